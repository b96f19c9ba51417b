//! Why a call was refused. Refusing a value or a step and printing the reason allocates nothing, so that a bench is not disturbed by a bad value.

use super::call::CallState;
use super::types::Status;
use super::variables::{Causality, Variable};
use crate::plant::pace::TooFast;
use std::fmt;

/// Why a call was refused; the message is what the importer's log shows.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum Refusal {
    #[error("not allowed in state {0:?}; see the state table of FMI 2.0 co-simulation")]
    CallSequence(CallState),
    #[error("argument {0} is NULL")]
    Null(&'static str),
    #[error("argument {} = {} is {}", .0, number(.1), .2)]
    Argument(&'static str, f64, &'static str),
    #[error("argument {0} does not point to memory of its type")]
    Pointer(&'static str),
    #[error("no variable has value reference {0}; see modelDescription.xml")]
    UnknownReference(u32),
    #[error("variable {} is a {:?}; use the function of that type", .0.name, .0.kind)]
    WrongKind(&'static Variable),
    #[error("{} cannot be set now: it is {}", .0.name, settability(.0))]
    NotSettable(&'static Variable),
    #[error("{} = {} {} is not finite; the value before stays", .0.name, number(.1), .0.unit)]
    NotFinite(&'static Variable, f64),
    #[error("{} = {} {} is outside {} to {}; the value before stays", .0.name, number(.1), .0.unit, number(&.0.min), number(&.0.max))]
    OutOfBounds(&'static Variable, f64),
    #[error("{} = {} {} {}; the value before stays", .0.name, number(.1), .0.unit, .2)]
    Inadmissible(&'static Variable, f64, &'static str),
    #[error("communicationStepSize = {} s is {}; the step was not made", number(.0), .1)]
    StepSize(f64, &'static str),
    #[error("currentCommunicationPoint = {} s is not where the last step ended, {} s; the step was not made", number(.0), number(.1))]
    CommunicationPoint(f64, f64),
    #[error("the step to {} s passes stopTime = {} s; the step was not made", number(.0), number(.1))]
    BeyondStop(f64, f64),
    #[error("{} = {} after the step is no number: with these parameters and inputs the plant runs away; reset, or set a saved state", .0.name, number(.1))]
    Diverged(&'static Variable, f64),
    #[error("parameters contradict each other: {0}")]
    Parameters(String),
    #[error("{0}; the step was not made, set other values")]
    TooFast(#[from] TooFast),
    #[error("the FMU state is damaged: {0}")]
    DamagedState(&'static str),
    #[error("log category \"{0}\" is unknown; see LogCategories in modelDescription.xml")]
    UnknownCategory(String),
    #[error("{0}")]
    NotOffered(&'static str),
    #[error("{0}")]
    NothingToReport(&'static str),
    #[error("internal error, please report it; reset, or set a saved state")]
    Panic,
}

impl Refusal {
    /// Status that the importer gets.
    pub fn status(&self) -> Status {
        if matches!(self, Self::NothingToReport(_)) { Status::Discard } else { Status::Error }
    }
}

fn settability(variable: &Variable) -> impl fmt::Display + use<> {
    match variable.causality {
        Causality::Parameter => "a fixed parameter, settable before initialization ends",
        Causality::Output => "an output",
        Causality::Local | Causality::Input => "calculated",
    }
}

/// Formats a number with as few digits as identify it: 5e-324 rather than 324 digits. NaN is not compared with anything, because an importer may trap that.
fn number(value: &f64) -> impl fmt::Display {
    struct Number(f64);
    impl fmt::Display for Number {
        fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
            if self.0.is_finite() { write!(f, "{:?}", self.0) } else { write!(f, "{}", self.0) }
        }
    }
    Number(*value)
}
