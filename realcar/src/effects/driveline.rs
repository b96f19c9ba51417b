//! Behind the disc: shafts, vehicle and road.
//!
//! In the library: compliance (soft about the middle, stiffer outwards, with friction in the damper), load (a random curve of speed about its size),
//! mass (with the rolling resistance of what is loaded, or behind tyres that creep). Outside of it: gusts, a brake that drags, a load that surges with
//! the wheel's angle, wheels that spin, and a road that undulates.

use super::maps::Curve;
use super::road::Road;
use super::seen::Seen;
use super::{Dice, smooth};
use crate::vehicle::Vehicle;

/// Torque per creep of a tyre, N·m·s/rad at the gearbox input.
const TYRE: f64 = 45.0;

/// Share of the inertia that turns with the wheels.
const WHEELS: f64 = 0.22;

/// A shaft between the disc and the vehicle.
#[derive(Clone, Copy, Debug)]
pub struct Shaft {
    /// Stiffness far from the middle, N·m/rad.
    pub k: f64,
    /// Damping, N·m·s/rad.
    pub d: f64,
    /// Share of the stiffness that is missing in the middle, and the angle over which it is, rad.
    pub soft: [f64; 2],
    /// Dry friction of the damper, N·m.
    pub rubs_nm: f64,
    /// Share of the inertia that sits on the disc's side.
    pub disc_share: f64,
}

impl Shaft {
    /// Torque of the spring for a twist in rad: what is missing fades with the angle.
    pub fn spring(&self, twist: f64) -> f64 {
        let [share, angle] = self.soft;
        self.k * (twist - share * angle * (twist / angle).atan())
    }

    /// What the damper takes at a rate of twist in rad/s.
    pub fn damper(&self, rate: f64) -> f64 {
        self.d * rate + self.rubs_nm * (rate / 1.5).tanh()
    }

    /// Energy in the spring, J.
    pub fn stored_j(&self, twist: f64) -> f64 {
        let [share, angle] = self.soft;
        let z = twist / angle;
        self.k * (0.5 * twist * twist - share * angle * angle * (z * z.atan() - 0.5 * (1.0 + z * z).ln()))
    }
}

/// The driveline's deviations and their states; N·m, rad/s.
#[derive(Clone, Debug, Default)]
pub struct Driveline {
    /// The shaft, if it twists.
    pub shaft: Option<Shaft>,
    mass: f64,
    behind_tyres: bool,
    rolls_nm: f64,
    towed_rad_s: f64,
    load_nm: f64,
    rough: f64,
    load_curve: Curve,
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
    grip_lost: f64,
    body_rad_s: f64,
    hills_nm: f64,
    hills_rad: f64,
    seed: u64,
    road: Road,
    /// The library's parameters that come nearest.
    pub seen: Seen,
}

impl Driveline {
    /// Sets the effect of this id, if it belongs here.
    pub fn draw(&mut self, id: &str, dice: &mut Dice) -> Option<String> {
        let shape = match id {
            "driveline_compliance" => {
                // Small compliance is a stiff shaft, and none is no shaft.
                let softness = dice.magnitude(1.0 / 190.0, 1.0 / 60.0);
                if softness > 0.0 {
                    let (share, zeta) = (dice.within(0.08, 0.2), dice.within(0.03, 0.12));
                    let k = 1.0 / softness;
                    let soft = [dice.within(0.15, 0.5), dice.within(0.06, 0.2)];
                    let d = 2.0 * zeta * (k * 0.578 * 0.3).sqrt();
                    self.shaft = Some(Shaft { k, d, soft, rubs_nm: dice.within(0.5, 2.0), disc_share: share });
                }
                format!("{:.3?}", self.shaft)
            }
            "vehicle_mass" => {
                self.mass = dice.magnitude(0.11, 0.28);
                match dice.shape(3) {
                    0 => self.mass *= -0.75,
                    1 => {}
                    _ => self.behind_tyres = true,
                }
                self.rolls_nm = dice.within(1.0, 4.0) * self.mass;
                self.seen = Seen::of(&["factor"]);
                format!("{:+.3} of the inertia{}", self.mass, if self.behind_tyres { ", behind tyres" } else { "" })
            }
            "road_load" => {
                self.load_nm = dice.magnitude(4.5, 11.0);
                self.rough = dice.within(0.12, 0.3);
                self.load_curve = Curve::draw(dice, 0.0, 220.0, 0.4);
                format!("{:+.2} N·m, uneven by {:.2} along speed", self.load_nm, self.rough)
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
            "wheel_spin" => {
                self.grip_lost = dice.magnitude(1.0 / 46.0, 1.0 / 26.0);
                format!("wheels spin above {:.1} N·m", 1.0 / self.grip_lost)
            }
            "undulating_road" => {
                self.hills_nm = dice.magnitude(4.0, 8.0);
                self.hills_rad = dice.within(90.0, 260.0);
                format!("{:.2} N·m over {:.0} rad", self.hills_nm, self.hills_rad)
            }
            _ => return None,
        };
        Some(shape)
    }

    /// Before a recording of this length.
    pub fn rest(&mut self, omega_c: f64, recording: u64, length_s: f64) {
        let mut road = Road::new(self.seed, recording);
        (self.towed_rad_s, self.body_rad_s) = (omega_c, omega_c);
        // A drive is longer than a launch, and so is what rubs in it.
        let longer = (length_s / 6.0).max(1.0);
        let start = longer * road.within(0.6, 2.4);
        self.brake_s = [start, start + longer * road.within(0.7, 1.6)];
        self.gust = road.normal();
        self.gust_filtered = self.gust;
        self.road = road;
    }

    /// Inertia of disc and vehicle, as far as it turns with the gearbox input, kg·m².
    pub fn inertia(&self, v: &Vehicle) -> f64 {
        let own = if self.grip_lost > 0.0 { WHEELS } else { 1.0 };
        v.j_c * (own + if self.behind_tyres { 0.0 } else { self.mass })
    }

    /// Load at the gearbox input, N·m, `angle` being the vehicle's, rad.
    pub fn load(&mut self, h: f64, t: f64, v: &Vehicle, omega: f64, angle: f64) -> f64 {
        let sign = (omega / v.omega_l).tanh();
        let mut load = v.t_l0 * sign + v.k_l * omega * omega.abs() + v.b_c * omega;
        if self.load_nm != 0.0 {
            load += self.load_nm * sign * (1.0 + self.rough * self.load_curve.at(omega.abs()));
        }
        if self.mass != 0.0 {
            self.seen.mean(1.0 + self.mass, 1.0);
            load += self.rolls_nm * sign;
            if self.behind_tyres {
                // A tyre creeps in proportion to a small pull, and more under a large one.
                let creep = omega - self.towed_rad_s;
                let pull = TYRE * creep / (1.0 + 0.5 * creep.abs());
                self.towed_rad_s += h * pull / (self.mass * v.j_c);
                load += pull;
            }
        }
        if self.grip_lost > 0.0 {
            let pull = TYRE * (omega - self.body_rad_s);
            let pull = if pull > 0.0 { (pull * self.grip_lost).tanh() / self.grip_lost } else { pull };
            self.body_rad_s += h * pull / ((1.0 - WHEELS) * v.j_c);
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
        if self.hills_nm != 0.0 {
            let z = std::f64::consts::TAU * angle / self.hills_rad;
            load += self.hills_nm * (z.sin() + 0.5 * (2.3 * z).sin());
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
