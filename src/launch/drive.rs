//! One launch of a car under a controller that samples its measurements, and the figures that a calibration engineer reads off it.

use super::cars::{Car, Random};
use super::{IDLE, controller_inputs, plant_inputs};
use crate::control::Controller;
use crate::physics::driveline;
use crate::physics::phase::Phase;
use crate::plant::motion::index;
use crate::plant::{Plant, Start, clutch};

/// Step of the plant between two samples of the controller, s.
const STEP: f64 = 1e-3;

/// Number of parts into which the step of lock-up is divided, so that the slip acceleration is the one at ω_fc = 0.
const FINE: usize = 100;

/// Least change against the torque's present direction that counts as a reversal, N·m.
pub const REVERSAL: f64 = 5.0;

/// Engine speed below which the engine has stalled, rad/s.
pub const STALLED: f64 = 50.0;

/// Figures of a launch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// Whether the slip has vanished and clutch and controller agree at the end that the clutch is locked.
    pub locked: bool,
    /// Time at which the slip first vanishes, s; the end of the launch if it never does.
    pub time: f64,
    /// Least engine speed, rad/s.
    pub least_engine_speed: f64,
    /// Greatest engine speed, rad/s.
    pub greatest_engine_speed: f64,
    /// Greatest speed at which the car rolls back, rad/s.
    pub roll_back: f64,
    /// Reversals of the clutch torque until the slip is down to `slip_lock`; the first one belongs to the launch itself. Below that slip, friction
    /// changes into its static value whatever the controller does.
    pub reversals: usize,
    /// Greatest clutch torque until then, N·m.
    pub peak_torque: f64,
    /// Slip acceleration at ω_fc = 0, rad/s².
    pub slip_acceleration: f64,
    /// Energy dissipated, J.
    pub energy: f64,
}

/// Counts the reversals of a torque.
#[derive(Clone, Copy, Debug, Default)]
struct Reversals {
    extreme: f64,
    falling: bool,
    count: usize,
}

impl Reversals {
    fn take(&mut self, torque: f64) {
        let beyond = if self.falling { self.extreme - torque } else { torque - self.extreme };
        if beyond > 0.0 {
            self.extreme = torque;
        } else if beyond < -REVERSAL {
            *self = Self { extreme: torque, falling: !self.falling, count: self.count + 1 };
        }
    }
}

/// Clutch torque without the pulsation due to geometry: no controller can remove it, so that it does not count as a reversal.
fn smooth_torque(plant: &Plant, t_fc: f64) -> f64 {
    let (config, y) = (plant.config(), &plant.state().y);
    let slip = (y[index::OMEGA_F] - y[index::OMEGA_C]).abs();
    let factor: f64 = config.pulsation.iter().map(|effect| effect(&config.parameters, y[index::ANGLE], slip)).product();
    if factor > 0.1 { t_fc / factor } else { t_fc }
}

/// How the slip vanishes within a step.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Meeting {
    /// Slip acceleration just before, rad/s².
    pub slip_acceleration: f64,
    /// Greatest clutch torque within the step until then, N·m.
    pub torque: f64,
    /// Time since the start of the step, s.
    pub into: f64,
}

/// Finds out how the slip vanishes within a step of `step` seconds that starts from the state of `plant`; `advance` integrates it over the given number of seconds.
pub fn meeting(mut plant: Plant, step: f64, advance: impl Fn(&mut Plant, f64)) -> Meeting {
    let mut before = slip(&plant);
    let fine = step / FINE as f64;
    let mut found = Meeting { into: step, ..Meeting::default() };
    for k in 0..FINE {
        advance(&mut plant, fine);
        if plant.outputs().phase == Phase::Locked || slip(&plant) * before < 0.0 {
            found.into = k as f64 * fine;
            break;
        }
        found.slip_acceleration = (slip(&plant) - before) / fine;
        found.torque = found.torque.max(plant.outputs().t_fc);
        before = slip(&plant);
    }
    found
}

/// Slip of a plant, rad/s.
pub fn slip(plant: &Plant) -> f64 {
    plant.state().y[index::OMEGA_F] - plant.state().y[index::OMEGA_C]
}

/// Whether the slip has vanished in a step that began with a slip of `before` rad/s.
pub fn has_met(plant: &Plant, before: f64) -> bool {
    plant.outputs().phase == Phase::Locked || slip(plant) * before < 0.0
}

/// Slip below which it may vanish within a step, rad/s.
pub const NEAR: f64 = 10.0;

/// Greatest clutch torque that the planned launch needs in this car, N·m.
pub fn planned_torque(plant: &Plant, duration: f64, speed: f64) -> f64 {
    let config = plant.config();
    let steepest = 1.5 * speed / duration;
    let resist = crate::plant::motion::vehicle_resistance(config, 0.5 * speed, 0.0);
    config.constants.driveline.J_c * steepest + resist
}

/// Whether engine torque and clutch capacity of this car exceed its load by a tenth, and the torque that holds the speeds together is positive.
pub fn can_lock(plant: &Plant, controller: &Controller) -> bool {
    let (config, s) = (plant.config(), controller.settings());
    let d = &config.constants.driveline;
    let load = crate::plant::motion::vehicle_resistance(config, s.reference_speed, 0.0);
    let c = &config.constants;
    let engine = c.engine_gain * s.engine_torque_max + c.engine_bias - c.accessory_power / s.reference_speed - d.b_f * s.reference_speed;
    let closed = clutch::capacity(config, s.x_max, plant.state().memory, 0.0, &plant.state().y);
    driveline::holding_torque(d, d.J_c, s.reference_speed, engine, load) > 0.0 && engine > 1.1 * load && closed > 1.1 * load
}

/// Drives `car` for `seconds` under `controller`, from a stand at idle speed.
pub fn drive(car: &Car, controller: &mut Controller, seconds: f64) -> Figures {
    let mut random = Random(car.seed);
    let grade = car.inclination(controller.vehicle());
    let start = Start { omega_f: IDLE, omega_c: 0.0, theta_c: car.theta, theta_b: car.theta };
    let mut inputs = plant_inputs(controller.outputs());
    let mut plant = Plant::new(&car.vehicle, &car.effects, &start, &inputs);
    let (samples, within) = ((seconds / car.sampling) as usize, (car.sampling / STEP).round() as usize);
    let mut found = Figures {
        locked: false,
        time: seconds,
        least_engine_speed: f64::INFINITY,
        greatest_engine_speed: 0.0,
        roll_back: 0.0,
        reversals: 0,
        peak_torque: 0.0,
        slip_acceleration: 0.0,
        energy: 0.0,
    };
    let (mut reversals, mut landed, mut gone) = (Reversals::default(), false, false);
    for k in 0..samples {
        for i in 0..within {
            let slip_before = slip(&plant);
            let before = (!gone && slip_before.abs() < NEAR).then(|| plant.clone());
            plant.set_brake(controller.outputs().t_brake);
            plant.step(&inputs, STEP);
            let now = plant.outputs();
            let y = plant.state().y;
            if let Some(before) = before.filter(|_| has_met(&plant, slip_before)) {
                gone = true;
                let met = meeting(before, STEP, |plant, h| plant.step(&inputs, h));
                found.slip_acceleration = met.slip_acceleration;
                found.time = (k * within + i) as f64 * STEP + met.into;
            }
            landed |= slip(&plant).abs() <= controller.settings().slip_lock;
            if !landed {
                let torque = smooth_torque(&plant, now.t_fc);
                reversals.take(torque);
                found.peak_torque = found.peak_torque.max(torque);
            }
            found.least_engine_speed = found.least_engine_speed.min(y[index::OMEGA_F]);
            found.greatest_engine_speed = found.greatest_engine_speed.max(y[index::OMEGA_F]);
            found.roll_back = found.roll_back.max(-y[index::OMEGA_V]);
        }
        let mut told = controller_inputs(&plant.outputs(), true);
        told.omega_f += car.noise * random.normal();
        told.omega_c += car.noise * random.normal();
        told.wish.t_grade = grade;
        controller.step(&told, car.sampling);
        inputs = plant_inputs(controller.outputs());
    }
    let end = plant.outputs();
    found.locked = gone && end.phase == Phase::Locked && controller.outputs().phase == Phase::Locked;
    found.reversals = reversals.count;
    found.energy = end.e_d;
    found
}
