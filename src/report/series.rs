//! Curves encoded as small integers, so that the report of a usual campaign fits into an e-mail.
//!
//! The measured curve is stored as differences between successive samples, and the models' curves as differences of (measured − model); both are in units of a quantum `q`
//! below the noise, encoded as bytes of variable length in base 64. Up to [`WHOLE`] samples are all stored. Longer data are decimated: of each stretch of time the least and
//! the greatest measured value and the samples with the greatest gap of the nominal and of the retuned model are kept, so that no peak is lost.

use serde_json::{Value, json};

use super::json::{list, real, text};
use super::{Input, Overlay, OverlayChannel};

/// Number of samples, all channels together, up to which none is left out.
const WHOLE: usize = 300_000;
/// Number of points, all channels together, that the viewer gets otherwise.
const VIEWER_POINTS: usize = 60_000;

/// An input signal of a recording.
#[derive(Clone, Debug, Default)]
pub struct Signal {
    /// Column of the recording.
    pub column: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// One value per sample of the curves.
    pub values: Vec<f64>,
}

/// Inputs and clutch states of one recording.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    /// Reported torque and commanded position.
    pub signals: Vec<Signal>,
    /// State of the clutch per sample: 0 open, 1 slipping, 2 locked.
    pub phases: Vec<u8>,
    /// Disc temperature of the retuned model, °C.
    pub theta: Vec<f64>,
}

/// All curves as JSON that is safe inside a script element.
pub fn embedded(input: &Input) -> String {
    let limit = viewer_limit(input.overlays);
    let nothing = Trace::default();
    let recordings: Vec<Value> = input
        .overlays
        .iter()
        .enumerate()
        .map(|(k, o)| recording(o, input.traces.get(k).unwrap_or(&nothing), input.diagnosis, limit))
        .collect();
    let flywheel = super::residuals::flywheel(input).map(|(inertia, damping)| [inertia, damping]);
    json!({ "recordings": recordings, "retuned": retuned(input.diagnosis), "flywheel": flywheel }).to_string().replace('<', "\\u003c")
}

/// Number of points per curve that the viewer gets.
pub(super) fn viewer_limit(overlays: &[Overlay]) -> usize {
    let samples: usize = overlays.iter().flat_map(|o| &o.channels).map(OverlayChannel::len).sum();
    if samples <= WHOLE { usize::MAX } else { limit(overlays, VIEWER_POINTS, usize::MAX) }
}

/// Whether there is a retuned model beside the nominal one; if not, its curves would only repeat the nominal ones.
pub fn retuned(diagnosis: &Value) -> bool {
    !matches!(text(diagnosis, "verdict"), Some("unexplained" | "inputs_do_not_fit")) || holds_law(diagnosis)
}

/// Whether the retuned plant contains a learned law.
pub fn holds_law(diagnosis: &Value) -> bool {
    diagnosis["how_far"]["empirical"]["taken"] == true
}

/// Words for one or several learned laws: the name with and without an article, and the clause that they name no cause.
pub fn law_words(far: &Value) -> [&'static str; 3] {
    match far["empirical"]["laws"].as_array() {
        Some(laws) if laws.len() > 1 => ["empirical laws", "empirical laws", "which name no cause"],
        _ => ["an empirical law", "empirical law", "which names no cause"],
    }
}

/// Number of points that each channel may have if all channels share `total`.
pub fn limit(overlays: &[Overlay], total: usize, most: usize) -> usize {
    let channels: usize = overlays.iter().map(|o| o.channels.len()).sum();
    (total / channels.max(1)).clamp(45, most)
}

/// Standard deviation of the noise of a channel, as stated by the diagnosis for this recording, or else for another one, because the sensor is the same.
pub fn noise(diagnosis: &Value, recording: &str, column: &str) -> Option<f64> {
    let rows = list(&diagnosis["how_far"], "per_recording");
    let mut of_channel = rows.iter().filter(|r| text(r, "channel") == Some(column));
    let own = of_channel.clone().find(|r| text(r, "recording") == Some(recording));
    own.or_else(|| of_channel.next()).and_then(|r| real(r, "noise"))
}

/// Root mean square of `real − model`.
pub fn rms(real: &[f64], model: &[f64]) -> f64 {
    let squares: Vec<f64> = real.iter().zip(model).map(|(r, m)| (r - m) * (r - m)).filter(|s| s.is_finite()).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

impl OverlayChannel {
    /// Number of samples that all three curves have.
    pub fn len(&self) -> usize {
        self.real.len().min(self.before.len()).min(self.after.len())
    }

    /// Whether there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Indices of the samples to draw: all of them, or about `limit` of them that keep every peak.
    pub fn kept(&self, limit: usize) -> Vec<usize> {
        let n = self.len();
        if n <= limit {
            return (0..n).collect();
        }
        let stretches = (limit / 4).max(1);
        let mut kept = vec![0, n - 1];
        for s in 0..stretches {
            let stretch = s * n / stretches..(s + 1) * n / stretches;
            let least =
                |key: &dyn Fn(usize) -> f64| stretch.clone().filter(|&i| key(i).is_finite()).min_by(|&i, &j| key(i).total_cmp(&key(j)));
            kept.extend(least(&|i| self.real[i]));
            kept.extend(least(&|i| -self.real[i]));
            kept.extend(least(&|i| -(self.real[i] - self.before[i]).abs()));
            kept.extend(least(&|i| -(self.real[i] - self.after[i]).abs()));
            // Gaps in the measurement must remain gaps.
            kept.extend(stretch.clone().find(|&i| !self.real[i].is_finite()));
        }
        kept.sort_unstable();
        kept.dedup();
        kept
    }
}

fn recording(overlay: &Overlay, trace: &Trace, diagnosis: &Value, limit: usize) -> Value {
    let channels: Vec<Value> = overlay.channels.iter().map(|c| channel(c, noise(diagnosis, &overlay.recording, c.column), limit)).collect();
    let inputs: Vec<Value> = trace.signals.iter().filter(|s| s.values.iter().any(|v| v.is_finite())).map(|s| signal(s, limit)).collect();
    json!({
        "name": overlay.recording, "manoeuvre": overlay.manoeuvre, "held_out": overlay.held_out, "dt": overlay.dt, "channels": channels,
        "inputs": inputs, "phases": runs(&trace.phases),
    })
}

/// Start of each run of equal clutch state: sample and state.
fn runs(phases: &[u8]) -> Vec<[usize; 2]> {
    let begins = |i: usize| i == 0 || phases[i] != phases[i - 1];
    (0..phases.len()).filter(|&i| begins(i)).map(|i| [i, phases[i].into()]).collect()
}

fn signal(s: &Signal, limit: usize) -> Value {
    let step = s.values.len().div_ceil(limit.max(1)).max(1);
    let kept: Vec<f64> = s.values.iter().copied().step_by(step).collect();
    let q = quantum(&kept);
    json!({ "label": super::text::channel(s.column), "unit": super::text::unit(s.unit), "q": q, "step": step, "values": packed(kept.iter().map(|v| v / q)) })
}

pub(super) fn channel(c: &OverlayChannel, noise: Option<f64>, limit: usize) -> Value {
    let kept = c.kept(limit);
    let q = quantum(&c.real);
    let over = |model: &[f64]| packed(kept.iter().map(|&i| (c.real[i] - model[i]) / q));
    let index = (kept.len() < c.len()).then(|| packed(kept.iter().map(|&i| i as f64)));
    let size = |model: &[f64]| Some(rms(&c.real, model)).filter(|r| r.is_finite());
    let sizes = [size(&c.before), size(&c.after)];
    json!({
        "column": c.column, "label": super::text::channel(c.column), "unit": super::text::unit(c.unit), "q": q, "noise": noise, "samples": c.len(),
        "rms": sizes,
        "index": index, "real": packed(kept.iter().map(|&i| c.real[i] / q)), "before": over(&c.before), "after": over(&c.after),
    })
}

/// Rounded values as differences of successive values, in base 64. Each difference is doubled with its sign in the lowest bit, and one is added, because zero stands for a
/// missing value. Seven bits go into each byte, the lowest first, and the eighth bit says that more follow.
fn packed(values: impl Iterator<Item = f64>) -> String {
    let mut bytes = Vec::new();
    let mut level = 0_i64;
    for value in values {
        let now = value.round();
        let mut left = if now.is_finite() && now.abs() < 1e15 {
            let step = now as i64 - level;
            level = now as i64;
            ((step << 1) ^ (step >> 63)) as u64 + 1
        } else {
            0
        };
        while left > 127 {
            bytes.push((left & 127) as u8 | 128);
            left >>= 7;
        }
        bytes.push(left as u8);
    }
    base64(&bytes)
}

pub(super) fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let all = three.iter().fold(0_u32, |a, b| a << 8 | u32::from(*b)) << (8 * (3 - three.len()));
        for k in 0..4 {
            out.push(if k > three.len() { '=' } else { LETTERS[(all >> (18 - 6 * k) & 63) as usize] as char });
        }
    }
    out
}

/// Quantum of 1, 2 or 5 times a power of ten, between 1/20 000 and 1/8 000 of the range; this is below the noise even for a speed that runs from 0 to 250 rad/s.
fn quantum(values: &[f64]) -> f64 {
    let (low, high) = super::chart::range(values.iter());
    let finest = ((high - low) / 2e4).clamp(1e-9, 1e9);
    let exponent = finest.log10().floor() as i32;
    // The value is parsed from text, because 10^-3 as a product of floats is not the float nearest to 0.001.
    let steps = [(1, exponent), (2, exponent), (5, exponent), (1, exponent + 1)].map(|(m, e)| format!("{m}e{e}"));
    let steps = steps.map(|text| text.parse::<f64>().expect("digits with an exponent are a number"));
    steps.into_iter().find(|q| *q >= finest).unwrap_or(finest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel_of(real: Vec<f64>) -> OverlayChannel {
        OverlayChannel { column: "omega_f_rad_s", unit: "rad/s", before: real.iter().map(|r| r + 1.0).collect(), after: real.clone(), real }
    }

    #[test]
    fn a_peak_survives_thinning() {
        let mut real = vec![0.0; 600_000];
        real[123_457] = 9.0;
        let mut c = channel_of(real);
        // Where only one of the models is far off.
        c.before[333_333] = -5.0;
        c.after[444_444] = 7.0;
        let kept = c.kept(3000);
        assert!([123_457, 333_333, 444_444].iter().all(|k| kept.contains(k)) && kept.len() <= 3100, "{} points", kept.len());
        assert_eq!((kept[0], *kept.last().unwrap()), (0, 599_999));
    }

    #[test]
    fn bytes_hold_steps_and_gaps() {
        // 20000 is 40000 doubled and 40001 with one added: 65, 56, 2 in groups of seven bits; a difference of 24 is stored as 49; a missing value as 0; 30076 is a difference
        // of 10052.
        let c = channel_of(vec![100.0, 100.12, f64::NAN, 150.38]);
        let stored = channel(&c, None, 100);
        assert_eq!(stored["q"], 0.005);
        assert_eq!(stored["real"], base64(&[0xC1, 0xB8, 2, 49, 0, 0x89, 0x9D, 1]));
        assert_eq!(stored["before"], base64(&[0x90, 3, 1, 0, 1]), "−200 is 399 with its sign in the last bit, 400 with one added");
        assert_eq!([base64(b"kiss"), base64(b"poi"), base64(b"nt")], ["a2lzcw==", "cG9p", "bnQ="]);
    }

    #[test]
    fn rounding_is_below_the_noise() {
        for top in [99.0, 150.0, 182.0, 201.0, 249.0, 1000.0] {
            let q = quantum(&[0.0, top]);
            assert!((1.1 * top / 2e4..=1.1 * top / 8e3).contains(&q), "{top}: {q}");
        }
    }

    #[test]
    fn what_fits_is_whole() {
        let overlay = Overlay {
            recording: "r".into(),
            manoeuvre: String::new(),
            held_out: true,
            dt: 1e-3,
            theta: [25.0; 2],
            slip_angle: 0.0,
            channels: vec![channel_of(vec![1.5; 100_000])],
        };
        let d = json!({});
        let page = embedded(&Input { overlays: &[overlay], ..Input::empty(&d) });
        assert!(page.contains("\"index\":null"), "100 000 samples are no reason to leave any out");
    }

    #[test]
    fn states_are_told_where_they_begin() {
        assert_eq!(runs(&[0, 0, 1, 1, 2]), [[0, 0], [2, 1], [4, 2]]);
    }
}
