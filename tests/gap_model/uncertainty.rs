//! Innovation variances of the filter compared with variances added up by hand, for white sensor noise and no other disturbance.

use crate::made_up::example;
use kisspoint::campaign::Recording;
use kisspoint::gap::model::filter::{Disturbances, filter};
use kisspoint::gap::model::noise::Noise;
use kisspoint::gap::model::prepare;
use kisspoint::gap::model::tolerance::Wander;
use kisspoint::gap::model::track::{Channel, Track};
use kisspoint::vehicle::Vehicle;

/// Sensors with white noise of 0.1 rad/s and 0.2 rad/s, and no process noise.
fn sensors_alone(track: &Track, vehicle_json: &serde_json::Value, recording: &Recording) -> Disturbances {
    let (_, tolerances) = prepare::read(&[recording], vehicle_json).unwrap();
    let still = Wander { sigma: 0.0, time_s: 1.0 };
    let mut with = prepare::disturbances(std::slice::from_ref(track), &tolerances);
    (with.report, with.load, with.clutch, with.sensors) = (still, still, still, [still; 2]);
    (with.report_noise, with.stamps, with.late, with.skew) = (0.0, 0.0, [0.0; 2], 0.0);
    for (noise, white) in with.noise.iter_mut().zip([0.1, 0.2]) {
        *noise = Noise { white, coloured: 0.0, memory_s: 1.0 };
    }
    with
}

/// A wheel whose first sample comes one row late and shows 3 rad/s may have stood still or moved at that speed before: the standard deviation is half of it, in addition to the
/// noise of the sensor and of the initial value.
#[test]
fn a_wheel_that_showed_nothing_is_uncertain_by_half_of_what_it_shows_first() {
    let (recordings, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let mut track = Track::new(&recordings[0]);
    let with = sensors_alone(&track, &vehicle_json, &recordings[0]);
    (track.measured[Channel::OmegaC as usize][0], track.measured[Channel::OmegaC as usize][1]) = (f64::NAN, 3.0);
    let variance = filter(&track, &vehicle, &with, &[]).gains[1].weight[1].powi(-2);
    assert!((variance - (2.0 * 0.04 + 1.5 * 1.5)).abs() < 1e-9, "{variance}");
}

/// A clutch that was closed and remains locked after its command has opened may slip by three standard deviations of the slip of one sample.
#[test]
fn a_clutch_that_holds_against_its_command_may_slip_unseen_by_three_standard_deviations() {
    let (mut recordings, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let r = &mut recordings[0];
    for k in 0..r.time.len() {
        r.x_to_cmd[k] = if k < 1 { vehicle.actuator.x_cls_0 } else { vehicle.actuator.x_cnt_0 - 0.5 };
        (r.omega_f[k], r.omega_c[k]) = (100.0, 100.0);
    }
    let track = Track::new(r);
    let with = sensors_alone(&track, &vehicle_json, r);
    let found = filter(&track, &vehicle, &with, &[]);
    let [f, c] = [0.01, 0.04];
    let (flywheel, car) = (vehicle.driveline.J_f, vehicle.driveline.J_c);
    let share = car / (flywheel + car);
    // Each speed is known from its initial value and one sample. Then both speeds become one, which both sensors observe; then they part.
    let one = ((1.0 - share).powi(2) * f + share.powi(2) * c) / 2.0;
    let seen = 1.0 / (1.0 / one + 1.0 / f + 1.0 / c);
    let expected = seen + share.powi(2) * 9.0 * (f + c) + f;
    let variance = found.gains[2].weight[0].powi(-2);
    assert!((variance - expected).abs() < 1e-9, "{variance} {expected}");
}

/// Without a position the flywheel follows its sensor while the clutch slips. The disc then carries that sensor's noise, white and slowly varying, in the ratio of the
/// inertias.
#[test]
fn without_a_position_the_disc_carries_the_noise_of_the_flywheel() {
    let (mut recordings, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let r = &mut recordings[0];
    (r.x_to_cmd, r.x_to, r.t_fc) = (Vec::new(), None, None);
    let (tracks, _) = prepare::read(&[&*r], &vehicle_json).unwrap();
    let mut with = sensors_alone(&tracks[0], &vehicle_json, r);
    with.noise[0].coloured = 0.3;
    let found = filter(&tracks[0], &vehicle, &with, &[]);
    assert!(found.pinned[0]);
    let ratio = vehicle.driveline.J_f / vehicle.driveline.J_c;
    let variance = found.gains[0].weight[1].powi(-2);
    // Once for the initial value and once for the sample.
    assert!((variance - 2.0 * (0.04 + ratio.powi(2) * (0.01 + 0.09))).abs() < 1e-9, "{variance}");
}
