//! The order of a torque ripple is found by a scan, for a fit loses its phase within a few hundredths of it.

use kisspoint::campaign;
use kisspoint::effects::{self, REGISTRY, param::judder};
use kisspoint::gap::nuisance;
use kisspoint::gap::predict::{Follow, HORIZON_S, predict};
use kisspoint::gap::problem::Problem;
use kisspoint::gap::pulsation;
use kisspoint::gap::series::{Channel, Series};
use kisspoint::vehicle::Vehicle;
use std::path::Path;

/// The bundled campaign as a car with this ripple, and nothing else that differs, would have recorded it.
fn with_ripple(order: f64) -> Problem {
    let campaign = campaign::read(Path::new("tests/data/campaigns/example"), &Default::default()).unwrap();
    let mut problem = Problem {
        series: campaign.recordings.iter().map(Series::coarse).collect(),
        vehicle: Vehicle::from_value(&campaign.vehicle_json).unwrap(),
        nuisances: nuisance::read(&campaign.vehicle_json).unwrap(),
        follow: Follow::Horizon(HORIZON_S),
    };
    let mut real = effects::null();
    (real[judder::sine], real[judder::order]) = (0.2, order);
    for series in &mut problem.series {
        let driven = predict(series, &problem.vehicle, &real, [0.0; 2], Follow::Open);
        for channel in [Channel::OmegaF, Channel::OmegaC] {
            series.measured[channel as usize] = driven.value[channel as usize].clone();
        }
    }
    problem
}

#[test]
fn the_order_of_a_ripple_is_found() {
    let entry = &REGISTRY[effects::find("judder").unwrap()];
    for order in [0.6, 1.1, 1.7, 2.3, 3.1] {
        let problem = with_ripple(order);
        let nominal = problem.nominal();
        let starts = pulsation::starts(&problem, &nominal, &problem.all_residuals(&nominal), entry);
        let found: Vec<f64> = starts.iter().map(|p| p.effects[judder::order]).collect();
        assert!(found.iter().any(|f| (f - order).abs() < 0.005), "order {order}: {found:?}");
    }
}
