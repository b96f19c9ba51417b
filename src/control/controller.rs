//! The controller of paper Figure 3, as a sampled controller.
//!
//! ```text
//!            engage, engine fast enough, inputs trusted
//!     open ------------------------------------------> engaging
//!      ^  <------------------------------------------     |
//!      |           engage drops, stall, fault             | slip ≤ slip_lock, or changes sign
//!      |                                                  v
//!      +------------------------------------------------ closed
//!                     engage drops, stall
//! ```
//!
//! While engaging, T_c,ref = PI(ω_c,ref − ω_c), T_e,ref = PI(ω_f,ref − ω_f) + T_c,ref, and
//! x_to = x(T_c,ref, ω_fc, θ̂_c) + PI(T_c,ref − T̂_fc), with x the inverse torque map. A clutch torque has the sign of the slip:
//! with the engine slower than the clutch, a torque that would have to drive is none, so the clutch waits at its contact point
//! for the engine. Closed, the position goes to its maximum and the engine controller holds the reference speed of both.
//!
//! A step is cut into samples of at most [`MAX_SAMPLE`], with the inputs held: integrators, references and estimates run on
//! between the importer's steps, so that its step size changes nothing but the age of the measurements.

use super::guard::{Fault, Guard, Inputs};
use super::observer::{Estimate, Observer};
use super::performance;
use super::pi::{Gains, Limits, Pi};
use super::reference::{self, Plan};
use super::settings::Settings;
use super::temperature::{Estimator, Temperatures};
use crate::physics::phase::Phase;
use crate::physics::{cushion, map};
use crate::vehicle::Vehicle;

/// Longest sample, s.
pub const MAX_SAMPLE: f64 = 1e-3;

/// Samples in one step at most: a longer step has longer samples, which the exact estimators stand.
pub const MAX_SAMPLES: usize = 1000;

/// Relative length under which what remains of a step is rounding.
const SLIVER: f64 = 1e-9;

/// Outputs after the last step.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Outputs {
    /// Throwout position commanded, mm.
    pub x_to: f64,
    /// Clutch torque observed, N·m.
    pub t_fc_hat: f64,
    /// Disc temperature estimated, °C.
    pub theta_c: f64,
    /// Body temperature estimated, °C.
    pub theta_b: f64,
    /// Engine torque asked for, N·m.
    pub t_e_ref: f64,
    /// Share of the position that the torque feedback adds, mm.
    pub x_to_fb: f64,
    /// Clutch torque asked for; the observed one once closed, N·m.
    pub t_c_ref: f64,
    /// Energy dissipated in this engagement, J.
    pub e_d: f64,
    /// Phase as the controller sees it.
    pub phase: Phase,
    /// What is wrong with the inputs.
    pub fault: Fault,
}

/// What the controller is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Mode {
    /// Open, or opening.
    #[default]
    Open = 0,
    /// Following the references.
    Engaging = 1,
    /// Handed over after lock-up.
    Closed = 2,
}

/// Everything that changes while the controller runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// What the controller is doing.
    pub mode: Mode,
    /// Time since the engagement began, s.
    pub elapsed: f64,
    /// Its references.
    pub plan: Plan,
    /// Engine speed controller.
    pub engine: Pi,
    /// Clutch speed controller.
    pub clutch: Pi,
    /// Torque feedback.
    pub feedback: Pi,
    /// The observer has begun at the first measurement.
    pub observing: bool,
    /// Torque observer.
    pub estimate: Estimate,
    /// Thermal estimate.
    pub temperatures: Temperatures,
    /// Slip of the sample before, rad/s.
    pub last_slip: f64,
    /// Guard of the inputs.
    pub guard: Guard,
    /// Outputs.
    pub outputs: Outputs,
}

/// The clutch engagement controller of one vehicle: a plain value without heap memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Controller {
    vehicle: Vehicle,
    settings: Settings,
    xi_0: f64,
    observer: Observer,
    estimator: Estimator,
    state: State,
}

impl Controller {
    /// A controller at its start: open, at the start temperatures.
    pub fn new(vehicle: &Vehicle, settings: &Settings) -> Self {
        Self {
            vehicle: *vehicle,
            settings: *settings,
            xi_0: cushion::contact_point(&vehicle.cushion_spring),
            observer: Observer::new(&vehicle.driveline, settings.l_1, settings.l_2),
            estimator: Estimator::new(&vehicle.thermal),
            state: start(settings),
        }
    }

    /// Back to the start; vehicle and settings stay.
    pub fn restart(&mut self) {
        self.state = start(&self.settings);
    }

    /// Takes other settings while running: states are kept, start values act at the next restart.
    pub fn set_settings(&mut self, settings: &Settings) {
        self.settings = *settings;
        self.observer = Observer::new(&self.vehicle.driveline, settings.l_1, settings.l_2);
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Outputs after the last step.
    #[inline]
    pub fn outputs(&self) -> &Outputs {
        &self.state.outputs
    }

    /// The state: together with vehicle and settings it determines all that follows, bit for bit.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Takes up a state that [`Controller::state`] gave.
    pub fn set_state(&mut self, state: &State) {
        self.state = *state;
    }

    /// Advances by `h` > 0 seconds with the inputs held.
    pub fn step(&mut self, inputs: &Inputs, h: f64) {
        let slipping = self.state.mode == Mode::Engaging && self.state.outputs.phase == Phase::Slipping;
        self.state.guard.take(&self.settings, inputs, slipping, h);
        let count = (h / MAX_SAMPLE * (1.0 - SLIVER)).ceil().clamp(1.0, MAX_SAMPLES as f64);
        for _ in 0..count as usize {
            self.sample(h / count);
        }
    }

    /// One sample of `h` seconds.
    fn sample(&mut self, h: f64) {
        let inputs = self.state.guard.good;
        let slip = inputs.omega_f - inputs.omega_c;
        self.change_mode(&inputs, slip);
        self.estimate(&inputs, slip, h);
        match self.state.mode {
            Mode::Open => self.open(&inputs, h),
            Mode::Engaging => self.engage(&inputs, slip, h),
            Mode::Closed => self.hold_closed(&inputs, h),
        }
        self.state.last_slip = slip;
        self.report(slip);
    }

    fn change_mode(&mut self, inputs: &Inputs, slip: f64) {
        let s = &self.settings;
        let trusted = self.state.guard.trusted(s);
        let stalling = trusted && inputs.omega_f < s.stall_speed;
        match self.state.mode {
            Mode::Open => {
                if trusted && self.state.guard.believed && inputs.engage && inputs.omega_f >= s.stall_speed + s.stall_margin {
                    self.begin(inputs, slip);
                }
            }
            Mode::Engaging if !inputs.engage || !trusted || stalling => self.state.mode = Mode::Open,
            Mode::Engaging => {
                if slip.abs() <= s.slip_lock || slip * self.state.last_slip < 0.0 {
                    // The clutch torque is no input any more: what it contributed goes on as the engine controller's own.
                    self.state.engine.integral += self.state.outputs.t_c_ref;
                    self.state.mode = Mode::Closed;
                }
            }
            Mode::Closed if !inputs.engage || stalling => {
                self.state.engine.integral -= self.state.estimate.t_fc;
                self.state.mode = Mode::Open;
            }
            Mode::Closed => {}
        }
    }

    fn begin(&mut self, inputs: &Inputs, slip: f64) {
        let state = &mut self.state;
        state.mode = Mode::Engaging;
        state.elapsed = 0.0;
        state.plan = reference::plan(&self.settings, inputs.omega_f, inputs.omega_c);
        state.clutch = Pi::default();
        state.feedback = Pi::default();
        state.last_slip = slip;
        state.outputs.e_d = 0.0;
    }

    /// Torque observer, temperatures and dissipated energy.
    fn estimate(&mut self, inputs: &Inputs, slip: f64, h: f64) {
        let state = &mut self.state;
        if !state.guard.started {
            return;
        }
        if !state.observing {
            state.observing = true;
            state.estimate.omega_f = inputs.omega_f;
            state.engine.integral = self.vehicle.driveline.b_f * inputs.omega_f;
        }
        let before = state.estimate.t_fc;
        if state.guard.believed {
            state.estimate = self.observer.advance(state.estimate, inputs.omega_f, inputs.t_e, h);
        }
        let slipping = state.outputs.phase == Phase::Slipping;
        // The mean of the torque over the sample without the observer's lag.
        let mean = 0.5 * (before + state.estimate.t_fc) + self.observer.lag() * (state.estimate.t_fc - before) / h;
        let power = if slipping { performance::dissipated_power(mean, slip) } else { 0.0 };
        let engaged = state.outputs.phase != Phase::Open;
        state.temperatures = self.estimator.advance(state.temperatures, inputs.theta_h, engaged, power, h);
        state.outputs.e_d += power * h;
    }

    /// Opens at a bounded rate; the engine idles, and is relieved of the clutch's torque as that vanishes.
    fn open(&mut self, inputs: &Inputs, h: f64) {
        let s = &self.settings;
        let touching = self.state.outputs.x_to > self.contact();
        let feed = if touching { self.state.estimate.t_fc } else { 0.0 };
        // An engine this slow does not run: torque would only race one whose speed signal has dropped to nothing.
        let runs = inputs.omega_f > 0.5 * s.stall_speed;
        self.state.outputs.t_e_ref = if self.state.guard.believed && runs {
            let gains = Gains { p: s.kp_engine, i: s.ki_engine };
            self.state.engine.step(gains, s.idle_speed - inputs.omega_f, feed, engine_limits(s), h)
        } else {
            engine_limits(s).bound(self.vehicle.driveline.b_f * s.idle_speed)
        };
        self.state.outputs.t_c_ref = 0.0;
        self.state.outputs.x_to_fb = 0.0;
        self.move_to(s.x_open, h);
    }

    /// Figure 3: references, speed controllers, decoupling, feedforward and torque feedback.
    fn engage(&mut self, inputs: &Inputs, slip: f64, h: f64) {
        if !self.state.guard.believed {
            // Bridging: with measurements that stand still, only the position and torques reached so far are safe.
            return;
        }
        let (s, state) = (&self.settings, &mut self.state);
        state.elapsed += h;
        let wanted = reference::references(&state.plan, state.elapsed);
        let (direction, limits) = clutch_limits(s, inputs.omega_f, slip);
        let gains = Gains { p: s.kp_clutch, i: s.ki_clutch };
        let t_c = state.clutch.step(gains, wanted.omega_c - inputs.omega_c, 0.0, limits, h);
        let gains = Gains { p: s.kp_engine, i: s.ki_engine };
        let t_e = state.engine.step(gains, wanted.omega_f - inputs.omega_f, t_c, engine_limits(s), h);
        let gains = Gains { p: s.kp_torque, i: s.ki_torque };
        let reach = Limits { low: -s.x_fb_max, high: s.x_fb_max };
        let x_fb = state.feedback.step(gains, direction * (t_c - state.estimate.t_fc), 0.0, reach, h);
        let v = &self.vehicle;
        let theta_c = state.temperatures.theta_c;
        let x = map::inverse_above(&v.friction, &v.actuator, &v.cushion_spring, self.xi_0, t_c.abs(), slip.abs(), theta_c);
        state.outputs.t_c_ref = t_c;
        state.outputs.t_e_ref = t_e;
        state.outputs.x_to_fb = x_fb;
        self.move_to(x + x_fb, h);
    }

    /// After lock-up: the position goes to its maximum, the engine controller holds the speed of both inertias.
    fn hold_closed(&mut self, inputs: &Inputs, h: f64) {
        let (s, state) = (&self.settings, &mut self.state);
        if state.guard.believed {
            state.elapsed += h;
            let wanted = reference::references(&state.plan, state.elapsed);
            let d = &self.vehicle.driveline;
            // The same damping with the driveline's inertia on top needs less integral gain.
            let gains = Gains { p: s.kp_engine, i: s.ki_engine * d.J_f / (d.J_f + d.J_c) };
            state.outputs.t_e_ref = state.engine.step(gains, wanted.omega_f - inputs.omega_f, 0.0, engine_limits(s), h);
        }
        state.outputs.t_c_ref = state.estimate.t_fc;
        state.outputs.x_to_fb = 0.0;
        self.move_to(s.x_max, h);
    }

    /// Moves the command towards `target` mm at a bounded rate.
    fn move_to(&mut self, target: f64, h: f64) {
        let (s, x) = (&self.settings, self.state.outputs.x_to);
        let target = Limits { low: s.x_open, high: s.x_max }.bound(target);
        self.state.outputs.x_to = target.max(x - s.rate_open * h).min(x + s.rate_close * h);
    }

    /// Position in mm at which the facings touch, at the estimated temperature.
    fn contact(&self) -> f64 {
        let contact = map::contact(&self.vehicle.actuator, self.state.temperatures.theta_c);
        contact.x_cnt + self.xi_0 * (contact.x_cls - contact.x_cnt)
    }

    fn report(&mut self, slip: f64) {
        let contact = self.contact();
        let (s, state) = (&self.settings, &mut self.state);
        let locked = state.mode == Mode::Closed && slip.abs() <= s.slip_release;
        state.outputs.phase = if locked {
            Phase::Locked
        } else if state.outputs.x_to > contact {
            Phase::Slipping
        } else {
            Phase::Open
        };
        let waits = state.mode == Mode::Open && state.guard.started && state.guard.good.engage;
        let slow = state.guard.good.omega_f < s.stall_speed + s.stall_margin;
        state.outputs.fault = if state.guard.fault == Fault::None && waits && slow { Fault::Stall } else { state.guard.fault };
        state.outputs.t_fc_hat = state.estimate.t_fc;
        state.outputs.theta_c = state.temperatures.theta_c;
        state.outputs.theta_b = state.temperatures.theta_b;
    }
}

fn start(s: &Settings) -> State {
    let temperatures = Temperatures { theta_c: s.theta_c_start, theta_b: s.theta_b_start };
    let outputs = Outputs { x_to: s.x_open, theta_c: s.theta_c_start, theta_b: s.theta_b_start, ..Outputs::default() };
    State {
        mode: Mode::Open,
        elapsed: 0.0,
        plan: Plan::default(),
        engine: Pi::default(),
        clutch: Pi::default(),
        feedback: Pi::default(),
        observing: false,
        estimate: Estimate::default(),
        temperatures,
        last_slip: 0.0,
        guard: Guard::new(s.theta_b_start),
        outputs,
    }
}

fn engine_limits(s: &Settings) -> Limits {
    Limits { low: s.engine_torque_min, high: s.engine_torque_max }
}

/// Direction of slip, and the clutch torques that it allows. Driving the vehicle, the torque fades before the engine stalls; driven
/// by the vehicle, it helps the engine.
fn clutch_limits(s: &Settings, omega_f: f64, slip: f64) -> (f64, Limits) {
    if slip < 0.0 {
        return (-1.0, Limits { low: -s.torque_max, high: 0.0 });
    }
    let fade = ((omega_f - s.stall_speed) / s.stall_margin).clamp(0.0, 1.0);
    (1.0, Limits { low: 0.0, high: fade * s.torque_max })
}
