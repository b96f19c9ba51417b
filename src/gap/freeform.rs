//! Which part of the clutch an unknown gap lies in: free forms of the torque that is missing, one family for each part.
//!
//! While the clutch slips the two balances give the torque that it is short of, δT. Each part of the clutch can only make errors of its own
//! kind, and each kind is a family of functions, none of them an effect of the library:
//!
//! - actuator: δT = T(x + δx) − T(x), where δx follows from the command's past (lag, play, stiction) or from how long it has pressed;
//! - clutch force: δT = T · f, f over the position, over its direction, over the time since contact, over temperature;
//! - friction: δT = T · f, f over slip, over pressure, over work and time of slip, over temperature;
//! - thermal: δT = T · ∂ln μ/∂θ · δθ, where δθ is a temperature that the model does not know (a hot surface, a slow part).
//!
//! Families compete by their marginal likelihood in a linear Gaussian model, beside the tolerances at their price: a family that is
//! more pliable pays for it. Each may build on the library effect of its own part that comes nearest.

use super::balance::{self, Window};
use super::coordinate::Coordinate;
use super::predict::{Follow, HORIZON_S, predict};
use super::problem::{Point, Problem};
use super::pulsation::{self, Clock};
use super::select::Search;
use crate::effects::{REGISTRY, Subsystem};
use crate::physics::friction;
use crate::plant::{clutch, config::Config, motion};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Parts of the clutch.
const PARTS: [Subsystem; 4] = [Subsystem::Actuator, Subsystem::ClutchForce, Subsystem::Friction, Subsystem::Thermal];

/// The part whose family explains the missing torque best, and those that might do as well, best first.
///
/// A gap that keeps one rhythm has its place by its clock: an actuator oscillates in time, a plate wobbles with the crankshaft.
pub fn parts_of_clutch(problem: &Problem, search: &Search) -> Vec<Subsystem> {
    let base = &search.base.fit;
    match pulsation::rhythm(problem, &base.point, &base.residuals) {
        Some(Clock::Time) => return vec![Subsystem::Actuator],
        Some(Clock::Crank) => return vec![Subsystem::ClutchForce],
        None => {}
    }
    if nearest_is_of(search, Subsystem::Actuator) {
        return vec![Subsystem::Actuator];
    }
    let of = |part: Subsystem| {
        let nearest = search.singles.iter().find(|h| REGISTRY[h.effects[0]].effect.subsystem == part);
        let effects = nearest.map(|h| Point { effects: h.fit.point.effects, ..problem.nominal() });
        [Some(problem.nominal()), effects].into_iter().flatten().map(|p| evidence_of(problem, &p, part)).fold(f64::NEG_INFINITY, f64::max)
    };
    let mut all: Vec<(Subsystem, f64)> = PARTS.into_par_iter().map(|part| (part, of(part))).collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    let most = all[0].1;
    // Where no family has any evidence, none is better than another.
    all.into_iter().filter(|(_, evidence)| *evidence == most || most - evidence < AMBIGUOUS_NATS).map(|(part, _)| part).collect()
}

/// Difference of evidence in nats under which two parts are not told apart: families are rough, so that differences between them are larger than
/// those between effects.
const AMBIGUOUS_NATS: f64 = 30.0;

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

/// Signals of one recording that the families are made from, sample by sample.
struct Signals {
    config: Config,
    dt: f64,
    /// Positions at which the clutch slips, mm.
    range: [f64; 2],
    position: Vec<f64>,
    capacity: Vec<f64>,
    slip: Vec<f64>,
    theta: Vec<f64>,
    /// ∂ln μ/∂θ, 1/K.
    sensitivity: Vec<f64>,
}

impl Signals {
    /// Torque in N·m that sample `j` would have at bearing position `x` mm.
    fn capacity_at(&self, j: usize, x: f64) -> f64 {
        let mut y = [0.0; motion::N];
        y[motion::index::THETA_C] = self.theta[j];
        clutch::capacity(&self.config, x, clutch::Branch { x, z: 0.0 }, self.slip[j], &y)
    }
}

fn signals(problem: &Problem, point: &Point, k: usize) -> Signals {
    let series = &problem.series[k];
    let (vehicle, effects) = problem.plant_at(point);
    let config = Config::new(&vehicle, &effects);
    let replay = predict(series, &vehicle, &effects, point.theta_shift[k], Follow::Horizon(HORIZON_S));
    let n = series.len();
    let slip: Vec<f64> = (0..n).map(|j| (series.measured[0][j] - series.measured[1][j]).max(0.0)).collect();
    let theta = replay.value[4].clone();
    let mu = |j: usize, d: f64| friction::friction_coefficient(&vehicle.friction, slip[j], theta[j] + d);
    let sensitivity = (0..n).map(|j| (mu(j, 1.0) / mu(j, -1.0)).ln() / 2.0).collect();
    let a = &vehicle.actuator;
    let at = |share: f64| a.x_cnt_0 + share * (a.x_cls_0 - a.x_cnt_0);
    let range = [at(0.2), at(0.85)];
    let mut signals =
        Signals { config, dt: series.dt, range, position: replay.value[2].clone(), capacity: Vec::new(), slip, theta, sensitivity };
    signals.capacity = (0..n).map(|j| signals.capacity_at(j, signals.position[j])).collect();
    signals
}

/// What follows `v` with a time constant in s.
fn lagged(v: &[f64], dt: f64, tau: f64) -> Vec<f64> {
    let share = 1.0 - (-dt / tau).exp();
    let mut y = v[0];
    v.iter()
        .map(|&x| {
            y += share * (x - y);
            y
        })
        .collect()
}

/// What follows `v` through play of this width.
fn played(v: &[f64], width: f64) -> Vec<f64> {
    let mut y = v[0];
    v.iter()
        .map(|&x| {
            y = y.clamp(x - 0.5 * width, x + 0.5 * width);
            y
        })
        .collect()
}

/// What follows `v` in jumps while it is held, once it is further away than this.
fn stuck(v: &[f64], held: impl Fn(usize) -> bool, reach: f64) -> Vec<f64> {
    let mut y = v[0];
    v.iter()
        .enumerate()
        .map(|(j, &x)| {
            if (x - y).abs() > reach || !held(j) {
                y = x
            }
            y
        })
        .collect()
}

/// Direction of `v`, −1 to 1, turned over a stroke.
fn direction(v: &[f64], stroke: f64) -> Vec<f64> {
    let (mut z, mut last) = (0.0, v[0]);
    v.iter()
        .map(|&x| {
            let towards = (x - last).signum();
            if x != last {
                z = towards + (z - towards) * (-2.0 * (x - last).abs() / stroke).exp();
            }
            last = x;
            z
        })
        .collect()
}

/// Integral of `rate` over time while `on`, from zero whenever it is off if `anew`.
fn integral(rate: &[f64], on: &[bool], dt: f64, anew: bool) -> Vec<f64> {
    let mut sum = 0.0;
    rate.iter()
        .zip(on)
        .map(|(r, on)| {
            if *on {
                sum += r * dt
            } else if anew {
                sum = 0.0
            }
            sum
        })
        .collect()
}

/// Torque in N·m above which the faces count as pressed.
const PRESSED_NM: f64 = 0.5;
/// Size of a relative change of torque that is worth speaking of.
const SHARE: f64 = 0.3;
/// Usual temperatures and powers, K and W.
const WARM_K: f64 = 30.0;
const POWER_W: f64 = 3000.0;

/// The family of a part: per function its δT in N·m for a coefficient of one, sample by sample.
fn family(part: Subsystem, s: &Signals) -> Vec<Vec<f64>> {
    let times = |a: &[f64], f: &dyn Fn(usize) -> f64| -> Vec<f64> { a.iter().enumerate().map(|(j, a)| a * f(j)).collect() };
    let relative = |f: &dyn Fn(usize) -> f64| times(&s.capacity, &|j| SHARE * f(j));
    let pressed: Vec<bool> = s.capacity.iter().map(|t| *t > PRESSED_NM).collect();
    let ones = vec![1.0; s.capacity.len()];
    let since_contact = integral(&ones, &pressed, s.dt, true);
    let warm = relative(&|j| (s.theta[j] - 25.0) / 80.0);
    let power: Vec<f64> = s.capacity.iter().zip(&s.slip).map(|(t, w)| t * w).collect();
    match part {
        Subsystem::Actuator => {
            let at = |y: &dyn Fn(usize) -> f64| (0..s.position.len()).map(|j| s.capacity_at(j, y(j)) - s.capacity[j]).collect::<Vec<f64>>();
            let behind = |y: Vec<f64>| at(&|j| y[j]);
            let pressed_time = integral(&ones, &pressed, s.dt, false);
            let leak = |tau: f64| at(&|j| s.position[j] - 0.2 * (1.0 - (-since_contact[j] / tau).exp()));
            let leak_not_refilled = at(&|j| s.position[j] - 0.1 * pressed_time[j]);
            let lags = [0.03, 0.1, 0.3, 1.0].map(|tau| behind(lagged(&s.position, s.dt, tau)));
            let plays = [0.1, 0.2, 0.4].map(|w| behind(played(&s.position, w)));
            let jumps = [0.1, 0.15, 0.2].map(|w| behind(stuck(&s.position, |_| true, w)));
            let loaded_jumps = [0.1, 0.15, 0.2].map(|w| behind(stuck(&s.position, |j| pressed[j], w)));
            lags.into_iter().chain(plays).chain(jumps).chain(loaded_jumps).chain([1.0, 3.0].map(leak)).chain([leak_not_refilled]).collect()
        }
        Subsystem::ClutchForce => {
            let places = hats(&s.position, &s.range, 6);
            let turned = [0.1, 0.4].map(|stroke| direction(&s.position, stroke));
            let settling = [0.4, 1.2].map(|tau: f64| relative(&|j| (-since_contact[j] / tau).exp()));
            let over_position = places.iter().map(|h| relative(&|j| h[j]));
            over_position.chain(turned.iter().map(|z| relative(&|j| z[j]))).chain(settling).chain([warm]).collect()
        }
        Subsystem::Friction => {
            let speeds = hats(&s.slip, &[0.0, 120.0], 5);
            let slipping: Vec<bool> = s.slip.iter().zip(&pressed).map(|(w, p)| *p && *w > 1.0).collect();
            let (work, time) = (integral(&power, &slipping, s.dt, false), integral(&ones, &slipping, s.dt, false));
            let worn = [1000.0, 3000.0].map(|w: f64| relative(&|j| (-work[j] / w).exp()));
            let dried = [0.3, 0.8].map(|tau: f64| relative(&|j| (-time[j] / tau).exp()));
            let pressure = times(&s.capacity, &|j| s.capacity[j] / 60.0);
            speeds.iter().map(|h| relative(&|j| h[j])).chain(worn).chain(dried).chain([pressure, warm]).collect()
        }
        _ => {
            let of_power = |tau: f64| lagged(&power, s.dt, tau);
            let flash = [0.02, 0.15].map(|tau| {
                let p = of_power(tau);
                times(&s.capacity, &|j| p[j] / POWER_W * WARM_K * s.sensitivity[j])
            });
            let burn = [0.02, 0.15].map(|tau| {
                let p = of_power(tau);
                times(&s.capacity, &|j| 0.5 * SHARE * p[j] / POWER_W)
            });
            let soak = [0.7, 3.0].map(|tau| {
                let l = lagged(&s.theta, s.dt, tau);
                times(&s.capacity, &|j| (l[j] - s.theta[j]) * s.sensitivity[j])
            });
            flash.into_iter().chain(burn).chain(soak).collect()
        }
    }
}

/// Piecewise linear functions that sum to one over a range.
fn hats(v: &[f64], [low, high]: &[f64; 2], count: usize) -> Vec<Vec<f64>> {
    let spacing = (high - low) / (count - 1) as f64;
    let hat = |k: usize| v.iter().map(|x| (1.0 - ((x.clamp(*low, *high) - low) / spacing - k as f64).abs()).max(0.0)).collect();
    (0..count).map(hat).collect()
}

/// Sizes of a family's coefficients that are tried, and scatters in N·m beyond the sensors' that no family accounts for.
const SIZES: [f64; 4] = [0.1, 0.3, 1.0, 3.0];
const SCATTERS: [f64; 5] = [0.0, 0.3, 1.0, 3.0, 8.0];
/// Error of the torque map that is always there, relative.
const MAP_ERROR: f64 = 0.01;

/// Logarithm of the marginal likelihood of the missing torque, with size and scatter that suit it best.
fn evidence_of(problem: &Problem, point: &Point, part: Subsystem) -> f64 {
    let (shortage, windows) = shortage(problem, point);
    let families: Vec<(f64, Vec<Vec<f64>>)> = (0..problem.series.len())
        .map(|k| {
            let signals = signals(problem, point, k);
            (signals.dt, family(part, &signals))
        })
        .collect();
    let count = families.first().map_or(0, |f| f.1.len());
    let members = DMatrix::from_fn(windows.len(), count, |i, m| {
        let (dt, family) = &families[windows[i].recording];
        family[m][((windows[i].time / dt).round() as usize).min(family[m].len() - 1)]
    });
    let tried = SIZES.iter().flat_map(|size| SCATTERS.iter().map(move |scatter| (*size, *scatter)));
    tried
        .filter_map(|(size, scatter)| {
            let deviations = DVector::from_fn(windows.len(), |i, _| {
                (shortage.sigma[i].powi(2) + scatter * scatter + (MAP_ERROR * windows[i].torque).powi(2)).sqrt()
            });
            log_evidence(&shortage, &(&members * size), &deviations)
        })
        .fold(f64::NEG_INFINITY, f64::max)
}

/// Gaussian marginal likelihood with standard normal coefficients of tolerances and members.
fn log_evidence(shortage: &Shortage, members: &DMatrix<f64>, deviations: &DVector<f64>) -> Option<f64> {
    let (n, t) = (members.nrows(), shortage.tolerances.ncols());
    let columns = DMatrix::from_fn(n, t + members.ncols(), |i, k| {
        let value = if k < t { shortage.tolerances[(i, k)] } else { members[(i, k - t)] };
        value / deviations[i]
    });
    let y = shortage.torque.component_div(deviations);
    let curvature = columns.tr_mul(&columns) + DMatrix::identity(columns.ncols(), columns.ncols());
    let projected = columns.tr_mul(&y);
    let root = curvature.cholesky()?;
    let explained = projected.dot(&root.solve(&projected));
    let volume: f64 = root.l().diagonal().iter().map(|d| d.ln()).sum();
    Some(-0.5 * (y.norm_squared() - explained) - volume - deviations.iter().map(|d| d.ln()).sum::<f64>())
}
