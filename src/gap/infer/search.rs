//! The search: which sets of effects are worth a fit, up to three at a time.
//!
//! From the car within its tolerances, and then from the best sets so far, every effect is screened, and the most promising ones are fitted. Sets compete by their posterior: the
//! evidence, in which an effect pays for everything else that it could have done, and the prior odds of the number of effects. The search goes on as long as a larger set is more
//! probable than the one that it extends. If it is repeated with a better filter, sets that the first search found near its best are fitted as well.

use super::belief::{ByAccuracy, STEERING};
use super::density::{Basis, Point, Problem, WHOLE, cost};
use super::fit::{Fit, Free, LOOK, fit, least_gain, mean_covariance};
use super::form::{self, forms};
use super::linear::{Columns, Known};
use super::prior::{log_prior, moments};
use super::pulsation;
use super::screen::{Anchor, Promise, screen};
use crate::effects::{Act, PARAMETERS, REGISTRY};
use rayon::prelude::*;
use std::collections::HashSet;
use std::sync::Arc;

/// A fitted set of effects.
#[derive(Clone, Debug)]
pub struct Hypothesis {
    /// Effects, by their place in the registry, ascending.
    pub effects: Vec<usize>,
    /// Fit, with the effects' forms eliminated.
    pub fit: Fit,
    /// Fit with the functions of the effects' forms.
    pub formed: Fit,
    /// Functions of the effects' forms.
    pub basis: Basis,
    /// Logarithm of the posterior probability under the full likelihood, nats, up to a constant that depends on the recordings alone. It decides where the search goes.
    pub exact_log_posterior: f64,
    /// The same with the likelihood raised to the powers that steer the search: what is believed.
    pub log_posterior: f64,
    /// Logarithm of the posterior probability for each accuracy that the explanation may have.
    pub by_accuracy: ByAccuracy<f64>,
    /// [`Fit::strain`] for each accuracy.
    pub strains: ByAccuracy<f64>,
}

impl Hypothesis {
    fn new(problem: &Problem, mut effects: Vec<usize>, formed: Fit, basis: Basis) -> Self {
        effects.sort_unstable();
        let at = |powers| {
            let (evidence, fit) = formed.weighed(problem, &basis, 0, powers);
            (evidence + log_prior(effects.len()) + moments(&fit, &effects), fit)
        };
        let (exact_log_posterior, sharp) = at(WHOLE);
        let all = problem.powers.map(at);
        let by_accuracy = all.each_ref().map(|(believed, _)| *believed);
        let strains = all.each_ref().map(|(_, fit)| fit.strain);
        let (log_posterior, coarse) = all[STEERING].clone();
        let mean_covariance = mean_covariance(all.map(|(_, fit)| fit));
        let exact = sharp.marginal().curvature;
        let fit = Fit { point: sharp.point, mean_covariance, exact, ..coarse }.marginal();
        Self { effects, fit, formed, basis, exact_log_posterior, log_posterior, by_accuracy, strains }
    }

    /// The same hypothesis with its derivatives and functions, fitted anew if they were released.
    pub fn whole(&self, problem: &Problem) -> Self {
        if self.formed.columns.is_empty() {
            Self::fitted(problem, self.effects.clone(), &self.formed.point, LOOK, None)
        } else {
            self.clone()
        }
    }

    fn let_go(&mut self) {
        self.basis = Basis::new();
        [&mut self.fit, &mut self.formed].into_iter().for_each(Fit::let_go);
    }

    /// Fits a set with the forms of its effects. `known` are derivatives at a nearby point.
    pub fn fitted(problem: &Problem, effects: Vec<usize>, start: &Point, iterations: usize, known: Option<Known>) -> Self {
        let basis = forms(problem, start, &effects);
        let start = Point { missing: Vec::new(), ..start.clone() };
        let formed = fit(problem, Free { effects: &effects, basis: Some(&basis) }, &start, iterations, known);
        // A form is a share of what its effect changes where the fit ends, not where it began.
        let there = forms(problem, &formed.point, &effects);
        if form::are_as_large(&there, &basis) {
            return Self::new(problem, effects, formed, basis);
        }
        let start = Point { missing: Vec::new(), ..formed.point.clone() };
        let formed = fit(problem, Free { effects: &effects, basis: Some(&there) }, &start, LOOK, formed.known());
        Self::new(problem, effects, formed, there)
    }
}

/// Result of a search.
#[derive(Clone, Debug)]
pub struct Search {
    /// All sets that were fitted, the most probable first.
    pub hypotheses: Vec<Hypothesis>,
    /// Gain in log evidence, nats, that the linear model predicts for each effect alone, without its prior odds; none for an effect without a candidate, such as a ripple that no
    /// scan found.
    pub promised: Vec<Option<f64>>,
    /// Sets beside which all effects were screened, each with its cost at that time.
    screened: Vec<(Vec<usize>, f64)>,
}

impl Search {
    /// The car within its tolerances: the set without effects.
    pub fn base(&self) -> &Hypothesis {
        self.of(&[]).expect("the search begins with it")
    }
    /// The hypothesis of a set, if it was fitted.
    pub fn of(&self, effects: &[usize]) -> Option<&Hypothesis> {
        self.hypotheses.iter().find(|h| h.effects == effects)
    }
    /// The set that leads.
    pub fn best(&self) -> &Hypothesis {
        &self.hypotheses[0]
    }
    /// Distance in nats behind the log evidence `best` within which an explanation is worth more work.
    pub fn behind(&self, best: f64) -> f64 {
        BEHIND_NATS + BEHIND_SHARE * (best - self.base().fit.log_evidence).max(0.0)
    }
    /// Whether the same set was already fitted as well or better from another start, so that this one is not worth another fit. Ripples of different orders are different starts.
    fn has_better(&self, h: &Hypothesis) -> bool {
        !pulsates(&h.effects) && self.of(&h.effects).is_some_and(|o| o.fit.log_evidence >= h.fit.log_evidence)
    }
    pub(super) fn add(&mut self, h: Hypothesis) {
        match self.hypotheses.iter_mut().find(|o| o.effects == h.effects) {
            Some(o) if o.exact_log_posterior < h.exact_log_posterior => *o = h,
            Some(_) => {}
            None => self.hypotheses.push(h),
        }
        self.hypotheses.sort_by(|a, b| b.exact_log_posterior.total_cmp(&a.exact_log_posterior));
        self.let_go();
    }
    fn let_go(&mut self) {
        let_go(&mut self.hypotheses, MOST_BYTES);
    }
    /// Releases all derivatives and functions; fits that need them compute them again.
    pub fn let_go_of_all(&mut self) {
        self.hypotheses.iter_mut().for_each(Hypothesis::let_go);
    }
}

/// Releases the derivatives and functions of the last sets, beyond the first ones that together take no more than `most` bytes.
fn let_go<'a>(all: impl IntoIterator<Item = &'a mut Hypothesis>, most: usize) {
    let (mut held, mut seen) = (0, HashSet::new());
    for h in all {
        held += h.formed.columns.iter().flatten().map(|c| c.bytes(&mut seen)).sum::<usize>();
        held += h.basis.iter().flat_map(|f| f.iter()).map(|f| f.innovations.bytes(&mut seen)).sum::<usize>();
        if held > most {
            h.let_go();
        }
    }
}

/// Memory that derivatives and functions of fits may take, bytes.
pub(super) const MOST_BYTES: usize = 120_000_000;

/// Minimum number of looks after which memory is released.
const LOOKS_AT_ONCE: usize = 4;

/// Maximum number of effects in a set.
pub const MOST_EFFECTS: usize = 3;
/// Maximum number of iterations of a full fit.
pub(super) const STAY: usize = 12;
/// Number of candidates that get a look from the fitted car, number of those that get one from the nominal car if a gap dragged the fit along, and number of looks that are fitted
/// to the end.
const LOOKED_AT: usize = 4;
const LOOKED_AT_AGAIN: usize = 2;
const FITTED: usize = 5;
/// Number of sets of one and of two effects that are extended.
const BEAM: [usize; MOST_EFFECTS - 1] = [2, 1];
/// Distance in nats behind the best look within which a fit is finished, to which this share of what the best look explains is added.
pub(super) const BEHIND_NATS: f64 = 20.0;
const BEHIND_SHARE: f64 = 0.3;
/// Gain that an effect must promise to get a look, in the cost scaled by [`Problem::power`]: its price is higher.
pub(super) const LEAST_PROMISE: f64 = 10.0;
/// Mean square of the nuisances above which a fit was dragged along by a gap, so that the nominal car serves as a second anchor.
pub const DRAGGED: f64 = 3.0;

#[cfg(test)]
impl Hypothesis {
    /// A set with this fit that was not weighed.
    pub fn made_up(effects: &[usize], fit: Fit) -> Self {
        let (formed, none) = (fit.clone(), Default::default());
        let (exact_log_posterior, log_posterior) = (0.0, 0.0);
        Self {
            effects: effects.to_vec(),
            fit,
            formed,
            basis: Basis::new(),
            exact_log_posterior,
            log_posterior,
            by_accuracy: none,
            strains: none,
        }
    }
}

#[cfg(test)]
impl Search {
    /// A search that found these sets, the car within its tolerances among them.
    pub fn made_up(hypotheses: Vec<Hypothesis>) -> Self {
        Self { hypotheses, promised: Vec::new(), screened: Vec::new() }
    }
}

/// Searches, without an [`exchange`](super::exchange::exchange). `earlier` is the result of a search under another filter, and `progress` is called with the stage and how far the
/// search is. Once so much work is done that [no more may begin](crate::gap::progress::Work::may_go_on), no set is extended.
pub fn search(problem: &Problem, earlier: Option<&Search>, progress: &(dyn Fn(&str, f64) + Sync)) -> Search {
    progress("tolerances", 0.0);
    let nominal = problem.nominal();
    let base = Hypothesis::fitted(problem, Vec::new(), &nominal, STAY, None);
    let mut found = Search { hypotheses: Vec::new(), promised: vec![None; REGISTRY.len()], screened: Vec::new() };
    found.add(base);
    let mut frontier: Vec<Vec<usize>> = vec![Vec::new()];
    for size in 1..=MOST_EFFECTS {
        let best = found.best().exact_log_posterior;
        for set in frontier.iter().filter(|_| problem.work.may_go_on()) {
            progress(["effects", "pairs", "triples"][size - 1], 0.2 * size as f64);
            extend(problem, &mut found, set);
        }
        let mut of_size: Vec<&Hypothesis> = found.hypotheses.iter().filter(|h| h.effects.len() == size).collect();
        if size == MOST_EFFECTS || of_size.first().is_none_or(|h| h.exact_log_posterior < best) {
            break;
        }
        of_size.truncate(BEAM[size - 1]);
        let most = BEHIND_NATS + BEHIND_SHARE * (of_size[0].exact_log_posterior - best);
        of_size.retain(|h| found.best().exact_log_posterior - h.exact_log_posterior < most);
        frontier = of_size.into_iter().map(|h| h.effects.clone()).collect();
    }
    if let Some(earlier) = earlier {
        // Nothing was screened here if no work was left.
        if found.promised.iter().all(Option::is_none) {
            found.promised.clone_from(&earlier.promised);
        }
        take_up(problem, &mut found, earlier);
    }
    found
}

/// Fits sets that an earlier search, under another filter, found near its best and that this one did not fit, from the points that the earlier search found. If one of them leads
/// now, it is extended as well.
fn take_up(problem: &Problem, found: &mut Search, earlier: &Search) {
    let least = earlier.best().exact_log_posterior - earlier.behind(earlier.best().fit.log_evidence);
    let near = earlier.hypotheses.iter().take(FITTED).filter(|h| h.exact_log_posterior > least && found.of(&h.effects).is_none());
    let near: Vec<&Hypothesis> = near.filter(|h| problem.can_follow(&h.formed.point)).collect();
    let again = |h: &&Hypothesis| Hypothesis::fitted(problem, h.effects.clone(), &h.formed.point, STAY, None);
    let fitted: Vec<Hypothesis> = near.par_iter().map(again).collect();
    fitted.into_iter().for_each(|h| found.add(h));
    let best = found.best().effects.clone();
    if best.len() < MOST_EFFECTS && near.iter().any(|h| h.effects == best) && problem.work.may_go_on() {
        extend(problem, found, &best);
    }
}

/// Screens all effects beside a set that was fitted, and fits the most promising ones. Nothing is done if the set was screened before and its fit has hardly improved since.
pub(super) fn extend(problem: &Problem, found: &mut Search, set: &[usize]) {
    let Some(from) = found.of(set).map(|h| h.whole(problem)) else { return };
    if found.screened.iter().any(|(done, cost)| done == set && from.fit.cost > cost - least_promise(problem)) {
        return;
    }
    found.screened.push((set.to_vec(), from.fit.cost));
    let (starts, columns) = starts(problem, found, &from);
    let mut looked: Vec<(Hypothesis, f64)> = Vec::new();
    for some in starts.chunks(LOOKS_AT_ONCE.max(rayon::current_num_threads())) {
        looked.par_extend(some.par_iter().map(|start| (start.look(problem, &columns), start.promise)));
        looked.sort_by(|a, b| b.0.fit.log_evidence.total_cmp(&a.0.fit.log_evidence));
        let_go(looked.iter_mut().map(|l| &mut l.0), MOST_BYTES);
    }
    // A larger set can only explain more, except for a ripple out of phase. A look that ends with a worse fit was led astray by derivatives at another point: the most promising of
    // these sets are fitted with derivatives of their own.
    looked.sort_by(|a, b| a.1.total_cmp(&b.1));
    let most = from.fit.cost + least_gain(problem);
    let is_astray = |h: &Hypothesis| h.fit.cost > most && !pulsates(&h.effects) && !found.has_better(h);
    let astray: Vec<&mut (Hypothesis, f64)> = looked.iter_mut().filter(|l| l.1.is_finite() && is_astray(&l.0)).take(FITTED).collect();
    astray.into_par_iter().for_each(|(h, _)| {
        *h = Hypothesis::fitted(problem, h.effects.clone(), &h.formed.point, LOOK + 1, None);
    });
    finish(problem, found, looked.into_iter().map(|(h, _)| h).collect());
}

/// Start of a look.
struct Start {
    /// Effects, ascending.
    effects: Vec<usize>,
    point: Point,
    /// Predicted cost; −∞ where it is not known.
    promise: f64,
    /// Index of the anchor whose derivatives the look uses.
    anchor: usize,
}

impl Start {
    fn new(set: &[usize], beside: impl IntoIterator<Item = usize>, point: Point, promise: f64, anchor: usize) -> Self {
        let mut effects: Vec<usize> = set.iter().copied().chain(beside).collect();
        effects.sort_unstable();
        Self { effects, point, promise, anchor }
    }

    /// Sum of the orders of its ripples, because ripples of different orders are different starts.
    fn orders(&self) -> f64 {
        let order = |e: &usize| self.point.effects[REGISTRY[*e].parameters.start + 2];
        self.effects.iter().filter(|e| pulsates(&[**e])).map(order).sum()
    }

    fn look(&self, problem: &Problem, columns: &[Arc<Vec<Columns>>]) -> Hypothesis {
        let known = columns.get(self.anchor).map(|c| Known::Nuisances(c));
        // The mode is further from the nominal car.
        let iterations = if self.anchor == 0 { LOOK } else { 2 * LOOK };
        Hypothesis::fitted(problem, self.effects.clone(), &self.point, iterations, known)
    }
}

/// Starts that are worth a look beside a set that was fitted, and the derivatives of each anchor.
fn starts(problem: &Problem, found: &mut Search, from: &Hypothesis) -> (Vec<Start>, Vec<Arc<Vec<Columns>>>) {
    let (set, formed) = (from.effects.as_slice(), &from.formed);
    let mut places: Vec<(Point, Option<&Fit>)> = vec![(formed.point.clone(), Some(formed))];
    if from.fit.pull() > DRAGGED {
        let (effects, missing) = (formed.point.effects, formed.point.missing.clone());
        places.push((Point { effects, missing, ..problem.nominal() }, None));
    }
    // Everything that changes the slip angle also changes the order at which a ripple fits, so that the scan is repeated beside each set.
    let ripples = if pulsates(set) { Vec::new() } else { pulsation::starts(problem, &from.fit.point, least_promise(problem)) };
    let ripple = |(e, p): (usize, Point)| {
        let mut point = formed.point.clone();
        REGISTRY[e].parameters.clone().for_each(|k| point.effects[k] = p.effects[k]);
        (e, point)
    };
    let further: Vec<(usize, Point)> = ripples.into_iter().map(ripple).collect();
    let mut starts: Vec<Start> = Vec::new();
    let mut columns: Vec<Arc<Vec<Columns>>> = Vec::new();
    for (point, known) in &places {
        let Some(anchor) = Anchor::new(problem, point, set, Some(&from.basis), *known) else { continue };
        let screening = screen(problem, &anchor, if columns.is_empty() { &further } else { &[] });
        // From the nominal car, the linear model predicts a higher cost for every candidate, but also without any; the threshold takes that into account.
        let least = screening.settled().max(from.fit.cost) - least_promise(problem);
        let singles = screening.singles();
        if set.is_empty() && columns.is_empty() {
            for (e, nats) in screening.evidence() {
                found.promised[e] = Some(found.promised[e].map_or(nats, |best: f64| best.max(nats)));
            }
        }
        // The relief of a tolerance counts in full, however low the power of the likelihood is. If a gap dragged all tolerances along, this does not count, because every effect
        // that follows the gap relieves them.
        let gain = |p: &Promise| if from.fit.pull() > DRAGGED { 0.0 } else { screening.gain(p) };
        let pairs = if set.len() + 2 <= MOST_EFFECTS { screening.pairs() } else { Vec::new() };
        let most = if columns.is_empty() { LOOKED_AT } else { LOOKED_AT_AGAIN };
        let worthwhile = singles.iter().filter(|p| p.cost < least || gain(p) > LEAST_PROMISE).take(most);
        let together = pairs.iter().filter(|p| singles.first().is_some_and(|s| p.cost < s.cost - 2.0 * least_promise(problem))).take(2);
        let started = |p: &Promise| {
            let members = p.members.iter().map(|&m| screening.candidates[m].effect);
            Start::new(set, members, screening.start(&anchor, p), p.cost, columns.len())
        };
        starts.extend(worthwhile.chain(together).map(started).filter(|s| problem.can_follow(&s.point)));
        columns.push(anchor.columns);
    }
    starts.extend(taken_over(problem, &formed.point, set).into_iter().map(|(effects, point)| {
        let there = cost(&point, &problem.all_residuals(&point, Some(&from.basis)));
        Start::new(&effects, None, point, there, 0)
    }));
    // A ripple also starts as the scan found it, because a linear model says little about a phase that is only nearly right.
    starts.extend(further.into_iter().map(|(e, point)| Start::new(set, [e], point, f64::NEG_INFINITY, 0)));
    // Of several starts of one set from one anchor, the most promising is kept, except that ripples of different orders are kept apart.
    let by_set = |a: &Start, b: &Start| a.effects.cmp(&b.effects).then(a.anchor.cmp(&b.anchor)).then(a.orders().total_cmp(&b.orders()));
    starts.sort_by(|a, b| by_set(a, b).then(a.promise.total_cmp(&b.promise)));
    starts.dedup_by(|later, kept| later.effects == kept.effects && later.anchor == kept.anchor && later.orders() == kept.orders());
    (starts, columns)
}

/// [`LEAST_PROMISE`] in the unscaled cost.
pub(super) fn least_promise(problem: &Problem) -> f64 {
    LEAST_PROMISE / problem.power()
}

fn pulsates(effects: &[usize]) -> bool {
    effects.iter().any(|&e| matches!(REGISTRY[e].effect.act, Act::Pulsation(_)))
}

/// For each tolerance that was pulled far from its declared value and for which an effect can stand in exactly: `set` with that effect, and the same car with the effect in place
/// of the tolerance.
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

/// Fits those looks to the end that came near the best one, and adds all of them to what was found.
pub(super) fn finish(problem: &Problem, found: &mut Search, mut looked: Vec<Hypothesis>) {
    looked.sort_by(|a, b| b.fit.log_evidence.total_cmp(&a.fit.log_evidence));
    let Some(best) = looked.first().map(|l| l.fit.log_evidence) else { return };
    let most = found.behind(best);
    let is_near = |k: usize, h: &Hypothesis| k < FITTED && best - h.fit.log_evidence < most && !found.has_better(h);
    let (near, far): (Vec<_>, Vec<_>) = looked.into_iter().enumerate().partition(|(k, h)| is_near(*k, h));
    far.into_iter().for_each(|(_, h)| found.add(h));
    let stays = |(_, h): (usize, Hypothesis)| Hypothesis::fitted(problem, h.effects, &h.formed.point, STAY, h.formed.known());
    let done: Vec<Hypothesis> = near.into_par_iter().map(stays).collect();
    done.into_iter().for_each(|h| found.add(h));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In the bundled campaign, the contact point moves with temperature. A search that did not find this takes it up from an earlier one and looks for a companion; a set that was
    /// far behind in the earlier search is left out.
    #[test]
    fn what_an_earlier_search_found_is_taken_up() {
        let example = crate::gap::model::prepare::Example::read();
        let all: Vec<_> = example.campaign.recordings.iter().collect();
        let (problem, _) = example.problem(&all);
        let [moves, heavy] = ["kiss_point_thermal", "vehicle_mass"].map(|id| crate::effects::find(id).unwrap());
        let fitted = |set: &[usize], iterations: usize| Hypothesis::fitted(&problem, set.to_vec(), &problem.nominal(), iterations, None);
        let base = fitted(&[], STAY);
        let led = |set: &[usize], exact_log_posterior: f64| Hypothesis { exact_log_posterior, ..fitted(set, 1) };
        let earlier = Search::made_up(vec![led(&[moves], 0.0), led(&[heavy], -1e6), led(&[], -1e7)]);
        let mut found = Search::made_up(vec![base]);
        take_up(&problem, &mut found, &earlier);
        assert!(found.best().effects.contains(&moves) && found.of(&[heavy]).is_none());
        assert!(found.of(&[moves]).unwrap().exact_log_posterior > found.base().exact_log_posterior + 1000.0);
        assert_eq!(found.screened.iter().map(|(set, _)| set.clone()).collect::<Vec<_>>(), [[moves]]);
    }

    /// With no work left, a search only takes up what an earlier one found and promised, and nothing is exchanged, though the set that leads strains its tolerances.
    #[test]
    fn a_search_ends_when_its_work_is_done() {
        use crate::gap::infer::exchange::exchange;
        use crate::gap::progress::{MOST_ROWS, Work};
        let example = crate::gap::model::prepare::Example::read();
        let (problem, _) = example.problem(&[&example.campaign.recordings[0]]);
        let none = Problem { work: Work::default(), ..problem.clone() };
        none.work.add(MOST_ROWS as usize - 1);
        assert!(none.work.may_go_on() && !none.work.was_cut_short());
        none.work.add(1);
        let moves = vec![crate::effects::find("kiss_point_thermal").unwrap()];
        let fitted = |set: &[usize]| Hypothesis::fitted(&problem, set.to_vec(), &problem.nominal(), LOOK, None);
        let single = Hypothesis { exact_log_posterior: 1e6, ..fitted(&moves) };
        let mut earlier = Search::made_up(vec![single, fitted(&[])]);
        earlier.promised = (0..REGISTRY.len()).map(|e| Some(e as f64)).collect();
        let mut found = search(&none, Some(&earlier), &|_, _| {});
        assert!(none.work.was_cut_short() && found.screened.is_empty() && found.promised == earlier.promised);
        assert_eq!(found.hypotheses.len(), 2);
        found.hypotheses[0].fit.point.shared.fill(2.0);
        exchange(&none, &mut found);
        assert_eq!(found.hypotheses.len(), 2);
    }

    /// If a set was fitted to −100 nats, a start at −90 is worth another fit and one at −110 is not. A set that was never fitted is worth a fit, and so is one with a ripple, whose
    /// order may differ.
    #[test]
    fn a_start_that_lags_behind_a_fit_of_its_set_is_not_worth_another() {
        let [judder, mass, lag] = ["judder", "vehicle_mass", "actuator_lag"].map(|id| crate::effects::find(id).unwrap());
        let of = |effects: &[usize], log_evidence: f64| Hypothesis::made_up(effects, Fit { log_evidence, ..Fit::made_up(Vec::new()) });
        let found = Search::made_up(vec![of(&[mass], -100.0), of(&[judder], -100.0)]);
        assert_eq!([of(&[mass], -90.0), of(&[mass], -110.0)].each_ref().map(|h| found.has_better(h)), [false, true]);
        assert_eq!([of(&[lag], -110.0), of(&[judder], -110.0)].each_ref().map(|h| found.has_better(h)), [false, false]);
    }

    #[test]
    fn ripples_of_different_orders_are_different_starts() {
        let [judder, mass] = ["judder", "vehicle_mass"].map(|id| crate::effects::find(id).unwrap());
        let mut point = Point { shared: Vec::new(), own: Vec::new(), effects: crate::effects::null(), missing: Vec::new() };
        point.effects[crate::effects::param::judder::order] = 0.75;
        let orders = |effects: &[usize]| Start::new(&[], effects.to_vec(), point.clone(), 0.0, 0).orders();
        assert_eq!([orders(&[judder, mass]), orders(&[mass])], [0.75, 0.0]);
    }

    /// The sets hold 400 bytes each, and some of them share their derivatives: those of the sets beyond 1000 bytes are released.
    #[test]
    fn memory_is_bounded_and_counts_what_is_shared_once() {
        use crate::gap::model::column::Column;
        let of = |effects: &[usize], column: &Column| {
            let fit = Fit { columns: Arc::new(vec![vec![column.clone()]]), ..Fit::made_up(Vec::new()) };
            Hypothesis::made_up(effects, fit)
        };
        let [a, b, c] = [1.0, 2.0, 3.0].map(|x| Column::new(&[x; 100]));
        let mut all = [of(&[1], &a), of(&[2], &a), of(&[3], &b), of(&[4], &c), of(&[], &c)];
        let kept = |all: &[Hypothesis]| all.iter().map(|h| !h.formed.columns.is_empty()).collect::<Vec<_>>();
        let_go(&mut all, 1000);
        assert_eq!(kept(&all), [true, true, true, false, false]);
        let_go(&mut all, 0);
        assert_eq!(kept(&all), [false; 5]);
    }
}
