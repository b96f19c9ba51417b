//! Where: the gap in every balance, and the subsystem in which it lies.
//!
//! Balances are those of [`balance`]: what each side of the clutch is short of, per phase and region, against the noise that
//! the sensors bring and under the family-wise error rate of Holm's procedure. The subsystem is that of the effect that explains the gap; where no effect does,
//! the balances decide between engine, driveline, sensors and the clutch, and the candidates that come nearest between the parts of the clutch.

use super::balance::{self, HIGH_TORQUE_NM, HOT_DEGC, Window};
use super::coordinate::Coordinate;
use super::decide::{Decision, Verdict};
use super::derivatives::add_products;
use super::freeform;
use super::problem::{Point, Problem};
use super::select::Search;
use crate::effects::{self, REGISTRY, Subsystem};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Probability of any false alarm among all cells of a car without gap.
pub const FAMILY_WISE_ERROR: f64 = 0.01;

/// One cell of the residual map.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Balance.
    pub equation: &'static str,
    /// Phase.
    pub phase: &'static str,
    /// Operating region.
    pub region: &'static str,
    /// Gap in standard deviations of its noise: of the mean, or of the scatter, whichever is further out.
    pub sigma: f64,
    /// Root mean square of the windows.
    pub rms: f64,
    /// Unit of `rms`.
    pub unit: &'static str,
    /// Windows.
    pub samples: usize,
    /// Whether the gap is beyond chance.
    pub significant: bool,
}

/// Where the gap lies.
#[derive(Clone, Debug)]
pub struct Location {
    /// Subsystem, if there is a gap.
    pub primary: Option<Subsystem>,
    /// Share of each subsystem.
    pub shares: Vec<(Subsystem, f64)>,
    /// Residual map.
    pub cells: Vec<Cell>,
    /// Subsystem of a structured remainder.
    pub unexplained_at: Option<Subsystem>,
    /// Subsystems in which that remainder might lie as well, as far as these recordings tell.
    pub or_at: Vec<Subsystem>,
}

/// Two-sided p-value of a standard normal deviate.
fn two_sided_p(z: f64) -> f64 {
    libm::erfc(z.abs() / std::f64::consts::SQRT_2)
}

/// Locates the gap of a decided campaign.
pub fn locate(problem: &Problem, search: &Search, decision: &Decision) -> Location {
    let remainder = matches!(decision.verdict, Verdict::Unexplained | Verdict::PartlyExplained);
    let unknown = remainder.then(|| of_unknown(problem, search, decision));
    let (mut places, seen_there) = unknown.map_or_else(Default::default, |u| (u.places, u.windows));
    // Without any effect, and with the tolerances that go with the verdict: tolerances fitted alone would have bent towards the gap and hidden it.
    let windows = if decision.verdict == Verdict::Unexplained {
        seen_there
    } else {
        balance::windows(problem, &Point { effects: effects::null(), ..decision.chosen.fit.point.clone() })
    };
    let mut cells = cells(&windows);
    mark_significant(&mut cells);
    let or_at = places.split_off(places.len().min(1));
    let unexplained_at = places.pop();
    let shares = shares(search, decision, unexplained_at);
    let first = decision.chosen.effects.first().map(|&e| REGISTRY[e].effect.subsystem);
    let primary = if decision.verdict == Verdict::NoGap { None } else { first.or(unexplained_at) };
    Location { primary, shares, cells, unexplained_at, or_at }
}

/// Share of each subsystem in what the tolerances alone leave: what its effects take away, and for an unknown gap what is left.
fn shares(search: &Search, decision: &Decision, unexplained_at: Option<Subsystem>) -> Vec<(Subsystem, f64)> {
    let chosen = &decision.chosen;
    let without = |e: usize| -> f64 {
        let rest: Vec<usize> = chosen.effects.iter().copied().filter(|o| *o != e).collect();
        let known = search.singles.iter().find(|h| !rest.is_empty() && h.effects == rest);
        known.map_or(search.base.fit.cost, |h| h.fit.cost) - chosen.fit.cost
    };
    let of_effects = chosen.effects.iter().map(|&e| (REGISTRY[e].effect.subsystem, without(e)));
    let left = (chosen.fit.cost - search.noise_cost).max(1.0);
    let mut shares: Vec<(Subsystem, f64)> = Vec::new();
    for (subsystem, cost) in of_effects.chain(unexplained_at.map(|s| (s, left))) {
        match shares.iter_mut().find(|(s, _)| *s == subsystem) {
            Some((_, sum)) => *sum += cost.max(0.0),
            None => shares.push((subsystem, cost.max(0.0))),
        }
    }
    let total: f64 = shares.iter().map(|s| s.1).sum();
    shares.iter_mut().for_each(|s| s.1 /= total.max(f64::MIN_POSITIVE));
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    shares
}

/// What may be wrong in one place only: a torque, or a speed as it is sensed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wrong {
    Engine,
    Driveline,
    Clutch,
    EngineSpeed,
    DiscSpeed,
}

/// Loss of one deviate, bounded so that single windows do not decide.
fn loss(z: f64) -> f64 {
    let z2 = z * z;
    z2 / (1.0 + z2 / SATURATION)
}

/// Square of a deviate at which its loss is half of what it could be at most.
const SATURATION: f64 = 400.0;

/// What is left unexplained of a window if only that one thing is wrong, in standard deviations.
fn left_by(wrong: Wrong, w: &Window) -> [f64; 2] {
    let (f, c) = (w.engine / w.sigma[0], w.driveline / w.sigma[1]);
    let sum = (w.engine + w.driveline) / w.sigma[0].hypot(w.sigma[1]);
    let slip = w.slip[0] / w.slip[1];
    match (wrong, w.phase) {
        // A sensor that errs leaves the other speed, and so the motion, as predicted.
        (Wrong::EngineSpeed, _) => [c, 0.0],
        (Wrong::DiscSpeed, _) => [f, 0.0],
        // Locked: the sides move as one, so that only their sum is a torque; slip that is measured is a sensor's.
        (Wrong::Clutch, 3) => [slip, sum],
        (_, 3) => [slip, 0.0],
        // Open: the clutch passes nothing that could be missing.
        (Wrong::Clutch, 1) => [f, c],
        (Wrong::Engine, _) => [c, 0.0],
        (Wrong::Driveline, _) => [f, 0.0],
        (Wrong::Clutch, _) => [sum, 0.0],
    }
}

/// A car whose tolerances explain what one wrong place leaves: its cost, and its windows.
struct Explanation {
    cost: f64,
    windows: Vec<Window>,
}

/// Rounds of reweighting.
const ROUNDS: usize = 8;

/// The windows at nominal tolerances, and at each tolerance moved by one standard deviation.
struct Moves {
    nominal: Vec<Window>,
    moved: Vec<Vec<Window>>,
    phases: Vec<Vec<u8>>,
}

fn moves(problem: &Problem, nominal: &Point) -> Moves {
    let phases = balance::phases(problem, nominal);
    let at = |k: usize| Coordinate::Nuisance(k).moved(nominal, 1.0);
    let moved = (0..problem.nuisances.len()).into_par_iter().map(|k| balance::windows_in(problem, &at(k), &phases)).collect();
    Moves { nominal: balance::windows_in(problem, nominal, &phases), moved, phases }
}

/// Moves the tolerances, at their price, to where what is `wrong` leaves least: linear in them, reweighted for the bounded loss.
fn explain(problem: &Problem, nominal: &Point, moves: &Moves, wrong: Wrong) -> Explanation {
    let rows = |w: &[Window]| w.iter().flat_map(|w| left_by(wrong, w)).collect::<Vec<f64>>();
    let here = rows(&moves.nominal);
    let n = moves.moved.len();
    let column = |w: &Vec<Window>| DVector::from_iterator(here.len(), rows(w).iter().zip(&here).map(|(a, b)| a - b));
    let mut matrix = DMatrix::zeros(here.len(), n);
    moves.moved.iter().enumerate().for_each(|(k, w)| matrix.set_column(k, &column(w)));
    let all: Vec<usize> = (0..n).collect();
    let mut z = DVector::zeros(n);
    let mut left = here.clone();
    for _ in 0..ROUNDS {
        let weights: Vec<f64> = left.iter().map(|r| (1.0 + r * r / SATURATION).powi(-2)).collect();
        let (mut curvature, mut gradient) = (DMatrix::identity(n, n), DVector::zeros(n));
        add_products(matrix.clone(), &here, &weights, &all, &mut curvature, &mut gradient);
        let Some(step) = curvature.cholesky() else { break };
        z = -step.solve(&gradient);
        left = here.iter().zip((&matrix * &z).iter()).map(|(a, b)| a + b).collect();
    }
    let point = Point { z: z.iter().copied().collect(), ..nominal.clone() };
    let windows = balance::windows_in(problem, &point, &moves.phases);
    let cost = rows(&windows).into_iter().map(loss).sum::<f64>() + z.norm_squared();
    Explanation { cost, windows }
}

/// Serial correlation of a balance, and net impulse, under which what is missing is no torque: the error of a speed sensor comes and goes, so that
/// its differences cancel from window to window (a correlation of −1/2 for one that is new in each), or at least over a recording, while a torque moves
/// the car for good.
const UNDOES_ITSELF: f64 = -0.25;
const NO_IMPULSE: f64 = 0.65;

/// Mean loss of the balances outside slip, relative to that in slip, under which a gap belongs to the clutch.
const ONLY_IN_SLIP: f64 = 0.25;

/// Whether the balances are short of torque only while the clutch slips: engine and driveline know nothing of its phase.
fn only_slipping(windows: &[Window]) -> bool {
    let mean = |slipping: bool| {
        let losses: Vec<f64> = windows
            .iter()
            .filter(|w| (w.phase == 2) == slipping)
            .map(|w| {
                let both = w.sigma[0].hypot(w.sigma[1]);
                if w.phase == 3 {
                    loss((w.engine + w.driveline) / both)
                } else {
                    loss(w.engine / w.sigma[0]).max(loss(w.driveline / w.sigma[1]))
                }
            })
            .collect();
        losses.iter().sum::<f64>() / losses.len().max(1) as f64
    };
    let rest = windows.iter().filter(|w| w.phase != 2).count();
    rest >= LEAST_WINDOWS && mean(false) < ONLY_IN_SLIP * mean(true)
}

/// Factor on the least leftover up to which the clutch is still in question.
const CLOSE: f64 = 1.3;

/// What a balance is short of in a window, and its standard deviation.
type Short = fn(&Window) -> [f64; 2];

/// Correlation of successive windows of one recording, beyond that of noise (windows share the sample between them); none if there is nothing but noise.
fn serial_correlation(windows: &[Window], read: Short) -> Option<f64> {
    let square: f64 = windows.iter().map(read).map(|[torque, sigma]| torque * torque - sigma * sigma).sum();
    let successive = windows.windows(2).filter(|p| p[0].recording == p[1].recording).map(|p| [read(&p[0]), read(&p[1])]);
    let product: f64 = successive.map(|[a, b]| a[0] * b[0] + 0.5 * a[1] * b[1]).sum();
    (square > 0.0).then(|| product / square)
}

/// Square of what a balance is short of over a recording, relative to what windows that know nothing of each other would add up to; beyond noise, and none
/// if there is nothing else.
fn net_impulse(windows: &[Window], read: Short) -> Option<f64> {
    let of = |recording: &[Window]| {
        let sum = |f: &dyn Fn([f64; 2]) -> f64| recording.iter().map(|w| f(read(w))).sum::<f64>();
        let noise = sum(&|[_, sigma]| sigma * sigma);
        [sum(&|[torque, _]| torque).powi(2) - noise, sum(&|[torque, _]| torque * torque) - noise]
    };
    let all = windows.chunk_by(|a, b| a.recording == b.recording).map(of);
    let [net, each] = all.fold([0.0; 2], |sum, of| [sum[0] + of[0], sum[1] + of[1]]);
    (each > 0.0).then(|| net / each)
}

/// Whether what a balance is short of is undone again, which no torque is: from window to window, over a recording, or already within each window.
fn undoes_itself(windows: &[Window], read: Short) -> bool {
    serial_correlation(windows, read).is_none_or(|c| c < UNDOES_ITSELF) || net_impulse(windows, read).is_none_or(|n| n < NO_IMPULSE)
}

/// Where a gap, or a remainder, may lie that no effect accounts for.
struct Unknown {
    /// Subsystems: the one that explains it best, and those that are nearly as good.
    places: Vec<Subsystem>,
    /// Windows with the tolerances that suit the first of them.
    windows: Vec<Window>,
}

/// A place that is wrong: its subsystem (none is the clutch, whose parts are told apart later), its cost with what speaks against it, its windows.
struct Suspect {
    place: Option<Subsystem>,
    cost: f64,
    windows: Vec<Window>,
}

/// Each place is given the tolerances that suit it best, at their price: those of the fit have been dragged away by a gap without cause in the
/// library.
fn of_unknown(problem: &Problem, search: &Search, decision: &Decision) -> Unknown {
    let nominal = Point { effects: decision.chosen.fit.point.effects, ..problem.nominal() };
    let moves = moves(problem, &nominal);
    let suspect = |place: Option<Subsystem>, wrong: Wrong| {
        let Explanation { cost, windows } = explain(problem, &nominal, &moves, wrong);
        Suspect { place, cost, windows }
    };
    let engine = suspect(Some(Subsystem::Engine), Wrong::Engine);
    let driveline = suspect(Some(Subsystem::Driveline), Wrong::Driveline);
    let mut clutch = suspect(None, Wrong::Clutch);
    if only_slipping(&clutch.windows) {
        clutch.cost /= CLOSE;
    }
    // The side of the clutch on which a torque, or a speed as it is sensed, is wrong.
    let (side, other_side, sensor, undone) = if engine.cost < driveline.cost {
        let undone = undoes_itself(&engine.windows, |w| [w.engine, w.sigma[0]]);
        (engine, driveline, Wrong::EngineSpeed, undone)
    } else {
        let undone = undoes_itself(&driveline.windows, |w| [w.driveline, w.sigma[1]]);
        (driveline, engine, Wrong::DiscSpeed, undone)
    };
    let suspects = if clutch.cost < side.cost {
        vec![clutch, side, other_side]
    } else {
        let mut sensor = suspect(Some(Subsystem::Sensors), sensor);
        sensor.cost /= if undone { UNDONE } else { LASTING };
        let [first, second] = if sensor.cost < side.cost { [sensor, side] } else { [side, sensor] };
        vec![first, second, other_side, clutch]
    };
    let nearly = CLOSE * suspects[0].cost;
    let near = suspects.iter().enumerate().filter(|(k, s)| *k == 0 || s.cost < nearly);
    let places =
        near.flat_map(|(_, s)| s.place.map_or_else(|| freeform::parts_of_clutch(problem, search, &nominal), |p| vec![p])).collect();
    Unknown { places, windows: suspects.into_iter().next().map_or_else(Vec::new, |s| s.windows) }
}

/// Factor on the cost of a torque that is wrong up to which a sensor is the better explanation: where what is missing undoes itself, and where it lasts.
const UNDONE: f64 = 2.0;
const LASTING: f64 = 0.5;

fn phase_name(phase: u8) -> &'static str {
    match phase {
        1 => "open",
        2 => "slipping",
        _ => "locked",
    }
}

fn region_name(w: &Window) -> &'static str {
    match (w.theta >= HOT_DEGC, w.torque >= HIGH_TORQUE_NM) {
        (false, false) => "cold, low torque",
        (false, true) => "cold, high torque",
        (true, false) => "hot, low torque",
        (true, true) => "hot, high torque",
    }
}

/// What a balance is, how it is read off a window (value and standard deviation), and its unit.
type Reading = (&'static str, &'static str, fn(&Window) -> Option<[f64; 2]>);

const READINGS: [Reading; 7] = [
    ("engine balance", "N.m", |w| (w.phase != 3).then_some([w.engine, w.sigma[0]])),
    ("driveline balance", "N.m", |w| (w.phase != 3).then_some([w.driveline, w.sigma[1]])),
    ("sum of both balances", "N.m", |w| (w.phase == 3).then_some([w.engine + w.driveline, w.sigma[0].hypot(w.sigma[1])])),
    ("torque map", "N.m", |w| {
        let of_balances = (w.phase == 2).then_some([0.5 * (w.driveline - w.engine), 0.5 * w.sigma[0].hypot(w.sigma[1])]);
        w.bench[1].filter(|_| w.phase == 2).or(of_balances)
    }),
    ("speed sensors", "rad/s", |w| (w.phase == 3).then_some(w.slip)),
    ("actuator", "mm", |w| w.bench[0]),
    ("thermal", "K", |w| w.bench[2]),
];

/// Least number of windows in a cell.
const LEAST_WINDOWS: usize = 4;

fn cells(windows: &[Window]) -> Vec<Cell> {
    let mut cells = Vec::new();
    for (equation, unit, read) in READINGS {
        for phase in 1..=3 {
            for region in ["cold, low torque", "cold, high torque", "hot, low torque", "hot, high torque"] {
                let here = windows.iter().filter(|w| w.phase == phase && region_name(w) == region);
                let readings: Vec<[f64; 2]> = here.filter_map(read).collect();
                if readings.len() >= LEAST_WINDOWS {
                    cells.push(cell(equation, phase_name(phase), region, unit, &readings));
                }
            }
        }
    }
    cells
}

fn cell(equation: &'static str, phase: &'static str, region: &'static str, unit: &'static str, readings: &[[f64; 2]]) -> Cell {
    let n = readings.len() as f64;
    let z: Vec<f64> = readings.iter().map(|[v, s]| v / s).collect();
    let mean = z.iter().sum::<f64>() / n.sqrt();
    // Wilson and Hilferty: the cube root of a mean square is nearly normal.
    let square = z.iter().map(|z| z * z).sum::<f64>() / n;
    let spread = 2.0 / (9.0 * n);
    let scatter = (square.cbrt() - (1.0 - spread)) / spread.sqrt();
    let sigma = if mean.abs() > scatter.abs() { mean.abs() } else { scatter.max(0.0) };
    let rms = (readings.iter().map(|[v, _]| v * v).sum::<f64>() / n).sqrt();
    Cell { equation, phase, region, sigma, rms, unit, samples: readings.len(), significant: false }
}

/// Holm's procedure over all cells; two looks at each (mean and scatter) count twice.
fn mark_significant(cells: &mut [Cell]) {
    let mut order: Vec<usize> = (0..cells.len()).collect();
    order.sort_by(|&a, &b| cells[b].sigma.total_cmp(&cells[a].sigma));
    let tests = cells.len();
    for (rank, &k) in order.iter().enumerate() {
        if 2.0 * two_sided_p(cells[k].sigma) * (tests - rank) as f64 > FAMILY_WISE_ERROR {
            break;
        }
        cells[k].significant = true;
    }
}
