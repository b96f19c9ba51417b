//! Starts for a torque that pulsates with the slip angle: a scan over its order.
//!
//! A torque ripple T cos(nφ) reaches the flywheel speed through 1/J_f and the memory of the corrected replay. For every
//! order n the response is computed from measured slip and predicted torque, and the orders that explain most of the residual in flywheel
//! speed become starts. A scan is needed because the response loses its phase within a few hundredths of the order.

use super::fit::{Point, Problem, Residuals};
use super::predict::{Follow, HORIZON_S, predict};
use super::series::Series;
use crate::effects::Entry;
use std::f64::consts::PI;

/// Orders per radian that are scanned.
const ORDERS: std::ops::Range<f64> = 0.15..12.0;
/// Orders that become starts.
const STARTS: usize = 2;

/// Samples of a recording that the scan looks at: the first slip of a long recording tells as much as all of it.
const LONGEST_TRACK: usize = 2000;

/// One recording's torque and slip angle, and the residual to be explained.
struct Track {
    torque: Vec<f64>,
    angle: Vec<f64>,
    residual: Vec<f64>,
    gain: f64,
    forget: f64,
}

/// Points at which the effect `entry` (amplitudes: cosine, sine; shape: order) is set as the scan finds it.
pub fn starts(problem: &Problem, point: &Point, residuals: &[Residuals], entry: &Entry) -> Vec<Point> {
    let tracks: Vec<Track> = problem.series.iter().enumerate().filter_map(|(k, s)| track(problem, point, k, s, &residuals[k])).collect();
    let Some(longest) = tracks.iter().filter_map(|t| t.angle.last()).copied().reduce(f64::max) else {
        return Vec::new();
    };
    // A quarter of a turn at the end of the longest slip.
    let step = (0.5 * PI / longest).clamp(0.002, 0.05);
    let mut found: Vec<(f64, f64, [f64; 2])> = Vec::new();
    let count = ((ORDERS.end - ORDERS.start) / step) as usize;
    for k in 0..count {
        let order = ORDERS.start + k as f64 * step;
        let (gain, amplitudes) = explained(&tracks, order);
        match found.last_mut() {
            Some(last) if order - last.1 < 20.0 * step => {
                if gain > last.0 {
                    *last = (gain, order, amplitudes);
                }
            }
            _ => found.push((gain, order, amplitudes)),
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let set = |(_, order, amplitudes): &(f64, f64, [f64; 2])| {
        let mut start = point.clone();
        let k = entry.parameters.start;
        (start.effects[k], start.effects[k + 1]) = (amplitudes[0].clamp(-0.9, 0.9), amplitudes[1].clamp(-0.9, 0.9));
        start.effects[k + 2] = *order;
        start
    };
    found.iter().take(STARTS).map(set).collect()
}

fn track(problem: &Problem, point: &Point, k: usize, series: &Series, residuals: &Residuals) -> Option<Track> {
    let (vehicle, effects) = problem.plant_at(point);
    let predicted = predict(series, &vehicle, &effects, point.theta_shift[k], Follow::Horizon(HORIZON_S));
    let block = series.block;
    let samples = (series.len() / block).min(LONGEST_TRACK);
    let dt = series.dt * block as f64;
    let mut angle = Vec::with_capacity(samples);
    let mut phi = 0.0;
    for j in 0..samples * block {
        if j % block == 0 && angle.len() < samples {
            angle.push(phi);
        }
        phi += (series.measured[0][j] - series.measured[1][j]).max(0.0) * series.dt;
    }
    let torque: Vec<f64> = predicted.value[3].iter().step_by(block).take(samples).copied().collect();
    // Residuals are in standard deviations of block means.
    let scale = series.noise[0] / (block as f64).sqrt();
    let residual: Vec<f64> = residuals.iter().take(samples).map(|r| r * scale).collect();
    (phi > 2.0 * PI).then(|| Track { torque, angle, residual, gain: dt / vehicle.driveline.J_f, forget: (-dt / HORIZON_S).exp() })
}

/// Sum of squares that a pulsation of this order explains, and its amplitudes (cosine, sine).
fn explained(tracks: &[Track], order: f64) -> (f64, [f64; 2]) {
    let (mut cc, mut ss, mut cs, mut cr, mut sr) = (1e-9, 1e-9, 0.0, 0.0, 0.0);
    for t in tracks {
        let (mut c, mut s) = (0.0, 0.0);
        for ((torque, angle), r) in t.torque.iter().zip(&t.angle).zip(&t.residual) {
            cc += c * c;
            ss += s * s;
            cs += c * s;
            cr += c * r;
            sr += s * r;
            let (sin, cos) = (order * angle).sin_cos();
            c = t.forget * c - t.gain * torque * cos;
            s = t.forget * s - t.gain * torque * sin;
        }
    }
    let determinant = cc * ss - cs * cs;
    if determinant <= 1e-6 * cc * ss {
        return (0.0, [0.0; 2]);
    }
    let a = (ss * cr - cs * sr) / determinant;
    let b = (cc * sr - cs * cr) / determinant;
    (a * cr + b * sr, [a, b])
}
