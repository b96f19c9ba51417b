//! Changes within a communication step of an FMU: inputs with a derivative and timed faults, and values that a calibration tool writes between two steps.

use kisspoint::effects::{self, param};
use kisspoint::faults::Faults;
use kisspoint::fmi2::{calibration::kisspoint_values, exports::*, guid, plant, plant::vr, types::*};
use kisspoint::plant::{Inputs, Plant, Start};
use kisspoint::vehicle::Vehicle;
use serde_json::{Value, json};
use std::ffi::{CString, c_void};
use std::ptr;

fn instance(guid: &str, location: Option<&str>) -> *mut c_void {
    let (guid, location) = (CString::new(guid).unwrap(), location.map(|text| CString::new(text).unwrap()));
    let location = location.as_ref().map_or(ptr::null(), |text| text.as_ptr());
    let c = fmi2Instantiate(c"x".as_ptr(), CO_SIMULATION, guid.as_ptr(), location, &CallbackFunctions::NONE, 0, 0);
    assert!(!c.is_null());
    c
}

fn initialize(c: *mut c_void) {
    assert_eq!((fmi2EnterInitializationMode(c), fmi2ExitInitializationMode(c)), (Status::Ok, Status::Ok));
}

fn set(c: *mut c_void, reference: u32, value: f64) {
    assert_eq!(fmi2SetReal(c, &reference, 1, &value), Status::Ok, "{value}");
}

fn get(c: *mut c_void, reference: u32) -> f64 {
    let mut value = f64::NAN;
    assert_eq!(fmi2GetReal(c, &reference, 1, &mut value), Status::Ok);
    value
}

fn step(c: *mut c_void, from: f64, h: f64) {
    assert_eq!(fmi2DoStep(c, from, h, 1), Status::Ok, "from {from} s");
}

fn slope(c: *mut c_void, reference: u32, per_second: f64) {
    assert_eq!(fmi2SetRealInputDerivatives(c, &reference, 1, &1, &per_second), Status::Ok);
}

/// An open clutch whose flywheel turns at 100 rad/s under 20 N·m.
fn free_flywheel() -> *mut c_void {
    let c = instance(plant::GUID, None);
    set(c, vr::omega_f_start, 100.0);
    set(c, vr::T_e_ref, 20.0);
    initialize(c);
    c
}

/// Speed of a flywheel after `t` s under a torque of `t_0` N·m that grows by `rate` N·m/s, from `omega` rad/s: the solution of J ω̇ = T − b ω.
fn flywheel(omega: f64, t_0: f64, rate: f64, t: f64) -> f64 {
    let d = Vehicle::paper().driveline;
    let steady = |t: f64| (t_0 + rate * t) / d.b_f - rate * d.J_f / (d.b_f * d.b_f);
    steady(t) + (omega - steady(0.0)) * (-d.b_f / d.J_f * t).exp()
}

#[test]
fn an_input_with_a_derivative_moves_through_one_step_and_stands_again() {
    let c = free_flywheel();
    slope(c, vr::T_e_ref, 400.0);
    step(c, 0.0, 0.05);
    let after = flywheel(100.0, 20.0, 400.0, 0.05);
    assert!((get(c, vr::omega_f) - after).abs() < 1e-5, "{} against {after} rad/s", get(c, vr::omega_f));
    assert_eq!(get(c, vr::T_e_ref), 20.0, "the input is what was set");
    step(c, 0.05, 0.03);
    let after = flywheel(after, 20.0, 0.0, 0.03);
    assert!((get(c, vr::omega_f) - after).abs() < 1e-5, "without a derivative it stands: {} against {after} rad/s", get(c, vr::omega_f));
    fmi2FreeInstance(c);
}

/// A master that interpolates by parabolas cannot know that inputs follow only straight lines; it must be able to continue with those.
#[test]
fn derivatives_of_a_higher_order_are_ignored_with_a_warning() {
    let (one, other) = (free_flywheel(), free_flywheel());
    slope(one, vr::T_e_ref, 400.0);
    let both = [vr::T_e_ref; 2];
    assert_eq!(fmi2SetRealInputDerivatives(other, both.as_ptr(), 2, [1, 2].as_ptr(), [400.0, 1e4].as_ptr()), Status::Warning);
    for c in [one, other] {
        step(c, 0.0, 0.05);
    }
    assert_eq!(get(one, vr::omega_f), get(other, vr::omega_f));
    for (order, value) in [(0, 1.0), (-1, 1.0), (2, f64::NAN)] {
        assert_eq!(fmi2SetRealInputDerivatives(other, &vr::T_e_ref, 1, &order, &value), Status::Error, "{order}, {value}");
    }
    [one, other].into_iter().for_each(|c| fmi2FreeInstance(c));
}

#[test]
fn a_step_along_a_derivative_has_pieces_of_a_millisecond_and_keeps_the_input_s_bounds() {
    let c = free_flywheel();
    let mut from = 0.0;
    // The last piece of each step holds the position at its middle: steps of 10 pieces, of 11, and of one.
    for (x, rate, h, pieces) in [(1.0, 100.0, 0.01, 10.0), (1.0, -100.0, 0.0104, 11.0), (2.0, 50.0, 0.0004, 1.0)] {
        let last = x + rate * h * (pieces - 0.5) / pieces;
        set(c, vr::x_to, x);
        slope(c, vr::x_to, rate);
        step(c, from, h);
        from += h;
        assert!((get(c, vr::x_to_actual) - last).abs() < 1e-12, "{} against {last} mm", get(c, vr::x_to_actual));
    }
    // All inputs at once.
    set(c, vr::x_to, 1.0);
    for (reference, rate) in [(vr::x_to, 100.0), (vr::T_e_ref, 1.0), (vr::theta_h, 1.0), (vr::T_load, 1.0), (vr::T_brake, 1.0)] {
        slope(c, reference, rate);
    }
    step(c, from, 0.01);
    from += 0.01;
    assert!((get(c, vr::x_to_actual) - 1.95).abs() < 1e-12, "{} mm", get(c, vr::x_to_actual));
    for (bound, rate) in [(50.0, 1e4), (-50.0, -1e4)] {
        set(c, vr::x_to, 0.9 * bound);
        slope(c, vr::x_to, rate);
        step(c, from, 0.01);
        from += 0.01;
        assert_eq!(get(c, vr::x_to_actual), bound);
    }
    fmi2FreeInstance(c);
}

/// GUID and resources of a plant of the paper's car with these faults.
fn faulty(list: &Value) -> (String, String) {
    let faults = Faults::from_value(list).unwrap();
    let tail = guid::tail(plant::DESCRIPTION.variables.iter().map(|v| v.start).chain(faults.numbers()));
    let mut document = Vehicle::paper().to_value();
    document["faults"] = list.clone();
    let guid = format!("{}{}", &plant::GUID[..guid::OF_INTERFACE], std::str::from_utf8(&tail).unwrap());
    (guid, format!("data:application/json,{document}"))
}

/// Friction falls to one half within 20 ms, and the engine torque rises by 7 N·m at once.
fn list() -> Value {
    json!([
        {"parameter": "effect.friction_level.factor", "time_s": 0.05, "ramp_s": 0.02, "value": 0.5},
        {"parameter": "effect.engine_torque_bias.torque", "time_s": 0.03, "value": 7.0},
    ])
}

const START: Start = Start { omega_f: 150.0, omega_c: 20.0, theta_c: 60.0, theta_b: 40.0 };
const INPUTS: Inputs = Inputs { x_to: 6.0, t_e_ref: 60.0, theta_h: 25.0, t_load: 0.0 };

/// An instance with these faults and a slipping clutch; its friction at the start is scaled by `factor`.
fn slipping(faults: &Value, factor: f64) -> *mut c_void {
    let (guid, location) = faulty(faults);
    let c = instance(&guid, Some(&location));
    for (reference, value) in [
        (vr::omega_f_start, START.omega_f),
        (vr::omega_c_start, START.omega_c),
        (vr::theta_c_start, START.theta_c),
        (vr::theta_b_start, START.theta_b),
        (vr::x_to, INPUTS.x_to),
        (vr::T_e_ref, INPUTS.t_e_ref),
        (vr::theta_h, INPUTS.theta_h),
        (vr::effect_friction_level_factor, factor),
    ] {
        set(c, reference, value);
    }
    initialize(c);
    c
}

#[test]
fn faults_come_at_their_times_whatever_the_communication_step() {
    assert_eq!(faulty(&json!([])).0, plant::GUID, "without faults it is the plain plant");
    // The plant, with each change applied at its time.
    let mut expected = Plant::new(&Vehicle::paper(), &effects::null(), &START, &INPUTS);
    let mut change = |until: f64, from: f64, set: &[(usize, f64)]| {
        expected.step(&INPUTS, until - from);
        let mut parameters = effects::null();
        set.iter().for_each(|&(k, value)| parameters[k] = value);
        expected.set_effects(&Vehicle::paper(), &parameters).unwrap();
        expected.outputs()
    };
    let (friction, bias) = (param::friction_level::factor, param::engine_torque_bias::torque);
    let begun = change(0.03, 0.0, &[(bias, 7.0)]);
    let mut time = 0.05;
    change(time, 0.03, &[(bias, 7.0)]);
    for k in 1..=20 {
        let next = 0.05 + 1e-3 * f64::from(k);
        change(next, time, &[(bias, 7.0), (friction, 1.0 - 0.025 * f64::from(k))]);
        time = next;
    }
    let ended = change(0.12, time, &[(bias, 7.0), (friction, 0.5)]);
    for h in [1e-3_f64, 2e-3, 0.03] {
        let c = slipping(&list(), 1.0);
        for k in 0..(0.12 / h).round() as u32 {
            step(c, f64::from(k) * h, h);
            let t = f64::from(k + 1) * h;
            let at = if (t - 0.03).abs() < 1e-9 { &begun } else { &ended };
            if (t - 0.03).abs() < 1e-9 || (t - 0.12).abs() < 1e-9 {
                for (reference, value) in
                    [(vr::omega_f, at.omega_f), (vr::omega_c, at.omega_c), (vr::T_fc, at.t_fc), (vr::theta_c, at.theta_c)]
                {
                    let found = get(c, reference);
                    assert!((found - value).abs() < 1e-6 * value.abs(), "{found} against {value} at {t} s in steps of {h} s");
                }
            }
        }
        fmi2FreeInstance(c);
    }
}

#[test]
fn a_fault_owns_its_parameter_from_its_onset_on() {
    let c = slipping(&list(), 0.9);
    let factor = vr::effect_friction_level_factor;
    // Steps end between two points of the raster on which faults are evaluated; a value holds from the last point on.
    let h = 0.0073;
    let ramp = |share: f64| 0.9 + (0.5 - 0.9) * share;
    for (k, expected) in [0.9, 0.9, 0.9, 0.9, 0.9, 0.9, ramp(0.05), ramp(0.4), ramp(0.75), 0.5, 0.5].into_iter().enumerate() {
        step(c, k as f64 * h, h);
        assert!((get(c, factor) - expected).abs() < 1e-12, "{} against {expected} after step {}", get(c, factor), k + 1);
    }
    assert_eq!(get(c, vr::effect_engine_torque_bias_torque), 7.0);
    set(c, factor, 0.8);
    set(c, vr::effect_engine_torque_gain_gain, 1.1);
    step(c, 11.0 * h, h);
    assert_eq!((get(c, factor), get(c, vr::effect_engine_torque_gain_gain)), (0.5, 1.1), "what no fault drives is free");
    fmi2FreeInstance(c);
}

#[test]
fn a_state_holds_the_effects_from_which_its_faults_depart() {
    let (one, other) = (slipping(&list(), 0.8), slipping(&list(), 1.2));
    let mut state = ptr::null_mut();
    step(one, 0.0, 0.055);
    assert_eq!(fmi2GetFMUstate(one, &mut state), Status::Ok);
    assert_eq!(fmi2SetFMUstate(other, state), Status::Ok);
    assert_eq!(fmi2FreeFMUstate(one, &mut state), Status::Ok);
    for c in [one, other] {
        step(c, 0.055, 0.0105);
        // 15 of the 20 points of the ramp.
        assert!((get(c, vr::effect_friction_level_factor) - (0.8 - 0.3 * 0.75)).abs() < 1e-12);
    }
    assert_eq!(get(one, vr::omega_f), get(other, vr::omega_f));
    [one, other].into_iter().for_each(|c| fmi2FreeInstance(c));
}

#[test]
fn what_is_written_before_the_start_is_checked_like_what_is_set() {
    let c = instance(plant::GUID, None);
    let (mut values, mut count) = (ptr::null_mut(), 0);
    assert_eq!(kisspoint_values(c, &mut values, &mut count), Status::Ok);
    let place = |reference: u32| plant::DESCRIPTION.find(reference).unwrap();
    // SAFETY: as below.
    let (write, read) = (|k: usize, value: f64| unsafe { *values.add(k) = value }, |k: usize| unsafe { *values.add(k) });
    let (disc, speed, inertia) = (place(vr::theta_c_start), place(vr::omega_f_start), place(vr::driveline_J_f));
    // Written before initialization, and again during it, when an output is read.
    write(disc, f64::NAN);
    write(speed, 80.0);
    assert_eq!((fmi2EnterInitializationMode(c), fmi2ExitInitializationMode(c)), (Status::Ok, Status::Error));
    assert_eq!((read(disc), read(speed)), (25.0, 80.0), "what is refused is put back, what is sound beside it is taken");
    write(inertia, -1.0);
    assert_eq!(fmi2GetReal(c, &vr::omega_f, 1, &mut 0.0), Status::Error);
    assert_eq!((get(c, vr::omega_f), read(inertia)), (80.0, Vehicle::paper().driveline.J_f));
    write(speed, 90.0);
    assert_eq!((fmi2ExitInitializationMode(c), get(c, vr::omega_f)), (Status::Ok, 90.0));
    step(c, 0.0, 0.01);
    assert!(get(c, vr::theta_c).is_finite());
    fmi2FreeInstance(c);
}

#[test]
fn what_is_written_at_an_address_counts_from_the_next_step_if_it_may_be_set() {
    let c = free_flywheel();
    let (mut values, mut count) = (ptr::null_mut(), 0);
    assert_eq!(kisspoint_values(c, &mut values, &mut count), Status::Ok);
    assert_eq!(count, plant::DESCRIPTION.variables.len());
    let place = |reference: u32| plant::DESCRIPTION.find(reference).unwrap();
    // SAFETY: the address is valid until the instance is freed, and the indices are within the count.
    let (write, read) = (|k: usize, value: f64| unsafe { *values.add(k) = value }, |k: usize| unsafe { *values.add(k) });
    let (bias, inertia, position, speed) =
        (place(vr::effect_engine_torque_bias_torque), place(vr::driveline_J_f), place(vr::x_to), place(vr::omega_f));
    write(bias, 7.0);
    write(speed, 1e6);
    step(c, 0.0, 0.05);
    let after = flywheel(100.0, 27.0, 0.0, 0.05);
    assert!((read(speed) - after).abs() < 1e-6, "{} against {after} rad/s", read(speed));
    // A value beyond its bounds, a NaN, and a parameter that is fixed at run time are refused and restored, while a valid value beside them is taken.
    let fixed = read(inertia);
    for (k, bad, good) in [(position, 50.1, 0.0), (position, f64::NAN, 0.0), (inertia, 1.0, fixed)] {
        write(k, bad);
        write(bias, 8.0);
        assert_eq!(fmi2DoStep(c, 0.05, 0.05, 1), Status::Error);
        assert_eq!((read(k), read(bias)), (good, 8.0));
    }
    // A saved state contains no unchecked value.
    let mut state = ptr::null_mut();
    write(position, f64::NAN);
    assert_eq!((fmi2GetFMUstate(c, &mut state), read(position), state.is_null()), (Status::Error, 0.0, true));
    assert_eq!(
        (fmi2GetFMUstate(c, &mut state), fmi2SetFMUstate(c, state), fmi2FreeFMUstate(c, &mut state)),
        (Status::Ok, Status::Ok, Status::Ok)
    );
    step(c, 0.05, 0.05);
    let after = flywheel(after, 28.0, 0.0, 0.05);
    assert!((read(speed) - after).abs() < 1e-6, "{} against {after} rad/s", read(speed));
    fmi2FreeInstance(c);
}
