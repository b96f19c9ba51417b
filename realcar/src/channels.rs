//! What is recorded, and with which noise.

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};

/// One recording, a column a channel, in the units of the names.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// What is driven: launch, creep, open_rev, modulate or locked_drive.
    pub manoeuvre: &'static str,
    /// Samples per second.
    pub sample_rate_hz: f64,
    /// Temperature of the disc at the start as it is noted, °C, good to about 1 K.
    pub theta_c0_deg_c: f64,
    /// Temperature of the body at the start as it is noted, °C, good to about 1 K.
    pub theta_b0_deg_c: f64,
    /// Standard deviations of both, K, where they are not 1.
    pub theta_sigma_k: Option<[f64; 2]>,
    /// Time, s.
    pub time_s: Vec<f64>,
    /// Flywheel speed, rad/s.
    pub omega_f_rad_s: Vec<f64>,
    /// Disc speed, rad/s.
    pub omega_c_rad_s: Vec<f64>,
    /// Engine torque as it is reported, N·m.
    pub t_e_nm: Vec<f64>,
    /// Commanded position, mm.
    pub x_to_cmd_mm: Vec<f64>,
    /// Housing air, °C.
    pub theta_h_deg_c: Vec<f64>,
    /// Whether the driver brakes; on the road.
    pub brake: Option<Vec<bool>>,
    /// What only a bench has.
    pub bench: Option<Bench>,
}

/// The channels of a bench.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bench {
    /// Position, mm.
    pub x_to_mm: Vec<f64>,
    /// Clutch torque, N·m.
    pub t_fc_nm: Vec<f64>,
    /// Disc temperature, °C.
    pub theta_c_deg_c: Vec<f64>,
}

/// Standard deviations of a car's sensor noise.
#[derive(Clone, Debug)]
pub struct Noise {
    /// Both speeds, rad/s.
    pub speed: f64,
    /// Reported torque, N·m; zero in one car of four.
    pub torque: f64,
    /// Position, mm.
    pub position: f64,
    /// Disc temperature, °C.
    pub temperature: f64,
}

impl Noise {
    /// Draws the noise of a car's sensors.
    pub fn draw(rng: &mut StdRng) -> Self {
        Self {
            speed: rng.random_range(0.05..0.26),
            torque: if rng.random_bool(0.25) { 0.0 } else { rng.random_range(0.05..0.40) },
            position: rng.random_range(0.004..0.013),
            temperature: rng.random_range(0.4..1.0),
        }
    }
}

/// The steps in which channels are logged.
#[derive(Clone, Copy, Debug)]
pub struct Steps {
    /// Both speeds, rad/s.
    pub speed: f64,
    /// Reported torque, N·m.
    pub torque: f64,
    /// Commanded position, mm.
    pub command: f64,
}

impl Steps {
    /// Those of a bench.
    pub const BENCH: Self = Self { speed: 0.025, torque: 0.1, command: 0.001 };

    /// Draws those of a bus: speeds to a quarter or a whole revolution per minute, torque to 0.1, 0.5 or 1 N·m.
    pub fn draw_bus(rng: &mut StdRng) -> Self {
        let rpm = std::f64::consts::TAU / 60.0;
        let speed = [0.25 * rpm, rpm][rng.random_range(0..2)];
        Self { speed, torque: [0.1, 0.5, 1.0][rng.random_range(0..3)], command: 0.01 }
    }
}

/// What a real sensor adds: noise and steps.
pub struct Pen {
    noise: Noise,
    steps: Steps,
    rng: StdRng,
}

impl Pen {
    /// Noise of its own for each recording.
    pub fn new(noise: &Noise, steps: Steps, seed: u64) -> Self {
        Self { noise: noise.clone(), steps, rng: StdRng::seed_from_u64(seed) }
    }

    fn read(&mut self, value: f64, sigma: f64, step: f64) -> f64 {
        let z: f64 = StandardNormal.sample(&mut self.rng);
        ((value + sigma * z) / step).round() * step
    }

    /// A speed as it is read.
    pub fn speed(&mut self, value: f64) -> f64 {
        self.read(value, self.noise.speed, self.steps.speed)
    }

    /// A reported torque as it is logged.
    pub fn torque(&mut self, value: f64) -> f64 {
        self.read(value, self.noise.torque, self.steps.torque)
    }

    /// A commanded position as it is logged.
    pub fn command(&mut self, value: f64) -> f64 {
        self.read(value, 0.0, self.steps.command)
    }

    /// How far a stamp or a task is off its tick, s, to the tenth of a millisecond.
    pub fn jitter(&mut self, most: f64) -> f64 {
        (self.rng.random_range(-most..=most) * 1e4).round() * 1e-4
    }

    /// A row of the bench: position, torque, temperature.
    pub fn bench(&mut self, bench: &mut Bench, x: f64, t_fc: f64, theta: f64) {
        bench.x_to_mm.push(self.read(x, self.noise.position, 0.001));
        bench.t_fc_nm.push(self.read(t_fc, 0.5, 0.05));
        bench.theta_c_deg_c.push(self.read(theta, self.noise.temperature, 0.1));
    }
}
