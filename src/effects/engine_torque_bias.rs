//! Reported torque is off by a constant, or by an accessory that takes power: T_e = T_report + torque − accessory_power / ω_f.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `torque` | bias of the report; a constant load is negative | N·m |
//! | `accessory_power` | power of a load that the report leaves out; below 50 rad/s its torque is constant | W |

use super::{Act, Constants, Effect, Parameters, Subsystem, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Engine,
    amplitudes: &[param::engine_torque_bias::torque, param::engine_torque_bias::accessory_power],
    act: Act::Constants(apply),
    starts: &[
        &[(param::engine_torque_bias::torque, 3.0)],
        &[(param::engine_torque_bias::torque, -3.0)],
        &[(param::engine_torque_bias::accessory_power, 500.0)],
    ],
    shown_by: "an open-clutch rev, where the engine balance stands alone",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.engine_bias += p[param::engine_torque_bias::torque];
    c.accessory_power += p[param::engine_torque_bias::accessory_power];
}
