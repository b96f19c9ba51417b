//! What to measure: how large an effect must be to show in a planned campaign, and which manoeuvre settles what a campaign left open.
//!
//! Every manoeuvre that can be driven is rehearsed with the plant, and its rehearsal goes through the same density as a recording: same filter, same nuisances, same derivatives.
//! Only two equations for the worth of a recording are specific to planning: the limit of detection ([`super::infer::limit`]) and the expected evidence between two explanations
//! ([`split`]).
//!
//! - [`manoeuvre`]: what can be driven
//! - [`driver`]: how it is driven
//! - [`rehearse`](mod@rehearse): the recording that it would give
//! - [`reach`](mod@reach): the smallest effects that recordings show
//! - [`split`]: expected nats between explanations

pub mod driver;
pub mod manoeuvre;
pub mod reach;
pub mod rehearse;
pub mod split;

use super::infer::belief::{ByAccuracy, EXACT};
use super::infer::density::{ByPhase, Point, Problem, TEMPERATURES};
use super::infer::posterior::Posterior;
use super::infer::screen::Limit;
use super::model::clock::{CONTROL_INTERVAL_S, misses};
use super::model::filter::Disturbances;
use super::model::noise::Noise;
use super::model::tolerance::{self, Car, Nuisance, ToleranceError};
use super::model::track::Track;
use super::model::{missing, prepare};
use super::progress::Work;
use crate::campaign::Recording;
use crate::effects;
use crate::vehicle::Vehicle;
use manoeuvre::Manoeuvre;
use reach::{Reach, TOO_LARGE};
use rehearse::{Logger, rehearse};
use serde_json::Value;
use split::{Rival, Split};

/// Sensor noise that is assumed before anything has been recorded: standard deviations of one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensors {
    /// Both speeds, rad/s.
    pub speed: f64,
    /// Reported torque, N·m.
    pub torque: f64,
    /// Bearing position, mm; clutch torque, N·m; disc temperature, K: where they are measured.
    pub bench: [f64; 3],
}

impl Default for Sensors {
    /// Speed sensors of a production car and a typical bench.
    fn default() -> Self {
        Self { speed: 0.15, torque: 0.2, bench: [0.01, 0.5, 0.7] }
    }
}

/// A car, its sensors, and what can be driven with it.
#[derive(Clone, Debug)]
pub struct Planner {
    /// Manoeuvres that can be driven.
    pub manoeuvres: Vec<Manoeuvre>,
    vehicle: Vehicle,
    shared: Vec<Nuisance>,
    own: Vec<Nuisance>,
    with: Disturbances,
    logger: Logger,
    /// Powers of the likelihood for what has been recorded.
    powers: ByAccuracy<ByPhase<f64>>,
    work: Work,
}

impl Planner {
    /// A planner before anything has been recorded.
    ///
    /// # Errors
    /// Returns an error if a tolerance is invalid.
    pub fn before(
        vehicle: &Vehicle,
        document: &Value,
        sensors: Sensors,
        logger: Logger,
        manoeuvres: Vec<Manoeuvre>,
    ) -> Result<Self, ToleranceError> {
        let interval_s = 1.0 / logger.rate_hz;
        let steady = tolerance::Logger { interval_s, loose: misses(interval_s, CONTROL_INTERVAL_S) };
        let tolerances = tolerance::read(document, steady)?;
        let white = |white: f64| Noise { white, coloured: 0.0, memory_s: 1.0 };
        let [x, t, theta] = sensors.bench;
        let noise = [sensors.speed, sensors.speed, x, t, theta].map(white);
        let with = prepare::healthy(noise, sensors.torque, 0.0, &tolerances);
        Ok(Self {
            manoeuvres,
            vehicle: *vehicle,
            shared: tolerances.shared,
            own: tolerances.own,
            with,
            logger,
            powers: EXACT,
            work: Work::default(),
        })
    }

    /// A planner for a car that has been recorded; its manoeuvres are logged as its recordings were.
    pub fn after(problem: &Problem, with: &Disturbances, manoeuvres: Vec<Manoeuvre>) -> Self {
        let interval = prepare::logger(&problem.tracks).interval_s;
        let has = |c: usize| problem.tracks.iter().any(|t| !t.measured[c].is_empty());
        let sigma = |node: usize| problem.tracks.iter().map(|t| t.theta_0_sigma[node]).fold(0.0, f64::max);
        let logger = Logger { rate_hz: 1.0 / interval, bench: [has(2), has(3), has(4)], theta_0_sigma: [sigma(0), sigma(1)] };
        let (shared, own, work) = (problem.shared.clone(), problem.own.clone(), problem.work.clone());
        Self { manoeuvres, vehicle: problem.vehicle, shared, own, with: *with, logger, powers: problem.powers, work }
    }

    /// The recording of a manoeuvre driven with this car, without noise.
    pub fn recording(&self, what: &Manoeuvre, car: &Car) -> Recording {
        rehearse(what, car, &self.vehicle, &self.logger)
    }

    /// That recording, prepared for inference.
    fn problem(&self, what: &Manoeuvre, car: &Car) -> Problem {
        let track = Track::new(&self.recording(what, car));
        let filter = prepare::filter_of(&track, &self.vehicle, &self.with);
        let states = missing::states(&track, &filter, &Car::nominal(&self.vehicle), track.theta_0);
        let (shared, own, work) = (self.shared.clone(), self.own.clone(), self.work.clone());
        Problem {
            tracks: vec![track],
            filters: vec![filter],
            vehicle: self.vehicle,
            shared,
            own,
            states: vec![states],
            powers: self.powers,
            work,
        }
    }

    /// The car as the vehicle file gives it.
    pub fn nominal(&self) -> Point {
        self.at(&Point { shared: vec![0.0; self.shared.len()], own: Vec::new(), effects: effects::null(), missing: Vec::new() })
    }

    /// The part of a point that recordings share; what belongs to the new recording alone is at its nominal value.
    fn at(&self, point: &Point) -> Point {
        Point { own: vec![vec![0.0; TEMPERATURES + self.own.len()]], missing: Vec::new(), ..point.clone() }
    }

    /// The car at a point.
    fn car(&self, point: &Point) -> Car {
        let mut car = Car { effects: point.effects, ..Car::nominal(&self.vehicle) };
        car.apply(&self.shared, &point.shared);
        car
    }
}

/// What a campaign left open, and what each manoeuvre would contribute to settling it.
#[derive(Clone, Debug)]
pub struct Outlook {
    /// Manoeuvres that can be driven.
    pub manoeuvres: Vec<Manoeuvre>,
    /// Explanations that are still plausible, the most probable first.
    pub rivals: Vec<Rival>,
    /// Expected evidence of each manoeuvre between them; empty if there are fewer than two.
    pub splits: Vec<Split>,
    /// Limits of detection of the recordings.
    pub limits: Vec<Limit>,
    /// Limits with each manoeuvre added; `None` if they were not computed because everything shows already.
    pub reach: Option<Reach>,
}

/// Computes the outlook of a diagnosis. `point` is the car without effects. With `whole`, limits with further manoeuvres are computed even if all effects show already.
pub fn outlook(planner: Planner, problem: &Problem, posterior: &Posterior, point: &Point, whole: bool) -> Outlook {
    let rivals = split::rivals(posterior);
    let splits = if rivals.len() > 1 { split::splits(&planner, &rivals) } else { Vec::new() };
    let looked_ahead = || reach::reach(&planner, Some(problem), point);
    let (limits, reach) = if whole {
        let reach = looked_ahead();
        (reach.as_ref().map_or_else(Vec::new, |r| r.now.clone()), reach)
    } else {
        let limits = reach::limits(problem, point);
        let hidden = limits.iter().any(|l| l.in_sizes() > TOO_LARGE);
        (limits, if hidden { looked_ahead() } else { None })
    };
    Outlook { manoeuvres: planner.manoeuvres, rivals, splits, limits, reach }
}

/// Expected worth of a manoeuvre for distinguishing some rivals.
#[derive(Clone, Debug, PartialEq)]
pub struct Worth {
    /// Index of the manoeuvre.
    pub manoeuvre: usize,
    /// Expected evidence for the true explanation, nats.
    pub nats: f64,
    /// The same per minute, preparation included.
    pub nats_per_minute: f64,
    /// Probability that the first rival is told apart from the others: the smallest over its pairs.
    pub splits: f64,
}

impl Outlook {
    /// Manoeuvres in descending order of their worth per minute for the rivals at these indices, the first of which is the best.
    pub fn ranked(&self, places: &[usize]) -> Vec<Worth> {
        if places.len() < 2 {
            return Vec::new();
        }
        let probability: Vec<f64> = places.iter().map(|&k| self.rivals[k].probability).collect();
        let one = |(manoeuvre, split): (usize, &Split)| {
            let among = split.among(places);
            let nats = among.evidence(&probability);
            let minutes = self.manoeuvres[manoeuvre].minutes();
            Worth { manoeuvre, nats, nats_per_minute: nats / minutes, splits: among.splits(&probability) }
        };
        let mut all: Vec<Worth> = self.splits.iter().enumerate().map(one).collect();
        all.sort_by(|a, b| b.nats_per_minute.total_cmp(&a.nats_per_minute));
        all
    }

    /// Manoeuvres in that order for all rivals.
    pub fn ranked_for_all(&self) -> Vec<Worth> {
        self.ranked(&(0..self.rivals.len()).collect::<Vec<_>>())
    }

    /// Indices of the first rival and of those that hold another effect, or none, in the place of `effect`, beside all its other effects.
    pub fn in_place_of(&self, effect: usize) -> Vec<usize> {
        let Some(best) = self.rivals.first() else { return Vec::new() };
        let kept = |r: &Rival| best.effects.iter().filter(|e| **e != effect).all(|e| r.effects.contains(e));
        let stands_in = |r: &Rival| !r.effects.contains(&effect) && kept(r);
        let others = (1..self.rivals.len()).filter(|&k| stands_in(&self.rivals[k]));
        std::iter::once(0).chain(others).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// The tolerances of a planned logger are those of a recording at that rate: at 75 Hz a logger still sees every command.
    #[test]
    fn a_planned_logger_is_as_loose_as_one_that_has_recorded() {
        let vehicle = Vehicle::paper();
        let sigmas = |all: &[Nuisance]| all.iter().map(|n| n.sigma).collect::<Vec<_>>();
        for (rate_hz, loose) in [(100.0, false), (75.0, false), (60.0, true)] {
            let logger = Logger { rate_hz, bench: [false; 3], theta_0_sigma: [1.0; 2] };
            let planner = Planner::before(&vehicle, &json!({}), Sensors::default(), logger, Vec::new()).unwrap();
            let read = tolerance::read(&json!({}), tolerance::Logger { interval_s: 1.0 / rate_hz, loose }).unwrap();
            assert_eq!(sigmas(&planner.shared), sigmas(&read.shared), "{rate_hz} Hz");
        }
    }
}
