//! Cars with production tolerances and wear, drawn at random for [`super::monte_carlo`].
//!
//! | quantity | how it is drawn |
//! |---|---|
//! | numbers of the vehicle file | normal, with the standard deviations in [`TOLERANCES`] |
//! | friction, touch point, mass | × 0.8 to 1.2, ± 0.4 mm, × 0.7 to 1.3, uniform |
//! | grade | 0 to 20 %, uniform; the inclination sensor has an error of 1 % (standard deviation), and its torque is computed with the nominal mass |
//! | disc and body | 20 to 150 °C at the start; the controller is given a temperature that is up to 20 K off |
//! | actuator | lag 20 to 40 ms, delay 10 to 20 ms, uniform |
//! | sampling | 10 or 20 ms |
//! | noise of both speeds | normal, standard deviation 0 to 1 rad/s |
//! | effects | one or two more effects of the library, at 0.5 to 1.5 times a typical size (`starts`) |

use crate::effects::{self, Entry, PARAMETERS, Parameters, REGISTRY, param};
use crate::vehicle::{NUMBERS, Vehicle};

/// Numbers that differ from car to car, with their relative standard deviations.
pub const TOLERANCES: [(&str, f64); 10] = [
    ("driveline.J_f", 0.01),
    ("driveline.b_f", 0.1),
    ("driveline.b_c", 0.1),
    ("driveline.T_L0", 0.1),
    ("cushion_spring.beta_1", 0.01),
    ("cushion_spring.beta_2", 0.01),
    ("cushion_spring.beta_3", 0.01),
    ("thermal.C_1", 0.05),
    ("thermal.gamma_1", 0.05),
    ("thermal.gamma_2", 0.05),
];

/// Effects that every car has in any case; none of them is drawn as an additional one.
const DRAWN_ANYWAY: [&str; 6] = ["friction_level", "kiss_point_offset", "vehicle_mass", "road_load", "actuator_lag", "actuator_delay"];

/// One car, and how it is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Car {
    /// Its numbers in the vehicle file.
    pub vehicle: Vehicle,
    /// Its effects.
    pub effects: Parameters,
    /// Temperature of disc and body at the start, °C.
    pub theta: f64,
    /// Temperature that the controller assumes, °C.
    pub theta_believed: f64,
    /// Sampling period of the controller, s.
    pub sampling: f64,
    /// Standard deviation of the noise of both measured speeds, rad/s.
    pub noise: f64,
    /// Error of the inclination sensor, as a grade.
    pub grade_error: f64,
    /// Seed of the noise.
    pub seed: u64,
}

impl Car {
    /// Torque due to the grade, N·m, as computed from the inclination sensor for the nominal vehicle.
    pub fn inclination(&self, nominal: &Vehicle) -> f64 {
        let seen = self.effects[param::road_load::grade] + self.grade_error;
        nominal.driveline.mgR_over_i * seen / seen.hypot(1.0)
    }
}

/// Pseudo-random numbers: SplitMix64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Random(pub u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform between `low` and `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.next() >> 11) as f64 / (1_u64 << 53) as f64)
    }

    /// Normal with mean 0 and standard deviation 1, by the Box–Muller transform.
    pub fn normal(&mut self) -> f64 {
        let (a, b) = (self.between(f64::MIN_POSITIVE, 1.0), self.between(0.0, 1.0));
        (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    }

    fn below(&mut self, count: usize) -> usize {
        ((self.between(0.0, 1.0) * count as f64) as usize).min(count - 1)
    }
}

/// Car number `k` of the family with this `seed`, around the vehicle `nominal`.
pub fn draw(nominal: &Vehicle, seed: u64, k: usize) -> Car {
    let mut random = Random(seed.wrapping_mul(0x2545_f491_4f6c_dd1d) ^ (k as u64).wrapping_mul(0xd134_2543_de82_ef95));
    let mut vehicle = *nominal;
    for number in &NUMBERS {
        if let Some((_, sigma)) = TOLERANCES.iter().find(|(name, _)| *name == number.name) {
            *(number.get_mut)(&mut vehicle) *= 1.0 + sigma * random.normal();
        }
    }
    let mut p = effects::null();
    p[param::friction_level::factor] = random.between(0.8, 1.2);
    p[param::kiss_point_offset::offset] = random.between(-0.4, 0.4);
    p[param::kiss_point_offset::closed_offset] = p[param::kiss_point_offset::offset];
    p[param::vehicle_mass::factor] = random.between(0.7, 1.3);
    p[param::road_load::grade] = random.between(0.0, 0.2);
    p[param::actuator_lag::time_constant] = random.between(0.02, 0.04);
    p[param::actuator_delay::delay] = random.between(0.01, 0.02);
    for _ in 0..1 + random.below(2) {
        add_effect(&mut p, &mut random);
    }
    let theta = random.between(20.0, 150.0);
    let theta_believed = theta + random.between(-20.0, 20.0);
    let sampling = if random.below(2) == 0 { 0.01 } else { 0.02 };
    Car {
        vehicle,
        effects: p,
        theta,
        theta_believed,
        sampling,
        noise: random.between(0.0, 1.0),
        seed: random.next(),
        grade_error: 0.01 * random.normal(),
    }
}

fn add_effect(p: &mut Parameters, random: &mut Random) {
    let all: Vec<&Entry> = REGISTRY.iter().filter(|entry| !DRAWN_ANYWAY.contains(&entry.id)).collect();
    let entry = all[random.below(all.len())];
    let start = entry.effect.starts[random.below(entry.effect.starts.len())];
    let size = random.between(0.5, 1.5);
    for &(k, value) in start {
        let null = PARAMETERS[k].null;
        // A shape parameter keeps its typical value; an amplitude is scaled.
        let factor = if entry.effect.amplitudes.contains(&k) { size } else { 1.0 };
        p[k] = (null + factor * (value - null)).clamp(PARAMETERS[k].min, PARAMETERS[k].max);
    }
}
