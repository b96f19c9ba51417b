//! Draws a car: its vehicle, its effects, its campaign, and recordings that the campaign does not hold.

use crate::bed::Bed;
use crate::car::{Motion, Start};
use crate::catalogue;
use crate::channels::{Noise, Recording};
use crate::effects::{Deviation, Dice};
use crate::fleet::Population;
use crate::street::Street;
use crate::vehicle::{Moves, Vehicle};
use rand::rngs::StdRng;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};

/// Where a car is recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Place {
    /// Short manoeuvres with temperatures known to 1 K; some with the channels of a bench.
    #[default]
    Bench,
    /// Drives, as a logger on the bus of a production car gives them.
    Road,
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
    /// Three effects of the library.
    Triple(&'static str, &'static str, &'static str),
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
    /// Whether it was drawn up after the diagnosis that it is to try.
    pub is_new: bool,
    /// Name and value of the parameters of a library's effect of this id that come nearest to it, where their meaning agrees.
    pub parameters: Vec<(&'static str, f64)>,
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

/// The car itself, to be driven again.
#[derive(Clone, Debug)]
pub struct Real {
    pub(crate) vehicle: Vehicle,
    pub(crate) moves: Moves,
    pub(crate) deviation: Deviation,
    pub(crate) noise_rad_s: f64,
    pub(crate) noise: Noise,
    /// Recordings of the campaign; those that it does not hold are counted on from there.
    pub(crate) shown: u64,
}

impl Real {
    /// Standard deviation of what the sensors add to a speed, their steps included, rad/s.
    pub fn noise_rad_s(&self) -> f64 {
        self.noise_rad_s
    }

    /// How far each number is from the file, in standard deviations of its tolerance.
    pub fn moves(&self) -> &[(&'static str, f64)] {
        &self.moves
    }

    /// What its sensors add to what they read.
    pub fn noise(&self) -> &Noise {
        &self.noise
    }

    /// The car at the start of the unseen recording of this number, as far as its files tell: temperatures as they are noted, no grade, and an
    /// engine that gives what it reports.
    pub fn at_start_of(&self, r: &Recording, number: u64) -> Motion {
        let start = Start {
            omega: [r.omega_f_rad_s[0], r.omega_c_rad_s[0]],
            theta: [r.theta_c0_deg_c, r.theta_b0_deg_c],
            air: r.theta_h_deg_c[0],
            torque: r.t_e_nm[0],
            position: r.x_to_cmd_mm[0],
            length_s: r.time_s.last().copied().unwrap_or(0.0),
        };
        Motion::start(&self.vehicle, &self.deviation, crate::street::STEP_S, start, self.shown + number)
    }
}

/// What remains of a bed once all is recorded.
pub(crate) struct Remains {
    pub vehicle_json: String,
    pub real: Vehicle,
    pub moves: Moves,
    pub noise_rad_s: f64,
    pub noise: Noise,
    pub shown: usize,
    pub seen: Deviation,
}

/// A car with its campaign, its truth, and what the campaign does not show.
#[derive(Clone, Debug)]
pub struct Car {
    /// What the diagnosis is handed.
    pub campaign: Campaign,
    /// Further recordings of the same car: two launches of other strengths and a creep, or two drives.
    pub unseen: Vec<Recording>,
    /// What was withheld.
    pub truth: Truth,
    /// The car itself.
    pub real: Real,
}

/// The car of this index: of twenty, 3 healthy, 8 with one effect (all in turn), 4 with two, 2 with three, 3 outside the library.
pub fn draw_car(place: Place, seed: u64, index: usize) -> Car {
    draw_car_of(place, seed, index, kind(place, seed, index))
}

/// The drives of a campaign, where they are not drawn.
#[derive(Clone, Copy, Debug, Default)]
pub struct Driven {
    /// How many.
    pub drives: Option<usize>,
    /// How long each is, s.
    pub length_s: Option<f64>,
}

/// The car of this index on the road, driven as long as this says: for what a long log costs.
pub fn draw_long(seed: u64, index: usize, driven: Driven) -> Car {
    drawn(Place::Road, seed, index, kind(Place::Road, seed, index), 1.0, Whose::Driven(driven))
}

/// The car of this index with an effect that was not drawn while the diagnosis was made: each in turn.
pub fn draw_new(place: Place, seed: u64, index: usize) -> Car {
    draw_car_of(place, seed, index, Kind::Outside(turn(seed, &catalogue::NEW, index)))
}

/// What the car of this index carries, unless told otherwise.
pub fn kind(place: Place, seed: u64, index: usize) -> Kind {
    let score = index / 20;
    let mut rng = StdRng::seed_from_u64(mix(seed, 0x5c0e, score));
    let mut places: Vec<usize> = (0..20).collect();
    for i in (1..20).rev() {
        places.swap(i, rng.random_range(0..=i));
    }
    let mut rng = StdRng::seed_from_u64(mix(seed, 0x1d, index));
    let library = catalogue::drawn(place);
    match places[index % 20] {
        0..3 => Kind::Healthy,
        p @ 3..11 => Kind::Single(turn(seed, &library, score * 8 + p - 3)),
        11..15 => {
            let [a, b] = apart(&mut rng, &library);
            Kind::Pair(a, b)
        }
        15..17 => {
            let [a, b, c] = apart(&mut rng, &library);
            Kind::Triple(a, b, c)
        }
        p => Kind::Outside(turn(seed, &catalogue::OUTSIDE, score * 3 + p - 17)),
    }
}

/// The car of this index with effects of this kind.
///
/// # Panics
/// If an id is not in the catalogue.
pub fn draw_car_of(place: Place, seed: u64, index: usize, kind: Kind) -> Car {
    draw_car_sized(place, seed, index, kind, 1.0)
}

/// As [`draw_car_of`], every magnitude scaled by `size`: at 0 the car is the healthy car of that index.
pub fn draw_car_sized(place: Place, seed: u64, index: usize, kind: Kind, size: f64) -> Car {
    drawn(place, seed, index, kind, size, Whose::Own)
}

/// What is not drawn for a car alone.
#[derive(Clone, Copy)]
pub(crate) enum Whose<'a> {
    /// Nothing.
    Own,
    /// What its fleet shares.
    Fleet(&'a Population),
    /// How many drives its campaign has, and how long they are.
    Driven(Driven),
}

/// A car by itself, or of a fleet.
pub(crate) fn drawn(place: Place, seed: u64, index: usize, kind: Kind, size: f64, whose: Whose) -> Car {
    let ids: &[&'static str] = match &kind {
        Kind::Healthy => &[],
        Kind::Single(a) | Kind::Outside(a) => std::slice::from_ref(a),
        Kind::Pair(a, b) => &[*a, *b],
        Kind::Triple(a, b, c) => &[*a, *b, *c],
    };
    // Cars differ in how much of an effect they have, beyond the effect's own range.
    let size = size * StdRng::seed_from_u64(mix(seed, 0x512e, index)).random_range(0.75..1.25);
    let mut deviation = Deviation::default();
    let mut effects: Vec<TrueEffect> = Vec::new();
    for id in ids {
        let (id, subsystem, in_library) = catalogue::find(id).unwrap_or_else(|| panic!("`{id}` is not in the catalogue"));
        let mut dice = Dice::new(mix(seed, hash(id), index), size);
        let shape = deviation.set(id, &mut dice);
        effects.push(TrueEffect {
            id,
            subsystem,
            in_library,
            is_new: catalogue::NEW.iter().any(|new| new.0 == id),
            parameters: Vec::new(),
            shape,
        });
    }
    let fleet = if let Whose::Fleet(population) = whose { Some(population) } else { None };
    let driven = if let Whose::Driven(driven) = whose { Some(driven) } else { None };
    let (mut all, mut bed) = match place {
        Place::Bench => Bed::draw(seed, index, ids, fleet).record(&deviation),
        Place::Road => Street::draw(seed, index).with(driven).record(&deviation),
    };
    for (subsystem, seen) in bed.seen.seen() {
        effects.iter_mut().filter(|e| e.in_library && e.subsystem == subsystem).for_each(|e| e.parameters = seen.parameters());
    }
    let unseen = all.split_off(bed.shown);
    let campaign = Campaign { vehicle_json: bed.vehicle_json, recordings: all };
    let moves = bed.moves;
    let real = Real { vehicle: bed.real, moves, deviation, noise_rad_s: bed.noise_rad_s, noise: bed.noise, shown: bed.shown as u64 };
    Car { campaign, unseen, truth: Truth { effects }, real }
}

/// Effects of different subsystems, of which each can be told beside the others.
fn apart<const N: usize>(rng: &mut StdRng, library: &[(&'static str, &'static str)]) -> [&'static str; N] {
    loop {
        let drawn: [_; N] = std::array::from_fn(|_| library.choose(rng).copied().unwrap_or(library[0]));
        let subsystems: std::collections::BTreeSet<_> = drawn.iter().map(|e| e.1).collect();
        // Where the heat goes is the faintest of all: beside another effect nobody could tell.
        if subsystems.len() == N && !subsystems.contains("thermal") {
            return drawn.map(|e| e.0);
        }
    }
}

/// The list in an order of the seed, round and round.
fn turn(seed: u64, list: &[(&'static str, &'static str)], n: usize) -> &'static str {
    let round = n / list.len();
    let mut rng = StdRng::seed_from_u64(mix(seed, 0x7a4, round));
    let mut order: Vec<usize> = (0..list.len()).collect();
    for i in (1..order.len()).rev() {
        order.swap(i, rng.random_range(0..=i));
    }
    list[order[n % list.len()]].0
}

/// A seed of its own for each purpose and car.
pub(crate) fn mix(seed: u64, purpose: u64, index: usize) -> u64 {
    let mut z = seed ^ purpose.wrapping_mul(0xd6e8_feb8_6659_fd93) ^ (index as u64).wrapping_mul(0xa076_1d64_78bd_642f);
    z = (z ^ (z >> 32)).wrapping_mul(0xe703_7ed1_a0b4_28db);
    z ^ (z >> 29)
}

fn hash(id: &str) -> u64 {
    id.bytes().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01b3))
}
