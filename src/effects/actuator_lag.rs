//! Finite bandwidth of the bearing: x + τ ẋ + κ τ² ẍ = x_cmd.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | τ, `time_constant` | time constant | s |
//! | κ, `curvature` | second-order share | 1 |
//! | a, `asymmetry` | τ is (1 + a) times as long upwards and (1 − a) times downwards | 1 |

use super::{Act, Constants, Effect, Parameters, Subsystem, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Actuator,
    amplitudes: &[param::actuator_lag::time_constant],
    act: Act::Constants(apply),
    starts: &[
        &[(param::actuator_lag::time_constant, 0.03)],
        &[(param::actuator_lag::time_constant, 0.1)],
        &[(param::actuator_lag::time_constant, 0.06), (param::actuator_lag::curvature, 0.25)],
    ],
    shown_by: "a position chirp, or the bearing position sensor",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.actuator_lag.time_constant = p[param::actuator_lag::time_constant];
    c.actuator_lag.curvature = p[param::actuator_lag::curvature];
    c.actuator_lag.asymmetry = p[param::actuator_lag::asymmetry];
}
