//! Plant and controller coupled, where a test may manipulate the signals between them.

use kisspoint::control::{Controller, Inputs, Outputs, Settings};
use kisspoint::effects::Parameters;
use kisspoint::launch::{self, IDLE};
use kisspoint::plant::{self, Plant, Start};
use kisspoint::vehicle::Vehicle;

/// At rest, 1000 rpm, 25 °C.
pub const STANDSTILL: Start = Start { omega_f: IDLE, omega_c: 0.0, theta_c: 25.0, theta_b: 25.0 };

/// One communication point: time, plant, controller.
pub type Row = (f64, plant::Outputs, Outputs);

/// A coupled run that a test can continue step by step.
pub struct Coupled {
    pub plant: Plant,
    pub controller: Controller,
    pub time: f64,
    pub step: f64,
    pub t_load: f64,
    pub rows: Vec<Row>,
}

impl Coupled {
    pub fn new(effects: &Parameters, settings: &Settings, start: Start) -> Self {
        let vehicle = Vehicle::paper();
        let settings = Settings { theta_c_start: start.theta_c, theta_b_start: start.theta_b, ..*settings };
        let controller = Controller::new(&vehicle, &settings);
        let plant = Plant::new(&vehicle, effects, &start, &launch::plant_inputs(controller.outputs()));
        Self { plant, controller, time: 0.0, step: 1e-3, t_load: 0.0, rows: Vec::new() }
    }

    /// Runs to `until` s; `wire` may change the controller's inputs at each step.
    pub fn run(&mut self, until: f64, mut wire: impl FnMut(f64, &mut Inputs)) -> &mut Self {
        while self.time < until - 1e-9 {
            let inputs = plant::Inputs { t_load: self.t_load, ..launch::plant_inputs(self.controller.outputs()) };
            self.plant.step(&inputs, self.step);
            self.time += self.step;
            let measured = self.plant.outputs();
            let mut told = launch::controller_inputs(&measured, true);
            wire(self.time, &mut told);
            self.controller.step(&told, self.step);
            self.rows.push((self.time, measured, *self.controller.outputs()));
        }
        self
    }

    pub fn last(&self) -> &Row {
        self.rows.last().expect("the run has begun")
    }
}
