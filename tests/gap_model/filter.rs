//! The filter's innovations are noise for a matching car, and data that were not shown to the filter have no influence.

use crate::made_up::{answered, example, made_up, mean_square_from, normals, prepared};
use kisspoint::campaign::Recording;
use kisspoint::effects::{self, param};
use kisspoint::gap::infer::density::{Problem, misfit};
use kisspoint::gap::infer::search::Hypothesis;
use kisspoint::gap::model::tolerance::Car;
use kisspoint::gap::model::track::{Channel, Track};
use kisspoint::gap::model::{filter, prepare, replay};
use kisspoint::plant::Phase;
use kisspoint::vehicle::Vehicle;

#[test]
fn innovations_of_the_true_car_are_white_and_of_unit_variance_at_most() {
    let problem = made_up(|_| {});
    let all = problem.all_residuals(&problem.nominal(), None);
    for (r, f) in all.iter().zip(&problem.filters) {
        for c in 0..2 {
            let v: Vec<f64> = (0..f.gains.len()).map(|k| r[2 * k + c]).collect();
            let n = v.len() as f64;
            let variance = v.iter().map(|x| x * x).sum::<f64>() / n;
            let neighbours = v.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / (n * variance);
            // The filter also allows for disturbances that this car does not have, so the variance is below one.
            assert!((0.5..1.2).contains(&variance), "variance {variance}");
            assert!(neighbours.abs() < 0.3, "correlation {neighbours}");
        }
    }
}

/// The example's inputs from a logger of 1 kHz: the change of the innovations due to an effect, computed in steps of an observation, is nearly that computed for every row, and
/// equal to it for judder, whose torque pulsates.
#[test]
fn changes_in_steps_of_an_observation_are_nearly_those_of_every_row() {
    const FASTER: usize = 10;
    let (mut recordings, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let times = |v: &[f64]| v.iter().flat_map(|x| [*x; FASTER]).collect::<Vec<f64>>();
    for r in &mut recordings {
        let h = 1.0 / r.sample_rate_hz / FASTER as f64;
        (r.x_to, r.t_fc, r.theta_c, r.brake) = (None, None, None, None);
        r.time = (0..FASTER * r.time.len()).map(|k| k as f64 * h).collect();
        r.sample_rate_hz *= FASTER as f64;
        for v in [&mut r.omega_f, &mut r.omega_c, &mut r.t_e, &mut r.x_to_cmd, &mut r.theta_h] {
            *v = times(v);
        }
    }
    let all: Vec<&Recording> = recordings.iter().collect();
    let (tracks, tolerances) = prepare::read(&all, &vehicle_json).unwrap();
    let with = prepare::disturbances(&tracks, &tolerances);
    let problem = prepare::problem(tracks, &vehicle, &tolerances, &with);
    assert_eq!(problem.tracks[0].rows_of(1), FASTER..2 * FASTER);
    let nominal = problem.nominal();
    let here = problem.residuals(0, &nominal, None);
    let from = problem.baseline(0, &nominal, None, Some(&here));
    for (parameter, value, most) in
        [(param::vehicle_mass::factor, 1.2, 0.03), (param::friction_level::factor, 0.9, 0.03), (param::judder::sine, 0.1, 0.0)]
    {
        let mut to = nominal.clone();
        to.effects[parameter] = value;
        let rows: Vec<f64> = problem.residuals(0, &to, None).iter().zip(&here).map(|(a, b)| a - b).collect();
        let steps = problem.change(0, &from, &to);
        let square = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>();
        let (off, whole) = (square(&mut rows.iter().zip(&steps).map(|(a, b)| a - b)), square(&mut rows.iter().copied()));
        assert!(whole > 100.0 && off <= most * most * whole, "{parameter}: {} of {}", off.sqrt(), whole.sqrt());
    }
}

#[test]
fn a_brake_is_no_gap() {
    let (mut recordings, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let r = recordings.iter_mut().find(|r| r.manoeuvre == "open_rev").unwrap();
    // From the middle on, an unreported torque of 100 N·m pulls on the car's side.
    let half = r.time.len() / 2;
    let begin = r.time[half];
    let speed = r.omega_c[half];
    for k in half..r.time.len() {
        r.omega_c[k] = (speed - 100.0 / 0.6 * (r.time[k] - begin)).max(0.0);
    }
    let marked: Vec<bool> = (0..r.time.len()).map(|k| k >= half).collect();
    let cost = |brake: Option<Vec<bool>>| {
        let track = Track::new(&Recording { brake, ..r.clone() });
        let (_, tolerances) = prepare::read(&[&*r], &vehicle_json).unwrap();
        let with = prepare::disturbances(std::slice::from_ref(&track), &tolerances);
        let filter = prepare::filter_of(&track, &vehicle, &with);
        let n = track.observations();
        let all = kisspoint::gap::model::replay::innovations(&track, &filter, &Car::nominal(&vehicle), track.theta_0, None);
        assert_eq!(all.len(), 2 * n);
        misfit(&[(0..n).map(|k| all[2 * k + 1]).collect()]) / n as f64
    };
    let (without, with) = (cost(None), cost(Some(marked)));
    assert!(with < 4.0 && without > 20.0 * with, "marked {with}, not marked {without}");
}

#[test]
fn samples_that_are_not_there_are_not_made_up() {
    let (mut recordings, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let r = &mut recordings[0];
    (1..r.omega_c.len()).step_by(2).for_each(|k| r.omega_c[k] = f64::NAN);
    let (tracks, tolerances) = prepare::read(&[&*r], &vehicle_json).unwrap();
    let with = prepare::disturbances(&tracks, &tolerances);
    let f = filter::filter(&tracks[0], &vehicle, &with, &[]);
    let known = |c: usize| f.gains.iter().filter(|g| g.weight[c] > 0.0).count();
    assert_eq!(known(0), tracks[0].observations());
    assert_eq!(known(1), tracks[0].observations().div_ceil(2));
    assert!(tracks[0].measured[Channel::OmegaC as usize].iter().any(|v| v.is_nan()));
}

#[test]
fn speeds_that_cross_while_the_clutch_is_open_are_not_locked() {
    let (mut recordings, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let r = &mut recordings[0];
    let n = r.time.len();
    // Open throughout; the disc speed passes the flywheel speed in the middle.
    for k in 0..n {
        let part = k as f64 / n as f64;
        (r.x_to_cmd[k], r.omega_f[k], r.omega_c[k]) = (vehicle.actuator.x_cnt_0 - 0.5, 100.0, 60.0 + 80.0 * part);
    }
    let (tracks, tolerances) = prepare::read(&[&*r], &vehicle_json).unwrap();
    let with = prepare::disturbances(&tracks, &tolerances);
    assert!(filter::filter(&tracks[0], &vehicle, &with, &[]).phase.iter().all(|p| *p != Phase::Locked));
    // Closed while both speeds are equal, then commanded open: it counts as locked until the speeds part.
    for k in 0..n {
        let slip = if k < n / 2 { 0.0 } else { 40.0 * (k - n / 2) as f64 / n as f64 };
        let closed = k < n / 4;
        r.x_to_cmd[k] = if closed { vehicle.actuator.x_cls_0 } else { vehicle.actuator.x_cnt_0 - 0.5 };
        (r.omega_f[k], r.omega_c[k]) = (100.0, 100.0 - slip);
    }
    let (tracks, tolerances) = prepare::read(&[&*r], &vehicle_json).unwrap();
    let with = prepare::disturbances(&tracks, &tolerances);
    let locked: Vec<bool> = filter::filter(&tracks[0], &vehicle, &with, &[]).phase.iter().map(|p| *p == Phase::Locked).collect();
    let last = locked.iter().rposition(|l| *l).unwrap();
    assert!(locked[..last].iter().all(|l| *l), "a lock that nothing shows to end goes on");
    assert!((locked.len() / 2..locked.len() * 2 / 3).contains(&last), "{last} of {}", locked.len());
}

/// Two cars whose torques and inertias differ by a common factor move alike. A likelihood that prefers one of them would judge the filter's corrections, not the car.
#[test]
fn a_common_factor_on_torques_and_inertias_changes_nothing() {
    let problem = made_up(|_| ());
    let misfit_of = |f: f64| {
        let mut vehicle = problem.vehicle;
        let d = &mut vehicle.driveline;
        for number in [&mut d.J_f, &mut d.J_c, &mut d.b_f, &mut d.b_c, &mut d.T_L0, &mut d.k_L] {
            *number *= f;
        }
        let friction = &mut vehicle.friction;
        for number in [&mut friction.mu_0, &mut friction.alpha_1, &mut friction.m_0, &mut friction.m_1, &mut friction.m_2] {
            *number *= f;
        }
        // Temperatures stay the same although the heat is scaled.
        let thermal = &mut vehicle.thermal;
        for number in [&mut thermal.C_1, &mut thermal.C_b, &mut thermal.gamma_1, &mut thermal.gamma_2] {
            *number *= f;
        }
        let changed = kisspoint::gap::infer::density::Problem { vehicle, ..problem.clone() };
        let mut point = changed.nominal();
        point.effects[param::engine_torque_gain::gain] = f;
        misfit(&changed.all_residuals(&point, None))
    };
    let (plain, scaled) = (misfit_of(1.0), misfit_of(1.08));
    assert!((plain - scaled).abs() < 0.01 * plain, "{plain} {scaled}");
}

/// Only the first sample informs the initial speed. Its innovation therefore has twice the variance of the sensor: of white noise, of coloured noise, and of the sensor
/// disturbance, in the initial state as in the sample.
#[test]
fn the_first_sample_is_as_uncertain_as_its_sensor_twice() {
    let (recordings, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let (tracks, tolerances) = prepare::read(&[&recordings[0]], &vehicle_json).unwrap();
    let mut with = prepare::disturbances(&tracks, &tolerances);
    (with.noise[0].white, with.noise[0].coloured) = (0.1, 0.2);
    with.sensors[0] = kisspoint::gap::model::tolerance::Wander { sigma: 0.3, time_s: 1.0 };
    let variance = filter::filter(&tracks[0], &vehicle, &with, &[]).gains[0].weight[0].powi(-2);
    assert!((variance - 2.0 * (0.01 + 0.04 + 0.09)).abs() < 1e-12, "{variance}");
}

#[test]
fn a_wheel_that_shows_nothing_stands_still_if_it_begins_slowly() {
    let (recordings, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let mut track = Track::new(&recordings[0]);
    let mut begins_with = |first: f64, second: f64| {
        (track.measured[Channel::OmegaC as usize][0], track.measured[Channel::OmegaC as usize][1]) = (first, second);
        replay::start(&track, &Car::nominal(&vehicle), 0, [40.0; 2], 0.1).omega_c
    };
    assert_eq!([begins_with(f64::NAN, 3.0), begins_with(f64::NAN, 30.0), begins_with(2.0, 3.0)], [0.0, 30.0, 2.0]);
}

#[test]
fn a_wheel_that_shows_nothing_yet_stands_nearly_still() {
    let mut problem = made_up(|_| ());
    let misfit_of = |p: &Problem| misfit(&p.all_residuals(&p.nominal(), None)) / p.samples() as f64;
    let whole = misfit_of(&problem);
    // The disc speed sensor has a threshold of 3 rad/s.
    for track in &mut problem.tracks {
        track.measured[Channel::OmegaC as usize].iter_mut().filter(|v| v.abs() < 3.0).for_each(|v| *v = f64::NAN);
    }
    let (_, vehicle_json) = example();
    let logger = kisspoint::gap::model::tolerance::Logger::UNIFORM;
    let tolerances = kisspoint::gap::model::tolerance::read(&vehicle_json, logger).unwrap();
    let with = prepare::disturbances(&problem.tracks, &tolerances);
    let hidden = prepare::problem(problem.tracks, &problem.vehicle, &tolerances, &with);
    assert!(hidden.tracks.iter().any(|t| t.measured[Channel::OmegaC as usize][0].is_nan()), "some begin at rest");
    assert!(misfit_of(&hidden) < 1.1 * whole, "{} {whole}", misfit_of(&hidden));
}

/// Uniform samples with time stamps that are off by up to 4.5 ms, or samples taken at such times: neither is a gap.
#[test]
fn uneven_stamps_are_no_gap() {
    let (_, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let mut normal = normals(31);
    // The torque oscillates while the clutch is open.
    let inputs: Vec<[f64; 2]> = (0..600).map(|k| [50.0 * (0.05 * f64::from(k)).sin(), 1.0]).collect();
    let moving = |row: usize, now: [f64; 2]| if row == 0 && now == [0.0; 2] { [200.0, 20.0] } else { now };
    let mut uneven = answered(&Car::nominal(&vehicle), &inputs, 0.05, |_| false, moving);
    uneven.time.iter_mut().skip(1).for_each(|t| *t += (0.0026 * normal()).clamp(-0.0045, 0.0045));
    let left = |with_stamps: bool| {
        let mut problem = prepared(&uneven);
        let tolerances = prepare::read(&[&uneven], &vehicle_json).unwrap().1;
        let with = prepare::disturbances(&problem.tracks, &tolerances);
        assert!((with.stamps / 0.0025 - 1.0).abs() < 0.25 && with.noise[0].white < 0.1, "{with:?}");
        let with = filter::Disturbances { stamps: if with_stamps { with.stamps } else { 0.0 }, ..with };
        problem.filters = problem.tracks.iter().map(|t| prepare::filter_of(t, &vehicle, &with)).collect();
        mean_square_from(&problem, effects::null(), 0.1)
    };
    let (known, ignored) = (left(true), left(false));
    assert!((0.4..1.3).contains(&known) && ignored > 5.0, "{known} {ignored}");
}

/// Rows at the end that do not fill an observation are assigned to the last one.
#[test]
fn torques_of_rows_that_fill_no_observation_belong_to_the_last_one() {
    let (_, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let n = 107;
    let r = Recording {
        name: "made up".into(),
        sample_rate_hz: 1000.0,
        time: (0..n).map(|k| 0.001 * f64::from(k)).collect(),
        theta_c0: 40.0,
        theta_b0: 40.0,
        omega_f: vec![200.0; 107],
        omega_c: vec![20.0; 107],
        t_e: vec![40.0; 107],
        x_to_cmd: (0..n).map(|k| if k < 102 { 5.5 } else { 1.0 }).collect(),
        theta_h: vec![30.0; 107],
        ..Recording::default()
    };
    let problem = prepared(&r);
    let torques = replay::torques(&problem.tracks[0], &problem.filters[0], &Car::nominal(&vehicle), [40.0; 2]);
    assert_eq!(torques.len(), 107);
    // The clutch is open by the end.
    assert!(torques[101] > 1.0 && torques[106] == 0.0, "{torques:?}");
}

#[test]
fn shafts_of_a_car_that_its_brakes_hold_are_at_rest() {
    let (_, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let mut car = Car::nominal(&vehicle);
    car.effects[param::driveline_compliance::compliance] = 0.011;
    car.effects[param::driveline_compliance::damping] = 0.3;
    let idle = 100.0;
    let inputs = vec![[vehicle.driveline.b_f * idle, vehicle.actuator.x_cnt_0 - 0.5]; 400];
    // The brakes hold the car. The flywheel signal is the same as without brakes; the noise of the disc sensor would excite the shafts of a model that is not held.
    let recording = answered(&car, &inputs, 0.4, |_| true, |_, _| [idle, 0.0]);
    let mut problem = prepared(&recording);
    let of_disc = |p: &Problem| {
        let point = kisspoint::gap::infer::density::Point { effects: car.effects, ..p.nominal() };
        p.all_residuals(&point, None)[0][200..].iter().skip(1).step_by(2).map(|r| r * r).sum::<f64>()
    };
    let held = of_disc(&problem);
    problem.filters[0].stands.fill(false);
    let swings = of_disc(&problem);
    assert!(held < 0.6 * swings, "{held} {swings}");
}

#[test]
fn a_clutch_that_opens_while_both_sides_slow_down_alike_is_not_held() {
    let (_, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let (open, closed) = (vehicle.actuator.x_cnt_0 - 0.5, vehicle.actuator.x_cls_0);
    let inputs: Vec<[f64; 2]> = (0..250).map(|k| if k < 100 { [20.0, closed] } else { [-10.0, open] }).collect();
    // Locked for a second; then the engine slows down by itself, and the brakes slow the car down nearly as much.
    let speeds = |k: usize, now: [f64; 2]| match k {
        0 => [150.0; 2],
        1..100 => now,
        _ => {
            let t = 0.01 * (k - 100) as f64;
            [now[0], now[0] + 0.4 * (t / 0.3).min(1.0) * (1.0 + 4.0 * (t - 0.6).max(0.0))]
        }
    };
    let recording = answered(&Car::nominal(&vehicle), &inputs, 0.1, |k| k >= 100, speeds);
    let left = mean_square_from(&prepared(&recording), effects::null(), 1.05);
    assert!(left < 1.5, "{left}");
}

/// A closed clutch accelerates and then brakes at 250 rad/s², with a flywheel speed that is sensed 12 ms late. The sensed speeds are 3 rad/s apart although there is no slip.
/// If no such latency is declared, this counts as slip.
#[test]
fn a_closed_clutch_that_brakes_with_one_speed_late_holds() {
    let (_, mut vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let closed = vehicle.actuator.x_cls_0;
    let inputs = [[20.0, closed]; 150];
    let speeds = |k: usize, _: [f64; 2]| {
        let at = |t: f64| if t < 1.0 { 120.0 + 80.0 * t } else { 200.0 - 250.0 * (t - 1.0) };
        let t = 0.01 * k as f64;
        [at(t - 0.012), at(t)]
    };
    let mut recording = answered(&Car::nominal(&vehicle), &inputs, 0.05, |k| k >= 100, speeds);
    // A tenth of the frames is lost.
    (5..150).step_by(10).for_each(|k| recording.omega_c[k] = f64::NAN);
    let held = |vehicle_json: &serde_json::Value| {
        let (tracks, tolerances) = prepare::read(&[&recording], vehicle_json).unwrap();
        let with = prepare::disturbances(&tracks, &tolerances);
        let problem = prepare::problem(tracks, &vehicle, &tolerances, &with);
        (with.skew, problem.filters[0].phase[103..].iter().filter(|p| **p == Phase::Locked).count())
    };
    let (_, without) = held(&vehicle_json);
    for sensor in ["sensors.omega_f_latency", "sensors.omega_c_latency"] {
        vehicle_json["tolerance"][sensor] = serde_json::json!({"abs": 0.004});
    }
    let (skew, with) = held(&vehicle_json);
    assert!((skew - 0.012).abs() < 1e-3, "{skew}");
    assert!(with == 47 && without < 5, "{with} {without}");
}

/// The same samples in four messages at intervals of 30 µs give the same innovations and the same car.
#[test]
fn channels_in_bursts_say_what_they_say_in_one_row() {
    let (recordings, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let bursts = |r: &Recording| {
        let rows = 4 * r.time.len();
        let one = |v: &[f64], message: usize| (0..rows).map(|k| if k % 4 == message { v[k / 4] } else { f64::NAN }).collect::<Vec<f64>>();
        // Inputs are held; the first value also applies to the rows before it.
        let held = |v: &[f64], message: usize| (0..rows).map(|k| v[(k + 4 - message).saturating_sub(4) / 4]).collect::<Vec<f64>>();
        let own = |message: usize| Some((0..rows).filter(|k| k % 4 == message).collect::<Vec<usize>>());
        let all = Recording {
            time: (0..rows).map(|k| r.time[k / 4] + 3e-5 * (k % 4) as f64).collect(),
            omega_f: one(&r.omega_f, 0),
            omega_c: one(&r.omega_c, 1),
            t_e: held(&r.t_e, 2),
            x_to_cmd: held(&r.x_to_cmd, 3),
            theta_h: held(&r.theta_h, 0),
            input_rows: [own(2), own(3)],
            x_to: r.x_to.as_ref().map(|v| one(v, 0)),
            t_fc: r.t_fc.as_ref().map(|v| one(v, 0)),
            theta_c: r.theta_c.as_ref().map(|v| one(v, 0)),
            brake: None,
            ..r.clone()
        };
        // As the reader returns it: the recording begins with the message that begins last.
        let cut = |v: Vec<f64>| v[3..].to_vec();
        Recording {
            time: all.time[3..].iter().map(|t| t - all.time[3]).collect(),
            omega_f: cut(all.omega_f),
            omega_c: cut(all.omega_c),
            t_e: cut(all.t_e),
            x_to_cmd: cut(all.x_to_cmd),
            theta_h: cut(all.theta_h),
            x_to: all.x_to.map(cut),
            t_fc: all.t_fc.map(cut),
            theta_c: all.theta_c.map(cut),
            input_rows: all.input_rows.map(|own| own.map(|o| o.iter().filter(|k| **k >= 3).map(|k| k - 3).collect())),
            brake: None,
            ..r.clone()
        }
    };
    let of = |recordings: &[Recording]| {
        let all: Vec<&Recording> = recordings.iter().collect();
        let (tracks, tolerances) = prepare::read(&all, &vehicle_json).unwrap();
        let with = prepare::disturbances(&tracks, &tolerances);
        let problem = prepare::problem(tracks, &vehicle, &tolerances, &with);
        let fit = Hypothesis::fitted(&problem, Vec::new(), &problem.nominal(), 12, None).fit;
        (misfit(&problem.all_residuals(&problem.nominal(), None)), fit)
    };
    let (whole, split) = (of(&recordings), of(&recordings.iter().map(bursts).collect::<Vec<_>>()));
    assert!((split.0 / whole.0 - 1.0).abs() < 0.02 && (split.1.cost / whole.1.cost - 1.0).abs() < 0.02, "{} {}", split.0, whole.0);
    let apart = split.1.point.shared.iter().zip(&whole.1.point.shared).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart < 0.6, "{apart}: {:?} {:?}", split.1.point.shared, whole.1.point.shared);
}

/// A speed that is lost for 0.8 s under braking is not a speed below a sensor's threshold: the car keeps moving.
#[test]
fn a_car_whose_speed_is_lost_under_its_brakes_does_not_stand() {
    let (_, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let speeds = |row: usize, now: [f64; 2]| [now[0], if (60..140).contains(&row) { f64::NAN } else { 80.0 - 0.1 * row as f64 }];
    let lost = prepared(&answered(&Car::nominal(&vehicle), &[[5.0, 0.0]; 200], 0.1, |row| (20..150).contains(&row), speeds));
    assert!(lost.tracks[0].measured[Channel::OmegaC as usize].iter().filter(|v| v.is_nan()).count() == 80);
    assert!(!lost.filters[0].stands.contains(&true));
}

/// The shafts oscillate for half a second after a stop. The car counts as at rest neither during that time nor after the brakes are released.
#[test]
fn a_car_rests_half_a_second_after_it_stopped_under_its_brakes() {
    let (_, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let speeds = |row: usize, now: [f64; 2]| [if row == 0 { 100.0 } else { now[0] }, 0.0];
    let standing = answered(&Car::nominal(&vehicle), &[[5.0, 0.0]; 200], 0.1, |row| (20..150).contains(&row), speeds);
    let problem = prepared(&standing);
    let (track, stands) = (&problem.tracks[0], &problem.filters[0].stands);
    let rest: Vec<f64> = (0..stands.len()).filter(|k| stands[*k]).map(|k| track.time[track.rows_of(k).start]).collect();
    let near = |found: f64, expected: f64| (found - expected).abs() < 0.025;
    assert!(near(rest[0], 0.7) && near(rest[rest.len() - 1], 1.5), "from {} s to {} s", rest[0], rest[rest.len() - 1]);
}
