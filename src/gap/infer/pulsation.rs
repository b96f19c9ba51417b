//! Where a fit of a torque ripple may start: it loses its phase within a few hundredths of its order, so no gradient leads to it.
//!
//! A ripple of order k adds δT = T (a cos kφ + b sin kφ) to the clutch torque, φ the slip angle. It moves the flywheel's innovations through the same filter
//! that corrects the replay. For every order the two amplitudes follow from a linear least-squares fit to these innovations; the best orders, and those that
//! turn once more or less on the way, are starts.

use super::coordinate::Coordinate;
use super::density::{Point, Problem};
use super::fit::{Fit, along};
use super::linear::Frame;
use crate::effects::{Act, REGISTRY};
use crate::gap::model::replay;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Orders that are scanned, per radian of slip.
const ORDERS: std::ops::Range<f64> = 0.15..12.0;
/// Orders that are tried, those that become starts, and the iterations of a try.
const TRIED: usize = 5;
const STARTS: usize = 2;
const POLISH: usize = 2;
/// Slip angle, rad, that one track spans at most: a drive's engagements have angles of their own.
const LONGEST_ANGLE: f64 = 600.0;
/// Neighbouring orders that one task scans.
const NEIGHBOURS: usize = 64;
/// Share of the flywheel's squared innovations that a ripple has to take to be tried: chance alone takes a few thousandths.
const LEAST_SHARE: f64 = 0.01;

/// Torque, slip angle and weighted innovation of one engagement.
struct Stretch {
    torque: Vec<f64>,
    angle: Vec<f64>,
    innovation: Vec<f64>,
    /// Change of the flywheel's speed per N·m over an interval, and how the filter forgets it.
    gain: Vec<f64>,
    forget: Vec<f64>,
    weight: Vec<f64>,
}

/// Points at which a ripple is set as the scan finds it.
pub fn starts(problem: &Problem, point: &Point) -> Vec<(usize, Point)> {
    let Some((effect, entry)) = REGISTRY.iter().enumerate().find(|(_, e)| matches!(e.effect.act, Act::Pulsation(_))) else {
        return Vec::new();
    };
    let stretches: Vec<Stretch> = (0..problem.tracks.len()).into_par_iter().flat_map_iter(|k| stretches(problem, point, k)).collect();
    let Some(longest) = stretches.iter().filter_map(|s| s.angle.last()).copied().reduce(f64::max) else { return Vec::new() };
    let whole: f64 = stretches.iter().flat_map(|s| &s.innovation).map(|r| r * r).sum();
    let step = (0.5 * PI / longest).clamp(0.002, 0.05);
    let count = ((ORDERS.end - ORDERS.start) / step) as usize;
    let mut found: Vec<(f64, f64, [f64; 2])> = Vec::new();
    for (k, (gain, amplitudes)) in scan(&stretches, ORDERS.start, step, count).into_iter().enumerate() {
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
    found.retain(|f| f.0 > LEAST_SHARE * whole);
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let set = |(_, order, amplitudes): &(f64, f64, [f64; 2])| {
        let mut start = point.clone();
        let k = entry.parameters.start;
        (start.effects[k], start.effects[k + 1]) = (amplitudes[0].clamp(-0.9, 0.9), amplitudes[1].clamp(-0.9, 0.9));
        start.effects[k + 2] = *order;
        start
    };
    // Side lobes explain nearly as much, but only the order itself gets better when it is let free.
    let own = || Frame { shared: entry.parameters.clone().map(Coordinate::Effect).collect(), own: Vec::new() };
    let mut fits: Vec<Fit> = found.iter().take(TRIED).map(|f| along(problem, own(), None, &set(f), POLISH, None)).collect();
    fits.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    fits.truncate(STARTS);
    // An order that is one turn out at the end of the longest slip is a minimum of its own.
    let neighbours: Vec<Point> = fits.first().map_or_else(Vec::new, |best| {
        let moved = |turns: f64| {
            let mut p = best.point.clone();
            p.effects[entry.parameters.start + 2] += turns * 2.0 * PI / longest;
            p
        };
        [-1.0, 1.0].map(moved).to_vec()
    });
    let beside: Vec<Fit> = neighbours.iter().map(|p| along(problem, own(), None, p, POLISH, None)).collect();
    if let Some(better) = beside.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost)).filter(|f| f.cost < fits[0].cost) {
        fits[0] = better;
    }
    fits.into_iter().map(|f| (effect, f.point)).collect()
}

fn stretches(problem: &Problem, point: &Point, k: usize) -> Vec<Stretch> {
    let (track, filter) = (&problem.tracks[k], &problem.filters[k]);
    let car = problem.car(point, Some(k));
    let n = track.observations();
    let (mut torque, mut slip) = (vec![0.0; n], vec![0.0; n]);
    let innovations = replay::corrected(track, filter, &car, problem.temperatures(point, k), None, |row, now| {
        let j = track.observation_of(row);
        torque[j] = if now.phase == crate::plant::Phase::Slipping { now.t_fc } else { 0.0 };
        slip[j] = (now.omega_f - now.omega_c).max(0.0);
    });
    let mut all = Vec::new();
    let (mut angle, mut j) = (0.0, 0);
    while j < n {
        let mut s = Stretch { torque: vec![], angle: vec![], innovation: vec![], gain: vec![], forget: vec![], weight: vec![] };
        let begin = angle;
        while j < n && angle - begin < LONGEST_ANGLE {
            let gain = &filter.gains[j];
            s.torque.push(torque[j]);
            // What acts from one observation to the next acts at the angle in the middle.
            s.angle.push(angle + 0.5 * slip[j] * gain.interval);
            s.innovation.push(innovations[2 * j]);
            s.gain.push(gain.interval / car.vehicle.driveline.J_f);
            s.forget.push(1.0 - gain.of[0][0]);
            s.weight.push(gain.weight[0]);
            angle += slip[j] * gain.interval;
            j += 1;
        }
        if s.torque.iter().filter(|t| **t > 0.0).count() > 10 {
            all.push(s);
        }
    }
    all
}

/// For `count` orders from `first` on: the sum of squares that a pulsation of this order explains, and its amplitudes (cosine, sine).
fn scan(stretches: &[Stretch], first: f64, step: f64, count: usize) -> Vec<(f64, [f64; 2])> {
    let chunk = |from: usize| {
        let turned = |order: f64| -> Vec<Vec<(f64, f64)>> {
            stretches.iter().map(|t| t.angle.iter().map(|angle| (order * angle).sin_cos()).collect()).collect()
        };
        let (mut phasors, rotations) = (turned(first + from as f64 * step), turned(step));
        (from..count.min(from + NEIGHBOURS))
            .map(|_| {
                let found = explained(stretches, &phasors);
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

/// Sum of squares that a pulsation explains whose sines and cosines are given, and its amplitudes (cosine, sine).
fn explained(stretches: &[Stretch], phasors: &[Vec<(f64, f64)>]) -> (f64, [f64; 2]) {
    let (mut cc, mut ss, mut cs, mut cr, mut sr) = (1e-9, 1e-9, 0.0, 0.0, 0.0);
    for (t, turned) in stretches.iter().zip(phasors) {
        let (mut c, mut s) = (0.0, 0.0);
        for j in 0..t.torque.len() {
            let w = t.weight[j];
            let (wc, ws, r) = (w * c, w * s, t.innovation[j]);
            cc += wc * wc;
            ss += ws * ws;
            cs += wc * ws;
            cr += wc * r;
            sr += ws * r;
            let (sin, cos) = turned[j];
            c = t.forget[j] * c - t.gain[j] * t.torque[j] * cos;
            s = t.forget[j] * s - t.gain[j] * t.torque[j] * sin;
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
