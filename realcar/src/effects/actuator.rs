//! Between the position that is commanded and the one of the bearing.
//!
//! In the library: delay (which wanders, and waits for a slot of the bus), rate limit (an orifice: the last of the way goes with the root of the
//! distance, and the pace differs along the travel), lag (two in a row, slower in some places), backlash (wider in some places). Outside of it: a
//! bearing that sticks, one that hunts about its target, one that leaks back while it is held, and one that moves in steps.

use super::Dice;
use super::maps::Curve;
use super::ring::Ring;
use super::road::Road;
use super::seen::Seen;
use std::f64::consts::TAU;

/// Positions over which curves are drawn, mm.
const TRAVEL: [f64; 2] = [3.0, 9.0];

/// The actuator's deviations and their states; mm and s.
#[derive(Clone, Debug, Default)]
pub struct Actuator {
    map: Curve,
    rough: f64,
    delay_s: f64,
    slot_s: f64,
    slot_left_s: f64,
    sent: f64,
    line: Ring,
    pace_s_mm: f64,
    pace_more_up: f64,
    orifice_mm: f64,
    limited: f64,
    lag_s: f64,
    lag_share: f64,
    lag_more_up: f64,
    behind: [f64; 2],
    half_play: f64,
    play_power: f64,
    loose: f64,
    last: f64,
    stick_mm: f64,
    stick_zone: f64,
    moving: bool,
    held: f64,
    hunt_mm: f64,
    hunt_hz: f64,
    hunt_phase: f64,
    hunt_settles_s: f64,
    still_s: f64,
    hunt_last: f64,
    leak_mm_s: f64,
    leak_tau_s: f64,
    leaked: f64,
    notch_mm: f64,
    notch: f64,
    notched: f64,
    seed: u64,
    drift: [f64; 4],
    /// The library's parameters that come nearest.
    pub seen: Seen,
}

impl Actuator {
    /// Sets the effect of this id, if it belongs here.
    pub fn draw(&mut self, id: &str, dice: &mut Dice) -> Option<String> {
        let mut uneven = |dice: &mut Dice| {
            self.rough = dice.within(0.12, 0.3);
            self.map = Curve::draw(dice, TRAVEL[0], TRAVEL[1], 0.35);
        };
        let shape = match id {
            "actuator_delay" => {
                self.rough = dice.within(0.1, 0.25);
                self.delay_s = dice.magnitude(0.035, 0.10);
                self.slot_s = [0.0, 0.3 * self.delay_s][dice.shape(2)];
                self.seed = dice.seed();
                self.seen = Seen::of(&["delay"]);
                format!("{:.4} s, wanders by {:.2} of it, slots of {:.4} s", self.delay_s, self.rough, self.slot_s)
            }
            "actuator_rate_limit" => {
                uneven(dice);
                self.pace_s_mm = dice.magnitude(1.0 / 5.5, 1.0 / 2.2);
                self.pace_more_up = dice.within(-0.25, 0.25);
                self.orifice_mm = dice.within(0.05, 0.25);
                format!("{:.4} s/mm, {:+.2} upwards, orifice over {:.2} mm", self.pace_s_mm, self.pace_more_up, self.orifice_mm)
            }
            "actuator_lag" => {
                uneven(dice);
                self.lag_s = dice.magnitude(0.045, 0.13);
                self.lag_share = dice.within(0.1, 0.5);
                self.lag_more_up = dice.within(-0.25, 0.25);
                self.seen = Seen::of(&["time_constant"]);
                format!("{:.4} s, {:.2} of it first, {:+.2} upwards", self.lag_s, self.lag_share, self.lag_more_up)
            }
            "actuator_backlash" => {
                uneven(dice);
                self.half_play = 0.5 * dice.magnitude(0.18, 0.5);
                self.play_power = [f64::INFINITY, 4.0][dice.shape(2)];
                self.seen = Seen::of(&["play"]);
                format!("{:.3} mm, sharpness {}", 2.0 * self.half_play, self.play_power)
            }
            "bearing_stiction" => {
                self.stick_mm = dice.magnitude(0.10, 0.22);
                self.stick_zone = if dice.shape(2) == 0 { f64::INFINITY } else { dice.within(0.9, 1.3) };
                format!("sticks for {:.3} mm", self.stick_mm)
            }
            "actuator_hunting" => {
                self.hunt_mm = dice.magnitude(0.09, 0.22);
                self.hunt_hz = dice.within(4.0, 9.0);
                self.hunt_phase = dice.within(0.0, TAU);
                self.hunt_settles_s = if dice.shape(2) == 0 { f64::INFINITY } else { dice.within(0.5, 1.0) };
                format!("{:.3} mm at {:.1} Hz", self.hunt_mm, self.hunt_hz)
            }
            "actuator_leak" => {
                self.leak_mm_s = dice.magnitude(0.06, 0.16);
                // What leaks is refilled in the end: a clutch that is held for a minute does not open by itself.
                self.leak_tau_s = if dice.shape(2) == 0 { 4.0 } else { dice.within(0.8, 1.5) };
                format!("{:.3} mm/s, refilled in {:.1} s", self.leak_mm_s, self.leak_tau_s)
            }
            "stepped_bearing" => {
                self.notch_mm = dice.magnitude(0.16, 0.30);
                self.notch = dice.within(0.0, 1.0);
                format!("steps of {:.3} mm", self.notch_mm)
            }
            _ => return None,
        };
        Some(shape)
    }

    /// At rest at this commanded position.
    pub fn rest(&mut self, command: f64, h: f64, recording: u64) {
        self.line.rest(command, if self.delay_s > 0.0 { (self.delay_s * 2.0 / h) as usize } else { 0 });
        (self.behind, self.sent, self.slot_left_s) = ([command; 2], command, 0.0);
        (self.limited, self.loose, self.held, self.last, self.hunt_last) = (command, command, command, command, command);
        (self.still_s, self.leaked, self.moving) = (0.0, 0.0, false);
        self.notched = if self.notch_mm > 0.0 { self.nearest_notch(command) } else { command };
        let mut road = Road::new(self.seed, recording);
        self.drift = [road.within(0.0, TAU), road.within(0.0, TAU), road.within(0.4, 1.1), road.within(1.3, 2.7)];
    }

    /// Position of the bearing, mm; `x_cnt` is the one of first contact.
    pub fn step(&mut self, h: f64, t: f64, command: f64, x_cnt: f64) -> f64 {
        let mut x = self.late(h, t, command);
        if self.pace_s_mm > 0.0 {
            x = self.limit(h, x);
        }
        if self.lag_s > 0.0 {
            x = self.follow(h, x);
        }
        if self.half_play > 0.0 {
            x = self.play(x);
        }
        if self.stick_mm > 0.0 {
            x = self.stick(h, x, x_cnt);
        }
        if self.notch_mm > 0.0 {
            // It leaves a step only for a good half of the next.
            if (x - self.notched).abs() > 0.6 * self.notch_mm {
                self.notched = self.nearest_notch(x);
            }
            self.held += (self.notched - self.held) * (1.0 - (-h / 0.008).exp());
            x = self.held;
        }
        x + self.hunt(h, t, command) - self.leak(h, command, x_cnt)
    }

    fn nearest_notch(&self, x: f64) -> f64 {
        ((x / self.notch_mm - self.notch).round() + self.notch) * self.notch_mm
    }

    fn uneven(&self, x: f64) -> f64 {
        (1.0 + self.rough * self.map.at(x)).max(0.3)
    }

    fn late(&mut self, h: f64, t: f64, command: f64) -> f64 {
        if self.delay_s <= 0.0 {
            return command;
        }
        self.slot_left_s -= h;
        let before = self.sent;
        if self.slot_left_s <= 0.0 {
            (self.slot_left_s, self.sent) = (self.slot_s, command);
        }
        let [a, b, slow, fast] = self.drift;
        let wanders = 1.0 + self.rough * ((TAU * slow * t + a).sin() + (TAU * fast * t + b).sin());
        let delay = (self.delay_s - 0.5 * self.slot_s) * wanders;
        if self.sent != before {
            self.seen.mean(delay + 0.5 * self.slot_s, (self.sent - before).powi(2));
        }
        self.line.step(self.sent, (delay / h).round() as usize)
    }

    /// Flow through an orifice: at full pace until the last of the way, then with the root of the distance.
    fn limit(&mut self, h: f64, x: f64) -> f64 {
        let off = x - self.limited;
        let up = if off > 0.0 { 1.0 + self.pace_more_up } else { 1.0 - self.pace_more_up };
        let top = up / (self.pace_s_mm * self.uneven(self.limited));
        let flow = top * (off.abs() / self.orifice_mm).sqrt().min(1.0);
        self.limited += (h * flow).min(off.abs()) * off.signum();
        self.limited
    }

    fn follow(&mut self, h: f64, x: f64) -> f64 {
        let up = if x > self.behind[1] { 1.0 + self.lag_more_up } else { 1.0 - self.lag_more_up };
        let tau = self.lag_s * up * self.uneven(self.behind[1]);
        let before = self.behind[1];
        self.behind[0] += (x - self.behind[0]) * (1.0 - (-h / (tau * self.lag_share)).exp());
        self.behind[1] += (self.behind[0] - self.behind[1]) * (1.0 - (-h / (tau * (1.0 - self.lag_share))).exp());
        self.seen.mean(tau, ((self.behind[1] - before) / h).powi(2));
        self.behind[1]
    }

    /// The bearing follows its command through play that takes up the sooner the sharper it is.
    fn play(&mut self, x: f64) -> f64 {
        let half = self.half_play * self.uneven(x);
        let dx = x - self.last;
        if self.play_power.is_finite() {
            let taken_up = ((x - self.loose) / half * dx.signum()).clamp(-1.0, 1.0);
            self.loose += dx * (0.5 + 0.5 * taken_up).powf(self.play_power);
        }
        self.loose = self.loose.clamp(x - half, x + half);
        self.seen.mean(2.0 * half, dx.abs());
        self.last = x;
        self.loose
    }

    fn stick(&mut self, h: f64, x: f64, x_cnt: f64) -> f64 {
        let err = x - self.held;
        if (self.held - x_cnt - 1.9).abs() > self.stick_zone || err.abs() > self.stick_mm {
            self.moving = true;
        }
        if self.moving {
            self.held += err * (1.0 - (-h / 0.006).exp());
            self.moving = (x - self.held).abs() > 0.012;
        }
        self.held
    }

    fn hunt(&mut self, h: f64, t: f64, command: f64) -> f64 {
        if self.hunt_mm == 0.0 {
            return 0.0;
        }
        self.still_s += h;
        if (command - self.hunt_last).abs() > 0.03 {
            (self.still_s, self.hunt_last) = (0.0, command);
        }
        self.hunt_mm * (TAU * self.hunt_hz * t + self.hunt_phase).sin() * (0.5 + 0.5 * (-self.still_s / self.hunt_settles_s).exp())
    }

    fn leak(&mut self, h: f64, command: f64, x_cnt: f64) -> f64 {
        if self.leak_mm_s == 0.0 {
            return 0.0;
        }
        let under_pressure = f64::from(u8::from(command > x_cnt + 0.4));
        self.leaked +=
            h * (self.leak_mm_s * under_pressure - self.leaked / self.leak_tau_s * if under_pressure > 0.0 { 1.0 } else { 20.0 });
        self.leaked
    }
}
