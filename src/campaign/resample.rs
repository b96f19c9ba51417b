//! Puts a channel onto the recording's uniform grid.
//!
//! A grid point within 2 % of a grid step of a sample takes that sample's value as it stands, so a file that is on the grid
//! already comes through unchanged. Between samples an input keeps the previous value (zero-order hold) and a signal runs
//! along the straight line; a slow temperature keeps its edge value beyond its ends.

use super::channels::Lasting;
use super::clock::valid;

/// A grid point this close to a sample, as a part of the grid's step, is that sample.
pub(crate) const SNAP: f64 = 0.02;

/// A uniform grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Grid {
    /// Time of the first point on the file's clock, s.
    pub start: f64,
    /// Points per second.
    pub rate_hz: f64,
    /// Number of points.
    pub count: usize,
}

/// A channel on the grid.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct OnGrid {
    /// One value per grid point.
    pub values: Vec<f64>,
    /// How many grid points fell between samples.
    pub between: usize,
}

/// Samples a channel on the grid. The channel has at least one valid sample.
pub(crate) fn resample(time: &[f64], values: &[f64], lasting: Lasting, grid: Grid) -> OnGrid {
    let tolerance = SNAP / grid.rate_hz;
    let mut points = valid(time, values).map(|(_, t, v)| (t, v)).peekable();
    let mut before: Option<(f64, f64)> = None;
    let mut out = OnGrid { values: Vec::with_capacity(grid.count), between: 0 };
    for i in 0..grid.count {
        let at = grid.start + i as f64 / grid.rate_hz;
        while let Some(point) = points.next_if(|(t, _)| *t <= at + tolerance) {
            before = Some(point);
        }
        let (value, on_sample) = match (before, points.peek()) {
            (Some((t, v)), _) if at - t <= tolerance => (v, true),
            (Some((_, v)), None) | (None, Some(&(_, v))) => (v, false),
            (Some((_, v)), Some(_)) if lasting == Lasting::Held => (v, false),
            (Some((t0, v0)), Some(&(t1, v1))) => (v0 + (v1 - v0) * (at - t0) / (t1 - t0), false),
            (None, None) => (f64::NAN, false),
        };
        out.values.push(value);
        out.between += usize::from(!on_sample);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_on_the_grid_come_through_unchanged() {
        let time: Vec<f64> = (0..50).map(|i| 3.0 + f64::from(i) / 300.0).collect();
        let rounded: Vec<f64> = time.iter().map(|t| (t * 1e4).round() / 1e4).collect();
        let values: Vec<f64> = (0..50).map(|i| f64::from(i * i)).collect();
        for lasting in [Lasting::Held, Lasting::Sensed, Lasting::Slow] {
            let grid = Grid { start: 3.0, rate_hz: 300.0, count: 50 };
            let got = resample(&rounded, &values, lasting, grid);
            assert_eq!(got.values, values);
            assert_eq!(got.between, 0);
        }
    }

    #[test]
    fn inputs_hold_and_signals_run_straight() {
        let (time, values) = ([0.0, 1.0, 2.0], [0.0, 10.0, 30.0]);
        let grid = Grid { start: 0.0, rate_hz: 2.0, count: 6 };
        assert_eq!(resample(&time, &values, Lasting::Held, grid).values, [0.0, 0.0, 10.0, 10.0, 30.0, 30.0]);
        assert_eq!(resample(&time, &values, Lasting::Sensed, grid).values, [0.0, 5.0, 10.0, 20.0, 30.0, 30.0]);
    }

    #[test]
    fn an_invalid_sample_is_bridged() {
        let (time, values) = ([0.0, 0.5, 1.0], [0.0, f64::NAN, 10.0]);
        let grid = Grid { start: 0.0, rate_hz: 2.0, count: 3 };
        assert_eq!(resample(&time, &values, Lasting::Sensed, grid).values, [0.0, 5.0, 10.0]);
    }
}
