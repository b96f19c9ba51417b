//! What the vehicle is beyond its file: its load, and its inertia.
//!
//! Load observer: the torque that the driveline needs beyond what the vehicle file says – a grade, a trailer, and whatever the torque map
//! or the mass is off by.
//!
//! J_c ω̂̇ = T − b_c ω̂ − T_L(ω̂) − d̂ + …, d̂̇ = …, both corrected by the error of ω̂ with a double pole at −p (an observer of Luenberger
//! with the load as a constant state; in the sampled form of an α–β filter, which is stable at every step).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | T | clutch torque asked for, behind the model of the actuator and the filter of the speed | N·m |
//! | ω̂ | disc speed behind the same filter | rad/s |
//! | d̂ | load beyond the vehicle file's | N·m |
//! | p | bandwidth | 1/s |

use crate::physics::driveline::{self, Driveline};

/// State of the observer.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Load {
    /// ω̂, rad/s.
    pub omega: f64,
    /// d̂, N·m.
    pub torque: f64,
}

impl Load {
    /// Advances by `h` s a driveline of inertia `j` kg·m² with the filtered torque `t` in N·m and the filtered speed `omega` in rad/s; `most` bounds d̂ in N·m.
    #[inline]
    pub fn advance(&mut self, d: &Driveline, j: f64, t: f64, omega: f64, bandwidth: f64, most: f64, h: f64) {
        let slow = bandwidth * h / (1.0 + bandwidth * h);
        let predicted = self.omega + h * (t - driveline::resistance(d, self.omega, self.torque)) / j;
        let error = omega - predicted;
        self.omega = predicted + error * slow * (2.0 - slow);
        self.torque = (self.torque - j * error * slow * slow / h).clamp(-most, most);
    }
}

/// Inertia of the car over the vehicle file's, by least squares over an engagement: what is left of the torque, r = T − T_L(ω) − J_c ω̇, goes
/// with J_c ω̇ if the inertia is off, and is constant if the load is.
///
/// Sums of (J_c ω̇)², J_c ω̇, 1, J_c ω̇ r and r, each times the time over the residual's variance.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Inertia(pub [f64; 5]);

impl Inertia {
    /// Standard deviations of the inertia (relative) and the load (N·m) that are known before, and of the residual (N·m), which is
    /// independent after some time (s).
    const PRIOR: (f64, f64) = (0.2, 50.0);
    const RESIDUAL: f64 = 6.0;
    const INDEPENDENT_AFTER: f64 = 0.1;

    /// Takes in a sample of `h` s: `a` = J_c ω̇ and the residual `r`, N·m.
    #[inline]
    pub fn take(&mut self, a: f64, r: f64, h: f64) {
        let w = h / (Self::INDEPENDENT_AFTER * Self::RESIDUAL * Self::RESIDUAL);
        for (sum, x) in self.0.iter_mut().zip([a * a, a, 1.0, a * r, r]) {
            *sum += w * x;
        }
    }

    /// Inertia over the vehicle file's, between 0.6 and 1.6.
    #[inline]
    pub fn factor(&self) -> f64 {
        let [aa, a, one, ar, r] = self.0;
        let (p, q) = (aa + Self::PRIOR.0.powi(-2), one + Self::PRIOR.1.powi(-2));
        let determinant = p * q - a * a;
        if determinant > 0.0 { (1.0 + (ar * q - a * r) / determinant).clamp(0.6, 1.6) } else { 1.0 }
    }
}
