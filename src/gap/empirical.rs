//! Where the library ends: a law that is learned from the recordings, and whether it is worth anything.
//!
//! A verdict that leaves something without a cause names a place; one that names its cause may leave a part of the gap all the same, for no real effect has quite the
//! library's form. The curves of `effects::empirical` that act there, or where the effects are, are fitted beside whatever was named, and a
//! law is taken only if free replays say so of recordings that did not teach it: of each recording in turn with a law that was learned from the others, and of what
//! was held out from everything. Either time it has to close more than it leaves. It is never a cause, and changes no verdict.

use super::infer::density::{Point, Problem};
use super::infer::fit::Fit;
use super::infer::learned::{Learned, learn};
use super::measure::{self, Closed, HeldOut};
use super::verdict::{Conclusion, Verdict};
use crate::campaign::Recording;
use crate::effects::empirical::{Curve, curves};
use crate::effects::{self, Parameters, REGISTRY, Subsystem};
use crate::vehicle::Vehicle;
use rayon::prelude::*;

/// Share of what is left that a law has to close: more than it leaves.
pub const LEAST_CLOSED: f64 = 0.5;

/// Share of the gap on what was held out that effects which explain it have to leave for a law to be tried beside them.
const WORTH_A_LAW: f64 = 0.03;

/// A law that was tried, and what became of it.
#[derive(Clone, Debug)]
pub struct Tried {
    /// Where something is missing.
    pub place: Subsystem,
    /// Subsystem of the law.
    pub law: Subsystem,
    /// What was learned.
    pub learned: Learned,
    /// The car with it.
    pub vehicle: Vehicle,
    /// Its effects, the learned values among them.
    pub effects: Parameters,
    /// Gap of the recordings that taught it, each with a law learned from the others, rad/s: without and with.
    pub left_out: [f64; 2],
    /// Their number.
    pub recordings: usize,
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
        let [without, with] = self.left_out;
        if without > 0.0 { 1.0 - with / without } else { 0.0 }
    }
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
    /// Recordings that taught, in the order of the problem's.
    pub taught: &'a [Recording],
    /// What was held out.
    pub held_out: &'a Recording,
    /// Whether only its last engagement was.
    pub last_engagement: bool,
    /// What the true car would leave there, rad/s.
    pub floor: f64,
    /// The car as its file gives it.
    pub nominal: &'a Vehicle,
    /// The car as it would be handed out without a law.
    pub tuned: measure::Car<'a>,
}

impl Judge<'_> {
    /// Gaps of a car on what was held out.
    fn gaps(&self, car: measure::Car) -> Vec<HeldOut> {
        measure::evaluate_part(self.held_out, (self.nominal, &effects::null()), car, self.last_engagement)
    }

    /// Share of the gap above what the true car would leave that a car leaves on what was held out; none of it where it leaves less than that car.
    fn leaves(&self, car: measure::Car) -> f64 {
        let closed = Closed { noise: self.floor, ..Closed::of(&self.gaps(car)) };
        if closed.after <= self.floor { 0.0 } else { 1.0 - closed.fraction() }
    }
}

/// Gap of both speeds in free replays of one recording, rad/s: of the first car and of the second.
fn gap(recording: &Recording, before: measure::Car, after: measure::Car) -> [f64; 2] {
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
    let mut laws: Vec<(Subsystem, Subsystem)> = Vec::new();
    let of_effects = conclusion.effects.iter().map(|&e| &REGISTRY[e].effect.subsystem);
    let of_effects = of_effects.filter(|_| conclusion.verdict == Verdict::Explained);
    for &place in conclusion.unexplained_at.iter().chain(&conclusion.or_at).chain(of_effects) {
        for &law in laws_for(place) {
            if laws.iter().all(|(_, known)| *known != law) {
                laws.push((place, law));
            }
        }
    }
    let mut best: Option<Tried> = None;
    for (place, law) in laws {
        let all: Vec<&'static Curve> = curves(law).collect();
        let mut from = start.clone();
        // The first curve alone, then all: what few numbers say carries further.
        for count in if all.len() > 1 { vec![1, all.len()] } else { vec![1] } {
            let learned = learn(problem, &all[..count], &from, best.as_ref().map_or(near, |b| Some(&b.learned.fit)));
            from = learned.fit.point.clone();
            let tried = tried(problem, place, law, learned, judge);
            if best.as_ref().is_none_or(|b| tried.left_out[1] < b.left_out[1]) {
                best = Some(tried);
            }
        }
    }
    best.map(|mut tried| {
        tried.judge(judge);
        tried
    })
}

fn tried(problem: &Problem, place: Subsystem, law: Subsystem, learned: Learned, judge: &Judge) -> Tried {
    let car = problem.car(&learned.fit.point, None);
    let points = learned.without_each(problem);
    let one = |(recording, point): (&Recording, &Point)| {
        let other = problem.car(point, None);
        gap(recording, judge.tuned, (&other.vehicle, &other.effects))
    };
    let gaps: Vec<[f64; 2]> = judge.taught.par_iter().zip(&points).map(one).collect();
    let left_out = [0, 1].map(|k| gaps.iter().map(|g| g[k]).sum::<f64>() / gaps.len().max(1) as f64);
    Tried {
        place,
        law,
        learned,
        vehicle: car.vehicle,
        effects: car.effects,
        left_out,
        recordings: gaps.len(),
        held_out: Vec::new(),
        without: 0.0,
        refused: Some(Refusal::LeftOut),
    }
}

impl Tried {
    fn judge(&mut self, judge: &Judge) {
        self.held_out = judge.gaps((&self.vehicle, &self.effects));
        self.without = Closed::of(&judge.gaps(judge.tuned)).after;
        let left = Closed { before: self.without, noise: judge.floor, ..Closed::of(&self.held_out) };
        self.refused = refusal(self.share_left_out(), &left);
    }
}

/// Whether a law is refused that closes this share on recordings that did not teach it, and this of what was held out.
fn refusal(left_out: f64, held_out: &Closed) -> Option<Refusal> {
    if left_out <= LEAST_CLOSED {
        Some(Refusal::LeftOut)
    } else if held_out.is_below_floor() {
        Some(Refusal::NothingToJudge)
    } else if held_out.fraction() <= LEAST_CLOSED {
        Some(Refusal::HeldOut)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_law_has_to_close_more_than_it_leaves_twice() {
        let left = |before: f64, after: f64| Closed { before, after, noise: 1.0, sensors: 0.1 };
        for (share, held_out, refused) in [
            (0.5, left(3.0, 1.0), Some(Refusal::LeftOut)),
            (-1.0, left(0.9, 0.1), Some(Refusal::LeftOut)),
            (0.51, left(1.0, 0.1), Some(Refusal::NothingToJudge)),
            (0.51, left(3.0, 2.0), Some(Refusal::HeldOut)),
            (0.51, left(3.0, 4.0), Some(Refusal::HeldOut)),
            (0.51, left(3.0, 1.98), None),
            (0.99, left(3.0, 1.0), None),
        ] {
            assert_eq!(refusal(share, &held_out), refused, "{share} {held_out:?}");
        }
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
