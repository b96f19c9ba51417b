//! Where the gap lies: torque balances, the slip of a locked clutch, position and temperature, by phase and region.
//!
//! Over windows of about 0.1 s the innovations of the corrected replay give the torque that each side of the clutch is
//! short of: δT_f = J_f Δe_f/W on the engine side, δT_c = J_c Δe_c/W on the driveline's, where Δe is what the innovation
//! gained in the window beyond what the correction forgets. An error of the engine shows in δT_f alone, one of the driveline in δT_c alone, one of the clutch in both
//! with opposite sign; while locked only their sum is seen, and slip that is measured there belongs to the sensors.

use super::predict::{Follow, HORIZON_S, Prediction, predict};
use super::problem::{Point, Problem};
use super::series::{Channel, Series};

/// Length of a window, s.
const WINDOW_S: f64 = 0.1;

/// Temperature that parts cold from hot, °C.
pub const HOT_DEGC: f64 = 70.0;

/// Clutch torque that parts low from high, N·m.
pub const HIGH_TORQUE_NM: f64 = 25.0;

/// One window of one recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Recording.
    pub recording: usize,
    /// Time of its middle, s.
    pub time: f64,
    /// Phase as predicted: 1 open, 2 slipping, 3 locked.
    pub phase: u8,
    /// Torque missing on the engine side, N·m.
    pub engine: f64,
    /// Torque missing on the driveline side, N·m.
    pub driveline: f64,
    /// Standard deviations of these two, N·m.
    pub sigma: [f64; 2],
    /// Measured slip beyond the predicted one, rad/s, and its standard deviation.
    pub slip: [f64; 2],
    /// Predicted slip, rad/s.
    pub predicted_slip: f64,
    /// Disc temperature, °C.
    pub theta: f64,
    /// Predicted clutch torque, N·m.
    pub torque: f64,
    /// Mean errors of position, torque and temperature sensors with their standard deviations; none without the sensor.
    pub bench: [Option<[f64; 2]>; 3],
}

/// Windows of all recordings at a point.
pub fn windows(problem: &Problem, point: &Point) -> Vec<Window> {
    windows_in(problem, point, &phases(problem, point))
}

/// Predicted phase of every sample of every recording.
pub fn phases(problem: &Problem, point: &Point) -> Vec<Vec<u8>> {
    (0..problem.series.len()).map(|k| replay(problem, point, k).phase).collect()
}

/// Windows of all recordings at a point, cut where these `phases` (recording, sample) change: the same windows at any point.
pub fn windows_in(problem: &Problem, point: &Point, phases: &[Vec<u8>]) -> Vec<Window> {
    (0..problem.series.len()).flat_map(|k| of_recording(problem, point, k, &phases[k])).collect()
}

fn replay(problem: &Problem, point: &Point, k: usize) -> Prediction {
    let (vehicle, effects) = problem.plant_at(point);
    predict(&problem.series[k], &vehicle, &effects, point.theta_shift[k], Follow::Horizon(HORIZON_S))
}

fn of_recording(problem: &Problem, point: &Point, k: usize, phase: &[u8]) -> Vec<Window> {
    let series: &Series = &problem.series[k];
    let vehicle = problem.plant_at(point).0;
    let predicted = replay(problem, point, k);
    let length = (WINDOW_S / series.dt).round().max(1.0) as usize;
    let share = 1.0 - (-series.dt / HORIZON_S).exp();
    let error = |c: Channel, j: usize| series.measured[c as usize][j] - predicted.value[c as usize][j];
    let d = &vehicle.driveline;
    let span = length as f64 * series.dt;
    let mut all = Vec::new();
    let mut first = 0;
    while first + length < series.len() {
        let last = first + length;
        let steady = phase[first..=last].iter().all(|p| *p == phase[first]);
        if steady {
            let gained = |c: Channel| error(c, last) - error(c, first) + share * (first..last).map(|j| error(c, j)).sum::<f64>();
            let spread = |c: Channel, j: f64| j / span * series.noise[c as usize] * (2.0 + length as f64 * share * share).sqrt();
            let mean = |f: &dyn Fn(usize) -> f64| (first..last).map(f).sum::<f64>() / length as f64;
            let root = (length as f64).sqrt();
            let bench = [Channel::XTo, Channel::TFc, Channel::ThetaC]
                .map(|c| (!series.measured[c as usize].is_empty()).then(|| [mean(&|j| error(c, j)), series.noise[c as usize] / root]));
            all.push(Window {
                recording: k,
                time: 0.5 * (first + last) as f64 * series.dt,
                phase: phase[first],
                engine: d.J_f * gained(Channel::OmegaF) / span,
                driveline: d.J_c * gained(Channel::OmegaC) / span,
                sigma: [spread(Channel::OmegaF, d.J_f), spread(Channel::OmegaC, d.J_c)],
                slip: [mean(&|j| error(Channel::OmegaF, j) - error(Channel::OmegaC, j)), series.noise[0].hypot(series.noise[1]) / root],
                predicted_slip: mean(&|j| predicted.value[0][j] - predicted.value[1][j]).abs(),
                theta: mean(&|j| predicted.value[4][j]),
                torque: mean(&|j| predicted.value[3][j]).abs(),
                bench,
            });
        }
        first = last;
    }
    all
}
