//! Where: gap of each balance equation in each phase and region, and the share of each subsystem.

use serde_json::Value;

use super::absent;
use super::json::{flag, list, real, text};
use super::text::{escape, number, percent, title, unit, words};

/// Bounds between the shades, in standard deviations.
const SHADES: [f64; 5] = [2.0, 3.0, 5.0, 10.0, 30.0];

/// Equations and phases in the order in which torque flows and the clutch closes; others follow as they come.
const EQUATIONS: [&str; 6] = ["engine balance", "actuator", "torque map", "thermal", "driveline balance", "speed sensors"];
const PHASES: [&str; 3] = ["open", "slipping", "locked"];

/// The section.
pub fn section(diagnosis: &Value) -> String {
    let place = &diagnosis["where"];
    let entries = list(place, "equations");
    let map = if entries.is_empty() { absent("The gap per equation, phase and region was not handed over.") } else { map(entries) };
    format!("{}{map}{}", lead(place), subsystems(place))
}

fn lead(place: &Value) -> String {
    let primary = match text(place, "primary") {
        Some(id) => format!("The gap lies first of all in <b>{}</b>.", escape(&words(id))),
        None => "No subsystem shows a gap.".to_owned(),
    };
    let remainder = text(place, "unexplained_at").map_or_else(String::new, |id| {
        format!(
            " <span class=\"pill warn\"><span aria-hidden=\"true\">◐</span> A structured remainder lies in {}</span>",
            escape(&words(id))
        )
    });
    format!("<p>{primary}{remainder}</p>\n")
}

/// Names that occur, known ones first.
fn ordered<'a>(known: &[&'a str], found: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let found: Vec<&str> = found.collect();
    let mut out: Vec<&str> = known.iter().copied().filter(|k| found.contains(k)).collect();
    for name in found {
        if !out.contains(&name) {
            out.push(name);
        }
    }
    out
}

fn map(entries: &[Value]) -> String {
    let equations = ordered(&EQUATIONS, entries.iter().filter_map(|e| text(e, "equation")));
    let phases = ordered(&PHASES, entries.iter().filter_map(|e| text(e, "phase")));
    let head: String = equations.iter().map(|e| format!("<th scope=\"col\">{}</th>", escape(&title(e)))).collect();
    let mut rows = String::new();
    for phase in phases {
        let of_phase: Vec<&Value> = entries.iter().filter(|e| text(e, "phase") == Some(phase)).collect();
        let regions = ordered(&[], of_phase.iter().map(|e| text(e, "region").unwrap_or("all")));
        for (k, region) in regions.iter().enumerate() {
            let cells: String = equations.iter().map(|equation| cell(&of_phase, equation, region)).collect();
            let span = regions.len();
            let group = if k == 0 { format!("<th scope=\"rowgroup\" rowspan=\"{span}\">{}</th>", escape(phase)) } else { String::new() };
            rows += &format!("<tr>{group}<th scope=\"row\">{}</th>{cells}</tr>", escape(region));
        }
        rows += "</tbody><tbody>";
    }
    let rows = rows.trim_end_matches("<tbody>").trim_end_matches("</tbody>");
    format!(
        "<div class=\"scroll\" role=\"region\" aria-label=\"Residual map\" tabindex=\"0\"><table class=\"heat\">\
         <caption><span>Gap before retuning, in standard deviations of its noise; below it the rms gap.</span></caption>\
         <thead><tr><th scope=\"col\">Phase</th><th scope=\"col\">Region</th>{head}</tr></thead><tbody>{rows}</tbody></table></div>\n{}",
        scale()
    )
}

fn cell(entries: &[&Value], equation: &str, region: &str) -> String {
    let found = entries.iter().find(|e| text(e, "equation") == Some(equation) && text(e, "region").unwrap_or("all") == region);
    let Some((entry, sigma)) = found.and_then(|e| real(e, "sigma").map(|s| (e, s))) else {
        return "<td class=\"none\"><span title=\"no samples\">·</span></td>".to_owned();
    };
    let mark = if flag(entry, "significant") { " hit" } else { "" };
    let said = if mark.is_empty() { "" } else { "<span class=\"unseen\"> significant</span>" };
    let rms = real(entry, "rms")
        .map_or_else(String::new, |r| format!("<small>{} {}</small>", number(r, 2), escape(&unit(text(entry, "unit").unwrap_or("")))));
    let samples = real(entry, "samples").map_or_else(String::new, |n| format!(" title=\"{} samples\"", number(n, 7)));
    format!("<td class=\"h{}{mark}\"{samples}><b>{}</b>{said}{rms}</td>", shade(sigma), number(sigma, 2))
}

fn shade(sigma: f64) -> usize {
    SHADES.iter().filter(|bound| sigma.abs() >= **bound).count()
}

fn scale() -> String {
    let bins = ["&lt;&#8201;2", "2–3", "3–5", "5–10", "10–30", "≥&#8201;30"];
    let bins: String = bins.iter().enumerate().map(|(k, label)| format!("<span class=\"bin h{k}\">{label}</span>")).collect();
    format!(
        "<p class=\"scale\">{bins}<span>standard deviations</span><span class=\"bin hit\">frame</span><span>significant at the false-alarm rate of the diagnosis</span><span class=\"bin\">·</span><span>no samples</span></p>\n"
    )
}

fn subsystems(place: &Value) -> String {
    let shares: Vec<(&str, f64)> = list(place, "subsystems").iter().filter_map(|s| Some((text(s, "id")?, real(s, "share")?))).collect();
    if shares.is_empty() {
        return String::new();
    }
    let row = |(id, share): &(&str, f64)| {
        format!(
            "<tr><th scope=\"row\">{}</th><td class=\"num\">{}</td><td class=\"wide\"><span class=\"bar\"><i style=\"width:{:.1}%\"></i></span></td></tr>",
            escape(&title(id)),
            percent(*share),
            100.0 * share.clamp(0.0, 1.0)
        )
    };
    let rows: String = shares.iter().map(row).collect();
    format!(
        "<h3>Share of the gap per subsystem</h3>\n<table class=\"bars\"><thead class=\"unseen\"><tr><th scope=\"col\">Subsystem</th>\
         <th scope=\"col\">Share</th><th scope=\"col\">Bar</th></tr></thead><tbody>{rows}</tbody></table>\n"
    )
}
