//! Everything about a car on the road but its effects: vehicle and what is declared of it, driver, logger, drives.

use crate::car::{Motion, Outer, Start};
use crate::channels::{Noise, Pen, Recording, Steps};
use crate::draw::{Driven, Remains, mix};
use crate::drive::Drive;
use crate::driver::{Driver, Style, TICK_S};
use crate::effects::Deviation;
use crate::vehicle::{Declared, Moves, Vehicle};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};

/// The fine step on the road, s: drives are long.
pub(crate) const STEP_S: f64 = 1e-4;

/// One standard deviation of a control unit's own estimate of its clutch's temperatures after a soak, K.
const SOAK_SIGMA_K: f64 = 12.0;

/// How stamps come to jitter.
#[derive(Clone, Copy, Debug)]
enum Jitter {
    /// The control unit's task does, and the stamps say so.
    Task(f64),
    /// The bus is busy: what was true on the tick is stamped a little off it.
    Stamp(f64),
}

/// What one logger does to every recording of a car.
#[derive(Clone, Debug)]
struct Logger {
    noise: Noise,
    steps: Steps,
    /// One sample every so many ticks.
    every: usize,
    jitter: Jitter,
}

/// Everything about a car but its effects.
pub(crate) struct Street {
    file: Vehicle,
    declared: Declared,
    real: Vehicle,
    moves: Moves,
    style: Style,
    logger: Logger,
    drives: usize,
    /// Length of these drives, s, where it is not drawn.
    length_s: Option<f64>,
    rng: StdRng,
    seen: Deviation,
}

impl Street {
    pub(crate) fn draw(seed: u64, index: usize) -> Self {
        let mut rng = StdRng::seed_from_u64(mix(seed, 0x57ee7, index));
        let file = Vehicle::draw_type(&mut rng);
        let declared = Declared::draw(&mut rng);
        let (mut real, moves) = file.draw_real(&mut rng);
        real.latency_s = declared.draw_latency(&mut rng);
        let style = Style::draw(&mut rng);
        let noise = Noise { speed: rng.random_range(0.04..0.2), ..Noise::draw(&mut rng) };
        let every = if rng.random_bool(0.4) { 2 } else { 1 };
        let part = rng.random_range(0.01..0.06) * TICK_S * every as f64;
        let jitter = if rng.random_bool(0.6) { Jitter::Task(part) } else { Jitter::Stamp(part) };
        let logger = Logger { noise, steps: Steps::draw_bus(&mut rng), every, jitter };
        let drives = rng.random_range(2..=5);
        Self { file, declared, real, moves, style, logger, drives, length_s: None, rng, seen: Deviation::default() }
    }

    /// The same with so many drives in the campaign, and as long ones, where that is asked for.
    pub(crate) fn with(self, driven: Option<Driven>) -> Self {
        Self { drives: driven.and_then(|d| d.drives).unwrap_or(self.drives), length_s: driven.and_then(|d| d.length_s), ..self }
    }

    pub(crate) fn record(mut self, deviation: &Deviation) -> (Vec<Recording>, Remains) {
        let mut all = Vec::new();
        for k in 0..self.drives + 2 {
            let (recording, mut car) = self.one(k, deviation);
            if k < self.drives {
                car.add_seen_to(&mut self.seen);
            }
            all.push(recording);
        }
        let vehicle_json = crate::write::pretty(&self.file.to_json(Some(&self.declared)));
        let noise_rad_s = self.logger.noise.speed.hypot(self.logger.steps.speed / 12f64.sqrt());
        let moves = self.moves;
        (all, Remains { vehicle_json, real: self.real, moves, noise_rad_s, noise: self.logger.noise, shown: self.drives, seen: self.seen })
    }

    fn one(&mut self, k: usize, deviation: &Deviation) -> (Recording, Motion) {
        let rng = &mut self.rng;
        let drawn = rng.random_range(20.0..80.0);
        let length_s = self.length_s.filter(|_| k < self.drives).unwrap_or(drawn);
        let drive = Drive { length_s, held: rng.random_bool(0.6), seed: rng.random() };
        // Each second drive follows another one, and the first of them a hard one: what fades only when hot has its chance.
        let disc: f64 = match k {
            1 => rng.random_range(100.0..140.0),
            k if k % 2 == 1 => rng.random_range(65.0..130.0),
            _ => rng.random_range(12.0..48.0),
        };
        let body = 22.0 + 0.6 * (disc - 22.0) + rng.random_range(-6.0..6.0);
        let noted = [disc, body].map(|theta| {
            let z: f64 = StandardNormal.sample(rng);
            (theta + SOAK_SIGMA_K * z.clamp(-3.0, 3.0)).round()
        });
        let air = f64::from(rng.random_range(15..=55));
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let grade = self.declared.grade * normal().clamp(-3.0, 3.0);
        let wander = Wander { now: self.declared.wander_nm * normal(), declared: self.declared, rng: StdRng::seed_from_u64(rng.random()) };
        let pen = Pen::new(&self.logger.noise, self.logger.steps, rng.random());
        let driver = Driver::new(&self.file, &self.style, &drive, noted);
        let road = Road { drive, theta: [disc, body], noted, air, grade_nm: grade * self.file.weight_nm, wander };
        record(&self.real, deviation, road, driver, pen, &self.logger, k as u64)
    }
}

/// The slow error of the torque report: first-order Gauss–Markov, exact at the ticks and held between them.
struct Wander {
    now: f64,
    declared: Declared,
    rng: StdRng,
}

impl Wander {
    fn next(&mut self) -> f64 {
        let a = (-TICK_S / self.declared.wander_s).exp();
        let z: f64 = StandardNormal.sample(&mut self.rng);
        let was = self.now;
        self.now = a * was + self.declared.wander_nm * (1.0 - a * a).sqrt() * z;
        was
    }
}

/// The circumstances of one drive; °C, N·m.
struct Road {
    drive: Drive,
    theta: [f64; 2],
    noted: [f64; 2],
    air: f64,
    grade_nm: f64,
    wander: Wander,
}

fn record(
    real: &Vehicle,
    deviation: &Deviation,
    mut road: Road,
    mut driver: Driver,
    mut pen: Pen,
    logger: &Logger,
    k: u64,
) -> (Recording, Motion) {
    let mut r = Recording {
        manoeuvre: "drive",
        sample_rate_hz: 1.0 / (TICK_S * logger.every as f64),
        theta_c0_deg_c: road.noted[0],
        theta_b0_deg_c: road.noted[1],
        theta_sigma_k: Some([SOAK_SIGMA_K; 2]),
        brake: Some(Vec::new()),
        ..Recording::default()
    };
    let ticks = (road.drive.length_s / TICK_S) as usize;
    let omega = [driver.idle_rad_s(), 0.0];
    let (mut read_f, mut read_c) = (pen.speed(omega[0]), pen.speed(omega[1]));
    let mut command = driver.command(0.0, read_f, read_c);
    let start = Start {
        omega,
        theta: road.theta,
        air: road.air,
        torque: command.torque,
        position: command.position,
        length_s: road.drive.length_s,
    };
    let mut car = Motion::start(real, deviation, STEP_S, start, k);
    let mut now = 0.0;
    for tick in 0..ticks {
        if tick > 0 {
            let [f, c] = car.sensed(TICK_S);
            (read_f, read_c) = (pen.speed(f), pen.speed(c));
            command = driver.command(now, read_f, read_c);
        }
        if tick % logger.every == 0 {
            let off = match logger.jitter {
                Jitter::Stamp(most) if tick > 0 => pen.jitter(most),
                _ => 0.0,
            };
            r.time_s.push(now + off);
            r.omega_f_rad_s.push(read_f);
            r.omega_c_rad_s.push(read_c);
            r.t_e_nm.push(pen.torque(command.torque));
            r.x_to_cmd_mm.push(pen.command(command.position));
            r.theta_h_deg_c.push(road.air);
            r.brake.get_or_insert_default().push(command.brake);
        }
        let shift = match logger.jitter {
            Jitter::Task(most) => pen.jitter(most),
            Jitter::Stamp(_) => 0.0,
        };
        let next = ((tick + 1) as f64 * TICK_S + shift) / STEP_S;
        let next = next.round() * STEP_S;
        car.outer = Outer { grade_nm: road.grade_nm, wander_nm: road.wander.next(), brake_nm: command.brake_nm };
        car.drive(next - now, command.torque, command.position);
        now = next;
    }
    (r, car)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::Dice;

    /// Work of the engine is stored, turned to heat, or lost to road and brakes, over whole drives.
    #[test]
    fn a_drive_balances_its_energy() {
        for id in ["", "driveline_compliance", "clutch_drag"] {
            let mut deviation = Deviation::default();
            if !id.is_empty() {
                deviation.set(id, &mut Dice::new(9, 1.0));
            }
            let mut street = Street::draw(3, 1);
            let (r, car) = street.one(0, &deviation);
            let start = 0.5 * street.real.j_f * r.omega_f_rad_s[0].powi(2);
            let off = car.engine_j - (car.stored_j() - start) - car.heat_j - car.road_j;
            assert!(car.heat_j > 2000.0 && car.road_j > 2000.0, "{id}: {} J of heat", car.heat_j);
            assert!(off.abs() < 4e-3 * car.heat_j, "{id}: {off} J of {} J", car.heat_j);
        }
    }

    /// Disc, body and air take up the heat of the clutch.
    #[test]
    fn a_drive_warms_its_clutch() {
        let mut street = Street::draw(3, 1);
        let (r, car) = street.one(0, &Deviation::default());
        let hottest = car.heat_j / street.real.c_1;
        assert!(car.theta[0] > r.theta_c0_deg_c - 60.0 && car.theta[0] < r.theta_c0_deg_c + 60.0 + hottest, "{:?}", car.theta);
        assert!(car.theta.iter().all(|t| t.is_finite() && (-20.0..320.0).contains(t)), "{:?}", car.theta);
    }
}
