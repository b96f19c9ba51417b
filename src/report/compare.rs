//! One page that compares two answers for one car: what has gone, what is new, what has changed.
//!
//! It shows what `kisspoint compare --json` prints.

use super::json::{flag, list, real, text};
use super::names;
use super::page;
use super::text::{capitalised, enumeration, escape, number, percent, unit};
use serde_json::Value;

/// The changes in one sentence.
pub fn headline(found: &Value) -> String {
    let of = |change: &str| -> Vec<String> {
        list(found, "effects")
            .iter()
            .filter(|e| text(e, "change") == Some(change))
            .filter_map(|e| text(e, "id"))
            .map(names::effect)
            .collect()
    };
    let moved: Vec<String> = list(found, "changes").iter().filter(|c| flag(c, "significant")).map(|c| what(c).0).collect();
    let plural = |name: &String| names::EFFECTS.iter().any(|(id, known)| known == name && names::is_plural(id));
    let is = |all: &[String], one: &str, many: &str| {
        let verb = if all.len() == 1 && !plural(&all[0]) { one } else { many };
        format!("{} {verb}", enumeration(all))
    };
    let mut parts = Vec::new();
    for (change, one, many) in [("gone", "is gone", "are gone"), ("new", "is new", "are new")] {
        let all = of(change);
        if !all.is_empty() {
            parts.push(is(&all, one, many));
        }
    }
    if !moved.is_empty() {
        parts.push(is(&moved, "has changed", "have changed"));
    }
    if parts.is_empty() { "Nothing has changed beyond chance.".to_owned() } else { format!("{}.", capitalised(&parts.join("; "))) }
}

/// The quantity that changed, and its unit.
pub fn what(change: &Value) -> (String, String) {
    let name = text(change, "name").unwrap_or_default();
    match text(change, "effect") {
        Some(effect) => (format!("{} of {}", name, names::effect(effect)), text(change, "unit").unwrap_or_default().to_owned()),
        None => (name.to_owned(), "σ".to_owned()),
    }
}

/// The page; links lead to the two reports.
pub fn html(found: &Value, links: &[String; 2]) -> String {
    let title = ["a", "b"].map(|side| text(&found[side], "name").unwrap_or_default().to_owned()).join(" and ");
    let sides: String = ["a", "b"].iter().zip(links).map(|(side, link)| tile(&found[*side], link)).collect();
    let effects: String = list(found, "effects").iter().map(effect).collect();
    let changes: String = list(found, "changes").iter().map(change).collect();
    let other = list(found, "other_numbers_in_vehicle_file");
    let warning = if other.is_empty() {
        String::new()
    } else {
        format!(
            "<ul class=\"doubts\"><li class=\"grave\">The two vehicle files differ in {} numbers: what lies within their tolerances is not compared.</li></ul>",
            other.len()
        )
    };
    let table = |head: &str, rows: &str, none: &str| {
        if rows.is_empty() {
            format!("<p class=\"absent\">{none}</p>")
        } else {
            format!("<div class=\"scroll\"><table class=\"plain\"><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>")
        }
    };
    let sizes = format!(
        "<p>Parameters of effects that both answers name, and numbers of the vehicle file about which the recordings of both have something to say; \
         whatever the tolerance had absorbed is taken out. The probability that any of the marked changes is due to chance is {} (Holm).</p>\n{}",
        percent(real(found, "family_wise_error").unwrap_or(f64::NAN)),
        table(
            "<th scope=\"col\">What</th><th scope=\"col\" class=\"num\">First</th><th scope=\"col\" class=\"num\">Second</th><th scope=\"col\" class=\"num\">Change (95 %)</th><th scope=\"col\">Unit</th>",
            &changes,
            "No parameter or number is informed by both answers.",
        )
    );
    let effects = table(
        "<th scope=\"col\">Effect</th><th scope=\"col\">Change</th><th scope=\"col\">First</th><th scope=\"col\">Second</th>",
        &effects,
        "Neither answer names an effect.",
    );
    page::html(&page::Page {
        title: &title,
        style: "section td small, section th small { display: block; color: var(--muted); }\n",
        header: &format!(
            "<header><p class=\"eyebrow\">Kisspoint comparison: {}</p>\n<h1>{}</h1>\n{warning}<dl class=\"tiles\">{sides}</dl></header>\n",
            escape(&title),
            escape(&headline(found))
        ),
        sections: &[("effects", "Effects", effects), ("sizes", "Sizes and numbers", sizes)],
        data: &[],
        script: "",
    })
}

fn tile(side: &Value, link: &str) -> String {
    let gap = |key: &str| real(side, key).map_or("–".to_owned(), |v| number(v, 3));
    format!(
        "<div><dt><a href=\"{}\">{}</a></dt><dd><strong>{}</strong><span>{} Free replay: {} rad/s off, retuned {}.</span></dd></div>",
        escape(link),
        escape(text(side, "name").unwrap_or_default()),
        escape(&capitalised(&text(side, "verdict").unwrap_or("none").replace('_', " "))),
        escape(text(side, "headline").unwrap_or_default()),
        gap("before"),
        gap("after")
    )
}

fn effect(e: &Value) -> String {
    let id = text(e, "id").unwrap_or_default();
    let change = text(e, "change").unwrap_or_default();
    let tone = match change {
        "gone" => "good",
        "new" => "warn",
        _ => "",
    };
    let sizes = |side: &Value| -> String {
        let one = |(name, p): (&String, &Value)| {
            let get = |key: &str| real(p, key).map_or("?".to_owned(), |v| number(v, 3));
            format!(
                "<code>{}</code> {} {}<small>{} to {}</small>",
                escape(name),
                get("value"),
                unit(text(p, "unit").unwrap_or_default()),
                get("low"),
                get("high")
            )
        };
        side["parameters"].as_object().map_or("–".to_owned(), |all| all.iter().map(one).collect())
    };
    format!(
        "<tr><th scope=\"row\">{}<small>{}</small></th><td><span class=\"pill {tone}\">{}</span></td><td>{}</td><td>{}</td></tr>",
        escape(&names::effect_title(id)),
        escape(id),
        escape(change),
        sizes(&e["a"]),
        sizes(&e["b"])
    )
}

fn change(c: &Value) -> String {
    let get = |key: &str| real(c, key).map_or("?".to_owned(), |v| number(v, 3));
    let (what, in_unit) = what(c);
    let mark = if flag(c, "significant") { " <em>changed</em>" } else { "" };
    format!(
        "<tr><th scope=\"row\">{}{mark}</th><td class=\"num\">{}</td><td class=\"num\">{}</td><td class=\"num\">{}<small>{} to {}</small></td><td>{}</td></tr>",
        escape(&what),
        get("a"),
        get("b"),
        get("by"),
        get("low"),
        get("high"),
        unit(&in_unit)
    )
}
