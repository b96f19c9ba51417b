//! Recordings without a commanded position: nothing says what the clutch should transmit, so its torque is an unknown input.
//!
//! While the clutch slips or is open, its torque is what the flywheel's balance leaves (8a), T = T_e − b_f ω_f − J_f ω̇_f, and a replay passes it on to the disc: the replayed
//! flywheel follows the measured speed, and the disc's balance with that torque, that is the sum of both balances, is compared. The clutch torque cancels in this sum, whatever it
//! was. While the clutch is locked, both sides turn as one, and the whole driveline is compared as usual. Which of the two holds is read from the measured speeds alone, before any
//! model is used:
//!
//! - The speeds of a locked clutch agree up to the gain g and the lag τ of the disc's sensor relative to the flywheel's, ω_c(t + τ) = g ω_f(t). All recordings share these, and
//!   they are estimated first.
//! - The clutch counts as locked where the deviation from this relation is noise, for single observations and for means over several ([`MEANS`]), for at least [`LEAST_S`], less
//!   [`MARGIN_S`] at either end.
//!
//! A lock mistaken for slip costs only the information that both speeds are equal. Slip mistaken for a lock would look like a sensor error: hence the margins.

use super::noise::{self, Noise};
use super::tolerance::{Car, Signal};
use super::track::{Channel, Track};
use crate::effects::{PARAMETERS, REGISTRY, Subsystem, param};
use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

/// Subsystems that do not show without a position: all those that determine the clutch torque.
pub const HIDDEN: [Subsystem; 4] = [Subsystem::Actuator, Subsystem::ClutchForce, Subsystem::Friction, Subsystem::Thermal];

/// Numbers of observations over which slip is averaged, and the largest mean slip of a locked clutch, in standard deviations of the noise of that mean.
const MEANS: [(usize, f64); 4] = [(1, 6.0), (3, 4.0), (9, 4.0), (25, 4.0)];

/// Shortest lock, s, and the margin removed at either end of it, s: the last of a soft lock-up, the first of an opening.
const LEAST_S: f64 = 0.2;
const MARGIN_S: f64 = 0.05;

/// Range and step of the gains (around 1) and lags (s) of the disc's sensor that are tried.
const GAINS: (f64, f64) = (0.06, 0.004);
const LAGS_S: (f64, f64) = (0.1, 0.02);

/// Difference in rad/s that the steps of these may leave between the speeds of a locked clutch.
const COARSE: f64 = 0.5;

/// Speed in rad/s below which a gain hardly shows.
const MOVING_SPEED: f64 = 10.0;

/// How much longer both speeds must agree with a gain and lag for these to be pursued instead of 1 and 0: a factor on the time, and further seconds.
const REQUIRED_GAIN: (f64, f64) = (1.1, 0.5);

/// Prior standard deviations of gain and lag (s), since a drive at constant speed says nothing about a lag.
const PRIOR: [f64; 2] = [0.02, 0.02];

/// Number of observations on either side over which the slope of a speed is taken.
const SLOPE: usize = 3;

/// Replacement for the clutch model.
#[derive(Clone, Debug)]
pub struct UnknownClutch {
    /// Whether it is locked from each observation to the next.
    pub locked: Vec<bool>,
    /// Stamps of the observations that have a flywheel speed, s.
    time: Vec<f64>,
    /// Flywheel speed at these stamps with its noise removed, rad/s.
    omega_f: Vec<f64>,
}

impl UnknownClutch {
    /// Flywheel speed as sensed at `time` s, rad/s, with its noise removed: interpolated linearly between observations and extrapolated beyond the last.
    pub fn omega_f(&self, time: f64) -> f64 {
        let n = self.time.len();
        if n < 2 {
            // A part of a log may contain one sample or none.
            return self.omega_f.first().copied().unwrap_or(0.0);
        }
        let k = self.time.partition_point(|t| *t <= time).clamp(1, n - 1);
        let (a, b) = if time > self.time[n - 1] { (n - 1 - SLOPE.min(n - 1), n - 1) } else { (k - 1, k) };
        let share = (time.max(self.time[0]) - self.time[a]) / (self.time[b] - self.time[a]);
        self.omega_f[a] + share * (self.omega_f[b] - self.omega_f[a])
    }
}

/// Latency of the flywheel's speed in a car, s: that of the signal, and dead time and smoothing of the sensor.
pub fn age_of_flywheel(car: &Car) -> f64 {
    use param::engine_speed_delay::{delay, smoothing};
    car.late[Signal::OmegaF as usize] + car.effects[delay] + car.effects[smoothing]
}

/// The same car without the effects and the command's latency, which would show only in its clutch torque.
pub fn without_hidden_effects(car: &Car) -> Car {
    let mut seen = *car;
    for entry in REGISTRY.iter().filter(|e| HIDDEN.contains(&e.effect.subsystem)) {
        entry.parameters.clone().for_each(|k| seen.effects[k] = PARAMETERS[k].null);
    }
    seen.late[Signal::Command as usize] = 0.0;
    seen
}

/// Whether two cars cannot be told apart by a recording without a position.
pub fn look_alike(a: &Car, b: &Car) -> bool {
    let (a, b) = (without_hidden_effects(a), without_hidden_effects(b));
    a.effects == b.effects && a.late == b.late && a.vehicle.driveline == b.vehicle.driveline
}

/// The hidden subsystems, in words.
pub fn hidden() -> &'static str {
    "actuator, clutch force, friction and thermal parts"
}

/// Whether a subsystem does not show in any of these recordings.
pub fn hides(tracks: &[Track], place: Subsystem) -> bool {
    HIDDEN.contains(&place) && tracks.iter().all(|t| t.position_free)
}

/// Determines the replacement for the clutch model in the recordings that have no position. They all have the same sensors, with this noise.
pub fn find(tracks: &mut [Track], noise: &[Noise; 5]) {
    let free: Vec<usize> = (0..tracks.len()).filter(|&k| tracks[k].position_free).collect();
    let speeds: Vec<Speeds> = free.iter().map(|&k| Speeds::of(&tracks[k], noise)).collect();
    let sensors = Sensors::of(&speeds);
    for (k, speeds) in free.into_iter().zip(speeds) {
        let locked = speeds.locked(sensors);
        let known: Vec<usize> = (0..speeds.time.len()).filter(|&k| speeds.value[0][k].is_finite()).collect();
        let pick = |v: &[f64]| known.iter().map(|&k| v[k]).collect::<Vec<f64>>();
        let (time, raw) = (pick(&speeds.time), pick(&speeds.value[0]));
        let omega_f = noise::without_noise(&time, &raw, speeds.noise[0], 0.0);
        tracks[k].unknown_clutch = Some(UnknownClutch { locked, time, omega_f });
    }
}

/// Both speeds of a recording by observation, NaN where there is none, and the noise of one observation, rad/s.
struct Speeds {
    time: Vec<f64>,
    value: [Vec<f64>; 2],
    noise: [f64; 2],
}

/// Gain and lag in s of the disc's sensor relative to the flywheel's.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sensors {
    gain: f64,
    lag: f64,
}

/// Sensors without a relative gain or lag.
const ALIKE: Sensors = Sensors { gain: 1.0, lag: 0.0 };

impl Speeds {
    fn of(track: &Track, noise: &[Noise; 5]) -> Self {
        let n = track.observations();
        let stamp = |k: usize| track.rows_of(k).map(|row| track.time[row]).sum::<f64>() / track.rows_of(k).len() as f64;
        let mean = |c: Channel| (0..n).map(|k| track.mean(c, k).0).collect();
        let root = (track.samples_per_observation(Channel::OmegaF) as f64).sqrt();
        Self {
            time: (0..n).map(stamp).collect(),
            value: [mean(Channel::OmegaF), mean(Channel::OmegaC)],
            noise: [noise[0], noise[1]].map(|n| (n.white / root).hypot(n.coloured)),
        }
    }

    fn observation_interval(&self) -> f64 {
        let n = self.time.len();
        (self.time[n - 1] - self.time[0]) / (n.max(2) - 1) as f64
    }

    /// Slip by observation, rad/s, corrected for gain and lag of the sensors; NaN where it is unknown.
    fn slip(&self, sensors: Sensors) -> Vec<f64> {
        let [omega_f, omega_c] = &self.value;
        let mut at = 0;
        let of = |(k, f): (usize, &f64)| {
            let then = self.time[k] + sensors.lag;
            while at + 2 < self.time.len() && self.time[at + 1] <= then {
                at += 1;
            }
            let (a, b) = (at, (at + 1).min(self.time.len() - 1));
            let share = if b > a { (then - self.time[a]) / (self.time[b] - self.time[a]) } else { 0.0 };
            // No extrapolation before the first sample or after the last one.
            let near = (-1e-6..=1.0 + 1e-6).contains(&share);
            let c = if share == 0.0 { omega_c[a] } else { omega_c[a] + share * (omega_c[b] - omega_c[a]) };
            if near { f - c / sensors.gain } else { f64::NAN }
        };
        omega_f.iter().enumerate().map(of).collect()
    }

    /// Whether the corrected slip is no more than noise plus `coarse` rad/s, by observation.
    fn together(&self, sensors: Sensors, coarse: f64) -> Vec<bool> {
        let slip = self.slip(sensors);
        let noise = self.noise[0].hypot(self.noise[1] / sensors.gain);
        let (mut sums, mut counts) = (vec![0.0], vec![0]);
        for s in &slip {
            let known = s.is_finite();
            sums.push(sums[sums.len() - 1] + if known { *s } else { 0.0 });
            counts.push(counts[counts.len() - 1] + usize::from(known));
        }
        let n = slip.len();
        let small = |k: usize, (window, most): (usize, f64)| {
            let (a, b) = (k.saturating_sub(window / 2), (k + window / 2 + 1).min(n));
            let count = counts[b] - counts[a];
            count > 0 && (sums[b] - sums[a]).abs() / (count as f64) < coarse + most * noise / (count as f64).sqrt()
        };
        (0..n).map(|k| MEANS.iter().all(|m| small(k, *m))).collect()
    }

    /// Whether the clutch is locked from each observation to the next.
    fn locked(&self, sensors: Sensors) -> Vec<bool> {
        let together = self.together(sensors, 0.0);
        let interval = self.observation_interval();
        let (least, margin) = ((LEAST_S / interval).ceil() as usize, ((MARGIN_S + sensors.lag.abs()) / interval).ceil() as usize);
        let mut locked = vec![false; together.len()];
        for run in runs(&together).filter(|r| r.len() >= least.max(2 * margin + 2)) {
            // Each entry covers the interval to the next observation, so the last observation of a run has none.
            locked[run.start + margin..run.end - margin - 1].fill(true);
        }
        locked
    }
}

/// Ranges of consecutive `true`.
fn runs(of: &[bool]) -> impl Iterator<Item = std::ops::Range<usize>> {
    let mut at = 0;
    std::iter::from_fn(move || {
        let start = at + of[at..].iter().position(|x| *x)?;
        at = start + of[start..].iter().position(|x| !*x).unwrap_or(of.len() - start);
        Some(start..at)
    })
}

impl Sensors {
    /// Estimates gain and lag from the recordings. The least-squares refinement starts from sensors that agree, unless the speeds stay together for clearly longer with others
    /// (`REQUIRED_GAIN`).
    fn of(all: &[Speeds]) -> Self {
        let time = |sensors: Sensors| -> f64 {
            let one = |s: &Speeds| {
                let together = s.together(sensors, COARSE);
                let moves = |r: &std::ops::Range<usize>| r.clone().filter(|&k| s.value[1][k] > MOVING_SPEED).count();
                let interval = s.observation_interval();
                runs(&together).map(|r| moves(&r) as f64 * interval).filter(|t| *t > LEAST_S).sum::<f64>()
            };
            // Summed in order, so that the result does not depend on the threads.
            all.par_iter().map(one).collect::<Vec<f64>>().iter().sum()
        };
        let steps = |(most, step): (f64, f64)| {
            let count = (most / step).round() as i32;
            (-count..=count).map(move |k| f64::from(k) * step)
        };
        let alike = time(ALIKE);
        let others = steps(GAINS).flat_map(|g| steps(LAGS_S).map(move |lag| Sensors { gain: 1.0 + g, lag }));
        let (longest, best) = others.map(|s| (time(s), s)).fold((0.0, ALIKE), |a, b| if b.0 > a.0 { b } else { a });
        let from = if longest > REQUIRED_GAIN.0 * alike + REQUIRED_GAIN.1 { best } else { ALIKE };
        from.refined(all, COARSE).refined(all, 0.0)
    }

    /// Gain g and lag τ by least squares over the stretches in which the speeds agree with the present values: ω_c = g ω_f − g τ ω̇_f.
    fn refined(self, all: &[Speeds], coarse: f64) -> Self {
        let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
        for s in all {
            let [omega_f, omega_c] = &s.value;
            let variance = s.noise[0].powi(2) + s.noise[1].powi(2);
            for run in runs(&s.together(self, coarse)).filter(|r| r.len() as f64 * s.observation_interval() > LEAST_S) {
                for k in run.start + SLOPE..run.end.saturating_sub(SLOPE) {
                    let slope = (omega_f[k + SLOPE] - omega_f[k - SLOPE]) / (s.time[k + SLOPE] - s.time[k - SLOPE]);
                    let row = Vector2::new(omega_f[k], -slope);
                    if row.iter().all(|x| x.is_finite()) && omega_c[k] > MOVING_SPEED {
                        normal += row * row.transpose() / variance;
                        right += row * (omega_c[k] - omega_f[k]) / variance;
                    }
                }
            }
        }
        normal += Matrix2::from_diagonal(&Vector2::new(PRIOR[0].powi(-2), PRIOR[1].powi(-2)));
        let Some(inverse) = normal.try_inverse() else { return self };
        let found = inverse * right;
        let gain = 1.0 + found[0];
        Self { gain, lag: found[1] / gain }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A launch of 10 s at 100 Hz whose speeds meet at 2 s and part at 8 s, as sensors with this gain and lag show it; noise of 0.1 rad/s.
    fn launch(gain: f64, lag: f64) -> Speeds {
        let both = |t: f64| {
            let disc = 20.0 * t + 10.0 * (2.0 * t).sin();
            let slip = if t < 2.0 { 40.0 * (2.0 - t) } else { 30.0 * (t - 8.0).max(0.0) };
            [disc + slip, disc]
        };
        let mut seed = 7_u64;
        let mut noise = move || {
            let mut uniform = || {
                seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                (seed >> 11) as f64 / (1_u64 << 53) as f64
            };
            0.1 * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0)
        };
        let time: Vec<f64> = (0..1000).map(|k| 0.01 * f64::from(k)).collect();
        let omega_f = time.iter().map(|&t| both(t)[0] + noise()).collect();
        let omega_c = time.iter().map(|&t| gain * both(t - lag)[1] + noise()).collect();
        Speeds { time, value: [omega_f, omega_c], noise: [0.1, 0.1] }
    }

    /// Stale samples may be all that a part of a log has of a speed.
    #[test]
    fn a_part_without_a_flywheel_speed_has_one_that_stands() {
        for known in 0..2 {
            let recording = crate::campaign::Recording {
                sample_rate_hz: 100.0,
                time: (0..50).map(|k| 0.01 * f64::from(k)).collect(),
                omega_f: (0..50).map(|k| if k < known { 90.0 } else { f64::NAN }).collect(),
                omega_c: vec![80.0; 50],
                t_e: vec![10.0; 50],
                theta_h: vec![25.0; 50],
                ..Default::default()
            };
            let mut tracks = [Track::new(&recording)];
            find(&mut tracks, &[Noise { white: 0.1, coloured: 0.0, memory_s: 1.0 }; 5]);
            assert_eq!(tracks[0].unknown_clutch.as_ref().unwrap().omega_f(0.3), 90.0 * f64::from(known));
        }
    }

    #[test]
    fn gain_and_lag_of_a_sensor_are_found_and_hide_no_lock() {
        for (gain, lag) in [(1.0, 0.0), (1.03, 0.0), (0.97, 0.0), (1.0, 0.05), (1.0, -0.04), (1.02, 0.03)] {
            let speeds = launch(gain, lag);
            let found = Sensors::of(std::slice::from_ref(&speeds));
            assert!((found.gain - gain).abs() < 2e-3 && (found.lag - lag).abs() < 2e-3, "{gain} {lag}: {found:?}");
            let locked = speeds.locked(found);
            let count = locked.iter().filter(|l| **l).count();
            assert!(count > 520, "{gain} {lag}: {count}");
            let truly = |k: usize| (2.0..8.0).contains(&speeds.time[k]);
            assert!((0..locked.len()).all(|k| !locked[k] || truly(k)), "{gain} {lag}");
        }
    }

    /// A lock that just exceeds both margins counts between them, and a shorter one not at all. At 100 Hz a lag of 0.1 s makes each margin 15 observations, and the longest mean and the
    /// interpolation hide 13 more at either end.
    #[test]
    fn a_lock_counts_from_two_margins_on() {
        let locked = |lasting: usize| {
            let omega_c = (0..300).map(|k| if (100..100 + lasting).contains(&k) { 100.0 } else { 60.0 }).collect();
            let speeds =
                Speeds { time: (0..300).map(|k| 0.01 * f64::from(k)).collect(), value: [vec![100.0; 300], omega_c], noise: [0.1, 0.1] };
            speeds.locked(Sensors { gain: 1.0, lag: 0.1 }).iter().filter(|l| **l).count()
        };
        assert_eq!([locked(57), locked(58), locked(60)], [0, 1, 3]);
    }

    /// Locked for 3 s, then with a slip in proportion to the speed, as if a sensor had a gain. The gain is believed only if this lasts longer than the lock by a tenth and half a
    /// second.
    #[test]
    fn a_slip_in_proportion_is_no_gain_unless_it_outlasts_the_lock() {
        for (lasts, gain) in [(3.3, 1.0), (4.5, 1.0 / 1.04)] {
            let count = 300 + (100.0 * lasts) as usize;
            let time: Vec<f64> = (0..count).map(|k| 0.01 * k as f64).collect();
            let omega_c: Vec<f64> = time.iter().map(|t| 100.0 + 20.0 * (3.0 * t).sin()).collect();
            let omega_f = omega_c.iter().enumerate().map(|(k, c)| if k < 300 { *c } else { 1.04 * c }).collect();
            let found = Sensors::of(&[Speeds { time, value: [omega_f, omega_c], noise: [0.1, 0.1] }]);
            assert!((found.gain - gain).abs() < 2e-3 && found.lag.abs() < 2e-3, "{lasts} s: {found:?}");
        }
    }

    #[test]
    fn speeds_that_cross_are_not_locked() {
        let mut speeds = launch(1.0, 0.0);
        // The disc's speed crosses the flywheel's at 5 s.
        let time = speeds.time.clone();
        speeds.value[1].iter_mut().zip(time).for_each(|(c, t)| *c += 15.0 * (t - 5.0));
        assert!(speeds.locked(ALIKE).iter().all(|l| !l));
    }

    /// Speeds that agree for 24 + `known` observations and are 20 rad/s apart before and after. The mean over 25 observations shows this slip in all but `known` of them.
    #[test]
    fn speeds_that_stay_together_for_less_than_a_fifth_of_a_second_are_not_locked() {
        for (known, locked) in [(18, 0), (23, 23 - 2 * 5 - 1)] {
            let time: Vec<f64> = (0..1000).map(|k| 0.01 * f64::from(k)).collect();
            let omega_f = (0..1000).map(|k| if (400..424 + known).contains(&k) { 100.0 } else { 120.0 }).collect();
            let speeds = Speeds { time, value: [omega_f, vec![100.0; 1000]], noise: [0.1, 0.1] };
            assert_eq!(speeds.locked(ALIKE).iter().filter(|l| **l).count(), locked, "{known}");
        }
    }
}
