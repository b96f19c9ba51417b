//! What an effect does, row by row, if it is a torque of the engine or the car, or an error of a speed as sensed, and nothing else.
//!
//! The torque of an uneven law differs from that of an even one by a share, but what a corrected replay shows of the two does not: the filter takes up what lasts, and then a load is seen where it
//! changes. So the functions of such an effect's form ([`form`](super::form)) are replayed from this.

use super::density::{Point, Problem};
use crate::effects::{Act, Constants, REGISTRY};
use crate::gap::model::missing::{state, way};
use crate::gap::model::replay::Missing;
use crate::plant::config::Config;
use crate::plant::motion::{self, Motion, engine_torque, index, vehicle_resistance};
use crate::plant::{actuation::engine_target, sensed};

/// What an effect does in the states along every recording; none if it does something else.
pub fn causes(problem: &Problem, point: &Point, effect: usize) -> Option<Vec<Missing>> {
    let without = point.without(effect);
    let one = |r: usize| {
        let [with, without] = [point, &without].map(|point| {
            let car = problem.car(point, Some(r));
            Config::new(&car.vehicle, &car.effects)
        });
        acts_beside_the_clutch(effect, &with.constants, &without.constants).then(|| cause(problem, r, &with, &without))
    };
    (0..problem.tracks.len()).map(one).collect()
}

/// Whether an effect, with which constants are these and without which they are those, is such a one.
fn acts_beside_the_clutch(effect: usize, with: &Constants, without: &Constants) -> bool {
    match REGISTRY[effect].effect.act {
        Act::Load(_) | Act::Engine(_) => true,
        Act::Constants(_) => {
            let Constants { engine_gain, engine_bias, accessory_power, clutch_speed_gain, .. } = *without;
            *without == Constants { engine_gain, engine_bias, accessory_power, clutch_speed_gain, ..*with }
        }
        _ => false,
    }
}

/// What one plant does beside another in the states along a recording.
fn cause(problem: &Problem, r: usize, with: &Config, without: &Config) -> Missing {
    let (track, states) = (&problem.tracks[r], &problem.states[r]);
    let differences = |of: &dyn Fn(&Config, &Motion, usize) -> f64| -> Vec<f64> {
        let one = |k: usize| {
            let mut y = [0.0; motion::N];
            (y[index::OMEGA_F], y[index::OMEGA_C]) = (states[state::OMEGA_F][k], states[state::OMEGA_C][k]);
            of(with, &y, k) - of(without, &y, k)
        };
        let all: Vec<f64> = (0..track.observations()).map(one).collect();
        if all.iter().all(|x| *x == 0.0) { Vec::new() } else { (0..track.rows()).map(|row| all[track.observation_of(row)]).collect() }
    };
    let engine = |config: &Config, y: &Motion, k: usize| engine_torque(config, y, engine_target(config, states[state::REPORT][k]));
    // What holds a standing car holds it against more, too.
    let car = |config: &Config, y: &Motion, _| -vehicle_resistance(config, y[index::OMEGA_C], 0.0) * way(y[index::OMEGA_C]).abs();
    let shown = |config: &Config, y: &Motion, _| sensed::shown(config, 1, y[index::OMEGA_C]);
    Missing { torque: [differences(&engine), differences(&car)], sensed: [Vec::new(), differences(&shown)], ..Missing::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{find, param};
    use crate::gap::model::prepare::Example;

    /// Each against its formula in the states that the example runs through; what does something else has no cause.
    #[test]
    fn an_effect_does_what_its_formula_says_row_by_row() {
        let example = Example::read();
        let (problem, _) = example.problem(&[&example.campaign.recordings[0]]);
        let of = |id: &str, values: &[(usize, f64)]| {
            let mut point = problem.nominal();
            values.iter().for_each(|&(k, value)| point.effects[k] = value);
            causes(&problem, &point, find(id).unwrap()).map(|mut all| all.remove(0))
        };
        let (track, states) = (&problem.tracks[0], &problem.states[0]);
        let along = |found: &[f64], expected: &dyn Fn(usize) -> f64| {
            assert_eq!(found.len(), track.rows());
            for (row, x) in found.iter().enumerate() {
                let expected = expected(track.observation_of(row));
                assert!((x - expected).abs() < 1e-9, "row {row}: {x} {expected}");
            }
        };
        let omega_c = &states[state::OMEGA_C];
        let load = of("road_load", &[(param::road_load::rolling_torque, 4.0)]).unwrap();
        along(&load.torque[1], &|k| -4.0 * (omega_c[k] / example.vehicle.driveline.omega_L).tanh() * (omega_c[k] / 0.5).tanh().abs());
        assert!(load.torque[0].is_empty() && load.clutch.is_empty() && load.sensed.concat().is_empty());
        along(&of("engine_torque_bias", &[(param::engine_torque_bias::torque, 3.0)]).unwrap().torque[0], &|_| 3.0);
        let gain = of("engine_torque_gain", &[(param::engine_torque_gain::gain, 1.06)]).unwrap();
        along(&gain.torque[0], &|k| 0.06 * states[state::REPORT][k]);
        along(&of("clutch_speed_gain", &[(param::clutch_speed_gain::gain, 1.02)]).unwrap().sensed[1], &|k| 0.02 * omega_c[k]);
        assert!(of("vehicle_mass", &[(param::vehicle_mass::factor, 1.2)]).is_none());
        assert!(of("friction_level", &[(param::friction_level::factor, 1.1)]).is_none());
        assert!(of("judder", &[(param::judder::sine, 0.1)]).is_none());
        assert!(of("actuator_lag", &[(param::actuator_lag::time_constant, 0.1)]).is_none());
        assert!(of("clutch_speed_delay", &[(param::clutch_speed_delay::delay, 0.05)]).is_none());
    }
}
