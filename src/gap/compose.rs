//! Composes the answer from the findings of a diagnosis.

use super::advice;
use super::answer::{
    Answer, Correlation, Domain, Effect, Empirical, EmpiricalCurve, Equation, Figures, HowFar, Interval, LeftOut, NotAssessable,
    PerRecording, Plant, Ranked, Real, Share, TakenBack, Visible, Weighed, Where, Which, plant_parameters,
};
use super::empirical::{Refusal, Tried};
use super::infer::coordinate::Coordinate;
use super::infer::density::{Problem, size, sizes};
use super::infer::fit::Fit;
use super::infer::posterior::{Explanation, Posterior};
use super::infer::prior::log_prior;
use super::infer::search::Search;
use super::map::{Cell, FAMILY_WISE_ERROR};
use super::measure::{Closed, Engagement, HeldOut};
use super::model::track::Channel;
use super::model::unknown_clutch::HIDDEN;
use super::plan::Outlook;
use super::plan::reach::Reach;
use super::prose::{listed, percent, three_digits};
use super::sentence::sentence;
use super::verdict::{Conclusion, NAMED_BESIDE, Verdict};
use crate::campaign::Campaign;
use crate::effects::{self, PARAMETERS, Parameters, REGISTRY, Subsystem};
use crate::validated::Validated;
use crate::vehicle::Vehicle;
use std::collections::BTreeMap;

/// Findings of a diagnosis from which the answer is composed.
pub struct Findings<'a> {
    /// The campaign that was read.
    pub campaign: &'a Campaign,
    /// The problem that was fitted.
    pub problem: &'a Problem,
    /// The search with the sets of effects that were fitted.
    pub search: &'a Search,
    /// The posterior over these sets and over missing laws.
    pub posterior: &'a Posterior,
    /// The conclusion: the verdict and what belongs to it.
    pub conclusion: &'a Conclusion,
    /// Residual map without effects.
    pub cells: &'a [Cell],
    /// Residual map with the effects.
    pub cells_after: &'a [Cell],
    /// Open questions, and the measurements that could settle them.
    pub outlook: &'a Outlook,
    /// Gaps on the held-out data, before and after retuning, by channel.
    pub held_out: &'a [HeldOut],
    /// Name of the held-out data.
    pub held_out_name: String,
    /// Gap that the true car would be expected to leave on the held-out data, rad/s.
    pub floor: f64,
    /// The retuned car.
    pub retuned: (&'a Vehicle, &'a Parameters),
    /// Where the retuned car was validated, and how well its clutch torque is known.
    pub validated: &'a Validated,
    /// The law that was learned for what the library does not explain, whether it was taken or not.
    pub learned: Option<&'a Tried>,
    /// Notes for the reader of the answer.
    pub notes: Vec<String>,
}

/// Half width of a 95 % interval in standard deviations.
const INTERVAL: f64 = 1.96;
/// Maximum number of explanations that are listed.
const LISTED: usize = 12;

/// The whole answer.
pub fn answer(f: &Findings) -> Answer {
    let closed = Closed { noise: f.floor, ..Closed::of(f.held_out) };
    let of_law = f.learned.map(|l| law_note(&l.laws, l.refused.is_none(), &reason(f, l)));
    Answer {
        schema: "kisspoint-diagnosis/1",
        verdict: f.conclusion.verdict,
        confidence: Real(f.conclusion.probability),
        sentence: sentence(f, closed.fraction()),
        notes: f.notes.iter().cloned().chain(below_floor(f, &closed)).chain(of_law).collect(),
        left_out: f.campaign.left_out.iter().map(|l| LeftOut { recording: l.recording.clone(), reason: l.reason.clone() }).collect(),
        place: place(f),
        which: which(f),
        how_far: how_far(f, closed),
        plant: Plant {
            parameters: plant_parameters(f.retuned.0, f.retuned.1),
            nominal_parameters: plant_parameters(&f.problem.vehicle, &effects::null()),
        },
        joint: super::joint::joint(f.problem, f.conclusion),
        domain: Domain::of(f.validated),
        measure_next: advice::measure_next(f.outlook),
        hidden_without_position: HIDDEN.iter().filter(|_| position_free(f)).map(|s| s.id()).collect(),
    }
}

/// Note that the held-out gap is no larger than what the unknowns of the recording may cause; none if it is larger, or if no effects are named.
fn below_floor(f: &Findings, closed: &Closed) -> Option<String> {
    (names_effects(f) && closed.is_below_floor()).then(|| {
        format!(
            "the gap of {} ({:.2} rad/s) is below the floor of {:.2} rad/s that its start temperatures, grade and torque report leave: the share that is closed counts from the sensors' noise",
            f.held_out_name, closed.before, closed.noise
        )
    })
}

fn names_effects(f: &Findings) -> bool {
    matches!(f.conclusion.verdict, Verdict::Explained | Verdict::PartlyExplained)
}

/// Effects that are named, those of the subsystem with the largest share of the gap first.
pub(super) fn named(f: &Findings) -> Vec<usize> {
    if !names_effects(f) {
        return Vec::new();
    }
    let share = |e: usize| f.conclusion.shares.iter().find(|s| s.0 == REGISTRY[e].effect.subsystem).map_or(0.0, |s| s.1);
    let mut all = f.conclusion.effects.clone();
    all.sort_by(|a, b| share(*b).total_cmp(&share(*a)));
    all
}

fn place(f: &Findings) -> Where {
    let c = f.conclusion;
    let primary = match c.verdict {
        Verdict::NoGap | Verdict::InputsDoNotFit => None,
        _ => c.shares.first().map(|s| s.0.id()),
    };
    Where {
        primary,
        subsystems: c.shares.iter().map(|(s, share)| Share { id: s.id(), share: Real(*share) }).collect(),
        equations: f.cells.iter().map(equation).collect(),
        equations_after: f.cells_after.iter().map(equation).collect(),
        family_wise_error: Real(FAMILY_WISE_ERROR),
        unexplained_at: c.unexplained_at.map(Subsystem::id),
        ambiguous_with: c.or_at.iter().map(|s| s.id()).collect(),
        irregular: c.irregular.clone(),
        missing_law: Subsystem::ALL.iter().map(|s| (s.id(), Real(f.posterior.of_place(*s)))).collect(),
    }
}

fn equation(c: &Cell) -> Equation {
    Equation {
        equation: c.equation,
        phase: c.phase,
        region: c.region,
        sigma: Real(c.sigma),
        rms: Real(c.rms),
        unit: c.unit,
        samples: c.samples,
        significant: c.significant,
    }
}

/// Smallest magnitude of a correlation that is listed, and the maximum number of correlations: the strongest are kept.
const CORRELATED: f64 = 0.3;
const CORRELATIONS: usize = 12;

/// Correlations of each parameter of a named effect with every other unknown that all recordings share.
fn correlations(f: &Findings) -> Vec<Correlation> {
    let fit = f.conclusion.explanation.fit.as_ref().expect("the best was fitted");
    let Some(covariance) = fit.covariance() else { return Vec::new() };
    let named: Vec<usize> = named(f).into_iter().flat_map(|e| REGISTRY[e].parameters.clone()).collect();
    let name = |c: &Coordinate| match c {
        Coordinate::Effect(k) => Some(PARAMETERS[*k].variable.to_owned()),
        Coordinate::Shared(k) => Some(f.problem.shared[*k].name.clone()),
        _ => None,
    };
    let mut all = Vec::new();
    for (i, a) in fit.shared.iter().enumerate() {
        let Coordinate::Effect(k) = a else { continue };
        // Each pair of parameters once.
        let others = fit.shared.iter().enumerate().filter(|(j, b)| !matches!(b, Coordinate::Effect(_)) || *j > i);
        for (j, b) in others.filter(|_| named.contains(k)) {
            let r = covariance[(i, j)] / (covariance[(i, i)] * covariance[(j, j)]).sqrt();
            if let (Some(with), true) = (name(b), r.abs() >= CORRELATED) {
                all.push(Correlation { parameter: PARAMETERS[*k].variable, with, coefficient: Real(r) });
            }
        }
    }
    all.sort_by(|a, b| b.coefficient.0.abs().total_cmp(&a.coefficient.0.abs()));
    all.truncate(CORRELATIONS);
    all
}

fn which(f: &Findings) -> Which {
    let point = &f.conclusion.explanation.fit.as_ref().expect("the best was fitted").point;
    let too_large = |e: usize| Reach::hides(&f.outlook.limits, e);
    let best = f.posterior.best().log_posterior;
    Which {
        effects: named(f).into_iter().map(|e| effect(f, e)).collect(),
        taken_back: f.conclusion.taken_back.as_ref().map(|t| TakenBack {
            effects: t.effects.iter().map(|&e| REGISTRY[e].id).collect(),
            before: Real(t.gaps[0]),
            after: Real(t.gaps[1]),
        }),
        ranked: ranked(f, &too_large),
        not_assessable: (0..REGISTRY.len())
            .filter(|e| too_large(*e) && !named(f).contains(e))
            .map(|e| NotAssessable { id: REGISTRY[e].id, measure: to_measure(f, e) })
            .collect(),
        tolerances: f.problem.shared.iter().zip(&point.shared).map(|(n, z)| (n.name.clone(), Real(*z))).collect(),
        explanations: f
            .posterior
            .explanations
            .iter()
            .take(LISTED)
            .map(|e| Weighed {
                effects: e.effects.iter().map(|&k| REGISTRY[k].id).collect(),
                missing_law: e.place.map(Subsystem::id),
                probability: Real(e.probability),
                behind: Real(best - e.log_posterior),
            })
            .collect(),
        beyond: Real(f.posterior.beyond),
        correlations: correlations(f),
    }
}

/// Text on what to measure so that an effect shows. If the effect is hidden because no recording has a position, the text asks for the position as well.
fn to_measure(f: &Findings, effect: usize) -> String {
    let what = advice::shown_by(f.outlook, effect);
    if position_free(f) && HIDDEN.contains(&REGISTRY[effect].effect.subsystem) {
        return format!("record x_to_cmd_mm, the position that the TCU commands; with it {what}");
    }
    what
}

/// Whether no recording has a position.
pub(super) fn position_free(f: &Findings) -> bool {
    f.problem.tracks.iter().all(|t| t.position_free)
}

/// Effects that may be present instead of `e`.
pub(super) fn rivals(f: &Findings, e: usize) -> Vec<usize> {
    in_place_of(e, &f.conclusion.explanation.effects, &f.posterior.explanations)
}

/// Effects that replace `e` in a set that is otherwise the chosen one, if all such explanations together have a probability above [`NAMED_BESIDE`]; the most probable effect first.
fn in_place_of(e: usize, chosen: &[usize], all: &[Explanation]) -> Vec<usize> {
    let mut found: Vec<(usize, f64)> = Vec::new();
    for other in all {
        let new: Vec<usize> = other.effects.iter().copied().filter(|k| !chosen.contains(k)).collect();
        let kept = chosen.iter().filter(|k| **k != e).all(|k| other.effects.contains(k));
        if let ([k], true, false) = (new.as_slice(), kept, other.effects.contains(&e)) {
            match found.iter_mut().find(|r| r.0 == *k) {
                Some(r) => r.1 += other.probability,
                None => found.push((*k, other.probability)),
            }
        }
    }
    found.retain(|r| r.1 > NAMED_BESIDE);
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    found.into_iter().map(|r| r.0).collect()
}

fn effect(f: &Findings, e: usize) -> Effect {
    let entry = &REGISTRY[e];
    let group = rivals(f, e);
    let fit = f.conclusion.explanation.fit.as_ref().expect("the best was fitted");
    let split = if group.is_empty() { String::new() } else { advice::separated_by(f.outlook, e) };
    Effect {
        id: entry.id,
        probability: Real(f.posterior.of_effect(e)),
        ambiguous_with: group.iter().map(|&k| REGISTRY[k].id).collect(),
        separated_by: split,
        sizes: Real(sizes(&fit.point, e)),
        parameters: entry.parameters.clone().map(|k| (PARAMETERS[k].name, interval(fit, k))).collect(),
    }
}

/// Estimate and 95 % interval of an effect parameter, from the posterior with the forms of the effects eliminated and the variance averaged over the accuracies of the laws.
///
/// The functions of a form have mean zero where the effect acts in these recordings, so that they do not determine the parameter of the car elsewhere. The mean of the form is a
/// further unknown, as large as the form, which the data cannot distinguish from a part of the effect's size.
fn interval(fit: &Fit, k: usize) -> Interval {
    let value = fit.point.effects[k];
    let at = fit.shared.iter().position(|c| *c == Coordinate::Effect(k));
    // Without a covariance the recordings bound nothing, and the parameter's own limits are the interval.
    let variance = at.zip(fit.mean_covariance.as_ref()).map_or(f64::INFINITY, |(i, c)| c[(i, i)]);
    let p = &PARAMETERS[k];
    let half = INTERVAL * variance.sqrt().hypot(fit.sigma_of_form_mean(k));
    Interval { value: Real(value), low: Real((value - half).max(p.min)), high: Real((value + half).min(p.max)), unit: p.unit }
}

fn ranked(f: &Findings, too_large: &dyn Fn(usize) -> bool) -> Vec<Ranked> {
    let named = named(f);
    let ambiguous: Vec<usize> = named.iter().flat_map(|&e| rivals(f, e)).collect();
    let best_with = |e: usize, holds: bool| {
        let all = f.posterior.explanations.iter().filter(|x| x.fit.is_some() && x.effects.contains(&e) == holds);
        all.map(|x| x.log_posterior).fold(f64::NEG_INFINITY, f64::max)
    };
    let base = f.posterior.explanations.iter().find(|x| x.effects.is_empty() && x.place.is_none());
    let base = base.expect("the car within its tolerances is always weighed").log_posterior;
    let odds = |e: usize| {
        let (with, without) = (best_with(e, true), best_with(e, false));
        if with.is_finite() {
            return (with - without, true);
        }
        // An effect that was never fitted has what the linear model of the screening predicts.
        (base + f.search.promised[e].unwrap_or(0.0) + log_prior(1) - without, false)
    };
    let mut all: Vec<(usize, f64, bool)> = (0..REGISTRY.len()).map(|e| (e, odds(e).0, odds(e).1)).collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    all.into_iter()
        .map(|(e, nats, fitted)| {
            let (verdict, reason) = if named.contains(&e) {
                ("chosen", "the most probable explanation holds it".to_owned())
            } else if too_large(e) {
                ("not assessable", format!("these recordings could not show it; measure: {}", to_measure(f, e)))
            } else if ambiguous.contains(&e) {
                ("ambiguous", "may be at work instead of a chosen one".to_owned())
            } else if f.conclusion.taken_back.as_ref().is_some_and(|t| t.effects.contains(&e)) {
                ("rejected", "taken back: with it the car follows the recordings worse than without".to_owned())
            } else if fitted && nats > 0.0 {
                ("rejected", format!("{nats:.1} nats better with it than without, yet a part of what is missing there rather than a cause"))
            } else if fitted {
                ("rejected", format!("the best explanation with it is {:.1} nats behind the best without it", -nats))
            } else {
                ("rejected", "screened: its linear model promises less than its price".to_owned())
            };
            let smallest_visible = Reach::of(&f.outlook.limits, e).filter(|l| l.in_sizes() < 1e3).map(|l| {
                let p = &PARAMETERS[l.parameter];
                Visible { parameter: p.name, size: Real(l.size), usual: Real(size(l.parameter)), unit: p.unit }
            });
            Ranked { id: REGISTRY[e].id, evidence: Real(nats), verdict, reason, smallest_visible }
        })
        .collect()
}

/// Gaps on the held-out data of the nominal car and with a learned law, with the floor of the true car.
fn with_law(f: &Findings, l: &Tried) -> Closed {
    Closed { noise: f.floor, ..Closed::of(&l.held_out) }
}

/// Why a law was taken, or not.
fn reason(f: &Findings, l: &Tried) -> String {
    let others = match l.left_out.len() {
        1 => "the other recording, with a law learned from the rest".to_owned(),
        n => format!("the {n} other recordings, each with a law learned from the rest"),
    };
    let held = &f.held_out_name;
    let closed = with_law(f, l);
    let (with, without) = (three_digits(closed.after), three_digits(l.without));
    match l.refused {
        None => {
            let flat = if l.stands_out() {
                ""
            } else {
                "; no value of its curves stands out of its 95 % band around zero: what closes the gap are the numbers of the vehicle file, moved within their tolerances beside it"
            };
            format!("on {held} a free replay is off by {with} rad/s with it and by {without} without{flat}")
        }
        Some(Refusal::LeftOut) => {
            let share = l.share_left_out();
            let does = if share > 0.0 { format!("closes {} of what is left", percent(share)) } else { "closes nothing".to_owned() };
            format!("it {does} on {others}, which is not more than chance would, so it does not carry over")
        }
        Some(Refusal::HeldOut) => {
            format!("on {held} a free replay is off by {with} rad/s with it and by {without} without")
        }
        Some(Refusal::NothingToJudge) => {
            format!("on {held} nothing is left above the {:.2} rad/s by which a perfect model may be off, so it cannot be judged", f.floor)
        }
    }
}

fn empirical(f: &Findings, l: &Tried) -> Empirical {
    let closed = with_law(f, l);
    let values = l.learned.fit.point.effects;
    let curve = |c: &&'static effects::empirical::Curve| EmpiricalCurve {
        id: c.name,
        over: c.over,
        unit: c.unit(),
        breakpoints: c.breakpoints,
        values: c.parameters().map(|k| Real(values[k])).collect(),
        sigma: l.learned.sigma(c).into_iter().map(Real).collect(),
    };
    Empirical {
        places: ids(&l.places),
        laws: ids(&l.laws),
        taken: l.refused.is_none(),
        reason: reason(f, l),
        without: Real(l.without),
        after: Real(closed.after),
        closed_fraction: Real(closed.fraction()),
        left_out_fraction: Real(l.share_left_out()),
        per_recording: per_recording(&l.held_out),
        curves: l.learned.curves.iter().map(curve).collect(),
    }
}

fn ids(of: &[Subsystem]) -> Vec<&'static str> {
    of.iter().map(|s| s.id()).collect()
}

/// Name of a subsystem with its article.
fn in_words(id: &str) -> String {
    let name = id.replace('_', " ");
    if name == "friction" { name } else { format!("the {name}") }
}

/// Note whether the retuned plant contains a learned law, and why.
fn law_note(laws: &[Subsystem], taken: bool, reason: &str) -> String {
    let law = listed(&laws.iter().map(|s| in_words(s.id())).collect::<Vec<_>>(), " and ");
    if taken {
        format!("the retuned plant holds an empirical law of {law}, learned from the recordings and no cause: {reason}")
    } else {
        format!("an empirical law of {law} was learned and not taken: {reason}")
    }
}

fn per_recording(held_out: &[HeldOut]) -> Vec<PerRecording> {
    let one = |h: &HeldOut| PerRecording {
        recording: h.recording.clone(),
        channel: h.channel.column(),
        unit: h.channel.unit(),
        before: Real(h.before),
        after: Real(h.after),
        noise: Real(h.noise),
    };
    held_out.iter().map(one).collect()
}

fn how_far(f: &Findings, closed: Closed) -> HowFar {
    HowFar {
        metric: if position_free(f) {
            "root mean square of real minus simulated speed, mean of flywheel and disc, in a replay that is told the clutch torque which the flywheel's balance gives while the clutch slips, so that there the disc alone is judged, rad/s"
        } else {
            "root mean square of real minus simulated speed, free replay, mean of flywheel and disc, rad/s"
        },
        before: Real(closed.before),
        after: Real(closed.after),
        noise_floor: Real(closed.noise),
        closed_fraction: Real(closed.fraction()),
        held_out: vec![f.held_out_name.clone()],
        per_recording: per_recording(f.held_out),
        kpi: f.held_out.iter().filter(|h| h.channel == Channel::OmegaF).map(|h| (h.recording.clone(), kpi(h))).collect(),
        empirical: f.learned.map(|l| empirical(f, l)),
    }
}

fn kpi(h: &HeldOut) -> BTreeMap<&'static str, Figures> {
    let figures = |get: fn(&Engagement) -> f64| {
        let [real, before, after] = h.engagement.map(|e| e.map(|e| Real(get(&e))));
        Figures { real, before, after }
    };
    BTreeMap::from([
        ("engagement_time_s", figures(|e| e.time_s)),
        ("dissipated_energy_J", figures(|e| e.energy_j)),
        ("slip_acceleration_rad_s2", figures(|e| e.slip_acceleration)),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::param;
    use nalgebra::DMatrix;

    fn fitted(along: &[usize], variances: Option<Vec<f64>>, form_size: f64) -> Fit {
        let mean_covariance = variances.map(|v| DMatrix::from_diagonal(&v.into()));
        Fit { mean_covariance, form_size, ..Fit::made_up(along.iter().map(|k| Coordinate::Effect(*k)).collect()) }
    }

    /// The half width is 1.96 times the root of the variance plus the square of the mean of the form: 12 % of the effect's departure, times the size of the form, here one half.
    /// The interval never exceeds the limits of the parameter.
    #[test]
    fn an_interval_holds_what_the_data_and_the_form_leave_open() {
        let (mass, grade) = (param::vehicle_mass::factor, param::road_load::grade);
        let mut fit = fitted(&[grade, mass], Some(vec![9.0, 0.03_f64.powi(2)]), 0.5);
        fit.point.effects[mass] = 1.5;
        let found = interval(&fit, mass);
        let half = 1.96 * (0.03_f64.powi(2) + (0.12 * 0.5 * 0.5_f64).powi(2)).sqrt();
        assert_eq!((found.value.0, found.unit), (1.5, PARAMETERS[mass].unit));
        assert!((found.high.0 - 1.5 - half).abs() < 1e-12 && (1.5 - found.low.0 - half).abs() < 1e-12, "{found:?}");
        // At the null value of an effect, its form contributes nothing.
        fit.point.effects[mass] = 1.0;
        assert!((interval(&fit, mass).high.0 - 1.0 - 1.96 * 0.03).abs() < 1e-12);
        for (along, variances) in [(vec![mass], None), (Vec::new(), Some(Vec::new()))] {
            let open = interval(&fitted(&along, variances, 1.0), mass);
            assert_eq!((open.low.0, open.high.0), (PARAMETERS[mass].min, PARAMETERS[mass].max));
        }
    }

    #[test]
    fn a_law_is_said_to_be_held_or_not_taken() {
        let said = |taken| law_note(&[Subsystem::Friction, Subsystem::Engine], taken, "it closes half");
        for (note, does) in [(said(true), "holds an empirical law"), (said(false), "not taken")] {
            assert!([does, "friction and the engine", "it closes half"].iter().all(|part| note.contains(part)), "{note}");
        }
        assert!(!said(true).contains("not taken"));
    }

    fn believed(effects: &[usize], probability: f64) -> Explanation {
        Explanation { effects: effects.to_vec(), probability, ..Explanation::default() }
    }

    #[test]
    fn what_may_be_there_instead_differs_in_one_effect_and_is_believed_by_a_twentieth() {
        let all = [
            believed(&[1, 2], 0.5),
            believed(&[1, 7], 0.04),
            believed(&[1, 5], 0.07),
            believed(&[1, 4], 0.045),
            believed(&[1, 4, 2], 0.2),
            believed(&[3, 4], 0.3),
            believed(&[1], 0.3),
            believed(&[1, 8], 0.03),
            believed(&[1, 8], 0.06),
        ];
        assert_eq!(in_place_of(2, &[1, 2], &all), [8, 5]);
        assert_eq!(in_place_of(1, &[1, 2], &all), [0; 0]);
    }
}
