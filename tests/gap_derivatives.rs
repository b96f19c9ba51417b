//! A tolerance that moves the same number as an effect has the effect's derivatives, so these have to be its own.

use kisspoint::campaign;
use kisspoint::effects::{PARAMETERS, REGISTRY};
use kisspoint::gap::coordinate::{Coordinate, coordinates};
use kisspoint::gap::derivatives::derivatives;
use kisspoint::gap::nuisance;
use kisspoint::gap::predict::{Follow, HORIZON_S};
use kisspoint::gap::problem::Problem;
use kisspoint::gap::series::Series;
use kisspoint::vehicle::Vehicle;
use std::path::Path;

fn problem() -> Problem {
    let campaign = campaign::read(Path::new("tests/data/campaigns/example"), &Default::default()).unwrap();
    Problem {
        series: campaign.recordings.iter().take(4).map(Series::coarse).collect(),
        vehicle: Vehicle::from_value(&campaign.vehicle_json).unwrap(),
        nuisances: nuisance::read(&campaign.vehicle_json).unwrap(),
        follow: Follow::Horizon(HORIZON_S),
    }
}

#[test]
fn a_tolerance_that_an_effect_repeats_has_the_same_derivatives_as_by_itself() {
    let problem = problem();
    let mut point = problem.nominal();
    let all: Vec<usize> = (0..REGISTRY.len()).collect();
    let mut repeated = 0;
    for effect in all {
        let effects = [effect];
        point.effects = problem.nominal().effects;
        for k in REGISTRY[effect].parameters.clone().filter(|&k| PARAMETERS[k].null == 1.0) {
            point.effects[k] = 1.1;
        }
        let residuals = problem.all_residuals(&point);
        let alone = derivatives(&problem, &point, &residuals, &coordinates(&problem, &[]), None);
        let places = coordinates(&problem, &effects);
        let shared = derivatives(&problem, &point, &residuals, &places, None);
        for (k, nuisance) in problem.nuisances.iter().enumerate() {
            let Some((parameter, _)) = nuisance.same_as(&problem.plant_at(&point).0, &point.effects) else { continue };
            if !places.contains(&Coordinate::Effect(parameter)) {
                continue;
            }
            repeated += 1;
            // Over all recordings together: in one that does not show the number, both are rounding.
            let squares = |of: &dyn Fn(usize) -> f64| (0..alone.len()).map(of).sum::<f64>().sqrt();
            let size = squares(&|r| alone[r].matrix.column(k).norm_squared());
            let difference = squares(&|r| (alone[r].matrix.column(k) - shared[r].matrix.column(k)).norm_squared());
            assert!(difference <= 0.01 * size, "{}: {difference} beside {size}", nuisance.name);
        }
    }
    assert_eq!(repeated, 7, "bias and gain of the torque, μ, J_c, gamma_1, T_L0, x_cnt");
}

#[test]
fn an_effect_that_takes_over_from_its_tolerance_leaves_the_car_as_it_is() {
    let problem = problem();
    let mut taken_over = 0;
    for k in 0..problem.nuisances.len() {
        let mut moved = problem.nominal();
        moved.z[k] = 3.0;
        let mut instead = problem.nominal();
        if problem.nuisances[k].hand_over(3.0, &problem.vehicle, &mut instead.effects).is_none() {
            continue;
        }
        taken_over += 1;
        for (a, b) in problem.all_residuals(&moved).iter().flatten().zip(problem.all_residuals(&instead).iter().flatten()) {
            assert!((a - b).abs() < 1e-6, "{}: {a} and {b}", problem.nuisances[k].name);
        }
    }
    assert_eq!(taken_over, 7);
}
