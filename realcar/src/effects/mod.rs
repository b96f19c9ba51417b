//! What a real car does otherwise than the nominal plant, one subsystem a file.
//!
//! Each subsystem is a plain struct of shapes and their states, of which the default is the healthy car, with a `draw`
//! that sets one shape by the effect's id at random: most are smooth random functions ([`maps`]), of which no library can hold the formula. Magnitudes scale with the size that [`Dice::new`] is given; at zero the car is healthy.

pub mod actuator;
pub mod driveline;
pub mod engine;
pub mod force;
pub mod friction;
pub mod maps;
pub mod ring;
pub mod road;
pub mod seen;
pub mod sensors;
pub mod thermal;

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};

/// The fine step of the simulation, s.
pub const STEP_S: f64 = 5e-5;

/// Everything that one car does otherwise.
#[derive(Clone, Debug, Default)]
pub struct Deviation {
    /// Between reported and real engine torque.
    pub engine: engine::Engine,
    /// Between commanded and real position.
    pub actuator: actuator::Actuator,
    /// Between position and force.
    pub force: force::Force,
    /// Between force and torque.
    pub friction: friction::Friction,
    /// Where the heat goes.
    pub thermal: thermal::Thermal,
    /// Behind the disc.
    pub driveline: driveline::Driveline,
    /// Between the real speeds and the recorded ones.
    pub sensors: sensors::Sensors,
}

impl Deviation {
    /// Sets the effect of this id and returns the name of the shape that was drawn.
    ///
    /// # Panics
    /// If no subsystem knows the id, which a test rules out for the catalogue's ids.
    pub fn set(&mut self, id: &str, dice: &mut Dice) -> String {
        None.or_else(|| self.engine.draw(id, dice))
            .or_else(|| self.actuator.draw(id, dice))
            .or_else(|| self.force.draw(id, dice))
            .or_else(|| self.friction.draw(id, dice))
            .or_else(|| self.thermal.draw(id, dice))
            .or_else(|| self.driveline.draw(id, dice))
            .or_else(|| self.sensors.draw(id, dice))
            .unwrap_or_else(|| panic!("no subsystem knows an effect `{id}`; see the catalogue"))
    }

    /// What came nearest in the library, by subsystem.
    pub fn seen(&mut self) -> [(&'static str, &mut seen::Seen); 7] {
        [
            ("engine", &mut self.engine.seen),
            ("actuator", &mut self.actuator.seen),
            ("clutch_force", &mut self.force.seen),
            ("friction", &mut self.friction.seen),
            ("thermal", &mut self.thermal.seen),
            ("driveline", &mut self.driveline.seen),
            ("sensors", &mut self.sensors.seen),
        ]
    }
}

/// Chance for one effect: which shape it takes, and how large it is.
pub struct Dice {
    rng: StdRng,
    size: f64,
}

impl Dice {
    /// Chance from a seed; `size` scales every magnitude, 1 is as seen in practice and 0 is no effect.
    pub fn new(seed: u64, size: f64) -> Self {
        Self { rng: StdRng::seed_from_u64(seed), size }
    }

    /// Which of `n` shapes.
    pub fn shape(&mut self, n: usize) -> usize {
        self.rng.random_range(0..n)
    }

    /// A magnitude, evenly spread on a logarithmic scale, times the size.
    pub fn magnitude(&mut self, low: f64, high: f64) -> f64 {
        let share: f64 = self.rng.random();
        self.size * low * (high / low).powf(share)
    }

    /// A magnitude of either sign.
    pub fn either(&mut self, low: f64, high: f64) -> f64 {
        let m = self.magnitude(low, high);
        if self.rng.random_bool(0.5) { m } else { -m }
    }

    /// A number that is no magnitude: a phase, a width, a place.
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        self.rng.random_range(low..high)
    }

    /// A number of mean 0 and variance 1 that is no magnitude.
    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.rng)
    }

    /// A seed for what goes on at random while the car drives.
    pub fn seed(&mut self) -> u64 {
        self.rng.random()
    }
}

/// A smooth step from 0 at 0 to 1 at 1.
pub fn smooth(s: f64) -> f64 {
    let s = s.clamp(0.0, 1.0);
    s * s * (3.0 - 2.0 * s)
}
