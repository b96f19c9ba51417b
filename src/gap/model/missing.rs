//! Missing laws, which no effect of the library describes: for each subsystem one smooth error, as a function of the variables on which that subsystem's law can depend.
//!
//! Each error is a sum of functions with normal amplitudes (a Gaussian process of low rank). Their length scales are physical: a friction coefficient changes over some ten rad/s
//! of slip or some ten kelvin, a spring over a part of its travel, an actuator over its own time constants. The amplitudes have the size of a noteworthy fault.
//!
//! | subsystem | error | as a function of | size |
//! |---|---|---|---|
//! | engine | torque | speed, requested torque, its change | 4 N·m |
//! | actuator | position, times ∂T/∂x | commanded position now and before, its direction, time under pressure | 0.05 mm |
//! | clutch force | torque, relative | position, its direction, time since slip began, temperature | 8 % |
//! | friction | torque, relative | slip, temperature, power, work done, time slipped | 8 % |
//! | thermal | temperature, times ∂T/∂θ | heat of the last second, seconds, minutes | 12 K |
//! | driveline | torque | nothing (a constant), speed, its direction, acceleration, time since the start | 3 N·m |
//! | sensors | speeds as sensed | speed, acceleration | 1 rad/s |

use super::filter::Filter;
use super::replay::{self, Missing};
use super::tolerance::Car;
use super::track::Track;
use crate::effects::Subsystem;
use crate::physics::friction::friction_coefficient;
use crate::plant::clutch;
use crate::plant::config::Config;
use crate::plant::motion;

/// Signals along a corrected replay, row by row.
struct Signals {
    dt: f64,
    time: Vec<f64>,
    torque: Vec<f64>,
    slipping: Vec<bool>,
    slip: Vec<f64>,
    position: Vec<f64>,
    command: Vec<f64>,
    report: Vec<f64>,
    theta: Vec<f64>,
    speed: [Vec<f64>; 2],
    acceleration: [Vec<f64>; 2],
    /// ∂T/∂x, N·m/mm.
    stiffness: Vec<f64>,
    /// ∂T/∂θ, N·m/K.
    warmth: Vec<f64>,
    travel: [f64; 2],
}

fn signals(track: &Track, filter: &Filter, car: &Car, theta: [f64; 2]) -> Signals {
    let n = track.rows();
    let mut s = Signals {
        dt: track.interval(),
        time: track.time.clone(),
        torque: vec![0.0; n],
        slipping: vec![false; n],
        slip: vec![0.0; n],
        position: vec![0.0; n],
        command: track.tick_of_row[..n].iter().map(|&k| track.ticks[k].x_to).collect(),
        report: track.tick_of_row[..n].iter().map(|&k| track.ticks[k].t_e).collect(),
        theta: vec![0.0; n],
        speed: [vec![0.0; n], vec![0.0; n]],
        acceleration: [Vec::new(), Vec::new()],
        stiffness: vec![0.0; n],
        warmth: vec![0.0; n],
        travel: [car.vehicle.actuator.x_cnt_0, car.vehicle.actuator.x_cls_0],
    };
    // Predicted, not measured speeds: a measured speed would bring its own noise into the prediction of itself.
    replay::corrected(track, filter, car, theta, None, |row, now, plant| {
        s.speed[0][row] = now.omega_f;
        s.speed[1][row] = now.omega_c;
        // Slip of the plant, not of its sensors, one of which may be late or off by a factor.
        s.slip[row] = plant.slip();
        s.position[row] = now.x_to_actual;
        s.theta[row] = now.theta_c;
        s.slipping[row] = now.phase == crate::plant::Phase::Slipping;
        s.torque[row] = if s.slipping[row] { now.t_fc } else { 0.0 };
    });
    let config = Config::new(&car.vehicle, &car.effects);
    for row in 0..n {
        let mut y = [0.0; motion::N];
        y[motion::index::THETA_C] = s.theta[row];
        let capacity = |x: f64| clutch::capacity(&config, x, clutch::Branch { x, z: 0.0 }, s.slip[row].abs(), &y);
        if s.slipping[row] {
            let sign = s.slip[row].signum();
            s.stiffness[row] = sign * (capacity(s.position[row] + 0.02) - capacity(s.position[row] - 0.02)) / 0.04;
            let mu = |d: f64| friction_coefficient(&car.vehicle.friction, s.slip[row].abs(), s.theta[row] + d);
            s.warmth[row] = s.torque[row] * (mu(1.0) / mu(-1.0)).ln() / 2.0;
        }
    }
    let reach = ((0.03 / s.dt).round() as usize).max(1);
    for side in 0..2 {
        let v = &s.speed[side];
        s.acceleration[side] = (0..n)
            .map(|k| {
                // Backward difference, for the same reason: later predictions have been corrected by the measurement at this row.
                let a = k.saturating_sub(2 * reach);
                (v[k] - v[a]) / (s.time[k] - s.time[a]).max(1e-3)
            })
            .collect();
    }
    s
}

/// `v` after a first-order lag with the time constant `tau`, s.
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

/// Mean over a fifth of a second around each row.
fn averaged(v: &[f64], dt: f64) -> Vec<f64> {
    let reach = (0.1 / dt).round() as usize;
    let mut sums = vec![0.0];
    v.iter().for_each(|x| sums.push(sums[sums.len() - 1] + x));
    let mean = |k: usize| {
        let (a, b) = (k.saturating_sub(reach), (k + reach + 1).min(v.len()));
        (sums[b] - sums[a]) / (b - a) as f64
    };
    (0..v.len()).map(mean).collect()
}

/// `v` after play (backlash) of this width.
fn played(v: &[f64], width: f64) -> Vec<f64> {
    let mut y = v[0];
    v.iter()
        .map(|&x| {
            y = y.clamp(x - 0.5 * width, x + 0.5 * width);
            y
        })
        .collect()
}

/// Gaussian bump of unit height around `centre`.
fn bump(x: f64, centre: f64, length: f64) -> f64 {
    (-0.5 * ((x - centre) / length).powi(2)).exp()
}

/// Indices of the [`states`].
pub mod state {
    /// Slip, rad/s.
    pub const SLIP: usize = 0;
    /// Temperature of the disc, °C.
    pub const THETA: usize = 1;
    /// Position of the bearing, mm.
    pub const POSITION: usize = 2;
    /// Direction in which it moves, from −1 to 1.
    pub const DIRECTION: usize = 3;
    /// Speed of the flywheel, rad/s.
    pub const OMEGA_F: usize = 4;
    /// Speed of the disc, rad/s.
    pub const OMEGA_C: usize = 5;
    /// Requested torque, as reported, N·m.
    pub const REPORT: usize = 6;
    /// Time, s.
    pub const TIME: usize = 7;
    /// Not a state along a replay, but what an effect itself does: the effect's form may depend on its size and sign.
    pub const ITSELF: usize = 8;
    /// Indices of all states along a replay.
    pub const ALL: [usize; 8] = [0, 1, 2, 3, 4, 5, 6, 7];
}

/// States along a corrected replay that a law may depend on, by observation: slip, disc temperature, position and its direction, both speeds, requested torque, time ([`state`]).
pub fn states(track: &Track, filter: &Filter, car: &Car, theta: [f64; 2]) -> Vec<Vec<f64>> {
    let s = signals(track, filter, car, theta);
    let direction = direction(&s);
    let last: Vec<usize> = (0..track.observations()).map(|k| track.rows_of(k).end - 1).collect();
    let all = [&s.slip, &s.theta, &s.position, &direction, &s.speed[0], &s.speed[1], &s.report, &s.time];
    all.map(|v| last.iter().map(|&row| v[row]).collect()).to_vec()
}

/// Direction in which the bearing moves, from −1 to 1.
fn direction(s: &Signals) -> Vec<f64> {
    let slow = lagged(&s.position, s.dt, 0.05);
    s.position.iter().zip(&slow).map(|(x, slow)| ((x - slow) / 0.02).tanh()).collect()
}

/// Disc speed in rad/s below which a car hardly moves.
const STANDING: f64 = 0.5;

/// Direction in which a car moves at a disc speed in rad/s, from −1 to 1.
pub fn way(speed: f64) -> f64 {
    (speed / STANDING).tanh()
}

/// Sizes of a noteworthy fault: torque of engine and of car in N·m, bearing position in mm, share of the clutch torque, disc temperature in K.
const ENGINE: f64 = 4.0;
const CAR: f64 = 3.0;
const BEARING: f64 = 0.05;
const CLUTCH: f64 = 0.08;
const DISC: f64 = 12.0;

impl Signals {
    /// Law of a clutch torque `f`, N·m, by row; zero where the clutch does not slip.
    fn clutch(&self, f: &dyn Fn(usize) -> f64) -> Missing {
        Missing::of_clutch((0..self.slipping.len()).map(|k| if self.slipping[k] { f(k) } else { 0.0 }).collect())
    }
    /// Law of a bearing displaced by `f`, mm: it changes the clutch torque, and the position sensor shows it as well.
    fn moved(&self, f: &dyn Fn(usize) -> f64) -> Missing {
        let mut m = self.clutch(&|k| self.stiffness[k] * f(k));
        m.bench[0] = self.by_row(f);
        m
    }
    /// Law of a disc warmer by `f`, K: it changes the clutch torque, and the temperature sensor shows it as well.
    fn warmed(&self, f: &dyn Fn(usize) -> f64) -> Missing {
        let mut m = self.clutch(&|k| self.warmth[k] * f(k));
        m.bench[1] = self.by_row(f);
        m
    }
    /// Law of a torque `f` on one side (0 flywheel, 1 disc), N·m.
    fn on(&self, side: usize, f: &dyn Fn(usize) -> f64) -> Missing {
        let mut m = Missing::default();
        m.torque[side] = self.by_row(f);
        m
    }
    /// Law of a torque on the car in units of a noteworthy fault ([`CAR`]), which vanishes where the car stands: what holds a standing car would also hold it against more torque.
    fn on_moving_car(&self, f: &dyn Fn(usize) -> f64) -> Missing {
        let way = self.way();
        self.on(1, &|k| CAR * way[k].abs() * f(k))
    }
    /// Direction in which the car moves, from −1 to 1.
    fn way(&self) -> Vec<f64> {
        self.speed[1].iter().map(|speed| way(*speed)).collect()
    }
    /// Law of an error `f` of one speed as sensed, rad/s.
    fn sensed(&self, side: usize, f: &dyn Fn(usize) -> f64) -> Missing {
        let mut m = Missing::default();
        m.sensed[side] = self.by_row(f);
        m
    }
    fn by_row(&self, f: &dyn Fn(usize) -> f64) -> Vec<f64> {
        (0..self.slipping.len()).map(f).collect()
    }
}

/// Functions of time alone, for errors that follow no state: triangular bumps of the size of a noteworthy fault, `width` seconds apart. Clutch force, thermal and sensors have
/// none, because no error there comes and goes by itself.
pub fn bumps(
    place: Subsystem,
    width: f64,
    track: &Track,
    filter: &Filter,
    car: &Car,
    theta: [f64; 2],
) -> impl Iterator<Item = Missing> + use<> {
    let none = matches!(place, Subsystem::ClutchForce | Subsystem::Thermal | Subsystem::Sensors);
    let count = if none { 0 } else { (track.duration() / width).ceil() as usize + 1 };
    let s = signals(track, filter, car, theta);
    let one = move |bump: usize| {
        let bump = |k: usize| (1.0 - ((s.time[k] - s.time[0]) / width - bump as f64).abs()).max(0.0);
        match place {
            Subsystem::Engine => s.on(0, &|k| ENGINE * bump(k)),
            Subsystem::Actuator => s.moved(&|k| BEARING * bump(k)),
            Subsystem::Driveline => s.on_moving_car(&|k| bump(k)),
            _ => s.clutch(&|k| CLUTCH * s.torque[k] * bump(k)),
        }
    };
    (0..count).map(one)
}

/// The functions of a subsystem's missing law, row by row, each scaled to one standard deviation of its amplitude.
pub fn functions(place: Subsystem, track: &Track, filter: &Filter, car: &Car, theta: [f64; 2]) -> Vec<Missing> {
    let s = signals(track, filter, car, theta);
    let n = track.rows();
    // Time since slip began; work done and time slipped since the recording began.
    let (mut since, mut work, mut slipped, mut done) = (vec![0.0; n], vec![0.0; n], vec![0.0; n], 0.0);
    for k in 1..n {
        since[k] = if s.slipping[k] { since[k - 1] + s.dt } else { 0.0 };
        done += (s.torque[k] * s.slip[k]).max(0.0) * s.dt;
        work[k] = done;
        slipped[k] = slipped[k - 1] + if s.slipping[k] { s.dt } else { 0.0 };
    }
    let power: Vec<f64> = (0..n).map(|k| (s.torque[k] * s.slip[k]).max(0.0)).collect();
    let share = |k: usize| (s.position[k] - s.travel[0]) / (s.travel[1] - s.travel[0]);
    let direction = direction(&s);
    let mut all: Vec<Missing> = Vec::new();
    match place {
        Subsystem::Engine => {
            for centre in [70.0, 130.0, 200.0, 280.0] {
                all.push(s.on(0, &|k| ENGINE * bump(s.speed[0][k], centre, 45.0)));
            }
            for centre in [-20.0, 20.0, 60.0, 110.0] {
                all.push(s.on(0, &|k| ENGINE * bump(s.report[k], centre, 25.0)));
            }
            for tau in [0.05, 0.2, 0.8] {
                let slow = lagged(&s.report, s.dt, tau);
                // Rising and falling torque have separate functions: an engine may be slow to build up torque and quick to drop it.
                all.push(s.on(0, &|k| 0.3 * (slow[k] - s.report[k]).min(0.0)));
                all.push(s.on(0, &|k| 0.3 * (slow[k] - s.report[k]).max(0.0)));
            }
        }
        Subsystem::Actuator => {
            for tau in [0.04, 0.15, 0.6] {
                let slow = lagged(&s.command, s.dt, tau);
                all.push(s.moved(&|k| (slow[k] - s.command[k]).clamp(-1.0, 1.0) * 0.3));
            }
            for width in [0.05, 0.2] {
                let follows = played(&s.command, width);
                all.push(s.moved(&|k| follows[k] - s.command[k]));
            }
            all.push(s.moved(&|k| BEARING * direction[k]));
            for tau in [0.3, 1.5] {
                all.push(s.moved(&|k| BEARING * (1.0 - (-since[k] / tau).exp())));
            }
            for tau in [3.0, 20.0] {
                let pressed = lagged(&(0..n).map(|k| share(k).clamp(0.0, 1.0)).collect::<Vec<_>>(), s.dt, tau);
                all.push(s.moved(&|k| BEARING * 2.0 * pressed[k]));
            }
        }
        Subsystem::ClutchForce => {
            for centre in [0.25, 0.4, 0.55, 0.7, 0.9] {
                all.push(s.clutch(&|k| CLUTCH * s.torque[k] * bump(share(k), centre, 0.12)));
            }
            for centre in [0.35, 0.65] {
                all.push(s.clutch(&|k| CLUTCH * s.torque[k] * direction[k] * bump(share(k), centre, 0.2)));
            }
            for tau in [0.2, 1.0] {
                all.push(s.clutch(&|k| CLUTCH * s.torque[k] * (-since[k] / tau).exp()));
            }
            for centre in [40.0, 110.0, 180.0] {
                all.push(s.clutch(&|k| CLUTCH * s.torque[k] * bump(s.theta[k], centre, 40.0)));
            }
        }
        Subsystem::Friction => {
            for (centre, length) in [(0.0, 6.0), (12.0, 10.0), (35.0, 18.0), (70.0, 28.0), (130.0, 45.0)] {
                all.push(s.clutch(&|k| CLUTCH * s.torque[k] * bump(s.slip[k].abs(), centre, length)));
            }
            for centre in [30.0, 80.0, 130.0, 190.0] {
                all.push(s.clutch(&|k| CLUTCH * s.torque[k] * bump(s.theta[k], centre, 28.0)));
            }
            for scale in [2e3, 6e3] {
                all.push(s.clutch(&|k| CLUTCH * s.torque[k] * (power[k] / scale).tanh()));
            }
            for joules in [2e3, 1e4, 5e4] {
                all.push(s.clutch(&|k| CLUTCH * s.torque[k] * (-work[k] / joules).exp()));
            }
            for seconds in [0.5, 3.0] {
                all.push(s.clutch(&|k| CLUTCH * s.torque[k] * (-slipped[k] / seconds).exp()));
            }
        }
        Subsystem::Thermal => {
            for tau in [0.3, 1.5, 8.0, 40.0] {
                // A part that is heated by the mean power of the last τ, relative to 3 kW, or to less if τ exceeds 1.5 s (at least 300 W).
                let heat = lagged(&power, s.dt, tau);
                let most = 3e3 * (1.0_f64).min(1.5 / tau).max(0.1);
                all.push(s.warmed(&|k| DISC * heat[k] / most));
            }
            let start = s.theta[0];
            all.push(s.warmed(&|k| DISC * (s.theta[k] - start) / 60.0));
            all.push(s.warmed(&|_| DISC));
            for tau in [0.3, 1.5] {
                let heat = lagged(&power, s.dt, tau);
                all.push(s.clutch(&|k| CLUTCH * s.torque[k] * heat[k] / 3e3));
            }
        }
        Subsystem::Driveline => {
            all.push(s.on(1, &|_| CAR));
            for centre in [8.0, 50.0, 110.0, 180.0, 260.0] {
                all.push(s.on_moving_car(&|k| bump(s.speed[1][k], centre, if centre < 20.0 { 15.0 } else { 40.0 })));
            }
            all.push(Missing { rolling: CAR, way: s.way(), ..Missing::default() });
            all.push(s.on(1, &|k| 0.1 * car.vehicle.driveline.J_c * s.acceleration[1][k]));
            for tau in [0.05, 0.3] {
                let slow = lagged(&s.acceleration[1], s.dt, tau);
                all.push(s.on(1, &|k| 0.1 * car.vehicle.driveline.J_c * (s.acceleration[1][k] - slow[k])));
            }
            for tau in [0.5, 2.0, 8.0] {
                all.push(s.on_moving_car(&|k| (-s.time[k] / tau).exp()));
            }
        }
        Subsystem::Sensors => {
            // Functions of averaged speeds: a speed that a sample has just corrected would act like another gain of the filter.
            for side in 0..2 {
                let speed = averaged(&s.speed[side], s.dt);
                let acceleration = averaged(&s.acceleration[side], s.dt);
                all.push(s.sensed(side, &|k| 0.01 * speed[k]));
                all.push(s.sensed(side, &|k| -0.008 * acceleration[k]));
                // The signal of a pickup grows with speed, so an error near standstill vanishes within some rad/s.
                for (centre, length) in [(0.0, 5.0), (12.0, 8.0), (60.0, 45.0), (130.0, 45.0), (220.0, 45.0)] {
                    all.push(s.sensed(side, &|k| bump(speed[k], centre, length)));
                }
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_follows_a_signal_follows_it_as_it_is_called() {
        let step: Vec<f64> = (0..200).map(|k| f64::from(u8::from(k > 0))).collect();
        let slow = lagged(&step, 0.01, 0.5);
        for k in [0, 1, 50, 199] {
            assert!((slow[k] - (1.0 - (-0.02 * k as f64).exp())).abs() < 1e-12, "{k}: {}", slow[k]);
        }
        let line: Vec<f64> = (0..50).map(f64::from).collect();
        let mean = averaged(&line, 0.02);
        // Five samples to either side, fewer at the ends.
        assert_eq!((mean[0], mean[3], mean[25], mean[49]), (2.5, 4.0, 25.0, 46.5));
        assert_eq!(played(&[0.0, 1.0, 3.0, 2.5, 1.0], 2.0), [0.0, 0.0, 2.0, 2.0, 2.0]);
        assert_eq!(played(&[0.0, 3.0, -3.0], 2.0), [0.0, 2.0, -2.0]);
        assert!((bump(3.0, 1.0, 2.0) - (-0.5_f64).exp()).abs() < 1e-12 && bump(1.0, 1.0, 2.0) == 1.0);
    }

    /// Neighbouring bumps add up to 1 at any time, and each bump vanishes half a second from its centre.
    #[test]
    fn bumps_share_out_the_time() {
        let example = crate::gap::model::prepare::Example::read();
        let (problem, _) = example.problem(&[&example.campaign.recordings[0]]);
        let (track, car) = (&problem.tracks[0], Car::nominal(&example.vehicle));
        let of = |place| bumps(place, 0.5, track, &problem.filters[0], &car, track.theta_0).collect::<Vec<_>>();
        let all = of(Subsystem::Engine);
        assert_eq!(all.len(), (track.duration() / 0.5).ceil() as usize + 1);
        for row in 0..track.rows() {
            assert!((all.iter().map(|b| b.torque[0][row]).sum::<f64>() - ENGINE).abs() < 1e-9);
            let third = all[3].torque[0][row];
            let away = (track.time[row] - track.time[0] - 1.5).abs();
            assert!((third - ENGINE * (1.0 - away / 0.5).max(0.0)).abs() < 1e-9, "{row}: {third}");
        }
        assert_eq!([Subsystem::ClutchForce, Subsystem::Thermal, Subsystem::Sensors].map(|place| of(place).len()), [0; 3]);
    }

    /// Five rows of which the clutch slips in the middle three.
    fn along() -> Signals {
        let rows = |v: [f64; 5]| v.to_vec();
        Signals {
            dt: 0.1,
            time: rows([1.0, 1.1, 1.2, 1.3, 1.4]),
            torque: rows([0.0, 10.0, 20.0, 30.0, 0.0]),
            slipping: vec![false, true, true, true, false],
            slip: rows([50.0, 40.0, 30.0, 20.0, 0.0]),
            position: rows([1.0, 1.0, 1.1, 1.1, 1.0]),
            command: rows([0.0; 5]),
            report: rows([0.0; 5]),
            theta: rows([25.0; 5]),
            speed: [rows([0.0; 5]), rows([0.0; 5])],
            acceleration: [Vec::new(), Vec::new()],
            stiffness: rows([2.0; 5]),
            warmth: rows([0.5; 5]),
            travel: [1.0, 2.0],
        }
    }

    /// A clutch torque acts on both sides while the clutch slips, and its transducer shows it. A displaced bearing or a warmer disc shows at its own sensor as well.
    #[test]
    fn a_law_acts_where_it_is_and_shows_where_it_is_measured() {
        let s = along();
        let c = s.clutch(&|k| k as f64);
        assert_eq!((&c.clutch, c.torque.concat().len(), c.bench.concat().len()), (&vec![0.0, 1.0, 2.0, 3.0, 0.0], 0, 0));
        let (m, w) = (s.moved(&|_| 0.1), s.warmed(&|_| 4.0));
        assert_eq!((m.clutch[2], m.bench[0][0], w.clutch[2], w.bench[1][4]), (0.2, 0.1, 2.0, 4.0));
        let on = s.on(1, &|k| k as f64);
        assert!(on.torque[0].is_empty() && on.torque[1][3] == 3.0 && s.sensed(0, &|_| 7.0).sensed[0] == [7.0; 5]);
        let moving = Signals { speed: [vec![0.0; 5], vec![0.0, 0.25, 0.5, 40.0, -40.0]], ..along() }.on_moving_car(&|_| 2.0);
        assert!(moving.torque[1].iter().zip([0.0, 0.4621, 0.7616, 1.0, 1.0]).all(|(t, share)| (t - 2.0 * CAR * share).abs() < 1e-3));
        let d = direction(&s);
        assert!(d[0] == 0.0 && d[2] > 0.5 && d[4] < -0.5, "{d:?}");
    }
}
