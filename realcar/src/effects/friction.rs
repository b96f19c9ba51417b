//! Between the clamp force and the torque.
//!
//! In the library: level (a random map of slip and temperature about its size, and from recording to recording), fade (some losses at random
//! temperatures), slip gradient (a random curve that falls or rises towards standstill), drag (a random curve of slip), judder (two harmonics, fading along a
//! random curve of slip). Outside of it: a facing that wears in within a run, one that is damp until work has dried it, and one that groans.

use super::Dice;
use super::maps::{Curve, Surface};
use super::road::Road;
use super::seen::Seen;
use std::f64::consts::TAU;

/// Slip over which curves are drawn, rad/s.
const SLIPS: [f64; 2] = [0.0, 130.0];

/// Friction that is lost with temperature: depth, place, width.
type Loss = [f64; 3];

/// The facing's deviations and their states; N·m, rad/s, °C, J.
#[derive(Clone, Debug, Default)]
pub struct Friction {
    rough: f64,
    level: f64,
    level_map: Surface,
    level_wanders: f64,
    level_now: f64,
    losses: Vec<Loss>,
    gradient: f64,
    gradient_curve: Curve,
    drag_nm: f64,
    drag_even: f64,
    drag_curve: Curve,
    judder: f64,
    judder_order: f64,
    judder_phases: [f64; 2],
    judder_second: f64,
    judder_fades: f64,
    judder_curve: Curve,
    wear_in: f64,
    wear_in_j: f64,
    damp: f64,
    damp_by_work: bool,
    damp_scale: f64,
    worked_j: f64,
    slipped_s: f64,
    groan: f64,
    groan_hz: f64,
    groan_below: f64,
    clock_s: f64,
    seed: u64,
    /// The library's parameters that come nearest.
    pub seen: Seen,
}

impl Friction {
    /// Sets the effect of this id, if it belongs here.
    pub fn draw(&mut self, id: &str, dice: &mut Dice) -> Option<String> {
        let shape = match id {
            "friction_level" => {
                self.level = dice.either(0.08, 0.19);
                self.level_wanders = [0.0, 0.05][dice.shape(2)];
                self.rough = dice.within(0.08, 0.2);
                self.level_map = Surface::draw(dice, SLIPS, [15.0, 160.0], 0.5);
                self.seed = dice.seed();
                self.seen = Seen::of(&["factor"]);
                format!(
                    "factor {:.3}, uneven by {:.2} of it, ±{} from recording to recording",
                    1.0 + self.level,
                    self.rough,
                    self.level_wanders
                )
            }
            "friction_fade" => {
                let depth = dice.magnitude(0.16, 0.4);
                let share = dice.within(0.35, 0.75);
                let first = [depth * share, dice.within(85.0, 115.0), dice.within(4.0, 12.0)];
                let second = [depth * (1.0 - share), first[1] + dice.within(12.0, 40.0), dice.within(4.0, 16.0)];
                self.losses = vec![first, second];
                format!("{:.3?}", self.losses)
            }
            "friction_slip_gradient" => {
                self.gradient = dice.either(0.26, 0.62);
                // Right where friction was rated, at slip; otherwise towards standstill: a level that is off is another effect.
                let reach = [dice.within(25.0, 70.0), dice.within(90.0, 150.0)][dice.shape(2)];
                let roughness = dice.within(0.5, 1.1);
                self.gradient_curve = Curve::rising(dice, 0.0, reach, roughness);
                format!("{:+.3} at standstill, none from {reach:.0} rad/s", self.gradient)
            }
            "clutch_drag" => {
                self.drag_nm = dice.magnitude(1.8, 4.5);
                self.drag_even = dice.within(0.0, 1.0);
                self.drag_curve = Curve::rising(dice, 0.0, 130.0, 0.7);
                self.seen = Seen::of(&["torque", "viscosity"]);
                format!("{:.3} N·m, {:.2} of it at any slip", self.drag_nm, self.drag_even)
            }
            "judder" => {
                // The faster it pulsates the less the speeds show of it.
                let (order, more) = [(0.5, 1.0), (1.0, 1.3), (2.0, 1.8)][dice.shape(3)];
                self.judder = more * dice.magnitude(0.12, 0.30);
                self.judder_order = order;
                self.judder_phases = [dice.within(0.0, TAU), dice.within(0.0, TAU)];
                self.judder_second = dice.within(0.15, 0.4);
                self.judder_fades = dice.within(0.0, 0.85);
                self.judder_curve = Curve::rising(dice, 0.0, 140.0, 0.7);
                format!(
                    "{:.3} of the torque, order {order}, twice that {:.2}, fades by {:.2}",
                    self.judder, self.judder_second, self.judder_fades
                )
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
            "groan" => {
                self.groan = dice.magnitude(0.22, 0.42);
                self.groan_hz = dice.within(5.0, 9.0);
                self.groan_below = dice.within(30.0, 60.0);
                format!("±{:.3} at {:.1} Hz below {:.0} rad/s", self.groan, self.groan_hz, self.groan_below)
            }
            _ => return None,
        };
        Some(shape)
    }

    /// Before a recording.
    pub fn rest(&mut self, recording: u64) {
        let wanders = if self.level_wanders > 0.0 { Road::new(self.seed, recording).within(-1.0, 1.0) } else { 0.0 };
        self.level_now = self.level * (1.0 + self.level_wanders * wanders);
        (self.worked_j, self.slipped_s, self.clock_s) = (0.0, 0.0, 0.0);
    }

    /// Counts the work done on the facing.
    pub fn work(&mut self, h: f64, power_w: f64) {
        self.worked_j += h * power_w.max(0.0);
        self.clock_s += h;
        if power_w > 20.0 {
            self.slipped_s += h;
        }
    }

    /// Factor on the friction coefficient.
    pub fn factor(&mut self, slip: f64, theta: f64, slip_angle: f64, force_n: f64) -> f64 {
        let omega = slip.abs();
        let mut f = 1.0;
        if self.level != 0.0 {
            f += self.level_now * (1.0 + self.rough * self.level_map.at(omega, theta));
            if omega > 1.0 {
                self.seen.mean(f, force_n * force_n);
            }
        }
        for [depth, place, wide] in &self.losses {
            // A loss that sets in within a width and stays.
            f -= depth * (0.5 + 0.5 * ((theta - place) / wide).tanh());
        }
        if self.gradient != 0.0 {
            f *= (1.0 + self.gradient * (1.0 - self.gradient_curve.at(omega))).max(0.3);
        }
        if self.judder != 0.0 {
            let [first, second] = self.judder_phases;
            let angle = self.judder_order * slip_angle;
            let wave = (angle + first).sin() + self.judder_second * (2.0 * angle + second).sin();
            f *= 1.0 + self.judder * (1.0 - self.judder_fades * self.judder_curve.at(omega)) * wave;
        }
        f.max(0.1) * self.outside(omega)
    }

    fn outside(&self, omega: f64) -> f64 {
        let mut f = 1.0;
        if self.wear_in != 0.0 {
            f *= 1.0 + self.wear_in * (0.5 - (-self.worked_j / self.wear_in_j).exp());
        }
        if self.damp != 0.0 {
            let done = if self.damp_by_work { self.worked_j } else { self.slipped_s };
            f *= 1.0 - self.damp * (-done / self.damp_scale).exp();
        }
        if self.groan != 0.0 {
            let low = 1.0 - super::smooth((omega - 0.7 * self.groan_below) / (0.3 * self.groan_below));
            f *= 1.0 + self.groan * low * (TAU * self.groan_hz * self.clock_s).sin();
        }
        f
    }

    /// Drag by magnitude at a slip, N·m; it gives way as the faces press.
    pub fn drag(&mut self, force_n: f64, slip: f64) -> f64 {
        if self.drag_nm == 0.0 {
            return 0.0;
        }
        let omega = slip.abs();
        let open = 1.0 / (1.0 + (force_n / 220.0).powi(2));
        let drag = self.drag_nm * (self.drag_even + 1.6 * (1.0 - self.drag_even) * self.drag_curve.at(omega)) * open;
        if force_n <= 0.0 && omega > 8.0 {
            self.seen.count([1.0, omega], drag, 1.0);
        }
        drag
    }
}
