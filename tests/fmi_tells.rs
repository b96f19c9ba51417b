//! What the FMUs report besides the motion: events in the log, parameters learned from launches, and where a plant was validated.

use kisspoint::fmi2::{controller, exports::*, guid, plant, plant::vr, types::*};
use kisspoint::validated::{Place as At, TABLE, UNKNOWN_NM, Validated};
use kisspoint::vehicle::Vehicle;
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::ptr;

thread_local! {
    /// Category and text of each message.
    static SAID: RefCell<Vec<(String, String)>> = const { RefCell::new(Vec::new()) };
}

/// A C implementation of `fmi2CallbackLogger` may declare fewer parameters than it is called with.
unsafe extern "C" fn hear(_: *mut c_void, _: *const c_char, _: c_int, category: *const c_char, message: *const c_char) {
    // SAFETY: both are C strings that live through the call.
    let [category, message] = [category, message].map(|text| unsafe { CStr::from_ptr(text) }.to_str().unwrap().to_owned());
    SAID.with(|said| said.borrow_mut().push((category, message)));
}

fn instance(guid: &str, location: Option<&str>) -> *mut c_void {
    logging(guid, location, 1)
}

fn logging(guid: &str, location: Option<&str>, on: c_int) -> *mut c_void {
    // SAFETY: the calling convention lets a C function ignore trailing arguments.
    let logger: LoggerFn = unsafe {
        std::mem::transmute::<unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char), LoggerFn>(hear)
    };
    let callbacks = CallbackFunctions { logger: Some(logger), ..CallbackFunctions::NONE };
    let (guid, location) = (CString::new(guid).unwrap(), location.map(|text| CString::new(text).unwrap()));
    let location = location.as_ref().map_or(ptr::null(), |text| text.as_ptr());
    let c = fmi2Instantiate(c"x".as_ptr(), CO_SIMULATION, guid.as_ptr(), location, &callbacks, 0, on);
    assert!(!c.is_null());
    c
}

fn initialize(c: *mut c_void) {
    assert_eq!((fmi2EnterInitializationMode(c), fmi2ExitInitializationMode(c)), (Status::Ok, Status::Ok));
}

fn set(c: *mut c_void, reference: u32, value: f64) {
    assert_eq!(fmi2SetReal(c, &reference, 1, &value), Status::Ok, "{value}");
}

fn get<const N: usize>(c: *mut c_void, references: [u32; N]) -> [f64; N] {
    let mut values = [f64::NAN; N];
    assert_eq!(fmi2GetReal(c, references.as_ptr(), N, values.as_mut_ptr()), Status::Ok);
    values
}

#[test]
fn contact_lock_up_and_opening_are_events_of_the_log() {
    let c = instance(plant::GUID, None);
    set(c, vr::omega_f_start, 100.0);
    set(c, vr::omega_c_start, 95.0);
    initialize(c);
    SAID.with(|said| said.borrow_mut().clear());
    for (k, x) in [0.0, 6.0, 8.0, 8.0, 0.0, 0.0].into_iter().enumerate() {
        set(c, vr::x_to, x);
        assert_eq!(fmi2DoStep(c, 0.05 * k as f64, 0.05, 1), Status::Ok);
    }
    let said = SAID.with(|said| said.take());
    assert!(said.iter().all(|(category, _)| category == "logEvents"), "{said:?}");
    let whats: Vec<&str> = said.iter().map(|(_, text)| text.rsplit(" s: ").next().unwrap()).collect();
    assert!(whats.first() == Some(&"contact: the clutch slips") || whats.first() == Some(&"locked"), "{said:?}");
    assert!(whats.contains(&"locked") && whats.last() == Some(&"open: no contact"), "{said:?}");
    fmi2FreeInstance(c);
}

/// Facings with 0.8 of the friction that the controller assumes: a launch learns part of the difference, which is kept until it is reset on request.
#[test]
fn what_a_launch_has_taught_is_kept_until_it_is_to_be_forgotten() {
    use controller::vr as k;
    let (p, c) = (instance(plant::GUID, None), instance(controller::GUID, None));
    set(p, vr::effect_friction_level_factor, 0.8);
    set(p, vr::omega_f_start, 104.7);
    set(p, vr::omega_c_start, 0.0);
    initialize(p);
    initialize(c);
    for n in 0..4000 {
        let t = f64::from(n) * 1e-3;
        let [omega_f, omega_c, t_e] = get(p, [vr::omega_f, vr::omega_c, vr::T_e]);
        [(k::omega_f, omega_f), (k::omega_c, omega_c), (k::T_e, t_e)].into_iter().for_each(|(reference, value)| set(c, reference, value));
        assert_eq!(fmi2DoStep(c, t, 1e-3, 1), Status::Ok);
        let [x_to, t_e_ref] = get(c, [k::x_to, k::T_e_ref]);
        set(p, vr::x_to, x_to);
        set(p, vr::T_e_ref, t_e_ref);
        assert_eq!(fmi2DoStep(p, t, 1e-3, 1), Status::Ok);
    }
    let learned = get(c, [k::friction_factor])[0];
    assert!((0.8..0.97).contains(&learned), "{learned} of the friction");
    assert_eq!(fmi2SetBoolean(c, &k::forget, 1, &1), Status::Ok);
    assert_eq!(fmi2DoStep(c, 4.0, 1e-3, 1), Status::Ok);
    assert_eq!(get(c, [k::friction_factor, k::touch_point_offset]), [1.0, 0.0]);
    [p, c].into_iter().for_each(|c| fmi2FreeInstance(c));
}

/// Validated only at 25 °C with an open clutch, with a σ of 3 N·m everywhere.
#[test]
fn a_plant_says_where_it_was_validated_until_a_number_is_another() {
    const OF_ITSELF: [u32; 2] = [vr::validity, vr::T_fc_sigma];
    let known = Validated::new([At { slip: 0.0, theta: 25.0, closing: -0.1, torque: 0.0 }].into_iter(), [3.0; TABLE].into_iter());
    let tail = guid::tail(plant::DESCRIPTION.variables.iter().map(|v| v.start).chain(known.numbers()));
    let mut document = Vehicle::paper().to_value();
    document["validated"] = known.to_value();
    let guid = format!("{}{}", &plant::GUID[..guid::OF_INTERFACE], std::str::from_utf8(&tail).unwrap());
    let (telling, plain) = (instance(&guid, Some(&format!("data:application/json,{document}"))), instance(plant::GUID, None));
    for c in [telling, plain] {
        [vr::omega_f_start, vr::omega_c_start].into_iter().for_each(|reference| set(c, reference, 0.0));
        initialize(c);
    }
    let step = |c, k: usize| assert_eq!(fmi2DoStep(c, 0.01 * k as f64, 0.01, 1), Status::Ok);
    step(telling, 0);
    step(plain, 0);
    assert_eq!((get(telling, OF_ITSELF), get(plain, OF_ITSELF)), ([1.0, 3.0], [0.0, UNKNOWN_NM]));
    set(telling, vr::effect_friction_fade_depth, 0.3);
    step(telling, 1);
    assert_eq!(get(telling, OF_ITSELF), [0.0, UNKNOWN_NM], "an effect that is injected makes another plant");
    set(telling, vr::effect_friction_fade_depth, 0.0);
    step(telling, 2);
    assert_eq!(get(telling, OF_ITSELF), [1.0, 3.0]);
    [telling, plain].into_iter().for_each(|c| fmi2FreeInstance(c));
}

/// A short drop-out and a jump are warnings, which are logged whether or not events are; the return to normal is an event.
#[test]
fn implausible_inputs_are_warnings_of_the_controller() {
    use controller::vr as k;
    for on in [0, 1] {
        let c = logging(controller::GUID, None, on);
        initialize(c);
        SAID.with(|said| said.borrow_mut().clear());
        for n in 0..100 {
            let t = 0.01 * f64::from(n);
            let omega_f = match n {
                20..23 => f64::NAN,
                60..63 => 300.0,
                _ => 100.0 + 0.1 * f64::from(n % 3),
            };
            set(c, k::omega_f, omega_f);
            set(c, k::omega_c, 0.1 * f64::from(n % 2));
            set(c, k::T_e, 20.0);
            assert_eq!(fmi2DoStep(c, t, 0.01, 1), Status::Ok);
        }
        let said = SAID.with(|said| said.take());
        let warnings: Vec<&str> = said.iter().filter(|(category, _)| category == "logStatusWarning").map(|(_, text)| &text[..]).collect();
        assert!(warnings.len() == 2 && warnings[0].contains("not finite") && warnings[1].contains("jumped"), "{said:?}");
        let again = said.iter().filter(|(category, text)| category == "logEvents" && text.contains("plausible again")).count();
        assert_eq!(again, if on == 1 { 2 } else { 0 }, "{said:?}");
        fmi2FreeInstance(c);
    }
}
