//! The posterior over everything that may be wrong: sets of effects, with or without a missing law in some place.
//!
//! Verdict, probabilities, groups and places are sums over this one distribution.

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

/// One explanation with its share of the posterior. By default, nothing is wrong and nothing has been weighed.
#[derive(Clone, Debug, Default)]
pub struct Explanation {
    /// Effects, by their place in the registry, ascending.
    pub effects: Vec<usize>,
    /// Subsystem of the missing law, if there is one.
    pub place: Option<Subsystem>,
    /// Logarithm of the posterior for each accuracy that explanations may have, nats, up to a constant of each accuracy.
    pub by_accuracy: ByAccuracy<f64>,
    /// [`Fit::strain`] for each accuracy, if it was fitted.
    pub strains: ByAccuracy<f64>,
    /// Logarithm of the posterior probability, which is the mean over accuracies, nats.
    pub log_posterior: f64,
    /// Posterior probability.
    pub probability: f64,
    /// The fit; none for a missing law that was not worth one.
    pub fit: Option<Fit>,
}

/// The posterior. Its explanations are in the order of their probability, except that the one that stands may precede "nothing is wrong".
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

/// Weighs missing laws beside the sets that the search found; those that are already `known` are not computed again.
pub fn posterior(problem: &Problem, search: &Search, known: Strained) -> Posterior {
    let tolerated = |effects: &[usize], fit: &Fit| effects.iter().any(|&e| problem.is_tolerated(&fit.point, e));
    let sets: Vec<&Hypothesis> = search.hypotheses.iter().filter(|h| !tolerated(&h.effects, &h.fit)).collect();
    let best = sets.first().copied().unwrap_or(search.base());
    let mut unknowns: Vec<Unknown> = known.laws_beside(problem, search, best);
    unknowns.sort_by(|a, b| b.exact_log_posterior.total_cmp(&a.exact_log_posterior));
    // The set that is most probable at the powers of the search may be smaller than the one that leads under the full likelihood.
    let believed = sets.iter().copied().max_by(|a, b| a.log_posterior.total_cmp(&b.log_posterior)).unwrap_or(best);
    if !believed.effects.is_empty() && believed.effects != best.effects {
        unknowns.extend(places(problem, believed, believed.exact_log_posterior));
    }
    // An effect may stand in for a missing law, and a missing law for an effect: both are tried, from the leading law.
    if let Some(first) = unknowns.iter().find(|u| u.fit.is_some()).filter(|u| u.exact_log_posterior > best.exact_log_posterior).cloned() {
        unknowns.extend(changed_beside(problem, search, first));
    }
    let mut left_out: Vec<(Vec<usize>, Subsystem)> = Vec::new();
    loop {
        unknowns.retain(|u| u.fit.as_ref().is_none_or(|fit| !tolerated(&u.effects, fit)));
        unknowns = distinct(unknowns);
        let posterior = weighed(problem, search, &sets, &unknowns);
        // The explanation that stands must also have been fitted without each of its effects: the search was steered by other probabilities than those that count in the end.
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

/// Removes duplicate explanations: of two fits the better one is kept, and a fit takes precedence over a promise of the linear model.
fn distinct(mut unknowns: Vec<Unknown>) -> Vec<Unknown> {
    unknowns.sort_by(|a, b| b.fit.is_some().cmp(&a.fit.is_some()).then(b.exact_log_posterior.total_cmp(&a.exact_log_posterior)));
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

/// The posterior over sets of effects and missing laws beside them.
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

/// Logarithm of a factor on the prior of a missing law, by which the law must differ from the library: it is computed from the sets that have an effect of the law's subsystem
/// instead of the law.
fn prior_beside_the_library(search: &Search, law: &Unknown) -> f64 {
    let (Some(fit), Some(without)) = (&law.fit, search.of(&law.effects)) else { return 0.0 };
    let instead = |h: &&Hypothesis| {
        let further: Vec<usize> = h.effects.iter().copied().filter(|e| !law.effects.contains(e)).collect();
        h.effects.len() == law.effects.len() + 1 && matches!(further[..], [e] if REGISTRY[e].effect.subsystem == law.law.place)
    };
    let library = search.hypotheses.iter().filter(instead).map(|h| h.fit.misfit()).min_by(f64::total_cmp);
    library.map_or(0.0, |library| departure(without.fit.misfit(), fit.misfit(), library))
}

/// Logarithm of a factor on the prior of effects that stand beside a missing law of their own subsystem.
fn prior_beside_a_law(search: &Search, laws: &[Unknown], law: &Unknown) -> f64 {
    let Some(fit) = &law.fit else { return 0.0 };
    let of_law = |rest: &[usize]| laws.iter().find(|u| u.effects == rest && u.law.place == law.law.place).and_then(|u| u.fit.as_ref());
    let with_law = |rest: &[usize]| of_law(rest).map(Fit::misfit);
    let without = |rest: &[usize]| search.of(rest).map(|h| h.fit.misfit());
    departures(&law.effects, law.law.place, fit.misfit(), with_law, without)
}

/// Sum of [`departure`] over the effects of the law's subsystem `place`, from misfits: `with_all` is left with effects and law, `with_law` and `without` by a set that lacks one of
/// the effects, with the law and without it, where that is known.
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

/// Logarithm of the factor on the prior of a law, or of an effect beside a law, from three misfits: with neither of two, with the one whose prior it is (or with both), and with
/// the other.
///
/// A law's functions can also do what an effect of its subsystem does. The law is then that effect in another form, or the effect beside it is a part of the law. As the prior of
/// an effect vanishes where the effect does nothing, that of a law vanishes where an effect does all that the law does, and that of an effect beside the law where the law alone
/// does everything ([`moment`]). The square of the departure is the share of what is accounted for that the other one does not account for.
fn departure(with_neither: f64, with_it: f64, with_other: f64) -> f64 {
    let (it, other) = (with_neither - with_it, with_neither - with_other);
    if it > 0.0 && other > 0.0 { moment((1.0 - other / it).max(LEAST_DEPARTURE)).min(0.0) } else { 0.0 }
}

/// Lower limit of the square of a departure, because fits do not end nearer to their modes.
const LEAST_DEPARTURE: f64 = 1e-3;

/// Log odds of the hypothesis that none of the compared explanations holds against the leading one, whose tolerances, `tolerances` in number, have the sum of squares `strain`.
///
/// Explanations with more than one missing law are not compared. Two laws that are missing in two subsystems have the prior odds of their places. What they would leave beside the
/// explanation's effects is not computed; it is taken to be as much as the explanation leaves, with tolerances like those of real cars, whose squares add up to their number.
fn strained(strain: f64, tolerances: usize) -> f64 {
    let places = Subsystem::ALL.len() as f64;
    0.5 * (strain - tolerances as f64) + (0.5 * places * (places - 1.0)).ln() + 2.0 * PLACE_PRIOR.ln()
}

/// Sets the probabilities of all explanations: the mean over the accuracies that explanations may have, all equally likely. Returns the probability that none of them holds.
fn average(all: &mut [Explanation], tolerances: usize) -> f64 {
    average_of(all, tolerances, |e| e.fit.is_some())
}

/// As [`average`], where `is_fitted` says which explanations were fitted.
fn average_of(all: &mut [Explanation], tolerances: usize, is_fitted: impl Fn(&Explanation) -> bool) -> f64 {
    let mut beyond = 0.0;
    let fitted: Vec<bool> = all.iter().map(is_fitted).collect();
    let mut shares: Vec<Vec<f64>> = vec![Vec::new(); all.len()];
    for c in 0..ACCURACIES.len() {
        let most = all.iter().zip(&fitted).filter(|(_, f)| **f).map(|(e, _)| e.by_accuracy[c]).fold(f64::NEG_INFINITY, f64::max);
        // An explanation that was not fitted is only a promise: its weight is halved, and limited to half of that of the best fitted one.
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

/// Sorts explanations by probability. "Nothing is wrong" is preceded by the best explanation in which something is wrong if that is more probable altogether, because effects that
/// look alike share the probability that one of them would have alone. Explanations that are only promised do not count for this.
fn order(all: &mut [Explanation], is_fitted: impl Fn(&Explanation) -> bool) {
    all.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
    let nothing = |e: &Explanation| e.effects.is_empty() && e.place.is_none();
    let sum = |of: &dyn Fn(&Explanation) -> bool| all.iter().filter(|e| of(e)).map(|e| e.probability).sum::<f64>();
    let (sound, wrong) = (sum(&nothing), sum(&|e| !nothing(e) && is_fitted(e)));
    if let Some(first) = all.iter().position(|e| !nothing(e) && is_fitted(e)).filter(|_| sound < wrong) {
        all[..=first].rotate_right(1);
    }
}

/// Drops effects beside a missing law one by one, and adds effects in place of tolerances that are strained beside it, as long as that is more probable. If no effect is left,
/// tries the leading single ones.
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
        // The set that is most probable at the powers of the search may be smaller than the one that leads under the full likelihood; a step that gains in either is taken.
        let by = |of: fn(&Unknown) -> f64| others.iter().max_by(|a, b| of(a).total_cmp(&of(b))).filter(|u| of(u) >= of(&current)).cloned();
        let next = by(|u| u.log_posterior).or_else(|| by(|u| u.exact_log_posterior));
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

/// Number of single effects that are tried beside a missing law.
const TRIED_BESIDE: usize = 2;

#[cfg(test)]
mod tests {
    use super::*;

    fn explanation(effects: &[usize], by_accuracy: ByAccuracy<f64>) -> Explanation {
        Explanation { effects: effects.to_vec(), by_accuracy, ..Explanation::default() }
    }

    /// Number of tolerances, so large that none of the explanations strains them.
    const MANY: usize = 100;

    /// With eighteen tolerances that are strained as much as expected, the odds that two laws are missing that are not compared are 21 pairs of places with 0.012² each. If they
    /// are strained by 20 nats more, hardly anything else is left. Only the strain of the leading explanation counts.
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
        // Strain of an explanation that does not lead has no influence.
        assert!(of([4.0, 18.0 + 80.0]).0 < 1e-5);
    }

    /// A law is no law of its own if an effect does all that it does, to within a thousandth. A law that does twice as much as the effect pays the factor of one half, and one for
    /// which an effect does nothing pays nothing.
    #[test]
    fn a_law_that_does_what_an_effect_does_is_that_effect() {
        let of = |effect: f64| departure(1000.0, 0.0, 1000.0 - effect);
        for (effect, square) in [(1.0_f64, 0.999_f64), (500.0, 0.5), (900.0, 0.1), (999.9, 1e-3), (1100.0, 1e-3)] {
            assert!((of(effect) - (square.ln() - 0.01 / square).min(0.0)).abs() < 1e-9, "{effect}: {}", of(effect));
        }
        assert!(of(999.9) < -16.0 && of(500.0) > -0.8);
        // There is no factor if one of the two gains nothing or does harm.
        assert_eq!([of(0.0), of(-5.0), departure(1000.0, 1000.0, 500.0), departure(1000.0, 1001.0, 500.0)], [0.0; 4]);
    }

    /// Beside a law of the driveline, a load that adds a hundredth to what the law does pays for that. A bias of the engine, which is another subsystem, pays nothing, nor does an
    /// effect without known misfits to compare.
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

    /// One of two explanations leads by 10 nats if laws are nearly exact, and by less the less exact they are. Its probability is the mean over these cases, and all probabilities
    /// add up to one, however far the logarithms are from zero.
    #[test]
    fn what_is_believed_is_the_mean_over_how_exact_laws_may_be() {
        let ahead = [10.0, 2.0, -1.0];
        let mut all = [explanation(&[1], ahead.map(|a| a - 1e4)), explanation(&[2], [-1e4; 3])];
        average_of(&mut all, MANY, |_| true);
        let odds = |a: f64| 1.0 / (1.0 + (-a).exp());
        let expected = ahead.into_iter().map(odds).sum::<f64>() / 3.0;
        assert!((all[0].probability - expected).abs() < 1e-12, "{} {expected}", all[0].probability);
        assert!((all[0].probability + all[1].probability - 1.0).abs() < 1e-12);
        // The probability that nothing is wrong is 0.4, and two effects that look alike share 0.6: the more probable of the two stands, followed by what is more probable by
        // itself.
        let [none, one, other] = [0.4_f64, 0.32, 0.28].map(f64::ln);
        let mut alike = [explanation(&[], [none; 3]), explanation(&[2], [other; 3]), explanation(&[1], [one; 3])];
        average_of(&mut alike, MANY, |_| true);
        order(&mut alike, |_| true);
        assert_eq!(alike.each_ref().map(|e| e.effects.clone()), [vec![1], vec![], vec![2]]);
        alike[1].by_accuracy = [0.7_f64.ln(); 3];
        average_of(&mut alike, MANY, |_| true);
        order(&mut alike, |_| true);
        assert!(alike[0].effects.is_empty());
        // The other effect is only promised, and does not count together with the fitted one.
        let mut alike = [explanation(&[], [none; 3]), explanation(&[2], [other; 3]), explanation(&[1], [one; 3])];
        average_of(&mut alike, MANY, |e| e.effects != [2]);
        order(&mut alike, |e| e.effects != [2]);
        assert!(alike[0].effects.is_empty());
        // A promise weighs at most half as much as the best that was fitted.
        average_of(&mut all, MANY, |e| e.effects == [2]);
        assert!(all[0].probability < 1.0 / 3.0 + 1e-12, "{}", all[0].probability);
    }

    /// A pair leads the search, and one of the two alone is more probable at the powers of the search: missing laws are weighed beside the pair, beside that one, and beside no
    /// effect.
    #[test]
    fn laws_are_weighed_beside_the_set_that_is_believed() {
        let example = crate::gap::model::prepare::Example::read();
        let (problem, _) = example.problem(&[&example.campaign.recordings[0]]);
        let mut pair = ["friction_level", "vehicle_mass"].map(|id| crate::effects::find(id).unwrap()).to_vec();
        pair.sort_unstable();
        let of = |set: &[usize], exact_log_posterior: f64, log_posterior: f64| {
            let fitted = Hypothesis::fitted(&problem, set.to_vec(), &problem.nominal(), 1, None);
            Hypothesis { exact_log_posterior, log_posterior, ..fitted }
        };
        // The sets are so far ahead that no law is fitted, only promised.
        let sets = vec![of(&pair, 3e9, 1.0), of(&pair[..1], 2e9, 2.0), of(&[], 1e9, 0.0)];
        let found = posterior(&problem, &Search::made_up(sets), Strained::default());
        let beside = |set: &[usize]| found.explanations.iter().filter(|e| e.place.is_some() && e.effects == set).count();
        assert!([beside(&pair), beside(&pair[..1]), beside(&[])].iter().all(|laws| *laws > 0) && beside(&pair[1..]) == 0);
    }
}
