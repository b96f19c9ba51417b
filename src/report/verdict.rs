//! The verdict: a headline that includes the ambiguity, the doubts, and a short answer to each question.

use serde_json::Value;

use super::Input;
use super::doubts;
use super::json::{list, real, text, texts};
use super::names;
use super::text::{alternatives, capitalised, enumeration, escape, number, percent};
use crate::gap::prose::listed;

/// Encloses the "or" between rivals, which the page sets in bold.
const MARK: char = '\u{1}';

/// Lead in nats from which an explanation is clearly ahead of all others of the library.
const AHEAD: f64 = 7.0;

/// Lead in nats from which the explanation is settled for most purposes: odds of 20 to one.
const SETTLED: f64 = 3.0;

/// Lead in nats below which two explanations count as equally probable: odds of 1.05 to one.
const EQUAL: f64 = 0.05;

/// The sentence above everything else, as plain text.
pub fn headline(diagnosis: &Value) -> String {
    marked(diagnosis).replace(MARK, "")
}

/// The headline with marks around each "or" that is set in bold. If it is more likely that none of the compared explanations holds, it begins with that.
fn marked(diagnosis: &Value) -> String {
    let said = of_verdict(diagnosis);
    let compared = matches!(text(diagnosis, "verdict"), Some("no_gap" | "explained" | "partly_explained"));
    let none = beyond(diagnosis).0;
    if compared && none > 0.5 {
        format!("Most probably ({}) none of the explanations compared holds. The nearest one: {said}", percent(none))
    } else {
        said
    }
}

fn of_verdict(diagnosis: &Value) -> String {
    let effects = list(&diagnosis["which"], "effects");
    let place = places(diagnosis);
    let alone = effects.len() < 2;
    match text(diagnosis, "verdict") {
        Some("no_gap") if !texts(diagnosis, "hidden_without_position").is_empty() => {
            let hidden: Vec<String> = texts(diagnosis, "hidden_without_position").into_iter().map(names::place).collect();
            format!(
                "No effect is needed in engine, driveline and sensors: there the model follows the car within the tolerances of its vehicle file. Without a recorded position, {} could not be assessed.",
                enumeration(&hidden)
            )
        }
        Some("no_gap") => "No effect is needed: the model follows the car within the tolerances of its vehicle file.".to_owned(),
        Some(verdict @ ("explained" | "partly_explained")) => {
            let part = if verdict == "explained" { "the gap" } else { "part of the gap" };
            let names = named(effects);
            // The verb agrees with the last of the alternatives.
            let last = effects.first().and_then(|e| texts(e, "ambiguous_with").last().copied().or(text(e, "id")));
            let singular = alone && !last.is_some_and(names::is_plural);
            let [explains, closes] = if singular { ["explains", "closes"] } else { ["explain", "close"] };
            let only = if closes_none(&diagnosis["how_far"]) {
                format!(" in the recordings used in the fit, but {closes} none of it on held-out data")
            } else {
                String::new()
            };
            let rest = if verdict == "explained" {
                String::new()
            } else {
                format!("; the rest lies in {place}, and no effect in the library explains it")
            };
            if likelier_not(diagnosis) {
                let at = percent(real(diagnosis, "confidence").unwrap_or(0.0));
                let only = if only.is_empty() { "" } else { "; it closes none of it on held-out data" };
                return format!("The most probable explanation of {part}, at {at}, is {names}{only}{rest}.");
            }
            format!("{} {explains} {part}{only}{rest}.", capitalised(&names))
        }
        Some("unexplained") => format!("No effect in the library explains the gap; it lies in {place}."),
        Some("inputs_do_not_fit") => text(diagnosis, "sentence").unwrap_or("These inputs do not fit this vehicle.").to_owned(),
        _ => "The diagnosis holds no verdict.".to_owned(),
    }
}

/// Whether, for one of the named effects, it is more likely that neither it nor any of its rivals is there.
fn likelier_not(diagnosis: &Value) -> bool {
    let which = &diagnosis["which"];
    let holds = |group: &[&str]| -> f64 {
        let all = list(which, "explanations").iter().filter(|e| texts(e, "effects").iter().any(|id| group.contains(id)));
        all.filter_map(|e| real(e, "probability")).sum()
    };
    let group = |e: &Value| -> f64 {
        let own = text(e, "id").into_iter().chain(texts(e, "ambiguous_with")).collect::<Vec<_>>();
        real(e, "probability").unwrap_or(1.0).max(holds(&own))
    };
    list(which, "effects").iter().any(|e| group(e) < 0.5)
}

/// Whether the gap on held-out data is not smaller after retuning.
fn closes_none(far: &Value) -> bool {
    !list(far, "held_out").is_empty() && real(far, "closed_fraction").is_some_and(|c| c <= 0.0)
}

/// Effects with their rivals: "A or B, and C".
fn named(effects: &[Value]) -> String {
    let groups: Vec<String> = effects
        .iter()
        .filter_map(|e| {
            let own = text(e, "id")?;
            let all: Vec<String> = std::iter::once(own).chain(texts(e, "ambiguous_with")).map(names::effect).collect();
            Some(all.join(&format!(" {MARK}or{MARK} ")))
        })
        .collect();
    if groups.is_empty() {
        return "an effect that is not named".to_owned();
    }
    let doubtful = groups.iter().any(|g| g.contains(MARK));
    listed(&groups, if doubtful { ", and " } else { " and " })
}

/// Subsystem of the remainder or of the unexplained gap, with its rivals.
fn places(diagnosis: &Value) -> String {
    let place = &diagnosis["where"];
    let first = text(place, "unexplained_at").or_else(|| text(place, "primary"));
    let all: Vec<String> = first.into_iter().chain(texts(place, "ambiguous_with")).map(names::place).collect();
    if all.is_empty() { "a subsystem that is not named".to_owned() } else { listed(&all, &format!(" {MARK}or{MARK} ")) }
}

/// Gap of a free replay of held-out data, before and after, in a sentence.
pub fn replayed(diagnosis: &Value) -> Option<String> {
    let far = &diagnosis["how_far"];
    let (before, after) = (real(far, "before")?, real(far, "after")?);
    let unit = unit_of(far);
    let held = texts(far, "held_out");
    let on = if held.is_empty() {
        "In a free replay of the recordings that were fitted, the model".to_owned()
    } else {
        format!(
            "In a free replay of {}, which took no part in the fit, the model",
            enumeration(&held.iter().map(|h| (*h).to_owned()).collect::<Vec<_>>())
        )
    };
    let with_unit = |v: f64| format!("{} {unit}", number(v, 3)).trim_end().to_owned();
    let (b, a) = (with_unit(before), with_unit(after));
    let law = real(&far["empirical"], "after").filter(|_| super::series::holds_law(diagnosis));
    let [a_law, _, no_cause] = super::series::law_words(far);
    let law = law.map_or_else(String::new, |v| format!(" With {a_law}, {no_cause}, it is off by {}.", with_unit(v)));
    let said = match text(diagnosis, "verdict") {
        Some("unexplained") if !law.is_empty() => format!("{on} is off by {b} (rms)."),
        Some("unexplained" | "inputs_do_not_fit") => format!("{on} is off by {b} (rms); nothing was retuned."),
        Some("no_gap") if after > before => {
            format!(
                "{on} is off by {a} (rms) with the numbers that fit the other recordings best, and by {b} with those of the vehicle file."
            )
        }
        Some("no_gap") => format!(
            "{on} is off by {a} (rms) once its numbers are adjusted within their tolerances, and by {b} as the vehicle file has them."
        ),
        _ if after > before => format!("{on} got worse: it is off by {a} (rms), up from {b}."),
        _ => format!("{on} is off by {a} (rms), down from {b}."),
    };
    Some(said + &law)
}

/// The next best explanation that differs from the best one, and how many nats it trails.
pub fn next_best<'a>(diagnosis: &'a Value) -> Option<(String, f64)> {
    let all = list(&diagnosis["which"], "explanations");
    let best = all.first()?;
    // An effect of the best explanation that the answer does not name counts as part of the missing law. Explanations with that law then count as the same with or without the
    // effect.
    let named: Vec<&str> = list(&diagnosis["which"], "effects").iter().filter_map(|e| text(e, "id")).collect();
    let of_the_law: Vec<&str> =
        texts(best, "effects").into_iter().filter(|id| best["missing_law"] != Value::Null && !named.contains(id)).collect();
    let effects = |e: &'a Value| -> Vec<&'a str> {
        let same_law = e["missing_law"] == best["missing_law"];
        texts(e, "effects").into_iter().filter(|id| !(same_law && of_the_law.contains(id))).collect()
    };
    let other = all.iter().skip(1).find(|e| effects(e) != effects(best) || e["missing_law"] != best["missing_law"])?;
    let (kept, ids) = (effects(best), effects(other));
    // An explanation that only adds effects to the best one is described as such.
    let adds = !kept.is_empty() && kept.iter().all(|id| ids.contains(id)) && best["missing_law"] == Value::Null;
    let mut parts: Vec<String> = ids.iter().filter(|id| !(adds && kept.contains(id))).map(|id| names::effect(id)).collect();
    parts.extend(text(other, "missing_law").map(|s| format!("a missing law in {}", names::place(s))));
    if let Some(law) = text(best, "missing_law").filter(|_| !kept.is_empty() && kept == ids && other["missing_law"] == Value::Null) {
        return Some((format!("the same without a missing law in {}", names::place(law)), real(other, "behind")?));
    }
    let name = match (parts.is_empty(), adds) {
        (true, _) => "no effect at all".to_owned(),
        (_, true) => format!("the same plus {}", enumeration(&parts)),
        _ => enumeration(&parts),
    };
    Some((name, real(other, "behind")?))
}

/// How settled the answer is, in words.
pub fn confidence(diagnosis: &Value) -> Option<String> {
    if !diagnosis["which"]["taken_back"].is_null() {
        return Some("Not settled.".to_owned());
    }
    // If the inputs do not fit, the comparison of explanations carries no information.
    if text(diagnosis, "verdict") == Some("inputs_do_not_fit") {
        return Some("All that follows is of the recordings as they are mapped.".to_owned());
    }
    let (name, behind) = next_best(diagnosis)?;
    let odds = match behind.exp() {
        r if r > 1e6 => "more than a million to one".to_owned(),
        r if r < 10.0 => format!("{} to one", number(r, 2)),
        r => {
            let unit = 10f64.powf(r.log10().floor() - 1.0);
            format!("{} to one", number((r / unit).round() * unit, 2))
        }
    };
    let (beyond, ahead_of_none) = beyond(diagnosis);
    let said = match behind.min(ahead_of_none) {
        b if b < 1.0 => "Not settled",
        b if b < SETTLED => "Tentative",
        b if b < AHEAD => "Likely",
        _ => "Clear",
    };
    let none = format!(
        " With a probability of {} none of the explanations compared holds: they strain the tolerances of the vehicle file.",
        percent(beyond)
    );
    let none = if ahead_of_none < SETTLED { &none } else { "" };
    if behind < EQUAL {
        return Some(format!("{said}. Next best: {name}, which is just as probable.{none}"));
    }
    Some(format!(
        "{said}. Next best: {name}, {} nats behind (odds of {odds}, if the true cause is among those compared).{none}",
        number(behind, 2)
    ))
}

/// Probability that none of the compared explanations holds, and how many nats this possibility trails them.
fn beyond(diagnosis: &Value) -> (f64, f64) {
    let beyond = real(&diagnosis["which"], "beyond").unwrap_or(0.0);
    (beyond, ((1.0 - beyond) / beyond).ln())
}

/// Whether the answer has no rivals: no ambiguous effect or subsystem, no withdrawal, and a lead of at least `SETTLED` over all alternatives.
pub fn settled(diagnosis: &Value) -> bool {
    let rivals = list(&diagnosis["which"], "effects").iter().any(|e| !texts(e, "ambiguous_with").is_empty());
    let elsewhere = !texts(&diagnosis["where"], "ambiguous_with").is_empty();
    let taken_back = !diagnosis["which"]["taken_back"].is_null();
    let compared = beyond(diagnosis).1 >= SETTLED;
    !rivals && !elsewhere && !taken_back && compared && next_best(diagnosis).is_none_or(|(_, behind)| behind >= SETTLED)
}

/// Header of the report.
pub fn section(input: &Input) -> String {
    let diagnosis = input.diagnosis;
    let doubts = doubts::of(input);
    // A tick marks an answer that can be taken as it stands.
    let sure = settled(diagnosis) && !doubts.iter().any(|d| d.grave);
    let (mark, class, verdict) = match (text(diagnosis, "verdict"), sure) {
        (Some("no_gap"), true) => ("✓", "good", "No gap found"),
        (Some("no_gap"), false) => ("≈", "warn", "No gap found, with doubts"),
        (Some("explained"), true) => ("✓", "good", "Explained"),
        (Some("explained"), false) => ("≈", "warn", "Explained, with doubts"),
        (Some("partly_explained"), _) => ("◐", "warn", "Partly explained"),
        (Some("unexplained"), _) => ("?", "bad", "Unexplained"),
        (Some("inputs_do_not_fit"), _) => ("✗", "bad", "Inputs do not fit"),
        _ => ("–", "warn", "No verdict"),
    };
    let tiles: String = tiles(diagnosis).iter().map(|(name, value, note)| tile(name, value, note)).collect();
    let lead = replayed(diagnosis).map_or_else(String::new, |said| format!("<p class=\"lead\">{}</p>\n", escape(&said)));
    let sure = confidence(diagnosis).map_or_else(
        || "<p class=\"confidence\">Confidence: not stated</p>\n".to_owned(),
        |said| format!("<p class=\"confidence\">{}</p>\n", escape(&said)),
    );
    let doubts: String = doubts.iter().map(|d| format!("<li{}>{}</li>", if d.grave { " class=\"grave\"" } else { "" }, d.html)).collect();
    let doubts = if doubts.is_empty() { String::new() } else { format!("<ul class=\"doubts\" aria-label=\"Doubts\">{doubts}</ul>\n") };
    format!(
        "<header id=\"verdict\">\n<p class=\"eyebrow\">{name}Kisspoint: where a simulation departs from the car</p>\n\
         <p class=\"pill {class}\"><span aria-hidden=\"true\">{mark}</span> {verdict}</p>\n<h1>{}</h1>\n{lead}<dl class=\"tiles\">{tiles}</dl>\n{sure}{doubts}</header>\n",
        bold(&marked(diagnosis)),
        name = if input.name.is_empty() { String::new() } else { format!("<b>{}</b> · ", escape(input.name)) },
    )
}

/// Escapes the text and sets each marked "or" in bold.
fn bold(text: &str) -> String {
    escape(text).replace(&format!("{MARK}or{MARK}"), "<strong class=\"or\">or</strong>")
}

/// Name, answer and short explanation of each tile; the answers may contain marks.
fn tiles(diagnosis: &Value) -> Vec<(&'static str, String, String)> {
    let (place, far) = (&diagnosis["where"], &diagnosis["how_far"]);
    let or = format!(" {MARK}or{MARK} ");
    // For a gap that is explained in part, the ambiguity concerns the place of the remainder.
    let partly = text(diagnosis, "verdict") == Some("partly_explained");
    let doubts: Vec<&str> = if partly { Vec::new() } else { texts(place, "ambiguous_with") };
    let primary = match text(place, "primary") {
        Some(id) => std::iter::once(id).chain(doubts.iter().copied()).map(names::subsystem).collect::<Vec<_>>().join(&or),
        None => "no subsystem".to_owned(),
    };
    let others: Vec<String> = super::residual_map::subsystems(place).iter().skip(1).map(|id| names::subsystem(id)).collect();
    let then = if others.is_empty() { None } else { Some(format!("then {}", enumeration(&others))) };
    let rest = text(place, "unexplained_at").filter(|_| partly).map(|id| {
        let all: Vec<String> = std::iter::once(id).chain(texts(place, "ambiguous_with")).map(names::subsystem).collect();
        format!("the rest: {}", alternatives(&all))
    });
    let then = then.into_iter().chain(rest).collect::<Vec<_>>().join("; ");
    let effects = list(&diagnosis["which"], "effects");
    let which = if effects.is_empty() { "no effect added".to_owned() } else { named(effects) };
    let ids: Vec<String> = effects.iter().filter_map(|e| text(e, "id")).map(str::to_owned).collect();
    let unit = unit_of(far);
    let (value, note) = match (real(far, "before"), real(far, "after")) {
        (Some(b), Some(a)) if matches!(text(diagnosis, "verdict"), Some("unexplained" | "inputs_do_not_fit")) => {
            let law = real(&far["empirical"], "after").filter(|_| super::series::holds_law(diagnosis));
            let [a_law, _, no_cause] = super::series::law_words(far);
            let note = law.map_or_else(|| "nothing retuned".to_owned(), |v| format!("{} {unit} with {a_law}, {no_cause}", number(v, 3)));
            (format!("{} {unit}", number(b.max(a), 3)), note)
        }
        (Some(b), Some(a)) => {
            let change = if b <= 0.0 {
                String::new()
            } else if a <= b {
                format!("{} less", percent(1.0 - a / b))
            } else {
                format!("{} more", percent(a / b - 1.0))
            };
            let floor =
                real(far, "noise_floor").map_or_else(String::new, |f| format!("; even a perfect model may be off by {}", number(f, 3)));
            (format!("{} → {} {unit}", number(b, 3), number(a, 3)), format!("{change}{floor}"))
        }
        _ => ("not stated".to_owned(), String::new()),
    };
    vec![
        ("Where", capitalised(&primary), then),
        ("Which", capitalised(&which), ids.join(", ")),
        ("Free replay of held-out data", capitalised(&value), note),
    ]
}

/// Unit of the gap: the part of the metric after its last comma, if that is one word.
pub fn unit_of(far: &Value) -> String {
    let metric = text(far, "metric").unwrap_or_default();
    let last = metric.rsplit_once(", ").map(|(_, unit)| unit).filter(|unit| !unit.contains(' '));
    last.map_or_else(String::new, super::text::unit)
}

fn tile(name: &str, value: &str, note: &str) -> String {
    let note = if note.is_empty() { String::new() } else { format!("<span>{}</span>", escape(note)) };
    format!("<div><dt>{name}</dt><dd><strong>{}</strong>{note}</dd></div>", bold(value))
}

/// The rivals of a subsystem as alternatives, in bold.
pub fn or_places(ids: &[&str]) -> String {
    alternatives(&ids.iter().map(|id| format!("<b>{}</b>", escape(&names::place(id)))).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_verb_agrees_with_the_name_before_it() {
        for (id, rivals, verb) in [
            ("driveline_compliance", json!([]), "explain"),
            ("driveline_compliance", json!(["judder"]), "explains"),
            ("judder", json!([]), "explains"),
        ] {
            let diagnosis = json!({"verdict": "explained", "which": {"effects": [{"id": id, "ambiguous_with": rivals}]}, "where": {}});
            let said = headline(&diagnosis);
            assert!(said.ends_with(&format!(" {verb} the gap.")), "{said}");
        }
    }

    #[test]
    fn of_inputs_that_do_not_fit_no_explanation_is_called_likely() {
        let explanations = json!([{"effects": ["judder"], "behind": 0.0}, {"effects": ["vehicle_mass"], "behind": 9.0}]);
        let said = |verdict: &str| {
            confidence(&json!({"verdict": verdict, "sentence": "S.", "which": {"explanations": explanations, "effects": []}, "where": {}}))
                .unwrap()
        };
        assert!(said("explained").contains("Next best"), "{}", said("explained"));
        assert_eq!(said("inputs_do_not_fit"), "All that follows is of the recordings as they are mapped.");
    }

    #[test]
    fn the_headline_begins_with_what_is_likelier_than_all_that_was_compared() {
        for (verdict, beyond, none) in
            [("no_gap", 0.4, false), ("no_gap", 0.9, true), ("explained", 0.9, true), ("unexplained", 0.9, false)]
        {
            let diagnosis = json!({"verdict": verdict, "which": {"effects": [{"id": "vehicle_mass"}], "beyond": beyond}, "where": {}});
            let said = headline(&diagnosis);
            let none_holds = said.starts_with(&format!("Most probably ({}) none of the explanations compared holds.", percent(beyond)));
            assert_eq!(none_holds, none, "{verdict} {beyond}: {said}");
        }
    }

    #[test]
    fn what_none_of_the_explanations_accounts_for_is_said() {
        let with = |beyond: f64| {
            let explanation = |id: &str, behind: f64| json!({"effects": [id], "missing_law": null, "probability": 0.5, "behind": behind});
            let explanations = [explanation("vehicle_mass", 0.0), explanation("friction_level", 9.0)];
            json!({"which": {"effects": [{"id": "vehicle_mass"}], "explanations": explanations, "beyond": beyond}, "where": {}})
        };
        for (beyond, word, none, is_settled) in [
            (1e-6, "Clear", false, true),
            (0.02, "Likely", false, true),
            (0.2, "Tentative", true, false),
            (0.68, "Not settled", true, false),
        ] {
            let said = confidence(&with(beyond)).unwrap();
            assert!(said.starts_with(word) && said.contains("none of the explanations") == none, "{beyond}: {said}");
            assert!(!none || said.contains(&percent(beyond)), "{said}");
            assert_eq!(settled(&with(beyond)), is_settled, "{beyond}");
        }
    }
}
