//! The form of an effect: how the real one differs from the library's.
//!
//! Let d be what an effect of the library does: torques and sensor errors. A real effect does more in some states and less in others,
//!
//! ```text
//! d (1 + Σ a_jk H_k(u_j)) ,   a_jk normal,
//! ```
//!
//! where u_j are the states that the effect's subsystem can depend on ([`missing::states`](crate::gap::model::missing::states)), and d itself if the effect arises from a memory,
//! each shifted and scaled to mean 0 and variance 1 where the effect acts, and H_k are the Hermite polynomials up to the fourth degree. All a_jk have one standard deviation,
//! chosen so that the form is expected to do the share [`FORM`] of what the effect does; alternatively, the functions along a single state do as much alone ([`alone`]). What each
//! function changes in the innovations follows from the course of the car ([`Course`]), including the filter, which absorbs whatever lasts.
//!
//! A course does not show what inertias and elastic shafts do, nor ripples that a logger hardly resolves. For these effects, and for missing laws, d is the change that they make
//! in the whitened innovations, and the polynomials are those of first and second degree along all states. A ripple may also be shifted in phase: the d of the same ripple a
//! quarter of a turn on is added to its own.
//!
//! The functions are linear in the innovations, so that a fit includes them without further replays.

use super::density::{Baseline, Basis, Point, Problem, Residuals};
use crate::effects::{Act, REGISTRY, Subsystem};
use crate::gap::model::column::Column;
use crate::gap::model::course::Course;
use crate::gap::model::missing::state;
use crate::gap::model::replay::{Missing, at};
use crate::gap::model::track::Track;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::SQRT_2;

/// How far the form of a real effect is expected to be from the library's: standard deviation of what the form changes in the recordings, relative to what the effect itself
/// changes in them.
pub const FORM: f64 = 0.12;

/// Time, s, by which the form of a real effect shifts what the effect changes.
const MOVED_S: f64 = 0.02;

/// Highest degree of the polynomials: for functions of what an effect does, and for functions of what an effect changes in the innovations, where its courses do not show what it
/// does.
const DEGREE_OF_CAUSE: i32 = 4;
const DEGREE_OF_CHANGE: i32 = 2;

/// Largest relative error (root mean square) with which the response to what an effect does may reproduce what the effect changes in the innovations; beyond it, the form is
/// derived from these changes.
const LARGEST_MISMATCH: f64 = 0.5;

/// States on which the action of a subsystem can depend.
fn depends_on(subsystem: Subsystem) -> &'static [usize] {
    match subsystem {
        Subsystem::Engine => &[state::OMEGA_F, state::REPORT, state::TIME],
        Subsystem::Driveline | Subsystem::Sensors => &[state::OMEGA_C, state::TIME],
        _ => &[state::SLIP, state::THETA, state::POSITION, state::DIRECTION, state::TIME],
    }
}

/// Limit of the scaled states beyond which a polynomial is constant.
const FAR: f64 = 2.5;

/// The functions of the forms of these effects at a point, each with the size of one standard deviation.
pub fn forms(problem: &Problem, point: &Point, effects: &[usize]) -> Basis {
    if effects.is_empty() {
        return Basis::new();
    }
    let with = problem.courses(point, None);
    effects.iter().flat_map(|&e| of_effect(problem, point, e, &with)).collect()
}

fn of_effect(problem: &Problem, point: &Point, effect: usize, with: &[Course]) -> Basis {
    let entry = &REGISTRY[effect];
    let change =
        |other: &[Course]| -> Vec<Residuals> { with.iter().zip(other).map(|(a, b)| difference(&a.innovations, &b.innovations)).collect() };
    let without = problem.courses(&point.without(effect), Some(with));
    let mut changes = vec![change(&without)];
    if square(&changes[0]) == 0.0 {
        return Basis::new();
    }
    if matches!(entry.effect.act, Act::Pulsation(_)) {
        let k = entry.parameters.start;
        let mut turned = point.clone();
        (turned.effects[k], turned.effects[k + 1]) = (-point.effects[k + 1], point.effects[k]);
        let turn = change(&problem.courses(&turned, Some(with)));
        changes.push(turn.iter().zip(&changes[0]).map(|(turn, whole)| difference(whole, turn)).collect());
        return of_changes(problem, &changes, FORM, Some(effect));
    }
    let causes: Vec<Missing> = with.iter().zip(&without).map(|(a, b)| a.beyond(b)).collect();
    let answers = |to: &[Missing]| -> Vec<Residuals> { with.iter().zip(to).map(|(course, law)| course.response(law)).collect() };
    if !accounts_for(&answers(&causes), &changes[0]) {
        return of_changes(problem, &changes, FORM, Some(effect));
    }
    // An effect that arises from a memory is not a function of states alone, and its form may depend on what the effect does itself.
    let at_once: Vec<Missing> = with.iter().zip(&without).map(|(a, b)| a.beyond_at_once(b)).collect();
    let itself: &[usize] = if accounts_for(&answers(&at_once), &changes[0]) { &[] } else { &[state::ITSELF] };
    let along = [depends_on(entry.effect.subsystem), itself].concat();
    of_causes(problem, &changes[0], &causes, with, (effect, &along))
}

/// Whether `told` predicts the change of the innovations to within the relative error [`LARGEST_MISMATCH`].
fn accounts_for(told: &[Residuals], change: &[Residuals]) -> bool {
    let untold: Vec<Residuals> = change.iter().zip(told).map(|(a, b)| difference(a, b)).collect();
    square(&untold) <= LARGEST_MISMATCH.powi(2) * square(change)
}

/// The functions of the form of a missing law at a point, from the change of the innovations by the first `amplitudes` functions of the basis. Since nobody knows the law, its form
/// is as uncertain as its size.
pub fn of_law(problem: &Problem, point: &Point, basis: &Basis, amplitudes: usize) -> Basis {
    let mut without = point.clone();
    without.missing[..amplitudes].fill(0.0);
    let from = baselines(problem, point, Some(basis));
    of_changes(problem, &[less(problem, &from, &without)], 1.0, None)
}

/// Expected square of the change that forms make in the innovations: the sum of squares of all functions, which have the size of one standard deviation.
pub fn change(basis: &Basis) -> f64 {
    basis.iter().flat_map(|f| f.iter()).map(|f| f.innovations.square()).sum()
}

/// Difference of the logarithms of [`change`] below which two sets of forms are equally large.
const AS_LARGE: f64 = 0.2;

/// Whether two sets of forms are equally large. If not, the forms are computed again where a fit ends, because a form is a share of what its effect changes there.
pub fn are_as_large(one: &Basis, other: &Basis) -> bool {
    one.is_empty() && other.is_empty() || (change(one) / change(other)).ln().abs() < AS_LARGE
}

/// Functions along one state: their indices in a basis, and the factor on their sizes with which they alone change as much as the functions along all states together.
#[derive(Clone, Debug, PartialEq)]
pub struct Alone {
    /// Indices in the basis.
    pub functions: Vec<usize>,
    /// Factor on their sizes.
    pub factor: f64,
}

/// Groups the functions of each effect's form by state.
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

/// The functions of a form that is derived from changes of the innovations, scaled so that all of them together change the given share of what `changes[0]` is. `effect` is the
/// effect to which the form belongs; a missing law has none.
fn of_changes(problem: &Problem, changes: &[Vec<Residuals>], share: f64, effect: Option<usize>) -> Basis {
    let whole = square(&changes[0]);
    if whole == 0.0 {
        return Basis::new();
    }
    let functions: Vec<Function> = changes.iter().flat_map(|d| modulated(problem, d)).collect();
    let all: f64 = functions.iter().flat_map(|f| &f.by_recording).map(Column::square).sum();
    basis(functions, share * (whole / all.max(f64::MIN_POSITIVE)).sqrt(), effect)
}

/// The functions of the form of an effect that are derived from what the effect does in each recording (`causes`), scaled so that all of them together do the share [`FORM`] of it.
/// The shifts in time are derived from what the effect changes in the innovations (`change`).
fn of_causes(problem: &Problem, change: &[Residuals], causes: &[Missing], with: &[Course], (effect, along): (usize, &[usize])) -> Basis {
    let size = |k: usize| causes.iter().flat_map(|c| c.acting()[k]).map(|x| x * x).sum::<f64>();
    // The foremost action of the effect is its largest torque or, without any, the larger of its two speed errors.
    let torque = (0..3).max_by(|&a, &b| size(a).total_cmp(&size(b))).filter(|&k| size(k) > 0.0);
    let foremost = torque.unwrap_or(if size(3) > size(4) { 3 } else { 4 });
    let itself: Vec<&[f64]> = causes.iter().map(|c| c.acting()[foremost].as_slice()).collect();
    let weights = |(itself, track): (&&[f64], &Track)| (0..track.rows()).map(|row| at(itself, row).powi(2)).collect();
    let weights: Vec<Vec<f64>> = itself.iter().zip(&problem.tracks).map(weights).collect();
    let value = |r: usize, state: usize, row: usize| match state {
        state::ITSELF => at(itself[r], row),
        _ => problem.states[r][state][problem.tracks[r].observation_of(row)],
    };
    let polynomials = polynomials(along, DEGREE_OF_CAUSE, &weights, value);
    let of_polynomial = |p: &Polynomial| {
        let one = |(r, (cause, course)): (usize, (&Missing, &Course))| {
            Column::new(&course.response(&cause.times(|row| p.at(value(r, p.state, row)))))
        };
        Function { state: Some(p.state), by_recording: causes.iter().zip(with).enumerate().map(one).collect() }
    };
    let mut functions: Vec<Function> = in_time(problem, change).iter().map(|f| Function::new(None, f)).collect();
    functions.par_extend(polynomials.par_iter().map(of_polynomial));
    let scale = FORM / (functions.len() as f64).sqrt();
    basis(functions, scale, Some(effect))
}

fn basis(functions: Vec<Function>, scale: f64, effect: Option<usize>) -> Basis {
    let one = |f: Function| {
        let along = effect.zip(f.state);
        f.by_recording.into_iter().map(|values| Missing { innovations: values.times(scale), along, ..Missing::default() }).collect()
    };
    functions.into_iter().map(one).collect()
}

/// A function of a form along a state or, without a state, a shift in time.
struct Function {
    state: Option<usize>,
    by_recording: Vec<Column>,
}

impl Function {
    fn new(state: Option<usize>, values: &[Residuals]) -> Self {
        Self { state, by_recording: values.iter().map(|v| Column::new(v)).collect() }
    }
}

/// A Hermite polynomial of a state.
struct Polynomial {
    state: usize,
    centre: f64,
    spread: f64,
    degree: i32,
}

impl Polynomial {
    fn at(&self, x: f64) -> f64 {
        let u = ((x - self.centre) / self.spread).clamp(-FAR, FAR);
        match self.degree {
            1 => u,
            2 => (u * u - 1.0) / SQRT_2,
            3 => (u.powi(3) - 3.0 * u) / 6.0_f64.sqrt(),
            _ => (u.powi(4) - 6.0 * u * u + 3.0) / 24.0_f64.sqrt(),
        }
    }
}

/// The polynomials along these states from the first degree up to `degree`. Each state is shifted and scaled to mean 0 and variance 1 under `weights`, which are given by recording
/// and sample; `value(r, state, i)` returns the state at sample `i` of recording `r`.
fn polynomials(along: &[usize], degree: i32, weights: &[Vec<f64>], value: impl Fn(usize, usize, usize) -> f64) -> Vec<Polynomial> {
    let whole: f64 = weights.iter().flatten().sum();
    let mut all = Vec::new();
    for &state in along {
        let mean = |f: &dyn Fn(f64) -> f64| {
            let one = |(r, weights): (usize, &Vec<f64>)| weights.iter().enumerate().map(|(i, w)| w * f(value(r, state, i))).sum::<f64>();
            weights.iter().enumerate().map(one).sum::<f64>() / whole
        };
        let centre = mean(&|x| x);
        let spread = mean(&|x| (x - centre).powi(2)).sqrt();
        // A state that does not vary modulates nothing.
        if spread <= 1e-9 * centre.abs() || !spread.is_finite() {
            continue;
        }
        all.extend((1..=degree).map(|degree| Polynomial { state, centre, spread, degree }));
    }
    all
}

/// A change shifted in time, and a change multiplied by the polynomials of every state.
fn modulated(problem: &Problem, change: &[Residuals]) -> Vec<Function> {
    // Two speeds per observation, then the bench channels, one value each.
    let value = |r: usize, state: usize, i: usize| {
        let n = problem.tracks[r].observations();
        problem.states[r][state][if i < 2 * n { i / 2 } else { (i - 2 * n) % n }]
    };
    let weights: Vec<Vec<f64>> = change.iter().map(|d| d.iter().map(|d| d * d).collect()).collect();
    let mut functions: Vec<Function> = in_time(problem, change).iter().map(|f| Function::new(None, f)).collect();
    functions.extend(polynomials(&state::ALL, DEGREE_OF_CHANGE, &weights, value).iter().map(|p| {
        let one = |(r, d): (usize, &Residuals)| d.iter().enumerate().map(|(i, d)| d * p.at(value(r, p.state, i))).collect();
        Function::new(Some(p.state), &change.iter().enumerate().map(one).collect::<Vec<_>>())
    }));
    functions
}

/// First and second difference of a change in time, each scaled to the size of the change.
fn in_time(problem: &Problem, change: &[Residuals]) -> Vec<Vec<Residuals>> {
    let difference = |weights: [f64; 3]| -> Vec<Residuals> {
        let one = |(d, track): (&Residuals, &Track)| {
            let n = track.observations();
            let by = (MOVED_S / track.observation_interval()).round().max(1.0) as usize;
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

/// Change of the innovations from baselines to a point without a law; what the law changes is the negative of this.
fn less(problem: &Problem, from: &[Baseline], to: &Point) -> Vec<Residuals> {
    from.par_iter().enumerate().map(|(r, from)| problem.change(r, from, to)).collect()
}

fn difference(a: &Residuals, b: &Residuals) -> Residuals {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

fn square(all: &[Residuals]) -> f64 {
    all.iter().flatten().map(|x| x * x).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{find, param};
    use crate::gap::model::missing::state::OMEGA_C;
    use crate::gap::model::prepare::Example;
    use nalgebra::{DMatrix, DVector};

    /// A load that rises with speed is reproduced by an even load and the functions along the speed that are derived from the load's torque. Functions that are derived from the
    /// change that the even load makes in the innovations do not reproduce it.
    #[test]
    fn the_form_of_a_load_is_that_of_its_torque() {
        let example = Example::read();
        let (problem, _) = example.problem(&example.campaign.recordings[..2].iter().collect::<Vec<_>>());
        let load = find("road_load").unwrap();
        let mut point = problem.nominal();
        point.effects[param::road_load::rolling_torque] = 6.0;
        let (with, without) = (problem.courses(&point, None), problem.courses(&point.without(load), None));
        let from = baselines(&problem, &point, None);
        let rising = |(r, cause): (usize, Missing)| {
            let along = &problem.states[r][OMEGA_C];
            problem.change_under(r, &from[r], cause.times(|row| 0.1 * (along[problem.tracks[r].observation_of(row)] / 100.0 - 1.0)))
        };
        let causes = with.iter().zip(&without).map(|(a, b)| a.beyond(b));
        let uneven: Vec<f64> = causes.enumerate().flat_map(rising).collect();
        let even: Vec<Residuals> = with.iter().zip(&without).map(|(a, b)| difference(&a.innovations, &b.innovations)).collect();
        let left = |functions: Vec<Vec<f64>>| {
            let columns: Vec<DVector<f64>> = functions.into_iter().chain([even.concat()]).map(DVector::from_vec).collect();
            let (a, y) = (DMatrix::from_columns(&columns), DVector::from_column_slice(&uneven));
            let x = a.tr_mul(&a).cholesky().unwrap().solve(&a.tr_mul(&y));
            (y.clone() - a * x).norm() / y.norm()
        };
        let along_speed = |basis: Basis| {
            let of = |f: &std::sync::Arc<[Missing]>| f.iter().flat_map(|m| m.innovations.values().collect::<Vec<_>>()).collect();
            left(basis.iter().filter(|f| f[0].along == Some((load, OMEGA_C))).map(of).collect())
        };
        assert!(forms(&problem, &problem.nominal(), &[load]).is_empty());
        let by_cause = along_speed(forms(&problem, &point, &[load]));
        let by_change = along_speed(of_changes(&problem, std::slice::from_ref(&even), FORM, Some(load)));
        assert!(by_cause < 0.04 && by_change > 0.1, "{by_cause} {by_change}");
    }

    /// A friction level has a form along the states on which friction depends; a lag also along what the lag does itself; a car's mass along every state, because it does not act
    /// as a torque.
    #[test]
    fn what_remembers_may_depend_on_its_own_size_and_sign() {
        use param::{engine_torque_lag, friction_level, vehicle_mass};
        let example = Example::read();
        let (problem, _) = example.problem(&[&example.campaign.recordings[1]]);
        let along = |id: &str, k: usize, by: f64| {
            let mut point = problem.nominal();
            point.effects[k] += by;
            let effect = find(id).unwrap();
            let mut states: Vec<usize> =
                forms(&problem, &point, &[effect]).iter().filter_map(|f| f[0].along).map(|(_, state)| state).collect();
            states.dedup();
            states
        };
        assert_eq!(
            along("friction_level", friction_level::factor, 0.05),
            [state::SLIP, state::THETA, state::POSITION, state::DIRECTION, state::TIME]
        );
        assert_eq!(
            along("engine_torque_lag", engine_torque_lag::time_constant, 0.05),
            [state::OMEGA_F, state::REPORT, state::TIME, state::ITSELF]
        );
        assert_eq!(along("vehicle_mass", vehicle_mass::factor, 0.1), state::ALL);
    }
}
