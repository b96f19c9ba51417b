//! Performance figures of an engagement: engagement time, dissipated energy (10), slip acceleration at lock-up (11).
//!
//! (10) E_d = ∫_0^t_f T_fc ω_fc dt
//! (11) ω̇_c(t_f⁺) − ω̇_c(t_f⁻) = J_f / (J_f + J_c) ω̇_fc(t_f⁻)
//!
//! | symbol | meaning | unit | source |
//! |---|---|---|---|
//! | t_f | time from the start of the engagement to lock-up | s | paper Table II |
//! | E_d | energy dissipated by slip | J | eq. (10) |
//! | ω̇_fc(t_f⁻) | slip acceleration just before lock-up; Table II prints its magnitude | rad/s² | eq. (11) |

use crate::physics::driveline::{self, Driveline};

/// Figures of one engagement.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Performance {
    /// t_f, s.
    pub time: f64,
    /// E_d, J.
    pub energy: f64,
    /// ω̇_fc just before lock-up, rad/s².
    pub slip_acceleration: f64,
}

/// Friction power in W that heats the clutch: the integrand of (10). With an estimated torque it may be negative for a moment; clipping it would turn noise into heat.
#[inline]
pub fn dissipated_power(t_fc: f64, slip: f64) -> f64 {
    t_fc * slip
}

/// Slip acceleration ω̇_fc in rad/s², from (7) with the clutch torque `t_fc` in N·m.
pub fn slip_acceleration(p: &Driveline, omega_f: f64, omega_c: f64, t_e: f64, t_fc: f64, t_load: f64) -> f64 {
    let engine = driveline::flywheel_acceleration(p, omega_f, t_e, t_fc);
    engine - driveline::driveline_acceleration(p.J_c, t_fc, driveline::resistance(p, omega_c, t_load))
}

/// Jump of the driveline's acceleration at lock-up in rad/s², eq. (11).
pub fn acceleration_jump(p: &Driveline, slip_acceleration: f64) -> f64 {
    p.J_f / (p.J_f + p.J_c) * slip_acceleration
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::Vehicle;

    #[test]
    fn the_jump_is_the_one_that_both_balances_make() {
        let p = Vehicle::paper().driveline;
        let (omega, t_e, t_fc) = (100.0, 40.0, 55.0);
        let resist = driveline::resistance(&p, omega, 0.0);
        let before = driveline::driveline_acceleration(p.J_c, t_fc, resist);
        let after = driveline::driveline_acceleration(p.J_c, driveline::holding_torque(&p, p.J_c, omega, t_e, resist), resist);
        let jump = acceleration_jump(&p, slip_acceleration(&p, omega, omega, t_e, t_fc, 0.0));
        assert!((after - before - jump).abs() < 1e-12, "{} against {jump}", after - before);
    }
}
