//! Scales, ticks and paths of still figures.

use std::fmt::Write as _;

/// A linear scale from values to user units of the drawing.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    /// Value drawn at `a`.
    pub low: f64,
    /// Value drawn at `b`.
    pub high: f64,
    /// Position of `low`, user units.
    pub a: f64,
    /// Position of `high`, user units.
    pub b: f64,
}

impl Scale {
    /// Position of a value.
    pub fn at(&self, value: f64) -> f64 {
        self.a + (value - self.low) / (self.high - self.low) * (self.b - self.a)
    }
}

/// Least and greatest of the finite values, widened a little; (0, 1) if there is none.
pub fn range<'a>(values: impl Iterator<Item = &'a f64>) -> (f64, f64) {
    let (low, high) =
        values.filter(|v| v.is_finite()).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)));
    if low > high {
        return (0.0, 1.0);
    }
    let margin = if high > low { 0.05 * (high - low) } else { 0.5 * high.abs().max(1e-3) };
    (low - margin, high + margin)
}

/// About `count` round values within a range.
pub fn ticks(low: f64, high: f64, count: usize) -> Vec<f64> {
    let raw = (high - low) / count.max(1) as f64;
    if !(raw.is_finite() && raw > 0.0) {
        return Vec::new();
    }
    let power = 10f64.powf(raw.log10().floor());
    let step = power * [1.0, 2.0, 5.0, 10.0].into_iter().find(|m| m * power >= raw).unwrap_or(10.0);
    let first = (low / step).ceil() as i64;
    (first..=(high / step).floor() as i64).map(|k| k as f64 * step).collect()
}

/// The largest round value that does not exceed `reach`, for a strip around zero.
pub fn bound(reach: f64) -> f64 {
    let power = 10f64.powf(reach.log10().floor());
    [8.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0].into_iter().map(|m| m * power).find(|v| *v <= reach * 1.000_001).unwrap_or(reach)
}

/// Number of decimals that tell neighbouring ticks apart.
pub fn decimals(ticks: &[f64]) -> usize {
    match ticks {
        [a, b, ..] => (-(b - a).abs().log10() + 1e-9).ceil().clamp(0.0, 9.0) as usize,
        _ => 0,
    }
}

/// Path through points in whole user units; a point that is not finite breaks the line.
pub fn path(points: impl Iterator<Item = (f64, f64)>) -> String {
    let mut out = String::new();
    let mut last: Option<(i64, i64)> = None;
    for (x, y) in points {
        if !(x.is_finite() && y.is_finite()) {
            last = None;
            continue;
        }
        let (x, y) = (x.round() as i64, y.round() as i64);
        match last {
            None => write!(out, "M{x} {y}"),
            Some(before) if before == (x, y) => continue,
            Some((a, b)) => write!(out, "l{} {}", x - a, y - b),
        }
        .expect("a String takes any text");
        last = Some((x, y));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks(0.0, 4.5, 5), [0.0, 1.0, 2.0, 3.0, 4.0]);
        assert_eq!(decimals(&ticks(0.0, 0.1, 4)), 2);
        assert!(ticks(1.0, 1.0, 4).is_empty());
        assert_eq!([bound(7.0), bound(4.9), bound(0.12)], [6.0, 4.0, 0.1]);
    }

    #[test]
    fn a_gap_breaks_the_path() {
        let points = [(0.0, 1.0), (1.0, 2.0), (2.0, f64::NAN), (3.0, 3.0)];
        assert_eq!(path(points.into_iter()), "M0 1l1 1M3 3");
    }
}
