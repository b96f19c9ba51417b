//! Reported torque is off by a factor: T_e = gain · T_report.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | gain | torque delivered over torque reported | 1 |

use super::{Act, Constants, Effect, Parameters, Subsystem, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Engine,
    amplitudes: &[param::engine_torque_gain::gain],
    act: Act::Constants(apply),
    starts: &[&[(param::engine_torque_gain::gain, 1.06)], &[(param::engine_torque_gain::gain, 0.94)]],
    shown_by: "an open-clutch rev with several torque levels",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.engine_gain *= p[param::engine_torque_gain::gain];
}
