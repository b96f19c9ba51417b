//! Free replays: a car that starts at measured speeds and is then driven by the recorded torque and position alone, without corrections by a filter.
//!
//! An engineer who drives the FMU with the recording sees the same errors. A bench recording is replayed as a whole. Of a drive, single engagements are replayed: from the release
//! of the brake at rest to the next braking, [`LONGEST_S`] at most. They start at the temperatures and the slip angle that the same car has there in a corrected replay of
//! everything before.

use super::model::filter::Filter;
use super::model::prepare;
use super::model::replay;
use super::model::tolerance;
use super::model::track::{Channel, Track};
use super::model::unknown_clutch;
use crate::campaign::Recording;
use crate::effects::Parameters;
use crate::vehicle::Vehicle;
use std::ops::Range;

/// Longest free replay of an engagement, s.
pub const LONGEST_S: f64 = 5.0;
/// Disc speed, rad/s, below which a car counts as at rest.
const AT_REST: f64 = 2.0;

/// Whether the disc may be at rest, for each row of its speed in rad/s.
pub(super) fn rests(omega_c: impl Iterator<Item = f64> + Clone) -> Vec<bool> {
    replay::rests(omega_c, |speed| speed < AT_REST).collect()
}

/// A car: its numbers and its effects.
pub type Car<'a> = (&'a Vehicle, &'a Parameters);

/// Ranges of rows of a recording that are replayed freely: all rows if the driver never brakes, otherwise one range per engagement.
pub fn stretches(track: &Track) -> Vec<Range<usize>> {
    if track.brake.iter().all(|b| !b) {
        return vec![0..track.rows()];
    }
    // Where channels have clocks of their own, the brake may be released in a row without a speed. The mean speed of the same observation is used then.
    let omega_c = |row: usize| {
        let here = track.measured[Channel::OmegaC as usize][row];
        if here.is_finite() { here } else { track.mean(Channel::OmegaC, track.observation_of(row)).0 }
    };
    let rests = rests((0..track.rows()).map(omega_c));
    let mut all: Vec<Range<usize>> = Vec::new();
    let mut row = 0;
    while row < track.rows() {
        let released = !track.brake[row] && (row == 0 || track.brake[row - 1]) && rests[row];
        if !released {
            row += 1;
            continue;
        }
        let begin = row;
        while row < track.rows() && !track.brake[row] && track.time[row] - track.time[begin] < LONGEST_S {
            row += 1;
        }
        if track.time[row - 1] - track.time[begin] > 0.5 {
            all.push(begin..row);
        }
    }
    all
}

/// Result of the free replay of one stretch.
#[derive(Clone, Debug, Default)]
pub struct Free {
    /// Temperatures of disc and body at the beginning of the stretch, °C.
    pub theta: [f64; 2],
    /// Slip angle at the beginning of the stretch, counted from the beginning of the recording, rad.
    pub slip_angle: f64,
    /// Values that the sensors would show, by [`Channel`] and row of the stretch.
    pub value: [Vec<f64>; 5],
}

/// Temperatures of disc and body in °C and slip angle in rad by row of a corrected replay.
fn states_along(track: &Track, filter: &Filter, car: &tolerance::Car, theta: [f64; 2]) -> Vec<([f64; 2], f64)> {
    let mut all = vec![(theta, track.slip_angle_0); track.rows()];
    replay::corrected(track, filter, car, theta, None, |row, now, plant| all[row] = ([now.theta_c, now.theta_b], plant.slip_angle()));
    all
}

fn free(track: &Track, rows: &Range<usize>, car: &tolerance::Car, (theta, slip_angle): ([f64; 2], f64), noise: f64) -> Free {
    let start = replay::start(track, car, rows.start, theta, noise);
    let mut found = Free { theta, slip_angle, ..Free::default() };
    replay::replay(track, car, (&start, slip_angle), rows.clone(), None, |_, now, _, _| {
        for (column, v) in found.value.iter_mut().zip([now.omega_f, now.omega_c, now.x_to_actual, now.t_fc, now.theta_c]) {
            column.push(v);
        }
    });
    found
}

/// A recording prepared for replays.
pub struct Prepared {
    /// Its samples.
    pub track: Track,
    filter: Filter,
    /// Standard deviation of white noise, by [`Channel`].
    pub noise: [f64; 5],
    /// Ranges of rows that are replayed freely.
    pub stretches: Vec<Range<usize>>,
}

/// Prepares a recording of a vehicle for replays.
pub fn prepare(recording: &Recording, vehicle: &Vehicle) -> Prepared {
    let mut track = Track::new(recording);
    let none = tolerance::Tolerances {
        shared: Vec::new(),
        own: Vec::new(),
        report: tolerance::defaults::REPORT,
        declared_report: tolerance::defaults::REPORT,
    };
    let with = prepare::disturbances(std::slice::from_ref(&track), &none);
    unknown_clutch::find(std::slice::from_mut(&mut track), &with.noise);
    let filter = prepare::filter_of(&track, vehicle, &with);
    let stretches = stretches(&track);
    Prepared { noise: with.noise.map(|n| n.white), track, filter, stretches }
}

impl Prepared {
    fn car(car: Car) -> tolerance::Car {
        tolerance::Car { effects: *car.1, ..tolerance::Car::nominal(car.0) }
    }

    /// Free replays of all stretches with a car. `theta` are the temperatures of disc and body at the beginning of the recording, °C.
    pub fn replays(&self, car: Car, theta: [f64; 2]) -> Vec<Free> {
        let car = Self::car(car);
        self.replays_from(&car, &self.begin(&car, theta))
    }

    fn replays_from(&self, car: &tolerance::Car, begin: &[([f64; 2], f64)]) -> Vec<Free> {
        self.stretches.iter().zip(begin).map(|(rows, begin)| free(&self.track, rows, car, *begin, self.noise[0])).collect()
    }

    /// Temperatures of disc and body in °C, and slip angle in rad, by row of a corrected replay that begins at the temperatures `theta`.
    pub(super) fn along(&self, car: Car, theta: [f64; 2]) -> Vec<([f64; 2], f64)> {
        states_along(&self.track, &self.filter, &Self::car(car), theta)
    }

    /// Temperatures in °C and slip angle in rad at which each stretch begins.
    fn begin(&self, car: &tolerance::Car, theta: [f64; 2]) -> Vec<([f64; 2], f64)> {
        if self.stretches.len() == 1 && self.stretches[0] == (0..self.track.rows()) {
            return vec![(theta, self.track.slip_angle_0)];
        }
        let along = states_along(&self.track, &self.filter, car, theta);
        self.stretches.iter().map(|rows| along[rows.start]).collect()
    }

    /// Root mean square of measured minus replayed values of a channel.
    pub fn rms(&self, channel: Channel, replays: &[Free]) -> f64 {
        let measured = &self.track.measured[channel as usize];
        let errors = self.stretches.iter().zip(replays).flat_map(|(rows, f)| measured[rows.clone()].iter().zip(&f.value[channel as usize]));
        let (sum, count) = errors.filter(|(y, _)| y.is_finite()).fold((0.0, 0), |(s, n), (y, p)| (s + (y - p).powi(2), n + 1));
        (sum / f64::from(count.max(1))).sqrt()
    }
}

/// A recording that is replayed freely with several cars. With each of them, the engagements of a drive begin at the temperatures and slip angles that the first car has there.
pub struct Freely {
    prepared: Prepared,
    begin: Vec<([f64; 2], f64)>,
}

impl Freely {
    /// Prepares a recording of `vehicle`; `car` is the first car.
    pub fn new(recording: &Recording, vehicle: &Vehicle, car: Car) -> Self {
        let prepared = prepare(recording, vehicle);
        let begin = prepared.begin(&Prepared::car(car), [recording.theta_c0, recording.theta_b0]);
        Self { prepared, begin }
    }

    /// Errors of both speeds (measured minus replayed) at their samples, rad/s.
    pub fn errors(&self, car: Car) -> Vec<f64> {
        let p = &self.prepared;
        let replays = p.replays_from(&Prepared::car(car), &self.begin);
        let of = |c: usize| {
            let stretches = p.stretches.iter().zip(&replays);
            stretches.flat_map(move |(rows, f)| {
                p.track.measured[c][rows.clone()].iter().zip(f.value[c].iter()).filter(|(y, _)| y.is_finite()).map(|(y, v)| y - v)
            })
        };
        [Channel::OmegaF, Channel::OmegaC].into_iter().flat_map(|c| of(c as usize)).collect()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A recording at 100 Hz with these speeds by time in s, under a constant torque with an open clutch.
    pub fn recording(rows: usize, speeds: impl Fn(f64) -> [f64; 2], torque: f64) -> Recording {
        let time: Vec<f64> = (0..rows).map(|k| 0.01 * k as f64).collect();
        let speed = |side: usize| time.iter().map(|t| speeds(*t)[side]).collect();
        Recording {
            sample_rate_hz: 100.0,
            omega_f: speed(0),
            omega_c: speed(1),
            t_e: vec![torque; rows],
            x_to_cmd: vec![3.0; rows],
            theta_h: vec![25.0; rows],
            time,
            ..Recording::default()
        }
    }

    /// A track of such a recording, with brake and disc speed as functions of time in s.
    fn driven(rows: usize, brake: impl Fn(f64) -> bool, omega_c: impl Fn(f64) -> f64) -> Track {
        let r = recording(rows, |t| [100.0, omega_c(t)], 10.0);
        Track::new(&Recording { brake: Some(r.time.iter().map(|t| brake(*t)).collect()), ..r })
    }

    #[test]
    fn engagements_of_a_drive_go_from_the_release_at_rest_to_the_next_braking() {
        let bench = Track::new(&recording(100, |_| [100.0, 0.0], 10.0));
        assert_eq!(stretches(&bench).first(), Some(&(0..100)));
        // The brake is released at rest, on the move, for too short a time, and for longer than a free replay lasts.
        let brake = |t: f64| t < 1.0 || (2.0..3.0).contains(&t) || (4.0..5.0).contains(&t) || (5.3..6.0).contains(&t);
        let rolls = |t: f64| if (2.5..4.5).contains(&t) { 2.1 } else { 1.9 };
        assert_eq!(stretches(&driven(1300, brake, rolls)), [100..200, 600..1100]);
        // A speed that its sensor has not shown yet counts as at rest, and a drive may begin with the brake released.
        assert_eq!(stretches(&driven(400, |t| t > 2.0 && t < 3.0, |_| f64::NAN)), [0..201, 300..400]);
    }

    /// Messages every 10 ms, each with a stamp of its own: the brake's comes after the speeds, in a row without them.
    #[test]
    fn a_brake_let_go_on_the_move_begins_no_engagement_whatever_row_that_is_logged_in() {
        let brake = |t: f64| t < 1.0 || (2.0..3.0).contains(&t) || (4.0..5.0).contains(&t);
        let rolls = |t: f64| if (2.5..4.5).contains(&t) { 5.0 } else { 0.0 };
        let time: Vec<f64> = (0..1400).map(|k| 0.01 * f64::from(k / 2) + 0.003 * f64::from(k % 2)).collect();
        let of_speeds =
            |value: &dyn Fn(f64) -> f64| time.iter().enumerate().map(|(k, t)| if k % 2 == 0 { value(*t) } else { f64::NAN }).collect();
        let r = Recording {
            sample_rate_hz: 100.0,
            omega_f: of_speeds(&|_| 100.0),
            omega_c: of_speeds(&rolls),
            t_e: vec![10.0; 1400],
            x_to_cmd: vec![3.0; 1400],
            theta_h: vec![25.0; 1400],
            brake: Some((0..1400_usize).map(|k| brake(time[k.saturating_sub(1 - k % 2)])).collect()),
            time: time.clone(),
            ..Recording::default()
        };
        let begins: Vec<f64> = stretches(&Track::new(&r)).iter().map(|rows| time[rows.start]).collect();
        assert!(begins.len() == 2 && (begins[0] - 1.003).abs() < 1e-9 && (begins[1] - 5.003).abs() < 1e-9, "{begins:?}");
    }

    /// A car whose speed is lost at 80 rad/s is not at rest; one whose speed is lost at 3 rad/s may be, because a sensor shows nothing below its threshold.
    #[test]
    fn a_speed_that_is_lost_on_the_move_is_not_one_at_rest() {
        let lost = |speed: f64| driven(300, |t| t < 1.0, move |t| if (0.95..1.05).contains(&t) { f64::NAN } else { speed });
        assert_eq!((stretches(&lost(80.0)), stretches(&lost(3.0))), (Vec::new(), std::iter::once(100..300).collect()));
    }

    /// Idling at 100 rad/s against a disc at rest, with an open clutch, for two seconds.
    #[test]
    fn an_engagement_begins_at_the_slip_angle_to_which_the_drive_has_turned() {
        let mut r = recording(300, |_| [100.0, 0.0], 0.0);
        r.brake = Some(r.time.iter().map(|t| *t < 2.0).collect());
        let (vehicle, null) = (Vehicle::paper(), crate::effects::null());
        let all = prepare(&r, &vehicle).replays((&vehicle, &null), [25.0; 2]);
        assert!(all.len() == 1 && (all[0].slip_angle - 200.0).abs() < 0.5, "{:?}", all.iter().map(|f| f.slip_angle).collect::<Vec<_>>());
    }
}
