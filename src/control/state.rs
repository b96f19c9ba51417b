//! Outputs of the controller, and everything that changes while it runs.

use super::governed::Governed;
use super::guard::{Fault, Guard};
use super::learning::Learning;
use super::observer::Estimate;
use super::pi::Pi;
use super::reference::Plan;
use super::settings::Settings;
use super::temperature::Temperatures;
use crate::physics::phase::Phase;

/// Outputs after the last step.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Outputs {
    /// Commanded throwout position, mm.
    pub x_to: f64,
    /// Observed clutch torque, N·m.
    pub t_fc_hat: f64,
    /// Estimated disc temperature, °C.
    pub theta_c: f64,
    /// Estimated body temperature, °C.
    pub theta_b: f64,
    /// Requested engine torque, N·m.
    pub t_e_ref: f64,
    /// Contribution of the torque feedback to the position, mm.
    pub x_to_fb: f64,
    /// Requested clutch torque, or the observed one once the clutch is closed, N·m.
    pub t_c_ref: f64,
    /// Energy dissipated in this engagement, J.
    pub e_d: f64,
    /// Phase as the controller sees it.
    pub phase: Phase,
    /// Fault of the inputs.
    pub fault: Fault,
    /// Observed load in addition to the vehicle file's, N·m.
    pub t_load_hat: f64,
    /// Learned touch point relative to the vehicle file's, mm.
    pub touch_point_offset: f64,
    /// Learned friction as a factor on the vehicle file's.
    pub friction_factor: f64,
    /// Requested brake torque, N·m.
    pub t_brake: f64,
}

/// What the controller is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Mode {
    /// Open, or opening.
    #[default]
    Open = 0,
    /// Following the references.
    Engaging = 1,
    /// Handed over after lock-up.
    Closed = 2,
    /// Locked; the torque capacity is being raised softly.
    Closing = 3,
}

/// Everything that changes while the controller runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// What the controller is doing.
    pub mode: Mode,
    /// Time since the engagement began, s.
    pub elapsed: f64,
    /// References of the engagement.
    pub plan: Plan,
    /// Engine speed controller.
    pub engine: Pi,
    /// Clutch speed controller.
    pub clutch: Pi,
    /// Torque feedback.
    pub feedback: Pi,
    /// Whether the observer has been initialised with the first measurement.
    pub observing: bool,
    /// Torque observer.
    pub estimate: Estimate,
    /// Thermal estimate.
    pub temperatures: Temperatures,
    /// Slip of the previous sample, rad/s.
    pub last_slip: f64,
    /// Disc speed of the previous sample, rad/s.
    pub last_omega_c: f64,
    /// Whether the cooling over `soak_time` has been taken into account.
    pub soaked: bool,
    /// State of the governed law.
    pub governed: Governed,
    /// What has been learned from launches.
    pub learning: Learning,
    /// Guard of the inputs.
    pub guard: Guard,
    /// Outputs.
    pub outputs: Outputs,
}

/// State before the first step.
pub(super) fn start(s: &Settings) -> State {
    let temperatures = Temperatures { theta_c: s.theta_c_start, theta_b: s.theta_b_start };
    let outputs = Outputs {
        x_to: s.x_open,
        theta_c: s.theta_c_start,
        theta_b: s.theta_b_start,
        touch_point_offset: s.touch_point_offset_start,
        friction_factor: s.friction_factor_start,
        ..Outputs::default()
    };
    State {
        mode: Mode::Open,
        elapsed: 0.0,
        plan: Plan::default(),
        engine: Pi::default(),
        clutch: Pi::default(),
        feedback: Pi::default(),
        observing: false,
        estimate: Estimate::default(),
        temperatures,
        last_slip: 0.0,
        last_omega_c: 0.0,
        soaked: false,
        governed: Governed::default(),
        learning: Learning::new(s),
        guard: Guard::new(s.theta_b_start),
        outputs,
    }
}
