//! Rehearsal: a manoeuvre driven with the simulated plant and recorded as a logger would, without noise.

use super::driver::Driver;
use super::manoeuvre::Manoeuvre;
use crate::campaign::Recording;
use crate::gap::model::replay::SUBSTEP_S;
use crate::gap::model::tolerance::Car;
use crate::plant::{Inputs, Plant, Start};
use crate::vehicle::Vehicle;

/// How a car is recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Logger {
    /// Samples per second.
    pub rate_hz: f64,
    /// Whether the bearing's position, the clutch torque, the disc temperature are measured.
    pub bench: [bool; 3],
    /// Standard deviations of the start temperatures, K: disc, body.
    pub theta_0_sigma: [f64; 2],
}

/// Housing air, °C.
const AIR: f64 = 25.0;
/// Gain of the brake that holds the disc: torque per disc speed, for a car of 1 kg·m², N·m per rad/s.
const HOLD: f64 = 20.0;

/// The recording of a manoeuvre driven with this car. `file` is the vehicle that the driver knows.
pub fn rehearse(what: &Manoeuvre, car: &Car, file: &Vehicle, logger: &Logger) -> Recording {
    let dt = 1.0 / logger.rate_hz;
    let rows = (what.seconds * logger.rate_hz).round() as usize;
    let mut driver = Driver::new(what, file, dt);
    let [omega_f, omega_c] = driver.start();
    let start = Start { omega_f, omega_c, theta_c: what.theta_c, theta_b: what.theta_b };
    let mut command = driver.command(0.0, omega_f, omega_c);
    let inputs = |t_e: f64, x_to: f64, t_load: f64| Inputs { x_to, t_e_ref: t_e, theta_h: AIR, t_load };
    let mut plant = Plant::new(&car.vehicle, &car.effects, &start, &inputs(command.t_e, command.x_to, 0.0));
    plant.set_max_substep(SUBSTEP_S.min(dt));
    let mut r = Recording {
        name: what.name.clone(),
        manoeuvre: what.name.clone(),
        sample_rate_hz: logger.rate_hz,
        theta_c0: what.theta_c,
        theta_b0: what.theta_b,
        theta_0_sigma: logger.theta_0_sigma,
        ..Recording::default()
    };
    let mut brake = Vec::with_capacity(rows);
    let mut bench: [Vec<f64>; 3] = Default::default();
    for row in 0..rows {
        let t = row as f64 * dt;
        let now = plant.outputs();
        if row > 0 {
            command = driver.command(t, now.omega_f, now.omega_c);
        }
        r.time.push(t);
        r.omega_f.push(now.omega_f);
        r.omega_c.push(now.omega_c);
        r.t_e.push(command.t_e);
        r.x_to_cmd.push(command.x_to);
        r.theta_h.push(AIR);
        brake.push(command.brake);
        bench.iter_mut().zip([now.x_to_actual, now.t_fc, now.theta_c]).for_each(|(b, v)| b.push(v));
        // The brake balances the clutch torque, and opposes the remaining speed.
        let parts = if command.brake { (dt / 1e-3).ceil().max(1.0) as usize } else { 1 };
        for _ in 0..parts {
            let held = if command.brake { brake_torque(&plant, car) } else { 0.0 };
            plant.step(&inputs(command.t_e, command.x_to, held), dt / parts as f64);
        }
    }
    let [x_to, t_fc, theta_c] = bench;
    let kept = |on: bool, v: Vec<f64>| on.then_some(v);
    (r.x_to, r.t_fc, r.theta_c) = (kept(logger.bench[0], x_to), kept(logger.bench[1], t_fc), kept(logger.bench[2], theta_c));
    r.brake = brake.iter().any(|b| *b).then_some(brake);
    r
}

fn brake_torque(plant: &Plant, car: &Car) -> f64 {
    let now = plant.outputs();
    now.t_fc + HOLD * car.vehicle.driveline.J_c * now.omega_c
}

#[cfg(test)]
mod tests {
    use super::super::manoeuvre::{Kind, built_in};
    use super::*;

    const LOGGER: Logger = Logger { rate_hz: 100.0, bench: [false; 3], theta_0_sigma: [1.0; 2] };

    /// With the nominal car, every manoeuvre does what its name says.
    #[test]
    fn manoeuvres_do_what_they_are_called() {
        let vehicle = Vehicle::paper();
        let car = Car::nominal(&vehicle);
        for m in built_in(&vehicle) {
            let r = rehearse(&m, &car, &vehicle, &LOGGER);
            assert!(r.omega_f.iter().chain(&r.omega_c).all(|w| w.is_finite() && *w > -10.0 && *w < 400.0), "{}", m.name);
            let last = r.time.len() - 1;
            let slip = |k: usize| r.omega_f[k] - r.omega_c[k];
            let locks = (0..=last).any(|k| slip(k).abs() < 0.1 && r.x_to_cmd[k] > vehicle.actuator.x_cls_0);
            let least = r.omega_f.iter().copied().fold(f64::INFINITY, f64::min);
            assert!(least > 40.0 || m.kind == Kind::TipIn, "{} stalls: {least}", m.name);
            match m.kind {
                Kind::Launch | Kind::Reengage => assert!(locks, "{} does not lock", m.name),
                Kind::TipIn => assert!((0..=last).all(|k| slip(k).abs() < 0.5), "{} slips", m.name),
                Kind::BrakedRamp | Kind::HeatAndRest => {
                    assert!(r.omega_c.iter().all(|w| w.abs() < 3.0), "{}: the brake does not hold", m.name);
                    assert!(r.brake.is_some());
                }
                Kind::CoastDown => assert!(r.omega_c[last] < r.omega_c[0]),
                _ => assert!((0..=last / 2).all(|k| slip(k) > 5.0 || m.kind == Kind::OpenRev), "{} meets early", m.name),
            }
        }
    }
}
