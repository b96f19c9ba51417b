//! The joint density of recordings and unknowns, from which everything else is derived.
//!
//! The unknowns are shared nuisances z (tolerances, timing of the logger), own unknowns of every recording (start temperatures, drift, grade), effect parameters p, and the
//! amplitudes of a missing law. Minus twice the logarithm of their joint density with the recordings is, up to a constant,
//!
//! ```text
//! Σ ρ(e) + Σ z² + Σ ((p − p_0)/s_p)² ,
//! ```
//!
//! where e are the whitened innovations of the corrected replay, ρ is Huber's loss, all nuisances are in units of their standard deviation, and p_0 and s_p are the null value of
//! an effect parameter and the size that it has in a noticeable effect. [`COUPLED_PRIORS`] and [`BENDS`] add terms that couple some of the parameters.

use super::belief::ByAccuracy;
use crate::effects::empirical::{CURVES, Curve};
use crate::effects::{self, PARAMETERS, Parameters, REGISTRY};
use crate::gap::model::course::Course;
use crate::gap::model::filter::Filter;
use crate::gap::model::replay::{self, Missing, Steps};
use crate::gap::model::tolerance::{Car, LATE_SIGMAS, Nuisance};
use crate::gap::model::track::Track;
use crate::gap::model::unknown_clutch::look_alike;
use crate::gap::progress::Work;
use crate::plant::config::Config;
use crate::vehicle::Vehicle;
use rayon::prelude::*;
use std::sync::{Arc, LazyLock};

/// Where Huber's loss turns linear, in standard deviations.
pub const HUBER: f64 = 4.0;

/// Shortest substep with which a plant is still replayed again and again, relative to that of the car as its file gives it. A plant with a shorter one is too expensive to replay,
/// and dynamics that settle ten times as fast are not visible.
const LEAST_SUBSTEP: f64 = 0.1;

/// Number of own unknowns of a recording that precede its own nuisances: the start temperatures of disc and body.
pub const TEMPERATURES: usize = 2;

/// Number of phases of the clutch.
pub const PHASES: usize = 3;

/// One for each phase of the clutch: open, slipping, locked.
pub type ByPhase<T> = [T; PHASES];

/// Powers of one: the full likelihood.
pub const WHOLE: ByPhase<f64> = [1.0; PHASES];

/// Recordings of one car with what the density needs: their filters, the vehicle, its nuisances, and the powers of the likelihood.
#[derive(Clone, Debug)]
pub struct Problem {
    /// Recordings.
    pub tracks: Vec<Track>,
    /// Their filters.
    pub filters: Vec<Filter>,
    /// Vehicle as its file gives it.
    pub vehicle: Vehicle,
    /// Nuisances that all recordings share.
    pub shared: Vec<Nuisance>,
    /// Nuisances that every recording has of its own.
    pub own: Vec<Nuisance>,
    /// States along the replays of the nominal car, by recording, state and observation: the variables on which the form of an effect may depend.
    pub states: Vec<Vec<Vec<f64>>>,
    /// Power of the likelihood in each phase of the clutch, for each accuracy that explanations may have; see [`belief`](super::belief).
    pub powers: ByAccuracy<ByPhase<f64>>,
    /// Work that replays have taken so far.
    pub work: Work,
}

/// A basis function of a missing law or of the form of an effect, one entry per recording.
pub type Function = Arc<[Missing]>;

/// Basis functions. Copies share their data, because there may be hundreds of functions, each as long as a drive.
pub type Basis = Vec<Function>;

/// A point in the space of unknowns.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Shared nuisances, in standard deviations.
    pub shared: Vec<f64>,
    /// Own unknowns of every recording, in standard deviations: temperatures, then nuisances.
    pub own: Vec<Vec<f64>>,
    /// Effect parameters.
    pub effects: Parameters,
    /// Amplitudes of the functions of a missing law, in standard deviations.
    pub missing: Vec<f64>,
}

impl Point {
    /// The same point with all parameters of one effect at their null values.
    pub fn without(&self, effect: usize) -> Self {
        let mut without = self.clone();
        REGISTRY[effect].parameters.clone().for_each(|k| without.effects[k] = PARAMETERS[k].null);
        without
    }
}

/// Whitened innovations of one recording.
pub type Residuals = Vec<f64>;

/// Reference point from which changes of the innovations of one recording are counted.
pub struct Baseline<'a> {
    point: &'a Point,
    basis: Option<&'a Basis>,
    /// The law that acts in the replay at this point.
    law: Option<Missing>,
    steps: Steps,
    /// Innovations at this point, without the contributions of functions that are linear in the innovations.
    driven: Residuals,
}

impl Problem {
    /// Phase of the clutch, counted from 0, at innovation `i` of recording `r`. Innovations are ordered as two speeds per observation, followed by the bench channels with one
    /// value per observation each.
    pub fn phase(&self, r: usize, i: usize) -> usize {
        let phase = &self.filters[r].phase;
        let n = phase.len();
        phase[if i < 2 * n { i / 2 } else { (i - 2 * n) % n }] as usize - 1
    }

    /// The recordings' part of the cost, phase by phase.
    pub fn misfits(&self, residuals: &[Residuals]) -> ByPhase<f64> {
        let mut sums = [0.0; PHASES];
        for (r, residuals) in residuals.iter().enumerate() {
            residuals.iter().enumerate().for_each(|(i, x)| sums[self.phase(r, i)] += huber(*x));
        }
        sums
    }

    /// The nominal car.
    pub fn nominal(&self) -> Point {
        Point {
            shared: vec![0.0; self.shared.len()],
            own: vec![vec![0.0; TEMPERATURES + self.own.len()]; self.tracks.len()],
            effects: effects::null(),
            missing: Vec::new(),
        }
    }

    /// The car at a point, with the own nuisances of recording `k`; without `k`, with the shared nuisances alone.
    pub fn car(&self, point: &Point, k: Option<usize>) -> Car {
        let mut car = Car { effects: point.effects, ..Car::nominal(&self.vehicle) };
        car.apply(&self.shared, &point.shared);
        if let Some(k) = k {
            car.apply(&self.own, &point.own[k][TEMPERATURES..]);
        }
        car
    }

    /// Start temperatures of recording `k` at a point, °C.
    pub fn temperatures(&self, point: &Point, k: usize) -> [f64; 2] {
        let track = &self.tracks[k];
        std::array::from_fn(|node| track.theta_0[node] + track.theta_0_sigma[node] * point.own[k][node])
    }

    /// Whether an effect makes a sensor no later than its declared latency allows, which is [`LATE_SIGMAS`] standard deviations. A delay within this range is worth less than the
    /// price of an effect; whatever an explanation gains beyond that comes from the form of the effect, which could not be distinguished from anything else.
    pub fn is_tolerated(&self, point: &Point, effect: usize) -> bool {
        let car = self.car(point, None);
        let amplitudes = REGISTRY[effect].effect.amplitudes;
        let late: f64 = amplitudes.iter().map(|&k| car.effects[k] - PARAMETERS[k].null).sum();
        let latencies = self.shared.iter().filter(|n| n.declared && n.one_sided).filter_map(|n| n.same_as(&car));
        latencies.into_iter().any(|(k, sigma)| amplitudes.contains(&k) && late < LATE_SIGMAS * sigma)
    }

    /// Whether the plant at a point is slow enough for replays. A wild step of a fit may lead to inertias or shafts that no car has.
    pub fn can_follow(&self, point: &Point) -> bool {
        let substep = |car: &Car| Config::new(&car.vehicle, &car.effects).pace.longest_substep(replay::SUBSTEP_S);
        substep(&self.car(point, None)) >= LEAST_SUBSTEP * substep(&Car::nominal(&self.vehicle))
    }

    /// Innovations of recording `k`.
    pub fn residuals(&self, k: usize, point: &Point, basis: Option<&Basis>) -> Residuals {
        self.replayed(k, point, basis, Steps::Rows)
    }

    fn replayed(&self, k: usize, point: &Point, basis: Option<&Basis>, steps: Steps) -> Residuals {
        let mut all = self.driven(k, point, basis.map(|b| driving(b, k, &point.missing)).as_ref(), steps);
        add_linear(&mut all, basis, k, |f| point.missing[f]);
        all
    }

    /// Innovations of recording `k` under a law that acts in the replay, without the contributions of functions that are linear in the innovations.
    fn driven(&self, k: usize, point: &Point, law: Option<&Missing>, steps: Steps) -> Residuals {
        let acts = law.filter(|l| !l.is_linear());
        let track = &self.tracks[k];
        self.work.add(if steps == Steps::Rows { track.rows() } else { track.observations() });
        replay::innovations_in(steps, track, &self.filters[k], &self.car(point, Some(k)), self.temperatures(point, k), acts)
    }

    /// Innovations of all recordings.
    pub fn all_residuals(&self, point: &Point, basis: Option<&Basis>) -> Vec<Residuals> {
        (0..self.tracks.len()).into_par_iter().map(|k| self.residuals(k, point, basis)).collect()
    }

    /// Steps with which recording `k` is replayed at a point if only differences between replays are used.
    fn steps(&self, k: usize, point: &Point) -> Steps {
        // A pulsating clutch torque varies within an observation.
        if self.tracks[k].averages() && !self.car(point, Some(k)).pulsates() { Steps::Observations } else { Steps::Rows }
    }

    /// Courses of the car at a point, without missing laws. With `like`, they have the same steps as the courses with which they will be compared.
    pub fn courses(&self, point: &Point, like: Option<&[Course]>) -> Vec<Course<'_>> {
        let one = |k: usize| self.course(k, point, like.map_or_else(|| self.steps(k, point), |all| all[k].steps));
        (0..self.tracks.len()).into_par_iter().map(one).collect()
    }

    fn course(&self, k: usize, point: &Point, steps: Steps) -> Course<'_> {
        let track = &self.tracks[k];
        self.work.add(if steps == Steps::Rows { track.rows() } else { track.observations() });
        Course::new(steps, track, &self.filters[k], &self.car(point, Some(k)), self.temperatures(point, k))
    }

    /// The reference point of [`Problem::change`] in recording `k`. `known` are the innovations at this point, if they have been computed before.
    pub fn baseline<'a>(&self, k: usize, point: &'a Point, basis: Option<&'a Basis>, known: Option<&Residuals>) -> Baseline<'a> {
        let steps = self.steps(k, point);
        let law = basis.map(|b| driving(b, k, &point.missing));
        let driven = match known.filter(|_| steps == Steps::Rows) {
            Some(known) => {
                let mut all = known.clone();
                add_linear(&mut all, basis, k, |f| -point.missing[f]);
                all
            }
            None => self.driven(k, point, law.as_ref(), steps),
        };
        Baseline { point, basis, law, steps, driven }
    }

    /// Change of the innovations of recording `k` from a baseline to a point with the same functions.
    pub fn change(&self, k: usize, from: &Baseline, to: &Point) -> Residuals {
        let law = from.basis.map(|b| driving(b, k, &to.missing));
        let mut change = self.change_driven(k, from, to, law.as_ref());
        add_linear(&mut change, from.basis, k, |f| to.missing[f] - from.point.missing[f]);
        change
    }

    /// Change of the innovations of recording `k` from a baseline if a further law acts.
    pub fn change_under(&self, k: usize, from: &Baseline, mut law: Missing) -> Residuals {
        if let Some(there) = &from.law {
            law.add(there, 1.0);
        }
        self.change_driven(k, from, from.point, Some(&law))
    }

    fn change_driven(&self, k: usize, from: &Baseline, to: &Point, law: Option<&Missing>) -> Residuals {
        // Where the clutch torque is unknown, a difference between cars that only this torque would show changes nothing.
        let hides = || look_alike(&self.car(from.point, Some(k)), &self.car(to, Some(k)));
        if self.tracks[k].position_free && law == from.law.as_ref() && hides() {
            return vec![0.0; from.driven.len()];
        }
        let difference = |there: Residuals, here: &Residuals| there.iter().zip(here).map(|(a, b)| a - b).collect();
        if from.steps == Steps::Observations && self.car(to, Some(k)).pulsates() {
            return difference(self.driven(k, to, law, Steps::Rows), &self.driven(k, from.point, from.law.as_ref(), Steps::Rows));
        }
        difference(self.driven(k, to, law, from.steps), &from.driven)
    }

    /// The same problem with recording `k` alone.
    pub fn of_recording(&self, k: usize) -> Self {
        Self {
            tracks: vec![self.tracks[k].clone()],
            filters: vec![self.filters[k].clone()],
            states: vec![self.states[k].clone()],
            vehicle: self.vehicle,
            shared: self.shared.clone(),
            own: self.own.clone(),
            powers: self.powers,
            work: self.work.clone(),
        }
    }

    /// Number of samples in all recordings.
    pub fn samples(&self) -> usize {
        self.filters.iter().map(|f| f.samples).sum()
    }
}

/// Sum of the functions that act in the replay of recording `k`, each times its amplitude.
fn driving(basis: &Basis, k: usize, amplitudes: &[f64]) -> Missing {
    let mut sum = Missing::default();
    for (function, a) in basis.iter().zip(amplitudes).filter(|(f, a)| **a != 0.0 && !f[k].is_linear()) {
        sum.add(&function[k], *a);
    }
    sum
}

/// Adds the functions that are linear in the innovations of recording `k`, each with its amplitude.
fn add_linear(all: &mut Residuals, basis: Option<&Basis>, k: usize, amplitude: impl Fn(usize) -> f64) {
    for (f, function) in basis.into_iter().flatten().enumerate().filter(|(_, function)| function[k].is_linear()) {
        let a = amplitude(f);
        if a != 0.0 {
            function[k].innovations.add_to(all, a);
        }
    }
}

/// Cost of residuals and priors: minus twice the logarithm of the density.
pub fn cost(point: &Point, residuals: &[Residuals]) -> f64 {
    misfit(residuals) + prior(point)
}

/// The recordings' part of the cost, Σ ρ(e).
pub fn misfit(residuals: &[Residuals]) -> f64 {
    residuals.iter().flatten().map(|r| huber(*r)).sum()
}

/// The priors' part of the cost.
pub fn prior(point: &Point) -> f64 {
    let square = |x: &f64| x * x;
    let nuisances: f64 = point.shared.iter().chain(point.own.iter().flatten()).chain(&point.missing).map(square).sum();
    let effects: f64 = (0..PARAMETERS.len()).map(|k| ((point.effects[k] - PARAMETERS[k].null) / size(k)).powi(2)).sum();
    let strains = COUPLED_PRIORS.iter().map(|t| t.strain(&point.effects).powi(2)).sum::<f64>();
    let bends = BENDS.iter().map(|b| b.strain(&point.effects).powi(2)).sum::<f64>();
    nuisances + effects + strains + bends
}

/// Size that effect parameter `k` has in a noticeable effect: the standard deviation of its prior.
pub fn size(k: usize) -> f64 {
    effects::owner(k).map_or(PARAMETERS[k].nominal, |entry| entry.scale(k))
}

/// Size of effect `e` in sizes of a noticeable one, by the amplitude that departs furthest from its null value.
pub fn sizes(point: &Point, e: usize) -> f64 {
    let departure = |&k: &usize| (point.effects[k] - PARAMETERS[k].null).abs() / size(k);
    REGISTRY[e].effect.amplitudes.iter().map(departure).fold(0.0, f64::max)
}

/// Prior that couples two parameters of an effect: the follower is expected to be a share of the leader.
#[derive(Clone, Copy, Debug)]
pub struct CoupledPrior {
    /// Index of the leading parameter.
    pub leader: usize,
    /// Index of the parameter that follows it.
    pub follower: usize,
    /// Expected ratio of the follower to the leader.
    pub share: f64,
    /// Standard deviation of the follower around this expectation.
    pub sigma: f64,
}

/// If the contact point moves, the clutch is worn or was adjusted, and its closed point moves in the same direction, by all, some or none of the distance. A closed point that
/// moved on its own would be a different stiffness.
pub const COUPLED_PRIORS: [CoupledPrior; 1] = [CoupledPrior {
    leader: effects::param::kiss_point_offset::offset,
    follower: effects::param::kiss_point_offset::closed_offset,
    share: 0.5,
    sigma: 0.05,
}];

impl CoupledPrior {
    /// Deviation of the follower from its expected value, in standard deviations.
    pub fn strain(&self, effects: &Parameters) -> f64 {
        (effects[self.follower] - self.share * effects[self.leader]) / self.sigma
    }
}

/// Prior standard deviation of the second differences of a learned curve from breakpoint to breakpoint, in units of the prior size of its values.
pub const BEND: f64 = 0.5;

/// Smoothness prior on one second difference of a learned curve.
#[derive(Clone, Copy, Debug)]
pub struct Bend {
    /// Parameter indices of three neighbouring values.
    values: [usize; 3],
    sigma: f64,
}

/// The smoothness priors of all learned curves.
pub static BENDS: LazyLock<Vec<Bend>> = LazyLock::new(|| {
    let of = |c: &'static Curve| {
        let all: Vec<usize> = c.parameters().collect();
        all.windows(3).map(|w| Bend { values: [w[0], w[1], w[2]], sigma: BEND * size(w[0]) }).collect::<Vec<_>>()
    };
    CURVES.iter().flat_map(of).collect()
});

impl Bend {
    /// The second difference, in standard deviations.
    pub fn strain(&self, effects: &Parameters) -> f64 {
        self.slopes().map(|(k, a)| a * effects[k]).sum()
    }

    /// Parameter index of each value with the derivative of the strain along it.
    pub fn slopes(&self) -> impl Iterator<Item = (usize, f64)> {
        self.values.into_iter().zip([1.0 / self.sigma, -2.0 / self.sigma, 1.0 / self.sigma])
    }
}

/// Huber's loss; r² near zero.
#[inline]
pub fn huber(r: f64) -> f64 {
    let a = r.abs();
    if a <= HUBER { r * r } else { HUBER * (2.0 * a - HUBER) }
}

/// Weight of a residual in the iteratively reweighted least squares that minimise [`huber`].
#[inline]
pub fn weight(r: f64) -> f64 {
    let a = r.abs();
    if a <= HUBER { 1.0 } else { HUBER / a }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::param;

    /// The loss is r² up to four standard deviations and its tangent beyond; a parabola with the weight as factor touches it.
    #[test]
    fn the_loss_turns_linear_at_four() {
        for (r, loss, factor) in [(0.0, 0.0, 1.0), (-3.0, 9.0, 1.0), (4.0, 16.0, 1.0), (5.0, 24.0, 0.8), (-10.0, 64.0, 0.4)] {
            assert!((huber(r) - loss).abs() < 1e-12 && (weight(r) - factor).abs() < 1e-12, "{r}: {} {}", huber(r), weight(r));
            let slope = (huber(r + 1e-6) - huber(r - 1e-6)) / 2e-6;
            assert!((slope - 2.0 * weight(r) * r).abs() < 1e-4);
        }
        assert!((misfit(&[vec![3.0, -10.0], vec![5.0]]) - 97.0).abs() < 1e-12);
    }

    #[test]
    fn a_prior_is_the_square_of_every_departure_in_its_own_unit() {
        let none = Point { shared: vec![1.0, -2.0], own: vec![vec![3.0], vec![0.5, 0.0]], effects: effects::null(), missing: vec![2.0] };
        assert!((prior(&none) - (1.0 + 4.0 + 9.0 + 0.25 + 4.0)).abs() < 1e-12);
        let of = |parameter: usize, sizes: f64| {
            let mut point = Point { shared: Vec::new(), own: Vec::new(), effects: effects::null(), missing: Vec::new() };
            point.effects[parameter] += sizes * size(parameter);
            prior(&point)
        };
        assert!((of(param::vehicle_mass::factor, -1.5) - 2.25).abs() < 1e-9 && (of(param::judder::sine, 2.0) - 4.0).abs() < 1e-9);
        // The closed point is expected to follow the contact point by half of its move, ± 0.05 mm.
        let mut moved = effects::null();
        (moved[COUPLED_PRIORS[0].leader], moved[COUPLED_PRIORS[0].follower]) = (0.3, 0.25);
        assert!((COUPLED_PRIORS[0].strain(&moved) - 2.0).abs() < 1e-9);
        let own = |p: usize| (moved[p] / size(p)).powi(2);
        let point = Point { shared: Vec::new(), own: Vec::new(), effects: moved, missing: Vec::new() };
        assert!((prior(&point) - own(COUPLED_PRIORS[0].leader) - own(COUPLED_PRIORS[0].follower) - 4.0).abs() < 1e-9);
        assert!((cost(&point, &[vec![2.0]]) - prior(&point) - 4.0).abs() < 1e-12);
    }

    /// A straight line has no second difference, whatever its slope; a kink of half the size of a value is one standard deviation.
    #[test]
    fn a_curve_pays_for_its_bends() {
        let bend = &BENDS[0];
        let [a, b, c] = bend.values;
        let mut line = effects::null();
        (line[a], line[b], line[c]) = (1.0, 3.0, 5.0);
        assert!(bend.strain(&line).abs() < 1e-12);
        line[c] += 0.5 * size(a);
        assert!((bend.strain(&line) - 1.0).abs() < 1e-9);
        line[b] += 0.5 * size(a);
        assert!((bend.strain(&line) + 1.0).abs() < 1e-9);
        for (k, slope) in bend.slopes() {
            let mut more = line;
            more[k] += 1.0;
            assert!((bend.strain(&more) - bend.strain(&line) - slope).abs() < 1e-9);
        }
    }
}
