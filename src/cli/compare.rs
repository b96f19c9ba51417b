//! `kisspoint compare`: what has changed between two answers for one car.
//!
//! Effects appear or disappear, their parameters change, and numbers of the vehicle file move within their tolerances. Changes of parameters that both answers contain, and of
//! numbers that both recordings inform, are tested for significance with Holm's procedure over all of them. If a number has the posterior N(z, v) under its prior N(0, 1), the
//! recordings alone say N(z/v · l, l) with l = 1/(1/v − 1). The prior is divided out because both answers share it: it would otherwise be counted twice, and would draw both
//! estimates to the value of the file.

use super::error::{CommandError, at};
use super::files::write_all;
use super::index::{link, read};
use super::output::{folded, print, print_json, width};
use crate::report::text::{number, unit};
use crate::report::{compare, names, verdict};
use nalgebra::DMatrix;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};

/// Options of `kisspoint compare`.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "Examples:\n  kisspoint compare out/before out/after\n  kisspoint compare out/level_12 out/level_13 --out compare.html\n  kisspoint compare out/before out/after --json | jq '.effects'"
)]
pub struct Args {
    /// Folder of the first answer, with diagnosis.json
    #[arg(value_name = "A")]
    first: PathBuf,
    /// Folder of the second answer
    #[arg(value_name = "B")]
    second: PathBuf,
    /// Also write the comparison as a page
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print the comparison as JSON
    #[arg(long)]
    json: bool,
}

/// Family-wise error rate: probability of any false alarm among all reported changes.
const FAMILY_WISE_ERROR: f64 = 0.01;
/// Half width of a 95 % interval in standard deviations.
const INTERVAL: f64 = 1.96;
/// Variance of a number by the recordings alone, in units of its prior variance, above which it is too poorly known to be compared.
const UNINFORMED: f64 = 9.0;

/// Runs the subcommand.
///
/// # Errors
/// Answers that cannot be read, a page that cannot be written.
pub fn run(args: &Args) -> Result<(), CommandError> {
    let answers = [&args.first, &args.second].map(|folder| read(&folder.join("diagnosis.json")));
    let [a, b] = answers;
    let found = between(&[a?, b?], [&args.first, &args.second].map(|p| called(p)));
    if let Some(out) = &args.out {
        let folder = out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let links = [&args.first, &args.second].map(|p| link(&p.join("report.html"), folder));
        let name = out.file_name().ok_or_else(|| at(out)(std::io::ErrorKind::InvalidFilename.into()))?;
        write_all(folder, &[(name.to_string_lossy(), compare::html(&found, &links).into_bytes())])?;
    }
    if args.json { print_json(&found) } else { print(&as_text(&found, args.out.as_deref())) }
}

fn called(folder: &Path) -> String {
    let whole = std::fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned());
    whole.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Compares two answers.
fn between(answers: &[Value; 2], called: [String; 2]) -> Value {
    let mut tests: Vec<(f64, Value)> = Vec::new();
    let of = |k: usize, id: &str| answers[k]["which"]["effects"].as_array().into_iter().flatten().find(|e| e["id"] == id).cloned();
    let ids: BTreeSet<String> = answers
        .iter()
        .flat_map(|a| a["which"]["effects"].as_array().into_iter().flatten())
        .filter_map(|e| e["id"].as_str())
        .map(String::from)
        .collect();
    let mut effects = Vec::new();
    for id in &ids {
        let both = [of(0, id), of(1, id)];
        let (change, rivals) = match &both {
            [Some(own), None] => ("gone", stands_in(&answers[1], id) || stood_in_for(own, &answers[1])),
            [None, Some(own)] => ("new", stands_in(&answers[0], id) || stood_in_for(own, &answers[0])),
            _ => ("stays", false),
        };
        // An effect that the other answer cannot tell apart from one of its own has not certainly come or gone.
        effects.push(json!({"id": id, "change": if rivals { "perhaps the same" } else { change }, "a": both[0], "b": both[1]}));
        if let [Some(a), Some(b)] = &both {
            for (name, value) in a["parameters"].as_object().into_iter().flatten() {
                let other = &b["parameters"][name];
                if let (Some(x), Some(y)) = (normal(value), normal(other)) {
                    let row = json!({"what": "parameter", "effect": id, "name": name, "unit": value["unit"], "a": x.0, "b": y.0});
                    tests.push(difference(row, x, y));
                }
            }
        }
    }
    let nominal = answers.each_ref().map(|a| &a["plant"]["nominal_parameters"]);
    let other_numbers: Vec<&String> =
        nominal[0].as_object().into_iter().flatten().filter(|(name, v)| nominal[1][name.as_str()] != **v).map(|(name, _)| name).collect();
    let numbers = answers.each_ref().map(numbers);
    for (name, [z, v, sigma], relative, effect) in &numbers[0] {
        let Some((_, [y, w, s], _, other)) = numbers[1].iter().find(|n| n.0 == *name) else { continue };
        // A number that stands for a named effect is compared as that effect. The standard deviations of a number are equal only if both answers used the same vehicle file.
        if *effect || *other || sigma != s || !other_numbers.is_empty() || v.max(*w) > UNINFORMED {
            continue;
        }
        let row = json!({"what": "number", "name": name, "sigma": sigma, "relative": relative, "a": z, "b": y});
        tests.push(difference(row, (*z, v.sqrt()), (*y, w.sqrt())));
    }
    // Holm: the smallest p-value is tested against α/m, the next against α/(m − 1), and so on.
    tests.sort_by(|a, b| a.0.total_cmp(&b.0));
    let all = tests.len();
    let mut on = true;
    let changes: Vec<Value> = tests
        .into_iter()
        .enumerate()
        .map(|(k, (p, mut row))| {
            on = on && p < FAMILY_WISE_ERROR / (all - k) as f64;
            row["significant"] = on.into();
            row
        })
        .collect();
    let sides: Vec<Value> = answers
        .iter()
        .zip(called)
        .map(|(a, name)| json!({"name": name, "verdict": a["verdict"], "confidence": a["confidence"], "headline": verdict::headline(a), "sentence": a["sentence"], "where": a["where"]["primary"], "before": a["how_far"]["before"], "after": a["how_far"]["after"], "closed_fraction": a["how_far"]["closed_fraction"]}))
        .collect();
    json!({"schema": "kisspoint-comparison/1", "a": sides[0], "b": sides[1], "effects": effects, "changes": changes, "family_wise_error": FAMILY_WISE_ERROR, "other_numbers_in_vehicle_file": other_numbers})
}

/// Whether an effect is listed as a rival of one of the answer's effects.
fn stands_in(answer: &Value, id: &str) -> bool {
    answer["which"]["effects"]
        .as_array()
        .into_iter()
        .flatten()
        .any(|e| e["ambiguous_with"].as_array().is_some_and(|all| all.iter().any(|r| r == id)))
}

/// Whether one of the answer's effects is among the rivals of this effect.
fn stood_in_for(effect: &Value, answer: &Value) -> bool {
    let rivals = effect["ambiguous_with"].as_array();
    rivals.into_iter().flatten().any(|rival| answer["which"]["effects"].as_array().into_iter().flatten().any(|e| e["id"] == *rival))
}

/// Estimate and standard deviation, from a value with its 95 % interval.
fn normal(value: &Value) -> Option<(f64, f64)> {
    let [x, low, high] = ["value", "low", "high"].map(|key| value[key].as_f64());
    // One end may have been cut off at the parameter's bound, so the wider side gives the half width.
    let half = (high? - x?).max(x? - low?);
    (half > 0.0).then_some((x?, half / INTERVAL))
}

/// Two-sided p-value of a difference, and the row with the difference and its interval added.
fn difference(mut row: Value, a: (f64, f64), b: (f64, f64)) -> (f64, Value) {
    let sd = a.1.hypot(b.1);
    let by = b.0 - a.0;
    let p = libm::erfc((by / sd).abs() / std::f64::consts::SQRT_2);
    row["by"] = by.into();
    row["low"] = (by - INTERVAL * sd).into();
    row["high"] = (by + INTERVAL * sd).into();
    (p, row)
}

/// Numbers of an answer's joint posterior: name; estimate and variance by the recordings alone, in standard deviations of the tolerance, and that standard deviation; whether
/// it is relative; whether a named effect stands for the number.
fn numbers(answer: &Value) -> Vec<(String, [f64; 3], bool, bool)> {
    let joint = &answer["joint"];
    let unknowns = joint["unknowns"].as_array().cloned().unwrap_or_default();
    let entry = |i: usize, j: usize| joint["precision"][i.max(j)][i.min(j)].as_f64().unwrap_or(f64::NAN);
    let Some(covariance) = DMatrix::from_fn(unknowns.len(), unknowns.len(), entry).cholesky().map(|c| c.inverse()) else {
        return Vec::new();
    };
    let named = |variable: &Value| unknowns.iter().any(|u| u["name"] == *variable);
    let one = |(k, u): (usize, &Value)| {
        let v = covariance[(k, k)];
        let alone = 1.0 / (1.0 / v - 1.0).max(f64::MIN_POSITIVE);
        let z = u["value"].as_f64()? / v * alone;
        let told = u["kind"] == "tolerance" && u["one_sided"] == false;
        told.then(|| {
            (
                u["name"].as_str().unwrap_or_default().to_owned(),
                [z, alone, u["sigma"].as_f64().unwrap_or(f64::NAN)],
                u["relative"] == true,
                named(&u["same_as"]["parameter"]),
            )
        })
    };
    unknowns.iter().enumerate().filter_map(one).collect()
}

fn as_text(found: &Value, out: Option<&Path>) -> String {
    let mut lines = vec![compare::headline(found)];
    for side in ["a", "b"] {
        let s = &found[side];
        lines.push(format!("  {}: {}", s["name"].as_str().unwrap_or_default(), s["headline"].as_str().unwrap_or_default()));
    }
    for e in found["effects"].as_array().into_iter().flatten() {
        let id = e["id"].as_str().unwrap_or_default();
        lines.push(format!("  {} ({id}): {}", names::effect(id), e["change"].as_str().unwrap_or_default()));
    }
    for c in found["changes"].as_array().into_iter().flatten().filter(|c| c["significant"] == true) {
        let get = |key: &str| number(c[key].as_f64().unwrap_or(f64::NAN), 3);
        let (what, in_unit) = compare::what(c);
        lines.push(format!(
            "  {what}: from {} to {} {}, by {} (95 %: {} to {})",
            get("a"),
            get("b"),
            unit(&in_unit),
            get("by"),
            get("low"),
            get("high")
        ));
    }
    let other = found["other_numbers_in_vehicle_file"].as_array().map_or(0, Vec::len);
    if other > 0 {
        lines.push(format!("  ! the vehicle files differ in {other} numbers: what lies within their tolerances is not compared"));
    }
    lines.extend(out.map(|out| format!("  written: {}", out.display())));
    let wide = width(std::io::stdout().is_terminal());
    lines.iter().map(|line| folded(line, wide, "  ") + "\n").collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(effects: Value, z: f64, v: f64) -> Value {
        json!({
            "verdict": "explained", "sentence": "", "which": {"effects": effects}, "plant": {"nominal_parameters": {"a": 1.0}}, "how_far": {}, "where": {},
            "joint": {"unknowns": [{"name": "driveline.J_f", "kind": "tolerance", "value": z, "sigma": 0.01, "relative": true, "one_sided": false, "same_as": null}],
                      "precision": [[1.0 / v]]}
        })
    }

    fn effect(id: &str, value: f64, rivals: &[&str]) -> Value {
        json!({"id": id, "ambiguous_with": rivals, "parameters": {"torque": {"value": value, "low": value - 0.2, "high": value + 0.2, "unit": "N.m"}}})
    }

    #[test]
    fn what_came_went_and_changed_is_told_apart() {
        let first = answer(json!([effect("engine_torque_bias", 1.0, &[]), effect("judder", 1.0, &[])]), 0.0, 0.1);
        let second = answer(json!([effect("engine_torque_bias", 3.0, &[]), effect("road_load", 1.0, &[])]), 1.5, 0.1);
        let found = between(&[first, second], ["a".into(), "b".into()]);
        let change = |id: &str| found["effects"].as_array().unwrap().iter().find(|e| e["id"] == id).unwrap()["change"].clone();
        assert_eq!([change("judder"), change("road_load"), change("engine_torque_bias")], ["gone", "new", "stays"]);
        let rows = found["changes"].as_array().unwrap();
        assert_eq!(rows.len(), 2);
        assert!(rows.iter().all(|r| r["significant"] == true), "{rows:?}");
        // With the prior divided out, 1.5 standard deviations at a posterior variance of 0.1 become 1.67 by the recordings alone.
        let moved = rows.iter().find(|r| r["what"] == "number").unwrap();
        assert!((moved["by"].as_f64().unwrap() - 1.5 / 0.9).abs() < 1e-9);
    }

    #[test]
    fn an_answer_has_not_changed_from_itself_and_a_rival_is_no_news() {
        let same = answer(json!([effect("judder", 1.0, &["road_load"])]), 0.7, 0.2);
        let found = between(&[same.clone(), same.clone()], ["a".into(), "b".into()]);
        assert!(found["changes"].as_array().unwrap().iter().all(|c| c["significant"] == false && c["by"] == 0.0));
        let other = answer(json!([effect("road_load", 1.0, &["judder"])]), 0.7, 0.2);
        let found = between(&[same, other], ["a".into(), "b".into()]);
        assert!(found["effects"].as_array().unwrap().iter().all(|e| e["change"] == "perhaps the same"));
        // The ambiguity may appear in only one of the two answers, in either order.
        let sure = answer(json!([effect("road_load", 1.0, &[])]), 0.7, 0.2);
        let doubtful = answer(json!([effect("judder", 1.0, &["road_load"])]), 0.7, 0.2);
        for pair in [[sure.clone(), doubtful.clone()], [doubtful, sure]] {
            let found = between(&pair, ["a".into(), "b".into()]);
            assert!(found["effects"].as_array().unwrap().iter().all(|e| e["change"] == "perhaps the same"), "{found}");
        }
    }
}
