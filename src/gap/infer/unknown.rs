//! What no effect of the library accounts for, as hypotheses beside the others: a missing law in one subsystem, alone or beside a set of effects; and the
//! form of an effect, which is never quite the library's.
//!
//! Both are sums of the functions of `model::missing`. Their evidence follows from one linear Gaussian model at a mode: with G the curvature along the
//! amplitudes (all else eliminated, in units of their prior) and g the gradient, they gain ½ gᵀ(1 + G)⁻¹g − ½ ln det(1 + G) nats. A missing law has the
//! size of a fault worth the name, and the places that gain most are fitted. A form has the size [`FORM`] of what its effect does to the recordings.

use super::coordinate::coordinates;
use super::density::{Basis, Point, Problem, Residuals, weight};
use super::fit::{Fit, Free, LOOK, fit};
use super::linear::{Columns, Frame, Normal, normal};
use super::pulsation;
use super::search::{DRAGGED, Hypothesis, log_prior, moments};
use crate::effects::{Act, PARAMETERS, REGISTRY, Subsystem};
use crate::gap::model::missing;
use crate::gap::model::replay::Missing;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::Arc;

/// Prior probability that some law is missing in a given subsystem.
const PLACE_PRIOR: f64 = 0.012;

/// How far the form of a real effect is from the library's: standard deviation of what that changes in the recordings, relative to what the effect
/// itself changes in them.
const FORM: f64 = 0.4;

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
const MOST_FITTED: usize = 4;

/// Logarithm of the prior odds of a missing law at some place, of one of its sizes.
fn place_prior() -> f64 {
    (PLACE_PRIOR / (1.0 - PLACE_PRIOR)).ln() - (SIZES.len() as f64).ln()
}

/// How large a missing law may be, in sizes of a fault worth the name: each as likely as another.
const SIZES: [f64; 4] = [1.0, 2.0, 4.0, 8.0];

/// Missing laws beside a set of effects, every place, most probable first. They are fitted if the best of them promises more than `least`.
pub fn places(problem: &Problem, of: &Hypothesis, least: f64) -> Vec<Unknown> {
    let at = Mode::new(problem, &of.fit, &of.effects, None);
    let Some(at) = at else { return Vec::new() };
    let laws: Vec<Law> = Subsystem::ALL.into_iter().map(|place| at.law(place)).collect();
    let mut found: Vec<(Unknown, f64)> = laws
        .iter()
        .map(|Law { place, basis, columns: law }| {
            let (place, mut basis) = (*place, basis.clone());
            let beside = at.forms(&of.effects, Some(place), &laws);
            let of_size = |size: f64| {
                let all: Vec<Changes> = law.iter().zip(&beside).map(|(l, b)| joined(&(l * size), b)).collect();
                (size, at.gain(&all).nats)
            };
            let (size, gain) = SIZES.map(of_size).into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).expect("there are sizes");
            basis.iter_mut().flatten().for_each(|f| f.scale(size));
            let log_posterior = of.fit.log_evidence + log_prior(of.effects.len()) + moments(&of.fit, &of.effects) + gain + place_prior();
            (Unknown { effects: of.effects.clone(), place, log_posterior, fit: None, basis }, size)
        })
        .collect();
    // Tolerances that the gap bent are no good start for a law that explains it.
    let bent = of.fit.pull() > DRAGGED;
    let straight = Point { effects: of.fit.point.effects, ..problem.nominal() };
    // A fit may fall short of its promise: the most promising is fitted until the first two are.
    for _ in 0..MOST_FITTED {
        found.sort_by(|a, b| b.0.log_posterior.total_cmp(&a.0.log_posterior));
        let best = found[0].0.log_posterior;
        let worthwhile = |u: &Unknown| u.fit.is_none() && best > least && best - u.log_posterior < FITTED_NATS;
        let Some((u, size)) = found.iter_mut().take(FITTED).find(|(u, _)| worthwhile(u)) else { break };
        let place = u.place;
        *u = beside(problem, &of.effects, place, &u.basis, &of.fit.point, of.fit.known());
        if bent {
            let mut basis = functions(problem, &straight, place);
            basis.iter_mut().flatten().for_each(|f| f.scale(*size));
            let other = beside(problem, &of.effects, place, &basis, &straight, None);
            if other.log_posterior > u.log_posterior {
                *u = other;
            }
        }
    }
    let mut found: Vec<Unknown> = found.into_iter().map(|(u, _)| u).collect();
    found.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
    found
}

/// A missing law at a place beside a set, fitted from a point. `known` are derivatives along nuisances there.
pub fn beside(problem: &Problem, effects: &[usize], place: Subsystem, basis: &Basis, start: &Point, known: Option<&[Columns]>) -> Unknown {
    let fitted = fit(problem, Free { effects, basis: Some(basis) }, start, LOOK + 2, known);
    let form = Mode::new(problem, &fitted, effects, Some(basis)).map_or(0.0, |m| m.gain(&m.forms(effects, Some(place), &[])).nats);
    let log_posterior = fitted.log_evidence + form + log_prior(effects.len()) + moments(&fitted, effects) + place_prior();
    Unknown { effects: effects.to_vec(), place, log_posterior, fit: Some(fitted), basis: basis.clone() }
}

/// What the unknown form of its effects adds to a set: nats of evidence, and the curvature along the shared coordinates that is left.
pub fn form(problem: &Problem, fit: &Fit, effects: &[usize]) -> Option<Gain> {
    let mode = Mode::new(problem, fit, effects, None)?;
    Some(mode.gain(&mode.forms(effects, None, &[])))
}

/// What functions beside a mode gain.
#[derive(Clone, Debug)]
pub struct Gain {
    /// Logarithm of the evidence that they add, nats.
    pub nats: f64,
    /// Curvature of half the cost along the mode's shared coordinates, the functions' amplitudes eliminated.
    pub curvature: DMatrix<f64>,
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
    basis: Option<&'a Basis>,
    columns: Arc<Vec<Columns>>,
    equations: Normal,
}

/// Changes of one recording's innovations for one standard deviation of each function.
type Changes = DMatrix<f64>;

/// The functions of a place's law, and what they change at a mode.
struct Law {
    place: Subsystem,
    basis: Basis,
    columns: Vec<Changes>,
}

fn joined(a: &Changes, b: &Changes) -> Changes {
    DMatrix::from_fn(a.nrows(), a.ncols() + b.ncols(), |i, j| if j < a.ncols() { a[(i, j)] } else { b[(i, j - a.ncols())] })
}

impl<'a> Mode<'a> {
    fn new(problem: &'a Problem, fit: &'a Fit, effects: &[usize], basis: Option<&'a Basis>) -> Option<Self> {
        let (shared, own) = coordinates(problem, effects, basis.map_or(0, Vec::len));
        let frame = Frame { shared, own };
        let columns = fit.derivatives(problem, &frame, basis);
        let equations = normal(&fit.point, &frame, &columns, &fit.residuals, 0.0)?;
        Some(Self { problem, fit, basis, columns, equations })
    }

    /// What each function changes, by recording.
    fn columns(&self, further: &Basis) -> Vec<Changes> {
        let there: Basis = self.basis.into_iter().flatten().chain(further).cloned().collect();
        let fitted = there.len() - further.len();
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

    fn law(&self, place: Subsystem) -> Law {
        let basis = functions(self.problem, &self.fit.point, place);
        let columns = self.columns(&basis);
        Law { place, basis, columns }
    }

    /// What the forms of these effects change, by recording; not of those that lie where a law is missing as a whole. `known` laws are not replayed again.
    fn forms(&self, effects: &[usize], but_at: Option<Subsystem>, known: &[Law]) -> Vec<Changes> {
        let mut all: Vec<Changes> = self.fit.residuals.iter().map(|r| DMatrix::zeros(r.len(), 0)).collect();
        let pulsates = |e: usize| matches!(REGISTRY[e].effect.act, Act::Pulsation(_));
        let smooth = Subsystem::ALL.into_iter().filter(|p| Some(*p) != but_at).map(|place| {
            let there = effects.iter().filter(|&&e| REGISTRY[e].effect.subsystem == place && !pulsates(e));
            (there.map(|&e| self.change(e)).sum::<f64>(), None, place)
        });
        let ripples = effects.iter().filter(|&&e| pulsates(e)).map(|&e| (self.change(e), Some(e), REGISTRY[e].effect.subsystem));
        // Effects that work against each other change more than the whole gap; their forms are told from it alone.
        let sum: f64 = effects.iter().map(|&e| self.change(e)).sum();
        let share = if sum > 0.0 { (self.gap() / sum).min(1.0) } else { 1.0 };
        for (change, ripple, place) in smooth.chain(ripples).collect::<Vec<_>>() {
            if change == 0.0 {
                continue;
            }
            let point = &self.fit.point;
            let mut columns = match (ripple, known.iter().find(|l| l.place == place)) {
                (Some(e), _) => self.columns(&pulsation::form(self.problem, point, e)),
                (None, Some(law)) => law.columns.clone(),
                (None, None) => self.law(place).columns,
            };
            let whole: f64 = columns.iter().map(DMatrix::norm_squared).sum();
            // Never larger than a law that is missing altogether.
            let scale = (FORM * (share * change / whole.max(f64::MIN_POSITIVE)).sqrt()).min(1.0);
            columns.iter_mut().for_each(|c| *c *= scale);
            all = all.iter().zip(&columns).map(|(a, b)| joined(a, b)).collect();
        }
        all
    }

    /// Sum of squares of what an effect changes in the innovations.
    fn change(&self, effect: usize) -> f64 {
        let mut point = self.fit.point.clone();
        REGISTRY[effect].parameters.clone().for_each(|p| point.effects[p] = PARAMETERS[p].null);
        self.off(&point, self.basis)
    }

    /// The same of everything that the mode has beyond the nominal car.
    fn gap(&self) -> f64 {
        self.off(&self.problem.nominal(), None)
    }

    /// Sum of squares of the difference in innovations between a point and the mode.
    fn off(&self, point: &Point, basis: Option<&Basis>) -> f64 {
        let square = |r: usize| {
            let there = self.problem.residuals(r, point, basis);
            there.iter().zip(&self.fit.residuals[r]).map(|(a, b)| (a - b).powi(2)).sum::<f64>()
        };
        // Summed in one order, whatever the threads do.
        (0..self.problem.tracks.len()).into_par_iter().map(square).collect::<Vec<f64>>().iter().sum()
    }

    fn gain(&self, changes: &[Changes]) -> Gain {
        let curvature = &self.equations.curvature;
        let m = changes.first().map_or(0, DMatrix::ncols);
        let none = || Gain { nats: 0.0, curvature: curvature.clone() };
        if m == 0 {
            return none();
        }
        let parts: Vec<(DMatrix<f64>, DVector<f64>, DMatrix<f64>)> = changes.par_iter().enumerate().map(|(r, v)| self.part(r, v)).collect();
        let (mut gram, mut slope, mut cross) = (DMatrix::identity(m, m), DVector::zeros(m), DMatrix::zeros(curvature.nrows(), m));
        for (g, s, c) in parts {
            gram += g;
            slope += s;
            cross += c;
        }
        let (Some(root), Some(own)) = (curvature.clone().cholesky(), gram.clone().cholesky()) else { return none() };
        let left = curvature - &cross * own.solve(&cross.transpose());
        let solved = root.solve(&cross);
        gram -= cross.tr_mul(&solved);
        slope -= solved.tr_mul(&self.equations.gradient);
        let Some(law) = gram.cholesky() else { return none() };
        let log_det = 2.0 * law.l_dirty().diagonal().map(f64::ln).sum();
        Gain { nats: 0.5 * slope.dot(&law.solve(&slope)) - 0.5 * log_det, curvature: left }
    }

    /// One recording's products of the changes among themselves, with its residuals, and with the shared coordinates, own unknowns eliminated.
    fn part(&self, r: usize, changes: &Changes) -> (DMatrix<f64>, DVector<f64>, DMatrix<f64>) {
        let here: &Residuals = &self.fit.residuals[r];
        let w = DVector::from_iterator(here.len(), here.iter().map(|r| weight(*r).sqrt()));
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
