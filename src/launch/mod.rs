//! The coupled start-up: plant and controller in one process, as the paper simulates it, and its Table II.
//!
//! Both advance from communication point to communication point, the plant first (Gauss–Seidel); a master that couples the two
//! FMUs in this order gets the same numbers.
//!
//! | column | plant compared with the controller's map | torque feedback |
//! |---|---|---|
//! | I | the same: perfect inversion | none |
//! | A | weaker friction, later contact | none |
//! | B | as A | PI on reference minus observed torque |
//!
//! The slip acceleration of Table II is the one at which the controller hands over. The clutch then closes at once; the slip acceleration with which
//! the slip actually vanishes is in [`Launch::meeting`].
//!
//! - [`cars`], [`drive`], [`monte_carlo`]: drawn cars under several controllers
//! - [`temperature`]: a touch point that moves with temperature, known, ignored and wrongly estimated
//!
//! The paper states neither references and gains nor load and mismatch. [`Settings::paper`] and [`mismatch`] are one set that
//! reproduces its nine numbers with the shipped vehicle; the numbers determine the direction of the mismatch, not its kind.

pub mod cars;
pub mod drive;
#[cfg(feature = "cli")]
pub mod monte_carlo;
pub mod temperature;

use crate::control::performance::{self, Performance};
use crate::control::{self, Controller, Settings};
use crate::effects::{self, Parameters, param};
use crate::faults::Faults;
use crate::physics::phase::Phase;
use crate::plant::clutch;
use crate::plant::config::Config;
use crate::plant::pace::TooFast;
use crate::plant::{self, Plant, Start};
use crate::vehicle::Vehicle;
use drive::Meeting;

/// Engine speed at the start, rad/s: 1000 rpm.
pub const IDLE: f64 = 1000.0 * std::f64::consts::PI / 30.0;

/// Ambient temperature, °C.
pub const AMBIENT: f64 = 25.0;

/// One coupled simulation.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The vehicle that the plant simulates.
    pub vehicle: Vehicle,
    /// The vehicle that the controller assumes.
    pub believed: Vehicle,
    /// The plant's effects.
    pub effects: Parameters,
    /// The controller's settings.
    pub settings: Settings,
    /// Start values of the plant.
    pub start: Start,
    /// Communication step, s.
    pub step: f64,
    /// End, s.
    pub stop: f64,
    /// Faults of the plant.
    pub faults: Faults,
}

/// One communication point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Time, s.
    pub time_s: f64,
    /// The plant's outputs.
    pub plant: plant::Outputs,
    /// The controller's outputs.
    pub controller: control::Outputs,
    /// Torque that the clutch transmits or, once it is locked, could transmit at rest (the paper's static friction torque), N·m.
    pub transmissible: f64,
}

/// A simulated launch.
#[derive(Clone, Debug, PartialEq)]
pub struct Launch {
    /// All communication points.
    pub rows: Vec<Row>,
    /// Figures of the engagement; `None` if the controller has not detected lock-up.
    pub performance: Option<Performance>,
    /// How the slip actually vanished; `None` if it has not.
    pub meeting: Option<Meeting>,
}

impl Setup {
    /// The paper's launch of `vehicle`: from standstill at 1000 rpm, all at ambient temperature.
    pub fn new(vehicle: &Vehicle, effects: &Parameters, settings: &Settings) -> Self {
        let start = Start { omega_f: IDLE, omega_c: 0.0, theta_c: settings.theta_c_start, theta_b: settings.theta_b_start };
        Self {
            vehicle: *vehicle,
            believed: *vehicle,
            effects: *effects,
            settings: *settings,
            start,
            step: 1e-3,
            stop: 2.5,
            faults: Faults::default(),
        }
    }

    /// Checks that the plant can be followed through all of its faults.
    ///
    /// # Errors
    /// The first part of the plant that becomes too fast.
    pub fn check_faults(&self) -> Result<(), TooFast> {
        let mut time = 0.0;
        while time < self.stop {
            Config::new(&self.vehicle, &self.faults.at(time, &self.effects)).pace.check()?;
            time = self.faults.next_change(time);
        }
        Ok(())
    }
}

/// A column of Table II.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column {
    /// Name in the paper.
    pub name: &'static str,
    /// What it stands for.
    pub meaning: &'static str,
    /// The paper's figures; its accelerations are magnitudes.
    pub paper: Performance,
    mismatched: bool,
    feedback: bool,
}

/// The three columns of Table II.
pub const TABLE_II: [Column; 3] = [
    Column {
        name: "I",
        meaning: "perfect inversion",
        paper: Performance { time: 1.217, energy: 3619.0, slip_acceleration: -35.761 },
        mismatched: false,
        feedback: false,
    },
    Column {
        name: "A",
        meaning: "mismatch, without feedback",
        paper: Performance { time: 1.423, energy: 3670.0, slip_acceleration: -12.254 },
        mismatched: true,
        feedback: false,
    },
    Column {
        name: "B",
        meaning: "mismatch, with feedback",
        paper: Performance { time: 1.243, energy: 3623.0, slip_acceleration: -16.578 },
        mismatched: true,
        feedback: true,
    },
];

/// Effects of the plant in columns A and B that the controller's map does not have.
pub fn mismatch() -> Parameters {
    let mut effects = effects::null();
    effects[param::friction_level::factor] = 0.41359;
    effects[param::kiss_point_offset::offset] = 0.012161;
    effects[param::kiss_point_offset::closed_offset] = 0.012161;
    effects
}

impl Column {
    /// The simulation behind the column.
    pub fn setup(&self, vehicle: &Vehicle) -> Setup {
        let effects = if self.mismatched { mismatch() } else { effects::null() };
        let mut settings = Settings::paper();
        if !self.feedback {
            settings.kp_torque = 0.0;
            settings.ki_torque = 0.0;
        }
        Setup::new(vehicle, &effects, &settings)
    }
}

/// Runs the coupled simulation.
///
/// # Panics
/// If the faults include one that [`Setup::check_faults`] refuses.
pub fn simulate(setup: &Setup) -> Launch {
    let mut controller = Controller::new(&setup.believed, &setup.settings);
    let mut inputs = plant_inputs(controller.outputs());
    let mut plant = Plant::new(&setup.vehicle, &setup.effects, &setup.start, &inputs);
    let steps = (setup.stop / setup.step).round() as usize;
    let mut rows = Vec::with_capacity(steps + 1);
    rows.push(row(0.0, &plant, &controller));
    let (mut found, mut meeting) = (None, None);
    for k in 1..=steps {
        let slip = drive::slip(&plant);
        let before = (meeting.is_none() && slip.abs() < drive::NEAR).then(|| plant.clone());
        step_through_faults(&mut plant, setup, &inputs, setup.step);
        if let Some(before) = before.filter(|_| drive::has_met(&plant, slip)) {
            meeting = Some(drive::meeting(before, setup.step, |plant, h| step_through_faults(plant, setup, &inputs, h)));
        }
        let measured = plant.outputs();
        controller.step(&controller_inputs(&measured, true), setup.step);
        inputs = plant_inputs(controller.outputs());
        let row = row(k as f64 * setup.step, &plant, &controller);
        rows.push(row);
        if found.is_none() && row.controller.phase == Phase::Locked {
            found = Some(figures(&setup.vehicle, &row));
        }
    }
    Launch { rows, performance: found, meeting }
}

fn row(time_s: f64, plant: &Plant, controller: &Controller) -> Row {
    let (outputs, state) = (plant.outputs(), plant.state());
    let transmissible = if outputs.phase == Phase::Locked {
        clutch::capacity(plant.config(), state.bearing, state.memory, 0.0, &state.y)
    } else {
        outputs.t_fc
    };
    Row { time_s, plant: outputs, controller: *controller.outputs(), transmissible }
}

/// Makes a step of `h` seconds, divided where a fault changes an effect.
fn step_through_faults(plant: &mut Plant, setup: &Setup, inputs: &plant::Inputs, h: f64) {
    let mut left = h;
    loop {
        let now = plant.state().time;
        let effects = setup.faults.at(now, &setup.effects);
        if effects != plant.config().parameters {
            plant.set_effects(&setup.vehicle, &effects).expect("`Setup::check_faults` has let them pass");
        }
        let piece = (setup.faults.next_change(now) - now).min(left);
        plant.step(inputs, piece);
        left -= piece;
        if left <= 0.0 {
            return;
        }
    }
}

/// Figures at the communication point at which the controller detects lock-up; the plant's torque is still that of the slipping clutch.
fn figures(vehicle: &Vehicle, row: &Row) -> Performance {
    let p = &row.plant;
    let slip_acceleration = performance::slip_acceleration(&vehicle.driveline, p.omega_f, p.omega_c, p.t_e, p.t_fc, 0.0);
    Performance { time: row.time_s, energy: p.e_d, slip_acceleration }
}

/// The plant's inputs from the controller's outputs.
pub fn plant_inputs(from: &control::Outputs) -> plant::Inputs {
    plant::Inputs { x_to: from.x_to, t_e_ref: from.t_e_ref, theta_h: AMBIENT, t_load: 0.0 }
}

/// The controller's inputs from the plant's outputs.
pub fn controller_inputs(from: &plant::Outputs, engage: bool) -> control::Inputs {
    control::Inputs {
        omega_f: from.omega_f,
        omega_c: from.omega_c,
        t_e: from.t_e,
        theta_h: AMBIENT,
        engage,
        wish: control::Wish::default(),
    }
}
