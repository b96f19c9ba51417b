//! Draws a car: its vehicle, its effects, its campaign, and recordings that the campaign does not hold.

use crate::car::{Motion, Start};
use crate::catalogue;
use crate::channels::{Bench, Noise, Pen, Recording};
use crate::effects::{Deviation, Dice, STEP_S};
use crate::manoeuvre::{self, Manoeuvre};
use crate::tcu::{Tcu, Tuning};
use crate::vehicle::Vehicle;
use rand::rngs::StdRng;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};

/// How many cars, and which.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Seed of the whole draw.
    pub seed: u64,
    /// Number of cars.
    pub cars: usize,
}

/// What a car carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Nothing beyond the tolerances.
    Healthy,
    /// One effect of the library.
    Single(&'static str),
    /// Two effects of the library.
    Pair(&'static str, &'static str),
    /// One effect that no library holds.
    Outside(&'static str),
}

/// One effect of a car.
#[derive(Clone, Debug, PartialEq)]
pub struct TrueEffect {
    /// Its id.
    pub id: &'static str,
    /// Where it acts.
    pub subsystem: &'static str,
    /// Whether the library holds it.
    pub in_library: bool,
    /// The shape and magnitude that it took, for people.
    pub shape: String,
}

/// The answer: what was withheld.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Truth {
    /// The effects; none in a healthy car.
    pub effects: Vec<TrueEffect>,
}

/// What the diagnosis is handed.
#[derive(Clone, Debug, PartialEq)]
pub struct Campaign {
    /// The vehicle file: what the engineer believes.
    pub vehicle_json: String,
    /// The recordings, in the order of their files.
    pub recordings: Vec<Recording>,
}

/// A car with its campaign, its truth, and what the campaign does not show.
#[derive(Clone, Debug, PartialEq)]
pub struct Car {
    /// What the diagnosis is handed.
    pub campaign: Campaign,
    /// Three further recordings of the same car: two launches of other strengths and a creep.
    pub unseen: Vec<Recording>,
    /// What was withheld.
    pub truth: Truth,
}

/// All cars of a draw, one after the other.
pub fn draw(settings: Settings) -> impl Iterator<Item = Car> {
    (0..settings.cars).map(move |index| draw_car(settings.seed, index))
}

/// The car of this index: 15 % healthy, 50 % with one effect (all in turn), 20 % with two, 15 % outside the library.
pub fn draw_car(seed: u64, index: usize) -> Car {
    draw_car_of(seed, index, kind(seed, index))
}

/// What the car of this index carries, unless told otherwise.
pub fn kind(seed: u64, index: usize) -> Kind {
    // Each score of cars holds 3 healthy, 10 singles, 4 pairs and 3 others, in an order of its own.
    let score = index / 20;
    let mut rng = StdRng::seed_from_u64(mix(seed, 0x5c0e, score));
    let mut places: Vec<usize> = (0..20).collect();
    for i in (1..20).rev() {
        places.swap(i, rng.random_range(0..=i));
    }
    let mut rng = StdRng::seed_from_u64(mix(seed, 0x1d, index));
    match places[index % 20] {
        0..3 => Kind::Healthy,
        p @ 3..13 => Kind::Single(turn(seed, &catalogue::LIBRARY, score * 10 + p - 3)),
        13..17 => pair(&mut rng),
        p => Kind::Outside(turn(seed, &catalogue::OUTSIDE, score * 3 + p - 17)),
    }
}

/// The car of this index with effects of this kind.
///
/// # Panics
/// If an id is not in the catalogue.
pub fn draw_car_of(seed: u64, index: usize, kind: Kind) -> Car {
    draw_car_sized(seed, index, kind, 1.0)
}

/// As [`draw_car_of`], every magnitude scaled by `size`: at 0 the car is the healthy car of that index.
pub fn draw_car_sized(seed: u64, index: usize, kind: Kind, size: f64) -> Car {
    let ids: &[&'static str] = match &kind {
        Kind::Healthy => &[],
        Kind::Single(a) | Kind::Outside(a) => std::slice::from_ref(a),
        Kind::Pair(a, b) => &[*a, *b],
    };
    let mut deviation = Deviation::default();
    let mut effects = Vec::new();
    for id in ids {
        let (id, subsystem, in_library) = catalogue::find(id).unwrap_or_else(|| panic!("`{id}` is not in the catalogue"));
        let mut dice = Dice::new(mix(seed, hash(id), index), size);
        let shape = deviation.set(id, &mut dice);
        effects.push(TrueEffect { id, subsystem, in_library, shape });
    }
    let (campaign, unseen) = Bed::draw(seed, index, ids).record(&deviation);
    Car { campaign, unseen, truth: Truth { effects } }
}

/// Everything about a car but its effects: the same for every kind of the same index, where the effects allow it.
struct Bed {
    file: Vehicle,
    real: Vehicle,
    tuning: Tuning,
    noise: Noise,
    rate: f64,
    bench: bool,
    plan: Vec<(Manoeuvre, bool)>,
    unseen: Vec<(Manoeuvre, bool)>,
    rng: StdRng,
    pen_seed: u64,
}

impl Bed {
    fn draw(seed: u64, index: usize, ids: &[&str]) -> Self {
        let mut rng = StdRng::seed_from_u64(mix(seed, 0xbed, index));
        let file = Vehicle::draw_type(&mut rng);
        let real = file.draw_real(&mut rng);
        let tuning = Tuning::draw(&mut rng);
        let noise = Noise::draw(&mut rng);
        let rate = if rng.random_bool(0.17) { 1000.0 } else { 100.0 };
        // A fast logger comes with a bench.
        let bench = rate > 500.0 || rng.random_bool(0.24);
        let alone = rng.random_bool(0.17) && ids.iter().all(|id| catalogue::shows_in_launches(id, bench));
        let hot_creep = rng.random_bool(0.45);
        let plan = plan(&mut rng, alone, hot_creep);
        let unseen = unseen(&mut rng);
        Self { file, real, tuning, noise, rate, bench, plan, unseen, pen_seed: rng.random(), rng }
    }

    fn record(mut self, deviation: &Deviation) -> (Campaign, Vec<Recording>) {
        let jobs: Vec<_> = self.plan.iter().chain(&self.unseen).copied().collect();
        let mut all: Vec<_> = jobs.into_iter().enumerate().map(|(k, (what, hot))| self.one(what, hot, deviation, k as u64)).collect();
        let unseen = all.split_off(self.plan.len());
        let vehicle_json = crate::write::pretty(&self.file.to_json());
        (Campaign { vehicle_json, recordings: all }, unseen)
    }

    fn one(&mut self, what: Manoeuvre, hot: bool, deviation: &Deviation, k: u64) -> Recording {
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
        let pen = Pen::new(&self.noise, self.pen_seed);
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

/// Drives one recording with fine steps of `h` seconds.
pub fn record(real: &Vehicle, deviation: &Deviation, s: Setting, mut tcu: Tcu, mut pen: Pen, k: u64, h: f64) -> Recording {
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
    let start = Start { omega, theta: s.theta, air: s.air, torque, position };
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
    r
}

fn plan(rng: &mut StdRng, alone: bool, hot_creep: bool) -> Vec<(Manoeuvre, bool)> {
    let launches = if alone { manoeuvre::LAUNCHES_ALONE } else { manoeuvre::LAUNCHES };
    let mut plan: Vec<_> = launches.iter().enumerate().map(|(i, l)| (Manoeuvre::Launch(*l), i > 2)).collect();
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

/// Two effects of different subsystems, of which each can be told beside the other.
fn pair(rng: &mut StdRng) -> Kind {
    loop {
        let (a, in_a) = catalogue::LIBRARY[rng.random_range(0..24)];
        let (b, in_b) = *catalogue::LIBRARY.choose(rng).unwrap_or(&catalogue::LIBRARY[0]);
        // Where the heat goes is the faintest of all: beside another effect nobody could tell.
        if in_a != in_b && in_a != "thermal" && in_b != "thermal" {
            return Kind::Pair(a, b);
        }
    }
}

/// The list in an order of the seed, round and round.
fn turn(seed: u64, list: &'static [(&'static str, &'static str)], n: usize) -> &'static str {
    let round = n / list.len();
    let mut rng = StdRng::seed_from_u64(mix(seed, 0x7a4, round));
    let mut order: Vec<usize> = (0..list.len()).collect();
    for i in (1..order.len()).rev() {
        order.swap(i, rng.random_range(0..=i));
    }
    list[order[n % list.len()]].0
}

/// A seed of its own for each purpose and car.
fn mix(seed: u64, purpose: u64, index: usize) -> u64 {
    let mut z = seed ^ purpose.wrapping_mul(0xd6e8_feb8_6659_fd93) ^ (index as u64).wrapping_mul(0xa076_1d64_78bd_642f);
    z = (z ^ (z >> 32)).wrapping_mul(0xe703_7ed1_a0b4_28db);
    z ^ (z >> 29)
}

fn hash(id: &str) -> u64 {
    id.bytes().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01b3))
}
