//! Reported torque is off by a constant: T_e = T_report + torque.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | torque | accessory load (negative) or bias | N·m |

use super::{Act, Constants, Effect, Parameters, Subsystem, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Engine,
    amplitudes: &[param::engine_torque_bias::torque],
    act: Act::Constants(apply),
    starts: &[&[(param::engine_torque_bias::torque, 3.0)], &[(param::engine_torque_bias::torque, -3.0)]],
    shown_by: "an open-clutch rev, where the engine balance stands alone",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.engine_bias += p[param::engine_torque_bias::torque];
}
