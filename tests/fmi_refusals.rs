//! What the FMU refuses although each single value may be within its bounds: results that are not finite, saved states beyond the bounds of their variables, and shafts that
//! are neither rigid nor soft enough to be integrated.

use kisspoint::fmi2::{controller, exports::*, plant, types::*, words};
use std::ffi::{CString, c_char, c_void};
use std::ptr;

fn instance(guid: &str) -> *mut c_void {
    let guid = CString::new(guid).unwrap();
    let c = fmi2Instantiate(c"x".as_ptr(), CO_SIMULATION, guid.as_ptr(), ptr::null(), &CallbackFunctions::NONE, 0, 0);
    assert!(!c.is_null());
    c
}

fn initialize(c: *mut c_void) {
    assert_eq!(fmi2EnterInitializationMode(c), Status::Ok);
    assert_eq!(fmi2ExitInitializationMode(c), Status::Ok);
}

fn set(c: *mut c_void, vr: u32, value: f64) -> Status {
    fmi2SetReal(c, &vr, 1, &value)
}

fn get(c: *mut c_void, vr: u32) -> f64 {
    let mut value = f64::NAN;
    assert_eq!(fmi2GetReal(c, &vr, 1, &mut value), Status::Ok);
    value
}

fn serialized(c: *mut c_void) -> Vec<u8> {
    let (mut state, mut size) = (ptr::null_mut(), 0);
    assert_eq!(fmi2GetFMUstate(c, &mut state), Status::Ok);
    assert_eq!(fmi2SerializedFMUstateSize(c, state, &mut size), Status::Ok);
    let mut stored = vec![0_u8; size];
    assert_eq!(fmi2SerializeFMUstate(c, state, stored.as_mut_ptr().cast::<c_char>(), size), Status::Ok);
    assert_eq!(fmi2FreeFMUstate(c, &mut state), Status::Ok);
    stored
}

/// Deserializes the state of `c` after changing every word that equals `from`, except for the first `kept` of them, to `to`, with a valid checksum.
fn take_up_changed(c: *mut c_void, guid: &str, from: f64, to: f64, kept: usize) -> Status {
    let mut payload = words::payload(guid, &serialized(c)).unwrap();
    let places = payload.iter_mut().filter(|word| **word == from.to_bits()).skip(kept);
    assert!(places.map(|word| *word = to.to_bits()).count() > 0, "the state holds {from} more than {kept} times");
    let bytes: Vec<u8> = words::bytes(guid, &payload).collect();
    let mut state = ptr::null_mut();
    let status = fmi2DeSerializeFMUstate(c, bytes.as_ptr().cast::<c_char>(), bytes.len(), &mut state);
    if status != Status::Ok {
        assert!(state.is_null(), "a refused state was handed out");
        return status;
    }
    let status = fmi2SetFMUstate(c, state);
    assert_eq!(fmi2FreeFMUstate(c, &mut state), Status::Ok);
    status
}

#[test]
fn a_step_that_leaves_no_numbers_is_refused_until_a_reset() {
    let c = instance(plant::GUID);
    assert_eq!((set(c, plant::vr::omega_f_start, 100.0), set(c, plant::vr::x_to, 6.5)), (Status::Ok, Status::Ok));
    initialize(c);
    assert_eq!(fmi2DoStep(c, 0.0, 0.01, 1), Status::Ok);
    // No sound run reaches such a speed; its friction power overflows.
    assert_eq!(take_up_changed(c, plant::GUID, get(c, plant::vr::omega_f), 1e308, 0), Status::Ok);
    assert_eq!(fmi2DoStep(c, 0.01, 0.01, 1), Status::Error);
    let mut time = f64::NAN;
    assert_eq!((fmi2GetRealStatus(c, LAST_SUCCESSFUL_TIME, &mut time), time), (Status::Ok, 0.01));
    assert_eq!(fmi2DoStep(c, 0.02, 0.01, 1), Status::Error, "a failed instance steps no further");
    assert_eq!(fmi2Reset(c), Status::Ok);
    initialize(c);
    assert_eq!(fmi2DoStep(c, 0.0, 0.01, 1), Status::Ok);
    fmi2FreeInstance(c);
}

#[test]
fn a_state_beyond_the_bounds_of_its_variables_is_refused() {
    let (c, vr, beyond) = (instance(plant::GUID), plant::vr::x_to, 50.1);
    initialize(c);
    assert_eq!(set(c, vr, beyond), Status::Error, "that is its bound");
    assert_eq!(set(c, vr, 12.345), Status::Ok);
    assert_eq!(take_up_changed(c, plant::GUID, 12.345, 23.456, 0), Status::Ok, "within the bounds it is a state like any other");
    assert_eq!(get(c, vr), 23.456);
    assert_eq!(take_up_changed(c, plant::GUID, 23.456, beyond, 0), Status::Error);
    assert_eq!(get(c, vr), 23.456, "a refused state changes nothing");
    assert_eq!(fmi2DoStep(c, 0.0, 0.01, 1), Status::Ok);
    fmi2FreeInstance(c);
}

/// A failed sensor must not keep the values of the others from the controller.
#[test]
fn every_real_input_of_the_controller_takes_any_value() {
    use controller::vr::{T_e, T_e_max, T_grade, aggressiveness, fault_code, omega_c, omega_f, theta_h};
    let c = instance(controller::GUID);
    initialize(c);
    for (k, bad) in [f64::NAN, f64::INFINITY, -1e300, 3000.0].into_iter().enumerate() {
        for (n, failed) in [T_grade, T_e_max, aggressiveness, T_e, theta_h].into_iter().enumerate() {
            let told = 90.0 + n as f64;
            assert_eq!(fmi2SetReal(c, [omega_f, failed, omega_c].as_ptr(), 3, [told, bad, 1.0].as_ptr()), Status::Ok, "{bad}");
            assert_eq!(get(c, omega_f), told);
            assert_eq!(fmi2DoStep(c, (5 * k + n) as f64 * 1e-3, 1e-3, 1), Status::Ok);
            let mut code = 0;
            assert_eq!(fmi2GetInteger(c, &fault_code, 1, &mut code), Status::Ok);
            assert!(failed != T_grade || bad == 3000.0 || code == 2, "{bad}: {code}");
            assert_eq!(set(c, failed, 0.0), Status::Ok);
        }
    }
    fmi2FreeInstance(c);
}

#[test]
fn what_a_model_keeps_beside_its_variables_has_their_bounds() {
    let offset = plant::vr::effect_kiss_point_offset_offset;
    for (guid, vr, beyond) in [(plant::GUID, offset, 1e6), (controller::GUID, controller::vr::controller_x_fb_max, -1.0)] {
        let c = instance(guid);
        assert_eq!(set(c, vr, 0.123), Status::Ok);
        initialize(c);
        assert_eq!(take_up_changed(c, guid, 0.123, 0.234, 1), Status::Ok, "a change that is on its way");
        assert_eq!(take_up_changed(c, guid, 0.234, beyond, 0), Status::Error);
        assert_eq!(fmi2DoStep(c, 0.0, 0.01, 1), Status::Ok);
        fmi2FreeInstance(c);
    }
}

#[test]
fn shafts_are_rigid_or_soft_enough_to_be_followed() {
    let c = instance(plant::GUID);
    initialize(c);
    let compliance = plant::vr::effect_driveline_compliance_compliance;
    for refused in [1e-300, 5e-7, 9.999e-7, -1e-6, 0.11] {
        assert_eq!(set(c, compliance, refused), Status::Error, "{refused}");
        assert_eq!(get(c, compliance), 0.0);
    }
    for taken in [1e-6, 1e-3, 0.0] {
        assert_eq!(set(c, compliance, taken), Status::Ok, "{taken}");
        assert_eq!(get(c, compliance), taken);
    }
    fmi2FreeInstance(c);
}

/// Words from 1 to 5 in these states are not quantities but flags, counts and choices, for none of which 7 is valid.
#[test]
fn a_state_with_a_choice_that_does_not_exist_is_refused() {
    for (guid, settings) in [
        (plant::GUID, &[(plant::vr::x_to, 6.0), (plant::vr::omega_f_start, 100.0)][..]),
        (controller::GUID, &[(controller::vr::omega_f, 100.0), (controller::vr::T_e, 20.0)][..]),
    ] {
        let c = instance(guid);
        settings.iter().for_each(|&(vr, value)| assert_eq!(set(c, vr, value), Status::Ok));
        initialize(c);
        assert_eq!(fmi2DoStep(c, 0.0, 0.3, 1), Status::Ok);
        let payload = words::payload(guid, &serialized(c)).unwrap();
        let choices: Vec<usize> = (0..payload.len()).filter(|k| (1..=5).contains(&payload[*k])).collect();
        assert!(choices.first() == Some(&0) && (guid != controller::GUID || choices.len() > 4), "{choices:?}");
        for k in choices {
            for (word, status) in [(payload[k], Status::Ok), (7, Status::Error)] {
                let mut changed = payload.clone();
                changed[k] = word;
                let bytes: Vec<u8> = words::bytes(guid, &changed).collect();
                let mut state = ptr::null_mut();
                assert_eq!(
                    fmi2DeSerializeFMUstate(c, bytes.as_ptr().cast::<c_char>(), bytes.len(), &mut state),
                    status,
                    "word {k} is {word}"
                );
                assert_eq!(fmi2FreeFMUstate(c, &mut state), Status::Ok);
            }
        }
        fmi2FreeInstance(c);
    }
}

#[test]
fn the_longest_step_is_a_thousand_seconds() {
    let c = instance(controller::GUID);
    initialize(c);
    assert_eq!(fmi2DoStep(c, 0.0, 1000.1, 1), Status::Error);
    assert_eq!(fmi2DoStep(c, 0.0, 1000.0, 1), Status::Ok);
    fmi2FreeInstance(c);
}

#[test]
fn a_guid_with_characters_between_interface_and_tail_is_none() {
    use kisspoint::fmi2::guid::OF_INTERFACE;
    let (interface, tail) = plant::GUID.split_at(OF_INTERFACE);
    for between in ["0", "00", "-"] {
        let guid = CString::new(format!("{interface}{between}{tail}")).unwrap();
        assert!(fmi2Instantiate(c"x".as_ptr(), CO_SIMULATION, guid.as_ptr(), ptr::null(), &CallbackFunctions::NONE, 0, 0).is_null());
    }
}

#[test]
fn a_place_for_a_state_that_no_pointer_fits_is_refused() {
    let c = instance(plant::GUID);
    initialize(c);
    let stored = serialized(c);
    let mut room = [ptr::null_mut::<c_void>(); 2];
    let between = room.as_mut_ptr().wrapping_byte_add(1);
    assert_eq!(fmi2GetFMUstate(c, between), Status::Error);
    assert_eq!(fmi2DeSerializeFMUstate(c, stored.as_ptr().cast::<c_char>(), stored.len(), between), Status::Error);
    assert_eq!(fmi2FreeFMUstate(c, between), Status::Error);
    assert!(room.iter().all(|pointer| pointer.is_null()), "nothing was written there");
    assert_eq!(fmi2DoStep(c, 0.0, 0.01, 1), Status::Ok);
    fmi2FreeInstance(c);
}

#[test]
fn what_is_not_defined_of_an_experiment_may_be_anything() {
    for (tolerance, stop, status) in [
        ((FALSE, f64::NAN), (FALSE, f64::NAN), Status::Ok),
        ((FALSE, -1.0), (FALSE, -1.0), Status::Ok),
        ((TRUE, 1e-6), (TRUE, 2.0), Status::Ok),
        ((TRUE, -1e-6), (FALSE, 0.0), Status::Error),
        ((TRUE, f64::NAN), (TRUE, 2.0), Status::Error),
        ((FALSE, 0.0), (TRUE, 1.0), Status::Error),
        ((FALSE, 0.0), (TRUE, f64::INFINITY), Status::Error),
    ] {
        let c = instance(plant::GUID);
        assert_eq!(fmi2SetupExperiment(c, tolerance.0, tolerance.1, 1.0, stop.0, stop.1), status, "{tolerance:?} {stop:?}");
        fmi2FreeInstance(c);
    }
}

#[test]
fn a_flag_is_read_as_it_was_set() {
    let c = instance(controller::GUID);
    assert_eq!(fmi2EnterInitializationMode(c), Status::Ok);
    let flags = [controller::vr::engage, controller::vr::creep];
    let read = |c| {
        let mut values = [-7; 2];
        assert_eq!(fmi2GetBoolean(c, flags.as_ptr(), 2, values.as_mut_ptr()), Status::Ok);
        values
    };
    assert_eq!(read(c), [TRUE, FALSE], "as they start");
    assert_eq!(fmi2SetBoolean(c, flags.as_ptr(), 2, [FALSE, 5].as_ptr()), Status::Ok);
    assert_eq!(read(c), [FALSE, TRUE]);
    fmi2FreeInstance(c);
}

#[test]
fn outputs_follow_the_start_values_while_they_are_set() {
    let c = instance(plant::GUID);
    assert_eq!(fmi2EnterInitializationMode(c), Status::Ok);
    for speed in [100.0, 120.0] {
        assert_eq!(set(c, plant::vr::omega_f_start, speed), Status::Ok);
        assert_eq!(get(c, plant::vr::omega_f), speed);
    }
    fmi2FreeInstance(c);
}

#[test]
fn parameters_that_contradict_each_other_can_be_looked_at_and_are_no_start() {
    let c = instance(plant::GUID);
    assert_eq!(fmi2EnterInitializationMode(c), Status::Ok);
    let (inner, outer) = (plant::vr::friction_R_1, plant::vr::friction_R_2);
    let sound = get(c, inner);
    assert_eq!(set(c, inner, get(c, outer) + 0.01), Status::Ok);
    assert_eq!(get(c, inner), get(c, outer) + 0.01);
    let mut speed = 0.0;
    assert_eq!(fmi2GetReal(c, &plant::vr::omega_f, 1, &mut speed), Status::Error, "what would come of them");
    assert_eq!(fmi2ExitInitializationMode(c), Status::Error);
    assert_eq!(set(c, inner, sound), Status::Ok);
    assert_eq!(fmi2ExitInitializationMode(c), Status::Ok);
    fmi2FreeInstance(c);
}

#[test]
fn a_million_values_are_the_most_of_one_call() {
    let c = instance(plant::GUID);
    initialize(c);
    let most = 1 << 20;
    let (references, mut values) = (vec![plant::vr::omega_f; most + 1], vec![f64::NAN; most + 1]);
    assert_eq!(fmi2GetReal(c, references.as_ptr(), most + 1, values.as_mut_ptr()), Status::Error);
    assert_eq!(fmi2GetReal(c, references.as_ptr(), most, values.as_mut_ptr()), Status::Ok);
    assert!(values[..most].iter().all(|v| v.is_finite()) && values[most].is_nan());
    fmi2FreeInstance(c);
}
