//! The evidence of the diagnosis by Laplace's approximation, (4) of docs/diagnosis.md, compared with the same integral by the No-U-Turn sampler of nuts-rs.
//!
//! ```text
//! cargo test --manifest-path tests/sampler/Cargo.toml -- --nocapture
//! ```
//!
//! On three campaigns of the repository, two hypotheses are fitted: the car within its tolerances, and the car with the effect that it carries, forms of the effect included.
//! The density is then sampled in coordinates in which Laplace's approximation is standard normal, with the own unknowns of every recording explicit. A path of densities leads
//! from that normal to the true one, and the ratio of the integrals of each pair of neighbours is estimated by bridge sampling (Meng and Wong, 1996, "Simulating ratios of
//! normalizing constants via a simple identity: a theoretical exploration"). Takes a quarter of an hour on two cores.
#![cfg(test)]

use kisspoint::campaign::{self, ReadOptions};
use kisspoint::effects::{self, PARAMETERS};
use kisspoint::gap::infer::coordinate::Coordinate;
use kisspoint::gap::infer::density::{Basis, ByPhase, Point, Problem, TEMPERATURES, WHOLE, prior};
use kisspoint::gap::infer::linear::{Frame, Normal, Products, assemble, to_powers};
use kisspoint::gap::infer::search::{Hypothesis, search};
use kisspoint::gap::model::prepare;
use kisspoint::gap::model::tolerance::Nuisance;
use kisspoint::vehicle::Vehicle;
use nalgebra::{DMatrix, DVector};
use nuts_rs::{Chain, CpuLogpFunc, CpuMath, CpuMathError, DiagNutsSettings, KineticEnergyKind, LogpError, Settings};
use rand::SeedableRng;
use rand::rngs::StdRng;
use rand_distr::{Distribution, StandardNormal};
use std::collections::HashMap;
use std::path::Path;

/// Exponents of the true density along the path from the normal to it.
const PATH: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
/// Number of draws from each density.
const DRAWS: usize = 500;
/// Number of draws with which the sampler tunes its step size.
const TUNE: usize = 200;
/// Admissible disagreement of the two in the evidence of a set of effects against the empty one, in nats and as a share of the difference: odds of 20 to one, and less than
/// half of the accuracy of laws.
const AGREE: (f64, f64) = (3.0, 0.01);

fn problem(folder: &str) -> Problem {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data").join(folder);
    let campaign = campaign::read(&root, &ReadOptions::default()).unwrap();
    let vehicle = Vehicle::from_value(&campaign.vehicle_json).unwrap();
    let all: Vec<_> = campaign.recordings.iter().collect();
    let (tracks, tolerances) = prepare::read(&all, &campaign.vehicle_json).unwrap();
    let with = prepare::disturbances(&tracks, &tolerances);
    prepare::problem(tracks, &vehicle, &tolerances, &with)
}

/// A density in coordinates z in which its Laplace approximation is standard normal.
#[derive(Clone)]
struct Whitened<'a> {
    problem: &'a Problem,
    basis: &'a Basis,
    powers: ByPhase<f64>,
    /// The point at which z is zero.
    mode: Point,
    frame: Frame,
    /// L⁻ᵀ of the shared coordinates' curvature L Lᵀ.
    shared: DMatrix<f64>,
    /// For each recording, the dependence of its own unknowns on the shared coordinates, and L⁻ᵀ of their curvature.
    own: Vec<(DMatrix<f64>, DMatrix<f64>)>,
    /// Half the cost at the mode.
    least: f64,
    /// Logarithm of the volume of the normal approximation, relative to the prior's.
    log_volume: f64,
    /// Exponent of the true density; that of the normal is the rest.
    share: f64,
}

fn log_det(m: &DMatrix<f64>) -> f64 {
    2.0 * m.clone().cholesky().unwrap().l().diagonal().map(f64::ln).sum()
}

fn inverse_root(curvature: &DMatrix<f64>) -> DMatrix<f64> {
    curvature.clone().cholesky().unwrap().l().transpose().try_inverse().unwrap()
}

impl<'a> Whitened<'a> {
    fn new(problem: &'a Problem, h: &'a Hypothesis, powers: ByPhase<f64>) -> Self {
        let frame = Frame { shared: h.formed.shared.clone(), own: h.formed.own.clone() };
        let parts: Vec<Products> = to_powers(&h.formed.parts, powers);
        let e: Normal = assemble(&h.formed.point, &frame, &parts, 0.0).unwrap();
        let mut this = Self {
            problem,
            basis: &h.basis,
            powers,
            mode: h.formed.point.clone(),
            frame,
            shared: inverse_root(&e.curvature),
            own: e.eliminated.iter().map(|r| (r.coupling().clone(), inverse_root(&r.covariance().try_inverse().unwrap()))).collect(),
            least: 0.0,
            log_volume: 0.5 * (e.log_det_prior - log_det(&e.curvature) - e.log_det_own),
            share: 1.0,
        };
        // Tempering by the powers moves the mode towards the priors.
        let step = -e.curvature.clone().cholesky().unwrap().solve(&e.gradient);
        let to = this.moved(&step, &e.eliminated.iter().map(|r| r.step(&step)).collect::<Vec<_>>());
        let [here, there] = [&this.mode, &to].map(|point| this.half_cost(point).unwrap_or(f64::INFINITY));
        if there < here {
            this.mode = to;
        }
        this.least = here.min(there);
        this
    }

    fn dim(&self) -> usize {
        self.frame.shared.len() + self.frame.own.len() * self.own.len()
    }

    fn moved(&self, shared: &DVector<f64>, own: &[DVector<f64>]) -> Point {
        let mut point = self.mode.clone();
        for (c, by) in self.frame.shared.iter().zip(shared.iter()) {
            match *c {
                Coordinate::Shared(k) => point.shared[k] += by,
                Coordinate::Effect(k) => point.effects[k] += by,
                Coordinate::Missing(k) => point.missing[k] += by,
                Coordinate::Own(_) => unreachable!("not shared"),
            }
        }
        for (r, own) in own.iter().enumerate() {
            for (c, by) in self.frame.own.iter().zip(own.iter()) {
                let Coordinate::Own(k) = *c else { unreachable!("shared") };
                point.own[r][k] += by;
            }
        }
        point
    }

    fn at(&self, z: &[f64]) -> Point {
        let (s, o) = (self.frame.shared.len(), self.frame.own.len());
        let shared = &self.shared * DVector::from_column_slice(&z[..s]);
        let own = |(r, (coupling, root)): (usize, &(DMatrix<f64>, DMatrix<f64>))| {
            root * DVector::from_column_slice(&z[s + r * o..s + (r + 1) * o]) - coupling * &shared
        };
        self.moved(&shared, &self.own.iter().enumerate().map(own).collect::<Vec<_>>())
    }

    /// Half the cost; `None` outside the bounds of an effect, or if the replay fails. A one-sided unknown is folded, that is, counted on both sides of zero, as in Laplace's
    /// approximation.
    fn half_cost(&self, point: &Point) -> Option<f64> {
        let mut point = point.clone();
        let within = |k: usize| (PARAMETERS[k].min..=PARAMETERS[k].max).contains(&point.effects[k]);
        if !self.frame.shared.iter().all(|c| !matches!(*c, Coordinate::Effect(k) if !within(k))) {
            return None;
        }
        let fold =
            |values: &mut [f64], of: &[Nuisance]| values.iter_mut().zip(of).filter(|(_, n)| n.one_sided).for_each(|(x, _)| *x = x.abs());
        fold(&mut point.shared, &self.problem.shared);
        point.own.iter_mut().for_each(|own| fold(&mut own[TEMPERATURES..], &self.problem.own));
        if !self.problem.can_follow(&point) {
            return None;
        }
        let residuals = self.problem.all_residuals(&point, Some(self.basis));
        let misfit: f64 = self.problem.misfits(&residuals).iter().zip(self.powers).map(|(m, power)| m * power).sum();
        Some(0.5 * (misfit + prior(&point)))
    }

    /// Logarithm of the ratio of the density to the normal, each relative to its value at the mode.
    fn log_ratio(&self, z: &[f64]) -> f64 {
        self.half_cost(&self.at(z)).map_or(f64::NEG_INFINITY, |half| self.least - half + 0.5 * square(z))
    }
}

fn square(z: &[f64]) -> f64 {
    z.iter().map(|z| z * z).sum()
}

#[derive(Debug, thiserror::Error)]
#[error("outside the bounds")]
struct Outside;

impl LogpError for Outside {
    fn is_recoverable(&self) -> bool {
        true
    }
}

impl nuts_storable::HasDims for Whitened<'_> {
    fn dim_sizes(&self) -> HashMap<String, u64> {
        ["unconstrained_parameter", "dim"].map(|name| (name.to_owned(), self.dim() as u64)).into()
    }
}

impl CpuLogpFunc for Whitened<'_> {
    type LogpError = Outside;
    type FlowParameters = ();
    type ExpandedVector = Vec<f64>;

    fn dim(&self) -> usize {
        Whitened::dim(self)
    }

    /// The gradient is that of the normal and only guides the trajectory. Any field that depends on the position alone keeps the leapfrog reversible and volume-preserving, and
    /// the acceptance is decided by the true density.
    fn logp(&mut self, position: &[f64], gradient: &mut [f64]) -> Result<f64, Outside> {
        gradient.iter_mut().zip(position).for_each(|(g, z)| *g = -z);
        let log = self.share * self.log_ratio(position) - 0.5 * square(position);
        if log.is_finite() { Ok(log) } else { Err(Outside) }
    }

    fn expand_vector<R: rand::Rng + ?Sized>(&mut self, _: &mut R, array: &[f64]) -> Result<Vec<f64>, CpuMathError> {
        Ok(array.to_vec())
    }
}

fn mean(v: &[f64]) -> f64 {
    v.iter().sum::<f64>() / v.len() as f64
}

/// Logarithm of the ratio of the integrals of two densities q1 and q2 by optimal bridge sampling, and its standard error for independent draws. `one` and `two` are ln q1 − ln
/// q2 at equally many draws from each density.
fn bridge(one: &[f64], two: &[f64]) -> (f64, f64) {
    let mut log_ratio = 0.0_f64;
    let weights = |log_ratio: f64| -> [Vec<f64>; 2] {
        [
            two.iter().map(|l| 1.0 / (1.0 + (log_ratio - l).exp())).collect(),
            one.iter().map(|l| 1.0 / (1.0 + (l - log_ratio).exp())).collect(),
        ]
    };
    for _ in 0..500 {
        let [up, down] = weights(log_ratio);
        log_ratio += (mean(&up) / mean(&down)).ln();
    }
    let relative = |v: &Vec<f64>| v.iter().map(|x| (x / mean(v) - 1.0).powi(2)).sum::<f64>() / (v.len() as f64).powi(2);
    (log_ratio, weights(log_ratio).iter().map(relative).sum::<f64>().sqrt())
}

/// Logarithms of the ratio of the density to the normal, at draws from a density of the path.
fn drawn(density: &Whitened, rng: &mut StdRng) -> Vec<f64> {
    let normal = |rng: &mut StdRng| -> Vec<f64> { (0..density.dim()).map(|_| StandardNormal.sample(rng)).collect() };
    if density.share == 0.0 {
        return (0..DRAWS).map(|_| density.log_ratio(&normal(rng))).collect();
    }
    let mut settings = DiagNutsSettings { num_tune: TUNE as u64, num_draws: DRAWS as u64, maxdepth: 3, ..Default::default() };
    settings.trajectory_kind = KineticEnergyKind::ExactNormal;
    let mut chain = settings.new_chain(0, CpuMath::new(density.clone()), rng).unwrap();
    // The start is not the mode, where the gradient is zero.
    let start: Vec<f64> = normal(rng).iter().map(|z| 0.3 * z).collect();
    chain.set_position(&start).unwrap();
    let all: Vec<_> = (0..TUNE + DRAWS).map(|_| chain.draw().unwrap().0).collect();
    all[TUNE..].iter().map(|z| density.log_ratio(z)).collect()
}

/// Logarithm of the evidence by the sampler, and its standard error.
fn sampled(mut density: Whitened) -> (f64, f64) {
    let mut rng = StdRng::seed_from_u64(7);
    let along = PATH.map(|share| {
        density.share = share;
        drawn(&density, &mut rng)
    });
    let (mut log, mut variance) = (density.log_volume - density.least, 0.0);
    for (shares, ratios) in PATH.windows(2).zip(along.windows(2)) {
        let between = |ratios: &[f64]| -> Vec<f64> { ratios.iter().map(|l| (shares[1] - shares[0]) * l).collect() };
        let (more, error) = bridge(&between(&ratios[1]), &between(&ratios[0]));
        log += more;
        variance += error * error;
    }
    (log, variance.sqrt())
}

#[test]
fn evidence_is_that_of_a_sampler() {
    let mut wrong = Vec::new();
    for (folder, effect) in
        [("campaigns/example", "kiss_point_thermal"), ("cases/2/campaign", "heat_partition"), ("cases/6/campaign", "friction_level")]
    {
        let problem = problem(folder);
        let found = search(&problem, None, &|_, _| {});
        let sets = [vec![], vec![effects::find(effect).unwrap()]];
        let fitted = sets.map(|set| found.of(&set).expect("a set that is always fitted").whole(&problem));
        for (likelihood, powers) in [("whole", WHOLE), ("2 %", problem.powers[0]), ("8 %", problem.powers[2])] {
            let laplace = fitted.each_ref().map(|h| h.formed.weighed(&problem, h.basis.len(), powers).0);
            let sampler = fitted.each_ref().map(|h| sampled(Whitened::new(&problem, h, powers)));
            let by_laplace = laplace[1] - laplace[0];
            let (by_sampler, error) = (sampler[1].0 - sampler[0].0, sampler[1].1.hypot(sampler[0].1));
            let line =
                format!("{folder}, {effect}, likelihood {likelihood}: Laplace {by_laplace:.2}, sampler {by_sampler:.2} ± {error:.2} nats");
            eprintln!("{line}; each {laplace:.1?}, {sampler:.2?}");
            if (by_laplace - by_sampler).abs() > AGREE.0.max(AGREE.1 * by_sampler) + 2.0 * error {
                wrong.push(line);
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
