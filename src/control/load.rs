//! Estimates of what the vehicle file does not know: additional load, and inertia.
//!
//! Load observer: estimates the torque that the driveline needs beyond the vehicle file's – a grade, a trailer, and the errors of torque map and mass.
//!
//! J_c ω̂̇ = T − b_c ω̂ − T_L(ω̂) − d̂ + …, d̂̇ = …, both corrected by the error of ω̂ with a double pole at −p (a Luenberger observer with the load as a constant state, in
//! the sampled form of an α–β filter, which is stable at every step).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | T | requested clutch torque, behind the model of the actuator and the filter of the speed | N·m |
//! | ω̂ | disc speed behind the same filter | rad/s |
//! | d̂ | load in addition to the vehicle file's | N·m |
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
    /// Advances the observer by `h` s for a driveline of inertia `j` kg·m², with the filtered torque `t` in N·m and the filtered speed `omega` in rad/s; `most` bounds d̂ in
    /// N·m.
    #[expect(clippy::too_many_arguments, reason = "one for each quantity of the equation")]
    #[inline]
    pub fn advance(&mut self, d: &Driveline, j: f64, t: f64, omega: f64, bandwidth: f64, most: f64, h: f64) {
        let slow = bandwidth * h / (1.0 + bandwidth * h);
        let predicted = self.omega + h * (t - driveline::resistance(d, self.omega, self.torque)) / j;
        let error = omega - predicted;
        self.omega = predicted + error * slow * (2.0 - slow);
        self.torque = (self.torque - j * error * slow * slow / h).clamp(-most, most);
    }
}

/// Inertia of the car relative to the vehicle file's, by least squares over an engagement: the residual torque r = T − T_L(ω) − J_c ω̇ is proportional to J_c ω̇ if the inertia
/// is wrong, and constant if the load is.
///
/// Sums of (J_c ω̇)², J_c ω̇, 1, J_c ω̇ r and r, each weighted with the sample time over the correlation time and variance of the residual.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Inertia(pub [f64; 5]);

impl Inertia {
    /// Prior standard deviations of inertia (relative) and load (N·m), standard deviation of the residual (N·m), and the time after which the residual is independent (s).
    const PRIOR: (f64, f64) = (0.2, 50.0);
    const RESIDUAL: f64 = 6.0;
    const INDEPENDENT_AFTER: f64 = 0.1;

    /// Adds a sample of `h` s: `a` = J_c ω̇ and the residual `r`, N·m.
    #[inline]
    pub fn take(&mut self, a: f64, r: f64, h: f64) {
        let w = h / (Self::INDEPENDENT_AFTER * Self::RESIDUAL * Self::RESIDUAL);
        for (sum, x) in self.0.iter_mut().zip([a * a, a, 1.0, a * r, r]) {
            *sum += w * x;
        }
    }

    /// Estimated inertia over the vehicle file's, between 0.6 and 1.6.
    #[inline]
    pub fn factor(&self) -> f64 {
        let [aa, a, one, ar, r] = self.0;
        let (p, q) = (aa + Self::PRIOR.0.powi(-2), one + Self::PRIOR.1.powi(-2));
        let determinant = p * q - a * a;
        if determinant > 0.0 { (1.0 + (ar * q - a * r) / determinant).clamp(0.6, 1.6) } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A driveline without resistance of its own, 0.5 kg·m² turning at 40 rad/s.
    fn free() -> (Driveline, f64) {
        (Driveline { omega_L: 1.0, ..Driveline::default() }, 0.5)
    }

    /// With a double pole at −p, a load step d is estimated as d (1 − (1 + p t) e^(−p t)).
    #[test]
    fn a_load_that_begins_is_found_at_the_bandwidth() {
        let ((d, j), h, p) = (free(), 1e-5, 10.0);
        let (carried, load) = (30.0, 12.0);
        let mut observer = Load { omega: 40.0, torque: 0.0 };
        for k in 1..=30_000_u32 {
            let t = f64::from(k) * h;
            let speed = 40.0 + (carried - load) / j * t;
            observer.advance(&d, j, carried, speed, p, 100.0, h);
            if k % 5_000 == 0 {
                let found = load * (1.0 - (1.0 + p * t) * (-p * t).exp());
                assert!((observer.torque - found).abs() < 2e-3, "{} against {found} N·m at {t} s", observer.torque);
                // The model, which does not know the whole load yet, is ahead by d t e^(−p t)/J.
                let ahead = load * t * (-p * t).exp() / j;
                assert!((observer.omega - speed - ahead).abs() < 2e-3, "{} against {speed} + {ahead} rad/s", observer.omega);
            }
        }
        (0..200_000).for_each(|k| observer.advance(&d, j, carried, 40.0 + 36.0 * (0.3 + f64::from(k + 1) * h), p, 10.0, h));
        assert_eq!(observer.torque, 10.0, "bounded");
    }

    #[test]
    fn what_the_vehicle_file_knows_is_no_load() {
        let d = Driveline { T_L0: 8.0, omega_L: 0.5, b_c: 0.1, k_L: 1e-3, ..Driveline::default() };
        let held = 8.0 + 0.1 * 40.0 + 1e-3 * 1600.0;
        let mut observer = Load { omega: 40.0, torque: 0.0 };
        (0..1000).for_each(|_| observer.advance(&d, 0.5, held, 40.0, 5.0, 100.0, 1e-3));
        assert!(observer.torque.abs() < 1e-9 && (observer.omega - 40.0).abs() < 1e-9, "{observer:?}");
    }

    #[test]
    fn inertia_and_load_are_told_apart_by_the_acceleration() {
        for (factor, load, found) in [(1.3, 20.0, 1.3), (0.8, -15.0, 0.8), (1.0, 40.0, 1.0), (2.5, 0.0, 1.6), (0.2, 5.0, 0.6)] {
            let mut inertia = Inertia::default();
            // r = (m − 1) a + d, for so long that the prior is negligible.
            (0..10).for_each(|k| inertia.take(10.0 + 5.0 * f64::from(k), (factor - 1.0) * (10.0 + 5.0 * f64::from(k)) + load, 1e8));
            assert!((inertia.factor() - found).abs() < 1e-6, "{} against {found}", inertia.factor());
        }
        assert_eq!(Inertia::default().factor(), 1.0);
    }

    /// Two samples of 0.36 s have a weight of 0.1 each. With a = ±20 and r = ±6 the load estimate is zero, so x (2 · 0.1 · 400 + 1/0.2²) = 2 · 0.1 · 120.
    #[test]
    fn a_few_samples_of_inertia_are_weighed_against_what_was_known() {
        let mut inertia = Inertia::default();
        inertia.take(20.0, 6.0, 0.36);
        inertia.take(-20.0, -6.0, 0.36);
        assert!((inertia.factor() - (1.0 + 24.0 / 105.0)).abs() < 1e-12, "{}", inertia.factor());
        // One sample with an acceleration of 0 informs about the load alone.
        let mut still = Inertia::default();
        still.take(0.0, 6.0, 0.36);
        assert_eq!(still.factor(), 1.0);
        // x a + d = r with a = 20, r = 6: by Cramer's rule of (0.1 · 400 + 25, 2; 2, 0.1 + 1/50²) and (12, 0.6).
        let mut one = Inertia::default();
        one.take(20.0, 6.0, 0.36);
        let expected = (12.0 * 0.1004 - 2.0 * 0.6) / (65.0 * 0.1004 - 4.0);
        assert!((one.factor() - 1.0 - expected).abs() < 1e-12, "{}", one.factor());
    }
}
