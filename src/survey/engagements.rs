//! Launches and shifts: from where a clutch opens, or the car begins to move, to where engine and disc speed meet in the next gear.

use super::Trace;
use super::gears::{Gears, Stretch};
use super::ringing::Ringing;

/// One engagement.
#[derive(Clone, Debug)]
pub struct Engagement {
    /// Gear, counted from 0.
    pub gear: usize,
    /// Whether it starts from standstill.
    pub launch: bool,
    /// Time at which the clutch begins to slip, s: the end of the previous gear, or the last sample at standstill.
    pub from: f64,
    /// Time at which engine and disc speed first meet, s.
    pub met: f64,
    /// Time at which the gear is left again, s.
    pub until: f64,
    /// Oscillation after the engagement.
    pub ringing: Option<Ringing>,
    /// Energy dissipated by slip, J, provided that the first torque channel is the clutch's.
    pub heat: Option<f64>,
}

/// All engagements, in order.
pub fn find(engine: Trace<'_>, road: Trace<'_>, gears: &Gears) -> Vec<Engagement> {
    let (merged, standing) = (merge(engine, road, gears), road.standing());
    let one = |(k, stretch): (usize, &Stretch)| {
        let before = k.checked_sub(1).map(|b| &merged[b]);
        let rest = standstill_before(road, standing, stretch.from).filter(|t| before.is_none_or(|b| *t > b.to));
        let from = match (rest, before) {
            (Some(rest), _) => rest,
            (None, Some(b)) => b.to,
            // The log begins in a gear.
            (None, None) => return None,
        };
        let met = meeting(engine, road, gears.factor(stretch.gear), from, stretch)?;
        Some(Engagement { gear: stretch.gear, launch: rest.is_some(), from, met, until: stretch.to, ringing: None, heat: None })
    };
    merged.iter().enumerate().filter_map(one).collect()
}

/// Joins stretches of the same gear that are less than 1 s apart and have no slip in between.
fn merge(engine: Trace<'_>, road: Trace<'_>, gears: &Gears) -> Vec<Stretch> {
    let mut out: Vec<Stretch> = Vec::new();
    for s in &gears.stretches {
        let factor = gears.factor(s.gear);
        let slipped = |from: f64, to: f64| {
            let samples = road.within(from, to);
            let all = samples.len() as f64;
            let off = samples.filter(|&k| (engine.at(road.time[k]) - factor * road.values[k]).abs() > 0.15 * engine.at(road.time[k]));
            off.count() as f64 * (to - from) > 0.1 * all
        };
        match out.last_mut() {
            Some(last) if last.gear == s.gear && s.from - last.to < 1.0 && !slipped(last.to, s.from) => last.to = s.to,
            _ => out.push(*s),
        }
    }
    out
}

/// Time of the last sample before `t` whose speed is at most `standing`.
fn standstill_before(road: Trace<'_>, standing: f64, t: f64) -> Option<f64> {
    let end = road.time.partition_point(|s| *s < t);
    (0..end).rev().find(|&k| road.values[k] <= standing).map(|k| road.time[k])
}

/// Time at which the slip in the new gear first vanishes after its maximum.
fn meeting(engine: Trace<'_>, road: Trace<'_>, factor: f64, from: f64, stretch: &Stretch) -> Option<f64> {
    let range = road.within(from - 0.2, stretch.from + 0.6);
    let slip: Vec<(f64, f64)> = range.map(|k| (road.time[k], engine.at(road.time[k]) - factor * road.values[k])).collect();
    let peak = (0..slip.len()).max_by(|&a, &b| slip[a].1.abs().total_cmp(&slip[b].1.abs()))?;
    let crossing = slip[peak..].windows(2).find(|w| w[0].1.signum() != w[1].1.signum())?;
    let [(t0, s0), (t1, s1)] = [crossing[0], crossing[1]];
    Some(t0 + (t1 - t0) * s0 / (s0 - s1))
}

/// ∫ T (ω_e − ω_c) dt from the beginning of an engagement until the speeds meet, J.
pub fn heat(engine: Trace<'_>, road: Trace<'_>, torque: Trace<'_>, factor: f64, e: &Engagement) -> f64 {
    let range = torque.within(e.from, e.met);
    let power = |k: usize| torque.values[k] * (engine.at(torque.time[k]) - factor * road.at(torque.time[k]));
    range.clone().zip(range.skip(1)).map(|(a, b)| 0.5 * (power(a) + power(b)) * (torque.time[b] - torque.time[a])).sum()
}
