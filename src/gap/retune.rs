//! The numbers of the car that is handed back.
//!
//! The innovations show what the real law of an effect does from one sample to the next, and the form of the effect absorbs what the library's formula leaves. The retuned plant
//! has the formula alone, and has to follow whole recordings. Of the numbers that the posterior allows, it therefore gets those with which free replays of the recordings of the
//! fit come nearest to the car. They minimise
//!
//! ```text
//! Σ A_r²/F_r² + (p − p̂)ᵀ C⁻¹ (p − p̂)
//! ```
//!
//! with the gap A_r of recording r in a free replay, the gap F_r that the true car would leave there, and mode p̂ and covariance C of the posterior. A free replay counts once,
//! whatever its number of samples, because its errors are one long swing.

use super::free::Freely;
use super::infer::coordinate::Coordinate;
use super::infer::density::{Point, Problem};
use super::infer::fit::{Fit, TRUSTED_GAIN_RATIO};
use crate::campaign::Recording;
use crate::effects::{self, PARAMETERS};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Maximum number of iterations; the factor by which the damping grows if a step led too far; and the maximum number of steps that an iteration tries.
const ITERATIONS: usize = 12;
const SHRINK: f64 = 10.0;
const TRIES: usize = 4;
/// Step of the finite differences, in standard deviations of the posterior.
const STEP: f64 = 0.1;
/// Decrease of the sum in an iteration below which the minimisation ends.
const LEAST: f64 = 0.1;

/// The recordings to which free replays have to come near.
#[derive(Clone, Copy)]
pub struct Followed<'a> {
    /// The recordings.
    pub recordings: &'a [Recording],
    /// Gap that the true car would leave in each, rad/s.
    pub floors: &'a [f64],
}

/// The point near the `mode` at which the recordings are followed best. `fit` is the fit to which the mode belongs; if it has no covariance, the mode itself is returned.
pub fn retuned(problem: &Problem, fit: &Fit, mode: &Point, followed: Followed) -> Point {
    Nearby::of(problem, fit, mode, followed).map_or_else(|| mode.clone(), |near| near.at(&near.best().z))
}

/// As [`retuned`], from the mode of `fit`; in addition, for each recording, the point that would result without it, which is one step from the best point. `modes` are the modes of
/// the posterior without each recording.
pub fn and_without_each(problem: &Problem, fit: &Fit, modes: &[Point], followed: Followed) -> (Point, Vec<Point>) {
    let Some(near) = Nearby::of(problem, fit, &fit.point, followed) else { return (fit.point.clone(), modes.to_vec()) };
    let best = near.best();
    (near.at(&best.z), modes.iter().enumerate().map(|(k, mode)| near.without(k, &best, mode)).collect())
}

/// The neighbourhood of a mode, in coordinates in which the posterior is standard normal.
struct Nearby<'a> {
    problem: &'a Problem,
    mode: &'a Point,
    free: Vec<Coordinate>,
    root: DMatrix<f64>,
    recordings: Vec<Freely>,
    floors: &'a [f64],
}

/// A place in this neighbourhood, with the errors of each recording and their derivatives.
struct Place {
    z: DVector<f64>,
    errors: Vec<DVector<f64>>,
    slopes: Vec<DMatrix<f64>>,
}

impl Place {
    /// Gauss–Newton normal equations of recording `r`: half the curvature and half the gradient of its sum of squared errors.
    fn normal(&self, r: usize) -> (DMatrix<f64>, DVector<f64>) {
        (self.slopes[r].tr_mul(&self.slopes[r]), self.slopes[r].tr_mul(&self.errors[r]))
    }

    /// Sum of the normal equations of all recordings.
    fn all_normal(&self) -> (DMatrix<f64>, DVector<f64>) {
        let n = self.z.len();
        let add = |(h, g): (DMatrix<f64>, DVector<f64>), (more, slope)| (h + more, g + slope);
        (0..self.errors.len()).map(|r| self.normal(r)).fold((DMatrix::zeros(n, n), DVector::zeros(n)), add)
    }

    fn cost(&self) -> f64 {
        squares(&self.errors) + self.z.norm_squared()
    }

    /// Moves to a place nearby. The derivatives stay as they are, except along the step, where they are corrected to agree with the change of the errors (Broyden's update).
    fn follow(mut self, z: DVector<f64>, errors: Vec<DVector<f64>>) -> Self {
        let way = &z - &self.z;
        for ((slopes, before), after) in self.slopes.iter_mut().zip(&self.errors).zip(&errors) {
            let unforeseen = after - before - &*slopes * &way;
            slopes.ger(1.0 / way.norm_squared(), &unforeseen, &way, 1.0);
        }
        Self { z, errors, slopes: self.slopes }
    }
}

impl<'a> Nearby<'a> {
    fn of(problem: &'a Problem, fit: &Fit, mode: &'a Point, followed: Followed<'a>) -> Option<Self> {
        let shared: Vec<Coordinate> = fit.shared.iter().copied().filter(|c| !matches!(c, Coordinate::Missing(_))).collect();
        let covariance = fit.mean_covariance.as_ref().filter(|c| c.nrows() == shared.len())?;
        let is_there = |e: &effects::Entry| e.parameters.clone().any(|p| mode.effects[p] != PARAMETERS[p].null);
        let is_free = |c: Coordinate| if let Coordinate::Effect(k) = c { effects::owner(k).is_none_or(is_there) } else { true };
        let kept: Vec<usize> = (0..shared.len()).filter(|&k| is_free(shared[k])).collect();
        // The mean that the form of an effect may have, which these recordings do not show, widens the covariance as it widens the intervals.
        let of_form = |c: Coordinate| match c {
            Coordinate::Effect(k) if effects::owner(k).is_some() => fit.sigma_of_form_mean(k).powi(2),
            _ => 0.0,
        };
        let of = |i: usize, j: usize| covariance[(kept[i], kept[j])] + if i == j { of_form(shared[kept[i]]) } else { 0.0 };
        let root = DMatrix::from_fn(kept.len(), kept.len(), of).cholesky()?.l();
        let car = problem.car(mode, None);
        let prepared = |r: &Recording| Freely::new(r, &problem.vehicle, (&car.vehicle, &car.effects));
        let recordings = followed.recordings.par_iter().map(prepared).collect();
        Some(Self { problem, mode, free: kept.iter().map(|&k| shared[k]).collect(), root, recordings, floors: followed.floors })
    }

    fn at(&self, z: &DVector<f64>) -> Point {
        let mut point = self.mode.clone();
        for (c, by) in self.free.iter().zip((&self.root * z).iter()) {
            c.move_by(self.problem, &mut point, 0, *by);
        }
        point
    }

    /// Errors of each recording, scaled so that their squares add up to A²/F².
    fn errors(&self, point: &Point) -> Vec<DVector<f64>> {
        let car = self.problem.car(point, None);
        let one = |(freely, floor): (&Freely, &f64)| {
            let errors = DVector::from_vec(freely.errors((&car.vehicle, &car.effects)));
            let scale = floor * (errors.len().max(1) as f64).sqrt();
            errors / scale
        };
        self.recordings.par_iter().zip(self.floors).map(one).collect()
    }

    fn place(&self, z: DVector<f64>, errors: Vec<DVector<f64>>) -> Place {
        let moved = |k: usize| {
            let mut to = z.clone();
            to[k] += STEP;
            self.errors(&self.at(&to))
        };
        let mut all: Vec<Vec<DVector<f64>>> = (0..z.len()).into_par_iter().map(moved).collect();
        // For an hour of drives, the errors take hundreds of megabytes: those of a recording are released as its slopes are computed.
        let of = |(r, here): (usize, &DVector<f64>)| {
            let seen: Vec<DVector<f64>> = all.iter_mut().map(|moved| std::mem::take(&mut moved[r])).collect();
            DMatrix::from_fn(here.len(), z.len(), |i, k| (seen[k][i] - here[i]) / STEP)
        };
        let slopes = errors.iter().enumerate().map(of).collect();
        Place { z, errors, slopes }
    }

    fn best(&self) -> Place {
        let start = DVector::zeros(self.free.len());
        let mut now = self.place(start.clone(), self.errors(&self.at(&start)));
        let mut fresh = true;
        for _ in 0..ITERATIONS {
            let before = now.cost();
            let (normal, mut gradient) = now.all_normal();
            gradient += &now.z;
            let (mut damping, mut next) = (0.0, None);
            for _ in 0..TRIES {
                let scale = DVector::from_fn(start.len(), |i, _| 1.0 + damping * (1.0 + normal[(i, i)]));
                let Some(root) = (&normal + DMatrix::from_diagonal(&scale)).cholesky() else { break };
                let step = -root.solve(&gradient);
                let to = &now.z + &step;
                let point = self.at(&to);
                if self.problem.can_follow(&point) {
                    let errors = self.errors(&point);
                    let fallen = before - squares(&errors) - to.norm_squared();
                    if fallen > 0.0 {
                        let promised = -2.0 * gradient.dot(&step) - (&normal * &step).dot(&step) - step.norm_squared();
                        next = Some((to, errors, fallen, fallen / promised));
                        break;
                    }
                }
                damping = if damping == 0.0 { 0.1 } else { damping * SHRINK };
            }
            let Some((to, errors, fallen, word)) = next else {
                if fresh {
                    break;
                }
                (now, fresh) = (self.place(now.z, now.errors), true);
                continue;
            };
            fresh = !TRUSTED_GAIN_RATIO.contains(&word);
            now = if fresh { self.place(to, errors) } else { now.follow(to, errors) };
            if fallen < LEAST {
                break;
            }
        }
        now
    }

    /// The point without recording `k`: a Gauss–Newton step from the best place with the normal equations of the other recordings, around `mode`, their own mode; or that mode, if
    /// they are not followed better after the step.
    fn without(&self, k: usize, best: &Place, mode: &Point) -> Point {
        let off = DVector::from_iterator(self.free.len(), self.free.iter().map(|c| c.get(mode, 0) - c.get(self.mode, 0)));
        let Some(centre) = self.root.solve_lower_triangular(&off) else { return mode.clone() };
        let mut normal = DMatrix::identity(self.free.len(), self.free.len());
        let mut right = centre.clone();
        for r in (0..self.recordings.len()).filter(|r| *r != k) {
            let (of_r, gradient) = best.normal(r);
            right += &of_r * &best.z - gradient;
            normal += of_r;
        }
        let Some(z) = normal.cholesky().map(|c| c.solve(&right)) else { return mode.clone() };
        let point = self.at(&z);
        let cost = |point: &Point, z: &DVector<f64>| {
            let mut errors = self.errors(point);
            errors.remove(k);
            squares(&errors) + (z - &centre).norm_squared()
        };
        if self.problem.can_follow(&point) && cost(&point, &z) < cost(mode, &centre) { point } else { mode.clone() }
    }
}

fn squares(errors: &[DVector<f64>]) -> f64 {
    errors.iter().map(DVector::norm_squared).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::param::kiss_point_thermal::slope;
    use crate::gap::infer::search::Hypothesis;
    use crate::gap::measure::{self, Closed};
    use crate::gap::model::prepare::Example;
    use crate::gap::progress::Work;
    use crate::gap::ready::Ready;

    /// A slope that is three standard deviations off is corrected if the true car would follow the recordings closely, and stays as it is if the true car would be far off as well.
    #[test]
    fn a_plant_has_those_of_the_numbers_allowed_that_follow_the_recordings() {
        let Example { campaign, vehicle } = Example::read();
        let Ready { problem, split, .. } = Ready::judged_by(None, &campaign, &vehicle, &Work::default()).unwrap();
        let effect = effects::find("kiss_point_thermal").unwrap();
        let fit = Hypothesis::fitted(&problem, vec![effect], &problem.nominal(), 12, None).fit;
        let place = fit.shared.iter().position(|c| *c == Coordinate::Effect(slope)).unwrap();
        let covariance = fit.mean_covariance.clone().unwrap();
        let sigma = covariance[(place, place)].sqrt();
        let mut off = fit.point.clone();
        for (k, c) in fit.shared.iter().filter(|c| !matches!(c, Coordinate::Missing(_))).enumerate() {
            c.move_by(&problem, &mut off, 0, -3.0 * covariance[(k, place)] / sigma);
        }
        let gap = |point: &Point| {
            let (car, null) = (problem.car(point, None), effects::null());
            let one = |r: &Recording| Closed::of(&measure::evaluate(r, (&vehicle, &null), (&car.vehicle, &car.effects))).after;
            split.fitted_part.iter().map(one).sum::<f64>() / split.fitted_part.len() as f64
        };
        let found = |fit: &Fit, floor: f64| {
            let floors = vec![floor; split.fitted_part.len()];
            retuned(&problem, fit, &off, Followed { recordings: &split.fitted_part, floors: &floors })
        };
        let with = |floor: f64| found(&fit, floor);
        let near = with(0.2);
        let [far, close, least] = [&off, &near, &fit.point].map(gap);
        assert!(far > 10.0 * least && close < 0.1 * far, "{far} {close} {least}");
        let stays = with(1e4);
        assert!((stays.effects[slope] - off.effects[slope]).abs() < 1e-3 * sigma && gap(&stays) > 0.99 * gap(&off));
        // Without a covariance nothing bounds the numbers, and the mode is returned.
        let unknown = Fit { mean_covariance: None, ..fit.clone() };
        assert_eq!(found(&unknown, 0.2).effects, off.effects);
        // If a single recording can be followed closely, nothing is learned without it.
        let mut floors = vec![1e4; split.fitted_part.len()];
        floors[0] = 0.2;
        let modes = vec![off.clone(); floors.len()];
        let at_off = Fit { point: off.clone(), ..fit.clone() };
        let (_, without_each) = and_without_each(&problem, &at_off, &modes, Followed { recordings: &split.fitted_part, floors: &floors });
        let moved = |p: &Point| (p.effects[slope] - off.effects[slope]).abs() / sigma;
        assert!(
            moved(&without_each[0]) < 1e-3 && moved(&without_each[1]) > 0.5,
            "{:?}",
            without_each.iter().map(moved).collect::<Vec<_>>()
        );
    }
}
