//! Additional constant load: a grade, or rolling resistance.
//!
//! T = mgR/i · sin(arctan grade) + rolling_torque · tanh(ω_c/ω_L).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `grade` | tangent of the road's angle | 1 |
//! | `rolling_torque` | rolling resistance added | N·m |
//! | mgR/i | load torque of a vertical grade, `driveline.mgR_over_i` | N·m |

use super::{Act, Effect, Parameters, Subsystem, param};
use crate::physics::driveline;
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Driveline,
    amplitudes: &[param::road_load::grade, param::road_load::rolling_torque],
    act: Act::Load(apply),
    starts: &[&[(param::road_load::grade, 0.02)], &[(param::road_load::grade, -0.02)], &[(param::road_load::rolling_torque, 3.0)]],
    shown_by: "coasting and a locked drive",
};

fn apply(p: &Parameters, vehicle: &Vehicle, omega: f64) -> f64 {
    let grade = p[param::road_load::grade];
    let d = &vehicle.driveline;
    let rolling = p[param::road_load::rolling_torque];
    // Skips tanh for a drive that has only a grade, because every stage of every step evaluates this.
    let rolls = if rolling == 0.0 { 0.0 } else { rolling * driveline::tanh(omega / d.omega_L) };
    d.mgR_over_i * grade / (1.0 + grade * grade).sqrt() + rolls
}
