//! The plant against an independent solution (`tests/oracle/plant_oracle.py`): states to 1e-6 relative through lock-up,
//! break-away and reversal, hot and cold; times of the events to 1e-6 s.

use kisspoint::effects;
use kisspoint::plant::{Inputs, Phase, Plant, Start};
use kisspoint::vehicle::Vehicle;
use serde_json::Value;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("an array").iter().map(|x| x.as_f64().expect("a number")).collect()
}

fn inputs(case: &Value, t: f64) -> Inputs {
    let corner = case["inputs"].as_array().unwrap().iter().map(numbers).rfind(|u| u[0] <= t + 1e-12).unwrap();
    Inputs { x_to: corner[1], t_e_ref: corner[2], theta_h: corner[3], t_load: corner[4] }
}

fn plant(case: &Value) -> Plant {
    let mut vehicle = Vehicle::paper();
    let (kiss, closed, start) = (numbers(&case["x_cnt"]), numbers(&case["x_cls"]), numbers(&case["start"]));
    let a = &mut vehicle.actuator;
    (a.x_cnt_0, a.x_cnt_1, a.x_cnt_2) = (kiss[0], kiss[1], kiss[2]);
    (a.x_cls_0, a.x_cls_1, a.x_cls_2) = (closed[0], closed[1], closed[2]);
    let start = Start { omega_f: start[0], omega_c: start[1], theta_c: start[2], theta_b: start[3] };
    Plant::new(&vehicle, &effects::null(), &start, &inputs(case, 0.0))
}

/// Every time at which an input changes or the oracle looks.
fn stops(case: &Value) -> Vec<f64> {
    let looks = case["rows"].as_array().unwrap().iter().map(|r| r["time"].as_f64().unwrap());
    let corners = case["inputs"].as_array().unwrap().iter().map(|u| u[0].as_f64().unwrap());
    let mut all: Vec<f64> = looks.chain(corners).filter(|t| *t > 0.0).collect();
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

/// Runs a scenario in steps of at most `step`; returns the worst relative deviation of a state.
fn worst_deviation(name: &str, case: &Value, step: f64) -> f64 {
    let mut plant = plant(case);
    let (mut t, mut worst) = (0.0_f64, 0.0_f64);
    for stop in stops(case) {
        let count = ((stop - t) / step).ceil();
        for _ in 0..count as usize {
            plant.step(&inputs(case, t), (stop - t) / count);
        }
        t = stop;
        let Some(row) = case["rows"].as_array().unwrap().iter().find(|r| r["time"].as_f64() == Some(t)) else { continue };
        let found = plant.outputs();
        // A scale of 1 keeps a slip of nearly nothing from counting as a relative error of its own.
        for (what, value) in [
            ("omega_f", found.omega_f),
            ("omega_c", found.omega_c),
            ("theta_c", found.theta_c),
            ("theta_b", found.theta_b),
            ("e_d", found.e_d),
        ] {
            let exact = row[what].as_f64().unwrap();
            let deviation = (value - exact).abs() / exact.abs().max(1.0);
            assert!(deviation < 1e-6, "{name}, {what} at {t} s in steps of {step} s: {value} against {exact}, {deviation:.1e}");
            worst = worst.max(deviation);
        }
        assert_eq!(found.phase == Phase::Locked, row["stuck"].as_bool().unwrap(), "{name} at {t} s");
    }
    worst
}

#[test]
fn states_agree_through_lock_up_and_break_away() {
    let oracle: Value = serde_json::from_str(include_str!("oracle/plant_oracle.json")).unwrap();
    for (name, case) in oracle.as_object().unwrap() {
        for step in [1e-3, 1e-2, 2.7e-4] {
            println!("{name} in steps of {step} s: worst relative deviation {:.1e}", worst_deviation(name, case, step));
        }
    }
}

#[test]
fn lock_up_happens_when_the_oracle_says() {
    let oracle: Value = serde_json::from_str(include_str!("oracle/plant_oracle.json")).unwrap();
    for (name, case) in oracle.as_object().unwrap() {
        let event = &case["events"][0];
        assert_eq!(event["what"], "lock-up", "{name}");
        let at = event["time"].as_f64().unwrap();
        for (offset, locked) in [(-1e-6, false), (1e-6, true)] {
            let mut plant = plant(case);
            let mut t = 0.0;
            for stop in stops(case).into_iter().filter(|s| *s < at).chain([at + offset]) {
                plant.step(&inputs(case, t), stop - t);
                t = stop;
            }
            assert_eq!(plant.outputs().phase == Phase::Locked, locked, "{name}: {offset} s from its lock-up at {at} s");
        }
    }
}
