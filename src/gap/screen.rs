//! Screening: what every effect could explain, from one replay per start.
//!
//! At a fitted point each effect is set to each of its starts and the recordings are replayed once. Along that change and
//! the derivatives of everything already free, the cost is minimised as if residuals were linear. The best start of each effect is where its
//! real fit begins; the order of their costs says which effects are worth one.

use super::fit::{self, Columns, Coordinate, Fit, Point, Problem, Residuals};
use super::pulsation;
use crate::effects::{Act, Entry, PARAMETERS, REGISTRY};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// An effect that may be missing, where its fit should start, and the cost that the linear model promises.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Place in the registry.
    pub effect: usize,
    /// Where to start the fit.
    pub start: Point,
    /// Promised cost.
    pub promise: f64,
}

/// The anchor of a screening: a point, its residuals, and their derivatives along what is free there.
pub struct Anchor {
    point: Point,
    residuals: Vec<Residuals>,
    coordinates: Vec<Coordinate>,
    columns: Columns,
}

impl Anchor {
    /// Differentiates at `point` along nuisances and the parameters of `effects`.
    pub fn new(problem: &Problem, point: &Point, effects: &[usize]) -> Self {
        let residuals = problem.all_residuals(point);
        let coordinates = fit::coordinates(problem, effects);
        let columns = fit::derivatives(problem, point, &residuals, &coordinates);
        Self { point: point.clone(), residuals, coordinates, columns }
    }

    /// At a fit.
    pub fn at(problem: &Problem, fit: &Fit, effects: &[usize]) -> Self {
        Self::new(problem, &fit.point, effects)
    }
}

/// Candidates among the effects that are not in `already`, the most promising first.
pub fn screen(problem: &Problem, anchor: &Anchor, already: &[usize]) -> Vec<Candidate> {
    let tasks: Vec<(usize, Point)> = (0..REGISTRY.len())
        .filter(|e| !already.contains(e))
        .flat_map(|e| starts(problem, anchor, &REGISTRY[e]).into_iter().map(move |p| (e, p)))
        .collect();
    let all: Vec<Candidate> = tasks.into_par_iter().filter_map(|(effect, start)| promise(problem, anchor, effect, start)).collect();
    let mut best: Vec<Candidate> = Vec::new();
    for candidate in all {
        match best.iter_mut().find(|b| b.effect == candidate.effect) {
            Some(b) if b.promise <= candidate.promise => {}
            Some(b) => *b = candidate,
            None => best.push(candidate),
        }
    }
    best.sort_by(|a, b| a.promise.total_cmp(&b.promise).then(a.effect.cmp(&b.effect)));
    best
}

fn starts(problem: &Problem, anchor: &Anchor, entry: &Entry) -> Vec<Point> {
    if let Act::Pulsation(_) = entry.effect.act {
        return pulsation::starts(problem, &anchor.point, &anchor.residuals, entry);
    }
    let at = |start: &&[(usize, f64)]| {
        let mut point = anchor.point.clone();
        for (k, value) in start.iter() {
            point.effects[*k] = *value;
        }
        point
    };
    entry.effect.starts.iter().map(at).collect()
}

/// Range of the factor on a start's amplitude that the linear model may ask for.
const AMPLITUDE_FACTOR: std::ops::RangeInclusive<f64> = 0.05..=3.0;

/// Rounds of reweighting in the linear model.
const ROUNDS: usize = 3;

fn promise(problem: &Problem, anchor: &Anchor, effect: usize, start: Point) -> Option<Candidate> {
    let there: Vec<Residuals> = (0..problem.series.len()).map(|k| problem.residuals(k, &start)).collect();
    let n = anchor.coordinates.len();
    let mut step = DVector::zeros(n + 1);
    let mut residuals = there.clone();
    for _ in 0..ROUNDS {
        let (curvature, gradient) = equations(anchor, &there, &residuals);
        step = -curvature.cholesky()?.solve(&gradient);
        step[n] = (1.0 + step[n]).clamp(*AMPLITUDE_FACTOR.start(), *AMPLITUDE_FACTOR.end()) - 1.0;
        residuals = linear(anchor, &there, &step);
    }
    let mut point = start;
    let mut moved = point.clone();
    for (c, s) in anchor.coordinates.iter().zip(step.iter()) {
        moved = c.moved(&moved, *s);
    }
    let promise = residuals.iter().flatten().map(|r| fit::huber(*r)).sum::<f64>() + fit::prior(&moved);
    for &k in REGISTRY[effect].effect.amplitudes {
        let null = PARAMETERS[k].null;
        point.effects[k] = (null + (1.0 + step[n]) * (point.effects[k] - null)).clamp(PARAMETERS[k].min, PARAMETERS[k].max);
    }
    Some(Candidate { effect, start: point, promise })
}

/// Normal equations around the start, weighted as the present residuals ask; the last unknown is the change of amplitude.
fn equations(anchor: &Anchor, there: &[Residuals], present: &[Residuals]) -> (DMatrix<f64>, DVector<f64>) {
    let n = anchor.coordinates.len();
    let (mut curvature, mut gradient) = (DMatrix::zeros(n + 1, n + 1), DVector::zeros(n + 1));
    for (r, own) in anchor.columns.iter().enumerate() {
        let direction: Vec<f64> = there[r].iter().zip(&anchor.residuals[r]).map(|(a, b)| a - b).collect();
        let weights: Vec<f64> = present[r].iter().map(|r| fit::weight(*r)).collect();
        let columns: Vec<(usize, &[f64])> = own.iter().map(|(c, v)| (*c, v.as_slice())).chain([(n, direction.as_slice())]).collect();
        for (i, (ci, a)) in columns.iter().enumerate() {
            let weighted: Vec<f64> = a.iter().zip(&weights).map(|(a, w)| a * w).collect();
            gradient[*ci] += fit::dot(&weighted, &there[r]);
            for (cj, b) in &columns[..=i] {
                let h = fit::dot(&weighted, b);
                curvature[(*ci, *cj)] += h;
                if ci != cj {
                    curvature[(*cj, *ci)] += h;
                }
            }
        }
    }
    fit::add_prior(&anchor.point, &anchor.coordinates, &mut curvature, &mut gradient);
    curvature[(n, n)] += 1e-6;
    (curvature, gradient)
}

fn linear(anchor: &Anchor, there: &[Residuals], step: &DVector<f64>) -> Vec<Residuals> {
    let n = anchor.coordinates.len();
    let mut all = there.to_vec();
    for (r, own) in anchor.columns.iter().enumerate() {
        for (k, value) in all[r].iter_mut().enumerate() {
            *value += step[n] * (there[r][k] - anchor.residuals[r][k]);
        }
        for (c, column) in own {
            for (value, d) in all[r].iter_mut().zip(column) {
                *value += step[*c] * d;
            }
        }
    }
    all
}
