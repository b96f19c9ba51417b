//! What an export put between the samples: rows that repeat a sample, or lie on the straight line to the next one.
//!
//! Tools write channels of any rate in one raster, held or interpolated. Rows made that way are no measurements: they would count as samples without noise. Real samples have
//! noise, so that nearly each differs from the one before; in a raster n times as fast only every n-th row does, and between interpolated ones only every n-th row is a bend.
//! Rows with such an event come by a Bernoulli process: with one rate in any row, or with one on a lattice of n rows and another, next to none, beside it. Where the lattice is
//! likelier by [`SURE_NATS`], only its rows are samples. It begins anew with each event, so a raster that drifts against its source, or loses rows, is one all the same.

use super::channels::{Channel, Lasting};
use super::clock::valid;
use super::doubt::quantum;
use super::pick::Signal;
use super::span::Track;

/// Longest lattice, rows.
const LONGEST: usize = 100;

/// Nats by which a lattice has to be likelier than rows that are samples: the odds of e³⁰ that recordings are what they seem are beyond doubt either way.
const SURE_NATS: f64 = 30.0;

/// Share of the events that may lie beside the lattice.
const BESIDE: f64 = 0.05;

/// Share of the lattice's rows in which something has to happen: samples have noise, while a signal without any may bend where it will.
const HAPPENS: f64 = 0.3;

/// What lies between the samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Between {
    Repeats,
    Lines,
}

/// A raster that is faster than its source.
#[derive(Clone, Debug, PartialEq)]
struct Raster {
    between: Between,
    /// Rows from one sample to the next.
    every: usize,
    /// Whether each row is a sample.
    is_sample: Vec<bool>,
}

/// Takes out what lies between the samples of an export, if either speed shows one; the notes say so.
pub(super) fn samples_alone(tracks: &mut [Track]) -> Vec<String> {
    let speed = |t: &&Track| matches!(t.signal.channel, Channel::OmegaF | Channel::OmegaC);
    let of_speeds: Vec<Raster> = tracks.iter().filter(speed).filter_map(|t| raster(&t.signal.time, &t.signal.values)).collect();
    let mut said: Vec<(String, Vec<String>)> = Vec::new();
    for signal in tracks.iter_mut().filter(|t| t.lasting() != Lasting::Slow).map(|t| &mut t.signal) {
        let known = of_speeds.iter().find(|r| r.is_sample.len() == signal.values.len() && r.holds(signal)).cloned();
        let Some(raster) = known.or_else(|| if of_speeds.is_empty() { None } else { raster(&signal.time, &signal.values) }) else {
            continue;
        };
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
    said.into_iter().map(|(text, labels)| format!("{}: {text}", labels.join(", "))).collect()
}

/// Takes out what lies between the samples of a speed's series, if it is an export's; the note says so.
pub(super) fn samples_of(name: &str, time: &[f64], values: &mut [f64]) -> Option<String> {
    let raster = raster(time, values)?;
    values.iter_mut().zip(&raster.is_sample).filter(|(_, is_sample)| !**is_sample).for_each(|(v, _)| *v = f64::NAN);
    Some(format!("{name}: {}", raster.said()))
}

impl Raster {
    /// What it is, in words.
    fn said(&self) -> String {
        let between = match self.between {
            Between::Repeats => "repeat it",
            Between::Lines => "are interpolated",
        };
        format!("one row in {} is a sample, those between {between} and are left out", self.every)
    }

    /// Whether a signal of the same rows has values where this has samples, and nothing happens to it beside them.
    fn holds(&self, signal: &Signal) -> bool {
        let (rows, t, v) = known(&signal.time, &signal.values);
        let events = events(&t, &v, self.between);
        let beside = events.iter().filter(|&&k| !self.is_sample[rows[k]]).count();
        let samples = self.is_sample.iter().filter(|is| **is).count();
        let shared = rows.iter().filter(|&&row| self.is_sample[row]).count();
        beside as f64 <= BESIDE * events.len() as f64 && shared as f64 >= (1.0 - BESIDE) * samples as f64
    }
}

/// Rows that have a value, their times and their values.
fn known(time: &[f64], values: &[f64]) -> (Vec<usize>, Vec<f64>, Vec<f64>) {
    let rows: Vec<usize> = valid(time, values).map(|(row, ..)| row).collect();
    let of = |column: &[f64]| rows.iter().map(|&row| column[row]).collect();
    let (t, v) = (of(time), of(values));
    (rows, t, v)
}

/// The likeliest raster that is faster than its source; none if every row may be a sample.
fn raster(time: &[f64], values: &[f64]) -> Option<Raster> {
    let (rows, t, v) = known(time, values);
    let of = |between: Between| {
        let events = events(&t, &v, between);
        let best = (2..=LONGEST).map(|every| (lead(&events, every), every)).max_by(|a, b| a.0.total_cmp(&b.0))?;
        (best.0 > SURE_NATS).then_some((best.0, between, best.1, events))
    };
    let likelier = |a: &(f64, Between, usize, Vec<usize>), b: &(f64, Between, usize, Vec<usize>)| a.0.total_cmp(&b.0);
    let (_, between, every, events) = [Between::Repeats, Between::Lines].into_iter().filter_map(of).max_by(likelier)?;
    let mut is_sample = vec![false; values.len()];
    let ends = events.iter().skip(1).copied().chain([rows.len()]);
    // Before the first event the lattice goes back from it.
    let before = (1..=events[0] / every).map(|k| events[0] - k * every);
    let after = events.iter().copied().zip(ends).flat_map(|(from, to)| (from..to).step_by(every));
    before.chain(after).for_each(|k| is_sample[rows[k]] = true);
    Some(Raster { between, every, is_sample })
}

/// Samples that differ from the one before, or bends.
fn events(t: &[f64], v: &[f64], between: Between) -> Vec<usize> {
    match between {
        Between::Repeats => (1..v.len()).filter(|&k| v[k] != v[k - 1]).collect(),
        Between::Lines => {
            let most = v.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            // A row and both its neighbours are rounded, be it to single precision.
            let rounding = 1.01 * quantum(v) + 2.5e-7 * most;
            let off = |k: usize| {
                let share = (t[k] - t[k - 1]) / (t[k + 1] - t[k - 1]);
                (v[k] - v[k - 1] - share * (v[k + 1] - v[k - 1])).abs()
            };
            (1..v.len().saturating_sub(1)).filter(|&k| off(k) > rounding).collect()
        }
    }
}

/// Nats by which events on a lattice of so many rows are likelier than events in any row, each with the rates that suit it best; −∞ if too many lie beside it, or it has too few.
fn lead(events: &[usize], every: usize) -> f64 {
    let (Some(first), Some(last)) = (events.first(), events.last()) else { return f64::NEG_INFINITY };
    let rows = (last - first) as f64;
    let (mut on, mut passed, mut beside) = (0.0, 0.0, 0.0);
    for distance in events.windows(2).map(|w| w[1] - w[0]) {
        passed += ((distance - 1) / every) as f64;
        *(if distance % every == 0 { &mut on } else { &mut beside }) += 1.0;
    }
    if beside > BESIDE * (on + beside) || on < HAPPENS * (on + passed) {
        return f64::NEG_INFINITY;
    }
    let bernoulli = |events: f64, rows: f64| {
        let part = |n: f64| if n > 0.0 { n * (n / rows).ln() } else { 0.0 };
        part(events) + part(rows - events)
    };
    bernoulli(on, on + passed) + bernoulli(beside, rows - on - passed) - bernoulli(on + beside, rows) - (LONGEST as f64).ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A launch with noise of 0.1 rad/s in steps of `step`, at 100 Hz.
    fn sampled(step: f64) -> Vec<f64> {
        let noise =
            |k: u32| (0..4).map(|i| f64::from((4 * k + i).wrapping_mul(2_654_435_761) >> 12) / 1_048_576.0 - 0.5).sum::<f64>() * 0.17;
        let speed = |k: u32| (0.6 * f64::from(k) - 40.0).clamp(0.0, 90.0) + noise(k);
        (0..400).map(|k| (speed(k) / step).round() * step).collect()
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
        // Rows of other channels between, in which this one has no value.
        let sparse: Vec<f64> = sampled(0.025).chunks(2).flat_map(|two| [two[0], two[1], f64::NAN]).collect();
        assert_eq!(raster_of(&sparse, 0.005), None);
        // Lines without noise, with a bend every half a second.
        let lines = |k: usize| [0.0, 30.0, 35.0, 90.0, 90.0, 80.0, 120.0, 0.0, 0.0][k / 50] + 0.1 * (k % 50) as f64;
        assert_eq!(raster_of(&(0..450).map(lines).collect::<Vec<_>>(), 0.01), None);
        // A ramp without noise, in steps that it passes at even and at uneven times.
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

    /// A source that is a little faster than half the raster: now and then a sample has one row alone.
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
