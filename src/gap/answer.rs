//! The answer: diagnosis.json, as its schema has it.
//!
//! Keys are sorted and numbers rounded to six significant digits (plant parameters are exact), so that the same
//! campaign gives the same bytes.

use super::coordinate::Coordinate;
use super::decide::{self, HELPS, STRETCHED, STRUCTURED, Verdict};
use super::diagnosis::{Findings, verdict_id};
use super::fit::Fit;
use super::locate::FAMILY_WISE_ERROR;
use super::measure::{Closed, Engagement, HeldOut, unit};
use super::problem::prior;
use super::select::Hypothesis;
use super::series::Channel;
use crate::effects::{self, PARAMETERS, Parameters, REGISTRY, Subsystem};
use crate::vehicle::{NUMBERS, Vehicle};
use serde_json::{Map, Value, json};

/// Difference of evidence, in nats, under which two effects are not told apart.
const AMBIGUOUS_NATS: f64 = 4.0;

/// The whole answer.
pub(super) fn json(f: &Findings) -> Value {
    let effects = effects_json(f);
    let unseen = Closed::of(f.held_out);
    let (Closed { before, after, noise }, closed) = (unseen, unseen.fraction());
    let confidence = confidence(f);
    json!({
        "schema": "kisspoint-diagnosis/1",
        "verdict": verdict_id(f.decision.verdict),
        "confidence": round(confidence),
        "sentence": sentence(f, closed),
        "notes": notes(f, closed),
        "left_out": f.campaign.left_out.iter().map(|l| json!({"recording": l.recording, "reason": l.reason})).collect::<Vec<_>>(),
        "where": {
            "primary": f.location.primary.map(|s| s.id()),
            "subsystems": f.location.shares.iter().map(|(s, share)| json!({"id": s.id(), "share": round(*share)})).collect::<Vec<_>>(),
            "equations": f.location.cells.iter().map(|c| json!({
                "equation": c.equation, "phase": c.phase, "region": c.region, "sigma": round(c.sigma), "rms": round(c.rms),
                "unit": c.unit, "samples": c.samples, "significant": c.significant,
            })).collect::<Vec<_>>(),
            "family_wise_error": FAMILY_WISE_ERROR,
            "unexplained_at": f.location.unexplained_at.map(|s| s.id()),
            "ambiguous_with": places_in_doubt(f),
        },
        "which": {
            "effects": effects,
            "ranked": ranked(f),
            "not_assessable": f.blind_spots.iter().map(|&e| json!({"id": REGISTRY[e].id, "measure": REGISTRY[e].effect.shown_by})).collect::<Vec<_>>(),
            "tolerances": tolerances(f),
        },
        "how_far": {
            "metric": "root mean square of real minus simulated speed, free replay, mean of flywheel and disc, rad/s",
            "before": round(before),
            "after": round(after),
            "noise_floor": round(noise),
            "closed_fraction": round(closed),
            "short_horizon_closed_fraction": over_short_horizons(f).map(round),
            "held_out": held_out_names(f.held_out),
            "per_recording": f.held_out.iter().map(|h| json!({
                "recording": h.recording, "channel": h.channel.column(), "unit": unit(h.channel),
                "before": round(h.before), "after": round(h.after), "noise": round(h.noise),
            })).collect::<Vec<_>>(),
            "kpi": kpi(f.held_out),
        },
        "plant": {
            "parameters": plant_parameters(f.retuned.0, f.retuned.1),
            "nominal_parameters": plant_parameters(&f.problem.vehicle, &effects::null()),
        },
    })
}

/// Six significant digits; what is not finite becomes null.
fn round(x: f64) -> Value {
    format!("{x:.5e}").parse::<f64>().ok().filter(|x| x.is_finite()).map_or(Value::Null, Value::from)
}

/// Variable names and values of DrivelinePlant.fmu that make it this car.
pub fn plant_parameters(vehicle: &Vehicle, effects: &Parameters) -> Value {
    let numbers = NUMBERS.iter().map(|n| (n.name.to_owned(), Value::from((n.get)(vehicle))));
    let effects = PARAMETERS.iter().zip(effects).map(|(p, v)| (p.variable.to_owned(), Value::from(*v)));
    Value::Object(numbers.chain(effects).collect::<Map<_, _>>())
}

fn held_out_names(held_out: &[HeldOut]) -> Vec<&str> {
    let mut names: Vec<&str> = held_out.iter().map(|h| h.recording.as_str()).collect();
    names.dedup();
    names
}

fn kpi(held_out: &[HeldOut]) -> Value {
    let figures = |h: &HeldOut, get: fn(&Engagement) -> f64| {
        let [real, before, after] = h.engagement.map(|e| e.map_or(Value::Null, |e| round(get(&e))));
        json!({"real": real, "before": before, "after": after})
    };
    let one = |h: &HeldOut| {
        let all = json!({
            "engagement_time_s": figures(h, |e| e.time_s),
            "dissipated_energy_J": figures(h, |e| e.energy_j),
            "slip_acceleration_rad_s2": figures(h, |e| e.slip_acceleration),
        });
        (h.recording.clone(), all)
    };
    Value::Object(held_out.iter().filter(|h| h.channel == Channel::OmegaF).map(one).collect())
}

/// Scale of the evidence, see [`decide::dispersion`].
fn dispersion(f: &Findings) -> f64 {
    decide::dispersion(&f.decision.chosen.fit)
}

/// Hypotheses that differ from the chosen one in effect `k` alone; of pairs, those that the data ask for as well.
fn rivals<'a>(f: &'a Findings, k: usize) -> impl Iterator<Item = (usize, &'a Hypothesis)> {
    let chosen = &f.decision.chosen.effects;
    let kept: Vec<usize> = chosen.iter().copied().filter(|e| *e != chosen[k]).collect();
    let all: Vec<&Hypothesis> =
        if chosen.len() == 1 { f.search.singles.iter().collect() } else { decide::needed_pairs(f.search).collect() };
    all.into_iter().filter_map(move |h| {
        let other: Vec<usize> = h.effects.iter().copied().filter(|e| !kept.contains(e)).collect();
        (other.len() == 1 && other[0] != chosen[k]).then(|| (other[0], h))
    })
}

/// Nats by which the chosen hypothesis beats another.
fn behind(f: &Findings, other: &Hypothesis) -> f64 {
    0.5 * decide::evidence(other, &f.decision.chosen)
}

/// Effects that the data cannot tell from the chosen effect `k`.
fn ambiguous_with(f: &Findings, k: usize) -> impl Iterator<Item = usize> {
    rivals(f, k).filter(|(_, h)| behind(f, h) < AMBIGUOUS_NATS).map(|(e, _)| e)
}

/// Subsystems in which the gap, or what remains of it, might lie instead of where it is said to lie.
fn places_in_doubt(f: &Findings) -> Vec<&'static str> {
    let of_effects = (0..f.decision.chosen.effects.len()).flat_map(|k| ambiguous_with(f, k)).map(|e| REGISTRY[e].effect.subsystem);
    let said: Vec<Subsystem> = f.location.shares.iter().map(|s| s.0).collect();
    let doubted: Vec<Subsystem> = of_effects.chain(f.location.or_at.iter().copied()).filter(|s| !said.contains(s)).collect();
    Subsystem::ALL.iter().filter(|s| doubted.contains(s)).map(|s| s.id()).collect()
}

fn effects_json(f: &Findings) -> Vec<Value> {
    let chosen = &f.decision.chosen;
    (0..chosen.effects.len())
        .map(|k| {
            let entry = &REGISTRY[chosen.effects[k]];
            let odds: f64 = rivals(f, k).map(|(_, h)| (-behind(f, h)).exp()).sum();
            let group: Vec<&str> = ambiguous_with(f, k).map(|e| REGISTRY[e].id).collect();
            let split = group
                .first()
                .and_then(|id| effects::find(id))
                .map_or(String::new(), |other| format!("{}; or {}", entry.effect.shown_by, REGISTRY[other].effect.shown_by));
            json!({
                "id": entry.id,
                "probability": round((1.0 / (1.0 + odds)).min(SUREST)),
                "ambiguous_with": group,
                "separated_by": split,
                "parameters": intervals(f, entry.parameters.clone()),
            })
        })
        .collect()
}

/// Half width of a 95 % interval in standard deviations.
const INTERVAL: f64 = 1.96;

fn intervals(f: &Findings, parameters: std::ops::Range<usize>) -> Value {
    let fit = &f.decision.chosen.fit;
    let one = |k: usize| {
        let value = fit.point.effects[k];
        let half = INTERVAL * (standard_deviation(fit, Coordinate::Effect(k)) * dispersion(f).sqrt());
        let p = &PARAMETERS[k];
        let bounds = json!({
            "value": round(value), "low": round((value - half).max(p.min)), "high": round((value + half).min(p.max)), "unit": p.unit,
        });
        (p.name.to_owned(), bounds)
    };
    Value::Object(parameters.map(one).collect())
}

fn standard_deviation(fit: &Fit, coordinate: Coordinate) -> f64 {
    let place = fit.coordinates.iter().position(|c| *c == coordinate);
    let variance = place.and_then(|k| fit.curvature.clone().try_inverse().map(|c| c[(k, k)]));
    variance.map_or(f64::NAN, |v| v.max(0.0).sqrt())
}

/// Every candidate with its evidence over the car within its tolerances, in nats.
fn ranked(f: &Findings) -> Vec<Value> {
    let scale = dispersion(f);
    let base = &f.search.base;
    let ambiguous: Vec<usize> = (0..f.decision.chosen.effects.len()).flat_map(|k| ambiguous_with(f, k)).collect();
    let evidence = |e: usize| {
        let fitted = f.search.singles.iter().find(|h| h.effects == [e]).map(|h| h.fit.cost);
        let promised = || f.search.screened.iter().filter(|c| c.effect == e).map(|c| c.promise).reduce(f64::min);
        let cost = fitted.or_else(promised).unwrap_or(base.fit.cost);
        (0.5 * (base.fit.cost - cost) / scale, fitted.is_some())
    };
    let mut all: Vec<(usize, f64, bool)> = (0..REGISTRY.len()).map(|e| (e, evidence(e).0, evidence(e).1)).collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let one = |(e, nats, fitted): (usize, f64, bool)| {
        let (verdict, reason) = if f.decision.chosen.effects.contains(&e) {
            ("chosen", "explains more than any other, beyond tolerances and noise".to_owned())
        } else if f.blind_spots.contains(&e) {
            ("not assessable", format!("these recordings could not show it; measure: {}", REGISTRY[e].effect.shown_by))
        } else if ambiguous.contains(&e) {
            ("ambiguous", format!("within {AMBIGUOUS_NATS} nats of the chosen explanation"))
        } else if fitted && f.decision.chosen.effects.is_empty() {
            ("rejected", "fitted, it does not earn its place".to_owned())
        } else if fitted {
            ("rejected", "fitted alone, it leaves more unexplained than the chosen explanation".to_owned())
        } else {
            ("rejected", "screened: its linear model promises too little to be worth a fit".to_owned())
        };
        json!({"id": REGISTRY[e].id, "evidence": round(nats), "verdict": verdict, "reason": reason})
    };
    all.into_iter().map(one).collect()
}

/// Where the tolerances ended, in standard deviations.
fn tolerances(f: &Findings) -> Value {
    let point = &f.decision.chosen.fit.point;
    Value::Object(f.problem.nuisances.iter().zip(&point.z).map(|(n, z)| (n.name.clone(), round(*z))).collect())
}

/// The surest that an answer is: a car may hold what no candidate stands for, and drawn cars show wrong answers at about this rate.
const SUREST: f64 = 0.95;

/// Cost of the nuisances of a car within its tolerances, about.
const USUAL_PULL: f64 = 25.0;

/// Probability that the verdict is right, as far as the evidence tells: of the chosen effects among their rivals, or of no gap.
fn confidence(f: &Findings) -> f64 {
    let chosen = &f.decision.chosen;
    let odds = |k| rivals(f, k).map(|(_, h)| (-behind(f, h)).exp()).sum::<f64>();
    let among_rivals: f64 = (0..chosen.effects.len()).map(|k| 1.0 / (1.0 + odds(k))).product();
    let against: f64 = match f.decision.verdict {
        Verdict::NoGap => f.search.singles.iter().map(|h| (-(h.score() - chosen.score()).max(0.0) / 2.0 - 3.0).exp()).sum(),
        // How near what is left comes to where the verdict would turn.
        Verdict::Explained => 0.05 * (f.decision.left / HELPS).min(1.0),
        _ => 0.2 * (STRUCTURED * f.search.noise_cost / f.decision.chosen.fit.cost).min(1.0),
    };
    // Tolerances that had to be pulled far say that something else is not as believed; an unexplained gap says just that.
    let unbelievable = if f.decision.verdict == Verdict::Unexplained { 0.0 } else { prior(&chosen.fit.point) - USUAL_PULL };
    let pulled = unbelievable.max(0.0) / USUAL_PULL;
    (among_rivals / ((1.0 + against) * (1.0 + 0.1 * pulled))).clamp(0.0, SUREST)
}

/// Share of the held-out recording's cost beyond noise that the effects take away over short horizons, its start temperatures fitted.
fn over_short_horizons(f: &Findings) -> Option<f64> {
    f.unseen.fraction().filter(|_| !f.decision.chosen.effects.is_empty())
}

/// Difference between what short horizons and a free replay say is closed from which on both are said.
const WORTH_SAYING: f64 = 0.1;

/// The same where a free replay closes much less: then it is its start temperatures that are off, or an early error that stays.
fn better_over_short_horizons(f: &Findings, closed: f64) -> Option<f64> {
    over_short_horizons(f).filter(|share| share - closed > WORTH_SAYING)
}

fn sentence(f: &Findings, closed: f64) -> String {
    let names: Vec<&str> = f.decision.chosen.effects.iter().map(|&e| REGISTRY[e].id).collect();
    let (helps, closes) = if names.len() == 1 { ("helps", "closes") } else { ("help", "close") };
    let names = names.join(" and ");
    let places: Vec<&str> = f.location.unexplained_at.iter().chain(&f.location.or_at).map(|s| s.id()).collect();
    let at = places.join(" or ");
    // Rounded down: "100 %" is said of a gap that is closed, not of one that nearly is.
    let percent = |share: f64| format!("{:.1} %", (1000.0 * share).floor() / 10.0).replace('-', "−");
    let share = match better_over_short_horizons(f, closed) {
        Some(short) => format!(
            "{} of the gap over short horizons and {} in a free replay, on recordings that took no part in the fit",
            percent(short),
            percent(closed)
        ),
        None => format!("{} of the gap on recordings that took no part in the fit", percent(closed)),
    };
    match f.decision.verdict {
        Verdict::NoGap => "The car lies within its tolerances: nothing is left beyond noise.".to_owned(),
        Verdict::Explained => format!("The gap is explained by {names}, which {closes} {share}."),
        Verdict::PartlyExplained if f.decision.stretch > STRETCHED => {
            format!("{names} {helps} and {closes} {share}, but only with {}: something may be missing in {at}.", furthest_tolerance(f))
        }
        Verdict::PartlyExplained => format!(
            "{names} {helps} and {closes} {share}, but something structured remains in {at} that no effect of the library accounts for."
        ),
        Verdict::Unexplained => format!("There is a gap in {at} that no effect of the library accounts for."),
    }
}

/// The tolerance that was pulled furthest, in words.
fn furthest_tolerance(f: &Findings) -> String {
    let all = f.problem.nuisances.iter().zip(&f.decision.chosen.fit.point.z);
    let furthest = all.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    furthest.map_or_else(String::new, |(n, z)| format!("{} {:.0} standard deviations from its value in the vehicle file", n.name, z.abs()))
}

fn notes(f: &Findings, closed: f64) -> Vec<String> {
    let mut notes: Vec<String> = f.campaign.notes.iter().map(|n| format!("{}: {}", n.recording, n.text)).collect();
    let pulled = prior(&f.decision.chosen.fit.point);
    let free = f.problem.nuisances.len() as f64;
    if pulled > 3.0 * free + 10.0 {
        notes.push(format!(
            "The tolerances are pulled further than they should be (cost {pulled:.0} for {free:.0} numbers): one of the vehicle's numbers may be wrong beyond its tolerance."
        ));
    }
    if f.problem.series.iter().all(|s| s.measured[Channel::TFc as usize].is_empty()) {
        notes.push(
            "No torque transducer: force and friction are told apart only by how they depend on position, slip and temperature.".to_owned(),
        );
    }
    if better_over_short_horizons(f, closed).is_some() {
        notes.push(
            "The free replay of the held-out recording starts from the temperatures as noted, which are known to 1 K, and keeps every early error. Over short \
             horizons, with these temperatures fitted, more of the gap is closed: judge the effects by that, and the plant by the free replay."
                .to_owned(),
        );
    }
    notes
}
