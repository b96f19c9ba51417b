//! Replays: the plant driven by a recording's inputs, free or corrected by the filter.

use super::clock::{CONTROL_INTERVAL_S, LONGEST_TICK};
use super::column::Column;
use super::filter::{Filter, STATES, state};
use super::tolerance::{Car, Signal};
use super::track::{Channel, Track};
use super::unknown_clutch;
use super::unseen::sample_of;
use crate::effects::param;
use crate::plant::events::common_speed;
use crate::plant::{Inputs, Outputs, Plant, Start, sensed};
use std::ops::Range;

/// Longest substep of the plant in a replay, s; the error it adds is far below any sensor's noise. One interval of the control unit is one substep even if its stamps jitter.
pub const SUBSTEP_S: f64 = LONGEST_TICK * CONTROL_INTERVAL_S;

/// Torques that the filter adds to the inputs, N·m.
#[derive(Clone, Copy, Debug, Default)]
pub struct Added {
    /// On the flywheel.
    pub flywheel: f64,
    /// On the disc.
    pub disc: f64,
}

/// A law that the model lacks, as torques and sensor errors along a recording, by row. An empty vector stands for zero.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Missing {
    /// Torque on flywheel and disc, N·m.
    pub torque: [Vec<f64>; 2],
    /// Clutch torque on the disc, N·m. It acts on the flywheel with the opposite sign, and the torque transducer shows it.
    pub clutch: Vec<f64>,
    /// Rolling load that the law adds to the car's own, N·m. It opposes motion and holds a standing car. A negative one pushes a moving car and does nothing to a standing one.
    pub rolling: f64,
    /// Direction in which the car moves, from −1 to 1, by row, for a law with a rolling load.
    pub way: Vec<f64>,
    /// Errors of both speeds as sensed, rad/s.
    pub sensed: [Vec<f64>; 2],
    /// Changes of the bench readings of bearing position, mm, and disc temperature, °C.
    pub bench: [Vec<f64>; 2],
    /// Direct change of the whitened innovations without a replay, for a law that consists of nothing else.
    pub innovations: Column,
    /// For a function of an effect's form: the effect, by its index in the registry, and the state along which the function varies the effect, by its index in
    /// [`states`](super::missing::states).
    pub along: Option<(usize, usize)>,
}

impl Missing {
    /// The vectors that a replay uses.
    fn replayed(&self) -> [&Vec<f64>; 7] {
        let ([f, c], [sensed_f, sensed_c], [bearing, disc]) = (&self.torque, &self.sensed, &self.bench);
        [f, c, &self.clutch, sensed_f, sensed_c, bearing, disc]
    }
    fn replayed_mut(&mut self) -> [&mut Vec<f64>; 7] {
        let ([f, c], [sensed_f, sensed_c], [bearing, disc]) = (&mut self.torque, &mut self.sensed, &mut self.bench);
        [f, c, &mut self.clutch, sensed_f, sensed_c, bearing, disc]
    }

    /// Memory in bytes of the vectors that a replay uses.
    pub fn bytes(&self) -> usize {
        self.replayed().into_iter().chain([&self.way]).map(|values| size_of_val(&**values)).sum()
    }

    /// Torques of engine, car and clutch, and errors of both speeds, by row.
    pub fn acting(&self) -> [&Vec<f64>; 5] {
        let ([f, c], [sensed_f, sensed_c]) = (&self.torque, &self.sensed);
        [f, c, &self.clutch, sensed_f, sensed_c]
    }

    /// The law times a factor for each row. Its rolling load and direct innovations stay as they are.
    pub fn times(&self, factor: impl Fn(usize) -> f64) -> Self {
        let mut law = self.clone();
        law.replayed_mut().into_iter().for_each(|values| values.iter_mut().enumerate().for_each(|(row, x)| *x *= factor(row)));
        law
    }

    /// Multiplies the law by `by`.
    pub fn scale(&mut self, by: f64) {
        self.replayed_mut().into_iter().flatten().for_each(|x| *x *= by);
        self.rolling *= by;
        self.innovations = self.innovations.times(by);
    }

    /// Adds `amplitude` times another law, without its direct innovations.
    pub fn add(&mut self, law: &Self, amplitude: f64) {
        for (sum, one) in self.replayed_mut().into_iter().zip(law.replayed()) {
            if sum.len() < one.len() {
                sum.resize(one.len(), 0.0);
            }
            sum.iter_mut().zip(one).for_each(|(s, x)| *s += amplitude * x);
        }
        self.rolling += amplitude * law.rolling;
        if self.way.is_empty() {
            self.way.clone_from(&law.way);
        }
    }

    /// Whether the law changes the innovations only directly, so that no replay is needed.
    pub fn is_linear(&self) -> bool {
        self.rolling == 0.0 && self.replayed().into_iter().all(Vec::is_empty)
    }
    /// Torque on a side at a row, N·m, without a positive rolling load, which can also hold the car and is added to the car's own.
    pub fn torque(&self, side: usize, row: usize) -> f64 {
        let clutch = at(&self.clutch, row);
        let other = if side == 0 { -clutch } else { clutch - self.rolling.min(0.0) * at(&self.way, row) };
        at(&self.torque[side], row) + other
    }
    /// Errors of both speed readings at a row, rad/s.
    pub fn errors_of_reading(&self, row: usize) -> [f64; 2] {
        [0, 1].map(|side| at(&self.sensed[side], row))
    }
    /// A law that consists of a clutch torque on the disc in N·m, by row.
    pub fn of_clutch(torque: Vec<f64>) -> Self {
        Self { clutch: torque, ..Self::default() }
    }
}

/// Value at a row; 0 if the vector is empty.
pub fn at(values: &[f64], row: usize) -> f64 {
    values.get(row).copied().unwrap_or(0.0)
}

/// Slip in rad/s below which a recording that starts closed counts as starting locked.
const LOCKED_SLIP: f64 = 0.6;

/// Upper bound for the threshold of a speed sensor, below which it shows nothing, rad/s.
pub const SENSOR_THRESHOLD: f64 = 10.0;

/// Whether a wheel may be at rest, sample by sample of its speed in rad/s. A known speed counts as rest if it is `slow`. A missing one counts as rest if the last known speed may
/// lie below the sensor's threshold ([`SENSOR_THRESHOLD`]), and not if the sample was lost at a higher speed.
pub fn rests(omega: impl Iterator<Item = f64> + Clone, slow: impl Fn(f64) -> bool) -> impl Iterator<Item = bool> {
    let mut last = omega.clone().find(|v| v.is_finite()).unwrap_or(0.0);
    omega.map(move |speed| {
        last = if speed.is_finite() { speed } else { last };
        if speed.is_finite() { slow(speed.abs()) } else { last.abs() < SENSOR_THRESHOLD }
    })
}

/// Start state at a row, from the speeds measured there. If the clutch is commanded closed and both speeds are nearly equal, it starts locked.
pub fn start(track: &Track, car: &Car, row: usize, theta: [f64; 2], noise: f64) -> Start {
    start_read(track, car, row, theta, noise, [0.0; 2])
}

/// Start state like [`start`], from speeds that are read with these errors, rad/s.
fn start_read(track: &Track, car: &Car, row: usize, theta: [f64; 2], noise: f64, errors: [f64; 2]) -> Start {
    let first = |c: Channel| {
        if let Some((speed, _)) = track.speed_at(c, row) {
            return speed - errors[c as usize];
        }
        // A slow wheel whose sensor shows nothing yet stands still, or nearly.
        let seen = track.measured[c as usize][row..].iter().copied().find(|v| v.is_finite()).unwrap_or(0.0);
        if seen.abs() < SENSOR_THRESHOLD { 0.0 } else { seen }
    };
    let (omega_f, omega_c) =
        (sensed::meant(&car.effects, 0, first(Channel::OmegaF)), sensed::meant(&car.effects, 1, first(Channel::OmegaC)));
    if let Some(unknown) = &track.unknown_clutch {
        // A flywheel that follows its sensor also follows the errors of that sensor.
        let omega_f = unknown.omega_f(track.time[row] + unknown_clutch::age_of_flywheel(car));
        let locked = unknown.locked[track.observation_of(row)];
        let d = &car.vehicle.driveline;
        let common = common_speed([d.J_f, d.J_c], [omega_f - errors[0], omega_c]);
        let [omega_f, omega_c] = if locked { [common; 2] } else { [omega_f, omega_c] };
        return Start { omega_f, omega_c, theta_c: theta[0], theta_b: theta[1] };
    }
    let command = track.ticks[track.tick_of_row[row]].x_to;
    let closed = command > 0.5 * (car.vehicle.actuator.x_cnt_0 + car.vehicle.actuator.x_cls_0);
    let (omega_f, omega_c) = if closed && (omega_f - omega_c).abs() < LOCKED_SLIP.max(6.0 * noise) {
        let mean = 0.5 * (omega_f + omega_c);
        (mean, mean)
    } else {
        (omega_f, omega_c)
    };
    Start { omega_f, omega_c, theta_c: theta[0], theta_b: theta[1] }
}

/// Runs the plant over `rows` from a start state and a slip angle in rad. In each row, `at` is called with the sensor readings there; the torques that it leaves in its last
/// argument are added from then on.
pub fn replay(
    track: &Track,
    car: &Car,
    start: (&Start, f64),
    rows: Range<usize>,
    missing: Option<&Missing>,
    at: impl FnMut(usize, &Outputs, &mut Plant, &mut Added),
) {
    let first = rows.start;
    stepped(track, car, start, first, rows.map(|row| row..row + 1), missing, at);
}

/// Like [`replay`], with one step per group of rows: inputs are averaged over the group, and sensor readings are interpolated linearly between its ends. What `each` does to the
/// plant takes effect at the end of the group of its row; in a group of one row, from that row on.
fn stepped(
    track: &Track,
    car: &Car,
    (start, slip_angle): (&Start, f64),
    first: usize,
    groups: impl Iterator<Item = Range<usize>>,
    missing: Option<&Missing>,
    mut each: impl FnMut(usize, &Outputs, &mut Plant, &mut Added),
) {
    let seen = track.unknown_clutch.as_ref().map(|_| unknown_clutch::without_hidden_effects(car));
    let car = seen.as_ref().unwrap_or(car);
    let loaded = missing.filter(|m| m.rolling > 0.0).map(|m| {
        let mut car = *car;
        car.vehicle.driveline.T_L0 += m.rolling;
        car
    });
    let car = loaded.as_ref().unwrap_or(car);
    let [late_f, late_c, late_report, late_command] =
        [Signal::OmegaF, Signal::OmegaC, Signal::Report, Signal::Command].map(|s| car.late[s as usize]);
    let inputs = |ticks: Range<usize>| {
        // A late report belongs to an earlier torque: the present torque is reported later.
        let tick = track.inputs(ticks, late_report, late_command);
        Inputs { x_to: tick.x_to, t_e_ref: tick.t_e, theta_h: tick.theta_h, t_load: 0.0 }
    };
    let tick = track.tick_of_row[first];
    let mut plant = Plant::new(&car.vehicle, &car.effects, start, &inputs(tick..tick + 1));
    plant.set_max_substep(SUBSTEP_S);
    plant.turn_to(slip_angle);
    let gain = car.effects[param::engine_torque_gain::gain];
    let speed_gain = car.effects[param::clutch_speed_gain::gain];
    let age = unknown_clutch::age_of_flywheel(car);
    let mut added = Added::default();
    let mut accelerations = [0.0; 2];
    let shown = |plant: &Plant, accelerations: [f64; 2]| {
        let mut now = plant.outputs();
        now.omega_f -= late_f * accelerations[0];
        now.omega_c -= late_c * accelerations[1] * speed_gain;
        now
    };
    let with_missing = |mut now: Outputs, row: usize| {
        if let Some(m) = missing {
            now.omega_f += at(&m.sensed[0], row);
            now.omega_c += at(&m.sensed[1], row);
            now.x_to_actual += at(&m.bench[0], row);
            now.t_fc += at(&m.clutch, row);
            now.theta_c += at(&m.bench[1], row);
        }
        now
    };
    // Steps over `ticks` with the mean of the missing torque over `rows`, and returns the accelerations of both sides, rad/s².
    let step = |plant: &mut Plant, ticks: Range<usize>, rows: Range<usize>, added: &Added| {
        let (begin, end) = (track.ticks[ticks.start].time, track.tick_end(ticks.end - 1));
        let mut input = inputs(ticks);
        let on = |side: usize| missing.map_or(0.0, |m| rows.clone().map(|row| m.torque(side, row)).sum::<f64>() / rows.len() as f64);
        input.t_e_ref += (added.flywheel + on(0)) / gain;
        input.t_load -= added.disc + on(1);
        let h = end - begin;
        let before = &plant.state().y;
        let speeds = [before[0], before[1]];
        if let Some(unknown) = track.unknown_clutch.as_ref().filter(|_| !plant.state().stuck) {
            plant.pass_on(&input, h, unknown.omega_f(end + age));
        }
        plant.step(&input, h);
        let after = &plant.state().y;
        [(after[0] - speeds[0]) / h, (after[1] - speeds[1]) / h]
    };
    for rows in groups {
        if let Some(unknown) = &track.unknown_clutch {
            plant.couple(unknown.locked[track.observation_of(rows.start)]);
        }
        let ticks = track.tick_of_row[rows.start]..track.tick_of_row[rows.end];
        let begin = shown(&plant, accelerations);
        if rows.len() == 1 {
            each(rows.start, &with_missing(begin, rows.start), &mut plant, &mut added);
            for k in ticks {
                accelerations = step(&mut plant, k..k + 1, rows.clone(), &added);
            }
            continue;
        }
        let (from, to) = (track.ticks[ticks.start].time, track.tick_end(ticks.end - 1));
        accelerations = step(&mut plant, ticks, rows.clone(), &added);
        let end = shown(&plant, accelerations);
        for row in rows {
            let share = (track.time[row] - from) / (to - from);
            each(row, &with_missing(between(&begin, &end, share), row), &mut plant, &mut added);
        }
    }
}

/// Outputs interpolated linearly at the fraction `share` of the interval between two instants.
fn between(from: &Outputs, to: &Outputs, share: f64) -> Outputs {
    let line = |a: f64, b: f64| a + share * (b - a);
    Outputs {
        omega_f: line(from.omega_f, to.omega_f),
        omega_c: line(from.omega_c, to.omega_c),
        t_e: line(from.t_e, to.t_e),
        t_fc: line(from.t_fc, to.t_fc),
        theta_c: line(from.theta_c, to.theta_c),
        theta_b: line(from.theta_b, to.theta_b),
        x_to_actual: line(from.x_to_actual, to.x_to_actual),
        e_d: line(from.e_d, to.e_d),
        phase: from.phase,
    }
}

/// Steps of a replay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Steps {
    /// From row to row.
    Rows,
    /// From observation to observation, on mean inputs. A position that follows its command at once then shows half a step late, but the difference of two such replays is nearly
    /// that of two replays from row to row, at a fraction of the cost where the logger is fast.
    Observations,
}

/// Whitened innovations of a corrected replay: two per observation, then the bench channels; 0 where there is no sample.
pub fn innovations(track: &Track, filter: &Filter, car: &Car, theta: [f64; 2], missing: Option<&Missing>) -> Vec<f64> {
    innovations_in(Steps::Rows, track, filter, car, theta, missing)
}

/// Like [`innovations`], with the given steps.
pub fn innovations_in(steps: Steps, track: &Track, filter: &Filter, car: &Car, theta: [f64; 2], missing: Option<&Missing>) -> Vec<f64> {
    corrected_in(steps, track, filter, car, theta, missing, |_, _, _| {})
}

/// Clutch torque in N·m at the logger's samples in a corrected replay.
pub fn torques(track: &Track, filter: &Filter, car: &Car, theta: [f64; 2]) -> Vec<f64> {
    let mut all = vec![0.0; sample_of(track, track.rows() - 1) + 1];
    corrected(track, filter, car, theta, None, |row, now, _| {
        all[sample_of(track, row)] = now.t_fc;
    });
    all
}

/// Torques that the filter adds from observation `k` on to a car with these inertias, according to its estimate. The gains belong to one pair of inertias, and their corrections
/// are accelerations: with the same torques, a candidate with other inertias would be corrected by more or less, and gain or lose likelihood by that alone. The torques are
/// therefore scaled by the ratio of the inertias, see [`shares`].
pub fn added(filter: &Filter, k: usize, estimate: &[f64; STATES], inertia: [f64; 2], stuck: bool) -> Added {
    let share = shares(filter, k, inertia, stuck);
    let clutch = estimate[state::CLUTCH];
    Added { flywheel: share[0] * (estimate[state::ENGINE] - clutch), disc: share[1] * (estimate[state::LOAD] + clutch) }
}

/// Correction in N·m that turns the clutch torque of a replay at observation `k` into the filter's prediction of the transducer's reading, given the estimates `before` and after (`now`)
/// that observation's speeds. While the clutch slips the replay's torque is the law's alone, so the estimated disturbance of the clutch is added. While it sticks, the replay's torque holds
/// the speeds together under the disturbances that were added on the way here; it already has their estimates from `before`, and has the clutch's with the wrong sign, for that one is
/// applied as an external pair of torques.
pub fn carried(filter: &Filter, k: usize, [before, now]: [&[f64; STATES]; 2], [j_f, j_c]: [f64; 2], stuck: bool) -> f64 {
    let share = shares(filter, k, [j_f, j_c], stuck)[0];
    if !stuck {
        return share * now[state::CLUTCH];
    }
    let more = |place: usize| now[place] - before[place];
    share * (before[state::CLUTCH] + (j_c * more(state::ENGINE) - j_f * more(state::LOAD)) / (j_f + j_c))
}

/// Factors by which torques that the filter found on flywheel and disc are scaled for a candidate with these inertias: the ratio of the inertias of each side by its own, of both
/// together while the clutch sticks, and of the car while the flywheel is pinned.
fn shares(filter: &Filter, k: usize, [j_f, j_c]: [f64; 2], stuck: bool) -> [f64; 2] {
    let of = filter.inertia;
    if filter.pinned[k] {
        [j_c / of[1]; 2]
    } else if stuck {
        [(j_f + j_c) / (of[0] + of[1]); 2]
    } else {
        [j_f / of[0], j_c / of[1]]
    }
}

/// Runs a corrected replay and returns its whitened innovations. In every row, `each` is called with the sensor readings and the plant.
pub fn corrected(
    track: &Track,
    filter: &Filter,
    car: &Car,
    theta: [f64; 2],
    missing: Option<&Missing>,
    each: impl FnMut(usize, &Outputs, &Plant),
) -> Vec<f64> {
    corrected_in(Steps::Rows, track, filter, car, theta, missing, each)
}

/// Like [`corrected`], with the given steps.
pub fn corrected_in(
    steps: Steps,
    track: &Track,
    filter: &Filter,
    car: &Car,
    theta: [f64; 2],
    missing: Option<&Missing>,
    mut each: impl FnMut(usize, &Outputs, &Plant),
) -> Vec<f64> {
    let n = track.observations();
    let mut speeds = Vec::with_capacity(2 * n + filter.bench.iter().map(Vec::len).sum::<usize>());
    let mut bench: [Vec<f64>; 3] = [Vec::new(), Vec::new(), Vec::new()];
    let noise = 1.0 / filter.gains.iter().map(|g| g.weight[0]).fold(1e-3, f64::max);
    let speed_gain = car.effects[param::clutch_speed_gain::gain];
    let begin = start_read(track, car, 0, theta, noise, missing.map_or([0.0; 2], |law| law.errors_of_reading(0)));
    let mut estimate = [0.0; STATES];
    let mut lasting = [0.0; 3];
    let mut sums = [(0.0, 0_usize); 5];
    let mut k = 0;
    let mut last_row = track.rows_of(0).end - 1;
    let groups = (0..n).flat_map(|k| {
        let rows = track.rows_of(k);
        let (count, length) = if steps == Steps::Observations { (1, rows.len()) } else { (rows.len(), 1) };
        (0..count).map(move |i| rows.start + i * length..rows.start + (i + 1) * length)
    });
    stepped(track, car, (&begin, track.slip_angle_0), 0, groups, missing, |row, now, plant, added| {
        each(row, now, plant);
        for (c, predicted) in [now.omega_f, now.omega_c, now.x_to_actual, now.t_fc, now.theta_c].into_iter().enumerate() {
            let error = track.measured[c].get(row).map_or(f64::NAN, |y| y - predicted);
            if error.is_finite() {
                sums[c] = (sums[c].0 + error, sums[c].1 + 1);
            }
        }
        if row < last_row {
            return;
        }
        let gain = &filter.gains[k];
        let mean = |c: usize| sums[c].0 / sums[c].1.max(1) as f64;
        let before = estimate;
        for (c, innovation) in gain.innovations([mean(0), mean(1)], &mut estimate).into_iter().enumerate() {
            speeds.push(innovation.map_or(0.0, |innovation| innovation * gain.weight[c]));
            let Some(innovation) = innovation else { continue };
            let of = &gain.of[c];
            // A speed that is sensed late describes an earlier instant; the missing torques that it reveals have changed the speeds since then.
            let rate = filter.accelerations(k, of).map(|rate| rate * innovation);
            plant.correct_speeds([of[0] * innovation, of[1] * innovation / speed_gain], rate, c);
            plant.correct_shafts(filter.load_torque(k, of, plant.state().stuck) * innovation);
        }
        if filter.stands[k] {
            plant.hold_car();
        }
        let d = &plant.config().constants.driveline;
        let (inertia, stuck) = ([d.J_f, d.J_c], plant.state().stuck);
        let beyond = [0.0, carried(filter, k, [&before, &estimate], inertia, stuck), 0.0];
        for (c, gains) in filter.bench.iter().enumerate().filter(|(_, g)| !g.is_empty()) {
            bench[c].push(gains[k].innovation(mean(c + 2) - beyond[c], &mut lasting[c]));
        }
        estimate.iter_mut().zip(gain.decay).skip(2).for_each(|(e, d)| *e *= d);
        *added = self::added(filter, k, &estimate, inertia, stuck);
        sums = Default::default();
        k += 1;
        if k < n {
            last_row = track.rows_of(k).end - 1;
        }
    });
    speeds.extend(bench.into_iter().flatten());
    speeds
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Torques on one side and of the clutch add up, and still do after laws are added and scaled.
    #[test]
    fn a_torque_of_the_clutch_pulls_the_other_way_on_the_flywheel() {
        let mut law = Missing::of_clutch(vec![4.0, 6.0]);
        law.torque[0] = vec![1.0];
        (law.rolling, law.way) = (3.0, vec![0.5, 1.0]);
        let mut sum = Missing { sensed: [Vec::new(), vec![0.5]], ..Missing::default() };
        sum.add(&law, 2.0);
        sum.scale(0.5);
        assert_eq!((sum.torque(0, 0), sum.torque(1, 0)), (-3.0, 4.0));
        assert_eq!((sum.torque(0, 1), sum.torque(1, 1), sum.torque(1, 2)), (-6.0, 6.0, 0.0));
        // A negative rolling load pushes the car in proportion to its direction of motion; a positive one is part of the car's own.
        sum.rolling = -3.0;
        assert_eq!((sum.torque(0, 1), sum.torque(1, 0), sum.torque(1, 1), sum.torque(1, 2)), (-6.0, 5.5, 9.0, 0.0));
        assert!(!Missing { rolling: 1.0, ..Missing::default() }.is_linear());
        assert!(sum.sensed[1] == [0.25] && sum.bench.concat().is_empty() && !sum.is_linear() && Missing::default().is_linear());
    }

    /// Each speed is corrected by the error of its own sensor, a common speed by the mean of both errors.
    #[test]
    fn a_start_is_what_was_read_less_the_errors_of_reading() {
        for (slip, x, expected) in [(60.0, 0.0, [98.0, 41.0]), (0.3, 9.0, [99.35, 99.35])] {
            let mut r = crate::gap::free::tests::recording(30, |_| [100.0, 100.0 - slip], 0.0);
            r.x_to_cmd.fill(x);
            let (track, car) = (Track::new(&r), Car::nominal(&crate::vehicle::Vehicle::paper()));
            let of = |errors| {
                let s = start_read(&track, &car, 0, [25.0; 2], 1.0, errors);
                [s.omega_f, s.omega_c]
            };
            let read = if slip < 1.0 { [100.0 - 0.5 * slip; 2] } else { [100.0, 100.0 - slip] };
            for (errors, expected) in [([0.0; 2], read), ([2.0, -1.0], expected)] {
                assert!(of(errors).iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{:?}", of(errors));
            }
        }
    }

    /// By the balances of flywheel and car, worked out for the torques that act on each once the filter knows them.
    #[test]
    fn a_transducer_shows_what_the_filter_found_the_clutch_to_carry() {
        let filter = Filter { inertia: [0.2, 1.8], pinned: vec![false], ..Filter::default() };
        let of = |engine, load, clutch| {
            let mut e = [0.0; STATES];
            (e[state::ENGINE], e[state::LOAD], e[state::CLUTCH]) = (engine, load, clutch);
            e
        };
        let (before, now, inertia) = (of(10.0, -4.0, 3.0), of(16.0, -2.0, 5.0), [0.3, 2.7]);
        assert!((carried(&filter, 0, [&before, &now], inertia, false) - 1.5 * 5.0).abs() < 1e-12);
        let on = added(&filter, 0, &before, inertia, true);
        let held = |on_f: f64, on_c: f64| on_f - inertia[0] * (on_f + on_c) / (inertia[0] + inertia[1]);
        let expected = held(1.5 * 16.0, 1.5 * -2.0) - held(on.flywheel, on.disc);
        assert!((carried(&filter, 0, [&before, &now], inertia, true) - expected).abs() < 1e-12);
    }

    #[test]
    fn memory_of_a_law_is_that_of_all_its_rows() {
        let law = Missing {
            torque: [vec![0.0; 3], Vec::new()],
            sensed: [Vec::new(), vec![0.0; 2]],
            way: vec![0.0],
            ..Missing::of_clutch(vec![0.0])
        };
        assert_eq!((law.bytes(), Missing::default().bytes()), (7 * 8, 0));
    }

    /// A push that exceeds the car's own rolling load sets a standing car in motion, unless a law adds a rolling load greater than the excess.
    #[test]
    fn a_rolling_load_of_a_law_holds_a_standing_car() {
        let r = crate::gap::free::tests::recording(300, |_| [100.0, 0.0], 0.0);
        let (track, car) = (Track::new(&r), Car::nominal(&crate::vehicle::Vehicle::paper()));
        let push = car.vehicle.driveline.T_L0 + 4.0;
        let rest = Start { omega_f: 100.0, omega_c: 0.0, theta_c: 25.0, theta_b: 25.0 };
        let reached = |rolling: f64| {
            let law = Missing { torque: [Vec::new(), vec![push; track.rows()]], rolling, ..Missing::default() };
            let mut omega_c = 0.0;
            replay(&track, &car, (&rest, 0.0), 0..track.rows(), Some(&law), |_, now, _, _| omega_c = now.omega_c);
            omega_c
        };
        let [free, held] = [0.0, 8.0].map(reached);
        assert!(free > 5.0 && held < car.vehicle.driveline.omega_L, "{free} {held}");
    }
}
