//! Fit of a hypothesis: the mode of the joint density, and its evidence by Laplace's approximation there.
//!
//! The method is Levenberg–Marquardt. Derivatives along nuisances are reused as long as the linear model predicts the gain of a step well.

use super::belief::ByAccuracy;
use super::coordinate::{Coordinate, coordinates};
use super::density::{Basis, ByPhase, Point, Problem, Residuals, WHOLE, cost};
use super::form::FORM;
use super::linear::{Columns, Frame, Known, Normal, Products, all_products, assemble, by_phase, derivatives, to_powers};
use crate::effects::PARAMETERS;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Outcome of a fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// Mode.
    pub point: Point,
    /// Minus twice the logarithm of the density at the mode, up to a constant that depends on the recordings alone.
    pub cost: f64,
    /// Innovations at the mode; empty once they were released.
    pub residuals: Arc<Vec<Residuals>>,
    /// The recordings' part of the cost, phase by phase of the clutch.
    pub misfits: ByPhase<f64>,
    /// Coordinates that all recordings share.
    pub shared: Vec<Coordinate>,
    /// Curvature of half the cost along the shared coordinates, own unknowns eliminated.
    pub curvature: DMatrix<f64>,
    /// Logarithm of the evidence, nats, up to a constant that depends on the recordings alone.
    pub log_evidence: f64,
    /// Derivatives near the mode; empty once they were released.
    pub columns: Arc<Vec<Columns>>,
    /// Coordinates that each recording has of its own.
    pub own: Vec<Coordinate>,
    /// Products of the derivatives, by recording and phase of the clutch.
    pub parts: Arc<Vec<ByPhase<Products>>>,
    /// Sum of squares of the shared nuisances at the mode of the density under the likelihood powers with which the fit was weighed; 0 before it is weighed.
    pub strain: f64,
    /// Size of the effects' forms relative to the one assumed in the fit: root mean square over the possible sizes, weighted by their evidence; 1 before the fit is weighed.
    pub form_size: f64,
    /// Covariance of the shared coordinates without functions, averaged over the accuracies that an explanation may have. None before the fit is weighed, or if the curvature is
    /// not positive definite for one of them.
    pub mean_covariance: Option<DMatrix<f64>>,
    /// Curvature along the shared coordinates without functions under the full likelihood, as if laws were exact. Before the fit is weighed, a copy of `curvature`.
    pub exact: DMatrix<f64>,
}

/// Mean covariance of the fits of one explanation, one fit for each accuracy that it may have, functions eliminated.
pub fn mean_covariance(fits: ByAccuracy<Fit>) -> Option<DMatrix<f64>> {
    let all: Vec<DMatrix<f64>> = fits.into_iter().map(|fit| fit.marginal().covariance()).collect::<Option<_>>()?;
    let number = all.len() as f64;
    all.into_iter().reduce(|sum, one| sum + one).map(|sum| sum / number)
}

impl Fit {
    /// Derivatives at the mode, computed anew if they were released.
    pub fn derivatives(&self, problem: &Problem, frame: &Frame, basis: Option<&Basis>) -> Arc<Vec<Columns>> {
        if !self.columns.is_empty() {
            return self.columns.clone();
        }
        let anew = || Arc::new(problem.all_residuals(&self.point, basis));
        let residuals = if self.residuals.is_empty() { anew() } else { self.residuals.clone() };
        Arc::new(derivatives(problem, &self.point, basis, &residuals, frame, None))
    }

    /// The recordings' part of the cost.
    pub fn misfit(&self) -> f64 {
        self.misfits.iter().sum()
    }

    /// Releases the memory of the innovations, the derivatives and their products.
    pub fn let_go(&mut self) {
        (self.residuals, self.columns, self.parts) = (Arc::default(), Arc::default(), Arc::default());
    }

    /// Derivatives of which a fit of other effects can reuse those along nuisances.
    pub fn known(&self) -> Option<Known<'_>> {
        (!self.columns.is_empty()).then_some(Known::Nuisances(&self.columns))
    }

    /// Derivatives of which a fit of the same effects with further functions of the same law can reuse those along nuisances and along the law.
    pub fn known_with_law(&self) -> Option<Known<'_>> {
        (!self.columns.is_empty()).then_some(Known::Law(&self.columns))
    }

    /// Standard deviation of the mean of an effect's form, as a change of one of the effect's parameters. These recordings do not show such a mean, because a constant form is the
    /// same as a change of size.
    pub fn sigma_of_form_mean(&self, parameter: usize) -> f64 {
        FORM * self.form_size * (self.point.effects[parameter] - PARAMETERS[parameter].null)
    }

    /// Sum of squares of the shared nuisances.
    pub fn squares(&self) -> f64 {
        self.point.shared.iter().map(|z| z * z).sum()
    }

    /// Mean square of the shared nuisances.
    pub fn pull(&self) -> f64 {
        self.squares() / self.point.shared.len().max(1) as f64
    }

    /// Whether the fit strains its tolerances.
    pub fn strains(&self) -> bool {
        self.pull() > STRAINED
    }

    /// The fit without its functions: they are eliminated from its curvature.
    pub fn marginal(&self) -> Self {
        let (gone, kept): (Vec<usize>, Vec<usize>) =
            (0..self.shared.len()).partition(|&k| matches!(self.shared[k], Coordinate::Missing(_)));
        if gone.is_empty() {
            return self.clone();
        }
        let all = &self.curvature;
        let part = |rows: &[usize], columns: &[usize]| all.select_rows(rows).select_columns(columns);
        let cross = part(&gone, &kept);
        let eliminated =
            part(&gone, &gone).cholesky().map_or_else(|| DMatrix::zeros(kept.len(), kept.len()), |c| cross.tr_mul(&c.solve(&cross)));
        Self {
            point: Point { missing: Vec::new(), ..self.point.clone() },
            shared: kept.iter().map(|&k| self.shared[k]).collect(),
            curvature: part(&kept, &kept) - eliminated,
            ..self.clone()
        }
    }

    /// Covariance of the shared coordinates.
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        self.curvature.clone().cholesky().map(|c| c.inverse())
    }
}

#[cfg(test)]
impl Fit {
    /// A fit without recordings along these coordinates, at the nominal car.
    pub fn made_up(along: Vec<Coordinate>) -> Self {
        let identity = DMatrix::identity(along.len(), along.len());
        Self {
            point: Point { shared: Vec::new(), own: Vec::new(), effects: crate::effects::null(), missing: Vec::new() },
            cost: 0.0,
            residuals: Arc::default(),
            misfits: [0.0; 3],
            shared: along,
            curvature: identity.clone(),
            log_evidence: 0.0,
            columns: Arc::default(),
            own: Vec::new(),
            parts: Arc::default(),
            strain: 0.0,
            form_size: 1.0,
            mean_covariance: None,
            exact: identity,
        }
    }
}

/// Mean square of the nuisances beyond which a fit strains its tolerances. By chance, the mean square of a dozen standard normal numbers exceeds it in 2 % of all cases, that of
/// sixteen in 1 %.
const STRAINED: f64 = 2.0;
/// Maximum number of steps that an iteration tries, and the factor by which their damping grows from one to the next, so that each is shorter than the one before.
const TRIES: usize = 7;
const SHRINK: f64 = 20.0;
/// Range of the ratio of a step's gain to the gain that the linear model predicted within which derivatives along nuisances are reused.
pub const TRUSTED_GAIN_RATIO: std::ops::Range<f64> = 0.7..1.5;
/// Gain of a step below which a fit ends, in the cost scaled by [`Problem::power`].
const LEAST_GAIN: f64 = 0.3;

/// [`LEAST_GAIN`] in the unscaled cost.
pub fn least_gain(problem: &Problem) -> f64 {
    LEAST_GAIN / problem.power()
}

/// Iterations of a look: a preliminary fit with the derivatives along nuisances that it was given.
pub const LOOK: usize = 2;

/// What is fitted beside the nuisances.
#[derive(Clone, Copy, Debug, Default)]
pub struct Free<'a> {
    /// Effects, by their index in the registry.
    pub effects: &'a [usize],
    /// Functions of a missing law.
    pub basis: Option<&'a Basis>,
}

/// Maximises the density from `start`. `known` are derivatives at a nearby point.
pub fn fit(problem: &Problem, free: Free, start: &Point, iterations: usize, known: Option<Known>) -> Fit {
    let missing = free.basis.map_or(0, Vec::len);
    let (shared, own) = coordinates(problem, free.effects, missing);
    let mut start = start.clone();
    start.missing.resize(missing, 0.0);
    along(problem, Frame { shared, own }, free.basis, &start, iterations, known)
}

/// As [`fit`], along these coordinates alone.
pub fn along(problem: &Problem, frame: Frame, basis: Option<&Basis>, start: &Point, iterations: usize, known: Option<Known>) -> Fit {
    let mut point = start.clone();
    let mut residuals = problem.all_residuals(&point, basis);
    let mut now = cost(&point, &residuals);
    let mut damping = 0.0_f64;
    let mut columns: Vec<Columns> = Vec::new();
    let mut kept = known.is_some();
    let mut done = 0;
    let least = least_gain(problem);
    while done < iterations {
        if !kept {
            // The old derivatives are released first, because the new ones take as much memory again.
            columns = Vec::new();
        }
        let old = match known {
            Some(known) if columns.is_empty() => known,
            _ => Known::Law(&columns),
        };
        columns = derivatives(problem, &point, basis, &residuals, &frame, kept.then_some(old));
        // How much damping reused derivatives needed says nothing about new ones.
        damping = if kept { damping } else { 0.0 };
        let (before, mut promised) = (now, f64::INFINITY);
        let parts = all_products(&columns, &residuals);
        for _ in 0..TRIES {
            let Some(equations) = assemble(&point, &frame, &parts, damping) else {
                damping = (damping * SHRINK).max(1.0);
                continue;
            };
            let Some(step) = bounded_step(problem, &equations, &frame, &point) else {
                damping = (damping * SHRINK).max(1.0);
                continue;
            };
            let this = promise(&equations, &step);
            promised = if promised.is_finite() { promised } else { this };
            let trial = moved(problem, &frame, &equations, &point, &step);
            if !problem.can_follow(&trial) {
                damping = (damping * SHRINK).max(1.0);
                continue;
            }
            let there = problem.all_residuals(&trial, basis);
            let cost_there = cost(&trial, &there);
            if cost_there < now {
                promised = this;
                (point, residuals, now) = (trial, there, cost_there);
                damping = if damping < 0.1 { 0.0 } else { damping * 0.1 };
                break;
            }
            // The linear model promises next to nothing, as at a mode; shorter steps would promise even less.
            if promised < least {
                break;
            }
            damping = (damping * SHRINK).max(1.0);
        }
        let gain = before - now;
        let looks = iterations <= LOOK;
        // A full fit ends only where new derivatives lead to no further gain. A look also ends where reused derivatives promise no gain, or predicted it badly.
        if gain < least && (!kept || looks && promised < least) || (kept && looks && !TRUSTED_GAIN_RATIO.contains(&(gain / promised))) {
            break;
        }
        let keeps_its_word = gain >= least && TRUSTED_GAIN_RATIO.contains(&(gain / promised));
        // A step with reused derivatives that predicted its gain badly does not count as an iteration.
        done += usize::from(keeps_its_word || !kept);
        kept = keeps_its_word;
    }
    let parts = by_phase(problem, &columns, &residuals);
    let equations = assemble(&point, &frame, &to_powers(&parts, WHOLE), 0.0);
    let (curvature, log_evidence): (DMatrix<f64>, f64) = match equations {
        Some(e) => {
            let evidence = laplace(now, &e);
            (e.curvature, evidence)
        }
        None => (DMatrix::identity(frame.shared.len(), frame.shared.len()), f64::NEG_INFINITY),
    };
    let Frame { shared, own } = frame;
    let misfits = problem.misfits(&residuals);
    Fit {
        point,
        cost: now,
        residuals: Arc::new(residuals),
        misfits,
        shared,
        exact: curvature.clone(),
        curvature,
        log_evidence,
        columns: Arc::new(columns),
        own,
        parts: Arc::new(parts),
        strain: 0.0,
        form_size: 1.0,
        mean_covariance: None,
    }
}

/// Logarithm of the evidence by Laplace's approximation: density at the mode times the ratio of posterior to prior volume.
pub fn laplace(cost: f64, equations: &Normal) -> f64 {
    let Some(root) = equations.curvature.clone().cholesky() else { return f64::NEG_INFINITY };
    let log_det = 2.0 * root.l_dirty().diagonal().map(f64::ln).sum() + equations.log_det_own;
    -0.5 * cost - 0.5 * log_det + 0.5 * equations.log_det_prior
}

pub(super) fn promise(equations: &Normal, step: &DVector<f64>) -> f64 {
    // The own unknowns follow the shared ones; what they gain while the shared ones stay fixed is included.
    let own: f64 = equations.eliminated.iter().map(|e| e.gain()).sum();
    own - 2.0 * equations.gradient.dot(step) - (&equations.curvature * step).dot(step)
}

pub(super) fn moved(problem: &Problem, frame: &Frame, equations: &Normal, point: &Point, step: &DVector<f64>) -> Point {
    let mut trial = point.clone();
    for (c, s) in frame.shared.iter().zip(step.iter()) {
        c.move_by(problem, &mut trial, 0, *s);
    }
    for (r, e) in equations.eliminated.iter().enumerate() {
        for (c, s) in frame.own.iter().zip(e.step(step).iter()) {
            c.move_by(problem, &mut trial, r, *s);
        }
    }
    trial
}

/// Point to which a Gauss–Newton step within the bounds leads; None if the curvature is not positive definite.
pub fn stepped(problem: &Problem, frame: &Frame, equations: &Normal, point: &Point) -> Option<Point> {
    bounded_step(problem, equations, frame, point).map(|step| moved(problem, frame, equations, point, &step))
}

/// Gauss–Newton step within the bounds: the minimum of the quadratic model over the box of moves that the bounds leave possible, by the primal active-set method (Nocedal and
/// Wright, "Numerical Optimization", 2nd edition, algorithm 16.3). A coordinate that was stopped at its bound is released where the model falls inwards.
pub(super) fn bounded_step(problem: &Problem, equations: &Normal, frame: &Frame, point: &Point) -> Option<DVector<f64>> {
    let n = frame.shared.len();
    let room = |k: usize| [-FAR, FAR].map(|by| frame.shared[k].room(problem, point, 0, by));
    let bounds: Vec<[f64; 2]> = (0..n).map(room).collect();
    least_in_box(&equations.curvature, &equations.gradient, &bounds)
}

/// Further than any step.
const FAR: f64 = 1e9;

/// Minimises ½ sᵀHs + gᵀs with every component of s between its two bounds, which have zero between them; None if H is not positive definite.
fn least_in_box(curvature: &DMatrix<f64>, gradient: &DVector<f64>, bounds: &[[f64; 2]]) -> Option<DVector<f64>> {
    let n = bounds.len();
    let mut step = DVector::zeros(n);
    let outwards = |k: usize, slope: f64, at: f64| (at <= bounds[k][0] && slope > 0.0) || (at >= bounds[k][1] && slope < 0.0);
    let mut stopped: Vec<bool> = (0..n).map(|k| outwards(k, gradient[k], 0.0)).collect();
    // Each round stops a coordinate or releases one while the model falls, so that the iteration ends, in practice after a few rounds.
    for _ in 0..4 * n.max(4) {
        let (mut h, mut downhill) = (curvature.clone(), -(gradient + curvature * &step));
        for k in (0..n).filter(|k| stopped[*k]) {
            h.row_mut(k).fill(0.0);
            h.column_mut(k).fill(0.0);
            (h[(k, k)], downhill[k]) = (1.0, 0.0);
        }
        let to = h.cholesky()?.solve(&downhill);
        let share = |k: usize| {
            let [least, most] = bounds[k];
            let (from, by) = (step[k], to[k]);
            if from + by > most {
                (most - from) / by
            } else if from + by < least {
                (least - from) / by
            } else {
                1.0
            }
        };
        let first = (0..n).filter(|&k| !stopped[k] && share(k) < 1.0).min_by(|&a, &b| share(a).total_cmp(&share(b)));
        if let Some(k) = first {
            let bound = if to[k] > 0.0 { bounds[k][1] } else { bounds[k][0] };
            step += &to * share(k);
            (step[k], stopped[k]) = (bound, true);
            continue;
        }
        step += to;
        let slope = gradient + curvature * &step;
        let inwards = (0..n).filter(|&k| stopped[k] && !outwards(k, slope[k], step[k]) && slope[k] != 0.0);
        let Some(free) = inwards.max_by(|&a, &b| {
            let gain = |k: usize| slope[k] * slope[k] / curvature[(k, k)];
            gain(a).total_cmp(&gain(b))
        }) else {
            break;
        };
        stopped[free] = false;
    }
    Some(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tolerances_are_strained_beyond_a_mean_square_of_two() {
        let mut fit = Fit::made_up(Vec::new());
        assert!(!fit.strains() && fit.pull() == 0.0);
        for (shared, pull) in [(vec![1.0, -3.0], 5.0), (vec![2.0, 0.0, 1.4], 1.986_667), (vec![2.0, 0.0, 1.45], 2.034_167)] {
            fit.point.shared = shared;
            assert!((fit.pull() - pull).abs() < 1e-6 && fit.strains() == (pull > 2.0), "{}", fit.pull());
        }
    }

    /// Two shared unknowns and one function: eliminating the function leaves a curvature whose inverse is the unknowns' block of the covariance.
    #[test]
    fn a_fit_without_its_functions_has_the_covariance_that_it_had() {
        let along = vec![Coordinate::Shared(0), Coordinate::Missing(0), Coordinate::Shared(1)];
        let curvature = DMatrix::from_row_slice(3, 3, &[4.0, 1.0, 0.5, 1.0, 3.0, -1.0, 0.5, -1.0, 2.0]);
        let mut fit = Fit { curvature, ..Fit::made_up(along) };
        fit.point.missing = vec![0.7];
        let (whole, rest) = (fit.covariance().unwrap(), fit.marginal());
        assert_eq!(rest.shared, [Coordinate::Shared(0), Coordinate::Shared(1)]);
        assert!(rest.point.missing.is_empty());
        let left = rest.covariance().unwrap();
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            assert!((left[(i, j)] - whole[(2 * i, 2 * j)]).abs() < 1e-12);
        }
        assert_eq!(rest.marginal().shared.len(), 2);
    }

    /// The mean over the accuracies is that of covariances, not of curvatures. There is none if one of the curvatures is not positive definite.
    #[test]
    fn covariances_are_the_mean_over_accuracies() {
        let with = |curvature: f64| {
            let mut fit = Fit::made_up(vec![Coordinate::Shared(0), Coordinate::Shared(1)]);
            fit.curvature[(1, 1)] = curvature;
            fit
        };
        let found = mean_covariance([with(1.0), with(0.5), with(0.25)]).unwrap().diagonal();
        assert!((found[0] - 1.0).abs() < 1e-12 && (found[1] - 7.0 / 3.0).abs() < 1e-12, "{found:?}");
        assert_eq!(mean_covariance([with(1.0), with(-1.0), with(1.0)]), None);
    }

    /// First case: the second coordinate is stopped at its bound from the beginning, and only the first one moves. Second case: the unconstrained minimum violates the bounds of
    /// both coordinates; with the second one at its bound, the first one remains within its own.
    #[test]
    fn a_coordinate_that_was_stopped_is_let_go_where_the_model_falls_inwards() {
        let h = DMatrix::from_row_slice(2, 2, &[1.0, 0.9, 0.9, 1.0]);
        let g = DVector::from_vec(vec![-0.3, 1.0]);
        let both = [[0.0, f64::INFINITY], [0.0, f64::INFINITY]];
        let s = least_in_box(&h, &g, &both).unwrap();
        assert!((s[0] - 0.3).abs() < 1e-12 && s[1] == 0.0, "{s}");
        let far = DVector::from_vec(vec![1.0, -3.0]);
        let s = least_in_box(&h, &far, &[[-5.0, 5.0], [-5.0, 2.0]]).unwrap();
        assert!((s[1] - 2.0).abs() < 1e-12 && (s[0] + 2.8).abs() < 1e-12, "{s}");
    }

    /// Comparison with all combinations of active bounds: the result is as low as the lowest of their feasible minima.
    #[test]
    fn the_least_in_a_box_is_the_least_of_all_its_faces() {
        let mut seed = 7_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        for _ in 0..200 {
            let a = DMatrix::from_fn(4, 4, |_, _| random());
            let h = &a * a.transpose() + DMatrix::identity(4, 4) * 0.01;
            let g = DVector::from_fn(4, |_, _| random());
            let bounds: Vec<[f64; 2]> = (0..4).map(|_| [-(random() + 0.5).max(0.0), (random() + 0.3).max(0.0)]).collect();
            let value = |s: &DVector<f64>| 0.5 * (&h * s).dot(s) + g.dot(s);
            let found = least_in_box(&h, &g, &bounds).unwrap();
            let mut least = f64::INFINITY;
            for face in 0..3_usize.pow(4) {
                let side = |k: usize| face / 3_usize.pow(k as u32) % 3;
                let (mut m, mut b) = (h.clone(), -g.clone());
                for k in (0..4).filter(|k| side(*k) < 2) {
                    let at = bounds[k][side(k)];
                    b -= m.column(k) * at;
                    m.row_mut(k).fill(0.0);
                    m.column_mut(k).fill(0.0);
                    (m[(k, k)], b[k]) = (1.0, at);
                }
                let s = m.cholesky().unwrap().solve(&b);
                if (0..4).all(|k| s[k] >= bounds[k][0] - 1e-12 && s[k] <= bounds[k][1] + 1e-12) {
                    least = least.min(value(&s));
                }
            }
            assert!((0..4).all(|k| found[k] >= bounds[k][0] - 1e-12 && found[k] <= bounds[k][1] + 1e-12));
            assert!(value(&found) <= least + 1e-9, "{} instead of {least}", value(&found));
        }
    }
}
