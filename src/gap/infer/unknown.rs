//! What no effect of the library accounts for, as hypotheses beside the others: a missing law in one subsystem, alone or beside a set of effects.
//!
//! It is a sum of the functions of `model::missing`. Its evidence follows from one linear Gaussian model at a mode: with G the curvature along the
//! amplitudes (all else eliminated, in units of their prior) and g the gradient, they gain ½ gᵀ(1 + G)⁻¹g − ½ ln det(1 + G) nats. A missing law has the
//! size of a fault worth the name or some times that, and the places that gain most are fitted.

use super::density::{Basis, Point, Problem, Residuals, weight};
use super::fit::{Fit, Free, LOOK, fit};
use super::form::forms;
use super::linear::{Columns, Frame, Normal, Products, assemble};
use super::search::{DRAGGED, Hypothesis, log_prior, moments};
use crate::effects::Subsystem;
use crate::gap::model::missing;
use crate::gap::model::replay::Missing;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::Arc;

/// Prior probability that some law is missing in a given subsystem.
const PLACE_PRIOR: f64 = 0.012;

/// A missing law in one place, beside a set of effects.
#[derive(Clone, Debug)]
pub struct Unknown {
    /// Effects beside it.
    pub effects: Vec<usize>,
    /// Where.
    pub place: Subsystem,
    /// Logarithm of the posterior probability, nats, with the whole likelihood, as of [`Hypothesis::lead`].
    pub lead: f64,
    /// The same with the likelihood to the problem's power.
    pub log_posterior: f64,
    /// Fit, if it was fitted.
    pub fit: Option<Fit>,
    /// Functions of the law.
    pub basis: Basis,
}

/// Places beside a set are fitted if their linear evidence is this near that of the best.
const FITTED_NATS: f64 = 15.0;
const FITTED: usize = 2;
const MOST_FITTED: usize = 4;

/// Logarithm of the prior odds of a missing law at some place, of one of its sizes.
fn place_prior() -> f64 {
    (PLACE_PRIOR / (1.0 - PLACE_PRIOR)).ln() - (SIZES.len() as f64).ln()
}

/// How large a missing law may be, in sizes of a fault worth the name: each as likely as another.
const SIZES: [f64; 4] = [1.0, 2.0, 4.0, 8.0];

/// Missing laws beside a set of effects, every place, most probable first. They are fitted if the best of them promises more than `least`.
pub fn places(problem: &Problem, of: &Hypothesis, least: f64) -> Vec<Unknown> {
    let (Some(at), Some(coarse)) = (Mode::new(problem, of, 1.0), Mode::new(problem, of, problem.power)) else { return Vec::new() };
    let mut found: Vec<(Unknown, f64)> = Subsystem::ALL
        .into_iter()
        .map(|place| {
            let mut basis = functions(problem, &of.fit.point, place);
            let law = at.columns(&basis);
            let of_size = |size: f64| {
                let law: Vec<Changes> = law.iter().map(|l| l * size).collect();
                (size, at.gain(&law), coarse.gain(&law))
            };
            let (size, gain, coarse) = SIZES.map(of_size).into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).expect("there are sizes");
            basis.iter_mut().flatten().for_each(|f| f.scale(size));
            let (lead, log_posterior) = (of.lead + gain + place_prior(), of.log_posterior + coarse + place_prior());
            (Unknown { effects: of.effects.clone(), place, lead, log_posterior, fit: None, basis }, size)
        })
        .collect();
    // Tolerances that the gap bent are no good start for a law that explains it.
    let bent = of.fit.pull() > DRAGGED;
    let straight = Point { effects: of.fit.point.effects, ..problem.nominal() };
    // A fit may fall short of its promise: the most promising is fitted until the first two are.
    for _ in 0..MOST_FITTED {
        found.sort_by(|a, b| b.0.lead.total_cmp(&a.0.lead));
        let best = found[0].0.lead;
        let worthwhile = |u: &Unknown| u.fit.is_none() && best > least && best - u.lead < FITTED_NATS;
        let Some((u, size)) = found.iter_mut().take(FITTED).find(|(u, _)| worthwhile(u)) else { break };
        let place = u.place;
        *u = beside(problem, &of.effects, place, &u.basis, &of.fit.point, of.formed.known());
        if bent {
            let mut basis = functions(problem, &straight, place);
            basis.iter_mut().flatten().for_each(|f| f.scale(*size));
            let other = beside(problem, &of.effects, place, &basis, &straight, None);
            if other.lead > u.lead {
                *u = other;
            }
        }
    }
    let mut found: Vec<Unknown> = found.into_iter().map(|(u, _)| u).collect();
    found.sort_by(|a, b| b.lead.total_cmp(&a.lead));
    found
}

/// A missing law at a place beside a set with the forms of its effects, fitted from a point. `known` are derivatives along nuisances there.
pub fn beside(problem: &Problem, effects: &[usize], place: Subsystem, basis: &Basis, start: &Point, known: Option<&[Columns]>) -> Unknown {
    let all: Basis = basis.iter().cloned().chain(forms(problem, start, effects)).collect();
    let mut start = start.clone();
    start.missing.truncate(basis.len());
    let fitted = fit(problem, Free { effects, basis: Some(&all) }, &start, LOOK + 2, known);
    let prior = log_prior(effects.len()) + place_prior();
    let (lead, sharp) = fitted.weighed(problem, basis.len(), 1.0);
    let (log_posterior, fitted) = fitted.weighed(problem, basis.len(), problem.power);
    let lead = lead + prior + moments(&sharp, effects);
    let log_posterior = log_posterior + prior + moments(&fitted, effects);
    Unknown { effects: effects.to_vec(), place, lead, log_posterior, fit: Some(fitted), basis: basis.clone() }
}

/// Functions of the law at `place`, as a point's car would see them.
fn functions(problem: &Problem, point: &Point, place: Subsystem) -> Basis {
    let by_track: Vec<Vec<Missing>> = (0..problem.tracks.len())
        .into_par_iter()
        .map(|k| {
            let car = problem.car(point, Some(k));
            missing::functions(place, &problem.tracks[k], &problem.filters[k], &car, problem.temperatures(point, k))
        })
        .collect();
    let count = by_track.first().map_or(0, Vec::len);
    (0..count).map(|f| by_track.iter().map(|t| t[f].clone()).collect()).collect()
}

/// Amplitude, in standard deviations, at which a function is replayed.
const STEP: f64 = 0.5;

/// A mode at which further functions are tried.
struct Mode<'a> {
    problem: &'a Problem,
    fit: &'a Fit,
    /// Functions that are fitted there.
    basis: &'a Basis,
    columns: Arc<Vec<Columns>>,
    equations: Normal,
    power: f64,
}

/// Changes of one recording's innovations for one standard deviation of each function.
type Changes = DMatrix<f64>;

impl<'a> Mode<'a> {
    fn new(problem: &'a Problem, of: &'a Hypothesis, power: f64) -> Option<Self> {
        let fit = &of.formed;
        let frame = Frame { shared: fit.shared.clone(), own: fit.own.clone() };
        let columns = fit.derivatives(problem, &frame, Some(&of.basis));
        let parts: Vec<Products> = fit.parts.iter().map(|(p, g)| (p * power, g * power)).collect();
        let equations = assemble(&fit.point, &frame, &parts, 0.0)?;
        Some(Self { problem, fit, basis: &of.basis, columns, equations, power })
    }

    /// What each function changes, by recording.
    fn columns(&self, further: &Basis) -> Vec<Changes> {
        let there: Basis = self.basis.iter().chain(further).cloned().collect();
        let fitted = self.basis.len();
        let mut point = self.fit.point.clone();
        point.missing.resize(there.len(), 0.0);
        let one = |r: usize| {
            let here = &self.fit.residuals[r];
            let columns: Vec<Vec<f64>> = (0..further.len())
                .into_par_iter()
                .map(|k| {
                    let mut moved = point.clone();
                    moved.missing[fitted + k] = STEP;
                    let there = self.problem.residuals(r, &moved, Some(&there));
                    there.iter().zip(here).map(|(a, b)| (a - b) / STEP).collect()
                })
                .collect();
            DMatrix::from_fn(here.len(), further.len(), |i, k| columns[k][i])
        };
        (0..self.problem.tracks.len()).into_par_iter().map(one).collect()
    }

    /// Logarithm of the evidence that functions with these changes add, nats.
    fn gain(&self, changes: &[Changes]) -> f64 {
        let curvature = &self.equations.curvature;
        let m = changes.first().map_or(0, DMatrix::ncols);
        if m == 0 {
            return 0.0;
        }
        let parts: Vec<(DMatrix<f64>, DVector<f64>, DMatrix<f64>)> = changes.par_iter().enumerate().map(|(r, v)| self.part(r, v)).collect();
        let (mut gram, mut slope, mut cross) = (DMatrix::identity(m, m), DVector::zeros(m), DMatrix::zeros(curvature.nrows(), m));
        for (g, s, c) in parts {
            gram += g;
            slope += s;
            cross += c;
        }
        let Some(root) = curvature.clone().cholesky() else { return 0.0 };
        let solved = root.solve(&cross);
        gram -= cross.tr_mul(&solved);
        slope -= solved.tr_mul(&self.equations.gradient);
        let Some(law) = gram.cholesky() else { return 0.0 };
        let log_det = 2.0 * law.l_dirty().diagonal().map(f64::ln).sum();
        0.5 * slope.dot(&law.solve(&slope)) - 0.5 * log_det
    }

    /// One recording's products of the changes among themselves, with its residuals, and with the shared coordinates, own unknowns eliminated.
    fn part(&self, r: usize, changes: &Changes) -> (DMatrix<f64>, DVector<f64>, DMatrix<f64>) {
        let here: &Residuals = &self.fit.residuals[r];
        let w = DVector::from_iterator(here.len(), here.iter().map(|r| (self.power * weight(*r)).sqrt()));
        let weigh = |m: &DMatrix<f64>| {
            let mut m = m.clone();
            m.column_iter_mut().for_each(|mut c| c.component_mul_assign(&w));
            m
        };
        let known: &Columns = &self.columns[r];
        let (v, a) = (weigh(changes), weigh(&known.matrix));
        let weighted = DVector::from_column_slice(here).component_mul(&w);
        let s = self.equations.curvature.nrows();
        let products = a.tr_mul(&v);
        let (shared, own) = (products.rows(0, s).into_owned(), products.rows(s, products.nrows() - s).into_owned());
        let e = &self.equations.eliminated[r];
        let gram = v.tr_mul(&v) - own.tr_mul(&e.solve(&own));
        let slope = v.tr_mul(&weighted) - own.tr_mul(e.offset());
        let cross = shared - e.coupling().tr_mul(&own);
        (gram, slope, cross)
    }
}
