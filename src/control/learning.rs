//! Learning of the torque map from launches: its touch point and its friction.
//!
//! While the clutch slips, the observed torque deviates from the map's by r = T̂_fc − T_map. To first order r = −K Δx + T_map Δμ, with K = dT/dx; least squares over a launch
//! with a prior gives both, and a share of them is adopted at lock-up.
//!
//! | symbol | meaning | unit | prior standard deviation |
//! |---|---|---|---|
//! | Δx | touch point minus the current estimate | mm | 0.3 |
//! | Δμ | friction over the current estimate, minus 1 | 1 | 0.2 |
//! | r | residual of the torque, with a standard deviation of 4 N·m, independent after 0.1 s | N·m | |
//!
//! If the touch point depends on temperature according to the vehicle file, the part of Δx that a temperature error of 30 K can explain corrects the estimated temperature
//! instead: a wear of 0.1 mm between two launches is rare.

use super::filter::Lags;
use super::settings::Settings;

/// Least and greatest learned touch point relative to the vehicle file's, mm.
pub const TOUCH_POINT: (f64, f64) = (-3.0, 3.0);
/// Least and greatest learned friction as a factor on the vehicle file's.
pub const FRICTION: (f64, f64) = (0.3, 3.0);
/// Greatest correction by one launch at a learning rate of 1: touch point in mm, and relative friction.
const STEP: (f64, f64) = (0.5, 0.3);
/// Greatest correction of the estimated temperature by one launch, K.
const TEMPERATURE_STEP: f64 = 50.0;

const PRIOR: (f64, f64) = (0.3, 0.2);
const RESIDUAL: f64 = 4.0;
const INDEPENDENT_AFTER: f64 = 0.1;
const TEMPERATURE: f64 = 30.0;
const WEAR: f64 = 0.1;

/// Torque in N·m below which a sample says nothing about the map.
const LEAST_TORQUE: f64 = 3.0;

/// Learned values, and the least-squares sums of the current launch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Learning {
    /// Learned touch point relative to the vehicle file's, mm.
    pub touch_point: f64,
    /// Learned friction as a factor on the vehicle file's.
    pub friction: f64,
    /// Torque of the map at the commanded position, behind the lags of actuator and observer, N·m.
    pub torque: Lags<3>,
    /// Slope of the map there, behind the same lags, N·m/mm.
    pub slope: Lags<3>,
    /// Sums of K², K T, T², K r, T r, each weighted with the sample time over the correlation time and variance of the residual.
    pub sums: [f64; 5],
}

impl Learning {
    /// Starts from what was learned before according to the settings.
    pub fn new(s: &Settings) -> Self {
        let (touch_point, friction) = (s.touch_point_offset_start, s.friction_factor_start);
        Self { touch_point, friction, torque: Lags::default(), slope: Lags::default(), sums: [0.0; 5] }
    }

    /// Begins a launch.
    pub fn begin(&mut self) {
        *self = Self { torque: Lags::default(), slope: Lags::default(), sums: [0.0; 5], ..*self };
    }

    /// Adds a sample of `h` s: the map's `torque` in N·m and `slope` in N·m/mm at the commanded position, and the `observed` torque in N·m; `shares` are those of the lags.
    #[inline]
    pub fn observe(&mut self, torque: f64, slope: f64, observed: f64, shares: [f64; 3], h: f64) {
        let (t, k) = (self.torque.advance(torque, shares), self.slope.advance(slope, shares));
        if t < LEAST_TORQUE && observed < LEAST_TORQUE {
            return;
        }
        let (r, w) = (observed - t, h / (INDEPENDENT_AFTER * RESIDUAL * RESIDUAL));
        for (sum, x) in self.sums.iter_mut().zip([k * k, k * t, t * t, k * r, t * r]) {
            *sum += w * x;
        }
    }

    /// Ends a launch that has locked and adopts its result. `per_kelvin` is the change of the touch point with temperature according to the vehicle file, mm/K. Returns the
    /// correction of the estimated temperature in K.
    pub fn conclude(&mut self, rate: f64, per_kelvin: f64) -> f64 {
        let [kk, kt, tt, kr, tr] = self.sums;
        let (a, b) = (kk + PRIOR.0.powi(-2), tt + PRIOR.1.powi(-2));
        let determinant = a * b - kt * kt;
        if determinant <= 0.0 {
            self.begin();
            return 0.0;
        }
        let touch_point = (-kr * b + kt * tr) / determinant;
        let friction = (a * tr - kt * kr) / determinant;
        let by_temperature = (per_kelvin * TEMPERATURE).powi(2) / ((per_kelvin * TEMPERATURE).powi(2) + WEAR * WEAR);
        let step = rate * touch_point.clamp(-STEP.0, STEP.0);
        self.touch_point = (self.touch_point + (1.0 - by_temperature) * step).clamp(TOUCH_POINT.0, TOUCH_POINT.1);
        self.friction = (self.friction * (1.0 + rate * friction.clamp(-STEP.1, STEP.1))).clamp(FRICTION.0, FRICTION.1);
        self.begin();
        if by_temperature > 0.0 { (by_temperature * step / per_kelvin).clamp(-TEMPERATURE_STEP, TEMPERATURE_STEP) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A launch whose true map is off by `x` mm and by the factor `mu`, observed without lag.
    fn launch(learning: &mut Learning, x: f64, mu: f64) {
        learning.begin();
        for k in 0..1000 {
            let torque = 0.08 * f64::from(k);
            let slope = 16.0 + torque;
            let (dx, factor) = (x - learning.touch_point, mu / learning.friction);
            learning.observe(torque, slope, factor * torque - slope * dx, [1.0; 3], 1e-3);
        }
        learning.conclude(0.5, 0.0);
    }

    #[test]
    fn both_are_learned_within_a_few_launches() {
        for (x, mu) in [(0.4, 1.0), (-0.4, 1.2), (0.0, 0.8)] {
            let mut learning = Learning::new(&Settings::robust());
            for _ in 0..10 {
                launch(&mut learning, x, mu);
            }
            assert!((learning.touch_point - x).abs() < 0.05 && (learning.friction - mu).abs() < 0.04, "{learning:?} for {x}, {mu}");
        }
    }

    #[test]
    fn a_touch_point_that_moves_with_temperature_corrects_the_temperature() {
        let mut learning = Learning::new(&Settings::robust());
        learning.observe(50.0, 60.0, 50.0, [1.0; 3], 1.0);
        learning.sums[3] = -0.3 * learning.sums[0];
        let kelvin = learning.conclude(1.0, -0.01);
        assert!(kelvin < -10.0 && learning.touch_point.abs() < 0.1, "{kelvin} K, {learning:?}");
    }

    /// A sample of 16 ms has a weight of 0.01 with a residual of 4 N·m that is independent after 0.1 s.
    #[test]
    fn samples_count_by_their_time_unless_there_is_no_torque() {
        let mut learning = Learning::new(&Settings::robust());
        learning.observe(10.0, 2.0, 13.0, [1.0; 3], 0.016);
        for (sum, expected) in learning.sums.into_iter().zip([0.04, 0.2, 1.0, 0.06, 0.3]) {
            assert!((sum - expected).abs() < 1e-12, "{sum} against {expected}");
        }
        let counts = |torque: f64, observed: f64| {
            let mut learning = Learning::new(&Settings::robust());
            learning.observe(torque, 2.0, observed, [1.0; 3], 0.016);
            learning.sums[0] > 0.0
        };
        assert!(!counts(2.9, 2.9) && counts(3.0, 0.0) && counts(0.0, 3.0));
    }

    /// r = −K Δx + T Δμ by least squares with the priors of 0.3 mm and 0.2: both normal equations hold.
    #[test]
    fn a_launch_is_weighed_against_what_was_known() {
        let concluded = |sums: [f64; 5], rate: f64| {
            let mut learning = Learning::new(&Settings::robust());
            let (touch_point, friction) = (learning.touch_point, learning.friction);
            learning.sums = sums;
            assert_eq!(learning.conclude(rate, 0.0), 0.0, "nothing is known of the temperature");
            assert_eq!(learning.sums, [0.0; 5], "the next launch begins anew");
            (learning.touch_point - touch_point, learning.friction / friction - 1.0)
        };
        let (a, b) = (30.0 + 1.0 / 0.09, 60.0 + 25.0);
        for (kt, kr, tr) in [(0.0, -5.0, 6.0), (20.0, -5.0, 6.0), (20.0, 4.0, -9.0)] {
            let found = concluded([30.0, kt, 60.0, kr, tr], 0.5);
            let (x, mu) = (found.0 / 0.5, found.1 / 0.5);
            assert!((a * x - kt * mu + kr).abs() < 1e-9 && (b * mu - kt * x - tr).abs() < 1e-9, "{x} mm and {mu}");
        }
        // No launch corrects by more than one step.
        assert!((concluded([1e3, 0.0, 0.0, -1e3, 0.0], 0.5).0 - 0.25).abs() < 1e-12);
        assert!((concluded([0.0, 0.0, 1e3, 0.0, 1e3], 0.5).1 - 0.15).abs() < 1e-12);
        // Inconsistent sums change nothing.
        assert_eq!(concluded([1.0, 1e3, 1.0, -5.0, 6.0], 0.5), (0.0, 0.0));
    }

    /// 30 K at 0.01 mm/K are 0.3 mm, against a wear of 0.1 mm: nine tenths are attributed to the temperature.
    #[test]
    fn temperature_takes_its_share_of_the_touch_point_and_no_more_than_its_step() {
        let mut learning = Learning::new(&Settings::robust());
        let before = learning.touch_point;
        // Exactly 0.2 mm: the sums outweigh the prior.
        learning.sums = [1e12, 0.0, 0.0, -0.2e12, 0.0];
        let kelvin = learning.conclude(1.0, -0.01);
        assert!((kelvin + 18.0).abs() < 1e-6 && (learning.touch_point - before - 0.02).abs() < 1e-9, "{kelvin} K, {learning:?}");
        learning.sums = [1e12, 0.0, 0.0, -0.5e12, 0.0];
        let kelvin = learning.conclude(1.0, 0.003);
        assert_eq!(kelvin, 50.0, "0.45 of 0.5 mm would be 74 K");
    }

    #[test]
    fn absurd_sums_stay_within_the_bounds() {
        let mut learning = Learning::new(&Settings::robust());
        for k in 0..100 {
            learning.sums = [1e9, 0.0, 1e9, if k % 7 == 0 { 1e15 } else { -1e15 }, 1e15];
            learning.conclude(1.0, 0.0);
            assert!(learning.touch_point.abs() <= 3.0 && (0.3..=3.0).contains(&learning.friction));
        }
    }
}
