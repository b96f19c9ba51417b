//! How far the simulation is from the car: errors of [free replays](super::free) of a recording before and after retuning, and engagement figures.

use super::free::{Car, Free, LONGEST_S, prepare};
use super::model::tolerance::{self, Nuisance, Wander};
use super::model::track::{Channel, Track};
use crate::campaign::Recording;
use crate::physics::driveline::clutch_torque;
use crate::vehicle::Vehicle;
use rayon::prelude::*;
use std::ops::Range;

/// Gap of one channel of one recording.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldOut {
    /// Recording.
    pub recording: String,
    /// Channel.
    pub channel: Channel,
    /// Root mean square of measured minus replayed values, before retuning.
    pub before: f64,
    /// Root mean square of measured minus replayed values, after retuning.
    pub after: f64,
    /// Standard deviation of the channel's noise.
    pub noise: f64,
    /// Engagement figures: real, before, after.
    pub engagement: [Option<Engagement>; 3],
}

/// Figures of one engagement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Engagement {
    /// Time from the start until the slip is gone, s.
    pub time_s: f64,
    /// Energy that the clutch dissipated until then, J.
    pub energy_j: f64,
    /// Slip acceleration just before the slip is gone, rad/s².
    pub slip_acceleration: f64,
}

/// Measured curves of one recording, or of one engagement of a drive, with those of the nominal and the retuned model.
#[derive(Clone, Debug)]
pub struct Overlay {
    /// Name of the recording.
    pub recording: String,
    /// What was driven.
    pub manoeuvre: String,
    /// Whether these data were held out.
    pub held_out: bool,
    /// Time between samples, s.
    pub dt: f64,
    /// Temperatures of disc and body at the first sample, as the replay of the retuned model has them, °C.
    pub theta: [f64; 2],
    /// Slip angle at the first sample, counted from the beginning of the recording, rad.
    pub slip_angle: f64,
    /// Channels that were measured.
    pub channels: Vec<OverlayChannel>,
}

/// One channel of a recording.
#[derive(Clone, Debug)]
pub struct OverlayChannel {
    /// Column of the recording.
    pub column: &'static str,
    /// Unit of the values.
    pub unit: &'static str,
    /// As measured; a value that is not finite is a missing sample.
    pub real: Vec<f64>,
    /// Replay with the nominal model.
    pub before: Vec<f64>,
    /// Replay with the retuned model.
    pub after: Vec<f64>,
}

/// Gaps of every channel that the recording has. For a drive, they are taken over all its engagements, or over the last one alone if `last` is set.
pub fn evaluate_part(recording: &Recording, before: Car, after: Car, last: bool) -> Vec<HeldOut> {
    let mut p = prepare(recording, before.0);
    if last {
        p.stretches = p.stretches.split_off(p.stretches.len().saturating_sub(1));
    }
    let theta = [recording.theta_c0, recording.theta_b0];
    let (b, a) = (p.replays(before, theta), p.replays(after, theta));
    let figures = p.stretches.first().map_or([None; 3], |rows| {
        [
            engagement(&p.track, rows, None, before.0),
            engagement(&p.track, rows, b.first(), before.0),
            engagement(&p.track, rows, a.first(), after.0),
        ]
    });
    let present = Channel::ALL.into_iter().filter(|c| !p.track.measured[*c as usize].is_empty());
    present
        .map(|channel| HeldOut {
            recording: recording.name.clone(),
            channel,
            before: p.rms(channel, &b),
            after: p.rms(channel, &a),
            noise: p.noise[channel as usize],
            engagement: figures,
        })
        .collect()
}

/// Gaps of every channel that the recording has.
pub fn evaluate(recording: &Recording, before: Car, after: Car) -> Vec<HeldOut> {
    evaluate_part(recording, before, after, false)
}

/// Name of the engagement of a drive that begins at `row`.
pub fn name_of_engagement(recording: &Recording, row: usize) -> String {
    format!("{} at {:.1} s", recording.name, recording.time[row])
}

/// Curves of a recording: one overlay, or one for each engagement of a drive. `held_out` gets the index of an engagement and the number of engagements; `theta` are the
/// temperatures of the retuned car at the start of the recording.
pub fn overlays(recording: &Recording, held_out: impl Fn(usize, usize) -> bool, before: Car, after: Car, theta: [f64; 2]) -> Vec<Overlay> {
    let p = prepare(recording, before.0);
    let (b, a) = (p.replays(before, [recording.theta_c0, recording.theta_b0]), p.replays(after, theta));
    let single = p.stretches.len() == 1 && p.stretches[0] == (0..p.track.rows());
    let count = p.stretches.len();
    let one = |(k, rows): (usize, &Range<usize>)| {
        let channels = Channel::ALL
            .into_iter()
            .filter(|c| !p.track.measured[*c as usize].is_empty())
            .map(|c| OverlayChannel {
                column: c.column(),
                unit: c.unit(),
                real: p.track.measured[c as usize][rows.clone()].to_vec(),
                before: b[k].value[c as usize].clone(),
                after: a[k].value[c as usize].clone(),
            })
            .collect();
        Overlay {
            recording: if single { recording.name.clone() } else { name_of_engagement(recording, rows.start) },
            manoeuvre: if single { recording.manoeuvre.clone() } else { "engagement".to_owned() },
            held_out: held_out(k, count),
            dt: p.track.interval(),
            theta: a[k].theta,
            slip_angle: a[k].slip_angle,
            channels,
        }
    };
    p.stretches.iter().enumerate().map(one).collect()
}

/// Root mean square error, rad/s, that a free replay with the true car would be expected to show, as the mean of both speeds. It is due to noise and to what no file says about a
/// recording: its temperatures, drift and grade, and the wander of the torque report.
pub fn floor(recording: &Recording, after: Car, own: &[Nuisance], report: Wander, last: bool) -> f64 {
    let mut p = prepare(recording, after.0);
    if last {
        p.stretches = p.stretches.split_off(p.stretches.len().saturating_sub(1));
    }
    let theta = [recording.theta_c0, recording.theta_b0];
    let reference = p.replays(after, theta);
    let base = tolerance::Car { effects: *after.1, ..tolerance::Car::nominal(after.0) };
    let mut moved: Vec<Vec<Free>> = own
        .par_iter()
        .map(|n| {
            let mut car = base;
            car.apply(std::slice::from_ref(n), &[1.0]);
            p.replays((&car.vehicle, &car.effects), theta)
        })
        .collect();
    for node in 0..2 {
        let mut warmer = theta;
        warmer[node] += recording.theta_0_sigma[node];
        moved.push(p.replays(after, warmer));
    }
    let d = &after.0.driveline;
    let of_channel = |channel: Channel| {
        let c = channel as usize;
        let pairs = |m: &[Free]| -> f64 {
            let (sum, count) = m
                .iter()
                .zip(&reference)
                .flat_map(|(a, b)| a.value[c].iter().zip(&b.value[c]))
                .fold((0.0, 0), |(s, n), (a, b)| (s + (a - b).powi(2), n + 1));
            sum / f64::from(count.max(1))
        };
        // The wander, integrated by the inertia J, has the variance 2 σ² τ t/J² once t is longer than its time τ; the mean of this over a stretch is taken.
        let seconds = p.stretches.iter().map(|r| p.track.time[r.end - 1] - p.track.time[r.start]).fold(0.0, f64::max);
        let wander = (report.sigma / (d.J_f + d.J_c)).powi(2) * report.time_s * seconds.min(LONGEST_S);
        (p.noise[c].powi(2) + moved.iter().map(|m| pairs(m)).sum::<f64>() + wander).sqrt()
    };
    0.5 * (of_channel(Channel::OmegaF) + of_channel(Channel::OmegaC))
}

/// Gap of both speeds in free replays: mean over both channels, rad/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closed {
    /// Of the nominal plant.
    pub before: f64,
    /// Of the retuned plant.
    pub after: f64,
    /// Of a perfect plant, due to noise and to the declared uncertainties of the recording: the floor.
    pub noise: f64,
    /// Of a perfect plant in a recording in which nothing but the noise of the sensors is unknown.
    pub sensors: f64,
}

impl Closed {
    /// Averages the gaps of both speeds, with the noise of the sensors as the floor.
    pub fn of(held_out: &[HeldOut]) -> Self {
        let speeds: Vec<&HeldOut> = held_out.iter().filter(|h| matches!(h.channel, Channel::OmegaF | Channel::OmegaC)).collect();
        let mean = |get: fn(&HeldOut) -> f64| speeds.iter().map(|h| get(h)).sum::<f64>() / speeds.len().max(1) as f64;
        let noise = mean(|h| h.noise);
        Self { before: mean(|h| h.before), after: mean(|h| h.after), noise, sensors: noise }
    }

    /// Whether the gap before retuning is no larger than the floor, so that noise and the declared uncertainties of the recording could have caused it by themselves.
    pub fn is_below_floor(&self) -> bool {
        self.before <= self.noise
    }

    /// Share of the gap above the floor that is closed. A gap that lies below the floor is counted from the sensors' noise instead; if it lies below that as well, the share is
    /// zero.
    pub fn fraction(&self) -> f64 {
        let floor = if self.is_below_floor() { self.sensors } else { self.noise };
        if self.before > floor { ((self.before - self.after) / (self.before - floor)).min(1.0) } else { 0.0 }
    }
}

/// Slip in rad/s under which a clutch counts as engaged.
const ENGAGED_SLIP: f64 = 1.5;

/// Time over which slip acceleration and engine acceleration are taken, s.
const SLOPE_S: f64 = 0.1;

/// Figures of the first engagement of a stretch, measured (`replay` none) or replayed. None if the slip at the beginning is less than ten times [`ENGAGED_SLIP`], if it does not
/// fall below [`ENGAGED_SLIP`], or if it does so within twice [`SLOPE_S`].
///
/// The measured clutch torque is that of the transducer; without one, the engine balance (8a) gives it.
fn engagement(track: &Track, rows: &Range<usize>, replay: Option<&Free>, vehicle: &Vehicle) -> Option<Engagement> {
    let of = |c: Channel| -> Vec<f64> {
        let measured = &track.measured[c as usize];
        replay
            .map_or_else(|| if measured.is_empty() { Vec::new() } else { filled(&measured[rows.clone()]) }, |f| f.value[c as usize].clone())
    };
    let (omega_f, omega_c) = (of(Channel::OmegaF), of(Channel::OmegaC));
    let slip: Vec<f64> = omega_f.iter().zip(&omega_c).map(|(f, c)| f - c).collect();
    if slip.first().is_none_or(|s| *s < 10.0 * ENGAGED_SLIP) {
        return None;
    }
    let end = slip.iter().position(|s| *s < ENGAGED_SLIP)?;
    let dt = track.interval();
    let reach = ((SLOPE_S / dt).round() as usize).max(1);
    if end < 2 * reach {
        return None;
    }
    let d = &vehicle.driveline;
    let slope = |v: &[f64], k: usize| {
        let (a, b) = (k.saturating_sub(reach / 2), (k + reach / 2 + 1).min(v.len() - 1));
        (v[b] - v[a]) / ((b - a) as f64 * dt)
    };
    let torque = of(Channel::TFc);
    let report = |k: usize| track.ticks[track.tick_of_row[rows.start + k]].t_e;
    let at = |k: usize| if torque.is_empty() { clutch_torque(d, report(k), omega_f[k], slope(&omega_f, k)) } else { torque[k] };
    let energy_j = (0..end).map(|k| at(k) * slip[k] * dt).sum();
    let slip_acceleration = (slip[end] - slip[end - reach]) / (reach as f64 * dt);
    Some(Engagement { time_s: end as f64 * dt, energy_j, slip_acceleration })
}

/// The values, where a missing sample has the last known value.
fn filled(v: &[f64]) -> Vec<f64> {
    let mut last = v.iter().copied().find(|x| x.is_finite()).unwrap_or(0.0);
    v.iter()
        .map(|x| {
            if x.is_finite() {
                last = *x;
            }
            last
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gap::free::tests::recording;

    /// The flywheel slows down from 150 rad/s at 40 rad/s² and the disc speeds up from 50 rad/s at 60 rad/s²: the slip of 100 rad/s is gone after one second, and the balance gives
    /// the torque.
    #[test]
    fn an_engagement_is_timed_and_its_energy_is_that_of_the_torque_over_the_slip() {
        let vehicle = Vehicle::paper();
        let d = &vehicle.driveline;
        let meets = |t: f64| [150.0 - 40.0 * t.min(1.0), 50.0 + 60.0 * t.min(1.0)];
        let r = recording(150, meets, 30.0);
        let found = |r: &Recording| engagement(&Track::new(r), &(0..150), None, &vehicle);
        let e = found(&r).unwrap();
        // The time ends when the slip is below 1.5 rad/s.
        assert!((e.time_s - 0.99).abs() < 1e-9 && (e.slip_acceleration + 100.0).abs() < 1e-6, "{e:?}");
        // (8a): the torque of the engine, and that which the flywheel gives up as it slows down.
        let torque = |t: f64| clutch_torque(d, 30.0, 150.0 - 40.0 * t, -40.0);
        let expected: f64 = (0..99).map(|k| 0.01 * k as f64).map(|t| torque(t) * (100.0 - 100.0 * t) * 0.01).sum();
        assert!(expected > 1000.0 && (e.energy_j / expected - 1.0).abs() < 1e-3, "{} {expected}", e.energy_j);
        // The torque of a transducer takes precedence, and a lost sample has the value of the one before.
        let mut with = Recording { t_fc: Some(vec![20.0; 150]), ..r.clone() };
        with.omega_f[50] = f64::NAN;
        let measured = found(&with).unwrap().energy_j;
        assert!((measured - 20.0 * (50.0 + 0.5 + 0.4 * 0.01)).abs() < 0.2, "{measured}");
        // There are no figures if the slip is too small at the beginning, does not end, or ends at once.
        let none = |speeds: &dyn Fn(f64) -> [f64; 2]| found(&recording(150, speeds, 30.0)).is_none();
        assert!(none(&|_| [100.0, 86.0]) && none(&|_| [100.0, 50.0]) && none(&|t| [100.0, (50.0 + 400.0 * t).min(100.0)]));
        assert!(!none(&|t| [100.0, (84.0 + 40.0 * t).min(100.0)]));
    }

    #[test]
    fn what_is_closed_counts_from_the_floor() {
        let of = |channel: Channel, before: f64, after: f64, noise: f64| HeldOut {
            recording: String::new(),
            channel,
            before,
            after,
            noise,
            engagement: [None; 3],
        };
        let all = [of(Channel::OmegaF, 4.0, 2.0, 0.2), of(Channel::TFc, 99.0, 99.0, 9.0), of(Channel::OmegaC, 2.0, 1.0, 0.4)];
        let closed = Closed::of(&all);
        let expected = Closed { before: 3.0, after: 1.5, noise: 0.3, sensors: 0.3 };
        for (a, b) in [
            (closed.before, expected.before),
            (closed.after, expected.after),
            (closed.noise, expected.noise),
            (closed.sensors, expected.sensors),
        ] {
            assert!((a - b).abs() < 1e-12);
        }
        let fraction = |before: f64, after: f64, noise: f64| Closed { before, after, noise, sensors: 0.1 }.fraction();
        for (before, after, noise, expected) in [
            (3.0, 1.5, 1.0, 0.75),
            (3.0, 1.0, 1.0, 1.0),
            (3.0, 0.5, 1.0, 1.0),
            (3.0, 4.0, 1.0, -0.5),
            // A gap below the floor is counted from the noise of the sensors.
            (1.0, 0.55, 1.0, 0.5),
            (0.1, 0.05, 1.0, 0.0),
        ] {
            assert!((fraction(before, after, noise) - expected).abs() < 1e-12, "{before} {after} {noise}");
        }
        assert!(Closed { before: 1.0, after: 0.0, noise: 1.0, sensors: 0.1 }.is_below_floor());
        assert!(!Closed { before: 1.01, after: 0.0, noise: 1.0, sensors: 0.1 }.is_below_floor());
        assert_eq!(Closed::of(&[]).before, 0.0);
    }

    #[test]
    fn a_gap_is_the_root_mean_square_of_what_is_there() {
        assert_eq!(filled(&[f64::NAN, 2.0, f64::NAN, 3.0]), [2.0, 2.0, 2.0, 3.0]);
        let vehicle = Vehicle::paper();
        let mut r = recording(100, |_| [100.0, 0.0], 10.0);
        r.omega_f[3] = f64::NAN;
        let mut p = prepare(&r, &vehicle);
        p.stretches = vec![2..5, 10..11];
        let value = |v: &[f64]| Free { value: [v.to_vec(), Vec::new(), Vec::new(), Vec::new(), Vec::new()], ..Free::default() };
        let rms = p.rms(Channel::OmegaF, &[value(&[99.0, 0.0, 102.0]), value(&[100.0])]);
        assert!((rms - (5.0_f64 / 3.0).sqrt()).abs() < 1e-12, "{rms}");
    }
}
