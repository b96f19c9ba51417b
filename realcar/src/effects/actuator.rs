//! Between the position that is commanded and the one of the bearing.
//!
//! In the library: delay, rate limit, lag, backlash. Outside of it: a bearing that sticks, one that hunts about its
//! target, and one that leaks back while it is held.

use super::Dice;
use super::lag::{Lag, Shape};
use super::ring::Ring;
use super::road::Road;
use std::f64::consts::TAU;

/// The actuator's deviations and their states; mm and s.
#[derive(Clone, Debug, Default)]
pub struct Actuator {
    delay_s: f64,
    jitter: f64,
    delay_now_s: f64,
    clock_s: f64,
    line: Ring,
    pace_s_mm: f64,
    soft_pace: bool,
    limited: f64,
    lag: Lag,
    half_play: f64,
    play_power: f64,
    loose: f64,
    stick_mm: f64,
    stick_zone: f64,
    moving: bool,
    held: f64,
    hunt_mm: f64,
    hunt_hz: f64,
    hunt_phase: f64,
    hunt_settles_s: f64,
    still_s: f64,
    last: f64,
    leak_mm_s: f64,
    leak_tau_s: f64,
    leaked: f64,
    seed: u64,
    road: Option<Road>,
}

impl Actuator {
    /// Sets the effect of this id, if it belongs here.
    pub fn draw(&mut self, id: &str, dice: &mut Dice) -> Option<String> {
        let shape = match id {
            "actuator_delay" => {
                self.delay_s = dice.magnitude(0.035, 0.10);
                self.jitter = if dice.shape(2) == 0 { 0.0 } else { 0.2 };
                self.seed = dice.seed();
                format!("{:.4} s, jitter {}", self.delay_s, self.jitter)
            }
            "actuator_rate_limit" => {
                self.pace_s_mm = 1.0 / dice.within(2.2, 5.5) * dice.magnitude(0.999, 1.0);
                self.soft_pace = dice.shape(2) == 1;
                format!("{:.4} s/mm{}", self.pace_s_mm, if self.soft_pace { ", soft onset" } else { "" })
            }
            "actuator_lag" => {
                let tau = dice.magnitude(0.045, 0.13);
                let kind =
                    [Shape::First(tau), Shape::Second(tau, dice.within(0.55, 1.0)), Shape::UpDown(1.25 * tau, 0.8 * tau)][dice.shape(3)];
                self.lag = Lag::new(kind);
                format!("{kind:.3?}")
            }
            "actuator_backlash" => {
                self.half_play = 0.5 * dice.magnitude(0.18, 0.5);
                self.play_power = [f64::INFINITY, 4.0][dice.shape(2)];
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
                self.leak_tau_s = if dice.shape(2) == 0 { 100.0 } else { dice.within(0.8, 1.5) };
                format!("{:.3} mm/s, refilled in {:.1} s", self.leak_mm_s, self.leak_tau_s)
            }
            _ => return None,
        };
        Some(shape)
    }

    /// At rest at this commanded position.
    pub fn rest(&mut self, command: f64, h: f64, recording: u64) {
        self.line.rest(command, if self.delay_s > 0.0 { (self.delay_s * 1.3 / h) as usize } else { 0 });
        self.lag.rest(command);
        (self.limited, self.loose, self.held, self.last) = (command, command, command, command);
        (self.still_s, self.leaked, self.clock_s, self.moving) = (0.0, 0.0, 0.0, false);
        self.delay_now_s = self.delay_s;
        self.road = (self.jitter > 0.0).then(|| Road::new(self.seed, recording));
    }

    /// Position of the bearing, mm; `travel` is the position above first contact, mm.
    pub fn step(&mut self, h: f64, t: f64, command: f64, x_cnt: f64) -> f64 {
        let mut x = self.late(h, command);
        if self.pace_s_mm > 0.0 {
            let err = x - self.limited;
            let top = 1.0 / self.pace_s_mm;
            // A soft onset slows the bearing within half a millimetre of its target.
            let speed = if self.soft_pace { top * (err / 0.12).tanh() } else { (err / h).clamp(-top, top) };
            self.limited += h * speed;
            x = self.limited;
        }
        x = self.lag.step(h, x);
        if self.half_play > 0.0 {
            x = self.play(x);
        }
        if self.stick_mm > 0.0 {
            x = self.stick(h, x, x_cnt);
        }
        x + self.hunt(h, t, command) - self.leak(h, command, x_cnt)
    }

    fn late(&mut self, h: f64, command: f64) -> f64 {
        if self.delay_s <= 0.0 {
            return command;
        }
        self.clock_s += h;
        if self.clock_s > 0.05 {
            // The bus grants another slot now and then.
            self.clock_s = 0.0;
            if let Some(road) = &mut self.road {
                self.delay_now_s = self.delay_s * (1.0 + self.jitter * road.within(-1.0, 1.0));
            }
        }
        self.line.step(command, (self.delay_now_s / h).round() as usize)
    }

    /// The bearing follows its command through play that takes up the sooner the sharper it is.
    fn play(&mut self, x: f64) -> f64 {
        if self.play_power.is_infinite() {
            self.loose = self.loose.clamp(x - self.half_play, x + self.half_play);
        } else {
            let dx = x - self.last;
            let taken_up = ((x - self.loose) / self.half_play * dx.signum()).clamp(-1.0, 1.0);
            self.loose += dx * (0.5 + 0.5 * taken_up).powf(self.play_power);
            self.loose = self.loose.clamp(x - self.half_play, x + self.half_play);
        }
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
        if (command - self.last).abs() > 0.03 {
            (self.still_s, self.last) = (0.0, command);
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
