//! A first look into a log: the quality of its channels, the gears and engagements that it shows, and what its torque channels can be.
//!
//! Neither a position nor a vehicle file is needed. Everything is derived from two speeds, those of engine and road, and from whatever else is there:
//! [`gears`] finds ratios and locked stretches, [`engagements`] launches and shifts, [`ringing`] the oscillation after them, [`torque`] what a torque
//! channel can be, [`rests`] pedals that are switches, [`latency`] which speed is late.

pub mod engagements;
pub mod export;
pub mod gears;
pub mod latency;
pub mod picture;
pub mod rests;
pub mod ringing;
pub mod show;
pub mod torque;

use crate::campaign::{Channel, Log, LogChannel, Quantity, SLOWEST_HZ, is_slow};

/// What the user knows.
#[derive(Clone, Debug, Default)]
pub struct Known {
    /// Ratios of the gears, first gear first.
    pub ratios: Vec<f64>,
    /// Ratio of the final drive; 1 if the ratios include it.
    pub final_drive: Option<f64>,
    /// Rolling radius of the tyre, m.
    pub tyre_radius: Option<f64>,
    /// Name of the engine speed's channel.
    pub engine: Option<String>,
    /// Name of the channel with the speed of the road, the wheels, the output shaft or the gearbox input.
    pub road: Option<String>,
}

/// The results of a survey.
#[derive(Clone, Debug)]
pub struct Survey {
    /// The log.
    pub log: Log,
    /// Index of the engine speed among the log's channels.
    pub engine: Option<usize>,
    /// Index of the road speed among the log's channels.
    pub road: Option<usize>,
    /// Ratios and locked stretches.
    pub gears: gears::Gears,
    /// Launches and shifts.
    pub engagements: Vec<engagements::Engagement>,
    /// What each torque channel can be.
    pub torques: Vec<torque::Reading>,
    /// Pedals and similar channels that rest at a few values only.
    pub switches: Vec<rests::Switch>,
    /// Latency of the road speed relative to the engine speed.
    pub latency: Option<latency::Lag>,
    /// Rolling radius of the tyre, m, if it is given or follows from the ratios.
    pub tyre_radius: Option<f64>,
    /// Ratio of the final drive, where it is given.
    pub final_drive: Option<f64>,
    /// Whether any channel is a position of the clutch.
    pub has_position: bool,
    /// Remarks on what could not be found, and why.
    pub remarks: Vec<String>,
}

impl Survey {
    /// Whether the speed behind the clutch is the road's, in m/s, and not a shaft's.
    pub fn is_road_speed(&self) -> bool {
        self.road.is_some_and(|k| self.log.channels[k].quantity == Some(Quantity::Velocity))
    }
}

/// A series of samples.
#[derive(Clone, Copy, Debug)]
pub struct Trace<'a> {
    /// Stamps, s.
    pub time: &'a [f64],
    /// Values.
    pub values: &'a [f64],
}

impl Trace<'_> {
    /// Speed up to which the car counts as standing still: a hundredth of the greatest speed, which is above the noise of any sensor.
    pub fn standing(&self) -> f64 {
        0.01 * self.values.iter().copied().fold(0.0, f64::max)
    }

    /// The value at a time, interpolated linearly between neighbours and constant beyond the ends; for display and search, never for fitting.
    pub fn at(&self, t: f64) -> f64 {
        let k = self.time.partition_point(|s| *s <= t);
        match (k.checked_sub(1), self.time.get(k)) {
            (None, _) => self.values[0],
            (Some(b), None) => self.values[b],
            (Some(b), Some(after)) => {
                let share = (t - self.time[b]) / (after - self.time[b]);
                self.values[b] + share * (self.values[k] - self.values[b])
            }
        }
    }

    /// Indices of the samples from `from` to `to`.
    pub fn within(&self, from: f64, to: f64) -> std::ops::Range<usize> {
        self.time.partition_point(|t| *t < from)..self.time.partition_point(|t| *t <= to)
    }
}

impl LogChannel {
    /// Its samples, as a trace.
    pub fn trace(&self) -> Trace<'_> {
        Trace { time: &self.time, values: &self.values }
    }
}

/// Median; of an even number of values, the greater of the middle two. NaN if there are no values.
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    let middle = values.len() / 2;
    if values.is_empty() { f64::NAN } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

/// Surveys a log.
pub fn survey(log: Log, known: &Known) -> Survey {
    let named = |name: &Option<String>| name.as_ref().and_then(|n| log.channels.iter().position(|c| &c.name == n));
    let engine = named(&known.engine).or_else(|| log.channels.iter().position(|c| c.guess == Some(Channel::OmegaF)));
    let road = named(&known.road).or_else(|| road(&log, engine));
    let mut s = Survey {
        has_position: log
            .channels
            .iter()
            .any(|c| matches!(c.guess, Some(Channel::XToCmd | Channel::XTo)) && c.quantity == Some(Quantity::Length)),
        switches: rests::switches(&log),
        engine,
        road,
        gears: gears::Gears::default(),
        engagements: Vec::new(),
        torques: Vec::new(),
        latency: None,
        tyre_radius: known.tyre_radius,
        final_drive: known.final_drive,
        remarks: Vec::new(),
        log,
    };
    let (Some(engine), Some(road)) = (s.engine, s.road) else {
        let missing = if s.engine.is_none() { "the engine's speed (--engine NAME)" } else { "a speed behind the clutch (--road NAME)" };
        s.remarks.push(format!("no channel is {missing}: no gears, launches or shifts can be found"));
        return s;
    };
    s.remarks.extend(s.log.channels[engine].measure_as_engine());
    let (omega, road) = (&s.log.channels[engine], &s.log.channels[road]);
    let shaft = road.quantity != Some(Quantity::Velocity);
    if road.quantity.is_none() {
        s.remarks.push(format!("no unit is given for {}: it is taken for a speed behind the clutch, in units of its own", road.name));
    }
    // The gearbox input turns at the speed of the disc: there is no gear in between.
    let direct = Known { ratios: vec![1.0], tyre_radius: None, ..Known::default() };
    let given = !known.ratios.is_empty();
    let known = if road.guess == Some(Channel::OmegaC) && known.ratios.is_empty() { &direct } else { known };
    let mut slow = Vec::new();
    for c in [omega, road].into_iter().filter(|c| is_slow(c.step)) {
        slow.push(format!("{} has {:.1} samples a second", c.name, 1.0 / c.step));
    }
    if !slow.is_empty() {
        s.remarks.push(format!(
            "{}: that is enough for gears, but an engagement takes a second or less: launches and shifts are placed roughly and may be missed. Record at {SLOWEST_HZ} Hz or more, which `kisspoint diagnose` needs",
            slow.join(", ")
        ));
    }
    let steps = (omega.quantum, road.quantum);
    let (omega, v) = (omega.trace(), road.trace());
    s.gears = gears::Gears { given, ..gears::find(omega, v, known, shaft, &mut s.remarks) };
    let drive = known.final_drive.filter(|_| !shaft);
    s.tyre_radius = s.tyre_radius.or_else(|| Some(drive? / s.gears.common?));
    s.engagements = engagements::find(omega, v, &s.gears);
    s.torques = torque::readings(&s.log, omega, v);
    let clutch = s.torques.iter().find(|reading| !reading.is_no_torque()).map(|reading| s.log.channels[reading.channel].trace());
    for engagement in &mut s.engagements {
        let factor = s.gears.factor(engagement.gear);
        engagement.ringing = ringing::after(omega, v, (factor, steps.0 + factor * steps.1), engagement.met, engagement.until);
        engagement.heat = clutch.map(|torque| engagements::heat(omega, v, torque, factor, engagement));
    }
    s.latency = latency::between(omega, v, &s.gears, &s.engagements);
    s
}

/// The speed behind the clutch: that of the gearbox input, otherwise the road's, otherwise a wheel's or the output shaft's, otherwise a channel that
/// is called a speed and has no unit; of several, the one with the most samples.
fn road(log: &Log, engine: Option<usize>) -> Option<usize> {
    let rank = |k: usize| {
        let c = &log.channels[k];
        let name = c.name.to_lowercase();
        let shaft = ["wheel", "output", "shaft", "whl"].iter().any(|w| name.contains(w));
        match (c.guess, c.quantity) {
            _ if Some(k) == engine => None,
            (Some(Channel::OmegaC), _) => Some(3),
            (_, Some(Quantity::Velocity)) => Some(2),
            (_, Some(Quantity::Speed)) if shaft => Some(1),
            (None, None) if ["speed", "velocity", "geschwindigkeit", "vss"].iter().any(|w| name.contains(w)) => Some(0),
            _ => None,
        }
    };
    let all = (0..log.channels.len()).filter_map(|k| Some((rank(k)?, k)));
    all.max_by(|(a, i), (b, j)| a.cmp(b).then(log.channels[*i].values.len().cmp(&log.channels[*j].values.len()).then(j.cmp(i))))
        .map(|(_, k)| k)
}
