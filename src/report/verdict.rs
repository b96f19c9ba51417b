//! The verdict in a sentence, its confidence, and the answer to each question in a few words.

use serde_json::Value;

use super::json::{list, real, text};
use super::text::{enumeration, escape, number, percent, title, words};

/// The sentence that stands above everything.
pub fn sentence(diagnosis: &Value) -> String {
    if let Some(said) = text(diagnosis, "sentence") {
        return said.to_owned();
    }
    let effects = match effect_names(diagnosis) {
        names if names.is_empty() => "effects that are not named".to_owned(),
        names => enumeration(&names),
    };
    let place = |key| text(&diagnosis["where"], key).map_or_else(|| "an unnamed subsystem".to_owned(), words);
    match text(diagnosis, "verdict") {
        Some("no_gap") => "The car behaves as its model says, within noise and tolerances.".to_owned(),
        Some("explained") => format!("The gap is explained by {effects}."),
        Some("partly_explained") => {
            format!("Part of the gap is explained by {effects}; a structured remainder lies in {}.", place("unexplained_at"))
        }
        Some("unexplained") => format!("There is a gap in {} that no effect of the library explains.", place("primary")),
        _ => "The diagnosis holds no verdict.".to_owned(),
    }
}

/// Names of the effects chosen, as words.
pub fn effect_names(diagnosis: &Value) -> Vec<String> {
    list(&diagnosis["which"], "effects").iter().filter_map(|e| text(e, "id")).map(words).collect()
}

/// Header of the report.
pub fn section(diagnosis: &Value) -> String {
    let (mark, class, name) = match text(diagnosis, "verdict") {
        Some("no_gap") => ("✓", "good", "No gap"),
        Some("explained") => ("✓", "good", "Explained"),
        Some("partly_explained") => ("◐", "warn", "Partly explained"),
        Some("unexplained") => ("?", "bad", "Unexplained"),
        _ => ("–", "warn", "No verdict"),
    };
    let tiles: String = tiles(diagnosis).iter().map(|(name, value, note)| tile(name, value, note)).collect();
    format!(
        "<header id=\"verdict\">\n<p class=\"eyebrow\">Kisspoint · diagnosis of the sim-to-real gap</p>\n\
         <p class=\"pill {class}\"><span aria-hidden=\"true\">{mark}</span> {name}</p>\n<h1>{}</h1>\n{}<dl class=\"tiles\">{tiles}</dl>\n</header>\n",
        escape(&sentence(diagnosis)),
        confidence(diagnosis),
    )
}

fn confidence(diagnosis: &Value) -> String {
    match real(diagnosis, "confidence") {
        Some(share) => {
            let width = 100.0 * share.clamp(0.0, 1.0);
            format!(
                "<p class=\"confidence\"><span>Confidence <strong>{}</strong></span>\
                 <span class=\"meter\" aria-hidden=\"true\"><i style=\"width:{width:.1}%\"></i></span></p>\n",
                percent(share)
            )
        }
        None => "<p class=\"confidence\"><span>Confidence: not stated</span></p>\n".to_owned(),
    }
}

/// Name, answer, and a word of explanation.
fn tiles(diagnosis: &Value) -> Vec<(&'static str, String, String)> {
    let (place, far) = (&diagnosis["where"], &diagnosis["how_far"]);
    let primary = text(place, "primary").map_or_else(|| "No subsystem".to_owned(), title);
    let share = list(place, "subsystems").iter().find(|s| text(s, "id") == text(place, "primary")).and_then(|s| real(s, "share"));
    let located = share.map_or_else(String::new, |s| format!("{} of the gap", percent(s)));
    let effects = match effect_names(diagnosis) {
        names if names.is_empty() => "No effect added".to_owned(),
        names => names.iter().map(|n| title(n)).collect::<Vec<_>>().join(" + "),
    };
    let least = list(&diagnosis["which"], "effects").iter().filter_map(|e| real(e, "probability")).fold(f64::NAN, f64::min);
    let probability = if least.is_finite() { format!("probability {}", percent(least)) } else { String::new() };
    let closed = real(far, "closed_fraction").map_or_else(|| "Not stated".to_owned(), percent);
    let shrink = match (real(far, "before"), real(far, "after")) {
        (Some(b), Some(a)) => format!("{} → {} on {}", number(b, 3), number(a, 3), held_out(list(far, "held_out").len())),
        _ => String::new(),
    };
    let closed = if text(diagnosis, "verdict") == Some("no_gap") { "Nothing to close".to_owned() } else { closed };
    vec![("Where", primary, located), ("Which", effects, probability), ("Gap closed", closed, shrink)]
}

fn held_out(count: usize) -> String {
    match count {
        0 => "the recordings that were fitted".to_owned(),
        1 => "1 held-out recording".to_owned(),
        n => format!("{n} held-out recordings"),
    }
}

fn tile(name: &str, value: &str, note: &str) -> String {
    let note = if note.is_empty() { String::new() } else { format!("<span>{}</span>", escape(note)) };
    format!("<div><dt>{name}</dt><dd><strong>{}</strong>{note}</dd></div>", escape(value))
}
