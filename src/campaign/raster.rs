//! What an export put between the samples: rows that repeat a sample, or lie on the straight line to the next one.
//!
//! Tools write channels of any rate in one raster, held or interpolated. Rows made that way are no measurements: they would count as samples without noise. Real samples have
//! noise, so that nearly each differs from the one before; in a raster n times as fast only every n-th row does, and between interpolated ones only every n-th row is a bend.
//! Rows with such an event come by a Bernoulli process: with one rate in any row, or with one on a lattice of n rows and another, next to none, beside it. Where the lattice is
//! likelier by [`SURE_NATS`], only its rows are samples. It begins anew with each event, so a raster that drifts against its source, or loses rows, is one all the same.

use super::channels::{Channel, Lasting};
use super::doubt::quantum;
use super::pick::Signal;
use super::span::Track;

/// Longest lattice, rows.
const LONGEST: usize = 100;

/// Nats by which a lattice has to be likelier than rows that are samples: the odds of e³⁰ that recordings are what they seem are beyond doubt either way.
const SURE_NATS: f64 = 30.0;

/// Share of the events that may lie beside the lattice.
const BESIDE: f64 = 0.05;

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
    let of_speeds: Vec<Raster> = tracks.iter().filter(speed).filter_map(|t| raster(&t.signal)).collect();
    let mut said: Vec<(String, Vec<String>)> = Vec::new();
    for signal in tracks.iter_mut().filter(|t| t.lasting() != Lasting::Slow).map(|t| &mut t.signal) {
        let known = of_speeds.iter().find(|r| r.is_sample.len() == signal.values.len() && r.holds(signal)).cloned();
        let Some(raster) = known.or_else(|| if of_speeds.is_empty() { None } else { raster(signal) }) else { continue };
        let mut count = 0;
        for (v, is_sample) in signal.values.iter_mut().zip(&raster.is_sample) {
            count += usize::from(!is_sample && !v.is_nan());
            *v = if *is_sample { *v } else { f64::NAN };
        }
        let between = match raster.between {
            Between::Repeats => "repeat it",
            Between::Lines => "are interpolated",
        };
        let text = format!("one row in {} is a sample, those between {between} and are left out ({count} of each channel)", raster.every);
        match said.iter_mut().find(|(t, _)| *t == text) {
            Some((_, labels)) => labels.push(signal.label.clone()),
            None => said.push((text, vec![signal.label.clone()])),
        }
    }
    said.into_iter().map(|(text, labels)| format!("{}: {text}", labels.join(", "))).collect()
}

impl Raster {
    /// Whether nothing happens to a signal beside its samples.
    fn holds(&self, signal: &Signal) -> bool {
        let events = events(signal, self.between);
        let beside = events.iter().filter(|&&row| !self.is_sample[row]).count();
        beside as f64 <= BESIDE * events.len() as f64
    }
}

/// The likeliest raster that is faster than its source; none if every row may be a sample.
fn raster(signal: &Signal) -> Option<Raster> {
    let of = |between: Between| {
        let events = events(signal, between);
        let best = (2..=LONGEST).map(|every| (lead(&events, every), every)).max_by(|a, b| a.0.total_cmp(&b.0))?;
        (best.0 > SURE_NATS).then_some((best.0, between, best.1, events))
    };
    let likelier = |a: &(f64, Between, usize, Vec<usize>), b: &(f64, Between, usize, Vec<usize>)| a.0.total_cmp(&b.0);
    let (_, between, every, events) = [Between::Repeats, Between::Lines].into_iter().filter_map(of).max_by(likelier)?;
    let mut is_sample = vec![false; signal.values.len()];
    let ends = events.iter().skip(1).copied().chain([is_sample.len()]);
    for (from, to) in events.iter().copied().zip(ends) {
        (from..to).step_by(every).for_each(|row| is_sample[row] = true);
    }
    // Before the first event the lattice goes back from it.
    let mut row = events[0];
    while row >= every {
        row -= every;
        is_sample[row] = true;
    }
    Some(Raster { between, every, is_sample })
}

/// Rows that differ from the one before, or bends.
fn events(signal: &Signal, between: Between) -> Vec<usize> {
    let (t, v) = (&signal.time, &signal.values);
    match between {
        Between::Repeats => (1..v.len()).filter(|&k| v[k] != v[k - 1] && !v[k].is_nan() && !v[k - 1].is_nan()).collect(),
        Between::Lines => {
            let most = v.iter().filter(|v| v.is_finite()).fold(0.0, |m: f64, v| m.max(v.abs()));
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

/// Nats by which events on a lattice of so many rows are likelier than events in any row, each with the rates that suit it best; −∞ if too many lie beside it.
fn lead(events: &[usize], every: usize) -> f64 {
    let (Some(first), Some(last)) = (events.first(), events.last()) else { return f64::NEG_INFINITY };
    let rows = (last - first) as f64;
    let (mut on, mut passed, mut beside) = (0.0, 0.0, 0.0);
    for distance in events.windows(2).map(|w| w[1] - w[0]) {
        passed += ((distance - 1) / every) as f64;
        *(if distance % every == 0 { &mut on } else { &mut beside }) += 1.0;
    }
    if beside > BESIDE * (on + beside) {
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
    use std::rc::Rc;

    /// A launch with noise of 0.1 rad/s in steps of `step`, at 100 Hz.
    fn sampled(step: f64) -> Vec<f64> {
        let noise =
            |k: u32| (0..4).map(|i| f64::from((4 * k + i).wrapping_mul(2_654_435_761) >> 12) / 1_048_576.0 - 0.5).sum::<f64>() * 0.17;
        let speed = |k: u32| (0.6 * f64::from(k) - 40.0).clamp(0.0, 90.0) + noise(k);
        (0..400).map(|k| (speed(k) / step).round() * step).collect()
    }

    fn signal(values: Vec<f64>, step_s: f64) -> Signal {
        let time = Rc::new((0..values.len()).map(|k| step_s * k as f64).collect());
        Signal { channel: Channel::OmegaF, label: "omega_f".to_owned(), time, values }
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
            assert_eq!(raster(&signal(sampled(step), 0.01)), None, "steps of {step} rad/s");
        }
        // A ramp without noise, in steps that it passes at even and at uneven times.
        let ramp = |pace: f64| signal((0..400).map(|k| (pace * f64::from(k)).floor()).collect(), 0.01);
        for pace in [0.7, 0.61, 1.3] {
            assert_eq!(raster(&ramp(pace)), None, "{pace}");
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
                    let found = raster(&signal(rows, 0.01 / every as f64)).unwrap_or_else(|| panic!("{step} {every} {between:?}"));
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
        let found = raster(&signal(rows.clone(), 0.005)).unwrap();
        assert_eq!((found.between, found.every), (Between::Repeats, 2));
        let kept: Vec<f64> = rows.iter().zip(&found.is_sample).filter(|(_, is)| **is).map(|(v, _)| *v).collect();
        assert!(kept.len().abs_diff(397) <= 5, "{}", kept.len());
    }
}
