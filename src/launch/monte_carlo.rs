//! Launches of many drawn cars under several controllers, and the effect of learning on their spread.
//!
//! | criterion | requirement |
//! |---|---|
//! | locks | clutch and controller agree at the end that the clutch is locked |
//! | no stall | the engine stays above 50 rad/s |
//! | one reversal | the clutch torque rises and falls once; changes below 5 N·m do not count |
//! | peak torque | at most 1.3 times what the planned launch needs in this car |
//! | slip acceleration | at most 60 rad/s² where the slip vanishes |
//!
//! Cars that cannot lock whatever the controller does, because their engine torque or capacity is too small for their load, are left out and counted.

use super::cars::{self, Car};
use super::drive::{self, Figures};
use super::{AMBIENT, IDLE, plant_inputs};
use crate::control::{Controller, Settings};
use crate::effects::{self, param};
use crate::plant::{Plant, Start};
use crate::vehicle::Vehicle;
use rayon::prelude::*;

/// Duration of a launch, s.
const WATCHED: f64 = 8.0;

/// Largest admissible ratio of peak torque to planned torque.
pub const MOST_PEAK: f64 = 1.3;

/// Largest admissible slip acceleration at ω_fc = 0, rad/s².
pub const MOST_SLIP_ACCELERATION: f64 = 60.0;

/// Controllers that are compared: name, settings, and number of previous launches of the same car from which the controller has learned.
pub fn contenders() -> [(&'static str, Settings, usize); 4] {
    [
        ("governed", Settings::robust(), 0),
        ("5th launch", Settings::robust(), 4),
        ("Figure 3", Settings::figure_3(), 0),
        ("plain PI", Settings::plain_pi(), 0),
    ]
}

/// A launch of a drawn car, and the torque that was planned, N·m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// Figures of the launch.
    pub figures: Figures,
    /// Greatest torque that the planned launch needs in this car, N·m.
    pub planned: f64,
}

impl Outcome {
    /// Which of the five criteria are met, in the order of [`CRITERIA`].
    pub fn meets(&self) -> [bool; 5] {
        let f = &self.figures;
        [
            f.locked,
            f.least_engine_speed > drive::STALLED,
            f.reversals <= 1,
            f.peak_torque <= MOST_PEAK * self.planned,
            f.slip_acceleration.abs() <= MOST_SLIP_ACCELERATION,
        ]
    }
}

/// Names of the criteria.
pub const CRITERIA: [&str; 5] = ["locks", "no stall", "one reversal", "peak torque <= 1.3 of plan", "slip acceleration <= 60 rad/s2"];

/// Launches of all cars that can lock under one controller.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name of the controller.
    pub name: &'static str,
    /// Its launches, in the order of the cars.
    pub outcomes: Vec<Outcome>,
}

impl Column {
    /// Share of the launches that meet each criterion.
    pub fn shares(&self) -> [f64; 5] {
        let count = self.outcomes.len().max(1) as f64;
        std::array::from_fn(|k| self.outcomes.iter().filter(|o| o.meets()[k]).count() as f64 / count)
    }

    /// Quantile `q` of a figure over the launches.
    pub fn quantile(&self, q: f64, of: impl Fn(&Outcome) -> f64) -> f64 {
        let mut all: Vec<f64> = self.outcomes.iter().map(of).collect();
        all.sort_by(f64::total_cmp);
        if all.is_empty() { f64::NAN } else { all[((all.len() - 1) as f64 * q).round() as usize] }
    }
}

/// Whether this car can lock at all, judged with the first contender's settings.
fn can_lock(nominal: &Vehicle, car: &Car) -> bool {
    let controller = Controller::new(nominal, &Settings::robust());
    drive::can_lock(&plant_of(car, &controller), &controller)
}

fn plant_of(car: &Car, controller: &Controller) -> Plant {
    let start = Start { omega_f: IDLE, omega_c: 0.0, theta_c: car.theta, theta_b: car.theta };
    Plant::new(&car.vehicle, &car.effects, &start, &plant_inputs(controller.outputs()))
}

fn launch(nominal: &Vehicle, settings: &Settings, before: usize, car: &Car) -> Outcome {
    let mut settings = Settings { theta_c_start: car.theta_believed, theta_b_start: car.theta_believed, ..*settings };
    let mut car = *car;
    for _ in 0..before {
        next(nominal, &mut settings, &car);
        car.seed = car.seed.wrapping_add(1);
    }
    let mut controller = Controller::new(nominal, &settings);
    let planned = drive::planned_torque(&plant_of(&car, &controller), settings.reference_time, settings.reference_speed);
    Outcome { figures: drive::drive(&car, &mut controller, WATCHED), planned }
}

/// Makes one launch and stores what was learned in the settings for the next one.
fn next(nominal: &Vehicle, settings: &mut Settings, car: &Car) -> Figures {
    let mut controller = Controller::new(nominal, settings);
    let figures = drive::drive(car, &mut controller, WATCHED);
    settings.touch_point_offset_start = controller.outputs().touch_point_offset;
    settings.friction_factor_start = controller.outputs().friction_factor;
    figures
}

/// Draws `count` cars and launches each under every contender. Also returns the number of cars that cannot lock.
pub fn run(nominal: &Vehicle, count: usize, seed: u64) -> ([Column; 4], usize) {
    let cars: Vec<Car> = (0..count).into_par_iter().map(|k| cars::draw(nominal, seed, k)).filter(|car| can_lock(nominal, car)).collect();
    let columns = contenders().map(|(name, settings, before)| {
        let outcomes = cars.par_iter().map(|car| launch(nominal, &settings, before, car)).collect();
        Column { name, outcomes }
    });
    (columns, count - cars.len())
}

/// Number of launches in a series that [`learning`] follows.
pub const LAUNCHES: usize = 5;

/// Range of the lock-up time at each launch of a series, s: 25 cars with friction × 0.8 to 1.2 and a touch point offset of up to ± 0.4 mm, whose
/// controllers keep what they have learned.
pub fn learning(nominal: &Vehicle, rate: f64) -> [f64; LAUNCHES] {
    let grid: Vec<(f64, f64)> = (0..25).map(|k| (0.8 + 0.1 * f64::from(k % 5), -0.4 + 0.2 * f64::from(k / 5))).collect();
    let times: Vec<[f64; LAUNCHES]> = grid.par_iter().map(|&(mu, touch)| series(nominal, rate, mu, touch)).collect();
    std::array::from_fn(|k| {
        let (low, high) = times.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), t| (l.min(t[k]), h.max(t[k])));
        high - low
    })
}

fn series(nominal: &Vehicle, rate: f64, mu: f64, touch: f64) -> [f64; LAUNCHES] {
    let mut p = effects::null();
    p[param::friction_level::factor] = mu;
    p[param::kiss_point_offset::offset] = touch;
    p[param::kiss_point_offset::closed_offset] = touch;
    p[param::actuator_lag::time_constant] = 0.03;
    p[param::actuator_delay::delay] = 0.015;
    let car = Car {
        vehicle: *nominal,
        effects: p,
        theta: AMBIENT,
        theta_believed: AMBIENT,
        sampling: 0.01,
        noise: 0.0,
        seed: 0,
        grade_error: 0.0,
    };
    let mut settings = Settings { learning_rate: rate, ..Settings::robust() };
    std::array::from_fn(|_| next(nominal, &mut settings, &car).time)
}
