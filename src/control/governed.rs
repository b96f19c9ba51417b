//! The governed law while engaging: a plan that the engine can follow, carried out by feedforward, corrected by slow feedback.
//!
//! ```text
//! T_c,ref = J_c ω̇_c,ref + b_c ω̂ + T_L(ω̂) + d̂ + k_P (F A ω_c,ref − F ω_c),   0 ≤ T_c,ref ≤ T_lim
//! T_lim   = min(T_e,max − b_f ω_f − J_f ω̇_f,ref − reserve,  PI(ω_f − ω_f,ref + droop))
//! T_e,ref = PI(ω_f,ref − ω_f) + T_c,ref
//! x_to    = x(T_c,ref, s, θ̂_c) + x_fb,   ẋ_fb = p_T (O A T_c,ref − T̂_fc) / K
//! ```
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | A | model of the actuator: two lags, `actuator_time` in all | |
//! | F | two lags of `filter_time`, which roll the feedback off below the shafts' frequency | |
//! | O | lag of the torque observer | |
//! | d̂ | load of the observer in [`super::load`] | N·m |
//! | s | slip that will be there when the bearing has moved | rad/s |
//! | K | slope of the torque map | N·m/mm |
//!
//! - **Reference governor**: where the plan asks for more than T_lim, or the clutch falls behind, the plan's time runs slower.
//! - **Filtered references**: each reference is compared with its measurement behind the same lags, so a perfect map is left alone.
//! - **Soft landing**: after the end of the plan the clutch reference goes on with `reference_slope` until the filtered slip is gone;
//!   then the torque rises at `closing_rate` before the position goes to its maximum.
//! - **Hill**: the load is observed also while the clutch is open and the car rolls; **creep**: a ramp to `creep_speed` in slip.

use super::controller::{Controller, Mode, engine_limits};
use super::figure_3::clutch_limits;
use super::filter::{self, Lags};
use super::guard::Inputs;
use super::load::{Inertia, Load};
use super::pi::Gains;
use super::reference::{self, References};
use super::settings::Settings;
use crate::physics::{driveline, map};

/// Bandwidth of the load observer while the clutch is open: it closes no loop then, 1/s.
const OPEN_LOAD_BANDWIDTH: f64 = 20.0;

/// Bandwidth of the load observer times the time since the engagement began, until it has come down to `load_bandwidth`: as the gain of a
/// Kalman filter falls while it learns a constant.
const LOAD_FORGETTING: f64 = 3.0;

/// Errors of the clutch speed in rad/s at which the governor begins to slow the plan, and stops it.
const FALLING_BEHIND: (f64, f64) = (8.0, 20.0);

/// Times its rate that the plan runs at most to catch up with a car that is ahead of it.
const MOST_HASTE: f64 = 3.0;

/// Torque in N·m by which the hold-back stands above what is asked for while it is not needed.
const DROOP_STANDBY: f64 = 20.0;

/// Hold-back that holds nothing back, N·m.
const OUT_OF_THE_WAY: f64 = 1e6;

/// Rise of the hold-back over the square of the engine speed to spare, N·m·s/rad²: it is out of the way of an engine that keeps its speed.
const RECOVERY: f64 = 15.0;

/// Observed torque at which the facings have bitten, N·m.
const BITE: f64 = 8.0;

/// Time after which a bite is late, s: the bearing is slow.
const LATE_BITE: f64 = 0.4;

/// Share of the engine's speed that a slip may have which is taken for an error of a sensor.
const SENSOR_ERROR: f64 = 0.06;

/// Torque in N·m, and share of that asked for, by which the observed torque may be short before the bearing counts as not there yet.
const UNDELIVERED: f64 = 10.0;
const UNDELIVERED_SHARE: f64 = 0.25;

/// Bandwidth of the torque feedback when the facings bite, 1/s, and that times the time since, until it has come down to `torque_bandwidth`.
const BITE_BANDWIDTH: f64 = 5.0;
const TORQUE_FORGETTING: f64 = 2.0;

/// Least share of its bandwidth that the torque feedback keeps while the bearing is not there.
const LEAST_DELIVERY: f64 = 0.1;

/// Share of what the observed torque departs from the expected one that counts as the clutch's, not as a load.
const BELIEVED: f64 = 1.0;

/// Time over which the change of the torque that is lacking is taken, and time ahead for which it counts, s.
const LOOK_BACK: f64 = 0.1;
const LOOK_AHEAD: f64 = 0.3;

/// Share of the slope of the landing that the torque keeps for it.
const LANDING: f64 = 0.8;

/// Time constants of the slip's filter over `filter_time`: no feedback of any gain hangs on it.
const SLIP_FILTER: f64 = 0.6;

/// Fastest fall of the torque asked for, unless the engine or the direction of slip limits it, N·m/s.
const FALL: f64 = 400.0;

/// Fastest rise of the torque asked for, N·m/s.
const RISE: f64 = 150.0;

/// Fastest move of the torque feedback, mm/s.
const FEEDBACK_RATE: f64 = 1.0;

/// Share of what the observed torque departs from the expected one that the engine is told: all of it would make a slow engine swing.
const CARRIED_SHARE: f64 = 0.3;

/// Slope of the map in N·m/mm below which the feedback takes it for this.
const LEAST_SLOPE: f64 = 15.0;

/// Step in mm over which the touch point's change with temperature is taken, K.
const KELVIN: f64 = 1.0;

/// State of the governed law.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Governed {
    /// Load observer.
    pub load: Load,
    /// Inertia of the car.
    pub inertia: Inertia,
    /// Clutch speed behind F, rad/s.
    pub speed: Lags<2>,
    /// Slip behind two lags, rad/s.
    pub slip: Lags<2>,
    /// Clutch speed reference behind A and F, rad/s.
    pub wanted: Lags<4>,
    /// Torque asked for behind A and F, N·m.
    pub carried: Lags<4>,
    /// Torque asked for behind A and O, N·m.
    pub expected: Lags<3>,
    /// Torque that is lacking, a while ago, N·m.
    pub lacking: Lags<1>,
    /// Hold-back of the clutch torque, N·m.
    pub hold_back: f64,
    /// Time for which the filtered slip has been gone, s.
    pub near_for: f64,
    /// Time since lock-up, s.
    pub closing_for: f64,
    /// Time since the plan ended, s.
    pub landing_for: f64,
    /// Time since the facings have bitten, s.
    pub bitten_for: f64,
    /// Time since the clutch was open, s.
    pub engaged_for: f64,
    /// Side that the slip came from, ±1.
    pub from: f64,
    /// Share of its speed at which the torque rises, because the bearing is slow.
    pub pace: f64,
    /// Slope of the map where the bearing was sent, N·m/mm.
    pub slope: f64,
}

impl Governed {
    /// Filters begin at the first measurement.
    pub(super) fn settle(&mut self, omega_c: f64, slip: f64) {
        self.speed = Lags::at(omega_c);
        self.slip = Lags::at(slip);
        self.load.omega = omega_c;
    }

    /// An engagement begins.
    pub(super) fn begin(&mut self, omega_c: f64, slip: f64) {
        self.wanted = Lags::at(omega_c);
        self.expected = Lags::default();
        self.lacking = Lags::default();
        self.inertia = Inertia::default();
        self.hold_back = OUT_OF_THE_WAY;
        (self.bitten_for, self.near_for, self.landing_for, self.closing_for) = (0.0, 0.0, 0.0, 0.0);
        (self.from, self.pace) = (if slip < 0.0 { -1.0 } else { 1.0 }, 1.0);
    }

    /// Speed of a locked driveline behind F: the mean of both sensors, rad/s.
    pub(super) fn speed_of_both(&self) -> f64 {
        self.speed.out() + 0.5 * self.slip.out()
    }

    /// Whether the slip is gone: within `slip_lock` for `lock_time`, or small and unmoved long after the plan's end.
    pub(super) fn has_locked(&self, s: &Settings, omega_f: f64) -> bool {
        let unmoved = self.landing_for > s.landing_time && self.slip.out().abs() <= s.slip_lock + SENSOR_ERROR * omega_f.abs();
        self.near_for > s.lock_time || unmoved
    }

    /// 1 while the observed torque `t_fc` in N·m is near the one expected, falling to 0 as the bearing is not there yet.
    fn delivery(&self, t_fc: f64) -> f64 {
        let expected = self.expected.out();
        (2.0 - (expected - t_fc).abs() / (UNDELIVERED + UNDELIVERED_SHARE * expected)).clamp(0.0, 1.0)
    }

    fn watch_slip(&mut self, s: &Settings, h: f64) {
        let slip = self.slip.out();
        let gone = self.from * slip <= s.slip_lock;
        self.near_for = if gone { self.near_for + h } else { 0.0 };
    }
}

impl Controller {
    /// Filters and load observer, in every mode.
    pub(super) fn observe_load(&mut self, inputs: &Inputs, slip: f64, h: f64) {
        let (s, state) = (&self.settings, &mut self.state);
        let (a, f) = (filter::share(0.5 * s.actuator_time, h), filter::share(s.filter_time, h));
        let g = &mut state.governed;
        let torque = match state.mode {
            Mode::Open => 0.0,
            Mode::Engaging => state.outputs.t_c_ref,
            Mode::Closing | Mode::Closed => state.estimate.t_fc,
        };
        let omega = g.speed.advance(inputs.omega_c, [f; 2]);
        g.slip.advance(slip, [filter::share(SLIP_FILTER * s.filter_time, h); 2]);
        let t = g.carried.advance(torque, [a, a, f, f]);
        // What the bearing has not brought yet is no load.
        let departs = if state.mode == Mode::Engaging { BELIEVED * (state.estimate.t_fc - g.expected.out()) } else { 0.0 };
        let t = (t + departs).min(state.estimate.t_fc.max(0.0) + UNDELIVERED + UNDELIVERED_SHARE * t);
        g.engaged_for = if state.mode == Mode::Open { 0.0 } else { g.engaged_for + h };
        let bandwidth = (LOAD_FORGETTING / g.engaged_for.max(h)).min(OPEN_LOAD_BANDWIDTH).max(s.load_bandwidth);
        let d = &self.vehicle.driveline;
        g.load.advance(d, d.J_c * g.inertia.factor(), t, omega, bandwidth, s.torque_max, h);
        if state.mode == Mode::Engaging && t > UNDELIVERED {
            let [before, after] = g.speed.0;
            let accelerating = d.J_c * (before - after) / s.filter_time.max(h);
            g.inertia.take(accelerating, t - driveline::resistance(d, omega, 0.0) - accelerating, h);
        }
    }

    /// See the module.
    pub(super) fn engage_governed(&mut self, inputs: &Inputs, h: f64) {
        let limit = self.torque_limit(inputs, h);
        let (references, slopes) = self.advance_plan(inputs, limit, h);
        let (s, state) = (&self.settings, &mut self.state);
        let d = &self.vehicle.driveline;
        let (a, f) = (filter::share(0.5 * s.actuator_time, h), filter::share(s.filter_time, h));
        let g = &mut state.governed;
        g.watch_slip(s, h);
        let error = g.wanted.advance(references.omega_c, [a, a, f, f]) - g.speed.out();
        let (direction, mut limits) = clutch_limits(s, inputs.omega_f, g.slip.out() + s.slip_lock);
        limits.high = limits.high.min(limit);
        let needed = d.J_c * g.inertia.factor() * slopes.omega_c + driveline::resistance(d, g.load.omega, g.load.torque);
        // Before the plan's middle the torque does not fall: a car that runs ahead lets the plan run faster instead.
        let rising = 2.0 * state.elapsed < state.plan.duration && !inputs.wish.creep;
        // After it the torque does not fall below what the landing needs, so that it need not rise again.
        let landing = needed - d.J_c * g.inertia.factor() * (slopes.omega_c - LANDING * state.plan.slope).max(0.0);
        let least = if rising { state.outputs.t_c_ref } else { landing.min(needed) };
        let last = state.outputs.t_c_ref.max(0.0);
        let delivery = g.delivery(direction * state.estimate.t_fc).max(LEAST_DELIVERY);
        let t_c = limits.bound(
            (needed + s.kp_clutch * error)
                .max(least)
                .max(last - FALL * h)
                .min(last + RISE * inputs.wish.aggressiveness.exp2() * g.pace * delivery * h),
        );
        let gains = Gains { p: s.kp_engine, i: s.ki_engine };
        let bites = g.bitten_for == 0.0 && direction * state.estimate.t_fc > BITE;
        g.bitten_for = if bites || g.bitten_for > 0.0 { g.bitten_for + h } else { 0.0 };
        let share = if g.bitten_for > 0.0 { CARRIED_SHARE } else { 1.0 };
        let carried = t_c + share * direction * (state.estimate.t_fc.abs() - g.expected.out());
        state.outputs.t_e_ref = state.engine.step(gains, references.omega_f - inputs.omega_f, carried, engine_limits(s), h);
        state.outputs.t_c_ref = t_c;
        if bites && g.engaged_for > LATE_BITE {
            // A slow bearing is still on its way to where it was sent: it is sent to where it is, and the torque rises as slowly as it came.
            g.pace = LATE_BITE / g.engaged_for;
            state.feedback.integral = 0.0;
            state.outputs.t_c_ref = t_c.min(state.estimate.t_fc.abs());
        }
        let t_c = state.outputs.t_c_ref;
        let ahead = (s.actuator_time + 2.0 * SLIP_FILTER * s.filter_time) * (slopes.omega_f - slopes.omega_c);
        let slip_there = (direction * (g.slip.out() + ahead)).max(0.0);
        // While the torque rises, the bearing does not go back for an early bite alone: the feedback takes effect on what is added.
        let least = if rising && t_c < limits.high { state.outputs.x_to } else { s.x_open };
        self.place(t_c, direction, slip_there, least, h);
    }

    /// Greatest clutch torque that leaves the engine its speed, N·m.
    fn torque_limit(&mut self, inputs: &Inputs, h: f64) -> f64 {
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
    fn advance_plan(&mut self, inputs: &Inputs, limit: f64, h: f64) -> (References, References) {
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
        let rate = by_torque.min(by_error).min(g.delivery(state.estimate.t_fc)) * inputs.wish.aggressiveness.exp2();
        // A car that runs ahead takes its plan along, without more torque.
        state.elapsed += rate * h * (1.0 - error / begins).clamp(1.0, MOST_HASTE);
        if state.elapsed >= state.plan.duration {
            g.landing_for += h;
        }
        let (references, slopes) = reference::governed(&state.plan, state.elapsed);
        (references, References { omega_f: rate * slopes.omega_f, omega_c: rate * slopes.omega_c })
    }

    /// Sends the bearing where the clutch carries `t_c` N·m at a slip of `slip` rad/s, corrected by the torque feedback, but at
    /// least at `least` mm.
    fn place(&mut self, t_c: f64, direction: f64, slip: f64, least: f64, h: f64) {
        let v = &self.vehicle;
        let (theta, learned) = (self.state.temperatures.theta_c, self.state.learning);
        let torque = t_c.abs() / learned.friction;
        let (x, slope) = map::inverse_with_slope(&v.friction, &v.actuator, &v.cushion_spring, self.xi_0, torque, slip, theta);
        let (s, state) = (&self.settings, &mut self.state);
        let (a, o) = (filter::share(0.5 * s.actuator_time, h), filter::share(self.observer.lag(), h));
        let g = &mut state.governed;
        g.slope = learned.friction * slope.max(0.0);
        let observed = direction * state.estimate.t_fc;
        let lacking_now = g.expected.advance(t_c.abs(), [a, a, o]) - observed;
        let lacking_before = g.lacking.advance(lacking_now, [filter::share(LOOK_BACK, h)]);
        // A torque that is on its way needs no push: what will be lacking counts, unless it is of the other sign.
        let lacking = lacking_now + LOOK_AHEAD * (lacking_now - lacking_before) / LOOK_BACK;
        let lacking = if lacking * lacking_now > 0.0 { lacking.abs().min(lacking_now.abs()).copysign(lacking_now) } else { 0.0 };
        let integral = &mut state.feedback.integral;
        let bandwidth = (TORQUE_FORGETTING / g.engaged_for.max(h)).min(BITE_BANDWIDTH).max(s.torque_bandwidth)
            * g.delivery(observed).max(LEAST_DELIVERY);
        let rate = (bandwidth * lacking / g.slope.max(LEAST_SLOPE)).clamp(-FEEDBACK_RATE, FEEDBACK_RATE);
        *integral = (*integral + rate * h).clamp(-s.x_fb_max, s.x_fb_max);
        *integral = integral.max((least - x - learned.touch_point).min(*integral + FEEDBACK_RATE * h));
        state.outputs.x_to_fb = *integral;
        let of_map = t_c.abs() + g.slope * *integral;
        if s.learning_rate > 0.0 && slip > s.slip_lock {
            state.learning.observe(of_map, g.slope, observed, [a, a, o], h);
        }
        let fb = state.outputs.x_to_fb;
        self.move_to((x + learned.touch_point + fb).max(least), h);
    }

    /// What the launch has taught, at its lock-up.
    pub(super) fn conclude_learning(&mut self) {
        let theta = self.state.temperatures.theta_c;
        let per_kelvin = (self.contact_at(theta + KELVIN) - self.contact_at(theta)) / KELVIN;
        self.state.temperatures.theta_c += self.state.learning.conclude(self.settings.learning_rate, per_kelvin);
    }

    /// Locked: the torque that the clutch can carry rises until it is the greatest, then the position goes to its maximum.
    pub(super) fn close_softly(&mut self, inputs: &Inputs, h: f64) {
        let fb = self.state.outputs.x_to_fb;
        self.hold_speed(inputs, h);
        let s = self.settings;
        self.state.outputs.x_to_fb = fb;
        let g = &mut self.state.governed;
        g.closing_for += h;
        let gently = s.closing_rate * h / g.slope.max(LEAST_SLOPE);
        let rise = if g.closing_for < GENTLY { gently } else { gently.max(CLOSING_SPEED * h) };
        let x = self.state.outputs.x_to + rise;
        self.move_to(x, h);
        if self.state.outputs.x_to >= s.x_max {
            self.state.mode = Mode::Closed;
        }
    }
}

/// Time after lock-up for which the torque rises at `closing_rate` alone, s, and speed of the position after it, mm/s.
const GENTLY: f64 = 0.25;
const CLOSING_SPEED: f64 = 20.0;

/// A ramp to `creep_speed`; the launch that may follow is planned from where it has come to.
fn creep(s: &Settings, state: &mut super::controller::State, h: f64) -> (References, References) {
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
