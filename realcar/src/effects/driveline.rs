//! Behind the disc: shafts, vehicle and road.
//!
//! In the library: compliance, load, mass. Outside of it: gusts, a brake that drags, and a load that surges with the
//! wheel's angle.

use super::road::Road;
use super::{Dice, smooth};
use crate::vehicle::Vehicle;

/// A shaft between the disc and the vehicle.
#[derive(Clone, Copy, Debug)]
pub struct Shaft {
    /// Stiffness, N·m/rad.
    pub k: f64,
    /// Damping, N·m·s/rad.
    pub d: f64,
    /// Half-angle within which it is softer, rad, and by which factor.
    pub soft_rad: f64,
    /// Factor on the stiffness within the half-angle.
    pub soft: f64,
    /// Share of the inertia that sits on the disc's side.
    pub disc_share: f64,
}

impl Shaft {
    /// Torque for a twist in rad and its rate.
    pub fn torque(&self, twist: f64, rate: f64) -> f64 {
        let inner = twist.clamp(-self.soft_rad, self.soft_rad);
        self.k * (self.soft * inner + (twist - inner)) + self.d * rate
    }
}

/// The driveline's deviations and their states; N·m, rad/s.
#[derive(Clone, Debug, Default)]
pub struct Driveline {
    /// The shaft, if it twists.
    pub shaft: Option<Shaft>,
    mass: f64,
    coupled: f64,
    towed_rad_s: f64,
    load_nm: f64,
    load_per_rad_s: f64,
    gust_nm: f64,
    gust_tau_s: f64,
    gust_blows: bool,
    gust: f64,
    gust_filtered: f64,
    brake_nm: f64,
    brake_kind: usize,
    brake_s: [f64; 2],
    surge_nm: f64,
    surge_ratio: f64,
    seed: u64,
    road: Road,
}

impl Driveline {
    /// Sets the effect of this id, if it belongs here.
    pub fn draw(&mut self, id: &str, dice: &mut Dice) -> Option<String> {
        let shape = match id {
            "driveline_compliance" => {
                // Small compliance is a stiff shaft, and none is no shaft.
                let softness = dice.magnitude(1.0 / 190.0, 1.0 / 60.0);
                if softness > 0.0 {
                    let (share, zeta) = (dice.within(0.08, 0.2), dice.within(0.04, 0.14));
                    let k = 1.0 / softness;
                    let soft = [1.0, 0.5][dice.shape(2)];
                    let d = 2.0 * zeta * (k * 0.578 * 0.3).sqrt();
                    self.shaft = Some(Shaft { k, d, soft_rad: 0.12, soft, disc_share: share });
                }
                format!("{:.3?}", self.shaft)
            }
            "vehicle_mass" => {
                self.mass = dice.magnitude(0.11, 0.28);
                match dice.shape(3) {
                    0 => self.mass *= -0.75,
                    1 => {}
                    _ => self.coupled = 45.0,
                }
                format!("{:+.3} of the inertia{}", self.mass, if self.coupled > 0.0 { ", behind slipping tyres" } else { "" })
            }
            "road_load" => {
                self.load_nm = dice.magnitude(4.5, 11.0);
                match dice.shape(3) {
                    0 => {}
                    1 => self.load_per_rad_s = 0.0015 * self.load_nm,
                    _ => (self.load_nm, self.load_per_rad_s) = (0.8 * self.load_nm, 0.002 * self.load_nm),
                }
                format!("{:+.2} N·m, {:.4} N·m·s/rad", self.load_nm, self.load_per_rad_s)
            }
            "gusts" => {
                self.gust_nm = dice.magnitude(3.5, 8.0);
                self.gust_tau_s = dice.within(0.15, 0.6);
                self.gust_blows = dice.shape(2) == 1;
                self.seed = dice.seed();
                format!("{:.2} N·m rms over {:.2} s{}", self.gust_nm, self.gust_tau_s, if self.gust_blows { ", in blows" } else { "" })
            }
            "dragging_brake" => {
                self.brake_nm = dice.magnitude(6.0, 14.0);
                self.brake_kind = dice.shape(3);
                self.seed = dice.seed();
                format!("{:.2} N·m, {}", self.brake_nm, ["seizes", "lets go", "rubs for a while"][self.brake_kind])
            }
            "surging_load" => {
                self.surge_nm = dice.magnitude(5.0, 11.0);
                self.surge_ratio = [1.0 / 8.0, 1.0 / 13.0][dice.shape(2)];
                format!("{:.2} N·m once per wheel turn, ratio {:.3}", self.surge_nm, self.surge_ratio)
            }
            _ => return None,
        };
        Some(shape)
    }

    /// Before a recording.
    pub fn rest(&mut self, omega_c: f64, recording: u64, length_s: f64) {
        let mut road = Road::new(self.seed, recording);
        self.towed_rad_s = omega_c;
        // A drive is longer than a launch, and so is what rubs in it.
        let longer = (length_s / 6.0).max(1.0);
        let start = longer * road.within(0.6, 2.4);
        self.brake_s = [start, start + longer * road.within(0.7, 1.6)];
        self.gust = road.normal();
        self.gust_filtered = self.gust;
        self.road = road;
    }

    /// Inertia of disc and vehicle, kg·m².
    pub fn inertia(&self, v: &Vehicle) -> f64 {
        v.j_c * (1.0 + if self.coupled > 0.0 { 0.0 } else { self.mass })
    }

    /// Load at the gearbox input, N·m, `angle` being the vehicle's, rad.
    pub fn load(&mut self, h: f64, t: f64, v: &Vehicle, omega: f64, angle: f64) -> f64 {
        let sign = (omega / v.omega_l).tanh();
        let mut load = v.t_l0 * sign + v.k_l * omega * omega.abs() + v.b_c * omega;
        load += self.load_nm * sign + self.load_per_rad_s * omega;
        if self.coupled > 0.0 {
            let pull = self.coupled * (omega - self.towed_rad_s);
            self.towed_rad_s += h * pull / (self.mass * v.j_c);
            load += pull;
        }
        if self.gust_nm != 0.0 {
            load += self.blow(h) * sign;
        }
        if self.brake_nm != 0.0 {
            let on = smooth((t - self.brake_s[0]) / 0.3);
            let off = smooth((t - self.brake_s[1]) / 0.3);
            load += self.brake_nm * sign * [on, 1.0 - on, on - off][self.brake_kind];
        }
        if self.surge_nm != 0.0 {
            load += self.surge_nm * sign * (self.surge_ratio * angle).sin();
        }
        load
    }

    fn blow(&mut self, h: f64) -> f64 {
        let a = (-h / self.gust_tau_s).exp();
        let z = self.road.normal();
        self.gust = a * self.gust + (1.0 - a * a).sqrt() * z;
        self.gust_filtered += h / 0.05 * (self.gust - self.gust_filtered);
        let g = self.gust_filtered;
        // Blows: calm below a threshold, strong above it.
        self.gust_nm * if self.gust_blows { 2.2 * (g - 0.4).max(0.0) } else { g }
    }
}
