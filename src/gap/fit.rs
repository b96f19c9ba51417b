//! Least squares over short-horizon predictions, with tolerances and start temperatures as priors.
//!
//! The cost of a hypothesis is Σ ρ((y − ŷ)/σ) over channels and samples, plus the squares of the nuisances in units of
//! their tolerance. ρ is Huber's: square up to [`HUBER`] standard deviations, linear beyond, so that a lock-up a few samples early does
//! not outvote a whole recording. Levenberg–Marquardt; derivatives are finite differences of whole replays.

use super::nuisance::{self, Nuisance};
use super::predict::{Follow, SUBSTEP_S, predict};
use super::series::{Channel, Series};
use crate::effects::{self, PARAMETERS, Parameters, REGISTRY};
use crate::plant::config::Config;
use crate::vehicle::Vehicle;
use nalgebra::{DMatrix, DVector};
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
struct Together {
    leader: usize,
    follower: usize,
    share: f64,
    sigma: f64,
}

/// A clutch whose contact moves is worn or was adjusted, and its closed point moves the same way, by all, some or none of it. On its own it would
/// be another stiffness.
const TOGETHER: [Together; 1] = [Together {
    leader: effects::param::kiss_point_offset::offset,
    follower: effects::param::kiss_point_offset::closed_offset,
    share: 0.5,
    sigma: 0.05,
}];

impl Together {
    /// How far apart they are, in standard deviations.
    fn strain(&self, effects: &Parameters) -> f64 {
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

/// One free coordinate of a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coordinate {
    /// Nuisance k.
    Nuisance(usize),
    /// Start temperature of a recording: of the disc (0) or the body (1).
    Theta(usize, usize),
    /// Effect parameter k.
    Effect(usize),
}

impl Coordinate {
    /// Step of a finite difference, in the coordinate's unit.
    pub fn step(self) -> f64 {
        match self {
            Self::Nuisance(_) => 0.1,
            Self::Theta(..) => 0.1,
            Self::Effect(k) => 0.01 * effects::owner(k).scale(k),
        }
    }
    fn slot(self, point: &mut Point) -> &mut f64 {
        match self {
            Self::Nuisance(k) => &mut point.z[k],
            Self::Theta(k, node) => &mut point.theta_shift[k][node],
            Self::Effect(k) => &mut point.effects[k],
        }
    }
    /// Value at a point.
    pub fn get(self, point: &Point) -> f64 {
        match self {
            Self::Nuisance(k) => point.z[k],
            Self::Theta(k, node) => point.theta_shift[k][node],
            Self::Effect(k) => point.effects[k],
        }
    }
    /// Whether the parameter is a factor on a number. A factor and the relative tolerance of the same number move by their logarithms, so that
    /// the valley in which only their product counts is straight.
    fn is_factor(self) -> bool {
        matches!(self, Self::Effect(k) if PARAMETERS[k].null == 1.0 && effects::owner(k).effect.amplitudes.contains(&k))
    }
    /// Moves a point, within the bounds of effect parameters.
    pub fn moved(self, point: &Point, by: f64) -> Point {
        let factor = self.is_factor();
        let mut moved = point.clone();
        let slot = self.slot(&mut moved);
        *slot = if factor && *slot > 0.0 { *slot * (by / *slot).exp() } else { *slot + by };
        if let Self::Effect(k) = self {
            *slot = slot.clamp(PARAMETERS[k].min, PARAMETERS[k].max);
        }
        moved
    }
    /// How much of a move the bounds leave.
    fn room(self, point: &Point, by: f64) -> f64 {
        let Self::Effect(k) = self else { return by };
        let (from, to) = (self.get(point), self.get(&self.moved(point, by)));
        match to == PARAMETERS[k].min || to == PARAMETERS[k].max {
            false => by,
            true if self.is_factor() && from > 0.0 && to > 0.0 => from * (to / from).ln(),
            true => to - from,
        }
    }
    /// Precision that the prior gives, 1/variance.
    fn precision(self) -> f64 {
        match self {
            Self::Nuisance(_) => 1.0,
            Self::Theta(..) => 1.0 / (THETA_0_SIGMA_K * THETA_0_SIGMA_K),
            // Wide: an effect may be ten times its nominal size; this keeps shapes that do nothing where they are.
            Self::Effect(k) => 1.0 / (10.0 * effects::owner(k).scale(k)).powi(2),
        }
    }
    /// Curvature of one unit step: a tolerance, or the size of a noticeable effect.
    fn unit(self) -> f64 {
        if let Self::Effect(_) = self { 100.0 * self.precision() } else { self.precision() }
    }
    fn touches(self, recording: usize) -> bool {
        !matches!(self, Self::Theta(k, _) if k != recording)
    }
}

/// Free coordinates of a hypothesis that holds the effects (indices in the registry).
pub fn coordinates(problem: &Problem, effects: &[usize]) -> Vec<Coordinate> {
    let nuisances = (0..problem.nuisances.len()).map(Coordinate::Nuisance);
    let thetas = (0..problem.series.len()).flat_map(|k| [Coordinate::Theta(k, 0), Coordinate::Theta(k, 1)]);
    let of_effects = effects.iter().flat_map(|&e| REGISTRY[e].parameters.clone()).map(Coordinate::Effect);
    nuisances.chain(thetas).chain(of_effects).collect()
}

/// Derivatives of one recording's residuals: the coordinates that touch it, by their place, and a column for each.
#[derive(Clone, Debug)]
pub struct Columns {
    /// Places of the coordinates, ascending.
    pub places: Vec<usize>,
    /// Residuals by coordinates.
    pub matrix: DMatrix<f64>,
}

/// Derivatives of every recording's residuals along `coordinates`, as finite differences of whole replays. Columns that are `known` are
/// taken over, but those of effects. A tolerance that moves the same number as a free effect has that effect's column: differences of their own
/// would hide the valley between the two.
pub fn derivatives(
    problem: &Problem,
    point: &Point,
    residuals: &[Residuals],
    coordinates: &[Coordinate],
    known: Option<&[Columns]>,
) -> Vec<Columns> {
    let (vehicle, _) = problem.plant_at(point);
    let shared = |c: Coordinate| {
        let Coordinate::Nuisance(k) = c else { return None };
        let (parameter, rate) = problem.nuisances[k].same_as(&vehicle, &point.effects)?;
        let place = coordinates.iter().position(|c| *c == Coordinate::Effect(parameter))?;
        Some((place, rate))
    };
    let taken_over = |r: usize, place: usize| {
        let known = &known?[r];
        let k = known.places.iter().position(|&p| p == place)?;
        (!matches!(coordinates[place], Coordinate::Effect(_))).then(|| known.matrix.column(k))
    };
    let is_fresh = |r: usize, c: usize| shared(coordinates[c]).is_none() && taken_over(r, c).is_none();
    let tasks: Vec<(usize, usize)> = (0..problem.series.len())
        .flat_map(|r| (0..coordinates.len()).map(move |c| (r, c)))
        .filter(|&(r, c)| coordinates[c].touches(r) && is_fresh(r, c))
        .collect();
    let fresh: Vec<Vec<f64>> = tasks.par_iter().map(|&(r, c)| derivative(problem, point, r, &residuals[r], coordinates[c])).collect();
    let mut fresh = fresh.into_iter();
    let assembled = |r: usize| {
        let places: Vec<usize> = (0..coordinates.len()).filter(|&c| coordinates[c].touches(r)).collect();
        let mut matrix = DMatrix::zeros(residuals[r].len(), places.len());
        for (k, &place) in places.iter().enumerate() {
            if is_fresh(r, place) {
                matrix.column_mut(k).copy_from_slice(&fresh.next().expect("one for each task, in the same order"));
            } else if let Some(column) = taken_over(r, place) {
                matrix.set_column(k, &column);
            }
        }
        for (k, &place) in places.iter().enumerate() {
            if let Some((other, rate)) = shared(coordinates[place]) {
                let column = matrix.column(places.partition_point(|&p| p < other)) * rate;
                matrix.set_column(k, &column);
            }
        }
        Columns { places, matrix }
    };
    (0..problem.series.len()).map(assembled).collect()
}

fn derivative(problem: &Problem, point: &Point, recording: usize, residuals: &Residuals, coordinate: Coordinate) -> Vec<f64> {
    let mut moved = coordinate.moved(point, coordinate.step());
    let mut step = coordinate.get(&moved) - coordinate.get(point);
    if step.abs() < 0.5 * coordinate.step() {
        moved = coordinate.moved(point, -coordinate.step());
        step = coordinate.get(&moved) - coordinate.get(point);
    }
    let there = problem.residuals(recording, &moved);
    there.iter().zip(residuals).map(|(a, b)| (a - b) / step).collect()
}

/// Normal equations of one linearised step: curvature and gradient of half the cost.
pub fn normal_equations(
    point: &Point,
    residuals: &[Residuals],
    columns: &[Columns],
    coordinates: &[Coordinate],
) -> (DMatrix<f64>, DVector<f64>) {
    let n = coordinates.len();
    let mut curvature = DMatrix::zeros(n, n);
    let mut gradient = DVector::zeros(n);
    for (own, r) in columns.iter().zip(residuals) {
        let weights: Vec<f64> = r.iter().map(|r| weight(*r)).collect();
        add_products(own.matrix.clone(), r, &weights, &own.places, &mut curvature, &mut gradient);
    }
    add_prior(point, coordinates, &mut curvature, &mut gradient);
    (curvature, gradient)
}

/// Adds one recording's part of the normal equations: AᵀWA and AᵀWr at the `places` of its columns.
pub fn add_products(
    mut matrix: DMatrix<f64>,
    residuals: &[f64],
    weights: &[f64],
    places: &[usize],
    curvature: &mut DMatrix<f64>,
    gradient: &mut DVector<f64>,
) {
    let roots = DVector::from_iterator(weights.len(), weights.iter().map(|w| w.sqrt()));
    let weighted = DVector::from_iterator(weights.len(), residuals.iter().zip(weights).map(|(r, w)| r * w.sqrt()));
    matrix.column_iter_mut().for_each(|mut column| column.component_mul_assign(&roots));
    let (products, slopes) = (matrix.transpose() * &matrix, matrix.tr_mul(&weighted));
    for (i, &place) in places.iter().enumerate() {
        gradient[place] += slopes[i];
        for (j, &other) in places.iter().enumerate() {
            curvature[(place, other)] += products[(i, j)];
        }
    }
}

/// Adds the priors' curvature and gradient.
pub fn add_prior(point: &Point, coordinates: &[Coordinate], curvature: &mut DMatrix<f64>, gradient: &mut DVector<f64>) {
    for (k, c) in coordinates.iter().enumerate() {
        let centre = if let Coordinate::Effect(p) = c { PARAMETERS[*p].null } else { 0.0 };
        curvature[(k, k)] += c.precision();
        gradient[k] += c.precision() * (c.get(point) - centre);
    }
    for t in &TOGETHER {
        let place = |parameter: usize| coordinates.iter().position(|c| *c == Coordinate::Effect(parameter));
        if let (Some(leader), Some(follower)) = (place(t.leader), place(t.follower)) {
            let slopes = [(leader, -t.share / t.sigma), (follower, 1.0 / t.sigma)];
            for (i, a) in slopes {
                gradient[i] += a * t.strain(&point.effects);
                slopes.iter().for_each(|&(j, b)| curvature[(i, j)] += a * b);
            }
        }
    }
}

/// Inner product.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Outcome of a fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// Where the cost is least.
    pub point: Point,
    /// Cost there.
    pub cost: f64,
    /// Residuals there.
    pub residuals: Vec<Residuals>,
    /// Free coordinates.
    pub coordinates: Vec<Coordinate>,
    /// Curvature of half the cost there.
    pub curvature: DMatrix<f64>,
}

/// Steps that an iteration tries, each shorter than the one before.
const TRIES: usize = 7;
/// Factor on the damping of a step that led nowhere.
const SHRINK: f64 = 20.0;

/// Rounds in which parameters that would leave their bounds are stopped there.
const STOPS: usize = 4;

/// Damped Gauss–Newton step within the bounds of effect parameters: one that would leave is stopped at its bound, and the others move for
/// themselves, not as if it had gone on.
fn bounded_step(h: &DMatrix<f64>, g: &DVector<f64>, damping: f64, coordinates: &[Coordinate], point: &Point) -> Option<DVector<f64>> {
    let (mut curvature, mut downhill) = (h.clone(), -g);
    for (k, c) in coordinates.iter().enumerate() {
        curvature[(k, k)] += damping * c.unit();
    }
    let mut stopped = vec![false; coordinates.len()];
    for _ in 0..STOPS {
        let step = curvature.clone().cholesky()?.solve(&downhill);
        let room = |k: usize| coordinates[k].room(point, step[k]);
        let leaving: Vec<usize> = (0..step.len()).filter(|&k| !stopped[k] && room(k) != step[k]).collect();
        if leaving.is_empty() {
            return Some(step);
        }
        for k in leaving {
            stopped[k] = true;
            let to_bound = room(k);
            downhill -= curvature.column(k) * to_bound;
            curvature.row_mut(k).fill(0.0);
            curvature.column_mut(k).fill(0.0);
            curvature[(k, k)] = 1.0;
            downhill[k] = to_bound;
        }
    }
    curvature.cholesky().map(|c| c.solve(&downhill))
}

/// Ratio of a step's gain to what the linear model promised within which the derivatives along tolerances are kept for the next step.
const KEEPS_ITS_WORD: std::ops::Range<f64> = 0.7..1.5;
/// Gain of a step below which a fit ends.
const LEAST_GAIN: f64 = 0.5;

/// Minimises the cost over nuisances, start temperatures and the parameters of `effects`, from `start`. Derivatives along tolerances cost
/// most of a fit and change little: they are kept while the linear model keeps its word. `known` are those of a place nearby.
pub fn fit(problem: &Problem, effects: &[usize], start: &Point, iterations: usize, known: Option<&[Columns]>) -> Fit {
    fit_along(problem, coordinates(problem, effects), start, iterations, known)
}

/// As [`fit`], along these coordinates alone.
pub fn fit_along(problem: &Problem, coordinates: Vec<Coordinate>, start: &Point, iterations: usize, known: Option<&[Columns]>) -> Fit {
    let mut point = start.clone();
    let mut residuals = problem.all_residuals(&point);
    let mut cost = problem.cost(&point, &residuals);
    // Damping is in units of tolerances: an effect and the tolerance that it resembles share a valley, flat but for the
    // prior, along which damping in proportion to the curvature would hardly move.
    let mut damping = 0.0_f64;
    let mut curvature = DMatrix::identity(coordinates.len(), coordinates.len());
    let mut columns: Vec<Columns> = Vec::new();
    let mut kept = known.is_some();
    let mut done = 0;
    while done < iterations {
        let old = match known {
            Some(known) if columns.is_empty() => known,
            _ => &columns,
        };
        columns = derivatives(problem, &point, &residuals, &coordinates, kept.then_some(old));
        let (h, g) = normal_equations(&point, &residuals, &columns, &coordinates);
        let before = cost;
        let mut promised = f64::INFINITY;
        for _ in 0..TRIES {
            let Some(step) = bounded_step(&h, &g, damping, &coordinates, &point) else {
                damping = (damping * SHRINK).max(1.0);
                continue;
            };
            let mut trial = point.clone();
            for (c, s) in coordinates.iter().zip(step.iter()) {
                trial = c.moved(&trial, *s);
            }
            if !problem.can_follow(&trial) {
                damping = (damping * SHRINK).max(1.0);
                continue;
            }
            let there = problem.all_residuals(&trial);
            let cost_there = problem.cost(&trial, &there);
            if cost_there < cost {
                promised = -2.0 * g.dot(&step) - (&h * &step).dot(&step);
                (point, residuals, cost) = (trial, there, cost_there);
                damping = if damping < 0.1 { 0.0 } else { damping * 0.1 };
                break;
            }
            damping = (damping * SHRINK).max(1.0);
        }
        curvature = h;
        let gain = before - cost;
        if !kept && gain < LEAST_GAIN {
            break;
        }
        let keeps_its_word = gain >= LEAST_GAIN && KEEPS_ITS_WORD.contains(&(gain / promised));
        // A step from kept derivatives that broke its word was only a try.
        done += usize::from(keeps_its_word || !kept);
        kept = keeps_its_word;
    }
    Fit { point, cost, residuals, coordinates, curvature }
}
