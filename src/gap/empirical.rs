//! Learns laws from the recordings for what the library does not explain, and judges whether they are worth anything.
//!
//! A verdict that leaves something without a cause names a place, which is a subsystem. A verdict that names effects may leave a part of the gap as well, because no real effect
//! has exactly the library's form. The curves of `effects::empirical` that act in this place, or in the subsystems of the effects, are fitted beside the named effects. A law is
//! taken only if free replays confirm it on data to which it was not fitted: on each recording of the fit with a law that was learned from the others, and on the held-out data.
//! Laws are added one at a time, as long as the next one is confirmed as well. They are never named as a cause, and they do not change the verdict.

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

/// A law is tried beside effects that explain the gap only if they leave more than this share of the gap on the held-out data. Each law has to close more than this share of the
/// remaining gap on recordings from which it was not learned.
const WORTH_A_LAW: f64 = 0.03;

/// Maximum number of laws that are tried in turn beside those already taken: the ones with the most evidence.
const TRIED: usize = 3;

/// Laws that were learned together, and the result of judging them.
#[derive(Clone, Debug)]
pub struct Tried {
    /// Subsystems in which something may be missing.
    pub places: Vec<Subsystem>,
    /// Subsystems of the laws, the first one added first.
    pub laws: Vec<Subsystem>,
    /// The fitted curves.
    pub learned: Learned,
    /// The numbers of the car with the laws.
    pub vehicle: Vehicle,
    /// The effects of the car, including the learned values.
    pub effects: Parameters,
    /// Gap of each recording of the fit, rad/s: without any law, and with the laws as learned from the other recordings.
    pub left_out: Vec<[f64; 2]>,
    /// Gaps on the held-out data, of the nominal car and with the laws.
    pub held_out: Vec<HeldOut>,
    /// Gap of both speeds on the held-out data without any law, rad/s.
    pub without: f64,
    /// Why the last of the laws was not taken; none if it was.
    pub refused: Option<Refusal>,
}

/// Why a law was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// It does not carry over to recordings from which it was not learned.
    LeftOut,
    /// It does not reduce the gap on the held-out data.
    HeldOut,
    /// The gap on the held-out data is no larger than what the true car would leave, so that the law cannot be judged there.
    NothingToJudge,
}

/// Half width of a 95 % band in standard deviations.
pub const BAND: f64 = 1.96;

impl Tried {
    /// Whether any value of the curves lies outside its 95 % band around zero. If none does, the gap is closed by the tolerances that were fitted beside the curves.
    pub fn stands_out(&self) -> bool {
        let outside = |(k, sigma): (usize, f64)| sigma > 0.0 && self.learned.fit.point.effects[k].abs() > BAND * sigma;
        self.learned.curves.iter().any(|c| c.parameters().zip(self.learned.sigma(c)).any(outside))
    }

    /// Share by which the mean gap of the recordings of the fit falls, each replayed with laws that were learned from the others.
    pub fn share_left_out(&self) -> f64 {
        closed(&self.left_out)
    }

    /// Gap of each recording of the fit with the laws as learned from the others, rad/s.
    fn gaps(&self) -> impl Iterator<Item = f64> + Clone {
        self.left_out.iter().map(|g| g[1])
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0_usize), |(sum, count), x| (sum + x, count + 1));
    sum / count.max(1) as f64
}

/// Share by which the mean gap falls; each entry is a gap without and with a law. Zero if there is no gap.
fn closed(gaps: &[[f64; 2]]) -> f64 {
    let [without, with] = [0, 1].map(|k| mean(gaps.iter().map(|g| g[k])));
    if without > 0.0 { 1.0 - with / without } else { 0.0 }
}

/// Whether a law carries over to recordings from which it was not learned. `gaps` are theirs, rad/s: with the laws already taken, and with this law beside them.
fn carries_over(gaps: &[[f64; 2]]) -> bool {
    fall(gaps) && closed(gaps) > WORTH_A_LAW
}

/// Whether the gaps fall on average by more than the standard error of their mean fall. A single gap never does, because it has no standard error.
fn fall(gaps: &[[f64; 2]]) -> bool {
    let n = gaps.len() as f64;
    let by = || gaps.iter().map(|g| g[0] - g[1]);
    let fallen = mean(by());
    let variance = by().map(|d| (d - fallen).powi(2)).sum::<f64>() / (n - 1.0);
    fallen > (variance / n).sqrt()
}

/// Laws that can act on the car like a law that is missing at this place, in the order in which they are tried if no more than three laws are open.
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

/// The data by which a law is judged, and the cars with which it is compared.
pub struct Judge<'a> {
    /// The recordings of the fit, in the order of the problem, and the gap that the true car would leave in each.
    pub fitted_part: Followed<'a>,
    /// The recording that judges.
    pub held_out: &'a Recording,
    /// Whether only its last engagement was held out.
    pub last_engagement: bool,
    /// Gap that the true car would leave on the held-out data, rad/s.
    pub floor: f64,
    /// The car as its file gives it.
    pub nominal: &'a Vehicle,
    /// The car as it would be handed out without a law.
    pub tuned: Car<'a>,
}

impl Judge<'_> {
    /// Gaps on the held-out data, of the nominal car and of `car`.
    fn gaps(&self, car: Car) -> Vec<HeldOut> {
        measure::evaluate_part(self.held_out, (self.nominal, &effects::null()), car, self.last_engagement)
    }

    /// Share of the nominal car's gap above the floor of the true car that a car leaves on the held-out data; zero if it leaves no more than the floor.
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

/// Whether a law is tried after this verdict. `left` is the share of the gap that the effects leave, which matters only if they explain the gap.
fn is_worthwhile(verdict: Verdict, left: impl FnOnce() -> f64) -> bool {
    match verdict {
        Verdict::Unexplained | Verdict::PartlyExplained => true,
        Verdict::Explained => left() > WORTH_A_LAW,
        Verdict::NoGap | Verdict::InputsDoNotFit => false,
    }
}

/// Learns laws if something is left: because the verdict says so, or because effects that explain the gap leave a part of it on the held-out data. None if nothing is left, or if
/// no law acts there. If no law is taken, the first one that was refused is returned. `start` is the point that belongs to the tuned car; `near` is a fit whose derivatives along
/// nuisances are reused at first.
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

/// The laws already taken, beside which a further law is fitted, and the point from which its fit starts.
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

    /// The curves of the laws already taken, and the first `count` curves of a further law.
    fn and(&self, law: Subsystem, count: usize) -> Vec<&'static Curve> {
        self.curves.iter().copied().chain(curves(law).take(count)).collect()
    }

    /// Those of the laws `open` that have the most evidence at a first look, [`TRIED`] at most.
    fn most_evident(&self, problem: &Problem, open: &[Subsystem]) -> Vec<Subsystem> {
        let evidence = |law: Subsystem| look(problem, &self.and(law, usize::MAX), self.start, self.near);
        let mut all: Vec<(Subsystem, f64)> = open.iter().map(|&law| (law, if open.len() > TRIED { evidence(law) } else { 0.0 })).collect();
        all.sort_by(|a, b| b.1.total_cmp(&a.1));
        all.into_iter().take(TRIED).map(|(law, _)| law).collect()
    }

    /// Learns a further law, once with its first curve alone, because a law with few numbers carries over more easily, and once with all its curves. Returns the one with the
    /// smaller mean gap on recordings from which it was not learned.
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
        (learned.fit.point, points) = and_without_each(problem, &learned.fit, &points, judge.fitted_part);
    }
    let car = problem.car(&learned.fit.point, None);
    let one = |(recording, point): (&Recording, &Point)| {
        let other = problem.car(point, None);
        gap(recording, judge.tuned, (&other.vehicle, &other.effects))
    };
    Tried {
        places: places.to_vec(),
        laws: laws.to_vec(),
        left_out: judge.fitted_part.recordings.par_iter().zip(&points).map(one).collect(),
        learned,
        vehicle: car.vehicle,
        effects: car.effects,
        held_out: Vec::new(),
        without: 0.0,
        refused: Some(Refusal::LeftOut),
    }
}

/// Why a law is refused, depending on whether it carries over to recordings from which it was not learned, and on the gaps without and with it on the held-out data. None if it is
/// taken.
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

    /// Falls of 1, 2 and 3 rad/s have a mean of 2 and a standard error of 0.58. A single recording is not sufficient, and neither are rises, or falls that rises nearly compensate.
    #[test]
    fn gaps_fall_if_their_mean_does_by_its_standard_error() {
        let fallen = |by: &[f64]| fall(&by.iter().map(|d| [5.0, 5.0 - d]).collect::<Vec<_>>());
        assert!(fallen(&[1.0, 2.0, 3.0]) && fallen(&[0.1; 2]));
        // A mean of 1 with a standard error of 0.99 or 1.01.
        assert!(fallen(&[0.01, 1.99]) && !fallen(&[-0.01, 2.01]));
        assert!(!fallen(&[4.0]) && !fallen(&[]) && !fallen(&[0.0; 3]) && !fallen(&[-1.0, -2.0, -3.0]) && !fallen(&[1.0, -1.0, 0.1]));
    }

    /// A first law leaves 10 of 100 rad/s. A second law that leaves 9.6 rad/s closes 4 % of these 10, one that leaves 9.8 rad/s closes 2 %.
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
