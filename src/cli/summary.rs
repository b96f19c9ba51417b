//! The answer of a diagnosis in a few lines for a terminal.

use super::output::{Colour, coloured, folded, width};
use crate::gap::diagnosis::Diagnosis;
use crate::report::open_questions::of_recording;
use crate::report::text::{capitalised, estimate, number, probability, unit};
use crate::report::{Input, doubts, names, verdict};
use serde_json::Value;
use std::io::IsTerminal;
use std::path::Path;

/// The headline, the error of a free replay, the effects with their parameters, the doubts, the notes that concern all recordings, and the path of the report.
pub fn summary(diagnosis: &Diagnosis, out: Option<&Path>) -> String {
    let terminal = std::io::stdout().is_terminal();
    let json = &diagnosis.json;
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let doubts = doubts::of(&Input { overlays: &diagnosis.overlays, ..Input::empty(json) });
    let grave = doubts.iter().any(|d| d.grave) || !verdict::settled(json);
    let colour = match json["verdict"].as_str() {
        Some("unexplained" | "inputs_do_not_fit") => Colour::Red,
        Some("partly_explained") => Colour::Yellow,
        _ if grave => Colour::Yellow,
        _ => Colour::Green,
    };
    let wide = width(terminal);
    // Folded before it is coloured, since codes have no width.
    let mut lines = vec![coloured(&folded(&verdict::headline(json), wide, ""), colour, terminal)];
    let mut rest: Vec<String> = Vec::new();
    rest.extend(verdict::replayed(json));
    for effect in list(&json["which"]["effects"]) {
        let id = text(&effect["id"]);
        let mass = effect["probability"].as_f64().map_or_else(String::new, |p| format!(", probability {}", probability(p)));
        rest.push(format!("  {} ({id}){mass}", names::effect(&id)));
        rest.extend(effect["parameters"].as_object().into_iter().flatten().map(|(name, p)| parameter(name, p)));
        let group: Vec<String> =
            list(&effect["ambiguous_with"]).iter().map(|v| format!("{} ({})", names::effect(&text(v)), text(v))).collect();
        if !group.is_empty() {
            rest.push(format!("    cannot be told apart from: {}", group.join(", ")));
        }
    }
    rest.extend(verdict::confidence(json).map(|said| format!("  {said}")));
    rest.extend(doubts.iter().map(|d| format!("  {} {}", if d.grave { "!" } else { "-" }, d.text())));
    // Notes on single recordings were printed when the recordings were read.
    let of_all = diagnosis.answer.notes.iter().filter(|note| of_recording(note).is_none());
    rest.extend(of_all.map(|note| format!("  - {}.", capitalised(note).trim_end_matches('.'))));
    rest.extend(out.map(|out| format!("  written: {}", out.join("report.html").display())));
    lines.extend(rest.iter().map(|line| folded(line, wide, "  ")));
    lines.join("\n") + "\n"
}

/// One line of text: name, estimate, interval, unit.
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
