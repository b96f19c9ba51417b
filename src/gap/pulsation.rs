//! Torques that pulsate: starts for one that keeps time with the slip angle, and the clock of one that no effect stands for.
//!
//! A torque ripple T cos(nφ) reaches the flywheel speed through 1/J_f and the memory of the corrected replay. For every
//! order n the response is computed from measured slip and predicted torque, and the orders that explain most of the residual in flywheel
//! speed become starts. A scan is needed because the response loses its phase within a few hundredths of the order.

use super::coordinate::Coordinate;
use super::fit::{Fit, fit_along};
use super::predict::{Follow, HORIZON_S, predict};
use super::problem::{Point, Problem, Residuals};
use super::series::Series;
use crate::effects::Entry;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Orders per radian that are scanned.
const ORDERS: std::ops::Range<f64> = 0.15..12.0;
/// Orders that become starts.
const STARTS: usize = 2;
/// Orders that are tried for it, each with this many iterations.
const LOBES: usize = 6;
const POLISH: usize = 3;

/// Samples of a recording that the scan looks at: the first slip of a long recording tells as much as all of it.
const LONGEST_TRACK: usize = 2000;

/// What a pulsation keeps time with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// Time itself, in turns per second: something oscillates by itself.
    Time,
    /// The crankshaft's angle: something turns with it.
    Crank,
}

impl Clock {
    /// Frequencies in Hz, or orders per radian of the crankshaft, that are scanned: first, last, step.
    fn scanned(self) -> [f64; 3] {
        match self {
            Self::Time => [1.5, 20.0, 0.03],
            Self::Crank => [0.3, 2.2, 0.0015],
        }
    }
}

/// Share of a residual beyond the noise that one rhythm has to take.
const RHYTHMIC: f64 = 0.4;

/// The clock of a gap that comes and goes in one rhythm while the clutch slips, if it does. Each recording has a phase of its own.
pub fn rhythm(problem: &Problem, point: &Point, residuals: &[Residuals]) -> Option<Clock> {
    let of = |clock: Clock| {
        let tracks: Vec<Track> = problem
            .series
            .iter()
            .enumerate()
            .filter_map(|(k, s)| {
                let track = track(problem, point, k, s, &residuals[k])?;
                let angle = angles(s, track.angle.len(), |j| if clock == Clock::Time { 2.0 * PI } else { s.measured[0][j] });
                Some(Track { angle, ..track })
            })
            .collect();
        let noise: f64 = tracks.iter().map(|t| t.noise * t.noise * t.residual.len() as f64).sum();
        let beyond = tracks.iter().flat_map(|t| &t.residual).map(|r| r * r).sum::<f64>() - noise;
        let [first, last, step] = clock.scanned();
        let count = ((last - first) / step) as usize;
        let mut taken = vec![0.0; count];
        for track in &tracks {
            let own = scan(std::slice::from_ref(track), first, step, count);
            taken.iter_mut().zip(own).for_each(|(sum, (gain, _))| *sum += gain);
        }
        taken.into_iter().fold(0.0, f64::max) / beyond.max(1e-9)
    };
    let [time, crank] = [Clock::Time, Clock::Crank].map(of);
    let best = if time > crank { (Clock::Time, time) } else { (Clock::Crank, crank) };
    (best.1 > RHYTHMIC).then_some(best.0)
}

/// Angle in rad that this speed, in rad/s sample by sample, has turned in the middle of each interval between residuals: what acts from one residual to
/// the next acts at that angle. At the interval's beginning it would be out by half of what it turns meanwhile, which is a radian for a fast one and
/// nothing for a slow one.
fn angles(series: &Series, intervals: usize, speed: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut turned = Vec::with_capacity(series.len());
    let mut angle = 0.0;
    for j in 0..series.len() {
        turned.push(angle);
        angle += 0.5 * (speed(j) + speed((j + 1).min(series.len() - 1))) * series.dt;
    }
    let last = turned.len() - 1;
    let middle = |twice: usize| 0.5 * (turned[(twice / 2).min(last)] + turned[twice.div_ceil(2).min(last)]);
    (0..intervals).map(|k| middle((2 * k + 1) * series.block)).collect()
}

/// One recording's torque and slip angle, and the residual to be explained.
struct Track {
    noise: f64,
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
    for (k, (gain, amplitudes)) in scan(&tracks, ORDERS.start, step, count).into_iter().enumerate() {
        let order = ORDERS.start + k as f64 * step;
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
    // Side lobes explain nearly as much, but only the order itself gets better when it is let free.
    let own: Vec<Coordinate> = entry.parameters.clone().map(Coordinate::Effect).collect();
    let polished = |s: &(f64, f64, [f64; 2])| fit_along(problem, own.clone(), &set(s), POLISH, None);
    let mut fits: Vec<Fit> = found[..found.len().min(LOBES)].par_iter().map(polished).collect();
    fits.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    fits.truncate(STARTS);
    // An order that is one turn out at the end of the longest slip is a minimum of its own, to which no gradient leads.
    let turn = Coordinate::Effect(entry.parameters.start + 2);
    let neighbours = fits.first().map(|best| [-2.0, -1.0, 1.0, 2.0].map(|turns| turn.moved(&best.point, turns * 2.0 * PI / longest)));
    let beside = neighbours.into_par_iter().flatten().map(|p| fit_along(problem, own.clone(), &p, POLISH, None));
    let better = beside.min_by(|a, b| a.cost.total_cmp(&b.cost)).filter(|f| f.cost < fits[0].cost);
    if let Some(better) = better {
        fits[0] = better;
    }
    fits.into_iter().map(|f| f.point).collect()
}

fn track(problem: &Problem, point: &Point, k: usize, series: &Series, residuals: &Residuals) -> Option<Track> {
    let (vehicle, effects) = problem.plant_at(point);
    let predicted = predict(series, &vehicle, &effects, point.theta_shift[k], Follow::Horizon(HORIZON_S));
    let block = series.block;
    let samples = (series.len() / block).min(LONGEST_TRACK);
    let dt = series.dt * block as f64;
    let angle = angles(series, samples, |j| (series.measured[0][j] - series.measured[1][j]).max(0.0));
    // Only what slips pulsates: a locked clutch passes what it has to.
    let slipping = predicted.value[3].iter().zip(&predicted.phase).map(|(torque, phase)| if *phase == 2 { *torque } else { 0.0 });
    let torque: Vec<f64> = slipping.step_by(block).take(samples).collect();
    // Residuals are in standard deviations of block means.
    let scale = series.noise[0] / (block as f64).sqrt();
    let residual: Vec<f64> = residuals.iter().take(samples).map(|r| r * scale).collect();
    angle.last().is_some_and(|phi| *phi > 2.0 * PI).then(|| Track {
        noise: scale,
        torque,
        angle,
        residual,
        gain: dt / vehicle.driveline.J_f,
        forget: (-dt / HORIZON_S).exp(),
    })
}

/// Neighbouring orders that one task scans: the cosines of one follow from those of the one before by a rotation.
const NEIGHBOURS: usize = 64;

/// For `count` orders from `first` on: the sum of squares that a pulsation of this order explains, and its amplitudes (cosine, sine).
fn scan(tracks: &[Track], first: f64, step: f64, count: usize) -> Vec<(f64, [f64; 2])> {
    let chunk = |from: usize| {
        let turned = |order: f64| -> Vec<Vec<(f64, f64)>> {
            tracks.iter().map(|t| t.angle.iter().map(|angle| (order * angle).sin_cos()).collect()).collect()
        };
        let (mut phasors, rotations) = (turned(first + from as f64 * step), turned(step));
        (from..count.min(from + NEIGHBOURS))
            .map(|_| {
                let found = explained(tracks, &phasors);
                for ((sin, cos), (rs, rc)) in phasors.iter_mut().flatten().zip(rotations.iter().flatten()) {
                    (*sin, *cos) = (*sin * rc + *cos * rs, *cos * rc - *sin * rs);
                }
                found
            })
            .collect::<Vec<_>>()
    };
    let starts: Vec<usize> = (0..count).step_by(NEIGHBOURS).collect();
    starts.into_par_iter().flat_map_iter(chunk).collect()
}

/// Sum of squares that a pulsation explains whose sines and cosines per track are given, and its amplitudes (cosine, sine).
fn explained(tracks: &[Track], phasors: &[Vec<(f64, f64)>]) -> (f64, [f64; 2]) {
    let (mut cc, mut ss, mut cs, mut cr, mut sr) = (1e-9, 1e-9, 0.0, 0.0, 0.0);
    for (t, turned) in tracks.iter().zip(phasors) {
        let (mut c, mut s) = (0.0, 0.0);
        for ((torque, (sin, cos)), r) in t.torque.iter().zip(turned).zip(&t.residual) {
            cc += c * c;
            ss += s * s;
            cs += c * s;
            cr += c * r;
            sr += s * r;
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
