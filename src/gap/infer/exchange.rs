//! The exchange: every member of the best set is dropped in turn, and exchanged for what suits the rest better.

use super::density::Problem;
use super::fit::LOOK;
use super::search::{Hypothesis, STAY, Search, extend, finish, least_promise, taken_over};
use rayon::prelude::*;

/// Drops every member of the best set in turn; what is left is fitted from there and looks for a better companion, if it fits better than it did or if the
/// best set strains its tolerances, which says that it is not the right one.
pub fn exchange(problem: &Problem, found: &mut Search) {
    for _ in 0..EXCHANGES {
        let best = found.best().clone();
        if best.effects.is_empty() {
            return;
        }
        let strained = best.fit.strains();
        if best.effects.len() < 2 && !strained {
            return;
        }
        for &dropped in &best.effects {
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
        // The twins of tolerances that are pulled, in the place of each member.
        if strained {
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

/// Rounds of exchange.
const EXCHANGES: usize = 4;
/// Share of its strain that a strained set may keep in a round for another one: what only changes places is not on its way to what is wrong.
const STRAIN_LEFT: f64 = 0.75;

fn is_relieved(before: f64, now: f64) -> bool {
    now <= STRAIN_LEFT * before
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strain_that_only_changes_places_ends_the_exchange() {
        assert_eq!([5.0, 5.9, 6.1, 9.0].map(|now| is_relieved(8.0, now)), [true, true, false, false]);
    }
}
