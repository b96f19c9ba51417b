//! What is driven on the road: legs of stop and go, each with its launch, its locked driving and its braking.
//!
//! A leg stands, sets off (perhaps after creeping on a slipping clutch), drives locked through shifts of load, perhaps slips once more under
//! power, and brakes: to rest, or to a lower speed from which the clutch closes again while the car rolls.

use rand::rngs::StdRng;
use rand::{Rng, RngExt};

/// One leg of a drive; s, N·m, rad/s.
#[derive(Clone, Debug, PartialEq)]
pub struct Leg {
    /// Time at rest before it, s; none if the car still rolls.
    pub stand_s: Option<f64>,
    /// Time from the brake's release to the first movement of the clutch, s.
    pub pause_s: f64,
    /// Time to close the gap to the kiss point, s.
    pub fill_s: f64,
    /// Creeping before the launch: torque, N·m, and how long, s.
    pub creep: Option<(f64, f64)>,
    /// Torque to be transferred, N·m.
    pub torque: f64,
    /// Time in which it is built up, s.
    pub ramp_s: f64,
    /// Engine speed during the launch, rad/s.
    pub engine_rad_s: f64,
    /// Shifts of load while locked: how long, s, and engine torque, N·m.
    pub loads: Vec<(f64, f64)>,
    /// The load during which the clutch slips once more, and by how much, rad/s.
    pub slip_again: Option<(usize, f64)>,
    /// Rolling with the clutch open before braking, s.
    pub coast_s: f64,
    /// Disc speed below which the clutch opens in braking, rad/s; an early one opens at once.
    pub opens_below: f64,
    /// Torque of the brakes at the gearbox input, N·m.
    pub brake_nm: f64,
    /// How much the driver modulates it, and how fast, Hz.
    pub brake_swing: (f64, f64),
    /// Disc speed to which it brakes, rad/s; zero is to rest.
    pub down_to: f64,
}

impl Leg {
    /// Draws a leg; `rolls` if the car has not stopped.
    pub fn draw(rng: &mut StdRng, rolls: bool) -> Self {
        let creep = (!rolls && rng.random_bool(0.3)).then(|| (rng.random_range(7.0..15.0), rng.random_range(0.9..2.6)));
        let torque = rng.random_range(30.0f64..78.0);
        let loads: Vec<_> = (0..rng.random_range(1..5)).map(|_| load(rng)).collect();
        let slip_again = rng.random_bool(0.3).then(|| (rng.random_range(0..loads.len()), rng.random_range(14.0..34.0)));
        let early = rng.random_bool(0.45);
        let to_rest = rng.random_bool(0.78);
        Self {
            stand_s: (!rolls).then(|| rng.random_range(0.8..5.0)),
            pause_s: rng.random_range(0.05..0.5),
            fill_s: rng.random_range(0.14..0.3),
            creep,
            torque,
            ramp_s: rng.random_range(0.35..0.95),
            engine_rad_s: 108.0 + 0.55 * torque + rng.random_range(-6.0..18.0),
            loads,
            slip_again,
            coast_s: if rng.random_bool(0.3) { rng.random_range(0.4..2.2) } else { 0.0 },
            opens_below: if early { f64::INFINITY } else { rng.random_range(98.0..135.0) },
            brake_nm: rng.random_range(55.0..190.0),
            brake_swing: (rng.random_range(0.0..0.3), rng.random_range(0.3..1.1)),
            down_to: if to_rest { 0.0 } else { rng.random_range(35.0..95.0) },
        }
    }
}

/// A load while locked: most pull, some coast.
fn load(rng: &mut impl Rng) -> (f64, f64) {
    let torque = match rng.random_range(0..10) {
        0..2 => rng.random_range(-16.0..2.0),
        2..5 => rng.random_range(8.0..22.0),
        5..8 => rng.random_range(22.0..50.0),
        _ => rng.random_range(50.0..82.0),
    };
    // What pulls hard is over the sooner.
    let most = (62.0 / f64::max(torque, 12.0)).clamp(0.7, 3.2);
    (rng.random_range(0.45..1.0) * most, torque)
}

/// How a drive starts and how long it is.
#[derive(Clone, Copy, Debug)]
pub struct Drive {
    /// Length of the recording, s.
    pub length_s: f64,
    /// Whether the brake holds the car when the recording starts.
    pub held: bool,
    /// Seed of its legs.
    pub seed: u64,
}
