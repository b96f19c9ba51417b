//! Curves of each recording: cards to choose from, the frame of the viewer, and still figures for print.

use std::fmt::Write as _;

use super::chart::{Scale, bound, decimals, path, range, ticks};
use super::residuals::plain;
use super::series::{self, rms};
use super::text::{channel, escape, fixed, number, unit};
use super::{Input, Overlay, OverlayChannel, absent, laws, timeline};

/// Points per curve, all channels together, in still figures.
const STILL_POINTS: usize = 12_000;

/// The section.
pub fn section(input: &Input) -> String {
    if input.overlays.is_empty() {
        return absent("The curves are missing.");
    }
    let limit = series::limit(input.overlays, STILL_POINTS, 240);
    let stills: String = input.overlays.iter().map(|o| still(o, input, limit)).collect();
    let first = first_shown(input);
    let cards: String = input.overlays.iter().enumerate().map(|(k, o)| card(k, o, input, k == first)).collect();
    let retuned = series::retuned(input.diagnosis);
    let (said, class, legend, frame) = if retuned {
        (
            "<b>Before</b> is the nominal model, <b>after</b> the retuned one; below each plot is car minus model, each on its own scale.",
            "",
            LEGEND,
            FRAME.to_owned(),
        )
    } else {
        let without: String =
            FRAME.lines().filter(|l| !l.contains("data-curve=\"after\"")).map(|l| l.replace(">before<", ">model<") + "\n").collect();
        ("Nothing was retuned, so there is only one model; below each plot is car minus model.", " single", LEGEND_SINGLE, without)
    };
    format!(
        "<p>A free replay: the model starts where the car does and is then driven by the recorded inputs alone. {said} Held-out recordings took no part in choosing or fitting.{drives}</p>\n\
         <div class=\"live\" id=\"viewer\">\n<div class=\"cards\" role=\"group\" aria-label=\"Recording\">{cards}</div>\n{what_if}{frame}</div>\n\
         <div class=\"stills{class}\">{legend}{stills}</div>\n{}",
        timeline::section(input) + &aligned(input, retuned),
        drives = if input.overlays.iter().any(|o| o.recording.contains(" at ")) { DRIVES } else { "" },
        what_if = super::what_if::control(input),
    )
}

/// Why the curves of drives are closer to the car than the stated figures.
const DRIVES: &str = " Engagements of a drive start here at the temperatures that the fit gives them. The figures stated elsewhere on this page use those \
    noted in recordings.json, as a user of the model would, and can be larger.";

/// Legend of the still figures.
const LEGEND: &str = r#"<p class="keys"><svg class="key" aria-hidden="true"><path class="c-real" d="M0 7h26"/></svg> car
<svg class="key" aria-hidden="true"><path class="c-before" d="M0 7h26"/></svg> before
<svg class="key" aria-hidden="true"><path class="c-after" d="M0 7h26"/></svg> after; strips below: car minus model, before and after, each on its own scale, band ±2σ of noise</p>
"#;

/// The legend if there is only one model.
const LEGEND_SINGLE: &str = r#"<p class="keys"><svg class="key" aria-hidden="true"><path class="c-real" d="M0 7h26"/></svg> car
<svg class="key" aria-hidden="true"><path class="c-before" d="M0 7h26"/></svg> model; strip below: car minus model, band ±2σ of noise</p>
"#;

/// Frame of the viewer, which the script fills.
const FRAME: &str = r#"<div class="tools">
<div class="legend" role="group" aria-label="Curves shown">
<button type="button" data-curve="real" aria-pressed="true"><svg class="key" aria-hidden="true"><path class="c-real" d="M0 7h26"/></svg>car</button>
<button type="button" data-curve="before" aria-pressed="true"><svg class="key" aria-hidden="true"><path class="c-before" d="M0 7h26"/></svg>before</button>
<button type="button" data-curve="after" aria-pressed="true"><svg class="key" aria-hidden="true"><path class="c-after" d="M0 7h26"/></svg>after</button>
<button type="button" data-curve="whatif" aria-pressed="true" hidden><svg class="key" aria-hidden="true"><path class="c-whatif" d="M0 7h26"/></svg>what if</button>
</div>
<button type="button" id="rpm" aria-pressed="false">speeds in rpm</button>
<p class="states" id="states" hidden><span class="s0">open</span> <span class="s1">slipping</span> <span class="s2">locked</span></p>
<div class="zoom" role="group" aria-label="Zoom">
<button type="button" data-zoom="in" aria-label="Zoom in">+</button><button type="button" data-zoom="out" aria-label="Zoom out">−</button><button type="button" data-zoom="reset">Reset</button>
</div>
</div>
<h3 id="shown" class="shown"></h3>
<div id="stage" tabindex="0" role="group" aria-labelledby="shown" aria-describedby="keys"></div>
<p id="keys" class="hint">Move over a plot to read all channels at one instant; drag to zoom, double-click to reset. The page’s address holds recording and zoom. Keys: <kbd>←</kbd> <kbd>→</kbd> cursor (<kbd>Shift</kbd> for ten samples), <kbd>Home</kbd> <kbd>End</kbd>, <kbd>+</kbd> <kbd>−</kbd> zoom, <kbd>Esc</kbd> reset, <kbd>Page&nbsp;↑</kbd> <kbd>Page&nbsp;↓</kbd> other recording.</p>
<p id="spoken" class="unseen" aria-live="polite"></p>
"#;

/// Slip below which the clutch counts as locked, rad/s.
const LOCKED: f64 = 1.5;
/// Time shown before and after lock-up, s.
const AROUND_S: (f64, f64) = (1.5, 0.5);

/// Slip of all launches, each with its own lock-up at time zero; shows how retuning changes the way the clutch closes.
fn aligned(input: &Input, retuned: bool) -> String {
    let of = |o: &Overlay, column: &str, pick: fn(&OverlayChannel) -> &Vec<f64>| {
        o.channels.iter().find(|c| c.column == column).map(|c| pick(c).clone())
    };
    let slip = |o: &Overlay, pick: fn(&OverlayChannel) -> &Vec<f64>| -> Option<Vec<f64>> {
        let (f, c) = (of(o, "omega_f_rad_s", pick)?, of(o, "omega_c_rad_s", pick)?);
        Some(f.iter().zip(&c).map(|(f, c)| f - c).collect())
    };
    // Index of lock-up, for an overlay that slips at first and then locks.
    let locks = |s: &[f64]| s.iter().position(|v| v.abs() < LOCKED).filter(|&k| k > 20 && s.first().is_some_and(|v| *v > 10.0 * LOCKED));
    let launches: Vec<(&Overlay, usize)> = input.overlays.iter().filter_map(|o| Some((o, locks(&slip(o, |c| &c.real)?)?))).collect();
    if launches.is_empty() {
        return String::new();
    }
    let models: &[(&str, fn(&OverlayChannel) -> &Vec<f64>)] =
        if retuned { &[("before", |c| &c.before), ("after", |c| &c.after)] } else { &[("before", |c| &c.before)] };
    let x = Scale { low: -AROUND_S.0, high: AROUND_S.1, a: laws::LEFT, b: 512.0 };
    let mut drawn: Vec<(&str, Vec<(&str, &str, Vec<(f64, f64)>)>)> = Vec::new();
    for (name, model) in models {
        let mut curves: Vec<(&str, &str, Vec<(f64, f64)>)> = Vec::new();
        for (o, lock) in &launches {
            let around = |s: Option<Vec<f64>>| -> Vec<(f64, f64)> {
                let timed = s.into_iter().flatten().enumerate().map(|(i, v)| ((i as f64 - *lock as f64) * o.dt, v));
                timed.filter(|p| (x.low..=x.high).contains(&p.0)).collect()
            };
            curves.push((&o.recording, "c-real", around(slip(o, |c| &c.real))));
            curves.push((&o.recording, if *name == "after" { "c-after" } else { "c-before" }, around(slip(o, *model))));
        }
        drawn.push((name, curves));
    }
    // Both figures share one scale, because they are meant to be compared.
    let (low, high) = range(drawn.iter().flat_map(|d| &d.1).flat_map(|c| c.2.iter().map(|p| &p.1)));
    let y = Scale { low, high, a: 188.0, b: 8.0 };
    let mut figures = String::new();
    for (name, curves) in &drawn {
        let mut drawing = laws::frame(&x, &y, "time from the car’s lock-up, s");
        let mut csv = "recording,curve,time s,slip rad/s\n".to_owned();
        for (recording, class, points) in curves {
            write!(drawing, "<path class=\"{class} thin\" d=\"{}\"/>", path(points.iter().map(|p| (x.at(p.0), y.at(p.1)))))
                .expect("a String takes any text");
            let curve = if *class == "c-real" { "car" } else { "model" };
            for p in points.iter().filter(|p| p.1.is_finite()).step_by(1 + points.len() / 100) {
                writeln!(csv, "{recording},{curve},{},{}", plain(p.0), plain(p.1)).expect("a String takes any text");
            }
        }
        let title = if retuned { format!("Slip of car and model, {name}") } else { "Slip of car and model".to_owned() };
        figures += &laws::figure(&title, "rad/s", &drawing, &csv, &format!("{} launches", launches.len()));
    }
    format!("<h3>Launches, aligned where the car locks up</h3>\n<div class=\"figures\">{figures}</div>\n")
}

/// Index of the overlay shown first: held-out recordings come before others because they prove most, and among them the one with the largest gap.
fn first_shown(input: &Input) -> usize {
    let overlays = input.overlays;
    let gap = |o: &Overlay| o.channels.iter().map(|c| relative_gap(o, c, input)).fold(0.0, f64::max);
    let rank = |o: &Overlay| (o.held_out, gap(o));
    let mut best = 0;
    for k in 1..overlays.len() {
        let (a, b) = (rank(&overlays[k]), rank(&overlays[best]));
        if (a.0 && !b.0) || (a.0 == b.0 && a.1 > b.1) {
            best = k;
        }
    }
    best
}

/// Gap in multiples of the channel's noise; if the noise is not known, relative to the range of the channel in the campaign.
fn relative_gap(o: &Overlay, c: &OverlayChannel, input: &Input) -> f64 {
    let span = || {
        let same = input.overlays.iter().flat_map(|o| &o.channels).filter(|other| other.column == c.column);
        let (low, high) = range(same.flat_map(|c| &c.real));
        high - low
    };
    let gap = rms(&c.real, &c.before) / series::noise(input.diagnosis, &o.recording, c.column).filter(|n| *n > 0.0).unwrap_or_else(span);
    if gap.is_finite() { gap } else { 0.0 }
}

/// A button with a thumbnail of the speeds.
fn card(k: usize, o: &Overlay, input: &Input, pressed: bool) -> String {
    let speeds: Vec<&OverlayChannel> = o.channels.iter().take(2).collect();
    let (low, high) = range(speeds.iter().flat_map(|c| c.real.iter().chain(&c.before)));
    let y = Scale { low, high, a: 42.0, b: 2.0 };
    let mut curves = String::new();
    for c in &speeds {
        let x = Scale { low: 0.0, high: c.len().max(2) as f64 - 1.0, a: 0.0, b: 160.0 };
        let kept = c.kept(90);
        for (class, values) in [("c-before", &c.before), ("c-real", &c.real)] {
            let line = path(kept.iter().map(|&i| (x.at(i as f64), y.at(values[i]))));
            write!(curves, "<path class=\"{class}\" d=\"{line}\"/>").expect("a String takes any text");
        }
    }
    let held = if o.held_out { "<em>held out</em>" } else { "" };
    let worst = o.channels.iter().max_by(|a, b| relative_gap(o, a, input).total_cmp(&relative_gap(o, b, input)));
    let shrink = worst.map_or_else(String::new, |c| {
        format!(
            "<small>{}<br>off by {}{} {}</small>",
            escape(&channel(c.column)),
            number(rms(&c.real, &c.before), 2),
            if series::retuned(input.diagnosis) { format!(" → {}", number(rms(&c.real, &c.after), 2)) } else { String::new() },
            escape(&unit(c.unit))
        )
    });
    format!(
        "<button type=\"button\" class=\"card\" data-recording=\"{k}\" aria-pressed=\"{pressed}\"><span><b>{}</b> {}{held}</span>\
         <svg viewBox=\"0 0 160 44\" preserveAspectRatio=\"none\" aria-hidden=\"true\">{curves}</svg>{shrink}</button>",
        escape(&o.recording),
        escape(&super::text::words(&o.manoeuvre)),
    )
}

fn still(o: &Overlay, input: &Input, limit: usize) -> String {
    let retuned = series::retuned(input.diagnosis);
    let held = if o.held_out { " · held out" } else { "" };
    let name = format!("{} · {}{held}", escape(&o.recording), escape(&super::text::words(&o.manoeuvre)));
    let drawn = o.channels.iter().filter(|c| !c.is_empty());
    let figures: String = drawn.map(|c| figure(o, c, series::noise(input.diagnosis, &o.recording, c.column), limit, retuned)).collect();
    format!("<div class=\"still\"><h3>{name}</h3><div class=\"figures\">{figures}</div></div>\n")
}

/// Plot and residual strips of one channel, 520 by 292 user units.
fn figure(o: &Overlay, c: &OverlayChannel, noise: Option<f64>, limit: usize, retuned: bool) -> String {
    let kept = c.kept(limit);
    let n = c.len();
    let x = Scale { low: 0.0, high: (n.max(2) - 1) as f64 * o.dt, a: 52.0, b: 512.0 };
    let (low, high) = range(c.real[..n].iter().chain(&c.before[..n]).chain(&c.after[..n]));
    let plot = Scale { low, high, a: 158.0, b: 8.0 };
    let gap = |model: &[f64], i: usize| c.real[i] - model[i];
    let strip = |model: &[f64], top: f64| {
        let gaps = kept.iter().map(|&i| gap(model, i).abs()).filter(|g| g.is_finite());
        let reach = gaps.fold(2.5 * noise.unwrap_or(0.0), f64::max) * 1.05;
        let reach = if reach > 0.0 && reach.is_finite() { reach } else { 1.0 };
        Scale { low: -reach, high: reach, a: top + 44.0, b: top }
    };
    let strips = if retuned { vec![strip(&c.before, 172.0), strip(&c.after, 226.0)] } else { vec![strip(&c.before, 172.0)] };
    let height = if retuned { 292 } else { 238 };
    let line = |class: &str, scale: &Scale, value: &dyn Fn(usize) -> f64| {
        let points = kept.iter().map(|&i| (x.at(i as f64 * o.dt), scale.at(value(i))));
        format!("<path class=\"{class}\" d=\"{}\"/>", path(points))
    };
    let mut drawing = axes(&x, &plot, &strips, height);
    if let Some(sigma) = noise.filter(|s| *s > 0.0) {
        for strip in &strips {
            let (top, bottom) = (strip.at(2.0 * sigma), strip.at(-2.0 * sigma));
            write!(drawing, "<rect class=\"noise\" x=\"52\" width=\"460\" y=\"{top:.1}\" height=\"{:.1}\"/>", bottom - top)
                .expect("a String takes any text");
        }
    }
    drawing += &line("c-real", &plot, &|i| c.real[i]);
    drawing += &line("c-before", &plot, &|i| c.before[i]);
    if retuned {
        drawing += &line("c-after", &plot, &|i| c.after[i]);
    }
    drawing += "<g class=\"strip\">";
    drawing += &line("c-before", &strips[0], &|i| gap(&c.before, i));
    if retuned {
        drawing += &line("c-after", &strips[1], &|i| gap(&c.after, i));
    }
    drawing += "</g>";
    let unit = escape(&unit(c.unit));
    let label = escape(&channel(c.column));
    let sizes = (number(rms(&c.real, &c.before), 2), number(rms(&c.real, &c.after), 2));
    let (b, a) = sizes;
    let (shown, said) = if retuned {
        (
            format!("<span class=\"t-before\">before {b}</span>, <span class=\"t-after\">after {a}</span>"),
            format!("{b} {unit} before, {a} {unit} after"),
        )
    } else {
        (format!("<span class=\"t-before\">{b}</span>"), format!("{b} {unit}"))
    };
    format!(
        "<figure><figcaption><span><b>{label}</b>, {unit}</span> <span>car minus model (rms) {shown} {unit}</span></figcaption>\
         <svg viewBox=\"0 0 520 {height}\" role=\"img\" aria-label=\"{label}: car minus model {said}\">{drawing}</svg></figure>"
    )
}

/// Grid, ticks and their labels.
fn axes(x: &Scale, plot: &Scale, strips: &[Scale], height: i32) -> String {
    let mut out = String::new();
    for strip in strips {
        write!(out, "<rect class=\"floor\" x=\"52\" y=\"{:.0}\" width=\"460\" height=\"48\"/>", strip.b - 2.0)
            .expect("a String takes any text");
    }
    for scale in std::iter::once(plot).chain(strips) {
        let round = bound(scale.high);
        let at = if scale.high == -scale.low { vec![-round, 0.0, round] } else { ticks(scale.low, scale.high, 4) };
        let places = decimals(&at);
        for t in at {
            let y = scale.at(t);
            write!(
                out,
                "<path class=\"grid\" d=\"M52 {y:.1}h460\"/><text class=\"tick\" x=\"47\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                y + 4.0,
                fixed(t, places)
            )
            .expect("a String takes any text");
        }
    }
    let at = ticks(x.low, x.high, 6);
    let places = decimals(&at);
    for (k, t) in at.iter().enumerate() {
        let unit = if k + 1 == at.len() { " s" } else { "" };
        write!(
            out,
            "<text class=\"tick\" x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{}{unit}</text>",
            x.at(*t),
            height - 5,
            fixed(*t, places)
        )
        .expect("a String takes any text");
    }
    out
}
