//! Where the heat goes.
//!
//! In the library: the disc's share of the heat (a random curve of slip about its size), and the exchange of disc, body and air (a random curve of
//! engine speed about its size, or one that rises with it). Outside of it: a pressure plate that takes heat and gives it back late, a facing surface far
//! hotter than the disc while it slips, and moisture that has to boil away.

use super::Dice;
use super::maps::Curve;
use super::seen::Seen;
use crate::vehicle::Vehicle;

/// What the clutch is doing to its temperatures.
#[derive(Clone, Copy, Debug)]
pub struct Work {
    /// Housing air, °C.
    pub air: f64,
    /// Friction power, W.
    pub power_w: f64,
    /// Whether the facings touch.
    pub touching: bool,
    /// Flywheel and disc speed, rad/s.
    pub speeds: [f64; 2],
}

/// The thermal deviations and their states; W, J, °C.
#[derive(Clone, Debug, Default)]
pub struct Thermal {
    rough: f64,
    uneven: Curve,
    share: f64,
    exchange: f64,
    ventilation: f64,
    fan: Curve,
    plate_w_k: f64,
    plate_j_k: f64,
    plate_c: f64,
    flash_k_w: f64,
    flash_tau_s: f64,
    flash_k: f64,
    moisture: f64,
    boils_c: f64,
    /// The library's parameters that come nearest.
    pub seen: Seen,
}

impl Thermal {
    /// Sets the effect of this id, if it belongs here.
    pub fn draw(&mut self, id: &str, dice: &mut Dice) -> Option<String> {
        let shape = match id {
            "heat_partition" => {
                self.share = dice.either(0.15, 0.33);
                self.rough = dice.within(0.2, 0.4);
                self.uneven = Curve::draw(dice, 0.0, 130.0, 0.3);
                self.seen = Seen::of(&["share_change"]);
                format!("share {:.3}, uneven by {:.2} along slip", 0.5 + self.share, self.rough)
            }
            "clutch_cooling" => {
                let more = dice.magnitude(1.0, 2.6);
                self.rough = dice.within(0.15, 0.35);
                self.uneven = Curve::draw(dice, 60.0, 260.0, 0.4);
                match dice.shape(3) {
                    0 => self.exchange = more,
                    1 => self.exchange = -more / (1.0 + more),
                    _ => {
                        self.ventilation = 1.6 * more;
                        self.fan = Curve::rising(dice, 60.0, 260.0, 0.5);
                    }
                }
                if self.ventilation == 0.0 {
                    self.seen = Seen::of(&["body_factor"]);
                }
                format!("exchange {:+.2}, uneven by {:.2}, with speed {:+.2}", self.exchange, self.rough, self.ventilation)
            }
            "plate_heat_soak" => {
                self.plate_w_k = dice.magnitude(60.0, 150.0);
                self.plate_j_k = [90.0, 180.0][dice.shape(2)];
                format!("{:.0} W/K to a plate of {} J/K", self.plate_w_k, self.plate_j_k)
            }
            "flash_temperature" => {
                self.flash_k_w = dice.either(0.008, 0.016);
                // Hotter facings only; a colder one would be no physics.
                self.flash_k_w = self.flash_k_w.abs();
                self.flash_tau_s = [0.02, 0.15][dice.shape(2)];
                format!("{:.4} K/W, within {} s", self.flash_k_w, self.flash_tau_s)
            }
            "moisture_plateau" => {
                self.moisture = dice.magnitude(3.5, 8.0);
                self.boils_c = dice.within(50.0, 68.0);
                format!("{:.1} times the heat capacity about {:.0} °C", 1.0 + self.moisture, self.boils_c)
            }
            _ => return None,
        };
        Some(shape)
    }

    /// Before a recording; the plate starts between disc and body.
    pub fn rest(&mut self, theta_c: f64, theta_b: f64) {
        self.plate_c = 0.5 * (theta_c + theta_b);
        self.flash_k = 0.0;
    }

    /// Temperature at the facing, where friction is made.
    pub fn facing(&self, theta_c: f64) -> f64 {
        theta_c + self.flash_k
    }

    /// Rates of the disc's and the body's temperature, K/s.
    pub fn step(&mut self, h: f64, v: &Vehicle, theta: [f64; 2], work: Work) -> [f64; 2] {
        let [disc, body] = theta;
        let Work { air, power_w, touching, speeds } = work;
        let slip = (speeds[0] - speeds[1]).abs();
        if self.flash_k_w != 0.0 {
            self.flash_k += (self.flash_k_w * power_w - self.flash_k) * (1.0 - (-h / self.flash_tau_s).exp());
        }
        let extra = self.plate_w_k * (self.plate_c - disc);
        if self.plate_w_k != 0.0 {
            self.plate_c -= h * extra / self.plate_j_k;
        }
        let mut factor = 1.0;
        if self.exchange != 0.0 || self.ventilation != 0.0 {
            let more = self.exchange * (1.0 + self.rough * self.uneven.at(speeds[0])) + self.ventilation * self.fan.at(speeds[0]);
            factor = (1.0 + more).max(0.05);
        }
        // What boils takes heat within a few kelvin, on the way up and on the way down.
        let near = (disc - self.boils_c) / 10.0;
        let c_1 = v.c_1 * (1.0 + self.moisture * (-near * near).exp());
        if touching {
            let more = self.share * (1.0 + self.rough * self.uneven.at(slip));
            let share = (v.gamma_3 + if self.share == 0.0 { 0.0 } else { more }).clamp(0.05, 0.95);
            let across = v.gamma_1 * factor * (body - disc);
            if self.share != 0.0 {
                self.seen.mean(share - v.gamma_3, power_w * power_w);
            } else if self.exchange != 0.0 {
                self.seen.mean(factor, (body - disc).powi(2));
            }
            [(across + share * power_w + extra) / c_1, (-across + v.gamma_2 * (air - body) + (1.0 - share) * power_w) / v.c_b]
        } else {
            [(v.gamma_2 * factor * (air - disc) + extra) / c_1, 2.0 * v.gamma_2 * (air - body) / v.c_b]
        }
    }
}
