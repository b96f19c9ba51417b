//! Friction depends otherwise on slip speed: μ + slope · ω + stribeck · e^(−(ω/speed)²).
//!
//! `slope` is the gradient over the whole range of slip; a negative one excites judder. `stribeck` is what friction gains towards zero slip,
//! as in Stribeck's curve. Both add to the coefficient whatever the temperature; neither changes its level, which is another effect.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `slope` | change of the friction coefficient per slip speed | s/rad |
//! | `stribeck` | friction coefficient added at zero slip | 1 |
//! | `speed` | Stribeck speed | rad/s |
//! | ω | slip speed, ≥ 0 | rad/s |

use super::{Act, Effect, Parameters, Subsystem, param};

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Friction,
    amplitudes: &[param::friction_slip_gradient::slope, param::friction_slip_gradient::stribeck],
    act: Act::FrictionAdded(apply),
    starts: &[
        &[(param::friction_slip_gradient::slope, 0.0008)],
        &[(param::friction_slip_gradient::slope, -0.0008)],
        &[(param::friction_slip_gradient::stribeck, 0.08), (param::friction_slip_gradient::speed, 12.0)],
        &[(param::friction_slip_gradient::stribeck, -0.08), (param::friction_slip_gradient::speed, 12.0)],
        &[(param::friction_slip_gradient::stribeck, 0.08), (param::friction_slip_gradient::speed, 40.0)],
        &[(param::friction_slip_gradient::stribeck, -0.08), (param::friction_slip_gradient::speed, 40.0)],
    ],
    shown_by: "slip from high speed down to lock-up at constant position",
};

fn apply(p: &Parameters, omega: f64) -> f64 {
    let slow = omega / p[param::friction_slip_gradient::speed];
    p[param::friction_slip_gradient::slope] * omega + p[param::friction_slip_gradient::stribeck] * (-slow * slow).exp()
}
