//! The types and functions of this FMI 2.0 implementation compared with those that bindgen generates from the standard's headers (crate `fmi-sys`).
//!
//! Each type is reduced to its shape, that is, what the C calling convention sees of it, and the shapes are compared. Names, `unsafe` and the difference between an enumeration
//! and its integer do not matter; number, order, size and direction of arguments do.
#![cfg(test)]

use fmi_sys::fmi2 as theirs;
use kisspoint::fmi2::types as ours;
use std::ffi::c_void;
use std::mem::offset_of;

/// Representation of a type in the C calling convention.
trait Shape {
    fn shape() -> String;
}

macro_rules! plain {
    ($($type:ty => $shape:literal),* $(,)?) => { $(impl Shape for $type { fn shape() -> String { $shape.into() } })* };
}
plain! {
    () => "nothing", c_void => "void", f64 => "real", usize => "size", i32 => "int", u32 => "int", i8 => "byte", u8 => "byte",
    ours::Status => "int", ours::CallbackFunctions => "callbacks", theirs::fmi2CallbackFunctions => "callbacks",
    ours::EventInfo => "event info", theirs::fmi2EventInfo => "event info",
}
impl<T: Shape> Shape for *const T {
    fn shape() -> String {
        format!("*const {}", T::shape())
    }
}
impl<T: Shape> Shape for *mut T {
    fn shape() -> String {
        format!("*mut {}", T::shape())
    }
}
impl<T: Shape> Shape for Option<T> {
    fn shape() -> String {
        T::shape()
    }
}
macro_rules! functions {
    ($(($($argument:ident)*))*) => { $(
        impl<R: Shape $(, $argument: Shape)*> Shape for extern "C" fn($($argument),*) -> R {
            fn shape() -> String { format!("{:?} -> {}", [$($argument::shape()),*] as [String; _], R::shape()) }
        }
        impl<R: Shape $(, $argument: Shape)*> Shape for unsafe extern "C" fn($($argument),*) -> R {
            fn shape() -> String { <extern "C" fn($($argument),*) -> R>::shape() }
        }
    )* };
}
functions! { () (A) (A B) (A B C) (A B C D) (A B C D E) (A B C D E F) (A B C D E F G) }
impl<A: Shape, B: Shape, C: Shape, D: Shape, E: Shape, R: Shape> Shape for unsafe extern "C" fn(A, B, C, D, E, ...) -> R {
    fn shape() -> String {
        format!("{} and more", <extern "C" fn(A, B, C, D, E) -> R>::shape())
    }
}

fn shape_of<T: Shape>(_: T) -> String {
    T::shape()
}

/// Compares functions by name, with a `_` for every argument.
macro_rules! same {
    ($($module:ident: $($ours:ident($($argument:tt)*) $theirs:ident),* $(,)?);* $(;)?) => {{
        let mut count = 0;
        $($(
            let function: extern "C" fn($($argument),*) -> _ = kisspoint::fmi2::$module::$ours;
            assert_eq!(shape_of(function), <theirs::$theirs as Shape>::shape(), stringify!($ours));
            count += 1;
        )*)*
        count
    }};
}

#[test]
fn every_function_has_the_standards_signature() {
    let compared = same! {
        exports:
            fmi2GetTypesPlatform() fmi2GetTypesPlatformTYPE, fmi2GetVersion() fmi2GetVersionTYPE,
            fmi2SetDebugLogging(_ _ _ _) fmi2SetDebugLoggingTYPE, fmi2Instantiate(_ _ _ _ _ _ _) fmi2InstantiateTYPE,
            fmi2FreeInstance(_) fmi2FreeInstanceTYPE, fmi2SetupExperiment(_ _ _ _ _ _) fmi2SetupExperimentTYPE,
            fmi2EnterInitializationMode(_) fmi2EnterInitializationModeTYPE,
            fmi2ExitInitializationMode(_) fmi2ExitInitializationModeTYPE, fmi2Terminate(_) fmi2TerminateTYPE, fmi2Reset(_) fmi2ResetTYPE,
            fmi2GetReal(_ _ _ _) fmi2GetRealTYPE, fmi2GetInteger(_ _ _ _) fmi2GetIntegerTYPE,
            fmi2GetBoolean(_ _ _ _) fmi2GetBooleanTYPE, fmi2GetString(_ _ _ _) fmi2GetStringTYPE,
            fmi2SetReal(_ _ _ _) fmi2SetRealTYPE, fmi2SetInteger(_ _ _ _) fmi2SetIntegerTYPE,
            fmi2SetBoolean(_ _ _ _) fmi2SetBooleanTYPE, fmi2SetString(_ _ _ _) fmi2SetStringTYPE,
            fmi2GetFMUstate(_ _) fmi2GetFMUstateTYPE, fmi2SetFMUstate(_ _) fmi2SetFMUstateTYPE, fmi2FreeFMUstate(_ _) fmi2FreeFMUstateTYPE,
            fmi2SerializedFMUstateSize(_ _ _) fmi2SerializedFMUstateSizeTYPE, fmi2SerializeFMUstate(_ _ _ _) fmi2SerializeFMUstateTYPE,
            fmi2DeSerializeFMUstate(_ _ _ _) fmi2DeSerializeFMUstateTYPE,
            fmi2GetDirectionalDerivative(_ _ _ _ _ _ _) fmi2GetDirectionalDerivativeTYPE,
            fmi2SetRealInputDerivatives(_ _ _ _ _) fmi2SetRealInputDerivativesTYPE,
            fmi2GetRealOutputDerivatives(_ _ _ _ _) fmi2GetRealOutputDerivativesTYPE,
            fmi2DoStep(_ _ _ _) fmi2DoStepTYPE, fmi2CancelStep(_) fmi2CancelStepTYPE, fmi2GetStatus(_ _ _) fmi2GetStatusTYPE,
            fmi2GetRealStatus(_ _ _) fmi2GetRealStatusTYPE, fmi2GetIntegerStatus(_ _ _) fmi2GetIntegerStatusTYPE,
            fmi2GetBooleanStatus(_ _ _) fmi2GetBooleanStatusTYPE, fmi2GetStringStatus(_ _ _) fmi2GetStringStatusTYPE;
        model_exchange:
            fmi2EnterEventMode(_) fmi2EnterEventModeTYPE, fmi2NewDiscreteStates(_ _) fmi2NewDiscreteStatesTYPE,
            fmi2EnterContinuousTimeMode(_) fmi2EnterContinuousTimeModeTYPE,
            fmi2CompletedIntegratorStep(_ _ _ _) fmi2CompletedIntegratorStepTYPE, fmi2SetTime(_ _) fmi2SetTimeTYPE,
            fmi2SetContinuousStates(_ _ _) fmi2SetContinuousStatesTYPE, fmi2GetDerivatives(_ _ _) fmi2GetDerivativesTYPE,
            fmi2GetEventIndicators(_ _ _) fmi2GetEventIndicatorsTYPE, fmi2GetContinuousStates(_ _ _) fmi2GetContinuousStatesTYPE,
            fmi2GetNominalsOfContinuousStates(_ _ _) fmi2GetNominalsOfContinuousStatesTYPE;
    };
    assert_eq!(compared, 44);
}

/// Compares the offsets of fields, whose names differ, in two structs.
macro_rules! same_places {
    ($ours:ty, $theirs:ty: $($mine:ident $other:ident),*) => {
        assert_eq!((size_of::<$ours>(), align_of::<$ours>()), (size_of::<$theirs>(), align_of::<$theirs>()));
        $(assert_eq!(offset_of!($ours, $mine), offset_of!($theirs, $other), stringify!($other));)*
    };
}

#[test]
fn structures_lie_in_memory_as_the_standards() {
    same_places!(ours::CallbackFunctions, theirs::fmi2CallbackFunctions:
        logger logger, allocate_memory allocateMemory, free_memory freeMemory, step_finished stepFinished,
        component_environment componentEnvironment);
    same_places!(ours::EventInfo, theirs::fmi2EventInfo:
        new_discrete_states_needed newDiscreteStatesNeeded, terminate_simulation terminateSimulation,
        nominals_of_continuous_states_changed nominalsOfContinuousStatesChanged,
        values_of_continuous_states_changed valuesOfContinuousStatesChanged, next_event_time_defined nextEventTimeDefined,
        next_event_time nextEventTime);
    let (a, b) = (callbacks(), unsafe { std::mem::zeroed::<theirs::fmi2CallbackFunctions>() });
    assert_eq!(shape_of(a.logger), shape_of(b.logger));
    assert_eq!(shape_of(a.allocate_memory), shape_of(b.allocateMemory));
    assert_eq!(shape_of(a.free_memory), shape_of(b.freeMemory));
    assert_eq!(shape_of(a.step_finished), shape_of(b.stepFinished));
}

fn callbacks() -> ours::CallbackFunctions {
    ours::CallbackFunctions {
        logger: None,
        allocate_memory: None,
        free_memory: None,
        step_finished: None,
        component_environment: std::ptr::null_mut(),
    }
}

#[test]
fn constants_are_the_standards() {
    use ours::Status;
    assert_eq!(Status::Ok as u32, theirs::fmi2Status_fmi2OK);
    assert_eq!(Status::Warning as u32, theirs::fmi2Status_fmi2Warning);
    assert_eq!(Status::Discard as u32, theirs::fmi2Status_fmi2Discard);
    assert_eq!(Status::Error as u32, theirs::fmi2Status_fmi2Error);
    assert_eq!(Status::Fatal as u32, theirs::fmi2Status_fmi2Fatal);
    assert_eq!(Status::Pending as u32, theirs::fmi2Status_fmi2Pending);
    assert_eq!((ours::TRUE as u32, ours::FALSE as u32), (theirs::fmi2True, theirs::fmi2False));
    assert_eq!(ours::CO_SIMULATION as u32, theirs::fmi2Type_fmi2CoSimulation);
    assert_eq!(ours::DO_STEP_STATUS as u32, theirs::fmi2StatusKind_fmi2DoStepStatus);
    assert_eq!(ours::PENDING_STATUS as u32, theirs::fmi2StatusKind_fmi2PendingStatus);
    assert_eq!(ours::LAST_SUCCESSFUL_TIME as u32, theirs::fmi2StatusKind_fmi2LastSuccessfulTime);
    assert_eq!(ours::TERMINATED as u32, theirs::fmi2StatusKind_fmi2Terminated);
}
