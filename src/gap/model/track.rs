//! A recording as the inference uses it: the actual samples of every channel, and the inputs between them.
//!
//! Nothing is resampled. Rows are the stamps at which something was recorded; a channel that has no sample there is NaN. An input is held from one sample to the next or, where
//! samples are taken at uneven times, changes gradually before the next one ([`Track::sampled_loosely`]). A logger that is slower than the control unit misses commands in between:
//! the interval between two samples is divided into ticks along which the input is interpolated linearly, like a command that changes at every tick. A recording may state how fast
//! its control unit is ([`Recording::control_interval_s`]).
//!
//! Channels may have separate clocks, like messages on a bus. Their rows then come in bursts, and an observation holds whole bursts.

use super::clock::{Input, Tick, control_interval, first_rows, has_several_clocks, mean_interval, misses, ticks};
use super::unknown_clutch::UnknownClutch;
use crate::campaign::Recording;
use std::borrow::Cow;
use std::ops::Range;

/// Channels that a recording may hold, in the order of [`Track::measured`].
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

/// A recording, prepared for inference.
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
    /// Stamps of the samples of the torque report, s.
    pub report_time: Vec<f64>,
    /// Torque as reported, N·m, sample by sample. The ticks hold the torque that the engine is believed to have given instead.
    pub reported: Vec<f64>,
    /// Index of the first tick of each row, followed by the number of ticks.
    pub tick_of_row: Vec<usize>,
    /// Measured values, by [`Channel`]; empty where the channel is missing, NaN where it has no sample.
    pub measured: [Vec<f64>; 5],
    /// Whether the driver brakes, row by row.
    pub brake: Vec<bool>,
    /// Temperatures at the start: disc, body, °C.
    pub theta_0: [f64; 2],
    /// Their standard deviations, K.
    pub theta_0_sigma: [f64; 2],
    /// Angle by which the disc has fallen behind the flywheel at the start, rad.
    pub slip_angle_0: f64,
    /// First row of each observation, followed by the number of rows. Samples are averaged over the rows of an observation.
    first_rows: Vec<usize>,
    /// Observation to which each row belongs.
    observation_of_row: Vec<usize>,
    /// Sampling of torque report and command.
    inputs: [Input; 2],
    /// Typical interval of the speeds, s.
    speed_interval: f64,
    /// Whether channels have separate clocks.
    several_clocks: bool,
    /// Share of an interval, at its end, in which an input may have stepped; 0 for a logger that samples synchronously with the control unit. See [`Self::sampled_loosely`].
    spread: f64,
    /// Interval at which the control unit is taken to compute, s.
    pub control_interval: f64,
    /// Whether no position was recorded. Bench channels are then not used either.
    pub position_free: bool,
    /// Replacement for the clutch model where no position was recorded, once it has been determined ([`unknown_clutch::find`](super::unknown_clutch::find)).
    pub unknown_clutch: Option<UnknownClutch>,
}

impl Track {
    /// Creates the track of a recording.
    pub fn new(r: &Recording) -> Self {
        let position_free = r.x_to_cmd.is_empty();
        let optional = |v: &Option<Vec<f64>>| v.clone().filter(|_| !position_free).unwrap_or_default();
        let rows = r.time.len();
        let step = 1.0 / r.sample_rate_hz;
        let several_clocks = has_several_clocks(r);
        let [report, command] = r.input_rows.each_ref().map(|own| Input::new(own.as_deref(), &r.time, step));
        let reported: Vec<f64> = report.own_rows(rows).map(|row| r.t_e[row]).collect();
        let report_time = report.own_rows(rows).map(|row| r.time[row]).collect();
        let first_rows = first_rows(&r.time, step, several_clocks);
        let observation_of_row = first_rows.windows(2).enumerate().flat_map(|(k, w)| std::iter::repeat_n(k, w[1] - w[0])).collect();
        let (ticks, tick_of_row) = ticks(r, step, [&report, &command]);
        Self {
            name: r.name.clone(),
            manoeuvre: r.manoeuvre.clone(),
            time: r.time.clone(),
            ticks,
            report_time,
            reported,
            tick_of_row,
            measured: [r.omega_f.clone(), r.omega_c.clone(), optional(&r.x_to), optional(&r.t_fc), optional(&r.theta_c)],
            brake: r.brake.clone().unwrap_or_else(|| vec![false; r.time.len()]),
            theta_0: [r.theta_c0, r.theta_b0],
            theta_0_sigma: r.theta_0_sigma,
            slip_angle_0: r.slip_angle_0,
            first_rows,
            observation_of_row,
            inputs: [report, command],
            speed_interval: if several_clocks { step } else { mean_interval(&r.time) },
            several_clocks,
            spread: 0.0,
            control_interval: control_interval(r),
            position_free,
            unknown_clutch: None,
        }
    }

    /// Uses this engine torque in N·m, sample by sample, instead of the reported one.
    pub fn set_engine_torque(&mut self, torque: &[f64]) {
        self.between_samples(0, torque).into_iter().zip(&mut self.ticks).for_each(|(t_e, tick)| tick.t_e = t_e);
    }

    /// Treats the samples as taken at uneven times, apart from an error of the stamps with the standard deviation `stamps` in s. Does nothing if the stamps are even.
    ///
    /// If the times of the samples, with the standard deviation σ, are uniformly distributed over √12 σ, a step of the control unit is seen late by at most that much. If this is a
    /// whole interval, the step may have happened at any time since the last sample.
    pub fn sampled_loosely(&mut self, stamps: f64) {
        if !self.jitters() {
            return;
        }
        self.spread = self.share_of_interval((self.unevenness().powi(2) - stamps.powi(2)).max(0.0).sqrt());
        let commands: Vec<f64> = self.inputs[1].own_rows(self.rows()).map(|row| self.ticks[self.tick_of_row[row]].x_to).collect();
        self.between_samples(1, &commands).into_iter().zip(&mut self.ticks).for_each(|(x_to, tick)| tick.x_to = x_to);
    }

    /// Share of an interval, at most 1, over which uniformly distributed times with this standard deviation in s spread.
    fn share_of_interval(&self, sigma: f64) -> f64 {
        (12f64.sqrt() * sigma / self.speed_interval).min(1.0)
    }

    /// Share of an interval, at its end, in which an input may have stepped, whether the samples or only their stamps are uneven; 0 where the stamps are even.
    pub fn unevenness_of_steps(&self) -> f64 {
        if self.jitters() { self.share_of_interval(self.unevenness()) } else { 0.0 }
    }

    /// Values of an input, tick by tick, computed from its samples.
    fn between_samples(&self, input: usize, values: &[f64]) -> Vec<f64> {
        let of_row = |row: usize| {
            let ticks = self.tick_of_row[row]..self.tick_of_row[row + 1];
            ticks.map(move |k| {
                self.inputs[input].at(values, &self.time, row, self.ticks[k].time..self.tick_end(k), self.control_interval, self.spread)
            })
        };
        (0..self.rows()).flat_map(of_row).collect()
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.time.len()
    }

    /// Number of observations.
    pub fn observations(&self) -> usize {
        self.first_rows.len() - 1
    }

    /// Rows of observation `k`.
    pub fn rows_of(&self, k: usize) -> Range<usize> {
        self.first_rows[k]..self.first_rows[k + 1]
    }

    /// Observation to which `row` belongs.
    pub fn observation_of(&self, row: usize) -> usize {
        self.observation_of_row[row]
    }

    /// Whether observations average several rows that are spread over their interval, so that one step can replace them. The rows of a burst lie at the beginning of their
    /// observation instead.
    pub fn averages(&self) -> bool {
        self.observations() < self.rows() && !self.several_clocks
    }

    /// Whether samples of both speeds share one time stamp, instead of each having that of its own message.
    pub fn has_one_clock(&self) -> bool {
        !self.several_clocks
    }

    /// Typical interval of the observations, s.
    pub fn observation_interval(&self) -> f64 {
        self.interval() * self.rows() as f64 / self.observations() as f64
    }

    /// Typical number of samples of this speed per observation, at least 1.
    pub fn samples_per_observation(&self, speed: Channel) -> usize {
        let samples = self.measured[speed as usize].iter().filter(|v| v.is_finite()).count();
        ((samples as f64 / self.observations() as f64).round() as usize).max(1)
    }

    /// Number of samples of the torque report in observation `k`, at least 1 for the one that is held.
    pub fn reports_in(&self, k: usize) -> usize {
        self.inputs[0].own_in(self.rows_of(k)).max(1)
    }

    /// Mean of a measured channel over observation `k`, and the number of its samples; NaN if there is none.
    pub fn mean(&self, channel: Channel, k: usize) -> (f64, usize) {
        let v = &self.measured[channel as usize];
        if v.is_empty() {
            return (f64::NAN, 0);
        }
        let (sum, count) = self.rows_of(k).fold((0.0, 0), |(s, n), row| if v[row].is_nan() { (s, n) } else { (s + v[row], n + 1) });
        (sum / count as f64, count)
    }

    /// A speed at `row`, extrapolated from its first two samples from there on, and its variance in units of one sample's. `None` if the first sample is as far from `row` as the
    /// second is from the first: the sensor may be below its threshold, where it shows nothing.
    pub fn speed_at(&self, speed: Channel, row: usize) -> Option<(f64, f64)> {
        let v = &self.measured[speed as usize];
        let mut known = (row..self.rows()).filter(|&k| v[k].is_finite());
        let first = known.next()?;
        if first == row {
            return Some((v[row], 1.0));
        }
        let second = known.next()?;
        let share = (self.time[first] - self.time[row]) / (self.time[second] - self.time[first]);
        (share < 1.0 - 1e-6).then(|| (v[first] - share * (v[second] - v[first]), (1.0 + share).powi(2) + share.powi(2)))
    }

    /// Typical interval of the rows, s.
    pub fn interval(&self) -> f64 {
        mean_interval(&self.time)
    }

    /// Typical interval of the speeds, s.
    pub fn speed_interval(&self) -> f64 {
        self.speed_interval
    }

    /// Whether the logger is slower than the control unit, and misses commands.
    pub fn misses_commands(&self) -> bool {
        misses(self.speed_interval, self.control_interval)
    }

    /// Stamps of the logger's clock: those of the flywheel speed where channels have separate clocks.
    fn clock(&self) -> Cow<'_, [f64]> {
        let speed = &self.measured[Channel::OmegaF as usize];
        if !self.several_clocks {
            return Cow::Borrowed(&self.time);
        }
        self.time.iter().zip(speed).filter(|(_, v)| v.is_finite()).map(|(t, _)| *t).collect()
    }

    /// Standard deviation of the stamps around the uniform grid that is nearest to them by least squares, s.
    pub fn unevenness(&self) -> f64 {
        let clock = self.clock();
        let n = clock.len() as f64;
        if clock.len() < 2 {
            return 0.0;
        }
        // Sample numbers, counted from the middle one.
        let number = |k: usize| k as f64 - 0.5 * (n - 1.0);
        let mean = clock.iter().sum::<f64>() / n;
        let products: f64 = clock.iter().enumerate().map(|(k, t)| number(k) * (t - mean)).sum();
        let interval = products / (n * (n * n - 1.0) / 12.0);
        let off = |(k, t): (usize, &f64)| (t - mean - interval * number(k)).powi(2);
        (clock.iter().enumerate().map(off).sum::<f64>() / n).sqrt()
    }

    /// Whether the stamps are off a uniform grid by more than the rounding of their digits: more than a fifth of the intervals differ from a whole multiple of the mean interval by
    /// more than 1.5 % of it.
    pub fn jitters(&self) -> bool {
        let clock = self.clock();
        let interval = mean_interval(&clock);
        let off = |w: &[f64]| ((w[1] - w[0]) / interval).fract().min(1.0 - ((w[1] - w[0]) / interval).fract()) > 0.015;
        let many = clock.windows(2).filter(|w| off(w)).count();
        5 * many > clock.len()
    }

    /// Time from 0 to one interval after the last row, s.
    pub fn duration(&self) -> f64 {
        self.time.last().copied().unwrap_or(0.0) + self.interval()
    }

    /// Mean inputs over these ticks, with report and command read at stamps that many seconds later.
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

    /// Mean of a held input over the interval of these ticks, shifted by `later` s.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten bursts of four messages, whose stamps follow the beginning of a burst by `after`. The first two messages hold the speeds, the third the report and the last the command.
    fn bursts(step: f64, after: [f64; 4]) -> Recording {
        let time: Vec<f64> = (0..40).map(|k| step * f64::from(k / 4) + after[k as usize % 4]).collect();
        let own = |message: usize| move |k: usize| k % 4 == message;
        let sensed = |message: usize| (0..40).map(|k| if own(message)(k) { k as f64 } else { f64::NAN }).collect::<Vec<_>>();
        let held = |message: usize| (0..40_usize).map(|k| (k + 3 - message) / 4).map(|n| 10.0 * n as f64).collect::<Vec<_>>();
        let rows = |message: usize| Some((0..40).filter(|k| own(message)(*k)).collect::<Vec<usize>>());
        Recording {
            sample_rate_hz: 1.0 / step,
            omega_f: sensed(0),
            omega_c: sensed(1),
            t_e: held(2),
            x_to_cmd: held(3),
            theta_h: vec![25.0; 40],
            input_rows: [rows(2), rows(3)],
            time,
            ..Recording::default()
        }
    }

    /// However closely messages follow each other, an observation holds each of them once.
    #[test]
    fn an_observation_holds_a_burst_of_messages() {
        for (step, after) in
            [(0.01, [0.0, 0.0003, 0.0006, 0.0009]), (0.01, [0.0, 0.003, 0.0045, 0.0049]), (0.02, [0.0, 0.0003, 0.0006, 0.0009])]
        {
            let track = Track::new(&bursts(step, after));
            assert_eq!(track.observations(), 10, "{step} {after:?}");
            for k in 0..10 {
                assert_eq!((track.rows_of(k), track.observation_of(4 * k + 3), track.reports_in(k)), (4 * k..4 * k + 4, k, 1));
                assert_eq!(track.mean(Channel::OmegaC, k), (4.0 * k as f64 + 1.0, 1));
            }
            assert!(!track.averages() && !track.jitters() && track.unevenness() < 1e-9, "bursts are no jitter");
            assert!((track.speed_interval() - step).abs() < 1e-12 && track.samples_per_observation(Channel::OmegaF) == 1);
            // The disc speed at the first row is on the line through its first two samples.
            let (late, share) = (after[1], after[1] / step);
            let (value, variance) = track.speed_at(Channel::OmegaC, 0).unwrap();
            assert!(
                (value - (1.0 - 4.0 * share)).abs() < 1e-9 && (variance - ((1.0 + share).powi(2) + share.powi(2))).abs() < 1e-9,
                "{late}"
            );
            assert_eq!((track.speed_at(Channel::OmegaF, 0), track.speed_at(Channel::OmegaF, 37)), (Some((0.0, 1.0)), None));
            assert_eq!(track.reported, (0..10).map(|n| 10.0 * f64::from(n)).collect::<Vec<_>>());
        }
        // Speeds at 1 kHz, each with a clock of its own, make observations of ten samples.
        let time: Vec<f64> = (0..400).map(|k| 0.001 * f64::from(k / 2) + 0.0004 * f64::from(k % 2)).collect();
        let sensed = |side: i32| (0..400).map(|k| if k % 2 == side { 1.0 } else { f64::NAN }).collect::<Vec<_>>();
        let fast = Recording {
            sample_rate_hz: 1e3,
            omega_f: sensed(0),
            omega_c: sensed(1),
            t_e: vec![0.0; 400],
            theta_h: vec![25.0; 400],
            time,
            ..Recording::default()
        };
        let track = Track::new(&fast);
        assert!((0..20).all(|k| track.rows_of(k) == (20 * k..20 * k + 20)), "{:?}", track.rows_of(1));
    }

    /// If samples are taken at any time within an interval, a command between two of them is halfway to the next one on average. If instead the stamps are inexact, the command is
    /// held.
    #[test]
    fn a_command_between_uneven_samples_came_at_any_time() {
        // Off by 4.5 ms to either side, which spreads over a whole interval (√12 · 4.5 > 10), or by half a millisecond.
        for (off, share) in [(0.0045, 1.0), (0.0005, 12f64.sqrt() * 0.05)] {
            let time: Vec<f64> = (0..401).map(|k| 0.01 * f64::from(k) + if k % 2 == 1 { off } else { -off }).collect();
            let x_to_cmd: Vec<f64> = (0..401).map(|k| f64::from(k * 53 % 97)).collect();
            let held = Recording {
                sample_rate_hz: 100.0,
                omega_f: vec![0.0; 401],
                omega_c: vec![0.0; 401],
                t_e: x_to_cmd.clone(),
                theta_h: vec![25.0; 401],
                x_to_cmd: x_to_cmd.clone(),
                time,
                ..Recording::default()
            };
            let (held, mut loose) = (Track::new(&held), Track::new(&held));
            assert!(held.jitters() && (held.unevenness() - off).abs() < 1e-4, "{}", held.unevenness());
            loose.sampled_loosely(0.0);
            loose.set_engine_torque(&x_to_cmd);
            for k in 0..400 {
                let mean = x_to_cmd[k] + 0.5 * share * (x_to_cmd[k + 1] - x_to_cmd[k]);
                assert!((loose.ticks[k].x_to - mean).abs() < 0.3 && (loose.ticks[k].t_e - mean).abs() < 0.3, "{k}: {:?}", loose.ticks[k]);
                assert_eq!(held.ticks[k].x_to, x_to_cmd[k]);
            }
            loose = held.clone();
            loose.sampled_loosely(off + 0.001);
            assert!((0..400).all(|k| loose.ticks[k].x_to == x_to_cmd[k]));
        }
    }

    /// Between its samples, an input is interpolated linearly if they are 20 ms apart, and held if they are 10 ms apart.
    #[test]
    fn an_input_goes_from_its_own_sample_to_the_next() {
        for (step, way) in [(0.02, true), (0.01, false)] {
            let track = Track::new(&bursts(step, [0.0, 0.0003, 0.0006, 0.0009]));
            for tick in track.ticks.iter().filter(|t| t.time > 0.001 && t.time < 9.0 * step) {
                let of = |after: f64| {
                    let n = (tick.time - after) / step + 1e-9;
                    10.0 * if way { n } else { n.floor() }
                };
                assert!((tick.x_to - of(0.0009)).abs() < 1e-6 && (tick.t_e - of(0.0006)).abs() < 1e-6, "{tick:?}");
            }
            let mut believed = track.clone();
            believed.set_engine_torque(&track.reported.iter().map(|t| t + 5.0).collect::<Vec<_>>());
            assert!(track.ticks.iter().zip(&believed.ticks).all(|(a, b)| (b.t_e - a.t_e - 5.0).abs() < 1e-9 && b.x_to == a.x_to));
        }
    }
}
