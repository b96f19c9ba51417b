//! Start points for the fit of a torque ripple: a ripple loses its phase if its order is off by a few hundredths, so that no gradient leads to the right order.
//!
//! A ripple of order k adds δT = T (a cos kφ + b sin kφ) to the clutch torque, where φ is the slip angle. It moves the flywheel's innovations through the same filter that corrects
//! the replay. For every order the two amplitudes follow from a linear least-squares fit to these innovations. Starts are the best orders, and those whose phase is one turn more
//! or less at the end of the longest slip. In a whole drive the slip angle grows too large to try every order that it would tell apart: orders are first tried as if each
//! engagement had a phase of its own, and then, near the best, with one phase for all.

use super::coordinate::Coordinate;
use super::density::{Point, Problem};
use super::fit::{Fit, along};
use super::linear::Frame;
use super::sensors;
use crate::effects::{Act, REGISTRY};
use crate::gap::model::replay;
use crate::gap::model::tolerance::Signal;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Range of orders that are scanned, in radians of phase per radian of slip.
const ORDERS: std::ops::Range<f64> = 0.15..12.0;
/// Number of orders that are tried, number of those that become starts, and iterations of a try.
const TRIED: usize = 5;
const STARTS: usize = 2;
const POLISH: usize = 2;
/// Number of observations that still count as part of an engagement after its end; after more, the filter has forgotten it.
const REMEMBERED: usize = 20;
/// Largest slip angle, rad, that a stretch spans.
const LONGEST_ANGLE: f64 = 600.0;
/// Finest step of the first scan, and the largest ratio of the steps of first and second scan. Both bound the work for drives of hours, whose phase is lost on the way.
const FINEST: f64 = 0.002;
const FINER: f64 = 100.0;
/// Number of steps of the first scan within which only the best order counts, because side lobes are not orders of their own.
const LOBES: f64 = 20.0;
/// Number of neighbouring orders that one task scans.
const NEIGHBOURS: usize = 64;
/// Share of the flywheel's squared innovations that a ripple must explain to be tried; chance alone explains a few thousandths.
const LEAST_SHARE: f64 = 0.01;

/// Clutch torque, slip angle and whitened innovation of the flywheel speed in one engagement, by observation.
#[derive(Default)]
struct Stretch {
    torque: Vec<f64>,
    angle: Vec<f64>,
    innovation: Vec<f64>,
    /// Change of the flywheel's speed per N·m over an interval, and the share of an earlier change that the filter's correction leaves.
    gain: Vec<f64>,
    forget: Vec<f64>,
    weight: Vec<f64>,
}

/// Points at which a ripple is set as the scan finds it, each with the index of the ripple's effect. A ripple must reduce the cost by at least `least`.
pub fn starts(problem: &Problem, point: &Point, least: f64) -> Vec<(usize, Point)> {
    let Some((effect, entry)) = REGISTRY.iter().enumerate().find(|(_, e)| matches!(e.effect.act, Act::Pulsation(_))) else {
        return Vec::new();
    };
    let stretches: Vec<Stretch> = (0..problem.tracks.len()).into_par_iter().flat_map_iter(|k| stretches(problem, point, k)).collect();
    let Some(longest) = stretches.iter().flat_map(|s| &s.angle).map(|a| a.abs()).reduce(f64::max) else { return Vec::new() };
    let found = orders(&stretches, longest, least);
    let set = |(_, order, amplitudes): &Ripple| {
        let mut start = point.clone();
        let k = entry.parameters.start;
        (start.effects[k], start.effects[k + 1]) = (amplitudes[0].clamp(-0.9, 0.9), amplitudes[1].clamp(-0.9, 0.9));
        start.effects[k + 2] = *order;
        start
    };
    // Side lobes explain nearly as much, but only the true order improves when it is fitted.
    let own = || Frame { shared: entry.parameters.clone().map(Coordinate::Effect).collect(), own: Vec::new() };
    let mut fits: Vec<Fit> = found.iter().take(TRIED).map(|f| along(problem, own(), None, &set(f), POLISH, None)).collect();
    fits.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    fits.truncate(STARTS);
    // An order whose phase is one turn off at the end of the longest slip is a minimum of its own.
    let neighbours: Vec<Point> = fits.first().map_or_else(Vec::new, |best| {
        let order = entry.parameters.start + 2;
        let moved = |to: f64| {
            let mut p = best.point.clone();
            p.effects[order] = to;
            p
        };
        a_turn_out(best.point.effects[order], longest).map(moved).to_vec()
    });
    let beside: Vec<Fit> = neighbours.iter().map(|p| along(problem, own(), None, p, POLISH, None)).collect();
    if let Some(better) = beside.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost)).filter(|f| f.cost < fits[0].cost) {
        fits[0] = better;
    }
    fits.into_iter().map(|f| (effect, f.point)).collect()
}

/// Orders whose phase is one turn less and one turn more than that of this one at the end of the longest slip, a slip angle in rad.
fn a_turn_out(order: f64, longest: f64) -> [f64; 2] {
    [-1.0, 1.0].map(|turns| order + turns * 2.0 * PI / longest)
}

/// Reduction of the squared innovations by a ripple, its order, and its amplitudes (cosine, sine).
type Ripple = (f64, f64, [f64; 2]);

/// Orders that explain a noticeable share and reduce the cost by at least `least`, best first; `longest` is the largest slip angle of all, rad.
fn orders(stretches: &[Stretch], longest: f64, least: f64) -> Vec<Ripple> {
    let step = |angle: f64| (0.5 * PI / angle).min(0.05);
    let fine = step(longest);
    // Whether all stretches have one phase, or each has its own.
    let together = fine >= FINEST;
    let span = |s: &Stretch| (s.angle[s.angle.len() - 1] - s.angle[0]).abs();
    let coarse = if together { fine } else { step(stretches.iter().map(span).fold(0.0, f64::max)).max(FINEST) };
    let whole: f64 = stretches.iter().flat_map(|s| &s.innovation).map(|r| r * r).sum();
    let all = scan(stretches, ORDERS.start, coarse, ((ORDERS.end - ORDERS.start) / coarse) as usize, together);
    let mut found: Vec<Ripple> = Vec::new();
    for ripple in all {
        match found.last_mut() {
            Some(last) if ripple.1 - last.1 < LOBES * coarse => {
                if ripple.0 > last.0 {
                    *last = ripple;
                }
            }
            _ => found.push(ripple),
        }
    }
    found.retain(|f| f.0 > least.max(LEAST_SHARE * whole));
    let best_first = |found: &mut Vec<Ripple>| found.sort_by(|a, b| b.0.total_cmp(&a.0));
    best_first(&mut found);
    if !together {
        found.truncate(TRIED);
        let fine = fine.max(coarse / FINER);
        let near = |order: f64| {
            let reach = LOBES * coarse;
            let nearby = scan(stretches, order - reach, fine, (2.0 * reach / fine) as usize + 1, true);
            nearby.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).expect("at least the order itself")
        };
        found = found.into_iter().map(|f| near(f.1)).collect();
        best_first(&mut found);
    }
    found
}

fn stretches(problem: &Problem, point: &Point, k: usize) -> Vec<Stretch> {
    let (track, filter) = (&problem.tracks[k], &problem.filters[k]);
    let car = problem.car(point, Some(k));
    let n = track.observations();
    let (mut torque, mut angle) = (vec![0.0; n], vec![0.0; n + 1]);
    let innovations = replay::corrected(track, filter, &car, problem.temperatures(point, k), None, |row, now, plant| {
        let j = track.observation_of(row);
        torque[j] = if now.phase == crate::plant::Phase::Slipping { now.t_fc } else { 0.0 };
        angle[j..=j + 1].fill(plant.slip_angle());
    });
    // What acts from one observation to the next acts at the angle in the middle, and a flywheel speed that is sensed late shows it later.
    let late = sensors::late(&car.effects)[0] + car.late[Signal::OmegaF as usize];
    let mut time = vec![0.0; n + 1];
    (0..n).for_each(|j| time[j + 1] = time[j] + filter.gains[j].interval);
    let shown: Vec<(f64, f64)> = (0..n)
        .map(|j| {
            let acted = (0.5 * (time[j] + time[j + 1]) - late).clamp(0.0, time[n]);
            let i = time.partition_point(|t| *t <= acted).clamp(1, n) - 1;
            let share = (acted - time[i]) / (time[i + 1] - time[i]);
            (torque[i], angle[i] + share * (angle[i + 1] - angle[i]))
        })
        .collect();
    let mut all: Vec<Stretch> = Vec::new();
    let (mut begin, mut quiet) = (0.0, usize::MAX);
    for (j, (torque, angle)) in shown.into_iter().enumerate() {
        let gain = &filter.gains[j];
        if torque != 0.0 {
            if quiet > REMEMBERED || (angle - begin).abs() > LONGEST_ANGLE {
                all.push(Stretch::default());
                begin = angle;
            }
            quiet = 0;
        } else {
            quiet = quiet.saturating_add(1);
        }
        if let Some(s) = all.last_mut().filter(|_| quiet <= REMEMBERED) {
            s.torque.push(torque);
            s.angle.push(angle);
            s.innovation.push(innovations[2 * j]);
            s.gain.push(gain.interval / car.vehicle.driveline.J_f);
            s.forget.push(1.0 - gain.of[0][0]);
            s.weight.push(gain.weight[0]);
        }
    }
    all.retain(|s| s.torque.iter().filter(|t| **t != 0.0).count() > 10);
    all
}

/// What a ripple explains for `count` orders from `first` on: with one phase for all stretches if `together`, else with one phase for each and without common amplitudes.
fn scan(stretches: &[Stretch], first: f64, step: f64, count: usize, together: bool) -> Vec<Ripple> {
    let chunk = |from: usize| {
        let turned = |order: f64| -> Vec<Vec<(f64, f64)>> {
            stretches.iter().map(|t| t.angle.iter().map(|angle| (order * angle).sin_cos()).collect()).collect()
        };
        let (mut phasors, rotations) = (turned(first + from as f64 * step), turned(step));
        (from..count.min(from + NEIGHBOURS))
            .map(|k| {
                let order = first + k as f64 * step;
                let found = if together {
                    let (gain, amplitudes) = explained(stretches, &phasors);
                    (gain, order, amplitudes)
                } else {
                    let one = |s: usize| explained(&stretches[s..=s], &phasors[s..=s]).0;
                    ((0..stretches.len()).map(one).sum(), order, [0.0; 2])
                };
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

/// Sum of squares that a ripple with the given sines and cosines explains, and its amplitudes (cosine, sine).
fn explained(stretches: &[Stretch], phasors: &[Vec<(f64, f64)>]) -> (f64, [f64; 2]) {
    let (mut cc, mut ss, mut cs, mut cr, mut sr) = (1e-9, 1e-9, 0.0, 0.0, 0.0);
    for (t, turned) in stretches.iter().zip(phasors) {
        let (mut c, mut s) = (0.0, 0.0);
        for (j, (sin, cos)) in turned.iter().enumerate() {
            let w = t.weight[j];
            let (wc, ws, r) = (w * c, w * s, t.innovation[j]);
            cc += wc * wc;
            ss += ws * ws;
            cs += wc * ws;
            cr += wc * r;
            sr += ws * r;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_of_an_order_are_a_turn_out_at_the_end() {
        let [less, more] = a_turn_out(2.0, 50.0).map(|order| order * 50.0 - 100.0);
        assert!((less + 2.0 * PI).abs() < 1e-9 && (more - 2.0 * PI).abs() < 1e-9, "{less} {more}");
    }

    /// Engagements of one drive, each a second of slip at 100 Hz, under a ripple of this order and phase. The slip angle grows from the beginning of the drive, also with an open
    /// clutch, and runs backwards in overrun.
    fn drive(order: f64, phase: f64) -> Vec<Stretch> {
        let mut angle = 0.0_f64;
        let engagement = |k: usize| {
            let mut s = Stretch::default();
            let (mut speed, mut unknown) = (0.0, Road(k as u64 + 1));
            for j in 0..100 {
                let slip = if k % 3 == 2 { -60.0 } else { 90.0 } * (1.0 - j as f64 / 100.0);
                let (gain, forget, torque) = (0.05, 0.7, 100.0);
                s.innovation.push(speed + 0.3 * unknown.next());
                s.angle.push(angle + 0.005 * slip);
                s.torque.push(torque);
                s.gain.push(gain);
                s.forget.push(forget);
                s.weight.push(1.0);
                speed = forget * speed - gain * torque * 0.2 * (order * (angle + 0.005 * slip) + phase).cos();
                angle += 0.01 * slip;
            }
            // The engine idles with an open clutch, longer each time.
            angle += 400.0 + 37.0 * k as f64;
            s
        };
        (0..9).map(engagement).collect()
    }

    /// Reproducible numbers between −1 and 1.
    struct Road(u64);
    impl Road {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        }
    }

    /// After thousands of radians, the order is found to within about an eighth of a turn at the end.
    #[test]
    fn the_order_of_a_ripple_is_found_in_a_drive() {
        for (order, phase) in [(0.5_f64, 0.4_f64), (2.137, 2.0), (0.931, -1.0)] {
            let stretches = drive(order, phase);
            let longest = stretches.iter().flat_map(|s| &s.angle).fold(0.0, |m: f64, a| m.max(a.abs()));
            assert!(longest > 3000.0, "{longest}");
            let (_, found, [cosine, sine]) = orders(&stretches, longest, 0.0)[0];
            // Half a step of the finer scan is an eighth of a turn at the end.
            assert!((found - order).abs() * longest < 0.26 * PI, "{found} for {order} after {longest} rad");
            assert!((cosine.hypot(sine) - 0.2).abs() < 0.02, "{cosine} {sine}");
            let off = (-sine).atan2(cosine) - phase;
            assert!(off.sin().abs() < 0.8 && off.cos() > 0.0, "phase {} for {phase}", off + phase);
        }
    }

    /// A launch of a car that judders, recorded with a flywheel speed that is 60 ms late: the ripple that the innovations of a car with that sensor show has the order of the clutch's, and not that of a
    /// phase that runs ahead as slip falls.
    #[test]
    fn a_late_flywheel_speed_shows_the_ripple_of_an_earlier_angle() {
        use crate::effects::param::{engine_speed_delay, judder};
        use crate::plant::Start;
        let example = crate::gap::model::prepare::Example::read();
        let (mut problem, _) = example.problem(&[&example.campaign.recordings[1]]);
        let mut point = problem.nominal();
        point.effects[engine_speed_delay::delay] = 0.06;
        let mut true_point = point.clone();
        (true_point.effects[judder::cosine], true_point.effects[judder::order]) = (0.15, 1.3);
        let track = &mut problem.tracks[0];
        let theta = example.campaign.recordings[1].theta_h[0];
        let start = Start { omega_f: track.measured[0][0], omega_c: track.measured[1][0], theta_c: theta, theta_b: theta };
        let car = crate::gap::model::tolerance::Car {
            effects: true_point.effects,
            ..crate::gap::model::tolerance::Car::nominal(&example.vehicle)
        };
        let mut shown = [vec![f64::NAN; track.rows()], vec![f64::NAN; track.rows()]];
        replay::replay(track, &car, (&start, 0.0), 0..track.rows(), None, |row, now, _, _| {
            (shown[0][row], shown[1][row]) = (now.omega_f, now.omega_c);
        });
        shown.into_iter().enumerate().for_each(|(c, speed)| track.measured[c] = speed);
        let stretches = stretches(&problem, &point, 0);
        let longest = stretches.iter().flat_map(|s| &s.angle).fold(0.0, |m: f64, a| m.max(a.abs()));
        let order = orders(&stretches, longest, 0.0)[0].1;
        assert!((order - 1.3).abs() * longest < PI, "{order} after {longest} rad");
    }
}
