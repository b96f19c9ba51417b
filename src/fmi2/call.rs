//! Which function may be called in which state: the co-simulation table of FMI 2.0, section 4.2.4.
//!
//! ```text
//! Instantiated -> Initialization -> StepComplete -> Terminated
//!                                        |  a step or a call went wrong inside
//!                                        v
//!                                     Failed        reset leads from anywhere back to Instantiated
//! ```
//!
//! A refused call leaves the state as it was. Steps are synchronous, so the standard's states of a pending step do not occur.

/// State of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum CallState {
    /// After `fmi2Instantiate` or `fmi2Reset`.
    Instantiated = 1,
    /// Between `fmi2EnterInitializationMode` and `fmi2ExitInitializationMode`.
    Initialization = 2,
    /// Between steps.
    StepComplete = 4,
    /// A step failed or gave values that are not finite, or the code panicked: only a reset or a saved state makes the instance usable again.
    Failed = 8,
    /// After `fmi2Terminate`.
    Terminated = 16,
}

impl CallState {
    /// The state with this number, if there is one.
    pub fn from_number(number: u64) -> Option<Self> {
        [Self::Instantiated, Self::Initialization, Self::StepComplete, Self::Failed, Self::Terminated]
            .into_iter()
            .find(|state| *state as u64 == number)
    }
}

/// A function of the interface, and the states in which it may be called.
#[derive(Debug)]
pub struct Function {
    /// Its name in C.
    pub name: &'static str,
    /// Bit mask of the states.
    pub allowed: u8,
}

const INSTANTIATED: u8 = CallState::Instantiated as u8;
const INITIALIZATION: u8 = CallState::Initialization as u8;
const COMPLETE: u8 = CallState::StepComplete as u8;
const FAILED: u8 = CallState::Failed as u8;
const TERMINATED: u8 = CallState::Terminated as u8;
const ALWAYS: u8 = INSTANTIATED | INITIALIZATION | COMPLETE | FAILED | TERMINATED;
const SETTABLE: u8 = INSTANTIATED | INITIALIZATION | COMPLETE;
const READABLE: u8 = INITIALIZATION | COMPLETE | FAILED | TERMINATED;

macro_rules! functions {
    ($($constant:ident = $name:literal, $allowed:expr;)*) => {
        $(#[allow(missing_docs)] pub const $constant: &Function = &Function { name: $name, allowed: $allowed };)*
    };
}

functions! {
    SET_DEBUG_LOGGING = "fmi2SetDebugLogging", ALWAYS;
    SETUP_EXPERIMENT = "fmi2SetupExperiment", INSTANTIATED;
    ENTER_INITIALIZATION_MODE = "fmi2EnterInitializationMode", INSTANTIATED;
    EXIT_INITIALIZATION_MODE = "fmi2ExitInitializationMode", INITIALIZATION;
    TERMINATE = "fmi2Terminate", COMPLETE | FAILED;
    RESET = "fmi2Reset", ALWAYS;
    GET_REAL = "fmi2GetReal", READABLE;
    GET_INTEGER = "fmi2GetInteger", READABLE;
    GET_BOOLEAN = "fmi2GetBoolean", READABLE;
    GET_STRING = "fmi2GetString", READABLE;
    SET_REAL = "fmi2SetReal", SETTABLE;
    SET_INTEGER = "fmi2SetInteger", SETTABLE;
    SET_BOOLEAN = "fmi2SetBoolean", SETTABLE;
    SET_STRING = "fmi2SetString", SETTABLE;
    GET_FMU_STATE = "fmi2GetFMUstate", ALWAYS;
    SET_FMU_STATE = "fmi2SetFMUstate", ALWAYS;
    FREE_FMU_STATE = "fmi2FreeFMUstate", ALWAYS;
    SERIALIZED_FMU_STATE_SIZE = "fmi2SerializedFMUstateSize", ALWAYS;
    SERIALIZE_FMU_STATE = "fmi2SerializeFMUstate", ALWAYS;
    DESERIALIZE_FMU_STATE = "fmi2DeSerializeFMUstate", ALWAYS;
    GET_DIRECTIONAL_DERIVATIVE = "fmi2GetDirectionalDerivative", ALWAYS;
    SET_REAL_INPUT_DERIVATIVES = "fmi2SetRealInputDerivatives", SETTABLE;
    GET_REAL_OUTPUT_DERIVATIVES = "fmi2GetRealOutputDerivatives", ALWAYS;
    DO_STEP = "fmi2DoStep", COMPLETE;
    CANCEL_STEP = "fmi2CancelStep", ALWAYS;
    GET_STATUS = "fmi2GetStatus", READABLE;
    GET_REAL_STATUS = "fmi2GetRealStatus", READABLE;
    GET_INTEGER_STATUS = "fmi2GetIntegerStatus", READABLE;
    GET_BOOLEAN_STATUS = "fmi2GetBooleanStatus", READABLE;
    GET_STRING_STATUS = "fmi2GetStringStatus", READABLE;
    ENTER_EVENT_MODE = "fmi2EnterEventMode", ALWAYS;
    NEW_DISCRETE_STATES = "fmi2NewDiscreteStates", ALWAYS;
    ENTER_CONTINUOUS_TIME_MODE = "fmi2EnterContinuousTimeMode", ALWAYS;
    COMPLETED_INTEGRATOR_STEP = "fmi2CompletedIntegratorStep", ALWAYS;
    SET_TIME = "fmi2SetTime", ALWAYS;
    SET_CONTINUOUS_STATES = "fmi2SetContinuousStates", ALWAYS;
    GET_DERIVATIVES = "fmi2GetDerivatives", ALWAYS;
    GET_EVENT_INDICATORS = "fmi2GetEventIndicators", ALWAYS;
    GET_CONTINUOUS_STATES = "fmi2GetContinuousStates", ALWAYS;
    GET_NOMINALS_OF_CONTINUOUS_STATES = "fmi2GetNominalsOfContinuousStates", ALWAYS;
}
