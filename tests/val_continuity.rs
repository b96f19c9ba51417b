//! With effects, too, the communication step does not influence the result, and effects are continuous at their null values.

use kisspoint::effects::empirical::CURVES;
use kisspoint::effects::{self, Parameters, param};
use kisspoint::plant::{Inputs, Outputs, Plant, Start};
use kisspoint::vehicle::Vehicle;

const START: Start = Start { omega_f: 104.719_755_119_659_78, omega_c: 0.0, theta_c: 25.0, theta_b: 25.0 };

/// Position and torque, held for 20 ms each.
fn inputs(k: usize) -> Inputs {
    let t = 0.02 * k as f64;
    Inputs { x_to: 4.5 + 1.0 * t.min(1.0), t_e_ref: 30.0 + 10.0 * (k % 3) as f64, theta_h: 25.0, t_load: 0.0 }
}

/// Outputs after half a second of slip, in steps of `h` s.
fn run(p: &Parameters, h: f64) -> Outputs {
    let mut plant = Plant::new(&Vehicle::paper(), p, &START, &inputs(0));
    for k in 0..25 {
        for _ in 0..(0.02 / h).round() as usize {
            plant.step(&inputs(k), h);
        }
    }
    plant.outputs()
}

fn distance(a: &Outputs, b: &Outputs) -> (f64, f64) {
    let speed = (a.omega_f - b.omega_f).abs().max((a.omega_c - b.omega_c).abs());
    (speed, (a.t_fc - b.t_fc).abs())
}

// Delayed speeds are stored every 0.2 ms, and shorter steps would skip some of them.
#[test]
fn the_step_does_not_matter_with_any_effect() {
    for entry in effects::all() {
        for start in entry.effect.starts {
            let mut p = effects::null();
            start.iter().for_each(|&(k, value)| p[k] = value);
            let (speed, torque) = distance(&run(&p, 1e-3), &run(&p, 2.5e-4));
            println!("{}: {speed:.1e} rad/s, {torque:.1e} N·m", entry.id);
            assert!(speed < 1e-6 && torque < 1e-6, "{}: {speed:.1e} rad/s, {torque:.1e} N·m", entry.id);
        }
    }
}

/// A table has kinks, at which a method of fourth order drops to second order. The resulting error stays far below the noise of any sensor.
#[test]
fn the_step_hardly_matters_with_a_learned_law() {
    for curve in &CURVES {
        let mut p = effects::null();
        for (i, k) in curve.parameters().enumerate() {
            p[k] = 0.3 * effects::PARAMETERS[k].max * [1.0, -0.6, 0.4][i % 3];
        }
        let (speed, torque) = distance(&run(&p, 1e-3), &run(&p, 2.5e-4));
        println!("{}: {speed:.1e} rad/s, {torque:.1e} N·m", curve.name);
        assert!(speed < 1e-4 && torque < 1e-4, "{}: {speed:.1e} rad/s, {torque:.1e} N·m", curve.name);
    }
}

#[test]
fn fast_lags_a_rate_limit_with_lag_and_fast_judder_are_followed() {
    let cases: [(&str, &[(usize, f64)]); 6] = [
        ("filtered speeds", &[(param::engine_speed_delay::smoothing, 0.02), (param::clutch_speed_delay::smoothing, 0.01)]),
        ("speeds behind a short filter", &[(param::engine_speed_delay::smoothing, 1e-4), (param::clutch_speed_delay::smoothing, 1e-7)]),
        ("lag of 0.1 ms", &[(param::actuator_lag::time_constant, 1e-4)]),
        ("engine lag of 0.1 ms", &[(param::engine_torque_lag::time_constant, 1e-4)]),
        ("rate limit with lag", &[(param::actuator_rate_limit::inverse_speed, 0.06), (param::actuator_lag::time_constant, 0.03)]),
        ("judder of order 20", &[(param::judder::cosine, 0.1), (param::judder::order, 20.0)]),
    ];
    for (what, set) in cases {
        let mut p = effects::null();
        set.iter().for_each(|&(k, value)| p[k] = value);
        let (speed, torque) = distance(&run(&p, 1e-3), &run(&p, 2e-5));
        println!("{what}: {speed:.1e} rad/s, {torque:.1e} N·m");
        assert!(speed < 1e-6 && torque < 1e-6, "{what}: {speed:.1e} rad/s, {torque:.1e} N·m");
    }
}

#[test]
fn effects_are_continuous_at_null() {
    let nominal = run(&effects::null(), 1e-3);
    for entry in effects::all() {
        for start in entry.effect.starts {
            let mut p = effects::null();
            for &(k, value) in *start {
                let null = effects::PARAMETERS[k].null;
                let amplitude = entry.effect.amplitudes.contains(&k);
                p[k] = if amplitude { null + 1e-6 * (value - null) } else { value };
            }
            let (speed, _) = distance(&run(&p, 1e-3), &nominal);
            println!("{}: {speed:.1e} rad/s", entry.id);
            assert!(speed < 1e-4, "{}: {speed:.1e} rad/s at 1e-6 of its size", entry.id);
        }
    }
    // Filters of the sensors, from which no search starts.
    let mut p = effects::null();
    (p[param::engine_speed_delay::smoothing], p[param::clutch_speed_delay::smoothing]) = (2e-8, 2e-8);
    let (speed, _) = distance(&run(&p, 1e-3), &nominal);
    assert!(speed < 1e-4, "filters: {speed:.1e} rad/s at 1e-6 of their size");
}
