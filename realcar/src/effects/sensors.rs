//! Between the speeds as they are and the speeds as they are recorded, before noise.
//!
//! In the library: delays of both speeds (teeth counted over a window), gain of the disc's (a random curve of speed about its size). Outside of it: a
//! tone wheel that runs out, drop-outs that repeat the last value, a pick-up that sees nothing at low speed, and a signal that may not change faster
//! than somebody thought it could.

use super::Dice;
use super::maps::Curve;
use super::ring::Ring;
use super::road::Road;
use super::seen::Seen;

/// How a speed arrives late: teeth are counted over a window, and the count waits for a tooth and for its message.
#[derive(Clone, Debug, Default)]
struct Late {
    dead_s: f64,
    window_s: f64,
    waits: f64,
    angle: f64,
    line: Ring,
}

impl Late {
    fn draw(dice: &mut Dice) -> (Self, String) {
        let total = dice.magnitude(0.024, 0.064);
        let share = dice.within(0.25, 0.8);
        let late = Self { dead_s: (1.0 - share) * total, window_s: 2.0 * share * total, waits: dice.within(0.35, 0.8), ..Self::default() };
        let told = format!("{total:.4} s, of which {share:.2} are half a window; slow teeth wait by {:.2}", late.waits);
        (late, told)
    }

    fn rest(&mut self, omega: f64, h: f64) {
        self.angle = 0.0;
        self.line.ramp(omega * h, ((3.0 * self.dead_s + self.window_s) / h) as usize + 2);
    }

    fn step(&mut self, h: f64, omega: f64) -> f64 {
        if self.window_s < h {
            return omega;
        }
        self.angle += h * omega;
        self.line.push(self.angle);
        // At low speed the next tooth is long in coming.
        let slow = (110.0 / omega.abs().max(45.0)).min(2.4);
        let dead = self.dead_s * (1.0 + self.waits * (slow - 1.0));
        let (young, wide) = ((dead / h).round() as usize, (self.window_s / h).round() as usize);
        (self.line.ago(young) - self.line.ago(young + wide)) / (wide as f64 * h)
    }
}

/// The sensors' deviations and their states; rad/s.
#[derive(Clone, Debug, Default)]
pub struct Sensors {
    late_f: Late,
    late_c: Late,
    gain_c: f64,
    rough: f64,
    gain_curve: Curve,
    runout: f64,
    runout_order: f64,
    lost_share: f64,
    lost_s: f64,
    lost_until_s: f64,
    lost_value: f64,
    blind_below: f64,
    slew: f64,
    seed: u64,
    road: Option<Road>,
    now: [f64; 2],
    /// The library's parameters that come nearest.
    pub seen: Seen,
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
                self.rough = dice.within(0.12, 0.3);
                self.gain_curve = Curve::draw(dice, 0.0, 240.0, 0.4);
                self.seen = Seen::of(&["gain"]);
                format!("factor {:.4}, uneven by {:.2} of it", 1.0 + self.gain_c, self.rough)
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
            "slew_limited_pickup" => {
                self.slew = dice.magnitude(1.0 / 95.0, 1.0 / 60.0);
                format!("the disc speed changes by {:.0} rad/s² at most", 1.0 / self.slew)
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
        let [_, before] = self.now;
        self.now = [self.late_f.step(h, omega_f), self.late_c.step(h, omega_c)];
        if self.slew > 0.0 {
            self.now[1] = before + (self.now[1] - before).clamp(-h / self.slew, h / self.slew);
        }
    }

    /// The speeds as they have passed delay and filter.
    pub fn now(&self) -> [f64; 2] {
        self.now
    }

    /// The speeds that are sampled at `t`, before noise; `turn` is the disc's angle, rad, `heard` the speeds as they have arrived.
    pub fn sample(&mut self, t: f64, dt: f64, turn: f64, heard: [f64; 2]) -> [f64; 2] {
        let [f, mut c] = heard;
        if self.gain_c != 0.0 {
            let gain = self.gain_c * (1.0 + self.rough * self.gain_curve.at(c.abs()));
            self.seen.mean(1.0 + gain, c * c);
            c += gain * c;
        }
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
