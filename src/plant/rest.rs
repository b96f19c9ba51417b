//! What stands still: a car held by its brakes, and an engine that has stalled.
//!
//! - **Brakes** are friction behind the shafts: they carry up to their torque T_B while the car stands, and take T_B from it while it rolls.
//! - **An engine** does not run backwards: at ω_f = 0 it stays until what drives it forwards exceeds what the clutch takes.
//!
//! Both are found inside a substep, as lock-up and break-away are. With T_B = 0 and a running engine nothing of this takes part.

use super::State;
use super::actuation::Chain;
use super::clutch::Found;
use super::config::Config;
use super::motion::{self, Motion, index};

/// What stands, and the brakes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rest {
    /// T_B: greatest torque of the brakes, at the clutch, N·m.
    pub brake: f64,
    /// The car stands, held by its brakes.
    pub car: bool,
    /// Direction ±1 in which it rolls, or is about to.
    pub rolling: f64,
    /// The engine stands.
    pub engine: bool,
}

impl Default for Rest {
    fn default() -> Self {
        Self { brake: 0.0, car: false, rolling: 1.0, engine: false }
    }
}

impl Rest {
    /// Torque in N·m that the brakes put up against a car that rolls.
    #[inline(always)]
    pub fn braking(&self) -> f64 {
        if self.car { 0.0 } else { self.brake * self.rolling }
    }
}

/// What stands at a moment: torques at the clutch and behind it, N·m.
#[derive(Clone, Copy, Debug)]
struct Torques {
    /// Of the engine, over that of the clutch.
    engine: f64,
    /// On the car, over its resistance without brakes.
    car: f64,
}

/// An engine is asked for its torque where it stands: damping has no say.
fn torques(config: &Config, state: &State, y: &Motion, chain: &Chain) -> Torques {
    let (drive, t_load) = (chain.drive(), state.inputs.t_load);
    let t_e = motion::engine_torque(config, y, drive.t_e);
    let load = motion::vehicle_resistance(config, y[index::OMEGA_V], t_load);
    let behind = if config.compliant() { motion::resistance(config, y, t_load, 0.0) } else { load };
    let t_fc = if state.stuck {
        // What would have to move them together.
        return Torques { engine: t_e - behind, car: if config.compliant() { behind } else { t_e } - load };
    } else {
        motion::slipping(config, &Found::NOTHING, y, state.direction, state.memory, drive.x).total()
    };
    Torques { engine: t_e - t_fc, car: if config.compliant() { behind } else { t_fc } - load }
}

/// Whether the car takes part: it has brakes on.
#[inline]
fn braked(state: &State) -> bool {
    state.rest.brake > 0.0
}

/// How far car and engine are past their next event; positive once it has happened. In N·m or rad/s.
pub fn passed(config: &Config, state: &State, y: &Motion, chain: &Chain) -> [f64; 2] {
    let none = f64::NEG_INFINITY;
    let rest = &state.rest;
    let at_rest = (rest.car || rest.engine).then(|| torques(config, state, y, chain));
    let car = match at_rest {
        _ if !braked(state) => none,
        Some(t) if rest.car => t.car.abs() - rest.brake,
        _ => -rest.rolling * y[index::OMEGA_V],
    };
    let engine = match at_rest {
        Some(t) if rest.engine => t.engine,
        _ if state.y[index::OMEGA_F] >= 0.0 => -y[index::OMEGA_F],
        _ => none,
    };
    [car, engine]
}

/// The car has come to a stand, or is torn off.
pub fn switch_car(config: &Config, state: &mut State, chain: &Chain) {
    if !state.rest.car {
        stop_car(config, state);
    }
    decide_car(config, state, chain);
}

/// The engine has come to a stand, or is turned.
pub fn switch_engine(config: &Config, state: &mut State, chain: &Chain) {
    if !state.rest.engine {
        stop_engine(config, state);
    }
    state.rest.engine = torques(config, state, &state.y, chain).engine <= 0.0;
}

/// At the start of a step, with its inputs: what has been standing may start to move, and the other way round.
pub fn settle(config: &Config, state: &mut State, chain: &Chain) {
    if braked(state) && state.y[index::OMEGA_V] == 0.0 {
        decide_car(config, state, chain);
    } else {
        state.rest.car = false;
        state.rest.rolling = 1.0_f64.copysign(state.y[index::OMEGA_V]);
    }
    state.rest.engine = state.y[index::OMEGA_F] == 0.0 && torques(config, state, &state.y, chain).engine <= 0.0;
}

fn decide_car(config: &Config, state: &mut State, chain: &Chain) {
    let push = torques(config, state, &state.y, chain).car;
    state.rest.car = push.abs() <= state.rest.brake;
    state.rest.rolling = 1.0_f64.copysign(push);
}

fn stop_car(config: &Config, state: &mut State) {
    state.y[index::OMEGA_V] = 0.0;
    if !config.compliant() {
        state.y[index::OMEGA_C] = 0.0;
        if state.stuck {
            state.y[index::OMEGA_F] = 0.0;
        }
    }
}

fn stop_engine(config: &Config, state: &mut State) {
    state.y[index::OMEGA_F] = 0.0;
    if state.stuck {
        state.y[index::OMEGA_C] = 0.0;
        if !config.compliant() {
            state.y[index::OMEGA_V] = 0.0;
        }
    }
}
