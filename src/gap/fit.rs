//! Fit of a hypothesis: a set of effects together with every tolerance and start temperature.
//!
//! Levenberg–Marquardt on the cost of [`super::problem`], with derivatives that are kept while they serve.

use super::coordinate::{Coordinate, coordinates};
use super::derivatives::{Columns, derivatives, normal_equations};
use super::problem::{Point, Problem, Residuals};
use nalgebra::{DMatrix, DVector};

/// Outcome of a fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// Where the cost is least.
    pub point: Point,
    /// Cost there.
    pub cost: f64,
    /// Residuals there.
    pub residuals: Vec<Residuals>,
    /// Free coordinates.
    pub coordinates: Vec<Coordinate>,
    /// Curvature of half the cost there.
    pub curvature: DMatrix<f64>,
}

/// Steps that an iteration tries, each shorter than the one before.
const TRIES: usize = 7;
/// Factor on the damping of a step that led nowhere.
const SHRINK: f64 = 20.0;

/// Rounds in which parameters that would leave their bounds are stopped there.
const STOPS: usize = 4;

/// Damped Gauss–Newton step within the bounds of effect parameters: one that would leave is stopped at its bound, and the others move for
/// themselves, not as if it had gone on.
fn bounded_step(h: &DMatrix<f64>, g: &DVector<f64>, damping: f64, coordinates: &[Coordinate], point: &Point) -> Option<DVector<f64>> {
    let (mut curvature, mut downhill) = (h.clone(), -g);
    for (k, c) in coordinates.iter().enumerate() {
        curvature[(k, k)] += damping * c.unit();
    }
    let mut stopped = vec![false; coordinates.len()];
    for _ in 0..STOPS {
        let step = curvature.clone().cholesky()?.solve(&downhill);
        let room = |k: usize| coordinates[k].room(point, step[k]);
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

/// Ratio of a step's gain to what the linear model promised within which the derivatives along tolerances are kept for the next step.
const KEEPS_ITS_WORD: std::ops::Range<f64> = 0.7..1.5;
/// Gain of a step below which a fit ends.
const LEAST_GAIN: f64 = 0.5;

/// Minimises the cost over nuisances, start temperatures and the parameters of `effects`, from `start`. Derivatives along tolerances cost
/// most of a fit and change little: they are kept while the linear model keeps its word. `known` are those of a place nearby.
pub fn fit(problem: &Problem, effects: &[usize], start: &Point, iterations: usize, known: Option<&[Columns]>) -> Fit {
    fit_along(problem, coordinates(problem, effects), start, iterations, known)
}

/// As [`fit`], along these coordinates alone.
pub fn fit_along(problem: &Problem, coordinates: Vec<Coordinate>, start: &Point, iterations: usize, known: Option<&[Columns]>) -> Fit {
    let mut point = start.clone();
    let mut residuals = problem.all_residuals(&point);
    let mut cost = problem.cost(&point, &residuals);
    // Damping is in units of tolerances: an effect and the tolerance that it resembles share a valley, flat but for the
    // prior, along which damping in proportion to the curvature would hardly move.
    let mut damping = 0.0_f64;
    let mut curvature = DMatrix::identity(coordinates.len(), coordinates.len());
    let mut columns: Vec<Columns> = Vec::new();
    let mut kept = known.is_some();
    let mut done = 0;
    while done < iterations {
        let old = match known {
            Some(known) if columns.is_empty() => known,
            _ => &columns,
        };
        columns = derivatives(problem, &point, &residuals, &coordinates, kept.then_some(old));
        let (h, g) = normal_equations(&point, &residuals, &columns, &coordinates);
        let before = cost;
        let mut promised = f64::INFINITY;
        for _ in 0..TRIES {
            let Some(step) = bounded_step(&h, &g, damping, &coordinates, &point) else {
                damping = (damping * SHRINK).max(1.0);
                continue;
            };
            let mut trial = point.clone();
            for (c, s) in coordinates.iter().zip(step.iter()) {
                trial = c.moved(&trial, *s);
            }
            if !problem.can_follow(&trial) {
                damping = (damping * SHRINK).max(1.0);
                continue;
            }
            let there = problem.all_residuals(&trial);
            let cost_there = problem.cost(&trial, &there);
            if cost_there < cost {
                promised = -2.0 * g.dot(&step) - (&h * &step).dot(&step);
                (point, residuals, cost) = (trial, there, cost_there);
                damping = if damping < 0.1 { 0.0 } else { damping * 0.1 };
                break;
            }
            damping = (damping * SHRINK).max(1.0);
        }
        curvature = h;
        let gain = before - cost;
        if !kept && gain < LEAST_GAIN {
            break;
        }
        let keeps_its_word = gain >= LEAST_GAIN && KEEPS_ITS_WORD.contains(&(gain / promised));
        // A step from kept derivatives that broke its word was only a try.
        done += usize::from(keeps_its_word || !kept);
        kept = keeps_its_word;
    }
    Fit { point, cost, residuals, coordinates, curvature }
}
