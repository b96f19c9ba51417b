//! Where the heat goes.
//!
//! In the library: the disc's share of the heat, and the exchange of disc, body and air. Outside of it: a pressure plate
//! that takes heat and gives it back late, and a facing surface far hotter than the disc while it slips.

use super::Dice;
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
    share: f64,
    share_per_rad_s: f64,
    exchange: f64,
    ventilation: f64,
    plate_w_k: f64,
    plate_j_k: f64,
    plate_c: f64,
    flash_k_w: f64,
    flash_tau_s: f64,
    flash_k: f64,
}

impl Thermal {
    /// Sets the effect of this id, if it belongs here.
    pub fn draw(&mut self, id: &str, dice: &mut Dice) -> Option<String> {
        let shape = match id {
            "heat_partition" => {
                self.share = dice.either(0.15, 0.33);
                self.share_per_rad_s = if dice.shape(2) == 0 { 0.0 } else { 0.4 * self.share / 100.0 };
                format!("share {:.3}, {:.5} per rad/s", 0.5 + self.share, self.share_per_rad_s)
            }
            "clutch_cooling" => {
                let more = dice.magnitude(1.0, 2.6);
                match dice.shape(3) {
                    0 => self.exchange = more,
                    1 => self.exchange = -more / (1.0 + more),
                    _ => self.ventilation = more,
                }
                format!("exchange {:+.2}, with speed {:+.2}", self.exchange, self.ventilation)
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
        let factor = 1.0 + self.exchange + self.ventilation * speeds[0] / 150.0;
        if touching {
            let share = (v.gamma_3 + self.share + self.share_per_rad_s * (slip - 60.0)).clamp(0.05, 0.95);
            let across = v.gamma_1 * factor * (body - disc);
            [(across + share * power_w + extra) / v.c_1, (-across + v.gamma_2 * (air - body) + (1.0 - share) * power_w) / v.c_b]
        } else {
            [(v.gamma_2 * factor * (air - disc) + extra) / v.c_1, 2.0 * v.gamma_2 * (air - body) / v.c_b]
        }
    }
}
