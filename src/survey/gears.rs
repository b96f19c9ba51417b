//! Ratios of engine to road speed, and the stretches in which one of them holds because the clutch is closed.
//!
//! x = ln(ω_e / v). In a gear x is constant; while the clutch slips, or without a gear, it varies. A *stretch* is where the running median of x over
//! 0.3 s, which removes the ringing of the driveline, stays within 4.5 % for long enough, without a gap. Given ratios are fitted to the levels of all
//! stretches: their single common factor, final drive over tyre radius, is the one that matches the levels for most of the time.

use super::{Known, Trace, median};

/// Half width of the running median, s.
const HALF_S: f64 = 0.15;
/// Largest distance of x from a level, i.e. largest relative deviation of a ratio.
const WITHIN: f64 = 0.045;
/// Shortest stretch from which a gear is learned, s.
const MIN_LEARNING_S: f64 = 1.2;
/// Shortest stretch in a known gear, s.
const SHORTEST_S: f64 = 0.6;
/// Least number of samples in a stretch: slow logs have few.
const FEWEST: usize = 4;
/// Lowest engine speed that counts as running, rad/s.
const RUNNING: f64 = 20.0;

/// The gears.
#[derive(Clone, Debug, Default)]
pub struct Gears {
    /// One level per gear: engine speed per unit of the road's speed channel, rad/s per m/s or per rad/s. First gear first.
    pub levels: Vec<f64>,
    /// Whether ratios were given.
    pub given: bool,
    /// Common factor of the ratios, if they were given: final drive over tyre radius, 1/m, for a road speed; without unit for a shaft's speed, and 1 for the disc's own.
    pub common: Option<f64>,
    /// Stretches in which a gear is locked.
    pub stretches: Vec<Stretch>,
}

/// A stretch with the clutch closed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// Gear, counted from 0.
    pub gear: usize,
    /// First time, s.
    pub from: f64,
    /// Last time, s.
    pub to: f64,
}

impl Gears {
    /// Engine speed per unit of road speed in a gear, counted from 0.
    pub fn factor(&self, gear: usize) -> f64 {
        self.levels[gear]
    }

    /// Time for which a gear is locked, s.
    pub fn seconds(&self, gear: usize) -> f64 {
        // An empty sum is −0; adding 0 makes it +0.
        self.stretches.iter().filter(|s| s.gear == gear).map(|s| s.to - s.from).sum::<f64>() + 0.0
    }

    /// Median ratio of disc to engine speed while a gear is locked.
    pub fn locked_ratio(&self, gear: usize, engine: Trace<'_>, road: Trace<'_>) -> f64 {
        let factor = self.factor(gear);
        let stretches = self.stretches.iter().filter(|s| s.gear == gear);
        median(stretches.flat_map(|s| road.within(s.from, s.to)).map(|k| factor * road.values[k] / engine.at(road.time[k])))
    }
}

/// Finds the gears of a log.
pub fn find(engine: Trace<'_>, road: Trace<'_>, known: &Known, shaft: bool, remarks: &mut Vec<String>) -> Gears {
    let (time, x) = levels_over_time(engine, road);
    let learning_stretches = stretches(&time, &x, MIN_LEARNING_S, None);
    let mut gears = Gears { given: !known.ratios.is_empty(), ..Gears::default() };
    if gears.given {
        let Some(common) = common_factor(&learning_stretches, known, shaft) else {
            remarks.push("no stretch with a steady ratio of engine to road speed: the given ratios cannot be matched to anything".into());
            return gears;
        };
        gears.common = Some(common);
        gears.levels = known.ratios.iter().map(|i| i * common).collect();
    } else {
        gears.levels = learned(&learning_stretches);
    }
    let logs: Vec<f64> = gears.levels.iter().map(|l| l.ln()).collect();
    gears.stretches = stretches(&time, &x, SHORTEST_S, Some(&logs))
        .into_iter()
        .filter_map(|s| {
            let gear = (0..logs.len()).min_by(|&a, &b| (logs[a] - s.level).abs().total_cmp(&(logs[b] - s.level).abs()))?;
            Some(Stretch { gear, from: s.from, to: s.to })
        })
        .collect();
    gears
}

/// Stamps, and running medians of x, where engine and car move.
fn levels_over_time(engine: Trace<'_>, road: Trace<'_>) -> (Vec<f64>, Vec<f64>) {
    let standing = road.standing();
    // A hundred points per second follow a ratio well enough.
    let span = road.time[road.time.len() - 1] - road.time[0];
    let stride = (0.01 * road.time.len() as f64 / span.max(0.01)).floor().max(1.0) as usize;
    let moving = (0..road.time.len()).step_by(stride).filter(|&k| road.values[k] > standing && engine.at(road.time[k]) > RUNNING);
    let points: Vec<(f64, f64)> = moving.map(|k| (road.time[k], (engine.at(road.time[k]) / road.values[k]).ln())).collect();
    let time: Vec<f64> = points.iter().map(|p| p.0).collect();
    let smooth = |&t: &f64| {
        let (a, b) = (time.partition_point(|s| *s < t - HALF_S), time.partition_point(|s| *s <= t + HALF_S));
        median(points[a..b].iter().map(|p| p.1))
    };
    let x = time.iter().map(smooth).collect();
    (time, x)
}

/// A stretch and its level of x.
#[derive(Clone, Copy, Debug)]
struct Steady {
    level: f64,
    from: f64,
    to: f64,
}

/// Stretches of constant x, at any level or at one of the given ones.
fn stretches(time: &[f64], x: &[f64], shortest: f64, levels: Option<&[f64]>) -> Vec<Steady> {
    let (mut out, mut k) = (Vec::new(), 0);
    let gap = (2.5 * median(time.windows(2).map(|w| w[1] - w[0]))).max(0.3);
    while k < time.len() {
        let nearest = |x: f64| levels.and_then(|l| l.iter().copied().min_by(|a, b| (a - x).abs().total_cmp(&(b - x).abs())));
        let mut level = nearest(x[k]).unwrap_or(x[k]);
        let (mut sum, mut end) = (0.0, k);
        while end < time.len() && (x[end] - level).abs() < WITHIN && (end == k || time[end] - time[end - 1] < gap) {
            sum += x[end];
            end += 1;
            if levels.is_none() {
                level = sum / (end - k) as f64;
            }
        }
        if end >= k + FEWEST && time[end - 1] - time[k] >= shortest {
            out.push(Steady { level: median(x[k..end].iter().copied()), from: time[k], to: time[end - 1] });
            k = end;
        } else {
            k += 1;
        }
    }
    out
}

/// Ratios learned from the stretches, the highest (first gear) first. Levels within 6 % of each other are one gear.
fn learned(learning_stretches: &[Steady]) -> Vec<f64> {
    let mut levels: Vec<(f64, f64)> = Vec::new();
    for s in learning_stretches {
        let seconds = s.to - s.from;
        match levels.iter_mut().find(|(level, _)| (*level - s.level).abs() < 0.06) {
            Some((level, weight)) => {
                *level = (*level * *weight + s.level * seconds) / (*weight + seconds);
                *weight += seconds;
            }
            None => levels.push((s.level, seconds)),
        }
    }
    levels.sort_by(|a, b| b.0.total_cmp(&a.0));
    levels.into_iter().map(|(level, _)| level.exp()).collect()
}

/// The common factor with which the given ratios match the levels for most of the time.
fn common_factor(learning_stretches: &[Steady], known: &Known, shaft: bool) -> Option<f64> {
    if known.ratios == [1.0] && shaft {
        return Some(1.0);
    }
    if let (Some(radius), false) = (known.tyre_radius, shaft) {
        return Some(known.final_drive.unwrap_or(1.0) / radius);
    }
    let logs: Vec<f64> = known.ratios.iter().map(|i| i.ln()).collect();
    let off = |c: f64, s: &Steady| logs.iter().map(|l| s.level - l - c).min_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(f64::INFINITY);
    let score = |c: f64| learning_stretches.iter().map(|s| (s.to - s.from) * (-0.5 * (off(c, s) / 0.015).powi(2)).exp()).sum::<f64>();
    let candidates = learning_stretches.iter().flat_map(|s| logs.iter().map(move |l| s.level - l));
    let best = candidates.max_by(|a, b| score(*a).total_cmp(&score(*b)))?;
    let near: Vec<f64> = learning_stretches.iter().map(|s| off(best, s)).filter(|o| o.abs() < WITHIN).collect();
    Some((best + median(near)).exp())
}
