//! What is to be explained, and what an explanation costs.
//!
//! The cost of a hypothesis is Σ ρ((y − ŷ)/σ) over channels and samples, plus the squares of the nuisances in units of
//! their tolerance. ρ is Huber's: square up to [`HUBER`] standard deviations, linear beyond, so that a lock-up a few samples early does
//! not outvote a whole recording.

use super::nuisance::{self, Nuisance};
use super::predict::{Follow, SUBSTEP_S, predict};
use super::series::{Channel, Series};
use crate::effects::{self, Parameters};
use crate::plant::config::Config;
use crate::vehicle::Vehicle;
use rayon::prelude::*;

/// Where Huber's loss turns linear, in standard deviations.
pub const HUBER: f64 = 5.0;

/// Standard deviation of the temperatures at the start of a recording, K; from the contract of the recordings.
pub const THETA_0_SIGMA_K: f64 = 1.0;

/// Substep in s below which a plant is too fast to be replayed again and again.
const LEAST_SUBSTEP_S: f64 = 2e-4;

/// What is fitted: the recordings of one car, and what is believed of it.
#[derive(Clone, Debug)]
pub struct Problem {
    /// Recordings.
    pub series: Vec<Series>,
    /// Vehicle as its file gives it.
    pub vehicle: Vehicle,
    /// Tolerances.
    pub nuisances: Vec<Nuisance>,
    /// How replays follow their recordings.
    pub follow: Follow,
}

/// A point in the space of nuisances, start temperatures and effect parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Nuisances, in standard deviations.
    pub z: Vec<f64>,
    /// Shifts of the start temperatures of disc and body per recording, K.
    pub theta_shift: Vec<[f64; 2]>,
    /// Effect parameters.
    pub effects: Parameters,
}

/// Weighted residuals of one recording, channel after channel.
pub type Residuals = Vec<f64>;

impl Problem {
    /// The nominal car.
    pub fn nominal(&self) -> Point {
        Point { z: vec![0.0; self.nuisances.len()], theta_shift: vec![[0.0; 2]; self.series.len()], effects: effects::null() }
    }

    /// Vehicle and effects at a point.
    pub fn plant_at(&self, point: &Point) -> (Vehicle, Parameters) {
        let (mut vehicle, mut effects) = (self.vehicle, point.effects);
        nuisance::apply(&self.nuisances, &point.z, &mut vehicle, &mut effects);
        (vehicle, effects)
    }

    /// Whether the plant there is slow enough for replays: a wild step may ask for inertias or shafts that no car has.
    pub fn can_follow(&self, point: &Point) -> bool {
        let (vehicle, effects) = self.plant_at(point);
        Config::new(&vehicle, &effects).pace.longest_substep(SUBSTEP_S) > LEAST_SUBSTEP_S
    }

    /// Residuals of recording `k`, in units of each channel's scale.
    pub fn residuals(&self, k: usize, point: &Point) -> Residuals {
        let (vehicle, effects) = self.plant_at(point);
        let series = &self.series[k];
        let predicted = predict(series, &vehicle, &effects, point.theta_shift[k], self.follow);
        let mut all = Vec::with_capacity(5 * series.len());
        for c in 0..5 {
            let jumps = |k: usize| c == Channel::TFc as usize && series.locking[k];
            let pairs = series.measured[c].iter().zip(&predicted.value[c]).enumerate();
            let errors = pairs.map(|(k, (y, p))| if jumps(k) { 0.0 } else { (y - p) / series.scale[c] });
            push_blocks(&mut all, errors, series.block);
        }
        all
    }

    /// Residuals of all recordings.
    pub fn all_residuals(&self, point: &Point) -> Vec<Residuals> {
        (0..self.series.len()).into_par_iter().map(|k| self.residuals(k, point)).collect()
    }

    /// Cost that noise alone is expected to have: that of the sensors, and that of the torque report, which the replay takes for torque and
    /// integrates over its memory while the clutch slips.
    pub fn noise_cost(&self) -> f64 {
        let of = |s: &Series, c: usize| (s.measured[c].len() / s.block) as f64 * (s.noise[c] / s.scale[c]).powi(2);
        let reported = |s: &Series| {
            let Follow::Horizon(seconds) = self.follow else { return 0.0 };
            let each = s.torque_noise * s.dt / self.vehicle.driveline.J_f;
            let integrated = each * each / (1.0 - (-2.0 * s.dt / seconds).exp());
            s.slipping * (s.measured[0].len() / s.block) as f64 * integrated / s.scale[0].powi(2)
        };
        self.series.iter().map(|s| reported(s) + (0..5).map(|c| of(s, c)).sum::<f64>()).sum()
    }

    /// Cost of residuals and priors.
    pub fn cost(&self, point: &Point, residuals: &[Residuals]) -> f64 {
        residuals.iter().flatten().map(|r| huber(*r)).sum::<f64>() + prior(point)
    }
}

/// Appends block sums divided by the root of the block's length, so that white noise keeps its variance.
fn push_blocks(all: &mut Vec<f64>, errors: impl Iterator<Item = f64>, block: usize) {
    let (mut sum, mut count) = (0.0, 0);
    for error in errors {
        sum += error;
        count += 1;
        if count == block {
            all.push(sum / (block as f64).sqrt());
            (sum, count) = (0.0, 0);
        }
    }
}

/// Cost of the nuisances and start temperatures, and of effect parameters that do not belong together.
pub fn prior(point: &Point) -> f64 {
    let temperatures = point.theta_shift.iter().flatten().map(|t| t / THETA_0_SIGMA_K);
    let strains = TOGETHER.iter().map(|t| t.strain(&point.effects));
    point.z.iter().copied().chain(temperatures).chain(strains).map(|x| x * x).sum()
}

/// Two parameters of an effect of which the second goes with the first, more or less.
pub(super) struct Together {
    pub(super) leader: usize,
    pub(super) follower: usize,
    pub(super) share: f64,
    pub(super) sigma: f64,
}

/// A clutch whose contact moves is worn or was adjusted, and its closed point moves the same way, by all, some or none of it. On its own it would
/// be another stiffness.
pub(super) const TOGETHER: [Together; 1] = [Together {
    leader: effects::param::kiss_point_offset::offset,
    follower: effects::param::kiss_point_offset::closed_offset,
    share: 0.5,
    sigma: 0.05,
}];

impl Together {
    /// How far apart they are, in standard deviations.
    pub(super) fn strain(&self, effects: &Parameters) -> f64 {
        (effects[self.follower] - self.share * effects[self.leader]) / self.sigma
    }
}

/// Huber's loss; r² near zero.
#[inline]
pub fn huber(r: f64) -> f64 {
    let a = r.abs();
    if a <= HUBER { r * r } else { HUBER * (2.0 * a - HUBER) }
}

/// Weight of a residual in the iteration that minimises [`huber`].
#[inline]
pub fn weight(r: f64) -> f64 {
    let a = r.abs();
    if a <= HUBER { 1.0 } else { HUBER / a }
}
