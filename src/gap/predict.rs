//! One-step-ahead predictions: the plant driven by a recording and pulled towards its speeds.
//!
//! The plant is driven by the recorded torque and position, never by a controller. After each sample its speeds move by a
//! share of the innovation (measured minus predicted), which forgets the past within [`HORIZON_S`]: errors stay where they
//! arise, and neither lock-up nor a random walk of the torque report runs away with the replay. Temperature, position and torque are not
//! corrected.

use super::series::{Channel, Series};
use crate::effects::Parameters;
use crate::plant::{Inputs, Plant, Start};
use crate::vehicle::Vehicle;

/// Memory of the corrected replay, s.
pub const HORIZON_S: f64 = 0.25;

/// Substep of the plant in a fit, s; the error it adds is far below any sensor's noise.
pub const SUBSTEP_S: f64 = 1e-2;

/// How a replay follows its recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Follow {
    /// Corrected towards the measured speeds with this memory in s.
    Horizon(f64),
    /// Free after the first sample.
    Open,
}

/// What the plant predicts for one recording, by [`Channel`]; missing channels too.
#[derive(Clone, Debug)]
pub struct Prediction {
    /// Predicted value per channel and sample.
    pub value: [Vec<f64>; 5],
    /// The plant's phase per sample, numbered as the FMU's enumeration.
    pub phase: Vec<u8>,
}

/// Largest slip in rad/s at which a recording that starts closed counts as starting locked.
const LOCKED_SLIP: f64 = 0.6;

/// Speeds at the first sample; a clutch that is closed on two nearly equal speeds starts locked.
pub fn start(series: &Series, vehicle: &Vehicle, effects: &Parameters, theta_shift: [f64; 2]) -> Start {
    use crate::effects::param::clutch_speed_gain::gain;
    let first = |c: Channel| series.measured[c as usize][0];
    let (omega_f, omega_c) = (first(Channel::OmegaF), first(Channel::OmegaC) / effects[gain]);
    let closed = series.x_to[0] > 0.5 * (vehicle.actuator.x_cnt_0 + vehicle.actuator.x_cls_0);
    let theta = series.theta_0;
    let (omega_f, omega_c) = if closed && (omega_f - omega_c).abs() < LOCKED_SLIP.max(6.0 * series.noise[0]) {
        let mean = 0.5 * (omega_f + omega_c);
        (mean, mean)
    } else {
        (omega_f, omega_c)
    };
    Start { omega_f, omega_c, theta_c: theta[0] + theta_shift[0], theta_b: theta[1] + theta_shift[1] }
}

/// Replays a recording.
pub fn predict(series: &Series, vehicle: &Vehicle, effects: &Parameters, theta_shift: [f64; 2], follow: Follow) -> Prediction {
    let n = series.len();
    let inputs = |k: usize| Inputs { x_to: series.x_to[k], t_e_ref: series.t_e[k], theta_h: series.theta_h[k], t_load: 0.0 };
    let mut plant = Plant::new(vehicle, effects, &start(series, vehicle, effects, theta_shift), &inputs(0));
    plant.set_max_substep(SUBSTEP_S);
    let share = match follow {
        Follow::Horizon(seconds) => 1.0 - (-series.dt / seconds).exp(),
        Follow::Open => 0.0,
    };
    let gain = plant.config().constants.clutch_speed_gain;
    let mut value: [Vec<f64>; 5] = std::array::from_fn(|_| Vec::with_capacity(n));
    let mut phase = Vec::with_capacity(n);
    for k in 0..n {
        let now = plant.outputs();
        for (column, v) in value.iter_mut().zip([now.omega_f, now.omega_c, now.x_to_actual, now.t_fc, now.theta_c]) {
            column.push(v);
        }
        phase.push(now.phase as u8);
        if share > 0.0 {
            // Until the memory is filled the correction is the running mean: the noise of one first sample would else stay for all of it.
            let share = share.max(1.0 / (k + 1) as f64);
            let e = |c: Channel, v: f64| series.measured[c as usize][k] - v;
            plant.correct_speeds(share * e(Channel::OmegaF, now.omega_f), share * e(Channel::OmegaC, now.omega_c) / gain);
        }
        plant.step(&inputs(k), series.dt);
    }
    Prediction { value, phase }
}
