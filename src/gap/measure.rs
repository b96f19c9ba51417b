//! How far the simulation is from the car: free replays of a recording, before and after, and engagement figures.
//!
//! A free replay starts from the first sample and is driven by recorded torque and position alone; its errors are what an
//! engineer sees who plays the recording through the FMU.

use super::predict::{Follow, Prediction, predict};
use super::series::{Channel, Series};
use crate::campaign::Recording;
use crate::effects::Parameters;
use crate::report::{Overlay, OverlayChannel};
use crate::vehicle::Vehicle;

/// Gap of one channel of one recording.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldOut {
    /// Recording.
    pub recording: String,
    /// Channel.
    pub channel: Channel,
    /// Root mean square of real − before.
    pub before: f64,
    /// Root mean square of real − after.
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
    /// Slip acceleration just before, rad/s².
    pub slip_acceleration: f64,
}

/// A car: its numbers and its effects.
pub type Car<'a> = (&'a Vehicle, &'a Parameters);

/// Unit of a channel.
pub fn unit(channel: Channel) -> &'static str {
    match channel {
        Channel::OmegaF | Channel::OmegaC => "rad/s",
        Channel::XTo => "mm",
        Channel::TFc => "N.m",
        Channel::ThetaC => "degC",
    }
}

/// Free replay of a recording through a car.
pub fn free_replay(series: &Series, car: Car, theta_shift: [f64; 2]) -> Prediction {
    predict(series, car.0, car.1, theta_shift, Follow::Open)
}

/// Root mean square of the differences.
pub fn rms(a: &[f64], b: &[f64]) -> f64 {
    (a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / a.len().max(1) as f64).sqrt()
}

/// Gap of both speeds on recordings that took no part: mean over channels, rad/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closed {
    /// Of the nominal plant.
    pub before: f64,
    /// Of the retuned plant.
    pub after: f64,
    /// Of a perfect one.
    pub noise: f64,
}

impl Closed {
    /// Sums up held-out recordings.
    pub fn of(held_out: &[HeldOut]) -> Self {
        let speeds: Vec<&HeldOut> = held_out.iter().filter(|h| matches!(h.channel, Channel::OmegaF | Channel::OmegaC)).collect();
        let mean = |get: fn(&HeldOut) -> f64| speeds.iter().map(|h| get(h)).sum::<f64>() / speeds.len().max(1) as f64;
        Self { before: mean(|h| h.before), after: mean(|h| h.after), noise: mean(|h| h.noise) }
    }

    /// Share of the gap that is gone; zero where there was none.
    pub fn fraction(&self) -> f64 {
        if self.before > self.noise { ((self.before - self.after) / (self.before - self.noise)).min(1.0) } else { 0.0 }
    }
}

/// Gaps of every channel that the recording has.
pub fn evaluate(recording: &Recording, before: Car, after: Car) -> Vec<HeldOut> {
    let series = Series::native(recording);
    let (b, a) = (free_replay(&series, before, [0.0; 2]), free_replay(&series, after, [0.0; 2]));
    let figures = [engagement(&series, None, before.0), engagement(&series, Some(&b), before.0), engagement(&series, Some(&a), after.0)];
    let present = Channel::ALL.into_iter().filter(|c| !series.measured[*c as usize].is_empty());
    present
        .map(|channel| {
            let k = channel as usize;
            HeldOut {
                recording: recording.name.clone(),
                channel,
                before: rms(&series.measured[k], &b.value[k]),
                after: rms(&series.measured[k], &a.value[k]),
                noise: series.noise[k],
                engagement: figures,
            }
        })
        .collect()
}

/// Curves of a recording for the report.
pub fn overlay(recording: &Recording, held_out: bool, before: Car, after: Car, theta_shift: [f64; 2]) -> Overlay {
    let series = Series::native(recording);
    let (b, a) = (free_replay(&series, before, [0.0; 2]), free_replay(&series, after, theta_shift));
    let channels = Channel::ALL
        .into_iter()
        .filter(|c| !series.measured[*c as usize].is_empty())
        .map(|c| OverlayChannel {
            column: c.column(),
            unit: unit(c),
            real: series.measured[c as usize].clone(),
            before: b.value[c as usize].clone(),
            after: a.value[c as usize].clone(),
        })
        .collect();
    Overlay { recording: recording.name.clone(), manoeuvre: recording.manoeuvre.clone(), held_out, dt: series.dt, channels }
}

/// Slip in rad/s under which a clutch counts as engaged.
const ENGAGED_SLIP: f64 = 1.5;

/// Time over which slip acceleration and engine acceleration are taken, s.
const SLOPE_S: f64 = 0.1;

/// Figures of the first engagement, measured (`replay` none) or replayed; none if the slip does not begin or does not end.
///
/// The measured clutch torque is the transducer's; without one, the engine balance (8a) gives it.
fn engagement(series: &Series, replay: Option<&Prediction>, vehicle: &Vehicle) -> Option<Engagement> {
    let of = |c: Channel| replay.map_or(series.measured[c as usize].as_slice(), |p| p.value[c as usize].as_slice());
    let (omega_f, omega_c) = (of(Channel::OmegaF), of(Channel::OmegaC));
    let slip: Vec<f64> = omega_f.iter().zip(omega_c).map(|(f, c)| f - c).collect();
    if slip.first().is_none_or(|s| *s < 10.0 * ENGAGED_SLIP) {
        return None;
    }
    let end = slip.iter().position(|s| *s < ENGAGED_SLIP)?;
    let reach = ((SLOPE_S / series.dt).round() as usize).max(1);
    if end < 2 * reach {
        return None;
    }
    let d = &vehicle.driveline;
    let slope = |v: &[f64], k: usize| {
        let (a, b) = (k.saturating_sub(reach / 2), (k + reach / 2 + 1).min(v.len() - 1));
        (v[b] - v[a]) / ((b - a) as f64 * series.dt)
    };
    let torque = of(Channel::TFc);
    let at = |k: usize| if torque.is_empty() { series.t_e[k] - d.b_f * omega_f[k] - d.J_f * slope(omega_f, k) } else { torque[k] };
    let energy_j = (0..end).map(|k| at(k) * slip[k] * series.dt).sum();
    let slip_acceleration = (slip[end] - slip[end - reach]) / (reach as f64 * series.dt);
    Some(Engagement { time_s: end as f64 * series.dt, energy_j, slip_acceleration })
}
