//! The controller's settings: all design parameters, each named once in the model description.
//!
//! | set | law | made for |
//! |---|---|---|
//! | [`Settings::robust`] | governed launch | the start values of `modelDescription/ClutchController.xml`: real cars and actuators |
//! | [`Settings::figure_3`] | the paper's Figure 3 | the paper's law with gains that tolerate an actuator with 30 ms lag and 15 ms delay |
//! | [`Settings::plain_pi`] | the same without torque feedback | speed controllers and inverse map alone, for comparison |
//! | [`Settings::paper`] | the paper's Figure 3 | an ideal actuator: reproduces Table II |

use crate::vehicle::{Number, defaults};

/// Settings under the names of the FMU's parameters (where all but the start values have the prefix `controller.`).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[allow(missing_docs)]
pub struct Settings {
    pub theta_c_start: f64,
    pub theta_b_start: f64,
    pub soak_time: f64,
    pub touch_point_offset_start: f64,
    pub friction_factor_start: f64,
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
    pub scheme: f64,
    pub actuator_time: f64,
    pub filter_time: f64,
    pub load_bandwidth: f64,
    pub torque_bandwidth: f64,
    pub engine_droop: f64,
    pub kp_droop: f64,
    pub ki_droop: f64,
    pub engine_reserve: f64,
    pub lock_time: f64,
    pub landing_time: f64,
    pub closing_rate: f64,
    pub creep_speed: f64,
    pub creep_acceleration: f64,
    pub learning_rate: f64,
}

include!(concat!(env!("OUT_DIR"), "/settings.rs"));

/// Value of `scheme` that stands for the paper's law.
const FIGURE_3: f64 = 1.0;

/// Rate of the command that is never a limit, mm/s: the paper's actuator is ideal.
const UNLIMITED_RATE: f64 = 1e6;

impl Settings {
    /// The default set: robust against a slow actuator.
    pub fn robust() -> Self {
        defaults(&SETTINGS)
    }

    /// The paper's law with gains that keep their phase margin behind an actuator with 30 ms lag and 15 ms delay; nothing is learned.
    pub fn figure_3() -> Self {
        Self {
            scheme: FIGURE_3,
            reference_slope: 40.0,
            kp_engine: 2.0,
            ki_engine: 4.0,
            kp_clutch: 4.0,
            learning_rate: 0.0,
            ..Self::robust()
        }
    }

    /// Speed controllers and the inverse map without torque feedback.
    pub fn plain_pi() -> Self {
        Self { kp_torque: 0.0, ki_torque: 0.0, ..Self::figure_3() }
    }

    /// Whether the paper's law is selected.
    #[inline]
    pub fn is_figure_3(&self) -> bool {
        self.scheme < 1.5
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
            ..Self::figure_3()
        }
    }
}
