//! Removes what an export put between the samples: rows that repeat a sample, or that lie on the straight line to the next one.
//!
//! Tools write channels of any rate in one raster, held or interpolated. Rows made that way are no measurements: they would count as samples without
//! noise. Real samples have noise, so that nearly each differs from the one before; in a raster n times as fast only every n-th row does, and among
//! interpolated rows only every n-th one is a bend. Rows with such an event are modelled as a Bernoulli process: either with one rate in all rows, or
//! with one rate on a lattice of every n-th row and another rate, close to 0, beside it. If the lattice is likelier by [`SURE_NATS`], only its rows are
//! samples. It restarts at each event, so that a raster that drifts against its source, or loses rows, is recognised as well.
//!
//! A source that is polled, or whose rate does not divide that of the raster, is repeated unevenly: see [`super::repeats`].

use super::channels::{Channel, Lasting};
use super::clock::valid;
use super::doubt::quantum;
use super::pick::Signal;
use super::repeats::{self, Repeats};
use super::span::Track;
use std::collections::HashMap;

/// Longest period of a lattice, rows.
const LONGEST: usize = 100;

/// Least log-likelihood ratio, in nats, of a lattice against samples in every row: odds of e³⁰ leave no doubt.
pub(super) const SURE_NATS: f64 = 30.0;

/// Largest share of the events that may lie beside the lattice.
const MAX_OFF_LATTICE_SHARE: f64 = 0.05;

/// Least share of the lattice's rows in which an event has to occur: samples have noise, whereas a signal without any may bend anywhere.
const MIN_EVENT_SHARE: f64 = 0.3;

/// Kind of the rows between the samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Between {
    Repeats,
    Lines,
    /// Repeats without a fixed number of rows from one sample to the next.
    Uneven,
}

/// A raster that is faster than its source.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Raster {
    pub(super) between: Between,
    /// Least number of rows from one sample to the next.
    pub(super) every: usize,
    /// Whether each row is a sample.
    pub(super) is_sample: Vec<bool>,
}

/// Sets the values that an export put between the samples to NaN, if either speed shows such rows. Returns the repeats that were counted in the
/// speeds, and notes on what was done. `all` holds the repeats of all recordings of a campaign, once these have been read.
pub(super) fn samples_alone(tracks: &mut [Track], all: Option<&Repeats>) -> (Repeats, Vec<String>) {
    let speeds = [Channel::OmegaF, Channel::OmegaC].map(|c| tracks.iter().find(|t| t.signal.channel == c).map(|t| &t.signal));
    let own = Repeats::of(speeds);
    let uneven = own.among(all.unwrap_or(&own)).samples(speeds);
    let of_speed = |(s, uneven): (Option<&Signal>, Option<Raster>)| {
        let s = s?;
        Some((s.channel, raster(&s.time, &s.values).or(uneven)?))
    };
    let of_speeds: Vec<(Channel, Raster)> = speeds.into_iter().zip(uneven).filter_map(of_speed).collect();
    if of_speeds.is_empty() {
        return (own, Vec::new());
    }
    let mut said: Vec<(String, Vec<String>)> = Vec::new();
    for signal in tracks.iter_mut().filter(|t| t.lasting() != Lasting::Slow).map(|t| &mut t.signal) {
        let suits = |r: &&Raster| r.is_sample.len() == signal.values.len() && r.holds(signal);
        let known = of_speeds.iter().map(|(_, r)| r).find(suits);
        let own = || of_speeds.iter().find(|(c, _)| *c == signal.channel).map(|(_, r)| r);
        let Some(raster) = known.or_else(own).cloned().or_else(|| raster(&signal.time, &signal.values)) else { continue };
        let mut count = 0;
        for (v, is_sample) in signal.values.iter_mut().zip(&raster.is_sample) {
            count += usize::from(!is_sample && !v.is_nan());
            *v = if *is_sample { *v } else { f64::NAN };
        }
        let text = format!("{} ({count} of each channel)", raster.said());
        match said.iter_mut().find(|(t, _)| *t == text) {
            Some((_, labels)) => labels.push(signal.label.clone()),
            None => said.push((text, vec![signal.label.clone()])),
        }
    }
    (own, said.into_iter().map(|(text, labels)| format!("{}: {text}", labels.join(", "))).collect())
}

/// Sets the values that an export put between the samples of a speed to NaN; the note says so.
pub(super) fn samples_of(name: &str, time: &[f64], values: &mut [f64]) -> Option<String> {
    let raster = raster(time, values).or_else(|| repeats::alone(time, values))?;
    values.iter_mut().zip(&raster.is_sample).filter(|(_, is_sample)| !**is_sample).for_each(|(v, _)| *v = f64::NAN);
    Some(format!("{name}: {}", raster.said()))
}

impl Raster {
    /// Describes the raster in words.
    fn said(&self) -> String {
        let between = match self.between {
            Between::Repeats => "repeat it",
            Between::Lines => "are interpolated",
            Between::Uneven => return "rows repeat the sample before them, unevenly, and are left out".to_string(),
        };
        format!("one row in {} is a sample, those between {between} and are left out", self.every)
    }

    /// Whether a signal with the same rows has values at this raster's samples and events nowhere else, except for a share of [`MAX_OFF_LATTICE_SHARE`].
    fn holds(&self, signal: &Signal) -> bool {
        let (mut all, mut beside) = (0, 0);
        for (_, row) in events(&signal.time, &signal.values, self.between) {
            all += 1;
            beside += usize::from(!self.is_sample[row]);
        }
        let samples = || self.is_sample.iter().zip(&signal.values).filter(|(is, _)| **is);
        let lacking = samples().filter(|(_, v)| v.is_nan()).count();
        let few = |part: usize, of: usize| part as f64 <= MAX_OFF_LATTICE_SHARE * of as f64;
        few(beside, all) && few(lacking, samples().count())
    }
}

/// The likeliest raster that is faster than its source; `None` if every row may be a sample.
fn raster(time: &[f64], values: &[f64]) -> Option<Raster> {
    let of = |between: Between| {
        let distances = Distances::of(events(time, values, between).map(|(number, _)| number));
        (2..=LONGEST).map(move |every| (distances.lead(every), between, every)).max_by(|a, b| a.0.total_cmp(&b.0))
    };
    let best = [Between::Repeats, Between::Lines].into_iter().filter_map(of).max_by(|a, b| a.0.total_cmp(&b.0));
    let (_, between, every) = best.filter(|(lead, ..)| *lead > SURE_NATS)?;
    Raster::every(time, values, between, every)
}

impl Raster {
    /// Marks the rows of a lattice that restarts at each event and extends backwards from the first one.
    fn every(time: &[f64], values: &[f64], between: Between, every: usize) -> Option<Self> {
        let new = changes(time, values, between);
        let mut origin = valid(time, values).position(|(row, ..)| new[row])? % every;
        let mut is_sample = vec![false; values.len()];
        for (number, (row, ..)) in valid(time, values).enumerate() {
            if new[row] {
                origin = number;
            }
            is_sample[row] = number >= origin && (number - origin) % every == 0;
        }
        Some(Raster { between, every, is_sample })
    }
}

/// Whether an event occurs in each row.
pub(super) fn changes(time: &[f64], values: &[f64], between: Between) -> Vec<bool> {
    let mut new = vec![false; values.len()];
    events(time, values, between).for_each(|(_, row)| new[row] = true);
    new
}

/// Numbers and rows of the samples with an event: those that differ from the one before, or at which a line bends. A number counts valid samples only.
pub(super) fn events<'a>(time: &'a [f64], values: &'a [f64], between: Between) -> impl Iterator<Item = (usize, usize)> + 'a {
    // The value of a row and those of both its neighbours are rounded, possibly to single precision.
    let rounding = match between {
        Between::Repeats | Between::Uneven => 0.0,
        Between::Lines => 1.01 * quantum(values) + 2.5e-7 * valid(time, values).fold(0.0, |most: f64, (.., v)| most.max(v.abs())),
    };
    let mut before = [None; 2];
    valid(time, values).enumerate().filter_map(move |(number, now)| {
        let [first, middle] = before;
        before = [middle, Some(now)];
        let (_, t_1, v_1) = middle?;
        match between {
            Between::Repeats | Between::Uneven => (now.2 != v_1).then_some((number, now.0)),
            Between::Lines => {
                let (_, t_0, v_0) = first?;
                let off = v_1 - v_0 - (t_1 - t_0) / (now.1 - t_0) * (now.2 - v_0);
                (off.abs() > rounding).then_some((number - 1, middle?.0))
            }
        }
    })
}

/// Histogram of the distances between consecutive events, in samples.
struct Distances(HashMap<usize, usize>);

impl Distances {
    fn of(events: impl Iterator<Item = usize>) -> Self {
        let (mut all, mut last) = (HashMap::new(), None);
        for event in events {
            if let Some(before) = last.replace(event) {
                *all.entry(event - before).or_default() += 1;
            }
        }
        Self(all)
    }

    /// Log-likelihood ratio, in nats, of events on a lattice with this period against events in any row, each with its maximum-likelihood rates, less
    /// ln [`LONGEST`] for the choice of the period; −∞ if too many events lie beside the lattice, or too few on it.
    fn lead(&self, every: usize) -> f64 {
        let (mut rows, mut on, mut passed, mut beside) = (0.0, 0.0, 0.0, 0.0);
        for (&distance, &count) in &self.0 {
            let count = count as f64;
            rows += distance as f64 * count;
            passed += ((distance - 1) / every) as f64 * count;
            *(if distance % every == 0 { &mut on } else { &mut beside }) += count;
        }
        if rows == 0.0 || beside > MAX_OFF_LATTICE_SHARE * (on + beside) || on < MIN_EVENT_SHARE * (on + passed) {
            return f64::NEG_INFINITY;
        }
        let bernoulli = |events: f64, rows: f64| {
            let part = |n: f64| if n > 0.0 { n * (n / rows).ln() } else { 0.0 };
            part(events) + part(rows - events)
        };
        bernoulli(on, on + passed) + bernoulli(beside, rows - on - passed) - bernoulli(on + beside, rows) - (LONGEST as f64).ln()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A launch at 100 Hz with noise of 0.1 rad/s, rounded to steps of `step`.
    pub fn sampled(step: f64) -> Vec<f64> {
        (0..400).map(|k| (((0.6 * f64::from(k) - 40.0).clamp(0.0, 90.0) + noise(k)) / step).round() * step).collect()
    }

    pub fn noise(k: u32) -> f64 {
        (0..4).map(|i| f64::from((4 * k + i).wrapping_mul(2_654_435_761) >> 12) / 1_048_576.0 - 0.5).sum::<f64>() * 0.17
    }

    fn raster_of(values: &[f64], step_s: f64) -> Option<Raster> {
        raster(&(0..values.len()).map(|k| step_s * k as f64).collect::<Vec<_>>(), values)
    }

    fn held(values: &[f64], every: usize) -> Vec<f64> {
        (0..values.len() * every).map(|k| values[k / every]).collect()
    }

    fn interpolated(values: &[f64], every: usize) -> Vec<f64> {
        let at = |k: usize| {
            values[k / every] + (k % every) as f64 / every as f64 * (values[(k / every + 1).min(values.len() - 1)] - values[k / every])
        };
        (0..values.len() * every).map(|k| (at(k) * 1e4).round() * 1e-4).collect()
    }

    #[test]
    fn samples_are_no_raster() {
        for step in [1e-4, 0.025, 0.105, 0.84] {
            assert_eq!(raster_of(&sampled(step), 0.01), None, "steps of {step} rad/s");
        }
        // Rows of other channels in between, in which this channel has no value.
        let sparse: Vec<f64> = sampled(0.025).chunks(2).flat_map(|two| [two[0], two[1], f64::NAN]).collect();
        assert_eq!(raster_of(&sparse, 0.005), None);
        // Lines without noise, with a bend every half second.
        let lines = |k: usize| [0.0, 30.0, 35.0, 90.0, 90.0, 80.0, 120.0, 0.0, 0.0][k / 50] + 0.1 * (k % 50) as f64;
        assert_eq!(raster_of(&(0..450).map(lines).collect::<Vec<_>>(), 0.01), None);
        // A ramp without noise, whose quantisation steps change at even or uneven intervals.
        let ramp = |pace: f64| (0..400).map(|k| (pace * f64::from(k)).floor()).collect::<Vec<_>>();
        for pace in [0.7, 0.61, 1.3] {
            assert_eq!(raster_of(&ramp(pace), 0.01), None, "{pace}");
        }
    }

    #[test]
    fn repeats_and_lines_between_samples_are_told_from_them() {
        for step in [0.001, 0.025, 0.105] {
            let values = sampled(step);
            for every in [2, 5, 10, 50] {
                for (rows, between) in [(held(&values, every), Between::Repeats), (interpolated(&values, every), Between::Lines)] {
                    let mut rows = rows;
                    rows[7 * every + 1] = f64::NAN;
                    let found = raster_of(&rows, 0.01 / every as f64).unwrap_or_else(|| panic!("{step} {every} {between:?}"));
                    assert_eq!((found.between, found.every), (between, every), "{step}");
                    let wrong = found.is_sample.iter().enumerate().filter(|(k, is)| **is != (k % every == 0)).count();
                    assert!(wrong <= 4, "{wrong} of {} rows", found.is_sample.len());
                }
            }
        }
    }

    /// A source that is a little faster than half the raster: now and then a sample occupies a single row.
    #[test]
    fn a_raster_that_drifts_is_one_all_the_same() {
        let values = sampled(0.001);
        let rows: Vec<f64> = (0..790).map(|k| values[(f64::from(k) / 1.99) as usize]).collect();
        let found = raster_of(&rows, 0.005).unwrap();
        assert_eq!((found.between, found.every), (Between::Repeats, 2));
        let kept: Vec<f64> = rows.iter().zip(&found.is_sample).filter(|(_, is)| **is).map(|(v, _)| *v).collect();
        assert!(kept.len().abs_diff(397) <= 5, "{}", kept.len());
    }
}
