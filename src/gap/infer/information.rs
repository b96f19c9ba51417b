//! What recordings say of effects that are not free, beside all that is: from sums over them, what each effect alone is worth.

use super::linear::Normal;
use super::prior::moment;
use super::screen::{Candidate, LARGEST_FACTOR, off};
use crate::effects::REGISTRY;
use nalgebra::{DMatrix, DVector};

/// What recordings say of candidates and of all that recordings share, own unknowns eliminated, without any prior: a sum over recordings, so that those of
/// several campaigns at one anchor add up.
#[derive(Clone, Debug)]
pub struct Information {
    /// Of the shared coordinates.
    pub(super) curvature: DMatrix<f64>,
    /// Of shared coordinates with candidates.
    pub(super) cross: DMatrix<f64>,
    /// Of the candidates.
    pub(super) gram: DMatrix<f64>,
}

impl Information {
    /// Adds that of other recordings, so many times.
    pub fn add(&mut self, other: &Self, times: f64) {
        self.curvature += &other.curvature * times;
        self.cross += &other.cross * times;
        self.gram += &other.gram * times;
    }

    /// None at all, for as many coordinates and candidates.
    pub fn none(&self) -> Self {
        let zero = |m: &DMatrix<f64>| DMatrix::zeros(m.nrows(), m.ncols());
        Self { curvature: zero(&self.curvature), cross: zero(&self.cross), gram: zero(&self.gram) }
    }

    /// Of each candidate once the shared coordinates are eliminated, which have this prior precision.
    pub(super) fn beside(&self, prior: &DMatrix<f64>) -> Vec<f64> {
        let root = (&self.curvature + prior).cholesky().expect("a prior of positive precision");
        let solved = root.solve(&self.cross);
        (0..self.gram.nrows()).map(|k| (self.gram[(k, k)] - self.cross.column(k).dot(&solved.column(k))).max(0.0)).collect()
    }

    /// Each candidate alone, as it is believed: recordings count with this power, and the prior of the shared coordinates in full. Given are the gradients of the recordings along these
    /// and along the candidates.
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

/// What a candidate alone is worth as it is believed, beside what settles without it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Believed {
    /// Gain in the cost.
    pub(super) gain: f64,
    /// Nats of evidence, an effect's moments included and its odds not.
    pub(super) evidence: f64,
}

#[cfg(test)]
mod tests {
    use super::super::density::{Point, size};
    use super::*;
    use crate::effects;

    /// A tolerance that was pulled by five standard deviations, and an effect that does the same: it relieves that by 25, however little the recordings are believed.
    #[test]
    fn what_relieves_a_tolerance_counts_in_full() {
        let (pulled, sure) = (5.0, 1e6);
        let one = |x: f64| DMatrix::from_element(1, 1, x);
        let information = Information { curvature: one(sure), cross: one(sure), gram: one(sure) };
        let of = |x: f64| DVector::from_element(1, x);
        let prior = Normal { curvature: one(1.0), gradient: of(pulled), eliminated: Vec::new(), log_det_own: 0.0, log_det_prior: 0.0 };
        let mut point = Point { shared: vec![pulled], own: Vec::new(), effects: effects::null(), missing: Vec::new() };
        // A hundredth of its size stands for one standard deviation.
        let amplitude = REGISTRY[0].effect.amplitudes[0];
        point.effects[amplitude] += 0.01 * size(amplitude);
        let candidate = Candidate::of_share(0, point, 0.01);
        for power in [1.0, 0.1, 0.01] {
            // At the fit the recordings pull as the prior does, the other way.
            let Believed { gain, evidence } =
                information.believed(power, &prior, &of(-pulled), &of(-pulled), std::slice::from_ref(&candidate))[0];
            assert!((gain / pulled.powi(2) - 1.0).abs() < 1e-3, "{power}: {gain}");
            // Of a start it is 0.05 ± 0.01, beside what a start was thought to be.
            let expected = 12.5 + 0.01_f64.ln() + moment(0.05_f64.powi(2) + 0.01_f64.powi(2));
            assert!((evidence - expected).abs() < 0.02, "{power}: {evidence} {expected}");
        }
    }
}
