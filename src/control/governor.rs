//! Reference governor of the governed law: how much torque the engine can spare, and how fast the plan's time may run.

use super::controller::Controller;
use super::guard::Inputs;
use super::reference::{self, References};
use super::settings::Settings;
use super::state::State;
use crate::physics::driveline;

/// Errors of the clutch speed in rad/s at which the governor begins to slow the plan, and stops it.
const FALLING_BEHIND: (f64, f64) = (8.0, 20.0);

/// Maximum factor by which the plan's time runs faster in order to catch up with a car that is ahead of it.
const MOST_HASTE: f64 = 3.0;

/// Margin in N·m of the hold-back above the torque request while it is not needed.
const DROOP_STANDBY: f64 = 20.0;

/// Rate of rise of the hold-back per square of the engine's speed margin, N·m·s/rad²: it does not limit an engine that keeps its speed.
const RECOVERY: f64 = 15.0;

impl Controller {
    /// Greatest clutch torque at which the engine keeps its speed, N·m.
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

    /// Advances the plan's time as fast as the torque limit `limit` in N·m and the clutch allow; returns the current references and their slopes.
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
        // If the car runs ahead, the plan's time runs faster, without a higher torque request.
        state.elapsed += rate * h * (1.0 - error / begins).clamp(1.0, MOST_HASTE);
        if state.elapsed >= state.plan.duration {
            g.landing_for += h;
        }
        let (references, slopes) = reference::governed(&state.plan, state.elapsed);
        (references, References { omega_f: rate * slopes.omega_f, omega_c: rate * slopes.omega_c })
    }
}

/// Reference ramp to `creep_speed`; a launch that may follow is planned from the speed that the ramp has reached.
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

#[cfg(test)]
mod tests {
    use super::super::filter::Lags;
    use super::super::guard::{Guard, Wish};
    use super::*;
    use crate::vehicle::Vehicle;

    const H: f64 = 1e-2;

    /// Settings with round numbers.
    fn settings() -> Settings {
        Settings {
            engine_torque_max: 150.0,
            engine_reserve: 5.0,
            engine_droop: 4.0,
            kp_droop: 3.0,
            ki_droop: 20.0,
            reference_time: 1.2,
            reference_speed: 110.0,
            reference_slope: 10.0,
            creep_speed: 12.0,
            creep_acceleration: 30.0,
            ..Settings::robust()
        }
    }

    /// A controller that has been engaging for `share` of its plan, which began at 100 and 20 rad/s.
    fn engaging(share: f64) -> Controller {
        let mut c = Controller::new(&Vehicle::paper(), &settings());
        c.state.plan = reference::plan(&c.settings, 100.0, 20.0);
        c.state.elapsed = share * c.state.plan.duration;
        c.state.governed.hold_back = 1e6;
        c.state.outputs.t_c_ref = 1e6;
        c
    }

    fn told(omega_f: f64, wish: Wish) -> Inputs {
        Inputs { omega_f, wish, ..Guard::new(25.0).good }
    }

    fn close(what: &str, found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-9 * expected.abs().max(1.0), "{what}: {found} against {expected}");
    }

    #[test]
    fn the_torque_leaves_the_engine_what_it_needs_itself() {
        let d = Vehicle::paper().driveline;
        let limit = |share: f64, wish: Wish| engaging(share).torque_limit(&told(120.0, wish), H);
        let most = |t_e_max: f64| Wish { t_e_max, ..Wish::default() };
        close("after the plan", limit(2.0, Wish::default()), 150.0 - d.b_f * 120.0 - 5.0);
        // Half-way the cubic is steepest: 1.5 times its mean slope.
        let duration = engaging(0.0).state.plan.duration;
        close("while its speed rises", limit(0.5, Wish::default()), 150.0 - d.b_f * 120.0 - d.J_f * 1.5 * 10.0 / duration - 5.0);
        close("a weaker engine", limit(2.0, most(90.0)), 90.0 - d.b_f * 120.0 - 5.0);
        close("one that says more than it has", limit(2.0, most(400.0)), 150.0 - d.b_f * 120.0 - 5.0);
        assert_eq!(limit(2.0, most(1.0)), 0.0, "one that has nothing to spare");
    }

    #[test]
    fn torque_is_held_back_from_an_engine_that_falls_below_its_droop() {
        // Plan from 100 to 110 rad/s: the engine may fall to 96.
        let held = |omega_f: f64, hold_back: f64, t_c_ref: f64| {
            let mut c = engaging(2.0);
            c.state.governed.hold_back = hold_back;
            c.state.outputs.t_c_ref = t_c_ref;
            let limit = c.torque_limit(&told(omega_f, Wish::default()), H);
            (limit, c.state.governed.hold_back)
        };
        let both = |what: &str, found: (f64, f64), limit: f64, hold_back: f64| {
            close(what, found.0, limit);
            close(what, found.1, hold_back);
        };
        both("5 rad/s below", held(91.0, 50.0, 60.0), 50.0 - 20.0 * 5.0 * H - 3.0 * 5.0, 50.0 - 20.0 * 5.0 * H);
        both("2 rad/s above", held(98.0, 50.0, 60.0), 50.0 + (20.0 * 2.0 + 15.0 * 4.0) * H, 50.0 + (20.0 * 2.0 + 15.0 * 4.0) * H);
        both("not needed", held(98.0, 1e6, 60.0), 80.0, 80.0);
        both("all of it", held(60.0, 1.0, 60.0), 0.0, 0.0);
        // An engine that is to slow down may follow its plan.
        let mut c = engaging(2.0);
        (c.state.plan.omega_f_start, c.state.plan.end) = (120.0, 110.0);
        (c.state.governed.hold_back, c.state.outputs.t_c_ref) = (50.0, 60.0);
        close("the plan's own fall", c.torque_limit(&told(105.0, Wish::default()), H), 50.0 - 20.0 * H - 3.0);
    }

    /// A controller half-way through its plan, whose clutch speed is `behind` rad/s behind the reference.
    fn half_way(behind: f64) -> Controller {
        let mut c = engaging(0.5);
        let g = &mut c.state.governed;
        (g.speed, g.wanted) = (Lags::at(60.0), Lags::at(60.0 + behind));
        (g.load.omega, g.load.torque) = (60.0, 7.0);
        c
    }

    /// Rate of the plan's time for a torque limit that exceeds the resistance by `share` of the plan's accelerating torque.
    fn rate(c: &mut Controller, share: f64, wish: Wish) -> f64 {
        let d = Vehicle::paper().driveline;
        let resist = d.b_c * 60.0 + d.T_L0 * (60.0 / d.omega_L).tanh() + d.k_L * 3600.0 + 7.0;
        let planned = reference::governed(&c.state.plan, c.state.elapsed).1;
        let before = c.state.elapsed;
        let (_, slopes) = c.advance_plan(&told(100.0, wish), resist + share * d.J_c * planned.omega_c, H);
        let after = reference::governed(&c.state.plan, c.state.elapsed).1;
        let rate = slopes.omega_c / after.omega_c;
        close("the engine's slope", slopes.omega_f, rate * after.omega_f);
        let haste = (c.state.elapsed - before) / (rate * H);
        if rate > 0.0 {
            let behind = c.state.governed.wanted.out() - 60.0;
            close("haste", haste, (1.0 - behind / 8.0).clamp(1.0, 3.0));
        }
        rate
    }

    #[test]
    fn the_plan_runs_as_fast_as_torque_and_clutch_allow() {
        let none = Wish::default();
        close("all of it", rate(&mut half_way(0.0), 1.0, none), 1.0);
        close("more than asked for", rate(&mut half_way(0.0), 3.0, none), 1.0);
        close("half of the torque", rate(&mut half_way(0.0), 0.5, none), 0.5);
        close("none", rate(&mut half_way(0.0), -0.5, none), 0.0);
        close("8 rad/s behind", rate(&mut half_way(8.0), 1.0, none), 1.0);
        close("11 rad/s behind", rate(&mut half_way(11.0), 1.0, none), 0.75);
        close("20 rad/s behind", rate(&mut half_way(20.0), 1.0, none), 0.0);
        close("ahead", rate(&mut half_way(-4.0), 1.0, none), 1.0);
        close("far ahead", rate(&mut half_way(-40.0), 1.0, none), 1.0);
        close("a driver in haste", rate(&mut half_way(0.0), 1.0, Wish { aggressiveness: 1.0, ..none }), 2.0);
        close("one who is not", rate(&mut half_way(0.0), 0.5, Wish { aggressiveness: -1.0, ..none }), 0.25);
        let mut held = half_way(0.0);
        held.state.governed.held = true;
        close("held on a hill", rate(&mut held, 1.0, none), 0.0);
        // 30 N·m are expected and none has come: 2 − 30/(10 + 0.25 · 30) of the rate.
        let mut undelivered = half_way(0.0);
        undelivered.state.governed.expected = Lags::at(30.0);
        close("a bearing that is not there yet", rate(&mut undelivered, 1.0, none), 2.0 - 30.0 / 17.5);
        // A heavier car needs more for the same plan.
        let mut heavy = half_way(0.0);
        (0..10).for_each(|k| heavy.state.governed.inertia.take(10.0 + f64::from(k), 0.25 * (10.0 + f64::from(k)), 1e6));
        let found = rate(&mut heavy, 1.0, none);
        assert!((found - 1.0 / 1.25).abs() < 1e-6, "{found} of the rate for a car of 1.25 times the inertia");
        // The time after the plan's end counts for the landing.
        let mut ended = engaging(1.5);
        ended.advance_plan(&told(100.0, none), 1e3, H);
        assert_eq!((ended.state.governed.landing_for, half_way(0.0).state.governed.landing_for), (H, 0.0));
        let mut running = half_way(0.0);
        running.advance_plan(&told(100.0, none), 1e3, H);
        assert_eq!(running.state.governed.landing_for, 0.0);
    }

    #[test]
    fn creep_is_a_ramp_to_its_speed_from_below_and_above() {
        for (from, to) in [(2.0, 2.3), (11.9, 12.0), (30.0, 29.7), (12.1, 12.0), (12.0, 12.0)] {
            let mut c = engaging(0.5);
            c.state.plan.omega_c_start = from;
            let (references, slopes) = c.advance_plan(&told(100.0, Wish { creep: true, ..Wish::default() }), 1e3, H);
            close("speed", references.omega_c, to);
            close("slope", slopes.omega_c, (to - from) / H);
            assert_eq!((references.omega_f, slopes.omega_f), (c.settings.idle_speed, 0.0));
            // The launch that may follow begins there.
            assert_eq!((c.state.elapsed, c.state.plan), (0.0, reference::plan(&c.settings, c.settings.idle_speed, references.omega_c)));
        }
    }
}
