//! The search: which sets of effects are worth a fit, up to three at a time.
//!
//! From the car within its tolerances, and then from the best sets so far, every effect is screened; what promises most is fitted. Sets compete by their
//! posterior: evidence, which pays for what an effect could have done as well, and the odds of that many effects. The search goes on as long as a
//! larger set is more probable than the one that it extends. Last, every member of the best set is dropped in turn, and exchanged for what suits the rest
//! better.

use super::coordinate::Coordinate;
use super::density::{Point, Problem, STRAINS, cost, size};
use super::fit::{Fit, Free, LOOK, fit};
use super::linear::Columns;
use super::pulsation;
use super::screen::{Anchor, Promise, Screening, screen};
use crate::effects::{Act, PARAMETERS, Parameters, REGISTRY};
use rayon::prelude::*;
use std::sync::Arc;

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
        let log_posterior = fit.log_evidence + log_prior(effects.len()) + moments(&fit, &effects);
        Self { effects, fit, log_posterior }
    }
}

/// Prior probability of each effect of the library: about one car in four that somebody has reason to diagnose holds one.
pub const EFFECT_PRIOR: f64 = 0.01;

/// Logarithm of the prior odds of that many effects over none.
pub fn log_prior(effects: usize) -> f64 {
    effects as f64 * (EFFECT_PRIOR / (1.0 - EFFECT_PRIOR)).ln()
}

/// Nats by which the evidence of these effects changes because an effect that is there is not small.
///
/// A normal prior around null gives most weight to what nobody would call an effect. The moment prior (Johnson and Rossell 2010, "On the use of non-local
/// prior densities in Bayesian hypothesis tests") multiplies it by the square of the size in units of its standard deviation, so that the evidence is
/// multiplied by that square's mean over the normal prior's posterior; and [`moment`] takes away what is negligible.
pub fn moments(fit: &Fit, effects: &[usize]) -> f64 {
    let Some(covariance) = fit.covariance() else { return f64::NEG_INFINITY };
    let square = |k: usize| {
        let place = fit.shared.iter().position(|c| *c == Coordinate::Effect(k));
        let variance = place.map_or(0.0, |i| covariance[(i, i)]);
        ((fit.point.effects[k] - PARAMETERS[k].null).powi(2) + variance) / size(k).powi(2)
    };
    let one = |e: &usize| {
        // A parameter that only goes with another one is not what makes the effect.
        let leads = |k: &&usize| STRAINS.iter().all(|s| s.follower != **k);
        let squares: Vec<f64> = REGISTRY[*e].effect.amplitudes.iter().filter(leads).map(|k| square(*k)).collect();
        moment(squares.iter().sum::<f64>() / squares.len() as f64)
    };
    effects.iter().map(one).sum()
}

/// Square of the size, in units of a noticeable effect, below which a departure is the form of something else rather than an effect: a tenth of the size.
const NEGLIGIBLE: f64 = 0.01;

/// Logarithm of the factor that the prior of an effect has over a normal one, from the mean square of its size in units of a noticeable effect. It vanishes faster
/// than any power at null (the inverse moment prior of Johnson and Rossell): an effect of a tenth of the size pays one nat for that, one of a fiftieth 25.
pub fn moment(square: f64) -> f64 {
    square.ln() - NEGLIGIBLE / square
}

/// What was found.
#[derive(Clone, Debug)]
pub struct Search {
    /// All sets that were fitted, the most probable first.
    pub hypotheses: Vec<Hypothesis>,
    /// Cost that the linear model promises for each effect alone.
    pub promised: Vec<Option<f64>>,
    /// Torque ripples that a scan found.
    ripples: Vec<(usize, Parameters)>,
    /// Sets beside which all effects were screened, each with its cost then.
    screened: Vec<(Vec<usize>, f64)>,
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
    /// Nats behind a log evidence within which an explanation is worth more work.
    pub fn behind(&self, best: f64) -> f64 {
        BEHIND_NATS + BEHIND_SHARE * (best - self.base().fit.log_evidence).max(0.0)
    }
    fn add(&mut self, h: Hypothesis) {
        match self.hypotheses.iter_mut().find(|o| o.effects == h.effects) {
            Some(o) if o.log_posterior < h.log_posterior => *o = h,
            Some(_) => {}
            None => self.hypotheses.push(h),
        }
        self.hypotheses.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
        self.let_go();
    }
    /// Lets go of the derivatives of the least probable sets when all of them together take too much memory.
    fn let_go(&mut self) {
        let mut held = 0;
        for h in &mut self.hypotheses {
            held += h.fit.columns.iter().map(|c| 8 * c.matrix.len()).sum::<usize>();
            if held > MOST_BYTES && !h.effects.is_empty() {
                h.fit.columns = Arc::default();
            }
        }
    }
}

/// Memory that derivatives of fits may take, bytes, beside those of the car within its tolerances.
const MOST_BYTES: usize = 200_000_000;

/// Most effects at a time.
pub const MOST_EFFECTS: usize = 3;
/// Iterations of a fit that stays.
const STAY: usize = 12;
/// Candidates that are looked at per anchor, and those of them that are fitted to the end.
const LOOKED_AT: usize = 4;
const FITTED: usize = 2;
/// Sets that are extended.
const BEAM: [usize; MOST_EFFECTS - 1] = [2, 1];
/// Nats behind the best after a look up to which a fit is finished, beside this share of what the best explains.
const BEHIND_NATS: f64 = 20.0;
const BEHIND_SHARE: f64 = 0.3;
/// Gain in the cost that an effect has to promise to be looked at: its price is more.
const LEAST_PROMISE: f64 = 10.0;
/// Mean square of the nuisances above which a fit was dragged along by a gap, and the nominal car is a second anchor.
pub const DRAGGED: f64 = 3.0;

/// Searches, without [`exchange`]. `progress` is told how far it is.
pub fn search(problem: &Problem, progress: &(dyn Fn(&str, f64) + Sync)) -> Search {
    progress("tolerances", 0.0);
    let nominal = problem.nominal();
    let base = fit(problem, Free::default(), &nominal, STAY, None);
    let mut found = Search { hypotheses: Vec::new(), promised: vec![None; REGISTRY.len()], ripples: Vec::new(), screened: Vec::new() };
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
    found
}

/// Screens beside a set that was fitted, and fits what promises most; not again from where that was done.
fn extend(problem: &Problem, found: &mut Search, set: &[usize]) {
    let Some(from) = found.of(set).cloned() else { return };
    if found.screened.iter().any(|(done, cost)| done == set && from.fit.cost > cost - LEAST_PROMISE) {
        return;
    }
    found.screened.push((set.to_vec(), from.fit.cost));
    let mut places: Vec<(Point, Option<&Fit>)> = vec![(from.fit.point.clone(), Some(&from.fit))];
    if from.fit.pull() > DRAGGED {
        places.push((Point { effects: from.fit.point.effects, ..problem.nominal() }, None));
    }
    // A ripple's order is looked for once, from the car within its tolerances: it does not depend on what else is wrong.
    if set.is_empty() {
        found.ripples = pulsation::starts(problem, &from.fit.point).into_iter().map(|(e, p)| (e, p.effects)).collect();
    }
    let ripple = |(e, p): &(usize, Parameters)| {
        let mut point = from.fit.point.clone();
        REGISTRY[*e].parameters.clone().for_each(|k| point.effects[k] = p[k]);
        (*e, point)
    };
    let further: Vec<(usize, Point)> = found.ripples.iter().map(ripple).collect();
    let mut starts: Vec<(Vec<usize>, Point, f64, usize)> = Vec::new();
    let mut columns: Vec<Arc<Vec<Columns>>> = Vec::new();
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
        let begun = worthwhile.chain(together).map(|p| started(&anchor, &screening, set, p, columns.len()));
        starts.extend(begun.filter(|s| problem.can_follow(&s.1)));
        columns.push(anchor.columns);
    }
    starts.extend(taken_over(problem, &from.fit.point, set).into_iter().map(|(effects, point)| {
        let there = cost_at(problem, &point);
        (effects, point, there, 0)
    }));
    // A ripple starts as its scan found it: what a linear model makes of a phase that is nearly right says little.
    if set.is_empty() {
        starts.extend(further.into_iter().map(|(e, point)| (vec![e], point, f64::NEG_INFINITY, 0)));
    }
    // Of two starts of one set the more promising.
    starts.iter_mut().for_each(|s| s.0.sort_unstable());
    starts.sort_by(|a, b| a.0.cmp(&b.0).then(a.2.total_cmp(&b.2)));
    // Ripples of different orders are different starts.
    let orders = |p: &Point, set: &[usize]| {
        let ripples = set.iter().filter(|&&e| matches!(REGISTRY[e].effect.act, Act::Pulsation(_)));
        ripples.map(|&e| p.effects[REGISTRY[e].parameters.start + 2]).sum::<f64>()
    };
    starts.dedup_by(|later, kept| later.0 == kept.0 && orders(&later.1, &later.0) == orders(&kept.1, &kept.0));
    let mut looked: Vec<(Vec<usize>, Fit, f64)> = starts
        .into_par_iter()
        .map(|(effects, start, promise, anchor)| {
            let known = columns.get(anchor).map(|c| c.as_slice());
            let fitted = fit(problem, Free { effects: &effects, basis: None }, &start, LOOK, known);
            (effects, fitted, promise)
        })
        .collect();
    // More effects can only explain more. A look that does not bear that out was led astray by derivatives of elsewhere: the most promising get their own.
    looked.sort_by(|a, b| a.2.total_cmp(&b.2));
    let astray: Vec<&mut (Vec<usize>, Fit, f64)> =
        looked.iter_mut().filter(|l| l.2.is_finite() && l.1.cost > from.fit.cost).take(FITTED).collect();
    astray.into_par_iter().for_each(|(effects, fitted, _)| {
        *fitted = fit(problem, Free { effects, basis: None }, &fitted.point, LOOK + 1, None);
    });
    let looked = looked.into_iter().map(|(effects, fitted, _)| (effects, fitted)).collect();
    finish(problem, found, looked);
}

fn started(anchor: &Anchor, screening: &Screening, set: &[usize], promise: &Promise, k: usize) -> (Vec<usize>, Point, f64, usize) {
    let effects = set.iter().copied().chain(promise.members.iter().map(|&m| screening.candidates[m].effect)).collect();
    let start = screening.start(anchor, promise);
    (effects, start, promise.cost, k)
}

/// The same car with an effect in the place of each tolerance that does the same and was pulled; the sets with it beside `set`.
pub fn taken_over(problem: &Problem, from: &Point, set: &[usize]) -> Vec<(Vec<usize>, Point)> {
    const PULLED: f64 = 2.5;
    let pulled = (0..problem.shared.len()).filter(|&k| from.shared[k].abs() > PULLED);
    pulled
        .filter_map(|k| {
            let mut point = from.clone();
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
            Some((set.iter().copied().chain([effect]).collect(), point))
        })
        .collect()
}

/// Fits to the end what came near the best after a look.
fn finish(problem: &Problem, found: &mut Search, mut looked: Vec<(Vec<usize>, Fit)>) {
    looked.sort_by(|a, b| b.1.log_evidence.total_cmp(&a.1.log_evidence));
    let Some(best) = looked.first().map(|l| l.1.log_evidence) else { return };
    let most = found.behind(best);
    let (near, far): (Vec<_>, Vec<_>) = looked.into_iter().enumerate().partition(|(k, l)| *k < FITTED && best - l.1.log_evidence < most);
    for (_, (effects, rough)) in far {
        found.add(Hypothesis::new(effects, rough));
    }
    let done: Vec<(Vec<usize>, Fit)> = near
        .into_par_iter()
        .map(|(_, (effects, rough))| {
            let fitted = fit(problem, Free { effects: &effects, basis: None }, &rough.point, STAY, rough.known());
            (effects, fitted)
        })
        .collect();
    for (effects, fitted) in done {
        found.add(Hypothesis::new(effects, fitted));
    }
}

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
            let mut start = best.fit.point.clone();
            for p in REGISTRY[dropped].parameters.clone() {
                start.effects[p] = PARAMETERS[p].null;
            }
            let before = found.of(&rest).map(|h| h.fit.cost);
            let free = || Free { effects: &rest, basis: None };
            let looked = fit(problem, free(), &start, LOOK, best.fit.known());
            let better = before.is_some_and(|b| looked.cost < b - LEAST_PROMISE);
            let near = best.fit.log_evidence - looked.log_evidence < found.behind(best.fit.log_evidence);
            let whole = better || near && before.is_none();
            let fitted = if whole { fit(problem, free(), &looked.point, STAY, looked.known()) } else { looked };
            found.add(Hypothesis::new(rest.clone(), fitted));
            if better || strained {
                extend(problem, found, &rest);
            }
        }
        // The twins of tolerances that are pulled, in the place of each member.
        if strained {
            let all = taken_over(problem, &best.fit.point, &best.effects);
            let swapped = all.into_iter().flat_map(|(effects, point)| {
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
                    let fitted = fit(problem, Free { effects: &set, basis: None }, &point, LOOK + 1, best.fit.known());
                    (set, fitted)
                })
                .collect();
            finish(problem, found, looked);
        }
        let now = &found.best().fit;
        if found.best().effects == best.effects || strained && now.pull() > STRAIN_LEFT * best.fit.pull() {
            return;
        }
    }
}

/// Rounds of exchange.
const EXCHANGES: usize = 4;
/// Share of its strain that a strained set may keep in a round for another one: what only changes places is not on its way to what is wrong.
const STRAIN_LEFT: f64 = 0.75;
/// Cost of a point, for checks.
pub fn cost_at(problem: &Problem, point: &Point) -> f64 {
    cost(point, &problem.all_residuals(point, None))
}
