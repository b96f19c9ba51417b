//! The cushion spring's force changes with temperature: F (1 + slope d + curvature d²), d = θ − 25 °C, never negative.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `slope` | relative change per kelvin | 1/K |
//! | `curvature` | quadratic relative change | 1/K² |

use super::{Act, Effect, Parameters, Subsystem, param};
use crate::physics::map::THETA_REFERENCE;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::ClutchForce,
    amplitudes: &[param::cushion_stiffness_thermal::slope, param::cushion_stiffness_thermal::curvature],
    act: Act::Force(apply),
    starts: &[&[(param::cushion_stiffness_thermal::slope, 0.002)], &[(param::cushion_stiffness_thermal::slope, -0.002)]],
    shown_by: "creep sweeps and launches, cold and hot",
};

fn apply(p: &Parameters, theta: f64) -> f64 {
    let d = theta - THETA_REFERENCE;
    (1.0 + d * (p[param::cushion_stiffness_thermal::slope] + d * p[param::cushion_stiffness_thermal::curvature])).max(0.0)
}
