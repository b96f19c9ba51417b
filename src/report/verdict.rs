//! The verdict in a sentence, its confidence, and the answer to each question in a few words.

use serde_json::Value;

use super::Input;
use super::json::{list, real, text, texts};
use super::text::{alternatives, enumeration, escape, number, percent, title, words};

/// The sentence that stands above everything.
pub fn sentence(diagnosis: &Value) -> String {
    if let Some(said) = text(diagnosis, "sentence") {
        return in_words(said);
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
        Some("inputs_do_not_fit") => "These inputs do not fit this vehicle.".to_owned(),
        _ => "The diagnosis holds no verdict.".to_owned(),
    }
}

/// The sentence of diagnosis.json names effects and subsystems as programs know them; people read words.
fn in_words(said: &str) -> String {
    let known = |word: &str| word.contains('_') && word.chars().all(|c| c.is_ascii_lowercase() || c == '_');
    let all: Vec<String> = said
        .split(' ')
        .map(|word| {
            let name = word.trim_end_matches([',', '.', ';']);
            if known(name) { words(name) + &word[name.len()..] } else { word.to_owned() }
        })
        .collect();
    // A number and its percent sign stay on one line.
    super::text::capitalised(&all.join(" ").replace(" %", "\u{202f}%"))
}

/// Names of the effects chosen, as words.
pub fn effect_names(diagnosis: &Value) -> Vec<String> {
    list(&diagnosis["which"], "effects").iter().filter_map(|e| text(e, "id")).map(words).collect()
}

/// Header of the report.
pub fn section(input: &Input) -> String {
    let diagnosis = input.diagnosis;
    let (mark, class, verdict) = match text(diagnosis, "verdict") {
        Some("no_gap") => ("✓", "good", "No gap"),
        Some("explained") => ("✓", "good", "Explained"),
        Some("partly_explained") => ("◐", "warn", "Partly explained"),
        Some("unexplained") => ("?", "bad", "Unexplained"),
        Some("inputs_do_not_fit") => ("✗", "bad", "Inputs do not fit"),
        _ => ("–", "warn", "No verdict"),
    };
    let tiles: String = tiles(diagnosis).iter().map(|(name, value, note)| tile(name, value, note)).collect();
    format!(
        "<header id=\"verdict\">\n<p class=\"eyebrow\">{name}Kisspoint, diagnosis of the sim-to-real gap</p>\n\
         <p class=\"pill {class}\"><span aria-hidden=\"true\">{mark}</span> {verdict}</p>\n<h1>{}</h1>\n{}<dl class=\"tiles\">{tiles}</dl>\n</header>\n",
        escape(&sentence(diagnosis)),
        confidence(diagnosis),
        name = if input.name.is_empty() { String::new() } else { format!("<b>{}</b> · ", escape(input.name)) },
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
    let others: Vec<String> = super::residual_map::subsystems(place).iter().skip(1).map(|id| words(id)).collect();
    let doubts: Vec<String> = texts(place, "ambiguous_with").into_iter().map(words).collect();
    let then = (!others.is_empty()).then(|| format!("then {}", enumeration(&others)));
    let or = (!doubts.is_empty()).then(|| format!("or {}", alternatives(&doubts)));
    let located = then.into_iter().chain(or).collect::<Vec<_>>().join("; ");
    let effects = match effect_names(diagnosis) {
        names if names.is_empty() => "No effect added".to_owned(),
        _ => list(&diagnosis["which"], "effects").iter().map(with_rivals).collect::<Vec<_>>().join(" + "),
    };
    let least = list(&diagnosis["which"], "effects").iter().filter_map(|e| real(e, "probability")).fold(f64::NAN, f64::min);
    let probability = if least.is_finite() { format!("probability {}", percent(least)) } else { String::new() };
    let closed = real(far, "closed_fraction").map_or_else(|| "Not stated".to_owned(), percent);
    let shrink = match (real(far, "before"), real(far, "after")) {
        (Some(b), Some(a)) => format!("{} → {} {} on {}", number(b, 3), number(a, 3), unit_of(far), held_out(list(far, "held_out").len())),
        _ => String::new(),
    };
    let (name, closed) = match text(diagnosis, "verdict") {
        Some("no_gap") => ("Tolerances fitted", "Nothing left to close".to_owned()),
        Some("unexplained" | "inputs_do_not_fit") => ("Gap closed", "Nothing retuned".to_owned()),
        _ => ("Gap closed", closed),
    };
    vec![("Where", primary, located), ("Which", effects, probability), (name, closed, shrink)]
}

/// An effect's title with those that may be there in its place.
fn with_rivals(effect: &Value) -> String {
    let own = text(effect, "id").into_iter();
    own.chain(texts(effect, "ambiguous_with")).map(|id| title(&words(id))).collect::<Vec<_>>().join(" or ")
}

/// Unit of the gap: what stands behind the last comma of the metric, if that is one word.
pub fn unit_of(far: &Value) -> String {
    let metric = text(far, "metric").unwrap_or_default();
    let last = metric.rsplit_once(", ").map(|(_, unit)| unit).filter(|unit| !unit.contains(' '));
    last.map_or_else(String::new, super::text::unit)
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
