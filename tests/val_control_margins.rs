//! Phase margins of the paper's law and of the governed one, from the transfer functions of the linearised loop with an actuator of 30 ms lag and 15 ms delay.
//!
//! The loop is cut at the position command, so that both paths that act on it, the speed loop through the inverse map and the torque feedback through the observer, are
//! included. With K = dT_fc/dx of the plant and K̂ that of the controller's map,
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

/// Smallest phase margin in degrees, and gain margin as a factor, of a loop that is integrating at low frequency.
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

/// Smallest distance of the Nyquist curve from −1, and the angle in rad by which 1 + L turns from low to high frequencies. A loop without unstable poles that does not encircle
/// −1 is stable, even if shafts make its gain resonate above 1.
fn distance(open_loop: impl Fn(f64) -> C) -> (f64, f64) {
    let at = |k: usize| C::from(1.0) + open_loop(10.0_f64.powf(-2.0 + 5.0 * k as f64 / 20_000.0));
    let (mut nearest, mut turned, mut last) = (f64::INFINITY, 0.0, at(0));
    for k in 1..=20_000 {
        let now = at(k);
        turned += (now / last).arg();
        (nearest, last) = (nearest.min(now.norm()), now);
    }
    (nearest, turned)
}

/// dT/dx of the nominal map in N·m/mm at the position where it transmits `torque`.
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
    // 1/s with a delay of 0.1 s crosses unit gain at 1 rad/s with a phase margin of 90° − 5.73°; its phase passes −180° at 5 π rad/s.
    let (phase, gain) = margins(|w| (-C::new(0.0, w) * 0.1).exp() / C::new(0.0, w));
    assert!((phase - (90.0 - 5.7296)).abs() < 0.05, "{phase}");
    assert!((gain / (5.0 * std::f64::consts::PI) - 1.0).abs() < 1e-3, "{gain}");
}

#[test]
fn a_loop_that_turns_around_minus_one_is_found() {
    // Three lags of 1 s are stable up to a gain of 8.
    let lags = |gain: f64| move |w: f64| C::from(gain) / (C::new(1.0, w) * C::new(1.0, w) * C::new(1.0, w));
    let ((near, stable), (_, unstable)) = (distance(lags(6.0)), distance(lags(10.0)));
    assert!(stable.abs() < 0.1 && (unstable.abs() - 2.0 * std::f64::consts::PI).abs() < 0.1, "{stable}, {unstable}");
    assert!(near < 0.25, "{near}");
}

/// The governed loop, cut at the torque demand: speed feedback k_P, load observer with Q = p²/(s + p)², speed filter F, actual actuator A_true (30 ms lag, 15 ms delay, 1.5
/// samples) and its model in the controller (A),
///
/// L = (k_P + Q J_c s) F P A_true / (1 − Q A F), with P from clutch torque to disc speed.
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

/// Transfer function from clutch torque to disc speed, with shafts of this compliance, disc share and damping; compliance 0 means rigid.
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

/// A point of the landing: slope of the torque over the slip (N·m·s/rad), and the share of the landing that is still ahead, u (2 − u).
#[derive(Clone, Copy)]
struct Landing {
    gain: f64,
    share: f64,
}

/// The loop of the landing, cut at the torque demand, T = k (F_s s + a (ω̇_f,ref − (T − T_l)/J_c)) + (1 − g) T_l + …, with the load T_l = Q (A F T + T̂ − O A T − J_c ω̇_c F)
/// that the observer estimates, and an engine whose controller receives T + 0.3 (T̂ − O A T):
///
/// L = k a z⁻¹/J_c − k F_s s/T − (1 − g + k a/J_c) T_l/T.
fn landing_loop(g: &Settings, at: Landing, p: impl Fn(C) -> C, sampling: f64, steep: f64, w: f64) -> C {
    let d = Vehicle::paper().driveline;
    let s = C::new(0.0, w);
    let one = C::from(1.0);
    let lag = |time: f64| one / (one + s * time);
    let hold = (-s * (1.5 * sampling)).exp();
    let truly = hold * (-s * 0.015).exp() * lag(0.03) * steep;
    let a = lag(0.5 * g.actuator_time) * lag(0.5 * g.actuator_time);
    let f = lag(g.filter_time) * lag(g.filter_time);
    let quick = lag(0.6 * g.filter_time) * lag(0.6 * g.filter_time);
    let o = C::from(-g.l_2 / d.J_f) / (s * s + s * ((d.b_f + g.l_1) / d.J_f) - C::from(g.l_2 / d.J_f));
    let q = C::from(g.load_bandwidth * g.load_bandwidth) / ((s + g.load_bandwidth) * (s + g.load_bandwidth));
    let departs = o * truly - lag((d.b_f + g.l_1) / -g.l_2) * a;
    let disc = p(s) * truly;
    // The engine controller is sampled as well; the engine torque follows without lag.
    let engine = (hold * (one + departs * 0.3) - truly) / (s * d.J_f + d.b_f + hold * pi(g.kp_engine, g.ki_engine, s));
    let load = q * (a * f + departs - s * d.J_c * f * disc);
    let ahead = (g.actuator_time + 1.2 * g.filter_time) / d.J_c;
    C::from(at.gain * ahead) * (-s * 1e-3).exp() - quick * (engine - disc) * at.gain - load * (1.0 - at.share + at.gain * ahead)
}

#[test]
fn the_landing_keeps_its_margins_on_rigid_and_elastic_drivelines() {
    let g = Settings::robust();
    for (compliance, share, damping) in
        [(0.0, 1.0, 0.0), (0.003, 0.1, 1.0), (0.006, 0.1, 0.3), (0.006, 0.1, 1.0), (0.01, 0.1, 1.0), (0.015, 0.1, 0.5)]
    {
        for sampling in [1e-3, 1e-2, 2e-2] {
            for steep in [0.7, 1.0, 1.5] {
                // A launch with 40 N·m more than the landing needs, from three quarters of the slip down to none.
                for u in [0.75, 0.5, 0.25, 0.0_f64] {
                    let at = Landing { gain: 2.0 * (1.0 - u) * 40.0 / 55.0, share: u * (2.0 - u) };
                    let p = driveline(compliance, share, damping);
                    let (nearest, turned) = distance(|w| landing_loop(&g, at, &p, sampling, steep, w));
                    let what =
                        format!("{compliance} rad/(N·m), damping {damping}, samples of {sampling} s, {steep} × map, {u} of the slip");
                    println!("{what}: {nearest:.2} from -1");
                    // A distance of 0.5 guarantees a phase margin of 29° and a gain margin of 2. The softest shafts with the steepest clutch have less in the last moment of
                    // slip.
                    let least = if compliance > 0.012 && steep > 1.2 { 0.2 } else { 0.5 };
                    assert!(nearest > least && turned.abs() < 1.0, "{what}: {nearest:.2} from -1, turned by {turned:.1}");
                }
            }
        }
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
