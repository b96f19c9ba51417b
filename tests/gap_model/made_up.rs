//! Cars simulated by the plant itself with the inputs of the bundled campaign.

use kisspoint::campaign::{self, Recording};
use kisspoint::effects;
use kisspoint::gap::infer::density::Problem;
use kisspoint::gap::model::prepare;
use kisspoint::gap::model::replay::{Missing, replay, start};
use kisspoint::gap::model::tolerance::Car;
use kisspoint::gap::model::track::Track;
use kisspoint::vehicle::Vehicle;
use std::path::Path;

/// Deterministic, approximately standard normal numbers.
pub fn normals(mut seed: u64) -> impl FnMut() -> f64 {
    move || {
        let mut uniform = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((seed >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }
}

pub fn example() -> (Vec<Recording>, serde_json::Value) {
    let campaign = campaign::read(Path::new("tests/data/campaigns/example"), &Default::default()).unwrap();
    (campaign.recordings, campaign.vehicle_json)
}

/// The bundled campaign's inputs with the response of a car with these effects, and white sensor noise of 0.1 rad/s.
pub fn made_up(change: impl Fn(&mut effects::Parameters)) -> Problem {
    made_up_under(change, |_| 0.0)
}

/// The same with an additional torque in N·m on the car's side, as a function of time in s.
pub fn made_up_under(change: impl Fn(&mut effects::Parameters), torque: impl Fn(f64) -> f64) -> Problem {
    let (mut recordings, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let mut normal = normals(3);
    for r in &mut recordings {
        (r.x_to, r.t_fc, r.theta_c) = (None, None, None);
        let track = Track::new(r);
        let mut car = Car::nominal(&vehicle);
        change(&mut car.effects);
        let mut speeds = [vec![0.0; track.rows()], vec![0.0; track.rows()]];
        let begin = start(&track, &Car::nominal(&vehicle), 0, track.theta_0, 0.1);
        let missing = Missing { torque: [Vec::new(), track.time.iter().map(|t| torque(*t)).collect()], ..Missing::default() };
        replay(&track, &car, (&begin, 0.0), 0..track.rows(), Some(&missing), |row, now, _, _| {
            (speeds[0][row], speeds[1][row]) = (now.omega_f + 0.1 * normal(), now.omega_c + 0.1 * normal());
        });
        [r.omega_f, r.omega_c] = speeds;
    }
    let all: Vec<&Recording> = recordings.iter().collect();
    let (tracks, tolerances) = prepare::read(&all, &vehicle_json).unwrap();
    let with = prepare::disturbances(&tracks, &tolerances);
    prepare::problem(tracks, &vehicle, &tolerances, &with)
}

/// The problem restricted to its first `count` recordings.
pub fn first(count: usize, mut problem: Problem) -> Problem {
    problem.tracks.truncate(count);
    problem.filters.truncate(count);
    problem.states.truncate(count);
    problem.coarsen();
    problem
}

/// A recording of the bundled vehicle at 100 Hz: the response of this car to the inputs (torque and position of each row, and whether it brakes), with white noise of `noise`
/// rad/s.
pub fn answered(
    car: &Car,
    inputs: &[[f64; 2]],
    noise: f64,
    brake: impl Fn(usize) -> bool,
    speeds: impl Fn(usize, [f64; 2]) -> [f64; 2],
) -> Recording {
    answered_at(100.0, car, inputs, noise, brake, speeds)
}

/// The same at another sample rate, Hz.
pub fn answered_at(
    rate: f64,
    car: &Car,
    inputs: &[[f64; 2]],
    noise: f64,
    brake: impl Fn(usize) -> bool,
    speeds: impl Fn(usize, [f64; 2]) -> [f64; 2],
) -> Recording {
    let n = inputs.len();
    let time: Vec<f64> = (0..n).map(|k| k as f64 / rate).collect();
    let mut r = Recording {
        name: "made up".into(),
        sample_rate_hz: rate,
        time,
        theta_c0: 40.0,
        theta_b0: 40.0,
        omega_f: vec![speeds(0, [0.0; 2])[0]; n],
        omega_c: vec![speeds(0, [0.0; 2])[1]; n],
        t_e: inputs.iter().map(|i| i[0]).collect(),
        x_to_cmd: inputs.iter().map(|i| i[1]).collect(),
        theta_h: vec![30.0; n],
        brake: (0..n).any(&brake).then(|| (0..n).map(&brake).collect()),
        ..Recording::default()
    };
    let mut normal = normals(17);
    for (row, [omega_f, omega_c, _]) in shown(&r, car).into_iter().enumerate() {
        let truth = speeds(row, [omega_f, omega_c]);
        (r.omega_f[row], r.omega_c[row]) = (truth[0] + noise * normal(), truth[1] + noise * normal());
    }
    r
}

/// Both speeds (rad/s) and the bearing position (mm) of each row: the response of this car to the inputs of a recording, from its initial speeds on.
pub fn shown(r: &Recording, car: &Car) -> Vec<[f64; 3]> {
    let track = Track::new(r);
    let begin = start(&track, car, 0, track.theta_0, 0.1);
    let mut shown = vec![[0.0; 3]; track.rows()];
    replay(&track, car, (&begin, 0.0), 0..track.rows(), None, |row, now, _, _| {
        shown[row] = [now.omega_f, now.omega_c, now.x_to_actual];
    });
    shown
}

pub fn prepared(recording: &Recording) -> Problem {
    let (_, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let (tracks, tolerances) = prepare::read(&[recording], &vehicle_json).unwrap();
    let with = prepare::disturbances(&tracks, &tolerances);
    prepare::problem(tracks, &vehicle, &tolerances, &with)
}

/// Mean square of the innovations of a car with these effects, from the time `begin` (s) on.
pub fn mean_square_from(problem: &Problem, effects: effects::Parameters, begin: f64) -> f64 {
    let point = kisspoint::gap::infer::density::Point { effects, ..problem.nominal() };
    let time = &problem.tracks[0].time;
    let first = time.iter().position(|t| *t >= begin).unwrap();
    let all = &problem.all_residuals(&point, None)[0][2 * first..2 * time.len()];
    all.iter().map(|r| r * r).sum::<f64>() / all.len() as f64
}
