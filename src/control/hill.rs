//! Hill holder: the brakes hold a standing car until the clutch carries the torque of the grade.
//!
//! T_brake = 2 T_grade while held, else 0. `T_grade` comes from the car's inclination sensor; without one (0) nothing is held.
//! While the car is held, its load cannot be observed, so the load is taken from the sensor and the plan waits.

use super::controller::Controller;
use super::guard::Inputs;
use super::state::Mode;

/// Brake torque over the torque of the grade.
const BRAKES: f64 = 2.0;

/// Share of the grade's torque from which the car is left to the clutch: the bearing is on its way to provide the rest.
const CARRIED: f64 = 0.85;

/// Disc speed up to which a car counts as standing, rad/s.
const STANDS: f64 = 3.0;

impl Controller {
    /// Holds the car or releases it, and writes the requested brake torque to the outputs.
    pub(super) fn hold_on_hill(&mut self, inputs: &Inputs) {
        let state = &mut self.state;
        let (grade, g) = (inputs.wish.t_grade, &mut state.governed);
        let speed = g.speed.out();
        g.held = grade > 0.0
            && match state.mode {
                Mode::Open => speed.abs() <= STANDS,
                // A released car that rolls back is held again.
                Mode::Engaging => speed < -STANDS || speed <= STANDS && g.held && state.estimate.t_fc < CARRIED * grade,
                Mode::Closing | Mode::Closed => false,
            };
        if g.held {
            g.load.torque = grade;
            g.load.omega = g.speed.out();
            g.free_for = 0.0;
        }
        state.outputs.t_brake = if g.held { BRAKES * grade } else { 0.0 };
    }
}

#[cfg(test)]
mod tests {
    use super::super::filter::Lags;
    use super::super::guard::{Guard, Wish};
    use super::super::settings::Settings;
    use super::*;
    use crate::vehicle::Vehicle;

    #[test]
    fn brakes_hold_a_standing_car_until_the_clutch_carries_its_grade() {
        use Mode::{Closed, Closing, Engaging, Open};
        let grade = 40.0;
        // Mode, speed, held before, observed clutch torque, grade, and whether the car is then held.
        for (k, (mode, speed, before, carried, grade, held)) in [
            (Open, 0.0, false, 0.0, grade, true),
            (Open, 3.0, false, 0.0, grade, true),
            (Open, -3.0, false, 0.0, grade, true),
            (Open, 3.01, true, 0.0, grade, false),
            (Open, -3.01, true, 0.0, grade, false),
            (Open, 0.0, true, 0.0, 0.0, false),
            (Open, 0.0, true, 0.0, -grade, false),
            (Engaging, 0.0, true, 33.9, grade, true),
            (Engaging, 0.0, true, 34.0, grade, false),
            (Engaging, 3.0, true, 0.0, grade, true),
            (Engaging, 3.01, true, 0.0, grade, false),
            (Engaging, 0.0, false, 0.0, grade, false),
            (Engaging, -3.0, false, 0.0, grade, false),
            (Engaging, -3.01, false, 90.0, grade, true),
            (Closing, 0.0, true, 0.0, grade, false),
            (Closed, 0.0, true, 0.0, grade, false),
        ]
        .into_iter()
        .enumerate()
        {
            let mut c = Controller::new(&Vehicle::paper(), &Settings::robust());
            c.state.mode = mode;
            c.state.estimate.t_fc = carried;
            let g = &mut c.state.governed;
            (g.speed, g.held, g.free_for) = (Lags::at(speed), before, 0.7);
            (g.load.torque, g.load.omega) = (5.0, 9.0);
            c.hold_on_hill(&Inputs { wish: Wish { t_grade: grade, ..Wish::default() }, ..Guard::new(25.0).good });
            let g = &c.state.governed;
            assert_eq!((g.held, c.state.outputs.t_brake), (held, if held { 80.0 } else { 0.0 }), "row {k}");
            let known = if held { (40.0, speed, 0.0) } else { (5.0, 9.0, 0.7) };
            assert_eq!((g.load.torque, g.load.omega, g.free_for), known, "row {k}");
        }
    }
}
