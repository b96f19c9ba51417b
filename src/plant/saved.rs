//! Taking a plant out of its state and putting it back, for roll-back and for going on in another process.

use super::clutch::Found;
use super::config::Config;
use super::history::History;
use super::{Plant, State};
use crate::effects::Parameters;
use crate::vehicle::Vehicle;

impl Plant {
    /// The delay lines. With state, vehicle and effects they determine all that follows,
    /// bit for bit.
    pub fn history(&self) -> &History {
        &self.history
    }

    /// The delay lines, to be filled beside [`Plant::take_up`].
    pub fn history_mut(&mut self) -> &mut History {
        &mut self.history
    }

    /// Takes up a state that [`Plant::state`] gave, under the vehicle and effects that held then.
    pub fn take_up(&mut self, vehicle: &Vehicle, effects: &Parameters, state: &State) {
        if !equal(&self.config.parameters, effects) || self.config.vehicle != *vehicle {
            *self.config = Config::new(vehicle, effects);
            self.found = Found::NOTHING;
        }
        self.state = *state;
    }
}

/// Whether numbers are equal, all of them compared: nearly always they are, and without a way out in between the compiler takes several at a time.
pub fn equal(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).fold(true, |all, (a, b)| all & (a == b))
}
