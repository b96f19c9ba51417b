//! Directions of a fit: tolerances, start temperatures and effect parameters, each with its unit, its bounds and its prior.

use super::problem::{Point, Problem, THETA_0_SIGMA_K};
use crate::effects::{self, PARAMETERS, REGISTRY};

/// One free coordinate of a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coordinate {
    /// Nuisance k.
    Nuisance(usize),
    /// Start temperature of a recording: of the disc (0) or the body (1).
    Theta(usize, usize),
    /// Effect parameter k.
    Effect(usize),
}

impl Coordinate {
    /// Step of a finite difference, in the coordinate's unit.
    pub fn step(self) -> f64 {
        match self {
            Self::Nuisance(_) => 0.1,
            Self::Theta(..) => 0.1,
            Self::Effect(k) => 0.01 * effects::owner(k).scale(k),
        }
    }
    fn slot(self, point: &mut Point) -> &mut f64 {
        match self {
            Self::Nuisance(k) => &mut point.z[k],
            Self::Theta(k, node) => &mut point.theta_shift[k][node],
            Self::Effect(k) => &mut point.effects[k],
        }
    }
    /// Value at a point.
    pub fn get(self, point: &Point) -> f64 {
        match self {
            Self::Nuisance(k) => point.z[k],
            Self::Theta(k, node) => point.theta_shift[k][node],
            Self::Effect(k) => point.effects[k],
        }
    }
    /// Whether the parameter is a factor on a number. A factor and the relative tolerance of the same number move by their logarithms, so that
    /// the valley in which only their product counts is straight.
    fn is_factor(self) -> bool {
        matches!(self, Self::Effect(k) if PARAMETERS[k].null == 1.0 && effects::owner(k).effect.amplitudes.contains(&k))
    }
    /// Moves a point, within the bounds of effect parameters.
    pub fn moved(self, point: &Point, by: f64) -> Point {
        let factor = self.is_factor();
        let mut moved = point.clone();
        let slot = self.slot(&mut moved);
        *slot = if factor && *slot > 0.0 { *slot * (by / *slot).exp() } else { *slot + by };
        if let Self::Effect(k) = self {
            *slot = slot.clamp(PARAMETERS[k].min, PARAMETERS[k].max);
        }
        moved
    }
    /// How much of a move the bounds leave.
    pub(super) fn room(self, point: &Point, by: f64) -> f64 {
        let Self::Effect(k) = self else { return by };
        let (from, to) = (self.get(point), self.get(&self.moved(point, by)));
        match to == PARAMETERS[k].min || to == PARAMETERS[k].max {
            false => by,
            true if self.is_factor() && from > 0.0 && to > 0.0 => from * (to / from).ln(),
            true => to - from,
        }
    }
    /// Precision that the prior gives, 1/variance.
    pub(super) fn precision(self) -> f64 {
        match self {
            Self::Nuisance(_) => 1.0,
            Self::Theta(..) => 1.0 / (THETA_0_SIGMA_K * THETA_0_SIGMA_K),
            // Wide: an effect may be ten times its nominal size; this keeps shapes that do nothing where they are.
            Self::Effect(k) => 1.0 / (10.0 * effects::owner(k).scale(k)).powi(2),
        }
    }
    /// Curvature of one unit step: a tolerance, or the size of a noticeable effect.
    pub(super) fn unit(self) -> f64 {
        if let Self::Effect(_) = self { 100.0 * self.precision() } else { self.precision() }
    }
    pub(super) fn touches(self, recording: usize) -> bool {
        !matches!(self, Self::Theta(k, _) if k != recording)
    }
}

/// Free coordinates of a hypothesis that holds the effects (indices in the registry).
pub fn coordinates(problem: &Problem, effects: &[usize]) -> Vec<Coordinate> {
    let nuisances = (0..problem.nuisances.len()).map(Coordinate::Nuisance);
    let thetas = (0..problem.series.len()).flat_map(|k| [Coordinate::Theta(k, 0), Coordinate::Theta(k, 1)]);
    let of_effects = effects.iter().flat_map(|&e| REGISTRY[e].parameters.clone()).map(Coordinate::Effect);
    nuisances.chain(thetas).chain(of_effects).collect()
}
