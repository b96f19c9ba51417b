//! The evidence of a fit, averaged over the forms that its effects may have: over their sizes, and over the states along which they lie.
//!
//! Neither is known. A form has one of three sizes ([`SIZES`]), and either its functions along all states alike have this size, or those along a single state do as much alone
//! ([`alone`]), each equally likely. A real law is uneven along its temperature, say, and along nothing else: if its unevenness were shared out to every state, the functions along
//! that one would have to be several standard deviations large.
//!
//! The information of the recordings about the functions, all else eliminated, is a Gram matrix G and a slope b. Functions of sizes S add
//!
//! ```text
//! ½ (S b)ᵀ (1 + S G S)⁻¹ (S b) − ½ ln det(1 + S G S)
//! ```
//!
//! to the logarithm of the evidence, so that another choice of sizes costs a small factorisation. States are chosen effect by effect, each beside the best choice
//! for those before it.

use super::coordinate::Coordinate;
use super::density::{Basis, ByPhase, Point, Problem, WHOLE, prior};
use super::fit::{Fit, bounded_step, laplace, moved, promise};
use super::form::{Alone, alone};
use super::linear::{Frame, Products, assemble, to_powers};
use nalgebra::{DMatrix, DVector};

/// Sizes that the form of an effect may have, relative to the size with which it is fitted, all equally likely: from nearly none to all of it.
const SIZES: [f64; 3] = [0.04, 0.2, 1.0];

/// Logarithm of the sum of the exponentials of `logs`.
pub fn log_sum(logs: &[f64]) -> f64 {
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if most == f64::NEG_INFINITY { most } else { most + logs.iter().map(|l| (l - most).exp()).sum::<f64>().ln() }
}

/// Curvature and gradient along the amplitudes of functions, without their prior, all else eliminated.
#[derive(Clone, Debug)]
pub struct Information {
    /// Curvature.
    pub gram: DMatrix<f64>,
    /// Gradient where all amplitudes are zero.
    pub slope: DVector<f64>,
}

impl Information {
    /// Gain in log evidence by functions of these sizes, nats, with the likelihood raised to this further power; −∞ where rounding leaves the curvature not positive definite.
    pub fn gain(&self, by: &DVector<f64>, power: f64) -> f64 {
        let n = by.len();
        let gram = DMatrix::from_fn(n, n, |i, j| power * by[i] * by[j] * self.gram[(i, j)] + f64::from(u8::from(i == j)));
        let slope = power * self.slope.component_mul(by);
        let Some(law) = gram.cholesky() else { return f64::NEG_INFINITY };
        let log_det = 2.0 * law.l_dirty().diagonal().map(f64::ln).sum();
        0.5 * slope.dot(&law.solve(&slope)) - 0.5 * log_det
    }

    /// Information of the recordings about those coordinates of a fit that are functions, from the products of its derivatives.
    fn of_functions(fit: &Fit, functions: &[usize], parts: &[Products]) -> Option<Self> {
        let e = assemble(&fit.point, &Frame { shared: fit.shared.clone(), own: fit.own.clone() }, parts, 0.0)?;
        let rest: Vec<usize> = (0..fit.shared.len()).filter(|k| !functions.contains(k)).collect();
        let part = |rows: &[usize], columns: &[usize]| e.curvature.select_rows(rows).select_columns(columns);
        let gradient = |of: &[usize]| e.gradient.select_rows(of);
        let (root, cross) = (part(&rest, &rest).cholesky()?, part(&rest, functions));
        // Both contain the prior of the functions, whose precision is one.
        let gram = part(functions, functions) - cross.tr_mul(&root.solve(&cross));
        let slope = gradient(functions) - cross.tr_mul(&root.solve(&gradient(&rest)));
        let at = DVector::from_fn(functions.len(), |i, _| fit.shared[functions[i]].get(&fit.point, 0));
        let n = functions.len();
        Some(Self { slope: slope - &gram * &at, gram: gram - DMatrix::identity(n, n) })
    }

    /// Logarithm of the mean evidence over the states along which the form of each effect may lie, relative to that of forms of this size along all states alike; and the best
    /// sizes. `first` is the index of the first function of a form.
    fn along_states(&self, effects: &[Vec<Alone>], first: usize, size: f64) -> (f64, DVector<f64>) {
        let mut best = (0.0, DVector::from_element(self.slope.len(), size));
        best.0 = self.gain(&best.1, 1.0);
        if best.0 == f64::NEG_INFINITY {
            return (0.0, best.1);
        }
        let mut more = 0.0;
        for states in effects {
            let alike = best.0;
            let along = |one: &Alone| {
                let mut sizes = best.1.clone();
                states.iter().flat_map(|s| &s.functions).for_each(|k| sizes[k - first] = SIZES[0] * size);
                one.functions.iter().for_each(|k| sizes[k - first] = one.factor * size);
                (self.gain(&sizes, 1.0), sizes)
            };
            let mut choices: Vec<(f64, DVector<f64>)> = states.iter().map(along).collect();
            choices.push(best);
            let gains: Vec<f64> = choices.iter().map(|c| c.0 - alike).collect();
            more += log_sum(&gains) - (choices.len() as f64).ln();
            best = choices.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).expect("all states alike are one");
        }
        (more, best.1)
    }
}

impl Fit {
    /// Logarithm of the evidence with the likelihood raised to these powers, averaged over the forms that effects may have, and the fit with the best form. Functions of the basis
    /// from `first` on are functions of forms.
    pub fn weighed(&self, problem: &Problem, basis: &Basis, first: usize, powers: ByPhase<f64>) -> (f64, Self) {
        let is_form = |c: &Coordinate| matches!(c, Coordinate::Missing(k) if *k >= first);
        let forms: Vec<usize> = (0..self.shared.len()).filter(|k| is_form(&self.shared[*k])).collect();
        let sizes: &[f64] = if forms.is_empty() { &[1.0] } else { &SIZES };
        let parts = to_powers(&self.parts, powers);
        let information = if forms.is_empty() { None } else { Information::of_functions(self, &forms, &parts) };
        let effects = alone(basis);
        let misfit = self.misfits.iter().zip(powers).map(|(misfit, power)| misfit * power).sum();
        let mut by = DVector::from_element(self.shared.len(), 1.0);
        let mut with_forms = |of: &DVector<f64>| {
            forms.iter().zip(of.iter()).for_each(|(k, size)| by[*k] = *size);
            self.with_functions(problem, &parts, misfit, powers == WHOLE, &by)
        };
        let mut at = |&size: &f64| {
            let alike = DVector::from_element(forms.len(), size);
            let (evidence, fit) = with_forms(&alike)?;
            let Some((more, best)) = information.as_ref().map(|i| i.along_states(&effects, first, size)) else {
                return Some((size, evidence, fit));
            };
            let fit = if best == alike { fit } else { with_forms(&best).map_or(fit, |(_, fit)| fit) };
            Some((size, evidence + more, fit))
        };
        let all: Vec<(f64, f64, Self)> = sizes.iter().filter_map(&mut at).collect();
        let Some((_, most, best)) = all.iter().max_by(|a, b| a.1.total_cmp(&b.1)) else { return (f64::NEG_INFINITY, self.clone()) };
        let sum: f64 = all.iter().map(|(_, evidence, _)| (evidence - most).exp()).sum();
        let square: f64 = all.iter().map(|(size, evidence, _)| size.powi(2) * (evidence - most).exp()).sum();
        (most + (sum / sizes.len() as f64).ln(), Self { form_size: (square / sum).sqrt(), ..best.clone() })
    }

    /// Log evidence and fit with functions of these sizes, by the linear model at the mode; the size of a coordinate that is no function is one. The point of the fit only moves if
    /// `moves`.
    fn with_functions(&self, problem: &Problem, parts: &[Products], misfit: f64, moves: bool, sizes: &DVector<f64>) -> Option<(f64, Self)> {
        let frame = Frame { shared: self.shared.clone(), own: self.own.clone() };
        let n = frame.shared.len() + frame.own.len();
        let by = DVector::from_fn(n, |k, _| sizes.get(k).copied().unwrap_or(1.0));
        let scaled = |(p, g): &Products| (DMatrix::from_fn(n, n, |i, j| p[(i, j)] * by[i] * by[j]), g.component_mul(&by));
        let parts: Vec<Products> = parts.iter().map(scaled).collect();
        let mut point: Point = self.point.clone();
        for (c, size) in frame.shared.iter().zip(sizes.iter()) {
            if let Coordinate::Missing(k) = c {
                point.missing[*k] /= size;
            }
        }
        let e = assemble(&point, &frame, &parts, 0.0)?;
        // With a power below one or other sizes of functions, the mode moves towards the priors, within the bounds.
        let step = bounded_step(problem, &e, &frame, &point)?;
        let cost = misfit + prior(&point) - promise(&e, &step);
        let to = moved(problem, &frame, &e, &point, &step);
        let strain = to.shared.iter().map(|z| z * z).sum();
        // If the mode moves because a power discounts the recordings, the fit still keeps its point.
        let point = if moves && problem.can_follow(&to) { to } else { self.point.clone() };
        Some((laplace(cost, &e), Self { point, strain, curvature: e.curvature, ..self.clone() }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One function explains a sharp measurement of three standard deviations: its gain is the log ratio of the normal densities of the measurement with and without it.
    #[test]
    fn the_gain_of_a_function_is_the_ratio_of_two_normal_densities() {
        let (precision, measured) = (25.0_f64, 0.6_f64);
        let one = Information { gram: DMatrix::from_element(1, 1, precision), slope: DVector::from_element(1, -precision * measured) };
        for size in [0.3_f64, 1.0, 4.0] {
            let variance = [1.0 / precision, 1.0 / precision + size * size];
            let [without, with] = variance.map(|v| -0.5 * measured * measured / v - 0.5 * v.ln());
            assert!((one.gain(&DVector::from_element(1, size), 1.0) - (with - without)).abs() < 1e-9, "{size}");
        }
    }

    /// Functions that cost 10 nats are better than functions whose curvature is not positive definite by rounding; for the latter, states say nothing more.
    #[test]
    fn what_cannot_be_weighed_never_wins() {
        let of = |gram: f64| Information { gram: DMatrix::from_element(1, 1, gram), slope: DVector::zeros(1) };
        let size = DVector::from_element(1, 1.0);
        assert!(of(-2.0).gain(&size, 1.0) < of(20_f64.exp()).gain(&size, 1.0));
        let states = vec![vec![Alone { functions: vec![0], factor: 1.0 }]];
        assert_eq!(of(-2.0).along_states(&states, 0, 1.0), (0.0, size));
    }

    /// Eight states have two functions each, and a law is uneven along one of them by as much as all of them are expected to be together: five and a half standard deviations if
    /// that is shared out, two if it lies along that state.
    #[test]
    fn a_form_along_one_state_is_told_from_one_along_all_of_them() {
        let (states, precision) = (8, 1e4);
        let mut slope = DVector::zeros(2 * states);
        (slope[6], slope[7]) = (-precision * 4.0, -precision * 4.0);
        let information = Information { gram: DMatrix::identity(2 * states, 2 * states) * precision, slope };
        let one = |state: usize| Alone { functions: vec![5 + 2 * state, 6 + 2 * state], factor: (states as f64).sqrt() };
        let effects = vec![(0..states).map(one).collect::<Vec<_>>()];
        let (more, sizes) = information.along_states(&effects, 5, 1.0);
        // Two functions have squares of 16: either all sixteen have a variance of 1, or two have one of 8 and the rest next to none.
        let least = SIZES[0] * SIZES[0];
        let expected = 0.5 * (32.0 - 32.0 / 8.0) - 8.0_f64.ln() - 7.0 * (least + 1.0 / precision).ln() - (states as f64 + 1.0).ln();
        assert!((more - expected).abs() < 0.1, "{more} {expected}");
        for k in 0..2 * states {
            let expected = if k / 2 == 3 { 8.0_f64.sqrt() } else { SIZES[0] };
            assert!((sizes[k] - expected).abs() < 1e-12);
        }
        // Under the full likelihood, the gain may be tens of thousands of nats.
        let far = Information { slope: &information.slope * 50.0, gram: information.gram.clone() };
        assert!((29_000.0..45_000.0).contains(&far.along_states(&effects, 5, 1.0).0));
        // A law that is uneven along every state has a form along all of them alike; of nine choices, one fits.
        let uneven = Information { slope: DVector::from_element(2 * states, -precision), ..information };
        let (more, sizes) = uneven.along_states(&effects, 5, 1.0);
        assert!((more + 9.0_f64.ln()).abs() < 1e-6 && sizes.iter().all(|s| *s == 1.0), "{more}");
    }
}
