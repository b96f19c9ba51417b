//! Engine: the speed of a free flywheel shows the crankshaft torque, J (ω − ω_0) = ∫ T dt.

use crate::bench::{Bench, Law, omega_f, remains};
use kisspoint::effects::param::{
    combustion_pulsation as pulsation, engine_torque_bias as bias, engine_torque_gain as gain, engine_torque_lag as lag,
    engine_torque_limit as limit,
};
use kisspoint::plant::Plant;

const J: f64 = 0.2;
const START: f64 = 200.0;

/// A flywheel without damping, with an open clutch and a reported torque of `report` N·m from time 0 on.
fn free(start: f64, report: f64) -> Bench {
    let mut bench = Bench::held(start, 0.0, 25.0, 0.0);
    bench.vehicle.driveline.J_f = J;
    bench.driven(0.0, report)
}

/// Speed after `t` seconds with a lag of the time constant `tau` that starts from zero torque: the lag's equation, integrated once, gives the impulse.
fn lagged(report: f64, tau: f64, kappa: f64, t: f64) -> f64 {
    let (z, v) = remains(tau, kappa, t);
    START + report * (t - tau * (1.0 - z) - kappa * tau * tau * -v) / J
}

/// A flywheel held at a speed, with `report` N·m from time 0 on; its work is that of the torque.
fn held(speed: f64, report: f64) -> Bench {
    Bench::held(speed, 0.0, 25.0, 0.0).driven(0.0, report)
}

fn work(plant: &Plant) -> f64 {
    plant.energy().work_in
}

/// The smaller of two torques, with a corner smoothed over 2 N·m and zero preserved.
fn lesser(asked: f64, most: f64) -> f64 {
    0.5 * (asked + most - ((asked - most).powi(2) + 4.0).sqrt()) + 0.5 * ((most * most + 4.0).sqrt() - most)
}

pub fn laws() -> Vec<Law> {
    let law = Law::new;
    let falling = [(limit::inverse_torque, 0.025), (limit::best_speed, 200.0), (limit::falling, 0.8)];
    let firing = |torque, share, order| [(pulsation::torque, torque), (pulsation::share, share), (pulsation::order, order)];
    let slow = |k, a| vec![(lag::time_constant, 0.1), (lag::curvature, k), (lag::asymmetry, a)];
    vec![
        law("gain", &[(gain::gain, 1.3)], free(START, 20.0), 0.5, omega_f, START + 1.3 * 20.0 * 0.5 / J),
        law("gain, drag", &[(gain::gain, 0.7)], free(START, -20.0), 0.5, omega_f, START - 0.7 * 20.0 * 0.5 / J),
        law("bias", &[(bias::torque, -7.0)], free(START, 20.0), 0.5, omega_f, START + (20.0 - 7.0) * 0.5 / J),
        law("bias is not scaled", &[(bias::torque, 7.0), (gain::gain, 2.0)], free(START, 20.0), 0.5, omega_f, START + 47.0 * 0.5 / J),
        // J ω ω̇ = −P.
        law("accessory", &[(bias::accessory_power, 800.0)], free(START, 0.0), 1.0, omega_f, (START * START - 2.0 * 800.0 / J).sqrt()),
        law("slow accessory", &[(bias::accessory_power, 800.0)], free(40.0, 0.0), 0.2, omega_f, 40.0 - 800.0 / 50.0 * 0.2 / J),
        law("lag", &slow(0.0, 0.0), free(START, 30.0), 0.07, omega_f, lagged(30.0, 0.1, 0.0, 0.07)),
        law("lag of two equal parts", &slow(0.25, 0.0), free(START, 30.0), 0.07, omega_f, lagged(30.0, 0.1, 0.25, 0.07)),
        law("lag that overshoots", &slow(1.0, 0.0), free(START, 30.0), 0.3, omega_f, lagged(30.0, 0.1, 1.0, 0.3)),
        law("slower up", &slow(0.0, 0.4), free(START, 30.0), 0.07, omega_f, lagged(30.0, 0.14, 0.0, 0.07)),
        law("faster down", &slow(0.0, 0.4), free(START, -30.0), 0.07, omega_f, lagged(-30.0, 0.06, 0.0, 0.07)),
        law("the bias lags along", &[(lag::time_constant, 0.1), (bias::torque, 5.0)], free(START, 30.0), 0.07, omega_f, {
            lagged(30.0, 0.1, 0.0, 0.07) + 5.0 * 0.07 / J
        }),
        law("full load", &[(limit::inverse_torque, 0.025)], held(300.0, 60.0), 0.1, work, lesser(60.0, 40.0) * 300.0 * 0.1),
        law("near full load", &[(limit::inverse_torque, 0.025)], held(300.0, 39.0), 0.1, work, lesser(39.0, 40.0) * 300.0 * 0.1),
        law("full load beside the best speed", &falling, held(150.0, 60.0), 0.1, work, lesser(60.0, 40.0 * (1.0 - 0.8 * 0.0625)) * 15.0),
        law("least full load", &falling, held(600.0, 60.0), 0.1, work, lesser(60.0, 4.0) * 60.0),
        law("no torque asked for", &[(limit::inverse_torque, 0.025)], held(300.0, 0.0), 0.1, work, 0.0).absolute(1e-9).limit(),
        // The work of a cosine over the angle, at 100 rad/s for 0.13 s.
        law("pulsation at any load", &firing(12.0, 0.0, 2.0), held(100.0, 30.0), 0.13, work, 30.0 * 13.0 + 12.0 * (26.0_f64).sin() / 2.0),
        law(
            "pulsation with the load",
            &firing(0.0, 0.5, 1.5),
            held(100.0, -30.0),
            0.13,
            work,
            -30.0 * 13.0 + 15.0 * (19.5_f64).sin() / 1.5,
        ),
    ]
}
