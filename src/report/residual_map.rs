//! Section "where": gap of each balance equation in each phase and region, and the share of each subsystem.

use serde_json::Value;

use super::json::{flag, list, real, text, texts};
use super::names::place as named_place;
use super::text::{capitalised, enumeration, escape, number, percent, title, unit};
use super::verdict::or_places;
use super::{Input, absent};

/// Bounds between the shades, in standard deviations.
const SHADES: [f64; 5] = [2.0, 3.0, 5.0, 10.0, 30.0];

/// Equations in the order in which torque flows: name, the subsystems whose gap they show first, and what each compares. Other equations follow in the order of the answer.
const EQUATIONS: [(&str, &str, &str); 5] = [
    (
        "engine balance",
        "engine torque, clutch force, friction",
        "flywheel speed: torque missing on the flywheel in J_f ω̇_f = T_e − T_fc − b_f ω_f",
    ),
    ("bearing position", "actuator", "position of the throwout bearing"),
    ("clutch torque", "clutch force, friction", "torque by the transducer"),
    ("disc temperature", "heat balance", "temperature by the thermocouple"),
    ("driveline balance", "driveline, clutch force, friction", "disc speed: torque missing on the disc in J_c ω̇_c = T_fc − T_L − b_c ω_c"),
];

/// Phases in the order in which the clutch closes.
const PHASES: [&str; 3] = ["open", "slipping", "locked"];

/// The section.
pub fn section(input: &Input) -> String {
    let place = &input.diagnosis["where"];
    let entries = list(place, "equations");
    if entries.is_empty() {
        return lead(input.diagnosis) + &absent("The gap per equation, phase and region is missing.");
    }
    let hidden = text(place, "primary").is_some() && !entries.iter().any(|e| flag(e, "significant"));
    let hidden = if hidden { HIDDEN } else { "" };
    let after = list(place, "equations_after");
    let named = !list(&input.diagnosis["which"], "effects").is_empty();
    let switch = if after.is_empty() || !named { "" } else { SWITCH };
    let maps =
        if switch.is_empty() { map(entries, place, "") } else { map(entries, place, "map-before") + &map(after, place, "map-after") };
    lead(input.diagnosis) + hidden + switch + &maps + &how_to_read(entries, input.regions)
}

/// Buttons that switch between the maps. Both maps are in the page; without a script they appear one below the other.
const SWITCH: &str = "<div class=\"tools live\" role=\"group\" aria-label=\"Residual map\">\
    <button type=\"button\" data-map=\"map-before\" aria-pressed=\"true\">without the effects</button>\
    <button type=\"button\" data-map=\"map-after\" aria-pressed=\"false\">with the effects</button></div>\n";

/// Sentence for a gap that shows in no cell of the map.
const HIDDEN: &str = "<p>No cell stands out: spread over phases and regions, this gap is too faint to show in any one of them. It takes all recordings \
    together to show it.</p>\n";

/// Subsystems by decreasing share, with the primary one first.
pub fn subsystems(place: &Value) -> Vec<&str> {
    let mut shares: Vec<(&str, f64)> = list(place, "subsystems").iter().filter_map(|s| Some((text(s, "id")?, real(s, "share")?))).collect();
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    ordered(&text(place, "primary").into_iter().collect::<Vec<_>>(), shares.into_iter().map(|s| s.0))
}

fn lead(diagnosis: &Value) -> String {
    let place = &diagnosis["where"];
    let partly = text(diagnosis, "verdict") == Some("partly_explained");
    let primary = match text(place, "primary") {
        Some(id) => {
            let all: Vec<&str> = std::iter::once(id).chain(texts(place, "ambiguous_with")).collect();
            let others: Vec<String> = subsystems(place).iter().skip(1).map(|id| format!("<b>{}</b>", escape(&named_place(id)))).collect();
            let then = if others.is_empty() { String::new() } else { format!(", and then in {}", enumeration(&others)) };
            if partly {
                format!("The gap lies in <b>{}</b>{then}.", escape(&named_place(id)))
            } else {
                format!("The gap lies in {}{then}.", or_places(&all))
            }
        }
        None if text(diagnosis, "verdict") == Some("inputs_do_not_fit") => {
            "No subsystem can be named, because the inputs do not fit.".to_owned()
        }
        None => "No subsystem shows a gap.".to_owned(),
    };
    let remainder = text(place, "unexplained_at").filter(|_| partly).map_or_else(String::new, |id| {
        let all: Vec<&str> = std::iter::once(id).chain(texts(place, "ambiguous_with")).collect();
        format!(" <span class=\"pill warn\"><span aria-hidden=\"true\">◐</span> Unaccounted for: something in {}</span>", or_places(&all))
    });
    let irregular = texts(place, "irregular");
    let irregular = if irregular.is_empty() { String::new() } else { format!(" What is irregular: {}.", escape(&irregular.join("; "))) };
    format!("<p>{primary}{remainder}{irregular}</p>\n")
}

/// The names that occur in `found`, known ones first and in the order of `known`.
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

fn map(entries: &[Value], place: &Value, id: &str) -> String {
    let equations = ordered(&EQUATIONS.map(|e| e.0), entries.iter().filter_map(|e| text(e, "equation")));
    let phases = ordered(&PHASES, entries.iter().filter_map(|e| text(e, "phase")));
    let shows = |e: &str| EQUATIONS.iter().find(|k| k.0 == e).map_or_else(String::new, |k| format!("<small>{}</small>", k.1));
    let head: String = equations.iter().map(|e| format!("<th scope=\"col\">{}{}</th>", escape(&title(e)), shows(e))).collect();
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
        "<div class=\"map {id}\"><div class=\"scroll\" role=\"region\" aria-label=\"Residual map{}\" tabindex=\"0\"><table class=\"heat\">\
         <caption><span>{} How far each gap is beyond noise, in standard deviations of a test over all samples of the cell, with the rms error below. The model is corrected at every sample, so errors do not accumulate.</span></caption>\
         <thead><tr><th scope=\"col\">Phase</th><th scope=\"col\">Region</th>{head}</tr></thead><tbody>{rows}</tbody></table></div></div>\n{}",
        if id == "map-after" { ", with the effects" } else { "" },
        if id == "map-after" {
            "What is left once the named effects are in."
        } else {
            "Without any effect, at the vehicle numbers that go with the verdict."
        },
        if id == "map-before" { String::new() } else { scale(real(place, "family_wise_error")) }
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
    // Digits of a value that is practically zero carry no information.
    let shown = if sigma.abs() < LEAST { format!("&lt;&#8201;{LEAST}") } else { number(sigma, 2) };
    format!("<td class=\"h{}{mark}\"{samples}><b>{shown}</b>{said}{rms}</td>", shade(sigma))
}

fn shade(sigma: f64) -> usize {
    SHADES.iter().filter(|bound| sigma.abs() >= **bound).count()
}

fn scale(error: Option<f64>) -> String {
    let rate = error.map_or_else(|| "significant".to_owned(), |e| format!("significant (family-wise error {})", percent(e)));
    let bins = ["&lt;&#8201;2", "2–3", "3–5", "5–10", "10–30", "≥&#8201;30"];
    let bins: String = bins.iter().enumerate().map(|(k, label)| format!("<span class=\"bin h{k}\">{label}</span>")).collect();
    format!(
        "<p class=\"scale\">{bins}<span>standard deviations</span><span class=\"pair\"><span class=\"bin hit\">framed</span> {rate}</span><span class=\"pair\"><span class=\"bin\">·</span> no samples</span></p>\n"
    )
}

/// Standard deviations below which a cell shows only an upper bound.
const LEAST: f64 = 0.1;

/// Explains columns and rows of the map, and what a cell does not show.
fn how_to_read(entries: &[Value], regions: &str) -> String {
    let known = EQUATIONS.iter().filter(|(name, _, _)| entries.iter().any(|e| text(e, "equation") == Some(name)));
    let columns: String = known.map(|(name, _, meaning)| format!("<div><dt>{}</dt><dd>{meaning}</dd></div>", title(name))).collect();
    let regions = if regions.is_empty() { String::new() } else { format!(" {}.", escape(&capitalised(regions))) };
    format!(
        "<p class=\"hint\">Under each column’s name are the subsystems whose errors show there first. A cell says where the gap shows, not where it comes from: a wrong clutch force also heats the disc wrongly, and shows in both balances. \
         The subsystem named is that of the effect that explains all cells together or, if there is none, that of the balance that any explanation has to change.{regions}</p>\n\
         <dl class=\"columns\">{columns}</dl>\n"
    )
}
