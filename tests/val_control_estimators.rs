//! Estimators compared with the plant: the balances (8a), (8b), the observer (9) at every communication step, and the inverse map.

#[allow(dead_code)]
mod coupled;

use coupled::{Coupled, STANDSTILL};
use kisspoint::control::Settings;
use kisspoint::control::observer::{Estimate, Observer, from_driveline_balance, from_engine_balance};
use kisspoint::effects;
use kisspoint::physics::{cushion, map};
use kisspoint::plant::Phase;
use kisspoint::vehicle::Vehicle;

#[test]
fn balances_give_the_clutch_torque_back() {
    let d = Vehicle::paper().driveline;
    let mut run = Coupled::new(&effects::null(), &Settings::robust(), STANDSTILL);
    run.run(1.2, |_, _| ());
    let mut checked = 0;
    for w in run.rows.windows(3).filter(|w| w[0].0 > 0.3 && w[2].2.phase == Phase::Slipping) {
        let (a, b, c) = (&w[0].1, &w[1].1, &w[2].1);
        let slope = |f: fn(&kisspoint::plant::Outputs) -> f64| (f(c) - f(a)) / (2.0 * run.step);
        // The engine torque is held over a step, so the torque at the point between two steps is the mean of both.
        let t_e = 0.5 * (b.t_e + c.t_e);
        let by_engine = from_engine_balance(&d, b.omega_f, slope(|p| p.omega_f), t_e);
        let by_driveline = from_driveline_balance(&d, b.omega_c, slope(|p| p.omega_c), 0.0);
        assert!((by_engine - b.t_fc).abs() < 0.2, "(8a) {by_engine} against {} N·m at {} s", b.t_fc, w[1].0);
        assert!((by_driveline - b.t_fc).abs() < 0.2, "(8b) {by_driveline} against {} N·m at {} s", b.t_fc, w[1].0);
        checked += 1;
    }
    assert!(checked > 500);
}

/// Largest error during the last tenth of `time` s, for a constant torque on an engine whose speed is sampled every `step` s.
fn observer_error(step: f64, time: f64) -> f64 {
    let d = Vehicle::paper().driveline;
    let s = Settings::robust();
    let mut observer = Observer::new(&d, s.l_1, s.l_2);
    let (t_fc, t_e) = (60.0, 52.0);
    // (7a) with both torques constant has a closed-form solution.
    let speed = |t: f64| {
        let end = (t_e - t_fc) / d.b_f;
        end + (104.0 - end) * (-d.b_f / d.J_f * t).exp()
    };
    let mut estimate = Estimate { omega_f: 104.0, t_fc: 0.0 };
    let count = (time / step) as usize;
    let mut worst = 0.0_f64;
    for k in 1..=count {
        estimate = observer.advance(estimate, speed(k as f64 * step), t_e, step);
        assert!(estimate.t_fc.abs() < 200.0, "step {step} s: {} N·m", estimate.t_fc);
        if k > count * 9 / 10 {
            worst = worst.max((estimate.t_fc - t_fc).abs());
        }
    }
    worst
}

#[test]
fn the_observer_is_stable_and_true_at_every_communication_step() {
    for step in [1e-5, 1e-4, 3e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2] {
        let error = observer_error(step, 1.5);
        // The held speed causes a ripple of ℓ_2/ℓ_1 · J_f · ω̇ · h at most.
        let ripple = 4252.0 / 300.0 * 40.0 * step * 0.189 + 1e-3;
        assert!(error < ripple + 0.1, "step {step} s: {error} N·m, ripple {ripple} N·m");
    }
}

#[test]
fn the_observer_as_printed_would_be_unstable() {
    let d = Vehicle::paper().driveline;
    let mut printed = Observer::new(&d, -300.0, 4252.0);
    let mut estimate = Estimate { omega_f: 104.0, t_fc: 0.0 };
    for _ in 0..20 {
        estimate = printed.advance(estimate, 104.1, 3.0, 1e-3);
    }
    assert!(estimate.t_fc.abs() > 1e6);
}

#[test]
fn the_inverse_map_is_monotone_and_inverts() {
    let v = Vehicle::paper();
    let mut bent = v;
    (bent.actuator.x_cnt_1, bent.actuator.x_cls_1) = (-2e-3, -1.5e-3);
    for v in [v, bent] {
        for theta in [-20.0, 25.0, 90.0, 170.0, 240.0] {
            for slip in [0.0, 0.5, 4.0, 40.0, 110.0] {
                let forward = |x: f64| {
                    let xi = map::normalised_position(map::contact(&v.actuator, theta), x);
                    let force = cushion::force(&v.cushion_spring, cushion::contact_point(&v.cushion_spring), xi);
                    map::torque_capacity(&v.friction, force, slip, theta)
                };
                let mut last = f64::NEG_INFINITY;
                let most = forward(20.0);
                for k in 0..=100 {
                    let torque = f64::from(k) / 100.0 * most;
                    let x = map::inverse(&v.friction, &v.actuator, &v.cushion_spring, torque, slip, theta);
                    assert!(x > last, "{torque} N·m at {slip} rad/s, {theta} °C");
                    last = x;
                    assert!((forward(x) - torque).abs() < 1e-9, "{torque} N·m at {slip} rad/s, {theta} °C: {}", forward(x));
                }
            }
        }
    }
}
