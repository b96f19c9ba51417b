//! Where the library ends: a law that is learned from the recordings, and whether it is worth anything.
//!
//! A verdict that leaves something without a cause names a place; one that names its cause may leave a part of the gap all the same, for no real effect has quite the
//! library's form. The curves of `effects::empirical` that act there, or where the effects are, are fitted beside whatever was named, and a
//! law is taken only if free replays say so of recordings that did not teach it: of each recording in turn with a law that was learned from the others, and of what
//! was held out from everything. Laws are added one at a time, as long as the next one carries over, too. They are never a cause, and change no verdict.

use super::free::Car;
use super::infer::density::{Point, Problem};
use super::infer::fit::Fit;
use super::infer::learned::{Learned, learn, look};
use super::measure::{self, Closed, HeldOut};
use super::retune::{Followed, and_without_each};
use super::verdict::{Conclusion, Verdict};
use crate::campaign::Recording;
use crate::effects::empirical::{Curve, curves};
use crate::effects::{self, Parameters, REGISTRY, Subsystem};
use crate::vehicle::Vehicle;
use rayon::prelude::*;

/// Share of the gap on what was held out that effects which explain it have to leave for a law to be tried beside them, and share of what is left that each law has to close
/// on recordings that did not teach it.
const WORTH_A_LAW: f64 = 0.03;

/// Laws that are tried in turn beside those that are there, the ones with the most evidence.
const TRIED: usize = 3;

/// Laws that were tried together, and what became of them.
#[derive(Clone, Debug)]
pub struct Tried {
    /// Where something is missing.
    pub places: Vec<Subsystem>,
    /// Subsystems of the laws, the first one added first.
    pub laws: Vec<Subsystem>,
    /// What was learned.
    pub learned: Learned,
    /// The car with it.
    pub vehicle: Vehicle,
    /// Its effects, the learned values among them.
    pub effects: Parameters,
    /// Gap of each recording that taught it with a law learned from the others, rad/s: without and with.
    pub left_out: Vec<[f64; 2]>,
    /// Gap of what was held out, before and with the law.
    pub held_out: Vec<HeldOut>,
    /// The same without the law, as one number, rad/s.
    pub without: f64,
    /// Whether it is taken, or why not.
    pub refused: Option<Refusal>,
}

/// Why a law was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// It does not carry over from recording to recording.
    LeftOut,
    /// It does not close the gap on what was held out.
    HeldOut,
    /// Nothing on what was held out stands above what the true car would leave, so that it cannot be judged there.
    NothingToJudge,
}

/// Half width of a 95 % band in standard deviations.
pub const BAND: f64 = 1.96;

impl Tried {
    /// Whether any value of the curves stands out of its 95 % band around zero. If none does, what closes the gap are the tolerances that were fitted beside them.
    pub fn stands_out(&self) -> bool {
        let outside = |(k, sigma): (usize, f64)| sigma > 0.0 && self.learned.fit.point.effects[k].abs() > BAND * sigma;
        self.learned.curves.iter().any(|c| c.parameters().zip(self.learned.sigma(c)).any(outside))
    }

    /// Share of the gap that it closes on recordings that did not teach it, of those that taught the others.
    pub fn share_left_out(&self) -> f64 {
        closed(&self.left_out)
    }

    /// Gaps of the recordings that did not teach it, with it, rad/s.
    fn gaps(&self) -> impl Iterator<Item = f64> + Clone {
        self.left_out.iter().map(|g| g[1])
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0_usize), |(sum, count), x| (sum + x, count + 1));
    sum / count.max(1) as f64
}

/// Share of these gaps, without and with, that is closed.
fn closed(gaps: &[[f64; 2]]) -> f64 {
    let [without, with] = [0, 1].map(|k| mean(gaps.iter().map(|g| g[k])));
    if without > 0.0 { 1.0 - with / without } else { 0.0 }
}

/// Whether a law carries over that leaves these gaps of recordings that did not teach it, rad/s: without it, but with the laws that are there, and with it.
fn carries_over(gaps: &[[f64; 2]]) -> bool {
    fall(gaps) && closed(gaps) > WORTH_A_LAW
}

/// Whether gaps fall on average by more than the standard error of that mean; a single one never does.
fn fall(gaps: &[[f64; 2]]) -> bool {
    let n = gaps.len() as f64;
    let by = || gaps.iter().map(|g| g[0] - g[1]);
    let fallen = mean(by());
    let variance = by().map(|d| (d - fallen).powi(2)).sum::<f64>() / (n - 1.0);
    fallen > (variance / n).sqrt()
}

/// Laws that act on the car as one that is missing at this place may: they are tried in this order.
pub fn laws_for(place: Subsystem) -> &'static [Subsystem] {
    use Subsystem::{Actuator, ClutchForce, Driveline, Engine, Friction, Sensors, Thermal};
    match place {
        Engine => &[Engine],
        Actuator => &[Actuator, ClutchForce],
        ClutchForce => &[ClutchForce, Friction],
        Friction | Thermal => &[Friction, ClutchForce],
        Driveline => &[Driveline],
        Sensors => &[Sensors],
    }
}

/// What a law is judged on, and by.
pub struct Judge<'a> {
    /// Recordings that taught, in the order of the problem's, and what the true car would leave there.
    pub taught: Followed<'a>,
    /// What was held out.
    pub held_out: &'a Recording,
    /// Whether only its last engagement was.
    pub last_engagement: bool,
    /// What the true car would leave there, rad/s.
    pub floor: f64,
    /// The car as its file gives it.
    pub nominal: &'a Vehicle,
    /// The car as it would be handed out without a law.
    pub tuned: Car<'a>,
}

impl Judge<'_> {
    /// Gaps of a car on what was held out.
    fn gaps(&self, car: Car) -> Vec<HeldOut> {
        measure::evaluate_part(self.held_out, (self.nominal, &effects::null()), car, self.last_engagement)
    }

    /// Share of the gap above what the true car would leave that a car leaves on what was held out; none of it where it leaves less than that car.
    fn leaves(&self, car: Car) -> f64 {
        let closed = Closed { noise: self.floor, ..Closed::of(&self.gaps(car)) };
        if closed.after <= self.floor { 0.0 } else { 1.0 - closed.fraction() }
    }
}

/// Gap of both speeds in free replays of one recording, rad/s: of the first car and of the second.
fn gap(recording: &Recording, before: Car, after: Car) -> [f64; 2] {
    let c = Closed::of(&measure::evaluate(recording, before, after));
    [c.before, c.after]
}

/// Whether a law is tried after this verdict, where effects that explain leave this share of the gap.
fn is_worthwhile(verdict: Verdict, left: impl FnOnce() -> f64) -> bool {
    match verdict {
        Verdict::Unexplained | Verdict::PartlyExplained => true,
        Verdict::Explained => left() > WORTH_A_LAW,
        Verdict::NoGap | Verdict::InputsDoNotFit => false,
    }
}

/// Learns a law where something is left, by a verdict that says so or by effects on what was held out; none if nothing is, or if no law acts there. `start` is the point that goes with the tuned car,
/// `near` a fit from whose derivatives along nuisances the work may begin.
pub fn learn_law(problem: &Problem, conclusion: &Conclusion, start: &Point, near: Option<&Fit>, judge: &Judge) -> Option<Tried> {
    if !is_worthwhile(conclusion.verdict, || judge.leaves(judge.tuned)) {
        return None;
    }
    let start =
        if conclusion.verdict == Verdict::Unexplained { Point { effects: effects::null(), ..start.clone() } } else { start.clone() };
    let of_effects = conclusion.effects.iter().map(|&e| &REGISTRY[e].effect.subsystem);
    let of_effects = of_effects.filter(|_| conclusion.verdict == Verdict::Explained);
    let mut places: Vec<Subsystem> = Vec::new();
    for &place in conclusion.unexplained_at.iter().chain(&conclusion.or_at).chain(of_effects) {
        if !places.contains(&place) {
            places.push(place);
        }
    }
    let mut open: Vec<Subsystem> = Vec::new();
    for &law in places.iter().flat_map(|place| laws_for(*place)) {
        if !open.contains(&law) {
            open.push(law);
        }
    }
    let without = Closed::of(&judge.gaps(judge.tuned)).after;
    let mut best: Option<Tried> = None;
    let mut refused: Option<Tried> = None;
    'more: loop {
        let held_out = best.as_ref().map_or(without, |b| Closed::of(&b.held_out).after);
        let beside = Beside::of(best.as_ref(), &start, near);
        for law in beside.most_evident(problem, &open) {
            let mut next = beside.with(problem, judge, &places, law);
            let before = best.as_ref().map_or_else(|| next.left_out.iter().map(|g| g[0]).collect(), |b| b.gaps().collect::<Vec<_>>());
            let both: Vec<[f64; 2]> = before.into_iter().zip(next.gaps()).map(|(before, after)| [before, after]).collect();
            next.held_out = judge.gaps((&next.vehicle, &next.effects));
            next.without = without;
            next.refused = refusal(carries_over(&both), &Closed { before: held_out, noise: judge.floor, ..Closed::of(&next.held_out) });
            if next.refused.is_none() {
                open.retain(|other| *other != law);
                best = Some(next);
                continue 'more;
            }
            refused = refused.or(Some(next));
        }
        return best.or(refused);
    }
}

/// What a further law stands beside: the laws that are there, or none.
struct Beside<'a> {
    laws: &'a [Subsystem],
    curves: &'a [&'static Curve],
    start: &'a Point,
    near: Option<&'a Fit>,
}

impl<'a> Beside<'a> {
    fn of(best: Option<&'a Tried>, start: &'a Point, near: Option<&'a Fit>) -> Self {
        match best {
            None => Self { laws: &[], curves: &[], start, near },
            Some(b) => {
                let Learned { curves, fit, .. } = &b.learned;
                Self { laws: &b.laws, curves, start: &fit.point, near: Some(fit) }
            }
        }
    }

    /// The curves that are there, and the first ones of a law.
    fn and(&self, law: Subsystem, count: usize) -> Vec<&'static Curve> {
        self.curves.iter().copied().chain(curves(law).take(count)).collect()
    }

    /// Those of these laws that have the most evidence at a first look, [`TRIED`] at most.
    fn most_evident(&self, problem: &Problem, open: &[Subsystem]) -> Vec<Subsystem> {
        let evidence = |law: Subsystem| look(problem, &self.and(law, usize::MAX), self.start, self.near);
        let mut all: Vec<(Subsystem, f64)> = open.iter().map(|&law| (law, if open.len() > TRIED { evidence(law) } else { 0.0 })).collect();
        all.sort_by(|a, b| b.1.total_cmp(&a.1));
        all.into_iter().take(TRIED).map(|(law, _)| law).collect()
    }

    /// A law beside them: its first curve alone, for what few numbers say carries further, or all, whichever leaves less of recordings that did not teach it.
    fn with(&self, problem: &Problem, judge: &Judge, places: &[Subsystem], law: Subsystem) -> Tried {
        let laws = [self.laws, &[law]].concat();
        let first = tried(problem, places, &laws, learn(problem, &self.and(law, 1), self.start, self.near), judge);
        if curves(law).count() == 1 {
            return first;
        }
        let all = learn(problem, &self.and(law, usize::MAX), &first.learned.fit.point, Some(&first.learned.fit));
        let all = tried(problem, places, &laws, all, judge);
        if mean(all.gaps()) < mean(first.gaps()) { all } else { first }
    }
}

fn tried(problem: &Problem, places: &[Subsystem], laws: &[Subsystem], mut learned: Learned, judge: &Judge) -> Tried {
    let mut points = learned.without_each(problem);
    if problem.tracks.iter().all(|t| !t.position_free) {
        (learned.fit.point, points) = and_without_each(problem, &learned.fit, &points, judge.taught);
    }
    let car = problem.car(&learned.fit.point, None);
    let one = |(recording, point): (&Recording, &Point)| {
        let other = problem.car(point, None);
        gap(recording, judge.tuned, (&other.vehicle, &other.effects))
    };
    Tried {
        places: places.to_vec(),
        laws: laws.to_vec(),
        left_out: judge.taught.recordings.par_iter().zip(&points).map(one).collect(),
        learned,
        vehicle: car.vehicle,
        effects: car.effects,
        held_out: Vec::new(),
        without: 0.0,
        refused: Some(Refusal::LeftOut),
    }
}

/// Whether a law is refused that carries over to recordings that did not teach it, or does not, and closes this of what was held out.
fn refusal(carries_over: bool, held_out: &Closed) -> Option<Refusal> {
    if !carries_over {
        Some(Refusal::LeftOut)
    } else if held_out.is_below_floor() {
        Some(Refusal::NothingToJudge)
    } else if held_out.after >= held_out.before {
        Some(Refusal::HeldOut)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_law_has_to_close_something_twice() {
        let left = |before: f64, after: f64| Closed { before, after, noise: 1.0, sensors: 0.1 };
        for (carries_over, held_out, refused) in [
            (false, left(3.0, 1.0), Some(Refusal::LeftOut)),
            (false, left(0.9, 0.1), Some(Refusal::LeftOut)),
            (true, left(1.0, 0.1), Some(Refusal::NothingToJudge)),
            (true, left(3.0, 3.0), Some(Refusal::HeldOut)),
            (true, left(3.0, 4.0), Some(Refusal::HeldOut)),
            (true, left(3.0, 2.98), None),
        ] {
            assert_eq!(refusal(carries_over, &held_out), refused, "{carries_over} {held_out:?}");
        }
    }

    /// Falls of 1, 2 and 3 rad/s: 2 on average, with a standard error of 0.58. One recording tells nothing, nor do falls that are as often rises.
    #[test]
    fn gaps_fall_if_their_mean_does_by_its_standard_error() {
        let fallen = |by: &[f64]| fall(&by.iter().map(|d| [5.0, 5.0 - d]).collect::<Vec<_>>());
        assert!(fallen(&[1.0, 2.0, 3.0]) && fallen(&[0.1; 2]));
        // A mean of 1 with a standard error of 0.99 or 1.01.
        assert!(fallen(&[0.01, 1.99]) && !fallen(&[-0.01, 2.01]));
        assert!(!fallen(&[4.0]) && !fallen(&[]) && !fallen(&[0.0; 3]) && !fallen(&[-1.0, -2.0, -3.0]) && !fallen(&[1.0, -1.0, 0.1]));
    }

    /// Of 100 rad/s a first law leaves 10; a second one that takes them to 9.6 closes 4 % of what is left, and one that takes them to 9.8 closes 2 %.
    #[test]
    fn a_further_law_is_measured_by_what_those_before_it_leave() {
        assert!(carries_over(&[[100.0, 10.0]; 3]) && carries_over(&[[10.0, 9.6]; 3]) && !carries_over(&[[10.0, 9.8]; 3]));
        assert!(!carries_over(&[[10.0, 5.0], [10.0, 14.0]]) && !carries_over(&[[0.0, 0.0]; 3]));
    }

    #[test]
    fn laws_act_where_something_is_missing() {
        use Subsystem::{Actuator, ClutchForce, Driveline, Engine, Friction, Sensors, Thermal};
        let expected: [(Subsystem, &[Subsystem]); 7] = [
            (Engine, &[Engine]),
            (Actuator, &[Actuator, ClutchForce]),
            (ClutchForce, &[ClutchForce, Friction]),
            (Friction, &[Friction, ClutchForce]),
            (Thermal, &[Friction, ClutchForce]),
            (Driveline, &[Driveline]),
            (Sensors, &[Sensors]),
        ];
        expected.iter().for_each(|(place, laws)| assert_eq!(laws_for(*place), *laws));
    }

    #[test]
    fn a_law_is_tried_where_something_is_left() {
        for verdict in [Verdict::Unexplained, Verdict::PartlyExplained] {
            assert!(is_worthwhile(verdict, || unreachable!("it does not matter how much")));
        }
        assert!(is_worthwhile(Verdict::Explained, || 0.031) && !is_worthwhile(Verdict::Explained, || 0.029));
        assert!(!is_worthwhile(Verdict::NoGap, || 1.0) && !is_worthwhile(Verdict::InputsDoNotFit, || 1.0));
    }
}
