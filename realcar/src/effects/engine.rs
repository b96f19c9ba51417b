//! Between the torque that the ECU reports and the one at the crankshaft.
//!
//! In the library: gain, bias, lag. Outside of it: a weak cylinder, the dip of the air path at tip-in, and a ceiling that
//! the engine can't pass however much is reported.

use super::Dice;
use super::lag::{Lag, Shape};
use super::road::Road;
use std::f64::consts::TAU;

/// The engine's deviations and their states; torques in N·m, speeds in rad/s.
#[derive(Clone, Debug, Default)]
pub struct Engine {
    gain: f64,
    gain_per_rad_s: f64,
    bias_nm: f64,
    accessory_w: f64,
    lag: Lag,
    misfire: f64,
    burst_share: f64,
    burst_seed: u64,
    bursts: Vec<bool>,
    tip_in: f64,
    tip_fast: Lag,
    tip_slow: Lag,
    below_ceiling_nm: f64,
}

impl Engine {
    /// Sets the effect of this id, if it belongs here.
    pub fn draw(&mut self, id: &str, dice: &mut Dice) -> Option<String> {
        let shape = match id {
            "engine_torque_gain" => {
                let g = dice.either(0.06, 0.16);
                self.gain = g;
                if dice.shape(2) == 0 {
                    format!("constant factor {:.3}", 1.0 + g)
                } else {
                    self.gain_per_rad_s = 0.1 * g / 100.0;
                    format!("factor {:.3} at 150 rad/s that grows with speed", 1.0 + g)
                }
            }
            "engine_torque_bias" => {
                if dice.shape(2) == 0 {
                    self.bias_nm = dice.either(2.3, 5.5);
                    format!("constant {:.2} N·m", self.bias_nm)
                } else {
                    self.accessory_w = dice.magnitude(350.0, 800.0);
                    format!("accessory of {:.0} W", self.accessory_w)
                }
            }
            "engine_torque_lag" => {
                let tau = dice.magnitude(0.045, 0.12);
                let kind =
                    [Shape::First(tau), Shape::Second(tau, dice.within(0.6, 1.0)), Shape::UpDown(1.2 * tau, 0.7 * tau)][dice.shape(3)];
                self.lag = Lag::new(kind);
                format!("{kind:.3?}")
            }
            "misfire" => {
                self.misfire = dice.magnitude(0.35, 0.9);
                self.burst_share = if dice.shape(2) == 0 { 1.0 } else { dice.within(0.35, 0.6) };
                self.burst_seed = dice.seed();
                format!("cylinder loses {:.2} for {:.2} of the time", self.misfire, self.burst_share)
            }
            "tip_in_dip" => {
                self.tip_in = dice.magnitude(0.35, 0.8);
                let (fast, slow) = if dice.shape(2) == 0 { (0.06, 0.3) } else { (0.12, 0.45) };
                (self.tip_fast, self.tip_slow) = (Lag::new(Shape::First(fast)), Lag::new(Shape::First(slow)));
                format!("dip {:.2} of a rise between {fast} s and {slow} s", self.tip_in)
            }
            "torque_ceiling" => {
                self.below_ceiling_nm = dice.magnitude(18.0, 45.0);
                format!("ceiling {:.1} N·m below 100 N·m", self.below_ceiling_nm)
            }
            _ => return None,
        };
        Some(shape)
    }

    /// At rest with this reported torque.
    pub fn rest(&mut self, reported_nm: f64, recording: u64) {
        for lag in [&mut self.lag, &mut self.tip_fast, &mut self.tip_slow] {
            lag.rest(reported_nm);
        }
        let mut road = Road::new(self.burst_seed, recording);
        // One decision each quarter second.
        self.bursts = (0..400).map(|_| road.happens(self.burst_share)).collect();
    }

    /// Torque at the crankshaft, before the tolerances of its report.
    pub fn step(&mut self, h: f64, t: f64, reported_nm: f64, omega_f: f64, crank_rad: f64) -> f64 {
        let mut torque = self.lag.step(h, reported_nm);
        if self.tip_in != 0.0 {
            let rise = self.tip_fast.step(h, torque) - self.tip_slow.step(h, torque);
            torque -= self.tip_in * rise.max(0.0);
        }
        if self.below_ceiling_nm > 0.0 {
            // Rounded over a few N·m, as breathing limits are.
            let ceiling = 100.0 - self.below_ceiling_nm;
            let over = (torque - ceiling) / 3.0;
            torque -= if over > 30.0 { 3.0 * over } else { 3.0 * over.exp().ln_1p() };
        }
        if self.misfire != 0.0 && self.bursts[((t / 0.25) as usize).min(self.bursts.len() - 1)] {
            // One of four cylinders, once in two revolutions.
            let cycle = (crank_rad / (2.0 * TAU)).rem_euclid(1.0);
            if cycle < 0.25 {
                torque -= self.misfire * torque.max(0.0) * (0.5 - 0.5 * (TAU * 4.0 * cycle).cos()) * 2.0;
            }
        }
        torque * (1.0 + self.gain + self.gain_per_rad_s * (omega_f - 150.0)) + self.bias_nm - self.accessory_w / omega_f.max(60.0)
    }
}
