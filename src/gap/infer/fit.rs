//! Fit of a hypothesis: the mode of the joint density, and its evidence by Laplace's approximation there.
//!
//! Levenberg–Marquardt with derivatives along nuisances that are kept while the linear model keeps its word.

use super::coordinate::{Coordinate, coordinates};
use super::density::{Basis, Point, Problem, Residuals, cost};
use super::linear::{Columns, Frame, Normal, derivatives, normal};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Outcome of a fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// Mode.
    pub point: Point,
    /// Minus twice the logarithm of the density there, up to a constant of the recordings.
    pub cost: f64,
    /// Innovations there.
    pub residuals: Vec<Residuals>,
    /// Coordinates that all recordings share.
    pub shared: Vec<Coordinate>,
    /// Curvature of half the cost along them, own unknowns eliminated.
    pub curvature: DMatrix<f64>,
    /// Logarithm of the evidence, nats, up to a constant of the recordings.
    pub log_evidence: f64,
    /// Derivatives near the mode; empty once they were let go.
    pub columns: Arc<Vec<Columns>>,
}

impl Fit {
    /// Derivatives at the mode, worked out anew if they were let go.
    pub fn derivatives(&self, problem: &Problem, frame: &Frame, basis: Option<&Basis>) -> Arc<Vec<Columns>> {
        if self.columns.is_empty() {
            return Arc::new(derivatives(problem, &self.point, basis, &self.residuals, frame, None));
        }
        self.columns.clone()
    }

    /// Derivatives as another fit takes them over.
    pub fn known(&self) -> Option<&[Columns]> {
        (!self.columns.is_empty()).then_some(self.columns.as_slice())
    }

    /// Covariance of the shared coordinates.
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        self.curvature.clone().cholesky().map(|c| c.inverse())
    }
}

/// Steps that an iteration tries, each shorter than the one before, and the factor on their damping.
const TRIES: usize = 7;
const SHRINK: f64 = 20.0;
/// Rounds in which parameters that would leave their bounds are stopped there.
const STOPS: usize = 4;
/// Ratio of a step's gain to what the linear model promised within which derivatives along nuisances are kept.
const KEEPS_ITS_WORD: std::ops::Range<f64> = 0.7..1.5;
/// Gain of a step, in units of the cost, below which a fit ends.
const LEAST_GAIN: f64 = 0.3;

/// Iterations of a fit that only looks: it lives on the derivatives along nuisances that it was given.
pub const LOOK: usize = 2;

/// What is fitted beside the nuisances.
#[derive(Clone, Copy, Debug, Default)]
pub struct Free<'a> {
    /// Effects, by their place in the registry.
    pub effects: &'a [usize],
    /// Functions of a missing law.
    pub basis: Option<&'a Basis>,
}

/// Maximises the density from `start`. `known` are derivatives along nuisances of a place nearby.
pub fn fit(problem: &Problem, free: Free, start: &Point, iterations: usize, known: Option<&[Columns]>) -> Fit {
    let missing = free.basis.map_or(0, Vec::len);
    let (shared, own) = coordinates(problem, free.effects, missing);
    let mut start = start.clone();
    start.missing.resize(missing, 0.0);
    along(problem, Frame { shared, own }, free.basis, &start, iterations, known)
}

/// As [`fit`], along these coordinates alone.
pub fn along(problem: &Problem, frame: Frame, basis: Option<&Basis>, start: &Point, iterations: usize, known: Option<&[Columns]>) -> Fit {
    let mut point = start.clone();
    let mut residuals = problem.all_residuals(&point, basis);
    let mut now = cost(&point, &residuals);
    let mut damping = 0.0_f64;
    let mut columns: Vec<Columns> = Vec::new();
    let mut kept = known.is_some();
    let mut done = 0;
    while done < iterations {
        let old = match known {
            Some(known) if columns.is_empty() => known,
            _ => &columns,
        };
        columns = derivatives(problem, &point, basis, &residuals, &frame, kept.then_some(old));
        let (before, mut promised) = (now, f64::INFINITY);
        for _ in 0..TRIES {
            let Some(equations) = normal(&point, &frame, &columns, &residuals, damping) else {
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
            damping = (damping * SHRINK).max(1.0);
        }
        let gain = before - now;
        let looks = iterations <= LOOK;
        // What kept derivatives say is enough for a look; a mode is where new ones promise nothing more.
        if gain < LEAST_GAIN && (!kept || looks && promised < LEAST_GAIN) || (kept && looks && !KEEPS_ITS_WORD.contains(&(gain / promised)))
        {
            break;
        }
        let keeps_its_word = gain >= LEAST_GAIN && KEEPS_ITS_WORD.contains(&(gain / promised));
        // A step from kept derivatives that broke its word was only a try.
        done += usize::from(keeps_its_word || !kept);
        kept = keeps_its_word;
    }
    let equations = normal(&point, &frame, &columns, &residuals, 0.0);
    let (curvature, log_evidence) = match equations {
        Some(e) => {
            let evidence = laplace(now, &e, &frame);
            (e.curvature, evidence)
        }
        None => (DMatrix::identity(frame.shared.len(), frame.shared.len()), f64::NEG_INFINITY),
    };
    Fit { point, cost: now, residuals, shared: frame.shared, curvature, log_evidence, columns: Arc::new(columns) }
}

/// Logarithm of the evidence: density at the mode times the volume that the posterior leaves of the prior.
pub fn laplace(cost: f64, equations: &Normal, frame: &Frame) -> f64 {
    let Some(root) = equations.curvature.clone().cholesky() else { return f64::NEG_INFINITY };
    let log_det = 2.0 * root.l_dirty().diagonal().map(f64::ln).sum() + equations.log_det_own;
    let prior: f64 = frame.shared.iter().map(|c| c.precision().ln()).sum();
    -0.5 * cost - 0.5 * log_det + 0.5 * prior
}

fn promise(equations: &Normal, step: &DVector<f64>) -> f64 {
    // Own unknowns move along; what they gain where they stand is part of it.
    let own: f64 = equations.eliminated.iter().map(|e| e.gain()).sum();
    own - 2.0 * equations.gradient.dot(step) - (&equations.curvature * step).dot(step)
}

fn moved(problem: &Problem, frame: &Frame, equations: &Normal, point: &Point, step: &DVector<f64>) -> Point {
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

/// Gauss–Newton step within the bounds: a coordinate that would leave is stopped at its bound, and the others move for themselves.
fn bounded_step(problem: &Problem, equations: &Normal, frame: &Frame, point: &Point) -> Option<DVector<f64>> {
    let (mut curvature, mut downhill) = (equations.curvature.clone(), -equations.gradient.clone());
    let mut stopped = vec![false; frame.shared.len()];
    for _ in 0..STOPS {
        let step = curvature.clone().cholesky()?.solve(&downhill);
        let room = |k: usize| frame.shared[k].room(problem, point, 0, step[k]);
        let leaving: Vec<usize> = (0..step.len()).filter(|&k| !stopped[k] && room(k) != step[k]).collect();
        if leaving.is_empty() {
            return Some(step);
        }
        for k in leaving {
            stopped[k] = true;
            let to_bound = room(k);
            downhill -= curvature.column(k) * to_bound;
            curvature.row_mut(k).fill(0.0);
            curvature.column_mut(k).fill(0.0);
            curvature[(k, k)] = 1.0;
            downhill[k] = to_bound;
        }
    }
    curvature.cholesky().map(|c| c.solve(&downhill))
}
