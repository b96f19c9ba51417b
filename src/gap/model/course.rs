//! The course of a car in a corrected replay, and its linear response to a small torque or error of a reading, computed without another replay.
//!
//! The filter keeps a replay near the measurements. An additional torque therefore moves the speeds only as far as the filter lets it, and the state of the parts changes little:
//! the clutch sticks where it stuck, and the clutch torque, the torque of the shafts and the car's resistance change linearly with speeds and twist,
//!
//! ```text
//! J_f δω̇_f = u_f − g (δω_f − δω_d)
//! J_d δω̇_d = g (δω_f − δω_d) − δφ/c − d (δω_d − δω_v)
//! J_v δω̇_v = δφ/c + d (δω_d − δω_v) − b δω_v + u_c ,   δφ̇ = δω_d − δω_v ,
//! ```
//!
//! where u are the torques of the law in question and those that the filter adds, g = ∂T_fc/∂slip, c and d are compliance and damping of the shafts, and b is the slope of the
//! resistance. Flywheel and disc move as one while the clutch sticks, disc and car where the shafts are rigid. A flywheel that follows its sensor does not move, and torque errors
//! of its balance act on the disc.

use super::filter::{Filter, STATES};
use super::missing::way;
use super::replay::{self, Missing, SUBSTEP_S, Steps, added, at, carried};
use super::tolerance::{Car, Signal};
use super::track::Track;
use super::unseen::interval;
use crate::plant::clutch::{Branch, FaceCache, slipping};
use crate::plant::config::Config;
use crate::plant::events::common_speed;
use crate::plant::motion::{Motion, engine_torque, index, spring_torque, twist_under, vehicle_resistance};
use crate::plant::{actuation::engine_target, sensed};
use nalgebra::{Matrix3, Vector3};
use std::collections::VecDeque;

/// State of a car at an observation.
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
    /// Torque report after the engine's lag, without what the filter added, N·m.
    report: f64,
    /// Speed at the input of each sensor's gain (after latency, filter and dead time) minus the present speed, rad/s.
    ahead: [f64; 2],
}

/// Course of a car in a corrected replay.
#[derive(Clone, Debug)]
pub struct Course<'a> {
    /// Steps of that replay.
    pub steps: Steps,
    track: &'a Track,
    filter: &'a Filter,
    /// Configuration of the car.
    config: Config,
    /// States, by observation.
    instants: Vec<Instant>,
    /// Whitened innovations of the replay.
    pub innovations: Vec<f64>,
    /// Latency of both speeds as logged, s, and that of their sensors (dead time and smoothing), s. Only the latter is taken into account when the filter corrects the speeds.
    late: [f64; 2],
    age: [f64; 2],
    /// Linear model of a step, by observation.
    models: Vec<Model>,
}

/// Increments over which slopes are taken: of a speed, rad/s, and of a torque, N·m.
const OVER: f64 = 0.5;
const TWISTED: f64 = 1.0;

/// Indices of both speeds among the states.
const SPEEDS: [usize; 2] = [index::OMEGA_F, index::OMEGA_C];

/// State indices in which two courses may differ although the cars do the same thing: the speeds, the slip angle and the crank angle.
const KINEMATICS: [usize; 5] = [index::OMEGA_F, index::OMEGA_C, index::OMEGA_V, index::ANGLE, index::CRANK];

impl<'a> Course<'a> {
    /// Replays a car from start temperatures in °C (disc, body) and records its course.
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
        let age = [0, 1].map(|k| sensed::dead_time(&config, k) + sensed::smoothing(&config, k, 0.0));
        let late = [Signal::OmegaF, Signal::OmegaC].map(|signal| car.late[signal as usize]);
        let step = |k: usize| interval(track, k) / track.rows_of(k).len() as f64;
        let models = instants.iter().enumerate().map(|(k, now)| Model::new(&config, now, filter.pinned[k], step(k))).collect();
        Self { steps, track, filter, config, instants, innovations, late, age, models }
    }

    /// Difference between what this car and another one do, each on its own course but at the speeds of this one: torques, errors of readings, and bench readings. Where the clutch
    /// sticks on either course, its torque is not compared, because the capacity of a sticking clutch does not show. Differences of inertias and elastic shafts are not included.
    pub fn beyond(&self, other: &Self) -> Missing {
        self.beyond_one(&other.config, &other.instants)
    }

    /// Like [`Self::beyond`] if the other car were on this course too: the part of the difference that does not come from a memory, such as a lag or heat.
    pub fn beyond_at_once(&self, other: &Self) -> Missing {
        self.beyond_one(&other.config, &self.instants)
    }

    fn beyond_one(&self, config: &Config, instants: &[Instant]) -> Missing {
        let of = |(here, there): (&Instant, &Instant)| {
            let sticks = here.stuck || there.stuck;
            let mut there = Instant { direction: here.direction, ..*there };
            KINEMATICS.into_iter().for_each(|k| there.y[k] = here.y[k]);
            let (a, b) = (here.quantities(&self.config, sticks), there.quantities(config, sticks));
            std::array::from_fn(|i| a[i] - b[i])
        };
        let differences: Vec<[f64; QUANTITIES]> = self.instants.iter().zip(instants).map(of).collect();
        // A torque acts until the next observation and changes in between, so the mean of both observations is taken.
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

    /// First-order change of the whitened innovations caused by a small additional law: two speed innovations per observation, followed by those of the bench channels.
    pub fn response(&self, law: &Missing) -> Vec<f64> {
        let (track, filter) = (self.track, self.filter);
        let d = &self.config.constants.driveline;
        let inertia = [d.J_f, d.J_c];
        let speed_gain = self.config.constants.clutch_speed_gain;
        let mut all = Vec::with_capacity(self.innovations.len());
        let mut bench: [Vec<f64>; 3] = Default::default();
        let mut state = self.at_start(law);
        let mut sensors = self.age.map(|age| Delayed::new((age / track.interval()).round() as usize));
        let (mut estimate, mut lasting) = ([0.0; STATES], [0.0; 3]);
        for (k, model) in self.models.iter().enumerate() {
            let (gain, stuck) = (&filter.gains[k], self.instants[k].stuck);
            model.couple(&mut state);
            let rows = track.rows_of(k);
            let mut errors = [0.0; 5];
            for row in rows.clone() {
                let read = law.errors_of_reading(row);
                let seen = |s: usize| state.speeds[s] - sensors[s].since - self.late[s] * state.accelerations[s];
                let torque = model.carried(&state);
                let shows = [
                    seen(0) + read[0],
                    speed_gain * seen(1) + read[1],
                    at(&law.bench[0], row),
                    torque + at(&law.clutch, row),
                    at(&law.bench[1], row),
                ];
                errors.iter_mut().zip(shows).for_each(|(e, x)| *e -= x / rows.len() as f64);
                if row + 1 == rows.end {
                    let before = estimate;
                    for (c, innovation) in gain.innovations([errors[0], errors[1]], &mut estimate).into_iter().enumerate() {
                        all.push(innovation.map_or(0.0, |innovation| innovation * gain.weight[c]));
                        let Some(innovation) = innovation else { continue };
                        let of = &gain.of[c];
                        let mut by = [of[0] * innovation, of[1] * innovation / speed_gain];
                        let mut rate = filter.accelerations(k, of).map(|rate| rate * innovation);
                        if stuck {
                            [by, rate] = [by, rate].map(|v| [common_speed(inertia, v); 2]);
                        }
                        let since = self.age[c];
                        (0..2).for_each(|s| sensors[s].correct(rate[s], since));
                        let [f, c] = [0, 1].map(|s| by[s] + rate[s] * since);
                        state.speeds.iter_mut().zip([f, c, c]).for_each(|(speed, by)| *speed += by);
                        state.twist -= self.config.misread_twist(stuck) * filter.load_torque(k, of, stuck) * innovation;
                    }
                    if filter.stands[k] {
                        model.hold_car(&mut state);
                    }
                    errors[3] -= carried(filter, k, [&before, &estimate], inertia, stuck);
                    for (c, gains) in filter.bench.iter().enumerate().filter(|(_, g)| !g.is_empty()) {
                        bench[c].push(gains[k].innovation(errors[c + 2], &mut lasting[c]));
                    }
                    estimate.iter_mut().zip(gain.decay).skip(2).for_each(|(e, d)| *e *= d);
                }
                let added = added(filter, k, &estimate, inertia, stuck);
                let u = [added.flywheel + law.torque(0, row), added.disc + law.torque(1, row) - law.rolling.max(0.0) * at(&law.way, row)];
                let h = track.tick_end(track.tick_of_row[row + 1] - 1) - track.ticks[track.tick_of_row[row]].time;
                model.step(&mut state, u, h);
                (0..2).for_each(|s| sensors[s].pass(state.accelerations[s] * h, h));
            }
        }
        all.extend(bench.into_iter().flatten());
        all
    }

    /// Change of the initial state due to errors of the readings from which it is taken.
    fn at_start(&self, law: &Missing) -> State {
        let [f, c] = law.errors_of_reading(0);
        let [f, c] = [f, c / self.config.constants.clutch_speed_gain];
        let d = &self.config.constants.driveline;
        let [f, c] = match (self.instants[0].stuck, self.track.unknown_clutch.is_some()) {
            (true, true) => [common_speed([d.J_f, d.J_c], [f, c]); 2],
            (true, false) => [0.5 * (f + c); 2],
            // A flywheel that follows its sensor starts at the reading, errors included.
            (false, unknown) => [if unknown { 0.0 } else { f }, c],
        };
        State { speeds: Vector3::new(-f, -c, -c), ..State::default() }
    }
}

/// Changes of the speeds of flywheel, disc and car, rad/s, of the twist of the shafts, rad, of the accelerations of flywheel and disc, rad/s², and of the torque that a stuck
/// clutch transmits, N·m.
#[derive(Clone, Copy, Debug, Default)]
struct State {
    speeds: Vector3<f64>,
    twist: f64,
    accelerations: [f64; 2],
    held: f64,
}

/// The linear model of a car at an observation.
#[derive(Clone, Copy, Debug)]
struct Model {
    /// Inertias of flywheel, disc and car behind the shafts, kg·m².
    inertia: Vector3<f64>,
    /// Response of the speeds to angular momenta over a step, 1/(kg·m²): the inverse of K = J + h D + h²/(4 c) B Bᵀ, restricted to the independent speeds.
    answer: Matrix3<f64>,
    /// Slope of the clutch torque, N·m·s/rad.
    clutch: f64,
    /// Compliance of the shafts, rad/(N·m), if they are not rigid.
    compliance: Option<f64>,
    stuck: bool,
    pinned: bool,
    /// Number of substeps per step, chosen so that the shafts oscillate as in a replay.
    parts: usize,
}

impl Model {
    /// Linear model at `now` for steps of about `h` seconds.
    fn new(config: &Config, now: &Instant, pinned: bool, h: f64) -> Self {
        let (d, omega_v) = (&config.constants.driveline, now.y[index::OMEGA_V]);
        let (stuck, elastic) = (now.stuck, config.compliant());
        let parts = if elastic { (h / config.pace.longest_substep(SUBSTEP_S)).ceil().max(1.0) } else { 1.0 };
        let h = h / parts;
        let slip = now.y[index::OMEGA_F] - now.y[index::OMEGA_C];
        let further = now.direction * OVER;
        // Where the torque falls with slip, deviations would grow, which the filter prevents: the slope is then taken as 0.
        let slope = || ((now.slipping(config, slip + further) - now.slipping(config, slip)) / further).max(0.0);
        let clutch = if stuck || pinned { 0.0 } else { slope() };
        let car = (vehicle_resistance(config, omega_v + OVER, 0.0) - vehicle_resistance(config, omega_v - OVER, 0.0)) / (2.0 * OVER);
        let torque = spring_torque(config, &now.y);
        let compliance = elastic.then(|| (twist_under(config, torque + TWISTED) - twist_under(config, torque - TWISTED)) / (2.0 * TWISTED));
        let inertia = Vector3::new(d.J_f, config.disc_inertia(), d.J_c - config.disc_inertia());
        let along = Vector3::new(0.0, 1.0, -1.0);
        let slipping = Vector3::new(1.0, -1.0, 0.0);
        let mut k = Matrix3::from_diagonal(&inertia) + slipping * slipping.transpose() * (h * clutch);
        k[(2, 2)] += h * car;
        if let Some(c) = compliance {
            k += along * along.transpose() * (h * config.constants.shaft_damping + 0.25 * h * h / c);
        }
        // Maps the independent speeds to all speeds: parts that turn as one share a speed, and a flywheel that follows its sensor has none.
        let mut free = Matrix3::identity();
        if pinned {
            free[(0, 0)] = 0.0;
        } else if stuck {
            (free[(0, 0)], free[(0, 1)]) = (0.0, 1.0);
        }
        if !elastic {
            (free[(2, 2)], free[(2, 1)]) = (0.0, 1.0);
        }
        let unused = Matrix3::from_diagonal(&Vector3::from_fn(|i, _| if free.column(i).iter().all(|x| *x == 0.0) { 1.0 } else { 0.0 }));
        let inverse = (free.transpose() * k * free + unused).try_inverse().expect("inertias and slopes are positive");
        Self { inertia, answer: free * (inverse - unused) * free.transpose(), clutch, compliance, stuck, pinned, parts: parts as usize }
    }

    /// Gives parts that turn as one from now on a common speed, and a flywheel that follows its sensor no change of speed.
    fn couple(&self, state: &mut State) {
        let speeds = &mut state.speeds;
        if self.stuck && speeds[0] != speeds[1] {
            let common = common_speed([self.inertia[0], self.inertia[1]], [speeds[0], speeds[1]]);
            (speeds[0], speeds[1]) = (common, common);
        }
        if self.pinned {
            speeds[0] = 0.0;
        }
        if self.compliance.is_none() {
            speeds[2] = speeds[1];
        }
    }

    /// Change of the clutch torque, N·m.
    fn carried(&self, state: &State) -> f64 {
        if self.stuck { state.held } else { self.clutch * (state.speeds[0] - state.speeds[1]) }
    }

    /// Advances the state by `h` seconds under torques on flywheel and car, N·m.
    fn step(&self, state: &mut State, [on_f, on_c]: [f64; 2], h: f64) {
        let begin = state.speeds;
        // A flywheel that follows its sensor takes up no torque; the clutch passes it on to the disc.
        let torques = Vector3::new(on_f, if self.pinned { on_f } else { 0.0 }, on_c);
        let part = h / self.parts as f64;
        for _ in 0..self.parts {
            let before = state.speeds;
            let twisted = before[1] - before[2];
            let pull = self.compliance.map_or(0.0, |c| (state.twist + 0.25 * part * twisted) / c);
            let momenta = self.inertia.component_mul(&before) + (torques + Vector3::new(0.0, -pull, pull)) * part;
            state.speeds = self.answer * momenta;
            state.twist += 0.5 * part * (twisted + state.speeds[1] - state.speeds[2]);
        }
        state.accelerations = [0, 1].map(|s| (state.speeds[s] - begin[s]) / h);
        state.held = on_f - self.inertia[0] * state.accelerations[0];
    }

    /// Holds a standing car behind elastic shafts, which then carry the clutch torque alone.
    fn hold_car(&self, state: &mut State) {
        if let Some(c) = self.compliance {
            state.speeds[2] = 0.0;
            state.twist = c * self.carried(state);
        }
    }
}

/// Change of a speed since the instant that a late sensor shows now.
#[derive(Clone, Debug)]
struct Delayed {
    /// Changes of the last steps, rad/s, and their lengths, s, oldest first.
    steps: VecDeque<(f64, f64)>,
    /// Latency of the sensor in steps.
    late: usize,
    /// Sum of the changes, rad/s.
    since: f64,
}

impl Delayed {
    fn new(late: usize) -> Self {
        Self { steps: VecDeque::with_capacity(late + 1), late, since: 0.0 }
    }

    /// Appends a step of `h` seconds with this change of the speed, rad/s.
    fn pass(&mut self, change: f64, h: f64) {
        self.steps.push_back((change, h));
        self.since += change;
        if self.steps.len() > self.late {
            self.since -= self.steps.pop_front().map_or(0.0, |step| step.0);
        }
    }

    /// Adds the effect of a newly found torque that has accelerated the part by `rate`, rad/s², for the last `seconds`.
    fn correct(&mut self, rate: f64, mut seconds: f64) {
        for (change, h) in self.steps.iter_mut().rev() {
            let more = rate * h.min(seconds.max(0.0));
            *change += more;
            self.since += more;
            seconds -= *h;
        }
    }
}

/// Number of quantities in which two cars are compared: torques of engine, car and clutch, N·m, errors of both speeds as read, rad/s, position of the bearing, mm, temperature of
/// the disc, °C.
const QUANTITIES: usize = 7;

impl Instant {
    /// Torque in N·m of a slipping clutch at this slip in rad/s.
    fn slipping(&self, config: &Config, slip: f64) -> f64 {
        slipping(config, &FaceCache::EMPTY, self.bearing, self.memory, self.direction, slip, &self.y).total()
    }

    /// What a car with this configuration does in this state. The clutch torque is that of a slipping clutch, or 0 if the clutch `sticks`.
    fn quantities(&self, config: &Config, sticks: bool) -> [f64; QUANTITIES] {
        let speeds = SPEEDS.map(|k| self.y[k]);
        let engine = engine_torque(config, &self.y, engine_target(config, self.report));
        // A resistance that holds a standing car would also hold it against more torque, so resistance does not count at standstill.
        let omega_v = self.y[index::OMEGA_V];
        let car = -vehicle_resistance(config, omega_v, 0.0) * way(omega_v).abs();
        let clutch = if sticks { 0.0 } else { self.slipping(config, speeds[0] - speeds[1]) };
        let [f, c] = [0, 1].map(|k| sensed::shown(config, k, speeds[k] + self.ahead[k]) - speeds[k]);
        [engine, car, clutch, f, c, self.bearing, self.y[index::THETA_C]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{REGISTRY, Subsystem};
    use crate::gap::infer::density::Point;
    use crate::gap::model::missing;
    use crate::gap::model::prepare::Example;

    /// Root mean square of what `told` leaves of `change`, relative to `change`.
    fn left(change: &[f64], told: &[f64]) -> f64 {
        let square = |values: Vec<f64>| values.iter().map(|x| x * x).sum::<f64>();
        (square(change.iter().zip(told).map(|(a, b)| a - b).collect()) / square(change.to_vec())).sqrt()
    }

    /// Compares the response to every function of every law that shows in launch, creep and modulation with a replay of a tenth of it.
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

    /// For every effect at its usual size, except those of inertias and shafts, the difference between two courses accounts for the change of the innovations. For effects without
    /// memory, a single course suffices.
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
            entry.effect.amplitudes.iter().for_each(|&k| point.effects[k] += entry.scale(k));
            let with = course(&point);
            let change: Vec<f64> = with.innovations.iter().zip(&without.innovations).map(|(a, b)| a - b).collect();
            let [told, at_once] = [with.beyond(&without), with.beyond_at_once(&without)].map(|law| left(&change, &with.response(&law)));
            let untold = ["vehicle_mass", "driveline_compliance"].contains(&entry.id);
            assert!(if untold { told > 0.9 } else { told < 0.15 }, "{}: {told}", entry.id);
            let remembers = ["_lag", "_delay", "_limit", "_backlash", "heat_", "_cooling"].iter().any(|part| entry.id.contains(part));
            assert!(untold || if remembers { at_once > 0.9 } else { at_once < 0.15 }, "{}: {at_once}", entry.id);
        }
    }
}
