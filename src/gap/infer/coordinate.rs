//! Coordinates of a fit: shared nuisances, effect parameters, amplitudes of a missing law, and the own unknowns of each recording.

use super::density::{Point, Problem, TEMPERATURES, size};
use crate::effects::{self, PARAMETERS, REGISTRY};

/// Step of a finite difference along the order of a ripple. It shifts the phase of the ripple by a hundredth of a radian after the longest slip, or by a tenth after a drive of
/// minutes.
const ORDER_STEP: f64 = 2e-5;

/// One free coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coordinate {
    /// Shared nuisance k.
    Shared(usize),
    /// Effect parameter k.
    Effect(usize),
    /// Amplitude of function k of a missing law.
    Missing(usize),
    /// Own unknown k of a recording.
    Own(usize),
}

impl Coordinate {
    /// Step of a finite difference, in the coordinate's unit.
    pub fn step(self) -> f64 {
        match self {
            Self::Effect(effects::param::judder::order) => ORDER_STEP,
            Self::Effect(k) => 0.01 * size(k),
            _ => 0.1,
        }
    }

    fn slot(self, point: &mut Point, recording: usize) -> &mut f64 {
        match self {
            Self::Shared(k) => &mut point.shared[k],
            Self::Effect(k) => &mut point.effects[k],
            Self::Missing(k) => &mut point.missing[k],
            Self::Own(k) => &mut point.own[recording][k],
        }
    }

    /// Value at a point, in this recording if the coordinate is an own unknown.
    pub fn get(self, point: &Point, recording: usize) -> f64 {
        match self {
            Self::Shared(k) => point.shared[k],
            Self::Effect(k) => point.effects[k],
            Self::Missing(k) => point.missing[k],
            Self::Own(k) => point.own[recording][k],
        }
    }

    /// Whether the parameter is a factor on a number. A factor and the relative tolerance of the same number move by their logarithms, so that
    /// the valley in which only their product counts is straight.
    fn is_factor(self) -> bool {
        matches!(self, Self::Effect(k) if PARAMETERS[k].null == 1.0 && effects::owner(k).is_some_and(|e| e.effect.amplitudes.contains(&k)))
    }

    fn bounds(self, problem: &Problem) -> (f64, f64) {
        let one_sided = |n: &crate::gap::model::tolerance::Nuisance| {
            if n.one_sided { (0.0, f64::INFINITY) } else { (f64::NEG_INFINITY, f64::INFINITY) }
        };
        match self {
            Self::Effect(k) => (PARAMETERS[k].min, PARAMETERS[k].max),
            Self::Shared(k) => one_sided(&problem.shared[k]),
            Self::Own(k) if k >= TEMPERATURES => one_sided(&problem.own[k - TEMPERATURES]),
            _ => (f64::NEG_INFINITY, f64::INFINITY),
        }
    }

    /// Moves a point along the coordinate, within its bounds.
    pub fn move_by(self, problem: &Problem, point: &mut Point, recording: usize, by: f64) {
        let (factor, (least, most)) = (self.is_factor(), self.bounds(problem));
        let slot = self.slot(point, recording);
        *slot = if factor && *slot > 0.0 { *slot * (by / *slot).exp() } else { *slot + by };
        *slot = slot.clamp(least, most);
    }

    /// The part of a move `by` that the bounds leave possible.
    pub fn room(self, problem: &Problem, point: &Point, recording: usize, by: f64) -> f64 {
        let (least, most) = self.bounds(problem);
        let from = self.get(point, recording);
        let factor = self.is_factor() && from > 0.0;
        let to = if factor { from * (by / from).exp() } else { from + by };
        if to > least && to < most {
            return by;
        }
        let to = to.clamp(least, most);
        if factor && to > 0.0 { from * (to / from).ln() } else { to - from }
    }

    /// Whether the coordinate belongs to a law: an amplitude of a missing law, or a value of a learned curve.
    pub fn is_of_law(self) -> bool {
        match self {
            Self::Missing(_) => true,
            Self::Effect(k) => effects::owner(k).is_none(),
            Self::Shared(_) | Self::Own(_) => false,
        }
    }

    /// Precision of the prior, 1/variance.
    pub fn precision(self) -> f64 {
        if let Self::Effect(k) = self { size(k).powi(-2) } else { 1.0 }
    }

    /// Centre of the prior.
    pub fn centre(self) -> f64 {
        if let Self::Effect(k) = self { PARAMETERS[k].null } else { 0.0 }
    }
}

/// Free coordinates of a hypothesis: those that recordings share (nuisances, then the effects' parameters, then a missing law's amplitudes), and
/// those that each recording has of its own.
pub fn coordinates(problem: &Problem, effects: &[usize], missing: usize) -> (Vec<Coordinate>, Vec<Coordinate>) {
    let shared = (0..problem.shared.len()).map(Coordinate::Shared);
    let of_effects = effects.iter().flat_map(|&e| REGISTRY[e].parameters.clone()).map(Coordinate::Effect);
    let common = shared.chain(of_effects).chain((0..missing).map(Coordinate::Missing)).collect();
    (common, (0..TEMPERATURES + problem.own.len()).map(Coordinate::Own).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gap::model::prepare::Example;

    /// For every parameter, in both directions: a move that a bound cuts short ends at the bound, and so does a move by the room that is left; a move within the bounds has all of
    /// its room.
    #[test]
    fn the_room_that_is_left_leads_to_the_bound() {
        let example = Example::read();
        let (problem, _) = example.problem(&[&example.campaign.recordings[0]]);
        let nominal = problem.nominal();
        let moved = |c: Coordinate, by: f64| {
            let mut point = nominal.clone();
            c.move_by(&problem, &mut point, 0, by);
            c.get(&point, 0)
        };
        let mut bounded = [0; 2];
        for (k, p) in PARAMETERS.iter().enumerate() {
            let c = Coordinate::Effect(k);
            for (side, bound) in [p.min, p.max].into_iter().enumerate().filter(|(_, bound)| bound.is_finite() && *bound != p.null) {
                // A factor whose lower bound is 0 never reaches it, because its moves are multiplicative.
                let factor = c.is_factor() && bound > 0.0;
                let by = 3.0 * (bound - p.null) * if factor { (bound / p.null).ln().abs().max(1.0) } else { 1.0 };
                let room = c.room(&problem, &nominal, 0, by);
                if moved(c, by) == bound && (factor || !c.is_factor()) {
                    assert!(
                        room.abs() < by.abs() && (moved(c, room) - bound).abs() < 1e-9 * bound.abs().max(1.0),
                        "{}: {room}",
                        p.variable
                    );
                    bounded[usize::from(factor)] += 1;
                }
                let within = 1e-3 * (bound - p.null);
                assert_eq!(c.room(&problem, &nominal, 0, within), within, "{}, side {side}", p.variable);
            }
        }
        assert!(bounded.iter().all(|n| *n > 3), "{bounded:?}");
    }
}
