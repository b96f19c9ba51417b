//! Curves of each recording: cards to choose from, the viewer's frame, and still figures for paper.

use std::fmt::Write as _;

use super::chart::{Scale, bound, decimals, path, range, ticks};
use super::series::{self, rms};
use super::text::{channel, escape, fixed, number, unit};
use super::{Input, Overlay, OverlayChannel, absent};

/// Points per curve, all channels together, in still figures.
const STILL_POINTS: usize = 12_000;

/// The section.
pub fn section(input: &Input) -> String {
    if input.overlays.is_empty() {
        return absent("No curves were handed over.");
    }
    let limit = series::limit(input.overlays, STILL_POINTS, 240);
    let stills: String = input.overlays.iter().map(|o| still(o, input, limit)).collect();
    let first = first_shown(input);
    let cards: String = input.overlays.iter().enumerate().map(|(k, o)| card(k, o, input, k == first)).collect();
    format!(
        "<p>The model is driven by the recorded inputs. <b>Before</b> is the nominal model, <b>after</b> the retuned one; below each \
         plot stands what the car has over either, each on a scale of its own. Held-out recordings took no part in choosing or fitting.</p>\n\
         <div class=\"live\" id=\"viewer\">\n<div class=\"cards\" role=\"group\" aria-label=\"Recording\">{cards}</div>\n{FRAME}</div>\n\
         <div class=\"stills\">{LEGEND}{stills}</div>\n"
    )
}

/// Key to the still figures.
const LEGEND: &str = r#"<p class="keys"><svg class="key" aria-hidden="true"><path class="c-real" d="M0 7h26"/></svg> real
<svg class="key" aria-hidden="true"><path class="c-before" d="M0 7h26"/></svg> before
<svg class="key" aria-hidden="true"><path class="c-after" d="M0 7h26"/></svg> after; strips below: real − before and real − after, each on its own scale, band ±2σ of noise</p>
"#;

/// What the script fills.
const FRAME: &str = r#"<div class="tools">
<div class="legend" role="group" aria-label="Curves shown">
<button type="button" data-curve="real" aria-pressed="true"><svg class="key" aria-hidden="true"><path class="c-real" d="M0 7h26"/></svg>real</button>
<button type="button" data-curve="before" aria-pressed="true"><svg class="key" aria-hidden="true"><path class="c-before" d="M0 7h26"/></svg>before</button>
<button type="button" data-curve="after" aria-pressed="true"><svg class="key" aria-hidden="true"><path class="c-after" d="M0 7h26"/></svg>after</button>
</div>
<button type="button" id="rpm" aria-pressed="false">speeds in rpm</button>
<div class="zoom" role="group" aria-label="Zoom">
<button type="button" data-zoom="in" aria-label="Zoom in">+</button><button type="button" data-zoom="out" aria-label="Zoom out">−</button><button type="button" data-zoom="reset">Reset</button>
</div>
</div>
<h3 id="shown" class="shown"></h3>
<div id="stage" tabindex="0" role="group" aria-labelledby="shown" aria-describedby="keys"></div>
<p id="keys" class="hint">Move over a plot to read all channels at one instant; drag to zoom, double-click to reset. Keys: <kbd>←</kbd> <kbd>→</kbd> cursor (<kbd>Shift</kbd> for ten samples), <kbd>Home</kbd> <kbd>End</kbd>, <kbd>+</kbd> <kbd>−</kbd> zoom, <kbd>Esc</kbd> reset, <kbd>Page&nbsp;↑</kbd> <kbd>Page&nbsp;↓</kbd> other recording.</p>
<p id="spoken" class="unseen" aria-live="polite"></p>
"#;

/// Held-out recordings prove the most; among them the greatest gap is the one to look at first.
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

/// Gap in multiples of the channel's noise; where that is not known, relative to what the channel spans in the campaign.
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
            "<small>{}<br>gap {} → {} {}</small>",
            escape(&channel(c.column)),
            number(rms(&c.real, &c.before), 2),
            number(rms(&c.real, &c.after), 2),
            escape(&unit(c.unit))
        )
    });
    format!(
        "<button type=\"button\" class=\"card\" data-recording=\"{k}\" aria-pressed=\"{pressed}\"><span><b>{}</b> {}</span>{held}\
         <svg viewBox=\"0 0 160 44\" preserveAspectRatio=\"none\" aria-hidden=\"true\">{curves}</svg>{shrink}</button>",
        escape(&o.recording),
        escape(&super::text::words(&o.manoeuvre)),
    )
}

fn still(o: &Overlay, input: &Input, limit: usize) -> String {
    let held = if o.held_out { " · held out" } else { "" };
    let name = format!("{} · {}{held}", escape(&o.recording), escape(&super::text::words(&o.manoeuvre)));
    let drawn = o.channels.iter().filter(|c| !c.is_empty());
    let figures: String = drawn.map(|c| figure(o, c, series::noise(input.diagnosis, &o.recording, c.column), limit)).collect();
    format!("<div class=\"still\"><h3>{name}</h3><div class=\"figures\">{figures}</div></div>\n")
}

/// Plot and residual strips of one channel, 520 by 292 user units.
fn figure(o: &Overlay, c: &OverlayChannel, noise: Option<f64>, limit: usize) -> String {
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
    let strips = [strip(&c.before, 172.0), strip(&c.after, 226.0)];
    let line = |class: &str, scale: &Scale, value: &dyn Fn(usize) -> f64| {
        let points = kept.iter().map(|&i| (x.at(i as f64 * o.dt), scale.at(value(i))));
        format!("<path class=\"{class}\" d=\"{}\"/>", path(points))
    };
    let mut drawing = axes(&x, &plot, &strips);
    if let Some(sigma) = noise.filter(|s| *s > 0.0) {
        for strip in &strips {
            let (top, bottom) = (strip.at(2.0 * sigma), strip.at(-2.0 * sigma));
            write!(drawing, "<rect class=\"noise\" x=\"52\" width=\"460\" y=\"{top:.1}\" height=\"{:.1}\"/>", bottom - top)
                .expect("a String takes any text");
        }
    }
    drawing += &line("c-real", &plot, &|i| c.real[i]);
    drawing += &line("c-before", &plot, &|i| c.before[i]);
    drawing += &line("c-after", &plot, &|i| c.after[i]);
    drawing += "<g class=\"strip\">";
    drawing += &line("c-before", &strips[0], &|i| gap(&c.before, i));
    drawing += &line("c-after", &strips[1], &|i| gap(&c.after, i));
    drawing += "</g>";
    let unit = escape(&unit(c.unit));
    let label = escape(&channel(c.column));
    let sizes = (number(rms(&c.real, &c.before), 2), number(rms(&c.real, &c.after), 2));
    format!(
        "<figure><figcaption><b>{label}</b>, {unit} <span>gap (rms) <span class=\"t-before\">before {}</span>, \
         <span class=\"t-after\">after {}</span> {unit}</span></figcaption>\
         <svg viewBox=\"0 0 520 292\" role=\"img\" aria-label=\"{label}: gap {} {unit} before, {} {unit} after\">{drawing}</svg></figure>",
        sizes.0, sizes.1, sizes.0, sizes.1
    )
}

/// Grid, ticks and their labels.
fn axes(x: &Scale, plot: &Scale, strips: &[Scale; 2]) -> String {
    let mut out = String::new();
    for strip in strips {
        write!(out, "<rect class=\"floor\" x=\"52\" y=\"{:.0}\" width=\"460\" height=\"48\"/>", strip.b - 2.0)
            .expect("a String takes any text");
    }
    for scale in [plot, &strips[0], &strips[1]] {
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
        write!(out, "<text class=\"tick\" x=\"{:.1}\" y=\"287\" text-anchor=\"middle\">{}{unit}</text>", x.at(*t), fixed(*t, places))
            .expect("a String takes any text");
    }
    out
}
