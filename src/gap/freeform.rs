//! Which part of the clutch an unknown gap lies in: free forms of the torque that is missing, some for each part.
//!
//! While the clutch slips the two balances give the torque that it is short of, δT. Each part of the clutch can only make errors of its own
//! kind, by one of a few mechanisms, each a small family of functions and none of them an effect of the library:
//!
//! - actuator: δT = T(x + δx) − T(x), where δx follows from the command's past (lag, play, stiction) or from how long it has pressed (leaks);
//! - clutch force: δT = T · f, f over the position, its direction, the time since contact, or temperature;
//! - friction: δT = T · f, f over slip, pressure, the work or the time of slip, or temperature;
//! - thermal: δT = T · ∂ln μ/∂θ · δθ, where δθ is a temperature that the model does not know (a hot surface, a slow part), or T times the power.
//!
//! Parts compete by the marginal likelihood of their mechanisms in a linear Gaussian model, beside the tolerances at their price. Something is
//! wrong in one way, not in all ways at once: the likelihood of a part is the mean over its mechanisms, and a pliable one pays for it.

use super::balance::{self, Window};
use super::coordinate::Coordinate;
use super::mechanisms::{Mechanism, Signals, mechanisms, signals};
use super::problem::{Point, Problem};
use super::pulsation::{self, Clock};
use super::select::Search;
use crate::effects::{REGISTRY, Subsystem};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Parts of the clutch.
const PARTS: [Subsystem; 4] = [Subsystem::Actuator, Subsystem::ClutchForce, Subsystem::Friction, Subsystem::Thermal];

/// The part with the mechanism that explains the missing torque best, and those that might do as well, best first. Torque may be missing of the nominal
/// car or of a car with the effects of `point`, whichever leaves the part the better explanation.
///
/// A gap that keeps one rhythm has its place by its clock: an actuator oscillates in time, a plate wobbles with the crankshaft.
pub fn parts_of_clutch(problem: &Problem, search: &Search, point: &Point) -> Vec<Subsystem> {
    let base = &search.base.fit;
    match pulsation::rhythm(problem, &base.point, &base.residuals) {
        Some(Clock::Time) => return vec![Subsystem::Actuator],
        Some(Clock::Crank) => return vec![Subsystem::ClutchForce],
        None => {}
    }
    if nearest_is_of(search, Subsystem::Actuator) {
        return vec![Subsystem::Actuator];
    }
    let nominal = problem.nominal();
    let with_effects = (point.effects != nominal.effects).then_some(point);
    let mut all = PARTS.map(|part| (part, f64::NEG_INFINITY));
    for point in [Some(&nominal), with_effects].into_iter().flatten() {
        let (shortage, windows) = shortage(problem, point);
        let signals: Vec<Signals> = (0..problem.series.len()).into_par_iter().map(|k| signals(problem, point, k)).collect();
        all.par_iter_mut().for_each(|(part, evidence)| *evidence = evidence.max(evidence_of(&shortage, &windows, &signals, *part)));
    }
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    let most = all[0].1;
    // Where no mechanism has any evidence, none is better than another.
    all.into_iter().filter(|(_, evidence)| *evidence == most || most - evidence < AMBIGUOUS_NATS).map(|(part, _)| part).collect()
}

/// Difference of evidence in nats under which two parts are not told apart: mechanisms are rough, so that differences between them are larger than
/// those between effects.
const AMBIGUOUS_NATS: f64 = 20.0;

/// Cost beyond noise of the effect that comes nearest, relative to that of any other part's, under which it tells its part.
const NEAREST: f64 = 0.75;

/// Whether the library effect that explains most is of this part, and no other part's comes near it. An error that follows the past of a command is
/// hardly ever taken for another; laws of force, friction and heat take each other's place too easily for that.
fn nearest_is_of(search: &Search, part: Subsystem) -> bool {
    let least = |wanted: bool| {
        let costs = search
            .singles
            .iter()
            .filter(|h| (REGISTRY[h.effects[0]].effect.subsystem == part) == wanted)
            .map(|h| h.fit.cost - search.noise_cost);
        costs.fold(search.base.fit.cost - search.noise_cost, f64::min)
    };
    least(true) < NEAREST * least(false)
}

/// What the clutch is short of, window by window.
struct Shortage {
    /// Torque that is missing, N·m.
    torque: DVector<f64>,
    /// Its standard deviation, N·m.
    sigma: DVector<f64>,
    /// Its change per standard deviation of each tolerance, N·m.
    tolerances: DMatrix<f64>,
}

/// Best estimate from both balances: the engine side has its sign turned.
fn missing(w: &Window) -> f64 {
    let (f, c) = (w.sigma[0].powi(-2), w.sigma[1].powi(-2));
    (w.driveline * c - w.engine * f) / (f + c)
}

/// Predicted slip in rad/s below which a window is left out.
const LEAST_SLIP: f64 = 5.0;

fn shortage(problem: &Problem, point: &Point) -> (Shortage, Vec<Window>) {
    let phases = balance::phases(problem, point);
    let all = |p: &Point| balance::windows_in(problem, p, &phases);
    let at_point = all(point);
    // Where the replay is about to lock early, what is missing is no longer a torque of slipping faces.
    let slips: Vec<bool> = at_point.iter().map(|w| w.phase == 2 && w.predicted_slip > LEAST_SLIP).collect();
    let slipping = |all: Vec<Window>| -> Vec<Window> { all.into_iter().zip(&slips).filter(|(_, slips)| **slips).map(|(w, _)| w).collect() };
    let here = slipping(at_point);
    let moved: Vec<Vec<Window>> = (0..problem.nuisances.len()).map(|k| slipping(all(&Coordinate::Nuisance(k).moved(point, 1.0)))).collect();
    let n = here.len();
    let torque = DVector::from_fn(n, |i, _| missing(&here[i]));
    let sigma = DVector::from_fn(n, |i, _| (here[i].sigma[0].powi(-2) + here[i].sigma[1].powi(-2)).powf(-0.5));
    let tolerances = DMatrix::from_fn(n, moved.len(), |i, k| missing(&moved[k][i]) - torque[i]);
    (Shortage { torque, sigma, tolerances }, here)
}

/// Sizes of a mechanism's coefficients that are tried, and scatters in N·m beyond the sensors' that no mechanism accounts for.
const SIZES: [f64; 4] = [0.1, 0.3, 1.0, 3.0];
const SCATTERS: [f64; 5] = [0.0, 0.3, 1.0, 3.0, 8.0];
/// Error of the torque map that is always there, relative.
const MAP_ERROR: f64 = 0.01;

/// Logarithm of the mean marginal likelihood of a part's mechanisms, each with the size and scatter that suit it best.
fn evidence_of(shortage: &Shortage, windows: &[Window], signals: &[Signals], part: Subsystem) -> f64 {
    let recordings: Vec<Vec<Mechanism>> = signals.iter().map(|s| mechanisms(part, s)).collect();
    let count = recordings.first().map_or(0, Vec::len);
    let of = |m: usize| {
        let members = DMatrix::from_fn(windows.len(), recordings[0][m].functions.len(), |i, k| {
            let w = &windows[i];
            let function = &recordings[w.recording][m].functions[k];
            function[((w.time / signals[w.recording].dt).round() as usize).min(function.len() - 1)]
        });
        let tried = SIZES.iter().flat_map(|size| SCATTERS.iter().map(move |scatter| (*size, *scatter)));
        tried
            .filter_map(|(size, scatter)| {
                let deviations = DVector::from_fn(windows.len(), |i, _| {
                    (shortage.sigma[i].powi(2) + scatter * scatter + (MAP_ERROR * windows[i].torque).powi(2)).sqrt()
                });
                log_evidence(shortage, &(&members * size), &deviations, recordings[0][m].one_way)
            })
            .fold(f64::NEG_INFINITY, f64::max)
    };
    let each: Vec<f64> = (0..count).into_par_iter().map(of).collect();
    let most = each.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if most.is_finite() { most + (each.iter().map(|e| (e - most).exp()).sum::<f64>() / count as f64).ln() } else { most }
}

/// Gaussian marginal likelihood with standard normal coefficients of tolerances and members; the last one's is positive if it has one way only.
fn log_evidence(shortage: &Shortage, members: &DMatrix<f64>, deviations: &DVector<f64>, one_way: bool) -> Option<f64> {
    let (n, t) = (members.nrows(), shortage.tolerances.ncols());
    let columns = DMatrix::from_fn(n, t + members.ncols(), |i, k| {
        let value = if k < t { shortage.tolerances[(i, k)] } else { members[(i, k - t)] };
        value / deviations[i]
    });
    let y = shortage.torque.component_div(deviations);
    let curvature = columns.tr_mul(&columns) + DMatrix::identity(columns.ncols(), columns.ncols());
    let projected = columns.tr_mul(&y);
    let root = curvature.cholesky()?;
    let mean = root.solve(&projected);
    let volume: f64 = root.l().diagonal().iter().map(|d| d.ln()).sum();
    let evidence = -0.5 * (y.norm_squared() - projected.dot(&mean)) - volume - deviations.iter().map(|d| d.ln()).sum::<f64>();
    // Half of the prior is left, and of the posterior what lies above zero; the last diagonal element of the root is the last coefficient's precision.
    let last = mean.len() - 1;
    let above = mean[last] * root.l_dirty()[(last, last)] / std::f64::consts::SQRT_2;
    Some(if one_way { evidence + libm::erfc(-above).ln() } else { evidence })
}
