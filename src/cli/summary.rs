//! The answer of a diagnosis in a few lines for a terminal.

use crate::gap::diagnosis::Diagnosis;
use crate::report::text::{estimate, number, unit};
use serde_json::Value;
use std::path::Path;

/// The sentence, the effects with their parameters, how far the gap shrinks, and where the files are.
pub fn summary(diagnosis: &Diagnosis, out: Option<&Path>) -> String {
    let json = &diagnosis.json;
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let mut lines = vec![text(&json["sentence"])];
    for effect in list(&json["which"]["effects"]) {
        let probability = effect["probability"].as_f64().map_or_else(String::new, |p| format!(", probability {:.0} %", 100.0 * p));
        lines.push(format!("  {}{probability}", text(&effect["id"])));
        lines.extend(effect["parameters"].as_object().into_iter().flatten().map(|(name, p)| parameter(name, p)));
        let group: Vec<String> = list(&effect["ambiguous_with"]).iter().map(text).collect();
        if !group.is_empty() {
            lines.push(format!("    not told apart from: {}", group.join(", ")));
        }
    }
    let far = &json["how_far"];
    let figures = ["before", "after", "noise_floor"].map(|key| far[key].as_f64().map_or_else(|| "?".to_owned(), |v| number(v, 3)));
    lines.push(format!("  speed error on held-out recordings: {} before, {} after, noise {} rad/s", figures[0], figures[1], figures[2]));
    lines.extend(out.map(|out| format!("  written: {}", out.join("report.html").display())));
    lines.join("\n") + "\n"
}

/// One line for people: name, estimate, interval, unit.
fn parameter(name: &str, p: &Value) -> String {
    let unit = unit(p["unit"].as_str().unwrap_or_default());
    match ["value", "low", "high"].map(|key| p[key].as_f64()) {
        [Some(value), Some(low), Some(high)] if high > low => {
            let (value, interval) = estimate([value, low, high]);
            format!("    {name:<16} {value} {unit}{}(95 %: {interval})", if unit.is_empty() { "" } else { " " })
        }
        [value, _, _] => format!("    {name:<16} {} {unit}", value.map_or_else(|| "?".to_owned(), |v| number(v, 4))),
    }
}
