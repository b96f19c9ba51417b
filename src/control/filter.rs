//! First-order lags in series, which delay a reference in the same way as the measurement that it is compared with.
//!
//! τ ẏ = u − y, by the implicit step y += (u − y) h/(τ + h), which is stable at every τ and h.

/// Share of the way to its input that a lag with the time constant `time` s covers in `h` s.
#[inline]
pub fn share(time: f64, h: f64) -> f64 {
    h / (time + h)
}

/// `N` lags in series; the last one is the output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lags<const N: usize>(pub [f64; N]);

impl<const N: usize> Default for Lags<N> {
    fn default() -> Self {
        Self([0.0; N])
    }
}

impl<const N: usize> Lags<N> {
    /// All lags settled at `value`.
    pub fn at(value: f64) -> Self {
        Self([value; N])
    }

    /// Shifts the states of all lags by `by`.
    pub fn shift(&mut self, by: f64) {
        self.0.iter_mut().for_each(|y| *y += by);
    }

    /// Advances by one sample and returns the output; `shares` has the [`share`] of each lag.
    #[inline]
    pub fn advance(&mut self, input: f64, shares: [f64; N]) -> f64 {
        let mut u = input;
        for (y, share) in self.0.iter_mut().zip(shares) {
            *y += (u - *y) * share;
            u = *y;
        }
        u
    }

    /// Current output.
    #[inline]
    pub fn out(&self) -> f64 {
        self.0[N - 1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_lag_goes_its_share_of_the_way_to_the_one_before_it() {
        assert_eq!((share(0.03, 0.01), share(0.0, 0.01)), (0.25, 1.0));
        let mut lags = Lags::<2>::at(1.0);
        assert_eq!(lags.out(), 1.0);
        // The first lag goes half of the way from 1 to 5, the second a quarter of the way to the first.
        assert_eq!((lags.advance(5.0, [0.5, 0.25]), lags.out()), (1.5, 1.5));
        assert_eq!(lags.0, [3.0, 1.5]);
        lags.shift(-2.0);
        assert_eq!((lags.0, Lags::<3>::default().out()), ([1.0, -0.5], 0.0));
    }
}
