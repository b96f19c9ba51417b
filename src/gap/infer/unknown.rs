//! Missing laws, for what no effect of the library accounts for, as hypotheses beside the others: a law is missing in one subsystem, alone or beside a set of effects.
//!
//! A missing law is a sum of the functions of `model::missing`: functions of states, and functions of time alone for errors that come and go by themselves. Its evidence follows
//! from one linear Gaussian model at a mode: with G the curvature along the amplitudes (all else eliminated, in units of their prior) and g the gradient, the amplitudes gain ½
//! gᵀ(1 + G)⁻¹g − ½ ln det(1 + G) nats. A missing law has the size of a noteworthy fault or a multiple of it; sizes are summed over, and the places that gain most are fitted, with
//! a form of their own.

use super::belief::{ByAccuracy, STEERING, overall};
use super::coordinate::Coordinate;
use super::density::{Basis, ByPhase, Point, Problem, WHOLE};
use super::fit::{Fit, Free, fit, mean_covariance};
use super::form::{are_as_large, forms, of_law};
use super::linear::{Columns, Frame, Known, Normal, Products, assemble, by_phase, to_powers};
use super::prior::{log_prior, moment, moments};
use super::search::{DRAGGED, Hypothesis, MOST_BYTES, STAY};
use super::weigh::Information;
use crate::effects::Subsystem;
use crate::gap::model::column::Column;
use crate::gap::model::course::Course;
use crate::gap::model::missing;
use crate::gap::model::replay::Missing;
use crate::gap::model::track::Track;
use crate::gap::model::unknown_clutch::hides;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::collections::HashSet;
use std::sync::Arc;

/// Prior probability that some law is missing in a given subsystem.
pub const PLACE_PRIOR: f64 = 0.012;

/// A missing law.
#[derive(Clone, Debug)]
pub struct Law {
    /// Its subsystem.
    pub place: Subsystem,
    /// Its functions.
    basis: Basis,
    /// Logarithm of the prior odds of a law in this place, plus the logarithm of the mean evidence of all sizes relative to that of the best one.
    log_odds: f64,
    /// Size of its functions of states, in units of a noteworthy fault.
    size: f64,
}

/// A missing law in one place, beside a set of effects.
#[derive(Clone, Debug)]
pub struct Unknown {
    /// Effects beside it.
    pub effects: Vec<usize>,
    /// The law.
    pub law: Law,
    /// Logarithm of the posterior probability under the full likelihood, nats, as [`Hypothesis::exact_log_posterior`].
    pub exact_log_posterior: f64,
    /// The same with the likelihood raised to the powers that steer the search.
    pub log_posterior: f64,
    /// The same for each accuracy that the explanation may have.
    pub by_accuracy: ByAccuracy<f64>,
    /// [`Fit::strain`] for each accuracy, if the law was fitted.
    pub strains: ByAccuracy<f64>,
    /// Fit, if there is one.
    pub fit: Option<Fit>,
}

/// Distance in nats behind the best place, by linear evidence, within which a place is fitted; number of leading places that should be fitted; and maximum number of fits.
const FITTED_NATS: f64 = 15.0;
const FITTED: usize = 2;
const MOST_FITTED: usize = 4;

fn is_near(best: f64, exact_log_posterior: f64) -> bool {
    best - exact_log_posterior < FITTED_NATS
}

/// Sizes of the functions of time alone relative to those of states, all equally likely.
const OF_TIME: [f64; 3] = [0.0, 0.25, 1.0];

/// Minimum spacing, s, of the functions of time alone: what comes and goes faster has died away in the speeds.
const APART_S: f64 = 0.5;
/// Maximum number of functions of time alone in all recordings, and the spacing, s, beyond which such functions would say nothing and are left out.
const MOST_TIMES: f64 = 300.0;
const FAR_APART_S: f64 = 2.0;

/// Sizes of a missing law in units of a noteworthy fault, all equally likely.
const SIZES: [f64; 4] = [1.0, 2.0, 4.0, 8.0];

/// Missing laws in every place beside a set of effects, the most probable first. Those near the best are fitted if the [`Unknown::exact_log_posterior`] that the best one promises is above
/// `least`.
pub fn places(problem: &Problem, of: &Hypothesis, least: f64) -> Vec<Unknown> {
    let of = &of.whole(problem);
    let (Some(sharp), Some(coarse)) = (Mode::new(problem, of, WHOLE), Mode::new(problem, of, problem.steering())) else {
        return Vec::new();
    };
    let courses = problem.courses(&of.formed.point, None);
    let promised = |place: Subsystem| promised(problem, of, &courses, [&sharp, &coarse], place);
    let mut found: Vec<Promised> = Vec::new();
    for place in Subsystem::ALL.into_iter().filter(|p| !hides(&problem.tracks, *p)) {
        found.push(promised(place));
        found.sort_by(|a, b| b.unknown.exact_log_posterior.total_cmp(&a.unknown.exact_log_posterior));
        // The functions of all places would take more memory than anything else, so that only those of the leading places are kept: two places, or one if two already take too
        // much, as in long drives.
        let held = if found.iter().map(Promised::bytes).sum::<usize>() > MOST_BYTES { 1 } else { FITTED };
        found.iter_mut().skip(held).for_each(Promised::let_go);
    }
    // Tolerances that were bent by the gap are not a good start for a law that explains it.
    let bent = of.fit.pull() > DRAGGED;
    let straight = Point { effects: of.fit.point.effects, ..problem.nominal() };
    // A fit may fall short of its promise. Therefore, the most promising place is fitted next until the two leading places have been fitted.
    for _ in 0..MOST_FITTED {
        found.sort_by(|a, b| b.unknown.exact_log_posterior.total_cmp(&a.unknown.exact_log_posterior));
        let best = found[0].unknown.exact_log_posterior;
        let worthwhile = |u: &Unknown| u.fit.is_none() && best > least && is_near(best, u.exact_log_posterior);
        let Some(promise) = found.iter_mut().take(FITTED).find(|p| worthwhile(&p.unknown)) else { break };
        if promise.known.is_empty() {
            *promise = promised(promise.unknown.law.place);
        }
        let Promised { unknown: u, size, known } = promise;
        let begun = FitWithoutOwnForm::new(problem, &of.effects, &u.law, &of.fit.point, Some(Known::Law(known)));
        // These derivatives take more memory than anything else, and are no longer needed.
        *known = Vec::new();
        *u = begun.finished(problem, &of.effects, &u.law);
        if bent {
            let mut basis = functions(problem, &straight, u.law.place);
            scale(&mut basis, *size);
            basis.extend(u.law.basis.iter().skip(basis.len()).cloned());
            let other = beside(problem, &of.effects, &Law { basis, ..u.law }, &straight, None);
            if other.exact_log_posterior > u.exact_log_posterior {
                *u = other;
            }
        }
    }
    found.iter_mut().filter(|p| p.unknown.fit.is_none()).for_each(Promised::let_go);
    let mut found: Vec<Unknown> = found.into_iter().map(|p| p.unknown).collect();
    found.sort_by(|a, b| b.exact_log_posterior.total_cmp(&a.exact_log_posterior));
    found
}

/// A missing law in one place with what the linear model promises for it.
struct Promised {
    unknown: Unknown,
    /// Best size of its functions of states, in units of a noteworthy fault.
    size: f64,
    /// Derivatives at the mode; those along the law's functions of states are the last of the shared ones. Empty once they were released.
    known: Vec<Columns>,
}

impl Promised {
    /// Memory of the functions and derivatives.
    fn bytes(&self) -> usize {
        let mut seen = HashSet::new();
        let columns: usize = self.known.iter().flatten().map(|c| c.bytes(&mut seen)).sum();
        columns + self.unknown.law.basis.iter().flat_map(|f| f.iter()).map(Missing::bytes).sum::<usize>()
    }

    /// Releases the functions and derivatives.
    fn let_go(&mut self) {
        (self.unknown.law.basis, self.known) = (Basis::new(), Vec::new());
    }
}

/// What the linear models promise for a missing law in a place: `sharp` under the full likelihood, `coarse` under the powers that steer the search.
fn promised(problem: &Problem, of: &Hypothesis, courses: &[Course], [sharp, coarse]: [&Mode; 2], place: Subsystem) -> Promised {
    struct OfSize {
        states: f64,
        time: f64,
        gain: f64,
        coarse: f64,
    }
    let mut basis = functions(problem, &of.fit.point, place);
    let changes = with_times(problem, &of.fit.point, courses, place, columns(courses, &basis));
    let mode = sharp;
    let parts = mode.products(&changes);
    let (sharp, coarse) = (sharp.information(&parts), coarse.information(&parts));
    let of_size = |states: f64, time: f64| {
        let by = DVector::from_fn(changes[0].len(), |f, _| if f < basis.len() { states } else { time });
        OfSize { states, time, gain: sharp.gain(&by, 1.0), coarse: coarse.gain(&by, 1.0) }
    };
    let all: Vec<OfSize> = SIZES.iter().flat_map(|&size| OF_TIME.map(|share| of_size(size, share * size))).collect();
    let best = all.iter().max_by(|a, b| a.coarse.total_cmp(&b.coarse)).expect("there are sizes");
    let as_good = |one: &OfSize| if best.coarse.is_finite() { (one.coarse - best.coarse).exp() } else { 1.0 };
    let as_good = all.iter().map(as_good).sum::<f64>() / all.len() as f64;
    let log_odds = (PLACE_PRIOR / (1.0 - PLACE_PRIOR)).ln() + as_good.ln();
    let states = basis.len();
    let mut timed = if best.time > 0.0 { linear(&changes, basis.len()) } else { Basis::new() };
    scale(&mut basis, best.states);
    scale(&mut timed, best.time);
    basis.extend(timed);
    let (exact_log_posterior, log_posterior) = (of.exact_log_posterior + best.gain + log_odds, of.log_posterior + best.coarse + log_odds);
    // From one accuracy to another, the powers of all phases change by nearly the same factor.
    let by = DVector::from_fn(changes[0].len(), |f, _| if f < states { best.states } else { best.time });
    let gain = |powers: ByPhase<f64>| coarse.gain(&by, overall(powers) / problem.power());
    let by_accuracy = std::array::from_fn(|c| of.by_accuracy[c] + gain(problem.powers[c]) + log_odds);
    let law = Law { place, basis, log_odds, size: best.states };
    let unknown = Unknown {
        effects: of.effects.clone(),
        law,
        exact_log_posterior,
        log_posterior,
        by_accuracy,
        strains: Default::default(),
        fit: None,
    };
    let (own, kept) = (of.formed.own.len(), of.fit.shared.len());
    let known = mode.columns.iter().zip(&changes).map(|(free, law)| {
        let law = law[..states].iter().map(|c| c.times(best.states));
        free[..kept].iter().cloned().chain(law).chain(free[free.len() - own..].iter().cloned()).collect()
    });
    Promised { unknown, size: best.states, known: known.collect() }
}

/// Fits a missing law beside a set of effects, including the forms of both, from a point. `known` are derivatives at this point.
pub fn beside(problem: &Problem, effects: &[usize], law: &Law, start: &Point, known: Option<Known>) -> Unknown {
    FitWithoutOwnForm::new(problem, effects, law, start, known).finished(problem, effects, law)
}

/// A fit of a missing law without the law's own form.
struct FitWithoutOwnForm {
    /// Functions of the law and of the effects' forms.
    basis: Basis,
    fit: Fit,
}

impl FitWithoutOwnForm {
    fn new(problem: &Problem, effects: &[usize], law: &Law, start: &Point, known: Option<Known>) -> Self {
        let count = law.basis.len();
        let of_effects = forms(problem, start, effects);
        let mut basis: Basis = law.basis.iter().chain(&of_effects).cloned().collect();
        let mut start = start.clone();
        start.missing.truncate(count);
        let begun = fit(problem, Free { effects, basis: Some(&basis) }, &start, STAY, known);
        // Effects for which the law leaves nothing to explain have next to no form either.
        let there = forms(problem, &begun.point, effects);
        if are_as_large(&there, &of_effects) {
            return Self { basis, fit: begun };
        }
        basis.splice(count.., there);
        let mut from = begun.point.clone();
        from.missing.truncate(count);
        let fit = fit(problem, Free { effects, basis: Some(&basis) }, &from, STAY, begun.known());
        Self { basis, fit }
    }

    fn finished(self, problem: &Problem, effects: &[usize], law: &Law) -> Unknown {
        let count = law.basis.len();
        let form = of_law(problem, &self.fit.point, &self.basis, count);
        let all: Basis = self.basis.into_iter().chain(form).collect();
        let fitted = fit(problem, Free { effects, basis: Some(&all) }, &self.fit.point, STAY, self.fit.known_with_law());
        weighed(problem, effects, law, &all, &fitted)
    }
}

/// Weighs a fit of a law and its form. Functions of the basis beyond those of the law are functions of forms.
fn weighed(problem: &Problem, effects: &[usize], law: &Law, all: &Basis, fitted: &Fit) -> Unknown {
    let prior = log_prior(effects.len()) + law.log_odds;
    let at = |powers| {
        let (evidence, fit) = fitted.weighed(problem, all, law.basis.len(), powers);
        (evidence + prior + moments(&fit, effects) + moment_of_law(&fit, law), fit)
    };
    let (exact_log_posterior, sharp) = at(WHOLE);
    let exact = sharp.marginal().curvature;
    let believed = problem.powers.map(at);
    let by_accuracy = believed.each_ref().map(|(believed, _)| *believed);
    let strains = believed.each_ref().map(|(_, fit)| fit.strain);
    let (log_posterior, fitted) = believed[STEERING].clone();
    let mean_covariance = mean_covariance(believed.map(|(_, fit)| fit));
    // Functions are eliminated, and their derivatives are released, because there may be hundreds of them.
    let columns = Arc::new(fitted.columns.iter().map(|c| without_functions(c, &fitted.shared)).collect());
    let fit = Fit { columns, parts: Arc::default(), mean_covariance, exact, ..fitted.marginal() };
    Unknown { effects: effects.to_vec(), law: law.clone(), exact_log_posterior, log_posterior, by_accuracy, strains, fit: Some(fit) }
}

/// Change of the log evidence of a law, nats, by a moment prior like that of effects ([`moments`]), under which a missing law is not small. The size of a law is what it changes in
/// the innovations, relative to what it would be expected to change if each of its functions were as large as a noteworthy fault. Amplitudes alone do not measure it, because
/// functions may cancel each other.
fn moment_of_law(fit: &Fit, law: &Law) -> f64 {
    let Some(covariance) = fit.covariance() else { return f64::NEG_INFINITY };
    let is_of_law = |c: &Coordinate| matches!(c, Coordinate::Missing(k) if *k < law.basis.len());
    let of: Vec<usize> = (0..fit.shared.len()).filter(|&i| is_of_law(&fit.shared[i])).collect();
    let part = |all: &DMatrix<f64>| all.select_rows(&of).select_columns(&of);
    let amplitudes = DVector::from_fn(of.len(), |i, _| fit.shared[of[i]].get(&fit.point, 0));
    let mean_squares = &amplitudes * amplitudes.transpose() + part(&covariance);
    let products = fit.parts.iter().flatten().fold(DMatrix::zeros(of.len(), of.len()), |sum, (p, _)| sum + part(p));
    let expected = products.trace();
    // A law that changes nothing cannot be distinguished from anything.
    if expected == 0.0 {
        return 0.0;
    }
    let square = products.component_mul(&mean_squares).sum() / expected;
    // The normal prior already contains the law's own size.
    moment(square * law.size.powi(2)) - 2.0 * law.size.ln()
}

/// Derivatives along the coordinates `shared`, followed by the own ones, without those along functions.
fn without_functions(columns: &Columns, shared: &[Coordinate]) -> Columns {
    let is_function = |k: usize| matches!(shared.get(k), Some(Coordinate::Missing(_)));
    columns.iter().enumerate().filter(|(k, _)| !is_function(*k)).map(|(_, c)| c.clone()).collect()
}

/// Functions of the law in `place` along the replays of the car at a point.
fn functions(problem: &Problem, point: &Point, place: Subsystem) -> Basis {
    let of_track = |k: usize| {
        let car = problem.car(point, Some(k));
        missing::functions(place, &problem.tracks[k], &problem.filters[k], &car, problem.temperatures(point, k)).into_iter()
    };
    let mut by_track: Vec<_> = (0..problem.tracks.len()).into_par_iter().map(of_track).collect();
    let count = by_track.first().map_or(0, ExactSizeIterator::len);
    (0..count).map(|_| by_track.iter_mut().map(|t| t.next().expect("as many of every track")).collect()).collect()
}

/// Multiplies functions by a factor.
fn scale(basis: &mut Basis, by: f64) {
    basis.iter_mut().for_each(|f| Arc::make_mut(f).iter_mut().for_each(|one| one.scale(by)));
}

/// Replaces the functions from index `from` on by the changes that they make in the innovations, so that nothing has to be replayed.
fn linear(changes: &[Columns], from: usize) -> Basis {
    let one = |c: &Columns, f: usize| Missing { innovations: c[f].clone(), ..Missing::default() };
    (from..changes.first().map_or(0, Vec::len)).map(|f| changes.iter().map(|c| one(c, f)).collect()).collect()
}

/// Change of the innovations of each recording along its course, by one standard deviation of each function.
fn columns(courses: &[Course], further: &Basis) -> Vec<Columns> {
    let one = |(r, course): (usize, &Course)| further.par_iter().map(|f| Column::new(&course.response(&f[r]))).collect();
    courses.par_iter().enumerate().map(one).collect()
}

/// Appends the changes by functions of time alone in a place to `changes`: bumps, each in one recording.
fn with_times(problem: &Problem, point: &Point, courses: &[Course], place: Subsystem, changes: Vec<Columns>) -> Vec<Columns> {
    let total: f64 = problem.tracks.iter().map(Track::duration).sum();
    let width = APART_S.max(total / MOST_TIMES);
    if width > FAR_APART_S {
        return changes;
    }
    let of_recording = |(r, course): (usize, &Course)| -> Columns {
        let (car, theta) = (problem.car(point, Some(r)), problem.temperatures(point, r));
        let bumps = missing::bumps(place, width, &problem.tracks[r], &problem.filters[r], &car, theta);
        bumps.map(|bump| Column::new(&course.response(&bump))).filter(|column| !column.is_zero()).collect()
    };
    let timed: Vec<Columns> = courses.par_iter().enumerate().map(of_recording).collect();
    let count: usize = timed.iter().map(Vec::len).sum();
    let mut next = changes.first().map_or(0, Vec::len);
    let with = |(mut all, timed): (Columns, Columns)| {
        all.resize(all.len() + count, Column::default());
        for column in timed {
            all[next] = column;
            next += 1;
        }
        all
    };
    changes.into_iter().zip(timed).map(with).collect()
}

/// A mode at which further functions are tried.
struct Mode<'a> {
    problem: &'a Problem,
    fit: &'a Fit,
    columns: Arc<Vec<Columns>>,
    equations: Normal,
    powers: ByPhase<f64>,
}

impl<'a> Mode<'a> {
    fn new(problem: &'a Problem, of: &'a Hypothesis, powers: ByPhase<f64>) -> Option<Self> {
        let fit = &of.formed;
        let frame = Frame { shared: fit.shared.clone(), own: fit.own.clone() };
        let columns = fit.derivatives(problem, &frame, Some(&of.basis));
        let equations = assemble(&fit.point, &frame, &to_powers(&fit.parts, powers), 0.0)?;
        Some(Self { problem, fit, columns, equations, powers })
    }

    /// Products of everything that is free at the mode and of these changes, by recording and phase.
    fn products(&self, changes: &[Columns]) -> Vec<ByPhase<Products>> {
        let all: Vec<Columns> = self.columns.iter().zip(changes).map(|(free, more)| free.iter().chain(more).cloned().collect()).collect();
        by_phase(self.problem, &all, &self.fit.residuals)
    }

    /// Information of the recordings about functions, from these products.
    fn information(&self, parts: &[ByPhase<Products>]) -> Information {
        let curvature = &self.equations.curvature;
        let (s, free) = (curvature.nrows(), self.columns.first().map_or(0, Vec::len));
        let m = parts.first().map_or(0, |part| part[0].1.len() - free);
        let (mut gram, mut slope, mut cross) = (DMatrix::zeros(m, m), DVector::zeros(m), DMatrix::zeros(s, m));
        for (e, (p, g)) in self.equations.eliminated.iter().zip(to_powers(parts, self.powers)) {
            let own = p.view((s, free), (free - s, m)).into_owned();
            gram += p.view((free, free), (m, m)) - own.transpose() * e.solve(&own);
            slope += g.rows(free, m) - own.tr_mul(e.offset());
            cross += p.view((0, free), (s, m)) - e.coupling().transpose() * &own;
        }
        if let Some(root) = curvature.clone().cholesky() {
            let solved = root.solve(&cross);
            gram -= cross.transpose() * &solved;
            slope -= solved.tr_mul(&self.equations.gradient);
        }
        Information { gram, slope }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two functions change the same: with equal signs they are a law, with opposite signs they cancel.
    #[test]
    fn a_law_that_changes_next_to_nothing_is_negligible() {
        let of = |amplitudes: [f64; 2], size: f64| {
            let made_up = Fit::made_up(vec![Coordinate::Missing(0), Coordinate::Missing(1)]);
            let products = |p: f64| (DMatrix::from_element(2, 2, p), DVector::zeros(2));
            let parts = Arc::new(vec![[products(1e4), products(0.0), products(3e4)]]);
            let point = Point { missing: amplitudes.to_vec(), ..made_up.point.clone() };
            let fit = Fit { point, parts, curvature: DMatrix::identity(2, 2) * 1e8, ..made_up };
            let basis = vec![Arc::from([Missing::default()]), Arc::from([Missing::default()])];
            moment_of_law(&fit, &Law { place: Subsystem::Engine, basis, log_odds: 0.0, size })
        };
        // The measure is (a + b)² over two functions: with half a fault each, it is 0.5.
        let expected = |square: f64, size: f64| square.ln() - 0.01 / (square * size * size);
        assert!((of([0.5, 0.5], 1.0) - expected(0.5, 1.0)).abs() < 1e-3 && (of([0.5, 0.5], 4.0) - expected(0.5, 4.0)).abs() < 1e-3);
        assert!((of([0.1, 0.0], 1.0) - expected(0.005, 1.0)).abs() < 1e-3);
        assert!(of([1.0, -1.0], 1.0) < -1e5);
    }

    #[test]
    fn derivatives_along_functions_are_left_out() {
        let columns: Columns = (1..=5).map(|k| Column::new(&[f64::from(k)])).collect();
        let shared = [Coordinate::Shared(0), Coordinate::Missing(0), Coordinate::Missing(1), Coordinate::Effect(3)];
        let kept: Vec<f64> = without_functions(&columns, &shared).iter().flat_map(|c| c.values().collect::<Vec<_>>()).collect();
        assert_eq!(kept, [1.0, 4.0, 5.0]);
    }

    /// A fit that beats its promise can no longer make up for odds of three million to one.
    #[test]
    fn a_place_fifteen_nats_behind_is_not_fitted() {
        assert_eq!([14.9, 15.1, 0.0, -3.0].map(|behind| is_near(100.0, 100.0 - behind)), [true, false, true, true]);
    }
}
