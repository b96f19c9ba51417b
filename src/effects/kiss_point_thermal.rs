//! Contact point moves as the clutch heats: x_cnt + s, x_cls + closed_share · s, s = slope d + curvature d², d = θ − 25 °C.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `slope` | shift per kelvin | mm/K |
//! | `curvature` | quadratic shift | mm/K² |
//! | `closed_share` | share of the shift that applies to the closed point | 1 |

use super::{Act, Effect, Parameters, Subsystem, param};
use crate::physics::map::{Contact, THETA_REFERENCE};

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::ClutchForce,
    amplitudes: &[param::kiss_point_thermal::slope, param::kiss_point_thermal::curvature],
    act: Act::Contact(apply),
    starts: &[
        &[(param::kiss_point_thermal::slope, 0.002)],
        &[(param::kiss_point_thermal::slope, -0.002)],
        &[(param::kiss_point_thermal::slope, 0.002), (param::kiss_point_thermal::closed_share, 1.0)],
        &[(param::kiss_point_thermal::slope, -0.002), (param::kiss_point_thermal::closed_share, 1.0)],
    ],
    shown_by: "creep sweeps and launches, cold and hot",
};

fn apply(p: &Parameters, theta: f64, contact: &mut Contact) {
    let d = theta - THETA_REFERENCE;
    let shift = d * (p[param::kiss_point_thermal::slope] + d * p[param::kiss_point_thermal::curvature]);
    contact.x_cnt += shift;
    contact.x_cls += p[param::kiss_point_thermal::closed_share] * shift;
}
