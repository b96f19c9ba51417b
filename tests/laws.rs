//! The generator uses no law of the library: the library's best imitation of every drawn effect leaves a part of it.
//!
//! Both simulators are driven in the same way, with the effect and without it. The change of the bench channels due to the effect is fitted by the library's effect of the same
//! id, with all its parameters free, by least squares from all its start values. The unexplained share of the change would be zero if generator and library shared the law. For
//! laws that are shared on purpose (the tolerances), the test shows that it is.

use kisspoint::effects::{self, PARAMETERS, Parameters, REGISTRY};
use kisspoint::plant::{Inputs, Plant, Start};
use kisspoint::vehicle::Vehicle;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use realcar::catalogue::LIBRARY;
use realcar::effects::{Deviation, Dice};
use realcar::{Motion, car, vehicle};

/// Smallest share of an effect that the library must fail to imitate.
const LEAST_LEFT: f64 = 0.015;

/// Largest share of a shared law that differences of the simulators and of the fit may leave.
const MOST_LEFT_OF_SHARED: f64 = 0.002;

const DT: f64 = 0.01;

/// Time constant with which both simulators are pulled to the speeds of the healthy car, s, so that an error stays where it arises and lock-up does not drift away.
const MEMORY_S: f64 = 0.1;

/// Both speeds of the healthy car after each sample, for all runs.
type Path = Vec<[f64; 2]>;

/// One run: initial speeds, initial temperatures, length in s; torque in N·m and position as a share of the travel, over time.
struct Run {
    omega: [f64; 2],
    theta: [f64; 2],
    length_s: f64,
    torque: fn(f64) -> f64,
    xi: fn(f64) -> f64,
}

fn ramp(t: f64, from: f64, to: f64) -> f64 {
    ((t - from) / (to - from)).clamp(0.0, 1.0)
}

const RUNS: [Run; 5] = [
    // Cold and hot launches up to lock-up, with tip-in and tip-out.
    Run {
        omega: [140.0, 0.0],
        theta: [35.0, 32.0],
        length_s: 3.0,
        torque: |t| 20.0 + 25.0 * ramp(t, 0.1, 0.5) - 30.0 * ramp(t, 2.2, 2.4),
        xi: |t| -0.1 + 0.74 * ramp(t, 0.1, 0.7) + 0.06 * (5.0 * t).sin(),
    },
    Run {
        omega: [150.0, 0.0],
        theta: [100.0, 70.0],
        length_s: 3.0,
        torque: |t| 30.0 + 20.0 * ramp(t, 0.1, 0.4),
        xi: |t| 0.3 + 0.31 * ramp(t, 0.0, 1.2) - 0.03 * ramp(t, 1.3, 1.6),
    },
    // Locked, with tip-in and tip-out.
    Run {
        omega: [110.0, 110.0],
        theta: [60.0, 50.0],
        length_s: 2.5,
        torque: |t| 15.0 + 45.0 * ramp(t, 0.4, 0.45) - 65.0 * ramp(t, 1.3, 1.4) + 40.0 * ramp(t, 2.0, 2.05),
        xi: |_| 1.08,
    },
    // Open clutch.
    Run { omega: [120.0, 60.0], theta: [40.0, 38.0], length_s: 2.5, torque: |t| 25.0 - 33.0 * ramp(t, 1.2, 1.25), xi: |_| -0.2 },
    // A chirp of the position while the clutch slips.
    Run { omega: [170.0, 0.0], theta: [75.0, 55.0], length_s: 3.0, torque: |_| 40.0, xi: |t| 0.50 + 0.11 * (4.0 * t + 1.2 * t * t).sin() },
];

/// Weights of both speeds, position, torque and temperature: reciprocals of a bench's noise.
const WEIGHTS: [f64; 5] = [10.0, 10.0, 100.0, 2.0, 1.6];

/// The channels of all runs, weighted.
type Response = Vec<f64>;

fn share() -> f64 {
    1.0 - (-DT / MEMORY_S).exp()
}

fn generator(v: &vehicle::Vehicle, deviation: &Deviation, path: &Path) -> Response {
    let mut all = Vec::new();
    let mut path = path.iter();
    for run in &RUNS {
        let at = |t: f64| ((run.torque)(t), v_position(v.x_cnt, v.x_cls, (run.xi)(t)));
        let (torque, position) = at(0.0);
        let start = car::Start { omega: run.omega, theta: run.theta, air: 25.0, torque, position, length_s: run.length_s };
        let mut car = Motion::start(v, deviation, 5e-5, start, 0);
        for k in 0..(run.length_s / DT) as usize {
            let (torque, position) = at(k as f64 * DT);
            car.drive(DT, torque, position);
            let [f, c] = car.sensed(DT);
            if let Some([to_f, to_c]) = path.next() {
                car.push([share() * (to_f - f), share() * (to_c - c)]);
            }
            all.extend([f, c, car.x, car.t_fc, car.theta[0]].iter().zip(WEIGHTS).map(|(y, w)| y * w));
        }
    }
    all
}

fn v_position(x_cnt: f64, x_cls: f64, xi: f64) -> f64 {
    x_cnt + xi * (x_cls - x_cnt)
}

fn library(v: &Vehicle, parameters: &Parameters, path: &Path) -> Response {
    let mut all = Vec::new();
    let mut path = path.iter();
    for run in &RUNS {
        let at = |t: f64| {
            let x_to = v_position(v.actuator.x_cnt_0, v.actuator.x_cls_0, (run.xi)(t));
            Inputs { x_to, t_e_ref: (run.torque)(t), theta_h: 25.0, t_load: 0.0 }
        };
        let start = Start { omega_f: run.omega[0], omega_c: run.omega[1], theta_c: run.theta[0], theta_b: run.theta[1] };
        let mut plant = Plant::new(v, parameters, &start, &at(0.0));
        plant.set_max_substep(2.5e-3);
        for k in 0..(run.length_s / DT) as usize {
            plant.step(&at(k as f64 * DT), DT);
            let y = plant.outputs();
            if let Some([to_f, to_c]) = path.next() {
                plant.correct_speeds([share() * (to_f - y.omega_f), share() * (to_c - y.omega_c)], [0.0; 2], 0);
            }
            all.extend([y.omega_f, y.omega_c, y.x_to_actual, y.t_fc, y.theta_c].iter().zip(WEIGHTS).map(|(y, w)| y * w));
        }
    }
    all
}

fn minus(a: &Response, b: &Response) -> DVector<f64> {
    DVector::from_iterator(a.len(), a.iter().zip(b).map(|(a, b)| a - b))
}

/// Share of the change due to an effect that the library's effect of this id leaves at its best fit.
fn left(change: &DVector<f64>, id: &str, file: &Vehicle, path: &Path) -> f64 {
    let entry = &REGISTRY[effects::find(id).unwrap()];
    let null = library(file, &effects::null(), path);
    let of = |p: &Parameters| minus(&library(file, p, path), &null);
    let mut best = f64::INFINITY;
    let mut starts: Vec<Parameters> = Vec::new();
    for start in entry.effect.starts {
        for part in [0.5, 1.0] {
            let mut p = effects::null();
            for (k, value) in start.iter() {
                p[*k] = PARAMETERS[*k].null + part * (value - PARAMETERS[*k].null);
            }
            starts.push(p);
        }
    }
    // A fit finds an order only from nearby. The starts are the orders that are drawn, each with four phases.
    if let Some(order) = entry.parameters.clone().find(|&k| PARAMETERS[k].name == "order") {
        let turned: Vec<Parameters> = [0.5, 1.0, 2.0]
            .into_iter()
            .flat_map(|n| [[0.2, 0.0], [-0.2, 0.0], [0.0, 0.2], [0.0, -0.2]].map(|sides| (n, sides)))
            .map(|(n, sides)| {
                let mut p = effects::null();
                entry.effect.amplitudes.iter().zip(sides).for_each(|(&k, value)| p[k] = value);
                p[order] = n;
                p
            })
            .collect();
        starts.extend(turned);
    }
    for p in starts {
        best = best.min(fit(change, entry, p, of));
    }
    (best / change.norm_squared()).sqrt()
}

/// Levenberg–Marquardt fit from one start; returns the remaining sum of squares.
fn fit(change: &DVector<f64>, entry: &effects::Entry, mut p: Parameters, of: impl Fn(&Parameters) -> DVector<f64>) -> f64 {
    let free: Vec<usize> = entry.parameters.clone().collect();
    let bound = |k: usize, value: f64| value.clamp(PARAMETERS[k].min, PARAMETERS[k].max);
    let mut error = change - of(&p);
    let mut damping = 1e-2;
    for _ in 0..14 {
        let mut jacobian = DMatrix::zeros(change.len(), free.len());
        let base = change - &error;
        for (j, &k) in free.iter().enumerate() {
            let mut q = p;
            let step = 0.02 * entry.scale(k);
            q[k] = bound(k, p[k] + step);
            if q[k] == p[k] {
                q[k] = bound(k, p[k] - step);
            }
            let by = (q[k] - p[k]) / entry.scale(k);
            if by != 0.0 {
                jacobian.set_column(j, &((of(&q) - &base) / by));
            }
        }
        let (normal, right) = (jacobian.transpose() * &jacobian, jacobian.transpose() * &error);
        let mut improved = false;
        for _ in 0..6 {
            let mut damped = normal.clone();
            (0..free.len()).for_each(|j| damped[(j, j)] += damping * normal[(j, j)] + 1e-12);
            let Some(step) = damped.lu().solve(&right) else { break };
            let mut q = p;
            free.iter().enumerate().for_each(|(j, &k)| q[k] = bound(k, p[k] + step[j] * entry.scale(k)));
            let next = change - of(&q);
            if next.norm_squared() < error.norm_squared() {
                improved = next.norm_squared() < 0.999 * error.norm_squared();
                (p, error, damping) = (q, next, damping * 0.3);
                break;
            }
            damping *= 5.0;
        }
        if !improved {
            break;
        }
    }
    error.norm_squared()
}

/// The healthy car's path, and its response when it is pulled along that path.
fn healthy(own: &vehicle::Vehicle) -> (Path, Response) {
    let free = generator(own, &Deviation::default(), &Path::new());
    let path: Path = free.chunks(5).map(|y| [y[0] / WEIGHTS[0], y[1] / WEIGHTS[1]]).collect();
    let pulled = generator(own, &Deviation::default(), &path);
    (path, pulled)
}

#[test]
fn no_drawn_effect_is_the_library_s() {
    let own = vehicle::Vehicle::reference();
    let file = Vehicle::from_value(&own.to_json(None)).unwrap();
    let (path, healthy) = healthy(&own);
    let of = |(id, seed): (&str, u64)| {
        let mut deviation = Deviation::default();
        let shape = deviation.set(id, &mut Dice::new(40 + seed, 1.0));
        let change = minus(&generator(&own, &deviation, &path), &healthy);
        let left = left(&change, id, &file, &path);
        println!("{id:<28} {:5.1} % of {:8.1} left; {shape}", 100.0 * left, change.norm() / (change.len() as f64).sqrt());
        (left < LEAST_LEFT).then(|| format!("{id}: {:.1} % ({shape})", 100.0 * left))
    };
    let all: Vec<(&str, u64)> = LIBRARY.iter().flat_map(|(id, _)| [(*id, 0), (*id, 1)]).collect();
    let shared: Vec<String> = all.into_par_iter().filter_map(of).collect();
    assert!(shared.is_empty(), "generator and library share a law, or nearly: {shared:?}");
}

#[test]
fn a_shared_law_would_be_found() {
    let own = vehicle::Vehicle::reference();
    let file = Vehicle::from_value(&own.to_json(None)).unwrap();
    let (path, healthy) = healthy(&own);
    let gain = vehicle::Vehicle { engine_gain: 1.1, ..own.clone() };
    let level = vehicle::Vehicle { mu_factor: 0.88, ..own.clone() };
    for (id, real) in [("engine_torque_gain", gain), ("friction_level", level)] {
        let change = minus(&generator(&real, &Deviation::default(), &path), &healthy);
        let left = left(&change, id, &file, &path);
        println!("{id}: {:.2} % of a shared law left", 100.0 * left);
        assert!(left < MOST_LEFT_OF_SHARED, "{id}: {left:.4} is left of a law that is the same");
    }
}
