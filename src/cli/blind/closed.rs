//! Share of the gap that the retuned plant closes on recordings that the diagnosis never saw.
//!
//! The plant of the vehicle file, the retuned plant and the true car are replayed freely, driven by the logged torque and position alone:
//!
//! closed = (before − after) / (before − floor), each the mean over the replays of the root mean square error of both speeds.
//!
//! A bench recording is replayed from its first sample, and the floor is the noise of its sensors. The share that the true car itself would close is stated as well, because
//! the true car is given no more information than the retuned plant about start temperatures and the drift of the torque report.
//!
//! A drive is replayed from each release of the brake at rest to the next braking, for [`LONGEST_S`] at most. Between these free replays the plant is pulled towards the
//! measured speeds with the time constant [`MEMORY_S`], so that the temperatures and the actuator evolve over the whole drive. The floor is the error of the true car, which is
//! not told the grade or the wander of the torque report either, and knows the start temperatures only as noted.

use crate::effects::{self, PARAMETERS, Parameters};
use crate::plant::{Inputs, Plant, Start, sensed};
use crate::vehicle::{NUMBERS, Vehicle};
use realcar::{Real, Recording};
use serde_json::Value;

/// Longest free replay of an engagement, s.
const LONGEST_S: f64 = 5.0;

/// Time constant with which a replay follows the measured speeds of a drive between engagements, s. It exceeds every delay of a speed sensor, because otherwise this feedback
/// would oscillate.
const MEMORY_S: f64 = 0.3;

/// Disc speed below which a car is at rest, rad/s.
const AT_REST_RAD_S: f64 = 2.0;

/// Substep of the plant in a replay, s.
const SUBSTEP_S: f64 = 5e-3;

/// Root mean square errors of the speeds, averaged over both speeds and all replays, rad/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closed {
    /// Error of the vehicle file's plant.
    pub before: f64,
    /// Error of the retuned plant.
    pub after: f64,
    /// Smallest error that any plant could reach: the sensor noise on a bench, the true car's own error in a drive.
    pub floor: f64,
    /// Error of the true car, which is given no more information than the retuned plant.
    pub true_car: f64,
}

impl Closed {
    /// Share of the gap above the floor that the retuned plant closes; `None` unless the file's plant exceeds the floor by more than a fifth of it.
    pub fn fraction(&self) -> Option<f64> {
        self.above(self.floor)
    }

    /// The same share with the true car's error in place of the floor.
    pub fn of_true_car(&self) -> Option<f64> {
        self.above(self.true_car)
    }

    fn above(&self, floor: f64) -> Option<f64> {
        let above = self.before - floor;
        (above > 0.2 * floor).then(|| ((self.before - self.after) / above).min(1.0))
    }
}

/// A car that can be replayed.
trait Replayed: Clone {
    /// Both speeds as the sensors show them now.
    fn sensed(&mut self) -> [f64; 2];
    /// Shifts both speeds by `off`.
    fn move_by(&mut self, off: [f64; 2]);
    /// Advances by `h` seconds with the inputs of sample `k`.
    fn go(&mut self, r: &Recording, k: usize, h: f64);
}

impl Replayed for Plant {
    fn sensed(&mut self) -> [f64; 2] {
        let now = self.outputs();
        [now.omega_f, now.omega_c]
    }

    fn move_by(&mut self, [f, c]: [f64; 2]) {
        let now = self.outputs();
        let meant = |k: usize, seen: f64, by: f64| {
            let of = |seen| sensed::meant(&self.config().parameters, k, seen);
            of(seen + by) - of(seen)
        };
        self.correct_speeds([meant(0, now.omega_f, f), meant(1, now.omega_c, c)], [0.0; 2], 0);
    }

    fn go(&mut self, r: &Recording, k: usize, h: f64) {
        self.step(&inputs(r, k), h);
    }
}

impl Replayed for realcar::Motion {
    fn sensed(&mut self) -> [f64; 2] {
        realcar::Motion::sensed(self, 0.0)
    }

    fn move_by(&mut self, off: [f64; 2]) {
        self.push(off);
    }

    fn go(&mut self, r: &Recording, k: usize, h: f64) {
        self.drive(h, r.t_e_nm[k], r.x_to_cmd_mm[k]);
    }
}

fn inputs(r: &Recording, k: usize) -> Inputs {
    Inputs { x_to: r.x_to_cmd_mm[k], t_e_ref: r.t_e_nm[k], theta_h: r.theta_h_deg_c[k], t_load: 0.0 }
}

/// The gap on these recordings; `None` if the answer holds no plant parameters or no replay is possible.
pub fn on(unseen: &[Recording], vehicle_json: &str, parameters: &Value, real: &Real) -> Option<Closed> {
    let file = Vehicle::from_json(vehicle_json).ok()?;
    let (retuned, effects) = retuned(&file, parameters)?;
    let plant = |vehicle: &Vehicle, effects: &Parameters, r: &Recording| {
        let start =
            Start { omega_f: r.omega_f_rad_s[0], omega_c: r.omega_c_rad_s[0], theta_c: r.theta_c0_deg_c, theta_b: r.theta_b0_deg_c };
        let mut plant = Plant::new(vehicle, effects, &start, &inputs(r, 0));
        plant.set_max_substep(SUBSTEP_S);
        plant
    };
    let mut sums = [0.0; 4];
    let mut count = 0.0;
    for (number, r) in unseen.iter().enumerate() {
        let windows = windows(r);
        let before = errors(r, &windows, plant(&file, &effects::null(), r));
        let after = errors(r, &windows, plant(&retuned, &effects, r));
        let true_car = errors(r, &windows, real.at_start_of(r, number as u64));
        let floor = if r.brake.is_some() { true_car.clone() } else { vec![real.noise_rad_s(); 2 * windows.len()] };
        for (k, part) in [before, after, floor, true_car].iter().enumerate() {
            sums[k] += part.iter().sum::<f64>();
        }
        count += 2.0 * windows.len() as f64;
    }
    (count > 0.0).then(|| Closed { before: sums[0] / count, after: sums[1] / count, floor: sums[2] / count, true_car: sums[3] / count })
}

/// The file's vehicle and null effects, overwritten with the values that the answer gives for the FMU's variables.
pub fn retuned(file: &Vehicle, parameters: &Value) -> Option<(Vehicle, Parameters)> {
    let given = parameters.as_object()?;
    let mut vehicle = *file;
    for number in &NUMBERS {
        if let Some(value) = given.get(number.name).and_then(Value::as_f64) {
            *(number.get_mut)(&mut vehicle) = value;
        }
    }
    let value = |p: &effects::Parameter| given.get(p.variable).and_then(Value::as_f64).unwrap_or(p.null);
    Some((vehicle, std::array::from_fn(|k| value(&PARAMETERS[k]))))
}

/// First and last sample of each free replay.
fn windows(r: &Recording) -> Vec<(usize, usize)> {
    let Some(brake) = &r.brake else {
        return vec![(0, r.time_s.len() - 1)];
    };
    let released = |k: usize| !brake[k] && (k == 0 || brake[k - 1]) && r.omega_c_rad_s[k].abs() < AT_REST_RAD_S;
    let end = |k: usize| (k..brake.len()).find(|&i| brake[i] || r.time_s[i] > r.time_s[k] + LONGEST_S).unwrap_or(brake.len()) - 1;
    let all = (0..brake.len()).filter(|&k| released(k)).map(|k| (k, end(k)));
    all.filter(|(first, last)| r.time_s[*last] - r.time_s[*first] > 0.5).collect()
}

/// Root mean square error of both speeds in each window.
fn errors<T: Replayed>(r: &Recording, windows: &[(usize, usize)], mut car: T) -> Vec<f64> {
    let mut all = Vec::new();
    let mut windows = windows.iter().peekable();
    for k in 0..r.time_s.len() {
        let off = |car: &mut T| {
            let [f, c] = car.sensed();
            [r.omega_f_rad_s[k] - f, r.omega_c_rad_s[k] - c]
        };
        if let Some(window) = windows.next_if(|w| w.0 == k) {
            let mut free = car.clone();
            if k > 0 {
                let all_of_it = off(&mut free);
                free.move_by(all_of_it);
            }
            all.extend(free_replay(r, *window, free));
        }
        let Some(next) = r.time_s.get(k + 1) else { break };
        if windows.peek().is_none() {
            break;
        }
        let h = next - r.time_s[k];
        let share = 1.0 - (-h / MEMORY_S).exp();
        let [f, c] = off(&mut car);
        car.move_by([share * f, share * c]);
        car.go(r, k, h);
    }
    all
}

fn free_replay<T: Replayed>(r: &Recording, (first, last): (usize, usize), mut car: T) -> [f64; 2] {
    let mut sums = [0.0; 2];
    for k in first..=last {
        let [f, c] = car.sensed();
        sums[0] += (r.omega_f_rad_s[k] - f).powi(2);
        sums[1] += (r.omega_c_rad_s[k] - c).powi(2);
        if k < last {
            car.go(r, k, r.time_s[k + 1] - r.time_s[k]);
        }
    }
    sums.map(|s| (s / (last + 1 - first) as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use realcar::{Car, Kind, Place, draw_car_of};
    use serde_json::json;

    fn gap(car: &Car, parameters: &Value) -> Closed {
        on(&car.unseen, &car.campaign.vehicle_json, parameters, &car.real).unwrap()
    }

    /// The error that the true car leaves, larger than sensor noise, limits what any plant could close.
    #[test]
    fn a_gap_counts_from_the_floor_or_from_what_the_true_car_leaves() {
        let of = |before: f64, after: f64| Closed { before, after, floor: 0.2, true_car: 1.0 };
        assert!((of(5.0, 2.0).fraction().unwrap() - 3.0 / 4.8).abs() < 1e-12 && of(5.0, 2.0).of_true_car() == Some(0.75));
        assert!(of(1.19, 0.9).fraction().is_some() && of(1.19, 0.9).of_true_car().is_none());
        assert_eq!(of(5.0, 0.1).of_true_car(), Some(1.0));
    }

    #[test]
    fn an_answer_that_changes_nothing_closes_nothing() {
        for place in [Place::Bench, Place::Road] {
            let c = gap(&draw_car_of(place, 4, 1, Kind::Single("vehicle_mass")), &json!({}));
            assert_eq!(c.before, c.after);
            assert!(c.before > 1.5 * c.floor && c.fraction() == Some(0.0), "{place:?}: {c:?}");
        }
        assert_eq!(on(&[], "{}", &Value::Null, &draw_car_of(Place::Bench, 4, 2, Kind::Healthy).real), None);
    }

    /// With the true mass, hardly any gap is left above the floor.
    #[test]
    fn the_true_size_of_an_effect_closes_the_gap() {
        for place in [Place::Bench, Place::Road] {
            let closed: Vec<f64> = (0..3)
                .filter_map(|index| {
                    let car = draw_car_of(place, 4, index, Kind::Single("vehicle_mass"));
                    let (_, factor) = *car.truth.effects[0].parameters.first()?;
                    gap(&car, &json!({"effect.vehicle_mass.factor": factor})).fraction()
                })
                .collect();
            let mean = closed.iter().sum::<f64>() / closed.len() as f64;
            assert!(closed.len() > 1 && mean > 0.5, "{place:?}: {closed:?}");
        }
    }
}
