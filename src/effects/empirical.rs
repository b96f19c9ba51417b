//! Learned laws: what the model is missing, as curves that were learned from recordings and for which there is no formula.
//!
//! A learned law is not a cause and is not part of the library of effects. Each curve is a table over one variable, linear between its breakpoints and held constant outside
//! them; the curves of one law are added:
//!
//! | law | acts as | curves over |
//! |---|---|---|
//! | friction | T (1 + Σ) on the torque of the faces | slip, disc temperature, pressure, friction work since the start |
//! | clutch force | F (1 + Σ) on the spring's force | normalised position, its direction, disc temperature |
//! | engine | T_e + Σ at the crankshaft; a lag whose τ is longer by Σ | speed, requested torque; shortfall of the torque, requested torque |
//! | driveline | T_L + Σ tanh(ω/ω_L) against the motion | speed |
//! | actuator | ė = −e/τ of the distance e to the command, τ = Σ; then an offset, then play | distance, position |
//! | sensors | ω (1 + δ) behind τ ṡ + s = ω, for either speed | speed |
//!
//! A factor is at least [`LEAST_FACTOR`], so that slipping faces always brake; a time constant or a play is never negative. The parameters are the values at the breakpoints,
//! `<curve>_1` and so on; a law whose values are all zero has no influence.

use super::{PARAMETERS, Parameters, Subsystem, param::empirical as at};
use crate::physics::{approach, driveline};
use std::ops::Range;

/// Least factor on friction or force.
pub const LEAST_FACTOR: f64 = 0.1;

/// Stroke in mm over which the direction of the bearing reverses in the learned force law, where the force hysteresis of the library is not active and gives none.
pub const STROKE_MM: f64 = 0.3;

/// One table over one variable.
#[derive(Debug)]
pub struct Curve {
    /// Name: that of its parameters without the number.
    pub name: &'static str,
    /// Subsystem to whose law the curve belongs.
    pub subsystem: Subsystem,
    /// Independent variable, in words and with its unit.
    pub over: &'static str,
    /// Breakpoints.
    pub breakpoints: &'static [f64],
    /// Index of its first value in [`PARAMETERS`].
    first: usize,
    /// Index of the breakpoint at which a fit holds the curve at zero, so that only one curve of the law carries the law's level.
    pub reference: Option<usize>,
}

impl Curve {
    /// Indices of its values in [`PARAMETERS`].
    pub fn parameters(&self) -> Range<usize> {
        self.first..self.first + self.breakpoints.len()
    }

    /// Unit of its values.
    pub fn unit(&self) -> &'static str {
        PARAMETERS[self.first].unit
    }

    /// Index of the interval of breakpoints that contains `x`, and the relative position of `x` in it, 0 to 1.
    #[inline]
    pub fn place(&self, x: f64) -> (usize, f64) {
        let b = self.breakpoints;
        let mut k = 0;
        while k + 2 < b.len() && x > b[k + 1] {
            k += 1;
        }
        (k, ((x - b[k]) / (b[k + 1] - b[k])).clamp(0.0, 1.0))
    }

    /// Value at `x`.
    #[inline]
    pub fn value(&self, p: &Parameters, x: f64) -> f64 {
        let (k, share) = self.place(x);
        let (a, b) = (p[self.first + k], p[self.first + k + 1]);
        a + share * (b - a)
    }

    /// Greatest magnitude of the curve's slope.
    pub fn steepest(&self, p: &Parameters) -> f64 {
        let b = self.breakpoints;
        let slope = |k: usize| ((p[self.first + k + 1] - p[self.first + k]) / (b[k + 1] - b[k])).abs();
        (0..b.len() - 1).map(slope).fold(0.0, f64::max)
    }

    fn is_null(&self, p: &Parameters) -> bool {
        self.parameters().all(|k| p[k] == 0.0)
    }
}

/// Indices in [`CURVES`].
const FRICTION: [usize; 4] = [0, 1, 2, 3];
const FORCE: [usize; 3] = [4, 5, 6];
const DIRECTION: usize = FORCE[1];
const ENGINE: [usize; 2] = [7, 8];
const LOAD: usize = 9;
const TIME: [usize; 2] = [10, 11];
const OFFSET: usize = 12;
const PLAY: usize = 13;
const ACTUATOR: [usize; 4] = [TIME[0], TIME[1], OFFSET, PLAY];
const SCALE: [usize; 2] = [16, 14];
const FILTER: [usize; 2] = [17, 15];
const ENGINE_TIME: [usize; 2] = [18, 19];

const fn curve(name: &'static str, subsystem: Subsystem, over: &'static str, breakpoints: &'static [f64], first: usize) -> Curve {
    Curve { name, subsystem, over, breakpoints, first, reference: None }
}

const fn pinned(curve: Curve, reference: usize) -> Curve {
    Curve { reference: Some(reference), ..curve }
}

use Subsystem::{Actuator, ClutchForce, Driveline, Engine, Friction, Sensors};

/// All curves.
pub static CURVES: [Curve; 20] = [
    curve("friction_slip", Friction, "slip, rad/s", &[0.0, 4.0, 12.0, 30.0, 60.0, 110.0, 180.0], at::friction_slip_1),
    pinned(
        curve(
            "friction_temperature",
            Friction,
            "disc temperature, °C",
            &[20.0, 60.0, 100.0, 150.0, 200.0, 260.0],
            at::friction_temperature_1,
        ),
        1,
    ),
    pinned(
        curve(
            "friction_pressure",
            Friction,
            "force, share of the closed clutch's",
            &[0.0, 0.05, 0.12, 0.25, 0.5],
            at::friction_pressure_1,
        ),
        2,
    ),
    pinned(curve("friction_work", Friction, "friction work since the start, kJ", &[0.0, 1.0, 3.0, 8.0, 20.0], at::friction_work_1), 2),
    curve(
        "force_position",
        ClutchForce,
        "normalised position",
        &[0.25, 0.35, 0.45, 0.55, 0.65, 0.8, 1.0],
        at::force_position_1,
    ),
    curve("force_direction", ClutchForce, "normalised position, closing", &[0.3, 0.5, 0.7, 0.9], at::force_direction_1),
    pinned(
        curve("force_temperature", ClutchForce, "disc temperature, °C", &[20.0, 60.0, 100.0, 150.0, 220.0], at::force_temperature_1),
        1,
    ),
    curve("engine_speed", Engine, "engine speed, rad/s", &[50.0, 80.0, 110.0, 150.0, 200.0, 270.0, 360.0], at::engine_speed_1),
    pinned(curve("engine_torque", Engine, "torque asked for, N·m", &[-20.0, 0.0, 20.0, 45.0, 75.0, 110.0], at::engine_torque_1), 2),
    curve("load_speed", Driveline, "disc speed, rad/s", &[0.0, 5.0, 20.0, 50.0, 100.0, 170.0, 260.0], at::load_speed_1),
    curve("actuator_time", Actuator, "distance to the command, mm", &[-6.0, -2.0, -0.5, 0.0, 0.5, 2.0, 6.0], at::actuator_time_1),
    pinned(curve("actuator_slowing", Actuator, SHARE_OF_CLOSED, &[0.0, 0.3, 0.5, 0.7, 1.0], at::actuator_slowing_1), 2),
    curve("actuator_offset", Actuator, SHARE_OF_CLOSED, &[0.0, 0.3, 0.5, 0.6, 0.7, 0.85, 1.0], at::actuator_offset_1),
    curve("actuator_play", Actuator, SHARE_OF_CLOSED, &[0.3, 0.5, 0.7, 1.0], at::actuator_play_1),
    curve("disc_scale", Sensors, "disc speed, rad/s", &[4.0, 9.0, 15.0, 30.0, 80.0, 160.0, 280.0], at::disc_scale_1),
    curve("disc_filter", Sensors, "disc speed, rad/s", &[10.0, 60.0, 200.0], at::disc_filter_1),
    curve("flywheel_scale", Sensors, "flywheel speed, rad/s", &[50.0, 80.0, 110.0, 150.0, 200.0, 270.0, 360.0], at::flywheel_scale_1),
    curve("flywheel_filter", Sensors, "flywheel speed, rad/s", &[60.0, 120.0, 240.0], at::flywheel_filter_1),
    curve("engine_time", Engine, "torque short of what is asked for, N·m", &[-60.0, -20.0, -5.0, 0.0, 5.0, 20.0, 60.0], at::engine_time_1),
    pinned(curve("engine_slowing", Engine, "torque asked for, N·m", &[-20.0, 0.0, 20.0, 45.0, 75.0, 110.0], at::engine_slowing_1), 2),
];

const SHARE_OF_CLOSED: &str = "position, share of the closed clutch's";

/// Curves of a subsystem's law.
pub fn curves(of: Subsystem) -> impl Iterator<Item = &'static Curve> {
    CURVES.iter().filter(move |c| c.subsystem == of)
}

/// Whether parameter `k` is a value of a curve.
pub fn holds(k: usize) -> bool {
    PARAMETERS[k].effect == "empirical"
}

/// Which learned laws are active.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Active {
    /// [`friction`].
    pub friction: bool,
    /// [`force`].
    pub force: bool,
    /// The part of it that depends on the bearing's direction.
    pub direction: bool,
    /// [`engine`].
    pub engine: bool,
    /// [`engine_time`].
    pub engine_time: bool,
    /// [`load`].
    pub load: bool,
    /// Any curve of the actuator.
    pub actuator: bool,
    /// [`approach()`].
    pub slow: bool,
    /// [`scale`].
    pub scales: bool,
    /// [`smoothing`].
    pub filters: bool,
}

impl Active {
    /// The laws of which any value is not zero.
    pub fn of(p: &Parameters) -> Self {
        let any = |curves: &[usize]| curves.iter().any(|&c| !CURVES[c].is_null(p));
        Self {
            friction: any(&FRICTION),
            force: any(&FORCE),
            direction: any(&[DIRECTION]),
            engine: any(&ENGINE),
            engine_time: any(&ENGINE_TIME),
            load: any(&[LOAD]),
            actuator: any(&ACTUATOR),
            slow: any(&TIME),
            scales: any(&SCALE),
            filters: any(&FILTER),
        }
    }
}

/// Factor on friction at a slip ≥ 0 in rad/s, a disc temperature in °C, a force as share of the closed clutch's, and a friction work in J.
pub fn friction(p: &Parameters, slip: f64, theta: f64, pressure: f64, work: f64) -> f64 {
    let x = [slip, theta, pressure, 1e-3 * work];
    let sum: f64 = FRICTION.iter().zip(x).map(|(&c, x)| CURVES[c].value(p, x)).sum();
    (1.0 + sum).max(LEAST_FACTOR)
}

/// Factor on the force at a normalised position, a direction from −1 (opening) to +1 (closing), and a disc temperature in °C.
pub fn force(p: &Parameters, xi: f64, direction: f64, theta: f64) -> f64 {
    let [over_position, over_direction, over_temperature] = FORCE.map(|c| &CURVES[c]);
    let sum = over_position.value(p, xi) + direction * over_direction.value(p, xi) + over_temperature.value(p, theta);
    (1.0 + sum).max(LEAST_FACTOR)
}

/// Torque in N·m added at the crankshaft at a speed in rad/s and a requested torque of `torque` N·m.
pub fn engine(p: &Parameters, omega_f: f64, torque: f64) -> f64 {
    let [over_speed, over_torque] = ENGINE.map(|c| &CURVES[c]);
    over_speed.value(p, omega_f) + over_torque.value(p, torque)
}

/// Lower bound of an engine's time constant, as a share of its longest one: it keeps the torque from jumping on its way.
const QUICKEST: f64 = 0.02;

/// Time constant in s of an engine that is `short` N·m below a requested torque of `torque` N·m; `known` s without the learned law.
pub fn engine_time(p: &Parameters, short: f64, torque: f64, known: f64) -> f64 {
    let [over_short, over_torque] = ENGINE_TIME.map(|c| &CURVES[c]);
    (known + over_short.value(p, short) + over_torque.value(p, torque)).max(QUICKEST * longest_engine_time(p, known))
}

/// Torque in N·m against the motion at a speed in rad/s; `omega_l` is the speed scale of the rolling load.
pub fn load(p: &Parameters, omega: f64, omega_l: f64) -> f64 {
    CURVES[LOAD].value(p, omega.abs()) * driveline::tanh(omega / omega_l)
}

/// Time constant in s of an actuator that is `distance` mm short of its command, at the position `share`, a share of the closed clutch's.
pub fn time(p: &Parameters, distance: f64, share: f64) -> f64 {
    let (k, along) = CURVES[TIME[0]].place(distance);
    let (a, b) = (time_at(p, k, share), time_at(p, k + 1, share));
    a + along * (b - a)
}

/// Time constant in s at breakpoint `k` of the distance.
fn time_at(p: &Parameters, k: usize, share: f64) -> f64 {
    let [over_distance, over_share] = TIME.map(|c| &CURVES[c]);
    (p[over_distance.first + k] + over_share.value(p, share)).max(0.0)
}

/// Upper bound of the actuator's time constant in s.
pub fn longest_time(p: &Parameters) -> f64 {
    longest(p, TIME)
}

/// Upper bound of the engine's time constant in s; `known` s without the learned law.
pub fn longest_engine_time(p: &Parameters, known: f64) -> f64 {
    known + longest(p, ENGINE_TIME)
}

fn longest(p: &Parameters, curves: [usize; 2]) -> f64 {
    curves.into_iter().map(|c| CURVES[c].parameters().map(|k| p[k]).fold(0.0, f64::max)).sum()
}

/// Distance in mm that is left of `distance` mm after `h` s, for an actuator that started at the position `share`, a share of the closed clutch's.
pub fn approach(p: &Parameters, distance: f64, share: f64, h: f64) -> f64 {
    remaining_distance(TIME[0], distance, |k| time_at(p, k, share), h)
}

/// Shortfall in N·m that is left of `short` N·m after `h` s, for an engine with a requested torque of `torque` N·m whose time constant is `known` s without the learned law.
pub fn engine_approach(p: &Parameters, short: f64, torque: f64, known: f64, h: f64) -> f64 {
    let [over_short, over_torque] = ENGINE_TIME.map(|c| &CURVES[c]);
    let (by_torque, least) = (known + over_torque.value(p, torque), QUICKEST * longest_engine_time(p, known));
    remaining_distance(ENGINE_TIME[0], short, |k| (p[over_short.first + k] + by_torque).max(least), h)
}

/// What is left of a signed distance after `h` s, where `time` gives the non-negative time constants in s at the breakpoints of the curve with index `curve`.
fn remaining_distance(curve: usize, distance: f64, time: impl Fn(usize) -> f64, h: f64) -> f64 {
    let breakpoints = CURVES[curve].breakpoints;
    // Breakpoints from zero outwards, on the side of the distance's sign.
    let place = |steps: usize| if distance > 0.0 { HALF + steps } else { HALF - steps };
    let distances: [f64; HALF + 1] = std::array::from_fn(|k| breakpoints[place(k)].abs());
    approach::left(distances, std::array::from_fn(|k| time(place(k))), distance.abs(), h).copysign(distance)
}

/// Number of breakpoints of a time constant on either side of a distance of zero.
const HALF: usize = 3;

/// Offset of the bearing and half of its play, mm, at a position as share of the closed clutch's.
pub fn offset_and_play(p: &Parameters, share: f64) -> (f64, f64) {
    (CURVES[OFFSET].value(p, share), CURVES[PLAY].value(p, share).max(0.0))
}

/// Ratio of sensed to actual speed of the flywheel (0) or the disc (1), at a speed in rad/s.
pub fn scale(p: &Parameters, side: usize, speed: f64) -> f64 {
    1.0 + CURVES[SCALE[side]].value(p, speed.abs())
}

/// Learned time constant in s of the filter in the speed sensor of the flywheel (0) or the disc (1), at a speed in rad/s.
pub fn smoothing(p: &Parameters, side: usize, speed: f64) -> f64 {
    CURVES[FILTER[side]].value(p, speed.abs()).max(0.0)
}

/// Greatest slope of the engine's law over speed, N·m·s/rad.
pub fn steepest_engine(p: &Parameters) -> f64 {
    CURVES[ENGINE[0]].steepest(p)
}

/// Slips and speeds in rad/s in the middle of each interval of breakpoints, of the learned friction and of the learned load.
pub fn slips_and_speeds() -> (impl Iterator<Item = f64>, impl Iterator<Item = f64>) {
    let inside = |c: usize| CURVES[c].breakpoints.windows(2).map(|b| 0.5 * (b[0] + b[1]));
    (inside(FRICTION[0]), inside(LOAD))
}

#[cfg(test)]
mod tests {
    use super::super::null;
    use super::*;

    fn close(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-12, "{found} against {expected}");
    }

    /// The values of every curve are numbered from 1, are contiguous, and name their breakpoint in the model description.
    #[test]
    fn breakpoints_are_those_that_the_model_description_states() {
        let mut all = Vec::new();
        for c in &CURVES {
            assert!(c.breakpoints.is_sorted() && c.reference.is_none_or(|r| r < c.breakpoints.len()));
            for (i, k) in c.parameters().enumerate() {
                let p = &PARAMETERS[k];
                assert_eq!((p.name.to_owned(), p.null), (format!("{}_{}", c.name, i + 1), 0.0));
                let told = p.meaning.split(' ').filter_map(|w| w.parse::<f64>().ok()).collect::<Vec<_>>();
                assert_eq!(told, [c.breakpoints[i]], "{}: {}", p.name, p.meaning);
                all.push(k);
            }
        }
        all.sort_unstable();
        let expected: Vec<usize> = (0..PARAMETERS.len()).filter(|&k| holds(k)).collect();
        assert_eq!(all, expected);
    }

    #[test]
    fn every_subsystem_that_has_a_law_has_its_curves_in_their_unit() {
        let of = |s: Subsystem| curves(s).map(|c| (c.name, c.unit())).collect::<Vec<_>>();
        assert_eq!(
            of(Friction),
            [("friction_slip", "1"), ("friction_temperature", "1"), ("friction_pressure", "1"), ("friction_work", "1")]
        );
        assert_eq!(of(ClutchForce), [("force_position", "1"), ("force_direction", "1"), ("force_temperature", "1")]);
        assert_eq!(of(Engine), [("engine_speed", "N.m"), ("engine_torque", "N.m"), ("engine_time", "s"), ("engine_slowing", "s")]);
        assert_eq!(of(Driveline), [("load_speed", "N.m")]);
        assert_eq!(of(Actuator), [("actuator_time", "s"), ("actuator_slowing", "s"), ("actuator_offset", "mm"), ("actuator_play", "mm")]);
        assert_eq!(of(Sensors), [("disc_scale", "1"), ("disc_filter", "s"), ("flywheel_scale", "1"), ("flywheel_filter", "s")]);
        assert_eq!(of(Subsystem::Thermal), []);
    }

    #[test]
    fn a_table_is_linear_between_its_breakpoints_and_constant_outside() {
        let mut p = null();
        (p[at::load_speed_1], p[at::load_speed_2], p[at::load_speed_3]) = (2.0, 4.0, -5.0);
        let c = &CURVES[LOAD];
        for (x, expected) in [(-3.0, 2.0), (0.0, 2.0), (2.5, 3.0), (5.0, 4.0), (10.0, 1.0), (20.0, -5.0), (35.0, -2.5), (50.0, 0.0), (900.0, 0.0)] {
            close(c.value(&p, x), expected);
        }
        p[at::load_speed_7] = 8.0;
        close(c.value(&p, 215.0), 4.0);
        close(c.value(&p, 1e9), 8.0);
        close(c.steepest(&p), 0.6);
    }

    #[test]
    fn curves_of_a_law_are_added() {
        let mut p = null();
        (p[at::friction_slip_3], p[at::friction_temperature_3]) = (0.1, -0.3);
        (p[at::friction_pressure_5], p[at::friction_work_5]) = (0.2, 0.12);
        // 21 rad/s is half-way to the next breakpoint, 80 °C half-way from the last; 14 kJ half-way from 8 to 20.
        close(friction(&p, 21.0, 80.0, 0.5, 14e3), 1.0 + 0.05 - 0.15 + 0.2 + 0.06);
        p[at::friction_temperature_3] = -0.6;
        (p[at::friction_slip_3], p[at::friction_pressure_1]) = (-0.6, -0.6);
        close(friction(&p, 12.0, 100.0, 0.0, 0.0), LEAST_FACTOR);
        (p[at::force_position_4], p[at::force_direction_2], p[at::force_temperature_1]) = (0.1, 0.04, 0.02);
        close(force(&p, 0.55, 1.0, 20.0), 1.0 + 0.1 + 0.03 + 0.02);
        close(force(&p, 0.55, -1.0, 20.0), 1.0 + 0.1 - 0.03 + 0.02);
        (p[at::engine_speed_1], p[at::engine_torque_6]) = (3.0, -12.0);
        close(engine(&p, 65.0, 92.5), 1.5 - 6.0);
        (p[at::engine_time_2], p[at::engine_slowing_4]) = (0.08, -0.2);
        close(engine_time(&p, -40.0, 60.0, 0.3), 0.3 + 0.04 - 0.1);
        close(engine_time(&p, -40.0, 45.0, 0.1), QUICKEST * 0.18);
        // At 7 N·m τ is 0.3 s minus 0.1 s, a plain lag. On the other side it is 0.28 s at a shortfall of 20 N·m, and less closer to zero.
        close(engine_approach(&p, 7.0, 60.0, 0.3, 0.1), 7.0 * (-0.5_f64).exp());
        let after = |tau: f64| -20.0 * (-0.1 / tau).exp();
        assert!((after(0.28)..after(0.2)).contains(&engine_approach(&p, -20.0, 60.0, 0.3, 0.1)));
        close(engine_approach(&p, 7.0, 60.0, 0.05, 0.01), 7.0 * (-0.01 / (QUICKEST * 0.13_f64)).exp());
        p[at::load_speed_4] = 6.0;
        close(load(&p, 50.0, 2.0), 6.0);
        close(load(&p, -50.0, 2.0), -6.0);
        assert_eq!(load(&p, 0.0, 2.0), 0.0);
    }

    /// Either side has its own time constants; the position adds to both, and no time constant is negative.
    #[test]
    fn an_actuator_closes_its_distance_as_its_time_constants_say() {
        let mut p = null();
        p[at::actuator_time_1..=at::actuator_time_7].copy_from_slice(&[0.6, 0.2, 0.05, 0.0, 0.1, 0.1, 0.1]);
        p[at::actuator_time_4] = 0.0;
        close(approach(&p, -5.5, 0.4, 0.2), -3.5);
        // Within half a millimetre of the command the distance is closed at 5 mm/s.
        close(approach(&p, 0.4, 0.4, 0.02), 0.3);
        close(approach(&p, 3.0, 0.4, 0.05), 3.0 * (-0.5_f64).exp());
        (p[at::actuator_slowing_4], p[at::actuator_slowing_5]) = (0.05, -0.2);
        close(time(&p, 3.0, 0.7), 0.15);
        close(approach(&p, 3.0, 0.7, 0.03), 3.0 * (-0.2_f64).exp());
        close(time(&p, 3.0, 1.0), 0.0);
        close(approach(&p, 3.0, 1.0, 0.001), 0.0);
        close(longest_time(&p), 0.65);
        assert!(approach(&p, f64::NAN, 0.4, 0.01).is_nan());
    }

    #[test]
    fn offset_play_scale_and_filter_are_read_off_their_tables() {
        let mut p = null();
        (p[at::actuator_offset_2], p[at::actuator_play_1], p[at::actuator_play_2]) = (0.5, 0.2, -0.3);
        let (offset, play) = offset_and_play(&p, 0.4);
        close(offset, 0.25);
        close(play, 0.0);
        close(offset_and_play(&p, 0.0).1, 0.2);
        (p[at::disc_scale_4], p[at::flywheel_scale_1]) = (0.02, -0.01);
        (p[at::disc_filter_2], p[at::flywheel_filter_3]) = (0.04, -0.04);
        close(scale(&p, 1, -55.0), 1.01);
        close(scale(&p, 0, 10.0), 0.99);
        close(smoothing(&p, 1, 35.0), 0.02);
        close(smoothing(&p, 0, 240.0), 0.0);
    }

    #[test]
    fn a_law_takes_part_if_any_of_its_values_does() {
        assert_eq!(Active::of(&null()), Active::default());
        for c in &CURVES {
            for k in c.parameters() {
                let mut p = null();
                p[k] = 0.01;
                let a = Active::of(&p);
                let (sensed, drives) = (a.scales || a.filters, a.engine || a.engine_time);
                let of = [(Friction, a.friction), (ClutchForce, a.force), (Engine, drives), (Driveline, a.load), (Actuator, a.actuator), (Sensors, sensed)];
                of.iter().for_each(|(s, on)| assert_eq!(*on, *s == c.subsystem, "{}", PARAMETERS[k].name));
                assert_eq!(a.direction, c.name == "force_direction");
                assert_eq!(a.engine_time, ["engine_time", "engine_slowing"].contains(&c.name));
                assert_eq!(a.slow, ["actuator_time", "actuator_slowing"].contains(&c.name));
                assert_eq!((a.scales, a.filters), (c.name.ends_with("_scale"), c.name.ends_with("_filter")));
            }
        }
    }
}
