//! Screening: what every effect could explain beside what is free already, alone and in company, from one replay per start.
//!
//! At an anchor (a fitted point, or the nominal car) each effect is set to each of its starts and the recordings are replayed once. The changes of the
//! innovations, and the derivatives of everything already free, are columns of one linear model; nuisances and own unknowns are eliminated from it once,
//! and what is left is a small Gram matrix from which the gain of every set of starts follows.

use super::coordinate::coordinates;
use super::density::{Basis, Point, Problem, Residuals, cost, huber, prior, size, weight};
use super::fit::Fit;
use super::linear::{Columns, Frame, Normal, derivatives, normal};
use crate::effects::{Act, Entry, PARAMETERS, REGISTRY};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::Arc;

/// A place at which a linear model is made.
pub struct Anchor {
    /// Where.
    pub point: Point,
    /// Effects that are free there.
    pub effects: Vec<usize>,
    residuals: Vec<Residuals>,
    frame: Frame,
    /// Derivatives there.
    pub columns: Arc<Vec<Columns>>,
    equations: Normal,
    cost: f64,
}

impl Anchor {
    /// Differentiates at `point` along nuisances and the parameters of `effects`, unless a fit has the derivatives there.
    pub fn new(problem: &Problem, point: &Point, effects: &[usize], basis: Option<&Basis>, known: Option<&Fit>) -> Option<Self> {
        let residuals = problem.all_residuals(point, basis);
        let (shared, own) = coordinates(problem, effects, point.missing.len());
        let frame = Frame { shared, own };
        let anew = || Arc::new(derivatives(problem, point, basis, &residuals, &frame, None));
        let columns = known.filter(|f| f.known().is_some()).map_or_else(anew, |f| f.columns.clone());
        let equations = normal(point, &frame, &columns, &residuals, 0.0)?;
        let cost = cost(point, &residuals);
        Some(Self { point: point.clone(), effects: effects.to_vec(), residuals, frame, columns, equations, cost })
    }
}

/// A start of an effect as it was replayed at an anchor.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Place in the registry.
    pub effect: usize,
    /// Where it was replayed.
    pub point: Point,
    /// Cost there.
    pub cost: f64,
    /// Share of the start at which it was replayed.
    share: f64,
}

/// What the linear model says of the candidates of an anchor.
pub struct Screening {
    /// Candidates.
    pub candidates: Vec<Candidate>,
    /// Curvature between them, all else eliminated.
    gram: DMatrix<f64>,
    /// Gradient along them.
    slope: DVector<f64>,
    cost: f64,
}

/// Largest factor on a start that the linear model may ask for.
const LARGEST_FACTOR: f64 = 6.0;

/// Share of a start at which an effect that resembles a tolerance is replayed too: within it the trade between the two is linear.
const SMALL_SHARE: f64 = 0.1;

/// Replays every start of every effect that is not free at the anchor. `further` are starts that a scan found.
pub fn screen(problem: &Problem, anchor: &Anchor, further: &[(usize, Point)]) -> Screening {
    let mut candidates: Vec<Candidate> = Vec::new();
    for (e, entry) in REGISTRY.iter().enumerate().filter(|(e, _)| !anchor.effects.contains(e)) {
        if !matches!(entry.effect.act, Act::Pulsation(_)) {
            candidates.extend(starts(problem, anchor, e, entry));
        }
    }
    let found = further.iter().filter(|(e, _)| !anchor.effects.contains(e));
    candidates.extend(found.map(|(e, p)| Candidate { effect: *e, point: p.clone(), cost: 0.0, share: 1.0 }));
    let parts: Vec<Part> = (0..problem.tracks.len()).into_par_iter().map(|r| part(problem, anchor, &candidates, r)).collect();
    let m = candidates.len();
    candidates.iter_mut().for_each(|c| c.cost = prior(&c.point));
    let (mut gram, mut slope, mut cross) = (DMatrix::zeros(m, m), DVector::zeros(m), DMatrix::zeros(anchor.frame.shared.len(), m));
    for p in parts {
        gram += p.gram;
        slope += p.slope;
        cross += p.cross;
        candidates.iter_mut().zip(p.misfit).for_each(|(c, m)| c.cost += m);
    }
    let root = anchor.equations.curvature.clone().cholesky().expect("the anchor's curvature is positive");
    let solved = root.solve(&cross);
    gram -= cross.tr_mul(&solved);
    slope -= solved.tr_mul(&anchor.equations.gradient);
    for (k, c) in candidates.iter().enumerate() {
        gram[(k, k)] += c.share * c.share;
    }
    let settled = root.solve(&anchor.equations.gradient).dot(&anchor.equations.gradient)
        + anchor.equations.eliminated.iter().map(|e| e.gain()).sum::<f64>();
    Screening { candidates, gram, slope, cost: anchor.cost - settled }
}

fn starts<'a>(problem: &'a Problem, anchor: &'a Anchor, effect: usize, entry: &'static Entry) -> impl Iterator<Item = Candidate> + 'a {
    let car = problem.car(&anchor.point, None);
    let twin = problem.shared.iter().any(|n| n.same_as(&car).is_some_and(|(k, _)| entry.parameters.contains(&k)));
    let shares: &[f64] = if twin { &[1.0, SMALL_SHARE] } else { &[1.0] };
    entry
        .effect
        .starts
        .iter()
        .flat_map(move |start| {
            shares.iter().map(move |&share| {
                let mut point = anchor.point.clone();
                for &(k, value) in *start {
                    let null = PARAMETERS[k].null;
                    let amplitude = entry.effect.amplitudes.contains(&k);
                    point.effects[k] = if amplitude { null + share * (value - null) } else { value };
                }
                Candidate { effect, point, cost: 0.0, share }
            })
        })
        .filter(|c| problem.can_follow(&c.point))
}

/// One recording's part of a screening.
struct Part {
    gram: DMatrix<f64>,
    slope: DVector<f64>,
    cross: DMatrix<f64>,
    /// Of each candidate where it was replayed.
    misfit: Vec<f64>,
}

/// One recording's part: products among the candidates' columns, with the residuals, and with the shared coordinates, own unknowns eliminated.
fn part(problem: &Problem, anchor: &Anchor, candidates: &[Candidate], r: usize) -> Part {
    let here = &anchor.residuals[r];
    let roots: Vec<f64> = here.iter().map(|r| weight(*r).sqrt()).collect();
    let (columns, misfit): (Vec<Vec<f64>>, Vec<f64>) = candidates
        .par_iter()
        .map(|c| {
            let there = problem.residuals(r, &c.point, None);
            let misfit = there.iter().map(|r| huber(*r)).sum::<f64>();
            (there.iter().zip(here).zip(&roots).map(|((a, b), w)| (a - b) * w).collect::<Vec<f64>>(), misfit)
        })
        .unzip();
    let (n, m) = (here.len(), candidates.len());
    let mut v = DMatrix::zeros(n, m);
    columns.iter().enumerate().for_each(|(k, c)| v.column_mut(k).copy_from_slice(c));
    let mut a = anchor.columns[r].matrix.clone();
    let w = DVector::from_column_slice(&roots);
    a.column_iter_mut().for_each(|mut c| c.component_mul_assign(&w));
    let weighted = DVector::from_iterator(n, here.iter().zip(&roots).map(|(r, w)| r * w));
    let (s, o) = (anchor.frame.shared.len(), anchor.frame.own.len());
    let products = a.tr_mul(&v);
    let (shared, own) = (products.rows(0, s).into_owned(), products.rows(s, o).into_owned());
    let e = &anchor.equations.eliminated[r];
    let solved = e.solve(&own);
    let gram = v.tr_mul(&v) - own.tr_mul(&solved);
    let slope = v.tr_mul(&weighted) - own.tr_mul(e.offset());
    let cross = shared - e.coupling().tr_mul(&own);
    Part { gram, slope, cross, misfit }
}

/// A set of candidates of an anchor, and the cost that the linear model promises for them.
#[derive(Clone, Debug)]
pub struct Promise {
    /// Places in [`Screening::candidates`].
    pub members: Vec<usize>,
    /// Factors on their starts.
    pub factors: Vec<f64>,
    /// Cost promised.
    pub cost: f64,
}

impl Screening {
    /// Promise of these candidates together; none if one of them would have to go the other way.
    pub fn promise(&self, members: &[usize]) -> Option<Promise> {
        let m = members.len();
        let h = DMatrix::from_fn(m, m, |i, j| self.gram[(members[i], members[j])]);
        let g = DVector::from_fn(m, |i, _| self.slope[members[i]]);
        let step = h.clone().cholesky()?.solve(&-&g);
        if step.iter().any(|f| *f <= 0.0) {
            return None;
        }
        let most = |i: usize| LARGEST_FACTOR / self.candidates[members[i]].share;
        let step = DVector::from_fn(m, |i, _| step[i].min(most(i)));
        let gain = -2.0 * g.dot(&step) - (&h * &step).dot(&step);
        // What was replayed is sure, what is promised is not.
        if let [k] = members
            && self.candidates[*k].cost < self.cost - gain
        {
            return Some(Promise { members: vec![*k], factors: vec![1.0], cost: self.candidates[*k].cost });
        }
        Some(Promise { members: members.to_vec(), factors: step.iter().copied().collect(), cost: self.cost - gain })
    }

    /// For each effect that was screened, how large one of its starts has to be to promise this gain in the cost: the parameter, its size.
    pub fn visible(&self, gain: f64) -> Vec<(usize, usize, f64)> {
        let mut all: Vec<(usize, usize, f64)> = Vec::new();
        for (k, c) in self.candidates.iter().enumerate() {
            let information = self.gram[(k, k)] / (c.share * c.share);
            let factor = (gain / information.max(1e-30)).sqrt();
            let amplitudes = REGISTRY[c.effect].effect.amplitudes.iter();
            let Some(&p) = amplitudes.max_by(|a, b| off(c, **a).total_cmp(&off(c, **b))) else { continue };
            let needed = factor * (c.point.effects[p] - PARAMETERS[p].null).abs() / c.share;
            match all.iter_mut().find(|a| a.0 == c.effect) {
                Some(a) if needed / size(p) < a.2 / size(a.1) => *a = (c.effect, p, needed),
                Some(_) => {}
                None => all.push((c.effect, p, needed)),
            }
        }
        all
    }

    /// The best start of each effect, best first.
    pub fn singles(&self) -> Vec<Promise> {
        let mut best: Vec<Promise> = Vec::new();
        for k in 0..self.candidates.len() {
            let Some(p) = self.promise(&[k]) else { continue };
            let pulsates = matches!(REGISTRY[self.candidates[k].effect].effect.act, Act::Pulsation(_));
            match best.iter_mut().find(|b| !pulsates && self.candidates[b.members[0]].effect == self.candidates[k].effect) {
                Some(b) if p.cost < b.cost => *b = p,
                Some(_) => {}
                None => best.push(p),
            }
        }
        best.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        best
    }

    /// The best starts of each pair of effects, best first.
    pub fn pairs(&self) -> Vec<Promise> {
        let mut best: Vec<Promise> = Vec::new();
        let effect = |k: usize| self.candidates[k].effect;
        for i in 0..self.candidates.len() {
            for j in (0..i).filter(|&j| effect(j) != effect(i)) {
                let Some(p) = self.promise(&[j, i]) else { continue };
                let same = |b: &&mut Promise| {
                    let (a, c) = (effect(b.members[0]), effect(b.members[1]));
                    (a, c) == (effect(i), effect(j)) || (c, a) == (effect(i), effect(j))
                };
                match best.iter_mut().find(same) {
                    Some(b) if p.cost < b.cost => *b = p,
                    Some(_) => {}
                    None => best.push(p),
                }
            }
        }
        best.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        best
    }

    /// Where a fit of a promise starts.
    pub fn start(&self, anchor: &Anchor, promise: &Promise) -> Point {
        let mut point = anchor.point.clone();
        for (&k, factor) in promise.members.iter().zip(&promise.factors) {
            let c = &self.candidates[k];
            let entry = &REGISTRY[c.effect];
            for p in entry.parameters.clone() {
                let null = PARAMETERS[p].null;
                let set = c.point.effects[p];
                let amplitude = entry.effect.amplitudes.contains(&p);
                // Half of what is promised beyond the start: the linear model is surest near where it was replayed.
                let factor = if *factor > 1.0 && c.share == 1.0 { 1.0 + 0.5 * (factor - 1.0) } else { *factor };
                let moved = if amplitude { null + factor * (set - null) } else { set };
                point.effects[p] = moved.clamp(PARAMETERS[p].min, PARAMETERS[p].max).clamp(null - 8.0 * size(p), null + 8.0 * size(p));
            }
        }
        point
    }
}

/// How far a candidate's parameter is from its null value, in units of its size.
fn off(c: &Candidate, p: usize) -> f64 {
    (c.point.effects[p] - PARAMETERS[p].null).abs() / size(p)
}
