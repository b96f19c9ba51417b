//! The Kalman filter that corrects a replay: gains and whitening, computed once per recording.
//!
//! The states are errors of the replay: both speeds, the torque report's error w, a torque d on the car's side (brake, road), a torque c that the clutch transmits beyond its map,
//! and the coloured noise of both speed sensors. While the clutch is open or slipping,
//!
//! ```text
//! J_f δω̇_f = w − c,   J_c δω̇_c = c + d,   ẇ = −w/τ_w + …,  ḋ = −d/τ_d + …,  ċ = −c/τ_c + …
//! ```
//!
//! While it is locked, both speeds follow (J_f + J_c) δω̇ = w + d. All disturbances are first-order Gauss–Markov processes. Which of the two models holds is read from the measured
//! speeds, so that gains and innovation covariance do not depend on what is fitted: the innovations of a candidate are its errors under one fixed linear whitening, and the
//! likelihood's determinant is the same for all candidates.
//!
//! Where the clutch torque is unknown ([`super::unknown_clutch`]), the flywheel follows its sensor while the clutch slips, and the disc follows the sum of both balances, from
//! which the clutch torque has cancelled: J_c δω̇_c = w + d.
//!
//! The two speeds are processed sequentially (flywheel, then disc), which decorrelates their innovations at the same instant.

use super::lock_up::{self, LOCKED, LOCKED_MEAN, slip_noise};
use super::noise::Noise;
use super::replay::{SENSOR_THRESHOLD, rests};
use super::tolerance::Wander;
use super::track::{Channel, Track};
use super::unseen::{self, interval, unseen};
use crate::plant::Phase;
use crate::vehicle::Vehicle;
use nalgebra::{SMatrix, SVector};

/// Number of states.
pub const STATES: usize = 7;

/// Indices of the states.
pub mod state {
    /// Flywheel speed, rad/s.
    pub const OMEGA_F: usize = 0;
    /// Disc speed, rad/s.
    pub const OMEGA_C: usize = 1;
    /// Torque on the flywheel beyond the report, N·m.
    pub const ENGINE: usize = 2;
    /// Torque on the disc's side beyond the model, N·m.
    pub const LOAD: usize = 3;
    /// Coloured noise of the flywheel speed, rad/s.
    pub const NOISE_F: usize = 4;
    /// Coloured noise of the disc speed, rad/s.
    pub const NOISE_C: usize = 5;
    /// Torque of the clutch beyond its map, N·m.
    pub const CLUTCH: usize = 6;
}
use state::{CLUTCH, ENGINE, LOAD, NOISE_C, NOISE_F, OMEGA_C, OMEGA_F};

type Covariance = SMatrix<f64, STATES, STATES>;

/// Process noise of a car beyond its equations of motion, and noise of its sensors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disturbances {
    /// Sensor noise by [`Channel`].
    pub noise: [Noise; 5],
    /// White noise of one sample of the torque report, N·m.
    pub report_noise: f64,
    /// Slow error of the torque report, N·m.
    pub report: Wander,
    /// Torque on the car's side, N·m.
    pub load: Wander,
    /// Clutch torque beyond its map, as a share of the torque that the clutch transmits.
    pub clutch: Wander,
    /// Bearing position beyond the actuator's model, mm.
    pub bearing: Wander,
    /// Further coloured noise of each speed, rad/s.
    pub sensors: [Wander; 2],
    /// Known latency of each speed sensor, s: a sample shows the speed at that time before its stamp.
    pub late: [f64; 2],
    /// Remaining latency of the flywheel's speed relative to the disc's, s, within what the tolerances of the latencies allow; see [`lock_up::skew`].
    pub skew: f64,
    /// Standard deviation of the time stamps about the instants of their samples, s; see [`super::noise::stamps`].
    pub stamps: f64,
}

/// Torque on the car's side while the driver brakes, N·m and s. It is unknown, so its standard deviation is as large as tyres allow.
const BRAKES: Wander = Wander { sigma: 300.0, time_s: 0.2 };

/// Kalman gains of one observation.
#[derive(Clone, Copy, Debug, Default)]
pub struct Gain {
    /// Interval to the next observation, s.
    pub interval: f64,
    /// Gains for the innovations of flywheel speed and disc speed, per state.
    pub of: [[f64; STATES]; 2],
    /// Inverse standard deviations of the two innovations; 0 where there is no sample.
    pub weight: [f64; 2],
    /// Regression coefficient of the disc speed's error on the flywheel speed's, where both samples share one inexact time stamp; 0 otherwise.
    pub common: f64,
    /// Factors by which the disturbances decay to the next observation.
    pub decay: [f64; STATES],
}

impl Gain {
    /// Innovations of flywheel and disc speed, rad/s; `None` where there is no sample. The disc speed is processed after the flywheel speed has corrected the states. `errors` are
    /// the measured speeds less the predicted sensor readings; corrections of all states other than the speeds are added to `estimate`.
    pub fn innovations(&self, errors: [f64; 2], estimate: &mut [f64; STATES]) -> [Option<f64>; 2] {
        let mut corrected = [0.0; 2];
        std::array::from_fn(|c| {
            if self.weight[c] == 0.0 {
                return None;
            }
            let left = |c: usize| errors[c] - corrected[c] - estimate[[NOISE_F, NOISE_C][c]];
            let innovation = left(c) - if c == 1 && self.common != 0.0 { self.common * left(0) } else { 0.0 };
            (0..2).for_each(|s| corrected[s] += self.of[c][s] * innovation);
            (2..STATES).for_each(|s| estimate[s] += self.of[c][s] * innovation);
            Some(innovation)
        })
    }
}

/// Gain of one observation of a bench channel, whose error may be correlated in time.
#[derive(Clone, Copy, Debug, Default)]
pub struct BenchGain {
    /// Inverse standard deviation of the innovation; 0 where there is no sample.
    pub weight: f64,
    /// Gain for the correlated error.
    pub of: f64,
    /// Factor by which the correlated error decays to the next observation.
    pub decay: f64,
}

impl BenchGain {
    /// Whitened innovation of `error`, given the estimate `lasting` of its correlated part. Updates that estimate and predicts it for the next observation.
    pub fn innovation(&self, error: f64, lasting: &mut f64) -> f64 {
        let innovation = if self.weight == 0.0 { 0.0 } else { error - *lasting };
        *lasting = self.decay * (*lasting + self.of * innovation);
        innovation * self.weight
    }
}

/// Filter of one recording.
#[derive(Clone, Debug, Default)]
pub struct Filter {
    /// Gains of the speeds, by observation.
    pub gains: Vec<Gain>,
    /// Gains of the bench channels (bearing, torque, temperature) by observation; empty for a channel that is not there.
    pub bench: [Vec<BenchGain>; 3],
    /// Logarithm of the determinant of the innovations' covariance.
    pub log_det: f64,
    /// Phase of the clutch by observation. Whether it is locked is read from the measured speeds; otherwise it is open up to the kiss point of the vehicle file and slipping
    /// beyond, or always slipping if its torque is unknown.
    pub phase: Vec<Phase>,
    /// Whether the flywheel follows its sensor because the clutch torque is unknown, by observation. Torque errors of either balance then move the disc.
    pub pinned: Vec<bool>,
    /// Whether the car stands and is held by its brakes, by observation.
    pub stands: Vec<bool>,
    /// Inertias for which the gains were computed: flywheel, car, kg·m².
    pub inertia: [f64; 2],
    /// Number of innovations, of speeds and bench channels together.
    pub samples: usize,
}

impl Filter {
    /// Accelerations of flywheel and disc due to the torques that the gains `of` attribute to an innovation of 1 rad/s at observation `k`, 1/s.
    pub fn accelerations(&self, k: usize, of: &[f64; STATES]) -> [f64; 2] {
        let torque = if self.pinned[k] { [0.0, of[ENGINE] + of[LOAD]] } else { [of[ENGINE] - of[CLUTCH], of[LOAD] + of[CLUTCH]] };
        [torque[0] / self.inertia[0], torque[1] / self.inertia[1]]
    }

    /// Torque on the car's side that the gains `of` attribute to an innovation of 1 rad/s, N·m·s/rad. While the clutch is `stuck`, or the flywheel follows its sensor, it includes
    /// the engine's.
    pub fn load_torque(&self, k: usize, of: &[f64; STATES], stuck: bool) -> f64 {
        if stuck || self.pinned[k] { of[LOAD] + of[ENGINE] } else { of[LOAD] }
    }
}

/// Error of the disc temperature that lasts for about a second, K, because the temperature of the housing air is recorded in steps.
const LASTING_TEMPERATURE_K: f64 = 0.1;

/// Propagates the covariance along a recording and returns the filter. `torque` is the clutch torque in N·m at the logger's samples ([`replay::torques`](super::replay::torques)):
/// [`Disturbances::clutch`] is a share of it, and its curvature determines the variance of its unseen changes between slow samples.
pub fn filter(track: &Track, vehicle: &Vehicle, with: &Disturbances, torque: &[f64]) -> Filter {
    let n = track.observations();
    let speeds: [Vec<(f64, usize)>; 2] = [Channel::OmegaF, Channel::OmegaC].map(|c| (0..n).map(|k| track.mean(c, k)).collect());
    // The clutch locks when the speeds meet. Sensors with a known latency show it later, so their speeds are shifted back.
    let typical = track.observation_interval();
    let then: [Vec<(f64, usize)>; 2] = std::array::from_fn(|c| {
        let ahead = (with.late[c] / typical).round() as usize;
        (0..n).map(|k| speeds[c][(k + ahead).min(n - 1)]).collect()
    });
    let unknown = track.unknown_clutch.as_ref();
    let closed = |k: usize| unknown.is_some() || lock_up::closed(track, vehicle, k);
    let locked = unknown.map_or_else(|| lock_up::locked(&then, with, |k| track.time[track.rows_of(k).start], closed), |u| u.locked.clone());
    let lock_up_slip_sigma = if unknown.is_some() { vec![0.0; n] } else { lock_up::lock_up_slip_sigma(track, &then, &locked) };
    let [j_f, j_c] = [vehicle.driveline.J_f, vehicle.driveline.J_c];
    let total = j_f + j_c;
    let variance = |c: usize, samples: usize| with.noise[c].white.powi(2) / samples as f64;
    let mut p = Covariance::zeros();
    // A speed that begins below its sensor's threshold is taken as 0 at the start. Its standard deviation there is half of its first sample.
    let at_start = [Channel::OmegaF, Channel::OmegaC].map(|c| track.speed_at(c, 0).map(|s| s.1));
    let hidden = |c: usize| {
        let seen = speeds[c].iter().map(|s| s.0).find(|v| v.is_finite()).unwrap_or(0.0);
        if at_start[c].is_none() && seen.abs() < SENSOR_THRESHOLD { 0.5 * seen } else { 0.0 }
    };
    let start = |c: usize| {
        at_start[c].unwrap_or(1.0) * with.noise[c].white.powi(2)
            + with.noise[c].coloured.powi(2)
            + with.sensors[c].sigma.powi(2)
            + hidden(c).powi(2)
    };
    (p[(OMEGA_F, OMEGA_F)], p[(OMEGA_C, OMEGA_C)]) = (start(0), start(1));
    let colour: [Wander; 2] = std::array::from_fn(|c| joined(with.noise[c], with.sensors[c]));
    // Variance that the sensor noise of a flywheel that follows its sensor causes at the disc, (rad/s)².
    let followed = (j_f / j_c).powi(2) * (variance(0, track.samples_per_observation(Channel::OmegaF)) + colour[0].sigma.powi(2));
    let mut gains = Vec::with_capacity(n);
    let mut torque_variance = Vec::with_capacity(n);
    let mut log_det = 0.0;
    let mut samples = 0;
    // A brake that is applied or released between two samples, or recorded late, also acts in the intervals next to those that are marked.
    let marked = |k: usize| track.rows_of(k.min(n - 1)).any(|row| track.brake[row]);
    let braking = |k: usize| marked(k.saturating_sub(1)) || marked(k) || marked(k + 1);
    let stationary = |k: usize| -> [(usize, Wander); 5] {
        let load = if braking(k) { BRAKES } else { with.load };
        let transmitted = torque.get(unseen::samples_of(track, k).end - 1).map_or(0.0, |t| t.abs());
        let clutch = Wander { sigma: with.clutch.sigma * transmitted, ..with.clutch };
        [(ENGINE, with.report), (LOAD, load), (CLUTCH, clutch), (NOISE_F, colour[0]), (NOISE_C, colour[1])]
    };
    for (place, process) in stationary(0) {
        p[(place, place)] = process.sigma.powi(2);
    }
    let unseen_report = unseen(track, &unseen::at_samples(track, |t| t.t_e), |_| true);
    let unseen_torque = unseen(track, torque, |k| !locked[k]);
    let unseen_command = unseen(track, &unseen::at_samples(track, |t| t.x_to), |_| true);
    for k in 0..n {
        let mut gain = Gain { interval: interval(track, k), ..Gain::default() };
        let pinned = unknown.is_some() && !locked[k];
        // Error of the flywheel speed due to the time stamp (one standard deviation), and the variance of its whole measurement error.
        let mut flywheel = None;
        if unknown.is_some() && (k == 0 && pinned || k > 0 && locked[k] != locked[k - 1]) {
            p = switched(&p, pinned, j_f, j_c);
        }
        for c in 0..2 {
            let (mean, count) = speeds[c][k];
            if !mean.is_finite() || pinned && c == 0 {
                continue;
            }
            let (speed, noise) = [(OMEGA_F, NOISE_F), (OMEGA_C, NOISE_C)][c];
            let share = if c == 0 { j_c / total } else { j_f / total };
            let stamp = unseen::of_stamps(track, with.stamps, &speeds[c], k);
            let mut r = variance(c, count) + (share * lock_up_slip_sigma[k]).powi(2) + stamp.powi(2) + if pinned { followed } else { 0.0 };
            let mut h = SVector::<f64, STATES>::zeros();
            (h[speed], h[noise]) = (1.0, 1.0);
            if let Some((of_flywheel, all)) = flywheel.filter(|_| stamp != 0.0 && track.has_one_clock()) {
                // After the part predicted by the flywheel speed is subtracted, the rest of the disc speed's error is independent.
                gain.common = of_flywheel * stamp / all;
                r -= gain.common * of_flywheel * stamp;
                (h[OMEGA_F], h[NOISE_F]) = (-gain.common, -gain.common);
            }
            flywheel = Some((stamp, r));
            let ph = p * h;
            let s = h.dot(&ph) + r;
            let kalman = ph / s;
            p -= kalman * ph.transpose();
            gain.of[c] = kalman.into();
            gain.weight[c] = 1.0 / s.sqrt();
            log_det += s.ln();
            samples += 1;
        }
        // Sensitivity of the clutch torque to the disturbances. While the clutch slips it is the clutch disturbance itself; while it is locked it is the constraint torque that
        // keeps both speeds equal.
        let mut h = SVector::<f64, STATES>::zeros();
        if locked[k] {
            (h[ENGINE], h[LOAD]) = (j_c / total, -j_f / total)
        } else {
            h[CLUTCH] = 1.0
        };
        torque_variance.push(h.dot(&(p * h)));
        // Prediction to the next observation.
        let dt = gain.interval;
        let report_impulse = with.report_noise.powi(2) * dt * (dt / track.reports_in(k) as f64) + unseen_report.integral[k];
        let mut f = Covariance::identity();
        let mut decay = [1.0; STATES];
        let mut q = Covariance::zeros();
        for (place, process) in stationary(k) {
            let a = (-dt / process.time_s).exp();
            decay[place] = a;
            f[(place, place)] = a;
            q[(place, place)] = process.sigma.powi(2) * (1.0 - a * a);
            let through = process.time_s * (1.0 - a);
            match place {
                ENGINE => f[(OMEGA_F, ENGINE)] = through,
                LOAD => f[(OMEGA_C, LOAD)] = through,
                CLUTCH => (f[(OMEGA_F, CLUTCH)], f[(OMEGA_C, CLUTCH)]) = (-through, through),
                _ => {}
            }
        }
        if locked[k] {
            let (e, l) = (f[(OMEGA_F, ENGINE)] / total, f[(OMEGA_C, LOAD)] / total);
            for speed in [OMEGA_F, OMEGA_C] {
                (f[(speed, ENGINE)], f[(speed, LOAD)], f[(speed, CLUTCH)]) = (e, l, 0.0);
                (f[(speed, OMEGA_F)], f[(speed, OMEGA_C)]) = (j_f / total, j_c / total);
            }
            for (a, b) in [(OMEGA_F, OMEGA_F), (OMEGA_F, OMEGA_C), (OMEGA_C, OMEGA_F), (OMEGA_C, OMEGA_C)] {
                q[(a, b)] = report_impulse / (total * total);
            }
            // While the command asks for an open clutch, only the samples show that it is still locked, and only as accurately as they would show slip.
            if !closed(k) {
                q += of_slip((LOCKED_MEAN * slip_noise(with)).powi(2), j_f, j_c);
            }
        } else if pinned {
            f[(OMEGA_C, ENGINE)] = f[(OMEGA_F, ENGINE)] / j_c;
            f[(OMEGA_C, LOAD)] /= j_c;
            (f[(OMEGA_F, ENGINE)], f[(OMEGA_F, OMEGA_F)]) = (0.0, 0.0);
            (f[(OMEGA_F, CLUTCH)], f[(OMEGA_C, CLUTCH)]) = (0.0, 0.0);
            q[(OMEGA_C, OMEGA_C)] = report_impulse / (j_c * j_c);
        } else {
            f[(OMEGA_F, ENGINE)] /= j_f;
            f[(OMEGA_F, CLUTCH)] /= j_f;
            f[(OMEGA_C, LOAD)] /= j_c;
            f[(OMEGA_C, CLUTCH)] /= j_c;
            let unseen = unseen_torque.integral[k];
            q[(OMEGA_F, OMEGA_F)] = (report_impulse + unseen) / (j_f * j_f);
            q[(OMEGA_C, OMEGA_C)] = unseen / (j_c * j_c);
            q[(OMEGA_F, OMEGA_C)] = -unseen / (j_f * j_c);
            q[(OMEGA_C, OMEGA_F)] = q[(OMEGA_F, OMEGA_C)];
        }
        gain.decay = decay;
        gains.push(gain);
        p = f * p * f.transpose() + q;
        // The torque of a brake that is released vanishes at once, and the ordinary load disturbance takes its place.
        if k + 1 < n && braking(k) && !braking(k + 1) {
            p.row_mut(LOAD).fill(0.0);
            p.column_mut(LOAD).fill(0.0);
            p[(LOAD, LOAD)] = with.load.sigma.powi(2);
            gains[k].decay[LOAD] = 0.0;
        }
    }
    // A locked clutch transmits its share of the engine's unseen torque changes.
    let unseen_of_torque = |k: usize| if locked[k] { (j_c / total).powi(2) * unseen_report.before[k] } else { unseen_torque.before[k] };
    let of_torque = torque_variance.iter().enumerate().map(|(k, v)| v + unseen_of_torque(k)).collect();
    let beyond = [unseen_command.before, of_torque, vec![0.0; n]];
    let bench = bench(track, with, &locked, &beyond, &mut samples, &mut log_det);
    let phase = |k: usize| match (locked[k], closed(k)) {
        (true, _) => Phase::Locked,
        (_, true) => Phase::Slipping,
        _ => Phase::Open,
    };
    let (phase, stands) = ((0..n).map(phase).collect(), stands(track, &speeds[1], with.noise[1].white, braking));
    let pinned = locked.iter().map(|locked| unknown.is_some() && !locked).collect();
    Filter { gains, bench, log_det, stands, pinned, phase, inertia: [j_f, j_c], samples }
}

/// Covariance of both speeds if their difference has this variance, (rad/s)², and their total angular momentum is certain.
fn of_slip(variance: f64, j_f: f64, j_c: f64) -> Covariance {
    let mut v = SVector::<f64, STATES>::zeros();
    (v[OMEGA_F], v[OMEGA_C]) = (j_c / (j_f + j_c), -j_f / (j_f + j_c));
    v * v.transpose() * variance
}

/// Covariance after a clutch of unknown torque begins to slip (`pinned`) or locks again. While it slips, the flywheel follows its sensor, and the disc's state is the error of the
/// total angular momentum over the car's inertia; once it is locked, both sides share that momentum.
fn switched(p: &Covariance, pinned: bool, j_f: f64, j_c: f64) -> Covariance {
    let mut to = Covariance::identity();
    if pinned {
        (to[(OMEGA_F, OMEGA_F)], to[(OMEGA_C, OMEGA_F)]) = (0.0, j_f / j_c);
    } else {
        (to[(OMEGA_F, OMEGA_F)], to[(OMEGA_F, OMEGA_C)], to[(OMEGA_C, OMEGA_C)]) = (0.0, j_c / (j_f + j_c), j_c / (j_f + j_c));
    }
    to * p * to.transpose()
}

/// Time at rest under the brakes after which the shafts have come to rest as well, s.
pub const RESTED_S: f64 = 0.5;

/// Whether the car has stood under its brakes for more than [`RESTED_S`], by observation. A wheel speed below its sensor's threshold counts as standing.
fn stands(track: &Track, omega_c: &[(f64, usize)], noise: f64, braking: impl Fn(usize) -> bool) -> Vec<bool> {
    let mut since = 0.0;
    let held = |(k, rests): (usize, bool)| {
        since = if rests && braking(k) { since + interval(track, k) } else { 0.0 };
        since > RESTED_S
    };
    rests(omega_c.iter().map(|s| s.0), |speed| speed <= LOCKED * noise).enumerate().map(held).collect()
}

/// Sum of a sensor's coloured noise and a further first-order process, approximated by one first-order process. Where there is a further process, its correlation time holds for
/// both.
fn joined(noise: Noise, further: Wander) -> Wander {
    if further.sigma > 0.0 {
        return Wander { sigma: noise.coloured.hypot(further.sigma), time_s: further.time_s };
    }
    Wander { sigma: noise.coloured, time_s: noise.memory_s }
}

/// Gains of the bench channels. `beyond` holds, by channel and observation, the variance of the prediction, to which the sensor noise is added.
fn bench(
    track: &Track,
    with: &Disturbances,
    locked: &[bool],
    beyond: &[Vec<f64>; 3],
    samples: &mut usize,
    log_det: &mut f64,
) -> [Vec<BenchGain>; 3] {
    std::array::from_fn(|place| {
        let channel = [Channel::XTo, Channel::TFc, Channel::ThetaC][place];
        if track.measured[channel as usize].is_empty() {
            return Vec::new();
        }
        let lasting = if channel == Channel::ThetaC { LASTING_TEMPERATURE_K } else { 0.0 };
        let further = if channel == Channel::XTo { with.bearing } else { Wander { sigma: 0.0, time_s: 1.0 } };
        let wander = joined(with.noise[channel as usize], further);
        let mut p = wander.sigma.powi(2);
        let means: Vec<(f64, usize)> = (0..track.observations()).map(|k| track.mean(channel, k)).collect();
        (0..track.observations())
            .map(|k| {
                let dt = interval(track, k);
                let mut gain = BenchGain { decay: (-dt / wander.time_s).exp(), ..BenchGain::default() };
                let (mean, count) = means[k];
                // The clutch torque jumps at a lock-up, so its prediction there depends on a fraction of a sample. Samples next to a lock-up are skipped.
                let near = k.saturating_sub(2)..(k + 3).min(locked.len());
                let jumps = channel == Channel::TFc && near.clone().any(|j| locked[j] != locked[k]);
                if mean.is_finite() && !jumps {
                    let further = beyond[place][k] + unseen::of_stamps(track, with.stamps, &means, k).powi(2);
                    let r = with.noise[channel as usize].white.powi(2) / count as f64 + lasting.powi(2) / dt + further;
                    let s = p + r;
                    (gain.weight, gain.of) = (1.0 / s.sqrt(), p / s);
                    p *= r / s;
                    *samples += 1;
                    *log_det += s.ln();
                }
                p = wander.sigma.powi(2) + gain.decay.powi(2) * (p - wander.sigma.powi(2));
                gain
            })
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gap::model::{prepare, tolerance};

    #[test]
    fn slip_adds_no_momentum() {
        let (j_f, j_c) = (0.2, 1.7);
        let q = of_slip(0.09, j_f, j_c);
        let variance = |of_f: f64, of_c: f64| {
            let mut h = SVector::<f64, STATES>::zeros();
            (h[OMEGA_F], h[OMEGA_C]) = (of_f, of_c);
            h.dot(&(q * h))
        };
        assert!((variance(1.0, -1.0) - 0.09).abs() < 1e-12 && variance(j_f, j_c).abs() < 1e-12);
        assert!((q.trace() - variance(1.0, 0.0) - variance(0.0, 1.0)).abs() < 1e-12);
    }

    /// Two speeds rise by 80 and 30 rad/s² and are read under one stamp with an error of 2 ms. The disc speed's innovation must not contain the error that it shares with the
    /// flywheel speed.
    #[test]
    fn an_error_of_the_stamp_is_common_to_both_speeds() {
        let (stamps, white, accelerations) = (2e-3, [0.1, 0.07], [80.0, 30.0]);
        let speed = |c: usize| (0..60).map(|k| 100.0 * (1 - c) as f64 + 0.01 * accelerations[c] * f64::from(k)).collect::<Vec<_>>();
        let track = Track::new(&crate::campaign::Recording {
            sample_rate_hz: 100.0,
            time: (0..60).map(|k| 0.01 * f64::from(k)).collect(),
            omega_f: speed(0),
            omega_c: speed(1),
            t_e: vec![0.0; 60],
            x_to_cmd: vec![0.0; 60],
            theta_h: vec![25.0; 60],
            ..Default::default()
        });
        let tolerances = tolerance::read(&serde_json::json!({}), tolerance::Logger::UNIFORM).unwrap();
        let noise = |c: usize| Noise { white: white[c], coloured: 0.0, memory_s: 1.0 };
        let with = Disturbances { stamps, ..prepare::healthy([noise(0), noise(1), noise(0), noise(0), noise(0)], 0.0, 0.0, &tolerances) };
        let gain = filter(&track, &Vehicle::paper(), &with, &[]).gains[30];
        let (own, shared) = (white[0].powi(2) + (stamps * accelerations[0]).powi(2), stamps.powi(2) * accelerations[0] * accelerations[1]);
        assert!((gain.common - shared / own).abs() < 1e-9, "{} is not {}", gain.common, shared / own);
        // An error of the stamp alone: the disc speed's innovation is its error less the part that the flywheel speed's error predicts.
        let without = Gain { of: [[0.0; STATES]; 2], ..gain };
        let [first, second] = without.innovations([0.8, 0.3], &mut [0.0; STATES]).map(Option::unwrap);
        assert!((first - 0.8).abs() < 1e-12 && (second - (0.3 - 0.8 * gain.common)).abs() < 1e-12, "{first} {second}");
        // Messages with separate stamps have independent errors.
        let apart = Track::new(&crate::campaign::Recording {
            sample_rate_hz: 100.0,
            time: (0..120).map(|k| 0.005 * f64::from(k)).collect(),
            omega_f: speed(0).into_iter().flat_map(|v| [v, f64::NAN]).collect(),
            omega_c: speed(1).into_iter().flat_map(|v| [f64::NAN, v]).collect(),
            t_e: vec![0.0; 120],
            x_to_cmd: vec![0.0; 120],
            theta_h: vec![25.0; 120],
            ..Default::default()
        });
        assert!(!apart.has_one_clock() && filter(&apart, &Vehicle::paper(), &with, &[]).gains.iter().all(|gain| gain.common == 0.0));
        let even = filter(&track, &Vehicle::paper(), &Disturbances { stamps: 0.0, ..with }, &[]).gains[30];
        assert_eq!(even.common, 0.0);
        assert!(even.weight[1] > gain.weight[1] && even.weight[0] > gain.weight[0], "a stamp that is right leaves less open");
    }

    /// At 50 Hz, the last engine torque before a sample was not logged. The prediction of a locked clutch's torque has the engine torque's variance about the straight line between
    /// samples, times the square of the share that the clutch transmits.
    #[test]
    fn a_locked_clutch_carries_what_the_engine_did_unseen() {
        let speed: Vec<f64> = (0..60).map(|k| 100.0 + 0.1 * f64::from(k)).collect();
        let track = Track::new(&crate::campaign::Recording {
            sample_rate_hz: 50.0,
            time: (0..60).map(|k| 0.02 * f64::from(k)).collect(),
            omega_f: speed.clone(),
            omega_c: speed,
            t_e: (0..60).map(|k| 10.0 * f64::from((k - 30).max(0))).collect(),
            x_to_cmd: vec![Vehicle::paper().actuator.x_cls_0; 60],
            theta_h: vec![25.0; 60],
            t_fc: Some(vec![5.0; 60]),
            ..Default::default()
        });
        let tolerances = tolerance::read(&serde_json::json!({}), tolerance::Logger::UNIFORM).unwrap();
        let noise = Noise { white: 0.3, coloured: 0.0, memory_s: 1.0 };
        let of = |torque: &[f64]| filter(&track, &Vehicle::paper(), &prepare::healthy([noise; 5], 0.0, 0.0, &tolerances), torque);
        let found = of(&[5.0; 60]);
        assert!(found.phase.iter().all(|p| *p == Phase::Locked));
        let variance = |k: usize| found.bench[1][k].weight.powi(-2);
        // The sample at the bend lies 5 N·m off the mean of its neighbours. Half of that square counts for each of the two intervals beside it, and half of that again in the
        // middle of an interval.
        let [j_f, j_c] = found.inertia;
        let ratio = (variance(30) - variance(28)) / (6.25 * (j_c / (j_f + j_c)).powi(2));
        assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    }
}
