//! The plant compared with independent solutions, nominal (`tests/oracle/plant_oracle.py`) and with effects (`effects_oracle.py`): states agree to a relative 1e-6 through
//! lock-up, break-away, reversal and re-engagement, hot and cold, open and at standstill; times of the events to 1e-6 s.

use kisspoint::effects::{self, PARAMETERS};
use kisspoint::plant::{Inputs, Phase, Plant, Start};
use kisspoint::vehicle::Vehicle;
use serde_json::Value;

const NOMINAL: &str = include_str!("oracle/plant_oracle.json");
const EFFECTS: &str = include_str!("oracle/effects_oracle.json");

fn cases(text: &str) -> Vec<(String, Value)> {
    let oracle: Value = serde_json::from_str(text).unwrap();
    oracle.as_object().unwrap().iter().map(|(name, case)| (name.clone(), case.clone())).collect()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("an array").iter().map(|x| x.as_f64().expect("a number")).collect()
}

fn inputs(case: &Value, t: f64) -> Inputs {
    let corner = case["inputs"].as_array().unwrap().iter().map(numbers).rfind(|u| u[0] <= t + 1e-12).unwrap();
    Inputs { x_to: corner[1], t_e_ref: corner[2], theta_h: corner[3], t_load: corner[4] }
}

fn plant(case: &Value) -> Plant {
    let mut vehicle = Vehicle::paper();
    let a = &mut vehicle.actuator;
    for (key, [p_0, p_1, p_2]) in
        [("x_cnt", [&mut a.x_cnt_0, &mut a.x_cnt_1, &mut a.x_cnt_2]), ("x_cls", [&mut a.x_cls_0, &mut a.x_cls_1, &mut a.x_cls_2])]
    {
        if !case[key].is_null() {
            let given = numbers(&case[key]);
            (*p_0, *p_1, *p_2) = (given[0], given[1], given[2]);
        }
    }
    let mut parameters = effects::null();
    for (name, value) in case["effects"].as_object().into_iter().flatten() {
        let k = PARAMETERS.iter().position(|p| p.variable == format!("effect.{name}")).expect("an effect of the library");
        parameters[k] = value.as_f64().unwrap();
    }
    let start = numbers(&case["start"]);
    let start = Start { omega_f: start[0], omega_c: start[1], theta_c: start[2], theta_b: start[3] };
    Plant::new(&vehicle, &parameters, &start, &inputs(case, 0.0))
}

/// All times at which an input changes or the oracle has a row.
fn stops(case: &Value) -> Vec<f64> {
    let looks = case["rows"].as_array().unwrap().iter().map(|r| r["time"].as_f64().unwrap());
    let corners = case["inputs"].as_array().unwrap().iter().map(|u| u[0].as_f64().unwrap());
    let mut all: Vec<f64> = looks.chain(corners).filter(|t| *t > 0.0).collect();
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

/// Runs a scenario in steps of at most `step`, with substeps of at most `substep` s; returns the largest relative deviation of a state.
fn worst_deviation(name: &str, case: &Value, step: f64, substep: f64, allowed: f64) -> f64 {
    let mut plant = plant(case);
    plant.set_max_substep(substep);
    let (mut t, mut worst) = (0.0_f64, 0.0_f64);
    for stop in stops(case) {
        let count = ((stop - t) / step).ceil();
        for _ in 0..count as usize {
            plant.step(&inputs(case, t), (stop - t) / count);
        }
        t = stop;
        let Some(row) = case["rows"].as_array().unwrap().iter().find(|r| r["time"].as_f64() == Some(t)) else { continue };
        let found = plant.outputs();
        let omega_v = plant.state().y[kisspoint::plant::motion::index::OMEGA_V];
        // The scale is at least 1, so that a slip near zero does not give a large relative error.
        for (what, value) in [
            ("omega_f", found.omega_f),
            ("omega_c", found.omega_c),
            ("omega_v", omega_v),
            ("theta_c", found.theta_c),
            ("theta_b", found.theta_b),
            ("e_d", found.e_d),
            ("x_to_actual", found.x_to_actual),
            ("t_fc", found.t_fc),
        ] {
            let Some(exact) = row[what].as_f64() else { continue };
            let deviation = (value - exact).abs() / exact.abs().max(1.0);
            assert!(deviation < allowed, "{name}, {what} at {t} s in steps of {step} s: {value} against {exact}, {deviation:.1e}");
            worst = worst.max(deviation);
        }
        assert_eq!(found.phase == Phase::Locked, row["stuck"].as_bool().unwrap(), "{name} at {t} s");
    }
    worst
}

#[test]
fn states_agree_through_lock_up_and_break_away() {
    for (name, case) in cases(NOMINAL) {
        for step in [1e-3, 1e-2, 2.7e-4] {
            println!("{name} in steps of {step} s: worst relative deviation {:.1e}", worst_deviation(&name, &case, step, 1e-3, 1e-6));
        }
    }
}

#[test]
fn states_with_effects_agree_open_slipping_locked_re_engaged_overrun_and_at_standstill() {
    for (name, case) in cases(EFFECTS) {
        for (step, substep, allowed) in [(1e-3, 1e-4, 1e-6), (1e-2, 1e-4, 1e-6), (1e-3, 1e-3, 2e-4)] {
            let worst = worst_deviation(&name, &case, step, substep, allowed);
            println!("{name} in steps of {step} s, substeps of {substep} s: worst relative deviation {worst:.1e}");
        }
    }
}

#[test]
fn lock_up_happens_when_the_oracle_says() {
    for (name, case) in cases(NOMINAL) {
        let event = &case["events"][0];
        assert_eq!(event["what"], "lock-up", "{name}");
        let at = event["time"].as_f64().unwrap();
        for (offset, locked) in [(-1e-6, false), (1e-6, true)] {
            let mut plant = plant(&case);
            let mut t = 0.0;
            for stop in stops(&case).into_iter().filter(|s| *s < at).chain([at + offset]) {
                plant.step(&inputs(&case, t), stop - t);
                t = stop;
            }
            assert_eq!(plant.outputs().phase == Phase::Locked, locked, "{name}: {offset} s from its lock-up at {at} s");
        }
    }
}
