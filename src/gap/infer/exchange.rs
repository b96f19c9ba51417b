//! The exchange: every member of the best set is dropped in turn and replaced by effects that suit the rest better, or nearly as well.

use super::density::{Point, Problem};
use super::fit::LOOK;
use super::search::{BEHIND_NATS, Hypothesis, LEAST_PROMISE, STAY, Search, extend, finish, least_promise, taken_over};
use crate::effects::REGISTRY;
use rayon::prelude::*;

/// Exchanges members of the best set until no other effect suits the rest better, and then fits its [`rivals`].
pub fn exchange(problem: &Problem, found: &mut Search) {
    improve(problem, found);
    let looked: Vec<Hypothesis> = rivals(problem, found)
        .into_par_iter()
        .map(|(set, start)| Hypothesis::fitted(problem, set, &start, LOOK + 1, found.best().formed.known()))
        .collect();
    finish(problem, found, looked);
}

/// Sets, with start points, that may be as probable as the best one but were not fitted, or not as well as expected. In each of them, an effect that was nearly as good as a member
/// of the best set beside only a part of that set takes this member's place beside all the others. As long as such an effect was fitted beside a part only, it lacks what the rest
/// explains and seems far behind.
fn rivals(problem: &Problem, found: &Search) -> Vec<(Vec<usize>, Point)> {
    let best = found.best();
    let mut all: Vec<(Vec<usize>, Point)> = Vec::new();
    let is_part = |h: &&Hypothesis| h.effects.len() < best.effects.len() && h.effects.iter().all(|e| best.effects.contains(e));
    for part in found.hypotheses.iter().filter(is_part) {
        let as_good = |h: &&Hypothesis| h.effects.len() == part.effects.len() && h.log_posterior > part.log_posterior - BEHIND_NATS;
        for other in found.hypotheses.iter().filter(as_good) {
            let only = |of: &[usize], without: &[usize]| of.iter().copied().filter(|e| !without.contains(e)).collect::<Vec<_>>();
            let [added, gone] = [only(&other.effects, &best.effects), only(&part.effects, &other.effects)];
            let ([rival], [member]) = (&added[..], &gone[..]) else { continue };
            let mut set: Vec<usize> = best.effects.iter().map(|e| if e == member { *rival } else { *e }).collect();
            set.sort_unstable();
            let mut start = best.formed.point.without(*member);
            REGISTRY[*rival].parameters.clone().for_each(|k| start.effects[k] = other.formed.point.effects[k]);
            // A set that was fitted from another start may be far from its mode.
            let expected = best.log_posterior - (part.log_posterior - other.log_posterior).max(0.0);
            let is_short = |h: &Hypothesis| h.log_posterior < expected - 0.5 * LEAST_PROMISE;
            if found.of(&set).is_none_or(is_short) && all.iter().all(|(s, _)| *s != set) && problem.can_follow(&start) {
                all.push((set, start));
            }
        }
    }
    all
}

/// Drops each member of the best set in turn and fits the remaining set from there. Further effects are screened beside the remaining set if it fits better than before, or if the
/// best set strains its tolerances, which indicates that it is not the right one.
fn improve(problem: &Problem, found: &mut Search) {
    for _ in 0..EXCHANGES {
        let best = found.best().clone();
        if best.effects.is_empty() {
            return;
        }
        let strained = best.fit.strains();
        if best.effects.len() < 2 && !strained {
            return;
        }
        for &dropped in best.effects.iter().filter(|_| problem.work.may_go_on()) {
            let rest: Vec<usize> = best.effects.iter().copied().filter(|e| *e != dropped).collect();
            let start = best.formed.point.without(dropped);
            let before = found.of(&rest).map(|h| h.fit.cost);
            let looked = Hypothesis::fitted(problem, rest.clone(), &start, LOOK, best.formed.known());
            let better = before.is_some_and(|b| looked.fit.cost < b - least_promise(problem));
            let near = best.fit.log_evidence - looked.fit.log_evidence < found.behind(best.fit.log_evidence);
            let whole = better || near && before.is_none();
            let stays = || Hypothesis::fitted(problem, rest.clone(), &looked.formed.point, STAY, looked.formed.known());
            found.add(if whole { stays() } else { looked });
            if better || strained {
                extend(problem, found, &rest);
            }
        }
        // In place of each member, tries the effects that are equivalent to strongly pulled tolerances.
        if strained && problem.work.may_go_on() {
            let all = taken_over(problem, &best.formed.point, &best.effects);
            let swapped = all.into_iter().flat_map(|(effects, point)| {
                best.effects.clone().into_iter().map(move |dropped| {
                    let mut set: Vec<usize> = effects.iter().copied().filter(|e| *e != dropped).collect();
                    set.sort_unstable();
                    (set, point.without(dropped))
                })
            });
            let looked: Vec<Hypothesis> = swapped
                .collect::<Vec<_>>()
                .into_par_iter()
                .map(|(set, point)| Hypothesis::fitted(problem, set, &point, LOOK + 1, best.formed.known()))
                .collect();
            finish(problem, found, looked);
        }
        let now = &found.best().fit;
        if found.best().effects == best.effects || strained && !is_relieved(best.fit.pull(), now.pull()) {
            return;
        }
    }
}

/// Maximum number of rounds of exchange.
const EXCHANGES: usize = 4;
/// Share of its strain that a strained set may keep in a round that replaces it by another set. Strain that only moves from some tolerances to others does not lead to what is
/// wrong.
const STRAIN_LEFT: f64 = 0.75;

fn is_relieved(before: f64, now: f64) -> bool {
    now <= STRAIN_LEFT * before
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{null, param};
    use crate::gap::infer::fit::Fit;
    use crate::gap::model::prepare::Example;

    /// The best set is contact point and mass. Alone, friction is nearly as good as the contact point, and a lag far behind. Friction is therefore fitted beside the mass, in place
    /// of the contact point, from the size that it had alone. Once it is as good there as expected, it is not fitted again.
    #[test]
    fn what_was_nearly_as_good_alone_is_tried_beside_the_rest_of_the_best_set() {
        let example = Example::read();
        let (problem, _) = example.problem(&[&example.campaign.recordings[0]]);
        let of = |ids: &[&str], log_posterior: f64| {
            let mut set: Vec<usize> = ids.iter().map(|id| crate::effects::find(id).unwrap()).collect();
            set.sort_unstable();
            let mut fit = Fit::made_up(Vec::new());
            fit.point = Point { effects: null(), ..problem.nominal() };
            for (id, parameter, value) in [
                ("kiss_point_offset", param::kiss_point_offset::offset, 0.3),
                ("friction_level", param::friction_level::factor, 1.2),
                ("vehicle_mass", param::vehicle_mass::factor, 1.1),
            ] {
                if ids.contains(&id) {
                    fit.point.effects[parameter] = value;
                }
            }
            Hypothesis { log_posterior, ..Hypothesis::made_up(&set, fit) }
        };
        let mut all = vec![
            of(&["kiss_point_offset", "vehicle_mass"], 0.0),
            of(&["kiss_point_offset"], -30.0),
            of(&["friction_level"], -45.0),
            of(&["actuator_lag"], -60.0),
            of(&[], -90.0),
        ];
        let found = rivals(&problem, &Search::made_up(all.clone()));
        let [(set, start)] = &found[..] else { panic!("{} rivals", found.len()) };
        let rival = of(&["friction_level", "vehicle_mass"], -14.0);
        assert_eq!((set, &start.effects), (&rival.effects, &rival.formed.point.effects));
        for (log_posterior, again) in [(-19.0, false), (-21.0, true)] {
            all.truncate(5);
            all.push(Hypothesis { log_posterior, ..rival.clone() });
            assert_eq!(!rivals(&problem, &Search::made_up(all.clone())).is_empty(), again, "{log_posterior}");
        }
    }

    #[test]
    fn strain_that_only_changes_places_ends_the_exchange() {
        assert_eq!([5.0, 5.9, 6.1, 9.0].map(|now| is_relieved(8.0, now)), [true, true, false, false]);
    }
}
