//! Torque builds up behind the report: T_e + τ Ṫ_e + κ τ² T̈_e = T_report.
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
    subsystem: Subsystem::Engine,
    amplitudes: &[param::engine_torque_lag::time_constant],
    act: Act::Constants(apply),
    starts: &[
        &[(param::engine_torque_lag::time_constant, 0.05)],
        &[(param::engine_torque_lag::time_constant, 0.15)],
        &[(param::engine_torque_lag::time_constant, 0.1), (param::engine_torque_lag::curvature, 0.25)],
    ],
    shown_by: "steps of the reported torque, clutch open or locked",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.engine_lag.time_constant = p[param::engine_torque_lag::time_constant];
    c.engine_lag.curvature = p[param::engine_torque_lag::curvature];
    c.engine_lag.asymmetry = p[param::engine_torque_lag::asymmetry];
}
