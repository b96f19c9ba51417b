//! `documentation/index.html` of an FMU, from its model description.

use super::Model;
use super::description::attribute;
use std::fmt::Write;

const STYLE: &str = "body{font:15px/1.5 sans-serif;max-width:70em;margin:2em auto;padding:0 1em;color:#222}\
table{border-collapse:collapse;font-size:13px}td,th{border:1px solid #bbb;padding:.2em .6em;text-align:left}th{background:#eee}\
td.n{text-align:right;font-family:monospace}code{font-size:95%}";

const PLANT: &str = "<p>A car's driveline with a dry clutch, as the engine and the gearbox actuator see it: engine torque asked for and \
throwout position go in, speeds, torques and temperatures come out. Friction depends on slip and temperature, the cushion spring \
begins to carry at its true contact point, disc and body warm up, and lock-up and break-away are located inside a step: results do \
not depend on the communication step.</p>\
<p>The parameters <code>effect.*</code> are what a real car has beyond this model. All are off at their start values and may be \
set at any time; they take effect with the next step, and states carry on without a jump.</p>";

const CONTROLLER: &str = "<p>Engagement controller: two speed references, PI controllers with decoupling, feedforward through the inverse \
torque map at the estimated temperature, and feedback of the observed clutch torque. At lock-up the position goes to its maximum. \
<code>engage</code> opens and closes the clutch at any moment.</p>\
<p>Implausible inputs do not reach its states: they are bridged with the last good values, then the clutch opens; the output \
<code>fault</code> says what is wrong. The measured inputs take any value, also NaN, so that what a failed sensor says gets there.</p>";

const COMMON: &str = "<h2>Use</h2><ul>\
<li>FMI 2.0 for co-simulation. Any communication step, also a varying one, up to 1000 s; inputs are held over a step, or follow their derivatives.</li>\
<li>Outputs change in initialization and with steps, not when inputs are set: there is no direct feedthrough, so no algebraic loop.</li>\
<li>States can be saved, restored and serialized; instances are independent of each other, in any number of threads.</li>\
<li>Values that are not finite or out of bounds are refused with a log message that names variable, value and bounds; the instance \
goes on with the value before.</li>\
<li>After initialization nothing is allocated, no lock taken and no system call made.</li>\
<li><code>resources/vehicle.json</code> holds the vehicle's numbers. A start value that the importer sets wins over it.</li></ul>";

/// The page, from the completed model description.
pub fn page(model: &Model, xml: &str) -> String {
    let name = model.description.name;
    let summary = if name == "DrivelinePlant" { PLANT } else { CONTROLLER };
    let mut text = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{name}</title><style>{STYLE}</style></head><body>\n\
         <h1>{name}</h1>\n<p>Version {}, GUID <code>{}</code></p>\n{summary}\n{COMMON}\n<h2>Variables</h2>\n",
        env!("CARGO_PKG_VERSION"),
        xml.lines().find_map(|line| attribute(line, "guid")).unwrap_or_default()
    );
    for (title, wanted) in [("Inputs", "input"), ("Outputs", "output"), ("Parameters", "parameter")] {
        section(&mut text, title, wanted, model, xml);
    }
    text.push_str("</body></html>\n");
    text
}

fn section(text: &mut String, title: &str, causality: &str, model: &Model, xml: &str) {
    let head = "<table><tr><th>name<th>unit<th>start<th>least<th>greatest<th>variability<th>meaning</tr>";
    writeln!(text, "<h3>{title}</h3>\n{head}").expect("a String takes all text");
    for line in xml.lines().filter(|l| l.contains("<ScalarVariable") && attribute(l, "causality") == Some(causality)) {
        let get = |key| attribute(line, key).unwrap_or("");
        let unit = model.description.variables.iter().find(|v| v.name == get("name")).map_or("", |v| v.unit);
        writeln!(
            text,
            "<tr><td><code>{}</code><td>{unit}<td class=n>{}<td class=n>{}<td class=n>{}<td>{}<td>{}</tr>",
            get("name"),
            get("start"),
            get("min"),
            get("max"),
            get("variability"),
            get("description"),
        )
        .expect("a String takes all text");
    }
    text.push_str("</table>\n");
}
