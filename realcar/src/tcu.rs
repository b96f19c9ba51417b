//! The transmission controller that drives the car.
//!
//! It knows the vehicle file and the recorded speeds alone. The engine follows a planned speed by a PI controller on top of
//! the planned clutch torque; the position is the inverse torque map at an estimated disc temperature, corrected by an
//! integral of the disc's speed error. At synchronous speed it hands over: engine torque down, a firm grip, then full closing.

use crate::effects::smooth;
use crate::manoeuvre::{self, Launch, Manoeuvre};
use crate::map;
use crate::vehicle::Vehicle;
use rand::RngExt;
use rand::rngs::StdRng;
use std::rc::Rc;

/// Engine torque at full closing, as a share of what follows.
const CLOSING: f64 = 0.72;

/// The controller's own tuning, which differs between cars.
#[derive(Clone, Debug)]
pub struct Tuning {
    engine_p: f64,
    engine_i: f64,
    clutch_i: f64,
    follows_heat: bool,
}

impl Tuning {
    /// Draws a tuning.
    pub fn draw(rng: &mut StdRng) -> Self {
        Self {
            engine_p: rng.random_range(0.25..0.55),
            engine_i: rng.random_range(0.35..0.9),
            clutch_i: if rng.random_bool(0.4) { 0.0 } else { rng.random_range(0.05..0.35) },
            follows_heat: rng.random_bool(0.65),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Slipping,
    /// Since when, and from which position.
    HandOver {
        since: f64,
        x: f64,
    },
    Closed {
        since: f64,
    },
}

/// The controller at work.
#[derive(Clone, Debug)]
pub struct Tcu {
    vehicle: Rc<Vehicle>,
    tuning: Tuning,
    what: Manoeuvre,
    dt: f64,
    engine_sum: f64,
    clutch_sum: f64,
    plan_c: f64,
    theta: f64,
    theta_b: f64,
    slip: f64,
    phase: Phase,
    torque: f64,
    position: f64,
    down_since: Option<(f64, f64)>,
    near: usize,
}

impl Tcu {
    /// A controller for one manoeuvre; temperatures in °C as they are noted.
    pub fn new(vehicle: &Vehicle, tuning: &Tuning, what: Manoeuvre, dt: f64, theta: [f64; 2]) -> Self {
        let engine_sum = match what {
            Manoeuvre::Creep(..) => 4.0,
            Manoeuvre::Modulate => 7.0,
            _ => 0.0,
        };
        // A controller that does not follow the heat allows for half a launch of it.
        let allowed = match what {
            Manoeuvre::Launch(l) if !tuning.follows_heat => 0.3 * l.torque,
            _ => 0.0,
        };
        Self {
            vehicle: Rc::new(vehicle.clone()),
            tuning: tuning.clone(),
            what,
            dt,
            engine_sum,
            clutch_sum: 0.0,
            plan_c: 0.0,
            theta: theta[0] + allowed,
            theta_b: theta[1],
            slip: 100.0,
            phase: Phase::Slipping,
            torque: 0.0,
            position: 0.0,
            down_since: None,
            near: 0,
        }
    }

    /// Engine torque, N·m, and position, mm, from the recorded speeds of this sample.
    pub fn command(&mut self, t: f64, omega_f: f64, omega_c: f64) -> (f64, f64) {
        let v = Rc::clone(&self.vehicle);
        let at = |xi: f64| v.x_cnt + xi * (v.x_cls - v.x_cnt);
        let (torque, position) = match self.what {
            Manoeuvre::OpenRev(..) => (manoeuvre::open_rev_torque(t), v.x_cnt - 1.0),
            Manoeuvre::LockedDrive(_) => (manoeuvre::locked_torque(t), v.x_cls + 0.3),
            Manoeuvre::Creep(top, period) => {
                let x = rise(t, 0.3, v.x_cnt - 0.6, at(manoeuvre::creep_position(t.max(0.3), top, period)));
                (self.governor(150.0, omega_f, 0.85, 0.8) + self.carried(t, x), x)
            }
            Manoeuvre::Modulate => {
                let x = rise(t, 0.3, v.x_cnt - 0.6, at(manoeuvre::chirp_position(t.max(0.3))));
                (self.governor(150.0, omega_f, 0.8, 0.9) + 0.4 * self.carried(t, x), x)
            }
            Manoeuvre::Launch(l) => self.launch(l, t, omega_f, omega_c),
        };
        self.torque = torque.clamp(-12.0, 125.0);
        // The command is sent as whole micrometres.
        self.position = (position.clamp(v.x_cnt - 1.0, v.x_cls + 0.3) * 1000.0).round() / 1000.0;
        (self.torque, self.position)
    }

    /// What the clutch should carry at this position: the engine is told in advance.
    fn carried(&self, t: f64, x: f64) -> f64 {
        let v = &self.vehicle;
        let force = map::cushion_force_n(v, (x - v.x_cnt) / (v.x_cls - v.x_cnt));
        2.0 * map::friction_radius_m(v, 80.0, self.theta) * force * smooth(t / 0.3)
    }

    fn governor(&mut self, target: f64, omega_f: f64, p: f64, i: f64) -> f64 {
        let err = target - omega_f;
        if err.abs() < 25.0 {
            self.engine_sum += self.dt * i * err;
        }
        (p * err + self.engine_sum).clamp(-8.0, 90.0)
    }

    fn launch(&mut self, l: Launch, t: f64, omega_f: f64, omega_c: f64) -> (f64, f64) {
        self.slip += (omega_f - omega_c - self.slip) * (self.dt / 0.012).min(1.0);
        match self.phase {
            Phase::Slipping => self.slipping(l, t, omega_f, omega_c),
            Phase::HandOver { since, x } => self.hand_over(l, t, since, x),
            Phase::Closed { since } => self.closed(l, t - since),
        }
    }

    fn slipping(&mut self, l: Launch, t: f64, omega_f: f64, omega_c: f64) -> (f64, f64) {
        let v = Rc::clone(&self.vehicle);
        let plan = 0.93 * l.torque * ease(t - l.fill_s, l.ramp_s);
        self.plan_c += self.dt * (plan - v.t_l0 - v.b_c * self.plan_c).max(0.0) / v.j_c;
        // The engine is to meet the disc at the speed that the plan reaches in the time of its strength.
        let meet = 104.72 + 0.27 * (l.torque + 55.0);
        let share = smooth((t - 0.05) / 0.75);
        let err = 104.72 + (meet - 104.72) * share - omega_f;
        self.engine_sum = (self.engine_sum + self.dt * self.tuning.engine_i * err).clamp(-25.0, 25.0);
        let speed_up = v.j_f * (meet - 104.72) * 6.0 * ((t - 0.05) / 0.75).clamp(0.0, 1.0) * (1.0 - share) / 0.75 * 0.35;
        let wanted = plan + v.b_f * omega_f + self.tuning.engine_p * err + self.engine_sum + speed_up;
        let mut torque = wanted * smooth(t / 0.25);

        if plan > 0.84 * l.torque && self.slip > 5.0 {
            self.clutch_sum += self.dt * self.tuning.clutch_i * (self.plan_c - omega_c).clamp(-20.0, 20.0);
            self.clutch_sum = self.clutch_sum.clamp(-0.12 * l.torque, 0.12 * l.torque);
        }
        let asked = plan + self.clutch_sum;
        self.warm_up(asked);
        let x = if t < l.fill_s + 1e-9 {
            v.x_cnt - 0.8 * (1.0 - smooth(t / l.fill_s))
        } else {
            map::position_for_torque_mm(&v, asked, self.theta)
        };

        if plan > 0.84 * l.torque {
            if self.slip < 6.0 && self.down_since.is_none() {
                self.down_since = Some((t, torque));
            }
            self.near = if self.slip < 2.5 { self.near + 1 } else { 0 };
            let late = t > 0.62 * l.length_s + 0.55;
            if self.near as f64 * self.dt > 0.025 || (late && self.slip < 12.0) {
                self.phase = Phase::HandOver { since: t, x: self.position };
                self.down_since = Some(self.down_since.unwrap_or((t, torque)));
            }
        }
        if let Some((since, from)) = self.down_since {
            torque = going_down(l, t - since, from);
        }
        (torque, x)
    }

    /// Disc temperature by the vehicle file, for the feedforward.
    fn warm_up(&mut self, torque: f64) {
        if !self.tuning.follows_heat {
            return;
        }
        let v = Rc::clone(&self.vehicle);
        let heat = v.gamma_3 * torque.max(0.0) * self.slip.max(0.0);
        self.theta += self.dt / v.c_1 * (v.gamma_1 * (self.theta_b - self.theta) + heat);
    }

    fn hand_over(&mut self, l: Launch, t: f64, since: f64, x: f64) -> (f64, f64) {
        let v = Rc::clone(&self.vehicle);
        let (down, from) = self.down_since.unwrap_or((since, self.torque));
        let torque = going_down(l, t - down, from);
        let grip = map::position_for_torque_mm(&v, 1.38 * l.torque, self.theta).max(x + 0.2).min(v.x_cls + 0.3);
        let s = t - since;
        let position = x + (grip - x) * smooth(s / 0.09) + (v.x_cls + 0.3 - grip) * smooth((s - 0.22) / 0.34);
        if s > 0.56 {
            self.phase = Phase::Closed { since: t };
        }
        (torque, position)
    }

    /// Closed: drive, pull, coast, and perhaps slip once more under power.
    fn closed(&self, l: Launch, s: f64) -> (f64, f64) {
        let v = Rc::clone(&self.vehicle);
        let start = CLOSING * l.base;
        let mut torque = start + (l.base - start) * smooth(s / 0.03);
        torque += 30.0 * smooth((s - 0.40) / 0.07) - 55.0 * smooth((s - 0.98) / 0.07);
        let mut position = v.x_cls + 0.3;
        if l.reopens {
            let open = v.x_cnt + 0.35 * (v.x_cls - v.x_cnt) - position;
            let u = s - 1.42;
            let slips = smooth(u / 0.3) - smooth((u - 0.95) / 0.72);
            position += open * slips;
            torque += 14.5 * slips;
        }
        (torque, position)
    }
}

/// Engine torque on its way down from synchronous speed.
fn going_down(l: Launch, s: f64, from: f64) -> f64 {
    from + (CLOSING * l.base - from) * (s / 0.64).clamp(0.0, 1.0).powf(1.15)
}

/// Rises to 1 within `length`, fast at first.
fn ease(s: f64, length: f64) -> f64 {
    let z = (s / length).clamp(0.0, 1.0);
    z * (2.0 - z) * 0.55 + 0.45 * smooth(z)
}

/// A smooth rise within `length`, after a rest of a fifth of it.
fn rise(t: f64, length: f64, from: f64, to: f64) -> f64 {
    from + (to - from) * smooth((t - 0.06) / (length - 0.06))
}
