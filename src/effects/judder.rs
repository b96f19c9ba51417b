//! Torque pulsates with the slip angle: T (1 + (cosine · cos(n φ) + sine · sin(n φ)) / (1 + fading · ω²)).
//!
//! `fading` is 0 for a geometric pulsation, and 1/ω_h² for one whose amplitude has fallen to half at a slip of ω_h.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `cosine`, `sine` | relative amplitude in two phases | 1 |
//! | n, `order` | pulsations per revolution of slip: n φ is their phase, so n = 1 is once a turn | 1 |
//! | `fading` | see above | s²/rad² |
//! | φ | slip angle since the start | rad |
//! | ω | slip speed, ≥ 0 | rad/s |

use super::{Act, Effect, Parameters, Subsystem, param};

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Friction,
    amplitudes: &[param::judder::cosine, param::judder::sine],
    act: Act::Pulsation(apply),
    starts: &[&[(param::judder::cosine, 0.1), (param::judder::order, 4.0)]],
    shown_by: "slip at constant position, sampled fast",
};

fn apply(p: &Parameters, angle: f64, omega: f64) -> f64 {
    let (sin, cos) = (p[param::judder::order] * angle).sin_cos();
    1.0 + (p[param::judder::cosine] * cos + p[param::judder::sine] * sin) / (1.0 + p[param::judder::fading] * omega * omega)
}
