//! Friction depends on pressure: μ ((F² + F_0²)/(F_r² + F_0²))^(n/2), F_0 = 100 N.
//!
//! The torque of the facings then grows with F^(1 + n), as Rhee found for brake and clutch materials; F_0 keeps μ finite where the faces just touch.
//!
//! Source: Rhee, *Friction coefficient of automotive friction materials – its sensitivity to load, speed, and temperature*, SAE 740415, 1974.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | n, `exponent` | power of the force that μ follows; usually a little below 0 | 1 |
//! | F_r, `reference_force` | force at which μ is that of the map | N |

use super::{Act, Effect, Parameters, Subsystem, param};

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Friction,
    amplitudes: &[param::friction_pressure::exponent],
    act: Act::Pressure(apply),
    starts: &[&[(param::friction_pressure::exponent, -0.1)], &[(param::friction_pressure::exponent, 0.1)]],
    shown_by: "a creep sweep with a force sensor",
};

/// Force F_0 below which friction hardly changes any more, N.
const TOUCHING: f64 = 100.0;

fn apply(p: &Parameters, force: f64) -> f64 {
    let square = |f: f64| f * f + TOUCHING * TOUCHING;
    (square(force) / square(p[param::friction_pressure::reference_force])).powf(0.5 * p[param::friction_pressure::exponent])
}
