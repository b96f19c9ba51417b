//! Between the bearing's position and the clamp force.
//!
//! In the library: kiss point (shift, drift with temperature), cushion (temperature, hysteresis). Outside of it: a
//! pressure plate that wobbles, a cushion that settles while it is squeezed, and a knee in the cushion's curve.

use super::Dice;
use crate::map;
use crate::vehicle::Vehicle;
use std::f64::consts::TAU;

/// How something grows with the disc's temperature above 25 °C; `rate` is the mean slope up to 125 °C.
#[derive(Clone, Copy, Debug, Default)]
pub enum Growth {
    /// Not at all.
    #[default]
    None,
    /// In proportion.
    Linear(f64),
    /// With the square.
    Quadratic(f64),
    /// At first, and then no more.
    Saturating(f64),
}

impl Growth {
    fn draw(dice: &mut Dice, rate: f64) -> Self {
        [Self::Linear(rate), Self::Quadratic(rate), Self::Saturating(rate)][dice.shape(3)]
    }

    /// Growth at a temperature in °C.
    pub fn at(self, theta: f64) -> f64 {
        let d = theta - 25.0;
        match self {
            Self::None => 0.0,
            Self::Linear(r) => r * d,
            Self::Quadratic(r) => r * d * d.max(0.0) / 100.0,
            Self::Saturating(r) => r * 100.0 * (d / 60.0).tanh() / (100.0f64 / 60.0).tanh(),
        }
    }
}

/// The force's deviations and their states; mm, N, °C.
#[derive(Clone, Debug, Default)]
pub struct Force {
    kiss_mm: f64,
    closed_mm: f64,
    kiss_growth: Growth,
    closed_grows: bool,
    stiffness_growth: Growth,
    loop_width: f64,
    loop_travel: f64,
    loop_power: f64,
    loop_state: f64,
    last_xi: f64,
    wobble_mm: f64,
    wobble_order: f64,
    wobble_phase: f64,
    settle: f64,
    settle_tau_s: f64,
    settled: f64,
    knee: f64,
    knee_at: f64,
    knee_wide: f64,
}

impl Force {
    /// Sets the effect of this id, if it belongs here.
    pub fn draw(&mut self, id: &str, dice: &mut Dice) -> Option<String> {
        let shape = match id {
            "kiss_point_offset" => {
                self.kiss_mm = dice.either(0.10, 0.25);
                self.closed_mm = [self.kiss_mm, 0.0, 0.5 * self.kiss_mm][dice.shape(3)];
                format!("first contact {:+.3} mm, closed {:+.3} mm", self.kiss_mm, self.closed_mm)
            }
            "kiss_point_thermal" => {
                let rate = dice.either(0.0014, 0.004);
                self.kiss_growth = Growth::draw(dice, rate);
                self.closed_grows = dice.shape(2) == 0;
                format!("{:.5?} mm/K, closed too: {}", self.kiss_growth, self.closed_grows)
            }
            "cushion_stiffness_thermal" => {
                let rate = dice.either(0.0011, 0.0026);
                self.stiffness_growth = Growth::draw(dice, rate);
                format!("{:.5?} 1/K", self.stiffness_growth)
            }
            "cushion_hysteresis" => {
                self.loop_width = dice.magnitude(0.09, 0.24);
                self.loop_travel = dice.within(0.015, 0.05);
                self.loop_power = [1.0, 2.0][dice.shape(2)];
                format!("±{:.3} of the force, rounded over {:.3}, power {}", self.loop_width, self.loop_travel, self.loop_power)
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
            _ => return None,
        };
        Some(shape)
    }

    /// At rest at this position, with the loop where closing left it last.
    pub fn rest(&mut self, v: &Vehicle, x: f64, theta_c: f64) {
        self.last_xi = self.travel(v, x, theta_c);
        // A clutch at rest has been opened, or closed, before.
        self.loop_state = if self.last_xi > 0.5 { 1.0 } else { -1.0 };
        self.settled = if self.last_xi > 0.5 { 1.0 } else { 0.0 };
    }

    /// Normalised position, not yet limited to 0..1.
    fn travel(&self, v: &Vehicle, x: f64, theta_c: f64) -> f64 {
        let drift = self.kiss_growth.at(theta_c);
        let x_cnt = v.x_cnt + self.kiss_mm + drift;
        let x_cls = v.x_cls + self.closed_mm + if self.closed_grows { drift } else { 0.0 };
        (x - x_cnt) / (x_cls - x_cnt)
    }

    /// Clamp force and whether the facings touch.
    pub fn step(&mut self, h: f64, v: &Vehicle, x: f64, theta_c: f64, crank_rad: f64) -> (f64, bool) {
        let wobble = if self.wobble_mm == 0.0 { 0.0 } else { self.wobble_mm * (self.wobble_order * crank_rad + self.wobble_phase).sin() };
        let xi = self.travel(v, x + wobble, theta_c);
        let touching = xi > map::contact(v);
        let mut force = map::cushion_force_n(v, xi) * (1.0 + self.stiffness_growth.at(theta_c));
        if self.loop_width != 0.0 {
            force *= 1.0 + self.loop_width * self.turn(xi);
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
        (force.max(0.0), touching)
    }

    /// A Dahl-like loop: +1 after closing, −1 after opening, rounded over the travel in between.
    fn turn(&mut self, xi: f64) -> f64 {
        let xi = xi.clamp(0.0, 1.0);
        let d = xi - self.last_xi.clamp(0.0, 1.0);
        self.last_xi = xi;
        let away = (1.0 - self.loop_state * d.signum()).max(0.0) * 0.5;
        self.loop_state += 2.0 * d / self.loop_travel * away.powf(self.loop_power);
        self.loop_state = self.loop_state.clamp(-1.0, 1.0);
        self.loop_state
    }
}
