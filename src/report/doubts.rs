//! Doubts that a sceptical reader must know before believing the verdict. They are shown next to the verdict, not below it.

use serde_json::Value;

use super::Input;
use super::json::{list, real, text, texts};
use super::names;
use super::residuals::Residual;
use super::text::{alternatives, channel, enumeration, escape, number, percent};
use super::verdict::or_places;

/// One doubt.
pub struct Doubt {
    /// Whether it is serious, so that the verdict loses its tick.
    pub grave: bool,
    /// The sentence as HTML.
    pub html: String,
}

impl Doubt {
    /// The sentence without markup.
    pub fn text(&self) -> String {
        let linked = self.html.split("<a ").next().unwrap_or_default();
        let plain: String =
            linked.split('<').enumerate().map(|(k, part)| if k == 0 { part } else { part.split_once('>').map_or("", |p| p.1) }).collect();
        let plain = plain.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"").replace("&#39;", "'").replace("&amp;", "&");
        plain.trim_end().to_owned()
    }
}

/// Number of recordings below which a campaign counts as thin.
const FEW: usize = 4;
/// Departure in standard deviations above which a number of the vehicle file is reported as far off.
const FAR: f64 = 3.0;
/// Size of an effect, in sizes of a noticeable one, above which an input may not be what it is said to be. In a car so large an effect is improbable, and a wrong unit or scale
/// looks alike.
const OUTSIZED: f64 = 5.0;
/// Uninterrupted time outside the noise band from which a residual is reported, s.
const LONG_S: f64 = 0.2;

/// All doubts about this answer.
pub fn of(input: &Input) -> Vec<Doubt> {
    let d = input.diagnosis;
    let mut all: Vec<Doubt> = Vec::new();
    let mut tell = |grave: bool, html: Option<String>| all.extend(html.map(|html| Doubt { grave, html }));
    for effect in list(&d["which"], "effects") {
        tell(true, rivals(effect));
    }
    tell(true, outsized(d));
    tell(true, taken_back(d));
    tell(true, elsewhere(d));
    tell(true, thin(input));
    tell(true, far_off(d));
    tell(false, remains(input));
    tell(false, worse(d));
    all
}

fn rivals(effect: &Value) -> Option<String> {
    let rivals: Vec<String> =
        texts(effect, "ambiguous_with").into_iter().map(|id| format!("<b>{}</b>", escape(&names::effect(id)))).collect();
    let own = escape(&names::effect(text(effect, "id")?));
    if rivals.is_empty() {
        return None;
    }
    let how =
        text(effect, "separated_by").map_or_else(String::new, |how| format!(" To tell them apart: {}.", escape(how.trim_end_matches('.'))));
    Some(format!("These recordings cannot tell <b>{own}</b> from {}.{how}", alternatives(&rivals)))
}

/// Effects larger than [`OUTSIZED`], for which the inputs may be to blame.
fn outsized(d: &Value) -> Option<String> {
    let large = |e: &&Value| real(e, "sizes").is_some_and(|sizes| sizes > OUTSIZED);
    let named: Vec<String> = list(&d["which"], "effects")
        .iter()
        .filter(large)
        .filter_map(|e| Some(format!("<b>{}</b>", escape(&names::effect(text(e, "id")?)))))
        .collect();
    (!named.is_empty()).then(|| {
        format!(
            "More than {OUTSIZED} times as large as is usual: {}. Check the channel map first: units, scales, and which quantity each channel holds.",
            enumeration(&named)
        )
    })
}

/// Effects that were withdrawn, because free replays are farther off with them than without.
fn taken_back(d: &Value) -> Option<String> {
    let taken = &d["which"]["taken_back"];
    let [before, after] = ["before", "after"].map(|k| real(taken, k).map(|v| number(v, 3)));
    let named: Vec<String> = texts(taken, "effects").into_iter().map(|id| format!("<b>{}</b>", escape(&names::effect(id)))).collect();
    Some(format!(
        "Withdrawn: {}. Sample by sample the recordings point to it, but in free replays of those same recordings the model is off by {} rad/s with it, and by {} rad/s as the vehicle file has it. Where the gap lies is therefore uncertain.",
        enumeration(&named),
        after?,
        before?
    ))
}

fn elsewhere(d: &Value) -> Option<String> {
    let others = texts(&d["where"], "ambiguous_with");
    let what = if text(d, "verdict") == Some("partly_explained") { "The rest" } else { "The gap" };
    (!others.is_empty()).then(|| format!("{what} may just as well lie in {}.", or_places(&others)))
}

/// Fewer than [`FEW`] recordings, counted as recordings even if they give many curves.
fn thin(input: &Input) -> Option<String> {
    let mut names: Vec<&str> = input.overlays.iter().map(|o| o.recording.split(" at ").next().unwrap_or_default()).collect();
    names.sort_unstable();
    names.dedup();
    let (recordings, curves) = (names.len(), input.overlays.len());
    if curves == 0 || recordings >= FEW {
        return None;
    }
    let many = |n: usize, what: &str| if n == 1 { format!("one {what}") } else { format!("{n} {what}s") };
    Some(if curves > recordings {
        format!("All {curves} curves are engagements from {}, so nothing tests what those have in common.", many(recordings, "recording"))
    } else {
        format!(
            "Thin data: {}. With fewer than {FEW} the verdict rests on little, and what was held out resembles what was fitted.",
            many(recordings, "recording")
        )
    })
}

/// Numbers of the vehicle file that the fit moved far from their nominal values.
fn far_off(d: &Value) -> Option<String> {
    // The tolerances of a withdrawn fit describe no model that is in use.
    let map = d["which"]["tolerances"].as_object().filter(|_| d["which"]["taken_back"].is_null())?;
    let mut far: Vec<(&String, f64)> = map.iter().filter_map(|(n, z)| Some((n, z.as_f64()?))).filter(|(_, z)| z.abs() > FAR).collect();
    far.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    let named: Vec<String> = far.iter().take(3).map(|(n, z)| format!("<code>{}</code> by {}", escape(n), number(z.abs(), 2))).collect();
    (!named.is_empty()).then(|| {
        format!(
            "The fit moved {} standard deviations: either the vehicle file is wrong there, or this makes up for something else.",
            enumeration(&named)
        )
    })
}

/// Held-out speeds that stay outside their noise band.
fn remains(input: &Input) -> Option<String> {
    // If nothing was retuned, the residual is the gap itself.
    if !super::series::retuned(input.diagnosis) {
        return None;
    }
    let speeds = |c: &str| c.starts_with("omega");
    let worst =
        super::residuals::held_out(input).into_iter().filter(|r| speeds(r.column)).max_by(|a, b| a.longest_s.total_cmp(&b.longest_s))?;
    (worst.longest_s >= LONG_S)
        .then(|| stays(&worst, super::series::holds_law(input.diagnosis).then(|| super::series::law_words(&input.diagnosis["how_far"])[1])))
}

fn stays(r: &Residual, by_law: Option<&str>) -> String {
    format!(
        "In the free replay of {}{} the {} stays outside ±2σ of its sensor noise for {} s at a stretch, by up to {} {}; {} of its samples lie outside (noise \
         alone: 5\u{202f}%). <a href=\"#residuals\">Tests of the residuals</a>",
        escape(&r.recording),
        by_law.map_or_else(String::new, |law| format!(" with the {law}")),
        escape(&channel(r.column).to_lowercase()),
        number(r.longest_s, 2),
        number(r.largest, 2),
        escape(&super::text::unit(r.unit)),
        percent(r.outside)
    )
}

/// Figures that got worse by retuning.
fn worse(d: &Value) -> Option<String> {
    let far = &d["how_far"];
    let (mut all, mut names) = (0, Vec::new());
    for row in list(far, "per_recording") {
        let (Some(before), Some(after)) = (real(row, "before"), real(row, "after")) else { continue };
        all += 1;
        if after > 1.02 * before && after > real(row, "noise").unwrap_or(0.0) {
            let name = channel(text(row, "channel").unwrap_or("unnamed")).to_lowercase();
            names.push(format!("{name} of {} ({} → {})", text(row, "recording").unwrap_or(""), number(before, 3), number(after, 3)));
        }
    }
    for (recording, figures) in far["kpi"].as_object().into_iter().flatten() {
        for (key, name, _, factor) in super::shrinkage::FIGURES {
            let [Some(car), Some(before), Some(after)] = ["real", "before", "after"].map(|k| real(&figures[key], k)) else { continue };
            all += 1;
            if (after - car).abs() > (before - car).abs() + 0.01 * car.abs() {
                let [c, b, a] = [car, before, after].map(|v| number(v * factor, 3));
                names.push(format!("{} of {recording} ({b} → {a}, car {c})", name.to_lowercase()));
            }
        }
    }
    let (count, more) = (names.len(), names.len().saturating_sub(3));
    names.truncate(3);
    let tail = if more > 0 { format!(", and {more} more") } else { String::new() };
    (count > 0).then(|| format!("Worse after retuning, {count} of {all} figures: {}{tail}.", escape(&names.join(", "))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_terminal_gets_the_sentence_without_markup() {
        let doubt = Doubt { grave: true, html: "Not <b>a &amp; b</b> &lt; <code>c</code>. <a href=\"#x\">More</a>".to_owned() };
        assert_eq!(doubt.text(), "Not a & b < c.");
    }

    /// Effects of five usual sizes pass; of larger ones the inputs are doubted.
    #[test]
    fn inputs_are_doubted_if_an_effect_is_larger_than_in_any_car() {
        let with = |sizes: [f64; 2]| {
            outsized(&serde_json::json!({"which": {"effects": [
                {"id": "engine_torque_gain", "sizes": sizes[0]}, {"id": "friction_level", "sizes": sizes[1]}]}}))
        };
        assert!(with([4.9, 5.0]).is_none());
        let doubt = Doubt { grave: true, html: with([10.0, 1.0]).unwrap() };
        assert!(
            doubt.text().starts_with("More than 5 times as large as is usual: scale error of the engine torque. Check"),
            "{}",
            doubt.text()
        );
        assert!(with([10.0, 6.0]).unwrap().contains("<b>friction level</b>"));
    }
}
