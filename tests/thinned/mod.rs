//! A slower logger.

use kisspoint::campaign::Recording;

/// The same recording from a logger that keeps one row in `step`.
pub fn every(step: usize, whole: &Recording) -> Recording {
    let kept = |v: &[f64]| v.iter().copied().step_by(step).collect::<Vec<f64>>();
    Recording {
        sample_rate_hz: whole.sample_rate_hz / step as f64,
        time: kept(&whole.time),
        omega_f: kept(&whole.omega_f),
        omega_c: kept(&whole.omega_c),
        t_e: kept(&whole.t_e),
        x_to_cmd: kept(&whole.x_to_cmd),
        theta_h: kept(&whole.theta_h),
        x_to: whole.x_to.as_deref().map(kept),
        t_fc: whole.t_fc.as_deref().map(kept),
        theta_c: whole.theta_c.as_deref().map(kept),
        ..whole.clone()
    }
}
