//! Phase margin of the loops, of the paper's law and of the governed one, from the transfer functions of the linearised loop with an actuator of 30 ms lag and 15 ms delay.
//!
//! The loop is cut at the position command: both paths that act on it, the speed loop through the inverse map and the torque
//! feedback through the observer, count at once. With K = dT_fc/dx of the plant and K̂ that of the controller's map,
//!
//! L(s) = K A(s) [(1/K̂ + PI_T) PI_c / (J_c s + b_c) + PI_T O(s)], A = e^(−(15 ms + 1.5 h) s) / (1 + 30 ms s),
//! O(s) = (−ℓ_2/J_f) / (s² + (b_f + ℓ_1)/J_f s − ℓ_2/J_f), h = 1 ms the sampling step (hold and one step of transport).

use kisspoint::control::Settings;
use kisspoint::physics::{cushion, map};
use kisspoint::vehicle::Vehicle;
use nalgebra::Complex;

type C = Complex<f64>;

fn pi(p: f64, i: f64, s: C) -> C {
    C::from(p) + C::from(i) / s
}

fn position_loop(g: &Settings, gain: f64, believed: f64, w: f64) -> C {
    let d = Vehicle::paper().driveline;
    let s = C::new(0.0, w);
    let actuator = (-s * (0.015 + 1.5e-3)).exp() / (C::from(1.0) + s * 0.03);
    let observer = C::from(-g.l_2 / d.J_f) / (s * s + s * ((d.b_f + g.l_1) / d.J_f) - C::from(g.l_2 / d.J_f));
    let torque = pi(g.kp_torque, g.ki_torque, s);
    let speed = pi(g.kp_clutch, g.ki_clutch, s) / (s * d.J_c + d.b_c);
    actuator * gain * ((C::from(1.0 / believed) + torque) * speed + torque * observer)
}

/// Least phase margin in degrees and gain margin (factor) of a loop that is integrating at low frequency.
fn margins(open_loop: impl Fn(f64) -> C) -> (f64, f64) {
    let at = |k: usize| 10.0_f64.powf(-1.0 + 4.0 * k as f64 / 20_000.0);
    let (mut phase_margin, mut gain_margin) = (f64::INFINITY, f64::INFINITY);
    let mut last = open_loop(at(0));
    let mut phase = last.arg();
    if phase > 0.0 {
        phase -= 2.0 * std::f64::consts::PI;
    }
    for k in 1..=20_000 {
        let now = open_loop(at(k));
        let turned = phase + (now / last).arg();
        if last.norm() > 1.0 && now.norm() <= 1.0 {
            phase_margin = phase_margin.min(180.0 + turned.to_degrees());
        }
        if phase > -std::f64::consts::PI && turned <= -std::f64::consts::PI {
            gain_margin = gain_margin.min(1.0 / now.norm());
        }
        (last, phase) = (now, turned);
    }
    (phase_margin, gain_margin)
}

/// dT/dx of the nominal map in N·m/mm where it carries `torque`.
fn slope(torque: f64, theta: f64) -> f64 {
    let v = Vehicle::paper();
    let forward = |x: f64| {
        let xi = map::normalised_position(map::contact(&v.actuator, theta), x);
        let force = cushion::force(&v.cushion_spring, cushion::contact_point(&v.cushion_spring), xi);
        map::torque_capacity(&v.friction, force, 30.0, theta)
    };
    let x = map::inverse(&v.friction, &v.actuator, &v.cushion_spring, torque, 30.0, theta);
    (forward(x + 1e-4) - forward(x - 1e-4)) / 2e-4
}

#[test]
fn the_set_of_figure_3_keeps_its_margins_behind_a_real_actuator() {
    let g = Settings::figure_3();
    for (plant_over_map, least_phase, least_gain) in [(1.0, 40.0, 2.5), (0.5, 40.0, 2.5), (1.5, 30.0, 1.8)] {
        for theta in [25.0, 150.0] {
            for torque in [2.0, 10.0, 30.0, 60.0, 90.0] {
                let believed = slope(torque, theta);
                let (phase, gain) = margins(|w| position_loop(&g, plant_over_map * believed, believed, w));
                println!("{plant_over_map} × map, {theta} °C, {torque} N·m ({believed:.0} N·m/mm): {phase:.1} deg, factor {gain:.2}");
                assert!(phase > least_phase, "{plant_over_map} × map, {theta} °C, {torque} N·m: {phase:.1} deg of phase margin");
                assert!(gain > least_gain, "{plant_over_map} × map, {theta} °C, {torque} N·m: gain margin {gain:.2}");
            }
        }
    }
}

#[test]
fn the_set_of_the_paper_has_no_margin_there() {
    let g = Settings::paper();
    let believed = slope(60.0, 25.0);
    let (phase, _) = margins(|w| position_loop(&g, believed, believed, w));
    assert!(phase < 10.0, "{phase:.1} deg");
}

#[test]
fn the_engine_loop_stands_a_lag_of_its_own() {
    let (g, d) = (Settings::robust(), Vehicle::paper().driveline);
    let engine = |lag: f64| {
        move |w: f64| {
            let s = C::new(0.0, w);
            pi(g.kp_engine, g.ki_engine, s) / (s * d.J_f + d.b_f) * (-s * 1.5e-3).exp() / (C::from(1.0) + s * lag)
        }
    };
    for (lag, least) in [(0.0, 75.0), (0.05, 50.0), (0.1, 35.0)] {
        let (phase, _) = margins(engine(lag));
        println!("engine torque {lag} s late: {phase:.1} deg");
        assert!(phase > least, "engine torque {lag} s late: {phase:.1} deg");
    }
}

#[test]
fn margins_of_a_loop_that_is_known() {
    // 1/s with 0.1 s of delay crosses 1 rad/s with 90° − 5.73°; its phase passes −180° at 5 π rad/s.
    let (phase, gain) = margins(|w| (-C::new(0.0, w) * 0.1).exp() / C::new(0.0, w));
    assert!((phase - (90.0 - 5.7296)).abs() < 0.05, "{phase}");
    assert!((gain / (5.0 * std::f64::consts::PI) - 1.0).abs() < 1e-3, "{gain}");
}

/// The governed loop, cut at the torque asked for: speed feedback k_P, load observer with Q = p²/(s + p)², filter F of the speed, actuator as
/// it is (30 ms lag, 15 ms delay, 1.5 samples) and as the controller has it (A),
///
/// L = (k_P + Q J_c s) F P A_true / (1 − Q A F), P from clutch torque to disc speed.
fn governed_loop(g: &Settings, p: impl Fn(C) -> C, sampling: f64, w: f64) -> C {
    let s = C::new(0.0, w);
    let one = C::from(1.0);
    let truly = (-s * (0.015 + 1.5 * sampling)).exp() / (one + s * 0.03);
    let lag = |time: f64| one / (one + s * time);
    let a = lag(0.5 * g.actuator_time) * lag(0.5 * g.actuator_time);
    let f = lag(g.filter_time) * lag(g.filter_time);
    let q = C::from(g.load_bandwidth * g.load_bandwidth) / ((s + g.load_bandwidth) * (s + g.load_bandwidth));
    (C::from(g.kp_clutch) + q * s * Vehicle::paper().driveline.J_c) * f * p(s) * truly / (one - q * a * f)
}

/// From clutch torque to disc speed with shafts of this compliance, disc share and damping; 0 is rigid.
fn driveline(compliance: f64, share: f64, damping: f64) -> impl Fn(C) -> C {
    let d = Vehicle::paper().driveline;
    move |s: C| {
        if compliance == 0.0 {
            return C::from(1.0) / (s * d.J_c + d.b_c);
        }
        let (disc, beyond) = (share * d.J_c, (1.0 - share) * d.J_c);
        let shaft = s * damping + 1.0 / compliance;
        let far = s * s * beyond + s * d.b_c;
        s * (far + shaft) / (s * s * disc * (far + shaft) + far * shaft)
    }
}

#[test]
fn the_governed_loop_keeps_its_margins_on_rigid_and_elastic_drivelines() {
    let g = Settings::robust();
    for (compliance, share, damping) in
        [(0.0, 1.0, 0.0), (0.003, 0.1, 1.0), (0.006, 0.1, 0.3), (0.006, 0.1, 1.0), (0.01, 0.1, 1.0), (0.015, 0.1, 0.5)]
    {
        for sampling in [1e-3, 1e-2, 2e-2] {
            // The plant may be 1.5 times as steep as the map.
            for steep in [0.7, 1.0, 1.5] {
                let p = driveline(compliance, share, damping);
                let (phase, gain) = margins(|w| governed_loop(&g, &p, sampling, w) * steep);
                let what = format!("{compliance} rad/(N·m), damping {damping}, samples of {sampling} s, {steep} × map");
                println!("{what}: {phase:.1} deg, factor {gain:.2}");
                assert!(phase > 30.0 && gain > 1.8, "{what}: {phase:.1} deg, factor {gain:.2}");
            }
        }
    }
}
