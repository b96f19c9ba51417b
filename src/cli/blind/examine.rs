//! Examination of one car: its folder is written and diagnosed, and only then is the truth unsealed.

use super::closed::{self, Closed};
use super::folder;
use super::kept::Kept;
use super::predicted::{self, Predicted};
use crate::campaign::{self, ReadOptions};
use crate::cli::error::{CommandError, at};
use crate::gap::diagnosis::diagnose;
use realcar::altered::Alteration;
use realcar::{Car, Real, Recording, Truth};
use serde_json::{Value, json};
use std::path::Path;

/// A car to examine.
pub struct Subject {
    /// The car.
    pub car: Car,
    /// How its log was degraded, if at all.
    pub alteration: Option<Alteration>,
}

/// The truth about a car, sealed until the car has been diagnosed.
struct Sealed(Truth, Real, Vec<Recording>);

impl Sealed {
    /// Opens the seal in exchange for an answer.
    fn open(self, _answer: &Value) -> (Truth, Real, Vec<Recording>) {
        (self.0, self.1, self.2)
    }
}

/// An effect as an answer names it.
#[derive(Clone, Debug, PartialEq)]
pub struct Named {
    /// Effect id.
    pub id: String,
    /// Ids of the effects that the answer cannot tell apart from this one.
    pub group: Vec<String>,
    /// Claimed probability.
    pub probability: Option<f64>,
    /// Name, value and 95 % interval of its parameters.
    pub parameters: Vec<(String, f64, [f64; 2])>,
}

/// A diagnosed car with its truth unsealed.
pub struct Outcome {
    /// The truth.
    pub truth: Truth,
    /// How the log was degraded, if at all.
    pub alteration: Option<Alteration>,
    /// The verdict; empty if there is none.
    pub verdict: String,
    /// Subsystem to which the answer attributes the gap.
    pub primary: Option<String>,
    /// Subsystem to which the answer attributes the remainder.
    pub unexplained_at: Option<String>,
    /// Subsystems that the answer cannot tell apart from the primary one.
    pub doubted: Vec<String>,
    /// The effects, most important first.
    pub named: Vec<Named>,
    /// Share of the gap closed on recordings that the diagnosis never saw.
    pub closed: Option<Closed>,
    /// Errors of the clutch torque compared with their predicted standard deviation, for each of those recordings.
    pub predicted: Vec<Predicted>,
    /// Why there is no answer.
    pub error: Option<String>,
}

/// Writes the car into a folder, diagnoses that folder, and unseals the truth. The folder is removed afterwards unless answers are kept.
///
/// # Errors
/// A folder that cannot be written. A campaign that cannot be diagnosed is an outcome, not an error.
pub fn examine(folder: &Path, subject: Subject, kept: Option<&Kept>) -> Result<Outcome, CommandError> {
    let Subject { car, alteration } = subject;
    if !folder::stopped() && kept.is_none() {
        car.write(folder).map_err(at(folder))?;
    }
    let Car { campaign, unseen, truth, real } = car;
    let vehicle_json = campaign.vehicle_json;
    let sealed = Sealed(truth, real, unseen);
    let answer = match kept {
        Some(kept) => kept.answer(folder, || answer(folder)),
        None => {
            let answer = answer(folder);
            let _ = std::fs::remove_dir_all(folder);
            answer
        }
    };
    let (json, error) = match answer {
        Ok(json) => (json, None),
        Err(error) => (Value::Null, Some(error.to_string())),
    };
    let (truth, real, unseen) = sealed.open(&json);
    let closed = if error.is_none() { closed::on(&unseen, &vehicle_json, &json["plant"]["parameters"], &real) } else { None };
    let predicted = predicted::on(&unseen, &vehicle_json, &json, &real);
    Ok(Outcome {
        predicted,
        verdict: text(&json["verdict"]).unwrap_or_default(),
        primary: text(&json["where"]["primary"]),
        unexplained_at: text(&json["where"]["unexplained_at"]),
        doubted: texts(&json["where"]["ambiguous_with"]),
        named: json["which"]["effects"].as_array().into_iter().flatten().map(named).collect(),
        closed,
        truth,
        alteration,
        error,
    })
}

fn answer(folder: &Path) -> Result<Value, CommandError> {
    let campaign = campaign::read(folder, &ReadOptions::default())?;
    let failed = |source| CommandError::Diagnosis { path: folder.to_owned(), source, left_out: Vec::new() };
    Ok(diagnose(&campaign, &|_, _| {}).map_err(failed)?.json)
}

fn text(v: &Value) -> Option<String> {
    v.as_str().map(str::to_owned)
}

fn texts(v: &Value) -> Vec<String> {
    v.as_array().into_iter().flatten().filter_map(text).collect()
}

fn named(effect: &Value) -> Named {
    let interval =
        |(name, p): (&String, &Value)| Some((name.clone(), p["value"].as_f64()?, [bound(&p["low"], -1.0), bound(&p["high"], 1.0)]));
    Named {
        id: text(&effect["id"]).unwrap_or_default(),
        group: texts(&effect["ambiguous_with"]),
        probability: effect["probability"].as_f64(),
        parameters: effect["parameters"].as_object().into_iter().flatten().filter_map(interval).collect(),
    }
}

/// A bound of an interval; a missing bound is infinite on its side.
fn bound(v: &Value, side: f64) -> f64 {
    v.as_f64().unwrap_or(side * f64::INFINITY)
}

/// Interval of a parameter together with the true value.
pub struct Interval {
    /// Effect and parameter, joined by a dot.
    pub parameter: String,
    /// Estimate.
    pub value: f64,
    /// 95 % interval.
    pub bounds: [f64; 2],
    /// True value.
    pub truth: f64,
}

impl Interval {
    /// Whether the interval contains the true value.
    pub fn holds(&self) -> bool {
        (self.bounds[0]..=self.bounds[1]).contains(&self.truth)
    }
}

impl Outcome {
    /// Ids of the true effects.
    pub fn true_ids(&self) -> impl Iterator<Item = &'static str> + '_ {
        self.truth.effects.iter().map(|e| e.id)
    }

    /// Whether every true effect belongs to the library.
    pub fn known(&self) -> bool {
        self.truth.effects.iter().all(|e| e.in_library)
    }

    /// Whether `place` is the subsystem of one of the true effects.
    pub fn is_at(&self, place: Option<&str>) -> bool {
        self.truth.effects.iter().any(|e| Some(e.subsystem) == place)
    }

    /// Intervals of the parameters of correctly named effects.
    pub fn intervals(&self) -> impl Iterator<Item = Interval> + '_ {
        self.named.iter().flat_map(|n| {
            let truth = self.truth.effects.iter().find(|e| e.id == n.id);
            n.parameters.iter().filter_map(move |(name, value, bounds)| {
                let (_, truth) = truth?.parameters.iter().find(|p| p.0 == name)?;
                Some(Interval { parameter: format!("{}.{name}", n.id), value: *value, bounds: *bounds, truth: *truth })
            })
        })
    }

    /// Answer and truth in one line.
    pub fn line(&self) -> String {
        let named = |n: &Named| {
            let ids: Vec<&str> = std::iter::once(&n.id).chain(&n.group).map(String::as_str).collect();
            n.probability.map_or(ids.join(" or "), |p| format!("{} ({:.0} %)", ids.join(" or "), 100.0 * p))
        };
        let or = |ids: Vec<String>, none: &str| if ids.is_empty() { none.to_owned() } else { ids.join(", ") };
        let said = self.error.clone().map_or_else(
            || {
                let at = self.primary.as_ref().map_or_else(String::new, |place| format!("; in {place}"));
                let rest = self.unexplained_at.as_ref().map_or_else(String::new, |place| format!("; rest in {place}"));
                format!("{}: {}{at}{rest}", self.verdict, or(self.named.iter().map(named).collect(), "no effect named"))
            },
            |error| format!("not diagnosed: {error}"),
        );
        format!("{said} | true: {}", or(self.true_ids().map(str::to_owned).collect(), "healthy"))
    }

    /// The whole outcome as JSON, for closer inspection.
    pub fn as_json(&self) -> Value {
        let named: Vec<Value> = self.named.iter().map(|n| json!([n.id, n.group, n.probability])).collect();
        let interval =
            |i: Interval| json!({"parameter": i.parameter, "value": i.value, "low": i.bounds[0], "high": i.bounds[1], "true": i.truth});
        let intervals: Vec<Value> = self.intervals().map(interval).collect();
        let shapes: Vec<&str> = self.truth.effects.iter().map(|e| e.shape.as_str()).collect();
        json!({
            "truth": self.true_ids().collect::<Vec<_>>(), "shapes": shapes, "alteration": self.alteration.map(super::scores::row_name),
            "verdict": self.verdict, "primary": self.primary, "unexplained_at": self.unexplained_at, "doubted": self.doubted,
            "named": named, "intervals": intervals, "closed": self.closed.map(|c| c.fraction()), "gap": self.closed.map(|c| [c.before, c.after, c.floor, c.true_car]),
            "error": self.error,
        })
    }
}
