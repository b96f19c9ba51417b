//! Friction depends on slip speed in another way: μ + (slope · min(ω, reach) + stribeck · e^(−(ω/speed)^n)) · (1 − s + s μ/μ_r).
//!
//! `slope` is the gradient from zero slip up to a slip of `reach`, beyond which its contribution is constant; a negative one excites judder. `stribeck` is the increase of
//! friction towards zero slip, as in the Stribeck curve. The share s of both is proportional to the friction coefficient, which grows with temperature; the rest is independent
//! of temperature. The level of friction is an effect of its own.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `slope` | change of the friction coefficient per slip speed | s/rad |
//! | `reach` | slip speed up to which the gradient applies | rad/s |
//! | `stribeck` | friction coefficient added at zero slip | 1 |
//! | `speed` | Stribeck speed | rad/s |
//! | n | `exponent` of the Stribeck curve: 2 rounded, 1 exponential | 1 |
//! | s | `proportional_share` | 1 |
//! | μ_r | a typical friction coefficient, [`USUAL_MU`] | 1 |
//! | ω | slip speed, ≥ 0 | rad/s |

use super::{Act, Effect, Parameters, Subsystem, param};

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Friction,
    amplitudes: &[param::friction_slip_gradient::slope, param::friction_slip_gradient::stribeck],
    act: Act::FrictionAdded(apply),
    starts: &[
        &[(param::friction_slip_gradient::slope, 0.0008), (param::friction_slip_gradient::reach, 150.0)],
        &[(param::friction_slip_gradient::slope, -0.0008), (param::friction_slip_gradient::reach, 150.0)],
        &[(param::friction_slip_gradient::stribeck, 0.08), (param::friction_slip_gradient::speed, 12.0)],
        &[(param::friction_slip_gradient::stribeck, -0.08), (param::friction_slip_gradient::speed, 12.0)],
        &[(param::friction_slip_gradient::stribeck, 0.08), (param::friction_slip_gradient::speed, 40.0)],
        &[(param::friction_slip_gradient::stribeck, -0.08), (param::friction_slip_gradient::speed, 40.0)],
    ],
    shown_by: "slip from high speed down to lock-up at constant position",
};

/// Friction coefficient of the paper's facings at working temperature, at which the proportional and the constant share are equal.
const USUAL_MU: f64 = 0.3;

fn apply(p: &Parameters, omega: f64, mu: f64) -> f64 {
    use param::friction_slip_gradient::{exponent, proportional_share, reach, slope, speed, stribeck};
    let added = p[slope] * omega.min(p[reach]) + p[stribeck] * (-(omega / p[speed]).powf(p[exponent])).exp();
    added * (1.0 + p[proportional_share] * (mu / USUAL_MU - 1.0))
}
