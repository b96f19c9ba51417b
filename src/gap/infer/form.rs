//! The form of an effect: how the real one differs from the library's.
//!
//! An effect changes the whitened innovations by d: what they are with it less what they are without. A real one does more here and less there,
//!
//! ```text
//! d (1 + Σ a_jk H_k(u_j)) ,   a_jk normal,
//! ```
//!
//! with u_j the states that its law may depend on ([`missing::states`](crate::gap::model::missing::states)), each shifted and scaled to mean 0 and variance 1 where the effect acts, and H_k
//! the Hermite polynomials of first and second degree. All a_jk have one standard deviation, so that the form is expected to change [`FORM`] of what the effect
//! changes; or those of a single state have it, with as much to change ([`alone`]). A ripple may also be shifted in phase: its d is joined by that of the ripple a quarter
//! of a turn on.
//!
//! The functions are linear in the innovations: a fit takes them along without replays of their own.

use super::density::{Baseline, Basis, Point, Problem, Residuals};
use crate::effects::{Act, REGISTRY};
use crate::gap::model::column::Column;
use crate::gap::model::replay::Missing;
use crate::gap::model::track::Track;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// How far the form of a real effect is from the library's: standard deviation of what that changes in the recordings, relative to what the effect itself
/// changes in them.
pub const FORM: f64 = 0.12;

/// By how much the form of a real effect moves in time what the effect changes, s.
const MOVED_S: f64 = 0.02;

/// Scaled states beyond which a function stays as it is.
const FAR: f64 = 2.5;

/// The functions of the forms of these effects at a point, one standard deviation each.
pub fn forms(problem: &Problem, point: &Point, effects: &[usize]) -> Basis {
    if effects.is_empty() {
        return Basis::new();
    }
    let point = &Point { missing: Vec::new(), ..point.clone() };
    let from = baselines(problem, point, None);
    effects.iter().flat_map(|&e| of_effect(problem, point, e, &from)).collect()
}

fn of_effect(problem: &Problem, point: &Point, effect: usize, from: &[Baseline]) -> Basis {
    let entry = &REGISTRY[effect];
    let mut changes = vec![less(problem, from, &point.without(effect))];
    if matches!(entry.effect.act, Act::Pulsation(_)) {
        let k = entry.parameters.start;
        let mut turned = point.clone();
        (turned.effects[k], turned.effects[k + 1]) = (-point.effects[k + 1], point.effects[k]);
        let turn = less(problem, from, &turned);
        changes.push(difference(&changes[0], &turn));
    }
    of_changes(problem, &changes, FORM, Some(effect))
}

/// The functions of the form of a missing law: what its first `amplitudes` change at a point. Of a law that nobody knows the form is as uncertain as its size.
pub fn of_law(problem: &Problem, point: &Point, basis: &Basis, amplitudes: usize) -> Basis {
    let mut without = point.clone();
    without.missing[..amplitudes].fill(0.0);
    let from = baselines(problem, point, Some(basis));
    of_changes(problem, &[less(problem, &from, &without)], 1.0, None)
}

/// What forms are expected to change: the sum of squares of one standard deviation of each function.
pub fn change(basis: &Basis) -> f64 {
    basis.iter().flat_map(|f| f.iter()).map(|f| f.innovations.square()).sum()
}

/// Difference of the logarithms of the squares of what two sets of forms change, up to which they are as large as each other.
const AS_LARGE: f64 = 0.2;

/// Whether two sets of forms are as large as each other: those that are not are worked out again where a fit ends, for a form is a share of what its effect changes there.
pub fn are_as_large(one: &Basis, other: &Basis) -> bool {
    one.is_empty() && other.is_empty() || (change(one) / change(other)).ln().abs() < AS_LARGE
}

/// Functions along one state: their places in a basis, and the factor at which they alone change as much as those along every state.
#[derive(Clone, Debug, PartialEq)]
pub struct Alone {
    /// Places in the basis.
    pub functions: Vec<usize>,
    /// Factor on their sizes.
    pub factor: f64,
}

/// The functions of each effect's form, state by state.
pub fn alone(basis: &Basis) -> Vec<Vec<Alone>> {
    let mut effects: BTreeMap<usize, BTreeMap<usize, (Vec<usize>, f64)>> = BTreeMap::new();
    for (k, function) in basis.iter().enumerate() {
        if let Some((effect, state)) = function.first().and_then(|f| f.along) {
            let (functions, square) = effects.entry(effect).or_default().entry(state).or_default();
            functions.push(k);
            *square += function.iter().map(|f| f.innovations.square()).sum::<f64>();
        }
    }
    let of_effect = |states: BTreeMap<usize, (Vec<usize>, f64)>| {
        let whole: f64 = states.values().map(|(_, square)| square).sum();
        states.into_values().map(|(functions, square)| Alone { functions, factor: (whole / square).sqrt() }).collect()
    };
    effects.into_values().map(of_effect).collect()
}

/// The functions of changes, so that all of them together change this share of what the first one is: of the form of an effect, or of nothing that is told apart.
fn of_changes(problem: &Problem, changes: &[Vec<Residuals>], share: f64, effect: Option<usize>) -> Basis {
    let whole = square(&changes[0]);
    if whole == 0.0 {
        return Basis::new();
    }
    let functions: Vec<Function> = changes.iter().flat_map(|d| modulated(problem, d)).collect();
    let all: f64 = functions.iter().flat_map(|f| &f.by_recording).map(Column::square).sum();
    let scale = share * (whole / all.max(f64::MIN_POSITIVE)).sqrt();
    let one = |f: Function| {
        let along = effect.zip(f.state);
        f.by_recording.into_iter().map(|values| Missing { innovations: values.times(scale), along, ..Missing::default() }).collect()
    };
    functions.into_iter().map(one).collect()
}

/// A function of a form, along a state unless it moves the change in time.
struct Function {
    state: Option<usize>,
    by_recording: Vec<Column>,
}

/// A change moved in time, and times the polynomials of every state.
fn modulated(problem: &Problem, change: &[Residuals]) -> Vec<Function> {
    // Two speeds per observation, then the bench channels, one value each.
    let state = |j: usize, r: usize, i: usize| {
        let n = problem.tracks[r].observations();
        problem.states[r][j][if i < 2 * n { i / 2 } else { (i - 2 * n) % n }]
    };
    let times = |j: usize, f: &dyn Fn(f64) -> f64| -> Vec<Residuals> {
        let one = |(r, d): (usize, &Residuals)| d.iter().enumerate().map(|(i, d)| d * f(state(j, r, i))).collect();
        change.iter().enumerate().map(one).collect()
    };
    let whole = square(change);
    let function =
        |state: Option<usize>, values: &[Residuals]| Function { state, by_recording: values.iter().map(|v| Column::new(v)).collect() };
    let mut functions: Vec<Function> = in_time(problem, change).iter().map(|f| function(None, f)).collect();
    for j in 0..problem.states[0].len() {
        let mean = |f: &dyn Fn(f64) -> f64| {
            let weighted = times(j, f);
            change.iter().zip(&weighted).flat_map(|(d, w)| d.iter().zip(w)).map(|(d, w)| d * w).sum::<f64>() / whole
        };
        let centre = mean(&|x| x);
        let spread = mean(&|x| (x - centre).powi(2)).sqrt();
        // A state that stands still modulates nothing.
        if spread <= 1e-9 * centre.abs() || !spread.is_finite() {
            continue;
        }
        let u = |x: f64| ((x - centre) / spread).clamp(-FAR, FAR);
        functions.push(function(Some(j), &times(j, &u)));
        functions.push(function(Some(j), &times(j, &|x| (u(x).powi(2) - 1.0) / std::f64::consts::SQRT_2)));
    }
    functions
}

/// A change's first and second difference in time, each as large as the change.
fn in_time(problem: &Problem, change: &[Residuals]) -> Vec<Vec<Residuals>> {
    let difference = |weights: [f64; 3]| -> Vec<Residuals> {
        let one = |(d, track): (&Residuals, &Track)| {
            let n = track.observations();
            let by = (MOVED_S / track.pace()).round().max(1.0) as usize;
            // Two speeds per observation, then the bench channels, one value each.
            let at = |i: usize, earlier: usize, later: usize| {
                let (start, stride) = if i < 2 * n { (i % 2, 2) } else { (i - (i - 2 * n) % n, 1) };
                let k = (i - start) / stride + later;
                if k < earlier || k - earlier >= n { 0.0 } else { d[start + stride * (k - earlier)] }
            };
            (0..d.len()).map(|i| weights[0] * at(i, by, 0) + weights[1] * d[i] + weights[2] * at(i, 0, by)).collect()
        };
        change.iter().zip(&problem.tracks).map(one).collect()
    };
    let whole = square(change);
    let like = |mut d: Vec<Residuals>| {
        let size = square(&d);
        let scale = if size > 0.0 { (whole / size).sqrt() } else { 0.0 };
        d.iter_mut().flatten().for_each(|x| *x *= scale);
        d
    };
    [[-1.0, 0.0, 1.0], [1.0, -2.0, 1.0]].map(difference).map(like).into()
}

fn baselines<'a>(problem: &Problem, point: &'a Point, basis: Option<&'a Basis>) -> Vec<Baseline<'a>> {
    (0..problem.tracks.len()).into_par_iter().map(|r| problem.baseline(r, point, basis, None)).collect()
}

/// Change from baselines to a point with less: what the effect or law in question does is minus this.
fn less(problem: &Problem, from: &[Baseline], to: &Point) -> Vec<Residuals> {
    from.par_iter().enumerate().map(|(r, from)| problem.change(r, from, to)).collect()
}

fn difference(a: &[Residuals], b: &[Residuals]) -> Vec<Residuals> {
    a.iter().zip(b).map(|(a, b)| a.iter().zip(b).map(|(a, b)| a - b).collect()).collect()
}

fn square(all: &[Residuals]) -> f64 {
    all.iter().flatten().map(|x| x * x).sum()
}
