//! Phases and estimates of the sampled controller; the laws while engaging are in [`super::figure_3`] and [`super::governed`].
//!
//! ```text
//!            engage, engine fast enough, inputs trusted
//!     open ------------------------------------------> engaging
//!      ^  <------------------------------------------     |
//!      |           engage drops, stall, fault             | slip is gone
//!      |                                                  v
//!      +------------------------------- closed <------ closing (governed law only)
//!                engage drops, stall           full torque
//! ```
//!
//! A clutch torque has the sign of the slip: while the engine is slower than the clutch disc, the clutch cannot transmit a driving torque, so the request is limited to zero
//! and the clutch waits at its contact point for the engine. When the clutch is closed, the position goes to its maximum and the engine controller holds the reference speed of
//! both sides.
//!
//! A step is cut into samples of at most [`MAX_SAMPLE`], with the inputs held: integrators, references and estimates continue between the importer's steps, so that its step
//! size affects nothing but the age of the measurements.

use super::guard::{Fault, Inputs};
use super::learning::Learning;
use super::observer::Observer;
use super::performance;
use super::pi::{Gains, Limits, Pi};
use super::reference;
use super::settings::Settings;
use super::state::{Mode, Outputs, State, start};
use super::temperature::Estimator;
use crate::physics::phase::Phase;
use crate::physics::{cushion, map};
use crate::vehicle::Vehicle;

/// Longest sample, s.
pub const MAX_SAMPLE: f64 = 1e-3;

/// Maximum number of samples in one step: a longer step has longer samples, at which the exact estimators remain stable.
pub const MAX_SAMPLES: usize = 1000;

/// Factor on the engine controller's gains with which the governed law holds the filtered speed of a locked driveline.
const FIRMNESS: f64 = 2.0;

/// Relative length below which the remainder of a step is rounding.
const SLIVER: f64 = 1e-9;

/// The clutch engagement controller of one vehicle: a plain value without heap memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Controller {
    pub(super) vehicle: Vehicle,
    pub(super) settings: Settings,
    pub(super) xi_0: f64,
    pub(super) observer: Observer,
    pub(super) estimator: Estimator,
    pub(super) state: State,
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

    /// Resets the controller to its start; vehicle and settings are kept.
    pub fn restart(&mut self) {
        self.state = start(&self.settings);
    }

    /// Replaces the settings, also while the controller runs: states are kept, start values take effect at the next restart.
    pub fn set_settings(&mut self, settings: &Settings) {
        self.settings = *settings;
        self.observer = Observer::new(&self.vehicle.driveline, settings.l_1, settings.l_2);
    }

    /// The vehicle that the controller's models are based on.
    pub fn vehicle(&self) -> &Vehicle {
        &self.vehicle
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

    /// Restores a state from [`Controller::state`].
    pub fn set_state(&mut self, state: &State) {
        self.state = *state;
    }

    /// Advances by `h` > 0 seconds with the inputs held.
    pub fn step(&mut self, inputs: &Inputs, h: f64) {
        let slipping = self.state.mode == Mode::Engaging && self.state.outputs.phase == Phase::Slipping;
        self.state.guard.take(&self.settings, inputs, slipping, h);
        if self.state.guard.good.wish.forget {
            self.state.learning = Learning::new(&self.settings);
        }
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
        self.hold_on_hill(&inputs);
        match self.state.mode {
            Mode::Open => self.open(&inputs, h),
            // Bridging a fault: while the measurements stand still, only the position and torques reached so far are safe.
            Mode::Engaging if !self.state.guard.believed => (),
            Mode::Engaging if self.settings.is_figure_3() => self.engage_by_figure_3(&inputs, slip, h),
            Mode::Engaging => self.engage_governed(&inputs, h),
            Mode::Closing => self.close_softly(&inputs, h),
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
            Mode::Engaging if s.is_figure_3() => {
                if slip.abs() <= s.slip_lock || slip * self.state.last_slip < 0.0 {
                    self.hand_over(Mode::Closed);
                }
            }
            Mode::Engaging => {
                if self.state.governed.has_locked(s, inputs.omega_f) {
                    self.hand_over(Mode::Closing);
                    self.conclude_learning();
                }
            }
            Mode::Closed | Mode::Closing if !inputs.engage || stalling => {
                self.state.engine.integral -= self.state.estimate.t_fc;
                self.state.mode = Mode::Open;
            }
            Mode::Closed | Mode::Closing => {}
        }
    }

    /// Hands over to a locked mode: the clutch torque is no longer an input of the engine controller, so its contribution is moved into the controller's integral.
    fn hand_over(&mut self, to: Mode) {
        let (s, state) = (&self.settings, &mut self.state);
        state.engine.integral = if s.is_figure_3() {
            state.engine.integral + state.outputs.t_c_ref
        } else {
            // The engine torque continues without a step under the gains and the speed that apply from now on.
            let error = reference::references(&state.plan, state.elapsed).omega_f - state.governed.speed_of_both();
            state.outputs.t_e_ref - FIRMNESS * s.kp_engine * error
        };
        self.state.mode = to;
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
        state.governed.begin(inputs.omega_c, slip);
        state.learning.begin();
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
            state.governed.settle(inputs.omega_c, slip);
            state.last_omega_c = inputs.omega_c;
        }
        if !state.soaked {
            state.soaked = true;
            state.temperatures = self.estimator.advance(state.temperatures, inputs.theta_h, false, 0.0, self.settings.soak_time);
        }
        let before = state.estimate;
        if state.guard.believed {
            state.estimate = self.observer.advance(state.estimate, inputs.omega_f, inputs.t_e, h);
        }
        let slipping = state.outputs.phase == Phase::Slipping;
        // Means over the sample, with the observer's lag removed from the torque. The noise of this torque is the rate of change of the noise of ω̂_f: multiplied by a slip
        // from the same ω̂_f it averages out, whereas with the raw slip it would look like work.
        let now = state.estimate;
        let torque = 0.5 * (before.t_fc + now.t_fc) + self.observer.lag() * (now.t_fc - before.t_fc) / h;
        let mean_slip = 0.5 * (before.omega_f + now.omega_f) - 0.5 * (state.last_omega_c + inputs.omega_c);
        state.last_omega_c = inputs.omega_c;
        let power = if slipping { performance::dissipated_power(torque, mean_slip) } else { 0.0 };
        let engaged = state.outputs.phase != Phase::Open;
        state.temperatures = self.estimator.advance(state.temperatures, inputs.theta_h, engaged, power, h);
        state.outputs.e_d += power * h;
        if state.guard.believed {
            self.observe_load(inputs, slip, h);
        }
    }

    /// Opens the clutch at a bounded rate. The engine controller holds idle speed, with the clutch torque that remains as feedforward.
    fn open(&mut self, inputs: &Inputs, h: f64) {
        let s = &self.settings;
        let touching = self.state.outputs.x_to > self.contact();
        let feed = if touching { self.state.estimate.t_fc } else { 0.0 };
        // An engine this slow is not running, or its speed signal has dropped to nothing: more torque than idling takes would only race it.
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

    /// After lock-up: the position goes to its maximum, the engine controller holds the speed of both inertias.
    fn hold_closed(&mut self, inputs: &Inputs, h: f64) {
        self.hold_speed(inputs, h);
        self.move_to(self.settings.x_max, h);
    }

    /// Holds both inertias at the reference speed. The governed law uses the filtered speed, because the raw one would excite the shafts.
    pub(super) fn hold_speed(&mut self, inputs: &Inputs, h: f64) {
        let (s, state) = (&self.settings, &mut self.state);
        if state.guard.believed {
            state.elapsed += h;
            let wanted = reference::references(&state.plan, state.elapsed);
            let d = &self.vehicle.driveline;
            // With the driveline's inertia added, the same damping needs less integral gain.
            let i = s.ki_engine * d.J_f / (d.J_f + d.J_c);
            let (gains, speed) = if s.is_figure_3() {
                (Gains { p: s.kp_engine, i }, inputs.omega_f)
            } else {
                (Gains { p: FIRMNESS * s.kp_engine, i: FIRMNESS * i }, state.governed.speed_of_both())
            };
            state.outputs.t_e_ref = state.engine.step(gains, wanted.omega_f - speed, 0.0, engine_limits(s), h);
        }
        state.outputs.t_c_ref = state.estimate.t_fc;
        state.outputs.x_to_fb = 0.0;
    }

    /// Moves the command towards `target` mm at a bounded rate.
    pub(super) fn move_to(&mut self, target: f64, h: f64) {
        let (s, x) = (&self.settings, self.state.outputs.x_to);
        let target = Limits { low: s.x_open, high: s.x_max }.bound(target);
        let g = &self.state.governed;
        let follows = if self.state.mode == Mode::Open || s.is_figure_3() { f64::INFINITY } else { g.rate };
        let back = if g.landing.has_begun() { follows } else { f64::INFINITY };
        self.state.outputs.x_to = target.max(x - s.rate_open.min(back) * h).min(x + s.rate_close.min(follows) * h);
    }

    /// Position in mm at which the facings touch, at the estimated temperature.
    pub(super) fn contact(&self) -> f64 {
        self.contact_at(self.state.temperatures.theta_c)
    }

    /// Position in mm at which the facings touch at `theta` °C.
    pub(super) fn contact_at(&self, theta: f64) -> f64 {
        let contact = map::contact(&self.vehicle.actuator, theta);
        contact.x_cnt + self.xi_0 * (contact.x_cls - contact.x_cnt) + self.state.learning.touch_point
    }

    fn report(&mut self, slip: f64) {
        let contact = self.contact();
        let (s, state) = (&self.settings, &mut self.state);
        let seen = if s.is_figure_3() { slip } else { state.governed.slip.out() };
        let locked = matches!(state.mode, Mode::Closed | Mode::Closing) && seen.abs() <= s.slip_release;
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
        state.outputs.t_load_hat = state.governed.load.torque;
        state.outputs.touch_point_offset = state.learning.touch_point;
        state.outputs.friction_factor = state.learning.friction;
    }
}

pub(super) fn engine_limits(s: &Settings) -> Limits {
    Limits { low: s.engine_torque_min, high: s.engine_torque_max }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_may_stand_still_until_the_facings_touch() {
        let s = Settings { freeze_time: 0.05, rate_close: 20.0, ..Settings::robust() };
        let mut c = Controller::new(&Vehicle::paper(), &s);
        let told = Inputs { omega_f: 100.0, engage: true, ..c.state.guard.good };
        // More than 4 mm to the contact.
        (0..200).for_each(|_| c.step(&told, 1e-3));
        assert_eq!((c.state.mode, c.outputs().phase, c.outputs().fault), (Mode::Engaging, Phase::Open, Fault::None));
        (0..200).for_each(|_| c.step(&told, 1e-3));
        assert_eq!(c.outputs().fault, Fault::Frozen);
    }

    /// New settings replace the old ones and the observer's gains; the states stay as they are.
    #[test]
    fn settings_are_replaced_while_the_controller_runs() {
        let first = Settings::robust();
        let mut c = Controller::new(&Vehicle::paper(), &first);
        let told = Inputs { omega_f: 100.0, engage: true, ..c.state.guard.good };
        (0..50).for_each(|_| c.step(&told, 1e-3));
        let (mode, x) = (c.state.mode, c.outputs().x_to);
        c.set_settings(&Settings { rate_close: 0.5 * first.rate_close, l_1: 2.0 * first.l_1, ..first });
        assert!(c.settings().rate_close == 0.5 * first.rate_close && c.settings().l_1 == 2.0 * first.l_1);
        assert_eq!((c.state.mode, c.outputs().x_to), (mode, x));
    }

    #[test]
    fn the_facings_touch_where_the_plant_has_them_touch() {
        use crate::plant::{clutch, config::Config};
        let (vehicle, null) = (Vehicle::paper(), crate::effects::null());
        let mut c = Controller::new(&vehicle, &Settings::robust());
        for theta in [20.0, 150.0] {
            let expected = clutch::position_of(&Config::new(&vehicle, &null), 0.0, theta);
            assert!((c.contact_at(theta) - expected).abs() < 1e-12, "{} against {expected} mm", c.contact_at(theta));
            c.state.learning.touch_point = 0.3;
            assert!((c.contact_at(theta) - 0.3 - expected).abs() < 1e-12, "as it was learned");
            c.state.learning.touch_point = 0.0;
        }
    }

    /// An engine that is too slow to launch is reported as a fault once a launch is requested.
    #[test]
    fn a_slow_engine_is_a_fault_of_a_clutch_that_is_to_engage() {
        for (engage, speed, fault) in [(true, 0.0, Fault::Stall), (false, 0.0, Fault::None), (true, 100.0, Fault::None)] {
            let s = Settings::robust();
            let mut c = Controller::new(&Vehicle::paper(), &s);
            let omega_f = s.stall_speed + s.stall_margin - 1.0 + speed;
            (0..5).for_each(|k| c.step(&Inputs { omega_f: omega_f + 0.01 * f64::from(k), engage, ..c.state.guard.good }, 1e-3));
            assert_eq!(c.outputs().fault, fault, "{engage} at {omega_f} rad/s");
        }
    }

    /// The governed law holds a locked driveline with twice the gains, the paper's law with the gains as they are; in both, the added inertia of the driveline reduces the
    /// integral gain.
    #[test]
    fn a_locked_driveline_is_held_by_gains_for_its_inertia() {
        let (d, h) = (Vehicle::paper().driveline, 1e-3);
        for (s, times) in [(Settings::robust(), 2.0), (Settings::figure_3(), 1.0)] {
            let mut c = Controller::new(&Vehicle::paper(), &s);
            c.state.plan = reference::plan(&s, 100.0, 20.0);
            c.state.elapsed = 2.0 * c.state.plan.duration;
            (c.state.guard.believed, c.state.engine.integral, c.state.estimate.t_fc) = (true, 10.0, 33.0);
            // 3 rad/s below the end of the plan, by either sensor.
            let omega = c.state.plan.end - 3.0;
            c.state.governed.settle(omega, 0.0);
            c.hold_speed(&Inputs { omega_f: omega, omega_c: omega, ..c.state.guard.good }, h);
            let expected = 10.0 + times * (s.kp_engine + s.ki_engine * d.J_f / (d.J_f + d.J_c) * h) * 3.0;
            assert!((c.outputs().t_e_ref - expected).abs() < 1e-9, "{} against {expected} N·m", c.outputs().t_e_ref);
            assert_eq!((c.outputs().t_c_ref, c.outputs().x_to_fb), (33.0, 0.0));
        }
    }

    #[test]
    fn a_clutch_at_its_contact_is_open_and_slips_beyond() {
        let mut c = Controller::new(&Vehicle::paper(), &Settings::robust());
        let contact = c.contact();
        for (x, phase) in [(contact, Phase::Open), (contact.next_up(), Phase::Slipping)] {
            c.state.outputs.x_to = x;
            c.report(5.0);
            assert_eq!(c.state.outputs.phase, phase);
        }
    }

    /// An engine whose speed signal has dropped out, or is not believed, gets the torque of idling and no more.
    #[test]
    fn an_engine_that_seems_to_stand_is_not_raced() {
        let idling = Vehicle::paper().driveline.b_f * Settings::robust().idle_speed;
        let asked = |share: f64, believed: bool| {
            let mut c = Controller::new(&Vehicle::paper(), &Settings::robust());
            c.state.guard.believed = believed;
            let omega_f = share * c.settings.stall_speed;
            c.open(&Inputs { omega_f, ..c.state.guard.good }, 1e-3);
            c.state.outputs.t_e_ref
        };
        assert_eq!([asked(0.49, true), asked(0.0, true), asked(1.5, false)], [idling; 3]);
        let s = Settings::robust();
        let error = s.idle_speed - 0.51 * s.stall_speed;
        let expected = (s.kp_engine + s.ki_engine * 1e-3) * error;
        assert!((asked(0.51, true) - expected.min(s.engine_torque_max)).abs() < 1e-9, "{} against {expected} N·m", asked(0.51, true));
    }
}
