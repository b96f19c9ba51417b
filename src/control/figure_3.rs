//! The paper's Figure 3 while engaging: T_c,ref = PI(ω_c,ref − ω_c), T_e,ref = PI(ω_f,ref − ω_f) + T_c,ref, and
//! x_to = x(T_c,ref, ω_fc, θ̂_c) + PI(T_c,ref − T̂_fc), with x the inverse torque map.

use super::controller::{Controller, engine_limits};
use super::guard::Inputs;
use super::pi::{Gains, Limits};
use super::reference;
use super::settings::Settings;
use crate::physics::map;

impl Controller {
    /// Figure 3: references, speed controllers, decoupling, feedforward and torque feedback.
    pub(super) fn engage_by_figure_3(&mut self, inputs: &Inputs, slip: f64, h: f64) {
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
}

/// Direction of slip, and the limits of the clutch torque at this slip. While the engine drives the vehicle, the upper limit fades to zero before the engine stalls; while the
/// vehicle drives the engine, the clutch torque supports the engine.
pub(super) fn clutch_limits(s: &Settings, omega_f: f64, slip: f64) -> (f64, Limits) {
    if slip < 0.0 {
        return (-1.0, Limits { low: -s.torque_max, high: 0.0 });
    }
    let fade = ((omega_f - s.stall_speed) / s.stall_margin).clamp(0.0, 1.0);
    (1.0, Limits { low: 0.0, high: fade * s.torque_max })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torque_is_allowed_against_the_slip_and_less_as_the_engine_slows() {
        let s = Settings { torque_max: 200.0, stall_speed: 50.0, stall_margin: 20.0, ..Settings::robust() };
        for (omega_f, slip, direction, low, high) in [
            (100.0, 5.0, 1.0, 0.0, 200.0),
            (100.0, 0.0, 1.0, 0.0, 200.0),
            (60.0, 5.0, 1.0, 0.0, 100.0),
            (55.0, 5.0, 1.0, 0.0, 50.0),
            (40.0, 5.0, 1.0, 0.0, 0.0),
            (100.0, -5.0, -1.0, -200.0, 0.0),
            (40.0, -5.0, -1.0, -200.0, 0.0),
        ] {
            assert_eq!(clutch_limits(&s, omega_f, slip), (direction, Limits { low, high }), "{omega_f} rad/s, slip of {slip} rad/s");
        }
    }
}
