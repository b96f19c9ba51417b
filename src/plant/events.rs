//! The stick-slip state machine: lock-up, break-away and contact are located inside a substep.
//!
//! ```text
//!            slip reaches 0 and |T_hold| ≤ T_cap(0)
//!   slipping ------------------------------------> stuck
//!            <------------------------------------
//!                    |T_hold| > T_cap(0)
//! ```
//!
//! `Open` and `Slipping` have the same equations of motion and are distinguished by contact. Where the slip reaches 0 and the clutch cannot hold, it continues to slip in the
//! other direction.

use super::actuation::{self, Chain, Way};
use super::clutch::{self, FaceCache};
use super::config::{Config, Coupling};
use super::history::Signal;
use super::motion::{self, Motion, Setting, index};
use super::rest::{self, Rest};
use super::sensed;
use super::{Inputs, Phase, Plant, Start, State};

/// Value of an event function, slip in rad/s or torque in N·m, below which the event counts as located.
const EVENT_TOLERANCE: f64 = 1e-12;

/// Maximum number of search steps for an event; a search usually needs five.
pub const LOCATE_ITERATIONS: usize = 60;

/// Maximum number of stick-slip switches in one substep. A clutch that chatters more often is settled: once its sides meet again, they stay together until the end of the
/// substep.
pub const EVENTS_PER_SUBSTEP: usize = 8;

/// Maximum number of pieces into which one substep is cut by contact, by events and by the actuation chain.
pub const PIECES_PER_SUBSTEP: usize = 64;

/// Maximum number of inner iterations of one substep: each piece may search for contact and is then integrated, each switch is searched for, and the rest is integrated in two
/// parts, before and after both sides meet for the last time.
pub const ITERATIONS_PER_SUBSTEP: usize = PIECES_PER_SUBSTEP * (LOCATE_ITERATIONS + 1) + (EVENTS_PER_SUBSTEP + 1) * LOCATE_ITERATIONS + 2;

/// Relative length below which the remainder of a step is rounding.
const SLIVER: f64 = 1e-9;

/// Initial state, before the actuation chain is put into its steady state and the phase is determined.
pub fn initial(start: &Start, inputs: &Inputs) -> State {
    let mut y = [0.0; motion::N];
    y[index::OMEGA_F] = start.omega_f;
    y[index::OMEGA_C] = start.omega_c;
    y[index::OMEGA_V] = start.omega_c;
    y[index::THETA_C] = start.theta_c;
    y[index::THETA_B] = start.theta_b;
    State {
        time: 0.0,
        filtered: [start.omega_f, start.omega_c],
        y,
        stuck: false,
        direction: 1.0,
        rest: Rest::default(),
        engine: Default::default(),
        limited: 0.0,
        lagged: Default::default(),
        led: 0.0,
        bearing: 0.0,
        memory: Default::default(),
        presliding: Default::default(),
        inputs: *inputs,
    }
}

/// Determines phase and direction of slip at the start; shafts begin without twist.
pub fn settle_phase(config: &Config, state: &mut State) {
    let slip = motion::slip(&state.y);
    if slip == 0.0 { decide_at_zero_slip(config, state) } else { state.direction = slip.signum() }
}

/// With both sides at the same speed: the clutch sticks if it can hold, else it slips in the direction of the holding torque.
fn decide_at_zero_slip(config: &Config, state: &mut State) {
    let hold = motion::sticking_torque(config, &state.y, state.engine.value, state.inputs.t_load, &state.rest);
    let most = clutch::capacity(config, state.bearing, state.memory, 0.0, &state.y);
    state.stuck = hold.abs() <= most && most > 0.0;
    if !state.stuck {
        state.direction = 1.0_f64.copysign(hold);
    }
}

/// Current clutch torque, N·m.
pub fn clutch_torque(config: &Config, found: &FaceCache, s: &State) -> f64 {
    if s.stuck {
        motion::sticking_torque(config, &s.y, s.engine.value, s.inputs.t_load, &s.rest)
    } else if let Some(Coupling::Torque(torque)) = config.coupling {
        torque
    } else {
        motion::slipping(config, found, &s.y, s.direction, s.memory, s.bearing).total()
    }
}

/// Current phase.
pub fn phase(config: &Config, found: &FaceCache, s: &State) -> Phase {
    if s.stuck {
        Phase::Locked
    } else if config.coupling.is_some() || found.with_position(config, s.bearing, &s.y).engaged(config) {
        Phase::Slipping
    } else {
        Phase::Open
    }
}

/// Common speed that conserves the momentum of two inertias (kg·m²) at two speeds (rad/s).
pub fn common_speed(j: [f64; 2], omega: [f64; 2]) -> f64 {
    (j[0] * omega[0] + j[1] * omega[1]) / (j[0] + j[1])
}

/// See [`Plant::correct_speeds`].
pub fn correct_speeds(state: &mut State, omega_f: f64, omega_c: f64) {
    let y = &mut state.y;
    y[index::OMEGA_F] += omega_f;
    y[index::OMEGA_C] += omega_c;
    y[index::OMEGA_V] += omega_c;
    (state.rest.car, state.rest.engine) = (false, false);
    let slip = motion::slip(y);
    if !state.stuck && slip != 0.0 {
        state.direction = slip.signum();
    }
}

/// See [`Plant::step`].
pub fn step(plant: &mut Plant, inputs: &Inputs, h: f64) {
    let start = plant.state.time;
    let end = start + h;
    let delayed = plant.config.constants.command_delay > 0.0;
    if delayed && inputs.x_to != plant.state.inputs.x_to {
        plant.history.push(Signal::Command, start, inputs.x_to);
    }
    plant.state.inputs = *inputs;
    plant.iterations = 0;
    settle_rest(plant);
    let count = substeps(plant, h);
    for k in 1..=count as u64 {
        let until = if k as f64 == count { end } else { start + h * (k as f64 / count) };
        substep(plant, until, delayed);
        plant.found = look(&plant.config, &plant.state);
        sensed::record(&plant.config, &plant.state, &mut plant.history);
    }
}

/// Decides whether car and engine stand or move, with the inputs of the step that begins.
fn settle_rest(plant: &mut Plant) {
    let (config, state) = (&plant.config, &mut plant.state);
    if state.rest.brake > 0.0 || state.rest.car || state.y[index::OMEGA_F] == 0.0 {
        let chain = actuation::advance(config, state, state.inputs.x_to, 0.0);
        rest::settle(config, state, &chain);
    }
}

/// Number of substeps of a step of `h` seconds.
pub fn substeps(plant: &Plant, h: f64) -> f64 {
    let speeds = [plant.state.y[index::OMEGA_F], plant.state.y[index::OMEGA_C]];
    let longest = plant.config.pace.longest_substep(plant.max_substep).min(plant.config.pace.pulse(speeds, plant.max_substep));
    (h / longest * (1.0 - SLIVER)).ceil().max(1.0)
}

/// Position and radius of the faces for the outputs and the next substep; empty for a stuck clutch, for which neither is needed.
fn look(config: &Config, s: &State) -> FaceCache {
    if s.stuck {
        return FaceCache::EMPTY;
    }
    let found = FaceCache::EMPTY.with_position(config, s.bearing, &s.y);
    if found.engaged(config) { found.with_radius(config, clutch::along(s.direction, motion::slip(&s.y))) } else { found }
}

/// Integrates to `until`, from event to event.
fn substep(plant: &mut Plant, until: f64, delayed: bool) {
    let (mut switches, mut pieces) = (0, 0);
    loop {
        let (config, state, found, iterations) = (&plant.config, &mut plant.state, &plant.found, &mut plant.iterations);
        let mut h = until - state.time;
        if h <= SLIVER * plant.max_substep {
            state.time = until;
            return;
        }
        let last = pieces >= PIECES_PER_SUBSTEP;
        let mut x_cmd = state.inputs.x_to;
        if delayed {
            let lag = config.constants.command_delay;
            let line = plant.history.line(Signal::Command);
            x_cmd = line.held(state.time - lag).unwrap_or(x_cmd);
            if let Some(event) = line.next_event(state.time - lag).filter(|_| !last) {
                h = h.min((event + lag - state.time).max(SLIVER * plant.max_substep));
            }
        }
        if !last {
            h = h.min(actuation::smooth_for(config, state, x_cmd, plant.max_substep));
        }
        pieces += 1;
        let settled = last || switches >= EVENTS_PER_SUBSTEP;
        let mut way = actuation::way(config, state, x_cmd, h);
        if !settled {
            let contact = until_contact(config, state, x_cmd, h, &way, iterations);
            if contact != h {
                (h, way) = (contact, actuation::way(config, state, x_cmd, contact));
            }
        }
        switches += usize::from(smooth_piece(config, state, found, x_cmd, h, &way, settled, iterations));
    }
}

/// Time in s, at most `h`, until a moving bearing makes or breaks contact.
fn until_contact(config: &Config, state: &State, x_cmd: f64, h: f64, way: &Way, iterations: &mut u64) -> f64 {
    if actuation::immediate(config) || config.coupling.is_some() {
        return h;
    }
    let (theta, work) = (state.y[index::THETA_C], state.y[index::E_D]);
    let (begin, end) = (way.begin.drive().x, way.end.drive().x);
    if begin == end {
        return h;
    }
    let touches = |x: f64| clutch::engaged_after(config, x, theta, work);
    let before = touches(begin);
    if before == touches(end) {
        return h;
    }
    let (mut low, mut high) = (0.0, h);
    *iterations += LOCATE_ITERATIONS as u64;
    for _ in 0..LOCATE_ITERATIONS {
        let middle = 0.5 * (low + high);
        if touches(actuation::advance(config, state, x_cmd, middle).drive().x) == before { low = middle } else { high = middle }
    }
    high
}

fn setting(config: &Config, state: &State, found: &FaceCache, way: &Way) -> Setting {
    let found = found.with_position(config, way.middle.drive().x, &state.y);
    Setting {
        stuck: state.stuck,
        direction: state.direction,
        engaged: config.coupling.is_some() || found.engaged(config),
        found,
        memory: state.memory,
        rest: state.rest,
        theta_h: state.inputs.theta_h,
        t_load: state.inputs.t_load,
    }
}

fn integrate(config: &Config, state: &State, setting: &Setting, x_cmd: f64, h: f64, way: &Way) -> Motion {
    let immediate = actuation::immediate(config);
    let drive = if immediate { [way.end.drive(); 3] } else { actuation::stages(config, state, x_cmd, h, way) };
    motion::runge_kutta(config, setting, &state.y, drive, h)
}

/// Length of the integration step from which the accelerations at the ends of a piece are computed, s.
const MOMENT: f64 = 1e-6;

/// Advances the sensors' filters over a piece with the chain `way`, which ends in `y` and `end`. It is a separate function because most plants have no filters. The
/// accelerations come from an integration step of length [`MOMENT`], because another copy of the balances would slow down every plant.
#[cold]
#[inline(never)]
fn filter_speeds(config: &Config, state: &mut State, found: &FaceCache, way: &Way, (y, end): (&Motion, &Chain), h: f64) {
    let setting = setting(config, state, found, way);
    let at = |y: &Motion, chain: Chain| {
        let later = integrate(
            config,
            &State { y: *y, ..*state },
            &setting,
            state.inputs.x_to,
            MOMENT,
            &Way { begin: chain, middle: chain, end: chain },
        );
        [index::OMEGA_F, index::OMEGA_C].map(|i| (later[i] - y[i]) / MOMENT)
    };
    let accelerations = [at(&state.y, way.begin), at(y, *end)];
    sensed::advance(config, state, y, accelerations, h);
}

fn accept(config: &Config, state: &mut State, y: Motion, chain: &Chain, h: f64) {
    state.y = y;
    state.time += h;
    chain.store(state);
    actuation::remember(config, state);
    if config.remembers() {
        state.memory = clutch::advance_branch(config, state.memory, state.bearing);
    }
}

/// Integrates over `h`, or up to the first switch inside it; returns true if it ended in a switch. A `settled` clutch sticks once its sides meet and does not break away.
#[allow(clippy::too_many_arguments)]
fn smooth_piece(
    config: &Config,
    state: &mut State,
    found: &FaceCache,
    x_cmd: f64,
    h: f64,
    way: &Way,
    settled: bool,
    iterations: &mut u64,
) -> bool {
    *iterations += 1;
    // A coupling that replaces the clutch law decides by itself whether both sides turn as one: there is no event to locate.
    if config.coupling.is_some() {
        let y = integrate(config, state, &setting(config, state, found, way), x_cmd, h, way);
        if config.filters() {
            filter_speeds(config, state, found, way, (&y, &way.end), h);
        }
        accept(config, state, y, &way.end, h);
        return false;
    }
    if state.stuck && !settled && overload(config, state, &state.y, &way.begin) > 0.0 {
        way.begin.store(state);
        break_away(config, state);
        return true;
    }
    let setting = setting(config, state, found, way);
    // Event function of the clutch, positive once it breaks away or both sides meet.
    let meets = |y: &Motion, chain: &Chain| match setting.stuck {
        true if settled => 0.0,
        true => overload(config, state, y, chain),
        false => -setting.direction * motion::slip(y),
    };
    // A settled clutch no longer checks for a standstill; the next step does.
    let stands = |y: &Motion, chain: &Chain| if settled { [f64::NEG_INFINITY; 2] } else { rest::passed(config, state, y, chain) };
    let passed = |y: &Motion, chain: &Chain| {
        let [car, engine] = stands(y, chain);
        meets(y, chain).max(car).max(engine)
    };
    let y = integrate(config, state, &setting, x_cmd, h, way);
    let after = passed(&y, &way.end);
    if after <= 0.0 {
        if config.filters() {
            filter_speeds(config, state, found, way, (&y, &way.end), h);
        }
        accept(config, state, y, &way.end, h);
        return false;
    }
    let before = passed(&state.y, &way.begin);
    let mut bracket = Bracket { low: 0.0, high: h, at_low: before.min(0.0), at_high: after };
    let faces = found;
    let mut found = (y, way.end);
    for _ in 0..LOCATE_ITERATIONS {
        let Some(middle) = bracket.next() else { break };
        *iterations += 1;
        let part = actuation::way(config, state, x_cmd, middle);
        let y = integrate(config, state, &setting, x_cmd, middle, &part);
        let value = passed(&y, &part.end);
        if bracket.narrow(middle, value) {
            found = (y, part.end);
        }
        if value.abs() < EVENT_TOLERANCE && value > 0.0 {
            break;
        }
    }
    let clutch = meets(&found.0, &found.1) > 0.0;
    let [car, engine] = stands(&found.0, &found.1).map(|p| p > 0.0);
    let high = bracket.high;
    if config.filters() {
        filter_speeds(config, state, faces, way, (&found.0, &found.1), high);
    }
    accept(config, state, found.0, &found.1, high);
    if car {
        rest::switch_car(config, state, &found.1);
    }
    if engine {
        rest::switch_engine(config, state, &found.1);
    }
    match (clutch, setting.stuck) {
        (true, true) => break_away(config, state),
        (true, false) => {
            meet(config, state);
            state.stuck |= settled;
        }
        (false, _) => (),
    }
    true
}

/// Interval that contains an event: the event function is not positive at `low` and positive at `high`.
struct Bracket {
    low: f64,
    high: f64,
    at_low: f64,
    at_high: f64,
}

impl Bracket {
    /// Next point of the search, by regula falsi in the Illinois form; `None` once the interval is down to rounding.
    fn next(&self) -> Option<f64> {
        if self.high - self.low <= 4.0 * f64::EPSILON * self.high {
            return None;
        }
        let secant = self.high - self.at_high * (self.high - self.low) / (self.at_high - self.at_low);
        Some(if secant > self.low && secant < self.high { secant } else { 0.5 * (self.low + self.high) })
    }

    /// Narrows the interval by the value at `x`; returns true if the event lies before `x`.
    fn narrow(&mut self, x: f64, value: f64) -> bool {
        if value > 0.0 {
            // The value at the end that stays is halved; otherwise the secant would converge slowly.
            self.at_low *= 0.5;
            (self.high, self.at_high) = (x, value);
            true
        } else {
            self.at_high *= 0.5;
            (self.low, self.at_low) = (x, value);
            false
        }
    }
}

/// Excess of the holding torque over the capacity of a stuck clutch, N·m; negative while it holds. A clutch without capacity holds nothing, not even a torque of zero.
fn overload(config: &Config, state: &State, y: &Motion, chain: &Chain) -> f64 {
    let drive = chain.drive();
    let hold = motion::sticking_torque(config, y, drive.t_e, state.inputs.t_load, &state.rest);
    let most = clutch::capacity(config, drive.x, state.memory, 0.0, y);
    if most > 0.0 { hold.abs() - most } else { hold.abs().max(f64::MIN_POSITIVE) }
}

fn break_away(config: &Config, state: &mut State) {
    let hold = motion::sticking_torque(config, &state.y, state.engine.value, state.inputs.t_load, &state.rest);
    state.stuck = false;
    state.direction = 1.0_f64.copysign(hold);
}

/// Handles a slip of zero: both sides take the common speed that conserves momentum, then the clutch sticks or continues to slip.
fn meet(config: &Config, state: &mut State) {
    join(config, state);
    decide_at_zero_slip(config, state);
}

/// Gives both sides the common speed that conserves momentum, or 0 if one of them is held at a standstill.
pub fn join(config: &Config, state: &mut State) {
    let d = &config.constants.driveline;
    let stands = state.rest.engine || state.rest.car && !config.compliant();
    let common =
        if stands { 0.0 } else { common_speed([d.J_f, config.disc_inertia()], [state.y[index::OMEGA_F], state.y[index::OMEGA_C]]) };
    state.y[index::OMEGA_F] = common;
    state.y[index::OMEGA_C] = common;
    if !config.compliant() {
        state.y[index::OMEGA_V] = common;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{self, param};
    use crate::vehicle::Vehicle;

    /// A plant with flywheel and disc at these speeds, disengaged or closed; the vehicle has 0.2 and 0.6 kg·m².
    fn plant(speeds: [f64; 2], x_to: f64, set: &[(usize, f64)]) -> Plant {
        let (mut vehicle, mut parameters) = (Vehicle::paper(), effects::null());
        (vehicle.driveline.J_f, vehicle.driveline.J_c) = (0.2, 0.6);
        set.iter().for_each(|&(k, value)| parameters[k] = value);
        let start = Start { omega_f: speeds[0], omega_c: speeds[1], theta_c: 60.0, theta_b: 60.0 };
        Plant::new(&vehicle, &parameters, &start, &Inputs { x_to, theta_h: 60.0, ..Inputs::default() })
    }

    #[test]
    fn both_sides_meet_at_the_speed_that_keeps_their_momentum() {
        use param::driveline_compliance::{compliance, disc_share};
        // Behind elastic shafts the disc meets with its own inertia, and the car keeps its speed.
        for (set, common, behind) in [
            (&[][..], (0.2 * 10.0 + 0.6 * 6.0) / 0.8, 7.0),
            (&[(compliance, 1e-3), (disc_share, 0.5)][..], (0.2 * 10.0 + 0.3 * 6.0) / 0.5, 6.0),
        ] {
            let mut plant = plant([10.0, 6.0], 8.0, set);
            meet(&plant.config, &mut plant.state);
            let y = &plant.state.y;
            assert!((y[index::OMEGA_F] - common).abs() < 1e-12 && y[index::OMEGA_C] == y[index::OMEGA_F], "{y:?}");
            assert!((y[index::OMEGA_V] - behind).abs() < 1e-12, "{y:?}");
            assert!(plant.state.stuck, "a closed clutch holds");
        }
    }

    /// A standing engine or, without elastic shafts between, a standing car leaves the locked driveline at rest.
    #[test]
    fn what_stands_keeps_a_locked_driveline_at_rest() {
        use param::driveline_compliance::{compliance, disc_share};
        let speed = |engine: bool, car: bool, set: &[(usize, f64)]| {
            let mut plant = plant([10.0, 6.0], 8.0, set);
            (plant.state.rest.engine, plant.state.rest.car) = (engine, car);
            join(&plant.config, &mut plant.state);
            plant.state.y[index::OMEGA_F]
        };
        assert_eq!([speed(true, false, &[]), speed(false, true, &[])], [0.0; 2]);
        assert!((speed(false, false, &[]) - 7.0).abs() < 1e-12);
        let elastic = [(compliance, 1e-3), (disc_share, 0.5)];
        assert_eq!(speed(true, false, &elastic), 0.0);
        assert!((speed(false, true, &elastic) - 7.6).abs() < 1e-12, "the disc does not stand with the car");
    }

    /// The clutch is settled as it is after more switches than one substep allows.
    #[test]
    fn a_settled_clutch_neither_breaks_away_nor_slips_past_zero() {
        let smooth = |plant: &mut Plant, h: f64| {
            let (x, found) = (plant.state.inputs.x_to, plant.found);
            let way = actuation::way(&plant.config, &plant.state, x, h);
            smooth_piece(&plant.config, &mut plant.state, &found, x, h, &way, true, &mut 0)
        };
        let mut meets = plant([100.5, 100.0], 6.0, &[]);
        assert!(smooth(&mut meets, 0.1), "slip is gone within the piece");
        assert!(meets.state.stuck && meets.slip() == 0.0 && meets.state.time < 0.1);
        let dissipated = meets.energy().dissipated;
        assert!(dissipated > 0.0);
        // The opened clutch would break away, but it stays settled until the substep ends.
        meets.state.bearing = 0.0;
        meets.state.inputs.x_to = 0.0;
        meets.state.inputs.t_e_ref = 50.0;
        assert!(!smooth(&mut meets, 1e-3) && meets.state.stuck && meets.energy().dissipated == dissipated);
        meets.step(&Inputs { t_e_ref: 50.0, theta_h: 60.0, ..Inputs::default() }, 1e-3);
        assert!(!meets.state.stuck, "the next one lets it go");
    }
}
