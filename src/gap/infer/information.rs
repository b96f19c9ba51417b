//! Information of recordings about effects that are not free in a fit, and what each of these effects alone is worth beside everything that is free.

use super::linear::Normal;
use super::prior::moment;
use super::screen::{Candidate, LARGEST_FACTOR, off};
use crate::effects::REGISTRY;
use nalgebra::{DMatrix, DVector};

/// Information of recordings about the shared coordinates and the candidates: curvature of half the cost without the priors of either, own unknowns eliminated. It is a sum over
/// recordings, so that the information of several campaigns at one anchor adds up.
#[derive(Clone, Debug)]
pub struct Information {
    /// Information about the shared coordinates.
    pub(super) curvature: DMatrix<f64>,
    /// Cross terms of shared coordinates and candidates.
    pub(super) cross: DMatrix<f64>,
    /// Information about the candidates.
    pub(super) gram: DMatrix<f64>,
}

impl Information {
    /// Adds the information of other recordings, multiplied by `times`.
    pub fn add(&mut self, other: &Self, times: f64) {
        self.curvature += &other.curvature * times;
        self.cross += &other.cross * times;
        self.gram += &other.gram * times;
    }

    /// No information, with as many coordinates and candidates.
    pub fn none(&self) -> Self {
        let zero = |m: &DMatrix<f64>| DMatrix::zeros(m.nrows(), m.ncols());
        Self { curvature: zero(&self.curvature), cross: zero(&self.cross), gram: zero(&self.gram) }
    }

    /// Information about each candidate alone once the shared coordinates, which have this prior precision, are eliminated.
    pub(super) fn beside(&self, prior: &DMatrix<f64>) -> Vec<f64> {
        let root = (&self.curvature + prior).cholesky().expect("a prior of positive precision");
        let solved = root.solve(&self.cross);
        (0..self.gram.nrows()).map(|k| (self.gram[(k, k)] - self.cross.column(k).dot(&solved.column(k))).max(0.0)).collect()
    }

    /// Worth of each candidate alone, with the likelihood raised to `power` and the prior of the shared coordinates in full. `shared` and `own` are the gradients of the
    /// recordings' part of half the cost along the shared coordinates and along the candidates.
    pub(super) fn believed(
        &self,
        power: f64,
        prior: &Normal,
        shared: &DVector<f64>,
        own: &DVector<f64>,
        candidates: &[Candidate],
    ) -> Vec<Believed> {
        let root = (&self.curvature * power + &prior.curvature).cholesky().expect("a prior of positive precision");
        let settled = root.solve(&(shared * power + &prior.gradient));
        let solved = root.solve(&self.cross) * power;
        let one = |(k, c): (usize, &Candidate)| {
            let unlearned = c.share * c.share;
            let curvature = power * (self.gram[(k, k)] - self.cross.column(k).dot(&solved.column(k))) + unlearned;
            let slope = power * (own[k] - self.cross.column(k).dot(&settled));
            let step = (-slope / curvature).clamp(0.0, LARGEST_FACTOR / c.share);
            let gain = -(2.0 * slope + curvature * step) * step;
            let size = REGISTRY[c.effect].effect.amplitudes.iter().map(|&p| off(c, p).powi(2)).fold(0.0, f64::max);
            let evidence = 0.5 * gain + 0.5 * (unlearned / curvature).ln() + moment((step * step + 1.0 / curvature) * size);
            Believed { gain, evidence }
        };
        candidates.iter().enumerate().map(one).collect()
    }
}

/// Worth of a candidate alone with the likelihood raised to a power, beyond what the shared coordinates gain without it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Believed {
    /// Reduction of the cost.
    pub(super) gain: f64,
    /// Gain in log evidence, nats, with the effect's moment prior and without its prior odds.
    pub(super) evidence: f64,
}

#[cfg(test)]
mod tests {
    use super::super::density::{Point, size};
    use super::*;
    use crate::effects;

    /// A tolerance is pulled by five standard deviations, and an effect does exactly what the tolerance does. The effect relieves the cost by 25, however low the power of the
    /// likelihood is.
    #[test]
    fn what_relieves_a_tolerance_counts_in_full() {
        let (pulled, sure) = (5.0, 1e6);
        let one = |x: f64| DMatrix::from_element(1, 1, x);
        let information = Information { curvature: one(sure), cross: one(sure), gram: one(sure) };
        let of = |x: f64| DVector::from_element(1, x);
        let prior = Normal { curvature: one(1.0), gradient: of(pulled), eliminated: Vec::new(), log_det_own: 0.0, log_det_prior: 0.0 };
        let mut point = Point { shared: vec![pulled], own: Vec::new(), effects: effects::null(), missing: Vec::new() };
        // A hundredth of the size of the amplitude does the same as one standard deviation of the tolerance.
        let amplitude = REGISTRY[0].effect.amplitudes[0];
        point.effects[amplitude] += 0.01 * size(amplitude);
        let candidate = Candidate::of_share(0, point, 0.01);
        for power in [1.0, 0.1, 0.01] {
            // At the fit, the gradient of the recordings is the opposite of that of the prior.
            let Believed { gain, evidence } =
                information.believed(power, &prior, &of(-pulled), &of(-pulled), std::slice::from_ref(&candidate))[0];
            assert!((gain / pulled.powi(2) - 1.0).abs() < 1e-3, "{power}: {gain}");
            // The effect has 0.05 ± 0.01 times the size of its start, which was the prior standard deviation.
            let expected = 12.5 + 0.01_f64.ln() + moment(0.05_f64.powi(2) + 0.01_f64.powi(2));
            assert!((evidence - expected).abs() < 0.02, "{power}: {evidence} {expected}");
        }
    }
}
