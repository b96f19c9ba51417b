//! Estimates of the clutch torque: the balances (8a), (8b) and the observer (9).
//!
//! (8a) T̂_fc = −J_f ω̇_f − b_f ω_f + T_e
//! (8b) T̂_fc = J_c ω̇_c + b_c ω_c + T_L
//! (9)  J_f ω̂̇_f = −b_f ω̂_f + T_e − T̂_fc + ℓ_1 (ω_f − ω̂_f), T̂̇_fc = ℓ_2 (ω_f − ω̂_f)
//!
//! | symbol | meaning | unit | source |
//! |---|---|---|---|
//! | ω_f, ω_c | speeds, hats for estimates | rad/s | eq. (8), (9) |
//! | T_e, T_L | engine torque, load torque | N·m | eq. (7) |
//! | ℓ_1, ℓ_2 | observer gains | N·m·s/rad, N·m/rad | Table I, read as 300 and −4252 |
//!
//! With the signs as printed the poles are +1601 and −14.1 1/s; with both signs reversed they are −1573 and −14.3 1/s. (8b) is printed with
//! −b_c ω_c, but follows from (7b) with a plus. (9) is discretised exactly, so the fast pole is stable at every step.

use super::held::Held;
use crate::physics::driveline::{self, Driveline};

/// Clutch torque in N·m by (8a): from the acceleration `omega_f_dot` in rad/s².
#[inline]
pub fn from_engine_balance(p: &Driveline, omega_f: f64, omega_f_dot: f64, t_e: f64) -> f64 {
    driveline::clutch_torque(p, t_e, omega_f, omega_f_dot)
}

/// Clutch torque in N·m by (8b), with the vehicle's load torque: from the acceleration `omega_c_dot` in rad/s².
#[inline]
pub fn from_driveline_balance(p: &Driveline, omega_c: f64, omega_c_dot: f64, t_load: f64) -> f64 {
    p.J_c * omega_c_dot + driveline::resistance(p, omega_c, t_load)
}

/// State of the observer (9).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Estimate {
    /// ω̂_f, rad/s.
    pub omega_f: f64,
    /// T̂_fc, N·m.
    pub t_fc: f64,
}

/// The observer (9) for one engine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observer {
    j_f: f64,
    l_1: f64,
    l_2: f64,
    lag: f64,
    system: Held,
}

impl Observer {
    /// Observer with the gains ℓ_1 ≥ 0 and ℓ_2 < 0, which make it stable.
    pub fn new(p: &Driveline, l_1: f64, l_2: f64) -> Self {
        let system = Held::new([[-(p.b_f + l_1) / p.J_f, -1.0 / p.J_f], [-l_2, 0.0]]);
        Self { j_f: p.J_f, l_1, l_2, lag: (p.b_f + l_1) / -l_2, system }
    }

    /// Time in s by which T̂_fc lags T_fc: (b_f + ℓ_1)/(−ℓ_2), the slow pole. T̂_fc + lag · T̂̇_fc does not lag, but is noisy;
    /// where it is integrated, as in (10), the noise averages out.
    pub fn lag(&self) -> f64 {
        self.lag
    }

    /// Estimate `h` seconds later with speed and torque held.
    #[inline]
    pub fn advance(&mut self, from: Estimate, omega_f: f64, t_e: f64, h: f64) -> Estimate {
        let input = [(t_e + self.l_1 * omega_f) / self.j_f, self.l_2 * omega_f];
        let [omega_f, t_fc] = self.system.advance([from.omega_f, from.t_fc], input, h);
        Estimate { omega_f, t_fc }
    }
}
