//! How it was computed: versions, settings, fingerprint, and what to set in the plant.

use serde_json::Value;

use super::text::{escape, plain};
use super::{Input, absent};

/// The section.
pub fn section(input: &Input) -> String {
    let facts: String =
        input.provenance.iter().map(|(name, value)| format!("<div><dt>{}</dt><dd>{}</dd></div>", escape(name), escape(value))).collect();
    let facts = if facts.is_empty() {
        absent("Versions, settings and the fingerprint of the data were not handed over.")
    } else {
        format!("<dl class=\"facts\">{facts}</dl>\n")
    };
    format!("{facts}{}", retuned(&input.diagnosis["plant"]))
}

/// Parameters of the plant that differ from the vehicle as it was believed.
fn retuned(plant: &Value) -> String {
    let (Some(now), Some(nominal)) = (plant["parameters"].as_object(), plant["nominal_parameters"].as_object()) else {
        return absent("The parameters of the retuned plant were not handed over.");
    };
    let rows: String = now
        .iter()
        .filter(|(name, value)| nominal.get(*name) != Some(value))
        .map(|(name, value)| {
            let shown = |v: Option<&Value>| v.and_then(Value::as_f64).map_or_else(|| "–".to_owned(), |v| plain(v));
            format!(
                "<tr><th scope=\"row\"><code>{}</code></th><td class=\"num\">{}</td><td class=\"num\">{}</td></tr>",
                escape(name).replace('.', ".<wbr>"),
                shown(nominal.get(name)),
                shown(Some(value))
            )
        })
        .collect();
    if rows.is_empty() {
        return "<p>The plant keeps the numbers of the vehicle file.</p>\n".to_owned();
    }
    format!(
        "<h3>What to set in <code>DrivelinePlant.fmu</code></h3>\n<p>Every other parameter keeps the number of the vehicle file.</p>\n<table class=\"plain\"><thead><tr>\
         <th scope=\"col\">Variable</th><th scope=\"col\">Nominal</th><th scope=\"col\">Retuned</th></tr></thead><tbody>{rows}</tbody></table>\n"
    )
}
