//! How well the retuned plant knows its clutch torque: torque of a held-out recording in a free replay, with its band, and where the campaign covered the state.

use std::fmt::Write as _;

use super::Input;
use super::chart::{Scale, path, range};
use super::laws::{LEFT, figure, frame};
use super::residuals::plain;
use crate::validated::UNKNOWN_NM;

/// The retuned plant along one recording, sample by sample.
#[derive(Clone, Debug, Default)]
pub struct Known {
    /// Name of the recording.
    pub recording: String,
    /// Source of the car's torque, in words.
    pub from: &'static str,
    /// Time, s.
    pub time: Vec<f64>,
    /// Clutch torque, N·m.
    pub torque: Vec<f64>,
    /// Standard deviation of the torque, N·m.
    pub sigma: Vec<f64>,
    /// Validity, 0 to 1.
    pub validity: Vec<f64>,
    /// The car's clutch torque, N·m; non-finite values are gaps.
    pub real: Vec<f64>,
}

/// Half width of the band in standard deviations.
const BAND: f64 = 2.0;
/// Number of points of a curve.
const POINTS: usize = 400;
/// Height of the validity strip, in user units.
const STRIP: f64 = 7.0;

/// The section; empty if there are no data.
pub fn section(input: &Input) -> String {
    let Some(known) = input.known.filter(|k| k.time.len() > 1) else { return String::new() };
    format!(
        "<h3>How well the retuned plant knows its clutch torque</h3>\n<p>The retuned FMU reports it at every instant: <code>T_fc_sigma</code> is the standard deviation of the torque at this slip, temperature and \
         position; <code>validity</code> is 1 where the recordings that taught it covered slip, temperature, position and torque together, and falls to 0 outside.</p>\n\
         <p class=\"keys\"><svg class=\"key\" aria-hidden=\"true\"><path class=\"c-after\" d=\"M0 7h26\"/></svg> retuned plant in a free replay, with its ±2σ band (while locked, of the torque at which it \
         would break away); dots: the car; bar at the foot: dark where the plant is valid</p>\n<div class=\"figures\">{}</div>\n",
        drawn(known)
    )
}

fn drawn(k: &Known) -> String {
    let step = k.time.len().div_ceil(POINTS).max(1);
    let rows: Vec<usize> = (0..k.time.len()).step_by(step).collect();
    // An unknown σ is drawn over the full height of the drawing, and does not influence the scale.
    let width = |i: usize| BAND * k.sigma[i];
    let known = |i: &usize| k.sigma[*i] < UNKNOWN_NM;
    let (low, high) = range(k.time.iter());
    let edges: Vec<f64> = rows.iter().copied().filter(known).flat_map(|i| [k.torque[i] - width(i), k.torque[i] + width(i)]).collect();
    let real: Vec<(f64, f64)> = rows.iter().map(|&i| (k.time[i], k.real[i])).filter(|p| p.1.is_finite()).collect();
    let mut heights: Vec<f64> = real.iter().map(|p| p.1).collect();
    heights.sort_by(f64::total_cmp);
    let inner = heights.get(heights.len() / 50..heights.len() - heights.len() / 50).unwrap_or_default();
    let (bottom, top) = range(k.torque.iter().chain(&edges).chain(inner));
    let x = Scale { low, high, a: LEFT, b: 512.0 };
    let y = Scale { low: bottom, high: top, a: 188.0 - 2.0 * STRIP, b: 8.0 };
    let mut drawing = frame(&x, &y, "time, s");
    let within = |v: f64| y.at(v.clamp(bottom, top));
    let there = rows.iter().map(|&i| (x.at(k.time[i]), within(k.torque[i] + width(i))));
    let back = rows.iter().rev().map(|&i| (x.at(k.time[i]), within(k.torque[i] - width(i))));
    let dots = real.iter().filter(|p| (bottom..=top).contains(&p.1)).fold(String::new(), |mut out, p| {
        write!(out, "M{:.0} {:.0}h0", x.at(p.0), y.at(p.1)).expect("a String takes any text");
        out
    });
    let line = path(rows.iter().map(|&i| (x.at(k.time[i]), y.at(k.torque[i]))));
    write!(
        drawing,
        "<path class=\"noise\" d=\"{}z\"/><path class=\"dots d-real\" d=\"{dots}\"/><path class=\"c-after\" d=\"{line}\"/>",
        path(there.chain(back))
    )
    .expect("a String takes any text");
    drawing += &strip(k, &rows, &x);
    let mut csv = "time s,torque N·m,standard deviation N·m,validity,car N·m\n".to_owned();
    for &i in &rows {
        let all = [k.time[i], k.torque[i], k.sigma[i], k.validity[i], k.real[i]];
        writeln!(csv, "{}", all.map(|v| if v.is_finite() { plain(v) } else { String::new() }).join(",")).expect("a String takes any text");
    }
    figure(&format!("Clutch torque of {}", k.recording), "N·m", &drawing, &csv, k.from)
}

/// The validity as a bar: runs of equal validity, rounded to tenths.
fn strip(k: &Known, rows: &[usize], x: &Scale) -> String {
    let tenth = |i: usize| (10.0 * k.validity[i]).round() as u8;
    let mut out = String::new();
    let mut from = 0;
    for at in 1..=rows.len() {
        if at < rows.len() && tenth(rows[at]) == tenth(rows[from]) {
            continue;
        }
        let (begin, end) = (x.at(k.time[rows[from]]), x.at(k.time[rows[at.min(rows.len() - 1)]]));
        let (width, opacity) = ((end - begin).max(0.5), f64::from(tenth(rows[from])) / 10.0);
        write!(
            out,
            "<rect class=\"valid\" x=\"{begin:.1}\" y=\"{:.1}\" width=\"{width:.1}\" height=\"{STRIP}\" fill-opacity=\"{opacity}\"/>",
            188.0 - STRIP
        )
        .expect("a String takes any text");
        from = at;
    }
    out
}
