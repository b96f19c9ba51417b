//! Limits of detection and manoeuvres to drive next: the picture that `kisspoint plan` writes, and two tables of the report.

use super::chart::Scale;
use super::names;
use super::text::{capitalised, escape, number, plain, probability, words};
use serde_json::Value;
use std::fmt::Write as _;

const WIDTH: f64 = 860.0;
const ROW: f64 = 21.0;
const LEFT: f64 = 300.0;
const RIGHT: f64 = 70.0;
const TOP: f64 = 34.0;
const BOTTOM: f64 = 40.0;
/// Colours that colour-blind readers can tell apart, also in print.
const SHOWN: &str = "#0072b2";
const HIDDEN: &str = "#d55e00";

/// Limit of detection of one effect, relative to the size of a usual fault; not finite if nothing shows the effect.
struct Mark<'a> {
    id: &'a str,
    now: f64,
    best: Option<f64>,
}

/// The picture of a plan, from its JSON.
pub fn svg(plan: &Value) -> String {
    let effects: Vec<&Value> = plan["effects"].as_array().into_iter().flatten().collect();
    let marks: Vec<Mark> = effects
        .iter()
        .map(|e| {
            let best = e["shown_best_by"]["relative"].as_f64();
            Mark { id: e["id"].as_str().unwrap_or_default(), now: e["relative"].as_f64().unwrap_or(f64::INFINITY), best }
        })
        .collect();
    // Before measuring, the limit of the best manoeuvre alone is no useful comparison, because the campaign contains that manoeuvre.
    let marks: Vec<Mark> = if plan["campaign"].is_null() { marks.into_iter().map(|m| Mark { best: None, ..m }).collect() } else { marks };
    let (limits, limits_height) = limits(&marks);
    let (bars, bars_height) = worth(&plan["measure_next"]).unwrap_or_default();
    let height = limits_height + bars_height;
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{height}\" viewBox=\"0 0 {WIDTH} {height}\" font-family=\"sans-serif\" \
         font-size=\"13\" color=\"#222\">\n<title>What a campaign shows</title>\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n{limits}\
         <g transform=\"translate(0 {limits_height})\">{bars}</g>\n</svg>\n"
    )
}

/// Both tables for the report of a diagnosis; an empty one is left out.
pub fn figures(diagnosis: &Value) -> String {
    let mut out = String::new();
    out += &worth_table(&diagnosis["measure_next"]);
    let mut marks: Vec<Mark> = diagnosis["which"]["ranked"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(|r| {
            let usual = r["smallest_visible"]["usual"].as_f64()?;
            Some(Mark { id: r["id"].as_str()?, now: r["smallest_visible"]["size"].as_f64()? / usual, best: None })
        })
        .collect();
    marks.sort_by(|a, b| b.now.total_cmp(&a.now));
    if !marks.is_empty() {
        out += &limits_table(&marks);
    }
    out
}

/// A row for each effect, which reflows on a narrow screen: name, limit, and position on a logarithmic scale.
fn limits_table(marks: &[Mark]) -> String {
    let (low, high) = decades(marks);
    let x = Scale { low, high, a: 8.0, b: 232.0 };
    let ticks: String = (low as i32..=high as i32)
        .map(|power| {
            let size = plain(10f64.powi(power), 1);
            format!("<text class=\"tick\" x=\"{:.1}\" y=\"12\" text-anchor=\"middle\">{size}</text>", x.at(f64::from(power)))
        })
        .collect();
    let one = x.at(0.0);
    let row = |m: &Mark| {
        let seen = m.now < 1e3;
        let at = x.at(m.now.log10().clamp(low, high));
        let class = if m.now <= 1.0 { "dot" } else { "dot beyond" };
        let dot = if seen { format!("<circle class=\"{class}\" cx=\"{at:.1}\" cy=\"7\" r=\"4.5\"/>") } else { String::new() };
        format!(
            "<tr><th scope=\"row\">{}</th><td class=\"num\">{}</td><td class=\"drawn\"><svg viewBox=\"0 0 240 14\" aria-hidden=\"true\">\
             <path class=\"null\" d=\"M{one:.1} 0v14\"/>{dot}</svg></td></tr>",
            escape(&capitalised(&names::effect(m.id))),
            if seen { number(m.now, 2) } else { "not shown".to_owned() }
        )
    };
    let rows: String = marks.iter().map(row).collect();
    format!(
        "<h3>How small an effect would show</h3>\n<p>The smallest size of each effect that these recordings would show with 95\u{202f}% probability, in sizes of a usual fault. \
         Right of the line, a usual fault could go unseen.</p>\n\
         <table class=\"plain limits\"><thead><tr><th scope=\"col\">Effect</th><th scope=\"col\" class=\"num\">Limit</th><th scope=\"col\">\
         <svg viewBox=\"0 0 240 16\" role=\"img\" aria-label=\"sizes of a usual fault, logarithmic\" overflow=\"visible\">{ticks}</svg></th></tr></thead><tbody>{rows}</tbody></table>\n"
    )
}

/// Exponents of the powers of ten between which all limits lie.
fn decades(marks: &[Mark]) -> (f64, f64) {
    let finite = marks.iter().flat_map(|m| [Some(m.now), m.best]).flatten().filter(|x| x.is_finite() && *x > 0.0 && *x < 1e3);
    let (low, high) = finite.fold((0.1f64, 10.0f64), |(a, b), x| (a.min(x), b.max(x)));
    (low.log10().floor(), high.log10().ceil())
}

/// A row for each manoeuvre; empty if nothing is open.
fn worth_table(next: &Value) -> String {
    let all: Vec<&Value> = next["manoeuvres"].as_array().into_iter().flatten().collect();
    let rate = |m: &Value| m["nats_per_minute"].as_f64().unwrap_or(0.0).max(0.0);
    let most = all.iter().map(|m| rate(m)).fold(0.0, f64::max);
    if most <= 0.0 {
        return String::new();
    }
    let row = |m: &&Value| {
        format!(
            "<tr><th scope=\"row\">{}</th><td class=\"num\">{}</td><td class=\"num\">{:.0}\u{202f}%</td><td class=\"wide\"><span class=\"bar after\"><i style=\"width:{:.1}%\"></i></span></td></tr>",
            escape(&words(m["name"].as_str().unwrap_or_default())),
            plain(rate(m), 2),
            100.0 * m["splits"].as_f64().unwrap_or(0.0),
            100.0 * rate(m) / most
        )
    };
    let rows: String = all.iter().map(row).collect();
    format!(
        "<h3>What each manoeuvre would tell</h3>\n<p>Evidence that one more recording is expected to give about what is still open, per minute with its preparation, and the chance that it settles it.</p>\n\
         <table class=\"bars worth\"><thead><tr><th scope=\"col\">Manoeuvre</th><th scope=\"col\" class=\"num\">Nats per minute</th><th scope=\"col\" class=\"num\">Settles it</th>\
         <th scope=\"col\"><span class=\"unseen\">Drawn</span></th></tr></thead><tbody>{rows}</tbody></table>\n"
    )
}

/// A dot for each effect on a logarithmic scale, crossed by the line that marks a usual fault.
fn limits(marks: &[Mark]) -> (String, f64) {
    let height = TOP + ROW * marks.len() as f64 + BOTTOM;
    let (low, high) = decades(marks);
    let x = |size: f64| LEFT + (size.log10().clamp(low, high) - low) / (high - low) * (WIDTH - LEFT - RIGHT);
    let (top, bottom) = (TOP, height - BOTTOM);
    let mut svg = format!(
        "<text x=\"{LEFT}\" y=\"18\" fill=\"currentColor\">Smallest size that would show, in sizes of a usual fault</text>\n\
         <rect x=\"{a}\" y=\"{top}\" width=\"{w}\" height=\"{h}\" fill=\"{HIDDEN}\" fill-opacity=\"0.08\"/>\n\
         <path d=\"M{one} {top}V{bottom}\" stroke=\"currentColor\" stroke-dasharray=\"4 3\"/>\n",
        a = x(1.0),
        w = WIDTH - RIGHT - x(1.0),
        h = bottom - top,
        one = x(1.0),
    );
    for power in low as i32..=high as i32 {
        let at = x(10f64.powi(power));
        let _ = writeln!(
            svg,
            "<path d=\"M{at} {bottom}v5\" stroke=\"currentColor\"/><text x=\"{at}\" y=\"{}\" text-anchor=\"middle\" fill=\"currentColor\">{}</text>",
            bottom + 20.0,
            plain(10f64.powi(power), 1)
        );
    }
    for (k, m) in marks.iter().enumerate() {
        let y = top + ROW * (k as f64 + 0.5);
        let name = escape(&capitalised(&names::effect(m.id)));
        let _ = write!(svg, "<text x=\"{}\" y=\"{}\" text-anchor=\"end\" fill=\"currentColor\">{name}</text>", LEFT - 12.0, y + 4.5);
        if let Some(best) = m.best.filter(|b| *b < 0.8 * m.now) {
            let _ = write!(
                svg,
                "<path d=\"M{} {y}H{}\" stroke=\"{SHOWN}\" stroke-dasharray=\"2 3\"/><circle cx=\"{}\" cy=\"{y}\" r=\"4.5\" fill=\"none\" stroke=\"{SHOWN}\"/>",
                x(best),
                x(m.now),
                x(best)
            );
        }
        if m.now < 1e3 {
            let colour = if m.now <= 1.0 { SHOWN } else { HIDDEN };
            let _ = writeln!(
                svg,
                "<circle cx=\"{at}\" cy=\"{y}\" r=\"5\" fill=\"{colour}\"/><text x=\"{}\" y=\"{}\" fill=\"currentColor\" stroke=\"white\" stroke-width=\"3\" paint-order=\"stroke\">{}</text>",
                x(m.now) + 9.0,
                y + 4.5,
                plain(m.now, 2),
                at = x(m.now)
            );
        } else {
            let _ = writeln!(svg, "<text x=\"{}\" y=\"{}\" text-anchor=\"end\" fill=\"{HIDDEN}\">not shown</text>", WIDTH - RIGHT, y + 4.5);
        }
    }
    if marks.iter().any(|m| m.best.is_some_and(|b| b < 0.8 * m.now)) {
        let _ =
            writeln!(svg, "<text x=\"{LEFT}\" y=\"{}\" fill=\"currentColor\">hollow: with the best further manoeuvre</text>", height - 3.0);
    }
    (svg, height)
}

/// A bar for each manoeuvre.
fn worth(next: &Value) -> Option<(String, f64)> {
    let all: Vec<&Value> = next["manoeuvres"].as_array()?.iter().collect();
    let most = all.iter().filter_map(|m| m["nats_per_minute"].as_f64()).fold(0.0, f64::max);
    if all.is_empty() || most <= 0.0 {
        return None;
    }
    let height = TOP + ROW * all.len() as f64 + 12.0;
    let mut svg = format!("<text x=\"{LEFT}\" y=\"18\" fill=\"currentColor\">Expected nats per minute, preparation included</text>\n");
    for (k, m) in all.iter().enumerate() {
        let y = TOP + ROW * k as f64;
        let rate = m["nats_per_minute"].as_f64().unwrap_or(0.0);
        let long = rate.max(0.0) / most * (WIDTH - LEFT - RIGHT - 150.0);
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"end\" fill=\"currentColor\">{}</text><rect x=\"{LEFT}\" y=\"{}\" width=\"{long:.1}\" height=\"{}\" fill=\"{SHOWN}\"/>\
             <text x=\"{:.1}\" y=\"{}\" fill=\"currentColor\">{}, {} chance of settling it</text>",
            LEFT - 12.0,
            y + 15.0,
            escape(m["name"].as_str().unwrap_or_default()),
            y + 3.0,
            ROW - 6.0,
            LEFT + long + 8.0,
            y + 15.0,
            plain(rate, 2),
            probability(m["splits"].as_f64().unwrap_or(0.0))
        );
    }
    Some((svg, height))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn every_effect_and_every_manoeuvre_has_its_line() {
        let plan = json!({"campaign": "c", "effects": [
            {"id": "judder", "relative": 0.2, "usual": 0.1, "shown_best_by": {"relative": 0.1}},
            {"id": "clutch_cooling", "relative": null, "usual": 0.3, "shown_best_by": null}],
            "measure_next": {"manoeuvres": [{"name": "a<b", "nats_per_minute": 12.0, "splits": 0.9}]}});
        let svg = svg(&plan);
        assert!(svg.contains("Judder") && svg.contains("not shown") && svg.contains("hollow"));
        assert!(svg.contains("a&lt;b") && svg.contains("12, 90\u{202f}% chance of settling it"));
    }
}
