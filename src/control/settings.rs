//! The controller's settings: every number that is the designer's choice, named once in the model description.
//!
//! [`Settings::robust`] holds the start values of `modelDescription/ClutchController.xml`: a set that keeps its phase margin behind an
//! actuator with 30 ms lag and 15 ms delay. [`Settings::paper`] is the set that reproduces Table II, with an ideal actuator.

use crate::vehicle::{Number, defaults};

/// Settings under the names that the FMU gives them (there `controller.` stands before all but the start values).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[allow(missing_docs)]
pub struct Settings {
    pub theta_c_start: f64,
    pub theta_b_start: f64,
    pub reference_time: f64,
    pub reference_speed: f64,
    pub reference_slope: f64,
    pub reference_least_share: f64,
    pub idle_speed: f64,
    pub kp_engine: f64,
    pub ki_engine: f64,
    pub kp_clutch: f64,
    pub ki_clutch: f64,
    pub kp_torque: f64,
    pub ki_torque: f64,
    pub l_1: f64,
    pub l_2: f64,
    pub slip_lock: f64,
    pub slip_release: f64,
    pub torque_max: f64,
    pub engine_torque_min: f64,
    pub engine_torque_max: f64,
    pub x_open: f64,
    pub x_max: f64,
    pub rate_open: f64,
    pub rate_close: f64,
    pub x_fb_max: f64,
    pub stall_speed: f64,
    pub stall_margin: f64,
    pub fault_hold: f64,
    pub fault_recover: f64,
    pub freeze_time: f64,
    pub speed_jump: f64,
    pub acceleration_max: f64,
}

include!(concat!(env!("OUT_DIR"), "/settings.rs"));

/// A rate of the command that limits nothing, mm/s: the paper's actuator is ideal.
const UNLIMITED_RATE: f64 = 1e6;

impl Settings {
    /// The default set: robust against a slow actuator.
    pub fn robust() -> Self {
        defaults(&SETTINGS)
    }

    /// The set that reproduces Table II of the paper, which gives neither references nor gains; its actuator is ideal.
    pub fn paper() -> Self {
        Self {
            reference_time: 1.1724,
            reference_speed: 110.46,
            reference_slope: 73.462,
            kp_engine: 7.0937,
            ki_engine: 598.02,
            kp_clutch: 11.246,
            ki_clutch: 0.67393,
            kp_torque: 8.8889e-4,
            ki_torque: 0.39675,
            slip_lock: 1.8989,
            rate_open: UNLIMITED_RATE,
            rate_close: UNLIMITED_RATE,
            ..Self::robust()
        }
    }
}
