//! Residuals of the free replay: tests of whether they look like noise, are white, and depend on any signal.
//!
//! Whiteness: the share of autocorrelations at lags 1 to 25 outside ±1.96/√n, which is 5 % for white noise. Independence: the largest correlation of the residual with slip,
//! position, disc temperature or clutch torque, compared with the bound ±1.96/√n. Errors accumulate over a free replay, so a residual that narrowly fails these tests may be
//! due to a small error of a law, and not to a further effect.

use super::chart::{Scale, decimals, range, ticks};
use super::text::{channel, escape, fixed, number, percent, signed, unit};
use super::{Input, Overlay, OverlayChannel, absent, series};
use std::fmt::Write as _;

/// Number of autocorrelations that are tested.
const LAGS: usize = 25;
/// Half width of a 95 % interval in standard deviations.
const INTERVAL: f64 = 1.96;

/// Statistics of the residual of one channel.
pub struct Residual {
    /// Recording.
    pub recording: String,
    /// Column.
    pub column: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Root mean square.
    pub rms: f64,
    /// Share of samples outside ±2σ of the sensor's noise.
    pub outside: f64,
    /// Longest uninterrupted time outside ±2σ, s; a single sample inside does not interrupt it.
    pub longest_s: f64,
    /// Largest magnitude of the residual.
    pub largest: f64,
    /// Share of the autocorrelations outside their bound.
    pub coloured: f64,
    /// Autocorrelation at lag 1.
    pub lag_1: f64,
    /// The signal with which the residual correlates most, and the correlation coefficient.
    pub depends: Option<(&'static str, f64)>,
    /// 95 % bound of a correlation coefficient.
    pub bound: f64,
}

/// Residuals of the held-out recordings after retuning.
pub fn held_out(input: &Input) -> Vec<Residual> {
    input.overlays.iter().filter(|o| o.held_out).flat_map(|o| o.channels.iter().filter_map(|c| residual(input, o, c))).collect()
}

fn residual(input: &Input, o: &Overlay, c: &OverlayChannel) -> Option<Residual> {
    let sigma = series::noise(input.diagnosis, &o.recording, c.column).filter(|s| *s > 0.0)?;
    let gaps: Vec<f64> = (0..c.len()).map(|i| c.real[i] - c.after[i]).collect();
    let known: Vec<f64> = gaps.iter().copied().filter(|g| g.is_finite()).collect();
    if known.len() < 2 * LAGS {
        return None;
    }
    let n = known.len() as f64;
    let bound = INTERVAL / n.sqrt();
    let auto: Vec<f64> = (1..=LAGS).map(|lag| correlation(&known[lag..], &known[..known.len() - lag])).collect();
    let (mut longest, mut begin, mut last): (usize, Option<usize>, usize) = (0, None, 0);
    for (i, _) in gaps.iter().enumerate().filter(|(_, g)| g.abs() > 2.0 * sigma) {
        if begin.is_none() || i > last + 2 {
            begin = Some(i);
        }
        last = i;
        longest = longest.max(i - begin.unwrap_or(i));
    }
    let depends = regressors(o)
        .into_iter()
        .map(|(name, values)| (name, correlation(&gaps, &values)))
        .filter(|(_, r)| r.is_finite())
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    Some(Residual {
        recording: o.recording.clone(),
        column: c.column,
        unit: c.unit,
        rms: (known.iter().map(|g| g * g).sum::<f64>() / n).sqrt(),
        outside: known.iter().filter(|g| g.abs() > 2.0 * sigma).count() as f64 / n,
        longest_s: longest as f64 * o.dt,
        largest: known.iter().fold(0.0, |m: f64, g| m.max(g.abs())),
        coloured: auto.iter().filter(|r| r.abs() > bound).count() as f64 / LAGS as f64,
        lag_1: auto[0],
        depends,
        bound,
    })
}

/// Measured signals that a residual may depend on: slip, position, disc temperature and clutch torque, as far as recorded.
fn regressors(o: &Overlay) -> Vec<(&'static str, Vec<f64>)> {
    let of = |column: &str| o.channels.iter().find(|c| c.column == column).map(|c| c.real.as_slice());
    let mut all = Vec::new();
    if let (Some(f), Some(c)) = (of("omega_f_rad_s"), of("omega_c_rad_s")) {
        all.push(("slip", f.iter().zip(c).map(|(f, c)| f - c).collect()));
    }
    for (column, name) in [("x_to_mm", "position"), ("theta_c_degC", "disc temperature"), ("T_fc_Nm", "clutch torque")] {
        all.extend(of(column).map(|v| (name, v.to_vec())));
    }
    all
}

/// Correlation coefficient of two series, over the samples that are finite in both.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let pairs: Vec<(f64, f64)> = a.iter().zip(b).map(|(a, b)| (*a, *b)).filter(|(a, b)| a.is_finite() && b.is_finite()).collect();
    let n = pairs.len() as f64;
    let (ma, mb) = pairs.iter().fold((0.0, 0.0), |(x, y), (a, b)| (x + a / n, y + b / n));
    let (mut saa, mut sbb, mut sab) = (0.0, 0.0, 0.0);
    for (a, b) in pairs {
        saa += (a - ma).powi(2);
        sbb += (b - mb).powi(2);
        sab += (a - ma) * (b - mb);
    }
    sab / (saa * sbb).sqrt()
}

/// The section: the table of tests, and the unexplained torque on the flywheel.
pub fn section(input: &Input) -> String {
    let all = held_out(input);
    if all.is_empty() {
        return absent("Residuals were not tested: no curves of what was held out, or no noise to hold them against.");
    }
    let row = |r: &Residual| {
        let flag = |bad: bool| if bad { " class=\"num out\"" } else { " class=\"num\"" };
        let depends = r.depends.map_or_else(|| "–".to_owned(), |(name, c)| format!("{} {}", name, signed(c, 2)));
        format!(
            "<tr><th scope=\"row\">{}<small>{}</small></th><td class=\"num\">{} {}</td><td{}>{}</td><td{}>{} s</td><td{}>{}<small>lag 1: {}</small></td><td{}>{}<small>bound ±{}</small></td></tr>",
            escape(&channel(r.column)),
            escape(&r.recording),
            number(r.rms, 3),
            escape(&unit(r.unit)),
            flag(r.outside > 0.1),
            percent(r.outside),
            flag(r.longest_s > 0.2),
            number(r.longest_s, 2),
            flag(r.coloured > 0.15),
            percent(r.coloured),
            signed(r.lag_1, 2),
            flag(r.depends.is_some_and(|(_, c)| c.abs() > r.bound)),
            depends,
            number(r.bound, 2)
        )
    };
    let rows: String = all.iter().map(row).collect();
    format!(
        "<h3 id=\"residuals\">Does what is left look like noise?</h3>\n<p>Car minus model in the free replay of what was held out{}. Bold figures are beyond what noise alone would give. \
         Errors accumulate over a free replay, so a residual that fails here may be a small error in some law rather than another effect; \
         the verdict rests on the <a href=\"#where\">residual map</a>, where the model is corrected at every sample.</p>\n\
         <div class=\"scroll\" role=\"region\" aria-label=\"Tests of residuals\" tabindex=\"0\"><table class=\"plain tests\"><thead><tr><th scope=\"col\">Channel</th><th scope=\"col\" class=\"num\">rms</th>\
         <th scope=\"col\" class=\"num\">Outside ±2σ<small>noise: 5&#8239;%</small></th><th scope=\"col\" class=\"num\">Longest outside<small>at a stretch</small></th>\
         <th scope=\"col\" class=\"num\">Not white<small>noise: 5&#8239;% of 25 lags</small></th><th scope=\"col\" class=\"num\">Depends most on<small>correlation</small></th></tr></thead><tbody>{rows}</tbody></table></div>\n{}",
        if series::retuned(input.diagnosis) { ", after retuning" } else { "" },
        lacking(input)
    )
}

/// Time span over which the slope of the gap is taken, s.
const SLOPE_S: f64 = 0.1;
/// Largest number of dots of one scatter plot.
const DOTS: usize = 700;

/// J_f d(car − model)/dt + b_f (car − model), N·m: torque that acts on the car's flywheel but not on the model's.
pub fn unexplained_torque(o: &Overlay, model: fn(&OverlayChannel) -> &Vec<f64>, inertia: f64, damping: f64) -> Vec<f64> {
    let Some(c) = o.channels.iter().find(|c| c.column == "omega_f_rad_s") else { return Vec::new() };
    let values = model(c);
    let gap: Vec<f64> = (0..c.len()).map(|i| c.real[i] - values[i]).collect();
    let reach = ((0.5 * SLOPE_S / o.dt).round() as usize).max(1);
    (0..gap.len())
        .map(|i| {
            let (a, b) = (i.saturating_sub(reach), (i + reach).min(gap.len() - 1));
            if b > a { inertia * (gap[b] - gap[a]) / ((b - a) as f64 * o.dt) + damping * gap[i] } else { f64::NAN }
        })
        .collect()
}

/// Inertia and damping of the flywheel from the nominal plant.
pub fn flywheel(input: &Input) -> Option<(f64, f64)> {
    let numbers = &input.diagnosis["plant"]["nominal_parameters"];
    Some((numbers["driveline.J_f"].as_f64()?, numbers["driveline.b_f"].as_f64().unwrap_or(0.0)))
}

/// Label of the disc temperature, which is that of the retuned model if the campaign has no thermocouple.
fn temperature(input: &Input) -> &'static str {
    let measured = input.overlays.iter().any(|o| o.channels.iter().any(|c| c.column == "theta_c_degC"));
    if measured { "Disc temperature" } else { "Modelled disc temperature" }
}

/// The unexplained torque of all recordings, over slip, temperature and position.
fn lacking(input: &Input) -> String {
    let Some((inertia, damping)) = flywheel(input) else { return String::new() };
    let mut clouds: Vec<(&str, &str, Vec<[f64; 3]>)> =
        vec![("Slip", "rad/s", vec![]), (temperature(input), "°C", vec![]), ("Bearing position", "mm", vec![])];
    for (k, o) in input.overlays.iter().enumerate() {
        let before = unexplained_torque(o, |c| &c.before, inertia, damping);
        let after = unexplained_torque(o, |c| &c.after, inertia, damping);
        let all = regressors(o);
        let commanded = input.traces.get(k).and_then(|t| t.signals.iter().find(|s| s.column == "x_to_cmd_mm")).map(|s| s.values.clone());
        let slip = all.iter().find(|r| r.0 == "slip").map(|r| r.1.clone());
        let measured = all.iter().find(|r| r.0 == "disc temperature").map(|r| r.1.clone());
        let theta = measured.or_else(|| input.traces.get(k).map(|t| t.theta.clone()));
        let x = all.iter().find(|r| r.0 == "position").map(|r| r.1.clone()).or(commanded);
        for (cloud, values) in clouds.iter_mut().zip([slip, theta, x]) {
            for (i, v) in values.into_iter().flatten().enumerate().take(before.len()) {
                if v.is_finite() && before[i].is_finite() && after[i].is_finite() {
                    cloud.2.push([v, before[i], after[i]]);
                }
            }
        }
    }
    let drawn: String = clouds
        .iter()
        .filter(|c| c.2.len() > 20)
        .map(|(name, unit, dots)| scatter(name, unit, dots, series::retuned(input.diagnosis)))
        .collect();
    if drawn.is_empty() {
        return String::new();
    }
    format!(
        "<h3>Unexplained torque on the flywheel</h3>\n<p>Torque that acts on the car’s flywheel and not on the model’s: J_f times the slope of car minus model over {SLOPE_S} s, all recordings{}. \
         A cloud with a shape points to a wrong law, a flat one is noise. The same torque over time is below the speeds of each recording.</p>\n<div class=\"figures\">{drawn}</div>\n",
        if series::retuned(input.diagnosis) { ", before and after retuning" } else { "" }
    )
}

fn scatter(name: &str, unit: &str, dots: &[[f64; 3]], retuned: bool) -> String {
    let step = dots.len().div_ceil(DOTS);
    let kept: Vec<&[f64; 3]> = dots.iter().step_by(step).collect();
    // The scale ignores the few largest dots, since those of a replay that has diverged from the car would squeeze all others.
    let mut sizes: Vec<f64> = kept.iter().flat_map(|d| [d[1].abs(), d[2].abs()]).collect();
    sizes.sort_by(f64::total_cmp);
    let reach = (1.2 * sizes[(sizes.len() * 98 / 100).min(sizes.len() - 1)]).max(0.5);
    let (low, high) = range(kept.iter().map(|d| &d[0]));
    let x = Scale { low, high, a: super::laws::LEFT, b: 512.0 };
    let y = Scale { low: -reach, high: reach, a: 188.0, b: 8.0 };
    let mut drawing = super::laws::frame(&x, &y, &format!("{name}{}", if unit.is_empty() { String::new() } else { format!(", {unit}") }));
    let models: &[(&str, usize)] = if retuned { &[("d-before", 1), ("d-after", 2)] } else { &[("d-before", 1)] };
    for &(class, k) in models {
        let marks: String = kept.iter().filter(|d| d[k].abs() <= reach).fold(String::new(), |mut out, d| {
            write!(out, "M{:.0} {:.0}h0", x.at(d[0]), y.at(d[k])).expect("a String takes any text");
            out
        });
        write!(drawing, "<path class=\"dots {class}\" d=\"{marks}\"/>").expect("a String takes any text");
    }
    let head = if retuned { "before N·m,after N·m" } else { "model N·m" };
    let csv: String = kept.iter().fold(format!("{name} {unit},{head}\n"), |mut out, d| {
        let values: Vec<String> = d[..=models.len()].iter().map(|v| plain(*v)).collect();
        writeln!(out, "{}", values.join(",")).expect("a String takes any text");
        out
    });
    super::laws::figure(&format!("Unexplained torque over {}", name.to_lowercase().replace("modelled ", "")), "N·m", &drawing, &csv, "")
}

/// A number for the data table, with up to five decimals.
pub fn plain(v: f64) -> String {
    let text = format!("{v:.5}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Ticks of a scale with their labels.
pub fn labelled(scale: &Scale, count: usize) -> Vec<(f64, String)> {
    // If the round step is half of the scale or longer, zero would be the only tick; the number of ticks is raised until there are three.
    let at = (count..3 * count).map(|n| ticks(scale.low, scale.high, n)).find(|at| at.len() > 2).unwrap_or_default();
    let places = decimals(&at);
    at.into_iter().map(|t| (t, fixed(t, places))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// Deterministic pseudo-random numbers, uniform between −1 and 1.
    fn noise(n: usize) -> Vec<f64> {
        let mut x = 0.7_f64;
        (0..n)
            .map(|_| {
                x = (x * 9301.0 + 49297.0) % 233_280.0;
                2.0 * x / 233_280.0 - 1.0
            })
            .collect()
    }

    fn overlay(channel: OverlayChannel) -> Overlay {
        Overlay {
            recording: "r".into(),
            manoeuvre: String::new(),
            held_out: true,
            dt: 0.01,
            theta: [25.0; 2],
            slip_angle: 0.0,
            channels: vec![channel],
        }
    }

    fn tested(gap: Vec<f64>) -> Residual {
        let n = gap.len();
        let d = json!({"how_far": {"per_recording": [{"recording": "r", "channel": "omega_f_rad_s", "noise": 0.58}]}});
        let c = OverlayChannel { column: "omega_f_rad_s", unit: "rad/s", real: gap, before: vec![0.0; n], after: vec![0.0; n] };
        let o = overlay(c);
        let input = Input { overlays: &[o], ..Input::empty(&d) };
        held_out(&input).pop().expect("one channel")
    }

    #[test]
    fn noise_passes_and_an_offset_does_not() {
        let white = tested(noise(1000));
        assert!(white.outside < 0.05 && white.longest_s < 0.1 && white.coloured < 0.2, "{} {}", white.longest_s, white.coloured);
        let shifted = tested(noise(1000).iter().enumerate().map(|(i, e)| e + if i > 600 { 3.0 } else { 0.0 }).collect());
        assert!((shifted.longest_s - 3.98).abs() < 0.05 && shifted.outside > 0.35 && shifted.coloured > 0.9, "{}", shifted.longest_s);
    }

    #[test]
    fn a_missing_torque_is_the_slope_of_the_gap() {
        let n = 200;
        let c = OverlayChannel {
            column: "omega_f_rad_s",
            unit: "rad/s",
            real: (0..n).map(|i| 20.0 * 0.01 * f64::from(i)).collect(),
            before: vec![0.0; 200],
            after: vec![0.0; 200],
        };
        let o = overlay(c);
        let torque = unexplained_torque(&o, |c| &c.after, 0.2, 0.0);
        assert!(torque.iter().all(|t| (t - 4.0).abs() < 1e-9), "0.2 kg·m² at 20 rad/s²");
    }
}
