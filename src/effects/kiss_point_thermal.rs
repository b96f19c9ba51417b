//! Contact point moves as the clutch heats: x_cnt + s, x_cls + closed_slope d, s = slope d + curvature d², d = θ − 25 °C.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `slope` | shift per kelvin | mm/K |
//! | `curvature` | quadratic shift | mm/K² |
//! | `closed_slope` | shift of the closed point per kelvin | mm/K |

use super::{Act, Effect, Parameters, Subsystem, param};
use crate::physics::map::{Contact, THETA_REFERENCE};

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::ClutchForce,
    amplitudes: &[param::kiss_point_thermal::slope, param::kiss_point_thermal::curvature, param::kiss_point_thermal::closed_slope],
    act: Act::Contact(apply),
    starts: &[
        &[(param::kiss_point_thermal::slope, 0.002)],
        &[(param::kiss_point_thermal::slope, -0.002)],
        &[(param::kiss_point_thermal::slope, 0.002), (param::kiss_point_thermal::closed_slope, 0.002)],
        &[(param::kiss_point_thermal::slope, -0.002), (param::kiss_point_thermal::closed_slope, -0.002)],
    ],
    shown_by: "creep sweeps and launches, cold and hot",
};

fn apply(p: &Parameters, theta: f64, contact: &mut Contact) {
    let d = theta - THETA_REFERENCE;
    let shift = d * (p[param::kiss_point_thermal::slope] + d * p[param::kiss_point_thermal::curvature]);
    contact.x_cnt += shift;
    contact.x_cls += p[param::kiss_point_thermal::closed_slope] * d;
}
