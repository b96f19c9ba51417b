//! A recording as the inference takes it: real samples of every channel, and the inputs between them.
//!
//! Nothing is resampled. Rows are the stamps at which something was recorded; a channel that has no sample there is NaN. An input is held from one sample to
//! the next. A logger that is slower than the control unit misses commands in between: such an interval is cut into ticks along which the input
//! goes from one sample to the next, as a command that changes at every tick would. A slow control unit misses nothing ([`Recording::held`]).
//!
//! Channels may have clocks of their own, as messages of a bus do: their rows come in bursts, and an observation holds a burst.

use super::unknown_clutch::UnknownClutch;
use crate::campaign::Recording;
use std::borrow::Cow;
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
    /// Stamps of the samples of the torque report, s.
    pub report_time: Vec<f64>,
    /// Torque as it was reported, N·m, sample by sample: what the ticks hold is what the engine is believed to have given.
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
    /// First row of each observation, and one past the last row: samples are averaged over the rows between.
    first_rows: Vec<usize>,
    /// Observation that holds each row.
    observation_of_row: Vec<usize>,
    /// Torque report and command.
    inputs: [Input; 2],
    /// Typical interval of the speeds, s.
    speed_interval: f64,
    /// Whether channels have clocks of their own.
    several_clocks: bool,
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
            first_rows,
            observation_of_row,
            inputs: [report, command],
            speed_interval: if several_clocks { step } else { mean_interval(&r.time) },
            several_clocks,
            held: r.held,
            position_free,
            unknown_clutch: None,
        }
    }

    /// Takes this for the engine's torque in N·m, sample by sample, instead of what was reported.
    pub fn believe(&mut self, torque: &[f64]) {
        let report = &self.inputs[0];
        for row in 0..self.rows() {
            for k in self.tick_of_row[row]..self.tick_of_row[row + 1] {
                self.ticks[k].t_e = report.at(torque, &self.time, row, self.ticks[k].time, self.held);
            }
        }
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

    /// Observation that holds `row`.
    pub fn observation_of(&self, row: usize) -> usize {
        self.observation_of_row[row]
    }

    /// Whether the rows of an observation are spread over it, so that one step may stand for them all. Those of a burst lie at its beginning.
    pub fn averages(&self) -> bool {
        self.observations() < self.rows() && !self.several_clocks
    }

    /// Typical interval of the observations, s.
    pub fn pace(&self) -> f64 {
        self.interval() * self.rows() as f64 / self.observations() as f64
    }

    /// Samples of this speed that an observation has, typically.
    pub fn samples_per_observation(&self, speed: Channel) -> usize {
        let samples = self.measured[speed as usize].iter().filter(|v| v.is_finite()).count();
        ((samples as f64 / self.observations() as f64).round() as usize).max(1)
    }

    /// Samples of the torque report in observation `k`; at least the one that is held.
    pub fn reports_in(&self, k: usize) -> usize {
        self.inputs[0].own_in(self.rows_of(k)).max(1)
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

    /// A speed at `row`, from its first two samples from there on, and its variance in units of a sample's; none if the first comes as late as the second follows it: a sensor
    /// below its threshold says nothing.
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

    /// Stamps of the logger's clock: those of the flywheel speed where channels have clocks of their own.
    fn clock(&self) -> Cow<'_, [f64]> {
        let speed = &self.measured[Channel::OmegaF as usize];
        if !self.several_clocks {
            return Cow::Borrowed(&self.time);
        }
        self.time.iter().zip(speed).filter(|(_, v)| v.is_finite()).map(|(t, _)| *t).collect()
    }

    /// Standard deviation of the stamps around a uniform grid, s.
    pub fn unevenness(&self) -> f64 {
        let clock = self.clock();
        let (first, interval) = (clock.first().copied().unwrap_or(0.0), mean_interval(&clock));
        let off = |(k, t): (usize, &f64)| (t - first - k as f64 * interval).powi(2);
        (clock.iter().enumerate().map(off).sum::<f64>() / clock.len().max(1) as f64).sqrt()
    }

    /// Whether stamps are off a uniform grid by more than the digits they are written with.
    pub fn jitters(&self) -> bool {
        let clock = self.clock();
        let interval = mean_interval(&clock);
        let off = |w: &[f64]| ((w[1] - w[0]) / interval).fract().min(1.0 - ((w[1] - w[0]) / interval).fract()) > 0.015;
        let many = clock.windows(2).filter(|w| off(w)).count();
        5 * many > clock.len()
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

/// Typical interval of these stamps, s.
fn mean_interval(time: &[f64]) -> f64 {
    let span = time.last().zip(time.first()).map_or(0.0, |(b, a)| b - a);
    span / (time.len().max(2) - 1) as f64
}

/// Whether channels have clocks of their own: there are far more rows than the faster speed has samples.
fn has_several_clocks(r: &Recording) -> bool {
    let samples = |v: &[f64]| v.iter().filter(|x| x.is_finite()).count();
    2 * r.time.len() > 3 * samples(&r.omega_f).max(samples(&r.omega_c))
}

/// First row of each observation, and one past the last row. Rows of one clock are counted; those of several clocks belong to the observation that began less than
/// half a step of the speeds short of its length ago.
fn first_rows(time: &[f64], step: f64, clocks: bool) -> Vec<usize> {
    let rows = time.len();
    let mut firsts: Vec<usize> = if clocks {
        let length = OBSERVATION_S.max(step) - 0.5 * step.min(OBSERVATION_S);
        let mut begin = f64::NEG_INFINITY;
        let begins = |row: &usize| {
            let new = time[*row] - begin >= length;
            begin = if new { time[*row] } else { begin };
            new
        };
        (0..rows).filter(begins).collect()
    } else {
        let each = ((OBSERVATION_S / step).round() as usize).max(1);
        // Rows at the end that fill no observation are part of the last one.
        (0..(rows / each).max(1)).map(|k| k * each).collect()
    };
    firsts.push(rows);
    firsts
}

/// An input at the rows of a recording.
#[derive(Clone, Debug)]
struct Input {
    /// Rows at which it has samples; every row without.
    own: Option<Vec<usize>>,
    /// Sample that holds in each row.
    held: Vec<usize>,
    /// Typical interval of its samples, s.
    interval: f64,
}

impl Input {
    fn new(own: Option<&[usize]>, time: &[f64], step: f64) -> Self {
        let Some(own) = own.filter(|own| !own.is_empty()) else { return Self { own: None, held: Vec::new(), interval: step } };
        let held = (0..time.len()).map(|row| own.partition_point(|o| *o <= row).saturating_sub(1)).collect();
        let stamps: Vec<f64> = own.iter().map(|&row| time[row]).collect();
        Self { own: Some(own.to_vec()), held, interval: mean_interval(&stamps) }
    }

    /// Rows at which it has samples.
    fn own_rows(&self, rows: usize) -> Box<dyn Iterator<Item = usize> + '_> {
        match &self.own {
            Some(own) => Box::new(own.iter().copied()),
            None => Box::new(0..rows),
        }
    }

    /// How many of them lie in these rows.
    fn own_in(&self, rows: Range<usize>) -> usize {
        self.own.as_ref().map_or(rows.len(), |own| own.partition_point(|o| *o < rows.end) - own.partition_point(|o| *o < rows.start))
    }

    /// Sample that holds in `row`.
    fn sample(&self, row: usize) -> usize {
        if self.own.is_some() { self.held[row] } else { row }
    }

    /// Row of a sample.
    fn row(&self, sample: usize) -> usize {
        self.own.as_ref().map_or(sample, |own| own[sample])
    }

    /// Value at a time after `row` and before the next one, from the values of the samples: that of the last sample if it holds, else on the way to the next one.
    fn at(&self, values: &[f64], time: &[f64], row: usize, t: f64, held: bool) -> f64 {
        let sample = self.sample(row);
        let (Some(a), next) = (values.get(sample), values.get(sample + 1)) else { return 0.0 };
        let Some(b) = next.filter(|_| !held && misses(self.interval)) else { return *a };
        let (from, to) = (time[self.row(sample)], time[self.row(sample + 1)]);
        a + (t - from) / (to - from) * (b - a)
    }
}

/// Ticks between rows, and the first tick of each row.
fn ticks(r: &Recording, step: f64, [report, command]: [&Input; 2]) -> (Vec<Tick>, Vec<usize>) {
    let slow = [report, command].iter().any(|i| misses(i.interval)) && !r.held;
    let rows = r.time.len();
    let of = |input: &Input, values: &[f64]| -> Vec<f64> {
        if values.is_empty() { Vec::new() } else { input.own_rows(rows).map(|row| values[row]).collect() }
    };
    let (reports, commands) = (of(report, &r.t_e), of(command, &r.x_to_cmd));
    let (mut ticks, mut of_row) = (Vec::with_capacity(rows), Vec::with_capacity(rows + 1));
    for k in 0..rows {
        of_row.push(ticks.len());
        let next = (k + 1).min(rows - 1);
        let length = if next > k { r.time[next] - r.time[k] } else { step };
        let count = if slow { (length / CONTROL_INTERVAL_S).round().max(1.0) as usize } else { 1 };
        for part in 0..count {
            let time = r.time[k] + part as f64 / count as f64 * length;
            ticks.push(Tick {
                time,
                t_e: report.at(&reports, &r.time, k, time, r.held),
                x_to: command.at(&commands, &r.time, k, time, r.held),
                theta_h: r.theta_h[k],
            });
        }
    }
    of_row.push(ticks.len());
    (ticks, of_row)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten messages, each with stamps this much after the first one's; the first two hold the speeds, the third the report and the last the command.
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

    /// However close messages follow each other, an observation holds each of them once.
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

    /// Between its own samples, 20 ms apart, a command goes straight; at 10 ms it is held.
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
            believed.believe(&track.reported.iter().map(|t| t + 5.0).collect::<Vec<_>>());
            assert!(track.ticks.iter().zip(&believed.ticks).all(|(a, b)| (b.t_e - a.t_e - 5.0).abs() < 1e-9 && b.x_to == a.x_to));
        }
    }
}
