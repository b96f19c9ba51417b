//! The detection limit: how large an effect has to be for recordings to show it.
//!
//! Along one start of an effect, let f be the size of the effect in units of that start, and I the information of the recordings on f once all nuisances are eliminated
//! (Cramér–Rao: no unbiased estimate of f has a variance below 1/I). The negative gradient g of half the cost at f = 0 is then normal with mean I f and variance I. With the
//! prior's precision of one, H = 1 + I, and the log odds of the effect against none are those of the search,
//!
//! ```text
//! L(g) = ½ g²/H − ½ ln H + ln odds + ln m − 0.01/m,   m = r² (g²/H² + 1/H),
//! ```
//!
//! where r is the start in units of a noticeable effect. The terms are those of evidence, look-elsewhere price, prior odds and moment prior (`infer/prior.rs`). An effect is found
//! where L > 0, which is where |g| > g*. This happens with the probability Φ((I f − g*)/√I) + Φ((−I f − g*)/√I), and the limit is the size that is found with probability
//! [`POWER`].

use super::prior::{log_prior, moment};

/// Probability with which an effect of the size of the limit is found, as usual for a limit of detection (ISO 11843-1).
pub const POWER: f64 = 0.95;

/// Information of recordings along one start of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Visibility {
    /// Information on the size in units of the start, nuisances eliminated, without the prior.
    pub information: f64,
    /// The start in units of a noticeable effect.
    pub relative: f64,
}

impl Visibility {
    fn log_odds(self, g: f64) -> f64 {
        let h = 1.0 + self.information;
        let square = self.relative.powi(2) * ((g / h).powi(2) + 1.0 / h);
        0.5 * g * g / h - 0.5 * h.ln() + log_prior(1) + moment(square)
    }

    /// Threshold g* of |g| above which the effect is found.
    fn threshold(self) -> f64 {
        // The log odds grow with |g|, so that their zero is bracketed and bisected.
        let (mut low, mut high) = (0.0, (1.0 + self.information).sqrt());
        while self.log_odds(high) < 0.0 {
            (low, high) = (high, 2.0 * high);
        }
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.log_odds(middle) < 0.0 { low = middle } else { high = middle }
        }
        high
    }

    /// Probability that an effect of this size, in units of the start, is found.
    pub fn power(self, size: f64) -> f64 {
        let root = self.information.sqrt().max(f64::MIN_POSITIVE);
        let threshold = self.threshold();
        normal((self.information * size - threshold) / root) + normal((-self.information * size - threshold) / root)
    }

    /// The limit in units of the start; infinite where there is no information.
    pub fn limit(self) -> f64 {
        if self.information <= 0.0 {
            return f64::INFINITY;
        }
        (self.threshold() + Z_POWER * self.information.sqrt()) / self.information
    }
}

/// Standard normal quantile of [`POWER`].
const Z_POWER: f64 = 1.644_853_626_951_472_2;

/// Standard normal distribution function.
pub fn normal(z: f64) -> f64 {
    0.5 * libm::erfc(-z / std::f64::consts::SQRT_2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_is_found_as_often_as_it_says() {
        for information in [0.5, 10.0, 400.0, 1e5] {
            let v = Visibility { information, relative: 1.0 };
            assert!((v.power(v.limit()) - POWER).abs() < 1e-6, "{information}: {}", v.power(v.limit()));
            assert!(v.power(0.5 * v.limit()) < v.power(v.limit()) && v.power(4.0 * v.limit()) > 0.999);
        }
        assert_eq!(Visibility { information: 0.0, relative: 1.0 }.limit(), f64::INFINITY);
    }

    /// Comparison with drawn gradients, which are judged by the log odds themselves.
    #[test]
    fn the_power_is_the_share_of_drawn_cars_that_are_found() {
        let v = Visibility { information: 200.0, relative: 0.8 };
        let mut seed = 5_u64;
        let mut uniform = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((seed >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
        };
        for share in [0.5, 0.8, 1.0] {
            let size = share * v.limit();
            let found = (0..20_000).filter(|_| {
                let z = (-2.0 * uniform().ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos();
                v.log_odds(v.information * size + v.information.sqrt() * z) > 0.0
            });
            let share_found = found.count() as f64 / 20_000.0;
            assert!((share_found - v.power(size)).abs() < 0.012, "{share}: {share_found} {}", v.power(size));
        }
    }

    #[test]
    fn more_information_shows_smaller_effects() {
        let limit = |information| Visibility { information, relative: 1.0 }.limit();
        assert!(limit(400.0) < 0.6 * limit(100.0) && limit(100.0) < limit(90.0));
    }
}
