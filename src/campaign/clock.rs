//! Clocks: that time runs forward, how far samples lie apart, and where some are missing.
//!
//! A channel's *spacing* is the median distance between its valid samples, refined by the mean of those that are no gap. A
//! *gap* is a distance of more than 1.5 spacings; what is missing in it is the distance less one spacing. Judging each channel
//! by its own valid samples treats alike a slow channel with empty cells in between, rows that were lost, and invalid samples.

use super::error::Defect;

/// A distance of more spacings than this is a gap.
const GAP: f64 = 1.5;

/// That every time is a number and greater than the one before; else the defect and its sample.
pub(crate) fn check(time: &[f64]) -> Result<(), (Defect, usize)> {
    if let Some(i) = time.iter().position(|t| !t.is_finite()) {
        return Err((Defect::ClockInvalid, i));
    }
    match time.windows(2).position(|w| w[1] <= w[0]) {
        None => Ok(()),
        Some(i) if time[i + 1] == time[i] => Err((Defect::ClockRepeats(time[i]), i + 1)),
        Some(i) => Err((Defect::ClockBack { from: time[i], to: time[i + 1] }, i + 1)),
    }
}

/// How the valid samples of a channel lie in time.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Spacing {
    /// Distance between samples where none is missing, s; 0 for a single sample.
    pub step: f64,
    /// Time of the first valid sample, s.
    pub first: f64,
    /// Time of the last valid sample, s.
    pub last: f64,
    /// Number of valid samples.
    pub count: usize,
    /// Where samples are missing.
    pub gaps: Vec<Gap>,
}

/// A stretch without valid samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Gap {
    /// Time of the valid sample before it, s.
    pub from: f64,
    /// Time of the valid sample after it, s.
    pub to: f64,
    /// Index of the sample after `from`, which is missing or, if its row is missing too, the sample at `to`.
    pub sample: usize,
}

impl Gap {
    /// How long nothing was measured, s.
    pub fn missing_s(&self, step: f64) -> f64 {
        self.to - self.from - step
    }
}

/// The valid samples as index, time and value.
pub(crate) fn valid<'a>(time: &'a [f64], values: &'a [f64]) -> impl Iterator<Item = (usize, f64, f64)> + 'a {
    time.iter().zip(values).enumerate().filter(|(_, (_, v))| !v.is_nan()).map(|(i, (&t, &v))| (i, t, v))
}

/// The spacing of a channel; `None` without a valid sample.
pub(crate) fn spacing(time: &[f64], values: &[f64]) -> Option<Spacing> {
    let mut distances = Vec::with_capacity(time.len());
    let mut points = valid(time, values);
    let (_, first, _) = points.next()?;
    let mut last = first;
    for (_, t, _) in points {
        distances.push(t - last);
        last = t;
    }
    if distances.is_empty() {
        return Some(Spacing { step: 0.0, first, last, count: 1, gaps: Vec::new() });
    }
    let count = distances.len() + 1;
    let middle = distances.len() / 2;
    let median = *distances.select_nth_unstable_by(middle, f64::total_cmp).1;
    let near: Vec<f64> = distances.into_iter().filter(|d| *d <= GAP * median).collect();
    let step = near.iter().sum::<f64>() / near.len() as f64;
    Some(Spacing { step, first, last, count, gaps: gaps(time, values, step) })
}

fn gaps(time: &[f64], values: &[f64], step: f64) -> Vec<Gap> {
    let mut gaps = Vec::new();
    let mut before: Option<(usize, f64)> = None;
    for (i, t, _) in valid(time, values) {
        if let Some((at, from)) = before
            && t - from > GAP * step
        {
            gaps.push(Gap { from, to: t, sample: at + 1 });
        }
        before = Some((i, t));
    }
    gaps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_must_run_forward() {
        assert_eq!(check(&[0.0, 0.1, 0.2]), Ok(()));
        assert_eq!(check(&[0.0, 0.1, 0.1]), Err((Defect::ClockRepeats(0.1), 2)));
        assert_eq!(check(&[0.0, 0.2, 0.1]), Err((Defect::ClockBack { from: 0.2, to: 0.1 }, 2)));
        assert_eq!(check(&[0.0, f64::NAN]), Err((Defect::ClockInvalid, 1)));
    }

    #[test]
    fn invalid_samples_and_lost_rows_are_gaps() {
        let time: Vec<f64> = [0, 1, 2, 3, 4, 5, 9, 10].iter().map(|&i| f64::from(i) * 0.01).collect();
        let mut values = vec![1.0; 8];
        values[2] = f64::NAN;
        let s = spacing(&time, &values).unwrap();
        assert!((s.step - 0.01).abs() < 1e-12);
        assert_eq!(s.count, 7);
        assert_eq!(s.gaps.iter().map(|g| g.sample).collect::<Vec<_>>(), [2, 6]);
        assert!((s.gaps[0].missing_s(s.step) - 0.01).abs() < 1e-12);
        assert!((s.gaps[1].missing_s(s.step) - 0.03).abs() < 1e-12);
    }

    #[test]
    fn a_slow_channel_with_empty_cells_has_no_gap() {
        let time: Vec<f64> = (0..100).map(|i| f64::from(i) * 0.01).collect();
        let values: Vec<f64> = (0..100).map(|i| if i % 10 == 3 { 1.0 } else { f64::NAN }).collect();
        let s = spacing(&time, &values).unwrap();
        assert!((s.step - 0.1).abs() < 1e-12);
        assert!(s.gaps.is_empty());
        assert!(spacing(&time, &[f64::NAN; 100]).is_none());
    }
}
