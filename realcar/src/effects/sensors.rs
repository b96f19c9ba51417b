//! Between the speeds as they are and the speeds as they are recorded, before noise.
//!
//! In the library: delays of both speeds, gain of the disc's. Outside of it: a tone wheel that runs out, drop-outs that
//! repeat the last value, and a pick-up that sees nothing at low speed.

use super::Dice;
use super::lag::{Lag, Shape};
use super::ring::Ring;
use super::road::Road;

/// How a speed arrives late.
#[derive(Clone, Debug, Default)]
struct Late {
    delay_s: f64,
    line: Ring,
    filter: Lag,
}

impl Late {
    fn draw(dice: &mut Dice) -> (Self, String) {
        let total = dice.magnitude(0.024, 0.064);
        let filtered = [0.0, 0.5, 0.8][dice.shape(3)] * total;
        let late = Self { delay_s: total - filtered, line: Ring::default(), filter: Lag::new(Shape::First(filtered)) };
        (late, format!("{:.4} s dead time and {filtered:.4} s filter", total - filtered))
    }

    fn rest(&mut self, value: f64, h: f64) {
        self.line.rest(value, (self.delay_s / h) as usize + 1);
        self.filter.rest(value);
    }

    fn step(&mut self, h: f64, value: f64) -> f64 {
        let arrived = self.line.step(value, (self.delay_s / h).round() as usize);
        self.filter.step(h, arrived)
    }
}

/// The sensors' deviations and their states; rad/s.
#[derive(Clone, Debug, Default)]
pub struct Sensors {
    late_f: Late,
    late_c: Late,
    gain_c: f64,
    gain_above: f64,
    runout: f64,
    runout_order: f64,
    lost_share: f64,
    lost_s: f64,
    lost_until_s: f64,
    lost_value: f64,
    blind_below: f64,
    seed: u64,
    road: Option<Road>,
    now: [f64; 2],
}

impl Sensors {
    /// Sets the effect of this id, if it belongs here.
    pub fn draw(&mut self, id: &str, dice: &mut Dice) -> Option<String> {
        let shape = match id {
            "engine_speed_delay" => {
                let (late, name) = Late::draw(dice);
                self.late_f = late;
                name
            }
            "clutch_speed_delay" => {
                let (late, name) = Late::draw(dice);
                self.late_c = late;
                name
            }
            "clutch_speed_gain" => {
                self.gain_c = dice.either(0.012, 0.03);
                self.gain_above = [0.0, 30.0][dice.shape(2)];
                format!("factor {:.4} above {} rad/s", 1.0 + self.gain_c, self.gain_above)
            }
            "tone_wheel_runout" => {
                self.runout = dice.magnitude(0.008, 0.02);
                self.runout_order = [1.0, 2.0][dice.shape(2)];
                format!("{:.4} of the disc speed, order {}", self.runout, self.runout_order)
            }
            "speed_dropout" => {
                self.lost_share = dice.magnitude(0.9, 2.0);
                self.lost_s = [0.06, 0.14][dice.shape(2)];
                self.seed = dice.seed();
                format!("{:.2} times a second, {} s long", self.lost_share, self.lost_s)
            }
            "blind_pickup" => {
                self.blind_below = dice.magnitude(9.0, 22.0);
                format!("disc speed below {:.1} rad/s reads low", self.blind_below)
            }
            _ => return None,
        };
        Some(shape)
    }

    /// Before a recording.
    pub fn rest(&mut self, omega_f: f64, omega_c: f64, h: f64, recording: u64) {
        self.late_f.rest(omega_f, h);
        self.late_c.rest(omega_c, h);
        self.lost_until_s = -1.0;
        self.road = (self.lost_share > 0.0).then(|| Road::new(self.seed, recording));
        self.now = [omega_f, omega_c];
    }

    /// Takes the real speeds of a fine step.
    pub fn step(&mut self, h: f64, omega_f: f64, omega_c: f64) {
        self.now = [self.late_f.step(h, omega_f), self.late_c.step(h, omega_c)];
    }

    /// The speeds as they have passed delay and filter.
    pub fn now(&self) -> [f64; 2] {
        self.now
    }

    /// The speeds that are sampled at `t`, before noise; `turn` is the disc's angle, rad, `heard` the speeds as they have arrived.
    pub fn sample(&mut self, t: f64, dt: f64, turn: f64, heard: [f64; 2]) -> [f64; 2] {
        let [f, mut c] = heard;
        let above = (c.abs() - self.gain_above).max(0.0) * c.signum();
        c += self.gain_c * if self.gain_above > 0.0 { above * 1.25 } else { c };
        if self.runout != 0.0 {
            c += self.runout * c * (self.runout_order * turn).sin();
        }
        if self.blind_below > 0.0 {
            // The signal dies away rather than at once.
            c *= super::smooth(1.6 * c.abs() / self.blind_below - 0.6);
        }
        if let Some(road) = &mut self.road {
            if t >= self.lost_until_s && road.happens(self.lost_share * dt) {
                (self.lost_until_s, self.lost_value) = (t + self.lost_s, c);
            }
            if t < self.lost_until_s {
                c = self.lost_value;
            }
        }
        [f, c]
    }
}
