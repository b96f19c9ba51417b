//! Section on what could not be judged, and what to measure in order to judge it.

use serde_json::Value;

use super::absent;
use super::json::{list, text, texts};
use super::text::{capitalised, enumeration, escape, title};
use super::{names, plan};
use crate::effects::{REGISTRY, find};

/// The section.
pub fn section(diagnosis: &Value) -> String {
    let which = &diagnosis["which"];
    let mut out = next(diagnosis) + &plan::figures(diagnosis);
    if which["not_assessable"].is_array() {
        out += &not_assessable(list(which, "not_assessable"));
    } else {
        out += &absent("Which effects the data cannot show is not stated.");
    }
    let left: Vec<String> = list(diagnosis, "left_out")
        .iter()
        .map(|l| {
            format!(
                "<b>{}</b>: {}",
                escape(text(l, "recording").unwrap_or("unnamed")),
                escape(text(l, "reason").unwrap_or("no reason stated"))
            )
        })
        .collect();
    out += &items("Recordings left out", &left);
    out += &items("Notes", &notes(&texts(diagnosis, "notes")));
    out
}

/// Splits a note on a single recording into the recording's name and the text; `None` for other notes.
pub fn of_recording(note: &str) -> Option<(&str, &str)> {
    note.split_once(": ").filter(|(head, _)| !head.contains(' '))
}

/// Notes in their order; a note that several recordings share is listed once, with their names.
fn notes(all: &[&str]) -> Vec<String> {
    let mut groups: Vec<(&str, Vec<&str>)> = Vec::new();
    for note in all {
        let (recording, what) = of_recording(note).unwrap_or(("", note));
        match groups.iter_mut().find(|g| g.0 == what) {
            Some(group) => group.1.push(recording),
            None => groups.push((what, vec![recording])),
        }
    }
    let one = |(what, names): &(&str, Vec<&str>)| {
        let names: Vec<&str> = names.iter().copied().filter(|n| !n.is_empty()).collect();
        if names.is_empty() { escape(&capitalised(what)) } else { format!("<b>{}</b>: {}", escape(&names.join(", ")), escape(what)) }
    };
    groups.iter().map(one).collect()
}

fn items(heading: &str, items: &[String]) -> String {
    if items.is_empty() {
        return String::new();
    }
    let list: String = items.iter().map(|i| format!("<li>{i}</li>")).collect();
    format!("<h3>{heading}</h3>\n<ul>{list}</ul>\n")
}

/// Measurements that show more of a subsystem whose gap no effect of the library explains.
const CLOSER_LOOKS: [(&str, &str); 7] = [
    (
        "engine",
        "the engine torque with a torque meter behind the flywheel, or torque steps with the clutch open, to check what the ECU reports",
    ),
    ("actuator", "the bearing position with a sensor beside the command, in a chirp and in slow ramps both ways"),
    ("clutch_force", "the clutch torque with a transducer and the bearing position with a sensor, in slow ramps both ways, cold and hot"),
    ("friction", "the clutch torque with a transducer at constant position, with slip and disc temperature varied one at a time"),
    ("thermal", "the disc temperature with a thermocouple, in repeated launches and while cooling, open and locked"),
    (
        "driveline",
        "the load in a coast-down with the clutch open, and the wheel speed beside the disc speed for whatever lies between them",
    ),
    ("sensors", "both speeds against an encoder, or each other in a locked drive with steps: gain, delay and filtering"),
];

/// Measurements that would split the ambiguity groups, or show more of a gap without a cause.
fn next(diagnosis: &Value) -> String {
    let which = &diagnosis["which"];
    let unknown = text(&diagnosis["where"], "unexplained_at");
    let look = CLOSER_LOOKS.iter().find(|(id, _)| Some(*id) == unknown);
    let look = look.map(|(id, how)| format!("To find what the library lacks in <b>{}</b>, measure {how}.", escape(&names::place(id))));
    let splits = list(which, "effects").iter().filter_map(|e| {
        let group: Vec<String> = text(e, "id").into_iter().chain(texts(e, "ambiguous_with")).map(|id| escape(&names::effect(id))).collect();
        let how = text(e, "separated_by").filter(|_| group.len() > 1)?;
        Some(format!("{}: this would tell {} apart.", escape(&title(how.trim_end_matches('.'))), enumeration(&group)))
    });
    items("Measure next", &look.into_iter().chain(splits).collect::<Vec<_>>())
}

/// Effects that are not assessable, grouped by the measurement that would help, because measurements are what gets planned.
fn not_assessable(entries: &[Value]) -> String {
    if entries.is_empty() {
        return "<p>Every effect in the library could be judged from these recordings.</p>\n".to_owned();
    }
    let mut groups: Vec<(&str, Vec<String>)> = Vec::new();
    for entry in entries {
        let id = text(entry, "id").or(entry.as_str()).unwrap_or("unnamed");
        let known = find(id).map(|k| REGISTRY[k].effect.shown_by);
        let measure = text(entry, "measure").or(known).unwrap_or("not stated");
        match groups.iter_mut().find(|g| g.0 == measure) {
            Some(group) => group.1.push(escape(&names::effect_title(id))),
            None => groups.push((measure, vec![escape(&names::effect_title(id))])),
        }
    }
    let rows: String = groups
        .iter()
        .map(|(measure, ids)| format!("<tr><th scope=\"row\">{}</th><td>{}</td></tr>", ids.join(", "), escape(measure)))
        .collect();
    format!(
        "<h3>Not assessable from these recordings</h3>\n<table class=\"plain\"><thead><tr><th scope=\"col\">Effect</th><th scope=\"col\">What to measure</th></tr></thead>\
         <tbody>{rows}</tbody></table>\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_notes_of_several_recordings_stand_there_once() {
        let all =
            ["r01: n: rpm converted to rad/s", "r02: n: rpm converted to rad/s", "No torque transducer: force and friction <look> alike."];
        assert_eq!(
            notes(&all),
            ["<b>r01, r02</b>: n: rpm converted to rad/s", "No torque transducer: force and friction &lt;look&gt; alike."]
        );
    }
}
