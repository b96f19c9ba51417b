//! A learned law: curves of `effects::empirical` are unknowns of the same density, beside a set of effects that stay as they were fitted.
//!
//! The unknowns are the values at the curves' breakpoints, with which the FMU computes as well. Their prior is normal around zero, with the nominal size of the model description,
//! and smooth: second differences from breakpoint to breakpoint have a standard deviation of `density::BEND` times that size.

use super::coordinate::{Coordinate, coordinates};
use super::density::{Basis, Point, Problem, misfit, prior};
use super::fit::{Fit, LOOK, along, mean_covariance, stepped};
use super::linear::{Frame, all_products, assemble};
use crate::effects::empirical::Curve;
use rayon::prelude::*;

/// Damping factors that are tried, because a full step may lead too far: the precision of the priors is multiplied by one plus this.
const DAMPINGS: [f64; 5] = [0.0, 3.0, 30.0, 300.0, 3000.0];

/// Maximum number of iterations of a fit.
const ITERATIONS: usize = 8;

/// A learned law.
#[derive(Clone, Debug)]
pub struct Learned {
    /// Its curves.
    pub curves: Vec<&'static Curve>,
    /// The fit, whose point holds the curves' values among its effect parameters.
    pub fit: Fit,
    frame: Frame,
}

/// Coordinates of a fit of these curves, without those of effects. A curve's value at its reference is not free.
fn frame(problem: &Problem, curves: &[&'static Curve]) -> Frame {
    let (mut shared, own) = coordinates(problem, &[], 0);
    let free = |c: &&'static Curve| {
        let c = *c;
        c.parameters().enumerate().filter(|(i, _)| Some(*i) != c.reference).map(|(_, k)| Coordinate::Effect(k))
    };
    shared.extend(curves.iter().flat_map(free));
    Frame { shared, own }
}

/// Logarithm of the evidence of these curves after a look ([`LOOK`] iterations), nats, up to a constant that all curves share; `start` and `near` are those of [`learn`].
pub fn look(problem: &Problem, curves: &[&'static Curve], start: &Point, near: Option<&Fit>) -> f64 {
    along(problem, frame(problem, curves), None, start, LOOK, near.and_then(Fit::known)).log_evidence
}

/// Fits these curves from a point whose effects stay as they are. `near` is a fit of which the derivatives along nuisances are reused at first.
pub fn learn(problem: &Problem, curves: &[&'static Curve], start: &Point, near: Option<&Fit>) -> Learned {
    let frame = frame(problem, curves);
    let start = Point { missing: Vec::new(), ..start.clone() };
    let fit = along(problem, frame.clone(), None, &start, ITERATIONS, near.and_then(Fit::known));
    // A learned law is as inexact as any other, so that its covariance is the mean over the accuracies, too.
    let mean_covariance = mean_covariance(problem.powers.map(|powers| fit.weighed(problem, &Basis::new(), 0, powers).1));
    let fit = Fit { mean_covariance, ..fit };
    Learned { curves: curves.to_vec(), fit, frame }
}

impl Learned {
    /// Standard deviations of a curve's values; zero at its reference.
    pub fn sigma(&self, curve: &Curve) -> Vec<f64> {
        let covariance = self.fit.mean_covariance.as_ref();
        let of = |k: usize| {
            let place = self.fit.shared.iter().position(|c| *c == Coordinate::Effect(k));
            place.zip(covariance).map_or(0.0, |(i, c)| c[(i, i)].max(0.0).sqrt())
        };
        curve.parameters().map(of).collect()
    }

    /// Point that a fit without one of the recordings would reach, for each recording: a Newton step on the normal equations of all others, damped as far as necessary.
    pub fn without_each(&self, problem: &Problem) -> Vec<Point> {
        let columns = self.fit.derivatives(problem, &self.frame, None);
        let parts = all_products(&columns, &self.fit.residuals);
        let one = |k: usize| {
            let mut others = parts.clone();
            others[k].0.fill(0.0);
            others[k].1.fill(0.0);
            let damped = |damping| assemble(&self.fit.point, &self.frame, &others, damping);
            let tried = DAMPINGS.into_iter().filter_map(damped).filter_map(|e| stepped(problem, &self.frame, &e, &self.fit.point));
            self.borne_without(problem, k, tried.chain([self.fit.point.clone()]).collect())
        };
        (0..parts.len()).map(one).collect()
    }

    /// The one of these points at which the cost of all recordings except `left_out` is lowest.
    fn borne_without(&self, problem: &Problem, left_out: usize, mut tried: Vec<Point>) -> Point {
        let cost = |point: &Point| {
            let others = (0..problem.tracks.len()).into_par_iter().filter(|k| *k != left_out);
            let mut believed = point.clone();
            believed.own[left_out].fill(0.0);
            // Added in order, because a sum must not depend on the threads.
            let misfits: Vec<f64> = others.map(|k| misfit(&[problem.residuals(k, point, None)])).collect();
            misfits.iter().sum::<f64>() + prior(&believed)
        };
        let costs: Vec<f64> = tried.iter().map(cost).collect();
        let least = (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0);
        tried.swap_remove(least)
    }
}
