//! Noise of the sensors, estimated from the recordings alone, before any model of the car is used.
//!
//! A speed is the integral of torques and therefore smooth on the scale of a few samples, so the residual of a sample from a cubic through its neighbours is noise. The median of
//! the residuals is insensitive to kinks and lock-ups. Coloured noise (first-order Gauss–Markov) looks like motion on that scale; it is estimated by its likelihood once there is
//! an explanation (`infer::sensors`).

use super::track::Track;
use nalgebra::{Matrix3, Vector3};

/// Noise of one channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Standard deviation of the white part of one sample.
    pub white: f64,
    /// Standard deviation of the coloured part.
    pub coloured: f64,
    /// Correlation time of the coloured part, s.
    pub memory_s: f64,
}

/// Smallest noise that is accepted, by channel. With less, numerical errors of the replay would be fitted.
const LEAST_NOISE: [f64; 5] = [0.01, 0.01, 0.001, 0.05, 0.05];

/// Noise of every channel, estimated from all recordings of a car together.
pub fn channels(tracks: &[Track]) -> [Noise; 5] {
    let stamps = stamps(tracks);
    std::array::from_fn(|c| {
        let parts = parts_of(tracks, c);
        let white = if stamps > 0.0 { residuals_of(&parts).white(stamps) } else { white(&parts) };
        let white = white.max(LEAST_NOISE[c]).max(0.29 * quantum(parts.iter().map(|p| p.1)));
        Noise { white, coloured: 0.0, memory_s: 1.0 }
    })
}

fn parts_of(tracks: &[Track], channel: usize) -> Vec<(&[f64], &[f64])> {
    tracks.iter().map(|t| (t.time.as_slice(), t.measured[channel].as_slice())).collect()
}

/// Standard deviation, in s, of uneven time stamps about the instants of their samples; 0 if the stamps are even.
///
/// A logger may sample at uneven times, or give uneven stamps to evenly taken samples. The residuals of a speed v with the slope a = v̇ from its neighbours tell these apart:
/// inexact stamps with the standard deviation s give them the variance σ² + a² s². The residuals of the eighth of the samples with the smallest slopes and of the quarter with the
/// greatest give s, by least squares over both speeds. The result is limited to the unevenness of the stamps.
pub fn stamps(tracks: &[Track]) -> f64 {
    if !tracks.iter().any(Track::jitters) {
        return 0.0;
    }
    let (mut products, mut squares) = (0.0, 0.0);
    for c in 0..2 {
        let all = residuals_of(&parts_of(tracks, c));
        let (steady, fast) = (all.steady(), all.fast());
        if steady.is_empty() || fast.is_empty() {
            continue;
        }
        let slope = mean_square_slope(fast) - mean_square_slope(steady);
        products += (spread(fast).powi(2) - spread(steady).powi(2)) * slope;
        squares += slope * slope;
    }
    let found = if squares > 0.0 { (products / squares).max(0.0).sqrt() } else { 0.0 };
    found.min(tracks.iter().map(Track::unevenness).fold(0.0, f64::max))
}

/// White noise of the torque report, N·m.
pub fn of_report(tracks: &[Track]) -> f64 {
    let parts: Vec<(&[f64], &[f64])> = tracks.iter().map(|t| (t.report_time.as_slice(), t.reported.as_slice())).collect();
    white(&parts)
}

/// Quantisation step of the torque report, N·m; 0 if there is none.
pub fn report_quantum(tracks: &[Track]) -> f64 {
    quantum(tracks.iter().map(|t| t.reported.as_slice()))
}

/// Half-widths, in samples, of the windows over which a report is smoothed, and the greatest half-width in s: over more than 0.3 s, changes of the engine torque are real and not
/// noise.
const WINDOWS: [usize; 5] = [2, 3, 5, 8, 13];
const LONGEST_S: f64 = 0.15;

/// Removes white noise of this standard deviation (at least that of quantisation) from a signal. Each sample takes the value of a least-squares parabola over the widest window
/// around it that still agrees, within one standard deviation, with those over all narrower windows (Lepski's rule, as the intersection of confidence intervals by Goldenshluger
/// and Nemirovski, 1997), so that steps are preserved.
///
/// A noisy report on the input of a replay seems to move the car less than it should: errors in a regressor look like more inertia, or like a lag.
pub fn without_noise(time: &[f64], value: &[f64], noise: f64, quantum: f64) -> Vec<f64> {
    let n = value.len();
    let sigma = noise.max(0.29 * quantum);
    // Value at the sample of the least-squares parabola over a window, and its standard deviation. A straight line would round off every bend, always to the same side.
    let local = |k: usize, half: usize| -> (f64, f64) {
        let reach = time[k + half] - time[k - half];
        let powers = |j: usize| {
            let u = (time[j] - time[k]) / reach;
            Vector3::new(1.0, u, u * u)
        };
        let rows = || k - half..k + half + 1;
        let moments: Matrix3<f64> = rows().map(|j| powers(j) * powers(j).transpose()).sum();
        let Some(inverse) = moments.try_inverse() else { return (value[k], sigma) };
        let at: f64 = rows().map(|j| (inverse * powers(j))[0] * value[j]).sum();
        (at, sigma * inverse[(0, 0)].max(0.0).sqrt())
    };
    (0..n)
        .map(|k| {
            let (mut low, mut high, mut best) = (value[k] - sigma, value[k] + sigma, value[k]);
            for half in WINDOWS {
                if half > k || k + half >= n || time[k + half] - time[k] > LONGEST_S {
                    break;
                }
                let (there, width) = local(k, half);
                (low, high) = (low.max(there - width), high.min(there + width));
                if low > high {
                    break;
                }
                best = there;
            }
            best
        })
        .collect()
}

/// Quantisation step of a channel: the smallest difference between successive samples that many of them have in common; 0 if there is none.
fn quantum<'a>(columns: impl Iterator<Item = &'a [f64]>) -> f64 {
    let mut steps: Vec<f64> =
        columns.flat_map(|v| v.windows(2)).map(|w| (w[1] - w[0]).abs()).filter(|d| d.is_finite() && *d > 1e-9).collect();
    if steps.len() < 50 {
        return 0.0;
    }
    steps.sort_by(f64::total_cmp);
    // Rounding of printed digits scatters the differences around the true step, so the quantiles at 0.5 % and 10 % only have to agree within 30 %.
    let (least, tenth) = (steps[steps.len() / 200], steps[steps.len() / 10]);
    if tenth < 1.3 * least { tenth } else { 0.0 }
}

/// Absolute residual of a sample from the cubic through its two neighbours on either side, scaled so that white noise keeps its standard deviation, and the absolute slope of the
/// signal there.
#[derive(Clone, Copy)]
struct Residual {
    size: f64,
    slope: f64,
}

/// Residuals in ascending order of the slope.
struct ByPace(Vec<Residual>);

impl ByPace {
    /// The eighth with the smallest slopes.
    fn steady(&self) -> &[Residual] {
        &self.0[..self.0.len() / 8]
    }

    /// The quarter with the greatest slopes.
    fn fast(&self) -> &[Residual] {
        &self.0[self.0.len() - self.0.len() / 4..]
    }

    /// Standard deviation of the noise that remains once an error of the time stamps with the standard deviation `stamps`, s, is accounted for.
    fn white(&self, stamps: f64) -> f64 {
        let steady = self.steady();
        (spread(steady).powi(2) - stamps.powi(2) * mean_square_slope(steady)).max(0.0).sqrt()
    }
}

fn mean_square_slope(of: &[Residual]) -> f64 {
    of.iter().map(|l| l.slope * l.slope).sum::<f64>() / of.len().max(1) as f64
}

fn residuals_of(parts: &[(&[f64], &[f64])]) -> ByPace {
    let mut left: Vec<Residual> = Vec::new();
    for (time, value) in parts {
        let known: Vec<usize> = (0..value.len()).filter(|&k| value[k].is_finite()).collect();
        for w in known.windows(5) {
            let (t, v) = (|k: usize| time[w[k]], |k: usize| value[w[k]]);
            let weight = |k: usize| [0, 1, 3, 4].iter().filter(|&&j| j != k).map(|&j| (t(2) - t(j)) / (t(k) - t(j))).product::<f64>();
            let weights = [0, 1, 3, 4].map(weight);
            let between: f64 = [0, 1, 3, 4].iter().zip(weights).map(|(&k, w)| w * v(k)).sum();
            let size = (v(2) - between).abs() / (1.0 + weights.iter().map(|w| w * w).sum::<f64>()).sqrt();
            left.push(Residual { size, slope: ((v(4) - v(0)) / (t(4) - t(0))).abs() });
        }
    }
    left.sort_by(|a, b| a.slope.total_cmp(&b.slope));
    ByPace(left)
}

/// Standard deviation of white noise on a smooth signal, from the median of the residuals from cubics through each sample's neighbours.
fn white(parts: &[(&[f64], &[f64])]) -> f64 {
    spread(&residuals_of(parts).0)
}

fn spread(of: &[Residual]) -> f64 {
    if of.is_empty() {
        return 0.0;
    }
    let mut left: Vec<f64> = of.iter().map(|l| l.size).collect();
    left.sort_by(f64::total_cmp);
    // 0.6745 is the median of a half-normal variable. Quantised signals often stand still, which makes the median too small, so the mean of the lower nine tenths is used where it
    // gives more.
    let median = left[left.len() / 2] / 0.6745;
    let kept = &left[..left.len() - left.len() / 10];
    median.max(kept.iter().sum::<f64>() / kept.len() as f64 / 0.6667)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A smooth signal with white noise of known size, from a fixed congruential generator.
    fn signal(white: f64, interval: f64) -> (Vec<f64>, Vec<f64>) {
        let mut seed = 1_u64;
        let mut normal = move || {
            let sum: f64 = (0..12)
                .map(|_| {
                    seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                    (seed >> 11) as f64 / (1_u64 << 53) as f64
                })
                .sum();
            sum - 6.0
        };
        (0..6000)
            .map(|k| {
                let t = k as f64 * interval;
                (t, 100.0 + 40.0 * (0.7 * t).sin() + white * normal())
            })
            .unzip()
    }

    #[test]
    fn white_noise_is_found_at_every_rate() {
        for interval in [0.001, 0.01, 0.02] {
            let (t, v) = signal(0.2, interval);
            let found = white(&[(&t, &v)]);
            assert!((found / 0.2 - 1.0).abs() < 0.1, "{interval}: {found}");
        }
    }

    /// A speed that goes up and down, with uneven stamps on evenly taken samples, or sampled at uneven times.
    #[test]
    fn stamps_that_are_off_are_told_from_uneven_samples() {
        use crate::campaign::Recording;
        let (time, noise) = signal(0.05, 1e-9);
        let uneven: Vec<f64> = signal(0.002, 1e-9).1.iter().zip(&noise).rev().map(|(v, _)| v - 100.0).collect();
        let speed = |t: f64| 100.0 + 60.0 * (2.0 * t).sin();
        let found = |written: bool| {
            let at: Vec<f64> =
                (0..time.len()).map(|k| 0.01 * k as f64 + if k == 0 { 0.0 } else { uneven[k].clamp(-0.0045, 0.0045) }).collect();
            let omega_f = (0..time.len()).map(|k| speed(if written { 0.01 * k as f64 } else { at[k] }) + noise[k] - 100.0).collect();
            let n = time.len();
            let r = Recording {
                sample_rate_hz: 100.0,
                time: at,
                omega_f,
                omega_c: vec![0.0; n],
                t_e: vec![0.0; n],
                x_to_cmd: vec![3.0; n],
                theta_h: vec![25.0; n],
                ..Recording::default()
            };
            let tracks = [Track::new(&r)];
            (stamps(&tracks), channels(&tracks)[0].white)
        };
        let (off, white) = found(true);
        assert!((off / 0.002 - 1.0).abs() < 0.15 && (white / 0.05 - 1.0).abs() < 0.3, "{off} s, {white} rad/s");
        let (off, white) = found(false);
        assert!(off < 3e-4 && (white / 0.05 - 1.0).abs() < 0.15, "{off} s, {white} rad/s");
    }

    #[test]
    fn the_step_of_a_report_is_found() {
        let (_, v) = signal(0.3, 0.01);
        let stepped: Vec<f64> = v.iter().map(|x| (x / 0.5).round() * 0.5).collect();
        assert_eq!(quantum([stepped.as_slice()].into_iter()), 0.5);
        assert_eq!(quantum([v.as_slice()].into_iter()), 0.0);
    }

    #[test]
    fn a_step_stays_a_step_and_what_stands_still_is_averaged() {
        let time: Vec<f64> = (0..400).map(|k| 0.01 * k as f64).collect();
        let (_, wave) = signal(0.0, 0.01);
        let (_, noisy) = signal(0.2, 0.01);
        let noise: Vec<f64> = noisy.iter().zip(&wave).map(|(a, b)| a - b).collect();
        let truth: Vec<f64> = (0..400).map(|k| if k < 200 { 5.0 } else { 45.0 }).collect();
        let reported: Vec<f64> = truth.iter().zip(&noise).map(|(t, n)| t + n).collect();
        let found = without_noise(&time, &reported, 0.2, 0.0);
        let worst_near = (198..202).map(|k| (found[k] - truth[k]).abs()).fold(0.0, f64::max);
        assert!(worst_near < 1.0, "{worst_near}");
        let rms = |v: &[f64]| (20..180).map(|k| (v[k] - truth[k]).powi(2)).sum::<f64>().sqrt();
        assert!(rms(&found) < 0.6 * rms(&reported), "{} {}", rms(&found), rms(&reported));
    }

    /// The torque of an engine that is loaded within a quarter of a second curves upwards first. If smoothing rounded off this bend, the engine would seem to give torque that it
    /// does not give.
    #[test]
    fn a_bend_is_not_rounded_off() {
        let time: Vec<f64> = (0..60).map(|k| 0.01 * k as f64).collect();
        let truth: Vec<f64> = time.iter().map(|t| ((t - 0.15) / 0.25).clamp(0.0, 1.0)).map(|z| 60.0 * z * z * (3.0 - 2.0 * z)).collect();
        let (_, noisy) = signal(0.3, 1e-4);
        let noise: Vec<f64> = noisy.iter().zip(signal(0.0, 1e-4).1).map(|(a, b)| a - b).collect();
        let foot = 14..22;
        let off: Vec<f64> = noise
            .chunks_exact(60)
            .map(|n| {
                let reported: Vec<f64> = truth.iter().zip(n).map(|(t, n)| t + n).collect();
                let found = without_noise(&time, &reported, 0.3, 0.0);
                foot.clone().map(|k| found[k] - truth[k]).sum::<f64>() / foot.len() as f64
            })
            .collect();
        let mean = off.iter().sum::<f64>() / off.len() as f64;
        assert!(mean.abs() < 0.1, "{mean} N·m, from {} rises", off.len());
    }

    #[test]
    fn steps_of_rounding_are_smoothed() {
        let time: Vec<f64> = (0..400).map(|k| 0.01 * k as f64).collect();
        let truth: Vec<f64> = time.iter().map(|t| 20.0 + 3.0 * t).collect();
        let rounded: Vec<f64> = truth.iter().map(|x| x.round()).collect();
        let found = without_noise(&time, &rounded, 0.289, 1.0);
        let rms = |v: &[f64]| (20..380).map(|k| (v[k] - truth[k]).powi(2)).sum::<f64>().sqrt();
        assert!(rms(&found) < 0.9 * rms(&rounded), "{} {}", rms(&found), rms(&rounded));
    }

    /// Each channel has its own noise, which is never smaller than the least accepted one or that of quantisation.
    #[test]
    fn each_channel_has_the_noise_that_it_shows() {
        use crate::campaign::Recording;
        let (time, flywheel) = signal(0.2, 0.01);
        let (disc, torque) = (signal(0.0, 0.01).1, signal(3.0, 0.01).1);
        let stepped: Vec<f64> = disc.iter().map(|x| (x / 0.5).round() * 0.5).collect();
        let n = time.len();
        let r = Recording {
            sample_rate_hz: 100.0,
            time,
            omega_f: flywheel,
            omega_c: disc.clone(),
            t_e: torque,
            x_to_cmd: vec![3.0; n],
            theta_h: vec![25.0; n],
            x_to: Some(stepped),
            ..Recording::default()
        };
        let tracks = [Track::new(&r)];
        let found = channels(&tracks);
        assert!((found[0].white / 0.2 - 1.0).abs() < 0.1 && found[1].white == 0.01, "{found:?}");
        assert!((0.145..0.3).contains(&found[2].white) && found.iter().all(|n| n.coloured == 0.0), "{found:?}");
        assert!((of_report(&tracks) / 3.0 - 1.0).abs() < 0.1, "{}", of_report(&tracks));
    }
}
