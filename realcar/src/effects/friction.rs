//! Between the clamp force and the torque.
//!
//! In the library: level, fade, slip gradient, drag, judder. Outside of it: a facing that wears in within a
//! run, and one that is damp until work has dried it.

use super::Dice;
use super::road::Road;
use std::f64::consts::TAU;

/// Fade: how much friction is lost at the end, and on which way.
#[derive(Clone, Copy, Debug, Default)]
enum Fade {
    #[default]
    None,
    Step {
        loss: f64,
        at: f64,
        wide: f64,
    },
    Slope {
        per_k: f64,
        from: f64,
    },
}

/// How friction depends otherwise on slip.
#[derive(Clone, Copy, Debug, Default)]
enum Slip {
    #[default]
    None,
    Stribeck {
        more: f64,
        speed: f64,
    },
    Slope {
        per_rad_s: f64,
        rated: f64,
    },
}

/// Torque with the clutch open.
#[derive(Clone, Copy, Debug, Default)]
enum Drag {
    #[default]
    None,
    Constant(f64),
    Viscous(f64),
}

/// The facing's deviations and their states; N·m, rad/s, °C, J.
#[derive(Clone, Debug, Default)]
pub struct Friction {
    level: f64,
    level_wanders: f64,
    level_seed: u64,
    level_now: f64,
    fade: Fade,
    slip: Slip,
    drag: Drag,
    judder: f64,
    judder_order: f64,
    judder_phase: f64,
    judder_fades_rad_s: f64,
    wear_in: f64,
    wear_in_j: f64,
    damp: f64,
    damp_by_work: bool,
    damp_scale: f64,
    worked_j: f64,
    slipped_s: f64,
}

impl Friction {
    /// Sets the effect of this id, if it belongs here.
    pub fn draw(&mut self, id: &str, dice: &mut Dice) -> Option<String> {
        let shape = match id {
            "friction_level" => {
                self.level = dice.either(0.08, 0.19);
                self.level_wanders = [0.0, 0.05][dice.shape(2)];
                self.level_seed = dice.seed();
                format!("factor {:.3}, change ±{} of it from recording to recording", 1.0 + self.level, self.level_wanders)
            }
            "friction_fade" => {
                self.fade = if dice.shape(2) == 0 {
                    Fade::Step { loss: dice.magnitude(0.16, 0.38), at: dice.within(95.0, 125.0), wide: dice.within(6.0, 14.0) }
                } else {
                    Fade::Slope { per_k: dice.magnitude(0.003, 0.007), from: dice.within(80.0, 105.0) }
                };
                format!("{:.4?}", self.fade)
            }
            "friction_slip_gradient" => {
                self.slip = if dice.shape(2) == 0 {
                    Slip::Stribeck { more: dice.either(0.26, 0.7), speed: dice.within(12.0, 55.0) }
                } else {
                    Slip::Slope { per_rad_s: dice.either(0.0018, 0.0044), rated: [0.0, 15.0][dice.shape(2)] }
                };
                format!("{:.5?}", self.slip)
            }
            "clutch_drag" => {
                let d = dice.magnitude(1.8, 4.5);
                self.drag = if dice.shape(2) == 0 { Drag::Constant(d) } else { Drag::Viscous(d / 80.0) };
                format!("{:.4?}", self.drag)
            }
            "judder" => {
                // The faster it pulsates the less the speeds show of it.
                let (order, more) = [(0.5, 1.0), (1.0, 1.3), (2.0, 1.8)][dice.shape(3)];
                self.judder = more * dice.magnitude(0.12, 0.30);
                self.judder_order = order;
                self.judder_phase = dice.within(0.0, TAU);
                self.judder_fades_rad_s = [f64::INFINITY, 90.0][dice.shape(2)];
                format!("{:.3} of the torque, order {}, fades {}", self.judder, self.judder_order, self.judder_fades_rad_s)
            }
            "wear_in" => {
                self.wear_in = dice.either(0.2, 0.42);
                self.wear_in_j = [2500.0, 5000.0][dice.shape(2)];
                format!("{:+.3} within {} J", self.wear_in, self.wear_in_j)
            }
            "damp_facing" => {
                self.damp = dice.magnitude(0.16, 0.36);
                self.damp_by_work = dice.shape(2) == 0;
                self.damp_scale = if self.damp_by_work { dice.within(800.0, 2000.0) } else { dice.within(0.3, 0.7) };
                format!("-{:.3} at first, scale {:.1}", self.damp, self.damp_scale)
            }
            _ => return None,
        };
        Some(shape)
    }

    /// Before a recording.
    pub fn rest(&mut self, recording: u64) {
        let wanders = if self.level_wanders > 0.0 { Road::new(self.level_seed, recording).within(-1.0, 1.0) } else { 0.0 };
        self.level_now = self.level * (1.0 + self.level_wanders * wanders);
        (self.worked_j, self.slipped_s) = (0.0, 0.0);
    }

    /// Counts the work done on the facing.
    pub fn work(&mut self, h: f64, power_w: f64) {
        self.worked_j += h * power_w.max(0.0);
        if power_w > 20.0 {
            self.slipped_s += h;
        }
    }

    /// Factor on the friction coefficient.
    pub fn factor(&self, slip: f64, theta: f64, slip_angle: f64) -> f64 {
        let omega = slip.abs();
        let mut f = 1.0 + self.level_now;
        f *= match self.fade {
            Fade::None => 1.0,
            Fade::Step { loss, at, wide } => 1.0 - loss / (1.0 + (-(theta - at) / wide).exp()),
            Fade::Slope { per_k, from } => (1.0 - per_k * (theta - from).max(0.0)).max(0.35),
        };
        f *= match self.slip {
            Slip::None => 1.0,
            // Right where friction was rated, at slip here and near standstill below: a level that is off is another effect.
            Slip::Stribeck { more, speed } => 1.0 + more * (-omega / speed).exp(),
            Slip::Slope { per_rad_s, rated } => (1.0 - per_rad_s * (omega - rated)).clamp(0.5, 1.6),
        };
        if self.judder != 0.0 {
            let fading = 1.0 / (1.0 + (omega / self.judder_fades_rad_s).powi(2));
            f *= 1.0 + self.judder * fading * (self.judder_order * slip_angle + self.judder_phase).sin();
        }
        f * self.outside()
    }

    fn outside(&self) -> f64 {
        let mut f = 1.0;
        if self.wear_in != 0.0 {
            f *= 1.0 + self.wear_in * (0.5 - (-self.worked_j / self.wear_in_j).exp());
        }
        if self.damp != 0.0 {
            let done = if self.damp_by_work { self.worked_j } else { self.slipped_s };
            f *= 1.0 - self.damp * (-done / self.damp_scale).exp();
        }
        f
    }

    /// Drag: a constant part, by magnitude, and a viscous one per rad/s.
    pub fn drag(&self, force_n: f64) -> (f64, f64) {
        let open = (-force_n / 250.0).exp();
        match self.drag {
            Drag::None => (0.0, 0.0),
            Drag::Constant(d) => (d * open, 0.0),
            Drag::Viscous(c) => (0.0, c),
        }
    }
}
