//! The course that a car takes in a corrected replay, and how it answers to a torque or an error of a reading that is small: without another replay.
//!
//! The filter keeps a replay near what was measured. So a torque more or less moves the speeds only as far as the filter lets it, and the parts along the way change little: the clutch
//! sticks where it stuck, and its torque and the car's resistance change with the speeds by their slopes alone,
//!
//! ```text
//! J_f δω̇_f = u_f − g (δω_f − δω_c),   J_c δω̇_c = u_c + g (δω_f − δω_c) − b δω_c ,
//! ```
//!
//! u the torques of the law in question and those that the filter adds, g = ∂T_fc/∂slip, b the slope of the resistance; both sides together while the clutch sticks.

use super::filter::{Filter, STATES, state};
use super::missing::way;
use super::replay::{self, Missing, Steps, added, at};
use super::tolerance::{Car, Signal};
use super::track::Track;
use crate::plant::clutch::{Branch, Found, slipping};
use crate::plant::config::Config;
use crate::plant::motion::{Motion, engine_torque, index, vehicle_resistance};
use crate::plant::{actuation::engine_target, sensed};

/// Where a car is at an observation.
#[derive(Clone, Copy, Debug)]
struct Instant {
    /// Continuous states.
    y: Motion,
    /// Position of the bearing, mm.
    bearing: f64,
    /// Memory of the force hysteresis.
    memory: Branch,
    /// Direction of slip, ±1.
    direction: f64,
    /// Whether flywheel and disc turn as one.
    stuck: bool,
    /// Torque report behind the engine's lag, but for what the filter added, N·m.
    report: f64,
    /// By how much speeds that come to what scales them in their sensors are ahead of those of now, rad/s.
    ahead: [f64; 2],
}

/// A course.
#[derive(Clone, Debug)]
pub struct Course<'a> {
    /// Steps in which it was taken.
    pub steps: Steps,
    track: &'a Track,
    filter: &'a Filter,
    /// The car that takes it.
    config: Config,
    /// By observation.
    instants: Vec<Instant>,
    /// Whitened innovations along it.
    pub innovations: Vec<f64>,
    /// How late the speeds are read, and by how much their sensors are late that corrections know of, s.
    late: [f64; 2],
    known_late: [f64; 2],
    /// Slopes of clutch torque and resistance by observation, N·m·s/rad.
    slopes: Vec<[f64; 2]>,
}

/// Speed in rad/s over which slopes are taken.
const OVER: f64 = 0.5;

/// Places of both speeds among the states.
const SPEEDS: [usize; 2] = [index::OMEGA_F, index::OMEGA_C];

/// Places of what a course differs in from another while it does the same.
const KINEMATICS: [usize; 5] = [index::OMEGA_F, index::OMEGA_C, index::OMEGA_V, index::ANGLE, index::CRANK];

impl<'a> Course<'a> {
    /// Of a car, from start temperatures in °C.
    pub fn new(steps: Steps, track: &'a Track, filter: &'a Filter, car: &Car, theta: [f64; 2]) -> Self {
        let config = Config::new(&car.vehicle, &car.effects);
        let mut instants = Vec::with_capacity(track.observations());
        let mut last = track.rows_of(0).end - 1;
        let innovations = replay::corrected_in(steps, track, filter, car, theta, None, |row, now, plant| {
            if row < last {
                return;
            }
            let s = plant.state();
            let before = track.tick_of_row[row].saturating_sub(1);
            let added = s.inputs.t_e_ref - track.inputs(before..before + 1, car.late[Signal::Report as usize], 0.0).t_e;
            let c = &config.constants;
            let shown = [now.omega_f, now.omega_c];
            instants.push(Instant {
                y: s.y,
                bearing: s.bearing,
                memory: s.memory,
                direction: s.direction,
                stuck: s.stuck,
                report: (s.engine.value - c.engine_bias) / c.engine_gain - added,
                ahead: [0, 1].map(|k| sensed::meant(&car.effects, k, shown[k]) - s.y[SPEEDS[k]]),
            });
            let k = instants.len();
            if k < track.observations() {
                last = track.rows_of(k).end - 1;
            }
        });
        let known_late = [0, 1].map(|k| sensed::dead_time(&config, k) + sensed::smoothing(&config, k, 0.0));
        let late = [0, 1].map(|k| car.late[[Signal::OmegaF, Signal::OmegaC][k] as usize] + known_late[k]);
        let slopes = instants.iter().map(|now| slopes(&config, now)).collect();
        Self { steps, track, filter, config, instants, innovations, late, known_late, slopes }
    }

    /// What this car does beyond another on its own course, at the speeds of this one: torques, errors of readings, and what the bench shows. Of a clutch that sticks in either nobody sees
    /// what it could carry; inertias and elastic shafts do nothing that is told here.
    pub fn beyond(&self, other: &Self) -> Missing {
        self.beyond_one(&other.config, &other.instants)
    }

    /// The same of another car that would be on this course too: what it does by no memory.
    pub fn beyond_at_once(&self, other: &Self) -> Missing {
        self.beyond_one(&other.config, &self.instants)
    }

    fn beyond_one(&self, config: &Config, instants: &[Instant]) -> Missing {
        let of = |(here, there): (&Instant, &Instant)| {
            let sticks = here.stuck || there.stuck;
            let mut there = Instant { direction: here.direction, ..*there };
            KINEMATICS.into_iter().for_each(|k| there.y[k] = here.y[k]);
            let (a, b) = (here.doing(&self.config, sticks), there.doing(config, sticks));
            std::array::from_fn(|i| a[i] - b[i])
        };
        let differences: Vec<[f64; DOINGS]> = self.instants.iter().zip(instants).map(of).collect();
        // A torque acts until the next observation, and changes on the way.
        let torque = |k: usize, i: usize| 0.5 * (differences[k][i] + differences[(k + 1).min(differences.len() - 1)][i]);
        let shown = |k: usize, i: usize| differences[k][i];
        let by_row = |i: usize, value: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
            let nothing = differences.iter().all(|d| d[i] == 0.0);
            let rows = if nothing { 0 } else { self.track.rows() };
            (0..rows).map(|row| value(self.track.observation_of(row), i)).collect()
        };
        Missing {
            torque: [0, 1].map(|i| by_row(i, &torque)),
            clutch: by_row(2, &torque),
            sensed: [3, 4].map(|i| by_row(i, &shown)),
            bench: [5, 6].map(|i| by_row(i, &shown)),
            ..Missing::default()
        }
    }

    /// What a law that is small changes in the whitened innovations: two per observation, then the bench channels.
    pub fn response(&self, law: &Missing) -> Vec<f64> {
        let (track, filter) = (self.track, self.filter);
        let d = &self.config.constants.driveline;
        let inertia = [d.J_f, d.J_c];
        let total = inertia[0] + inertia[1];
        let common = |v: [f64; 2]| [(inertia[0] * v[0] + inertia[1] * v[1]) / total; 2];
        let n = track.observations();
        let mut all = Vec::with_capacity(self.innovations.len());
        let mut bench: [Vec<f64>; 3] = Default::default();
        let mut speeds = law.read_at_start(self.instants[0].stuck).map(|error| -error);
        let (mut pace, mut held) = ([0.0; 2], 0.0);
        let (mut estimate, mut lasting) = ([0.0; STATES], [0.0; 3]);
        for k in 0..n {
            let gain = &filter.gains[k];
            let (stuck, pinned) = (self.instants[k].stuck, filter.pinned[k]);
            let [g, b] = self.slopes[k];
            if stuck {
                speeds = common(speeds);
            } else if pinned {
                speeds[0] = 0.0;
            }
            let rows = track.rows_of(k);
            let mut errors = [0.0; 5];
            for row in rows.clone() {
                let carried = if stuck { held } else { g * (speeds[0] - speeds[1]) };
                let shows = [
                    speeds[0] - self.late[0] * pace[0] + at(&law.sensed[0], row),
                    speeds[1] - self.late[1] * pace[1] + at(&law.sensed[1], row),
                    at(&law.bench[0], row),
                    carried + at(&law.clutch, row),
                    at(&law.bench[1], row),
                ];
                errors.iter_mut().zip(shows).for_each(|(e, x)| *e -= x / rows.len() as f64);
                if row + 1 == rows.end {
                    let mut corrected = [0.0; 2];
                    for c in 0..2 {
                        if gain.weight[c] == 0.0 {
                            all.push(0.0);
                            continue;
                        }
                        let innovation = errors[c] - corrected[c] - estimate[[state::NOISE_F, state::NOISE_C][c]];
                        all.push(innovation * gain.weight[c]);
                        let of = &gain.of[c];
                        let rate = filter.rate(k, of);
                        (0..2).for_each(|s| corrected[s] += of[s] * innovation);
                        (0..2).for_each(|s| speeds[s] += (of[s] + rate[s] * self.known_late[c]) * innovation);
                        (2..STATES).for_each(|s| estimate[s] += of[s] * innovation);
                    }
                    if stuck {
                        speeds = common(speeds);
                    }
                    for (c, gains) in filter.bench.iter().enumerate().filter(|(_, g)| !g.is_empty()) {
                        bench[c].push(gains[k].innovation(errors[c + 2], &mut lasting[c]));
                    }
                    estimate.iter_mut().zip(gain.decay).skip(2).for_each(|(e, d)| *e *= d);
                }
                let added = added(filter, k, &estimate, inertia, stuck);
                let u = [added.flywheel + law.torque(0, row), added.disc + law.torque(1, row) - law.rolling.max(0.0) * at(&law.way, row)];
                let h = track.tick_end(track.tick_of_row[row + 1] - 1) - track.ticks[track.tick_of_row[row]].time;
                // Implicit steps: near lock-up the clutch's slope is steep.
                let after = if stuck {
                    let speed = (total * speeds[0] + h * (u[0] + u[1])) / (total + h * b);
                    held = (inertia[1] * u[0] - inertia[0] * (u[1] - b * speed)) / total;
                    [speed; 2]
                } else if pinned {
                    [0.0, (inertia[1] * speeds[1] + h * (u[0] + u[1])) / (inertia[1] + h * b)]
                } else {
                    let (of_f, of_c) = (inertia[0] + h * g, inertia[1] + h * (g + b));
                    let [f, c] = [0, 1].map(|s| inertia[s] * speeds[s] + h * u[s]);
                    let det = of_f * of_c - (h * g).powi(2);
                    [(of_c * f + h * g * c) / det, (of_f * c + h * g * f) / det]
                };
                pace = [0, 1].map(|s| (after[s] - speeds[s]) / h);
                speeds = after;
            }
        }
        all.extend(bench.into_iter().flatten());
        all
    }
}

/// Torques of engine, car and clutch, N·m, errors of both speeds as read, rad/s, position of the bearing, mm, temperature of the disc, °C.
const DOINGS: usize = 7;

impl Instant {
    /// Torque in N·m of a slipping clutch at this slip in rad/s.
    fn slipping(&self, config: &Config, slip: f64) -> f64 {
        slipping(config, &Found::NOTHING, self.bearing, self.memory, self.direction, slip, &self.y).total()
    }

    /// What a car does here; its clutch transmits what it would if it slipped, or `sticks`.
    fn doing(&self, config: &Config, sticks: bool) -> [f64; DOINGS] {
        let speeds = SPEEDS.map(|k| self.y[k]);
        let engine = engine_torque(config, &self.y, engine_target(config, self.report));
        // What holds a standing car holds it against more, too.
        let car = -vehicle_resistance(config, speeds[1], 0.0) * way(speeds[1]).abs();
        let clutch = if sticks { 0.0 } else { self.slipping(config, speeds[0] - speeds[1]) };
        let [f, c] = [0, 1].map(|k| sensed::shown(config, k, speeds[k] + self.ahead[k]) - speeds[k]);
        [engine, car, clutch, f, c, self.bearing, self.y[index::THETA_C]]
    }
}

/// Slopes of clutch torque and resistance.
fn slopes(config: &Config, now: &Instant) -> [f64; 2] {
    let (f, c) = (now.y[index::OMEGA_F], now.y[index::OMEGA_C]);
    let further = now.direction * OVER;
    let clutch = if now.stuck { 0.0 } else { (now.slipping(config, f - c + further) - now.slipping(config, f - c)) / further };
    let car = (vehicle_resistance(config, c + OVER, 0.0) - vehicle_resistance(config, c - OVER, 0.0)) / (2.0 * OVER);
    // What a torque that falls with slip lets grow the filter takes up.
    [clutch.max(0.0), car]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{PARAMETERS, REGISTRY, Subsystem};
    use crate::gap::infer::density::Point;
    use crate::gap::model::missing;
    use crate::gap::model::prepare::Example;

    /// Share of `change` that `told` leaves, root mean square.
    fn left(change: &[f64], told: &[f64]) -> f64 {
        let square = |values: Vec<f64>| values.iter().map(|x| x * x).sum::<f64>();
        (square(change.iter().zip(told).map(|(a, b)| a - b).collect()) / square(change.to_vec())).sqrt()
    }

    /// Of every function of every law that shows in launch, creep and modulation: what a replay makes of a tenth of it.
    #[test]
    fn a_small_law_changes_what_a_replay_says() {
        let example = Example::read();
        let some = [1, 5, 7].map(|k| &example.campaign.recordings[k]);
        let (problem, _) = example.problem(&some);
        let point = problem.nominal();
        for (r, track) in problem.tracks.iter().enumerate() {
            let (car, theta) = (problem.car(&point, Some(r)), problem.temperatures(&point, r));
            let course = Course::new(Steps::Rows, track, &problem.filters[r], &car, theta);
            let from = problem.baseline(r, &point, None, None);
            for place in Subsystem::ALL {
                let functions = missing::functions(place, track, &problem.filters[r], &car, theta);
                for (f, law) in functions.into_iter().enumerate() {
                    let mut small = law.clone();
                    small.scale(0.1);
                    let change: Vec<f64> = problem.change_under(r, &from, small).iter().map(|x| 10.0 * x).collect();
                    if change.iter().map(|x| x * x).sum::<f64>() < 10.0 {
                        continue;
                    }
                    let left = left(&change, &course.response(&law));
                    assert!(left < if place == Subsystem::Sensors { 0.2 } else { 0.1 }, "{} {place:?} {f}: {left}", track.manoeuvre);
                }
            }
        }
    }

    /// Each effect as large as is usual, but for those of inertias and shafts: what it does, told by two courses, is what it changes. What has no memory is told by one.
    #[test]
    fn what_an_effect_does_is_what_it_changes() {
        let example = Example::read();
        let (problem, _) = example.problem(&[&example.campaign.recordings[1]]);
        let course = |p: &Point| {
            Course::new(Steps::Rows, &problem.tracks[0], &problem.filters[0], &problem.car(p, Some(0)), problem.temperatures(p, 0))
        };
        let without = course(&problem.nominal());
        for entry in REGISTRY.iter() {
            let mut point = problem.nominal();
            entry.effect.amplitudes.iter().for_each(|&k| point.effects[k] += PARAMETERS[k].nominal);
            let with = course(&point);
            let change: Vec<f64> = with.innovations.iter().zip(&without.innovations).map(|(a, b)| a - b).collect();
            let [told, at_once] = [with.beyond(&without), with.beyond_at_once(&without)].map(|law| left(&change, &with.response(&law)));
            let untold = ["vehicle_mass", "driveline_compliance"].contains(&entry.id);
            assert!(if untold { told > 0.9 } else { told < 0.2 }, "{}: {told}", entry.id);
            let remembers = ["_lag", "_delay", "_limit", "_backlash", "heat_", "_cooling"].iter().any(|part| entry.id.contains(part));
            assert!(untold || if remembers { at_once > 0.9 } else { at_once < 0.25 }, "{}: {at_once}", entry.id);
        }
    }
}
