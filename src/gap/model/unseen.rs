//! What a logger does not show: where a signal went between slow samples, and when a sample was taken whose stamp is off.

use super::clock::{CONTROL_INTERVAL_S, misses};
use super::track::Track;

/// Observations to both sides over which the pace of a speed is taken.
pub const PACE_OBSERVATIONS: usize = 3;

/// From observation `k` to the next, s.
pub fn interval(track: &Track, k: usize) -> f64 {
    let begin = track.time[track.rows_of(k).start];
    let end = if k + 1 < track.observations() { track.time[track.rows_of(k + 1).start] } else { track.duration() };
    end - begin
}

/// How a signal may have gone unseen after each observation, beyond the straight line to the next one: none where a sample shows every step of the control unit.
///
/// A signal that goes any way between its samples is a Wiener process. With intervals T its variance s² per second shows in how far a sample lies off the
/// middle of its neighbours, δ² = s² T/2, which this gives. The integral between two samples, given both, has the variance s² T³/12 = δ² T²/6: the impulse of a torque. The
/// signal itself has s² T u (1 − u) = 2 δ² u (1 − u) at the share u of the way.
pub fn bends(track: &Track, signal: &[f64], counts: impl Fn(usize) -> bool) -> Vec<f64> {
    let n = track.observations();
    let off = |k: usize| {
        let known = k > 0 && k + 1 < signal.len() && (k - 1..=k + 1).all(&counts);
        if known { (signal[k] - 0.5 * (signal[k - 1] + signal[k + 1])).powi(2) } else { 0.0 }
    };
    (0..n).map(|k| if misses(interval(track, k)) && !track.held { 0.5 * (off(k) + off(k + 1)) } else { 0.0 }).collect()
}

/// Variance of such a signal just before each sample, when the control unit's last step is still the one that holds.
pub fn before_samples(track: &Track, bends: &[f64]) -> Vec<f64> {
    let one = |k: usize| {
        let Some(before) = k.checked_sub(1).filter(|&j| bends[j] > 0.0) else { return 0.0 };
        let left = CONTROL_INTERVAL_S / interval(track, before);
        2.0 * bends[before] * left * (1.0 - left)
    };
    (0..bends.len()).map(one).collect()
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
