//! From the posterior to a verdict: which explanation stands, what may stand in its place, and where the gap lies.

use super::infer::density::{Problem, misfit, prior, sizes};
use super::infer::fit::Fit;
use super::infer::irregular::Irregular;
use super::infer::posterior::{Explanation, Posterior};
use super::infer::search::Search;
use super::mistaken::{Mistake, Mistaken};
use crate::effects::{REGISTRY, Subsystem};
use serde::Serialize;

/// Verdict on a campaign, as the answer's schema names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing beyond noise and tolerances.
    NoGap,
    /// The effects leave nothing structured.
    Explained,
    /// The effects help and something structured remains.
    PartlyExplained,
    /// A gap that no library effect accounts for.
    Unexplained,
    /// The recordings cannot be of this vehicle.
    InputsDoNotFit,
}

/// Probability above which a rival is named beside what was chosen.
pub const NAMED_BESIDE: f64 = 0.05;

/// Share of the gap above which a missing law is what is wrong in its subsystem. Effects of that subsystem then only stood in for a part of the law, and are not named.
pub const STAND_IN_SHARE: f64 = 0.5;

/// Largest mean of Huber's loss of the innovations that the best explanation may leave, which corresponds to 9.5 standard deviations in every sample. With a larger mean, the
/// recordings are not those of this kind of car. On cars with a law that the library does not contain, the mean is at most a tenth of this.
pub const STRANGE: f64 = 60.0;

/// Departure of an effect, in sizes of a noticeable one, beyond which it is more likely that an input is not what it is said to be: the prior probability of such a departure is
/// less than one in a million. The bound applies only where no position is known, because then a single factor can make the inputs of another car fit; with a position, the torque
/// of the clutch would contradict it.
pub const BEYOND_A_CAR: f64 = 5.0;

/// Ratio of the gap with effects to the gap of the file's car, in free replays of the recordings of the fit, above which the effects are not named.
pub const MISLED: f64 = 2.0;

/// The conclusion on a campaign: the verdict and what belongs to it.
#[derive(Clone, Debug)]
pub struct Conclusion {
    /// Verdict.
    pub verdict: Verdict,
    /// Probability of the verdict's content: that nothing is wrong, that these effects are there, or that a law is missing there.
    pub probability: f64,
    /// The explanation that stands.
    pub explanation: Explanation,
    /// Effects that are named.
    pub effects: Vec<usize>,
    /// Subsystem of a structured remainder, or of an unexplained gap.
    pub unexplained_at: Option<Subsystem>,
    /// Subsystems with their shares of the gap, largest first.
    pub shares: Vec<(Subsystem, f64)>,
    /// Subsystems in which the gap, or its remainder, may lie instead.
    pub or_at: Vec<Subsystem>,
    /// Effects that were withdrawn.
    pub taken_back: Option<TakenBack>,
    /// Irregular disturbances, in words with their size.
    pub irregular: Vec<String>,
    /// A mistake in the channel map that explains the recordings.
    pub mistake: Option<Mistake>,
}

/// Effects that account for the innovations but were withdrawn, because with them the car follows the recordings of the fit worse than without.
#[derive(Clone, Debug, PartialEq)]
pub struct TakenBack {
    /// The effects.
    pub effects: Vec<usize>,
    /// Mean gap of both speeds in free replays of the recordings of the fit, rad/s: with the file's car, and with the effects.
    pub gaps: [f64; 2],
}

/// Draws the conclusion from the posterior.
pub fn conclude(problem: &Problem, search: &Search, posterior: &Posterior) -> Conclusion {
    let best = posterior.best().clone();
    let fit = best.fit.as_ref().expect("the best was fitted");
    let shares = shares(search, posterior, &best);
    let strange = leaves_too_much(problem, fit) || problem.tracks.iter().all(|t| t.position_free) && is_beyond_a_car(&best);
    let gap = || misfit(&problem.all_residuals(&problem.nominal(), None));
    let stands_in = best.place.filter(|_| law_share(gap(), search, &best) > STAND_IN_SHARE);
    let named: Vec<usize> = best.effects.iter().copied().filter(|&e| Some(REGISTRY[e].effect.subsystem) != stands_in).collect();
    let verdict =
        if strange { Verdict::InputsDoNotFit } else { verdict_of(!best.effects.is_empty(), !named.is_empty(), best.place.is_some()) };
    let unexplained_at = best.place.filter(|_| !strange);
    let probability = match verdict {
        Verdict::NoGap => posterior.of_no_gap(),
        Verdict::InputsDoNotFit => 1.0,
        Verdict::Unexplained => best.place.map_or(0.0, |p| posterior.of_place(p)),
        _ => posterior.explanations.iter().filter(|e| e.effects == best.effects).map(|e| e.probability).sum(),
    };
    let shown: Vec<Subsystem> = shares.iter().map(|s| s.0).collect();
    let or_at =
        if matches!(verdict, Verdict::NoGap | Verdict::InputsDoNotFit) { Vec::new() } else { doubted(&posterior.explanations, &shown) };
    let shares = if strange { Vec::new() } else { shares };
    Conclusion {
        verdict,
        probability,
        explanation: best,
        effects: named,
        unexplained_at,
        shares,
        or_at,
        taken_back: None,
        irregular: Vec::new(),
        mistake: None,
    }
}

/// Verdict of an explanation, depending on whether it has effects, whether any of them is named, and whether it has a missing law.
fn verdict_of(effects: bool, named: bool, law: bool) -> Verdict {
    match (effects, law) {
        (false, false) => Verdict::NoGap,
        (true, false) => Verdict::Explained,
        (true, true) if named => Verdict::PartlyExplained,
        (_, true) => Verdict::Unexplained,
    }
}

impl Conclusion {
    /// Withdraws the effects, because free replays of the recordings of the fit are further off with them than without. There is a gap, but a model that does not follow the
    /// recordings says no more about its place than that it is in one of the subsystems.
    pub fn withdraw(&mut self, gaps: [f64; 2]) {
        self.taken_back = Some(TakenBack { effects: std::mem::take(&mut self.effects), gaps });
        self.verdict = Verdict::Unexplained;
        self.probability = 1.0 / Subsystem::ALL.len() as f64;
        let places: Vec<Subsystem> =
            self.unexplained_at.into_iter().chain(self.shares.iter().map(|s| s.0)).chain(self.or_at.drain(..)).collect();
        for place in places {
            match self.unexplained_at {
                None => self.unexplained_at = Some(place),
                Some(first) if first != place && !self.or_at.contains(&place) => self.or_at.push(place),
                Some(_) => {}
            }
        }
        self.shares = self.unexplained_at.map(|place| (place, 1.0)).into_iter().collect();
    }

    /// Records that a channel is mapped wrongly. What was concluded from the recordings as they are mapped does not apply to any car, and is removed.
    pub fn mistake(&mut self, mistaken: Mistaken) {
        (self.verdict, self.probability, self.mistake) = (Verdict::InputsDoNotFit, mistaken.probability, Some(mistaken.mistake));
        (self.effects, self.unexplained_at, self.shares, self.or_at) = (Vec::new(), None, Vec::new(), Vec::new());
    }

    /// Records that an irregular disturbance is left.
    pub fn add_irregular(&mut self, irregular: &Irregular) {
        let of = |e: &usize| REGISTRY[*e].effect.subsystem;
        if irregular.share > STAND_IN_SHARE {
            self.effects.retain(|e| !irregular.places.contains(&of(e)));
        }
        if self.verdict == Verdict::InputsDoNotFit {
            return;
        }
        self.irregular.push(irregular.what.clone());
        self.verdict = if self.effects.is_empty() { Verdict::Unexplained } else { Verdict::PartlyExplained };
        if self.effects.is_empty() && self.unexplained_at.is_none() {
            self.probability = irregular.probability;
        }
        // Of places that the recordings do not distinguish, the first one with a share of the gap is taken, or else the most likely one.
        let known = |s: &Subsystem| self.shares.iter().any(|(at, _)| at == s);
        let first = irregular.places.iter().copied().find(known).or(irregular.places.first().copied());
        let rest: Vec<Subsystem> = irregular.places.iter().copied().filter(|p| Some(*p) != first).collect();
        if self.unexplained_at.is_none() {
            self.unexplained_at = first;
            self.or_at.extend(rest);
            // Each place is listed once, even if it was doubted before for another reason.
            let mut seen: Vec<Subsystem> = first.into_iter().collect();
            self.or_at.retain(|place| {
                !seen.contains(place) && {
                    seen.push(*place);
                    true
                }
            });
        }
        if let Some(first) = first {
            self.shares.iter_mut().for_each(|(_, share)| *share *= 1.0 - irregular.share);
            match self.shares.iter_mut().find(|(at, _)| *at == first) {
                Some((_, share)) => *share += irregular.share,
                None => self.shares.push((first, irregular.share)),
            }
            self.shares.sort_by(|a, b| b.1.total_cmp(&a.1));
        }
    }
}

/// Subsystems other than those shown in which something may be wrong instead: with a total probability of more than [`NAMED_BESIDE`].
fn doubted(all: &[Explanation], shown: &[Subsystem]) -> Vec<Subsystem> {
    let mass = |s: Subsystem| -> f64 {
        let holds = |e: &&Explanation| e.place == Some(s) || e.effects.iter().any(|&k| REGISTRY[k].effect.subsystem == s);
        all.iter().filter(holds).map(|e| e.probability).sum()
    };
    Subsystem::ALL.into_iter().filter(|s| !shown.contains(s) && mass(*s) > NAMED_BESIDE).collect()
}

/// Whether a fit leaves larger innovations than those of any car of this kind.
pub fn leaves_too_much(problem: &Problem, fit: &Fit) -> bool {
    is_strange(fit.misfit() / problem.samples().max(1) as f64)
}

/// Whether innovations with this mean loss cannot be those of such a car.
fn is_strange(mean_loss: f64) -> bool {
    mean_loss > STRANGE
}

/// Whether an effect of engine or sensors, which may stand for another input, or of the vehicle mass, which may stand for another gear, is larger than in any car.
fn is_beyond_a_car(best: &Explanation) -> bool {
    let Some(fit) = &best.fit else { return false };
    let input = |e: &usize| {
        let entry = &REGISTRY[*e];
        matches!(entry.effect.subsystem, Subsystem::Engine | Subsystem::Sensors) || entry.id == "vehicle_mass"
    };
    best.effects.iter().filter(|e| input(e)).any(|&e| sizes(&fit.point, e) > BEYOND_A_CAR)
}

/// Cost of an explanation without the prior terms of its law and of the forms of its effects; infinite if it was not fitted.
fn cost(e: &Explanation) -> f64 {
    e.fit.as_ref().map_or(f64::INFINITY, without_functions)
}

/// Cost of a fit without the prior terms of the functions of laws and forms.
fn without_functions(fit: &Fit) -> f64 {
    fit.misfit() + prior(&fit.point)
}

/// Share of the gap that a missing law accounts for beside the effects. `gap` is the misfit of the car of the vehicle file.
fn law_share(gap: f64, search: &Search, best: &Explanation) -> f64 {
    let without = search.of(&best.effects).map_or(gap, |h| without_functions(&h.fit));
    share(gap, without, cost(best))
}

/// Share of a gap that a law accounts for, from the costs of the file's car, of the effects without the law, and of both together.
fn share(gap: f64, without: f64, both: f64) -> f64 {
    (without - both).max(0.0) / (gap - both).max(1e-9)
}

/// Share of each subsystem in the total reduction of the cost, largest first.
fn shares(search: &Search, posterior: &Posterior, best: &Explanation) -> Vec<(Subsystem, f64)> {
    let base = search.base().fit.cost;
    let full = cost(best);
    let known = |effects: &[usize], with_place: bool| -> f64 {
        let same = posterior
            .explanations
            .iter()
            .filter(|e| e.effects == effects && e.fit.is_some() && (e.place == if with_place { best.place } else { None }));
        same.map(cost).fold(base, f64::min)
    };
    // If the remaining effects were not fitted beside the law, or are cheaper without it, their cost without the law is used.
    let rest_of = |effects: &[usize]| known(effects, best.place.is_some()).min(known(effects, false));
    let mut shares: Vec<(Subsystem, f64)> = Vec::new();
    let mut add = |s: Subsystem, taken: f64| match shares.iter_mut().find(|(o, _)| *o == s) {
        Some((_, sum)) => *sum += taken.max(0.0),
        None => shares.push((s, taken.max(1e-9))),
    };
    for &e in &best.effects {
        let rest: Vec<usize> = best.effects.iter().copied().filter(|o| *o != e).collect();
        add(REGISTRY[e].effect.subsystem, rest_of(&rest) - full);
    }
    if let Some(place) = best.place {
        add(place, known(&best.effects, false) - full);
    }
    let total: f64 = shares.iter().map(|s| s.1).sum();
    shares.iter_mut().for_each(|s| s.1 /= total.max(f64::MIN_POSITIVE));
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    shares
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::find;
    use crate::gap::infer::density::size;
    use crate::gap::model::filter::Disturbances;
    use crate::gap::model::noise::Noise;
    use crate::gap::model::tolerance::Wander;

    fn none() -> Disturbances {
        let (noise, still) = (Noise { white: 1.0, coloured: 0.0, memory_s: 1.0 }, Wander { sigma: 0.0, time_s: 1.0 });
        Disturbances {
            noise: [noise; 5],
            report_noise: 0.0,
            report: still,
            load: still,
            clutch: still,
            bearing: still,
            sensors: [still; 2],
            late: [0.0; 2],
            skew: 0.0,
            stamps: 0.0,
        }
    }

    fn left(places: &[Subsystem], share: f64) -> Irregular {
        Irregular { places: places.to_vec(), what: String::new(), share, probability: 0.9, gain: 0.0, with: none() }
    }

    fn concluded(effects: &[&str]) -> Conclusion {
        let effects: Vec<usize> = effects.iter().map(|id| find(id).unwrap()).collect();
        let shares = effects.iter().map(|e| (REGISTRY[*e].effect.subsystem, 1.0 / effects.len() as f64)).collect();
        let explanation = Explanation { effects: effects.clone(), probability: 1.0, ..Explanation::default() };
        let verdict = if effects.is_empty() { Verdict::NoGap } else { Verdict::Explained };
        Conclusion {
            verdict,
            probability: 1.0,
            explanation,
            effects,
            unexplained_at: None,
            shares,
            or_at: Vec::new(),
            taken_back: None,
            irregular: Vec::new(),
            mistake: None,
        }
    }

    #[test]
    fn something_irregular_is_a_gap_of_its_own() {
        let mut c = concluded(&[]);
        c.add_irregular(&left(&[Subsystem::Sensors], 1.0));
        assert_eq!((c.verdict, c.unexplained_at, c.probability), (Verdict::Unexplained, Some(Subsystem::Sensors), 0.9));
        assert_eq!(c.shares, [(Subsystem::Sensors, 1.0)]);
    }

    /// All that remains is that there is a gap in one of seven subsystems; those of the effects come first.
    #[test]
    fn effects_that_mislead_are_taken_back() {
        let mut c = concluded(&["vehicle_mass", "friction_level", "engine_torque_lag"]);
        c.or_at = vec![Subsystem::Sensors, Subsystem::Friction];
        let named = c.effects.clone();
        c.withdraw([2.0, 9.0]);
        assert_eq!(c.taken_back, Some(TakenBack { effects: named, gaps: [2.0, 9.0] }));
        assert!(c.effects.is_empty() && c.verdict == Verdict::Unexplained && (c.probability - 1.0 / 7.0).abs() < 1e-12);
        assert_eq!(c.unexplained_at, Some(Subsystem::Driveline));
        assert_eq!(c.or_at, [Subsystem::Friction, Subsystem::Engine, Subsystem::Sensors]);
        assert_eq!(c.shares, [(Subsystem::Driveline, 1.0)]);
        let mut c = Conclusion { unexplained_at: Some(Subsystem::Sensors), ..concluded(&["vehicle_mass"]) };
        c.withdraw([2.0, 9.0]);
        assert_eq!((c.unexplained_at, c.or_at.as_slice()), (Some(Subsystem::Sensors), &[Subsystem::Driveline][..]));
    }

    #[test]
    fn an_effect_stands_in_for_something_irregular_of_its_subsystem_only_if_that_is_the_larger_part() {
        for (share, named) in [(0.4, &["engine_torque_gain", "vehicle_mass"][..]), (0.6, &["vehicle_mass"])] {
            let mut c = concluded(&["engine_torque_gain", "vehicle_mass"]);
            c.add_irregular(&left(&[Subsystem::Engine], share));
            assert_eq!((c.verdict, c.unexplained_at), (Verdict::PartlyExplained, Some(Subsystem::Engine)));
            assert_eq!(c.effects.iter().map(|e| REGISTRY[*e].id).collect::<Vec<_>>(), named);
            assert!((c.shares.iter().map(|s| s.1).sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn of_places_that_are_not_told_apart_the_one_with_an_effect_comes_first() {
        let mut c = concluded(&["actuator_delay"]);
        c.add_irregular(&left(&[Subsystem::Friction, Subsystem::ClutchForce, Subsystem::Actuator], 0.1));
        assert_eq!((c.unexplained_at, c.or_at), (Some(Subsystem::Actuator), vec![Subsystem::Friction, Subsystem::ClutchForce]));
        // A subsystem that was doubted before is not listed twice.
        let mut c = Conclusion { or_at: vec![Subsystem::ClutchForce, Subsystem::Thermal], ..concluded(&["actuator_delay"]) };
        c.add_irregular(&left(&[Subsystem::Friction, Subsystem::ClutchForce, Subsystem::Actuator], 0.1));
        assert_eq!(c.or_at, [Subsystem::ClutchForce, Subsystem::Thermal, Subsystem::Friction]);
    }

    #[test]
    fn a_verdict_says_whether_effects_explain_and_whether_anything_is_left() {
        for (effects, named, law, verdict) in [
            (false, false, false, Verdict::NoGap),
            (false, false, true, Verdict::Unexplained),
            (true, true, false, Verdict::Explained),
            (true, true, true, Verdict::PartlyExplained),
            (true, false, true, Verdict::Unexplained),
        ] {
            assert_eq!(verdict_of(effects, named, law), verdict);
        }
    }

    /// The bound on the mean loss lies between what unknown laws leave and ten times as much, which the inputs of another car leave. An input that is off by more than five usual
    /// faults is not what it is said to be.
    #[test]
    fn inputs_that_are_none_of_this_car_are_far_from_it() {
        assert!(!is_strange(59.0) && is_strange(61.0));
        let with = |id: &str, sizes: f64| {
            let mut c = concluded(&[id]);
            let mut fit = crate::gap::infer::fit::Fit::made_up(Vec::new());
            let k = REGISTRY[find(id).unwrap()].effect.amplitudes[0];
            fit.point.effects[k] += sizes * size(k);
            c.explanation.fit = Some(fit);
            is_beyond_a_car(&c.explanation)
        };
        for (id, input) in [
            ("engine_torque_gain", true),
            ("clutch_speed_gain", true),
            ("vehicle_mass", true),
            ("friction_level", false),
            ("road_load", false),
        ] {
            assert_eq!([with(id, 4.9), with(id, 5.1), with(id, -5.1)], [false, input, input], "{id}");
        }
        assert!(!is_beyond_a_car(&concluded(&["vehicle_mass"]).explanation));
    }

    #[test]
    fn a_law_takes_the_share_of_the_gap_that_effects_alone_leave() {
        assert!((share(100.0, 60.0, 20.0) - 0.5).abs() < 1e-12 && (share(100.0, 100.0, 20.0) - 1.0).abs() < 1e-12);
        // A law that increases the cost has a share of zero, and so has any law if there is no gap.
        assert_eq!([share(100.0, 15.0, 20.0), share(20.0, 20.0, 20.0)], [0.0; 2]);
    }

    /// The cost falls from 100 to 60 with the effects, of which 20 are the prior terms of their forms, and to 30 with a law, of which 10 are prior terms. Without prior terms, the
    /// law accounts for 20 of 80, a quarter.
    #[test]
    fn the_price_of_forms_is_no_part_of_what_a_law_takes() {
        use crate::gap::infer::search::{Hypothesis, Search};
        let fit = |cost: f64, misfit: f64| Fit { cost, misfits: [misfit, 0.0, 0.0], ..Fit::made_up(Vec::new()) };
        let best = Explanation { fit: Some(fit(30.0, 20.0)), ..concluded(&["vehicle_mass"]).explanation };
        let search = Search::made_up(vec![Hypothesis::made_up(&best.effects, fit(60.0, 40.0))]);
        assert!((law_share(100.0, &search, &best) - 0.25).abs() < 1e-12);
    }

    #[test]
    fn a_place_is_doubted_if_explanations_with_it_are_believed_together() {
        let with = |effects: &[&str], place: Option<Subsystem>, probability: f64| {
            let explanation = concluded(effects).explanation;
            Explanation { place, probability, ..explanation }
        };
        let all = [
            with(&["vehicle_mass"], None, 0.5),
            with(&["friction_level"], None, 0.03),
            with(&["vehicle_mass"], Some(Subsystem::Friction), 0.03),
            with(&["engine_torque_gain"], None, 0.04),
            with(&[], Some(Subsystem::Sensors), 0.06),
        ];
        assert_eq!(doubted(&all, &[Subsystem::Driveline]), [Subsystem::Friction, Subsystem::Sensors]);
        assert_eq!(doubted(&all, &[Subsystem::Friction, Subsystem::Sensors]), [Subsystem::Driveline]);
    }
    /// The cost is 90 without effects, and 10 with all three: it is 30 without the first, 20 without the second, and 60 without the third, which is of another subsystem.
    #[test]
    fn effects_of_one_subsystem_share_what_each_of_them_takes() {
        use crate::gap::infer::fit::Fit;
        use crate::gap::infer::search::{Hypothesis, Search};
        let [level, fade, mass] = ["friction_level", "friction_fade", "vehicle_mass"].map(|id| find(id).unwrap());
        let fit = |cost: usize| Fit { cost: cost as f64, misfits: [cost as f64, 0.0, 0.0], ..Fit::made_up(Vec::new()) };
        let of =
            |effects: &[usize], cost: usize| Explanation { effects: effects.to_vec(), fit: Some(fit(cost)), ..concluded(&[]).explanation };
        let ordered = |mut effects: Vec<usize>| {
            effects.sort_unstable();
            effects
        };
        let best = of(&ordered(vec![level, fade, mass]), 10);
        let without = [(vec![fade, mass], 30), (vec![level, mass], 20), (vec![level, fade], 60)];
        let mut explanations: Vec<Explanation> = without.into_iter().map(|(rest, cost)| of(&ordered(rest), cost)).collect();
        explanations.push(best.clone());
        let search = Search::made_up(vec![Hypothesis::made_up(&[], fit(90))]);
        let found = shares(&search, &Posterior { explanations, beyond: 0.0, base_misfit: 90.0 }, &best);
        assert_eq!(found, [(Subsystem::Driveline, 50.0 / 80.0), (Subsystem::Friction, 30.0 / 80.0)]);
    }
}
