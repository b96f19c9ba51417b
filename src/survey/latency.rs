//! Latency between two speeds: the time shift at which they agree best while the clutch is closed.
//!
//! Both are averaged over half a second first, because the driveline rings faster than that, and engine and wheels then move against each other. What
//! remains of its wind-up counts as latency.

use super::Trace;
use super::engagements::Engagement;
use super::gears::Gears;

/// Largest shift that is tried, s.
const MOST_S: f64 = 0.1;
/// Distance between the shifts, s.
const FINE_S: f64 = 0.002;

/// Width of the means, s.
const MEAN_S: f64 = 0.5;

/// Least distance between the instants at which rates of change are compared, s, and largest number of instants: the means of neighbouring instants are nearly the same.
const APART_S: f64 = 0.02;
const MOST: f64 = 10_000.0;

/// A trace with its integrals from the beginning to each sample.
struct Sums<'a> {
    trace: Trace<'a>,
    sums: Vec<f64>,
}

impl<'a> Sums<'a> {
    fn of(trace: Trace<'a>) -> Sums<'a> {
        let pairs = trace.time.windows(2).zip(trace.values.windows(2));
        let parts = pairs.map(|(t, v)| 0.5 * (v[0] + v[1]) * (t[1] - t[0]));
        let mut sum = 0.0;
        let sums = std::iter::once(0.0).chain(parts.map(|part| {
            sum += part;
            sum
        }));
        Sums { sums: sums.collect(), trace }
    }

    /// ∫ from the beginning to `t`.
    fn to(&self, t: f64) -> f64 {
        let k = self.trace.time.partition_point(|s| *s <= t).saturating_sub(1);
        self.sums[k] + 0.5 * (self.trace.values[k] + self.trace.at(t)) * (t - self.trace.time[k])
    }

    fn mean(&self, from: f64, to: f64) -> f64 {
        (self.to(to) - self.to(from)) / (to - from)
    }
}

/// Latency of the road speed relative to the engine speed.
#[derive(Clone, Copy, Debug)]
pub struct Lag {
    /// Latency, s; positive if the road speed is late.
    pub seconds: f64,
    /// 95 % interval, s.
    pub interval: (f64, f64),
}

/// The shift at which the rates of change of both speeds agree best over all locked engagements; `None` if the data do not determine it.
pub fn between(engine: Trace<'_>, road: Trace<'_>, gears: &Gears, engagements: &[Engagement]) -> Option<Lag> {
    // The clutch may still slip in the first half second after the speeds meet.
    let locked: Vec<(usize, f64, f64)> =
        engagements.iter().map(|e| (e.gear, e.met + 0.5, e.until)).filter(|(_, a, b)| b - a > 0.5).collect();
    let steps = (MOST_S / FINE_S) as i32;
    let (engine, road) = (Sums::of(engine), Sums::of(road));
    let change = |sums: &Sums<'_>, t: f64| sums.mean(t, t + MEAN_S) - sums.mean(t - MEAN_S, t);
    let seconds_seen: f64 = locked.iter().map(|(_, a, b)| b - a).sum();
    let apart = APART_S.max(seconds_seen / MOST);
    // Times, and the rates at which the engine speed should change there.
    let mut instants: Vec<(f64, f64)> = Vec::new();
    for &(gear, from, to) in &locked {
        let mut next = from;
        for k in road.trace.within(from + MOST_S + MEAN_S, to - MOST_S - MEAN_S) {
            let t = road.trace.time[k];
            if t >= next {
                instants.push((t, gears.factor(gear) * change(&road, t)));
                // Samples that come a little early are accepted.
                next = t + 0.9 * apart;
            }
        }
    }
    if instants.len() < 100 {
        return None;
    }
    let error = |shift: f64| instants.iter().map(|(t, expected)| (change(&engine, t - shift) - expected).powi(2)).sum();
    let errors: Vec<(f64, f64)> = (-steps..=steps).map(|k| f64::from(k) * FINE_S).map(|shift| (shift, error(shift))).collect();
    let &(seconds, least) = errors.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    // Neighbouring means share most of their samples, so that only one per width of the mean counts as independent.
    let enough = least * (1.0 + 3.84 / (seconds_seen / MEAN_S).max(2.0));
    let good: Vec<f64> = errors.iter().filter(|(_, e)| *e <= enough).map(|(s, _)| *s).collect();
    let interval = (good[0], good[good.len() - 1]);
    (interval.1 - interval.0 < MOST_S && seconds.abs() < MOST_S - FINE_S).then_some(Lag { seconds, interval })
}
