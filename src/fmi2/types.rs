//! The types of FMI 2.0's C interface, as defined in `fmi2TypesPlatform.h` and `fmi2FunctionTypes.h`.
//!
//! | header | here |
//! |---|---|
//! | `fmi2Component`, `fmi2ComponentEnvironment`, `fmi2FMUstate` | `*mut c_void` |
//! | `fmi2ValueReference` | `u32` |
//! | `fmi2Real` | `f64` |
//! | `fmi2Integer`, `fmi2Boolean` | `i32` |
//! | `fmi2Char`, `fmi2Byte` | `c_char` |
//! | `fmi2String` | `*const c_char` |
//!
//! Enumerations that the importer passes in stay plain integers, because a value that is not one of theirs would be undefined behaviour in a Rust enum.

use std::ffi::{c_char, c_int, c_void};

/// `fmi2Status`, as returned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
#[allow(missing_docs)]
pub enum Status {
    Ok = 0,
    Warning = 1,
    Discard = 2,
    Error = 3,
    Fatal = 4,
    Pending = 5,
}

/// `fmi2True`.
pub const TRUE: i32 = 1;
/// `fmi2False`.
pub const FALSE: i32 = 0;
/// `fmi2CoSimulation` of `fmi2Type`.
pub const CO_SIMULATION: c_int = 1;
/// `fmi2DoStepStatus` of `fmi2StatusKind`.
pub const DO_STEP_STATUS: c_int = 0;
/// `fmi2PendingStatus`.
pub const PENDING_STATUS: c_int = 1;
/// `fmi2LastSuccessfulTime`.
pub const LAST_SUCCESSFUL_TIME: c_int = 2;
/// `fmi2Terminated`.
pub const TERMINATED: c_int = 3;

/// `fmi2CallbackLogger`: environment, instance name, status, category, message in the form of `printf`, its arguments.
pub type LoggerFn = unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...);

/// `fmi2CallbackFunctions`.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct CallbackFunctions {
    /// `logger`.
    pub logger: Option<LoggerFn>,
    /// `allocateMemory`; never called.
    pub allocate_memory: Option<unsafe extern "C" fn(usize, usize) -> *mut c_void>,
    /// `freeMemory`; never called.
    pub free_memory: Option<unsafe extern "C" fn(*mut c_void)>,
    /// `stepFinished`; never called, because no step is asynchronous.
    pub step_finished: Option<unsafe extern "C" fn(*mut c_void, c_int)>,
    /// `componentEnvironment`.
    pub component_environment: *mut c_void,
}

impl CallbackFunctions {
    /// Callbacks of a caller that wants no messages.
    pub const NONE: Self =
        Self { logger: None, allocate_memory: None, free_memory: None, step_finished: None, component_environment: std::ptr::null_mut() };
}

/// `fmi2EventInfo`, which only model exchange uses.
#[derive(Clone, Copy)]
#[repr(C)]
#[allow(missing_docs)]
pub struct EventInfo {
    pub new_discrete_states_needed: i32,
    pub terminate_simulation: i32,
    pub nominals_of_continuous_states_changed: i32,
    pub values_of_continuous_states_changed: i32,
    pub next_event_time_defined: i32,
    pub next_event_time: f64,
}
