//! Section "how far": gap before and after compared with the noise floor, and figures of each engagement.

use serde_json::Value;

use super::absent;
use super::chart::Scale;
use super::json::{list, real, text, texts};
use super::text::{capitalised, channel, escape, fixed, number, percent, signed, unit};

/// The section.
pub fn section(diagnosis: &Value) -> String {
    let far = &diagnosis["how_far"];
    // With the verdict "unexplained", a learned law has a row of its own beside the figures of the effects.
    let retuned = super::series::retuned(diagnosis) && text(diagnosis, "verdict") != Some("unexplained");
    let untouched = match text(diagnosis, "verdict") {
        _ if !retuned && super::series::holds_law(diagnosis) => {
            "<p>No effect was added: the model is that of the vehicle file. What was learned beyond it is shown beside it.</p>\n"
        }
        _ if !retuned => "<p>Nothing was retuned, so there is only one model: that of the vehicle file.</p>\n",
        Some("no_gap") => "<p><b>After</b> is the same vehicle with its numbers moved within their tolerances; no effect was added.</p>\n",
        _ => "",
    };
    format!("{untouched}{}{}{}", summary(far, retuned), per_recording(far, retuned), engagement(far, retuned))
}

fn summary(far: &Value, retuned: bool) -> String {
    let (Some(before), Some(after)) = (real(far, "before"), real(far, "after")) else {
        return absent("The gap before and after is missing.");
    };
    let metric = text(far, "metric").unwrap_or("metric not named");
    let unit = super::verdict::unit_of(far);
    let floor = real(far, "noise_floor");
    let law = real(&far["empirical"], "after").filter(|_| far["empirical"]["taken"] == true);
    let most = before.max(after).max(floor.unwrap_or(0.0));
    let row = |name: &str, class: &str, value: f64| {
        format!(
            "<tr><th scope=\"row\">{name}</th><td class=\"num\">{} {unit}</td><td class=\"wide\"><span class=\"bar {class}\"><i style=\"width:{:.1}%\"></i></span></td></tr>",
            number(value, 3),
            if most > 0.0 { (100.0 * value / most).clamp(0.0, 100.0) } else { 0.0 }
        )
    };
    let noise = floor
        .map_or_else(|| absent("How far off even a perfect model may be was not stated."), |f| row("Even a perfect model", "floor", f));
    let (row_noise, said) = if floor.is_some() { (noise, String::new()) } else { (String::new(), noise) };
    let held = texts(far, "held_out");
    let held = if held.is_empty() { "No recording was held out.".to_owned() } else { format!("Held out: {}.", escape(&held.join(", "))) };
    let less = if before > 0.0 && after <= before {
        format!(" The free replay is off by <b>{} less</b> than before.", percent(1.0 - after / before))
    } else {
        String::new()
    };
    let less = if after > before { " The free replay is off by <b>more</b> than before.".to_owned() } else { less };
    let less = if retuned { less } else { String::new() };
    // No share is stated for a gap that is closed to its floor, because the remainder cannot be told from the error of a perfect model.
    let closed = match (real(far, "closed_fraction"), floor) {
        (Some(_), Some(f)) if before <= f => {
            format!(
                " {} within the {} {unit} by which even a perfect model may be off.",
                if retuned { "Before, it was already" } else { "It is" },
                number(f, 3)
            )
        }
        _ if !retuned => String::new(),
        (Some(c), Some(f)) if c >= 1.0 => format!(" That is below the {} {unit} by which even a perfect model may be off.", number(f, 3)),
        (Some(c), _) => format!(" Not counting what even a perfect model may be off by, {} of the gap is gone.", percent(c)),
        _ => String::new(),
    };
    format!(
        "<p>{held}{less}{closed}</p>\n<table class=\"bars\"><caption>{}</caption><thead class=\"unseen\"><tr><th scope=\"col\">Model</th><th scope=\"col\">Gap</th>\
         <th scope=\"col\">Bar</th></tr></thead><tbody>{}{}{}{row_noise}</tbody></table>\n{said}",
        escape(&capitalised(&metric.replace("real minus simulated", "car minus model"))),
        row(if retuned { "Before" } else { "Model" }, "before", before),
        if retuned { row("After", "after", after) } else { String::new() },
        law.map_or_else(String::new, |with| row(&format!("With the {}", super::series::law_words(far)[1]), "after", with)),
    )
}

fn per_recording(far: &Value, retuned: bool) -> String {
    let entries = list(far, "per_recording");
    if entries.is_empty() {
        return absent("The gap per recording is missing.");
    }
    let ratios: Vec<f64> = entries
        .iter()
        .flat_map(|e| {
            let n = real(e, "noise");
            ["before", "after"].map(|k| Some(real(e, k)? / n?))
        })
        .flatten()
        .filter(|r| r.is_finite() && *r > 0.0)
        .collect();
    let low = ratios.iter().fold(0.7, |a: f64, b| a.min(*b));
    let high = ratios.iter().fold(3.0, |a: f64, b| a.max(*b));
    let x = Scale { low: low.ln(), high: high.ln(), a: 8.0, b: 232.0 };
    let held = texts(far, "held_out");
    let rows = grouped(entries, &held, &x, retuned);
    format!(
        "<h3>Per recording and channel</h3>\n<div class=\"scroll\" role=\"region\" aria-label=\"Gap per recording\" tabindex=\"0\"><table class=\"shrink\"><thead><tr>\
         <th scope=\"col\">Recording</th><th scope=\"col\">Channel</th>{}<th scope=\"col\" class=\"num\">Noise</th><th scope=\"col\">In multiples of noise{}</th></tr></thead>{rows}</table></div>\n",
        heads(retuned),
        ruler(&x)
    )
}

/// Column heads of the models.
fn heads(retuned: bool) -> &'static str {
    if retuned {
        "<th scope=\"col\" class=\"num\"><span class=\"t-before\">Before</span></th><th scope=\"col\" class=\"num\"><span class=\"t-after\">After</span></th>"
    } else {
        "<th scope=\"col\" class=\"num\"><span class=\"t-before\">Model</span></th>"
    }
}

/// Labels of the logarithmic scale.
fn ruler(x: &Scale) -> String {
    let marks = [0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0, 1e4];
    let inside = marks.iter().filter(|m| (x.low - 1e-9..=x.high + 1e-9).contains(&f64::ln(**m)));
    let texts: String = inside
        .map(|m| {
            format!(
                "<text class=\"tick\" x=\"{:.1}\" y=\"12\" text-anchor=\"middle\">{}</text>",
                x.at(m.ln()),
                if *m < 1.0 { fixed(*m, 1) } else { fixed(*m, 0) }
            )
        })
        .collect();
    // A label centred on the last mark extends beyond the drawing, so overflow is visible.
    format!("<svg class=\"ruler\" viewBox=\"0 0 240 16\" overflow=\"visible\" aria-hidden=\"true\">{texts}</svg>")
}

/// One table body per recording, with its name once.
fn grouped(entries: &[Value], held: &[&str], x: &Scale, retuned: bool) -> String {
    let mut out = String::new();
    for group in entries.chunk_by(|a, b| a["recording"] == b["recording"]) {
        let name = text(&group[0], "recording").unwrap_or("unnamed");
        let mark = mark(name, held);
        let mut head = format!("<th scope=\"rowgroup\" rowspan=\"{}\">{}{mark}</th>", group.len(), escape(name));
        out += "<tbody>";
        for entry in group {
            out += &format!("<tr>{}{}</tr>", std::mem::take(&mut head), recording_row(entry, x, retuned));
        }
        out += "</tbody>";
    }
    out
}

/// Mark of a held-out recording: in bench campaigns a whole recording is held out, in drives one engagement, whose recording is marked, too.
fn mark(name: &str, held: &[&str]) -> &'static str {
    if held.iter().any(|h| *h == name || h.ends_with(&format!(" of {name}"))) { " <em>held out</em>" } else { "" }
}

fn recording_row(e: &Value, x: &Scale, retuned: bool) -> String {
    let unit = escape(&unit(text(e, "unit").unwrap_or("")));
    let value = |key: &str| real(e, key).map_or_else(|| "–".to_owned(), |v| number(v, 2));
    let drawn = match (real(e, "before"), real(e, "after"), real(e, "noise")) {
        (Some(b), Some(a), Some(n)) if n > 0.0 && a > 0.0 && b > 0.0 => dumbbell(b / n, retuned.then_some(a / n), x),
        _ => String::new(),
    };
    format!(
        "<th scope=\"row\">{}</th><td class=\"num\">{}</td>{}<td class=\"num\">{} {unit}</td><td class=\"drawn\">{drawn}</td>",
        escape(&channel(text(e, "channel").unwrap_or("unnamed"))),
        value("before"),
        if retuned { format!("<td class=\"num\">{}</td>", value("after")) } else { String::new() },
        value("noise"),
    )
}

fn dumbbell(before: f64, after: Option<f64>, x: &Scale) -> String {
    let (b, one) = (x.at(before.ln()), x.at(0.0));
    let end = x.at(after.map_or(0.0, f64::ln));
    let dot = after.map_or_else(String::new, |_| format!("<circle class=\"f-after\" cx=\"{end:.1}\" cy=\"9\" r=\"4.5\"/>"));
    format!(
        "<svg viewBox=\"0 0 240 18\" aria-hidden=\"true\"><path class=\"null\" d=\"M{one:.1} 0v18\"/><path class=\"link\" d=\"M{b:.1} 9H{end:.1}\"/>\
         <rect class=\"f-before\" x=\"{:.1}\" y=\"5\" width=\"8\" height=\"8\"/>{dot}</svg>",
        b - 4.0
    )
}

/// Key, name, unit, and factor from the key's unit.
pub const FIGURES: [(&str, &str, &str, f64); 3] = [
    ("engagement_time_s", "Engagement time", "s", 1.0),
    ("dissipated_energy_J", "Dissipated energy", "kJ", 1e-3),
    ("slip_acceleration_rad_s2", "Slip acceleration at lock-up", "rad/s²", 1.0),
];

fn engagement(far: &Value, retuned: bool) -> String {
    let some = |figure: &Value| ["real", "before", "after"].iter().any(|k| real(figure, k).is_some());
    let engages = |figures: &Value| FIGURES.iter().any(|f| some(&figures[f.0]));
    let recordings: Vec<(&String, &Value)> = far["kpi"].as_object().into_iter().flatten().filter(|(_, figures)| engages(figures)).collect();
    if recordings.is_empty() {
        return absent("No engagement figures: no recording holds an engagement up to lock-up, or they are missing.");
    }
    let held = texts(far, "held_out");
    let mut rows = String::new();
    for (name, figures) in recordings {
        let found: Vec<_> = FIGURES.iter().filter(|f| figures[f.0].is_object()).collect();
        for (k, (key, title, unit, factor)) in found.iter().enumerate() {
            let mark = mark(name, &held);
            let group = if k == 0 {
                format!("<th scope=\"rowgroup\" rowspan=\"{}\">{}{mark}</th>", found.len(), escape(name))
            } else {
                String::new()
            };
            let values = ["real", "before", "after"].map(|k| real(&figures[*key], k).map(|v| v * factor));
            rows += &format!("<tr>{group}<th scope=\"row\">{title}, {unit}</th>{}</tr>", cells(values, retuned));
        }
        rows += "</tbody><tbody>";
    }
    let rows = rows.trim_end_matches("<tbody>").trim_end_matches("</tbody>");
    format!(
        "<h3>Engagement figures</h3>\n<div class=\"scroll\" role=\"region\" aria-label=\"Engagement figures\" tabindex=\"0\"><table class=\"figures-table\"><thead><tr>\
         <th scope=\"col\">Recording</th><th scope=\"col\">Figure</th><th scope=\"col\" class=\"num\">Car</th>{}</tr></thead><tbody>{rows}</tbody></table></div>\n",
        heads(retuned)
    )
}

/// Table cells of the models' values, with their deviation from the car's in per cent.
fn cells(values: [Option<f64>; 3], retuned: bool) -> String {
    let real = values[0];
    let off = |v: f64| match real {
        // Beyond a factor of ten, a decimal carries no information.
        Some(r) if r.abs() > 1e-9 => {
            let p = 100.0 * (v / r - 1.0);
            format!("<small>{}&#8239;%</small>", signed(p, usize::from(p.abs() < 1000.0)))
        }
        _ => String::new(),
    };
    let worse = matches!(values, [Some(r), Some(b), Some(a)] if (a - r).abs() > (b - r).abs() + 0.01 * r.abs());
    let cell = |v: Option<f64>, compare: bool| match v {
        Some(v) => format!("<td class=\"num\">{}{}</td>", number(v, 4), if compare { off(v) } else { String::new() }),
        None => "<td class=\"num\">–</td>".to_owned(),
    };
    let after = cell(values[2], true);
    let after = if worse {
        after.replacen("<td class=\"num\">", "<td class=\"num worse\"><span class=\"unseen\">worse: </span>", 1)
    } else {
        after
    };
    cell(real, false) + &cell(values[1], true) + if retuned { &after } else { "" }
}
