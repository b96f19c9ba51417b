//! The posterior over everything that may be wrong: sets of effects, with a missing law in some place or without.
//!
//! Verdict, probabilities, groups and places are sums of this one distribution.

use super::density::{Point, Problem, misfit};
use super::fit::Fit;
use super::search::{Hypothesis, MOST_EFFECTS, Search, taken_over};
use super::unknown::{Unknown, beside, places};
use crate::effects::{REGISTRY, Subsystem};

/// One explanation with its share of the posterior.
#[derive(Clone, Debug)]
pub struct Explanation {
    /// Effects, by their place in the registry, ascending.
    pub effects: Vec<usize>,
    /// Place of a missing law, if there is one.
    pub place: Option<Subsystem>,
    /// Logarithm of the posterior, nats, up to a constant.
    pub log_posterior: f64,
    /// Posterior probability.
    pub probability: f64,
    /// Fit; of a missing law that was not worth one, none.
    pub fit: Option<Fit>,
}

/// The posterior, the most probable explanation first.
#[derive(Clone, Debug)]
pub struct Posterior {
    /// All explanations that were weighed.
    pub explanations: Vec<Explanation>,
    /// Misfit of the car within its tolerances.
    pub base_misfit: f64,
}

impl Posterior {
    /// The most probable one that was fitted.
    pub fn best(&self) -> &Explanation {
        self.explanations.iter().find(|e| e.fit.is_some()).expect("the car within its tolerances is always fitted")
    }

    /// Probability that an effect is there.
    pub fn of_effect(&self, effect: usize) -> f64 {
        self.explanations.iter().filter(|e| e.effects.contains(&effect)).map(|e| e.probability).sum()
    }

    /// Probability that a law is missing at a place.
    pub fn of_place(&self, place: Subsystem) -> f64 {
        self.explanations.iter().filter(|e| e.place == Some(place)).map(|e| e.probability).sum()
    }

    /// Probability that nothing is wrong.
    pub fn of_no_gap(&self) -> f64 {
        self.explanations.iter().filter(|e| e.effects.is_empty() && e.place.is_none()).map(|e| e.probability).sum()
    }
}

/// Missing laws beside the most probable set and beside none, if that set strains its tolerances and one of them leads it by more than is worth a look; else none.
pub fn laws_far_ahead(problem: &Problem, search: &Search) -> Vec<Unknown> {
    let best = search.best();
    if !best.fit.strains() {
        return Vec::new();
    }
    let laws = beside_sets(problem, search, best, &[]);
    let far = best.lead + search.behind(best.fit.log_evidence);
    if laws.iter().any(|l| l.fit.is_some() && l.lead > far) { laws } else { Vec::new() }
}

fn beside_sets(problem: &Problem, search: &Search, best: &Hypothesis, known: &[Unknown]) -> Vec<Unknown> {
    let beside = |set: &Hypothesis, least: f64| {
        let there: Vec<Unknown> = known.iter().filter(|u| u.effects == set.effects).cloned().collect();
        if there.is_empty() { places(problem, set, least) } else { there }
    };
    let mut all = beside(best, best.lead);
    if !best.effects.is_empty() {
        all.extend(beside(search.base(), best.lead - search.behind(best.fit.log_evidence)));
    }
    all.sort_by(|a, b| b.lead.total_cmp(&a.lead));
    all
}

/// Weighs missing laws beside what the search found; `known` ones are not worked out again.
pub fn posterior(problem: &Problem, search: &Search, known: &[Unknown]) -> Posterior {
    let mut all: Vec<Explanation> = Vec::new();
    for h in &search.hypotheses {
        all.push(Explanation {
            effects: h.effects.clone(),
            place: None,
            log_posterior: h.log_posterior,
            probability: 0.0,
            fit: Some(h.fit.clone()),
        });
    }
    let best = search.best();
    let mut unknowns = beside_sets(problem, search, best, known);
    // The set that is believed may be a smaller one than that which leads.
    let believed = search.hypotheses.iter().max_by(|a, b| a.log_posterior.total_cmp(&b.log_posterior)).unwrap_or(best);
    if !believed.effects.is_empty() && believed.effects != best.effects {
        unknowns.extend(places(problem, believed, believed.lead));
    }
    // A law that is missing may have been what an effect stood in for, or stand in for one: both are tried from the best.
    if let Some(first) = unknowns.iter().find(|u| u.fit.is_some()).filter(|u| u.lead > best.lead).cloned() {
        unknowns.extend(changed_beside(problem, search, first));
    }
    // Of two fits of one explanation the better one, and either before a promise.
    unknowns.sort_by(|a, b| b.fit.is_some().cmp(&a.fit.is_some()).then(b.lead.total_cmp(&a.lead)));
    let mut distinct: Vec<Unknown> = Vec::new();
    for u in unknowns {
        if !distinct.iter().any(|d| d.effects == u.effects && d.law.place == u.law.place) {
            distinct.push(u);
        }
    }
    all.extend(distinct.into_iter().map(|u| Explanation {
        effects: u.effects,
        place: Some(u.law.place),
        log_posterior: u.log_posterior,
        probability: 0.0,
        fit: u.fit,
    }));
    let fitted = all.iter().filter(|e| e.fit.is_some()).map(|e| e.log_posterior);
    let most = fitted.fold(f64::NEG_INFINITY, f64::max);
    // What was not fitted is only promised: it weighs no more than the best that was, and half as much if it would.
    for e in &mut all {
        e.log_posterior = e.log_posterior.min(most);
        e.probability = (e.log_posterior - most).exp() * if e.fit.is_some() { 1.0 } else { 0.5 };
    }
    all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    let sum: f64 = all.iter().map(|e| e.probability).sum();
    all.iter_mut().for_each(|e| e.probability /= sum);
    Posterior { explanations: all, base_misfit: misfit(&search.base().fit.residuals) }
}

/// Drops effects beside a missing law one by one, and lets effects stand for tolerances that are strained beside it, as long as that is more probable; if
/// no effect is left, tries the likeliest single ones.
fn changed_beside(problem: &Problem, search: &Search, first: Unknown) -> Vec<Unknown> {
    let mut all = Vec::new();
    let mut current = first;
    for _ in 0..2 * MOST_EFFECTS {
        let from = current.fit.as_ref().expect("only what was fitted is tried");
        let without = |dropped: usize| {
            let rest: Vec<usize> = current.effects.iter().copied().filter(|e| *e != dropped).collect();
            let mut start = from.point.clone();
            for p in REGISTRY[dropped].parameters.clone() {
                start.effects[p] = crate::effects::PARAMETERS[p].null;
            }
            (rest, start)
        };
        let mut others: Vec<(Vec<usize>, Point)> = current.effects.iter().map(|e| without(*e)).collect();
        if from.strains() && current.effects.len() < MOST_EFFECTS {
            others.extend(taken_over(problem, &from.point, &current.effects));
        }
        others.iter_mut().for_each(|o| o.0.sort_unstable());
        others.retain(|o| all.iter().all(|u: &Unknown| u.effects != o.0));
        let other = |(effects, start): &(Vec<usize>, Point)| beside(problem, effects, &current.law, start, from.known());
        let others: Vec<Unknown> = others.iter().map(other).collect();
        // What is believed may be a smaller set than what leads: a step that gains in either is one.
        let by = |of: fn(&Unknown) -> f64| others.iter().max_by(|a, b| of(a).total_cmp(&of(b))).filter(|u| of(u) >= of(&current)).cloned();
        let next = by(|u| u.log_posterior).or_else(|| by(|u| u.lead));
        all.extend(others);
        let Some(next) = next else { break };
        current = next;
    }
    if !current.effects.is_empty() {
        return all;
    }
    let singles = search.hypotheses.iter().filter(|h| h.effects.len() == 1).take(TRIED_BESIDE);
    let start = current.fit.as_ref().map(|f| f.point.clone());
    for single in singles {
        let mut point = start.clone().unwrap_or_else(|| problem.nominal());
        point.effects = single.fit.point.effects;
        all.push(beside(problem, &single.effects, &current.law, &point, current.fit.as_ref().and_then(Fit::known)));
    }
    all
}

/// Single effects that are tried beside a missing law.
const TRIED_BESIDE: usize = 2;
