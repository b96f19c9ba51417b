//! Section "which": the effects chosen with their parameters, and every candidate with its evidence.

use serde_json::Value;

use super::absent;
use super::chart::Scale;
use super::json::{list, real, text, texts};
use super::names;
use super::text::{alternatives, escape, estimate, meaning as readable, number, probability, unit, words};
use crate::effects::{PARAMETERS, REGISTRY};

/// The section.
pub fn section(diagnosis: &Value) -> String {
    let which = &diagnosis["which"];
    let effects: String = list(which, "effects").iter().map(|e| effect(e, which)).collect();
    let chosen =
        if effects.is_empty() { absent("No effect was added to the model.") } else { format!("<div class=\"effects\">{effects}</div>\n") };
    format!("{chosen}{}{}", ranked(diagnosis), correlations(which))
}

fn effect(e: &Value, which: &Value) -> String {
    let id = text(e, "id").unwrap_or("unnamed");
    let ahead = list(which, "ranked").iter().find(|c| text(c, "id") == Some(id)).and_then(|c| real(c, "evidence"));
    let ahead = ahead.map_or_else(String::new, |nats| {
        let side = if nats >= 0.0 { "ahead of" } else { "behind" };
        format!("<strong>{} nats</strong> {side} the best explanation without it", number(nats.abs(), 3))
    });
    let mass = real(e, "probability")
        .map_or_else(|| "probability not stated".to_owned(), |p| format!("probability {} among the explanations compared", probability(p)));
    let parameters = match e["parameters"].as_object() {
        Some(map) if !map.is_empty() => {
            let rows: String = map.iter().map(|(name, p)| parameter(id, name, p)).collect();
            format!(
                "<table class=\"parameters\"><thead><tr><th scope=\"col\">Parameter</th><th scope=\"col\">Value</th><th scope=\"col\">95&#8239;% interval</th>\
                 <th scope=\"col\"><span class=\"unseen\">Interval drawn</span></th></tr></thead><tbody>{rows}</tbody></table>"
            )
        }
        _ => absent("No parameters were stated."),
    };
    format!(
        "<article class=\"effect\"><h3>{} <code>{}</code></h3><p class=\"probability\">{ahead}{} {mass}</p>{parameters}{}</article>",
        escape(&names::with_rivals(id, &texts(e, "ambiguous_with")))
            .replacen(names::effect(id).as_str(), &names::effect_title(id), 1)
            .replace(" or ", " <strong class=\"or\">or</strong> "),
        escape(id),
        if ahead.is_empty() { "" } else { ";" },
        ambiguity(e)
    )
}

fn parameter(id: &str, name: &str, p: &Value) -> String {
    let known = PARAMETERS.iter().position(|k| k.effect == id && k.name == name);
    let meaning = known.map_or("", |k| PARAMETERS[k].meaning);
    let amplitude = known.filter(|k| REGISTRY.iter().any(|entry| entry.effect.amplitudes.contains(k)));
    let null = amplitude.map(|k| PARAMETERS[k].null);
    let unit = escape(&unit(text(p, "unit").unwrap_or("")));
    let value = real(p, "value");
    let (shown, interval, drawn) = match (value, real(p, "low"), real(p, "high")) {
        (Some(value), Some(low), Some(high)) if high > low => {
            let (shown, interval) = estimate([value, low, high]);
            (shown, interval, null.map_or_else(String::new, |null| whisker(value, low, high, null)))
        }
        (Some(value), _, _) => (number(value, 4), "not stated".to_owned(), String::new()),
        _ => ("–".to_owned(), "not stated".to_owned(), String::new()),
    };
    format!(
        "<tr><th scope=\"row\">{}<small>{}</small></th><td class=\"num\"><b>{shown}</b> {unit}</td><td class=\"num\">{interval} {unit}</td><td class=\"drawn\">{drawn}</td></tr>",
        escape(&words(name)),
        escape(&readable(meaning))
    )
}

/// Drawing of estimate and interval, with a mark at the value at which the effect is absent.
fn whisker(value: f64, low: f64, high: f64, null: f64) -> String {
    let (least, most) = super::chart::range([value, low, high, null].iter());
    let x = Scale { low: least, high: most, a: 4.0, b: 136.0 };
    let absent = x.at(null).clamp(18.0, 122.0);
    format!(
        "<svg viewBox=\"0 0 140 30\" aria-hidden=\"true\"><path class=\"null\" d=\"M{absent:.1} 1v16\"/>\
         <text class=\"tick\" x=\"{absent:.1}\" y=\"28\" text-anchor=\"middle\">none</text><path class=\"whisker\" d=\"M{:.1} 9H{:.1}\"/><circle class=\"dot\" cx=\"{:.1}\" cy=\"9\" r=\"4.5\"/></svg>",
        x.at(low),
        x.at(high),
        x.at(value)
    )
}

fn ambiguity(e: &Value) -> String {
    if !e["ambiguous_with"].is_array() {
        return absent("It was not stated whether these data tell it from other effects.");
    }
    let others: Vec<String> = texts(e, "ambiguous_with").iter().map(|id| format!("<b>{}</b>", escape(&names::effect(id)))).collect();
    if others.is_empty() {
        return "<p class=\"ambiguity\">In these recordings no other effect in the library comes close to it.</p>".to_owned();
    }
    let split =
        text(e, "separated_by").map_or_else(String::new, |how| format!(" To tell them apart: {}.", escape(how.trim_end_matches('.'))));
    format!(
        "<p class=\"ambiguity\"><span class=\"pill warn\"><span aria-hidden=\"true\">≈</span> Ambiguous</span> These recordings cannot tell it from {}.{split} The numbers above hold if this one is right.</p>",
        alternatives(&others)
    )
}

/// Parameters whose estimates are correlated with another parameter or with a number of the vehicle file.
fn correlations(which: &Value) -> String {
    let row = |c: &Value| {
        let r = real(c, "coefficient")?;
        let x = Scale { low: -1.0, high: 1.0, a: 4.0, b: 136.0 };
        Some(format!(
            "<tr><th scope=\"row\" class=\"name\"><code>{}</code></th><td><code>{}</code></td><td class=\"num\">{}</td><td class=\"drawn\"><svg viewBox=\"0 0 140 14\" aria-hidden=\"true\">\
             <path class=\"null\" d=\"M70 0v14\"/><path class=\"whisker\" d=\"M70 7H{:.1}\"/></svg></td></tr>",
            escape(text(c, "parameter").unwrap_or("unnamed").trim_start_matches("effect.")).replace('.', ".<wbr>").replace('_', "_<wbr>"),
            escape(text(c, "with").unwrap_or("unnamed").trim_start_matches("effect.")).replace('.', ".<wbr>").replace('_', "_<wbr>"),
            super::text::signed(r, 2),
            x.at(r.clamp(-1.0, 1.0))
        ))
    };
    let rows: String = list(which, "correlations").iter().filter_map(row).collect();
    if rows.is_empty() {
        return String::new();
    }
    format!(
        "<h3>What moves together</h3>\n<p>Correlations of the effects’ parameters with each other and with the tolerances of the vehicle file. Near ±1 the recordings \
         determine only a combination of the two.</p>\n<table class=\"plain tolerances pairs\"><thead><tr><th scope=\"col\">Parameter</th><th scope=\"col\">with</th>\
         <th scope=\"col\" class=\"num\">Correlation</th><th scope=\"col\"><span class=\"unseen\">Drawn</span></th></tr></thead><tbody>{rows}</tbody></table>\n"
    )
}

/// Number of rejected candidates from which they are listed in a paragraph by reason, instead of a row each.
const MANY: usize = 3;

fn ranked(diagnosis: &Value) -> String {
    let candidates = list(&diagnosis["which"], "ranked");
    if candidates.is_empty() {
        return absent("The ranking of all candidates is missing.");
    }
    let law = text(&diagnosis["where"], "unexplained_at");
    // Candidates of interest have a row each; the rest share a paragraph.
    let far = |c: &Value| text(c, "verdict") == Some("rejected") && (screened(c) || real(c, "evidence").is_some_and(|e| e < FAR));
    let (rest, rows): (Vec<&Value>, Vec<&Value>) = candidates.iter().partition(|c| far(c));
    let (rest, rows) = if rest.len() < MANY { (Vec::new(), candidates.iter().collect()) } else { (rest, rows) };
    let rows: String = rows.iter().map(|c| candidate(c, diagnosis, law)).collect();
    format!(
        "<h3>Every candidate</h3>\n<p>By how many nats the best explanation with the effect leads the best one without it (to the right) or trails it (to the left); 2.3 nats are odds of ten to one. \
         For an effect that was never fitted, it is what a linear model makes of it.</p>\n\
         <div class=\"scroll\" role=\"region\" aria-label=\"Candidates\" tabindex=\"0\"><table class=\"ranked\"><thead><tr><th scope=\"col\">Effect</th>\
         <th scope=\"col\" class=\"num\">Nats</th><th scope=\"col\">{}</th><th scope=\"col\">Verdict</th><th scope=\"col\">Why</th></tr></thead><tbody>{rows}</tbody></table></div>\n{}",
        ruler(),
        rejected_by_reason(&rest, law)
    )
}

/// Whether the candidate was never fitted, because a linear model promises less gain than the effect costs.
fn screened(candidate: &Value) -> bool {
    text(candidate, "reason").is_some_and(|why| why.starts_with("screened"))
}

/// Evidence below which a rejected candidate that was fitted has no row of its own, nats.
const FAR: f64 = -30.0;

/// Nats at the ends of the scale; larger values are drawn at the end.
const REACH: f64 = 1e6;

/// Position of an evidence in nats on a scale that is linear near zero and logarithmic beyond.
fn forest_at(nats: f64) -> f64 {
    let edge = (0.5 * REACH).asinh();
    let x = Scale { low: -edge, high: edge, a: 6.0, b: 194.0 };
    x.at((0.5 * nats.clamp(-REACH, REACH)).asinh())
}

fn ruler() -> String {
    let marks: String = [(-1e5, "−10⁵"), (-100.0, "−100"), (0.0, "0"), (100.0, "100"), (1e5, "10⁵")]
        .iter()
        .map(|(m, shown)| format!("<text class=\"tick\" x=\"{:.1}\" y=\"12\" text-anchor=\"middle\">{shown}</text>", forest_at(*m)))
        .collect();
    format!(
        "<svg class=\"forest\" viewBox=\"-10 0 220 16\" role=\"img\" aria-label=\"nats, behind to the left and ahead to the right\">{marks}</svg>"
    )
}

/// Rejected candidates by reason: names with their nats.
fn rejected_by_reason(rest: &[&Value], law: Option<&str>) -> String {
    let mut groups: Vec<(String, Vec<String>)> = Vec::new();
    for c in rest {
        let name = format!(
            "{} <span class=\"num\">{}</span>",
            escape(&names::effect(text(c, "id").unwrap_or("unnamed"))),
            nats(real(c, "evidence"))
        );
        let why = reason(c, law);
        match groups.iter_mut().find(|g| g.0 == why) {
            Some(group) => group.1.push(name),
            None => groups.push((why, vec![name])),
        }
    }
    let items: String = groups.iter().map(|(why, names)| format!("<li><b>{}</b>: {}</li>", escape(why), names.join(", "))).collect();
    if items.is_empty() { items } else { format!("<p>Rejected, in nats:</p>\n<ul class=\"trifles\">{items}</ul>\n") }
}

/// The candidate's reason in plain words; diagnosis.json has its own wording.
fn reason(c: &Value, law: Option<&str>) -> String {
    let why = text(c, "reason").unwrap_or("");
    let fitted = why.contains("nats");
    match (text(c, "verdict"), real(c, "evidence")) {
        (Some("chosen"), _) => "in the most probable explanation".to_owned(),
        (Some("ambiguous"), _) => "may be at work in place of a named one".to_owned(),
        (Some("rejected"), Some(e)) if e > 0.0 => match law {
            Some(place) => format!("it helps alongside a missing law in {}, but does not explain the gap", names::place(place)),
            None => "it stands in for something else".to_owned(),
        },
        (Some("rejected"), _) if fitted => "explanations with it are less probable".to_owned(),
        (Some("rejected"), _) if screened(c) => "improvement too small to accept".to_owned(),
        _ => why.to_owned(),
    }
}

fn nats(evidence: Option<f64>) -> String {
    evidence.map_or_else(|| "–".to_owned(), |e| super::text::signed(e, usize::from(e.abs() < 10.0)))
}

fn candidate(c: &Value, diagnosis: &Value, law: Option<&str>) -> String {
    let evidence = real(c, "evidence");
    let id = text(c, "id").unwrap_or("unnamed");
    let place = evidence.map(forest_at);
    let dot = place.map_or_else(String::new, |x| {
        let zero = forest_at(0.0);
        format!(
            "<svg class=\"forest\" viewBox=\"-10 0 220 16\" aria-hidden=\"true\"><path class=\"null\" d=\"M{zero:.1} 0v16\"/><path class=\"link\" d=\"M{zero:.1} 8H{x:.1}\"/><circle class=\"dot\" cx=\"{x:.1}\" cy=\"8\" r=\"4.5\"/></svg>"
        )
    });
    let verdict = text(c, "verdict").unwrap_or("not stated");
    let own = list(&diagnosis["which"], "effects").iter().find(|e| text(e, "id") == Some(id));
    let rivals: Vec<String> = own.map(|e| texts(e, "ambiguous_with").into_iter().map(names::effect).collect()).unwrap_or_default();
    let (class, mark) = match verdict {
        "chosen" if !rivals.is_empty() => ("warn", "≈"),
        "chosen" => ("good", "✓"),
        "ambiguous" => ("warn", "≈"),
        "not assessable" => ("plain", "–"),
        "rejected" => ("plain", "✕"),
        _ => ("plain", "·"),
    };
    let said = if rivals.is_empty() {
        escape(verdict)
    } else {
        format!("chosen, <strong class=\"or\">or</strong> {}", escape(&alternatives(&rivals)))
    };
    format!(
        "<tr class=\"{class}\"><th scope=\"row\">{}<small><code>{}</code></small></th><td class=\"num\">{}</td><td class=\"wide\">{dot}</td>\
         <td><span class=\"pill {class}\"><span aria-hidden=\"true\">{mark}</span> {said}</span></td><td class=\"why\">{}</td></tr>",
        escape(&names::effect_title(id)),
        escape(id),
        nats(evidence),
        escape(&reason(c, law))
    )
}
