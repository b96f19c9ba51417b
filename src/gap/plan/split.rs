//! Which manoeuvre settles what a campaign left open: expected evidence between explanations that are still plausible.
//!
//! A manoeuvre is rehearsed with the car of the most probable explanation. On its recording, explanations i and j differ by d_ij = e_j − e_i, where e are their whitened
//! innovations. If i is true, the expected log Bayes factor of i over j is
//!
//! ```text
//! D_ij = ½ min over Δ of  |d_ij + J_j Δ|² + Δᵀ P_j Δ,
//! ```
//!
//! where J_j are the derivatives of the innovations along j's unknowns, and P_j is the precision with which these are known: the posterior precision of everything that recordings
//! share, the prior precision (1, in units of the standard deviation) of what belongs to the new recording alone, and, for the forms of j's effects, the precision of the size that
//! the recordings so far leave to them. Squares are replaced by Huber's loss, as everywhere, and the likelihood has the powers that it will have once the new recording shows the
//! gap as well, so that there is a D_ij for each accuracy of the explanations. The log Bayes factor is normal with variance 2 D_ij (mean and variance both follow from normal
//! innovations). With the present probabilities p, the expected evidence for the true explanation against all others is
//!
//! ```text
//! Σ p_i (−ln Σ_{j≠i} p_j e^(−D_ij) / (1 − p_i)),
//! ```
//!
//! For two explanations this is the mean of D_12 and D_21; for more, it is dominated by the nearest rival. Over the accuracies, what is left of a rival, e^(−D), is averaged, as
//! probabilities are.

use super::Planner;
use super::manoeuvre::Manoeuvre;
use crate::gap::infer::belief::{ByAccuracy, coarsened, of_replay};
use crate::gap::infer::coordinate::{Coordinate, coordinates};
use crate::gap::infer::density::Point;
use crate::gap::infer::form::forms;
use crate::gap::infer::limit::normal;
use crate::gap::infer::linear::{Frame, by_phase, derivatives, to_powers};
use crate::gap::infer::posterior::Posterior;
use crate::gap::verdict::NAMED_BESIDE;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// An explanation that is still plausible.
#[derive(Clone, Debug)]
pub struct Rival {
    /// Its effects, by their index in the registry, ascending; empty for the car within its tolerances.
    pub effects: Vec<usize>,
    /// Probability among the rivals.
    pub probability: f64,
    point: Point,
    shared: Vec<Coordinate>,
    /// Posterior precision of what recordings share.
    precision: DMatrix<f64>,
    /// Size of its effects' forms, relative to the size that the fit assumed.
    form_size: f64,
}

/// Explanations of a posterior between which a manoeuvre may decide: those with a probability of more than [`NAMED_BESIDE`], the best first. Missing laws have no formula, predict
/// nothing, and are left out.
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
                form_size: fit.form_size,
            })
        })
        .collect();
    let sum: f64 = all.iter().map(|r| r.probability).sum();
    all.iter_mut().for_each(|r| r.probability /= sum);
    all
}

/// Expected evidence of a manoeuvre between the rivals.
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    /// D_ij, nats, for each accuracy of the explanations; i is the row and is true.
    pub nats: ByAccuracy<DMatrix<f64>>,
}

fn mean(of: &ByAccuracy<f64>) -> f64 {
    of.iter().sum::<f64>() / of.len() as f64
}

impl Split {
    /// Expected evidence for the true explanation against the others, nats.
    pub fn evidence(&self, probability: &[f64]) -> f64 {
        let all = self.nats.each_ref().map(|nats| Self::evidence_of(nats, probability));
        let least = all.iter().copied().fold(f64::INFINITY, f64::min);
        least - mean(&all.map(|nats| (least - nats).exp())).ln()
    }

    fn evidence_of(nats: &DMatrix<f64>, probability: &[f64]) -> f64 {
        let one = |i: usize| {
            let others = (0..probability.len()).filter(|j| *j != i);
            let least = others.clone().map(|j| nats[(i, j)]).fold(f64::INFINITY, f64::min);
            let rest: f64 = others.clone().map(|j| probability[j]).sum();
            let left: f64 = others.map(|j| probability[j] * (least - nats[(i, j)]).exp()).sum();
            probability[i] * (least - (left / rest).ln())
        };
        let total: f64 = probability.iter().sum();
        (0..probability.len()).map(one).sum::<f64>() / total
    }

    /// Probability that the first rival and rival `k` are told apart afterwards: that the probability of the wrong one falls below [`NAMED_BESIDE`].
    pub fn told_apart(&self, probability: &[f64], k: usize) -> f64 {
        let prior = (probability[0] / probability[k]).ln();
        let of = |i: usize, j: usize, ahead: f64| told(&self.nats.each_ref().map(|nats| nats[(i, j)]), ahead);
        let (first, other) = (of(0, k, prior), of(k, 0, -prior));
        (probability[0] * first + probability[k] * other) / (probability[0] + probability[k])
    }

    /// Smallest probability with which the first rival and another one are told apart.
    pub fn splits(&self, probability: &[f64]) -> f64 {
        (1..probability.len()).map(|k| self.told_apart(probability, k)).fold(1.0, f64::min)
    }

    /// The split between the rivals at these indices alone.
    pub fn among(&self, places: &[usize]) -> Self {
        let of = |nats: &DMatrix<f64>| DMatrix::from_fn(places.len(), places.len(), |i, j| nats[(places[i], places[j])]);
        Self { nats: self.nats.each_ref().map(of) }
    }
}

/// Range of standard normal deviates in which the threshold above which explanations are told apart is sought.
const DEVIATES: [f64; 2] = [-40.0, 40.0];

/// Probability that the wrong explanation falls below [`NAMED_BESIDE`] if the true one is now `ahead` by this many nats and `nats` are expected at each accuracy. A recording has
/// one normal deviate for all accuracies, and the probability of the wrong explanation falls as the deviate rises.
fn told(nats: &ByAccuracy<f64>, ahead: f64) -> f64 {
    let is_told = |z: f64| mean(&nats.map(|d| 1.0 / (1.0 + (ahead + d + (2.0 * d).sqrt() * z).exp()))) < NAMED_BESIDE;
    let [mut low, mut high] = DEVIATES;
    if is_told(low) {
        return 1.0;
    }
    while high - low > 1e-6 {
        let middle = 0.5 * (low + high);
        if is_told(middle) { high = middle } else { low = middle }
    }
    normal(-high)
}

/// The split of these rivals by every manoeuvre, in the planner's order.
pub fn splits(planner: &Planner, rivals: &[Rival]) -> Vec<Split> {
    planner.manoeuvres.par_iter().map(|m| split(planner, rivals, m)).collect()
}

fn split(planner: &Planner, rivals: &[Rival], what: &Manoeuvre) -> Split {
    let problem = planner.problem(what, &planner.car(&planner.at(&rivals[0].point)));
    let points: Vec<Point> = rivals.iter().map(|r| planner.at(&r.point)).collect();
    let innovations: Vec<Vec<f64>> = points.iter().map(|p| problem.residuals(0, p, None)).collect();
    let difference = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<f64>>();
    // A manoeuvre that distinguishes explanations well also shows the gap, and what they leave of it, which lowers the powers of the likelihood.
    let gap = difference(&problem.residuals(0, &planner.nominal(), None), &innovations[0]);
    let gap = [gap];
    let powers = coarsened(problem.powers, problem.by_sample(&gap, of_replay), problem.misfits(&gap));
    let n = rivals.len();
    let mut nats = powers.map(|_| DMatrix::zeros(n, n));
    for (j, rival) in rivals.iter().enumerate() {
        let basis = forms(&problem, &points[j], &rival.effects);
        let point = Point { missing: vec![0.0; basis.len()], ..points[j].clone() };
        let (shared, own) = coordinates(&problem, &rival.effects, basis.len());
        let (known, s) = (rival.shared.len(), shared.len() + own.len());
        debug_assert_eq!(shared[..known], rival.shared);
        let functions = known..shared.len();
        let frame = Frame { shared, own };
        let columns = derivatives(&problem, &point, Some(&basis), &innovations[j..=j], &frame, None);
        let known = DMatrix::from_fn(s, s, |a, b| match (a < known && b < known, a == b) {
            (true, _) => rival.precision[(a, b)],
            (false, true) if functions.contains(&a) => rival.form_size.powi(-2),
            (false, same) => f64::from(u8::from(same)),
        });
        for i in (0..n).filter(|i| *i != j) {
            let d = [difference(&innovations[j], &innovations[i])];
            let (parts, misfits) = (by_phase(&problem, &columns, &d), problem.misfits(&d));
            for (nats, powers) in nats.iter_mut().zip(powers) {
                let (curvature, gradient) = to_powers(&parts, powers).remove(0);
                let followed = (curvature + &known).cholesky().map_or(0.0, |root| gradient.dot(&root.solve(&gradient)));
                let misfit: f64 = misfits.iter().zip(powers).map(|(misfit, power)| misfit * power).sum();
                nats[(i, j)] = 0.5 * (misfit - followed).max(0.0);
            }
        }
    }
    Split { nats }
}

#[cfg(test)]
mod tests {
    use super::super::Sensors;
    use super::super::manoeuvre::built_in;
    use super::super::rehearse::Logger;
    use super::*;
    use crate::effects::{self, param};
    use crate::vehicle::Vehicle;

    fn split(n: usize, nats: &[f64]) -> Split {
        Split { nats: std::array::from_fn(|_| DMatrix::from_row_slice(n, n, nats)) }
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

    /// Explanations are told apart at odds of 19 to 1 or more, and a manoeuvre that says nothing does not change the odds.
    #[test]
    fn what_says_nothing_leaves_the_odds_as_they_are() {
        let silent = split(2, &[0.0; 4]);
        // 24 to 1: told apart if the first is true; 3 to 1: not.
        assert!((silent.told_apart(&[0.96, 0.04], 1) - 0.96).abs() < 1e-12);
        assert_eq!(silent.told_apart(&[0.75, 0.25], 1), 0.0);
    }

    /// The accuracy with the least expected evidence keeps a rival alive: what remains is a third of what is left at that accuracy.
    #[test]
    fn over_accuracies_it_is_the_mean_of_what_is_left() {
        let mut s = split(2, &[0.0, 40.0, 40.0, 0.0]);
        s.nats[2].fill(0.5);
        let left = s.evidence(&[0.5, 0.5]);
        assert!((left - (0.5 + 3f64.ln())).abs() < 1e-9, "{left}");
        // A third of the rival's probability at that accuracy must be below a twentieth, so the odds there must be above 17 to 3.
        let expected = normal(0.5 - (17.0_f64 / 3.0).ln());
        assert!((s.told_apart(&[0.5, 0.5], 1) - expected).abs() < 1e-5, "{} {expected}", s.told_apart(&[0.5, 0.5], 1));
    }

    /// Less evidence is expected where the form of a rival's effect can follow the difference, and where the likelihood is lowered because the recording shows the gap.
    #[test]
    fn forms_and_inexact_laws_leave_less_to_expect() {
        let vehicle = Vehicle::paper();
        let logger = Logger { rate_hz: 100.0, bench: [false; 3], theta_0_sigma: [1.0; 2] };
        let chirp = built_in(&vehicle).into_iter().filter(|m| m.name == "chirp").collect();
        let planner = Planner::before(&vehicle, &serde_json::json!({}), Sensors::default(), logger, chirp).unwrap();
        let rival = |effect: &str, parameter: usize, size: f64, form_size: f64| {
            let mut point = planner.nominal();
            point.effects[parameter] = size;
            let effects = vec![effects::find(effect).unwrap()];
            let problem = planner.problem(&planner.manoeuvres[0], &planner.car(&point));
            let (shared, _) = coordinates(&problem, &effects, 0);
            let precision = DMatrix::from_fn(shared.len(), shared.len(), |i, j| if i == j { shared[i].precision() } else { 0.0 });
            Rival { effects, probability: 0.5, point, shared, precision, form_size }
        };
        let expected = |form_size: f64| {
            let lag = rival("actuator_lag", param::actuator_lag::time_constant, 0.06, form_size);
            let late = rival("actuator_delay", param::actuator_delay::delay, 0.06, form_size);
            splits(&planner, &[lag, late]).remove(0).nats.map(|nats| nats[(0, 1)])
        };
        let (formless, formed) = (expected(1e-3), expected(1.0));
        assert!(formed.iter().zip(&formless).all(|(formed, formless)| *formed < 0.9 * formless), "{formed:?} {formless:?}");
        assert!(formless[2] < 0.8 * formless[1] && formless[1] < 0.8 * formless[0] && formless[2] > 0.0, "{formless:?}");
    }

    /// Compared with the frequency among simulated Bayes factors.
    #[test]
    fn the_probability_of_a_split_is_its_frequency() {
        let (all, p) = ([6.0, 4.0, 1.5], [0.7, 0.3]);
        let s = Split { nats: all.map(|d| DMatrix::from_row_slice(2, 2, &[0.0, d, d, 0.0])) };
        let mut seed = 9_u64;
        let mut uniform = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((seed >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
        };
        let mut told = 0;
        for _ in 0..40_000 {
            let true_first = uniform() < p[0];
            let z = (-2.0 * uniform().ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos();
            let before = if true_first { (p[0] / p[1]).ln() } else { (p[1] / p[0]).ln() };
            let left = all.map(|d| 1.0 / (1.0 + (before + d + (2.0 * d).sqrt() * z).exp()));
            told += usize::from(left.iter().sum::<f64>() / 3.0 < 0.05);
        }
        let share = told as f64 / 40_000.0;
        assert!((share - s.told_apart(&p, 1)).abs() < 0.01, "{share} {}", s.told_apart(&p, 1));
    }
}
