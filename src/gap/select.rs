//! Choosing the effects: none, one, or a pair, by what they explain.
//!
//! Every hypothesis is fitted together with all nuisances, so that costs compare. A first effect is accepted when it
//! lowers the cost by more than chance does on cars within their tolerances; a second one when it takes most of what the first
//! left. Thresholds are set on drawn cars whose effects are known (see the docs of the method), never on a case at hand.

use super::fit::{Fit, fit};
use super::problem::{Point, Problem, prior};
use super::screen::{Anchor, Candidate, screen};
use crate::effects::{PARAMETERS, REGISTRY};
use rayon::prelude::*;

/// A set of effects with its fit.
#[derive(Clone, Debug)]
pub struct Hypothesis {
    /// Places in the registry, in the order of their acceptance.
    pub effects: Vec<usize>,
    /// The fit.
    pub fit: Fit,
}

/// Cost that a parameter of an effect has to earn: about the logarithm of the number of independent residuals.
const PARAMETER_COST: f64 = 6.0;

impl Hypothesis {
    /// Cost with what its parameters have to earn; hypotheses are ranked by it.
    pub fn score(&self) -> f64 {
        let parameters: usize = self.effects.iter().map(|&e| REGISTRY[e].parameters.len()).sum();
        self.fit.cost + PARAMETER_COST * parameters as f64
    }
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
    /// Cost that noise alone is expected to have.
    pub noise_cost: f64,
}

/// Single effects that are fitted after the screening, for each anchor.
const SINGLES: usize = 8;
/// Single effects that are tried as the first of a pair.
const FIRSTS: usize = 2;
/// Candidates that are fitted whatever they promise.
const SURE: usize = 3;
/// A candidate whose cost is so many times the best one's is not worth a fit.
const HOPELESS: f64 = 4.0;
/// Second effects that are fitted for each first one.
const SECONDS: usize = 4;
/// Iterations that every candidate gets.
const FIRST_ITERATIONS: usize = 5;
/// Candidates that are fitted to the end.
const FINALISTS: usize = 3;
/// Further iterations for these.
const ITERATIONS: usize = 12;
/// A single effect that leaves less than this cost per residual, and pulls no tolerance beyond [`PULLED`], needs no second one.
const SETTLED: f64 = 1.04;
/// Pairs whose halves are fitted alone.
const PRUNED: usize = 3;
/// Cost of the nuisances from which on the nominal car, with the first effect, is a second place to look from.
const FAR_AWAY: f64 = 150.0;
/// Gain over the best single effect below which a pair is not worth exchanging its halves.
const PROMISING: f64 = 20.0;
/// Share of a large gap that the best pair leaves from which on it is not worth more work.
const LOST: f64 = 0.5;
/// Cost of the nuisances that a car within its tolerances hardly reaches.
const PULLED: f64 = 32.0;
/// Base cost per residual above which the nuisances are taken for dragged away.
const DRAGGED: f64 = 1.6;

/// Searches for up to two effects. `progress` is told what is being fitted, with the share of the work done.
pub fn search(problem: &Problem, progress: &(dyn Fn(&str, f64) + Sync)) -> Search {
    progress("tolerances", 0.0);
    let base = fit(problem, &[], &problem.nominal(), ITERATIONS + FIRST_ITERATIONS, None);
    let noise_cost = problem.noise_cost();
    progress("single effects", 0.1);
    let mut anchors = vec![Anchor::at(problem, &base, &[])];
    // A large gap has dragged the nuisances away from where the car is: the nominal car is then the better place to look from.
    if base.cost > DRAGGED * noise_cost {
        anchors.push(Anchor::new(problem, &problem.nominal(), &[], false));
    }
    let screened = screen(problem, &anchors, &[]);
    // Each anchor sends its own: promises from different places do not compare.
    let from = |a: usize| screened.iter().filter(|c| c.anchor == a).cloned().collect::<Vec<Candidate>>();
    let sent: Vec<Candidate> = (0..anchors.len()).flat_map(|a| worthwhile(&from(a), SINGLES).to_vec()).collect();
    let mut singles = fit_all(problem, &[], &sent, &anchors);
    progress("pairs of effects", 0.5);
    let mut pairs: Vec<Hypothesis> = Vec::new();
    let settled = |h: &Hypothesis| h.fit.cost < SETTLED * noise_cost && prior(&h.fit.point) < PULLED;
    let firsts = if singles.first().is_none_or(settled) { 0 } else { FIRSTS };
    let rivals = |h: &&Hypothesis| h.fit.cost < HOPELESS * singles[0].fit.cost;
    for (k, first) in singles.iter().take(firsts).filter(rivals).enumerate() {
        let untried = |second: usize| !tried(&pairs, first.effects[0], second);
        let with_first = pairs_of(problem, first, untried);
        pairs.extend(with_first);
        progress("pairs of effects", 0.5 + 0.2 * (k + 1) as f64);
    }
    pairs.sort_by(|a, b| a.score().total_cmp(&b.score()));
    // What explains less than half of a large gap is the wrong pair altogether: neither exchanging its halves nor going back to one of them saves it.
    let lost = |best: &Hypothesis| base.cost > DRAGGED * noise_cost && best.fit.cost - noise_cost > LOST * (base.cost - noise_cost);
    let worth_more = pairs.first().is_some_and(|best| !lost(best));
    let promising = |best: &&Hypothesis| worth_more && !settled(best) && singles[0].score() - best.score() > PROMISING;
    if let Some(best) = pairs.first().filter(promising).cloned() {
        progress("exchanging", 0.9);
        exchange(problem, &best, &mut pairs);
    }
    if worth_more {
        progress("pruning", 0.95);
        let before = singles[0].fit.cost;
        for pair in pairs.iter().take(PRUNED) {
            prune(problem, pair, &mut singles);
        }
        // A single effect that has found a much better place on the way looks for its second one from there.
        if singles[0].fit.cost < MUCH_BETTER * before && !settled(&singles[0]) {
            pairs.extend(pairs_of(problem, &singles[0], |_| true));
            pairs.sort_by(|a, b| a.score().total_cmp(&b.score()));
        }
    }
    Search { base: Hypothesis { effects: Vec::new(), fit: base }, singles, pairs, screened, noise_cost }
}

/// The most promising pairs with this first effect, of the second ones that are `wanted`.
fn pairs_of(problem: &Problem, first: &Hypothesis, wanted: impl Fn(usize) -> bool) -> Vec<Hypothesis> {
    let mut anchors = vec![Anchor::at(problem, &first.fit, &first.effects)];
    if prior(&first.fit.point) > FAR_AWAY {
        let undragged = Point { effects: first.fit.point.effects, ..problem.nominal() };
        anchors.push(Anchor::new(problem, &undragged, &first.effects, false));
    }
    let mut candidates = screen(problem, &anchors, &first.effects);
    candidates.retain(|c| wanted(c.effect));
    let called = twins_of_pulled(problem, &first.fit.point);
    let seconds: Vec<Candidate> = (0..anchors.len())
        .flat_map(|a| {
            let from: Vec<Candidate> = candidates.iter().filter(|c| c.anchor == a).cloned().collect();
            let promising = worthwhile(&from, SECONDS);
            let twins = from[promising.len()..].iter().filter(|c| a == 0 && called.contains(&c.effect));
            promising.iter().chain(twins).cloned().collect::<Vec<Candidate>>()
        })
        .collect();
    fit_all(problem, &first.effects, &seconds, &anchors)
}

/// Move of one tolerance in standard deviations that calls for the effect which it stands in for.
const FAR: f64 = 4.0;

/// Effects whose tolerances had to be moved far: each is worth a fit, whatever a linear model promises of so long a way back.
fn twins_of_pulled(problem: &Problem, point: &Point) -> Vec<usize> {
    problem.nuisances.iter().zip(&point.z).filter(|(_, z)| z.abs() > FAR).filter_map(|(n, _)| n.twin()).collect()
}

/// Share of the cost at a promised start below which the same effect in the nominal car is the better start.
const MUCH_BETTER: f64 = 0.8;

/// Where the fit of a candidate starts: where it was promised, as it was replayed if the promise was too bold, or where it takes over from the
/// tolerance that stood in for it; with the nuisances nominal if they fit much better so (a large gap drags them away). What was found from the nominal car starts as it was replayed: its linear promise
/// is too rough to follow.
fn start_of(problem: &Problem, candidate: &Candidate, anchor: &Anchor) -> Point {
    let undragged = |effects| Point { effects, ..problem.nominal() };
    if candidate.anchor > 0 {
        return undragged(candidate.replayed);
    }
    let cost = |p: &Point| problem.cost(p, &problem.all_residuals(p));
    let here = [
        Some(candidate.start.clone()),
        Some(Point { effects: candidate.replayed, ..anchor.point().clone() }),
        handed_over(problem, candidate.effect, anchor.point()),
    ];
    let priced = here.into_iter().flatten().filter(|p| problem.can_follow(p)).map(|p| (cost(&p), p));
    let nominal = undragged(candidate.start.effects);
    match priced.min_by(|a, b| a.0.total_cmp(&b.0)) {
        Some((least, best)) if cost(&nominal) >= MUCH_BETTER * least => best,
        _ => nominal,
    }
}

/// The same car, with the moves of tolerances that the effect repeats put into the effect.
fn handed_over(problem: &Problem, effect: usize, point: &Point) -> Option<Point> {
    let mut moved = point.clone();
    for (k, nuisance) in problem.nuisances.iter().enumerate() {
        let mut effects = moved.effects;
        let parameter = nuisance.hand_over(moved.z[k], &problem.vehicle, &mut effects);
        let within = |p: usize| (PARAMETERS[p].min..=PARAMETERS[p].max).contains(&effects[p]);
        if parameter.is_some_and(|p| REGISTRY[effect].parameters.contains(&p) && within(p)) {
            (moved.z[k], moved.effects) = (0.0, effects);
        }
    }
    (moved != *point).then_some(moved)
}

/// Each half of a pair is exchanged for whatever suits the other half better: beside the right second effect, and with the tolerances that go with
/// it, the first one's neighbours no longer look alike.
fn exchange(problem: &Problem, best: &Hypothesis, pairs: &mut Vec<Hypothesis>) {
    for &kept in &best.effects {
        let mut point = best.fit.point.clone();
        for k in best.effects.iter().filter(|e| **e != kept).flat_map(|&e| REGISTRY[e].parameters.clone()) {
            point.effects[k] = PARAMETERS[k].null;
        }
        let anchors = [Anchor::new(problem, &point, &[kept], false)];
        let mut candidates = screen(problem, &anchors, &[kept]);
        candidates.retain(|c| !tried(pairs, kept, c.effect));
        candidates.iter_mut().for_each(|c| c.start = Point { effects: c.replayed, ..problem.nominal() });
        pairs.extend(fit_all(problem, &[kept], worthwhile(&candidates, SECONDS), &anchors));
    }
    pairs.sort_by(|a, b| a.score().total_cmp(&b.score()));
}

/// Each half of a pair is fitted alone from where the pair ended: a first effect that only helped the second to find its place is not
/// needed any more.
fn prune(problem: &Problem, pair: &Hypothesis, singles: &mut Vec<Hypothesis>) {
    for (&kept, &dropped) in pair.effects.iter().zip(pair.effects.iter().rev()) {
        let mut start = pair.fit.point.clone();
        for k in REGISTRY[dropped].parameters.clone() {
            start.effects[k] = PARAMETERS[k].null;
        }
        let alone = Hypothesis { effects: vec![kept], fit: fit(problem, &[kept], &start, ITERATIONS, None) };
        match singles.iter_mut().find(|h| h.effects == [kept]) {
            Some(known) if known.fit.cost <= alone.fit.cost => {}
            Some(known) => *known = alone,
            None => singles.push(alone),
        }
    }
    singles.sort_by(|a, b| a.score().total_cmp(&b.score()));
}

/// The most promising candidates: at most `most`, and beyond the first three none that promises far less than the best.
fn worthwhile(candidates: &[Candidate], most: usize) -> &[Candidate] {
    let hopeless = |c: &Candidate| c.promise > HOPELESS * candidates[0].promise;
    let count = candidates.iter().enumerate().take_while(|(k, c)| *k < SURE || !hopeless(c)).count();
    &candidates[..count.min(most)]
}

fn tried(pairs: &[Hypothesis], a: usize, b: usize) -> bool {
    pairs.iter().any(|p| p.effects.contains(&a) && p.effects.contains(&b))
}

/// Fits candidates on top of `already`, the better half of them to the end; best first.
fn fit_all(problem: &Problem, already: &[usize], candidates: &[Candidate], anchors: &[Anchor]) -> Vec<Hypothesis> {
    let first = |c: &Candidate| {
        let mut effects = already.to_vec();
        effects.push(c.effect);
        Hypothesis {
            fit: fit(problem, &effects, &start_of(problem, c, &anchors[c.anchor]), FIRST_ITERATIONS, Some(anchors[c.anchor].columns())),
            effects,
        }
    };
    let by_cost = |a: &Hypothesis, b: &Hypothesis| a.score().total_cmp(&b.score());
    let mut all: Vec<Hypothesis> = candidates.par_iter().map(first).collect();
    all.sort_by(by_cost);
    // Of two starts of the same effect the better one goes on.
    let mut seen: Vec<Vec<usize>> = Vec::new();
    all.retain(|h| {
        !seen.contains(&h.effects) && {
            seen.push(h.effects.clone());
            true
        }
    });
    let finalists = all.len().min(FINALISTS);
    all[..finalists].par_iter_mut().for_each(|h| h.fit = fit(problem, &h.effects, &h.fit.point, ITERATIONS, None));
    all.sort_by(by_cost);
    all
}
