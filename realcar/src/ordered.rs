//! A further recording of a car, driven as somebody else commands.
//!
//! What is asked for is told by a function of time and of the speeds that are read, as a control unit is: the car and its sensors are all that is here.

use crate::car::{Motion, Outer, Start};
use crate::channels::{Bench, Pen, Recording, Steps};
use crate::draw::{Real, mix};
use crate::effects::{Deviation, STEP_S};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

/// What is ordered.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    /// Samples, and commands, per second.
    pub rate_hz: f64,
    /// Length, s.
    pub length_s: f64,
    /// Disc and body temperature at the start as they are noted, °C; the car is within 1.6 K of them.
    pub theta_deg_c: [f64; 2],
    /// Flywheel and disc speed at the start, rad/s.
    pub omega_rad_s: [f64; 2],
    /// Whether the bench's channels are recorded.
    pub bench: bool,
}

/// What is commanded for one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Asked {
    /// Engine torque, N·m.
    pub torque_nm: f64,
    /// Bearing position, mm.
    pub position_mm: f64,
    /// Whether the brake holds the disc.
    pub brake: bool,
}

/// Torque that the brake can hold, N·m.
const BRAKE_NM: f64 = 2000.0;
/// Housing air, °C.
const AIR: f64 = 25.0;

impl Real {
    /// Drives an order; `number` chooses noise and chance, `pilot` is told time and both speeds as they are read. What the effects were in the library's terms is
    /// added to `seen`.
    pub fn record(&self, order: &Order, number: u64, seen: &mut Deviation, mut pilot: impl FnMut(f64, f64, f64) -> Asked) -> Recording {
        let dt = 1.0 / order.rate_hz;
        let rows = (order.length_s * order.rate_hz).round() as usize;
        let mut rng = StdRng::seed_from_u64(mix(number, 0x0bde, rows));
        let theta = order.theta_deg_c.map(|t| t + rng.random_range(-1.6..1.6));
        let mut pen = Pen::new(self.noise(), Steps::BENCH, rng.random());
        let mut r = Recording {
            manoeuvre: "ordered",
            sample_rate_hz: order.rate_hz,
            theta_c0_deg_c: order.theta_deg_c[0],
            theta_b0_deg_c: order.theta_deg_c[1],
            bench: order.bench.then(Bench::default),
            ..Recording::default()
        };
        let [f, c] = order.omega_rad_s;
        let (mut read_f, mut read_c) = (pen.speed(f), pen.speed(c));
        let mut asked = pilot(0.0, read_f, read_c);
        let start = Start {
            omega: order.omega_rad_s,
            theta,
            air: AIR,
            torque: asked.torque_nm,
            position: asked.position_mm,
            length_s: order.length_s,
        };
        let mut car = Motion::start(&self.vehicle, &self.deviation, STEP_S, start, self.shown + number);
        let mut brake = Vec::with_capacity(rows);
        for row in 0..rows {
            let t = row as f64 * dt;
            if row > 0 {
                let [f, c] = car.sensed(dt);
                (read_f, read_c) = (pen.speed(f), pen.speed(c));
                asked = pilot(t, read_f, read_c);
            }
            r.time_s.push(t);
            r.omega_f_rad_s.push(read_f);
            r.omega_c_rad_s.push(read_c);
            r.t_e_nm.push(pen.torque(asked.torque_nm));
            // The command is sent as whole micrometres.
            let position = pen.command(asked.position_mm);
            r.x_to_cmd_mm.push(position);
            r.theta_h_deg_c.push(AIR);
            brake.push(asked.brake);
            if let Some(bench) = &mut r.bench {
                pen.bench(bench, car.x, car.t_fc, car.theta[0]);
            }
            car.outer = Outer { brake_nm: if asked.brake { BRAKE_NM } else { 0.0 }, ..Outer::default() };
            car.drive(dt, asked.torque_nm, position);
        }
        r.brake = brake.iter().any(|b| *b).then_some(brake);
        car.add_seen_to(seen);
        r
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::{Kind, Place, draw_car_of};

    const ORDER: Order = Order { rate_hz: 100.0, length_s: 2.0, theta_deg_c: [25.0, 25.0], omega_rad_s: [105.0, 0.0], bench: false };

    #[test]
    fn what_is_ordered_is_driven_and_drawn_again_alike() {
        let car = draw_car_of(Place::Bench, 3, 0, Kind::Healthy);
        let drive = |brake: bool, number: u64| {
            let asked = Asked { torque_nm: 30.0, position_mm: 6.0, brake };
            car.real.record(&ORDER, number, &mut Deviation::default(), |_, _, _| asked)
        };
        let (free, held) = (drive(false, 1), drive(true, 1));
        assert_eq!((free.time_s.len(), &free), (200, &drive(false, 1)));
        assert_ne!(free, drive(false, 2));
        assert!(free.brake.is_none() && *free.omega_c_rad_s.last().unwrap() > 10.0);
        assert!(held.brake.is_some() && held.omega_c_rad_s.iter().all(|w| w.abs() < 2.0));
    }

    #[test]
    fn what_came_nearest_in_the_library_is_told() {
        let car = draw_car_of(Place::Bench, 3, 0, Kind::Single("friction_level"));
        let mut seen = Deviation::default();
        car.real.record(&ORDER, 1, &mut seen, |_, _, _| Asked { torque_nm: 40.0, position_mm: 6.2, brake: false });
        let [_, _, _, (_, friction), ..] = seen.seen();
        let factor = friction.parameters()[0].1;
        assert!((factor - 1.0).abs() > 0.02, "{factor}");
    }
}
