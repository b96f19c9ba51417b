//! Standstill: a car held by its brakes, and a stalled engine.
//!
//! - **Brakes** act as friction behind the shafts: they hold up to their torque T_B while the car stands, and oppose its motion with T_B while it rolls.
//! - **An engine** does not run backwards: at ω_f = 0 it stands until its torque exceeds the clutch torque.
//!
//! The events of both are located inside a substep, like lock-up and break-away. With T_B = 0 and a running engine this module has no influence.

use super::State;
use super::actuation::Chain;
use super::clutch::FaceCache;
use super::config::Config;
use super::motion::{self, Motion, index};

/// Standstill of car and engine, and the brakes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rest {
    /// T_B: greatest torque of the brakes, referred to the clutch, N·m.
    pub brake: f64,
    /// Whether the car stands, held by its brakes.
    pub car: bool,
    /// Direction ±1 in which the car rolls or is about to roll.
    pub rolling: f64,
    /// Whether the engine stands.
    pub engine: bool,
}

impl Default for Rest {
    fn default() -> Self {
        Self { brake: 0.0, car: false, rolling: 1.0, engine: false }
    }
}

impl Rest {
    /// Torque in N·m with which the brakes oppose a rolling car, signed; 0 while the car stands.
    #[inline(always)]
    pub fn braking(&self) -> f64 {
        if self.car { 0.0 } else { self.brake * self.rolling }
    }
}

/// Net torques that would set engine and car in motion at one instant, N·m.
#[derive(Clone, Copy, Debug)]
struct Torques {
    /// Engine torque minus clutch torque.
    engine: f64,
    /// Torque that drives the car minus its resistance without brakes.
    car: f64,
}

/// Net torques in the state `y`. Engine damping does not appear, because the engine's value is used only while it stands.
fn torques(config: &Config, state: &State, y: &Motion, chain: &Chain) -> Torques {
    let (drive, t_load) = (chain.drive(), state.inputs.t_load);
    let t_e = motion::engine_torque(config, y, drive.t_e);
    let load = motion::vehicle_resistance(config, y[index::OMEGA_V], t_load);
    let behind = if config.compliant() { motion::resistance(config, y, t_load, 0.0) } else { load };
    let t_fc = if state.stuck {
        // While stuck, engine and disc can only start to move together.
        return Torques { engine: t_e - behind, car: if config.compliant() { behind } else { t_e } - load };
    } else {
        motion::slipping(config, &FaceCache::EMPTY, y, state.direction, state.memory, drive.x).total()
    };
    Torques { engine: t_e - t_fc, car: if config.compliant() { behind } else { t_fc } - load }
}

/// Whether the brakes are applied; without them the car's standstill is not tracked.
#[inline]
fn braked(state: &State) -> bool {
    state.rest.brake > 0.0
}

/// Event functions of car and engine, for stopping or starting to move, in N·m or rad/s; positive once the event has happened.
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

/// Handles the car's event: it has come to a standstill, or its brakes cannot hold it any longer.
pub fn switch_car(config: &Config, state: &mut State, chain: &Chain) {
    if !state.rest.car {
        stop_car(config, state);
    }
    decide_car(config, state, chain);
}

/// Handles the engine's event: it has come to a standstill, or starts to turn.
pub fn switch_engine(config: &Config, state: &mut State, chain: &Chain) {
    if !state.rest.engine {
        stop_engine(config, state);
    }
    state.rest.engine = torques(config, state, &state.y, chain).engine <= 0.0;
}

/// Decides at the start of a step, with its inputs, whether car and engine stand or move.
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
