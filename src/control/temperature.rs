//! Estimate of disc and body temperature: paper eq. (6) with the observed torque, (5) while the clutch is open.
//!
//! The model is linear in both temperatures, so it is advanced exactly over a step of any length; its coefficients are derived
//! from [`thermal::single_rates`], which implements the equations.
//!
//! | symbol | meaning | unit | source |
//! |---|---|---|---|
//! | θ_c, θ_b | estimated temperature of disc and body | °C | eq. (6) |
//! | θ_h | housing air | °C | measured |
//! | P | friction power from the observed torque | W | T̂_fc ω_fc |

use super::held::Held;
use crate::physics::thermal::{self, Thermal};

/// Estimated temperatures, °C.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Temperatures {
    /// Disc.
    pub theta_c: f64,
    /// Body.
    pub theta_b: f64,
}

/// Thermal model with its exact solutions for the engaged and the open clutch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimator {
    thermal: Thermal,
    engaged: Held,
    open: Held,
}

impl Estimator {
    /// Model with the coefficients of `thermal`.
    pub fn new(thermal: &Thermal) -> Self {
        let system = |engaged: bool| {
            let (cc, bc) = thermal::single_rates(thermal, 1.0, 0.0, 0.0, engaged, 0.0);
            let (cb, bb) = thermal::single_rates(thermal, 0.0, 1.0, 0.0, engaged, 0.0);
            Held::new([[cc, cb], [bc, bb]])
        };
        Self { thermal: *thermal, engaged: system(true), open: system(false) }
    }

    /// Temperatures `h` seconds later with `theta_h` in °C and `power` in W held.
    #[inline]
    pub fn advance(&mut self, from: Temperatures, theta_h: f64, engaged: bool, power: f64, h: f64) -> Temperatures {
        let (c, b) = thermal::single_rates(&self.thermal, 0.0, 0.0, theta_h, engaged, power);
        let system = if engaged { &mut self.engaged } else { &mut self.open };
        let [theta_c, theta_b] = system.advance([from.theta_c, from.theta_b], [c, b], h);
        Temperatures { theta_c, theta_b }
    }
}
