//! Which: the effects chosen with their parameters, and every candidate with its evidence.

use serde_json::Value;

use super::absent;
use super::chart::Scale;
use super::json::{list, real, text, texts};
use super::text::{enumeration, escape, estimate, fixed, meaning as readable, number, percent, title, unit, words};
use crate::effects::{PARAMETERS, REGISTRY};

/// The section.
pub fn section(diagnosis: &Value) -> String {
    let which = &diagnosis["which"];
    let effects: String = list(which, "effects").iter().map(effect).collect();
    let chosen =
        if effects.is_empty() { absent("No effect was added to the model.") } else { format!("<div class=\"effects\">{effects}</div>\n") };
    format!("{chosen}{}", ranked(list(which, "ranked"), !effects.is_empty()))
}

fn effect(e: &Value) -> String {
    let id = text(e, "id").unwrap_or("unnamed");
    let probability = real(e, "probability").map_or_else(|| "not stated".to_owned(), percent);
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
        "<article class=\"effect\"><h3>{} <code>{}</code></h3><p class=\"probability\">Probability <strong>{probability}</strong></p>{parameters}{}</article>",
        escape(&title(id)),
        escape(id),
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

/// Estimate and interval beside the value at which the effect is absent.
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
        return absent("Whether these data tell it from other effects was not stated.");
    }
    let others: Vec<String> = texts(e, "ambiguous_with").iter().map(|id| format!("<b>{}</b>", escape(&words(id)))).collect();
    if others.is_empty() {
        return "<p class=\"ambiguity\">These data tell it apart from every other effect that can be assessed.</p>".to_owned();
    }
    let split =
        text(e, "separated_by").map_or_else(String::new, |how| format!(" To split the group: {}.", escape(how.trim_end_matches('.'))));
    format!(
        "<p class=\"ambiguity\"><span class=\"pill warn\"><span aria-hidden=\"true\">≈</span> Ambiguous</span> These data can’t tell it from {}.{split}</p>",
        enumeration(&others)
    )
}

/// Rejected candidates of one reason that are listed in a paragraph, not each in a row of its own, from this number on.
const MANY: usize = 3;

fn ranked(candidates: &[Value], chosen: bool) -> String {
    if candidates.is_empty() {
        return absent("The ranking of all candidates was not handed over.");
    }
    let most = candidates.iter().filter_map(|c| real(c, "evidence")).fold(0.0, f64::max);
    // Whatever stands out has a row; the many that do not share a paragraph.
    let trifling = |c: &Value| text(c, "verdict") == Some("rejected") && real(c, "evidence").is_some_and(|e| e < 0.05 * most);
    let (rest, rows): (Vec<&Value>, Vec<&Value>) = candidates.iter().partition(|c| trifling(c));
    let (rest, rows) = if rest.len() < MANY { (Vec::new(), candidates.iter().collect()) } else { (rest, rows) };
    let rows: String = rows.iter().map(|c| candidate(c, most, chosen)).collect();
    format!(
        "<h3>Every candidate</h3>\n<p>Evidence is the gain in log-likelihood over the model without the effect, in nats; noise alone gives half a nat per parameter on average. \
         Of an effect that was screened out it is what a linear model promises, which may be less than nothing.</p>\n\
         <div class=\"scroll\" role=\"region\" aria-label=\"Candidates\" tabindex=\"0\"><table class=\"ranked\"><thead><tr><th scope=\"col\">Effect</th>\
         <th scope=\"col\" colspan=\"2\">Evidence</th><th scope=\"col\">Verdict</th><th scope=\"col\">Why</th></tr></thead><tbody>{rows}</tbody></table></div>\n{}",
        trifles(&rest, chosen)
    )
}

/// Rejected candidates by reason: names with their evidence.
fn trifles(rest: &[&Value], chosen: bool) -> String {
    let mut groups: Vec<(String, Vec<String>)> = Vec::new();
    for c in rest {
        let name =
            format!("{} <span class=\"num\">{}</span>", escape(&words(text(c, "id").unwrap_or("unnamed"))), nats(real(c, "evidence")));
        let why = reason(c, chosen);
        match groups.iter_mut().find(|g| g.0 == why) {
            Some(group) => group.1.push(name),
            None => groups.push((why, vec![name])),
        }
    }
    let items: String = groups.iter().map(|(why, names)| format!("<li><b>{}</b>: {}</li>", escape(why), names.join(", "))).collect();
    if items.is_empty() { items } else { format!("<p>Rejected, each with its evidence:</p>\n<ul class=\"trifles\">{items}</ul>\n") }
}

/// Why, in the words of diagnosis.json; there is no chosen explanation to compare with where nothing was chosen.
fn reason(c: &Value, chosen: bool) -> String {
    let why = text(c, "reason").unwrap_or("");
    if chosen {
        why.to_owned()
    } else {
        why.replace("it leaves more unexplained than the chosen explanation", "it does not earn its place")
    }
}

fn nats(evidence: Option<f64>) -> String {
    evidence.map_or_else(|| "–".to_owned(), |e| fixed(e, usize::from(e.abs() < 10.0)))
}

fn candidate(c: &Value, most: f64, chosen: bool) -> String {
    let evidence = real(c, "evidence");
    let bar = evidence.filter(|_| most > 0.0).map_or_else(String::new, |e| {
        format!("<span class=\"bar\"><i style=\"width:{:.1}%\"></i></span>", 100.0 * (e / most).clamp(0.0, 1.0))
    });
    let verdict = text(c, "verdict").unwrap_or("not stated");
    let (class, mark) = match verdict {
        "chosen" => ("good", "✓"),
        "ambiguous" => ("warn", "≈"),
        "not assessable" => ("plain", "–"),
        "rejected" => ("plain", "✕"),
        _ => ("plain", "·"),
    };
    format!(
        "<tr class=\"{class}\"><th scope=\"row\">{}</th><td class=\"num\">{}</td><td class=\"wide\">{bar}</td>\
         <td><span class=\"pill {class}\"><span aria-hidden=\"true\">{mark}</span> {}</span></td><td class=\"why\">{}</td></tr>",
        escape(&title(text(c, "id").unwrap_or("unnamed"))),
        nats(evidence),
        escape(verdict),
        escape(&reason(c, chosen))
    )
}
