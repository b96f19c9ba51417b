//! Between the bearing's position and the clamp force.
//!
//! In the library: kiss point (shift, uneven between first contact and closing; drift with temperature, a random rising curve), cushion
//! (temperature, a random rising curve that acts unevenly along the travel; hysteresis, some plays of random width in parallel). Outside of it: a
//! pressure plate that wobbles, a cushion that settles while it is squeezed, a knee in the cushion's curve, fingers that are thrown outwards, and
//! air that has to be squeezed out.

use super::Dice;
use super::maps::Curve;
use super::seen::Seen;
use crate::map;
use crate::vehicle::Vehicle;
use std::f64::consts::TAU;

/// Growth with the disc's temperature above 25 °C: a random rising curve up to 175 °C.
#[derive(Clone, Debug, Default)]
struct Growth {
    /// Mean slope between 25 °C and 125 °C, 1/K of what grows.
    rate: f64,
    curve: Curve,
    at_25: f64,
    to_125: f64,
}

impl Growth {
    fn draw(dice: &mut Dice, rate: f64) -> Self {
        let roughness = dice.within(0.4, 1.0);
        let curve = Curve::rising(dice, 0.0, 175.0, roughness);
        let at_25 = curve.at(25.0);
        let to_125 = (curve.at(125.0) - at_25).max(0.2);
        Self { rate, curve, at_25, to_125 }
    }

    fn at(&self, theta: f64) -> f64 {
        if self.rate == 0.0 { 0.0 } else { 100.0 * self.rate * (self.curve.at(theta) - self.at_25) / self.to_125 }
    }
}

/// Plays in parallel: their mean position between −1 and 1 is the loop's state.
#[derive(Clone, Debug, Default)]
struct Loop {
    /// Half-width in normalised travel, and share.
    plays: Vec<(f64, f64)>,
    states: Vec<f64>,
}

impl Loop {
    fn draw(dice: &mut Dice) -> Self {
        let count = 3 + dice.shape(3);
        let mut plays: Vec<_> = (0..count).map(|_| (dice.within(0.004, 0.05), dice.within(0.3, 1.0))).collect();
        let sum: f64 = plays.iter().map(|p| p.1).sum();
        plays.iter_mut().for_each(|p| p.1 /= sum);
        Self { plays, states: vec![0.0; count] }
    }

    /// At rest at `xi`, having come from above or from below.
    fn rest(&mut self, xi: f64, from_below: bool) {
        let side = if from_below { -1.0 } else { 1.0 };
        self.states = self.plays.iter().map(|(half, _)| xi + side * half).collect();
    }

    /// +1 after closing, −1 after opening.
    fn step(&mut self, xi: f64) -> f64 {
        let mut sum = 0.0;
        for ((half, share), state) in self.plays.iter().zip(&mut self.states) {
            *state = state.clamp(xi - half, xi + half);
            sum += share * (xi - *state) / half;
        }
        sum
    }
}

/// The force's deviations and their states; mm, N, °C.
#[derive(Clone, Debug, Default)]
pub struct Force {
    kiss_mm: f64,
    closed_mm: f64,
    rough: f64,
    uneven: Curve,
    kiss_growth: Growth,
    closed_grows: f64,
    stiffness_growth: Growth,
    loop_width: f64,
    hysteresis: Loop,
    wobble_mm: f64,
    wobble_order: f64,
    wobble_phase: f64,
    settle: f64,
    settle_tau_s: f64,
    settled: f64,
    knee: f64,
    knee_at: f64,
    knee_wide: f64,
    thrown: f64,
    squeezed: f64,
    closing_mm_s: f64,
    last_xi: f64,
    crank: f64,
    /// The library's parameters that come nearest.
    pub seen: Seen,
}

impl Force {
    /// Sets the effect of this id, if it belongs here.
    pub fn draw(&mut self, id: &str, dice: &mut Dice) -> Option<String> {
        self.rough = dice.within(0.1, 0.3);
        self.uneven = Curve::draw(dice, 0.15, 0.85, 0.35);
        let shape = match id {
            "kiss_point_offset" => {
                self.kiss_mm = dice.either(0.10, 0.25);
                self.closed_mm = dice.within(0.0, 1.0) * self.kiss_mm;
                self.rough *= 0.5;
                self.seen = Seen::of(&["offset", "closed_offset"]);
                format!("first contact {:+.3} mm, closed {:+.3} mm, uneven by {:.2}", self.kiss_mm, self.closed_mm, self.rough)
            }
            "kiss_point_thermal" => {
                let rate = dice.either(0.0014, 0.004);
                self.kiss_growth = Growth::draw(dice, rate);
                self.closed_grows = dice.within(0.0, 1.0);
                format!("{rate:.5} mm/K, closed point {:.2} of it", self.closed_grows)
            }
            "cushion_stiffness_thermal" => {
                let rate = dice.either(0.0011, 0.0026);
                self.stiffness_growth = Growth::draw(dice, rate);
                self.seen = Seen::of(&["slope", "curvature"]);
                format!("{rate:.5} 1/K, uneven by {:.2} along the travel", self.rough)
            }
            "cushion_hysteresis" => {
                self.loop_width = dice.magnitude(0.09, 0.24);
                self.hysteresis = Loop::draw(dice);
                format!("±{:.3} of the force, {:.3?}", self.loop_width, self.hysteresis.plays)
            }
            "plate_wobble" => {
                let (order, more) = [(1.0, 1.5), (0.5, 1.0)][dice.shape(2)];
                self.wobble_mm = more * dice.magnitude(0.14, 0.28);
                self.wobble_order = order;
                self.wobble_phase = dice.within(0.0, TAU);
                format!("{:.3} mm, order {} of the flywheel", self.wobble_mm, self.wobble_order)
            }
            "cushion_settling" => {
                self.settle = dice.either(0.12, 0.26);
                self.settle_tau_s = [dice.within(0.5, 0.9), dice.within(1.2, 2.2)][dice.shape(2)];
                format!("{:+.3} of the force within {:.2} s of contact", self.settle, self.settle_tau_s)
            }
            "cushion_knee" => {
                self.knee = dice.either(0.24, 0.5);
                self.knee_at = dice.within(0.40, 0.52);
                self.knee_wide = [0.05, 0.09][dice.shape(2)];
                format!("{:+.3} of the force about {:.2}, width {}", self.knee, self.knee_at, self.knee_wide)
            }
            "centrifugal_clamp" => {
                self.thrown = dice.either(0.28, 0.5);
                format!("{:+.3} of the force from 100 to 200 rad/s", self.thrown)
            }
            "squeeze_film" => {
                self.squeezed = dice.magnitude(0.09, 0.2);
                format!("{:.3} of the force per mm/s of closing", self.squeezed)
            }
            _ => return None,
        };
        Some(shape)
    }

    /// At rest at this position, with the loop where closing left it last.
    pub fn rest(&mut self, v: &Vehicle, x: f64, theta_c: f64) {
        let xi = self.travel(v, x, theta_c).clamp(0.0, 1.0);
        // A clutch at rest has been opened, or closed, before.
        let closed = xi > 0.5;
        self.hysteresis.rest(xi, closed);
        self.settled = if closed { 1.0 } else { 0.0 };
        (self.last_xi, self.crank, self.closing_mm_s) = ((x - v.x_cnt) / (v.x_cls - v.x_cnt), 0.0, 0.0);
    }

    /// Normalised position, not yet limited to 0..1.
    fn travel(&self, v: &Vehicle, x: f64, theta_c: f64) -> f64 {
        let drift = self.kiss_growth.at(theta_c);
        let x_cnt = v.x_cnt + self.kiss_mm + drift;
        let x_cls = v.x_cls + self.closed_mm + self.closed_grows * drift;
        let even = (x - x_cnt) / (x_cls - x_cnt);
        if self.kiss_mm == 0.0 {
            return even;
        }
        let within = even.clamp(0.0, 1.0);
        even - self.rough * self.kiss_mm / (x_cls - x_cnt) * self.uneven.at(even) * 4.0 * within * (1.0 - within)
    }

    /// Clamp force and whether the facings touch.
    pub fn step(&mut self, h: f64, v: &Vehicle, x: f64, theta_c: f64, crank_rad: f64) -> (f64, bool) {
        let wobble = if self.wobble_mm == 0.0 { 0.0 } else { self.wobble_mm * (self.wobble_order * crank_rad + self.wobble_phase).sin() };
        let xi = self.travel(v, x + wobble, theta_c);
        let touching = xi > map::contact(v);
        let mut force = map::cushion_force_n(v, xi);
        if self.stiffness_growth.rate != 0.0 {
            let more = self.stiffness_growth.at(theta_c) * (1.0 + self.rough * self.uneven.at(xi));
            let d = theta_c - 25.0;
            self.seen.count([d, d * d], more, force * force);
            force *= 1.0 + more;
        }
        if self.kiss_mm != 0.0 && touching {
            self.compare_kiss(v, x, xi, force);
        }
        if self.loop_width != 0.0 {
            force *= 1.0 + self.loop_width * (1.0 + self.rough * self.uneven.at(xi)) * self.hysteresis.step(xi.clamp(0.0, 1.0));
        }
        if self.settle != 0.0 {
            let towards = f64::from(u8::from(touching));
            let tau = if touching { self.settle_tau_s } else { 0.4 };
            self.settled += h / tau * (towards - self.settled);
            force *= 1.0 + self.settle * (self.settled - 0.5);
        }
        if self.knee != 0.0 {
            let z = (xi - self.knee_at) / self.knee_wide;
            force *= 1.0 + self.knee * (-z * z).exp();
        }
        force *= self.moving(h, xi, (x - v.x_cnt) / (v.x_cls - v.x_cnt), crank_rad, v.x_cls - v.x_cnt);
        (force.max(0.0), touching)
    }

    /// What speed does: of the flywheel to the fingers, of the plate to the air before it.
    fn moving(&mut self, h: f64, xi: f64, even: f64, crank_rad: f64, span_mm: f64) -> f64 {
        let omega = (crank_rad - self.crank) / h;
        self.crank = crank_rad;
        // The air takes a moment to be squeezed, however the plate jerks.
        self.closing_mm_s += ((even - self.last_xi) * span_mm - h * self.closing_mm_s) / 0.02;
        self.last_xi = even;
        let mut factor = 1.0;
        if self.thrown != 0.0 {
            // Right at 150 rad/s; 30 000 rad²/s² lie between 100 and 200 rad/s.
            factor += self.thrown * (omega * omega - 22_500.0) / 30_000.0;
        }
        if self.squeezed != 0.0 && xi < 0.95 {
            factor += self.squeezed * self.closing_mm_s.clamp(0.0, 6.0);
        }
        factor.clamp(0.3, 2.5)
    }

    /// The shift at this travel, as a shift of first contact and one of the closed point.
    fn compare_kiss(&mut self, v: &Vehicle, x: f64, xi: f64, force: f64) {
        let span = v.x_cls - v.x_cnt;
        let shift = x - (v.x_cnt + xi * span);
        // Weighed by how the force answers to a shift.
        let steep = (map::cushion_force_n(v, xi + 0.01) - force) / 0.01;
        self.seen.count([1.0 - xi, xi], shift, steep * steep);
    }
}
