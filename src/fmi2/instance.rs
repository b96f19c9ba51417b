//! One instance of a model, in safe Rust: values, life cycle, steps and saved states.

use super::call::CallState;
use super::log::{Category, Log};
use super::model::{Model, Registered};
use super::refusal::Refusal;
use super::types::Status;
use super::variables::{Causality, Description, Kind, Variability, Variable};
use super::words::{Reader, Words, Writer};
use crate::faults::Faults;
use crate::plant::pace::TooFast;
use crate::validated::Validated;
use std::ops::Range;

/// Longest communication step, s: it bounds the work of a call.
pub const LONGEST_STEP: f64 = 1000.0;

/// Rounding error allowed between the importer's clock and ours: a few units in the last place of the time, and a share of the step.
const CLOCK_ROUNDING: f64 = 8.0 * f64::EPSILON;
const CLOCK_SHARE_OF_STEP: f64 = 1e-4;

/// Longest piece of a step over which an input with a derivative is held, at its value in the middle of the piece, s.
const PIECE: f64 = 1e-3;

/// Largest number of inputs of any model.
const MOST_INPUTS: usize = 16;

/// The parts of an instance.
pub struct Parts {
    /// The model.
    pub registered: &'static Registered,
    /// Its start values.
    pub fresh: Box<[f64]>,
    /// Faults to be played.
    pub faults: Faults,
    /// Where a campaign has validated the plant, and how well its clutch torque is known there.
    pub validated: Option<Validated>,
}

/// An instance.
pub struct Instance {
    /// Its model description.
    pub description: &'static Description,
    /// State in the sequence of calls.
    pub call_state: CallState,
    /// Receives its messages.
    pub log: Log,
    model: Box<dyn Model>,
    /// Values after instantiation and reset.
    fresh: Box<[f64]>,
    faults: Faults,
    values: Box<[f64]>,
    /// Outputs before the last step, for recognising events.
    before: Box<[f64]>,
    /// Derivatives of the inputs in the next step, per second.
    slopes: Box<[f64]>,
    /// Values as they were last checked; `None` unless an importer has their address.
    checked: Option<Box<[f64]>>,
    /// Positions of the inputs and the outputs among the values.
    inputs: Range<usize>,
    outputs: Range<usize>,
    moving: RunState,
}

/// State of an instance in addition to its values and its model.
#[derive(Clone, Copy, Debug)]
struct RunState {
    /// End of the last step, s.
    time: f64,
    stop: f64,
    /// Whether an input has a derivative other than 0.
    sloped: bool,
    /// Whether values were set from which the model has not been started yet.
    stale: bool,
    /// Whether tunable parameters were set since the last step.
    tuned: bool,
}

const AT_REST: RunState = RunState { time: 0.0, stop: f64::MAX, sloped: false, stale: false, tuned: false };

impl Instance {
    /// A new instance.
    ///
    /// # Panics
    /// If the inputs do not come first, or are too many.
    pub fn from_parts(Parts { registered, fresh, faults, validated }: Parts, log: Log) -> Self {
        let variables = registered.description.variables;
        let range = |wanted: Causality| {
            let first = variables.iter().position(|v| v.causality == wanted).unwrap_or(0);
            first..variables.iter().rposition(|v| v.causality == wanted).map_or(0, |k| k + 1)
        };
        let (inputs, outputs) = (range(Causality::Input), range(Causality::Output));
        assert!(inputs.start == 0 && inputs.end <= MOST_INPUTS, "the inputs stand first");
        let (slopes, before) = (vec![0.0; inputs.len()].into(), vec![0.0; outputs.len()].into());
        let (description, mut model, values) = (registered.description, (registered.make)(), fresh.clone());
        model.take_faults(faults.clone());
        if let Some(validated) = validated {
            model.take_validated(validated, &fresh);
        }
        let call_state = CallState::Instantiated;
        let mut made = Self {
            description,
            call_state,
            log,
            model,
            fresh,
            faults,
            values,
            before,
            slopes,
            checked: None,
            inputs,
            outputs,
            moving: AT_REST,
        };
        made.reset();
        made
    }

    /// `fmi2SetupExperiment`.
    ///
    /// # Errors
    /// The times or the tolerance are not admissible.
    pub fn setup(&mut self, start: f64, stop: Option<f64>, tolerance: Option<f64>) -> Result<Status, Refusal> {
        if !start.is_finite() {
            return Err(Refusal::Argument("startTime", start, "not finite"));
        }
        if let Some(stop) = stop.filter(|stop| !(stop.is_finite() && *stop > start)) {
            return Err(Refusal::Argument("stopTime", stop, "not after startTime"));
        }
        if let Some(tolerance) = tolerance.filter(|t| !(t.is_finite() && *t >= 0.0)) {
            return Err(Refusal::Argument("tolerance", tolerance, "not a tolerance"));
        }
        (self.moving.time, self.moving.stop) = (start, stop.unwrap_or(f64::MAX));
        Ok(Status::Ok)
    }

    /// `fmi2ExitInitializationMode`.
    ///
    /// # Errors
    /// Parameters contradict each other; the instance then stays in initialization mode.
    pub fn exit_initialization(&mut self) -> Result<Status, Refusal> {
        self.refresh()?;
        self.moving.tuned = false;
        self.call_state = CallState::StepComplete;
        Ok(Status::Ok)
    }

    /// `fmi2Reset`: returns to the state after instantiation.
    pub fn reset(&mut self) {
        self.values.copy_from_slice(&self.fresh);
        // The start values agree with each other: those of the XML do, and a vehicle file is checked when it is read.
        self.moving = RunState { stale: self.model.start(&mut self.values).is_err(), ..AT_REST };
        self.slopes.fill(0.0);
        if let Some(checked) = &mut self.checked {
            checked.copy_from_slice(&self.values);
        }
        self.call_state = CallState::Instantiated;
    }

    /// Restarts the model if a value has been set since its last start, or written directly.
    fn refresh(&mut self) -> Result<(), Refusal> {
        self.check_direct_writes()?;
        if self.moving.stale {
            self.model.start(&mut self.values).map_err(Refusal::Parameters)?;
            self.moving.stale = false;
        }
        Ok(())
    }

    fn find(&self, reference: u32, kinds: &[Kind]) -> Result<(usize, &'static Variable), Refusal> {
        let index = self.description.find(reference).ok_or(Refusal::UnknownReference(reference))?;
        let variable = &self.description.variables[index];
        if kinds.contains(&variable.kind) { Ok((index, variable)) } else { Err(Refusal::WrongKind(variable)) }
    }

    /// Value of a variable of one of these kinds.
    ///
    /// # Errors
    /// There is no such variable, it is of another kind, or, in initialization mode, parameters contradict each other.
    #[inline]
    pub fn get(&mut self, reference: u32, kinds: &[Kind]) -> Result<f64, Refusal> {
        let (index, variable) = self.find(reference, kinds)?;
        if self.call_state == CallState::Initialization && variable.causality == Causality::Output {
            self.refresh()?;
        }
        Ok(self.values[index])
    }

    /// Sets all values, or none.
    ///
    /// # Errors
    /// The first variable or value that is refused.
    pub fn set(&mut self, kinds: &[Kind], pairs: impl Iterator<Item = (u32, f64)> + Clone) -> Result<Status, Refusal> {
        for (reference, value) in pairs.clone() {
            let (_, variable) = self.find(reference, kinds)?;
            self.check(variable, value)?;
        }
        let running = self.call_state == CallState::StepComplete;
        for (reference, value) in pairs {
            let (index, variable) = self.find(reference, kinds)?;
            self.values[index] = value;
            if let Some(checked) = &mut self.checked {
                checked[index] = value;
            }
            self.moving.tuned |= running && variable.causality == Causality::Parameter;
        }
        self.moving.stale |= !running;
        Ok(Status::Ok)
    }

    fn check(&self, variable: &'static Variable, value: f64) -> Result<(), Refusal> {
        let running = self.call_state == CallState::StepComplete;
        let settable = match variable.causality {
            Causality::Input => true,
            Causality::Parameter => !running || variable.variability == Variability::Tunable,
            Causality::Output | Causality::Local => false,
        };
        if !settable {
            return Err(Refusal::NotSettable(variable));
        }
        if variable.is_measurement() {
            return Ok(());
        }
        if !value.is_finite() {
            return Err(Refusal::NotFinite(variable, value));
        }
        if value < variable.min || value > variable.max {
            return Err(Refusal::OutOfBounds(variable, value));
        }
        match self.model.objection(variable, value) {
            Some(why) => Err(Refusal::Inadmissible(variable, value, why)),
            None => Ok(()),
        }
    }

    /// Sets derivatives of inputs, which apply to the next step: all of them, or none. Those of an order above 1 are ignored with a warning, because
    /// the standard gives an FMU no means to declare beforehand which orders it supports.
    ///
    /// # Errors
    /// A variable that is not a continuous input, an order below 1, or a derivative that is not finite.
    pub fn set_slopes(&mut self, triples: impl Iterator<Item = (u32, i32, f64)> + Clone) -> Result<Status, Refusal> {
        for (reference, order, value) in triples.clone() {
            let (_, variable) = self.find(reference, &[Kind::Real])?;
            if variable.causality != Causality::Input {
                return Err(Refusal::NotSettable(variable));
            }
            if order < 1 {
                return Err(Refusal::Argument("order", f64::from(order), "not an order of a derivative, which begin at 1"));
            }
            if !value.is_finite() {
                return Err(Refusal::NotFinite(variable, value));
            }
        }
        let mut status = Status::Ok;
        for (reference, order, value) in triples {
            let (index, variable) = self.find(reference, &[Kind::Real])?;
            if order == 1 {
                self.slopes[index - self.inputs.start] = value;
            } else {
                status = Status::Warning;
                let what =
                    format_args!("fmi2SetRealInputDerivatives: order {order} of {} is ignored, inputs follow order 1", variable.name);
                self.log.write(status, Category::Warning, what);
            }
        }
        self.moving.sloped = self.slopes.iter().any(|slope| *slope != 0.0);
        Ok(status)
    }

    /// `fmi2DoStep`.
    ///
    /// # Errors
    /// The step is not admissible, the plant is too fast to be followed, or the results are not finite.
    pub fn do_step(&mut self, point: f64, h: f64) -> Result<Status, Refusal> {
        let end = self.check_step(point, h)?;
        self.check_direct_writes()?;
        if self.moving.tuned {
            self.model.tune(&self.values)?;
            self.moving.tuned = false;
        }
        let logs_events = self.log.wants(Category::Events) || self.log.wants(Category::Warning);
        if logs_events {
            self.before.copy_from_slice(&self.values[self.outputs.clone()]);
        }
        let made = if self.moving.sloped { self.step_along_slopes(h) } else { self.model.step(&mut self.values, h) };
        if let Err(too_fast) = made {
            // A part of the step has been made, so that only a reset or a saved state makes the instance usable again.
            self.call_state = CallState::Failed;
            return Err(too_fast.into());
        }
        if let Some(place) = self.values[self.outputs.clone()].iter().position(|v| !v.is_finite()) {
            let index = self.outputs.start + place;
            self.call_state = CallState::Failed;
            return Err(Refusal::Diverged(&self.description.variables[index], self.values[index]));
        }
        // The importer's clock is authoritative: a clock of our own would drift from it by the sum of all rounding errors.
        self.moving.time = end;
        if logs_events {
            self.log_event(end);
        }
        Ok(Status::Ok)
    }

    fn log_event(&mut self, end: f64) {
        let was = |index: usize| self.before[index - self.outputs.start];
        if let Some(event) = self.model.event(&was, &self.values) {
            let (status, category) = if event.warning { (Status::Warning, Category::Warning) } else { (Status::Ok, Category::Events) };
            self.log.write(status, category, format_args!("step to {end:?} s: {}", event.what));
        }
    }

    /// Makes a step in pieces, each with the inputs at its middle, which is second-order accurate in the length of a piece.
    fn step_along_slopes(&mut self, h: f64) -> Result<(), TooFast> {
        let pieces = (h / PIECE * (1.0 - 1e-9)).ceil().max(1.0);
        let piece = h / pieces;
        let range = self.inputs.clone();
        let begin: [f64; MOST_INPUTS] = std::array::from_fn(|k| if k < range.len() { self.values[range.start + k] } else { 0.0 });
        for k in 0..pieces as u64 {
            for (input, index) in range.clone().enumerate() {
                let variable = &self.description.variables[index];
                let along = begin[input] + self.slopes[input] * (k as f64 + 0.5) * piece;
                self.values[index] = if variable.is_measurement() { along } else { along.clamp(variable.min, variable.max) };
            }
            self.model.step(&mut self.values, piece)?;
        }
        self.values[range.clone()].copy_from_slice(&begin[..range.len()]);
        self.slopes.fill(0.0);
        self.moving.sloped = false;
        Ok(())
    }

    /// The values, for a calibration tool that reads and writes them between calls.
    pub fn share_values(&mut self) -> &mut [f64] {
        self.checked = Some(self.values.clone());
        &mut self.values
    }

    /// Treats values that were written directly as if they had been set; a value that cannot be set is restored.
    pub fn check_direct_writes(&mut self) -> Result<(), Refusal> {
        let Some(mut checked) = self.checked.take() else { return Ok(()) };
        let mut outcome = Ok(());
        for (index, variable) in self.description.variables.iter().enumerate() {
            let value = self.values[index];
            if variable.causality == Causality::Output || value.to_bits() == checked[index].to_bits() {
                continue;
            }
            self.values[index] = checked[index];
            outcome = outcome.and(self.set(&[variable.kind], std::iter::once((variable.value_reference, value))).map(drop));
            checked[index] = self.values[index];
        }
        self.checked = Some(checked);
        outcome
    }

    /// End of the step, if the step is admissible.
    fn check_step(&self, point: f64, h: f64) -> Result<f64, Refusal> {
        if !point.is_finite() {
            return Err(Refusal::CommunicationPoint(point, self.moving.time));
        }
        let reason = match h {
            _ if !h.is_finite() => "not finite",
            _ if h <= 0.0 => "not positive",
            _ if h > LONGEST_STEP => "longer than 1000 s",
            _ => "",
        };
        if !reason.is_empty() {
            return Err(Refusal::StepSize(h, reason));
        }
        let time = self.moving.time;
        let tolerance = CLOCK_ROUNDING * time.abs().max(point.abs()) + CLOCK_SHARE_OF_STEP * h;
        if (point - time).abs() > tolerance {
            return Err(Refusal::CommunicationPoint(point, time));
        }
        let end = point + h;
        if end == point {
            return Err(Refusal::StepSize(h, "too short to move the clock"));
        }
        if end > self.moving.stop + tolerance {
            return Err(Refusal::BeyondStop(end, self.moving.stop));
        }
        Ok(end)
    }

    /// End of the last step that was completed, s.
    pub fn last_successful_time(&self) -> f64 {
        self.moving.time
    }

    /// Largest size of a saved state, in words.
    pub fn most_words(&self) -> usize {
        self.values.len() + self.slopes.len() + 8 + self.model.most_words()
    }

    /// Appends everything that determines the instance's further behaviour.
    pub fn save(&self, payload: &mut Vec<u64>) {
        let mut writer = Writer(payload);
        writer.choice(&mut self.call_state.clone(), |s| s as u64, &[]);
        walk_moving(&mut self.moving.clone(), &mut writer);
        for values in [&self.values, &self.slopes] {
            writer.0.extend(values.iter().map(|v| v.to_bits()));
        }
        self.model.save(&mut writer);
    }

    /// Restores what [`Instance::save`] appended, or what [`Instance::check_state`] has accepted.
    ///
    /// # Errors
    /// The words are not a state of this model; the instance must then be reset.
    pub fn load(&mut self, payload: &[u64]) -> Result<Status, Refusal> {
        self.read(Reader { words: payload, failed: false, foreign: false })
    }

    fn read(&mut self, mut reader: Reader) -> Result<Status, Refusal> {
        let mut number = 0;
        reader.word(&mut number, |n| CallState::from_number(n).is_some());
        walk_moving(&mut self.moving, &mut reader);
        let inputs = self.inputs.clone();
        self.values[inputs.clone()].iter_mut().for_each(|v| reader.any_real(v));
        reader.reals(&mut self.values[inputs.end..]);
        reader.reals(&mut self.slopes);
        if let Some(checked) = &mut self.checked {
            checked.copy_from_slice(&self.values);
        }
        self.model.load(&self.values, &mut reader);
        if reader.failed || !reader.words.is_empty() {
            self.call_state = CallState::Failed;
            return Err(Refusal::DamagedState("its content is no state of this model"));
        }
        self.call_state = CallState::from_number(number).unwrap_or(CallState::Failed);
        Ok(Status::Ok)
    }

    /// Whether [`Instance::load`] would accept this state, tried on a scratch instance.
    ///
    /// # Errors
    /// As [`Instance::load`].
    pub fn check_state(&self, payload: &[u64]) -> Result<Status, Refusal> {
        let registered = super::model::find(self.description.guid).ok_or(Refusal::Panic)?;
        let silent = Log::new(None, std::ptr::null_mut(), std::ffi::CString::default(), false);
        // What a campaign has found is not part of a state.
        let parts = Parts { registered, fresh: self.fresh.clone(), faults: self.faults.clone(), validated: None };
        let mut scratch = Self::from_parts(parts, silent);
        scratch.read(Reader { words: payload, failed: false, foreign: true })?;
        let sound = |(v, x): (&Variable, &f64)| v.is_measurement() || v.causality == Causality::Output || (*x >= v.min && *x <= v.max);
        if self.description.variables.iter().zip(&scratch.values).all(sound) {
            return Ok(Status::Ok);
        }
        Err(Refusal::DamagedState("its content is no state of this model"))
    }
}

fn walk_moving(moving: &mut RunState, words: &mut impl Words) {
    let RunState { time, stop, sloped, stale, tuned } = moving;
    words.real(time);
    words.real(stop);
    words.flag(sloped);
    words.flag(stale);
    words.flag(tuned);
}
