//! Variances due to what a logger does not show: the course of a signal between slow samples, the time of a step between uneven samples, and the instant of a sample whose time
//! stamp is inexact.

use super::clock::{Tick, misses};
use super::track::Track;
use std::ops::Range;

/// Number of observations on either side over which the slope of a channel is taken.
pub const SLOPE_OBSERVATIONS: usize = 3;

/// Interval from observation `k` to the next, s.
pub fn interval(track: &Track, k: usize) -> f64 {
    let begin = track.time[track.rows_of(k).start];
    let end = if k + 1 < track.observations() { track.time[track.rows_of(k + 1).start] } else { track.duration() };
    end - begin
}

/// Number of samples of a logger: its rows where observations average them, otherwise its observations.
fn samples(track: &Track) -> usize {
    if track.averages() { track.rows() } else { track.observations() }
}

/// Indices of the samples in observation `k`.
pub fn samples_of(track: &Track, k: usize) -> Range<usize> {
    if track.averages() { track.rows_of(k) } else { k..k + 1 }
}

/// Index of the sample to which a row belongs.
pub fn sample_of(track: &Track, row: usize) -> usize {
    if track.averages() { row } else { track.observation_of(row) }
}

/// First row of a sample.
fn row_of(track: &Track, sample: usize) -> usize {
    if track.averages() { sample } else { track.rows_of(sample).start }
}

/// Values of an input, sample by sample.
pub fn at_samples(track: &Track, input: impl Fn(&Tick) -> f64) -> Vec<f64> {
    (0..samples(track)).map(|sample| input(&track.ticks[track.tick_of_row[row_of(track, sample)]])).collect()
}

/// Variances of a signal about its mean course between the samples of a slow or uneven logger, by observation.
pub struct Unseen {
    /// Variance of its integral over the observation; for a torque, this is the variance of an impulse.
    pub integral: Vec<f64>,
    /// Variance of its value just before the samples of the observation (of their mean), where the last step of the control unit before the sample still holds.
    pub before: Vec<f64>,
}

/// Computes these variances from the samples of a signal. Only samples in observations for which `counts` holds are used. The variances are zero where the samples show every step
/// of the control unit as it happens.
///
/// A logger as fast as the control unit whose samples or stamps are uneven sees every step Δ, but not when it happened within the last w of an interval. The integral then has the
/// variance Δ² w²/12. Just before a sample at the end of an interval T, the step has either happened or not, which has the variance Δ²/4 · w/T.
///
/// For a slower logger, the signal between its samples is modelled as a Wiener process with the variance s² per second. With intervals T, s² is estimated from the deviation δ of a
/// sample from the mean of its neighbours, δ² = s² T/2. The integral between two samples, given both, has the variance s² T³/12 = δ² T²/6. The signal itself has the variance s² T
/// u (1 − u) = 2 δ² u (1 − u) at the fraction u of the interval.
pub fn unseen(track: &Track, signal: &[f64], counts: impl Fn(usize) -> bool) -> Unseen {
    let observation = |sample: usize| track.observation_of(row_of(track, sample));
    let time = |sample: usize| track.time[row_of(track, sample)];
    let length = |sample: usize| if sample + 1 < samples(track) { time(sample + 1) } else { track.duration() } - time(sample);
    let off = |i: usize| {
        let known = i > 0 && i + 1 < signal.len() && (i - 1..=i + 1).all(|j| counts(observation(j)));
        if known { (signal[i] - 0.5 * (signal[i - 1] + signal[i + 1])).powi(2) } else { 0.0 }
    };
    // Mean of δ² over both ends of the interval after sample `i`.
    let bend = |i: usize| 0.5 * (off(i) + off(i + 1));
    let missing = |i: usize| misses(length(i), track.control_interval);
    let uneven = track.unevenness_of_steps();
    // Square of the step to the next sample.
    let step = |i: usize| {
        let known = i + 1 < signal.len() && counts(observation(i)) && counts(observation(i + 1));
        if known { (signal[i + 1] - signal[i]).powi(2) } else { 0.0 }
    };
    let integral = |i: usize| {
        if missing(i) { bend(i) * length(i).powi(2) / 6.0 } else { step(i) * (uneven * length(i)).powi(2) / 12.0 }
    };
    let before = |i: usize| {
        let Some(j) = i.checked_sub(1) else { return 0.0 };
        if missing(j) {
            let left = track.control_interval / length(j);
            2.0 * bend(j) * left * (1.0 - left)
        } else {
            0.25 * uneven * step(j)
        }
    };
    let of = |k: usize, variance: &dyn Fn(usize) -> f64| samples_of(track, k).map(variance).sum::<f64>();
    let all = 0..track.observations();
    Unseen {
        integral: all.clone().map(|k| of(k, &integral)).collect(),
        before: all.map(|k| of(k, &before) / (samples_of(track, k).len() as f64).powi(2)).collect(),
    }
}

/// Slope of a channel around observation `k`, per second, from the first and the last known sample within [`SLOPE_OBSERVATIONS`] on either side.
pub fn slope(samples: &[(f64, usize)], time: &impl Fn(usize) -> f64, k: usize) -> Option<f64> {
    let near = k.saturating_sub(SLOPE_OBSERVATIONS)..(k + SLOPE_OBSERVATIONS + 1).min(samples.len());
    let mut known = near.filter(|&j| samples[j].0.is_finite());
    let (a, b) = known.next().zip(known.next_back())?;
    Some((samples[b].0 - samples[a].0) / (time(b) - time(a)).max(1e-3))
}

/// Change of a channel within `stamps` s around observation `k`: its error if the time stamp is off by that much.
pub fn of_stamps(track: &Track, stamps: f64, samples: &[(f64, usize)], k: usize) -> f64 {
    if stamps == 0.0 {
        return 0.0;
    }
    stamps * slope(samples, &|k| track.time[track.rows_of(k).start], k).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Recording;

    /// A step at a uniformly distributed time between two samples, compared with its mean course.
    #[test]
    fn steps_between_uneven_samples_have_the_variance_of_their_instants() {
        let off = |k: i32| 0.0045 * f64::from(k * 37 % 101 - 50) / 50.0;
        let time: Vec<f64> = (0..2000).map(|k| 0.01 * f64::from(k) + off(k)).collect();
        let signal: Vec<f64> = (0..2000).map(|k| f64::from(k * 53 % 89)).collect();
        let track = Track::new(&Recording { time, ..logged(&signal) });
        let share = track.unevenness_of_steps();
        assert!((share - 0.9).abs() < 0.05, "{share}: nine of ten milliseconds");
        let found = unseen(&track, &signal, |_| true);
        let (mut integral, mut before) = ((0.0, 0.0), (0.0, 0.0));
        for k in (0..1998).filter(|k| !misses(interval(&track, *k), track.control_interval)) {
            let (length, step) = (interval(&track, k), signal[k + 1] - signal[k]);
            // The instant of the step runs through that share of the interval in equal increments.
            let mut off = (0..200).map(|i| (f64::from(i) + 0.5) / 200.0 - 0.5);
            integral.0 += off.by_ref().map(|u| (u * share * length * step).powi(2)).sum::<f64>() / 200.0;
            integral.1 += found.integral[k];
            // In that share of the cases, the step has or has not happened just before the sample, with equal probability.
            before.0 += share * (0.5 * step).powi(2);
            before.1 += found.before[k + 1];
        }
        assert!((integral.1 / integral.0 - 1.0).abs() < 1e-3, "{integral:?}");
        assert!((before.1 / before.0 - 1.0).abs() < 1e-3, "{before:?}");
        let even = Track::new(&Recording { time: (0..2000).map(|k| 0.01 * f64::from(k)).collect(), ..logged(&signal) });
        let nothing = unseen(&even, &signal, |_| true);
        assert!(nothing.integral.iter().chain(&nothing.before).all(|v| *v == 0.0), "a sample in step shows every step");
    }

    fn logged(signal: &[f64]) -> Recording {
        let zeros = vec![0.0; signal.len()];
        Recording {
            sample_rate_hz: 100.0,
            omega_f: zeros.clone(),
            omega_c: zeros.clone(),
            t_e: signal.to_vec(),
            theta_h: zeros,
            ..Recording::default()
        }
    }
}
