//! Hill holder: the brakes hold a standing car until the clutch carries its grade.
//!
//! T_brake = 2 T_grade while held, else 0. `T_grade` comes from the car's inclination sensor; without one (0) nothing is held.
//! While the car is held its load cannot be observed, so the sensor's counts and the plan waits.

use super::controller::{Controller, Mode};
use super::guard::Inputs;

/// Brakes over the torque of the grade.
const BRAKES: f64 = 2.0;

/// Share of the grade's torque from which the clutch is trusted with the car: the bearing is on its way to the rest.
const CARRIED: f64 = 0.85;

/// Disc speed up to which a car stands, rad/s.
const STANDS: f64 = 3.0;

impl Controller {
    /// Holds the car, or lets it go; what is asked of the brakes goes to the outputs.
    pub(super) fn hold_on_hill(&mut self, inputs: &Inputs) {
        let state = &mut self.state;
        let (grade, g) = (inputs.wish.t_grade, &mut state.governed);
        let speed = g.speed.out();
        g.held = grade > 0.0
            && match state.mode {
                Mode::Open => speed.abs() <= STANDS,
                // One that was let go and rolls back is caught again.
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
