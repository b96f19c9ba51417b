//! A set of effects that strains its tolerances is not what is wrong. Before more work goes into it, missing laws and irregular disturbances are tried.

use super::density::Problem;
use super::fit::Fit;
use super::irregular::{Irregular, irregular};
use super::search::{Hypothesis, Search};
use super::unknown::{Unknown, places};
use crate::gap::model::filter::Disturbances;

/// Missing laws in every place beside a set, with the cost of the set at that time.
#[derive(Debug)]
struct Beside {
    effects: Vec<usize>,
    cost: f64,
    laws: Vec<Unknown>,
}

impl Beside {
    fn new(problem: &Problem, set: &Hypothesis, least: f64) -> Self {
        Self { effects: set.effects.clone(), cost: set.fit.cost, laws: places(problem, set, least) }
    }

    /// Whether the laws are those of this set, and its fit is still the same.
    fn is_beside(&self, set: &Hypothesis) -> bool {
        self.effects == set.effects && self.cost == set.fit.cost
    }
}

/// Missing laws that are known before more work goes into sets that strain their tolerances.
#[derive(Debug, Default)]
pub struct Strained {
    laws: Vec<Beside>,
}

impl Strained {
    /// Missing laws beside the leading set and beside none, if that set strains its tolerances.
    pub fn new(problem: &Problem, search: &Search) -> Self {
        let best = search.best();
        Self { laws: if best.fit.strains() { beside_sets(problem, search, best, Vec::new()) } else { Vec::new() } }
    }

    /// Missing laws beside this set and beside none. Laws beside sets whose fit has not changed since are not computed again.
    pub fn laws_beside(self, problem: &Problem, search: &Search, best: &Hypothesis) -> Vec<Unknown> {
        beside_sets(problem, search, best, self.laws).into_iter().flat_map(|b| b.laws).collect()
    }

    /// The leading one of the laws that were fitted.
    fn leader(&self) -> Option<(&Unknown, &Fit)> {
        let fitted = self.laws.iter().flat_map(|b| &b.laws).filter_map(|u| u.fit.as_ref().map(|fit| (u, fit)));
        fitted.max_by(|a, b| a.0.exact_log_posterior.total_cmp(&b.0.exact_log_posterior))
    }

    /// Whether a law is so far ahead of all sets that another look at these is not worthwhile.
    pub fn is_far_ahead(&self, search: &Search) -> bool {
        let best = search.best();
        let far = best.exact_log_posterior + search.behind(best.fit.log_evidence);
        self.leader().is_some_and(|(law, _)| law.exact_log_posterior > far)
    }

    /// The irregular disturbance, if the leading set strains its tolerances and the disturbance makes the recordings more likely than any law does: then the filter is wrong, and
    /// neither sets nor laws are worth more work before it is right.
    pub fn irregular(&self, problem: &Problem, search: &Search, with: &Disturbances) -> Option<Irregular> {
        let best = search.best();
        if !best.fit.strains() {
            return None;
        }
        let by_law = self.leader().filter(|(law, _)| law.log_posterior > best.log_posterior);
        let best = best.whole(problem);
        let gain_of_law = by_law.map_or(0.0, |(law, _)| law.log_posterior - best.log_posterior);
        let fit = by_law.map_or(&best.fit, |(_, fit)| fit);
        irregular(problem, &fit.point, &fit.residuals, with).filter(|left| left.gain > gain_of_law)
    }
}

/// Missing laws beside the set `best` and beside none; those already `known` are not computed again.
fn beside_sets(problem: &Problem, search: &Search, best: &Hypothesis, mut known: Vec<Beside>) -> Vec<Beside> {
    let mut sets = vec![(best, best.exact_log_posterior)];
    if !best.effects.is_empty() {
        sets.push((search.base(), best.exact_log_posterior - search.behind(best.fit.log_evidence)));
    }
    let beside = |(set, least)| match known.iter().position(|b| b.is_beside(set)) {
        Some(place) => known.swap_remove(place),
        None => Beside::new(problem, set, least),
    };
    sets.into_iter().map(beside).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Laws beside a set whose fit has not changed are not computed again; beside one that has been fitted better since, they are.
    #[test]
    fn laws_beside_a_set_that_did_not_change_are_kept() {
        let example = crate::gap::model::prepare::Example::read();
        let (problem, _) = example.problem(&[&example.campaign.recordings[0]]);
        let mut base = Hypothesis::fitted(&problem, Vec::new(), &problem.nominal(), 1, None);
        let told = |set: &Hypothesis| {
            let mut beside = Beside::new(&problem, set, f64::INFINITY);
            beside.laws.iter_mut().for_each(|l| l.exact_log_posterior = 1e6);
            beside
        };
        let known = told(&base);
        let leads = |known: Beside, set: &Hypothesis| {
            let [beside] = &beside_sets(&problem, &Search::made_up(vec![set.clone()]), set, vec![known])[..] else { panic!("of one set") };
            beside.laws.iter().map(|l| l.exact_log_posterior).fold(f64::NEG_INFINITY, f64::max)
        };
        assert_eq!(leads(known, &base), 1e6);
        let known = told(&base);
        base.fit.cost -= 1.0;
        assert!(leads(known, &base) < 1e6);
    }

    /// A set strains its tolerances, and an irregular disturbance makes the recordings more likely by some nats: the disturbance comes first unless a law gains more. If the set
    /// does not strain its tolerances, no disturbance is tried.
    #[test]
    fn what_is_irregular_comes_before_a_law_that_gains_less() {
        let example = crate::gap::model::prepare::Example::read();
        let (problem, with) = example.problem(&[&example.campaign.recordings[0]]);
        let mut set = Hypothesis::fitted(&problem, Vec::new(), &problem.nominal(), 1, None);
        let first = |laws: Vec<Beside>, set: &Hypothesis| {
            Strained { laws }.irregular(&problem, &Search::made_up(vec![set.clone()]), &with).map(|left| left.gain)
        };
        set.fit.point.shared.fill(0.5);
        assert_eq!(first(Vec::new(), &set), None);
        set.fit.point.shared.fill(2.0);
        set.fit.residuals = std::sync::Arc::new(problem.all_residuals(&set.fit.point, None));
        let gain = first(Vec::new(), &set).expect("such a car is far off");
        let law = |ahead: f64| {
            let mut beside = Beside::new(&problem, &set, f64::INFINITY);
            beside.laws.truncate(1);
            (beside.laws[0].fit, beside.laws[0].log_posterior) = (Some(set.fit.clone()), set.log_posterior + ahead);
            vec![beside]
        };
        assert_eq!(first(law(gain - 1.0), &set), Some(gain));
        assert_eq!(first(law(gain + 1.0), &set), None);
    }
}
