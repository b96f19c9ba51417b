//! The motion of the real car.
//!
//! J_f ω̇_f = −b_f ω_f + T_e − T_fc and J_d ω̇_d = T_fc − T_s, with the shaft torque T_s passing to the vehicle behind it, or
//! the whole inertia at the disc if no shaft twists.
//!
//! There is no state of sticking. Each fine step asks for the impulse that would take the slip to zero at its end and
//! limits it to the torque capacity (a time-stepping contact law): while the impulse is within, the clutch sticks exactly,
//! else it slips. Everything else goes by semi-implicit Euler on the same step of 50 µs.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | ω_f, ω_d | flywheel and disc speed | rad/s |
//! | T_e, T_fc, T_s | engine, clutch and shaft torque | N·m |
//! | J_f, J_d | inertia of engine and disc side | kg·m² |

use crate::effects::Deviation;
use crate::effects::ring::Ring;
use crate::effects::thermal::Work;
use crate::map;
use crate::vehicle::Vehicle;

/// A car on the road.
#[derive(Clone, Debug)]
pub struct Motion {
    vehicle: Vehicle,
    deviation: Deviation,
    h: f64,
    /// Time since the start, s.
    pub t: f64,
    /// Flywheel speed, rad/s.
    pub omega_f: f64,
    /// Disc speed, rad/s.
    pub omega_d: f64,
    /// Speed of the vehicle at the gearbox input, rad/s.
    pub omega_v: f64,
    /// Bearing position, mm.
    pub x: f64,
    /// Clutch torque, N·m.
    pub t_fc: f64,
    /// Disc and body temperature, °C.
    pub theta: [f64; 2],
    /// Work of the engine since the start, J.
    pub engine_j: f64,
    /// Heat made in the clutch since the start, J.
    pub heat_j: f64,
    /// Work against engine friction, road, brakes and shaft damping since the start, J.
    pub road_j: f64,
    /// What acts on the car from outside now.
    pub outer: Outer,
    braked_nm: f64,
    late: [Ring; 2],
    heard: [f64; 2],
    crank: f64,
    turn: f64,
    vehicle_turn: f64,
    slip_angle: f64,
    twist: f64,
    air: f64,
}

/// What acts on the car beside its own commands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outer {
    /// Torque of the grade at the gearbox input, N·m.
    pub grade_nm: f64,
    /// What the engine gives beyond its report just now, N·m.
    pub wander_nm: f64,
    /// The most that the brakes hold at the gearbox input, N·m.
    pub brake_nm: f64,
}

/// How a recording starts.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    /// Flywheel and disc speed, rad/s.
    pub omega: [f64; 2],
    /// Disc and body temperature, °C.
    pub theta: [f64; 2],
    /// Housing air, °C.
    pub air: f64,
    /// First reported torque, N·m.
    pub torque: f64,
    /// First commanded position, mm.
    pub position: f64,
    /// Length of what is driven, s.
    pub length_s: f64,
}

impl Motion {
    /// The car at rest in its first commands. `recording` chooses what happens at random on the road.
    pub fn start(vehicle: &Vehicle, deviation: &Deviation, h: f64, start: Start, recording: u64) -> Self {
        let mut d = deviation.clone();
        let [omega_f, omega_d] = start.omega;
        d.engine.rest(start.torque, recording);
        d.actuator.rest(start.position, h, recording);
        d.force.rest(vehicle, start.position, start.theta[0]);
        d.friction.rest(recording);
        d.thermal.rest(start.theta[0], start.theta[1]);
        d.driveline.rest(omega_d, recording, start.length_s);
        d.sensors.rest(omega_f, omega_d, h, recording);
        let mut car = Self {
            vehicle: vehicle.clone(),
            deviation: d,
            h,
            t: 0.0,
            omega_f,
            omega_d,
            omega_v: omega_d,
            x: start.position,
            t_fc: 0.0,
            theta: start.theta,
            engine_j: 0.0,
            heat_j: 0.0,
            road_j: 0.0,
            outer: Outer::default(),
            braked_nm: 0.0,
            late: [0, 1].map(|k| Ring::full(start.omega[k], (vehicle.latency_s[k] / h) as usize + 1)),
            heard: start.omega,
            crank: 0.0,
            turn: 0.0,
            vehicle_turn: 0.0,
            slip_angle: 0.0,
            twist: 0.0,
            air: start.air,
        };
        car.wind_up(start.torque);
        car
    }

    /// A locked car that pulls has its shaft twisted already, as one that has been driving.
    fn wind_up(&mut self, torque: f64) {
        let Some(shaft) = self.deviation.driveline.shaft else {
            return;
        };
        if self.omega_f != self.omega_d || self.omega_f == 0.0 {
            return;
        }
        let jc = self.deviation.driveline.inertia(&self.vehicle);
        let net = torque - self.vehicle.b_f * self.omega_f - self.vehicle.t_l0 - self.vehicle.b_c * self.omega_f;
        let front = self.vehicle.j_f + shaft.disc_share * jc;
        let carried = net * (1.0 - front / (self.vehicle.j_f + jc)) + self.vehicle.t_l0;
        for _ in 0..50 {
            self.twist += (carried - shaft.spring(self.twist)) / shaft.k;
        }
    }

    /// Goes on for `seconds` with constant commands.
    pub fn drive(&mut self, seconds: f64, torque: f64, position: f64) {
        let steps = (seconds / self.h).round() as usize;
        for _ in 0..steps {
            self.step(torque, position);
        }
    }

    fn step(&mut self, reported: f64, command: f64) {
        let (h, v, d) = (self.h, &self.vehicle, &mut self.deviation);
        let engine = d.engine.step(h, self.t, reported, self.omega_f, self.crank) * v.engine_gain + v.engine_bias + self.outer.wander_nm;
        self.x = d.actuator.step(h, self.t, command, v.x_cnt);
        let (force, touching) = d.force.step(h, v, self.x, self.theta[0], self.crank);

        let slip = self.omega_f - self.omega_d;
        let facing = d.thermal.facing(self.theta[0]);
        let mut capacity = d.friction.drag(force, slip);
        if force > 0.0 {
            let factor = d.friction.factor(slip, facing, self.slip_angle, force);
            capacity += 2.0 * map::friction_radius_m(v, slip, facing) * force * factor;
        }

        let load = d.driveline.load(h, self.t, v, self.omega_v, self.vehicle_turn) + self.outer.grade_nm;
        let inertia = d.driveline.inertia(v);
        let mut braked_w = 0.0;
        let (j_d, behind, lost) = match d.driveline.shaft {
            None => (inertia, load, 0.0),
            Some(s) => {
                let rate = self.omega_d - self.omega_v;
                let torque = s.spring(self.twist) + s.damper(rate);
                let j_v = inertia * (1.0 - s.disc_share);
                let free = self.omega_v + h * (torque - load) / j_v;
                let braked = (free * j_v / h).clamp(-self.outer.brake_nm, self.outer.brake_nm);
                braked_w = braked * 0.5 * (self.omega_v + free - h * braked / j_v);
                self.omega_v = free - h * braked / j_v;
                (inertia * s.disc_share, torque, s.damper(rate) * rate)
            }
        };
        let friction_f = v.b_f * self.omega_f;

        // Speeds at the end of the step if the facings passed nothing, and the torque that would make them one.
        let free_f = self.omega_f + h * (engine - friction_f) / v.j_f;
        let free_d = self.omega_d - h * behind / j_d;
        let stick = |free_d: f64| ((free_f - free_d) / (h * (1.0 / v.j_f + 1.0 / j_d))).clamp(-capacity, capacity);
        let mut dry = stick(free_d);
        let mut braked = 0.0;
        if self.outer.brake_nm > 0.0 && d.driveline.shaft.is_none() {
            // Two dry contacts on one inertia: each asks in turn what the other leaves, until neither changes.
            braked = self.braked_nm;
            for _ in 0..60 {
                let was = (dry, braked);
                dry = stick(free_d - h * braked / j_d);
                braked = ((free_d + h * dry / j_d) * j_d / h).clamp(-self.outer.brake_nm, self.outer.brake_nm);
                if (dry - was.0).abs() + (braked - was.1).abs() < 1e-9 {
                    break;
                }
            }
        }
        self.braked_nm = braked;
        let before = [self.omega_f, self.omega_d];
        self.omega_f = free_f - h * dry / v.j_f;
        self.omega_d = free_d + h * (dry - braked) / j_d;
        self.t_fc = dry;

        // Work by the mean speed of the step, which balances the kinetic energy exactly.
        let mean = [0.5 * (before[0] + self.omega_f), 0.5 * (before[1] + self.omega_d)];
        let power = self.t_fc * (mean[0] - mean[1]);
        self.engine_j += h * engine * mean[0];
        self.heat_j += h * power;
        self.road_j += h
            * (friction_f * mean[0]
                + load * if d.driveline.shaft.is_some() { self.omega_v } else { mean[1] }
                + lost
                + braked * mean[1]
                + braked_w);
        d.friction.work(h, power);
        let rates = d.thermal.step(h, v, self.theta, Work { air: self.air, power_w: power, touching, speeds: mean });
        self.theta = [self.theta[0] + h * rates[0], self.theta[1] + h * rates[1]];

        if d.driveline.shaft.is_none() {
            self.omega_v = self.omega_d;
        } else {
            self.twist += h * (self.omega_d - self.omega_v);
        }
        self.crank += h * self.omega_f;
        self.turn += h * self.omega_d;
        self.vehicle_turn += h * self.omega_v;
        self.slip_angle += h * (self.omega_f - self.omega_d);
        self.t += h;
        d.sensors.step(h, self.omega_f, self.omega_d);
        self.heard = d.sensors.now();
        for (k, line) in self.late.iter_mut().enumerate().filter(|(k, _)| v.latency_s[*k] > 0.0) {
            self.heard[k] = line.step(self.heard[k], (v.latency_s[k] / h).round() as usize);
        }
    }

    /// What came nearest in the library, added to what other recordings saw.
    pub fn add_seen_to(&mut self, deviation: &mut Deviation) {
        for ((_, sum), (_, here)) in deviation.seen().into_iter().zip(self.deviation.seen()) {
            sum.add(here);
        }
    }

    /// Moves the speeds of flywheel and disc by so many rad/s: a replay that follows a recording.
    pub fn push(&mut self, [f, d]: [f64; 2]) {
        self.omega_f += f;
        self.omega_d += d;
        self.omega_v += d;
    }

    /// The speeds that the sensors give now, before noise.
    pub fn sensed(&mut self, dt: f64) -> [f64; 2] {
        let (t, turn, heard) = (self.t, self.turn, self.heard);
        self.deviation.sensors.sample(t, dt, turn, heard)
    }

    /// Kinetic and shaft energy, J.
    pub fn stored_j(&self) -> f64 {
        let jc = self.deviation.driveline.inertia(&self.vehicle);
        let kinetic = |j: f64, w: f64| 0.5 * j * w * w;
        kinetic(self.vehicle.j_f, self.omega_f)
            + match self.deviation.driveline.shaft {
                None => kinetic(jc, self.omega_d),
                Some(s) => {
                    kinetic(jc * s.disc_share, self.omega_d) + kinetic(jc * (1.0 - s.disc_share), self.omega_v) + s.stored_j(self.twist)
                }
            }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{Dice, STEP_S};

    const START: Start = Start { omega: [140.0, 0.0], theta: [40.0, 35.0], air: 25.0, torque: 40.0, position: 6.2, length_s: 4.0 };

    fn ride(deviation: &Deviation, h: f64) -> Motion {
        let v = Vehicle::reference();
        let mut car = Motion::start(&v, deviation, h, START, 0);
        car.drive(2.5, 55.0, 6.2);
        car.drive(1.0, 30.0, 7.6);
        car
    }

    #[test]
    fn engine_work_is_stored_or_lost() {
        let mut shaft = Deviation::default();
        shaft.set("driveline_compliance", &mut Dice::new(3, 1.0));
        for (deviation, part) in [(Deviation::default(), 1e-9), (shaft, 2e-3)] {
            let start = Motion::start(&Vehicle::reference(), &deviation, STEP_S, START, 0).stored_j();
            let car = ride(&deviation, STEP_S);
            let off = car.engine_j - (car.stored_j() - start) - car.heat_j - car.road_j;
            assert!(car.heat_j > 1000.0);
            assert!(off.abs() < part * car.engine_j, "{off} J of {} J", car.engine_j);
        }
    }

    #[test]
    fn disc_and_body_take_up_the_heat() {
        let mut v = Vehicle::reference();
        (v.gamma_2, v.t_l0) = (0.0, 3.1);
        let mut car = Motion::start(&v, &Deviation::default(), STEP_S, START, 0);
        car.drive(2.0, 55.0, 6.2);
        let taken = v.c_1 * (car.theta[0] - 40.0) + v.c_b * (car.theta[1] - 35.0);
        assert!((taken - car.heat_j).abs() < 1e-6 * car.heat_j, "{taken} J of {} J", car.heat_j);
    }

    #[test]
    fn a_finer_step_changes_nothing_that_a_sensor_sees() {
        let (coarse, fine) = (ride(&Deviation::default(), STEP_S), ride(&Deviation::default(), STEP_S / 8.0));
        assert!((coarse.omega_f - fine.omega_f).abs() < 0.01, "{} {}", coarse.omega_f, fine.omega_f);
        assert!((coarse.theta[0] - fine.theta[0]).abs() < 0.02);
    }

    #[test]
    fn a_closed_clutch_sticks_exactly_and_carries_its_share() {
        let car = ride(&Deviation::default(), STEP_S);
        assert!((car.omega_f - car.omega_d).abs() < 1e-10);
        let v = Vehicle::reference();
        let net = 30.0 - v.b_f * car.omega_f - v.t_l0 - v.b_c * car.omega_d - v.k_l * car.omega_d.powi(2);
        let share = 30.0 - v.b_f * car.omega_f - v.j_f * net / (v.j_f + v.j_c);
        assert!((car.t_fc - share).abs() < 0.01, "{} against {share}", car.t_fc);
    }
}
