//! A recording as the inference takes it: real samples of every channel, and the inputs between them.
//!
//! Nothing is resampled. Rows are the stamps at which something was recorded; a channel that has no sample there is NaN. Inputs are held from one row to
//! the next. A logger that is slower than the control unit misses commands in between: such an interval is cut into ticks along which the input
//! goes from one sample to the next, as a command that changes at every tick would. A slow control unit misses nothing ([`Recording::held`]).

use super::unknown_clutch::UnknownClutch;
use crate::campaign::Recording;
use std::ops::Range;

/// Channels that a recording may hold, in the order in which [`Track::measured`] has them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Flywheel speed, rad/s.
    OmegaF,
    /// Disc speed, rad/s.
    OmegaC,
    /// Bearing position, mm.
    XTo,
    /// Clutch torque, N·m.
    TFc,
    /// Disc temperature, °C.
    ThetaC,
}

impl Channel {
    /// All channels.
    pub const ALL: [Self; 5] = [Self::OmegaF, Self::OmegaC, Self::XTo, Self::TFc, Self::ThetaC];

    /// Name of the column in a recording.
    pub fn column(self) -> &'static str {
        match self {
            Self::OmegaF => "omega_f_rad_s",
            Self::OmegaC => "omega_c_rad_s",
            Self::XTo => "x_to_mm",
            Self::TFc => "T_fc_Nm",
            Self::ThetaC => "theta_c_degC",
        }
    }

    /// Unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::OmegaF | Self::OmegaC => "rad/s",
            Self::XTo => "mm",
            Self::TFc => "N.m",
            Self::ThetaC => "degC",
        }
    }
}

/// Interval at which control units compute, s: what a faster logger holds is exact, what a slower one misses lies between its samples.
pub const CONTROL_INTERVAL_S: f64 = 0.01;

/// Interval of the observations, s: faster samples are averaged over it, and so are the predictions of each of them.
pub const OBSERVATION_S: f64 = 0.01;

/// Inputs over one tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tick {
    /// Beginning, s.
    pub time: f64,
    /// Reported torque, N·m.
    pub t_e: f64,
    /// Commanded position, mm.
    pub x_to: f64,
    /// Housing air, °C.
    pub theta_h: f64,
}

/// A recording.
#[derive(Clone, Debug)]
pub struct Track {
    /// Name of the recording.
    pub name: String,
    /// Manoeuvre.
    pub manoeuvre: String,
    /// Stamps of the rows, s.
    pub time: Vec<f64>,
    /// Inputs, tick by tick.
    pub ticks: Vec<Tick>,
    /// Torque as it was reported, N·m, row by row: what the ticks hold is what the engine is believed to have given.
    pub reported: Vec<f64>,
    /// Tick at which each row lies, and one past the last.
    pub tick_of_row: Vec<usize>,
    /// What was measured, by [`Channel`]; empty where the channel is missing, NaN where it has no sample.
    pub measured: [Vec<f64>; 5],
    /// Whether the driver brakes, row by row.
    pub brake: Vec<bool>,
    /// Temperatures at the start: disc, body, °C.
    pub theta_0: [f64; 2],
    /// Their standard deviations, K.
    pub theta_0_sigma: [f64; 2],
    /// Rows that one observation averages.
    pub rows_per_observation: usize,
    /// [`Recording::held`].
    pub held: bool,
    /// Whether no position was recorded. Bench channels then say nothing either.
    pub position_free: bool,
    /// What takes the place of the clutch where no position was recorded, once it has been looked for ([`unknown_clutch::find`](super::unknown_clutch::find)).
    pub unknown_clutch: Option<UnknownClutch>,
}

impl Track {
    /// Takes over a recording.
    pub fn new(r: &Recording) -> Self {
        let position_free = r.x_to_cmd.is_empty();
        let optional = |v: &Option<Vec<f64>>| v.clone().filter(|_| !position_free).unwrap_or_default();
        let interval = 1.0 / r.sample_rate_hz;
        let (ticks, tick_of_row) = ticks(r, interval);
        Self {
            name: r.name.clone(),
            manoeuvre: r.manoeuvre.clone(),
            time: r.time.clone(),
            ticks,
            reported: r.t_e.clone(),
            tick_of_row,
            measured: [r.omega_f.clone(), r.omega_c.clone(), optional(&r.x_to), optional(&r.t_fc), optional(&r.theta_c)],
            brake: r.brake.clone().unwrap_or_else(|| vec![false; r.time.len()]),
            theta_0: [r.theta_c0, r.theta_b0],
            theta_0_sigma: r.theta_0_sigma,
            rows_per_observation: ((OBSERVATION_S / interval).round() as usize).max(1),
            held: r.held,
            position_free,
            unknown_clutch: None,
        }
    }

    /// Takes this for the engine's torque in N·m, row by row, instead of what was reported.
    pub fn believe(&mut self, torque: &[f64]) {
        for row in 0..self.rows() {
            let next = (row + 1).min(self.rows() - 1);
            let length = self.time[next] - self.time[row];
            for k in self.tick_of_row[row]..self.tick_of_row[row + 1] {
                let share = if length > 0.0 && !self.held { (self.ticks[k].time - self.time[row]) / length } else { 0.0 };
                self.ticks[k].t_e = torque[row] + share * (torque[next] - torque[row]);
            }
        }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.time.len()
    }

    /// Number of observations; rows at the end that fill none are part of the last one.
    pub fn observations(&self) -> usize {
        (self.rows() / self.rows_per_observation).max(1)
    }

    /// Rows of observation `k`.
    pub fn rows_of(&self, k: usize) -> Range<usize> {
        let n = self.rows_per_observation;
        let end = if k + 1 == self.observations() { self.rows() } else { (k + 1) * n };
        k * n..end
    }

    /// Observation that holds `row`.
    pub fn observation_of(&self, row: usize) -> usize {
        (row / self.rows_per_observation).min(self.observations() - 1)
    }

    /// Mean of a measured channel over observation `k`, and how many samples it has.
    pub fn mean(&self, channel: Channel, k: usize) -> (f64, usize) {
        let v = &self.measured[channel as usize];
        if v.is_empty() {
            return (f64::NAN, 0);
        }
        let (sum, count) = self.rows_of(k).fold((0.0, 0), |(s, n), row| if v[row].is_nan() { (s, n) } else { (s + v[row], n + 1) });
        (sum / count as f64, count)
    }

    /// Typical interval of the rows, s.
    pub fn interval(&self) -> f64 {
        let span = self.time.last().zip(self.time.first()).map_or(0.0, |(b, a)| b - a);
        span / (self.rows().max(2) - 1) as f64
    }

    /// Standard deviation of the stamps around a uniform grid, s.
    pub fn unevenness(&self) -> f64 {
        let (first, interval) = (self.time.first().copied().unwrap_or(0.0), self.interval());
        let off = |(k, t): (usize, &f64)| (t - first - k as f64 * interval).powi(2);
        (self.time.iter().enumerate().map(off).sum::<f64>() / self.rows().max(1) as f64).sqrt()
    }

    /// Whether stamps are off a uniform grid by more than the digits they are written with.
    pub fn jitters(&self) -> bool {
        let interval = self.interval();
        let off = |w: &[f64]| ((w[1] - w[0]) / interval).fract().min(1.0 - ((w[1] - w[0]) / interval).fract()) > 0.015;
        let many = self.time.windows(2).filter(|w| off(w)).count();
        5 * many > self.rows()
    }

    /// Length, s.
    pub fn duration(&self) -> f64 {
        self.time.last().copied().unwrap_or(0.0) + self.interval()
    }

    /// Mean inputs over these ticks, report and command read that many seconds later than their stamps say.
    pub fn inputs(&self, ticks: Range<usize>, report_later: f64, command_later: f64) -> Tick {
        let mut tick = self.ticks[ticks.start];
        let several = ticks.len() > 1;
        if report_later != 0.0 || several {
            tick.t_e = self.mean_over(&ticks, report_later, |t| t.t_e);
        }
        if command_later != 0.0 || several {
            tick.x_to = self.mean_over(&ticks, command_later, |t| t.x_to);
        }
        tick
    }

    /// End of tick `k`, s.
    pub fn tick_end(&self, k: usize) -> f64 {
        self.ticks.get(k + 1).map_or_else(|| self.duration(), |t| t.time)
    }

    /// Mean of a held input over the interval of these ticks moved by `later`.
    fn mean_over(&self, ticks: &Range<usize>, later: f64, value: impl Fn(&Tick) -> f64) -> f64 {
        let (from, to) = (self.ticks[ticks.start].time + later, self.tick_end(ticks.end - 1) + later);
        let mut at = ticks.start;
        while at > 0 && self.ticks[at].time > from {
            at -= 1;
        }
        while at + 1 < self.ticks.len() && self.ticks[at + 1].time <= from {
            at += 1;
        }
        let (mut sum, mut begin) = (0.0, from);
        loop {
            let end = if at + 1 < self.ticks.len() { self.ticks[at + 1].time.min(to) } else { to };
            sum += value(&self.ticks[at]) * (end - begin);
            if end >= to {
                return sum / (to - from);
            }
            (begin, at) = (end, at + 1);
        }
    }
}

/// Whether a logger of this interval in s is slower than the control unit, and may miss its commands.
pub fn misses(interval: f64) -> bool {
    interval > 1.5 * CONTROL_INTERVAL_S
}

fn ticks(r: &Recording, interval: f64) -> (Vec<Tick>, Vec<usize>) {
    let slow = misses(interval) && !r.held;
    let command = |k: usize| r.x_to_cmd.get(k).copied().unwrap_or(0.0);
    let (mut ticks, mut of_row) = (Vec::with_capacity(r.time.len()), Vec::with_capacity(r.time.len() + 1));
    for k in 0..r.time.len() {
        of_row.push(ticks.len());
        let next = (k + 1).min(r.time.len() - 1);
        let length = if next > k { r.time[next] - r.time[k] } else { interval };
        let count = if slow { (length / CONTROL_INTERVAL_S).round().max(1.0) as usize } else { 1 };
        for part in 0..count {
            let share = part as f64 / count as f64;
            let between = |a: f64, b: f64| a + share * (b - a);
            ticks.push(Tick {
                time: r.time[k] + share * length,
                t_e: between(r.t_e[k], r.t_e[next]),
                x_to: between(command(k), command(next)),
                theta_h: r.theta_h[k],
            });
        }
    }
    of_row.push(ticks.len());
    (ticks, of_row)
}
