//! The paper's point: a car whose touch point moves with temperature, launched hot.
//!
//! | case | the controller's map |
//! |---|---|
//! | known | the car's own polynomials, and the right temperature at the start |
//! | ignored | touch point and friction as they are at 25 °C, whatever the temperature |
//! | wrong | the car's polynomials, but 25 °C at the start |
//!
//! Each case is launched without and with the torque feedback, which is the paper's remedy. Car and controller are those of Table II's column I
//! except for the touch point, which comes earlier by [`TOUCH_POINT`] mm/K, because thermal expansion takes up stroke (paper, Section I).

use super::{AMBIENT, Launch, Setup, simulate};
use crate::control::Settings;
use crate::effects;
use crate::physics::friction;
use crate::plant::Start;
use crate::vehicle::Vehicle;

/// Change of contact and closed point with temperature, mm/K.
pub const TOUCH_POINT: f64 = -0.003;

/// Temperature of disc and body at the start, °C.
pub const HOT: f64 = 150.0;

/// A case with its launches.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Name of the case: what the controller knows.
    pub name: &'static str,
    /// Without the torque feedback.
    pub open_loop: Launch,
    /// With the torque feedback.
    pub closed_loop: Launch,
}

/// All three cases, around `vehicle`.
pub fn cases(vehicle: &Vehicle) -> [Case; 3] {
    let mut car = *vehicle;
    car.actuator.x_cnt_1 = TOUCH_POINT;
    car.actuator.x_cls_1 = TOUCH_POINT;
    [("known", car, HOT), ("ignored", cold(&car), HOT), ("wrong", car, AMBIENT)].map(|(name, believed, theta)| {
        let launch = |settings: Settings| {
            let told = Settings { theta_c_start: theta, theta_b_start: theta, ..settings };
            let setup = Setup::new(&car, &effects::null(), &told);
            let start = Start { theta_c: HOT, theta_b: HOT, ..setup.start };
            simulate(&Setup { believed, start, ..setup })
        };
        let with = Settings::paper();
        Case { name, open_loop: launch(Settings { kp_torque: 0.0, ki_torque: 0.0, ..with }), closed_loop: launch(with) }
    })
}

/// The same vehicle without temperature dependence: everything as at [`AMBIENT`].
fn cold(vehicle: &Vehicle) -> Vehicle {
    let mut cold = *vehicle;
    cold.friction.m_0 = friction::dynamic_friction(&vehicle.friction, AMBIENT);
    (cold.friction.m_1, cold.friction.m_2) = (0.0, 0.0);
    (cold.actuator.x_cnt_1, cold.actuator.x_cnt_2) = (0.0, 0.0);
    (cold.actuator.x_cls_1, cold.actuator.x_cls_2) = (0.0, 0.0);
    cold
}
