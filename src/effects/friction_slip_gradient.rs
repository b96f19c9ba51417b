//! Friction depends otherwise on slip speed: μ (1 + gradient · speed · (e^(−pivot/speed) − e^(−ω/speed))).
//!
//! A negative gradient is the negative slope that excites judder; a large `speed` makes it linear.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `gradient` | relative change per slip speed, near zero slip | s/rad |
//! | `speed` | slip speed over which the gradient fades | rad/s |
//! | `pivot` | slip speed at which friction is as nominal | rad/s |
//! | ω | slip speed, ≥ 0 | rad/s |

use super::{Act, Effect, Parameters, Subsystem, param};

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Friction,
    amplitudes: &[param::friction_slip_gradient::gradient],
    act: Act::Friction(apply),
    starts: &[
        &[
            (param::friction_slip_gradient::gradient, 0.003),
            (param::friction_slip_gradient::speed, 60.0),
            (param::friction_slip_gradient::pivot, 0.0),
        ],
        &[
            (param::friction_slip_gradient::gradient, -0.003),
            (param::friction_slip_gradient::speed, 60.0),
            (param::friction_slip_gradient::pivot, 0.0),
        ],
        &[
            (param::friction_slip_gradient::gradient, 0.003),
            (param::friction_slip_gradient::speed, 300.0),
            (param::friction_slip_gradient::pivot, 60.0),
        ],
        &[
            (param::friction_slip_gradient::gradient, -0.003),
            (param::friction_slip_gradient::speed, 300.0),
            (param::friction_slip_gradient::pivot, 60.0),
        ],
    ],
    shown_by: "slip from high speed down to lock-up at constant position",
};

fn apply(p: &Parameters, omega: f64, _: f64) -> f64 {
    let decay = |speed: f64| (-speed / p[param::friction_slip_gradient::speed]).exp();
    1.0 + p[param::friction_slip_gradient::gradient]
        * p[param::friction_slip_gradient::speed]
        * (decay(p[param::friction_slip_gradient::pivot]) - decay(omega))
}
