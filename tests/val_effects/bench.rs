//! A plant on which one law can be observed in isolation; parts that a row does not need are neutral.

use kisspoint::effects::{self, Parameters};
use kisspoint::physics::cushion::CushionSpring;
use kisspoint::physics::map::Actuator;
use kisspoint::plant::{Inputs, Plant, Start};
use kisspoint::vehicle::Vehicle;

/// Friction coefficient of the bench's facings, at every slip and temperature.
pub const MU: f64 = 0.3;
/// Mean radius of the facings, m.
pub const RADIUS: f64 = 0.09;
/// Spring force at the closed point, N; the spring is F = F_1 ξ³.
pub const F_1: f64 = 5000.0;
/// Contact point and closed point, mm.
pub const X_CNT: f64 = 4.0;
pub const X_CLS: f64 = 8.0;

/// Spring force in N at `x` mm, with the contact point at `cnt` mm and the closed point at `cls` mm.
pub fn force(x: f64, cnt: f64, cls: f64) -> f64 {
    F_1 * ((x - cnt) / (cls - cnt)).powi(3)
}

/// Torque in N·m of both faces at `x` mm, for the friction coefficient `mu`.
pub fn torque(x: f64, mu: f64) -> f64 {
    2.0 * mu * RADIUS * force(x, X_CNT, X_CLS)
}

/// Vehicle, initial state and inputs over time.
#[derive(Clone)]
pub struct Bench {
    pub vehicle: Vehicle,
    pub start: Start,
    /// Inputs at which the plant rests before time 0.
    pub rest: Inputs,
    /// Inputs from a time on, s.
    pub then: Vec<(f64, Inputs)>,
    /// Step, s.
    pub step: f64,
}

impl Bench {
    /// Infinite inertias and heat capacities: speeds and temperatures keep their initial values.
    pub fn held(omega_f: f64, omega_c: f64, theta: f64, x_to: f64) -> Self {
        let mut vehicle = Vehicle::paper();
        let f = &mut vehicle.friction;
        (f.R_1, f.R_2) = (RADIUS - 0.02, RADIUS + 0.02);
        (f.mu_0, f.m_0, f.m_1, f.m_2, f.alpha_1, f.alpha_2) = (MU, MU, 0.0, 0.0, 0.0, 0.3);
        vehicle.cushion_spring = CushionSpring { beta_1: 0.0, beta_2: 0.0, beta_3: F_1 };
        vehicle.actuator = Actuator { x_cnt_0: X_CNT, x_cls_0: X_CLS, ..Actuator::default() };
        let t = &mut vehicle.thermal;
        (t.C_1, t.C_b, t.gamma_1, t.gamma_2, t.gamma_3) = (1e13, 1e13, 0.0, 0.0, 0.3);
        let d = &mut vehicle.driveline;
        (d.J_f, d.J_c, d.b_f, d.b_c, d.T_L0, d.omega_L, d.k_L) = (1e10, 1e10, 0.0, 0.0, 0.0, 0.5, 0.0);
        d.mgR_over_i = 400.0;
        let start = Start { omega_f, omega_c, theta_c: theta, theta_b: theta };
        let rest = Inputs { x_to, t_e_ref: 0.0, theta_h: theta, t_load: 0.0 };
        Self { vehicle, start, rest, then: Vec::new(), step: 1e-3 }
    }

    /// Sets the position command to `x_to` mm from `time` s on.
    pub fn moved(mut self, time: f64, x_to: f64) -> Self {
        let last = self.then.last().map_or(self.rest, |(_, inputs)| *inputs);
        self.then.push((time, Inputs { x_to, ..last }));
        self
    }

    /// Sets the demanded engine torque to `t_e_ref` N·m from `time` s on.
    pub fn driven(mut self, time: f64, t_e_ref: f64) -> Self {
        let last = self.then.last().map_or(self.rest, |(_, inputs)| *inputs);
        self.then.push((time, Inputs { t_e_ref, ..last }));
        self
    }

    /// The plant after `at` seconds.
    pub fn run(&self, effects: &Parameters, at: f64) -> Plant {
        let mut plant = Plant::new(&self.vehicle, effects, &self.start, &self.rest);
        let (mut inputs, mut t) = (self.rest, 0.0);
        for (corner, next) in self.then.iter().copied().chain([(f64::INFINITY, inputs)]) {
            let end = corner.min(at);
            let count = ((end - t) / self.step - 1e-6).ceil().max(0.0);
            (0..count as usize).for_each(|_| plant.step(&inputs, (end - t) / count));
            if corner >= at {
                break;
            }
            (inputs, t) = (next, end);
        }
        plant
    }
}

/// One row: effects, bench, the quantity that is read and its time, and the expected value.
pub struct Law {
    pub what: &'static str,
    pub set: Vec<(usize, f64)>,
    pub bench: Bench,
    /// Time of the reading, s.
    pub at: f64,
    pub read: fn(&Plant) -> f64,
    pub expected: f64,
    pub tolerance: f64,
    /// Whether the effects do nothing in this row.
    pub limit: bool,
}

impl Law {
    /// A row with a relative tolerance of 1e-7.
    pub fn new(what: &'static str, set: &[(usize, f64)], bench: Bench, at: f64, read: fn(&Plant) -> f64, expected: f64) -> Self {
        let tolerance = 1e-7 * expected.abs().max(1e-2);
        Self { what, set: set.to_vec(), bench, at, read, expected, tolerance, limit: false }
    }

    /// The same, with another relative tolerance.
    pub fn within(self, relative: f64) -> Self {
        Self { tolerance: relative * self.expected.abs(), ..self }
    }

    /// The same, with an absolute tolerance.
    pub fn absolute(self, tolerance: f64) -> Self {
        Self { tolerance, ..self }
    }

    /// The same, for a limit at which the effects do nothing.
    pub fn limit(self) -> Self {
        Self { limit: true, ..self }
    }

    pub fn parameters(&self) -> Parameters {
        let mut parameters = effects::null();
        self.set.iter().for_each(|&(k, value)| parameters[k] = value);
        parameters
    }

    pub fn measure(&self, effects: &Parameters) -> f64 {
        (self.read)(&self.bench.run(effects, self.at))
    }
}

pub fn omega_f(plant: &Plant) -> f64 {
    plant.outputs().omega_f
}

pub fn omega_c(plant: &Plant) -> f64 {
    plant.outputs().omega_c
}

pub fn bearing(plant: &Plant) -> f64 {
    plant.outputs().x_to_actual
}

pub fn t_fc(plant: &Plant) -> f64 {
    plant.outputs().t_fc
}

pub fn theta_c(plant: &Plant) -> f64 {
    plant.outputs().theta_c
}

pub fn theta_b(plant: &Plant) -> f64 {
    plant.outputs().theta_b
}

/// Remaining departure at time `t` from the end value of κτ²ÿ + τẏ + y = u, for an initial departure of 1 with rate 0, and its rate: by partial fractions of the two poles, or
/// by the damped cosine if they are complex.
pub fn remains(tau: f64, kappa: f64, t: f64) -> (f64, f64) {
    let discriminant = 1.0 - 4.0 * kappa;
    if kappa == 0.0 {
        let z = (-t / tau).exp();
        (z, -z / tau)
    } else if discriminant == 0.0 {
        let p = 2.0 / tau;
        ((1.0 + p * t) * (-p * t).exp(), -p * p * t * (-p * t).exp())
    } else if discriminant > 0.0 {
        let poles = [1.0, -1.0].map(|sign| (-1.0 + sign * discriminant.sqrt()) / (2.0 * kappa * tau));
        let [fast, slow] = [poles[1], poles[0]];
        let (e_slow, e_fast) = ((slow * t).exp(), (fast * t).exp());
        ((slow * e_fast - fast * e_slow) / (slow - fast), slow * fast * (e_fast - e_slow) / (slow - fast))
    } else {
        let (decay, turn) = (1.0 / (2.0 * kappa * tau), (-discriminant).sqrt() / (2.0 * kappa * tau));
        let amplitude = (1.0 + (decay / turn).powi(2)).sqrt();
        let z = amplitude * (-decay * t).exp() * (turn * t - (decay / turn).atan()).cos();
        (z, -(decay * decay + turn * turn) / turn * (-decay * t).exp() * (turn * t).sin())
    }
}

/// Effects with these values.
pub fn with(set: &[(usize, f64)]) -> Parameters {
    let mut parameters = effects::null();
    set.iter().for_each(|&(k, value)| parameters[k] = value);
    parameters
}

pub fn close(what: &str, found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{what}: {found} against {expected}, {:.1e} apart", (found - expected).abs());
}

/// A disc and a car of together 0.5 kg·m² behind shafts without damping; the flywheel has 0.2 kg·m².
pub fn elastic(omega_f: f64, omega_c: f64, x_to: f64) -> (Bench, Parameters) {
    use effects::param::driveline_compliance::{compliance, damping, disc_share};
    let mut bench = Bench::held(omega_f, omega_c, 25.0, x_to);
    (bench.vehicle.driveline.J_f, bench.vehicle.driveline.J_c) = (0.2, 0.5);
    (bench, with(&[(compliance, 2e-3), (disc_share, 0.2), (damping, 0.0)]))
}
