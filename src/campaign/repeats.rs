//! Rows in which a logger repeats its source unevenly, because the source is polled or its rate does not divide the logger's.
//!
//! While a speed moves by several quantisation steps from row to row, consecutive readings are seldom equal, whatever their noise. If so many readings are held for more than
//! one row that this is beyond doubt, rows that show nothing new are not samples. A sensor that freezes now and then holds few of its readings, though for long; that is left
//! to the diagnosis. All recordings of a campaign are judged together, because one logger wrote them: those in which too little moves are treated like the others.

use super::clock::valid;
use super::pick::Signal;
use super::raster::{Between, Raster, SURE_NATS, changes, events};

/// Least log-likelihood ratio, in nats, for each speed once both together are sure, and the largest by which a recording may favour samples in every
/// row although its campaign does not: odds of 20 to one that the logger treats all recordings alike.
const LIKELY_NATS: f64 = 3.0;

/// Least change of a speed from row to row, in quantisation steps, for repeated rows to be counted.
const MOVES: f64 = 3.0;

/// Number of readings on either side over which this change is judged.
const AROUND: usize = 5;

/// Number of parts of a speed's range, in each of which its quantisation step counts as constant because that of a tone wheel grows with speed; and
/// the least number of readings from which a step is determined.
const BINS: usize = 10;
const FEWEST: usize = 10;

/// Counts of rows in which the speeds ω_f and ω_c repeat their sources; for several recordings, the sum.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Repeats {
    of: [Repeated; 2],
    /// Rows, with both speeds in motion, in which either one shows a new value, and rows in which both do.
    either: usize,
    both: usize,
}

/// Counts for a speed over the rows in which it moves by several quantisation steps from row to row.
#[derive(Clone, Copy, Debug, Default)]
struct Repeated {
    rows: usize,
    readings: usize,
    /// Readings that are held for more than one row.
    held: usize,
}

/// How the rows of a recording are treated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RowTreatment {
    /// Whether the rows of each speed repeat its source.
    uneven: [bool; 2],
    /// Whether both speeds are updated together.
    together: bool,
}

impl Repeats {
    /// Counts the repeats of two speeds that share their rows.
    pub(super) fn of(speeds: [Option<&Signal>; 2]) -> Self {
        let moving = speeds.map(|s| s.map_or_else(Moving::default, |s| Moving::of(&s.time, &s.values)));
        let [f, c] = moving.each_ref().map(|m| &m.rows);
        let known = || f.iter().zip(c).filter_map(|(f, c)| f.zip(*c));
        let either = known().filter(|(f, c)| *f || *c).count();
        Repeats { of: moving.each_ref().map(|m| m.count), either, both: known().filter(|(f, c)| *f && *c).count() }
    }

    /// The sum with the counts of another recording.
    pub(super) fn with(&self, other: &Self) -> Self {
        let of = std::array::from_fn(|k| {
            let (a, b) = (self.of[k], other.of[k]);
            Repeated { rows: a.rows + b.rows, readings: a.readings + b.readings, held: a.held + b.held }
        });
        Repeats { of, either: self.either + other.either, both: self.both + other.both }
    }

    /// How the rows of this recording are treated, judged by those of `all` recordings.
    pub(super) fn among(&self, all: &Self) -> RowTreatment {
        let nats = all.of.map(|of| of.nats());
        let likely = |k: usize| nats[k] > LIKELY_NATS && self.of[k].nats_at(all.of[k].share()) > -LIKELY_NATS;
        let sure = nats.iter().sum::<f64>() > SURE_NATS;
        let uneven = std::array::from_fn(|k| sure && likely(k));
        RowTreatment { uneven, together: uneven == [true; 2] && all.come_together() }
    }

    /// Whether both speeds are beyond doubt updated together, rather than each at its own times, judged by the share of rows with a new value in which both are new.
    fn come_together(&self) -> bool {
        let [f, c] = self.of.map(|of| of.readings as f64 / of.rows as f64);
        let apart = f * c / (f + c - f * c);
        let together = (1.0 - max_equal_share()) / (1.0 + max_equal_share());
        let one = (self.either - self.both) as f64;
        self.both as f64 * (together / apart).ln() + one * ((1.0 - together) / (1.0 - apart)).ln() > SURE_NATS
    }
}

impl RowTreatment {
    /// Samples of each speed whose rows repeat it.
    pub(super) fn samples(self, speeds: [Option<&Signal>; 2]) -> [Option<Raster>; 2] {
        let mut new = speeds.map(|s| s.map_or_else(Vec::new, |s| changes(&s.time, &s.values, Between::Uneven)));
        if self.together && new[0].len() == new[1].len() {
            let both: Vec<bool> = new[0].iter().zip(&new[1]).map(|(f, c)| *f || *c).collect();
            new = [both.clone(), both];
        }
        std::array::from_fn(
            |k| if self.uneven[k] { samples(&speeds[k]?.time, &speeds[k]?.values, std::mem::take(&mut new[k])) } else { None },
        )
    }
}

/// Samples of a speed whose rows repeat it, judged by this speed only.
pub(super) fn alone(time: &[f64], values: &[f64]) -> Option<Raster> {
    if Moving::of(time, values).count.nats() > SURE_NATS { samples(time, values, changes(time, values, Between::Uneven)) } else { None }
}

/// Rows that show something new are samples; so is the first row, whose sample was taken shortly before it.
fn samples(time: &[f64], values: &[f64], mut new: Vec<bool>) -> Option<Raster> {
    let (first, ..) = valid(time, values).next()?;
    new[first] = true;
    Some(Raster { between: Between::Uneven, every: 1, is_sample: new })
}

/// The counts of a speed in motion, and the same row by row.
#[derive(Clone, Debug, Default)]
struct Moving {
    count: Repeated,
    /// For each row in motion, whether it shows something new; `None` for the others.
    rows: Vec<Option<bool>>,
}

impl Moving {
    fn of(time: &[f64], values: &[f64]) -> Self {
        let rows: Vec<usize> = valid(time, values).map(|(row, ..)| row).collect();
        let read: Vec<(usize, f64)> = events(time, values, Between::Uneven).map(|(number, row)| (number, values[row])).collect();
        let (low, high) = read.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (_, v)| (v.min(low), v.max(high)));
        let bin = |v: f64| (((v - low) / (high - low) * BINS as f64) as usize).min(BINS - 1);
        let mut steps = [(0, f64::INFINITY); BINS];
        for two in read.windows(2) {
            let (count, least) = &mut steps[bin(two[1].1)];
            (*count, *least) = (*count + 1, least.min((two[1].1 - two[0].1).abs()));
        }
        let mut found = Moving { count: Repeated::default(), rows: vec![None; values.len()] };
        for around in read.windows(2 * AROUND + 1) {
            let (first, last, [before, now]) = (around[0], around[2 * AROUND], [around[AROUND - 1].0, around[AROUND].0]);
            let (count, step) = steps[bin(around[AROUND].1)];
            if count >= FEWEST && (last.1 - first.1).abs() > MOVES * step * (last.0 - first.0) as f64 {
                found.count.rows += now - before;
                found.count.readings += 1;
                found.count.held += usize::from(now > before + 1);
                (before + 1..=now).for_each(|number| found.rows[rows[number]] = Some(number == now));
            }
        }
        found
    }
}

impl Repeated {
    /// Share of the readings that are held, by Laplace's rule of succession.
    fn share(&self) -> f64 {
        (self.held as f64 + 1.0) / (self.readings as f64 + 2.0)
    }

    /// Log-likelihood ratio, in nats, of a source that is held against samples in every row; 0 if the latter are likelier.
    fn nats(&self) -> f64 {
        if self.share() > max_equal_share() { self.nats_at(self.share()).max(0.0) } else { 0.0 }
    }

    /// The same log-likelihood ratio for a source of which this share of the readings is held.
    fn nats_at(&self, share: f64) -> f64 {
        self.held as f64 * (share / max_equal_share()).ln()
            + (self.readings - self.held) as f64 * ((1.0 - share) / (1.0 - max_equal_share())).ln()
    }
}

/// Largest probability that a sample of a speed in motion equals the one before: two readings that are m steps q apart and have noise σ are equal
/// with probability q/(2√π σ) exp(−(m q/2σ)²), which is at most this for m = [`MOVES`] and any σ.
fn max_equal_share() -> f64 {
    (-0.5_f64).exp() / (MOVES * (2.0 * std::f64::consts::PI).sqrt())
}

#[cfg(test)]
mod tests {
    use super::super::channels::Channel;
    use super::super::raster::tests::{noise, sampled};
    use super::*;

    /// Neither coarse quantisation steps nor steps that grow with the speed count as repeats.
    #[test]
    fn samples_are_no_uneven_raster() {
        let time_of = |values: &[f64]| (0..values.len()).map(|k| 0.01 * k as f64).collect::<Vec<_>>();
        let repeated = |values: &[f64]| Moving::of(&time_of(values), values).count;
        for step in [1e-4, 0.025, 0.105, 0.3, 0.84] {
            let found = repeated(&sampled(step));
            assert!(found.nats() == 0.0, "steps of {step} rad/s: {found:?}");
        }
        for (pulses, slowest) in [(1e3, 1.0), (1.1e4, 40.0)] {
            let wheel: Vec<f64> = sampled(1e-4).iter().map(|v| pulses / (pulses / (v.max(0.0) + slowest)).round()).collect();
            let found = repeated(&wheel);
            assert!(found.nats() == 0.0, "{pulses}: {found:?}");
        }
    }

    /// For each row, the row in which the logger last read its source: about two of five, at random or because its rate does not divide the logger's.
    fn read_at(random: bool, mut draw: u32) -> Vec<usize> {
        let mut last = 0;
        let mut polled = |k: usize| {
            draw = draw.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            last = if draw >> 24 < 100 { k } else { last };
            last
        };
        (0..ROWS as usize).map(|k| if random { polled(k) } else { ((k as f64 / 2.5).floor() * 2.5).ceil() as usize }).collect()
    }

    const ROWS: u32 = 1600;

    /// Flywheel and disc speed that rise and fall, each as its source was read.
    fn speeds(step: f64, read: [&[usize]; 2]) -> [Signal; 2] {
        let wave = |k: u32, rows: f64| (f64::from(k) / rows).sin();
        let speed = |k: u32, from: u32| 50.0 + 30.0 * wave(k + from, 70.0) + 15.0 * wave(k + from, 23.0) + noise(k + 10_000 * from);
        let time = std::rc::Rc::new((0..ROWS).map(|k| 0.01 * f64::from(k)).collect::<Vec<_>>());
        [(Channel::OmegaF, 0, read[0]), (Channel::OmegaC, 40, read[1])].map(|(channel, from, read)| Signal {
            channel,
            label: String::new(),
            time: time.clone(),
            values: read.iter().map(|k| (speed(*k as u32, from) / step).round() * step).collect(),
        })
    }

    #[test]
    fn samples_of_an_uneven_raster_are_where_either_speed_or_each_changes() {
        for step in [0.001, 0.025, 0.105] {
            for (random, together) in [(false, true), (true, true), (true, false)] {
                let read = [read_at(random, 1), read_at(random, if together { 1 } else { 7 })];
                let both = speeds(step, [&read[0], &read[1]]);
                let [f, c] = both.each_ref().map(Some);
                let own = Repeats::of([f, c]);
                let taken = own.among(&own);
                assert_eq!(taken, RowTreatment { uneven: [true; 2], together }, "{step} {random}: {own:?}");
                for (k, (raster, read)) in taken.samples([f, c]).into_iter().zip(&read).enumerate() {
                    let is_sample = raster.unwrap().is_sample;
                    let samples = (0..ROWS as usize).filter(|k| read[*k] == *k).count();
                    let (there, beside): (Vec<usize>, Vec<usize>) =
                        (0..ROWS as usize).filter(|k| is_sample[*k]).partition(|k| read[*k] == *k);
                    assert!(beside.is_empty(), "{step} {random} {together} {k}: {beside:?}");
                    // Only the other speed shows that a value which has not changed was read again.
                    let least = if together { 0.95 } else { 0.7 };
                    assert!(there.len() as f64 > least * samples as f64, "{step} {random} {together} {k}: {} of {samples}", there.len());
                }
            }
        }
    }

    /// Half a second alone is inconclusive; together with a longer recording by the same logger it is clear.
    #[test]
    fn a_short_recording_is_told_by_the_others() {
        let read = read_at(false, 0);
        let all = speeds(0.025, [&read, &read]);
        let part =
            all.clone().map(|s| Signal { time: std::rc::Rc::new(s.time[60..110].to_vec()), values: s.values[60..110].to_vec(), ..s });
        let of = |s: &[Signal; 2]| Repeats::of(s.each_ref().map(Some));
        let (short, pool) = (of(&part), of(&all).with(&of(&part)));
        assert_eq!(short.among(&short), RowTreatment { uneven: [false; 2], together: false }, "{short:?}");
        assert_eq!(short.among(&pool), RowTreatment { uneven: [true; 2], together: true }, "{pool:?}");
        // Another logger, with a sample in every row.
        let each: Vec<usize> = (0..ROWS as usize).collect();
        let sampled = of(&speeds(0.025, [&each, &each]));
        assert_eq!(sampled.among(&sampled.with(&pool)).uneven, [false; 2], "{sampled:?}");
    }

    /// Twice a second a sensor freezes for a seventh of a second: a quarter of the rows, but few readings.
    #[test]
    fn a_sensor_that_stands_still_now_and_then_is_none_of_the_loggers_doing() {
        let read: Vec<usize> = (0..ROWS as usize).map(|k| if k % 50 < 14 { k / 50 * 50 } else { k }).collect();
        let each: Vec<usize> = (0..ROWS as usize).collect();
        let own = Repeats::of(speeds(0.025, [&read, &each]).each_ref().map(Some));
        let all = (0..30).fold(own, |all, _| all.with(&own));
        assert_eq!(own.among(&all).uneven, [false; 2], "{all:?}");
    }

    #[test]
    fn one_speed_alone_may_come_more_slowly() {
        let (read, each) = (read_at(false, 0), (0..ROWS as usize).collect::<Vec<_>>());
        let both = speeds(0.025, [&each, &read]);
        let own = Repeats::of(both.each_ref().map(Some));
        assert_eq!(own.among(&own), RowTreatment { uneven: [false, true], together: false });
        assert!(alone(&both[0].time, &both[0].values).is_none() && alone(&both[1].time, &both[1].values).is_some());
    }
}
