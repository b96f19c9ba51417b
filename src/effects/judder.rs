//! Torque pulsates with the slip angle: T (1 + cosine · cos(n φ) + sine · sin(n φ)).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `cosine`, `sine` | relative amplitude in two phases | 1 |
//! | n, `order` | pulsations per radian of slip angle | 1 |
//! | φ | slip angle since the start | rad |

use super::{Act, Effect, Parameters, Subsystem, param};

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Friction,
    amplitudes: &[param::judder::cosine, param::judder::sine],
    act: Act::Pulsation(apply),
    starts: &[&[(param::judder::cosine, 0.1), (param::judder::order, 1.02)]],
    shown_by: "slip at constant position, sampled fast",
};

fn apply(p: &Parameters, angle: f64) -> f64 {
    let (sin, cos) = (p[param::judder::order] * angle).sin_cos();
    1.0 + p[param::judder::cosine] * cos + p[param::judder::sine] * sin
}
