//! Proportional-integral controller with feedforward, limits and anti-windup: u = sat(k_P e + I + u_0), İ = k_I e.
//!
//! | symbol | meaning |
//! |---|---|
//! | e | error: reference minus measurement |
//! | u_0 | what another path contributes to the same output (decoupling) |
//! | I | integral part, in the unit of u |
//!
//! The integral is held while the output is at a limit and the error pushes further, and never exceeds the range that the limits leave.

/// Gains of one controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// k_P.
    pub p: f64,
    /// k_I, per second.
    pub i: f64,
}

/// Least and greatest output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Least output.
    pub low: f64,
    /// Greatest output.
    pub high: f64,
}

impl Limits {
    /// `x` within the limits; the upper one wins if they cross.
    #[inline]
    pub fn bound(self, x: f64) -> f64 {
        x.max(self.low).min(self.high)
    }
}

/// The integral part.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Pi {
    /// I, in the unit of the output.
    pub integral: f64,
}

impl Pi {
    /// Advances the integral by `h` seconds and returns the output for the error `e` and the feedforward `u_0`.
    #[inline]
    pub fn step(&mut self, gains: Gains, e: f64, u_0: f64, limits: Limits, h: f64) -> f64 {
        let wanted = gains.p * e + self.integral + u_0;
        let pushes_further = (wanted > limits.high && e >= 0.0) || (wanted < limits.low && e <= 0.0);
        if !pushes_further {
            self.integral += gains.i * e * h;
        }
        self.integral = self.integral.max((limits.low - u_0).min(0.0)).min((limits.high - u_0).max(0.0));
        limits.bound(gains.p * e + self.integral + u_0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_integral_does_not_wind_up_and_leaves_the_limit_at_once() {
        let (gains, limits) = (Gains { p: 1.0, i: 10.0 }, Limits { low: -1.0, high: 2.0 });
        let mut pi = Pi::default();
        for _ in 0..10_000 {
            assert!(pi.step(gains, 5.0, 0.5, limits, 1e-3) <= limits.high);
        }
        assert!(pi.step(gains, -0.1, 0.5, limits, 1e-3) < limits.high, "integral {}", pi.integral);
    }

    #[test]
    fn inside_the_limits_it_is_linear() {
        let mut pi = Pi::default();
        let mut u = 0.0;
        for _ in 0..100 {
            u = pi.step(Gains { p: 2.0, i: 3.0 }, 0.1, 0.25, Limits { low: -10.0, high: 10.0 }, 1e-2);
        }
        assert!((u - (0.2 + 0.3 + 0.25)).abs() < 1e-12);
    }
}
