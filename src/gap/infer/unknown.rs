//! What no effect of the library accounts for, as hypotheses beside the others: a missing law in one subsystem, alone or beside a set of effects.
//!
//! The evidence of every place follows from one linear Gaussian model at the set's mode: with G the curvature along the law's amplitudes (all else
//! eliminated, in units of their prior) and g the gradient, the law gains ½ gᵀ(1 + G)⁻¹g − ½ ln det(1 + G) nats. The places that gain most are fitted.
//!
//! A gap that follows no variable but time (gusts, misfires) is a disturbance of one place that the filter follows: its likelihood under that filter
//! competes as well.

use super::coordinate::coordinates;
use super::density::{Basis, Problem, Residuals, weight};
use super::fit::{Fit, Free, fit};
use super::linear::{Columns, Frame, Normal, normal};
use super::search::{Hypothesis, log_prior};
use crate::effects::{REGISTRY, Subsystem};
use crate::gap::model::missing;
use crate::gap::model::replay;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Prior probability that some law is missing in a given subsystem.
const PLACE_PRIOR: f64 = 0.012;
/// Prior probability that an effect which is there has another form than the library's.
const FORM_PRIOR: f64 = 0.3;

/// A missing law in one place, beside a set of effects.
#[derive(Clone, Debug)]
pub struct Unknown {
    /// Effects beside it.
    pub effects: Vec<usize>,
    /// Where.
    pub place: Subsystem,
    /// Logarithm of the posterior probability, nats, on the scale of the search.
    pub log_posterior: f64,
    /// Fit, if it was fitted.
    pub fit: Option<Fit>,
    /// Functions of the law.
    pub basis: Basis,
}

/// Places beside a set are fitted if their linear evidence is this near that of the best.
const FITTED_NATS: f64 = 15.0;
const FITTED: usize = 2;

fn odds(p: f64) -> f64 {
    (p / (1.0 - p)).ln()
}

/// Logarithm of the prior odds of a missing law at `place` beside these effects.
fn place_prior(effects: &[usize], place: Subsystem) -> f64 {
    let own = effects.iter().any(|&e| REGISTRY[e].effect.subsystem == place);
    if own { odds(FORM_PRIOR) } else { odds(PLACE_PRIOR) }
}

/// Missing laws beside a set of effects, every place, most probable first.
pub fn places(problem: &Problem, of: &Hypothesis) -> Vec<Unknown> {
    let (shared, own) = coordinates(problem, &of.effects, 0);
    let frame = Frame { shared, own };
    let Some(equations) = normal(&of.fit.point, &frame, &of.fit.columns, &of.fit.residuals, 0.0) else { return Vec::new() };
    let mut found: Vec<Unknown> = Subsystem::ALL
        .into_iter()
        .map(|place| {
            let basis = basis(problem, of, place);
            let gain = linear_gain(problem, of, &equations, &basis);
            let log_posterior = of.log_posterior + gain + place_prior(&of.effects, place);
            Unknown { effects: of.effects.clone(), place, log_posterior, fit: None, basis }
        })
        .collect();
    found.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
    let best = found[0].log_posterior;
    if best > of.log_posterior {
        for u in found.iter_mut().take(FITTED).filter(|u| best - u.log_posterior < FITTED_NATS) {
            let free = Free { effects: &u.effects, basis: Some(&u.basis) };
            let fitted = fit(problem, free, &of.fit.point, super::fit::LOOK + 2, None);
            // The linear gain is what the law promised; the fit is what it keeps.
            u.log_posterior = fitted.log_evidence + log_prior(u.effects.len()) + place_prior(&u.effects, u.place);
            u.fit = Some(fitted);
        }
        found.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
    }
    found
}

/// A missing law at a place beside another set, fitted from a point.
pub fn beside(problem: &Problem, effects: &[usize], place: Subsystem, basis: &Basis, start: &super::density::Point) -> Unknown {
    let fitted = fit(problem, Free { effects, basis: Some(basis) }, start, super::fit::LOOK + 2, None);
    let log_posterior = fitted.log_evidence + log_prior(effects.len()) + place_prior(effects, place);
    Unknown { effects: effects.to_vec(), place, log_posterior, fit: Some(fitted), basis: basis.clone() }
}

/// Functions of the law at `place`, as the set's car would see them.
fn basis(problem: &Problem, of: &Hypothesis, place: Subsystem) -> Basis {
    let point = &of.fit.point;
    let by_track: Vec<Vec<replay::Missing>> = (0..problem.tracks.len())
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

fn linear_gain(problem: &Problem, of: &Hypothesis, equations: &Normal, basis: &Basis) -> f64 {
    let m = basis.len();
    let parts: Vec<(DMatrix<f64>, DVector<f64>, DMatrix<f64>)> =
        (0..problem.tracks.len()).into_par_iter().map(|r| part(problem, of, equations, basis, r)).collect();
    let (mut gram, mut slope, mut cross) = (DMatrix::zeros(m, m), DVector::zeros(m), DMatrix::zeros(equations.curvature.nrows(), m));
    for (g, s, c) in parts {
        gram += g;
        slope += s;
        cross += c;
    }
    let Some(root) = equations.curvature.clone().cholesky() else { return 0.0 };
    let solved = root.solve(&cross);
    gram -= cross.tr_mul(&solved);
    slope -= solved.tr_mul(&equations.gradient);
    let Some(law) = (gram + DMatrix::identity(m, m)).cholesky() else { return 0.0 };
    let log_det = 2.0 * law.l_dirty().diagonal().map(f64::ln).sum();
    0.5 * slope.dot(&law.solve(&slope)) - 0.5 * log_det
}

fn part(problem: &Problem, of: &Hypothesis, equations: &Normal, basis: &Basis, r: usize) -> (DMatrix<f64>, DVector<f64>, DMatrix<f64>) {
    let here: &Residuals = &of.fit.residuals[r];
    let roots: Vec<f64> = here.iter().map(|r| weight(*r).sqrt()).collect();
    let mut point = of.fit.point.clone();
    point.missing = vec![0.0; basis.len()];
    let columns: Vec<Vec<f64>> = (0..basis.len())
        .into_par_iter()
        .map(|k| {
            let mut moved = point.clone();
            moved.missing[k] = STEP;
            let there = problem.residuals(r, &moved, Some(basis));
            there.iter().zip(here).zip(&roots).map(|((a, b), w)| (a - b) * w / STEP).collect()
        })
        .collect();
    let v = DMatrix::from_fn(here.len(), basis.len(), |i, k| columns[k][i]);
    let known: &Columns = &of.fit.columns[r];
    let mut a = known.matrix.clone();
    let w = DVector::from_column_slice(&roots);
    a.column_iter_mut().for_each(|mut c| c.component_mul_assign(&w));
    let weighted = DVector::from_iterator(here.len(), here.iter().zip(&roots).map(|(r, w)| r * w));
    let s = equations.curvature.nrows();
    let products = a.tr_mul(&v);
    let (shared, own) = (products.rows(0, s).into_owned(), products.rows(s, products.nrows() - s).into_owned());
    let e = &equations.eliminated[r];
    let gram = v.tr_mul(&v) - own.tr_mul(&e.solve(&own));
    let slope = v.tr_mul(&weighted) - own.tr_mul(e.offset());
    let cross = shared - e.coupling().tr_mul(&own);
    (gram, slope, cross)
}
