//! One car: its folder is written, diagnosed, and only then is its seal opened.

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
    /// What is wrong with its logging.
    pub alteration: Option<Alteration>,
}

/// What is true of a car, closed until it has been diagnosed.
struct Sealed(Truth, Real, Vec<Recording>);

impl Sealed {
    /// Opens against an answer.
    fn open(self, _answer: &Value) -> (Truth, Real, Vec<Recording>) {
        (self.0, self.1, self.2)
    }
}

/// An effect as an answer names it.
#[derive(Clone, Debug, PartialEq)]
pub struct Named {
    /// Its id.
    pub id: String,
    /// Effects that could be meant as well.
    pub group: Vec<String>,
    /// Its claimed probability.
    pub probability: Option<f64>,
    /// Name, value and 95 % interval of its parameters.
    pub parameters: Vec<(String, f64, [f64; 2])>,
}

/// A diagnosed car with its seal open.
pub struct Outcome {
    /// What is true.
    pub truth: Truth,
    /// What is wrong with its logging.
    pub alteration: Option<Alteration>,
    /// The verdict; empty if there is none.
    pub verdict: String,
    /// Where the gap is said to be.
    pub primary: Option<String>,
    /// Where a remainder is said to be.
    pub unexplained_at: Option<String>,
    /// Subsystems from which the primary one is not told.
    pub doubted: Vec<String>,
    /// The effects, most important first.
    pub named: Vec<Named>,
    /// How far the gap closes on recordings that the diagnosis never saw.
    pub closed: Option<Closed>,
    /// What the predicted deviation of the clutch torque is worth on each of those.
    pub predicted: Vec<Predicted>,
    /// Why there is no answer.
    pub error: Option<String>,
}

/// Draws into a folder, diagnoses the folder, opens the seal. The folder is gone afterwards, unless its answer is kept.
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

/// A bound of an interval; without one it is infinite to this side.
fn bound(v: &Value, side: f64) -> f64 {
    v.as_f64().unwrap_or(side * f64::INFINITY)
}

/// An interval of a parameter, and what is true.
pub struct Interval {
    /// Effect and parameter.
    pub parameter: String,
    /// Value that was found.
    pub value: f64,
    /// 95 % interval.
    pub bounds: [f64; 2],
    /// True value.
    pub truth: f64,
}

impl Interval {
    /// Whether it holds the true value.
    pub fn holds(&self) -> bool {
        (self.bounds[0]..=self.bounds[1]).contains(&self.truth)
    }
}

impl Outcome {
    /// Ids of the true effects.
    pub fn true_ids(&self) -> impl Iterator<Item = &'static str> + '_ {
        self.truth.effects.iter().map(|e| e.id)
    }

    /// Whether the library holds every true effect.
    pub fn known(&self) -> bool {
        self.truth.effects.iter().all(|e| e.in_library)
    }

    /// Whether this place is one of the true ones.
    pub fn is_at(&self, place: Option<&str>) -> bool {
        self.truth.effects.iter().any(|e| Some(e.subsystem) == place)
    }

    /// Intervals of what was named rightly.
    pub fn intervals(&self) -> impl Iterator<Item = Interval> + '_ {
        self.named.iter().flat_map(|n| {
            let truth = self.truth.effects.iter().find(|e| e.id == n.id);
            n.parameters.iter().filter_map(move |(name, value, bounds)| {
                let (_, truth) = truth?.parameters.iter().find(|p| p.0 == name)?;
                Some(Interval { parameter: format!("{}.{name}", n.id), value: *value, bounds: *bounds, truth: *truth })
            })
        })
    }

    /// What was said and what is true, in a line.
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

    /// Everything about it for people who look closer.
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
