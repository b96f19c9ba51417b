//! What a logger does not show: where a signal went between slow samples, and when a sample was taken whose stamp is off.

use super::clock::{Tick, misses};
use super::track::Track;
use std::ops::Range;

/// Observations to both sides over which the pace of a speed is taken.
pub const PACE_OBSERVATIONS: usize = 3;

/// From observation `k` to the next, s.
pub fn interval(track: &Track, k: usize) -> f64 {
    let begin = track.time[track.rows_of(k).start];
    let end = if k + 1 < track.observations() { track.time[track.rows_of(k + 1).start] } else { track.duration() };
    end - begin
}

/// Samples of a logger: its rows where observations average them, else the observations themselves.
fn samples(track: &Track) -> usize {
    if track.averages() { track.rows() } else { track.observations() }
}

/// Samples that observation `k` holds.
pub fn samples_of(track: &Track, k: usize) -> Range<usize> {
    if track.averages() { track.rows_of(k) } else { k..k + 1 }
}

/// Sample that holds a row.
pub fn sample_of(track: &Track, row: usize) -> usize {
    if track.averages() { row } else { track.observation_of(row) }
}

/// First row of a sample.
fn row_of(track: &Track, sample: usize) -> usize {
    if track.averages() { sample } else { track.rows_of(sample).start }
}

/// An input, sample by sample.
pub fn at_samples(track: &Track, input: impl Fn(&Tick) -> f64) -> Vec<f64> {
    (0..samples(track)).map(|sample| input(&track.ticks[track.tick_of_row[row_of(track, sample)]])).collect()
}

/// What a signal may have done between the samples of a slow logger, beyond the straight line from each to the next, observation by observation.
pub struct Unseen {
    /// Variance of its integral, which for a torque is an impulse.
    pub integral: Vec<f64>,
    /// Variance of its mean just before the samples, when the control unit's last step is still the one that holds.
    pub before: Vec<f64>,
}

/// The same from its samples, of which those of some observations count; nothing where a sample shows every step of the control unit.
///
/// A signal that goes any way between its samples is a Wiener process. With intervals T its variance s² per second shows in how far a sample lies off the
/// middle of its neighbours, δ² = s² T/2. The integral between two samples, given both, has the variance s² T³/12 = δ² T²/6. The
/// signal itself has s² T u (1 − u) = 2 δ² u (1 − u) at the share u of the way.
pub fn unseen(track: &Track, signal: &[f64], counts: impl Fn(usize) -> bool) -> Unseen {
    let observation = |sample: usize| track.observation_of(row_of(track, sample));
    let time = |sample: usize| track.time[row_of(track, sample)];
    let length = |sample: usize| if sample + 1 < samples(track) { time(sample + 1) } else { track.duration() } - time(sample);
    let off = |i: usize| {
        let known = i > 0 && i + 1 < signal.len() && (i - 1..=i + 1).all(|j| counts(observation(j)));
        if known { (signal[i] - 0.5 * (signal[i - 1] + signal[i + 1])).powi(2) } else { 0.0 }
    };
    // Mean of δ² at both ends of the interval after each sample.
    let bend = |i: usize| if misses(length(i), track.control_interval) { 0.5 * (off(i) + off(i + 1)) } else { 0.0 };
    let before = |i: usize| {
        let Some((j, bend)) = i.checked_sub(1).map(|j| (j, bend(j))).filter(|(_, bend)| *bend > 0.0) else { return 0.0 };
        let left = track.control_interval / length(j);
        2.0 * bend * left * (1.0 - left)
    };
    let of = |k: usize, variance: &dyn Fn(usize) -> f64| samples_of(track, k).map(variance).sum::<f64>();
    let all = 0..track.observations();
    Unseen {
        integral: all.clone().map(|k| of(k, &|i| bend(i) * length(i).powi(2) / 6.0)).collect(),
        before: all.map(|k| of(k, &before) / (samples_of(track, k).len() as f64).powi(2)).collect(),
    }
}

/// Slope of a channel around an observation per second, from the first and the last sample there that are known.
pub fn slope(samples: &[(f64, usize)], time: &impl Fn(usize) -> f64, k: usize) -> Option<f64> {
    let near = k.saturating_sub(PACE_OBSERVATIONS)..(k + PACE_OBSERVATIONS + 1).min(samples.len());
    let mut known = near.filter(|&j| samples[j].0.is_finite());
    let (a, b) = known.next().zip(known.next_back())?;
    Some((samples[b].0 - samples[a].0) / (time(b) - time(a)).max(1e-3))
}

/// Variance of a sample whose stamp is off by `stamps` s, one standard deviation.
pub fn of_stamps(track: &Track, stamps: f64, samples: &[(f64, usize)], k: usize) -> f64 {
    if stamps == 0.0 {
        return 0.0;
    }
    (stamps * slope(samples, &|k| track.time[track.rows_of(k).start], k).unwrap_or(0.0)).powi(2)
}
