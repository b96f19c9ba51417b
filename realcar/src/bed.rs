//! Everything about a car but its effects: vehicle, controller, sensors, and what is driven with them.

use crate::car::{Motion, Start};
use crate::catalogue;
use crate::channels::{Bench, Noise, Pen, Recording, Steps};
use crate::draw::{Remains, mix};
use crate::effects::{Deviation, STEP_S};
use crate::fleet::Population;
use crate::manoeuvre::{self, Manoeuvre};
use crate::tcu::{Tcu, Tuning};
use crate::vehicle::{Moves, Vehicle};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

/// Everything about a car but its effects: the same for every kind of the same index, where the effects allow it.
pub(crate) struct Bed {
    file: Vehicle,
    real: Vehicle,
    moves: Moves,
    tuning: Tuning,
    noise: Noise,
    rate: f64,
    bench: bool,
    plan: Vec<(Manoeuvre, bool)>,
    unseen: Vec<(Manoeuvre, bool)>,
    rng: StdRng,
    pen_seed: u64,
    seen: Deviation,
}

impl Bed {
    pub(crate) fn draw(seed: u64, index: usize, ids: &[&str], fleet: Option<&Population>) -> Self {
        let mut rng = StdRng::seed_from_u64(mix(seed, 0xbed, index));
        let (file, (real, moves)) = match fleet {
            None => {
                let file = Vehicle::draw_type(&mut rng);
                let real = file.draw_real(&mut rng);
                (file, real)
            }
            Some(population) => {
                let file = Vehicle::draw_type(&mut StdRng::seed_from_u64(mix(seed, 0xf11e, 0)));
                let real = file.draw_real_about(&mut rng, |name| population.of(name));
                (file, real)
            }
        };
        let tuning = Tuning::draw(&mut rng);
        let noise = Noise::draw(&mut rng);
        let rate = [1000.0, 200.0, 50.0, 100.0][[0.17, 0.25, 0.33].iter().take_while(|edge| rng.random::<f64>() > **edge).count()];
        // A fast logger comes with a bench.
        let bench = rate > 500.0 || rng.random_bool(0.24);
        let alone = rng.random_bool(0.17) && ids.iter().all(|id| catalogue::shows_in_launches(id, bench));
        let hot_creep = rng.random_bool(0.45);
        let plan = plan(&mut rng, alone, hot_creep);
        let unseen = unseen(&mut rng);
        Self { file, real, moves, tuning, noise, rate, bench, plan, unseen, pen_seed: rng.random(), seen: Deviation::default(), rng }
    }

    pub(crate) fn record(mut self, deviation: &Deviation) -> (Vec<Recording>, Remains) {
        let jobs: Vec<_> = self.plan.iter().chain(&self.unseen).copied().collect();
        let mut all = Vec::new();
        for (k, (what, hot)) in jobs.into_iter().enumerate() {
            let (recording, mut car) = self.one(what, hot, deviation, k as u64);
            if k < self.plan.len() {
                car.add_seen_to(&mut self.seen);
            }
            all.push(recording);
        }
        let vehicle_json = crate::write::pretty(&self.file.to_json(None));
        let noise_rad_s = self.noise.speed.hypot(Steps::BENCH.speed / 12f64.sqrt());
        (
            all,
            Remains {
                vehicle_json,
                real: self.real,
                moves: self.moves,
                noise_rad_s,
                noise: self.noise,
                shown: self.plan.len(),
                seen: self.seen,
            },
        )
    }

    fn one(&mut self, what: Manoeuvre, hot: bool, deviation: &Deviation, k: u64) -> (Recording, Motion) {
        let alone_hot = matches!(what, Manoeuvre::Launch(l) if l.reopens && l.length_s > 5.8);
        let disc = match (hot, alone_hot) {
            (true, true) => self.rng.random_range(50.0..92.0),
            (true, false) => self.rng.random_range(86.0..140.0),
            _ => self.rng.random_range(18.0..45.0),
        };
        let body = 25.0 + 0.6 * (disc - 25.0) + self.rng.random_range(-0.5..1.5);
        let air = f64::from(self.rng.random_range(30..=80)) * 0.5;
        let noted = [disc, body].map(|theta: f64| {
            let z: f64 = self.rng.random_range(-1.6..1.6);
            ((theta + z) * 10.0).round() / 10.0
        });
        let setting = Setting { what, rate: self.rate, bench: self.bench, theta: [disc, body], noted, air };
        self.pen_seed = self.pen_seed.wrapping_add(0x9e37_79b9);
        let pen = Pen::new(&self.noise, Steps::BENCH, self.pen_seed);
        let tcu = Tcu::new(&self.file, &self.tuning, what, 1.0 / self.rate, noted);
        record(&self.real, deviation, setting, tcu, pen, k, STEP_S)
    }
}

/// The circumstances of one recording; temperatures in °C as they are and as they are noted, rate in Hz.
pub struct Setting {
    /// What is driven.
    pub what: Manoeuvre,
    /// Samples per second.
    pub rate: f64,
    /// Whether the bench's channels are recorded.
    pub bench: bool,
    /// Disc and body temperature.
    pub theta: [f64; 2],
    /// The same as the recording notes them.
    pub noted: [f64; 2],
    /// Housing air.
    pub air: f64,
}

/// Drives one recording with fine steps of `h` seconds, and returns the car as well.
pub fn record(real: &Vehicle, deviation: &Deviation, s: Setting, mut tcu: Tcu, mut pen: Pen, k: u64, h: f64) -> (Recording, Motion) {
    let dt = 1.0 / s.rate;
    let rows = (s.what.length_s() * s.rate).round() as usize;
    let omega = s.what.start_speeds();
    let mut r = Recording {
        manoeuvre: s.what.name(),
        sample_rate_hz: s.rate,
        theta_c0_deg_c: s.noted[0],
        theta_b0_deg_c: s.noted[1],
        bench: s.bench.then(Bench::default),
        ..Recording::default()
    };
    let (mut read_f, mut read_c) = (pen.speed(omega[0]), pen.speed(omega[1]));
    let (mut torque, mut position) = tcu.command(0.0, read_f, read_c);
    let start = Start { omega, theta: s.theta, air: s.air, torque, position, length_s: s.what.length_s() };
    let mut car = Motion::start(real, deviation, h, start, k);
    for row in 0..rows {
        let t = row as f64 * dt;
        if row > 0 {
            let [f, c] = car.sensed(dt);
            (read_f, read_c) = (pen.speed(f), pen.speed(c));
            (torque, position) = tcu.command(t, read_f, read_c);
        }
        r.time_s.push(t);
        r.omega_f_rad_s.push(read_f);
        r.omega_c_rad_s.push(read_c);
        r.t_e_nm.push(pen.torque(torque));
        r.x_to_cmd_mm.push(pen.command(position));
        r.theta_h_deg_c.push(s.air);
        if let Some(bench) = &mut r.bench {
            pen.bench(bench, car.x, car.t_fc, car.theta[0]);
        }
        car.drive(dt, torque, position);
    }
    (r, car)
}

fn plan(rng: &mut StdRng, alone: bool, hot_creep: bool) -> Vec<(Manoeuvre, bool)> {
    let launches = if alone { manoeuvre::LAUNCHES_ALONE } else { manoeuvre::LAUNCHES };
    let mut plan: Vec<_> = launches.iter().enumerate().map(|(i, l)| (Manoeuvre::Launch(l.vary(rng)), i > 2)).collect();
    let creep = creep(rng);
    let rev = Manoeuvre::OpenRev(rng.random_range(111.0..129.0), rng.random_range(61.0..90.0));
    let locked = Manoeuvre::LockedDrive(rng.random_range(91.0..118.0));
    if !alone {
        plan.extend([(creep, false), (rev, false), (Manoeuvre::Modulate, false), (locked, false)]);
        if hot_creep {
            plan.push((creep, true));
        }
    }
    plan
}

fn unseen(rng: &mut StdRng) -> Vec<(Manoeuvre, bool)> {
    let [soft, firm] = manoeuvre::LAUNCHES_UNSEEN;
    let hot = rng.random_bool(0.5);
    vec![(Manoeuvre::Launch(soft), hot), (Manoeuvre::Launch(firm), !hot), (creep(rng), rng.random_bool(0.5))]
}

fn creep(rng: &mut StdRng) -> Manoeuvre {
    Manoeuvre::Creep(rng.random_range(0.48..0.54), rng.random_range(1.45..1.6))
}
