//! How it was computed: versions, settings, fingerprint, parameters to set in the plant, and how much of each tolerance was used.

use serde_json::{Map, Value};

use super::chart::Scale;
use super::json::{list, text};
use super::text::{escape, fixed, plain, signed, unit};
use super::{Input, absent};
use crate::effects::PARAMETERS;
use crate::vehicle::NUMBERS;

/// The section.
pub fn section(input: &Input) -> String {
    let facts: String =
        input.provenance.iter().map(|(name, value)| format!("<div><dt>{}</dt><dd>{}</dd></div>", escape(name), escape(value))).collect();
    let facts = if facts.is_empty() {
        absent("Versions, settings and the fingerprint of the data are missing.")
    } else {
        format!("<dl class=\"facts\">{facts}</dl>\n")
    };
    facts + &retuned(input.diagnosis) + &tolerances(input.diagnosis)
}

/// Parameters of the plant that differ from the nominal vehicle, those of the chosen effects first.
fn retuned(diagnosis: &Value) -> String {
    let plant = &diagnosis["plant"];
    let (Some(now), Some(nominal)) = (plant["parameters"].as_object(), plant["nominal_parameters"].as_object()) else {
        return absent("The parameters of the retuned plant are missing.");
    };
    let chosen: Vec<String> =
        list(&diagnosis["which"], "effects").iter().filter_map(|e| text(e, "id")).map(|id| format!("effect.{id}.")).collect();
    let changed = now.iter().map(|(name, _)| name).filter(|name| nominal.get(*name) != now.get(*name));
    let (effects, numbers): (Vec<&String>, Vec<&String>) = changed.partition(|name| chosen.iter().any(|c| name.starts_with(c)));
    if effects.is_empty() && numbers.is_empty() {
        return "<p>The plant keeps the numbers of the vehicle file.</p>\n".to_owned();
    }
    let body = |title: &str, names: &[&String]| {
        let rows: String = names.iter().map(|name| row(name, nominal, now)).collect();
        let head = format!("<tr><th scope=\"rowgroup\" colspan=\"3\">{title}</th></tr>");
        if names.is_empty() { String::new() } else { format!("<tbody>{head}{rows}</tbody>") }
    };
    let estimates = if effects.is_empty() {
        ""
    } else {
        " Numbers of effects may differ from the estimates above: among those that the data allow, they are the ones with which free replays of the recordings used in the fit come nearest to the car."
    };
    format!(
        "<h3>What to set in <code>DrivelinePlant.fmu</code></h3>\n<p>Every other parameter keeps the number of the vehicle file. The FMU beside this report has them set; all digits are in plant.ssv and diagnosis.json.{estimates}</p>\n\
         <table class=\"plain settings\"><thead><tr><th scope=\"col\">Variable</th><th scope=\"col\" class=\"num\">Nominal</th><th scope=\"col\" class=\"num\">Retuned</th></tr></thead>{}{}</table>\n",
        body("The effects", &effects),
        body("Numbers of the vehicle file, as the fit moved them", &numbers)
    )
}

fn row(name: &str, nominal: &Map<String, Value>, now: &Map<String, Value>) -> String {
    let shown = |values: &Map<String, Value>| values.get(name).and_then(Value::as_f64).map_or_else(|| "–".to_owned(), |v| plain(v, 4));
    let of_number = NUMBERS.iter().find(|n| n.name == name).map(|n| n.unit);
    let known = of_number.or_else(|| PARAMETERS.iter().find(|p| p.variable == name).map(|p| p.unit));
    format!(
        "<tr><th scope=\"row\"><code>{}</code></th><td class=\"num\">{}</td><td class=\"num\">{} {}</td></tr>",
        escape(name).replace('.', ".<wbr>"),
        shown(nominal),
        shown(now),
        known.map_or_else(String::new, unit)
    )
}

/// A dot at the value, or an arrow at the edge of the scale if the value lies beyond it.
fn mark(z: f64, x: &Scale) -> String {
    let (edge, tip) = if z < 0.0 { (x.at(x.low), -6.0) } else { (x.at(x.high), 6.0) };
    if (x.low..=x.high).contains(&z) {
        format!("<circle class=\"dot\" cx=\"{:.1}\" cy=\"7\" r=\"4.5\"/>", x.at(z))
    } else {
        format!("<path class=\"dot beyond\" d=\"M{:.1} 2v10l{tip:.0} -5z\"/>", edge - 0.5 * tip)
    }
}

/// Estimate of each number in its own standard deviations; a number far from zero was pulled by the data, and may be wrong in the vehicle file.
fn tolerances(diagnosis: &Value) -> String {
    let Some(used) = diagnosis["which"]["tolerances"].as_object().filter(|map| !map.is_empty()) else { return String::new() };
    // An FMU with a learned law has numbers from a fit of its own.
    let kept = match text(diagnosis, "verdict") {
        Some("unexplained") if super::series::holds_law(diagnosis) => {
            ", in the fit behind the verdict; the FMU's numbers, above, go with its empirical law"
        }
        Some("unexplained") => ", in a fit that was discarded",
        _ => "",
    };
    let x = Scale { low: -4.0, high: 4.0, a: 6.0, b: 134.0 };
    let row = |(name, z): (&String, &Value)| {
        let z = z.as_f64()?;
        let drawn = format!(
            "<svg viewBox=\"0 0 140 14\" aria-hidden=\"true\"><rect class=\"noise\" x=\"{:.1}\" width=\"{:.1}\" y=\"0\" height=\"14\"/><path class=\"null\" d=\"M{:.1} 0v14\"/>{}</svg>",
            x.at(-2.0),
            x.at(2.0) - x.at(-2.0),
            x.at(0.0),
            mark(z, &x)
        );
        let shown = if z.abs() < 1e4 { signed(z, 1) } else { fixed(z, 0) };
        Some(format!(
            "<tr><th scope=\"row\"><code>{}</code></th><td class=\"num\">{shown}</td><td class=\"drawn\">{drawn}</td></tr>",
            escape(name).replace('.', ".<wbr>")
        ))
    };
    let rows: String = used.iter().filter_map(row).collect();
    format!(
        "<h3>How far the tolerances were used</h3>\n<p>In standard deviations as the vehicle file declares them{kept}; the band reaches two to either side, an arrow means more than four. \
         A number far outside is wrong in the file, or makes up for something that no effect describes.</p>\n\
         <table class=\"plain tolerances\"><thead><tr><th scope=\"col\">Number</th><th scope=\"col\" class=\"num\">Moved by</th><th scope=\"col\"><span class=\"unseen\">Drawn</span></th></tr></thead><tbody>{rows}</tbody></table>\n"
    )
}
