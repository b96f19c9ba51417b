//! Clocks: checks that time increases, and determines how far samples lie apart and where some are missing.
//!
//! A channel's *step* is the mean distance between its valid samples, without the distances that are so far above the median that they are gaps. A *gap* is a
//! distance above 1.5 steps plus 3 standard deviations of the stamps' jitter; the time that is missing in it is the distance less one step. Each channel is
//! judged by its own valid samples, so that a slow channel with empty cells in between, lost rows and invalid samples are all treated alike.

use super::error::Defect;

/// A distance of more than this many steps is a gap, if the stamps do not jitter.
const GAP: f64 = 1.5;

/// Allowance for jitter by which a distance may exceed that, in standard deviations of the jitter.
const JITTER: f64 = 3.0;

/// Largest number of distances from which the median is taken; a longer series is thinned out evenly.
const MOST: usize = 200_000;

/// Unit of stamps for which none is stated, if the first one is too large for seconds since 1970: 10¹¹ s is the year 5138. `None` if it is not.
pub(crate) fn since_1970(first: f64) -> Option<&'static str> {
    [("ns", 1e17), ("us", 1e14), ("ms", 1e11)].into_iter().find(|(_, least)| first > *least).map(|(unit, _)| unit)
}

/// Checks that every time is finite and greater than the one before; otherwise returns the defect and the index of its sample.
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

/// Spacing of a channel's valid samples in time.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Spacing {
    /// Mean distance between samples where none is missing, s; 0 for a single sample.
    pub step: f64,
    /// Standard deviation of that distance, from its median absolute deviation, s.
    pub jitter: f64,
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
    /// Index of the sample after `from`: a missing sample or, if its row is missing too, the sample at `to`.
    pub sample: usize,
}

impl Gap {
    /// Time for which nothing was measured, s.
    pub fn missing_s(&self, step: f64) -> f64 {
        self.to - self.from - step
    }
}

/// The valid samples as index, time and value.
pub(crate) fn valid<'a>(time: &'a [f64], values: &'a [f64]) -> impl Iterator<Item = (usize, f64, f64)> + 'a {
    time.iter().zip(values).enumerate().filter(|(_, (_, v))| !v.is_nan()).map(|(i, (&t, &v))| (i, t, v))
}

/// Spacing of a channel; `None` if it has no valid sample.
pub(crate) fn spacing(time: &[f64], values: &[f64]) -> Option<Spacing> {
    let (_, first, _) = valid(time, values).next()?;
    let (mut last, mut count) = (first, 0_usize);
    for (_, t, _) in valid(time, values) {
        (last, count) = (t, count + 1);
    }
    if count == 1 {
        return Some(Spacing { step: 0.0, jitter: 0.0, first, last, count, gaps: Vec::new() });
    }
    let mut some: Vec<f64> = distances(time, values).step_by(count.div_ceil(MOST)).map(|(_, from, to)| to - from).collect();
    let median = middle(&mut some);
    some.iter_mut().for_each(|d| *d = (*d - median).abs());
    // 0.6745 is the median magnitude of a normal distribution with a standard deviation of 1.
    let jitter = middle(&mut some) / 0.6745;
    let longest = GAP * median + JITTER * jitter;
    let near = distances(time, values).map(|(_, from, to)| to - from).filter(|d| *d <= longest);
    let (sum, near) = near.fold((0.0, 0_usize), |(sum, n), d| (sum + d, n + 1));
    let step = sum / near as f64;
    let longest = GAP * step + JITTER * jitter;
    let gaps = distances(time, values).filter(|(_, from, to)| to - from > longest);
    let gaps = gaps.map(|(sample, from, to)| Gap { from, to, sample }).collect();
    Some(Spacing { step, jitter, first, last, count, gaps })
}

/// Consecutive valid samples: index after the earlier one, and both times.
fn distances<'a>(time: &'a [f64], values: &'a [f64]) -> impl Iterator<Item = (usize, f64, f64)> + 'a {
    let mut before: Option<(usize, f64)> = None;
    valid(time, values).filter_map(move |(i, t, _)| before.replace((i, t)).map(|(at, from)| (at + 1, from, t)))
}

/// Median; of an even number of values, the greater of the middle two. Reorders the values.
pub(crate) fn middle(values: &mut [f64]) -> f64 {
    let at = values.len() / 2;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
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
    fn stamps_of_this_century_tell_their_unit() {
        for (first, unit) in [(1.5e9, None), (1.5e12, Some("ms")), (1.5e15, Some("us")), (1.5e18, Some("ns"))] {
            assert_eq!(since_1970(first), unit);
        }
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

    #[test]
    fn jitter_is_no_gap_and_a_lost_frame_is_one() {
        // Stamps that deviate pseudo-randomly by up to 4.5 ms from a raster of 10 ms.
        let offset = |i: u32| (f64::from(i.wrapping_mul(i).wrapping_mul(2_654_435_761) >> 16) / 65536.0 - 0.5) * 9e-3;
        let time: Vec<f64> = (0..500).filter(|i| !(300..305).contains(i)).map(|i| f64::from(i) * 0.01 + offset(i)).collect();
        let s = spacing(&time, &vec![1.0; time.len()]).unwrap();
        assert!((s.step - 0.01).abs() < 3e-4, "{}", s.step);
        assert_eq!(s.gaps.iter().map(|g| g.sample).collect::<Vec<_>>(), [300]);
    }
}
