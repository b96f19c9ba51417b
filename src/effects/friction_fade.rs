//! Friction is lost above some temperature: μ (1 − depth · s), s = (p(z + k/2) − p(z − k/2))/k with z = k (θ − onset)/width, p(z) = ln(1 + e^z)
//! and k = 8: a ramp from 0 to 1 over `width` with rounded corners.
//!
//! A narrow `width` is a step, a wide one a slope.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `depth` | share lost when hot | 1 |
//! | `onset` | temperature at half of the depth | °C |
//! | `width` | temperature range of the loss | K |

use super::{Act, Effect, Parameters, Subsystem, param};

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Friction,
    amplitudes: &[param::friction_fade::depth],
    act: Act::Friction(apply),
    starts: &[
        &[(param::friction_fade::depth, 0.25), (param::friction_fade::onset, 110.0)],
        &[(param::friction_fade::depth, 0.25), (param::friction_fade::onset, 140.0)],
        &[(param::friction_fade::depth, 0.3), (param::friction_fade::onset, 120.0), (param::friction_fade::width, 100.0)],
    ],
    shown_by: "hot launches beside cold ones",
};

/// Sharpness of the ramp's corners: between that of a logistic step and of a broken line.
const SHARPNESS: f64 = 8.0;

fn apply(p: &Parameters, _: f64, theta: f64) -> f64 {
    let z = SHARPNESS * (theta - p[param::friction_fade::onset]) / p[param::friction_fade::width];
    let lost = (softplus(z + 0.5 * SHARPNESS) - softplus(z - 0.5 * SHARPNESS)) / SHARPNESS;
    1.0 - p[param::friction_fade::depth] * lost
}

/// ln(1 + e^z), without overflow.
fn softplus(z: f64) -> f64 {
    z.max(0.0) + (-z.abs()).exp().ln_1p()
}
