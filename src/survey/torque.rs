//! What a torque channel can be, judged by what it reads while the clutch transmits nothing.
//!
//! At standstill with the clutch open, the clutch torque is 0 and the engine obeys J_f ω̇_f = T_e − b_f ω_f. A channel that reads something other
//! than 0 at steady speed there is neither the torque of the clutch or the gearbox input nor the engine's net torque, unless it has an offset. If in
//! addition its changes there imply an inertia that no engine has, it is not the engine's torque at all.

use super::{Trace, median};
use crate::campaign::{Log, Quantity};

/// Shortest standstill that is examined, s.
const SHORTEST_S: f64 = 0.5;
/// Length of the steadiest part of a standstill, s.
const STEADY_S: f64 = 0.3;
/// Range of the inertias of car engines with flywheel, kg·m².
const INERTIAS: (f64, f64) = (0.03, 1.0);
/// Magnitude below which a reading counts as 0, N·m.
const SMALL: f64 = 5.0;

/// What a torque channel reads at standstill, and what follows from it.
#[derive(Clone, Debug)]
pub struct Reading {
    /// Its index in the log.
    pub channel: usize,
    /// The part of a standstill with open clutch in which the channel is steadiest: start and end in s, median in N·m.
    pub idle: Option<(f64, f64, f64)>,
    /// Engine inertia that its changes at standstill imply, kg·m².
    pub inertia: Option<f64>,
    /// What follows from the reading.
    pub verdict: String,
}

impl Reading {
    /// Whether the channel is neither the engine's torque nor, unless its zero is off, the clutch's.
    pub fn is_no_torque(&self) -> bool {
        self.idle.is_some_and(|(_, _, level)| level.abs() >= SMALL) && self.inertia.is_some_and(is_no_engine)
    }
}

fn is_no_engine(inertia: f64) -> bool {
    !(INERTIAS.0..=INERTIAS.1).contains(&inertia)
}

/// The readings of all torque channels; those that are named after a wheel come last.
pub fn readings(log: &Log, engine: Trace<'_>, road: Trace<'_>) -> Vec<Reading> {
    let pedal = log.channels.iter().find(|c| c.quantity == Some(Quantity::Share) && c.name.to_lowercase().contains("clutch"));
    let open = standstills(road, pedal.map(|p| p.trace()));
    // A channel that never changes carries no information.
    let all = (0..log.channels.len()).filter(|&k| log.channels[k].quantity == Some(Quantity::Torque) && log.channels[k].quantum > 0.0);
    let mut out: Vec<Reading> = all.map(|k| reading(k, log.channels[k].trace(), engine, &open, pedal.is_some())).collect();
    let wheel = |r: &Reading| log.channels[r.channel].name.to_lowercase().contains("wheel");
    out.sort_by_key(wheel);
    out
}

/// Stretches at standstill in which the clutch is open, as far as a pedal shows.
fn standstills(road: Trace<'_>, pedal: Option<Trace<'_>>) -> Vec<(f64, f64)> {
    let standing = road.standing();
    let still = |k: usize| road.values[k] <= standing && pedal.is_none_or(|p| p.at(road.time[k]) > 95.0);
    let mut out: Vec<(f64, f64)> = Vec::new();
    let mut running = false;
    for k in 0..road.time.len() {
        match out.last_mut() {
            Some(last) if still(k) && running => last.1 = road.time[k],
            _ if still(k) => out.push((road.time[k], road.time[k])),
            _ => {}
        }
        running = still(k);
    }
    out.retain(|(from, to)| to - from >= SHORTEST_S);
    out
}

fn reading(channel: usize, torque: Trace<'_>, engine: Trace<'_>, open: &[(f64, f64)], sure: bool) -> Reading {
    let idle = open.iter().filter_map(|&(from, to)| steadiest(torque, from, to)).min_by(|a, b| a.3.total_cmp(&b.3));
    let Some((from, to, level, _)) = idle else {
        let verdict = "no standstill with an open clutch: what it is can't be checked".to_string();
        return Reading { channel, idle: None, inertia: None, verdict };
    };
    let inertia = open.iter().find(|(a, b)| *a <= from && to <= *b).and_then(|&(a, _)| {
        let range = torque.within(a, from);
        let impulse: f64 =
            range.clone().zip(range.skip(1)).map(|(i, j)| (torque.values[i] - level) * (torque.time[j] - torque.time[i])).sum();
        let gain = engine.at(from) - engine.at(a);
        // Changes that are lost in noise imply no inertia.
        (impulse.abs() > 2.0 && gain != 0.0).then(|| impulse / gain)
    });
    let clutch = if sure { "the clutch open" } else { "the car at rest (whether the clutch is open, no channel tells)" };
    let verdict = match inertia {
        _ if level.abs() < SMALL => format!(
            "reads next to nothing with {clutch}: it may be the torque of clutch, gearbox input or wheels, or the engine's net torque, which is \
             little, too, at idle with the clutch open"
        ),
        Some(j) if is_no_engine(j) => format!(
            "it can't be T_e: with {clutch} its changes would ask for an engine of {j:.2} kg·m² (engines have {} to {}); nor is it the clutch's or \
             gearbox input's torque, which is 0 there, unless its zero is off by {level:.0} N·m",
            INERTIAS.0, INERTIAS.1
        ),
        _ => format!(
            "with {clutch} the torque of clutch and gearbox input is 0 and the engine's net torque small: it may be indicated torque (with \
             friction, accessories), or its zero is off by {level:.0} N·m. Say which"
        ),
    };
    Reading { channel, idle: Some((from, to, level)), inertia, verdict }
}

/// The part of a standstill in which the channel changes least: start, end, median, range.
fn steadiest(torque: Trace<'_>, from: f64, to: f64) -> Option<(f64, f64, f64, f64)> {
    let starts = torque.within(from, to - STEADY_S);
    let part = |k: usize| {
        let (a, b) = (torque.time[k], torque.time[k] + STEADY_S);
        let values = || torque.within(a, b).map(|i| torque.values[i]);
        let range = values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min);
        (a, b, median(values()), range)
    };
    starts.map(part).min_by(|a, b| a.3.total_cmp(&b.3))
}
