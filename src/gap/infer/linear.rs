//! The linear model around a point: derivatives of whole replays, and normal equations from which every recording's own unknowns are eliminated.
//!
//! With shared coordinates s and own ones o of recording r, curvature and gradient of half the cost have blocks A_r, B_r, D_r and a_r, d_r. The own
//! unknowns are eliminated by their Schur complement,
//!
//! ```text
//! H = Λ + Σ (A_r − B_r D_r⁻¹ B_rᵀ),   g = λ + Σ (a_r − B_r D_r⁻¹ d_r),
//! ```
//!
//! so that the work is linear in the number of recordings.

use super::coordinate::Coordinate;
use super::density::{BENDS, Baseline, Basis, ByPhase, COUPLED_PRIORS, Point, Problem, Residuals, TEMPERATURES, weight};
use crate::gap::model::column::Column;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

/// Derivatives of one recording's innovations by coordinate: shared ones first, then own ones.
pub type Columns = Vec<Column>;

/// Coordinates of a fit.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Shared by all recordings.
    pub shared: Vec<Coordinate>,
    /// The own unknowns of each recording.
    pub own: Vec<Coordinate>,
}

impl Frame {
    fn all(&self) -> impl Iterator<Item = Coordinate> + '_ {
        self.shared.iter().chain(&self.own).copied()
    }
}

/// Derivatives that are known at a nearby point.
#[derive(Clone, Copy, Debug)]
pub enum Known<'a> {
    /// Derivatives in another frame, whose nuisances are the same.
    Nuisances(&'a [Columns]),
    /// Derivatives along the same effects and the first functions or curves of the same law. Those along the law are reused as well, because they change as little as those along
    /// nuisances: the law is a sum of its functions.
    Law(&'a [Columns]),
}

/// Derivatives of every recording along all coordinates, by finite differences of whole replays. Columns that hardly change are taken over from `known`. A tolerance that moves the
/// same number as a free effect gets a multiple of that effect's column: separate finite differences would hide the valley between the two.
pub fn derivatives(
    problem: &Problem,
    point: &Point,
    basis: Option<&Basis>,
    residuals: &[Residuals],
    frame: &Frame,
    known: Option<Known>,
) -> Vec<Columns> {
    let all: Vec<Coordinate> = frame.all().collect();
    let leaders = leaders(problem, point, &all);
    let twin = |k: usize| leaders[k];
    let taken = |k: usize| match (known, all[k]) {
        (None, _) => false,
        (Some(_), Coordinate::Shared(_) | Coordinate::Own(_)) => true,
        (Some(Known::Nuisances(_)), _) => false,
        (Some(Known::Law(columns)), c) => c.is_of_law() && columns.first().is_some_and(|known| k + frame.own.len() < known.len()),
    };
    let fresh: Vec<usize> = (0..all.len()).filter(|&k| twin(k).is_none() && !taken(k)).collect();
    let tasks: Vec<(usize, usize)> = (0..problem.tracks.len()).flat_map(|r| fresh.iter().map(move |&k| (r, k))).collect();
    let from: Vec<Baseline> = residuals.par_iter().enumerate().map(|(r, known)| problem.baseline(r, point, basis, Some(known))).collect();
    let columns: Vec<Column> = tasks.par_iter().map(|&(r, k)| derivative(problem, point, basis, r, &from[r], all[k])).collect();
    let mut columns = columns.into_iter();
    // Shared nuisances have the same index whatever effects are free; own unknowns are counted from the end.
    let place = |known: &Columns, k: usize| if k < frame.shared.len() { k } else { known.len() - (all.len() - k) };
    let known = known.map(|known| match known {
        Known::Nuisances(columns) | Known::Law(columns) => columns,
    });
    (0..problem.tracks.len())
        .map(|r| {
            let mut these: Columns = vec![Column::default(); all.len()];
            for k in 0..all.len() {
                if fresh.contains(&k) {
                    these[k] = columns.next().expect("one for each task, in the same order");
                } else if let Some(known) = known.map(|known| &known[r]).filter(|_| twin(k).is_none()) {
                    these[k] = known[place(known, k)].clone();
                }
            }
            for k in 0..all.len() {
                if let Some((other, rate)) = twin(k) {
                    these[k] = these[other].times(rate);
                }
            }
            these
        })
        .collect()
}

/// For every coordinate that moves the car exactly as another one does, the index of that other one and the ratio of their rates. An effect leads the tolerances that do the same.
fn leaders(problem: &Problem, point: &Point, all: &[Coordinate]) -> Vec<Option<(usize, f64)>> {
    let car = problem.car(point, None);
    let direction = |c: Coordinate| match c {
        Coordinate::Effect(k) => Some((k, 1.0)),
        Coordinate::Shared(k) => problem.shared[k].same_as(&car),
        Coordinate::Own(k) => problem.own.get(k.checked_sub(TEMPERATURES)?)?.same_as(&car),
        Coordinate::Missing(_) => None,
    };
    let directions: Vec<Option<(usize, f64)>> = all.iter().map(|c| direction(*c)).collect();
    (0..all.len())
        .map(|k| {
            let (parameter, rate) = directions[k]?;
            let leads = |c: &Coordinate| matches!(c, Coordinate::Effect(_));
            let alike = |j: &usize| directions[*j].is_some_and(|(p, _)| p == parameter);
            let leader = (0..all.len()).filter(alike).min_by_key(|&j| (!leads(&all[j]), j))?;
            (leader != k).then(|| (leader, rate / directions[leader].map_or(1.0, |d| d.1)))
        })
        .collect()
}

fn derivative(problem: &Problem, point: &Point, basis: Option<&Basis>, r: usize, from: &Baseline, coordinate: Coordinate) -> Column {
    if let (Coordinate::Missing(k), Some(basis)) = (coordinate, basis)
        && basis[k][r].is_linear()
    {
        return basis[k][r].innovations.clone();
    }
    let mut moved = point.clone();
    coordinate.move_by(problem, &mut moved, r, coordinate.step());
    let mut step = coordinate.get(&moved, r) - coordinate.get(point, r);
    if step.abs() < 0.5 * coordinate.step() {
        moved = point.clone();
        coordinate.move_by(problem, &mut moved, r, -coordinate.step());
        step = coordinate.get(&moved, r) - coordinate.get(point, r);
    }
    Column::new(&problem.change(r, from, &moved)).times(1.0 / step)
}

/// The own unknowns of one recording, eliminated from the normal equations.
#[derive(Clone, Debug)]
pub struct Eliminated {
    own: Cholesky<f64, Dyn>,
    /// Dᵣ⁻¹ Bᵣᵀ.
    coupling: DMatrix<f64>,
    /// Dᵣ⁻¹ dᵣ.
    offset: DVector<f64>,
}

/// Logarithm of the determinant of a positive definite matrix that is nearly diagonal: only the rows with off-diagonal elements are factorised (Cholesky).
fn log_det(m: &DMatrix<f64>) -> Option<f64> {
    let coupled: Vec<usize> = (0..m.nrows()).filter(|&i| (0..m.ncols()).any(|j| j != i && m[(i, j)] != 0.0)).collect();
    let alone = (0..m.nrows()).filter(|i| !coupled.contains(i)).map(|i| m[(i, i)].ln()).sum::<f64>();
    let root = DMatrix::from_fn(coupled.len(), coupled.len(), |i, j| m[(coupled[i], coupled[j])]).cholesky()?;
    Some(alone + 2.0 * root.l_dirty().diagonal().map(f64::ln).sum())
}

impl Eliminated {
    /// Step of the own unknowns that follows from a step of the shared ones.
    pub fn step(&self, shared: &DVector<f64>) -> DVector<f64> {
        -(&self.offset) - &self.coupling * shared
    }
}

/// Normal equations of the shared coordinates.
#[derive(Clone, Debug)]
pub struct Normal {
    /// Curvature of half the cost.
    pub curvature: DMatrix<f64>,
    /// Gradient of half the cost.
    pub gradient: DVector<f64>,
    /// Eliminated own unknowns, by recording.
    pub eliminated: Vec<Eliminated>,
    /// Logarithm of the determinant of the own unknowns' curvature.
    pub log_det_own: f64,
    /// Logarithm of the determinant of the prior's precision along the shared coordinates.
    pub log_det_prior: f64,
}

/// Products of one recording's columns among themselves and with its residuals.
pub type Products = (DMatrix<f64>, DVector<f64>);

/// Products of one recording's columns, weighted: AᵀWA and AᵀWr over all its coordinates.
pub fn products(columns: &[Column], residuals: &Residuals) -> Products {
    products_of(columns, residuals, 0..residuals.len())
}

/// Rows that are multiplied at a time: few enough to stay in the cache.
const ROWS: usize = 1024;

/// As [`products`], over these samples alone.
fn products_of(columns: &[Column], residuals: &Residuals, mut samples: impl Iterator<Item = usize>) -> Products {
    let there: Vec<usize> = (0..columns.len()).filter(|&k| !columns[k].is_zero()).collect();
    let (mut p, mut g) = (DMatrix::zeros(there.len(), there.len()), DVector::zeros(there.len()));
    loop {
        let rows: Vec<usize> = samples.by_ref().take(ROWS).collect();
        if rows.is_empty() {
            break;
        }
        let roots: Vec<f64> = rows.iter().map(|i| weight(residuals[*i]).sqrt()).collect();
        let mut a = DMatrix::zeros(rows.len(), there.len());
        for (column, &k) in a.as_mut_slice().chunks_exact_mut(rows.len()).zip(&there) {
            columns[k].gather(&rows, &roots, column);
        }
        let r = DVector::from_iterator(rows.len(), rows.iter().zip(&roots).map(|(i, root)| residuals[*i] * root));
        // `gemm` works on blocks; `gemm_tr` takes one scalar product after the other.
        p.gemm(1.0, &a.transpose(), &a, 1.0);
        g.gemv_tr(1.0, &a, &r, 1.0);
    }
    let (mut all, mut slope) = (DMatrix::zeros(columns.len(), columns.len()), DVector::zeros(columns.len()));
    for (i, &k) in there.iter().enumerate() {
        slope[k] = g[i];
        there.iter().enumerate().for_each(|(j, &l)| all[(k, l)] = p[(i, j)]);
    }
    (all, slope)
}

/// Products of every recording's columns, phase by phase.
pub fn by_phase(problem: &Problem, columns: &[Columns], residuals: &[Residuals]) -> Vec<ByPhase<Products>> {
    let of = |(r, (columns, residuals)): (usize, (&Columns, &Residuals))| {
        std::array::from_fn(|phase| products_of(columns, residuals, (0..residuals.len()).filter(|i| problem.phase(r, *i) == phase)))
    };
    columns.par_iter().zip(residuals).enumerate().map(of).collect()
}

/// Products over all phases with the likelihood of each phase raised to its power.
pub fn to_powers(parts: &[ByPhase<Products>], powers: ByPhase<f64>) -> Vec<Products> {
    let one = |part: &ByPhase<Products>| {
        let (mut p, mut g) = (&part[0].0 * powers[0], &part[0].1 * powers[0]);
        for ((more, slope), power) in part.iter().zip(powers).skip(1) {
            p += more * power;
            g += slope * power;
        }
        (p, g)
    };
    parts.iter().map(one).collect()
}

/// Products of all recordings.
pub fn all_products(columns: &[Columns], residuals: &[Residuals]) -> Vec<Products> {
    columns.par_iter().zip(residuals).map(|(c, r)| products(c, r)).collect()
}

/// Assembles the normal equations from derivatives and residuals, see [`assemble`].
pub fn normal(point: &Point, frame: &Frame, columns: &[Columns], residuals: &[Residuals], damping: f64) -> Option<Normal> {
    assemble(point, frame, &all_products(columns, residuals), damping)
}

/// Assembles the normal equations from products, one per recording, with the precision of each coordinate's prior multiplied by 1 + `damping`. None if the priors or the own
/// unknowns of a recording have no positive definite curvature.
pub fn assemble(point: &Point, frame: &Frame, parts: &[Products], damping: f64) -> Option<Normal> {
    let (s, o) = (frame.shared.len(), frame.own.len());
    let mut curvature = DMatrix::zeros(s, s);
    let mut gradient = DVector::zeros(s);
    for (k, c) in frame.shared.iter().enumerate() {
        curvature[(k, k)] += (1.0 + damping) * c.precision();
        gradient[k] += c.precision() * (c.get(point, 0) - c.centre());
    }
    for t in &COUPLED_PRIORS {
        let place = |parameter: usize| frame.shared.iter().position(|c| *c == Coordinate::Effect(parameter));
        if let (Some(leader), Some(follower)) = (place(t.leader), place(t.follower)) {
            let slopes = [(leader, -t.share / t.sigma), (follower, 1.0 / t.sigma)];
            for (i, a) in slopes {
                gradient[i] += a * t.strain(&point.effects);
                slopes.iter().for_each(|&(j, b)| curvature[(i, j)] += a * b);
            }
        }
    }
    for bend in BENDS.iter() {
        let place = |parameter: usize| frame.shared.iter().position(|c| *c == Coordinate::Effect(parameter));
        let slopes: Vec<(usize, f64)> = bend.slopes().filter_map(|(k, a)| Some((place(k)?, a))).collect();
        for &(i, a) in &slopes {
            gradient[i] += a * bend.strain(&point.effects);
            slopes.iter().for_each(|&(j, b)| curvature[(i, j)] += a * b);
        }
    }
    let log_det_prior = log_det(&curvature)?;
    let mut eliminated = Vec::with_capacity(parts.len());
    let mut log_det_own = 0.0;
    for (r, (p, g)) in parts.iter().enumerate() {
        let mut d = p.view((s, s), (o, o)).into_owned();
        let mut slope = g.rows(s, o).into_owned();
        for (k, c) in frame.own.iter().enumerate() {
            d[(k, k)] += (1.0 + damping) * c.precision();
            slope[k] += c.precision() * (c.get(point, r) - c.centre());
        }
        let own = d.cholesky()?;
        log_det_own += 2.0 * own.l_dirty().diagonal().map(f64::ln).sum();
        let b = p.view((0, s), (s, o)).into_owned();
        let coupling = own.solve(&b.transpose());
        let offset = own.solve(&slope);
        curvature += p.view((0, 0), (s, s)) - &b * &coupling;
        gradient += g.rows(0, s) - &b * &offset;
        eliminated.push(Eliminated { own, coupling, offset });
    }
    Some(Normal { curvature, gradient, eliminated, log_det_own, log_det_prior })
}

impl Eliminated {
    /// Reduction of the cost by the own unknowns while the shared ones stay fixed.
    pub fn gain(&self) -> f64 {
        let l = self.own.l();
        (l.transpose() * &self.offset).norm_squared()
    }
    /// Dᵣ⁻¹ m.
    pub fn solve(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        self.own.solve(m)
    }
    /// Dᵣ⁻¹ Bᵣᵀ: how the own unknowns follow the shared ones.
    pub fn coupling(&self) -> &DMatrix<f64> {
        &self.coupling
    }
    /// Dᵣ⁻¹ dᵣ.
    pub fn offset(&self) -> &DVector<f64> {
        &self.offset
    }
    /// Covariance of the own unknowns while the shared ones stay fixed.
    pub fn covariance(&self) -> DMatrix<f64> {
        self.own.inverse()
    }
}

#[cfg(test)]
mod tests {
    use super::super::fit::laplace;
    use super::*;
    use crate::effects;

    /// Deterministic numbers between −1 and 1.
    fn numbers(seed: f64) -> impl FnMut() -> f64 {
        let mut x = seed;
        move || {
            x = (x * 9301.0 + 49297.0) % 233_280.0;
            2.0 * x / 233_280.0 - 1.0
        }
    }

    fn matrix(columns: &Columns) -> DMatrix<f64> {
        let all: Vec<DVector<f64>> = columns.iter().map(|c| DVector::from_iterator(c.values().count(), c.values())).collect();
        DMatrix::from_columns(&all)
    }

    /// The products are taken over more samples than are multiplied at a time, with one column of zeros and one residual whose weight is reduced by Huber's loss. Those of two
    /// halves of the samples add up to the whole.
    #[test]
    fn products_are_those_of_the_whole_matrices() {
        let n = 2 * ROWS + 7;
        let mut next = numbers(3.0);
        let mut drawn = || (0..n).map(|_| next()).collect::<Vec<f64>>();
        let mut residuals = drawn();
        residuals[5] = 16.0;
        let columns = vec![Column::new(&drawn()), Column::default(), Column::new(&drawn()).times(-3.0)];
        let sum = |f: &dyn Fn(usize) -> f64| (0..n).map(|i| f(i) * if i == 5 { 0.25 } else { 1.0 }).sum::<f64>();
        let value: Vec<Vec<f64>> = columns.iter().map(|c| if c.is_zero() { vec![0.0; n] } else { c.values().collect() }).collect();
        let whole = products(&columns, &residuals);
        let [even, odd] = [0, 1].map(|part| products_of(&columns, &residuals, (part..n).step_by(2)));
        for k in 0..3 {
            let expected = sum(&|i| value[k][i] * residuals[i]);
            assert!((whole.1[k] - expected).abs() < 1e-9 && (even.1[k] + odd.1[k] - expected).abs() < 1e-9);
            for l in 0..3 {
                let expected = sum(&|i| value[k][i] * value[l][i]);
                assert!((whole.0[(k, l)] - expected).abs() < 1e-9 && (even.0[(k, l)] + odd.0[(k, l)] - expected).abs() < 1e-9);
            }
        }
    }

    /// The closed point follows the contact point: with sizes s_1 and s_2, share ½ and σ, their prior has the precision (1/s_1² + ¼/σ², −½/σ²; −½/σ², 1/s_2² + 1/σ²).
    #[test]
    fn the_volume_of_a_prior_counts_what_goes_together() {
        use crate::effects::param::kiss_point_offset::{closed_offset, offset};
        let along = [Coordinate::Shared(0), Coordinate::Effect(offset), Coordinate::Shared(1), Coordinate::Effect(closed_offset)];
        let point = Point { shared: vec![0.0; 2], own: Vec::new(), effects: effects::null(), missing: Vec::new() };
        let of = |shared: Vec<Coordinate>| assemble(&point, &Frame { shared, own: Vec::new() }, &[], 0.0).unwrap().log_det_prior;
        let [a, b] = [along[1], along[3]].map(Coordinate::precision);
        let s = COUPLED_PRIORS[0].sigma.powi(-2);
        let expected = ((a + 0.25 * s) * (b + s) - 0.25 * s * s).ln();
        assert!((of(along.to_vec()) - expected).abs() < 1e-9);
        assert!((of(along[..3].to_vec()) - a.ln()).abs() < 1e-12 && of(vec![along[0]]) == 0.0);
    }

    /// Three shared unknowns and two of each of three recordings, all with unit normal priors, seen through unit normal noise: the evidence is that of
    /// a normal distribution with covariance 1 + AAᵀ, whose density is written down directly.
    #[test]
    fn the_evidence_of_a_linear_gaussian_problem_is_exact() {
        let (s, o, n, recordings) = (3, 2, 12, 3);
        let frame = Frame { shared: (0..s).map(Coordinate::Shared).collect(), own: (0..o).map(Coordinate::Own).collect() };
        let point = Point { shared: vec![0.0; s], own: vec![vec![0.0; o]; recordings], effects: effects::null(), missing: Vec::new() };
        let mut next = numbers(7.0);
        let columns: Vec<Columns> =
            (0..recordings).map(|_| (0..s + o).map(|_| Column::new(&(0..n).map(|_| next()).collect::<Vec<_>>())).collect()).collect();
        // Within the square part of Huber's loss.
        let residuals: Vec<Residuals> = (0..recordings).map(|_| (0..n).map(|_| 1.5 * next()).collect()).collect();
        let equations = normal(&point, &frame, &columns, &residuals, 0.0).unwrap();
        let step = equations.curvature.clone().cholesky().unwrap().solve(&-&equations.gradient);
        let gain: f64 = equations.eliminated.iter().map(Eliminated::gain).sum::<f64>() - equations.gradient.dot(&step);
        let square: f64 = residuals.iter().flatten().map(|r| r * r).sum();
        let found = laplace(square - gain, &equations);

        let unknowns = s + o * recordings;
        let mut a = DMatrix::zeros(n * recordings, unknowns);
        for (r, c) in columns.iter().enumerate() {
            let c = matrix(c);
            a.view_mut((r * n, 0), (n, s)).copy_from(&c.columns(0, s));
            a.view_mut((r * n, s + r * o), (n, o)).copy_from(&c.columns(s, o));
        }
        let covariance = DMatrix::identity(n * recordings, n * recordings) + &a * a.transpose();
        let root = covariance.cholesky().unwrap();
        let y = DVector::from_iterator(n * recordings, residuals.iter().flatten().copied());
        let log_det = 2.0 * root.l().diagonal().map(f64::ln).sum();
        let expected = -0.5 * y.dot(&root.solve(&y)) - 0.5 * log_det;
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }

    #[test]
    fn a_step_of_the_eliminated_unknowns_solves_the_whole_problem() {
        let frame = Frame { shared: vec![Coordinate::Shared(0)], own: vec![Coordinate::Own(0)] };
        let point = Point { shared: vec![0.0], own: vec![vec![0.0]], effects: effects::null(), missing: Vec::new() };
        let columns = [vec![Column::new(&[1.0, 0.0, 2.0]), Column::new(&[0.5, 1.0, -1.0])]];
        let residuals = [vec![1.0, -0.5, 0.25]];
        let e = normal(&point, &frame, &columns, &residuals, 0.0).unwrap();
        let shared = e.curvature.clone().cholesky().unwrap().solve(&-&e.gradient);
        let own = e.eliminated[0].step(&shared);
        let a = matrix(&columns[0]);
        let h = a.tr_mul(&a) + DMatrix::identity(2, 2);
        let g = a.tr_mul(&DVector::from_column_slice(&residuals[0]));
        let whole = h.cholesky().unwrap().solve(&-g);
        assert!((shared[0] - whole[0]).abs() < 1e-12 && (own[0] - whole[1]).abs() < 1e-12);
    }
}
