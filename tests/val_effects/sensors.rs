//! Sensors: speeds that change linearly or decay exponentially, as they are sensed.

use crate::bench::{Bench, Law, omega_c, omega_f};
use kisspoint::effects::param::{clutch_speed_delay as late_c, clutch_speed_gain as gain, engine_speed_delay as late_f};

/// Flywheel and disc lose speed by damping, at rates of 4 and 5 1/s.
fn decaying() -> Bench {
    let mut bench = Bench::held(200.0, 100.0, 25.0, 0.0);
    let d = &mut bench.vehicle.driveline;
    (d.J_f, d.b_f, d.J_c, d.b_c) = (0.2, 0.8, 0.5, 2.5);
    bench.step = 2.5e-4;
    bench
}

/// The disc loses 40 rad/s every second.
fn ramp() -> Bench {
    let mut bench = Bench::held(200.0, 100.0, 25.0, 0.0);
    bench.vehicle.driveline.J_c = 0.5;
    bench.rest.t_load = 20.0;
    bench
}

/// Distance, in time, that the output of a filter has moved along a ramp.
fn trailing(t: f64, tau: f64) -> f64 {
    t - tau * (1.0 - (-t / tau).exp())
}

/// Response to e^(−λt) of a filter whose output was 1: the steady response and the decaying transient.
fn smoothed(rate: f64, t: f64, tau: f64) -> f64 {
    let steady = 1.0 / (1.0 - rate * tau);
    steady * (-rate * t).exp() + (1.0 - steady) * (-t / tau).exp()
}

pub fn laws() -> Vec<Law> {
    let law = Law::new;
    let decay = |from: f64, rate: f64, t: f64| from * (-rate * t).exp();
    vec![
        law("disc speed by a factor", &[(gain::gain, 1.02)], ramp(), 0.5, omega_c, 1.02 * 80.0),
        law("disc speed late", &[(late_c::delay, 0.05)], ramp(), 0.5, omega_c, 100.0 - 40.0 * 0.45),
        law("disc speed filtered", &[(late_c::smoothing, 0.03)], ramp(), 0.5, omega_c, 100.0 - 40.0 * trailing(0.5, 0.03)),
        law("disc speed late and filtered", &[(late_c::delay, 0.05), (late_c::smoothing, 0.03)], ramp(), 0.5, omega_c, {
            100.0 - 40.0 * trailing(0.45, 0.03)
        }),
        law("disc speed late and by a factor", &[(late_c::delay, 0.05), (gain::gain, 1.02)], ramp(), 0.5, omega_c, 1.02 * 82.0),
        law("no value is older than the start", &[(late_c::delay, 0.2)], ramp(), 0.1, omega_c, 100.0),
        law("engine speed late", &[(late_f::delay, 0.05)], decaying(), 0.4, omega_f, decay(200.0, 4.0, 0.35)).within(1e-6),
        law("engine speed filtered", &[(late_f::smoothing, 0.01)], decaying(), 0.4, omega_f, 200.0 * smoothed(4.0, 0.4, 0.01)),
        law(
            "engine speed filtered for a short time",
            &[(late_f::smoothing, 0.05)],
            decaying(),
            0.03,
            omega_f,
            200.0 * smoothed(4.0, 0.03, 0.05),
        ),
        law("disc speed of a filter", &[(late_c::smoothing, 0.01)], decaying(), 0.4, omega_c, 100.0 * smoothed(5.0, 0.4, 0.01)),
        law("engine speed late and filtered", &[(late_f::delay, 0.03), (late_f::smoothing, 0.01)], decaying(), 0.4, omega_f, {
            200.0 * smoothed(4.0, 0.37, 0.01)
        }),
        law("both speeds late", &[(late_f::delay, 0.05), (late_c::delay, 0.03)], decaying(), 0.4, omega_c, decay(100.0, 5.0, 0.37))
            .within(1e-6),
        law("the engine's delay is not the disc's", &[(late_f::delay, 0.05)], decaying(), 0.4, omega_c, decay(100.0, 5.0, 0.4)).limit(),
    ]
}
