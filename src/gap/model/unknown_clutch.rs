//! Recordings without a position: the clutch is open or closed as the speeds say, and what it transmits while it slips is an unknown input.
//!
//! Without a position nothing says what torque the clutch should transmit, but both balances still hold with one and the same torque T_c,
//!
//! ```text
//! J_f ω̇_f = T_e − b_f ω_f − T_c,   J_c ω̇_c = T_c − T_L
//! ```
//!
//! The flywheel's gives T_c, the disc's then has to close: their sum says what engine, driveline and sensors are like. While the clutch is locked the whole
//! driveline speaks, as ever. The filter takes T_c for a torque of which nothing is known ([`torque`]), so that the flywheel's innovations are taken up by it
//! whole and count for nothing while the clutch slips.
//!
//! A plant has to be told what its clutch does all the same. Here a command is made for it, which is fully closed where the clutch is locked as measured and
//! fully open elsewhere, where the plant transmits the torque that the filter finds. Its clutch, actuator and temperatures are those of the vehicle file whatever a candidate says of
//! them: they were not seen, and by this they change nothing, so that derivatives, evidence and limits of detection say so by themselves.

use super::filter::{self, Disturbances};
use super::tolerance::{Car, Signal, Wander};
use super::track::{Channel, Track};
use crate::effects::empirical::CURVES;
use crate::effects::{PARAMETERS, REGISTRY, Subsystem};
use crate::physics::driveline::clutch_torque;
use crate::vehicle::Vehicle;

/// Standard deviation of a clutch torque of which nothing is known, N·m: as large as any clutch of a car transmits.
const TORQUE_NM: f64 = 300.0;

/// Half of the window, s, over which the flywheel's balance is asked how fast the clutch torque changes there.
const WINDOW_S: f64 = 0.1;

/// Change of torque over that window that is always allowed for, N·m: what a window's slope of the speed is worth.
const LEAST_CHANGE_NM: f64 = 0.5;

/// The clutch torque by observation as a disturbance of which the flywheel's balance says how fast it changes there, and nothing else: a random walk that comes as far in a window as
/// the balance does. Allowed to go faster, a filter would take noise of the flywheel's speed for torque, and whatever makes a candidate's disc slow to follow would seem to be right.
pub fn torque(track: &Track, vehicle: &Vehicle) -> Vec<Wander> {
    let n = track.observations();
    let row = |k: usize| track.rows_of(k).start;
    let time: Vec<f64> = (0..n).map(|k| track.time[row(k)]).collect();
    let omega: Vec<f64> = (0..n).map(|k| track.mean(Channel::OmegaF, k).0).collect();
    let reach = ((WINDOW_S / (track.interval() * track.rows_per_observation as f64)).round() as usize).max(2);
    let balance: Vec<f64> = (0..n)
        .map(|k| {
            let near = || (k.saturating_sub(reach)..(k + reach + 1).min(n)).filter(|j| omega[*j].is_finite());
            let count = near().count().max(1) as f64;
            let mean = |v: &[f64]| near().map(|j| v[j]).sum::<f64>() / count;
            let (t, w) = (mean(&time), mean(&omega));
            let (cross, square) = near().fold((0.0, 0.0), |(c, s), j| (c + (time[j] - t) * (omega[j] - w), s + (time[j] - t).powi(2)));
            let report = near().map(|j| track.ticks[track.tick_of_row[row(j)]].t_e).sum::<f64>() / count;
            let slope = if square > 0.0 { cross / square } else { 0.0 };
            clutch_torque(&vehicle.driveline, report, w, slope)
        })
        .collect();
    (0..n)
        .map(|k| {
            let (a, b) = (k.saturating_sub(reach), (k + reach).min(n - 1));
            let (least, most) = balance[a..=b].iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, m), x| (l.min(*x), m.max(*x)));
            let change = (most - least).max(LEAST_CHANGE_NM);
            let change = if change.is_finite() { change } else { TORQUE_NM };
            // Variance per second of a random walk, as the time of a process of this size.
            let pace = change * change / (2.0 * WINDOW_S);
            Wander { sigma: TORQUE_NM, time_s: 2.0 * TORQUE_NM * TORQUE_NM / pace }
        })
        .collect()
}

/// Subsystems that show in nothing but the torque that a position goes with.
pub const HIDDEN: [Subsystem; 4] = [Subsystem::Actuator, Subsystem::ClutchForce, Subsystem::Friction, Subsystem::Thermal];

/// How many times as much as the vehicle's the plant's clutch transmits where it was seen to be locked: it was, whatever it can hold.
const HOLDS: f64 = 3.0;

/// Makes the command of a track without a position: closed where the clutch is locked as measured.
pub fn command(track: &mut Track, vehicle: &Vehicle, with: &Disturbances) {
    let a = &vehicle.actuator;
    let travel = a.x_cls_0 - a.x_cnt_0;
    let locked = filter::locked_without_position(track, with);
    for (k, locked) in locked.into_iter().enumerate() {
        let rows = track.rows_of(k);
        let position = if locked { a.x_cls_0 + travel } else { a.x_cnt_0 - travel };
        let ticks = track.tick_of_row[rows.start]..track.tick_of_row[rows.end];
        track.ticks[ticks].iter_mut().for_each(|t| t.x_to = position);
    }
    track.stand_in = Some(Box::new(stand_in(vehicle)));
}

/// The vehicle whose clutch stands in for one of which nothing is known.
fn stand_in(vehicle: &Vehicle) -> Vehicle {
    let mut stand_in = *vehicle;
    let spring = &mut stand_in.cushion_spring;
    [&mut spring.beta_1, &mut spring.beta_2, &mut spring.beta_3].into_iter().for_each(|b| *b *= HOLDS);
    stand_in
}

/// A candidate with this clutch instead of its own.
pub fn with_clutch_of(stand_in: &Vehicle, car: &Car) -> Car {
    let mut car = *car;
    car.vehicle = Vehicle { driveline: car.vehicle.driveline, ..*stand_in };
    car.late[Signal::Command as usize] = 0.0;
    for entry in REGISTRY.iter().filter(|e| HIDDEN.contains(&e.effect.subsystem)) {
        entry.parameters.clone().for_each(|k| car.effects[k] = PARAMETERS[k].null);
    }
    for curve in CURVES.iter().filter(|c| HIDDEN.contains(&c.subsystem)) {
        curve.parameters().for_each(|k| car.effects[k] = PARAMETERS[k].null);
    }
    car
}

/// Names of what hides without a position, as a sentence lists them.
pub fn hidden() -> String {
    let ids: Vec<&str> = HIDDEN.iter().map(|s| s.id()).collect();
    let (last, first) = ids.split_last().expect("there are some");
    format!("{} and {last}", first.join(", "))
}
