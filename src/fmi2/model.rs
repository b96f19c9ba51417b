//! The interface between the generic layer and a model.

use super::guid;
use super::variables::{Description, Variable};
use super::words::{Reader, Writer};
use crate::effects::{PARAMETERS, Parameters};
use crate::faults::Faults;
use crate::plant::pace::TooFast;
use crate::validated::Validated;
use crate::vehicle::{NUMBERS, Vehicle};

/// A model behind an FMU. `values` hold every variable in the order of the model description; a model reads inputs and parameters
/// there, and writes its outputs.
pub trait Model: Send {
    /// Starts from the state that inputs and parameters describe, and writes the outputs.
    ///
    /// # Errors
    /// Parameters that contradict each other.
    fn start(&mut self, values: &mut [f64]) -> Result<(), String>;

    /// Why a value is inadmissible although it is within its bounds.
    fn objection(&self, _variable: &Variable, _value: f64) -> Option<&'static str> {
        None
    }

    /// Applies tunable parameters that have changed.
    ///
    /// # Errors
    /// The plant would be too fast to be followed; the previous parameters stay in effect.
    fn tune(&mut self, values: &[f64]) -> Result<(), TooFast>;

    /// Sets the faults to be played, before the start; a model without effects has none.
    fn take_faults(&mut self, _faults: Faults) {}

    /// Sets what a campaign has found of the car that these values describe, before the start; only a plant uses it.
    fn take_validated(&mut self, _validated: Validated, _values: &[f64]) {}

    /// Advances by `h` seconds with the inputs held, and writes the outputs.
    ///
    /// # Errors
    /// Faults make the plant too fast to be followed; the step then ends where they begin.
    fn step(&mut self, values: &mut [f64], h: f64) -> Result<(), TooFast>;

    /// Appends the state.
    fn save(&self, to: &mut Writer);

    /// Restores a state that [`Model::save`] wrote, with the values of that time.
    fn load(&mut self, values: &[f64], from: &mut Reader);

    /// Largest number of words that [`Model::save`] appends.
    fn most_words(&self) -> usize;

    /// An event in the last step that is worth a line in the log. `before` returns the outputs before the step.
    fn event(&self, before: &dyn Fn(usize) -> f64, values: &[f64]) -> Option<Event>;
}

/// Something worth a line in the log.
pub struct Event {
    /// Description of the event.
    pub what: &'static str,
    /// Whether it is a warning: an input is implausible.
    pub warning: bool,
}

/// The model to which an FMU's GUID belongs, whatever the FMU's start values.
pub fn find(guid: &str) -> Option<&'static Registered> {
    let (interface, tail) = guid.as_bytes().split_at_checked(guid::OF_INTERFACE)?;
    if guid.len() != guid::LENGTH || !tail.iter().all(|c| matches!(c, b'0'..=b'9' | b'a'..=b'f')) {
        return None;
    }
    MODELS.iter().find(|model| model.description.guid.as_bytes().starts_with(interface))
}

/// A model that this library holds.
pub struct Registered {
    /// Its model description.
    pub description: &'static Description,
    /// Creates one.
    pub make: fn() -> Box<dyn Model>,
}

/// All models in this library.
pub static MODELS: [Registered; 2] = [
    Registered { description: &super::plant::DESCRIPTION, make: super::plant::make },
    Registered { description: &super::controller::DESCRIPTION, make: super::controller::make },
];

/// Writes the vehicle's numbers and the effects' parameters into the values, as far as the model has variables for them.
pub fn put_vehicle(description: &Description, vehicle: &Vehicle, effects: &Parameters, values: &mut [f64]) {
    let effects = PARAMETERS.iter().zip(effects).map(|(p, value)| (p.value_reference, p.variable, *value));
    let numbers = NUMBERS.iter().map(|n| (n.value_reference, n.name, (n.get)(vehicle)));
    for (reference, name, value) in effects.chain(numbers) {
        if let Some(index) = description.find(reference) {
            debug_assert_eq!(description.variables[index].name, name, "both models give a number the same reference");
            values[index] = value;
        }
    }
}

/// Reads the vehicle's numbers from the values. Both models give them the same value references.
pub fn take_vehicle(description: &Description, values: &[f64]) -> Vehicle {
    let mut vehicle = Vehicle::paper();
    for number in &NUMBERS {
        if let Some(index) = description.find(number.value_reference) {
            *(number.get_mut)(&mut vehicle) = values[index];
        }
    }
    vehicle
}

/// The event between two consecutive phases, if they differ: lock-up, break-away, contact or opening.
pub fn phase_event(before: f64, now: f64) -> Option<Event> {
    let what = match (before as u8, now as u8) {
        (a, b) if a == b => return None,
        (_, 3) => "locked",
        (3, 2) => "broke away: the clutch slips",
        (_, 2) => "contact: the clutch slips",
        _ => "open: no contact",
    };
    Some(Event { what, warning: false })
}
