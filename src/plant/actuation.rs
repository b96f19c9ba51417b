//! From commands to engine torque and bearing position.
//!
//! Command → delay → rate limit → lag → learned time constants → release friction → offset and play → bearing; report → gain and bias → lag, with a learned change of its time
//! constant → crankshaft. Inputs are held over a substep, so the chain is solved exactly at its start, middle and end, and no lag is stiff, however short it is.

use super::clutch::Branch;
use super::config::Config;
use super::rate_limit::{behind_the_limit, rate_limited};
use super::{MAX_SUBSTEP, State};
use crate::effects::empirical;
use crate::physics::lag::{self, LagState};

/// Engine torque in N·m and bearing position in mm at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// Torque on the crankshaft.
    pub t_e: f64,
    /// Bearing position.
    pub x: f64,
}

/// States of the actuation chain at one instant.
#[derive(Clone, Copy, Debug)]
pub struct Chain {
    engine: LagState,
    limited: f64,
    lagged: LagState,
    led: f64,
    bearing: f64,
}

impl Chain {
    /// Engine torque and bearing position at this instant.
    #[inline]
    pub fn drive(&self) -> Drive {
        Drive { t_e: self.engine.value, x: self.bearing }
    }

    /// Writes the chain into the state.
    #[inline]
    pub fn store(&self, state: &mut State) {
        state.engine = self.engine;
        state.limited = self.limited;
        state.lagged = self.lagged;
        state.led = self.led;
        state.bearing = self.bearing;
    }
}

/// Chain at the start, in the middle and at the end of a piece.
#[derive(Clone, Copy, Debug)]
pub struct Way {
    /// Start, after any immediate response to a jump of the command.
    pub begin: Chain,
    /// Middle.
    pub middle: Chain,
    /// End.
    pub end: Chain,
}

/// The chain over `h` seconds with the (delayed) command `x_cmd` held.
#[inline]
pub fn way(config: &Config, state: &State, x_cmd: f64, h: f64) -> Way {
    let end = advance(config, state, x_cmd, h);
    if immediate(config) {
        return Way { begin: end, middle: end, end };
    }
    Way { begin: advance(config, state, x_cmd, 0.0), middle: advance(config, state, x_cmd, 0.5 * h), end }
}

/// Whether engine and bearing follow their commands without any dynamics, so that a held command gives the same drive throughout a substep.
#[inline]
pub fn immediate(config: &Config) -> bool {
    let c = &config.constants;
    let engine = c.engine_lag.time_constant <= 0.0 && !config.empirical.engine_time;
    engine && c.actuator_lag.time_constant <= 0.0 && c.inverse_speed <= 0.0 && !config.empirical.slow
}

/// Torque on the crankshaft in steady state for a reported torque, N·m.
#[inline]
pub fn engine_target(config: &Config, report: f64) -> f64 {
    config.constants.engine_gain * report + config.constants.engine_bias
}

/// Chain after `h` seconds with the (delayed) command `x_cmd` held.
#[inline]
pub fn advance(config: &Config, state: &State, x_cmd: f64, h: f64) -> Chain {
    let Actuated { limited, lagged, led, bearing } = actuate(config, state, x_cmd, h);
    Chain { engine: engine(config, state, h), limited, lagged, led, bearing }
}

/// Lag of the engine torque with the learned change of its time constant, at a requested torque of `target` N·m that the engine is `short` N·m below.
#[inline]
fn engine_lag(config: &Config, target: f64, short: f64) -> lag::Lag {
    let known = config.constants.engine_lag;
    if !config.empirical.engine_time {
        return known;
    }
    let time_constant = empirical::engine_time(&config.parameters, short, target, known.time_constant);
    lag::Lag { time_constant, ..known }
}

/// Torque on the crankshaft after `h` seconds.
#[inline]
fn engine(config: &Config, state: &State, h: f64) -> LagState {
    let lag = &config.constants.engine_lag;
    let target = engine_target(config, state.inputs.t_e_ref);
    match lag.time_constant > 0.0 || config.empirical.engine_time {
        true if h == 0.0 => state.engine,
        true if config.empirical.engine_time => learned_engine(config, state, target, h),
        true => lag::advance(lag, state.engine, target, 0.0, h),
        false => LagState { value: target, rate: 0.0 },
    }
}

/// As [`engine`], with a learned time constant. A first-order lag is solved exactly; a second-order lag takes the time constant at the middle of the step.
fn learned_engine(config: &Config, state: &State, target: f64, h: f64) -> LagState {
    let known = &config.constants.engine_lag;
    let short = target - state.engine.value;
    if known.time_constant > 0.0 && known.curvature >= lag::FIRST_ORDER {
        let middle = lag::advance(&engine_lag(config, target, short), state.engine, target, 0.0, 0.5 * h);
        return lag::advance(&engine_lag(config, target, target - middle.value), state.engine, target, 0.0, h);
    }
    let left = empirical::engine_approach(&config.parameters, short, target, known.towards(short), h);
    LagState { value: target - left, rate: 0.0 }
}

/// States of the actuator's part of the chain, behind the delayed command.
struct Actuated {
    limited: f64,
    lagged: LagState,
    led: f64,
    bearing: f64,
}

/// Actuator and bearing after `h` seconds with the (delayed) command `x_cmd` held.
#[inline]
fn actuate(config: &Config, state: &State, x_cmd: f64, h: f64) -> Actuated {
    let c = &config.constants;
    let limited = rate_limited(c.inverse_speed, c.approach, state.limited, x_cmd, h);
    let lagged = match c.actuator_lag.time_constant > 0.0 {
        true if h == 0.0 => state.lagged,
        // A command that jumps at the start of the substep counts as held over the substep.
        true if c.inverse_speed <= 0.0 => lag::advance(&c.actuator_lag, state.lagged, x_cmd, 0.0, h),
        true => behind_the_limit(config, state, x_cmd, limited, h),
        false => LagState { value: limited, rate: 0.0 },
    };
    let led = if config.empirical.slow { learned(config, state, lagged.value, h) } else { lagged.value };
    let mut pushed = if c.release.width > 0.0 { led - held_back(config, follow(config, state.presliding, led)) } else { led };
    let mut reach = 0.5 * c.play;
    if config.empirical.actuator {
        let (offset, play) = empirical::offset_and_play(&config.parameters, share_of_closed(config, led));
        (pushed, reach) = (pushed + offset, reach + play);
    }
    let bearing = if reach > 0.0 { drag_along(state.bearing, pushed, reach) } else { pushed };
    Actuated { limited, lagged, led, bearing }
}

/// Position as a share of the vehicle file's closed point in the cold state, which is positive.
fn share_of_closed(config: &Config, x: f64) -> f64 {
    x / config.vehicle.actuator.x_cls_0
}

/// Whether the input of the actuator's learned law has dynamics of its own behind the command: a lag or a rate limit.
fn leads(config: &Config) -> bool {
    config.constants.actuator_lag.time_constant > 0.0 || config.constants.inverse_speed > 0.0
}

/// Position after `h` seconds behind the actuator's learned time constants, whose input has moved to `leader` mm by then.
fn learned(config: &Config, state: &State, leader: f64, h: f64) -> f64 {
    if h == 0.0 {
        return state.led;
    }
    // A moving input counts as held at its mean over the step.
    let target = if leads(config) { 0.5 * (state.lagged.value + leader) } else { leader };
    target - empirical::approach(&config.parameters, target - state.led, share_of_closed(config, state.led), h)
}

/// Memory of the release bearing's friction: last actuator position, and the two friction states, each from −1 (opening) to 1 (closing).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Presliding {
    /// Position behind the lag and the learned time constants, mm.
    pub x: f64,
    /// z, the slow state, to which the friction settles.
    pub slow: f64,
    /// w, the quick state, which runs ahead of z.
    pub quick: f64,
}

/// Memory after the actuator has moved to `x` mm.
fn follow(config: &Config, memory: Presliding, x: f64) -> Presliding {
    let travel = x - memory.x;
    if travel == 0.0 {
        return memory;
    }
    let target = travel.signum();
    let gone = travel.abs() / config.constants.release.travel;
    let part = |z: f64, rate: f64| target + (z - target) * (-rate * gone).exp();
    Presliding { x, slow: part(memory.slow, 2.0), quick: part(memory.quick, 8.0) }
}

/// Distance by which friction holds the bearing back, mm.
fn held_back(config: &Config, memory: Presliding) -> f64 {
    let release = &config.constants.release;
    0.5 * release.width * (memory.slow + release.stiction * (memory.quick - memory.slow))
}

/// Updates the friction's memory with the position that the actuator has reached.
pub fn remember(config: &Config, state: &mut State) {
    if config.constants.release.width > 0.0 {
        state.presliding = follow(config, state.presliding, state.led);
    }
}

/// Ratio of time constant to step below which a lag is too short for the step's stages, and number of time constants after which such a lag has practically settled.
const SHORT_LAG: f64 = 0.5;
const ARRIVAL: f64 = 4.0;

/// Engine torque and bearing position at a step's start, middle and end, which the stages of one Runge–Kutta step weight with 1/6, 4/6 and 1/6.
///
/// To the first stage, a lag that settles within the step would look as if nothing had moved for a sixth of the step. Its start value is therefore replaced by the one with
/// which the weighted stages give the mean over the step. A lag that goes to zero thus becomes no lag, also in steps as long as those of a fit.
pub fn stages(config: &Config, state: &State, x_cmd: f64, h: f64, way: &Way) -> [Drive; 3] {
    let [mut begin, middle, end] = [way.begin, way.middle, way.end].map(|c| c.drive());
    let c = &config.constants;
    if config.empirical.engine_time {
        let known = c.engine_lag.time_constant * (1.0 + c.engine_lag.asymmetry.abs());
        let longest = empirical::longest_engine_time(&config.parameters, known);
        if let Some(over) = short(longest, h) {
            begin.t_e = first_stage([begin.t_e, middle.t_e, end.t_e], |t| engine(config, state, t).value, over, h);
        }
    } else if over_within(&c.engine_lag, h).is_some() {
        let target = engine_target(config, state.inputs.t_e_ref);
        let mean = lag::mean(&c.engine_lag, way.begin.engine, way.end.engine, target, h);
        begin.t_e = 6.0 * mean - 4.0 * middle.t_e - end.t_e;
    }
    let learned = || short(empirical::longest_time(&config.parameters), h);
    if let Some(over) = over_within(&c.actuator_lag, h).or_else(|| config.empirical.slow.then(learned).flatten()) {
        begin.x = first_stage([begin.x, middle.x, end.x], |t| actuate(config, state, x_cmd, t).bearing, over, h);
    }
    [begin, middle, end]
}

/// Time in s within which a lag settles if it is short compared with a step of `h` seconds; `None` if it is not.
#[inline]
fn over_within(lag: &lag::Lag, h: f64) -> Option<f64> {
    let tau = lag.time_constant * (1.0 - lag.asymmetry.abs());
    if lag.time_constant > 0.0 { short(tau, h) } else { None }
}

#[inline]
fn short(tau: f64, h: f64) -> Option<f64> {
    (tau < SHORT_LAG * h).then(|| (ARRIVAL * tau).min(h))
}

/// Value of the first of three stages for which their weighted sum is the mean over `h` seconds. The mean is taken by Simpson's rule, separately over the first `over` seconds,
/// in which the lag settles, and over the rest.
fn first_stage([begin, middle, end]: [f64; 3], at: impl Fn(f64) -> f64, over: f64, h: f64) -> f64 {
    let between = at(over);
    let simpson = |from: f64, a: f64, b: f64, to: f64| (to - from) / 6.0 * (a + 4.0 * at(0.5 * (from + to)) + b);
    6.0 * (simpson(0.0, begin, between, over) + simpson(over, between, end, h)) / h - 4.0 * middle - end
}

/// Play operator: moves the follower along once it is further than `reach` from `leader`. Unlike `clamp`, this returns NaN for a `leader` that is NaN instead of panicking: an
/// absurd saved state may overflow, and the step then reports it.
#[inline]
fn drag_along(follower: f64, leader: f64, reach: f64) -> f64 {
    let (low, high) = (leader - reach, leader + reach);
    if follower > high {
        high
    } else if follower >= low {
        follower
    } else {
        low
    }
}

/// Longest piece as a share of a lag's time constant while the lag is settling: three stages then reproduce its exponential to 1e-7.
const PIECE_OF_A_LAG: f64 = 0.2;

/// Deviation from the target below which a lag counts as settled, in N·m for the engine torque and in mm for the bearing.
const ARRIVED: f64 = 1e-9;

/// Shortest piece that is cut for a learned law, s: where its time constants go to zero, the pieces would otherwise do so as well.
const SHORTEST_PIECE_OF_A_TABLE: f64 = MAX_SUBSTEP / 16.0;

/// Shortest piece that is cut for the actuation chain, s.
pub const SHORTEST_PIECE: f64 = 1e-9;

/// Time in s for which the chain is smooth enough for one Runge–Kutta step, up to the moment at which the rate limit reaches its target or begins to slow down. For a fit,
/// which requests more than [`MAX_SUBSTEP`], the stages of an uncut substep are accurate enough.
pub fn smooth_for(config: &Config, state: &State, x_cmd: f64, max_substep: f64) -> f64 {
    if max_substep > MAX_SUBSTEP || immediate(config) {
        return f64::MAX;
    }
    let c = &config.constants;
    let under_way = |lag: &lag::Lag, at: LagState, target: f64| {
        let tau = lag.time_constant * (1.0 - lag.asymmetry.abs());
        let moves = (target - at.value).abs() > ARRIVED || (at.rate * tau).abs() > ARRIVED;
        let piece = || PIECE_OF_A_LAG * tau * lag.curvature.clamp(0.05, 0.25).sqrt() * 2.0;
        if lag.time_constant > 0.0 && moves { piece() } else { f64::MAX }
    };
    let target = engine_target(config, state.inputs.t_e_ref);
    let mut longest = under_way(&engine_lag(config, target, target - state.engine.value), state.engine, target);
    if config.empirical.engine_time {
        longest = longest.max(SHORTEST_PIECE_OF_A_TABLE);
    }
    longest = longest.min(under_way(&c.actuator_lag, state.lagged, if c.inverse_speed > 0.0 { state.limited } else { x_cmd }));
    if config.empirical.slow {
        let leader = if leads(config) { state.lagged.value } else { x_cmd };
        let distance = leader - state.led;
        let tau = empirical::time(&config.parameters, distance, share_of_closed(config, state.led));
        if distance.abs() > ARRIVED && tau > 0.0 {
            longest = longest.min((PIECE_OF_A_LAG * tau).max(SHORTEST_PIECE_OF_A_TABLE));
        }
    }
    if c.inverse_speed > 0.0 {
        let distance = (x_cmd - state.limited).abs();
        let left = (distance - c.approach.max(0.0)) * c.inverse_speed;
        if left > SHORTEST_PIECE {
            longest = longest.min(left);
        } else if c.approach > 0.0 && distance > ARRIVED {
            longest = longest.min(PIECE_OF_A_LAG * c.approach * c.inverse_speed);
        }
    }
    longest.max(SHORTEST_PIECE)
}

/// Puts the chain into the steady state of the state's inputs.
pub fn rest(config: &Config, state: &mut State) {
    let x = state.inputs.x_to;
    let at = |value| LagState { value, rate: 0.0 };
    state.engine = at(engine_target(config, state.inputs.t_e_ref));
    state.limited = x;
    state.lagged = at(x);
    state.led = x;
    let offset = if config.empirical.actuator { empirical::offset_and_play(&config.parameters, share_of_closed(config, x)).0 } else { 0.0 };
    state.bearing = x + offset;
    state.memory = Branch { x: state.bearing, z: 0.0 };
    state.presliding = Presliding { x, ..Presliding::default() };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lag_is_short_for_a_step_of_more_than_twice_its_time() {
        let lag = |time_constant: f64, asymmetry: f64| lag::Lag { time_constant, curvature: 0.0, asymmetry };
        assert_eq!(over_within(&lag(0.0, 0.0), 0.01), None, "none at all is not over: it was never under way");
        assert_eq!(over_within(&lag(0.006, 0.0), 0.01), None);
        assert_eq!(over_within(&lag(0.005, 0.0), 0.01), None);
        // Settled after four time constants, or by the end of the step.
        assert_eq!(over_within(&lag(0.002, 0.0), 0.01), Some(0.008));
        assert_eq!(over_within(&lag(0.004, 0.0), 0.01), Some(0.01));
        // The quicker of the two directions counts.
        for asymmetry in [0.5, -0.5] {
            assert_eq!(over_within(&lag(0.004, asymmetry), 0.01), Some(0.008));
        }
    }
    /// A bearing of limited speed moves at constant speed until it slows down, approaches exponentially from there, and limits no piece once it has arrived.
    #[test]
    fn a_piece_ends_where_a_bearing_slows_down() {
        use crate::effects::{null, param::actuator_rate_limit};
        use crate::plant::{Inputs, Plant, Start};
        let vehicle = crate::vehicle::Vehicle::paper();
        let piece = |approach: f64, distance: f64| {
            let mut p = null();
            (p[actuator_rate_limit::inverse_speed], p[actuator_rate_limit::approach]) = (0.06, approach);
            let start = Start { omega_f: 200.0, omega_c: 0.0, theta_c: 25.0, theta_b: 25.0 };
            let inputs = Inputs { x_to: 2.0, ..Inputs::default() };
            let plant = Plant::new(&vehicle, &p, &start, &inputs);
            smooth_for(&Config::new(&vehicle, &p), plant.state(), 2.0 + distance, MAX_SUBSTEP)
        };
        for sign in [1.0, -1.0] {
            for (approach, distance, expected) in [(0.5, 2.0, 0.09), (0.0, 2.0, 0.12), (0.5, 0.2, 0.2 * 0.5 * 0.06)] {
                let found = piece(approach, sign * distance);
                assert!((found - expected).abs() < 1e-12, "{approach} {distance}: {found}");
            }
        }
        assert_eq!([piece(0.5, 0.0), piece(0.0, 0.0)], [f64::MAX; 2]);
    }

    /// A learned change of 20 ms at every breakpoint makes the engine's lag 20 ms longer, for first and second order alike.
    #[test]
    fn an_engine_that_was_learned_to_be_slower_throughout_has_a_longer_lag() {
        use crate::effects::{Subsystem, null, param::engine_torque_lag};
        use crate::plant::{Inputs, Plant, Start};
        let curve = empirical::curves(Subsystem::Engine).find(|c| c.name == "engine_time").unwrap();
        for curvature in [0.0, 0.25] {
            let torque = |time_constant: f64, learned: f64| {
                let mut p = null();
                (p[engine_torque_lag::time_constant], p[engine_torque_lag::curvature]) = (time_constant, curvature);
                curve.parameters().for_each(|k| p[k] = learned);
                let start = Start { omega_f: 200.0, omega_c: 0.0, theta_c: 25.0, theta_b: 25.0 };
                let mut plant = Plant::new(&crate::vehicle::Vehicle::paper(), &p, &start, &Inputs::default());
                (0..100).for_each(|_| plant.step(&Inputs { t_e_ref: 50.0, ..Inputs::default() }, 1e-3));
                plant.state().engine.value
            };
            let (learned, longer) = (torque(0.1, 0.02), torque(0.12, 0.0));
            assert!((learned - longer).abs() < 1e-6 && longer < 49.0, "curvature {curvature}: {learned} {longer}");
        }
    }
}
