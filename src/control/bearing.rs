//! Position command of the governed law: inverse map, torque feedback, learning, and the soft close after lock-up.

use super::controller::Controller;
use super::filter;
use super::governed::LEAST_DELIVERY;
use super::guard::Inputs;
use super::state::Mode;
use crate::physics::map;

/// Upper bound of the torque feedback's bandwidth, 1/s, and product of the bandwidth and the time since the clutch was open: the bandwidth falls in inverse proportion to that
/// time until it reaches `torque_bandwidth`.
const BITE_BANDWIDTH: f64 = 5.0;
const TORQUE_FORGETTING: f64 = 2.0;

/// Maximum rate of the torque feedback, mm/s.
const FEEDBACK_RATE: f64 = 1.0;

/// Share of the requested torque beyond which the observed torque suffices during a landing, so that the feedback does not raise it.
const SUFFICIENT: f64 = 0.6;

/// Lower bound of the map's slope where a torque is converted to a position, N·m/mm.
const LEAST_SLOPE: f64 = 15.0;

/// Temperature step of the difference quotient for the touch point's change with temperature, K.
const KELVIN: f64 = 1.0;

/// Time constant over which the change of the torque deficit is determined, and horizon over which the deficit is extrapolated, s.
const LOOK_BACK: f64 = 0.1;
const LOOK_AHEAD: f64 = 0.3;

/// Time after lock-up for which the torque rises at `closing_rate` alone (which itself is ramped up over this time), s, and minimum speed of the position after it, mm/s.
const GENTLY: f64 = 0.25;
const CLOSING_SPEED: f64 = 20.0;

impl Controller {
    /// Commands the position at which the clutch carries `t_c` N·m at a slip of `slip` rad/s, corrected by the torque feedback and what was learned, but at least `least` mm.
    pub(super) fn place(&mut self, t_c: f64, direction: f64, slip: f64, least: f64, h: f64) {
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
        // Torque that is already building up needs no correction: the deficit is extrapolated, but does not exceed the present one, and is zero if it would change its sign.
        let lacking = lacking_now + LOOK_AHEAD * (lacking_now - lacking_before) / LOOK_BACK;
        let lacking = if lacking * lacking_now > 0.0 { lacking.abs().min(lacking_now.abs()).copysign(lacking_now) } else { 0.0 };
        let integral = &mut state.feedback.integral;
        let bandwidth = (TORQUE_FORGETTING / g.engaged_for.max(h)).min(BITE_BANDWIDTH).max(s.torque_bandwidth)
            * g.delivery(observed).max(LEAST_DELIVERY);
        let rate = (bandwidth * lacking / g.slope.max(LEAST_SLOPE)).clamp(-FEEDBACK_RATE, FEEDBACK_RATE);
        let departs = std::mem::take(&mut g.takes_over);
        if departs != 0.0 {
            let (f, at) = (&v.friction, |t: f64| t.max(0.0) / learned.friction);
            let place = |t: f64| map::inverse_above(f, &v.actuator, &v.cushion_spring, self.xi_0, at(t), slip, theta);
            *integral += place(g.landing.torque - departs) - place(g.landing.torque);
        }
        // Before the bite the observed torque says nothing, and in a landing a torque that suffices is not to rise again.
        let suffices = g.landing.has_begun() && observed > g.floor.max(SUFFICIENT * t_c);
        let most = if g.bitten_for == 0.0 || suffices { 0.0 } else { FEEDBACK_RATE };
        let least_rate = if g.bitten_for == 0.0 { 0.0 } else { -FEEDBACK_RATE };
        let rate = rate.clamp(least_rate, most);
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

    /// Adopts what the launch has taught, at its lock-up.
    pub(super) fn conclude_learning(&mut self) {
        let theta = self.state.temperatures.theta_c;
        let per_kelvin = (self.contact_at(theta + KELVIN) - self.contact_at(theta)) / KELVIN;
        self.state.temperatures.theta_c += self.state.learning.conclude(self.settings.learning_rate, per_kelvin);
    }

    /// After lock-up: raises the torque capacity until the position has reached its maximum; the clutch then counts as closed.
    pub(super) fn close_softly(&mut self, inputs: &Inputs, h: f64) {
        let fb = self.state.outputs.x_to_fb;
        self.hold_speed(inputs, h);
        let s = self.settings;
        self.state.outputs.x_to_fb = fb;
        let g = &mut self.state.governed;
        g.closing_for += h;
        let gently = s.closing_rate * (g.closing_for / GENTLY).min(1.0) * h / g.slope.max(LEAST_SLOPE);
        let rise = if g.closing_for <= GENTLY { gently } else { gently.max(CLOSING_SPEED * h) };
        let x = self.state.outputs.x_to + rise;
        self.move_to(x, h);
        if self.state.outputs.x_to >= s.x_max {
            self.state.mode = Mode::Closed;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::filter::Lags;
    use super::super::landing::Landing;
    use super::super::settings::Settings;
    use super::*;
    use crate::vehicle::Vehicle;

    /// ẋ_fb = p (expected − observed)/K, where p is 2 over the time since the clutch was open, times the share of the torque that has been delivered.
    #[test]
    fn the_feedback_follows_what_is_lacking_and_rests_in_a_landing_that_has_enough() {
        let (asked, h, before) = (50.0, 1e-2, 0.1);
        for (landing, bitten_for, observed, moves) in [
            (false, 0.5, 25.0, true),
            (true, 0.5, 25.0, true),
            (true, 0.5, 29.0, true),
            (true, 0.5, 31.0, false),
            (false, 0.5, 31.0, true),
            (false, 0.0, 25.0, false),
        ] {
            let mut c = Controller::new(&Vehicle::paper(), &Settings::robust());
            let lacking = asked - observed;
            let g = &mut c.state.governed;
            (g.expected, g.lacking, g.engaged_for, g.bitten_for, g.floor) = (Lags::at(asked), Lags::at(lacking), 1.0, bitten_for, 20.0);
            g.landing = if landing { Landing { slip: 50.0, torque: 60.0 } } else { Landing::default() };
            (c.state.estimate.t_fc, c.state.feedback.integral) = (observed, before);
            c.place(asked, 1.0, 30.0, c.settings.x_open, h);
            let (delivered, slope) = ((2.0 - lacking / 22.5).clamp(0.1, 1.0), c.state.governed.slope);
            assert!(slope > 15.0 && c.settings.torque_bandwidth < 2.0);
            let rate = (2.0 * delivered * lacking / slope).min(1.0);
            let expected = before + if moves { rate * h } else { 0.0 };
            let found = c.state.outputs.x_to_fb;
            assert!((found - expected).abs() < 1e-12, "{observed} N·m in a landing ({landing}): {found} against {expected} mm");
        }
    }

    /// The torque d that the clutch carries beyond the map at the beginning of a landing is moved to the feedback: x(T − d) − x(T).
    #[test]
    fn the_torque_that_a_landing_takes_over_moves_to_the_feedback() {
        let mut c = Controller::new(&Vehicle::paper(), &Settings::robust());
        let g = &mut c.state.governed;
        (g.expected, g.engaged_for, g.landing, g.takes_over) = (Lags::at(60.0), 1.0, Landing { slip: 50.0, torque: 60.0 }, 6.0);
        c.state.estimate.t_fc = 60.0;
        let v = Vehicle::paper();
        let x = |t: f64| map::inverse(&v.friction, &v.actuator, &v.cushion_spring, t, 30.0, c.state.temperatures.theta_c);
        let expected = x(54.0) - x(60.0);
        c.place(60.0, 1.0, 30.0, c.settings.x_open, 1e-2);
        assert!((c.state.outputs.x_to_fb - expected).abs() < 1e-9, "{} against {expected} mm", c.state.outputs.x_to_fb);
        assert_eq!(c.state.governed.takes_over, 0.0, "once");
    }

    /// After lock-up the torque rises at `closing_rate`, which itself is ramped up; after a quarter of a second the position moves at 20 mm/s or more.
    #[test]
    fn a_locked_clutch_closes_softly() {
        let h = 1e-2;
        for (closing_for, slope, rise) in
            [(0.04, 30.0, 300.0 * 0.2 * h / 30.0), (0.14, 5.0, 300.0 * 0.6 * h / 15.0), (0.3, 30.0, 20.0 * h), (0.3, 15.0, 20.0 * h)]
        {
            let s = Settings { closing_rate: 300.0, ..Settings::robust() };
            let mut c = Controller::new(&Vehicle::paper(), &s);
            c.state.mode = Mode::Closing;
            c.state.plan.duration = 1.0;
            c.state.outputs.x_to = 6.0;
            let g = &mut c.state.governed;
            (g.closing_for, g.slope, g.rate) = (closing_for, slope, 1e6);
            c.close_softly(&c.state.guard.good.clone(), h);
            assert!((c.state.outputs.x_to - 6.0 - rise).abs() < 1e-12, "{} mm, {rise} expected", c.state.outputs.x_to - 6.0);
            assert_eq!(c.state.mode, Mode::Closing);
            c.state.outputs.x_to = s.x_max;
            c.close_softly(&c.state.guard.good.clone(), h);
            assert_eq!(c.state.mode, Mode::Closed, "at its maximum it is closed");
        }
    }

    /// With a touch point that moves by −0.01 mm/K, nine tenths of the 0.2 mm that a launch shows are attributed to the temperature: −18 K.
    #[test]
    fn a_launch_corrects_the_temperature_along_the_touch_point_s_slope() {
        let mut vehicle = Vehicle::paper();
        let a = &mut vehicle.actuator;
        (a.x_cnt_1, a.x_cls_1, a.x_cnt_2, a.x_cls_2) = (-0.01, -0.01, 0.0, 0.0);
        let mut c = Controller::new(&vehicle, &Settings { learning_rate: 1.0, ..Settings::robust() });
        c.state.temperatures.theta_c = 80.0;
        // The sums outweigh the prior.
        c.state.learning.sums = [1e12, 0.0, 0.0, -0.2e12, 0.0];
        c.conclude_learning();
        assert!((c.state.temperatures.theta_c - 62.0).abs() < 1e-6, "{} °C", c.state.temperatures.theta_c);
    }

    /// A learned touch point shifts the bearing by its value. Only a slipping clutch teaches, and only with a learning rate above 0.
    #[test]
    fn a_learned_touch_point_moves_the_bearing_and_only_slip_teaches() {
        let placed = |touch_point: f64, learning_rate: f64, slip: f64| {
            let mut c = Controller::new(&Vehicle::paper(), &Settings { learning_rate, ..Settings::robust() });
            c.state.learning.touch_point = touch_point;
            let (before, open) = (format!("{:?}", c.state.learning), c.settings.x_open);
            (c.state.governed.expected, c.state.estimate.t_fc) = (Lags::at(40.0), 40.0);
            c.place(40.0, 1.0, slip, open, 10.0);
            (c.state.outputs.x_to, before != format!("{:?}", c.state.learning))
        };
        let lock = Settings::robust().slip_lock;
        assert!((placed(0.1, 0.0, 30.0).0 - placed(0.0, 0.0, 30.0).0 - 0.1).abs() < 1e-12);
        assert_eq!([placed(0.0, 0.5, 30.0).1, placed(0.0, 0.0, 30.0).1, placed(0.0, 0.5, 0.5 * lock).1], [true, false, false]);
    }
}
