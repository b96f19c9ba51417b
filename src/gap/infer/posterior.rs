//! The posterior over everything that may be wrong: sets of effects, with a missing law in some place or without.
//!
//! Verdict, probabilities, groups and places are sums of this one distribution.

use super::belief::{ACCURACIES, ByAccuracy};
use super::density::{Point, Problem};
use super::fit::Fit;
use super::prior::moment;
use super::search::{Hypothesis, MOST_EFFECTS, Search, taken_over};
use super::strained::Strained;
use super::unknown::{PLACE_PRIOR, Unknown, beside, places};
use super::weigh::log_sum;
use crate::effects::{REGISTRY, Subsystem};
use std::f64::consts::LN_2;

/// One explanation with its share of the posterior; nothing wrong, and not weighed, unless more is said.
#[derive(Clone, Debug, Default)]
pub struct Explanation {
    /// Effects, by their place in the registry, ascending.
    pub effects: Vec<usize>,
    /// Place of a missing law, if there is one.
    pub place: Option<Subsystem>,
    /// Logarithm of the posterior for each accuracy that explanations may have, nats, up to a constant of its own.
    pub by_accuracy: ByAccuracy<f64>,
    /// [`Fit::strain`] for each accuracy, if it was fitted.
    pub strains: ByAccuracy<f64>,
    /// Logarithm of the posterior, the mean over accuracies, nats.
    pub log_posterior: f64,
    /// Posterior probability.
    pub probability: f64,
    /// Fit; of a missing law that was not worth one, none.
    pub fit: Option<Fit>,
}

/// The posterior, the explanation that stands first, then by probability.
#[derive(Clone, Debug)]
pub struct Posterior {
    /// All explanations that were weighed.
    pub explanations: Vec<Explanation>,
    /// Probability that none of them holds, see [`strained`].
    pub beyond: f64,
    /// Misfit of the car within its tolerances.
    pub base_misfit: f64,
}

impl Posterior {
    /// The explanation that stands: the first that was fitted.
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

/// Weighs missing laws beside what the search found; `known` ones are not worked out again.
pub fn posterior(problem: &Problem, search: &Search, known: Strained) -> Posterior {
    let tolerated = |effects: &[usize], fit: &Fit| effects.iter().any(|&e| problem.is_tolerated(&fit.point, e));
    let sets: Vec<&Hypothesis> = search.hypotheses.iter().filter(|h| !tolerated(&h.effects, &h.fit)).collect();
    let best = sets.first().copied().unwrap_or(search.base());
    let mut unknowns: Vec<Unknown> = known.laws_beside(problem, search, best);
    unknowns.sort_by(|a, b| b.lead.total_cmp(&a.lead));
    // The set that is believed may be a smaller one than that which leads.
    let believed = sets.iter().copied().max_by(|a, b| a.log_posterior.total_cmp(&b.log_posterior)).unwrap_or(best);
    if !believed.effects.is_empty() && believed.effects != best.effects {
        unknowns.extend(places(problem, believed, believed.lead));
    }
    // A law that is missing may have been what an effect stood in for, or stand in for one: both are tried from the best.
    if let Some(first) = unknowns.iter().find(|u| u.fit.is_some()).filter(|u| u.lead > best.lead).cloned() {
        unknowns.extend(changed_beside(problem, search, first));
    }
    let mut left_out: Vec<(Vec<usize>, Subsystem)> = Vec::new();
    loop {
        unknowns.retain(|u| u.fit.as_ref().is_none_or(|fit| !tolerated(&u.effects, fit)));
        unknowns = distinct(unknowns);
        let posterior = weighed(problem, search, &sets, &unknowns);
        // What stands has been tried without each of its effects: what is believed in the end is not what steered the search.
        let first = posterior.best();
        let Some(first) = unknowns.iter().find(|u| u.effects == first.effects && Some(u.law.place) == first.place) else {
            return posterior;
        };
        let Some(fit) = &first.fit else { return posterior };
        let is_tried = |rest: &Vec<usize>| {
            let fitted = unknowns.iter().filter(|u| u.fit.is_some()).map(|u| (&u.effects, u.law.place));
            fitted.chain(left_out.iter().map(|(effects, place)| (effects, *place))).any(|of| of == (rest, first.law.place))
        };
        let without = |e: &usize| (all_but(&first.effects, *e), fit.point.without(*e));
        let untried: Vec<(Vec<usize>, Point)> = first.effects.iter().map(without).filter(|(rest, _)| !is_tried(rest)).collect();
        if untried.is_empty() {
            return posterior;
        }
        let place = first.law.place;
        let further: Vec<Unknown> = untried.iter().map(|(rest, start)| beside(problem, rest, &first.law, start, fit.known())).collect();
        left_out.extend(untried.into_iter().map(|(rest, _)| (rest, place)));
        unknowns.extend(further);
    }
}

/// Each explanation once: of two fits the better one, and either before a promise.
fn distinct(mut unknowns: Vec<Unknown>) -> Vec<Unknown> {
    unknowns.sort_by(|a, b| b.fit.is_some().cmp(&a.fit.is_some()).then(b.lead.total_cmp(&a.lead)));
    let mut distinct: Vec<Unknown> = Vec::new();
    for u in unknowns {
        if !distinct.iter().any(|d| d.effects == u.effects && d.law.place == u.law.place) {
            distinct.push(u);
        }
    }
    distinct
}

/// Effects without one of them.
fn all_but(effects: &[usize], dropped: usize) -> Vec<usize> {
    effects.iter().copied().filter(|e| *e != dropped).collect()
}

/// The posterior of sets of effects and of missing laws beside them.
fn weighed(problem: &Problem, search: &Search, sets: &[&Hypothesis], unknowns: &[Unknown]) -> Posterior {
    let of_set = |h: &&Hypothesis| Explanation {
        effects: h.effects.clone(),
        by_accuracy: h.by_accuracy,
        strains: h.strains,
        fit: Some(h.fit.clone()),
        ..Explanation::default()
    };
    let of_law = |u: &Unknown| {
        let apart = prior_beside_the_library(search, u) + prior_beside_a_law(search, unknowns, u);
        Explanation {
            effects: u.effects.clone(),
            place: Some(u.law.place),
            by_accuracy: u.by_accuracy.map(|l| l + apart),
            strains: u.strains,
            fit: u.fit.clone(),
            ..Explanation::default()
        }
    };
    let mut all: Vec<Explanation> = sets.iter().map(of_set).chain(unknowns.iter().map(of_law)).collect();
    let beyond = average(&mut all, problem.shared.len());
    order(&mut all, |e| e.fit.is_some());
    Posterior { explanations: all, beyond, base_misfit: search.base().fit.misfit() }
}

/// Logarithm of the factor that the prior of a missing law has because it is none of the library's, from the sets that have an effect of its subsystem instead.
fn prior_beside_the_library(search: &Search, law: &Unknown) -> f64 {
    let (Some(fit), Some(without)) = (&law.fit, search.of(&law.effects)) else { return 0.0 };
    let instead = |h: &&Hypothesis| {
        let further: Vec<usize> = h.effects.iter().copied().filter(|e| !law.effects.contains(e)).collect();
        h.effects.len() == law.effects.len() + 1 && matches!(further[..], [e] if REGISTRY[e].effect.subsystem == law.law.place)
    };
    let library = search.hypotheses.iter().filter(instead).map(|h| h.fit.misfit()).min_by(f64::total_cmp);
    library.map_or(0.0, |library| departure(without.fit.misfit(), fit.misfit(), library))
}

/// Logarithm of the factor that the prior of effects has because they are beside a missing law of their own subsystem.
fn prior_beside_a_law(search: &Search, laws: &[Unknown], law: &Unknown) -> f64 {
    let Some(fit) = &law.fit else { return 0.0 };
    let of_law = |rest: &[usize]| laws.iter().find(|u| u.effects == rest && u.law.place == law.law.place).and_then(|u| u.fit.as_ref());
    let with_law = |rest: &[usize]| of_law(rest).map(Fit::misfit);
    let without = |rest: &[usize]| search.of(rest).map(|h| h.fit.misfit());
    departures(&law.effects, law.law.place, fit.misfit(), with_law, without)
}

/// The same from what is left with effects and law, and with each set that lacks one of the effects, with the law and without, if that is known.
fn departures(
    effects: &[usize],
    place: Subsystem,
    with_all: f64,
    with_law: impl Fn(&[usize]) -> Option<f64>,
    without: impl Fn(&[usize]) -> Option<f64>,
) -> f64 {
    let one = |effect: &usize| {
        let rest = all_but(effects, *effect);
        with_law(&rest).zip(without(&rest)).map_or(0.0, |(alone, neither)| departure(neither, with_all, alone))
    };
    effects.iter().filter(|e| REGISTRY[**e].effect.subsystem == place).map(one).sum()
}

/// The same from what is left with neither of two, with the one whose prior it is (or both), and with the other.
///
/// A law's functions can also do what an effect of its subsystem does, and then it is that effect in another form, or the effect beside it a part of the law. As the prior of an effect vanishes
/// where it does nothing, that of a law vanishes where an effect does all that it does, and that of an effect beside the law where the law does ([`moment`]); the square of the departure
/// is the share of what is accounted for that the other does not.
fn departure(with_neither: f64, with_it: f64, with_other: f64) -> f64 {
    let (it, other) = (with_neither - with_it, with_neither - with_other);
    if it > 0.0 && other > 0.0 { moment((1.0 - other / it).max(LEAST_DEPARTURE)).min(0.0) } else { 0.0 }
}

/// Least square of a departure that counts: fits do not end nearer to their modes.
const LEAST_DEPARTURE: f64 = 1e-3;

/// Logarithm of how much more probable than the leading explanation it is that none of those compared holds, if the squares of that one's tolerances, so many, come to this.
///
/// No more than one missing law is compared. Two of them in two subsystems have the prior odds of their places; what they would leave beside the explanation's effects is not
/// worked out, and taken to be as much as the explanation leaves, with tolerances as those of cars are: their squares come to their number.
fn strained(strain: f64, tolerances: usize) -> f64 {
    let places = Subsystem::ALL.len() as f64;
    0.5 * (strain - tolerances as f64) + (0.5 * places * (places - 1.0)).ln() + 2.0 * PLACE_PRIOR.ln()
}

/// Probabilities: the mean over the accuracies that explanations may have, each as likely. Returns that of none of them.
fn average(all: &mut [Explanation], tolerances: usize) -> f64 {
    average_of(all, tolerances, |e| e.fit.is_some())
}

/// The same where this tells what was fitted.
fn average_of(all: &mut [Explanation], tolerances: usize, is_fitted: impl Fn(&Explanation) -> bool) -> f64 {
    let mut beyond = 0.0;
    let fitted: Vec<bool> = all.iter().map(is_fitted).collect();
    let mut shares: Vec<Vec<f64>> = vec![Vec::new(); all.len()];
    for c in 0..ACCURACIES.len() {
        let most = all.iter().zip(&fitted).filter(|(_, f)| **f).map(|(e, _)| e.by_accuracy[c]).fold(f64::NEG_INFINITY, f64::max);
        // What was not fitted is only promised: it weighs no more than the best that was, and half as much if it would.
        let weight = |(e, fitted): (&Explanation, &bool)| (e.by_accuracy[c] - most).min(0.0) - if *fitted { 0.0 } else { LN_2 };
        let logs: Vec<f64> = all.iter().zip(&fitted).map(weight).collect();
        let leader = (0..all.len()).filter(|&k| fitted[k]).max_by(|&a, &b| logs[a].total_cmp(&logs[b]));
        let none = leader.map_or(f64::NEG_INFINITY, |k| logs[k] + strained(all[k].strains[c], tolerances));
        let sum = log_sum(&[log_sum(&logs), none]);
        beyond += (none - sum).exp() / ACCURACIES.len() as f64;
        shares.iter_mut().zip(logs).for_each(|(s, l)| s.push(l - sum));
    }
    for (e, shares) in all.iter_mut().zip(shares) {
        e.log_posterior = log_sum(&shares) - (ACCURACIES.len() as f64).ln();
        e.probability = e.log_posterior.exp();
    }
    beyond
}

/// The most probable explanation first; but not that nothing is wrong where it is likelier that something is: effects that look alike share what one of them would
/// have alone. What is only promised decides nothing.
fn order(all: &mut [Explanation], is_fitted: impl Fn(&Explanation) -> bool) {
    all.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
    let nothing = |e: &Explanation| e.effects.is_empty() && e.place.is_none();
    let sum = |of: &dyn Fn(&Explanation) -> bool| all.iter().filter(|e| of(e)).map(|e| e.probability).sum::<f64>();
    let (sound, wrong) = (sum(&nothing), sum(&|e| !nothing(e) && is_fitted(e)));
    if let Some(first) = all.iter().position(|e| !nothing(e) && is_fitted(e)).filter(|_| sound < wrong) {
        all[..=first].rotate_right(1);
    }
}

/// Drops effects beside a missing law one by one, and lets effects stand for tolerances that are strained beside it, as long as that is more probable; if
/// no effect is left, tries the likeliest single ones.
fn changed_beside(problem: &Problem, search: &Search, first: Unknown) -> Vec<Unknown> {
    let mut all = Vec::new();
    let mut current = first;
    for _ in 0..2 * MOST_EFFECTS {
        let from = current.fit.as_ref().expect("only what was fitted is tried");
        let without = |e: &usize| (all_but(&current.effects, *e), from.point.without(*e));
        let mut others: Vec<(Vec<usize>, Point)> = current.effects.iter().map(without).collect();
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

#[cfg(test)]
mod tests {
    use super::*;

    fn explanation(effects: &[usize], by_accuracy: ByAccuracy<f64>) -> Explanation {
        Explanation { effects: effects.to_vec(), by_accuracy, ..Explanation::default() }
    }

    /// Tolerances of which none is strained.
    const MANY: usize = 100;

    /// Eighteen tolerances. Strained as much as they are expected to be, the odds that two laws are missing that nobody compares are 21 pairs of places with 0.012² each; by 20 nats more
    /// hardly anything else is left, and what is believed is then what strains them less.
    #[test]
    fn explanations_that_strain_tolerances_leave_room_for_what_nobody_compares() {
        let of = |strains: [f64; 2]| {
            let mut all =
                [1, 2].map(|k| Explanation { strains: [strains[k - 1]; 3], ..explanation(&[k], [if k == 1 { 30.0 } else { 0.0 }; 3]) });
            let beyond = average_of(&mut all, 18, |_| true);
            let sum: f64 = all.iter().map(|e| e.probability).sum();
            assert!((sum + beyond - 1.0).abs() < 1e-12);
            (beyond, all[0].probability)
        };
        let odds = 21.0 * 0.012_f64.powi(2);
        let (beyond, _) = of([18.0, 0.0]);
        assert!((beyond - odds / (1.0 + odds)).abs() < 1e-9, "{beyond}");
        let (beyond, first) = of([18.0 + 40.0, 0.0]);
        let expected = odds * 20.0_f64.exp();
        assert!((beyond - expected / (1.0 + expected)).abs() < 1e-9 && (first - 1.0 / (1.0 + expected)).abs() < 1e-9, "{beyond} {first}");
        assert!(of([4.0, 4.0]).0 < 1e-5);
        // What a better explanation does not strain needs no such law.
        assert!(of([4.0, 18.0 + 80.0]).0 < 1e-5);
    }

    /// What an effect does to a thousandth is no law of its own; one that does twice as much as the effect pays its half, and one that an effect does nothing for pays nothing.
    #[test]
    fn a_law_that_does_what_an_effect_does_is_that_effect() {
        let of = |effect: f64| departure(1000.0, 0.0, 1000.0 - effect);
        for (effect, square) in [(1.0_f64, 0.999_f64), (500.0, 0.5), (900.0, 0.1), (999.9, 1e-3), (1100.0, 1e-3)] {
            assert!((of(effect) - (square.ln() - 0.01 / square).min(0.0)).abs() < 1e-9, "{effect}: {}", of(effect));
        }
        assert!(of(999.9) < -16.0 && of(500.0) > -0.8);
        // What does nothing, or harm, says nothing.
        assert_eq!([of(0.0), of(-5.0), departure(1000.0, 1000.0, 500.0), departure(1000.0, 1001.0, 500.0)], [0.0; 4]);
    }

    /// Beside a law of the driveline a load that adds a hundredth to what the law does pays for that; a bias of the engine, which is elsewhere, pays nothing, nor does what nothing is known of.
    #[test]
    fn an_effect_that_adds_little_to_a_law_of_its_subsystem_is_a_part_of_the_law() {
        let [bias, load] = ["engine_torque_bias", "road_load"].map(|id| crate::effects::find(id).unwrap());
        let set = [bias, load];
        let with_law = |rest: &[usize]| (rest == [bias]).then_some(1010.0);
        let without = |rest: &[usize]| (rest == [bias]).then_some(2000.0);
        let found = departures(&set, Subsystem::Driveline, 1000.0, with_law, without);
        assert!((found - (0.01_f64.ln() - 1.0)).abs() < 1e-9, "{found}");
        assert_eq!(departures(&set, Subsystem::Engine, 1000.0, with_law, without), 0.0);
        assert_eq!(departures(&set, Subsystem::Driveline, 1000.0, |_| None, without), 0.0);
        assert_eq!(departures(&set, Subsystem::Driveline, 1000.0, with_law, |_| None), 0.0);
    }

    /// Of two explanations one leads by 10 nats if laws are nearly exact and by less the less they are: what is believed lies between the first and the last, and all of
    /// it adds up to one, however far the logarithms are from zero.
    #[test]
    fn what_is_believed_is_the_mean_over_how_exact_laws_may_be() {
        let ahead = [10.0, 2.0, -1.0];
        let mut all = [explanation(&[1], ahead.map(|a| a - 1e4)), explanation(&[2], [-1e4; 3])];
        average_of(&mut all, MANY, |_| true);
        let odds = |a: f64| 1.0 / (1.0 + (-a).exp());
        let expected = ahead.into_iter().map(odds).sum::<f64>() / 3.0;
        assert!((all[0].probability - expected).abs() < 1e-12, "{} {expected}", all[0].probability);
        assert!((all[0].probability + all[1].probability - 1.0).abs() < 1e-12);
        // Nothing is wrong with 0.4, one of two effects that look alike with 0.6: one of these stands, and then comes what is more probable by itself.
        let [none, one, other] = [0.4_f64, 0.32, 0.28].map(f64::ln);
        let mut alike = [explanation(&[], [none; 3]), explanation(&[2], [other; 3]), explanation(&[1], [one; 3])];
        average_of(&mut alike, MANY, |_| true);
        order(&mut alike, |_| true);
        assert_eq!(alike.each_ref().map(|e| e.effects.clone()), [vec![1], vec![], vec![2]]);
        alike[1].by_accuracy = [0.7_f64.ln(); 3];
        average_of(&mut alike, MANY, |_| true);
        order(&mut alike, |_| true);
        assert!(alike[0].effects.is_empty());
        // The other is only promised: what was fitted is weighed without it.
        let mut alike = [explanation(&[], [none; 3]), explanation(&[2], [other; 3]), explanation(&[1], [one; 3])];
        average_of(&mut alike, MANY, |e| e.effects != [2]);
        order(&mut alike, |e| e.effects != [2]);
        assert!(alike[0].effects.is_empty());
        // A promise weighs at most half as much as the best that was fitted.
        average_of(&mut all, MANY, |e| e.effects == [2]);
        assert!(all[0].probability < 1.0 / 3.0 + 1e-12, "{}", all[0].probability);
    }

    /// A pair leads the search, and one of the two alone is believed more: missing laws are weighed beside the pair, beside that one, and beside none.
    #[test]
    fn laws_are_weighed_beside_the_set_that_is_believed() {
        let example = crate::gap::model::prepare::Example::read();
        let (problem, _) = example.problem(&[&example.campaign.recordings[0]]);
        let mut pair = ["friction_level", "vehicle_mass"].map(|id| crate::effects::find(id).unwrap()).to_vec();
        pair.sort_unstable();
        let of = |set: &[usize], lead: f64, log_posterior: f64| {
            let fitted = Hypothesis::fitted(&problem, set.to_vec(), &problem.nominal(), 1, None);
            Hypothesis { lead, log_posterior, ..fitted }
        };
        // So far ahead that no law is fitted, only promised.
        let sets = vec![of(&pair, 3e9, 1.0), of(&pair[..1], 2e9, 2.0), of(&[], 1e9, 0.0)];
        let found = posterior(&problem, &Search::made_up(sets), Strained::default());
        let beside = |set: &[usize]| found.explanations.iter().filter(|e| e.place.is_some() && e.effects == set).count();
        assert!([beside(&pair), beside(&pair[..1]), beside(&[])].iter().all(|laws| *laws > 0) && beside(&pair[1..]) == 0);
    }
}
