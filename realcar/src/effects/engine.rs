//! Between the torque that the ECU reports and the one at the crankshaft.
//!
//! In the library: gain (a random map of torque and speed about its size), bias (a random function of speed about its size, or a pump that takes
//! more the faster it turns), lag (two storages in a row, emptied the faster the engine turns). Outside of it: a weak cylinder, the dip of the
//! air path at tip-in, a ceiling that the engine can't pass however much is reported, a compressor that comes and goes, and a spark that is
//! held back under load.

use super::maps::{Curve, Surface};
use super::road::Road;
use super::seen::Seen;
use super::{Dice, smooth};
use std::f64::consts::TAU;

/// Torque and speed over which maps are drawn, N·m and rad/s.
const TORQUES: [f64; 2] = [-20.0, 110.0];
const SPEEDS: [f64; 2] = [60.0, 300.0];

/// The engine's deviations and their states; torques in N·m, speeds in rad/s.
#[derive(Clone, Debug, Default)]
pub struct Engine {
    gain: f64,
    gain_map: Surface,
    bias_nm: f64,
    bias_map: Curve,
    pump_nm: f64,
    pump: Curve,
    lag_s: f64,
    lag_share: f64,
    lag_map: Curve,
    behind: [f64; 2],
    rough: f64,
    misfire: f64,
    burst_share: f64,
    seed: u64,
    bursts: Vec<bool>,
    tip_in: f64,
    tip_s: [f64; 2],
    tip: [f64; 2],
    below_ceiling_nm: f64,
    compressor_nm: f64,
    compressor_s: [f64; 2],
    compressor_at_s: f64,
    retard: f64,
    retard_s: f64,
    retarded: f64,
    /// The library's parameters that come nearest.
    pub seen: Seen,
}

impl Engine {
    /// Sets the effect of this id, if it belongs here.
    pub fn draw(&mut self, id: &str, dice: &mut Dice) -> Option<String> {
        let shape = match id {
            "engine_torque_gain" => {
                self.gain = dice.either(0.06, 0.16);
                self.rough = dice.within(0.15, 0.3);
                self.gain_map = Surface::draw(dice, TORQUES, SPEEDS, 0.4);
                self.seen = Seen::of(&["gain"]);
                format!("factor {:.3}, uneven by {:.2} of it", 1.0 + self.gain, self.rough)
            }
            "engine_torque_bias" => {
                self.rough = dice.within(0.15, 0.3);
                if dice.shape(2) == 0 {
                    self.bias_nm = dice.either(2.3, 5.5);
                    self.bias_map = Curve::draw(dice, SPEEDS[0], SPEEDS[1], 0.2);
                    self.seen = Seen::of(&["torque"]);
                    format!("{:.2} N·m, uneven by {:.2} of it", self.bias_nm, self.rough)
                } else {
                    self.pump_nm = dice.magnitude(2.8, 6.0);
                    self.pump = Curve::rising(dice, SPEEDS[0], 260.0, 0.6);
                    format!("a pump of {:.2} N·m that grows with speed", self.pump_nm)
                }
            }
            "engine_torque_lag" => {
                self.lag_s = dice.magnitude(0.045, 0.12);
                self.lag_share = dice.within(0.15, 0.5);
                self.rough = dice.within(0.1, 0.3);
                self.lag_map = Curve::draw(dice, TORQUES[0], TORQUES[1], 0.4);
                self.seen = Seen::of(&["time_constant"]);
                format!("{:.4} s at 150 rad/s, {:.2} of it first", self.lag_s, self.lag_share)
            }
            "misfire" => {
                self.misfire = dice.magnitude(0.35, 0.9);
                self.burst_share = if dice.shape(2) == 0 { 1.0 } else { dice.within(0.35, 0.6) };
                self.seed = dice.seed();
                format!("cylinder loses {:.2} for {:.2} of the time", self.misfire, self.burst_share)
            }
            "tip_in_dip" => {
                self.tip_in = dice.magnitude(0.35, 0.8);
                self.tip_s = if dice.shape(2) == 0 { [0.06, 0.3] } else { [0.12, 0.45] };
                format!("dip {:.2} of a rise between {:?} s", self.tip_in, self.tip_s)
            }
            "torque_ceiling" => {
                self.below_ceiling_nm = dice.magnitude(18.0, 45.0);
                format!("ceiling {:.1} N·m below 100 N·m", self.below_ceiling_nm)
            }
            "compressor_cycling" => {
                self.compressor_nm = dice.magnitude(5.0, 9.0);
                self.compressor_s = [dice.within(0.5, 1.3), dice.within(0.5, 1.6)];
                self.seed = dice.seed();
                format!("{:.2} N·m for {:.2} s, off for {:.2} s", self.compressor_nm, self.compressor_s[0], self.compressor_s[1])
            }
            "knock_retard" => {
                self.retard = dice.magnitude(0.22, 0.42);
                self.retard_s = dice.within(0.35, 0.8);
                format!("up to {:.2} of the torque within {:.2} s above 32 N·m", self.retard, self.retard_s)
            }
            _ => return None,
        };
        Some(shape)
    }

    /// At rest with this reported torque.
    pub fn rest(&mut self, reported_nm: f64, recording: u64) {
        (self.behind, self.tip, self.retarded) = ([reported_nm; 2], [reported_nm; 2], 0.0);
        let mut road = Road::new(self.seed, recording);
        // One decision each quarter second.
        self.bursts = (0..400).map(|_| road.happens(self.burst_share)).collect();
        self.compressor_at_s = road.within(0.0, self.compressor_s[0] + self.compressor_s[1]);
    }

    /// Torque at the crankshaft, before the tolerances of its report.
    pub fn step(&mut self, h: f64, t: f64, reported_nm: f64, omega_f: f64, crank_rad: f64) -> f64 {
        let mut torque = self.lagged(h, reported_nm, omega_f);
        if self.tip_in != 0.0 {
            for (y, tau) in self.tip.iter_mut().zip(self.tip_s) {
                *y += h / tau * (torque - *y);
            }
            torque -= self.tip_in * (self.tip[0] - self.tip[1]).max(0.0);
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
        if self.retard != 0.0 {
            // Held back while it pulls, given back at a third of that pace.
            let (aim, tau) = if torque > 32.0 { (1.0, self.retard_s) } else { (0.0, 3.0 * self.retard_s) };
            self.retarded += h / tau * (aim - self.retarded);
            torque -= self.retard * self.retarded * torque.max(0.0);
        }
        if self.compressor_nm != 0.0 {
            let [on, off] = self.compressor_s;
            let phase = (t + self.compressor_at_s).rem_euclid(on + off);
            torque -= self.compressor_nm * (smooth(phase / 0.06) - smooth((phase - on) / 0.06));
        }
        torque + self.off(torque, omega_f)
    }

    /// Gain, bias and pump.
    fn off(&mut self, torque: f64, omega_f: f64) -> f64 {
        let mut off = 0.0;
        if self.gain != 0.0 {
            let gain = self.gain * (1.0 + self.rough * self.gain_map.at(torque, omega_f));
            self.seen.mean(1.0 + gain, torque * torque);
            off += gain * torque;
        }
        if self.bias_nm != 0.0 {
            let bias = self.bias_nm * (1.0 + self.rough * self.bias_map.at(omega_f));
            self.seen.mean(bias, 1.0);
            off += bias;
        }
        off - if self.pump_nm != 0.0 { self.pump_nm * (0.35 + 0.65 * self.pump.at(omega_f)) } else { 0.0 }
    }

    /// Two storages in a row; both empty the faster the faster the engine breathes.
    fn lagged(&mut self, h: f64, reported_nm: f64, omega_f: f64) -> f64 {
        if self.lag_s <= 0.0 {
            return reported_nm;
        }
        let pace = (0.6 + 0.4 * 150.0 / omega_f.max(60.0)) * (1.0 + self.rough * self.lag_map.at(reported_nm)).max(0.3);
        let tau = self.lag_s * pace;
        let before = self.behind[1];
        self.behind[0] += (reported_nm - self.behind[0]) * (1.0 - (-h / (tau * self.lag_share)).exp());
        self.behind[1] += (self.behind[0] - self.behind[1]) * (1.0 - (-h / (tau * (1.0 - self.lag_share))).exp());
        self.seen.mean(tau, ((self.behind[1] - before) / h).powi(2));
        self.behind[1]
    }
}
