//! Reference governor of the governed law: how much torque the engine can spare, and how fast the plan's time may run.

use super::controller::{Controller, State};
use super::guard::Inputs;
use super::reference::{self, References};
use super::settings::Settings;
use crate::physics::driveline;

/// Errors of the clutch speed in rad/s at which the governor begins to slow the plan, and stops it.
const FALLING_BEHIND: (f64, f64) = (8.0, 20.0);

/// Times its rate that the plan runs at most to catch up with a car that is ahead of it.
const MOST_HASTE: f64 = 3.0;

/// Torque in N·m by which the hold-back stands above what is asked for while it is not needed.
const DROOP_STANDBY: f64 = 20.0;

/// Rise of the hold-back over the square of the engine speed to spare, N·m·s/rad²: it is out of the way of an engine that keeps its speed.
const RECOVERY: f64 = 15.0;

impl Controller {
    /// Greatest clutch torque that leaves the engine its speed, N·m.
    pub(super) fn torque_limit(&mut self, inputs: &Inputs, h: f64) -> f64 {
        let (s, state) = (&self.settings, &mut self.state);
        let (references, slopes) = reference::governed(&state.plan, state.elapsed);
        let d = &self.vehicle.driveline;
        let engine = if inputs.wish.t_e_max > 0.0 { inputs.wish.t_e_max.min(s.engine_torque_max) } else { s.engine_torque_max };
        let available = engine - d.b_f * inputs.omega_f - d.J_f * slopes.omega_f - s.engine_reserve;
        let spare = inputs.omega_f - (references.omega_f.min(state.plan.omega_f_start) - s.engine_droop);
        let g = &mut state.governed;
        g.hold_back += (s.ki_droop * spare + RECOVERY * spare.max(0.0).powi(2)) * h;
        g.hold_back = g.hold_back.min(state.outputs.t_c_ref + DROOP_STANDBY).max(0.0);
        available.min(g.hold_back + s.kp_droop * spare.min(0.0)).max(0.0)
    }

    /// Lets the plan's time run as fast as `limit` N·m and the clutch allow; the references and their slopes now.
    pub(super) fn advance_plan(&mut self, inputs: &Inputs, limit: f64, h: f64) -> (References, References) {
        let (s, state) = (&self.settings, &mut self.state);
        let d = &self.vehicle.driveline;
        if inputs.wish.creep {
            return creep(s, state, h);
        }
        let g = &mut state.governed;
        let (_, planned) = reference::governed(&state.plan, state.elapsed);
        let room = limit - driveline::resistance(d, g.load.omega, g.load.torque);
        let wanted = d.J_c * g.inertia.factor() * planned.omega_c;
        let by_torque = if wanted > 0.0 { (room / wanted).clamp(0.0, 1.0) } else { 1.0 };
        let (begins, stops) = FALLING_BEHIND;
        let error = g.wanted.out() - g.speed.out();
        let by_error = ((stops - error) / (stops - begins)).clamp(0.0, 1.0);
        let held = if g.held { 0.0 } else { 1.0 };
        let rate = held * by_torque.min(by_error).min(g.delivery(state.estimate.t_fc)) * inputs.wish.aggressiveness.exp2();
        // A car that runs ahead takes its plan along, without more torque.
        state.elapsed += rate * h * (1.0 - error / begins).clamp(1.0, MOST_HASTE);
        if state.elapsed >= state.plan.duration {
            g.landing_for += h;
        }
        let (references, slopes) = reference::governed(&state.plan, state.elapsed);
        (references, References { omega_f: rate * slopes.omega_f, omega_c: rate * slopes.omega_c })
    }
}

/// A ramp to `creep_speed`; the launch that may follow is planned from where it has come to.
fn creep(s: &Settings, state: &mut State, h: f64) -> (References, References) {
    let from = state.plan.omega_c_start;
    let to = if from < s.creep_speed {
        (from + s.creep_acceleration * h).min(s.creep_speed)
    } else {
        (from - s.creep_acceleration * h).max(s.creep_speed)
    };
    state.elapsed = 0.0;
    state.plan = reference::plan(s, s.idle_speed, to);
    (References { omega_f: s.idle_speed, omega_c: to }, References { omega_f: 0.0, omega_c: (to - from) / h })
}
