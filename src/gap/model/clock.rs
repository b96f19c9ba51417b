//! Clocks of a recording: which rows form an observation, at which rows an input has samples, and its value between them.

use crate::campaign::Recording;
use std::ops::Range;

/// Interval at which control units usually compute, s. Inputs held between the samples of a faster logger are exact; a slower logger misses commands between its samples.
pub const CONTROL_INTERVAL_S: f64 = 0.01;

/// Interval of the observations, s: faster samples are averaged over it, and so are their predictions.
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

/// Number of control intervals up to which a sampling interval counts as one step of the control unit; a longer one contains two or more.
pub const LONGEST_TICK: f64 = 1.5;

/// Whether a logger with this sampling interval is slower than a control unit with the interval `control`, and therefore misses commands; both in s.
pub fn misses(interval: f64, control: f64) -> bool {
    interval > LONGEST_TICK * control
}

/// Interval at which a recording's control unit is taken to compute, s.
pub fn control_interval(r: &Recording) -> f64 {
    r.control_interval_s.unwrap_or(CONTROL_INTERVAL_S)
}

/// Mean interval of these stamps, s.
pub fn mean_interval(time: &[f64]) -> f64 {
    let span = time.last().zip(time.first()).map_or(0.0, |(b, a)| b - a);
    span / (time.len().max(2) - 1) as f64
}

/// Whether channels have separate clocks: there are more than 1.5 times as many rows as samples of the faster speed.
pub fn has_several_clocks(r: &Recording) -> bool {
    let samples = |v: &[f64]| v.iter().filter(|x| x.is_finite()).count();
    2 * r.time.len() > 3 * samples(&r.omega_f).max(samples(&r.omega_c))
}

/// First row of each observation, followed by the number of rows. With one clock, every observation has the same number of rows. With several, a new observation begins at the
/// first row that lies an observation's length, less half a step of the speeds (at most half of [`OBSERVATION_S`]), after the beginning of the last one.
pub fn first_rows(time: &[f64], step: f64, clocks: bool) -> Vec<usize> {
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

/// Sampling of an input at the rows of a recording.
#[derive(Clone, Debug)]
pub struct Input {
    /// Rows at which it has samples; `None` if it has one in every row.
    own: Option<Vec<usize>>,
    /// Index of the sample that is held in each row.
    held: Vec<usize>,
    /// Typical interval of its samples, s.
    interval: f64,
}

impl Input {
    /// An input with samples at the rows `own` of these stamps or, without `own`, at every row, `step` s apart.
    pub fn new(own: Option<&[usize]>, time: &[f64], step: f64) -> Self {
        let Some(own) = own.filter(|own| !own.is_empty()) else { return Self { own: None, held: Vec::new(), interval: step } };
        let held = (0..time.len()).map(|row| own.partition_point(|o| *o <= row).saturating_sub(1)).collect();
        let stamps: Vec<f64> = own.iter().map(|&row| time[row]).collect();
        Self { own: Some(own.to_vec()), held, interval: mean_interval(&stamps) }
    }

    /// Rows at which it has samples.
    pub fn own_rows(&self, rows: usize) -> Box<dyn Iterator<Item = usize> + '_> {
        match &self.own {
            Some(own) => Box::new(own.iter().copied()),
            None => Box::new(0..rows),
        }
    }

    /// Number of samples within these rows.
    pub fn own_in(&self, rows: Range<usize>) -> usize {
        self.own.as_ref().map_or(rows.len(), |own| own.partition_point(|o| *o < rows.end) - own.partition_point(|o| *o < rows.start))
    }

    /// Index of the sample that is held in `row`.
    fn sample(&self, row: usize) -> usize {
        if self.own.is_some() { self.held[row] } else { row }
    }

    /// Row of a sample.
    fn row(&self, sample: usize) -> usize {
        self.own.as_ref().map_or(sample, |own| own[sample])
    }

    /// Value of the input over a tick between `row` and the next row, from the values of its samples. If the control unit steps several times between two samples, the value is
    /// interpolated linearly at the beginning of the tick. Otherwise the last sample is held. If `spread` > 0, the step to the next sample happens at an unknown time within this
    /// share of the interval, at its end, and the value is the mean over these times and over the tick.
    pub fn at(&self, values: &[f64], time: &[f64], row: usize, tick: Range<f64>, control: f64, spread: f64) -> f64 {
        let sample = self.sample(row);
        let (Some(a), Some(b)) = (values.get(sample), values.get(sample + 1)) else { return values.get(sample).copied().unwrap_or(0.0) };
        let (from, to) = (time[self.row(sample)], time[self.row(sample + 1)]);
        let share = if misses(self.interval, control) {
            (tick.start - from) / (to - from)
        } else if spread > 0.0 {
            // Mean over the tick of a ramp that ends at the next sample.
            let spread = spread * (to - from);
            let sum = |t: f64| (t - to + spread).max(0.0).powi(2) / (2.0 * spread);
            (sum(tick.end) - sum(tick.start)) / (tick.end - tick.start)
        } else {
            return *a;
        };
        a + share * (b - a)
    }
}

/// Ticks of a recording, and the index of the first tick of each row, followed by the number of ticks. Rows are divided into control intervals if an input is slower than the
/// control unit.
pub fn ticks(r: &Recording, step: f64, [report, command]: [&Input; 2]) -> (Vec<Tick>, Vec<usize>) {
    let control = control_interval(r);
    let slow = [report, command].iter().any(|i| misses(i.interval, control));
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
        let count = if slow { (length / control).round().max(1.0) as usize } else { 1 };
        for part in 0..count {
            let begin = |part: usize| r.time[k] + part as f64 / count as f64 * length;
            let time = begin(part);
            let value = |input: &Input, values| input.at(values, &r.time, k, time..begin(part + 1), control, 0.0);
            ticks.push(Tick { time, t_e: value(report, &reports), x_to: value(command, &commands), theta_h: r.theta_h[k] });
        }
    }
    of_row.push(ticks.len());
    (ticks, of_row)
}
