//! Which manoeuvre splits what a campaign left open: expected evidence between explanations that are still believed.
//!
//! A manoeuvre is rehearsed with the most probable explanation's car. On its recording, explanations i and j differ by d_ij = e_j − e_i, e their whitened innovations.
//! The logarithm of the Bayes factor that a recording of i gives for i over j is expected to be
//!
//! ```text
//! D_ij = ½ min over Δ of  |d_ij + J_j Δ|² + Δᵀ P_j Δ,
//! ```
//!
//! J_j the innovations' derivatives along j's unknowns and P_j what is known of these: the posterior's precision of all that recordings share, and one for each
//! standard deviation of what the new recording has of its own. Squares are Huber's loss, as everywhere. It is normal with variance 2 D_ij (both follow from
//! innovations that are normal). With p the present probabilities, the expected evidence for what is true against all else is
//!
//! ```text
//! Σ p_i (−ln Σ_{j≠i} p_j e^(−D_ij) / (1 − p_i)),
//! ```
//!
//! for two explanations the mean of D_12 and D_21, for more of them what the nearest rival leaves.

use super::Planner;
use super::manoeuvre::Manoeuvre;
use crate::gap::infer::coordinate::{Coordinate, coordinates};
use crate::gap::infer::density::Point;
use crate::gap::infer::limit::normal;
use crate::gap::infer::linear::{Frame, by_phase, derivatives, to_powers};
use crate::gap::infer::posterior::Posterior;
use crate::gap::verdict::NAMED_BESIDE;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// An explanation that is still believed.
#[derive(Clone, Debug)]
pub struct Rival {
    /// Its effects, by their place in the registry, ascending; none is the car within its tolerances.
    pub effects: Vec<usize>,
    /// Probability among the rivals.
    pub probability: f64,
    point: Point,
    shared: Vec<Coordinate>,
    /// Posterior precision of what recordings share.
    precision: DMatrix<f64>,
}

/// Explanations of a posterior between which a manoeuvre may decide: those that are believed beside the best by more than [`NAMED_BESIDE`], the best first. What
/// has no formula predicts nothing and is not among them.
pub fn rivals(posterior: &Posterior) -> Vec<Rival> {
    let formulas = posterior.explanations.iter().filter(|e| e.place.is_none() && e.probability > NAMED_BESIDE);
    let mut all: Vec<Rival> = formulas
        .filter_map(|e| {
            let fit = e.fit.as_ref()?;
            Some(Rival {
                effects: e.effects.clone(),
                probability: e.probability,
                point: fit.point.clone(),
                shared: fit.shared.clone(),
                precision: fit.curvature.clone(),
            })
        })
        .collect();
    let sum: f64 = all.iter().map(|r| r.probability).sum();
    all.iter_mut().for_each(|r| r.probability /= sum);
    all
}

/// What a manoeuvre is expected to do to the rivals.
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    /// D_ij, nats: row i is true.
    pub nats: DMatrix<f64>,
}

impl Split {
    /// Expected evidence for what is true against the rest, nats.
    pub fn evidence(&self, probability: &[f64]) -> f64 {
        let one = |i: usize| {
            let others = (0..probability.len()).filter(|j| *j != i);
            let least = others.clone().map(|j| self.nats[(i, j)]).fold(f64::INFINITY, f64::min);
            let rest: f64 = others.clone().map(|j| probability[j]).sum();
            let left: f64 = others.map(|j| probability[j] * (least - self.nats[(i, j)]).exp()).sum();
            probability[i] * (least - (left / rest).ln())
        };
        let total: f64 = probability.iter().sum();
        (0..probability.len()).map(one).sum::<f64>() / total
    }

    /// Probability that the first rival and rival `k` are told apart afterwards: that the one that is wrong falls below [`NAMED_BESIDE`].
    pub fn told_apart(&self, probability: &[f64], k: usize) -> f64 {
        let enough = ((1.0 - NAMED_BESIDE) / NAMED_BESIDE).ln();
        let prior = (probability[0] / probability[k]).ln();
        let when = |d: f64, ahead: f64| {
            if d > 0.0 { normal((d + ahead - enough) / (2.0 * d).sqrt()) } else { f64::from(u8::from(ahead > enough)) }
        };
        let (first, other) = (when(self.nats[(0, k)], prior), when(self.nats[(k, 0)], -prior));
        (probability[0] * first + probability[k] * other) / (probability[0] + probability[k])
    }

    /// The same of the first and all others: of the pair that is told apart worst.
    pub fn splits(&self, probability: &[f64]) -> f64 {
        (1..probability.len()).map(|k| self.told_apart(probability, k)).fold(1.0, f64::min)
    }

    /// The same for these rivals alone.
    pub fn among(&self, places: &[usize]) -> Self {
        Self { nats: DMatrix::from_fn(places.len(), places.len(), |i, j| self.nats[(places[i], places[j])]) }
    }
}

/// What every manoeuvre of the planner would do to these rivals, in its order.
pub fn splits(planner: &Planner, rivals: &[Rival]) -> Vec<Split> {
    planner.manoeuvres.par_iter().map(|m| split(planner, rivals, m)).collect()
}

fn split(planner: &Planner, rivals: &[Rival], what: &Manoeuvre) -> Split {
    let problem = planner.problem(what, &planner.car(&planner.at(&rivals[0].point)));
    let points: Vec<Point> = rivals.iter().map(|r| planner.at(&r.point)).collect();
    let innovations: Vec<Vec<f64>> = points.iter().map(|p| problem.residuals(0, p, None)).collect();
    let n = rivals.len();
    let mut nats = DMatrix::zeros(n, n);
    for (j, rival) in rivals.iter().enumerate() {
        let (shared, own) = coordinates(&problem, &rival.effects, 0);
        debug_assert_eq!(shared, rival.shared);
        let (s, o) = (shared.len(), own.len());
        let frame = Frame { shared, own };
        let columns = derivatives(&problem, &points[j], None, &innovations[j..=j], &frame, None);
        let known = DMatrix::from_fn(s + o, s + o, |a, b| match (a < s, b < s) {
            (true, true) => rival.precision[(a, b)],
            _ => f64::from(u8::from(a == b)),
        });
        for i in (0..n).filter(|i| *i != j) {
            let d: Vec<f64> = innovations[j].iter().zip(&innovations[i]).map(|(e_j, e_i)| e_j - e_i).collect();
            let d = [d];
            let parts = by_phase(&problem, &columns, &d);
            let (curvature, gradient) = to_powers(&parts, problem.steering()).remove(0);
            let followed = (curvature + &known).cholesky().map_or(0.0, |root| gradient.dot(&root.solve(&gradient)));
            let misfit: f64 = problem.misfits(&d).iter().zip(problem.steering()).map(|(misfit, power)| misfit * power).sum();
            nats[(i, j)] = 0.5 * (misfit - followed).max(0.0);
        }
    }
    Split { nats }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn split(n: usize, nats: &[f64]) -> Split {
        Split { nats: DMatrix::from_row_slice(n, n, nats) }
    }

    #[test]
    fn of_two_the_evidence_is_the_mean_of_both_and_of_more_what_the_nearest_leaves() {
        let two = split(2, &[0.0, 8.0, 12.0, 0.0]);
        assert!((two.evidence(&[0.5, 0.5]) - 10.0).abs() < 1e-12);
        assert!((two.evidence(&[0.6, 0.2]) - 9.0).abs() < 1e-12);
        let lopsided = split(3, &[0.0, 500.0, 0.1, 500.0, 0.0, 500.0, 0.1, 500.0, 0.0]);
        let even = split(3, &[0.0, 15.0, 15.0, 15.0, 0.0, 15.0, 15.0, 15.0, 0.0]);
        let p = [0.45, 0.1, 0.45];
        assert!((even.evidence(&p) - 15.0).abs() < 1e-9);
        assert!(lopsided.among(&[0, 2]).evidence(&[0.45, 0.45]) < 0.2);
        assert!(lopsided.splits(&p) < 0.05 && even.splits(&p) > 0.95);
    }

    /// Odds of 19 to one or more are apart, and a manoeuvre that says nothing does not change that.
    #[test]
    fn what_says_nothing_leaves_the_odds_as_they_are() {
        let silent = split(2, &[0.0; 4]);
        // 24 to one: apart if the first is true; 3 to one: not.
        assert!((silent.told_apart(&[0.96, 0.04], 1) - 0.96).abs() < 1e-12);
        assert_eq!(silent.told_apart(&[0.75, 0.25], 1), 0.0);
    }

    /// Against drawn Bayes factors.
    #[test]
    fn the_probability_of_a_split_is_its_frequency() {
        let (d, p) = (4.0, [0.7, 0.3]);
        let s = split(2, &[0.0, d, d, 0.0]);
        let mut seed = 9_u64;
        let mut uniform = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((seed >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
        };
        let mut told = 0;
        for _ in 0..40_000 {
            let true_first = uniform() < p[0];
            let z = (-2.0 * uniform().ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos();
            let factor = d + (2.0 * d).sqrt() * z;
            let odds = if true_first { (p[0] / p[1]).ln() + factor } else { (p[1] / p[0]).ln() + factor };
            told += usize::from(odds > 19f64.ln());
        }
        let share = told as f64 / 40_000.0;
        assert!((share - s.told_apart(&p, 1)).abs() < 0.01, "{share} {}", s.told_apart(&p, 1));
    }
}
