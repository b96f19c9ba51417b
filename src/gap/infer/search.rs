//! The search: which sets of effects are worth a fit, up to three at a time.
//!
//! From the car within its tolerances, and then from the best sets so far, every effect is screened; what promises most is fitted. Sets compete by their
//! posterior: evidence, which pays for what an effect could have done as well, and the odds of that many effects. The search goes on as long as a
//! larger set is more probable than the one that it extends. Last, every member of the best set is dropped in turn, and exchanged for what suits the rest
//! better.

use super::density::{Point, Problem, cost};
use super::fit::{Fit, Free, LOOK, fit};
use super::linear::Columns;
use super::pulsation;
use super::screen::{Anchor, Promise, Screening, screen};
use crate::effects::{PARAMETERS, REGISTRY};
use rayon::prelude::*;

/// A set of effects, fitted.
#[derive(Clone, Debug)]
pub struct Hypothesis {
    /// Effects, by their place in the registry, ascending.
    pub effects: Vec<usize>,
    /// Fit.
    pub fit: Fit,
    /// Logarithm of the posterior probability, nats, up to a constant of the recordings.
    pub log_posterior: f64,
}

impl Hypothesis {
    fn new(mut effects: Vec<usize>, fit: Fit) -> Self {
        effects.sort_unstable();
        let log_posterior = fit.log_evidence + log_prior(effects.len());
        Self { effects, fit, log_posterior }
    }
}

/// Prior probability of each effect of the library: about one car in four that somebody has reason to diagnose holds one.
pub const EFFECT_PRIOR: f64 = 0.01;

/// Logarithm of the prior odds of that many effects over none.
pub fn log_prior(effects: usize) -> f64 {
    effects as f64 * (EFFECT_PRIOR / (1.0 - EFFECT_PRIOR)).ln()
}

/// What was found.
#[derive(Clone, Debug)]
pub struct Search {
    /// All sets that were fitted, the most probable first.
    pub hypotheses: Vec<Hypothesis>,
    /// Cost that the linear model promises for each effect alone.
    pub promised: Vec<Option<f64>>,
}

impl Search {
    /// The car within its tolerances.
    pub fn base(&self) -> &Hypothesis {
        self.of(&[]).expect("the search begins with it")
    }
    /// A set, if it was fitted.
    pub fn of(&self, effects: &[usize]) -> Option<&Hypothesis> {
        self.hypotheses.iter().find(|h| h.effects == effects)
    }
    /// The most probable set.
    pub fn best(&self) -> &Hypothesis {
        &self.hypotheses[0]
    }
    fn add(&mut self, h: Hypothesis) {
        match self.hypotheses.iter_mut().find(|o| o.effects == h.effects) {
            Some(o) if o.log_posterior < h.log_posterior => *o = h,
            Some(_) => {}
            None => self.hypotheses.push(h),
        }
        self.hypotheses.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
    }
}

/// Most effects at a time.
pub const MOST_EFFECTS: usize = 3;
/// Iterations of a fit that stays.
const STAY: usize = 12;
/// Candidates that are looked at per anchor, and those of them that are fitted to the end.
const LOOKED_AT: usize = 5;
const FITTED: usize = 2;
/// Sets that are extended.
const BEAM: [usize; MOST_EFFECTS - 1] = [3, 2];
/// Nats behind the best after a look up to which a fit is finished, beside this share of what the best explains.
const BEHIND_NATS: f64 = 20.0;
const BEHIND_SHARE: f64 = 0.3;
/// Gain in the cost that an effect has to promise to be looked at: its price is more.
const LEAST_PROMISE: f64 = 10.0;
/// Mean square of the nuisances above which a fit was dragged along by a gap, and the nominal car is a second anchor.
const DRAGGED: f64 = 3.0;

/// Searches. `progress` is told how far it is.
pub fn search(problem: &Problem, progress: &(dyn Fn(&str, f64) + Sync)) -> Search {
    progress("tolerances", 0.0);
    let nominal = problem.nominal();
    let base = fit(problem, Free::default(), &nominal, STAY, None);
    let mut found = Search { hypotheses: Vec::new(), promised: vec![None; REGISTRY.len()] };
    found.add(Hypothesis::new(Vec::new(), base));
    let mut frontier: Vec<Vec<usize>> = vec![Vec::new()];
    for size in 1..=MOST_EFFECTS {
        let best = found.best().log_posterior;
        for set in &frontier {
            progress(["effects", "pairs", "triples"][size - 1], 0.2 * size as f64);
            extend(problem, &mut found, set);
        }
        let mut of_size: Vec<&Hypothesis> = found.hypotheses.iter().filter(|h| h.effects.len() == size).collect();
        if size == MOST_EFFECTS || of_size.first().is_none_or(|h| h.log_posterior < best) {
            break;
        }
        of_size.truncate(BEAM[size - 1]);
        let most = BEHIND_NATS + BEHIND_SHARE * (of_size[0].log_posterior - best);
        of_size.retain(|h| found.best().log_posterior - h.log_posterior < most);
        frontier = of_size.into_iter().map(|h| h.effects.clone()).collect();
    }
    progress("exchange", 0.8);
    exchange(problem, &mut found);
    found
}

/// Screens beside a set that was fitted, and fits what promises most.
fn extend(problem: &Problem, found: &mut Search, set: &[usize]) {
    let Some(from) = found.of(set).cloned() else { return };
    let mut places: Vec<(Point, Option<&[Columns]>)> = vec![(from.fit.point.clone(), Some(&from.fit.columns))];
    let shared = &from.fit.point.shared;
    if shared.iter().map(|z| z * z).sum::<f64>() > DRAGGED * shared.len() as f64 {
        places.push((Point { effects: from.fit.point.effects, ..problem.nominal() }, None));
    }
    let further = pulsation::starts(problem, &from.fit.point);
    let mut starts: Vec<(Vec<usize>, Point, f64, usize)> = Vec::new();
    let mut columns: Vec<Vec<Columns>> = Vec::new();
    for (point, known) in &places {
        let Some(anchor) = Anchor::new(problem, point, set, None, *known) else { continue };
        let screening = screen(problem, &anchor, &further);
        let least = from.fit.cost - LEAST_PROMISE;
        let singles = screening.singles();
        if set.is_empty() {
            for p in &singles {
                let e = screening.candidates[p.members[0]].effect;
                found.promised[e] = Some(found.promised[e].map_or(p.cost, |c: f64| c.min(p.cost)));
            }
        }
        let pairs = if set.len() + 2 <= MOST_EFFECTS { screening.pairs() } else { Vec::new() };
        let worthwhile = singles.iter().filter(|p| p.cost < least).take(LOOKED_AT);
        let together = pairs.iter().filter(|p| singles.first().is_some_and(|s| p.cost < s.cost - 2.0 * LEAST_PROMISE)).take(2);
        starts.extend(worthwhile.chain(together).map(|p| started(problem, &anchor, &screening, set, p, columns.len())));
        columns.push(anchor.columns);
    }
    starts.extend(taken_over(problem, &from, set));
    // Of two starts of one set the more promising.
    starts.iter_mut().for_each(|s| s.0.sort_unstable());
    starts.sort_by(|a, b| a.0.cmp(&b.0).then(a.2.total_cmp(&b.2)));
    starts.dedup_by(|later, kept| later.0 == kept.0 && later.2 > f64::NEG_INFINITY);
    let looked: Vec<(Vec<usize>, Fit)> = starts
        .into_par_iter()
        .map(|(effects, start, _, anchor)| {
            let known = columns.get(anchor).map(Vec::as_slice);
            let fitted = fit(problem, Free { effects: &effects, basis: None }, &start, LOOK, known);
            (effects, fitted)
        })
        .collect();
    finish(problem, found, looked);
}

fn started(
    problem: &Problem,
    anchor: &Anchor,
    screening: &Screening,
    set: &[usize],
    promise: &Promise,
    k: usize,
) -> (Vec<usize>, Point, f64, usize) {
    let effects = set.iter().copied().chain(promise.members.iter().map(|&m| screening.candidates[m].effect)).collect();
    let start = screening.start(anchor, promise);
    let _ = problem;
    (effects, start, promise.cost, k)
}

/// The same car with an effect in the place of each tolerance that does the same and was pulled.
fn taken_over(problem: &Problem, from: &Hypothesis, set: &[usize]) -> Vec<(Vec<usize>, Point, f64, usize)> {
    const PULLED: f64 = 2.5;
    let pulled = (0..problem.shared.len()).filter(|&k| from.fit.point.shared[k].abs() > PULLED);
    pulled
        .filter_map(|k| {
            let mut point = from.fit.point.clone();
            let mut car = crate::gap::model::tolerance::Car {
                effects: point.effects,
                ..crate::gap::model::tolerance::Car::nominal(&problem.vehicle)
            };
            let (parameter, _) = problem.shared[k].same_as(&car)?;
            let effect = crate::effects::find(PARAMETERS[parameter].effect)?;
            if set.contains(&effect) || !problem.shared[k].hand_over(point.shared[k], &mut car) {
                return None;
            }
            (point.shared[k], point.effects) = (0.0, car.effects);
            let there = cost_at(problem, &point);
            Some((set.iter().copied().chain([effect]).collect(), point, there, 0))
        })
        .collect()
}

/// Fits to the end what came near the best after a look.
fn finish(problem: &Problem, found: &mut Search, mut looked: Vec<(Vec<usize>, Fit)>) {
    looked.sort_by(|a, b| b.1.log_evidence.total_cmp(&a.1.log_evidence));
    let Some(best) = looked.first().map(|l| l.1.log_evidence) else { return };
    let explained = (best - found.base().fit.log_evidence).max(0.0);
    let most = BEHIND_NATS + BEHIND_SHARE * explained;
    let (near, far): (Vec<_>, Vec<_>) = looked.into_iter().enumerate().partition(|(k, l)| *k < FITTED && best - l.1.log_evidence < most);
    for (_, (effects, rough)) in far {
        found.add(Hypothesis::new(effects, rough));
    }
    let done: Vec<(Vec<usize>, Fit)> = near
        .into_par_iter()
        .map(|(_, (effects, rough))| {
            let fitted = fit(problem, Free { effects: &effects, basis: None }, &rough.point, STAY, Some(&rough.columns));
            (effects, fitted)
        })
        .collect();
    for (effects, fitted) in done {
        found.add(Hypothesis::new(effects, fitted));
    }
}

/// Drops every member of the best set in turn; what is left is fitted from there and looks for a better companion, if it fits better than it did or if the
/// best set strains its tolerances, which says that it is not the right one.
fn exchange(problem: &Problem, found: &mut Search) {
    for _ in 0..MOST_EFFECTS {
        let best = found.best().clone();
        if best.effects.is_empty() {
            return;
        }
        let shared = &best.fit.point.shared;
        let strained = shared.iter().map(|z| z * z).sum::<f64>() > STRAINED * shared.len() as f64;
        if best.effects.len() < 2 && !strained {
            return;
        }
        for &dropped in &best.effects {
            let rest: Vec<usize> = best.effects.iter().copied().filter(|e| *e != dropped).collect();
            let mut start = best.fit.point.clone();
            for p in REGISTRY[dropped].parameters.clone() {
                start.effects[p] = PARAMETERS[p].null;
            }
            let before = found.of(&rest).map(|h| h.fit.cost);
            let looked = fit(problem, Free { effects: &rest, basis: None }, &start, STAY, None);
            let better = before.is_none_or(|b| looked.cost < b - LEAST_PROMISE);
            found.add(Hypothesis::new(rest.clone(), looked));
            if better || strained {
                extend(problem, found, &rest);
            }
        }
        // The twins of tolerances that are pulled, in the place of each member.
        if strained {
            let all = taken_over(problem, &best, &best.effects);
            let swapped = all.into_iter().flat_map(|(effects, point, _, _)| {
                let newcomer = effects.iter().copied().find(|e| !best.effects.contains(e));
                best.effects.clone().into_iter().filter_map(move |dropped| {
                    let mut point = point.clone();
                    for p in REGISTRY[dropped].parameters.clone() {
                        point.effects[p] = PARAMETERS[p].null;
                    }
                    let mut set: Vec<usize> = effects.iter().copied().filter(|e| *e != dropped).collect();
                    set.sort_unstable();
                    newcomer.map(|_| (set, point))
                })
            });
            let looked: Vec<(Vec<usize>, Fit)> = swapped
                .collect::<Vec<_>>()
                .into_par_iter()
                .map(|(set, point)| {
                    let fitted = fit(problem, Free { effects: &set, basis: None }, &point, LOOK + 1, None);
                    (set, fitted)
                })
                .collect();
            finish(problem, found, looked);
        }
        if found.best().effects == best.effects {
            return;
        }
    }
}

/// Mean square of the nuisances beyond which a fit strains its tolerances: of a dozen and more standard normal numbers it is so once in a hundred times.
const STRAINED: f64 = 2.0;

/// Cost of a point, for checks.
pub fn cost_at(problem: &Problem, point: &Point) -> f64 {
    cost(point, &problem.all_residuals(point, None))
}
