//! A fleet: cars of one type, whose numbers spread about another mean than the vehicle file has, and not by its tolerances.
//!
//! What is wrong with the file is wrong for all, so that it can be learned from many cars and from none alone. The population is withheld as an
//! effect is: it comes from the seed.

use crate::draw::{Car, Kind, Place, Whose, drawn, mix};
use crate::vehicle::TOLERANCES;
use rand::rngs::StdRng;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};

/// Share of cars that carry an effect.
const FAULTY: f64 = 0.12;

/// Effects that one car of a fleet may have, and that no tolerance stands for.
const EFFECTS: [&str; 4] = ["friction_fade", "actuator_lag", "cushion_hysteresis", "clutch_drag"];

/// How the numbers of a fleet's cars are distributed, in standard deviations of the file's tolerances.
#[derive(Clone, Debug, PartialEq)]
pub struct Population {
    /// Seed of the fleet, and of its type.
    pub seed: u64,
    /// Of each tolerance: mean and standard deviation.
    pub numbers: Vec<(&'static str, [f64; 2])>,
    /// The effect that some of its cars carry.
    pub effect: &'static str,
}

impl Population {
    /// The population of this seed: two numbers are off for all cars, one spreads twice as far as declared and one a third as far.
    pub fn draw(seed: u64) -> Self {
        let mut rng = StdRng::seed_from_u64(mix(seed, 0xf1ee7, 0));
        let mut order: Vec<usize> = (0..TOLERANCES.len()).collect();
        for i in (1..order.len()).rev() {
            order.swap(i, rng.random_range(0..=i));
        }
        let mut numbers: Vec<_> = TOLERANCES.iter().map(|name| (*name, [0.0, 1.0])).collect();
        for &k in &order[..2] {
            numbers[k].1[0] = rng.random_range(1.0..2.0) * if rng.random_bool(0.5) { 1.0 } else { -1.0 };
        }
        numbers[order[2]].1[1] = 2.0;
        numbers[order[3]].1[1] = 0.33;
        Self { seed, numbers, effect: EFFECTS.choose(&mut rng).copied().unwrap_or(EFFECTS[0]) }
    }

    /// Mean and standard deviation of a number.
    pub(crate) fn of(&self, name: &str) -> [f64; 2] {
        self.numbers.iter().find(|n| n.0 == name).map_or([0.0, 1.0], |n| n.1)
    }
}

/// The car of this index of a fleet, recorded on a bench.
pub fn draw_member(population: &Population, index: usize) -> Car {
    let faulty = StdRng::seed_from_u64(mix(population.seed, 0xfa17, index)).random_bool(FAULTY);
    let kind = if faulty { Kind::Single(population.effect) } else { Kind::Healthy };
    drawn(Place::Bench, population.seed, index, kind, 1.0, Whose::Fleet(population))
}
