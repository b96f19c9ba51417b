//! Saving and restoring the state of a plant, for roll-back and for continuing in another process.

use super::clutch::FaceCache;
use super::config::Config;
use super::history::History;
use super::{Plant, State};
use crate::effects::Parameters;
use crate::vehicle::Vehicle;

impl Plant {
    /// The delay lines. Together with state, vehicle and effects they determine all that follows, bit for bit.
    pub fn history(&self) -> &History {
        &self.history
    }

    /// The delay lines, to be restored together with [`Plant::take_up`].
    pub fn history_mut(&mut self) -> &mut History {
        &mut self.history
    }

    /// Restores a state from [`Plant::state`], under the vehicle and effects that applied then.
    pub fn take_up(&mut self, vehicle: &Vehicle, effects: &Parameters, state: &State) {
        if !equal(&self.config.parameters, effects) || self.config.vehicle != *vehicle {
            *self.config = Config::new(vehicle, effects);
            self.found = FaceCache::EMPTY;
        }
        self.state = *state;
    }
}

/// Whether two slices of numbers are equal. All of them are compared without an early exit: they are nearly always equal, and the compiler can then compare several at a time.
pub fn equal(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).fold(true, |all, (a, b)| all & (a == b))
}
