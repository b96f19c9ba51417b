//! The functions of FMI 2.0 for model exchange. Some importers resolve all symbols, so that the functions exist, but they refuse.
#![allow(non_snake_case, missing_docs)]

use super::call::{self, Function};
use super::guard::guard;
use super::refusal::Refusal;
use super::types::{EventInfo, Status};
use std::ffi::c_void;

fn refuse(c: *mut c_void, function: &'static Function) -> Status {
    guard(c, function, |_| Err(Refusal::NotOffered("this FMU is for co-simulation alone")))
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2EnterEventMode(c: *mut c_void) -> Status {
    refuse(c, call::ENTER_EVENT_MODE)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2NewDiscreteStates(c: *mut c_void, _info: *mut EventInfo) -> Status {
    refuse(c, call::NEW_DISCRETE_STATES)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2EnterContinuousTimeMode(c: *mut c_void) -> Status {
    refuse(c, call::ENTER_CONTINUOUS_TIME_MODE)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2CompletedIntegratorStep(c: *mut c_void, _no_set: i32, _enter_event_mode: *mut i32, _terminate: *mut i32) -> Status {
    refuse(c, call::COMPLETED_INTEGRATOR_STEP)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2SetTime(c: *mut c_void, _time: f64) -> Status {
    refuse(c, call::SET_TIME)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2SetContinuousStates(c: *mut c_void, _x: *const f64, _nx: usize) -> Status {
    refuse(c, call::SET_CONTINUOUS_STATES)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetDerivatives(c: *mut c_void, _derivatives: *mut f64, _nx: usize) -> Status {
    refuse(c, call::GET_DERIVATIVES)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetEventIndicators(c: *mut c_void, _indicators: *mut f64, _ni: usize) -> Status {
    refuse(c, call::GET_EVENT_INDICATORS)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetContinuousStates(c: *mut c_void, _x: *mut f64, _nx: usize) -> Status {
    refuse(c, call::GET_CONTINUOUS_STATES)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetNominalsOfContinuousStates(c: *mut c_void, _nominals: *mut f64, _nx: usize) -> Status {
    refuse(c, call::GET_NOMINALS_OF_CONTINUOUS_STATES)
}
