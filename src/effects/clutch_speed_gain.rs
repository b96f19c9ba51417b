//! The disc speed is off by a factor: sensed ω_c = gain · ω_c.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `gain` | sensed over actual speed | 1 |

use super::{Act, Constants, Effect, Parameters, Subsystem, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Sensors,
    amplitudes: &[param::clutch_speed_gain::gain],
    act: Act::Constants(apply),
    starts: &[&[(param::clutch_speed_gain::gain, 1.02)], &[(param::clutch_speed_gain::gain, 0.98)]],
    shown_by: "a locked drive, where both speeds should agree",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.clutch_speed_gain *= p[param::clutch_speed_gain::gain];
}
