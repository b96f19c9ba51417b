//! The rows of a recording: the union of the stamps at which its channels have samples.
//!
//! The housing air adds no rows, because it changes too slowly. Nothing is interpolated. In a row without a sample of its own, a sensor has no value
//! (NaN) and an input has the value that it holds.

use super::clock::valid;
use super::pick::Signal;
use std::rc::Rc;

/// Stamps closer than this are taken as the same instant, s: clocks may be written with rounded digits, or in another unit.
pub(crate) const SAME_S: f64 = 1e-6;

/// The stamps, s, from `start` to `end` at which any of the channels has a valid sample.
pub(crate) fn rows<'a>(signals: impl Iterator<Item = &'a Signal>, start: f64, end: f64) -> Vec<f64> {
    let mut clocks: Vec<(&Rc<Vec<f64>>, Vec<bool>)> = Vec::new();
    for signal in signals {
        let known = clocks.iter().position(|(time, _)| Rc::ptr_eq(time, &signal.time));
        let at = known.unwrap_or_else(|| {
            clocks.push((&signal.time, vec![false; signal.time.len()]));
            clocks.len() - 1
        });
        clocks[at].1.iter_mut().zip(&signal.values).for_each(|(any, v)| *any |= !v.is_nan());
    }
    clocks.into_iter().fold(Vec::new(), |rows, (time, any)| {
        let within = time.iter().zip(any).filter(|(t, any)| *any && **t >= start - SAME_S && **t <= end + SAME_S);
        merge(rows, within.map(|(t, _)| *t))
    })
}

/// Merges two increasing lists of stamps.
fn merge(first: Vec<f64>, second: impl Iterator<Item = f64>) -> Vec<f64> {
    if first.is_empty() {
        return second.collect();
    }
    let mut out = Vec::with_capacity(first.len());
    let mut add = |t: f64| {
        if out.last().is_none_or(|last| t - last > SAME_S) {
            out.push(t);
        }
    };
    let mut second = second.peekable();
    for t in first {
        while let Some(earlier) = second.next_if(|s| *s < t) {
            add(earlier);
        }
        add(t);
    }
    second.for_each(&mut add);
    out
}

/// A sensor's samples in the rows at their stamps; NaN in all other rows.
pub(crate) fn sensed(signal: Signal, rows: &[f64]) -> Vec<f64> {
    if is_clock(&signal, rows) {
        return signal.values;
    }
    let mut samples = valid(&signal.time, &signal.values).map(|(_, t, v)| (t, v)).peekable();
    let sample = |&row: &f64| {
        while samples.next_if(|(t, _)| *t < row - SAME_S).is_some() {}
        samples.next_if(|(t, _)| *t <= row + SAME_S).map_or(f64::NAN, |(_, v)| v)
    };
    rows.iter().map(sample).collect()
}

/// Whether the rows are the signal's own clock, stamp by stamp.
fn is_clock(signal: &Signal, rows: &[f64]) -> bool {
    *signal.time == rows
}

/// An input's value in every row: that of its last valid sample or, in front of the first one, that of the first.
pub(crate) fn held(signal: &Signal, rows: &[f64]) -> Vec<f64> {
    let mut samples = valid(&signal.time, &signal.values).map(|(_, t, v)| (t, v)).peekable();
    let mut now = samples.peek().map_or(f64::NAN, |(_, v)| *v);
    let value = |&row: &f64| {
        while let Some((_, v)) = samples.next_if(|(t, _)| *t <= row + SAME_S) {
            now = v;
        }
        now
    };
    rows.iter().map(value).collect()
}

/// Rows at which an input has a valid sample; `None` if it has one in at least three quarters of the rows, so that the others count as lost.
pub(crate) fn own_rows(signal: &Signal, rows: &[f64]) -> Option<Vec<usize>> {
    let mut samples = valid(&signal.time, &signal.values).map(|(_, t, _)| t).peekable();
    let mut is_own = |row: f64| {
        while samples.next_if(|t| *t < row - SAME_S).is_some() {}
        samples.peek().is_some_and(|t| *t <= row + SAME_S)
    };
    let own: Vec<usize> = (0..rows.len()).filter(|&k| is_own(rows[k])).collect();
    (4 * own.len() < 3 * rows.len()).then_some(own)
}

#[cfg(test)]
mod tests {
    use super::super::channels::Channel;
    use super::*;

    fn signal(time: &[f64], values: &[f64]) -> Signal {
        Signal { channel: Channel::OmegaF, label: String::new(), time: Rc::new(time.to_vec()), values: values.to_vec() }
    }

    #[test]
    fn rows_are_the_union_and_rounded_stamps_are_one() {
        let a = signal(&[0.0, 0.1, 0.2, 0.3], &[1.0, 2.0, f64::NAN, 4.0]);
        let b = signal(&[0.05, 0.1 + 1e-9, 0.15], &[5.0, 6.0, 7.0]);
        let rows = rows([&a, &b].into_iter(), 0.0, 0.3);
        assert_eq!(rows, [0.0, 0.05, 0.1, 0.15, 0.3]);
        let sensed = sensed(b.clone(), &rows);
        assert_eq!(sensed[1..4], [5.0, 6.0, 7.0]);
        assert!(sensed[0].is_nan() && sensed[4].is_nan());
        assert_eq!(held(&a, &rows), [1.0, 1.0, 2.0, 2.0, 4.0]);
        assert_eq!(held(&b, &rows), [5.0, 5.0, 6.0, 7.0, 7.0]);
        assert_eq!([own_rows(&a, &rows), own_rows(&b, &rows)], [vec![0, 2, 4], vec![1, 2, 3]].map(Some));
        let c = signal(&[0.0, 0.05, 0.1, 0.3], &[1.0; 4]);
        assert_eq!(own_rows(&c, &rows), None);
    }

    /// Equal numbers of stamps between equal ends do not make two clocks the same.
    #[test]
    fn a_sample_stands_in_the_row_of_its_own_stamp() {
        let other = signal(&[0.0, 0.12, 0.2 + 1e-9, 0.3], &[1.0, 2.0, 3.0, 4.0]);
        let found = sensed(other, &[0.0, 0.1, 0.2, 0.3]);
        assert!(found[1].is_nan() && [found[0], found[2], found[3]] == [1.0, 3.0, 4.0], "{found:?}");
    }
}
