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
//! | s | slip predicted for the time when the bearing will have moved | rad/s |
//! | K | slope of the torque map | N·m/mm |
//!
//! - **Reference governor**: where the plan asks for more than T_lim, or the clutch falls behind, the plan's time runs slower.
//! - **Filtered references**: each reference is compared with its measurement behind the same lags, so a perfect map is not corrected.
//! - **Approach** ([`super::approach`]): until the facings bite, the torque request is small; the time of the bite gives the bearing's speed. An engine whose torque is late
//!   imitates a bite, but such a bite does not last and is withdrawn.
//! - **Landing** ([`super::landing`]): once half of the slip is gone, the torque falls with the slip, and the torque feedback takes over the map's error. When the filtered
//!   slip is gone, the torque rises at `closing_rate` before the position goes to its maximum.
//! - **Hill** ([`super::hill`]): brakes hold the car until the clutch carries the torque of the grade; without an inclination sensor the load is observed also while the clutch
//!   is open and the car rolls; **creep**: a ramp to `creep_speed` in slip.

use super::approach;
use super::controller::{Controller, engine_limits};
use super::figure_3::clutch_limits;
use super::filter::{self, Lags};
use super::guard::Inputs;
use super::landing::Landing;
use super::load::{Inertia, Load};
use super::pi::Gains;
use super::settings::Settings;
use super::state::{Mode, State};
use crate::physics::driveline;

/// Bandwidth of the load observer while the clutch is open, when the observer is in no feedback loop, 1/s; later it is the upper bound.
const OPEN_LOAD_BANDWIDTH: f64 = 20.0;

/// Product of the load observer's bandwidth and the time since the car was released or the clutch was open: the bandwidth falls in inverse proportion to that time until it
/// reaches `load_bandwidth`, like the gain of a Kalman filter that estimates a constant.
const LOAD_FORGETTING: f64 = 3.0;

/// Value at which a bound has no influence: hold-back in N·m, speed of the command in mm/s.
const UNLIMITED: f64 = 1e6;

/// Observed torque above which the facings count as having bitten, N·m.
const BITE: f64 = 8.0;

/// Observed torque in N·m below which a bite is withdrawn, and factor by which its duration is counted down faster than it was counted up.
const RELEASED: f64 = 2.0;
const FORGOTTEN: f64 = 4.0;

/// Time in s for which the bite must have lasted before a landing begins.
const FELT_FOR: f64 = 0.1;

/// Increase of the slip in rad/s, over its value at the beginning of a landing, that ends the landing: it began with a torque that the clutch never carried.
const ABORT_SLIP_RISE: f64 = 10.0;

/// Slip that is attributed to a sensor error, as a share of the engine speed.
const SENSOR_ERROR: f64 = 0.06;

/// Deviation between observed and expected torque, in N·m and as a share of the expected one, beyond which the bearing counts as not there yet.
const UNDELIVERED: f64 = 10.0;
const UNDELIVERED_SHARE: f64 = 0.25;

/// Least share of its bandwidth that the torque feedback keeps, and of its rate of rise that the torque request keeps, while the bearing is not there.
pub(super) const LEAST_DELIVERY: f64 = 0.1;

/// Acceleration retained for the landing over `reference_slope`, and the share of the corresponding torque that the clutch must carry for the feedback not to raise it.
const LANDING: f64 = 3.0;
const ENOUGH: f64 = 0.13;

/// Lower bound of the map's slope near the touch point, N·m/mm.
const TOUCHING: f64 = 15.0;

/// Time constant of each lag of the slip's filter over `filter_time`: no feedback with a considerable gain depends on the filtered slip.
const SLIP_FILTER: f64 = 0.6;

/// Maximum rate of fall of the torque request, unless the engine or the direction of slip limits the torque, N·m/s.
const FALL: f64 = 400.0;

/// Maximum rate of rise of the torque request, N·m/s.
const RISE: f64 = 150.0;

/// Ratio of the torque request to the lagged request (the expected torque) above which the request counts as not taken back.
const SOUND: f64 = 0.7;

/// Rate of rise of the torque request while the hill holder holds the car, N·m/s.
const SEEK: f64 = 50.0;

/// Share of the deviation between observed and expected torque that is passed to the engine controller as feedforward: all of it would make a slow engine oscillate.
const CARRIED_SHARE: f64 = 0.3;

/// State of the governed law.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Governed {
    /// Load observer.
    pub load: Load,
    /// Estimate of the car's inertia.
    pub inertia: Inertia,
    /// Clutch speed behind F, rad/s.
    pub speed: Lags<2>,
    /// Slip behind two lags, rad/s.
    pub slip: Lags<2>,
    /// Clutch speed reference behind A and F, rad/s.
    pub wanted: Lags<4>,
    /// Torque request behind A and F, N·m.
    pub carried: Lags<4>,
    /// Torque request behind A and O: the expected torque, N·m.
    pub expected: Lags<3>,
    /// Torque deficit behind a lag, for its rate of change, N·m.
    pub lacking: Lags<1>,
    /// Hold-back: limit of the clutch torque that protects the engine speed, N·m.
    pub hold_back: f64,
    /// Time for which the filtered slip has been within `slip_lock` or has changed its sign, s.
    pub slip_gone_for: f64,
    /// Time since lock-up, s.
    pub closing_for: f64,
    /// Time since the plan ended, s.
    pub landing_for: f64,
    /// Time since the facings have bitten, s.
    pub bitten_for: f64,
    /// Time since the clutch was open, s.
    pub engaged_for: f64,
    /// Whether the hill holder holds the car.
    pub held: bool,
    /// Time since the car was released or the clutch was open, s.
    pub free_for: f64,
    /// Sign of the slip at the beginning of the engagement, ±1.
    pub from: f64,
    /// Maximum speed of the command, which the bearing can follow, mm/s.
    pub rate: f64,
    /// Slope of the map at the commanded position, N·m/mm.
    pub slope: f64,
    /// Landing: the second half of the launch.
    pub landing: Landing,
    /// Torque beyond the map's, in N·m, that the torque feedback takes over at the beginning of the landing.
    pub takes_over: f64,
    /// Least torque that load and landing need, N·m.
    pub floor: f64,
}

impl Governed {
    /// Initialises the filters with the first measurement.
    pub(super) fn settle(&mut self, omega_c: f64, slip: f64) {
        self.speed = Lags::at(omega_c);
        self.slip = Lags::at(slip);
        self.load.omega = omega_c;
    }

    /// Prepares the state for a new engagement.
    pub(super) fn begin(&mut self, omega_c: f64, slip: f64) {
        self.wanted = Lags::at(omega_c);
        self.expected = Lags::default();
        self.lacking = Lags::default();
        self.inertia = Inertia::default();
        self.landing = Landing::default();
        self.held = true;
        self.rate = UNLIMITED;
        self.hold_back = UNLIMITED;
        (self.bitten_for, self.slip_gone_for, self.landing_for, self.closing_for) = (0.0, 0.0, 0.0, 0.0);
        self.from = if slip < 0.0 { -1.0 } else { 1.0 };
    }

    /// Speed of a locked driveline behind F: the mean of both sensors, rad/s.
    pub(super) fn speed_of_both(&self) -> f64 {
        self.speed.out() + 0.5 * self.slip.out()
    }

    /// Whether the slip is gone: it has been within `slip_lock` for `lock_time`, or it is within `slip_lock` plus a sensor error more than `landing_time` after the plan's end.
    pub(super) fn has_locked(&self, s: &Settings, omega_f: f64) -> bool {
        let unmoved = self.landing_for > s.landing_time && self.slip.out().abs() <= s.slip_lock + SENSOR_ERROR * omega_f.abs();
        self.slip_gone_for > s.lock_time || unmoved
    }

    /// Delivered share: 1 while the observed torque `t_fc` in N·m is near the expected one, falling to 0 with their deviation, when the bearing is not there yet.
    pub(super) fn delivery(&self, t_fc: f64) -> f64 {
        let expected = self.expected.out();
        (2.0 - (expected - t_fc).abs() / (UNDELIVERED + UNDELIVERED_SHARE * expected)).clamp(0.0, 1.0)
    }

    fn watch_slip(&mut self, s: &Settings, h: f64) {
        let slip = self.slip.out();
        let gone = self.from * slip <= s.slip_lock;
        self.slip_gone_for = if gone { self.slip_gone_for + h } else { 0.0 };
    }
}

impl Controller {
    /// Advances filters, load observer and inertia estimate, in every mode.
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
        // Torque that the bearing has not delivered yet must not count as a load: the deviation between observed and expected torque is the clutch's.
        let departs = if state.mode == Mode::Engaging { state.estimate.t_fc - g.expected.out() } else { 0.0 };
        let t = (t + departs).min(state.estimate.t_fc.max(0.0) + UNDELIVERED + UNDELIVERED_SHARE * t);
        g.engaged_for = if state.mode == Mode::Open { 0.0 } else { g.engaged_for + h };
        g.free_for = if state.mode == Mode::Open { 0.0 } else { g.free_for + h };
        let bandwidth = (LOAD_FORGETTING / g.free_for.max(h)).min(OPEN_LOAD_BANDWIDTH).max(s.load_bandwidth);
        let d = &self.vehicle.driveline;
        g.load.advance(d, d.J_c * g.inertia.factor(), t, omega, bandwidth, s.torque_max, h);
        if state.mode == Mode::Engaging && !g.held && t > UNDELIVERED {
            let [before, after] = g.speed.0;
            let accelerating = d.J_c * (before - after) / s.filter_time.max(h);
            g.inertia.take(accelerating, t - driveline::resistance(d, omega, 0.0) - accelerating, h);
        }
    }

    /// See the module.
    pub(super) fn engage_governed(&mut self, inputs: &Inputs, h: f64) {
        let limit = self.torque_limit(inputs, h);
        let (references, slopes) = self.advance_plan(inputs, limit, h);
        let (touch, lag) = (self.contact(), self.observer.lag());
        let (s, state) = (&self.settings, &mut self.state);
        let d = &self.vehicle.driveline;
        let (a, f) = (filter::share(0.5 * s.actuator_time, h), filter::share(s.filter_time, h));
        let g = &mut state.governed;
        g.watch_slip(s, h);
        let error = g.wanted.advance(references.omega_c, [a, a, f, f]) - g.speed.out();
        let (direction, mut limits) = clutch_limits(s, inputs.omega_f, g.slip.out() + s.slip_lock);
        limits.high = limits.high.min(limit);
        let j = d.J_c * g.inertia.factor();
        let resist = driveline::resistance(d, g.load.omega, g.load.torque);
        let last = state.outputs.t_c_ref.max(0.0);
        let closing = if g.landing.has_begun() { (last - resist) / j } else { slopes.omega_c };
        let ahead = (s.actuator_time + 2.0 * SLIP_FILTER * s.filter_time) * (slopes.omega_f - closing);
        let slip_there = (direction * (g.slip.out() + ahead)).max(0.0);
        if direction > 0.0 && !inputs.wish.creep {
            limits.high += begin_landing(state, slip_there);
        }
        let g = &mut state.governed;
        if g.landing.has_begun() && slip_there > g.landing.slip + ABORT_SLIP_RISE {
            g.landing = Landing::default();
        }
        let last = state.outputs.t_c_ref.max(0.0);
        let rising = !g.landing.has_begun() && !inputs.wish.creep;
        let landing = LANDING * j * state.plan.slope;
        g.floor = resist + ENOUGH * landing;
        let wanted = if g.landing.has_begun() {
            g.landing.torque_at(slip_there, resist + landing)
        } else {
            // Before the landing the torque request does not fall: if the car runs ahead, the plan runs faster instead. While the car is held, the request rises until the
            // clutch delivers what the map promised.
            let last = if g.held { last + SEEK * h } else { last };
            (j * slopes.omega_c + resist + s.kp_clutch * error).max(if rising { last } else { 0.0 })
        };
        let delivery = g.delivery(direction * state.estimate.t_fc).max(LEAST_DELIVERY);
        let felt = g.bitten_for > 0.0 || direction < 0.0;
        let most = if felt { f64::INFINITY } else { approach::most(g.engaged_for) };
        let rise = RISE * inputs.wish.aggressiveness.exp2() * delivery;
        let t_c = limits.bound(wanted.max(last - FALL * h).min(last + rise * h)).min(most);
        let gains = Gains { p: s.kp_engine, i: s.ki_engine };
        let bites = g.bitten_for == 0.0 && direction * state.estimate.t_fc > BITE;
        // A bite whose torque is no longer observed was none: an engine whose torque is late imitates one and then takes it away again.
        let lost = !g.landing.has_begun() && direction * state.estimate.t_fc < RELEASED && g.expected.out() > 2.0 * BITE;
        if g.bitten_for > 0.0 && lost {
            g.bitten_for = (g.bitten_for - FORGOTTEN * h).max(0.0);
            g.rate = if g.bitten_for > 0.0 { g.rate } else { UNLIMITED };
        } else if bites || g.bitten_for > 0.0 {
            g.bitten_for += h;
        }
        // Before the bite the expected torque is not there yet and is subtracted in full; what is observed of it may come from an engine whose torque is late.
        let there = if g.bitten_for > 0.0 { CARRIED_SHARE } else { 1.0 };
        let carried = t_c + direction * (CARRIED_SHARE * state.estimate.t_fc.abs() - there * g.expected.out());
        state.outputs.t_e_ref = state.engine.step(gains, references.omega_f - inputs.omega_f, carried, engine_limits(s), h);
        state.outputs.t_c_ref = t_c;
        if bites {
            let lags = s.actuator_time + lag;
            let speed = approach::speed(touch - s.x_open, g.engaged_for, lags);
            // States must be finite, but the speed may be infinite.
            g.rate = (approach::FOLLOWED * speed).min(UNLIMITED);
            if g.engaged_for > approach::SLOW {
                // The bearing is still on its way to the commanded position: the command is taken back to where the bearing is.
                state.outputs.t_c_ref = t_c.min(BITE + g.slope.max(TOUCHING) * speed * lags);
            }
        }
        let t_c = state.outputs.t_c_ref;
        // While the torque rises, an early bite alone does not move the bearing back: the feedback only reduces what is added.
        let least = if rising && t_c < limits.high { state.outputs.x_to } else { s.x_open };
        self.place(t_c, direction, slip_there.max(2.0 * self.settings.slip_lock), least, h);
    }
}

/// Begins the landing when half of the slip will be gone; returns by how much the limit of the torque rises with it, N·m.
fn begin_landing(state: &mut State, slip_there: f64) -> f64 {
    let (g, last) = (&mut state.governed, state.outputs.t_c_ref.max(0.0));
    let half = 0.5 * (state.plan.end - state.plan.omega_c_start);
    // If the slip is small because the engine was dragged down and the torque request was taken back for it, no landing begins.
    let carries = g.bitten_for > FELT_FOR && last > SOUND * g.expected.out();
    if g.landing.has_begun() || slip_there >= half || !carries {
        return 0.0;
    }
    // The difference between observed and expected torque is the map's error: it is taken over without a step.
    let departs = state.estimate.t_fc - g.expected.out();
    g.landing = Landing { slip: slip_there, torque: last + departs };
    g.expected.shift(departs);
    g.carried.shift(departs);
    g.hold_back += departs.max(0.0);
    g.takes_over = departs;
    state.outputs.t_c_ref += departs;
    departs.max(0.0)
}

#[cfg(test)]
mod tests {
    use super::super::guard::{Guard, Wish};
    use super::super::reference;
    use super::*;
    use crate::vehicle::Vehicle;

    const H: f64 = 1e-2;

    /// A controller that is engaging at a disc speed of 60 rad/s, with a load of 7 N·m in addition to the vehicle file's.
    fn engaging() -> Controller {
        let mut c = Controller::new(&Vehicle::paper(), &Settings::robust());
        c.state.mode = Mode::Engaging;
        c.state.plan = reference::plan(&c.settings, 110.0, 20.0);
        let g = &mut c.state.governed;
        (g.speed, g.wanted, g.from) = (Lags::at(60.0), Lags::at(60.0), 1.0);
        (g.load.omega, g.load.torque, g.hold_back, g.rate) = (60.0, 7.0, UNLIMITED, UNLIMITED);
        c
    }

    /// Resistance of that car in N·m.
    fn resistance() -> f64 {
        let d = Vehicle::paper().driveline;
        d.b_c * 60.0 + d.T_L0 * (60.0 / d.omega_L).tanh() + d.k_L * 3600.0 + 7.0
    }

    fn told(omega_f: f64, omega_c: f64) -> Inputs {
        Inputs { omega_f, omega_c, wish: Wish::default(), ..Guard::new(25.0).good }
    }

    /// T = T_l + (T_h − T_l) u (2 − u) at the slip predicted for the time when actuator and filter will have responded.
    #[test]
    fn a_landing_asks_for_the_torque_of_the_slip_to_come() {
        for last in [55.0, 70.0] {
            let mut c = engaging();
            c.state.elapsed = 2.0 * c.state.plan.duration;
            let (s, j) = (c.settings, c.vehicle.driveline.J_c);
            let closes = (last - resistance()) / j;
            let there = 25.0 - (s.actuator_time + 1.2 * s.filter_time) * closes;
            let needed = resistance() + 3.0 * j * c.state.plan.slope;
            let u = there / 50.0;
            assert!(there > 5.0 && needed < last);
            // 1 N·m less than before, which the maximum rate of fall allows.
            let wanted = last - 1.0;
            let g = &mut c.state.governed;
            g.landing = Landing { slip: 50.0, torque: needed + (wanted - needed) / (u * (2.0 - u)) };
            (g.slip, g.bitten_for, g.engaged_for, g.expected) = (Lags::at(25.0), 0.5, 0.8, Lags::at(last));
            (c.state.outputs.t_c_ref, c.state.estimate.t_fc) = (last, last);
            c.engage_governed(&told(120.0, 95.0), H);
            assert!((c.state.outputs.t_c_ref - wanted).abs() < 1e-9, "{} against {wanted} N·m", c.state.outputs.t_c_ref);
            assert!((c.state.governed.floor - resistance() - 0.13 * 3.0 * j * c.state.plan.slope).abs() < 1e-9);
        }
    }

    /// A landing begins from half of the slip on, if the bite has lasted and the torque request has not been taken back; torque that the clutch carries beyond the request is
    /// taken over.
    #[test]
    fn a_landing_begins_at_half_of_the_slip_with_the_torque_that_is_there() {
        for (bitten_for, last, expected, slip_there, begins) in [
            (0.11, 50.0, 60.0, 44.9, true),
            (0.11, 50.0, 60.0, 45.0, false),
            (0.10, 50.0, 60.0, 44.9, false),
            (0.11, 42.1, 60.0, 44.9, true),
            (0.11, 42.0, 60.0, 44.9, false),
        ] {
            let mut c = engaging();
            (c.state.plan.end, c.state.plan.omega_c_start) = (110.0, 20.0);
            let g = &mut c.state.governed;
            (g.bitten_for, g.expected, g.carried, g.hold_back) = (bitten_for, Lags::at(expected), Lags::at(1.0), 80.0);
            (c.state.outputs.t_c_ref, c.state.estimate.t_fc) = (last, 66.0);
            let more = begin_landing(&mut c.state, slip_there);
            let (g, asked) = (&c.state.governed, c.state.outputs.t_c_ref);
            let found = (more, g.landing, g.expected.out(), g.carried.out(), g.hold_back, g.takes_over, asked);
            let none = (0.0, Landing::default(), expected, 1.0, 80.0, 0.0, last);
            let begun = (6.0, Landing { slip: slip_there, torque: last + 6.0 }, 66.0, 7.0, 86.0, 6.0, last + 6.0);
            assert_eq!(found, if begins { begun } else { none }, "{bitten_for} s, {last} of {expected} N·m, {slip_there} rad/s");
        }
    }

    /// The time of the bite gives the bearing's speed; the command of a slow bearing is taken back to where the bearing is.
    #[test]
    fn a_late_bite_sends_the_command_back_to_the_bearing() {
        for (engaged_for, late) in [(0.5, false), (2.0, true)] {
            let mut c = engaging();
            c.state.elapsed = 0.5 * c.state.plan.duration;
            let g = &mut c.state.governed;
            (g.slip, g.expected, g.engaged_for) = (Lags::at(60.0), Lags::at(9.0), engaged_for);
            (c.state.outputs.t_c_ref, c.state.estimate.t_fc) = (40.0, 9.0);
            let lags = c.settings.actuator_time + c.observer.lag();
            let speed = (c.contact() - c.settings.x_open) / (engaged_for - lags);
            c.engage_governed(&told(120.0, 60.0), H);
            let (g, asked) = (&c.state.governed, c.state.outputs.t_c_ref);
            assert!(g.bitten_for == H && (g.rate - 0.7 * speed).abs() < 1e-9, "{} against 0.7 · {speed} mm/s", g.rate);
            // 8 N·m at the bite, plus what the bearing adds within the lags at 15 N·m/mm.
            assert!(if late { (asked - 8.0 - 15.0 * speed * lags).abs() < 1e-9 } else { asked >= 40.0 }, "{asked} N·m");
        }
    }

    /// An engine whose torque is late imitates a bite: the duration of a bite that is no longer observed is counted down four times as fast as it was counted up.
    #[test]
    fn a_bite_that_is_not_felt_any_more_is_taken_back() {
        let out = UNLIMITED;
        for (before, felt, expected, after, rate) in [
            (0.2, 1.9, 40.0, 0.16, 3.0),
            (0.03, 1.9, 40.0, 0.0, out),
            (0.2, 2.1, 40.0, 0.21, 3.0),
            (0.2, 1.9, 15.0, 0.21, 3.0),
            (0.0, 7.9, 40.0, 0.0, out),
        ] {
            let mut c = engaging();
            let g = &mut c.state.governed;
            (g.bitten_for, g.expected, g.engaged_for, g.slip) = (before, Lags::at(expected), 0.8, Lags::at(60.0));
            g.rate = if before > 0.0 { 3.0 } else { out };
            (c.state.outputs.t_c_ref, c.state.estimate.t_fc) = (expected, felt);
            c.engage_governed(&told(120.0, 60.0), H);
            let g = &c.state.governed;
            assert!((g.bitten_for - after).abs() < 1e-12 && g.rate == rate, "{felt} N·m felt: {} s at {} mm/s", g.bitten_for, g.rate);
        }
    }

    /// 5 N·m more than the model's torque are a load of 5 N·m, of which one sample adopts the share (p h/(1 + p h))²; p is 3 over the time, between the setting and 20 1/s.
    #[test]
    fn the_load_observer_is_quick_at_first() {
        let set = Settings::robust().load_bandwidth;
        for (mode, free_for, p) in [
            (Mode::Open, 9.0, 20.0),
            (Mode::Closed, 0.05, 20.0),
            (Mode::Closing, 0.29, 10.0),
            (Mode::Closed, 0.49, 6.0),
            (Mode::Closed, 1e3, set),
        ] {
            let mut c = engaging();
            c.state.mode = mode;
            let carried = if mode == Mode::Open { 0.0 } else { resistance() + 5.0 };
            let g = &mut c.state.governed;
            (g.carried, g.free_for) = (Lags::at(carried), free_for);
            // An open clutch carries nothing: the load is set lower by as much, so that the deviation is 5 N·m here as well.
            g.load.torque = if mode == Mode::Open { 7.0 - resistance() - 5.0 } else { 7.0 };
            let before = g.load.torque;
            c.state.estimate.t_fc = carried;
            c.observe_load(&told(100.0, 60.0), 40.0, H);
            let expected = before + 5.0 * (p * H / (1.0 + p * H)).powi(2);
            let found = c.state.governed.load.torque;
            assert!((found - expected).abs() < 1e-9, "{mode:?} after {free_for} s: {found} against {expected} N·m");
        }
    }

    /// 30 N·m are expected: up to a deviation of 10 N·m plus a quarter of them all is delivered, at twice as much nothing is.
    #[test]
    fn a_torque_is_delivered_while_it_is_near_the_one_expected() {
        let g = Governed { expected: Lags::at(30.0), ..Governed::default() };
        for (off, delivered) in [(0.0, 1.0), (17.5, 1.0), (26.25, 0.5), (35.0, 0.0), (60.0, 0.0)] {
            assert_eq!((g.delivery(30.0 - off), g.delivery(30.0 + off)), (delivered, delivered), "{off} N·m apart");
        }
    }

    #[test]
    fn a_clutch_has_locked_when_its_slip_is_gone_for_a_while_or_small_long_after_the_plan() {
        let s = Settings { slip_lock: 2.0, lock_time: 0.1, landing_time: 0.5, ..Settings::robust() };
        let locked = |slip_gone_for: f64, landing_for: f64, slip: f64| {
            Governed { slip_gone_for, landing_for, slip: Lags::at(slip), ..Governed::default() }.has_locked(&s, -100.0)
        };
        assert!(!locked(0.0, 0.0, 0.0) && !locked(0.1, 0.0, 0.0) && locked(0.11, 0.0, 50.0));
        // 2 rad/s, and 6 % of 100 rad/s for a sensor that is off.
        assert!(locked(0.0, 0.51, 8.0) && locked(0.0, 0.51, -8.0) && !locked(0.0, 0.51, 8.1) && !locked(0.0, 0.5, 0.0));
        let mut g = Governed { slip: Lags::at(-30.0), from: 1.0, ..Governed::default() };
        g.watch_slip(&s, 0.01);
        assert_eq!(g.slip_gone_for, 0.01, "slip that went through zero is gone");
        g.slip = Lags::at(2.0);
        g.watch_slip(&s, 0.01);
        assert_eq!(g.slip_gone_for, 0.02);
        g.slip = Lags::at(2.1);
        g.watch_slip(&s, 0.01);
        assert_eq!(g.slip_gone_for, 0.0);
        g.from = -1.0;
        g.watch_slip(&s, 0.01);
        assert_eq!(g.slip_gone_for, 0.01);
    }

    #[test]
    fn the_speed_of_both_is_their_mean() {
        assert_eq!(Governed { speed: Lags::at(50.0), slip: Lags::at(4.0), ..Governed::default() }.speed_of_both(), 52.0);
    }
}
