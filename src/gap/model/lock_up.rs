//! When the clutch is locked, according to the measured speeds: determined by the recording and independent of what is fitted.

use super::filter::Disturbances;
use super::tolerance::LATE_SIGMAS;
use super::track::{Channel, Track};
use super::unseen::{SLOPE_OBSERVATIONS, slope};
use crate::vehicle::Vehicle;

/// Number of observations on either side of a measured lock-up or opening for which an error of its timing is tolerated, and the size of that error, s.
const OBSERVATIONS: usize = 4;
const TIMING_S: f64 = 0.012;

/// Largest slip that counts as locked, in standard deviations of the noise of one sample: for one sample, and for the mean of three.
pub const LOCKED: f64 = 6.0;
/// See [`LOCKED`].
pub const LOCKED_MEAN: f64 = 3.0;
/// Shortest time for which two speeds have to agree to count as those of a locked clutch, s.
const TOGETHER_S: f64 = 0.3;

/// Whether the command at observation `k` is beyond the kiss point, so that the clutch may lock. Speeds that merely cross while the clutch is open are not locked.
pub fn closed(track: &Track, vehicle: &Vehicle, k: usize) -> bool {
    track.ticks[track.tick_of_row[track.rows_of(k).start]].x_to > vehicle.actuator.x_cnt_0
}

/// Slope of the mean of both speeds around an observation, rad/s², from the first and the last known sample within [`SLOPE_OBSERVATIONS`] on either side; zero if a speed has fewer
/// than two there.
fn acceleration(speeds: &[Vec<(f64, usize)>; 2], time: impl Fn(usize) -> f64, k: usize) -> f64 {
    slope(&speeds[0], &time, k).zip(slope(&speeds[1], &time, k)).map_or(0.0, |(f, c)| 0.5 * (f + c))
}

/// Latency of the flywheel's speed relative to the disc's, s, at most ± `most`. It is estimated by least squares over stretches of the recordings in which both speeds change
/// together and the brake is off, with a normal prior of standard deviation `most`/[`LATE_SIGMAS`]. Two sensors of unequal latency make a locked clutch appear to slip in
/// proportion to its acceleration.
pub fn skew(tracks: &[Track], with: &Disturbances, most: f64) -> f64 {
    if most <= 0.0 {
        return 0.0;
    }
    let sigma = slip_noise(with);
    let (mut products, mut squares) = (0.0, (LATE_SIGMAS * sigma / most).powi(2));
    for track in tracks {
        let n = track.observations();
        let speeds = [Channel::OmegaF, Channel::OmegaC].map(|c| (0..n).map(|k| track.mean(c, k)).collect::<Vec<_>>());
        let time = |k: usize| track.time[track.rows_of(k).start];
        let slip = |k: usize| speeds[0][k].0 - speeds[1][k].0;
        let accelerations: Vec<f64> = (0..n).map(|k| acceleration(&speeds, time, k)).collect();
        // A missing sample does not end a stretch.
        let together =
            |k: usize| !(slip(k).abs() > LOCKED * sigma + most * accelerations[k].abs()) && !track.rows_of(k).any(|row| track.brake[row]);
        let mut begin = 0;
        for k in 0..=n {
            if k < n && together(k) {
                continue;
            }
            if k > begin && time(k - 1) - time(begin) > TOGETHER_S {
                let inside = begin + SLOPE_OBSERVATIONS..k.saturating_sub(SLOPE_OBSERVATIONS).max(begin + SLOPE_OBSERVATIONS);
                let known = inside.filter(|&j| slip(j).is_finite());
                products -= known.clone().map(|j| slip(j) * accelerations[j]).sum::<f64>();
                squares += known.map(|j| accelerations[j].powi(2)).sum::<f64>();
            }
            begin = k + 1;
        }
    }
    (products / squares).clamp(-most, most)
}

/// Whether the clutch is locked according to the measured speeds, by observation. A lock can begin only while the clutch is closed, because speeds that merely cross are not
/// locked. It lasts until a sample, or the mean of three, shows more slip than unequal latencies of the sensors explain, because the time that a clutch takes to open is unknown.
/// Where the slip is unknown, the state stays as it was.
pub fn locked(
    speeds: &[Vec<(f64, usize)>; 2],
    with: &Disturbances,
    time: impl Fn(usize) -> f64,
    closed: impl Fn(usize) -> bool,
) -> Vec<bool> {
    let sigma = slip_noise(with);
    let slip: Vec<f64> =
        (0..speeds[0].len()).map(|k| speeds[0][k].0 - speeds[1][k].0 + with.skew * acceleration(speeds, &time, k)).collect();
    let mean = |k: usize| {
        let near = &slip[k.saturating_sub(1)..(k + 2).min(slip.len())];
        near.iter().sum::<f64>() / near.len() as f64
    };
    let slips = |k: usize| slip[k].abs() > LOCKED * sigma || mean(k).abs() > LOCKED_MEAN * sigma;
    let mut now = false;
    (0..slip.len())
        .map(|k| {
            if slip[k].is_finite() {
                now = !slips(k) && (now || closed(k));
            }
            now
        })
        .collect()
}

/// Standard deviation of the noise of the slip of one sample, rad/s.
pub fn slip_noise(with: &Disturbances) -> f64 {
    let spread = |c: usize| with.noise[c].white.hypot(with.noise[c].coloured);
    spread(0).hypot(spread(1))
}

/// Standard deviation of the slip around measured lock-ups and openings due to the error of their timing, rad/s, by observation: rate of change of the slip times `TIMING_S`.
pub fn lock_up_slip_sigma(track: &Track, speeds: &[Vec<(f64, usize)>; 2], locked: &[bool]) -> Vec<f64> {
    let slip = |k: usize| speeds[0][k].0 - speeds[1][k].0;
    let n = locked.len();
    let mut lock_up_slip_sigma: Vec<f64> = vec![0.0; n];
    for k in (1..n).filter(|&k| locked[k] != locked[k - 1]) {
        let (a, b) = if locked[k] { (k.saturating_sub(OBSERVATIONS + 1), k - 1) } else { (k, (k + OBSERVATIONS).min(n - 1)) };
        let time = |k: usize| track.time[track.rows_of(k).start];
        let slope = (slip(b) - slip(a)) / (time(b) - time(a)).max(1e-3);
        if slope.is_finite() {
            let reach = k.saturating_sub(OBSERVATIONS)..(k + OBSERVATIONS).min(n);
            lock_up_slip_sigma[reach].iter_mut().for_each(|b| *b = b.max(slope.abs() * TIMING_S));
        }
    }
    lock_up_slip_sigma
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Recording;
    use crate::gap::model::noise::Noise;
    use crate::gap::model::prepare::healthy;
    use crate::gap::model::tolerance::{self, Logger};

    /// Two samples, half a second apart.
    #[test]
    fn a_stretch_of_few_samples_says_nothing_of_lateness() {
        let count = SLOPE_OBSERVATIONS - 1;
        let speed: Vec<f64> = (0..count).map(|k| 10.0 * k as f64).collect();
        let track = Track::new(&Recording {
            sample_rate_hz: 2.0,
            time: (0..count).map(|k| 0.5 * k as f64).collect(),
            omega_f: speed.clone(),
            omega_c: speed,
            t_e: vec![0.0; count],
            x_to_cmd: vec![12.0; count],
            theta_h: vec![25.0; count],
            ..Recording::default()
        });
        let tolerances = tolerance::read(&serde_json::json!({}), Logger::UNIFORM).unwrap();
        let with = healthy([Noise { white: 0.1, coloured: 0.0, memory_s: 1.0 }; 5], 0.2, 0.0, &tolerances);
        assert_eq!(skew(&[track], &with, 0.01), 0.0);
    }
}
