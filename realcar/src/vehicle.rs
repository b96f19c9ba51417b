//! The numbers of a vehicle: what its file says, and what the real car of that type has.
//!
//! The file's numbers differ between vehicles, as between types; the real car differs from its file by the file's
//! tolerances, of which each is one standard deviation. Units: s, rad/s, N·m, mm, °C, J/K, W/K, N.

use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};
use serde_json::{Value, json};

/// The numbers of one vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct Vehicle {
    /// Inner and outer facing radius, m.
    pub radii_m: [f64; 2],
    /// Friction coefficient at standstill, -.
    pub mu_0: f64,
    /// Slope of the friction coefficient at small slip, s/rad.
    pub alpha_1: f64,
    /// Decay of the friction coefficient with slip, s/rad.
    pub alpha_2: f64,
    /// Dynamic friction as a polynomial in °C.
    pub mu_d: [f64; 3],
    /// Position of first contact, mm.
    pub x_cnt: f64,
    /// Position of full closing, mm.
    pub x_cls: f64,
    /// Cushion force polynomial in the normalised position, N.
    pub beta: [f64; 3],
    /// Heat capacity of the disc, J/K.
    pub c_1: f64,
    /// Heat capacity of the body, J/K.
    pub c_b: f64,
    /// Exchange of disc and body, W/K.
    pub gamma_1: f64,
    /// Exchange with the housing air, W/K.
    pub gamma_2: f64,
    /// Share of the friction heat that enters the disc.
    pub gamma_3: f64,
    /// Inertia of engine and flywheel, kg·m².
    pub j_f: f64,
    /// Inertia of disc and vehicle at the gearbox input, kg·m².
    pub j_c: f64,
    /// Engine's viscous friction, N·m·s/rad.
    pub b_f: f64,
    /// Driveline's viscous friction, N·m·s/rad.
    pub b_c: f64,
    /// Constant load, N·m.
    pub t_l0: f64,
    /// Speed over which the constant load builds up, rad/s.
    pub omega_l: f64,
    /// Quadratic load, N·m·s²/rad².
    pub k_l: f64,
    /// Weight times wheel radius over the overall ratio, N·m (a grade's torque per unit of slope).
    pub weight_nm: f64,
    /// Factor on the friction coefficient: 1 in the file, within its tolerance in a real car.
    pub mu_factor: f64,
    /// What the engine gives beyond its report, N·m: 0 in the file.
    pub engine_bias: f64,
    /// Factor on the reported torque: 1 in the file.
    pub engine_gain: f64,
    /// How late flywheel and disc speed arrive, s: 0 in the file.
    pub latency_s: [f64; 2],
}

/// How far each number of a car is from its file, in standard deviations of its tolerance.
pub type Moves = Vec<(&'static str, f64)>;

/// Names of the tolerances that every file declares, in the order in which they are drawn.
pub const TOLERANCES: [&str; 12] = [
    "driveline.J_f",
    "driveline.J_c",
    "driveline.b_f",
    "driveline.b_c",
    "driveline.T_L0",
    "actuator.x_cnt",
    "cushion_spring.beta",
    "friction.mu",
    "thermal.C_1",
    "thermal.gamma_1",
    "engine.T_e_bias",
    "engine.T_e_gain",
];

/// What a vehicle file declares of the road beside the tolerances of the bench; standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Declared {
    /// How late a speed may be, s: engine and disc.
    pub latency_s: [f64; 2],
    /// Slow error of the torque report, N·m.
    pub wander_nm: f64,
    /// Its correlation time, s.
    pub wander_s: f64,
    /// Slope of the road, new for each drive.
    pub grade: f64,
}

impl Declared {
    /// Draws what a file declares: half of all types declare the usual figures.
    pub fn draw(rng: &mut impl Rng) -> Self {
        let usual = Self { latency_s: [0.004, 0.004], wander_nm: 1.0, wander_s: 1.0, grade: 0.008 };
        if rng.random_bool(0.5) {
            return usual;
        }
        let mut of = |list: [f64; 3]| list[rng.random_range(0..3)];
        Self {
            latency_s: [of([0.003, 0.004, 0.006]), of([0.003, 0.004, 0.006])],
            wander_nm: of([0.6, 1.0, 1.5]),
            wander_s: of([0.5, 1.0, 2.5]),
            grade: of([0.004, 0.008, 0.012]),
        }
    }

    /// How late the speeds of one car are, s: never early.
    pub fn draw_latency(&self, rng: &mut impl Rng) -> [f64; 2] {
        self.latency_s.map(|sigma| {
            let z: f64 = StandardNormal.sample(rng);
            sigma * z.abs().min(3.0)
        })
    }
}

impl Vehicle {
    /// The reference vehicle.
    pub fn reference() -> Self {
        Self {
            radii_m: [0.074, 0.108],
            mu_0: 0.15,
            alpha_1: 0.02,
            alpha_2: 0.3,
            mu_d: [0.1834, 0.0024, -7.06e-6],
            x_cnt: 4.02,
            x_cls: 7.78,
            beta: [26.1195, -1304.6, 5818.5],
            c_1: 70.0,
            c_b: 6928.0,
            gamma_1: 14.58,
            gamma_2: 25.0,
            gamma_3: 0.5,
            j_f: 0.189,
            j_c: 0.578,
            b_f: 0.03,
            b_c: 0.012,
            t_l0: 3.1,
            omega_l: 0.5,
            k_l: 2e-5,
            weight_nm: 258.0,
            mu_factor: 1.0,
            engine_bias: 0.0,
            engine_gain: 1.0,
            latency_s: [0.0, 0.0],
        }
    }

    /// Draws a vehicle type: in three of ten the reference itself, else another of its kind.
    pub fn draw_type(rng: &mut impl Rng) -> Self {
        let mut v = Self::reference();
        if rng.random_bool(0.3) {
            return v;
        }
        let mut vary = |value: f64, part: f64, digits: i32| round(value * (1.0 + rng.random_range(-part..part)), digits);
        v.j_f = vary(v.j_f, 0.15, 4);
        v.j_c = vary(v.j_c, 0.15, 4);
        v.b_f = vary(v.b_f, 0.15, 4);
        v.t_l0 = vary(v.t_l0, 0.15, 3);
        v.c_1 = vary(v.c_1, 0.15, 2);
        v.gamma_1 = vary(v.gamma_1, 0.15, 3);
        v.weight_nm = vary(v.weight_nm, 0.14, 1);
        let force = vary(1.0, 0.12, 6);
        v.beta = v.beta.map(|b| round(b * force, 4));
        let span = vary(v.x_cls - v.x_cnt, 0.05, 3);
        v.x_cnt = vary(v.x_cnt, 0.073, 3);
        v.x_cls = round(v.x_cnt + span, 3);
        v
    }

    /// Draws a real car of this type: every number that has a tolerance lies off by it.
    pub fn draw_real(&self, rng: &mut impl Rng) -> (Self, Moves) {
        self.draw_real_about(rng, |_| [0.0, 1.0])
    }

    /// The same where numbers have another mean and standard deviation than the file says, in standard deviations of the tolerances.
    pub fn draw_real_about(&self, rng: &mut impl Rng, population: impl Fn(&str) -> [f64; 2]) -> (Self, Moves) {
        let mut v = self.clone();
        let mut moves = Vec::with_capacity(TOLERANCES.len());
        let mut off = |sigma: f64| -> f64 {
            let name = TOLERANCES[moves.len()];
            let [mean, spread] = population(name);
            let z: f64 = StandardNormal.sample(rng);
            let z = mean + spread * z.clamp(-3.0, 3.0);
            moves.push((name, z));
            sigma * z
        };
        v.j_f *= 1.0 + off(0.01);
        v.j_c *= 1.0 + off(0.02);
        v.b_f *= 1.0 + off(0.1);
        v.b_c *= 1.0 + off(0.1);
        v.t_l0 *= 1.0 + off(0.1);
        v.x_cnt += off(0.015);
        let force = 1.0 + off(0.01);
        v.beta = v.beta.map(|b| b * force);
        v.mu_factor = 1.0 + off(0.015);
        v.c_1 *= 1.0 + off(0.05);
        v.gamma_1 *= 1.0 + off(0.05);
        v.engine_bias = off(0.2);
        v.engine_gain = 1.0 + off(0.005);
        (v, moves)
    }

    /// The vehicle file that the engineer is handed, with what it declares of the road.
    pub fn to_json(&self, road: Option<&Declared>) -> Value {
        let rel = |r: f64| json!({ "rel": r });
        let abs = |a: f64| json!({ "abs": a });
        let mut file = json!({
            "friction": {"R_1": self.radii_m[0], "R_2": self.radii_m[1], "mu_0": self.mu_0, "alpha_1": self.alpha_1,
                "alpha_2": self.alpha_2, "mu_d": self.mu_d},
            "actuator": {"x_cnt": [self.x_cnt], "x_cls": [self.x_cls]},
            "cushion_spring": {"beta": self.beta},
            "thermal": {"C_1": self.c_1, "C_b": self.c_b, "gamma_1": self.gamma_1, "gamma_2": self.gamma_2,
                "gamma_3": self.gamma_3},
            "driveline": {"J_f": self.j_f, "J_c": self.j_c, "b_f": self.b_f, "b_c": self.b_c, "T_L0": self.t_l0,
                "omega_L": self.omega_l, "k_L": self.k_l, "mgR_over_i": self.weight_nm},
            "tolerance": {
                "driveline.J_f": rel(0.01), "driveline.J_c": rel(0.02), "driveline.b_f": rel(0.1),
                "driveline.b_c": rel(0.1), "driveline.T_L0": rel(0.1), "actuator.x_cnt": abs(0.015),
                "cushion_spring.beta": rel(0.01), "friction.mu": rel(0.015), "thermal.C_1": rel(0.05),
                "thermal.gamma_1": rel(0.05), "engine.T_e_bias": abs(0.2), "engine.T_e_gain": rel(0.005)}
        });
        if let Some(d) = road {
            let tolerance = &mut file["tolerance"];
            tolerance["sensors.omega_f_latency"] = abs(d.latency_s[0]);
            tolerance["sensors.omega_c_latency"] = abs(d.latency_s[1]);
            tolerance["engine.T_e_wander"] = json!({"abs": d.wander_nm, "time_s": d.wander_s});
            tolerance["driveline.grade"] = json!({"abs": d.grade, "per": "recording"});
        }
        file
    }
}

fn round(value: f64, digits: i32) -> f64 {
    let scale = 10f64.powi(digits);
    (value * scale).round() / scale
}
