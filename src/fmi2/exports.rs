//! The functions of FMI 2.0 that every FMU has, and those for co-simulation. Each goes through the guard.
// The signatures are the standard's: that a pointer is valid, beyond what can be checked, is the importer's responsibility.
#![allow(non_snake_case, missing_docs, clippy::not_unsafe_ptr_arg_deref)]

use super::call;
use super::guard::{array, fill, guard, hand_out, take_back, text};
use super::instance::{Instance, Parts};
use super::log::{Category, Log};
use super::refusal::Refusal;
use super::resource::start_values;
use super::types::{
    CO_SIMULATION, CallbackFunctions, DO_STEP_STATUS, FALSE, LAST_SUCCESSFUL_TIME, PENDING_STATUS, Status, TERMINATED, TRUE,
};
use super::variables::Kind;
use super::{model, saved};
use std::ffi::{CStr, c_char, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;

const WHOLE: &[Kind] = &[Kind::Integer, Kind::Enumeration];

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2Instantiate(
    instance_name: *const c_char,
    fmu_type: c_int,
    guid: *const c_char,
    resource_location: *const c_char,
    functions: *const CallbackFunctions,
    _visible: i32,
    logging_on: i32,
) -> *mut c_void {
    if functions.is_null() || !functions.is_aligned() {
        return ptr::null_mut();
    }
    // SAFETY: checked for NULL and alignment. The struct is copied, because the importer may reuse it.
    let callbacks = unsafe { functions.read() };
    let (name, guid, location) = (text(instance_name), text(guid), text(resource_location));
    let made = catch_unwind(AssertUnwindSafe(|| {
        let label = name.unwrap_or(c"unnamed").to_owned();
        let mut log = Log::new(callbacks.logger, callbacks.component_environment, label, logging_on != FALSE);
        match instantiate(name, fmu_type, guid, location, &mut log) {
            Ok(parts) => {
                let message = log.take();
                (hand_out(Instance::from_parts(parts, log)), message)
            }
            Err(why) => {
                log.write(Status::Error, Category::Error, format_args!("fmi2Instantiate: {why}"));
                (ptr::null_mut(), log.take().map(|message| message.named(name.unwrap_or(c"unnamed"))))
            }
        }
    }));
    let Ok((component, message)) = made else { return ptr::null_mut() };
    if let Some(message) = message {
        message.send();
    }
    component
}

fn instantiate(name: Option<&CStr>, fmu_type: c_int, guid: Option<&CStr>, location: Option<&CStr>, log: &mut Log) -> Result<Parts, String> {
    if name.is_none_or(CStr::is_empty) {
        return Err("instanceName is NULL or empty".into());
    }
    if fmu_type != CO_SIMULATION {
        return Err(format!("fmuType is {fmu_type}; this FMU is for co-simulation ({CO_SIMULATION}) alone"));
    }
    let guid = guid.ok_or("fmuGUID is NULL")?;
    let Some((registered, text)) = guid.to_str().ok().and_then(|text| Some((model::find(text)?, text))) else {
        let known = model::MODELS.each_ref().map(|m| m.description.guid);
        return Err(format!("fmuGUID {guid:?} is none of this library's, {known:?}; the modelDescription.xml is of another version"));
    };
    let (fresh, faults, validated) = start_values(registered.description, text, location.map(CStr::to_bytes), log)?;
    Ok(Parts { registered, fresh, faults, validated })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2FreeInstance(c: *mut c_void) {
    take_back(c);
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2SetDebugLogging(c: *mut c_void, logging_on: i32, count: usize, categories: *const *const c_char) -> Status {
    guard(c, call::SET_DEBUG_LOGGING, |instance| {
        let pointers = array(categories, count, "categories")?;
        let names: Option<Vec<&CStr>> = pointers.iter().map(|p| text(*p)).collect();
        instance.log.switch(logging_on != FALSE, &names.ok_or(Refusal::Null("categories[i]"))?)?;
        Ok(Status::Ok)
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2SetupExperiment(
    c: *mut c_void,
    tolerance_defined: i32,
    tolerance: f64,
    start: f64,
    stop_defined: i32,
    stop: f64,
) -> Status {
    guard(c, call::SETUP_EXPERIMENT, |instance| {
        instance.setup(start, (stop_defined != FALSE).then_some(stop), (tolerance_defined != FALSE).then_some(tolerance))
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2EnterInitializationMode(c: *mut c_void) -> Status {
    guard(c, call::ENTER_INITIALIZATION_MODE, |instance| {
        instance.call_state = call::CallState::Initialization;
        Ok(Status::Ok)
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2ExitInitializationMode(c: *mut c_void) -> Status {
    guard(c, call::EXIT_INITIALIZATION_MODE, Instance::exit_initialization)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2Terminate(c: *mut c_void) -> Status {
    guard(c, call::TERMINATE, |instance| {
        instance.call_state = call::CallState::Terminated;
        Ok(Status::Ok)
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2Reset(c: *mut c_void) -> Status {
    guard(c, call::RESET, |instance| {
        instance.reset();
        Ok(Status::Ok)
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetReal(c: *mut c_void, vr: *const u32, nvr: usize, value: *mut f64) -> Status {
    guard(c, call::GET_REAL, |instance| {
        let vr = array(vr, nvr, "vr")?;
        fill(value, nvr, "value", |k| instance.get(vr[k], &[Kind::Real]))
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetInteger(c: *mut c_void, vr: *const u32, nvr: usize, value: *mut i32) -> Status {
    guard(c, call::GET_INTEGER, |instance| {
        let vr = array(vr, nvr, "vr")?;
        fill(value, nvr, "value", |k| instance.get(vr[k], WHOLE).map(|x| x as i32))
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetBoolean(c: *mut c_void, vr: *const u32, nvr: usize, value: *mut i32) -> Status {
    guard(c, call::GET_BOOLEAN, |instance| {
        let vr = array(vr, nvr, "vr")?;
        fill(value, nvr, "value", |k| instance.get(vr[k], &[Kind::Boolean]).map(|x| if x != 0.0 { TRUE } else { FALSE }))
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetString(c: *mut c_void, vr: *const u32, nvr: usize, value: *mut *const c_char) -> Status {
    guard(c, call::GET_STRING, |instance| {
        let vr = array(vr, nvr, "vr")?;
        fill(value, nvr, "value", |k| instance.get(vr[k], &[]).map(|_| ptr::null()))
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2SetReal(c: *mut c_void, vr: *const u32, nvr: usize, value: *const f64) -> Status {
    guard(c, call::SET_REAL, |instance| {
        let (vr, value) = (array(vr, nvr, "vr")?, array(value, nvr, "value")?);
        instance.set(&[Kind::Real], vr.iter().copied().zip(value.iter().copied()))
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2SetInteger(c: *mut c_void, vr: *const u32, nvr: usize, value: *const i32) -> Status {
    guard(c, call::SET_INTEGER, |instance| {
        let (vr, value) = (array(vr, nvr, "vr")?, array(value, nvr, "value")?);
        instance.set(WHOLE, vr.iter().copied().zip(value.iter().map(|v| f64::from(*v))))
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2SetBoolean(c: *mut c_void, vr: *const u32, nvr: usize, value: *const i32) -> Status {
    guard(c, call::SET_BOOLEAN, |instance| {
        let (vr, value) = (array(vr, nvr, "vr")?, array(value, nvr, "value")?);
        instance.set(&[Kind::Boolean], vr.iter().copied().zip(value.iter().map(|v| f64::from(u8::from(*v != FALSE)))))
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2SetString(c: *mut c_void, vr: *const u32, nvr: usize, value: *const *const c_char) -> Status {
    guard(c, call::SET_STRING, |instance| {
        let (vr, _) = (array(vr, nvr, "vr")?, array(value, nvr, "value")?);
        instance.set(&[], vr.iter().map(|v| (*v, 0.0)))
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetFMUstate(c: *mut c_void, state: *mut *mut c_void) -> Status {
    guard(c, call::GET_FMU_STATE, |instance| saved::get(instance, state))
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2SetFMUstate(c: *mut c_void, state: *mut c_void) -> Status {
    guard(c, call::SET_FMU_STATE, |instance| saved::set(instance, state))
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2FreeFMUstate(c: *mut c_void, state: *mut *mut c_void) -> Status {
    guard(c, call::FREE_FMU_STATE, |_| saved::free(state))
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2SerializedFMUstateSize(c: *mut c_void, state: *mut c_void, size: *mut usize) -> Status {
    guard(c, call::SERIALIZED_FMU_STATE_SIZE, |instance| saved::size(instance, state, size))
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2SerializeFMUstate(c: *mut c_void, state: *mut c_void, bytes: *mut c_char, size: usize) -> Status {
    guard(c, call::SERIALIZE_FMU_STATE, |instance| saved::serialize(instance, state, bytes, size))
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2DeSerializeFMUstate(c: *mut c_void, bytes: *const c_char, size: usize, state: *mut *mut c_void) -> Status {
    guard(c, call::DESERIALIZE_FMU_STATE, |instance| saved::deserialize(instance, bytes, size, state))
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetDirectionalDerivative(
    c: *mut c_void,
    _unknown: *const u32,
    _unknowns: usize,
    _known: *const u32,
    _knowns: usize,
    _dv_known: *const f64,
    _dv_unknown: *mut f64,
) -> Status {
    guard(c, call::GET_DIRECTIONAL_DERIVATIVE, |_| {
        Err(Refusal::NotOffered("directional derivatives are not offered: providesDirectionalDerivative is false"))
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2SetRealInputDerivatives(c: *mut c_void, vr: *const u32, nvr: usize, order: *const i32, value: *const f64) -> Status {
    guard(c, call::SET_REAL_INPUT_DERIVATIVES, |instance| {
        let (vr, order, value) = (array(vr, nvr, "vr")?, array(order, nvr, "order")?, array(value, nvr, "value")?);
        instance.set_slopes((0..nvr).map(|k| (vr[k], order[k], value[k])))
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetRealOutputDerivatives(
    c: *mut c_void,
    _vr: *const u32,
    _nvr: usize,
    _order: *const i32,
    _value: *mut f64,
) -> Status {
    guard(c, call::GET_REAL_OUTPUT_DERIVATIVES, |_| {
        Err(Refusal::NotOffered("output derivatives are not offered: maxOutputDerivativeOrder is 0"))
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2DoStep(c: *mut c_void, point: f64, size: f64, _no_set_state_before: i32) -> Status {
    guard(c, call::DO_STEP, |instance| instance.do_step(point, size))
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2CancelStep(c: *mut c_void) -> Status {
    guard(c, call::CANCEL_STEP, |_| Err(Refusal::NotOffered("no step is ever pending: canRunAsynchronuously is false")))
}

/// The refusal of a status that exists only for a pending step: steps end before `fmi2DoStep` returns, so that nothing is ever pending.
fn no_status() -> Refusal {
    Refusal::NothingToReport("this status is only known while a step is pending, which none ever is")
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetStatus(c: *mut c_void, kind: c_int, value: *mut Status) -> Status {
    guard(c, call::GET_STATUS, |_| match kind {
        DO_STEP_STATUS => fill(value, 1, "value", |_| Err(no_status())),
        _ => Err(Refusal::Argument("s", f64::from(kind), "not a kind of status that this function gives")),
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetRealStatus(c: *mut c_void, kind: c_int, value: *mut f64) -> Status {
    guard(c, call::GET_REAL_STATUS, |instance| match kind {
        LAST_SUCCESSFUL_TIME => fill(value, 1, "value", |_| Ok(instance.last_successful_time())),
        _ => Err(Refusal::Argument("s", f64::from(kind), "not a kind of status that this function gives")),
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetIntegerStatus(c: *mut c_void, kind: c_int, _value: *mut i32) -> Status {
    guard(c, call::GET_INTEGER_STATUS, |_| Err(Refusal::Argument("s", f64::from(kind), "not a kind of status that this function gives")))
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetBooleanStatus(c: *mut c_void, kind: c_int, value: *mut i32) -> Status {
    guard(c, call::GET_BOOLEAN_STATUS, |_| match kind {
        // The models never end a simulation by themselves.
        TERMINATED => fill(value, 1, "value", |_| Ok(FALSE)),
        _ => Err(Refusal::Argument("s", f64::from(kind), "not a kind of status that this function gives")),
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetStringStatus(c: *mut c_void, kind: c_int, value: *mut *const c_char) -> Status {
    guard(c, call::GET_STRING_STATUS, |_| match kind {
        PENDING_STATUS => fill(value, 1, "value", |_| Err(no_status())),
        _ => Err(Refusal::Argument("s", f64::from(kind), "not a kind of status that this function gives")),
    })
}
