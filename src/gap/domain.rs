//! Where a retuned plant was validated, and how well its clutch torque is known: computes the [`Validated`] of a campaign.
//!
//! Places are the operating points through which the plant passes in corrected replays of the recordings of the fit. The standard deviation of the clutch torque at slip ω,
//! temperature θ and bearing position x follows from the posterior over explanations k with probabilities w_k and torques T_k, where T is the torque of the plant that is handed
//! out:
//!
//! ```text
//! σ² = Σ_k w_k [ (T_k − T)² + Σ_r ½ ((T_k(p + d_r) − T_k)² + (T_k(p − d_r) − T_k)²) ] + (s² + ρ²) T²
//! ```
//!
//! The deviations d_r are the columns of the Cholesky factor of the covariance of numbers and effects (the mean over the accuracies that laws may have); for each effect, the mean
//! that its form may have, as a share of the effect's size; and one standard deviation of each number that every recording has of its own. To first order the sum is gᵀCg, with g
//! the gradient of the torque and C its covariance; beyond first order, both sides of a kink count. s is the share of its torque by which the filter lets any clutch depart from
//! its map. ρ is the share of the torque by which the retuned plant differs from a transducer, if there is one, beyond the noise of the transducer, because no covariance contains
//! what the equations lack. All torques are computed with the plant's own equations.

use super::infer::coordinate::Coordinate;
use super::infer::density::{Point, Problem};
use super::infer::fit::Fit;
use super::infer::learned::Learned;
use super::infer::posterior::Posterior;
use super::model::prepare;
use super::model::replay;
use super::model::track::Channel;
use crate::effects::{self, REGISTRY};
use crate::plant::Phase;
use crate::plant::clutch::{self, Branch, FaceCache};
use crate::plant::config::Config;
use crate::plant::motion::{Motion, index};
use crate::validated::{CLOSING, Place, SLIPS, THETA, Validated};
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Probability below which an explanation is left out.
const LEAST_PROBABILITY: f64 = 0.01;

/// Variables other than the place on which the torque depends; its variance is averaged over these combinations: direction of the bearing, slip angle in rad, friction work in J.
const CIRCUMSTANCES: [(f64, f64, f64); 4] = [(1.0, 0.0, 1e3), (-1.0, 1.3, 3e3), (1.0, 2.9, 3e3), (-1.0, 4.6, 8e3)];

/// The plant that is handed out.
pub struct RetunedPlant<'a> {
    /// The point of the fit to which the plant belongs.
    pub point: &'a Point,
    /// The learned law that the plant contains, if any.
    pub learned: Option<&'a Learned>,
    /// Whether the plant follows the car, because it was retuned or contains a learned law. Otherwise it was validated nowhere.
    pub follows: bool,
    /// Whether a law of the clutch is missing and the plant contains no learned law. Only a transducer shows what the missing law does to the torque.
    pub lacks_clutch_law: bool,
}

impl RetunedPlant<'_> {
    /// Whether it is known how well the clutch torque of the plant follows that of the car; `measured` says whether some recording has a transducer.
    fn is_known(&self, measured: bool) -> bool {
        self.follows && (measured || !self.lacks_clutch_law)
    }
}

/// The clutch according to one explanation, with the weight of the explanation and both sides of every deviation d_r.
struct Clutch {
    weight: f64,
    mode: Config,
    deviations: Vec<[Config; 2]>,
}

/// The places at which a plant was validated, and the table of σ of its clutch torque.
pub fn validated(problem: &Problem, posterior: &Posterior, handed: &RetunedPlant) -> Validated {
    let car = problem.car(handed.point, None);
    let config = Config::new(&car.vehicle, &car.effects);
    let parts: Vec<Visited> = (0..problem.tracks.len()).into_par_iter().map(|k| visited(problem, handed.point, &config, k)).collect();
    let sum = |of: fn(&Visited) -> f64| parts.iter().map(of).sum::<f64>();
    let squares = sum(|v| v.squares);
    let missed = if squares > 0.0 { (sum(|v| v.excess) / squares).max(0.0) } else { 0.0 };
    let unexplained_share_squared = prepare::CLUTCH.sigma.powi(2) + missed;
    let clutches = clutches(problem, posterior, handed);
    let of_closing = |&closing: &f64| -> Vec<f64> {
        let of_theta = |&theta: &f64| {
            let x = clutch::position_of(&config, closing, theta);
            SLIPS.map(|slip| sigma(&config, &clutches, unexplained_share_squared, x, theta, slip))
        };
        THETA.iter().flat_map(of_theta).collect()
    };
    let table: Vec<Vec<f64>> = CLOSING.par_iter().map(of_closing).collect();
    let places = parts.iter().filter(|_| handed.is_known(squares > 0.0)).flat_map(|v| v.places.iter().copied());
    Validated::new(places, table.into_iter().flatten())
}

/// Places through which the plant passes in a recording, and its errors against a transducer. Empty if the recording has no position.
struct Visited {
    /// The place at each observation, as far as all its numbers are finite.
    places: Vec<Place>,
    /// Sum of the squared errors against the transducer minus the variance of their noise, over observations with a slipping clutch, (N·m)².
    excess: f64,
    /// Sum of the squared clutch torque of the plant over the same observations, (N·m)².
    squares: f64,
}

fn visited(problem: &Problem, point: &Point, config: &Config, k: usize) -> Visited {
    let (track, filter, car) = (&problem.tracks[k], &problem.filters[k], problem.car(point, Some(k)));
    if track.position_free {
        return Visited { places: Vec::new(), excess: 0.0, squares: 0.0 };
    }
    let n = track.observations();
    let mut places: Vec<Place> = Vec::with_capacity(n);
    let mut slips = vec![false; n];
    // Errors of the plant's own torque: the innovations are those of a torque that the filter has corrected.
    let mut errors = vec![(0.0, 0_usize); n];
    let measured = &track.measured[Channel::TFc as usize];
    replay::corrected(track, filter, &car, problem.temperatures(point, k), None, |row, now, plant| {
        if let Some(error) = measured.get(row).map(|torque| torque - now.t_fc).filter(|e| e.is_finite()) {
            let (sum, count) = &mut errors[track.observation_of(row)];
            (*sum, *count) = (*sum + error, *count + 1);
        }
        if places.len() < n && row == track.rows_of(places.len()).start {
            slips[places.len()] = now.phase == Phase::Slipping;
            let closing = clutch::closing(config, now.x_to_actual, now.theta_c);
            places.push(Place { slip: plant.slip(), theta: now.theta_c, closing, torque: now.t_fc });
        }
    });
    let transducer = &filter.bench[1];
    let (mut excess, mut squares) = (0.0, 0.0);
    for (((place, gain), (sum, count)), slips) in places.iter().zip(transducer).zip(errors).zip(slips) {
        if slips && gain.weight > 0.0 && count > 0 && place.torque.is_finite() {
            excess += (sum / count as f64).powi(2) - gain.weight.powi(-2);
            squares += place.torque * place.torque;
        }
    }
    places.retain(|p| p.numbers().iter().all(|x| x.is_finite()));
    Visited { places, excess, squares }
}

fn clutches(problem: &Problem, posterior: &Posterior, handed: &RetunedPlant) -> Vec<Clutch> {
    if let Some(l) = handed.learned {
        let mut one = clutch_of(problem, 1.0, &l.fit);
        // The effects beside a learned law stay as they were fitted, and keep their uncertainty.
        one.deviations.extend(posterior.best().fit.iter().flat_map(|fit| of_effects(problem, fit, &l.fit.point)));
        return vec![one];
    }
    let likely = posterior.explanations.iter().filter(|e| e.probability >= LEAST_PROBABILITY);
    likely
        .filter_map(|e| {
            let fit = e.fit.as_ref()?;
            let mut one = clutch_of(problem, e.probability, fit);
            one.deviations.extend(of_forms(problem, fit));
            Some(one)
        })
        .collect()
}

/// The clutch of a fit, with the deviations of its numbers and effects and of the numbers that every recording has of its own.
fn clutch_of(problem: &Problem, weight: f64, fit: &Fit) -> Clutch {
    let mode = problem.car(&fit.point, None);
    let covariance = fit.mean_covariance.clone().or_else(|| fit.covariance());
    let shared = along(problem, &fit.point, &fit.shared, covariance);
    let own = problem.own.iter().map(|n| {
        [1.0, -1.0].map(|side| {
            let mut car = mode;
            car.apply(std::slice::from_ref(n), &[side]);
            Config::new(&car.vehicle, &car.effects)
        })
    });
    Clutch { weight, mode: Config::new(&mode.vehicle, &mode.effects), deviations: shared.into_iter().chain(own).collect() }
}

/// Both sides of a deviation along each column of the Cholesky factor of the covariance of these coordinates.
fn along(problem: &Problem, point: &Point, coordinates: &[Coordinate], covariance: Option<DMatrix<f64>>) -> Vec<[Config; 2]> {
    let root = covariance.and_then(|c| c.cholesky()).map(|c| c.l()).unwrap_or_else(|| DMatrix::zeros(coordinates.len(), 0));
    let both = |column: nalgebra::DVectorView<f64>| {
        [1.0, -1.0].map(|side| {
            let mut moved = point.clone();
            coordinates.iter().zip(column.iter()).for_each(|(c, by)| c.move_by(problem, &mut moved, 0, side * by));
            let car = problem.car(&moved, None);
            Config::new(&car.vehicle, &car.effects)
        })
    };
    root.column_iter().map(both).collect()
}

/// Deviations of the effects of a fit beside a learned law, taken at the point `at` of the law's fit.
fn of_effects(problem: &Problem, fit: &Fit, at: &Point) -> Vec<[Config; 2]> {
    let places: Vec<usize> = (0..fit.shared.len()).filter(|&i| matches!(fit.shared[i], Coordinate::Effect(_))).collect();
    let coordinates: Vec<Coordinate> = places.iter().map(|&i| fit.shared[i]).collect();
    let part = |c: &DMatrix<f64>| DMatrix::from_fn(places.len(), places.len(), |i, j| c[(places[i], places[j])]);
    along(problem, at, &coordinates, fit.mean_covariance.as_ref().map(part))
}

/// Deviations of the effects of a fit, each made larger and smaller by the mean that its form may have.
fn of_forms(problem: &Problem, fit: &Fit) -> Vec<[Config; 2]> {
    let there = |e: &&effects::Entry| e.parameters.clone().any(|k| fit.shared.contains(&Coordinate::Effect(k)));
    let both = |e: &effects::Entry| {
        [1.0, -1.0].map(|side| {
            let mut moved = fit.point.clone();
            for k in e.effect.amplitudes {
                let by = side * fit.sigma_of_form_mean(*k);
                Coordinate::Effect(*k).move_by(problem, &mut moved, 0, by);
            }
            let car = problem.car(&moved, None);
            Config::new(&car.vehicle, &car.effects)
        })
    };
    REGISTRY.iter().filter(there).map(both).collect()
}

/// Standard deviation in N·m of the torque of a clutch that slips, or of the torque at which a locked clutch would slip. `unexplained_share_squared` is s² + ρ², the variance relative to the squared
/// torque that no number of the plant accounts for.
fn sigma(handed: &Config, clutches: &[Clutch], unexplained_share_squared: f64, x: f64, theta: f64, slip: f64) -> f64 {
    let weights: f64 = clutches.iter().map(|c| c.weight).sum();
    let variance = CIRCUMSTANCES.iter().map(|&(z, angle, work)| {
        let mut y = Motion::default();
        (y[index::THETA_C], y[index::ANGLE], y[index::E_D]) = (theta, angle, work);
        let torque = |c: &Config| clutch::slipping(c, &FaceCache::EMPTY, x, Branch { x, z }, 1.0, slip, &y).total();
        let out = torque(handed);
        let of = |c: &Clutch| {
            let mode = torque(&c.mode);
            let each = c.deviations.iter().flatten().map(|d| 0.5 * (torque(d) - mode).powi(2));
            c.weight * ((mode - out).powi(2) + each.sum::<f64>())
        };
        clutches.iter().map(of).sum::<f64>() / weights + unexplained_share_squared * out * out
    });
    (variance.sum::<f64>() / CIRCUMSTANCES.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gap::model::prepare::Example;

    #[test]
    fn a_car_whose_clutch_lacks_a_law_is_validated_by_a_transducer_alone() {
        let point = Example::read().problem(&[]).0.nominal();
        for (follows, lacks_clutch_law, without, with) in
            [(true, false, true, true), (true, true, false, true), (false, false, false, false), (false, true, false, false)]
        {
            let handed = RetunedPlant { point: &point, learned: None, follows, lacks_clutch_law };
            assert_eq!([handed.is_known(false), handed.is_known(true)], [without, with], "{follows} {lacks_clutch_law}");
        }
    }

    /// A transducer that reads 10 % more than the plant leaves 1 % of the squared torque beyond its noise.
    #[test]
    fn what_a_transducer_leaves_beyond_its_noise_is_a_share_of_its_torque() {
        let example = Example::read();
        let mut recording = example.campaign.recordings[0].clone();
        let (problem, _) = example.problem(&[&recording]);
        let point = problem.nominal();
        let (car, theta) = (problem.car(&point, Some(0)), problem.temperatures(&point, 0));
        let mut torque = vec![0.0; recording.time.len()];
        replay::corrected(&problem.tracks[0], &problem.filters[0], &car, theta, None, |row, now, _| torque[row] = 1.1 * now.t_fc);
        recording.t_fc = Some(torque);
        let (problem, _) = example.problem(&[&recording]);
        let found = visited(&problem, &point, &Config::new(&car.vehicle, &car.effects), 0);
        assert!(found.squares > 1e4 && (found.excess / found.squares - 0.01).abs() < 1e-3, "{} of {}", found.excess, found.squares);
    }
}
