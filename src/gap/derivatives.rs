//! The linear model of a hypothesis around a point: derivatives of whole replays, and the normal equations that follow from them.

use super::coordinate::Coordinate;
use super::problem::{Point, Problem, Residuals, TOGETHER, weight};
use crate::effects::PARAMETERS;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Derivatives of one recording's residuals: the coordinates that touch it, by their place, and a column for each.
#[derive(Clone, Debug)]
pub struct Columns {
    /// Places of the coordinates, ascending.
    pub places: Vec<usize>,
    /// Residuals by coordinates.
    pub matrix: DMatrix<f64>,
}

/// Derivatives of every recording's residuals along `coordinates`, as finite differences of whole replays. Columns that are `known` are
/// taken over, but those of effects. A tolerance that moves the same number as a free effect has that effect's column: differences of their own
/// would hide the valley between the two.
pub fn derivatives(
    problem: &Problem,
    point: &Point,
    residuals: &[Residuals],
    coordinates: &[Coordinate],
    known: Option<&[Columns]>,
) -> Vec<Columns> {
    let (vehicle, _) = problem.plant_at(point);
    let shared = |c: Coordinate| {
        let Coordinate::Nuisance(k) = c else { return None };
        let (parameter, rate) = problem.nuisances[k].same_as(&vehicle, &point.effects)?;
        let place = coordinates.iter().position(|c| *c == Coordinate::Effect(parameter))?;
        Some((place, rate))
    };
    let taken_over = |r: usize, place: usize| {
        let known = &known?[r];
        let k = known.places.iter().position(|&p| p == place)?;
        (!matches!(coordinates[place], Coordinate::Effect(_))).then(|| known.matrix.column(k))
    };
    let is_fresh = |r: usize, c: usize| shared(coordinates[c]).is_none() && taken_over(r, c).is_none();
    let tasks: Vec<(usize, usize)> = (0..problem.series.len())
        .flat_map(|r| (0..coordinates.len()).map(move |c| (r, c)))
        .filter(|&(r, c)| coordinates[c].touches(r) && is_fresh(r, c))
        .collect();
    let fresh: Vec<Vec<f64>> = tasks.par_iter().map(|&(r, c)| derivative(problem, point, r, &residuals[r], coordinates[c])).collect();
    let mut fresh = fresh.into_iter();
    let assembled = |r: usize| {
        let places: Vec<usize> = (0..coordinates.len()).filter(|&c| coordinates[c].touches(r)).collect();
        let mut matrix = DMatrix::zeros(residuals[r].len(), places.len());
        for (k, &place) in places.iter().enumerate() {
            if is_fresh(r, place) {
                matrix.column_mut(k).copy_from_slice(&fresh.next().expect("one for each task, in the same order"));
            } else if let Some(column) = taken_over(r, place) {
                matrix.set_column(k, &column);
            }
        }
        for (k, &place) in places.iter().enumerate() {
            if let Some((other, rate)) = shared(coordinates[place]) {
                let column = matrix.column(places.partition_point(|&p| p < other)) * rate;
                matrix.set_column(k, &column);
            }
        }
        Columns { places, matrix }
    };
    (0..problem.series.len()).map(assembled).collect()
}

fn derivative(problem: &Problem, point: &Point, recording: usize, residuals: &Residuals, coordinate: Coordinate) -> Vec<f64> {
    let mut moved = coordinate.moved(point, coordinate.step());
    let mut step = coordinate.get(&moved) - coordinate.get(point);
    if step.abs() < 0.5 * coordinate.step() {
        moved = coordinate.moved(point, -coordinate.step());
        step = coordinate.get(&moved) - coordinate.get(point);
    }
    let there = problem.residuals(recording, &moved);
    there.iter().zip(residuals).map(|(a, b)| (a - b) / step).collect()
}

/// Normal equations of one linearised step: curvature and gradient of half the cost.
pub fn normal_equations(
    point: &Point,
    residuals: &[Residuals],
    columns: &[Columns],
    coordinates: &[Coordinate],
) -> (DMatrix<f64>, DVector<f64>) {
    let n = coordinates.len();
    let mut curvature = DMatrix::zeros(n, n);
    let mut gradient = DVector::zeros(n);
    for (own, r) in columns.iter().zip(residuals) {
        let weights: Vec<f64> = r.iter().map(|r| weight(*r)).collect();
        add_products(own.matrix.clone(), r, &weights, &own.places, &mut curvature, &mut gradient);
    }
    add_prior(point, coordinates, &mut curvature, &mut gradient);
    (curvature, gradient)
}

/// Adds one recording's part of the normal equations: AᵀWA and AᵀWr at the `places` of its columns.
pub fn add_products(
    mut matrix: DMatrix<f64>,
    residuals: &[f64],
    weights: &[f64],
    places: &[usize],
    curvature: &mut DMatrix<f64>,
    gradient: &mut DVector<f64>,
) {
    let roots = DVector::from_iterator(weights.len(), weights.iter().map(|w| w.sqrt()));
    let weighted = DVector::from_iterator(weights.len(), residuals.iter().zip(weights).map(|(r, w)| r * w.sqrt()));
    matrix.column_iter_mut().for_each(|mut column| column.component_mul_assign(&roots));
    let (products, slopes) = (matrix.transpose() * &matrix, matrix.tr_mul(&weighted));
    for (i, &place) in places.iter().enumerate() {
        gradient[place] += slopes[i];
        for (j, &other) in places.iter().enumerate() {
            curvature[(place, other)] += products[(i, j)];
        }
    }
}

/// Adds the priors' curvature and gradient.
pub fn add_prior(point: &Point, coordinates: &[Coordinate], curvature: &mut DMatrix<f64>, gradient: &mut DVector<f64>) {
    for (k, c) in coordinates.iter().enumerate() {
        let centre = if let Coordinate::Effect(p) = c { PARAMETERS[*p].null } else { 0.0 };
        curvature[(k, k)] += c.precision();
        gradient[k] += c.precision() * (c.get(point) - centre);
    }
    for t in &TOGETHER {
        let place = |parameter: usize| coordinates.iter().position(|c| *c == Coordinate::Effect(parameter));
        if let (Some(leader), Some(follower)) = (place(t.leader), place(t.follower)) {
            let slopes = [(leader, -t.share / t.sigma), (follower, 1.0 / t.sigma)];
            for (i, a) in slopes {
                gradient[i] += a * t.strain(&point.effects);
                slopes.iter().for_each(|&(j, b)| curvature[(i, j)] += a * b);
            }
        }
    }
}
