//! What may be wrong in a part of the clutch: mechanisms, each a small family of functions of torque, position, slip, temperature and time.

use super::predict::{Follow, HORIZON_S, predict};
use super::problem::{Point, Problem};
use crate::effects::Subsystem;
use crate::physics::friction;
use crate::plant::{clutch, config::Config, motion};

/// Signals of one recording that mechanisms are made from, sample by sample.
pub struct Signals {
    config: Config,
    /// Sampling interval, s.
    pub dt: f64,
    /// Positions at which the clutch slips, mm.
    range: [f64; 2],
    position: Vec<f64>,
    capacity: Vec<f64>,
    slip: Vec<f64>,
    theta: Vec<f64>,
    /// ∂ln μ/∂θ, 1/K.
    sensitivity: Vec<f64>,
}

impl Signals {
    /// Torque in N·m that sample `j` would have at bearing position `x` mm.
    fn capacity_at(&self, j: usize, x: f64) -> f64 {
        let mut y = [0.0; motion::N];
        y[motion::index::THETA_C] = self.theta[j];
        clutch::capacity(&self.config, x, clutch::Branch { x, z: 0.0 }, self.slip[j], &y)
    }
}

/// Signals of recording `k` as a car at `point` would have made them.
pub fn signals(problem: &Problem, point: &Point, k: usize) -> Signals {
    let series = &problem.series[k];
    let (vehicle, effects) = problem.plant_at(point);
    let config = Config::new(&vehicle, &effects);
    let replay = predict(series, &vehicle, &effects, point.theta_shift[k], Follow::Horizon(HORIZON_S));
    let n = series.len();
    let slip: Vec<f64> = (0..n).map(|j| (series.measured[0][j] - series.measured[1][j]).max(0.0)).collect();
    let theta = replay.value[4].clone();
    let mu = |j: usize, d: f64| friction::friction_coefficient(&vehicle.friction, slip[j], theta[j] + d);
    let sensitivity = (0..n).map(|j| (mu(j, 1.0) / mu(j, -1.0)).ln() / 2.0).collect();
    let a = &vehicle.actuator;
    let at = |share: f64| a.x_cnt_0 + share * (a.x_cls_0 - a.x_cnt_0);
    let range = [at(0.2), at(0.85)];
    let mut signals =
        Signals { config, dt: series.dt, range, position: replay.value[2].clone(), capacity: Vec::new(), slip, theta, sensitivity };
    signals.capacity = (0..n).map(|j| signals.capacity_at(j, signals.position[j])).collect();
    signals
}

/// What follows `v` with a time constant in s.
fn lagged(v: &[f64], dt: f64, tau: f64) -> Vec<f64> {
    let share = 1.0 - (-dt / tau).exp();
    let mut y = v[0];
    v.iter()
        .map(|&x| {
            y += share * (x - y);
            y
        })
        .collect()
}

/// What follows `v` through play of this width.
fn played(v: &[f64], width: f64) -> Vec<f64> {
    let mut y = v[0];
    v.iter()
        .map(|&x| {
            y = y.clamp(x - 0.5 * width, x + 0.5 * width);
            y
        })
        .collect()
}

/// What follows `v` in jumps while it is held, once it is further away than this.
fn stuck(v: &[f64], held: impl Fn(usize) -> bool, reach: f64) -> Vec<f64> {
    let mut y = v[0];
    v.iter()
        .enumerate()
        .map(|(j, &x)| {
            if (x - y).abs() > reach || !held(j) {
                y = x
            }
            y
        })
        .collect()
}

/// Direction of `v`, −1 to 1, turned over a stroke.
fn direction(v: &[f64], stroke: f64) -> Vec<f64> {
    let (mut z, mut last) = (0.0, v[0]);
    v.iter()
        .map(|&x| {
            let towards = (x - last).signum();
            if x != last {
                z = towards + (z - towards) * (-2.0 * (x - last).abs() / stroke).exp();
            }
            last = x;
            z
        })
        .collect()
}

/// Integral of `rate` over time while `on`, from zero whenever it is off if `anew`.
fn integral(rate: &[f64], on: &[bool], dt: f64, anew: bool) -> Vec<f64> {
    let mut sum = 0.0;
    rate.iter()
        .zip(on)
        .map(|(r, on)| {
            if *on {
                sum += r * dt
            } else if anew {
                sum = 0.0
            }
            sum
        })
        .collect()
}

/// Torque in N·m above which the faces count as pressed.
const PRESSED_NM: f64 = 0.5;
/// Size of a relative change of torque that is worth speaking of.
const SHARE: f64 = 0.3;
/// Usual temperatures and powers, K and W.
const WARM_K: f64 = 30.0;
const POWER_W: f64 = 3000.0;

/// Something that may be wrong in a part.
pub struct Mechanism {
    /// Functions, each the δT in N·m for a coefficient of one, sample by sample.
    pub functions: Vec<Vec<f64>>,
    /// Whether physics allows the last function's coefficient one sign only, the positive one: nothing leads its command, and what is damp dries.
    pub one_way: bool,
}

impl Mechanism {
    fn either_way(functions: Vec<Vec<f64>>) -> Self {
        Self { functions, one_way: false }
    }

    fn one_way(functions: Vec<Vec<f64>>) -> Self {
        Self { functions, one_way: true }
    }
}

/// The mechanisms of a part in one recording.
pub fn mechanisms(part: Subsystem, s: &Signals) -> Vec<Mechanism> {
    let times = |a: &[f64], f: &dyn Fn(usize) -> f64| -> Vec<f64> { a.iter().enumerate().map(|(j, a)| a * f(j)).collect() };
    let relative = |f: &dyn Fn(usize) -> f64| times(&s.capacity, &|j| SHARE * f(j));
    // A shape beside another level of the torque.
    let shape = |f: &dyn Fn(usize) -> f64| vec![relative(&|_| 1.0), relative(f)];
    let over = |hats: Vec<Vec<f64>>| Mechanism::either_way(hats.iter().map(|h| relative(&|j| h[j])).collect());
    let pressed: Vec<bool> = s.capacity.iter().map(|t| *t > PRESSED_NM).collect();
    let ones = vec![1.0; s.capacity.len()];
    let since_contact = integral(&ones, &pressed, s.dt, true);
    let contact: Vec<f64> = pressed.iter().map(|p| f64::from(u8::from(*p))).collect();
    let power: Vec<f64> = s.capacity.iter().zip(&s.slip).map(|(t, w)| t * w).collect();
    let warm = Mechanism::either_way(shape(&|j| (s.theta[j] - 25.0) / 80.0));
    match part {
        Subsystem::Actuator => {
            let moved = |y: &dyn Fn(usize) -> f64| {
                let torque = (0..s.position.len()).map(|j| s.capacity_at(j, y(j)) - s.capacity[j]).collect();
                Mechanism::one_way(vec![torque])
            };
            let behind = |y: Vec<f64>| moved(&|j| y[j]);
            let lags = [0.03, 0.1, 0.3, 1.0].map(|tau| behind(lagged(&s.position, s.dt, tau)));
            let plays = [0.1, 0.2, 0.4].map(|w| behind(played(&s.position, w)));
            let stiction = [0.1, 0.15, 0.2].map(|w| behind(stuck(&s.position, |_| true, w)));
            let under_load = [0.1, 0.15, 0.2].map(|w| behind(stuck(&s.position, |j| pressed[j], w)));
            let pressed_time = integral(&ones, &pressed, s.dt, false);
            let leak_for_good = moved(&|j| s.position[j] - 0.1 * pressed_time[j]);
            let leaks = [0.7, 1.2, 2.0, 4.0].into_iter().flat_map(|tau: f64| {
                let refilled = lagged(&contact, s.dt, tau);
                [0.07, 0.15].map(|depth| {
                    let at_once = moved(&|j| s.position[j] - depth * (1.0 - (-since_contact[j] / tau).exp()));
                    [at_once, moved(&|j| s.position[j] - depth * contact[j] * refilled[j])]
                })
            });
            let leaks = leaks.flatten().chain([leak_for_good]);
            lags.into_iter().chain(plays).chain(stiction).chain(under_load).chain(leaks).collect()
        }
        Subsystem::ClutchForce => {
            let places = [6, 10].map(|count| over(hats(&s.position, &s.range, count)));
            let turned = [0.1, 0.4].map(|stroke| {
                let z = direction(&s.position, stroke);
                Mechanism::either_way(shape(&|j| z[j]))
            });
            let settling = [0.3, 0.5, 0.8, 1.3, 2.0].into_iter().flat_map(|tau: f64| {
                let settled = lagged(&contact, s.dt, tau);
                [shape(&|j| (-since_contact[j] / tau).exp()), shape(&|j| settled[j])].map(Mechanism::either_way)
            });
            places.into_iter().chain(turned).chain(settling).chain([warm]).collect()
        }
        Subsystem::Friction => {
            let speeds = over(hats(&s.slip, &[0.0, 120.0], 5));
            let slipping: Vec<bool> = s.slip.iter().zip(&pressed).map(|(w, p)| *p && *w > 1.0).collect();
            let (work, time) = (integral(&power, &slipping, s.dt, false), integral(&ones, &slipping, s.dt, false));
            let worn = [700.0, 1500.0, 3000.0, 6000.0].map(|w: f64| Mechanism::either_way(shape(&|j| (-work[j] / w).exp())));
            let dried = [0.25, 0.4, 0.7, 1.2].map(|tau: f64| Mechanism::one_way(shape(&|j| -(-time[j] / tau).exp())));
            let pressure = Mechanism::either_way(vec![relative(&|_| 1.0), times(&s.capacity, &|j| s.capacity[j] / 60.0)]);
            [speeds, pressure, warm].into_iter().chain(worn).chain(dried).collect()
        }
        _ => {
            let of_power = |tau: f64| lagged(&power, s.dt, tau);
            let flash = [0.02, 0.15, 0.4].map(|tau| {
                let p = of_power(tau);
                Mechanism::one_way(vec![times(&s.capacity, &|j| p[j] / POWER_W * WARM_K * s.sensitivity[j])])
            });
            let burn = [0.02, 0.15].map(|tau| {
                let p = of_power(tau);
                Mechanism::either_way(vec![times(&s.capacity, &|j| 0.5 * SHARE * p[j] / POWER_W)])
            });
            let soak = [0.7, 3.0].map(|tau| {
                let l = lagged(&s.theta, s.dt, tau);
                Mechanism::either_way(vec![times(&s.capacity, &|j| (l[j] - s.theta[j]) * s.sensitivity[j])])
            });
            flash.into_iter().chain(burn).chain(soak).collect()
        }
    }
}

/// Piecewise linear functions that sum to one over a range.
fn hats(v: &[f64], [low, high]: &[f64; 2], count: usize) -> Vec<Vec<f64>> {
    let spacing = (high - low) / (count - 1) as f64;
    let hat = |k: usize| v.iter().map(|x| (1.0 - ((x.clamp(*low, *high) - low) / spacing - k as f64).abs()).max(0.0)).collect();
    (0..count).map(hat).collect()
}
