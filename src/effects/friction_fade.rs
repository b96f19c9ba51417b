//! Friction is lost above some temperature: μ (1 − depth · s), s = 1/(1 + e^(−4 (θ − onset)/width)).
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

fn apply(p: &Parameters, _: f64, theta: f64) -> f64 {
    let z = 4.0 * (theta - p[param::friction_fade::onset]) / p[param::friction_fade::width];
    1.0 - p[param::friction_fade::depth] / (1.0 + (-z).exp())
}
