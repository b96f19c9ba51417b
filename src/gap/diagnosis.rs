//! The diagnosis of one campaign: where the gap lies, which effects cause it, how far it closes, and what stays in doubt.

use super::answer::Answer;
use super::compose::{self, Findings};
use super::divide::divided;
use super::domain::{self, RetunedPlant};
use super::drive::{self, Drive};
use super::empirical::{self, Tried};
use super::enough::{MOST_SAMPLES, enough_of};
use super::free::{Car, prepare};
use super::held_out::{Split, split};
use super::infer::density::{Point, Problem};
use super::infer::exchange::exchange;
use super::infer::fit::Fit;
use super::infer::irregular::irregular;
use super::infer::posterior::{Posterior, posterior};
use super::infer::search::{Search, search};
use super::infer::sensors;
use super::infer::strained::Strained;
use super::map;
use super::measure::{self, Closed, Overlay};
use super::mistaken::mistaken;
use super::model::filter::Disturbances;
use super::model::prepare;
use super::model::tolerance::ToleranceError;
use super::model::track::Track;
use super::notes;
use super::plan::manoeuvre::{Manoeuvre, built_in};
use super::plan::{Outlook, Planner, outlook};
use super::progress::{Watch, Work, watched};
use super::ready::{Read, Ready, WithoutStaleSamples, commanded_every, read_with_control_unit, read_without_stale};
use super::retune::{self, Followed};
use super::verdict::{Conclusion, MISLED, Verdict, conclude, leaves_too_much};
use crate::campaign::{Campaign, NO_POSITION, Note, Recording};
use crate::effects::{self, Parameters, REGISTRY, Subsystem};
use crate::validated::Validated;
use crate::vehicle::{Vehicle, VehicleError};
use rayon::prelude::*;

/// Why a campaign cannot be diagnosed.
#[derive(Debug, thiserror::Error)]
pub enum DiagnosisError {
    /// The vehicle file is invalid.
    #[error("vehicle.json: {0}")]
    Vehicle(#[from] VehicleError),
    /// The tolerances of the vehicle file are invalid.
    #[error("vehicle.json: {0}")]
    Tolerance(#[from] ToleranceError),
    /// There are too few recordings to hold one out.
    #[error(
        "the campaign has {} usable recording{}; at least 2 are needed, or a drive with two engagements, so that one can be held out to judge the fit",
        .0,
        if *.0 == 1 { "" } else { "s" }
    )]
    TooFew(usize),
}

/// The answer, and what the report shows beside it.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The answer.
    pub answer: Answer,
    /// The answer as diagnosis.json has it.
    pub json: serde_json::Value,
    /// The campaign as it was read: without stale samples, if it is long without the recordings that are not fitted, and with the interval of the control unit that suits it.
    pub read: Campaign,
    /// The held-out data as a recording of their own: for a drive its last engagement, which begins at the temperatures that the retuned car has there.
    pub held_out: Recording,
    /// Measured curves with those of the nominal and the retuned plant, by recording or engagement.
    pub overlays: Vec<Overlay>,
    /// The drives among the recordings.
    pub drives: Vec<Drive>,
    /// The retuned car.
    pub vehicle: Vehicle,
    /// Effects of the retuned car, including the values of a learned law that was taken.
    pub effects: Parameters,
    /// Where the retuned car was validated, and how well its clutch torque is known.
    pub validated: Validated,
    /// The car as its file gives it.
    pub nominal: Vehicle,
    /// Open questions, and the measurements that could settle them.
    pub outlook: Outlook,
    /// The law that was learned for what the library does not explain, whether it was taken or not.
    pub learned: Option<Tried>,
}

/// Diagnoses a campaign. `progress` is called ten times a second with the current stage and with the share of the whole diagnosis that is done.
///
/// # Errors
/// An invalid vehicle file or invalid tolerances; too few recordings.
pub fn diagnose(campaign: &Campaign, progress: &(dyn Fn(&str, f64) + Sync)) -> Result<Diagnosis, DiagnosisError> {
    diagnose_with(campaign, None, progress)
}

/// As [`diagnose`], if these manoeuvres and no others can be driven. Limits of detection with each of them are then always computed.
///
/// # Errors
/// As [`diagnose`].
pub fn diagnose_with(
    campaign: &Campaign,
    manoeuvres: Option<Vec<Manoeuvre>>,
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<Diagnosis, DiagnosisError> {
    of_samples(MOST_SAMPLES, campaign, manoeuvres, progress)
}

/// As [`diagnose_with`], with at most `most` samples in the fit.
pub(super) fn of_samples(
    most: usize,
    campaign: &Campaign,
    manoeuvres: Option<Vec<Manoeuvre>>,
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<Diagnosis, DiagnosisError> {
    let vehicle = Vehicle::from_value(&campaign.vehicle_json)?;
    let campaign = &*divided(campaign)?;
    let found = judged_by(None, most, campaign, &vehicle, manoeuvres.clone(), progress)?;
    // A gap that only the held-out recording shows cannot be found in the others, and it would be wrong to call the car healthy.
    let Some((judge, other)) = doubtful(&found, campaign) else { return Ok(found) };
    let mut again = judged_by(Some(other), most, campaign, &vehicle, manoeuvres, progress)?;
    if again.answer.verdict == Verdict::NoGap {
        return Ok(found);
    }
    again.answer.notes.push(notes::judge_changed(judge, other));
    Ok(again)
}

/// Gap on the held-out data of a car without a gap, relative to what the true car would leave there, above which it is also looked for with these data in the fit.
const BEYOND_ITS_FLOOR: f64 = 1.5;

/// Of an answer that finds no gap although the held-out recording is off by more than the true car would be: this recording, and one that can judge instead.
fn doubtful<'a>(found: &Diagnosis, campaign: &'a Campaign) -> Option<(&'a str, &'a str)> {
    let far = &found.answer.how_far;
    if found.answer.verdict != Verdict::NoGap || far.after.0 <= BEYOND_ITS_FLOOR * far.noise_floor.0 {
        return None;
    }
    let name = |k: usize| campaign.recordings[k].name.as_str();
    let judge = name(split(&campaign.recordings, None).judge);
    let others: Vec<Recording> = campaign.recordings.iter().filter(|r| r.name != judge).cloned().collect();
    // Two that remain: one to fit beside the first, and one to judge.
    (others.len() >= 2).then(|| split(&others, None).judge).and_then(|k| {
        let other = campaign.recordings.iter().find(|r| r.name == others[k].name)?;
        Some((judge, other.name.as_str()))
    })
}

/// The diagnosis with the recording of this name held out, or with the one that [`split`] chooses.
fn judged_by(
    judge: Option<&str>,
    most: usize,
    campaign: &Campaign,
    vehicle: &Vehicle,
    manoeuvres: Option<Vec<Manoeuvre>>,
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<Diagnosis, DiagnosisError> {
    progress("noise and tolerances", 0.0);
    let work = Work::default();
    let mut ready = Ready::judged_by(judge, campaign, vehicle, &work)?;
    let part = enough_of(campaign, &ready, most);
    if let Some((part, _)) = &part {
        ready = ready.of(campaign, part, vehicle)?;
    }
    let (campaign, note) = part.as_ref().map_or((campaign, None), |(part, note)| (part, Some(note.clone())));
    let rows = ready.problem.tracks.iter().map(Track::rows).sum();
    watched(progress, &work, rows, |watch| diagnosed(campaign, *vehicle, ready, note, manoeuvres, watch))
}

fn diagnosed(
    campaign: &Campaign,
    vehicle: Vehicle,
    ready: Ready,
    note: Option<String>,
    manoeuvres: Option<Vec<Manoeuvre>>,
    watch: &Watch,
) -> Result<Diagnosis, DiagnosisError> {
    let work = ready.problem.work.clone();
    let searched = |problem: &Problem, earlier: Option<&Search>| search(problem, earlier, &|what, _| watch.begin(what));
    let WithoutStaleSamples { campaign, ready, found, stale } = read_without_stale(campaign, &vehicle, ready, &searched)?;
    let Read { ready, mut found, control_interval_s } = read_with_control_unit(&campaign, &vehicle, ready, found, &searched)?;
    let read = control_interval_s.map_or(campaign.clone(), |s| commanded_every(&campaign, s));
    let campaign = &read;
    let mistake = mistaken(campaign, &vehicle, &ready, &found, &searched)?;
    let Ready { split, mut problem, tolerances, with } = ready;
    let known = |n: &&Note| n.text != NO_POSITION;
    let mut notes: Vec<String> = campaign.notes.iter().filter(known).map(|n| format!("{}: {}", n.recording, n.text)).collect();
    notes.extend(note);
    notes.extend(notes::position(campaign));
    notes.extend(control_interval_s.map(notes::control_unit));
    let refiltered = |problem: Problem, with: &Disturbances, found: &mut Search| {
        let problem = Problem { work: work.clone(), ..prepare::problem(problem.tracks, &vehicle, &tolerances, with) };
        found.let_go_of_all();
        *found = searched(&problem, Some(found));
        problem
    };
    // The delays and the noise of the sensors that the first search found improve the filter of the second.
    let late = sensors::late(&problem.car(&found.best().fit.point, None).effects);
    let known = Disturbances { late, ..with };
    let mut filtered_by = with;
    let best = found.best().whole(&problem);
    let coloured = sensors::refined(&problem, &best.fit.point, &best.fit.residuals, &known);
    let locks_by_position = problem.tracks.iter().any(|t| !t.position_free);
    if coloured.is_some() || locks_by_position && sensors::sees_the_lock_late(late, prepare::logger(&problem.tracks).interval_s) {
        notes.extend(coloured.as_ref().map(notes::correlated_noise));
        filtered_by = coloured.unwrap_or(known);
        problem = refiltered(problem, &filtered_by, &mut found);
    }
    // What an explanation leaves may be an irregular disturbance. Search and posterior are then repeated with this disturbance in the filter. If the best set strains its
    // tolerances, the disturbance is looked for before more work goes into the set.
    let mut before = strained(&problem, &found, watch);
    let is_one_of_them = |problem: &Problem, found: &Search| !leaves_too_much(problem, &found.best().fit);
    let mut left = is_one_of_them(&problem, &found).then(|| before.irregular(&problem, &found, &filtered_by)).flatten();
    if let Some(left) = &left {
        filtered_by = left.with;
        problem = refiltered(problem, &filtered_by, &mut found);
        before = strained(&problem, &found, watch);
    }
    let mut weights = weighed(&problem, &mut found, before, watch);
    let mut conclusion = conclude(&problem, &found, &weights);
    // An explanation that is a law alone already says that something is open, and says more about it than a disturbance, which has only a size.
    let law_alone = conclusion.explanation.effects.is_empty() && conclusion.explanation.place.is_some();
    if left.is_none() && conclusion.verdict != Verdict::InputsDoNotFit && !law_alone {
        let fit = fitted_whole(&problem, &found, &conclusion);
        left = irregular(&problem, &fit.point, &fit.residuals, &filtered_by);
        if let Some(left) = &left {
            filtered_by = left.with;
            problem = refiltered(problem, &filtered_by, &mut found);
            let before = strained(&problem, &found, watch);
            weights = weighed(&problem, &mut found, before, watch);
            conclusion = conclude(&problem, &found, &weights);
        }
    }
    if let Some(left) = &left {
        conclusion.add_irregular(left);
        notes.push(format!("whatever else is wrong, something irregular is left: {}; it is allowed for", left.what));
    }
    notes.extend(work.was_cut_short().then(notes::cut_short));
    for left in &stale {
        let at_fault = left.probability > 0.5;
        let few = if at_fault { "" } else { ", as few as a logger may lose" };
        notes.push(format!("stale samples: {}; they are left out{few}", left.what));
        if at_fault {
            conclusion.add_irregular(left);
        }
    }
    let point = &conclusion.explanation.fit.as_ref().expect("the best was fitted").point.clone();
    mistake.into_iter().for_each(|m| conclusion.mistake(m));
    notes.extend(notes::temperatures(&problem, point));
    let misled = || misled(&problem, &split.fitted_part, &vehicle, &tuned_by(&found, &conclusion, point));
    let named = matches!(conclusion.verdict, Verdict::Explained | Verdict::PartlyExplained);
    if let Some(gaps) = named.then(misled).flatten() {
        conclusion.withdraw(gaps);
    }
    // With such a verdict nothing is retuned, because the tolerances were fitted beside a law without a formula: the car is handed back as its file gives it.
    let retuned = !matches!(conclusion.verdict, Verdict::Unexplained | Verdict::InputsDoNotFit);
    let near = fitted_alone(&found, &conclusion).or(conclusion.explanation.fit.as_ref());
    let declared: Vec<_> = tolerances.own.iter().filter(|n| n.declared).cloned().collect();
    let mode = tuned_by(&found, &conclusion, point);
    let by_mode = problem.car(&mode, None);
    let floor_of = |r: &Recording| measure::floor(r, (&by_mode.vehicle, &by_mode.effects), &declared, tolerances.declared_report, false);
    let asked = !matches!(conclusion.verdict, Verdict::NoGap | Verdict::InputsDoNotFit);
    let floors: Vec<f64> = if asked { split.fitted_part.par_iter().map(floor_of).collect() } else { Vec::new() };
    let followed = Followed { recordings: &split.fitted_part, floors: &floors };
    let with_position = problem.tracks.iter().all(|t| !t.position_free);
    let names = retuned && mode.effects != effects::null();
    let alone = &near.filter(|_| names && with_position).map_or(mode.clone(), |fit| retune::retuned(&problem, fit, &mode, followed));
    let tuned = if retuned { problem.car(alone, None) } else { super::model::tolerance::Car::nominal(&vehicle) };
    let null = effects::null();
    let (before, after) = ((&vehicle, &null), (&tuned.vehicle, &tuned.effects));
    let judge = &campaign.recordings[split.judge];
    let held_out = measure::evaluate_part(judge, before, after, split.last_engagement);
    let floor = measure::floor(judge, after, &declared, tolerances.declared_report, split.last_engagement);
    watch.begin("a law beyond the library");
    let judge = empirical::Judge {
        fitted_part: followed,
        held_out: judge,
        last_engagement: split.last_engagement,
        floor,
        nominal: &vehicle,
        tuned: after,
    };
    let learned = empirical::learn_law(&problem, &conclusion, alone, near, &judge);
    // Nothing is fitted from here on, so that innovations and derivatives can be released.
    found.let_go_of_all();
    let explanations = weights.explanations.iter_mut().chain([&mut conclusion.explanation]);
    explanations.filter_map(|e| e.fit.as_mut()).for_each(Fit::let_go);
    let taken = learned.as_ref().filter(|l| l.refused.is_none());
    let handed = taken.map_or(after, |l| (&l.vehicle, &l.effects));
    watch.begin("where it was validated");
    let nominal = problem.nominal();
    let from = taken.map_or(if retuned { alone } else { &nominal }, |l| &l.learned.fit.point);
    let follows = retuned || taken.is_some();
    let of_clutch = [Subsystem::Actuator, Subsystem::ClutchForce, Subsystem::Friction, Subsystem::Thermal];
    let lacks_clutch_law = taken.is_none() && conclusion.unexplained_at.is_some_and(|place| of_clutch.contains(&place));
    let handed_out = RetunedPlant { point: from, learned: taken.map(|l| &l.learned), follows, lacks_clutch_law };
    let validated = domain::validated(&problem, &weights, &handed_out);
    watch.begin("residual map");
    let [cells, cells_after] = cells(&problem, &conclusion);
    watch.begin("what to measure next");
    let whole = manoeuvres.is_some();
    let planner = Planner::after(&problem, &filtered_by, manoeuvres.unwrap_or_else(|| built_in(&vehicle)));
    // The outlook is computed at the fitted tolerances, without effects.
    let without = Point { effects: effects::null(), ..found.best().fit.point.clone() };
    let outlook = outlook(planner, &problem, &weights, &without, whole);
    let answer = compose::answer(&Findings {
        campaign,
        problem: &problem,
        search: &found,
        posterior: &weights,
        conclusion: &conclusion,
        cells: &cells,
        cells_after: &cells_after,
        outlook: &outlook,
        held_out: &held_out,
        held_out_name: split.name.clone(),
        floor,
        retuned: handed,
        validated: &validated,
        learned: learned.as_ref(),
        notes,
    });
    let json = serde_json::to_value(&answer).expect("an answer is plain data");
    let overlays = overlays(campaign, &split, &problem, point, before, handed);
    let drives = drives(campaign, &split, &problem);
    let held_out = judged(&campaign.recordings[split.judge], split.last_engagement, &vehicle, handed);
    let (handed, effects) = (*handed.0, *handed.1);
    Ok(Diagnosis {
        answer,
        json,
        read,
        held_out,
        overlays,
        drives,
        vehicle: handed,
        effects,
        validated,
        nominal: vehicle,
        outlook,
        learned,
    })
}

/// The fit of the explanation that stands, with its innovations. If these were released, its set of effects is fitted again.
fn fitted_whole(problem: &Problem, found: &Search, conclusion: &Conclusion) -> Fit {
    let fit = conclusion.explanation.fit.clone().expect("the best was fitted");
    let anew = || found.of(&conclusion.explanation.effects).map(|h| h.whole(problem).fit);
    if fit.residuals.is_empty() { anew().unwrap_or(fit) } else { fit }
}

/// Missing laws beside the best set, if it strains its tolerances; needed before members are exchanged.
fn strained(problem: &Problem, found: &Search, watch: &Watch) -> Strained {
    watch.begin("exchange");
    Strained::new(problem, found)
}

/// The posterior over the sets of the search, with members exchanged, and over missing laws.
fn weighed(problem: &Problem, found: &mut Search, strained: Strained, watch: &Watch) -> Posterior {
    // If the best set strains its tolerances and is far behind a missing law, an exchange is not worth the work.
    if !strained.is_far_ahead(found) {
        exchange(problem, found);
    }
    watch.begin("missing laws");
    posterior(problem, found, strained)
}

/// The fit of the named effects without a missing law, from which the FMU gets its numbers, because the FMU does not contain the law either. None if this fit strains its
/// tolerances and no named effect belongs to the law's subsystem: then the FMU gets the numbers that were fitted beside the law. Within one subsystem, law and effect may
/// compensate each other.
fn fitted_alone<'a>(found: &'a Search, conclusion: &Conclusion) -> Option<&'a Fit> {
    let apart = conclusion.unexplained_at.is_some_and(|at| conclusion.effects.iter().all(|&e| REGISTRY[e].effect.subsystem != at));
    found.of(&conclusion.effects).map(|h| &h.fit).filter(|f| !(apart && f.strains()))
}

/// The estimates with which the car is retuned: those fitted without a missing law, or else those beside the law.
fn tuned_by(found: &Search, conclusion: &Conclusion, point: &Point) -> Point {
    fitted_alone(found, conclusion).map_or_else(|| beside_law(conclusion, point), |f| f.point.clone())
}

/// Mean gap of both speeds in free replays of the recordings of the fit, rad/s, with the car of the file and with the named effects, if the latter is more than [`MISLED`] times
/// the former. None without effects, or if no recording has a position.
fn misled(problem: &Problem, fitted_part: &[Recording], vehicle: &Vehicle, tuned: &Point) -> Option<[f64; 2]> {
    if tuned.effects == effects::null() || problem.tracks.iter().all(|t| t.position_free) {
        return None;
    }
    let (car, null) = (problem.car(tuned, None), effects::null());
    let one = |r: &Recording| Closed::of(&measure::evaluate(r, (vehicle, &null), (&car.vehicle, &car.effects)));
    let gaps: Vec<Closed> = fitted_part.par_iter().map(one).collect();
    let mean = |of: fn(&Closed) -> f64| gaps.iter().map(of).sum::<f64>() / gaps.len().max(1) as f64;
    let (before, after) = (mean(|c| c.before), mean(|c| c.after));
    (after > MISLED * before).then_some([before, after])
}

/// The point that was fitted beside a law, without the law and without the effects that only stood in for it.
fn beside_law(conclusion: &Conclusion, point: &Point) -> Point {
    let stood_in = conclusion.explanation.effects.iter().filter(|e| !conclusion.effects.contains(e));
    stood_in.fold(Point { missing: Vec::new(), ..point.clone() }, |beside, e| beside.without(*e))
}

/// The residual maps without any effect and with the effects, both at the tolerances of the conclusion. Tolerances that were fitted without effects would have moved towards the
/// gap and hidden it.
fn cells(problem: &Problem, conclusion: &Conclusion) -> [Vec<map::Cell>; 2] {
    let last = &conclusion.explanation.fit.as_ref().expect("the best was fitted").point;
    let strip = |p: &Point| Point { missing: Vec::new(), ..p.clone() };
    let without = Point { effects: effects::null(), ..strip(last) };
    [map::cells(problem, &without, &strip(last)), map::cells(problem, &strip(last), &strip(last))]
}

fn overlays(campaign: &Campaign, split: &Split, problem: &Problem, point: &Point, before: Car, after: Car) -> Vec<Overlay> {
    let of = |k: usize, r: &Recording| {
        let held_out = |engagement: usize, count: usize| is_held_out(split, k, engagement, count);
        let place = problem.tracks.iter().position(|t| t.name == r.name);
        let theta = place.map_or([r.theta_c0, r.theta_b0], |k| problem.temperatures(point, k));
        measure::overlays(r, held_out, before, after, theta)
    };
    campaign.recordings.iter().enumerate().flat_map(|(k, r)| of(k, r)).collect()
}

/// Whether engagement number `engagement` of `count` in recording `k` was held out.
fn is_held_out(split: &Split, k: usize, engagement: usize, count: usize) -> bool {
    k == split.judge && (!split.last_engagement || engagement + 1 == count)
}

/// The held-out data as a recording of their own.
fn judged(r: &Recording, last_engagement: bool, vehicle: &Vehicle, after: Car) -> Recording {
    let prepared = prepare(r, vehicle);
    let Some(rows) = prepared.stretches.last().filter(|_| last_engagement) else { return r.clone() };
    let ([theta_c0, theta_b0], slip_angle_0) = prepared.along(after, [r.theta_c0, r.theta_b0])[rows.start];
    let (name, manoeuvre) = (measure::name_of_engagement(r, rows.start), "engagement".to_owned());
    Recording { name, manoeuvre, theta_c0, theta_b0, slip_angle_0, ..r.part(rows.clone()) }
}

fn drives(campaign: &Campaign, split: &Split, problem: &Problem) -> Vec<Drive> {
    let of = |(k, r): (usize, &Recording)| {
        let fitted = problem.tracks.iter().zip(&problem.filters).find(|(t, _)| t.name == r.name);
        let held_out = |engagement: usize, count: usize| is_held_out(split, k, engagement, count);
        drive::drive(r, held_out, fitted.map(|(track, filter)| (track, filter.phase.as_slice())))
    };
    campaign.recordings.iter().enumerate().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gap::infer::posterior::Explanation;
    use crate::gap::infer::search::Hypothesis;
    use crate::gap::model::prepare::Example;

    fn example() -> Problem {
        let Example { campaign, vehicle } = Example::read();
        Ready::judged_by(None, &campaign, &vehicle, &Work::default()).unwrap().problem
    }

    /// The bundled campaign has a contact point that moves with temperature. If a vehicle mass has been added to it, the exchange removes the mass before the posterior is
    /// computed.
    #[test]
    fn members_of_the_best_set_are_exchanged_before_it_is_weighed() {
        let (problem, work) = (example(), Work::default());
        let mut pair = ["kiss_point_thermal", "vehicle_mass"].map(|id| effects::find(id).unwrap()).to_vec();
        pair.sort_unstable();
        let fitted = |set: Vec<usize>| Hypothesis::fitted(&problem, set, &problem.nominal(), 12, None);
        let mut found = search(&problem, None, &|_, _| {});
        found.hypotheses.retain(|h| h.effects.is_empty());
        found.hypotheses.insert(0, fitted(pair));
        let weights = watched(&|_, _| {}, &work, 1, |watch| weighed(&problem, &mut found, Strained::default(), watch));
        assert_eq!(weights.best().effects, [effects::find("kiss_point_thermal").unwrap()]);
    }

    /// If the innovations of an explanation were released, those of the same explanation are used, fitted again from its point.
    #[test]
    fn innovations_that_were_let_go_come_again() {
        let problem = example();
        let moves = effects::find("kiss_point_thermal").unwrap();
        let fitted = |set: Vec<usize>| Hypothesis::fitted(&problem, set, &problem.nominal(), 12, None);
        let mut found = Search::made_up(vec![fitted(vec![moves]), fitted(Vec::new())]);
        let of = |fit: &Fit| Explanation { effects: vec![moves], probability: 1.0, fit: Some(fit.clone()), ..Explanation::default() };
        let fit = found.best().fit.clone();
        let mut conclusion = Conclusion {
            verdict: Verdict::Explained,
            probability: 1.0,
            explanation: of(&fit),
            effects: vec![moves],
            unexplained_at: None,
            shares: Vec::new(),
            or_at: Vec::new(),
            taken_back: None,
            irregular: Vec::new(),
            mistake: None,
        };
        assert_eq!(fitted_whole(&problem, &found, &conclusion).residuals, fit.residuals);
        found.let_go_of_all();
        conclusion.explanation = of(&found.best().fit);
        let again = fitted_whole(&problem, &found, &conclusion);
        assert!(found.best().fit.residuals.is_empty() && again.residuals.len() == problem.tracks.len());
        assert!((again.misfit() / fit.misfit() - 1.0).abs() < 1e-3, "{} {}", again.misfit(), fit.misfit());
    }

    /// A car with half of the friction is further off than the car of the file; a car with the whole friction is not.
    #[test]
    fn effects_whose_car_follows_worse_than_the_file_s_are_told() {
        let Example { campaign, vehicle } = Example::read();
        let Ready { problem, split, .. } = Ready::judged_by(None, &campaign, &vehicle, &Work::default()).unwrap();
        let with = |factor: f64| {
            let mut point = problem.nominal();
            point.effects[crate::effects::param::friction_level::factor] = factor;
            misled(&problem, &split.fitted_part, &vehicle, &point)
        };
        assert_eq!([with(1.0), with(1.001)], [None; 2]);
        let [before, after] = with(0.5).unwrap();
        assert!(before > 1.0 && after > MISLED * before, "{before} {after}");
    }
}
