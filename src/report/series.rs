//! Curves as small integers, so that a usual campaign fits into a mail.
//!
//! The measured curve is stored as steps between samples, the models' as what the measurement has over them, both in units of a
//! decimal quantum `q` far below the noise. Long recordings are thinned: of each stretch of time the least and the greatest
//! measured value and the greatest gap are kept, so that no peak is lost.

use serde_json::{Value, json};

use super::json::{list, real, text};
use super::{Input, Overlay, OverlayChannel};

/// Points per curve, all channels together, that the viewer gets.
const VIEWER_POINTS: usize = 60_000;

/// All curves as JSON that is safe inside a script element.
pub fn embedded(input: &Input) -> String {
    let limit = limit(input.overlays, VIEWER_POINTS, usize::MAX);
    let recordings: Vec<Value> = input.overlays.iter().map(|o| recording(o, input.diagnosis, limit)).collect();
    json!({ "recordings": recordings }).to_string().replace('<', "\\u003c")
}

/// Points that each channel may have if all share `total`.
pub fn limit(overlays: &[Overlay], total: usize, most: usize) -> usize {
    let channels: usize = overlays.iter().map(|o| o.channels.len()).sum();
    (total / channels.max(1)).clamp(45, most)
}

/// Standard deviation of the noise of a channel, if the diagnosis states it.
pub fn noise(diagnosis: &Value, recording: &str, column: &str) -> Option<f64> {
    list(&diagnosis["how_far"], "per_recording")
        .iter()
        .find(|r| text(r, "recording") == Some(recording) && text(r, "channel") == Some(column))
        .and_then(|r| real(r, "noise"))
}

/// Root mean square of `real − model`.
pub fn rms(real: &[f64], model: &[f64]) -> f64 {
    let squares: Vec<f64> = real.iter().zip(model).map(|(r, m)| (r - m) * (r - m)).filter(|s| s.is_finite()).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

impl OverlayChannel {
    /// Samples that all three curves have.
    pub fn len(&self) -> usize {
        self.real.len().min(self.before.len()).min(self.after.len())
    }

    /// Whether there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Samples to draw: all of them, or about `limit` that keep every peak.
    pub fn kept(&self, limit: usize) -> Vec<usize> {
        let n = self.len();
        if n <= limit {
            return (0..n).collect();
        }
        let stretches = (limit / 3).max(1);
        let mut kept = vec![0, n - 1];
        for s in 0..stretches {
            let stretch = s * n / stretches..(s + 1) * n / stretches;
            let least =
                |key: &dyn Fn(usize) -> f64| stretch.clone().filter(|&i| key(i).is_finite()).min_by(|&i, &j| key(i).total_cmp(&key(j)));
            kept.extend(least(&|i| self.real[i]));
            kept.extend(least(&|i| -self.real[i]));
            kept.extend(least(&|i| -(self.real[i] - self.before[i]).abs()));
            // A gap has to stay one.
            kept.extend(stretch.clone().find(|&i| !self.real[i].is_finite()));
        }
        kept.sort_unstable();
        kept.dedup();
        kept
    }
}

fn recording(overlay: &Overlay, diagnosis: &Value, limit: usize) -> Value {
    let channels: Vec<Value> = overlay.channels.iter().map(|c| channel(c, noise(diagnosis, &overlay.recording, c.column), limit)).collect();
    json!({ "name": overlay.recording, "manoeuvre": overlay.manoeuvre, "dt": overlay.dt, "channels": channels })
}

fn channel(c: &OverlayChannel, noise: Option<f64>, limit: usize) -> Value {
    let kept = c.kept(limit);
    let q = quantum(c);
    let mut level = 0;
    let mut steps: Vec<Value> = Vec::with_capacity(kept.len());
    for &i in &kept {
        let now = (c.real[i] / q).round();
        steps.push(if now.is_finite() { json!(now as i64 - level) } else { Value::Null });
        level = if now.is_finite() { now as i64 } else { level };
    }
    let over = |model: &[f64]| -> Vec<Value> {
        let gap = |i: usize| ((c.real[i] - model[i]) / q).round();
        kept.iter().map(|&i| if gap(i).is_finite() { json!(gap(i) as i64) } else { Value::Null }).collect()
    };
    let index = (kept.len() < c.len()).then(|| {
        let mut last = 0;
        kept.iter().map(|&i| i - std::mem::replace(&mut last, i)).collect::<Vec<_>>()
    });
    let size = |model: &[f64]| Some(rms(&c.real, model)).filter(|r| r.is_finite());
    let sizes = [size(&c.before), size(&c.after)];
    json!({
        "label": super::text::channel(c.column), "unit": super::text::unit(c.unit), "q": q, "noise": noise, "samples": c.len(),
        "rms": sizes,
        "index": index, "real": steps, "before": over(&c.before), "after": over(&c.after),
    })
}

/// A power of ten, about one part in twenty thousand of the range.
fn quantum(c: &OverlayChannel) -> f64 {
    let (low, high) = super::chart::range(c.real.iter());
    let exponent = ((high - low) / 2e4).log10().ceil().clamp(-9.0, 9.0) as i32;
    // Through text, since 10^-3 as a product of floats is not the float nearest to 0.001.
    format!("1e{exponent}").parse().expect("a power of ten is a number")
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
        let c = channel_of(real);
        let kept = c.kept(3000);
        assert!(kept.contains(&123_457) && kept.len() <= 3100, "{} points", kept.len());
        assert_eq!((kept[0], *kept.last().unwrap()), (0, 599_999));
    }

    #[test]
    fn integers_give_the_curve_back() {
        let c = channel_of(vec![100.0, 100.123, f64::NAN, 250.5]);
        let stored = channel(&c, None, 100);
        assert_eq!(stored["q"], 0.01);
        assert_eq!(stored["real"], json!([10000, 12, null, 15038]));
        assert_eq!(stored["before"], json!([-100, -100, null, -100]));
    }
}
