//! Screening: what every effect could explain, from one replay per start.
//!
//! At a fitted point each effect is set to each of its starts and the recordings are replayed once. Along that change and
//! the derivatives of everything already free, the cost is minimised as if residuals were linear. The best start of each effect is where its
//! real fit begins; the order of their costs says which effects are worth one.

use super::coordinate::{Coordinate, coordinates};
use super::derivatives::{Columns, add_prior, add_products, derivatives};
use super::fit::Fit;
use super::problem::{Point, Problem, Residuals, huber, prior, weight};
use super::pulsation;
use crate::effects::{Act, Entry, PARAMETERS, Parameters, REGISTRY};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// An effect that may be missing, where its fit should start, and the cost that the linear model promises.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Place in the registry.
    pub effect: usize,
    /// Anchor from which it was found.
    pub anchor: usize,
    /// Where to start the fit.
    pub start: Point,
    /// The effects as they were replayed, before the linear model moved them.
    pub replayed: Parameters,
    /// Cost of that replay.
    pub cost: f64,
    /// Promised cost.
    pub promise: f64,
}

impl Candidate {
    /// Of two starts of one effect from one anchor: the better promise, and the replay that came nearest.
    fn join(&mut self, other: Candidate) {
        let nearest = if other.cost < self.cost { (other.replayed, other.cost) } else { (self.replayed, self.cost) };
        if other.promise < self.promise {
            *self = other;
        }
        (self.replayed, self.cost) = nearest;
    }
}

/// The anchor of a screening: a point, its residuals, and their derivatives along what is free there.
pub struct Anchor {
    point: Point,
    residuals: Vec<Residuals>,
    coordinates: Vec<Coordinate>,
    columns: Vec<Columns>,
    trades: bool,
}

impl Anchor {
    /// Differentiates at `point` along nuisances and the parameters of `effects`; `trades` says whether the nuisances there may hide
    /// an effect.
    pub fn new(problem: &Problem, point: &Point, effects: &[usize], trades: bool) -> Self {
        let residuals = problem.all_residuals(point);
        let coordinates = coordinates(problem, effects);
        let columns = derivatives(problem, point, &residuals, &coordinates, None);
        Self { point: point.clone(), residuals, coordinates, columns, trades }
    }

    /// The point.
    pub fn point(&self) -> &Point {
        &self.point
    }

    /// Derivatives along what is free there.
    pub fn columns(&self) -> &[Columns] {
        &self.columns
    }

    /// At a fit.
    pub fn at(problem: &Problem, fit: &Fit, effects: &[usize]) -> Self {
        Self::new(problem, &fit.point, effects, true)
    }
}

/// Candidates among the effects that are not in `already`, the most promising first: the best start of each effect
/// from each anchor.
pub fn screen(problem: &Problem, anchors: &[Anchor], already: &[usize]) -> Vec<Candidate> {
    let fresh = (0..REGISTRY.len()).filter(|e| !already.contains(e));
    let tasks: Vec<(usize, usize, Point, f64)> = fresh
        .flat_map(|e| anchors.iter().enumerate().map(move |(a, anchor)| (e, a, anchor)))
        .flat_map(|(e, a, anchor)| starts(problem, anchor, &REGISTRY[e]).into_iter().map(move |(p, most)| (e, a, p, most)))
        .collect();
    let promised = |(effect, a, start, most): (usize, usize, Point, f64)| {
        promise(problem, &anchors[a], effect, start, most).map(|c| Candidate { anchor: a, ..c })
    };
    let all: Vec<Option<Candidate>> = tasks.into_par_iter().map(promised).collect();
    let mut best: Vec<Candidate> = Vec::new();
    for candidate in all.into_iter().flatten() {
        // Orders of a pulsation do not lead to each other: each of its starts is a candidate.
        let alone = matches!(REGISTRY[candidate.effect].effect.act, Act::Pulsation(_));
        match best.iter_mut().find(|b| !alone && (b.effect, b.anchor) == (candidate.effect, candidate.anchor)) {
            Some(b) => b.join(candidate),
            None => best.push(candidate),
        }
    }
    best.sort_by(|a, b| a.promise.total_cmp(&b.promise).then(a.effect.cmp(&b.effect)));
    best
}

/// Points to replay, each with the greatest factor on its amplitude that the linear model may ask for.
fn starts(problem: &Problem, anchor: &Anchor, entry: &Entry) -> Vec<(Point, f64)> {
    if let Act::Pulsation(_) = entry.effect.act {
        let found = pulsation::starts(problem, &anchor.point, &anchor.residuals, entry);
        return found.into_iter().map(|p| (p, LARGEST_FACTOR)).collect();
    }
    let at = |start: &[(usize, f64)], share: f64| {
        let mut point = anchor.point.clone();
        for &(k, value) in start {
            let null = PARAMETERS[k].null;
            let amplitude = entry.effect.amplitudes.contains(&k);
            point.effects[k] = if amplitude { null + share * (value - null) } else { value };
        }
        (point, LARGEST_FACTOR / share)
    };
    let whole = entry.effect.starts.iter().map(|s| at(s, 1.0));
    // An effect that resembles a tolerance has to trade with it: only a small step is linear enough for that.
    let small = entry.effect.starts.iter().filter(|_| anchor.trades).map(|s| at(s, SMALL_SHARE));
    whole.chain(small).collect()
}

/// Factors on a start's amplitude that the linear model may ask for.
const SMALLEST_FACTOR: f64 = 0.05;
const LARGEST_FACTOR: f64 = 3.0;

/// Share of a start's amplitude in a small step.
const SMALL_SHARE: f64 = 0.01;

/// Move of a nuisance in standard deviations up to which a linear step is taken over into the start of a fit.
const CREDIBLE: f64 = 20.0;

/// Rounds of reweighting in the linear model.
const ROUNDS: usize = 3;

fn promise(problem: &Problem, anchor: &Anchor, effect: usize, start: Point, most: f64) -> Option<Candidate> {
    let there: Vec<Residuals> = (0..problem.series.len()).map(|k| problem.residuals(k, &start)).collect();
    let n = anchor.coordinates.len();
    let mut step = DVector::zeros(n + 1);
    let mut residuals = there.clone();
    for _ in 0..ROUNDS {
        let (curvature, gradient) = equations(anchor, &there, &residuals);
        step = -curvature.cholesky()?.solve(&gradient);
        step[n] = (1.0 + step[n]).clamp(SMALLEST_FACTOR, most) - 1.0;
        residuals = linear(anchor, &there, &step);
    }
    let mut point = start.clone();
    let mut moved = point.clone();
    for (c, s) in anchor.coordinates.iter().zip(step.iter()) {
        moved = c.moved(&moved, *s);
    }
    let promise = residuals.iter().flatten().map(|r| huber(*r)).sum::<f64>() + prior(&moved);
    // Moderate moves of the nuisances are taken over, wild ones are not believed.
    if moved.z.iter().zip(&point.z).all(|(a, b)| (a - b).abs() < CREDIBLE) {
        point = moved;
    }
    for &k in REGISTRY[effect].effect.amplitudes {
        let null = PARAMETERS[k].null;
        point.effects[k] = (null + (1.0 + step[n]) * (point.effects[k] - null)).clamp(PARAMETERS[k].min, PARAMETERS[k].max);
    }
    let cost = problem.cost(&start, &there);
    Some(Candidate { effect, anchor: 0, replayed: start.effects, cost, start: point, promise })
}

/// Normal equations around the start, weighted as the present residuals ask; the last unknown is the change of amplitude.
fn equations(anchor: &Anchor, there: &[Residuals], present: &[Residuals]) -> (DMatrix<f64>, DVector<f64>) {
    let n = anchor.coordinates.len();
    let (mut curvature, mut gradient) = (DMatrix::zeros(n + 1, n + 1), DVector::zeros(n + 1));
    for (r, own) in anchor.columns.iter().enumerate() {
        let direction: Vec<f64> = there[r].iter().zip(&anchor.residuals[r]).map(|(a, b)| a - b).collect();
        let weights: Vec<f64> = present[r].iter().map(|r| weight(*r)).collect();
        let mut matrix = own.matrix.clone().insert_column(own.places.len(), 0.0);
        matrix.column_mut(own.places.len()).copy_from_slice(&direction);
        let places: Vec<usize> = own.places.iter().copied().chain([n]).collect();
        add_products(matrix, &there[r], &weights, &places, &mut curvature, &mut gradient);
    }
    add_prior(&anchor.point, &anchor.coordinates, &mut curvature, &mut gradient);
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
        for (&place, column) in own.places.iter().zip(own.matrix.column_iter()) {
            for (value, d) in all[r].iter_mut().zip(column.iter()) {
                *value += step[place] * d;
            }
        }
    }
    all
}

/// Effects that these recordings could not show: none of their starts, once nuisances have traded against it, would change the cost by as
/// much as a first effect has to.
pub fn blind_spots(problem: &Problem, base: &Fit, needed: f64) -> Vec<usize> {
    let anchor = Anchor::at(problem, base, &[]);
    let visible = |entry: &Entry| entry.effect.starts.iter().any(|start| visibility(problem, &anchor, start) > needed);
    let all: Vec<bool> = REGISTRY.par_iter().map(visible).collect();
    (0..REGISTRY.len()).filter(|&e| !all[e]).collect()
}

/// Cost that an effect of this size would add, beyond what the nuisances could take up.
fn visibility(problem: &Problem, anchor: &Anchor, start: &[(usize, f64)]) -> f64 {
    let mut point = anchor.point.clone();
    for &(k, value) in start {
        point.effects[k] = value;
    }
    let there: Vec<Residuals> = (0..problem.series.len()).map(|k| problem.residuals(k, &point)).collect();
    let n = anchor.coordinates.len();
    let (curvature, _) = equations(anchor, &there, &anchor.residuals);
    let shared = curvature.view((0, n), (n, 1)).into_owned();
    let free = curvature.view((0, 0), (n, n)).into_owned();
    let taken = free.cholesky().map_or(0.0, |c| c.solve(&shared).dot(&shared));
    curvature[(n, n)] - taken
}
