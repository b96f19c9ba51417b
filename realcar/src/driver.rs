//! Driver and transmission controller on the road: every 10 ms engine torque, bearing position and brake.
//!
//! Both know the vehicle file and the speeds as they are read, no more. Engine: a governor at idle, a planned speed during a launch. Clutch: the
//! inverse torque map of the file at an estimated temperature, which leans on the engine's speed; at synchronous speed a firm grip, then full closing.

use crate::drive::{Drive, Leg};
use crate::effects::smooth;
use crate::map;
use crate::vehicle::Vehicle;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

/// Period of driver and controller, s.
pub const TICK_S: f64 = 0.01;

/// What differs between the controllers of two cars.
#[derive(Clone, Debug)]
pub struct Style {
    idle_rad_s: f64,
    gap_mm: f64,
    over_mm: f64,
    governor: [f64; 2],
    engine: [f64; 2],
    /// How much torque the clutch adds per rad/s that the engine runs too fast, N·m·s/rad.
    lean: f64,
    follows_heat: bool,
    close_s: f64,
    open_s: f64,
}

impl Style {
    /// Draws a controller.
    pub fn draw(rng: &mut StdRng) -> Self {
        Self {
            idle_rad_s: rng.random_range(88.0..108.0),
            gap_mm: rng.random_range(0.5..1.0),
            over_mm: rng.random_range(0.2..0.4),
            governor: [rng.random_range(0.5..0.9), rng.random_range(0.5..1.1)],
            engine: [rng.random_range(0.3..0.7), rng.random_range(0.3..0.9)],
            lean: if rng.random_bool(0.5) { 0.0 } else { rng.random_range(0.08..0.3) },
            follows_heat: rng.random_bool(0.6),
            close_s: rng.random_range(0.3..0.6),
            open_s: rng.random_range(0.12..0.3),
        }
    }
}

/// What is asked of the car for one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// Engine torque as it is reported, N·m.
    pub torque: f64,
    /// Commanded position, mm.
    pub position: f64,
    /// Torque of the brakes at the gearbox input, N·m.
    pub brake_nm: f64,
    /// Whether the brake light is on.
    pub brake: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    Stand,
    Launch,
    /// From which torque and position.
    Grip(f64, f64),
    /// Which load, since when in it.
    Locked(usize),
    /// Open and rolling.
    Coast,
    Brake,
}

/// Driver and controller at work.
#[derive(Debug)]
pub struct Driver {
    file: Vehicle,
    style: Style,
    rng: StdRng,
    leg: Leg,
    mode: Mode,
    /// When the mode began, and when the load began, s.
    since: f64,
    engine_sum: f64,
    near: usize,
    theta: [f64; 2],
    /// When the clutch was told to open, and from where.
    opened: Option<(f64, f64)>,
    last: Command,
    slip: f64,
}

impl Driver {
    /// At rest with the clutch open; temperatures of disc and body in °C as they are noted.
    pub fn new(file: &Vehicle, style: &Style, drive: &Drive, theta: [f64; 2]) -> Self {
        let mut rng = StdRng::seed_from_u64(drive.seed);
        let mut leg = Leg::draw(&mut rng, false);
        let holds = if drive.held { rng.random_range(0.4..3.0) } else { 0.0 };
        leg.stand_s = Some(holds);
        let open = file.x_cnt - style.gap_mm;
        Self {
            file: file.clone(),
            style: style.clone(),
            rng,
            leg,
            mode: Mode::Stand,
            since: 0.0,
            engine_sum: file.b_f * style.idle_rad_s,
            near: 0,
            theta,
            opened: Some((-10.0, open)),
            last: Command { position: open, torque: file.b_f * style.idle_rad_s, ..Command::default() },
            slip: style.idle_rad_s,
        }
    }

    /// Engine speed at which it starts, rad/s.
    pub fn idle_rad_s(&self) -> f64 {
        self.style.idle_rad_s
    }

    /// The command of this tick from the speeds that were read.
    pub fn command(&mut self, t: f64, omega_f: f64, omega_c: f64) -> Command {
        self.slip = omega_f - omega_c;
        let s = t - self.since;
        let next = match self.mode {
            Mode::Stand => self.stand(t, s, omega_f, omega_c),
            Mode::Launch => self.launch(t, s, omega_f),
            Mode::Grip(torque, x) => self.grip(t, s, torque, x),
            Mode::Locked(k) => self.locked(t, s, k, omega_f, omega_c),
            Mode::Coast => self.coast(t, s, omega_f),
            Mode::Brake => self.brake(t, s, omega_f, omega_c),
        };
        self.warm_up(next.position);
        // The command is sent as whole micrometres.
        let position = next.position.clamp(self.open_mm(), self.closed_mm());
        self.last = Command { torque: next.torque.clamp(-20.0, 140.0), position: (position * 1000.0).round() / 1000.0, ..next };
        self.last
    }

    fn open_mm(&self) -> f64 {
        self.file.x_cnt - self.style.gap_mm
    }

    fn closed_mm(&self) -> f64 {
        self.file.x_cls + self.style.over_mm
    }

    fn kiss_mm(&self) -> f64 {
        let v = &self.file;
        v.x_cnt + map::contact(v) * (v.x_cls - v.x_cnt)
    }

    fn enter(&mut self, mode: Mode, t: f64) {
        (self.mode, self.since, self.near) = (mode, t, 0);
    }

    fn idle(&mut self, omega_f: f64) -> f64 {
        let [p, i] = self.style.governor;
        let off = self.style.idle_rad_s - omega_f;
        if off.abs() < 20.0 {
            self.engine_sum = (self.engine_sum + TICK_S * i * off).clamp(-10.0, 20.0);
        }
        (p * off + self.engine_sum).clamp(-20.0, 24.0)
    }

    /// Position on the way to open.
    fn opening(&mut self, t: f64) -> f64 {
        let (since, from) = *self.opened.get_or_insert((t, self.last.position));
        from + (self.open_mm() - from) * smooth((t - since) / self.style.open_s)
    }

    fn stand(&mut self, t: f64, s: f64, omega_f: f64, omega_c: f64) -> Command {
        let stand = self.leg.stand_s.unwrap_or(0.0);
        let held = omega_c.abs() < 3.0 && s >= stand;
        // The light goes out when the last of the brake's torque has gone.
        let left = if held { 0.0 } else { 75.0 * smooth((stand - s) / 0.15) };
        let torque = self.idle(omega_f);
        let position = self.opening(t);
        if held && s >= stand + self.leg.pause_s {
            self.enter(Mode::Launch, t);
        }
        Command { torque, position, brake_nm: left, brake: !held }
    }

    fn launch(&mut self, t: f64, s: f64, omega_f: f64) -> Command {
        let leg = self.leg.clone();
        let creeping = leg.creep.map_or(0.0, |c| c.1);
        let go = s - leg.fill_s - creeping;
        let first = leg.creep.map_or(0.0, |(nm, _)| nm * smooth((s - leg.fill_s) / 0.35));
        // A launch that does not come to an end is helped along.
        let patience = 1.0 + 0.35 * (go - 2.6).max(0.0);
        let mut wanted = first + (leg.torque * patience - first) * smooth(go / leg.ramp_s);
        let idle = self.style.idle_rad_s;
        let target = idle + 0.25 * first + (leg.engine_rad_s - idle - 0.25 * first) * smooth((go + 0.25) / (leg.ramp_s + 0.25));
        let off = target - omega_f;
        wanted = (wanted - self.style.lean * off * smooth(go / leg.ramp_s)).max(0.0);
        let [p, i] = self.style.engine;
        if off.abs() < 30.0 {
            self.engine_sum += TICK_S * i * off;
        }
        let torque = p * off + self.engine_sum + wanted * smooth(s / leg.fill_s);
        let open = self.open_mm();
        let fill = open + (self.kiss_mm() - open) * smooth(s / leg.fill_s);
        let position = if s < leg.fill_s { fill } else { map::position_for_torque_mm(&self.file, wanted, self.theta[0]) };
        self.opened = None;
        // Synchronous: little slip, or some that stays, as a speed that arrives late leaves.
        self.near = match self.slip {
            slip if slip < 2.5 => self.near + 10,
            slip if slip < 12.0 => self.near + 1,
            _ => 0,
        };
        if go > 0.3 && (self.near > 35 || (go > 8.0 && self.slip < 30.0)) {
            self.enter(Mode::Grip(torque, position), t);
        }
        Command { torque, position, ..Command::default() }
    }

    fn grip(&mut self, t: f64, s: f64, torque: f64, x: f64) -> Command {
        let next = self.leg.loads[0].1;
        let at = torque + (next - torque) * smooth(s / 0.45);
        let firm = map::position_for_torque_mm(&self.file, 1.45 * torque.max(25.0), self.theta[0]).max(x + 0.15).min(self.closed_mm());
        let position = x + (firm - x) * smooth(s / 0.1) + (self.closed_mm() - firm) * smooth((s - 0.16) / self.style.close_s);
        if s > 0.16 + self.style.close_s {
            self.enter(Mode::Locked(0), t);
        }
        Command { torque: at, position, ..Command::default() }
    }

    fn locked(&mut self, t: f64, s: f64, k: usize, omega_f: f64, omega_c: f64) -> Command {
        let (length, level) = self.leg.loads[k];
        let from = if k == 0 { level } else { self.leg.loads[k - 1].1 };
        let torque = from + (level - from) * smooth(s / 0.09);
        let mut position = self.closed_mm();
        let mut length = length;
        if let Some((_, slip)) = self.leg.slip_again.filter(|again| again.0 == k && level > 15.0) {
            length = length.max(1.7);
            let u = s - 0.25;
            let aim = slip * (smooth(u / 0.35) - smooth((u - 0.95) / 0.3));
            let carried = (level - self.file.b_f * omega_f) * self.file.j_c / (self.file.j_f + self.file.j_c) + 3.0;
            let held = map::position_for_torque_mm(&self.file, (carried - 0.9 * (aim - self.slip)).max(4.0), self.theta[0]);
            let slipping = smooth(u / 0.2) - smooth((u - 1.15) / 0.25);
            position += (held.min(position) - position) * slipping;
        }
        let too_fast = omega_c > 285.0;
        let too_slow = omega_c < 74.0;
        if s >= length || too_fast || too_slow {
            if k + 1 < self.leg.loads.len() && !too_fast && !too_slow {
                self.enter(Mode::Locked(k + 1), t);
            } else {
                self.enter(if self.leg.coast_s > 0.0 { Mode::Coast } else { Mode::Brake }, t);
            }
        }
        Command { torque, position, ..Command::default() }
    }

    /// Rolls on with the clutch open.
    fn coast(&mut self, t: f64, s: f64, omega_f: f64) -> Command {
        let from = self.last.torque;
        let torque = from + (self.idle(omega_f) - from) * smooth(s / 0.2);
        let position = self.opening(t);
        if s > self.leg.coast_s {
            self.enter(Mode::Brake, t);
        }
        Command { torque, position, ..Command::default() }
    }

    fn brake(&mut self, t: f64, s: f64, omega_f: f64, omega_c: f64) -> Command {
        let leg = &self.leg;
        let (swing, hz) = leg.brake_swing;
        let soft = if leg.down_to == 0.0 { 0.45 + 0.55 * smooth(omega_c / 45.0) } else { 1.0 };
        let brake_nm = leg.brake_nm * smooth((s - 0.04) / 0.3) * (1.0 + swing * (std::f64::consts::TAU * hz * s).sin()) * soft;
        let opens = omega_c < leg.opens_below || self.opened.is_some();
        let down_to = leg.down_to;
        let (torque, position) = if opens {
            let position = self.opening(t);
            let from = self.last.torque;
            (from + (self.idle(omega_f) - from) * smooth((s + 0.02) / 0.15), position)
        } else {
            let from = self.last.torque;
            (from + (-14.0 - from) * smooth((s + 0.02) / 0.25), self.closed_mm())
        };
        let rolls = down_to > 0.0;
        if rolls && omega_c <= down_to && s > 0.3 {
            self.follow(t, true);
        } else if !rolls && omega_c.abs() < 0.5 && s > 0.3 {
            self.follow(t, false);
        }
        Command { torque, position, brake_nm, brake: true }
    }

    /// On to the next leg.
    fn follow(&mut self, t: f64, rolls: bool) {
        self.leg = Leg::draw(&mut self.rng, rolls);
        if rolls {
            // The engine catches the rolling car from above.
            self.leg.engine_rad_s = self.leg.engine_rad_s.max(118.0);
            self.enter(Mode::Launch, t);
        } else {
            self.enter(Mode::Stand, t);
        }
    }

    /// Disc temperature by the vehicle file, for the feedforward.
    fn warm_up(&mut self, position: f64) {
        if !self.style.follows_heat {
            return;
        }
        let v = &self.file;
        let xi = (position - v.x_cnt) / (v.x_cls - v.x_cnt);
        let force = map::cushion_force_n(v, xi);
        let torque = 2.0 * map::friction_radius_m(v, self.slip, self.theta[0]) * force;
        let heat = if self.slip > 2.0 { torque * self.slip } else { 0.0 };
        let across = v.gamma_1 * (self.theta[1] - self.theta[0]);
        self.theta[0] += TICK_S / v.c_1 * (across + v.gamma_3 * heat);
        self.theta[1] += TICK_S / v.c_b * ((1.0 - v.gamma_3) * heat - across);
    }
}
