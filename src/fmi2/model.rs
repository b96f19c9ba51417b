//! What the generic layer asks of a model.

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
    /// Takes the start state that inputs and parameters describe, and writes the outputs.
    ///
    /// # Errors
    /// Parameters that contradict each other.
    fn start(&mut self, values: &mut [f64]) -> Result<(), String>;

    /// Why a value within its bounds is impossible all the same.
    fn objection(&self, _variable: &Variable, _value: f64) -> Option<&'static str> {
        None
    }

    /// Takes tunable parameters that were changed.
    ///
    /// # Errors
    /// Parameters that make no plant; those before stay.
    fn tune(&mut self, values: &[f64]) -> Result<(), TooFast>;

    /// Takes faults to play, before the start; a model without effects has none.
    fn take_faults(&mut self, _faults: Faults) {}

    /// Takes what a campaign has found of the car that these values make, before the start; only a plant has use for it.
    fn take_validated(&mut self, _validated: Validated, _values: &[f64]) {}

    /// Advances by `h` seconds with the inputs held, and writes the outputs.
    ///
    /// # Errors
    /// Faults that make no plant; then the step ends where they begin.
    fn step(&mut self, values: &mut [f64], h: f64) -> Result<(), TooFast>;

    /// Appends the state.
    fn save(&self, to: &mut Writer);

    /// Takes a state that [`Model::save`] wrote, with the values that stood then.
    fn load(&mut self, values: &[f64], from: &mut Reader);

    /// Most words that [`Model::save`] appends.
    fn most_words(&self) -> usize;

    /// What happened in the last step that is worth a line in the log.
    /// `before` gives the outputs before it.
    fn event(&self, before: &dyn Fn(usize) -> f64, values: &[f64]) -> Option<Event>;
}

/// Something worth a line in the log.
pub struct Event {
    /// What.
    pub what: &'static str,
    /// An input is wrong: a warning.
    pub warning: bool,
}

/// A model by the GUID of one of its FMUs, whatever its start values.
pub fn find(guid: &str) -> Option<&'static Registered> {
    let (interface, tail) = guid.as_bytes().split_at_checked(guid::OF_INTERFACE)?;
    if guid.len() != guid::LENGTH || !tail.iter().all(|c| matches!(c, b'0'..=b'9' | b'a'..=b'f')) {
        return None;
    }
    MODELS.iter().find(|model| model.description.guid.as_bytes().starts_with(interface))
}

/// A model that this library holds.
pub struct Registered {
    /// Its variables.
    pub description: &'static Description,
    /// Makes one.
    pub make: fn() -> Box<dyn Model>,
}

/// All models in this library.
pub static MODELS: [Registered; 2] = [
    Registered { description: &super::plant::DESCRIPTION, make: super::plant::make },
    Registered { description: &super::controller::DESCRIPTION, make: super::controller::make },
];

/// Writes the vehicle's numbers and the effects' parameters into the values, as far as the model has them.
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

/// Reads the vehicle's numbers out of the values: both models give them the same references.
pub fn take_vehicle(description: &Description, values: &[f64]) -> Vehicle {
    let mut vehicle = Vehicle::paper();
    for number in &NUMBERS {
        if let Some(index) = description.find(number.value_reference) {
            *(number.get_mut)(&mut vehicle) = values[index];
        }
    }
    vehicle
}

/// Lock-up, break-away and contact, of two phases that follow each other.
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
