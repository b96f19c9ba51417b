//! Choosing the effects: none, one, or a pair, by what they explain.
//!
//! Every hypothesis is fitted together with all nuisances, so that costs compare. A first effect is accepted when it
//! lowers the cost by more than chance does on cars within their tolerances; a second one when it takes most of what the first
//! left. Thresholds are set on drawn cars whose effects are known (see the docs of the method), never on a case at hand.

use super::fit::{Fit, Problem, fit, prior};
use super::screen::{Anchor, Candidate, screen};
use rayon::prelude::*;

/// A set of effects with its fit.
#[derive(Clone, Debug)]
pub struct Hypothesis {
    /// Places in the registry, in the order of their acceptance.
    pub effects: Vec<usize>,
    /// The fit.
    pub fit: Fit,
}

/// Everything that was tried.
#[derive(Clone, Debug)]
pub struct Search {
    /// Nuisances alone.
    pub base: Hypothesis,
    /// Single effects that were fitted, best first.
    pub singles: Vec<Hypothesis>,
    /// Pairs that were fitted, best first.
    pub pairs: Vec<Hypothesis>,
    /// Every candidate of the screening for one effect, best first.
    pub screened: Vec<Candidate>,
    /// Number of residuals.
    pub samples: usize,
}

/// Single effects that are fitted after the screening.
const SINGLES: usize = 7;
/// Single effects that are tried as the first of a pair.
const FIRSTS: usize = 2;
/// Second effects that are fitted for each first one.
const SECONDS: usize = 5;
/// Iterations that every candidate gets.
const FIRST_ITERATIONS: usize = 3;
/// Candidates that are fitted to the end.
const FINALISTS: usize = 3;
/// Further iterations for these.
const ITERATIONS: usize = 5;
/// A single effect that leaves less than this cost per residual, and pulls no tolerance beyond [`PULLED`], needs no second one.
const SETTLED: f64 = 1.04;
/// Cost of the nuisances that a car within its tolerances hardly reaches.
const PULLED: f64 = 32.0;
/// Base cost per residual above which the nominal car is the better place to screen from: the nuisances have been dragged away.
const DRAGGED: f64 = 1.6;

/// Searches for up to two effects. `progress` is told what is being fitted, with the share of the work done.
pub fn search(problem: &Problem, progress: &(dyn Fn(&str, f64) + Sync)) -> Search {
    progress("tolerances", 0.0);
    let base = fit(problem, &[], &problem.nominal(), ITERATIONS + FIRST_ITERATIONS);
    let samples = base.residuals.iter().map(Vec::len).sum();
    let dragged = base.cost > DRAGGED * samples as f64;
    progress("single effects", 0.1);
    let from = if dragged { problem.nominal() } else { base.point.clone() };
    let screened = screen(problem, &Anchor::new(problem, &from, &[]), &[]);
    let singles = fit_all(problem, &[], &screened[..SINGLES.min(screened.len())], &from.z);
    progress("pairs of effects", 0.5);
    let mut pairs: Vec<Hypothesis> = Vec::new();
    let settled = |h: &Hypothesis| h.fit.cost < SETTLED * samples as f64 && prior(&h.fit.point) < PULLED;
    let firsts = if singles.first().is_none_or(settled) { 0 } else { FIRSTS };
    for (k, first) in singles.iter().take(firsts).enumerate() {
        let candidates = screen(problem, &Anchor::at(problem, &first.fit, &first.effects), &first.effects);
        let fresh: Vec<Candidate> = candidates.into_iter().filter(|c| !tried(&pairs, first.effects[0], c.effect)).take(SECONDS).collect();
        pairs.extend(fit_all(problem, &first.effects, &fresh, &first.fit.point.z));
        progress("pairs of effects", 0.5 + 0.25 * (k + 1) as f64);
    }
    pairs.sort_by(|a, b| a.fit.cost.total_cmp(&b.fit.cost));
    Search { base: Hypothesis { effects: Vec::new(), fit: base }, singles, pairs, screened, samples }
}

fn tried(pairs: &[Hypothesis], a: usize, b: usize) -> bool {
    pairs.iter().any(|p| p.effects.contains(&a) && p.effects.contains(&b))
}

/// Fits candidates on top of `already`, the better half of them to the end; best first. Nuisances begin at `z`.
fn fit_all(problem: &Problem, already: &[usize], candidates: &[Candidate], z: &[f64]) -> Vec<Hypothesis> {
    let first = |c: &Candidate| {
        let mut effects = already.to_vec();
        effects.push(c.effect);
        let mut start = c.start.clone();
        start.z.copy_from_slice(z);
        Hypothesis { fit: fit(problem, &effects, &start, FIRST_ITERATIONS), effects }
    };
    let by_cost = |a: &Hypothesis, b: &Hypothesis| a.fit.cost.total_cmp(&b.fit.cost);
    let mut all: Vec<Hypothesis> = candidates.par_iter().map(first).collect();
    all.sort_by(by_cost);
    let finalists = all.len().min(FINALISTS);
    all[..finalists].par_iter_mut().for_each(|h| h.fit = fit(problem, &h.effects, &h.fit.point, ITERATIONS));
    all.sort_by(by_cost);
    all
}
