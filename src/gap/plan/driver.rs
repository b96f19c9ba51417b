//! Driver of a manoeuvre: a small feedback controller, so that the manoeuvre can be driven with any car.
//!
//! It reads the two speeds, governs the engine and positions the bearing according to the nominal car's torque map. The same controller drives the simulated car with which a plan
//! is made and, in `kisspoint blind --plan`, the drawn car on which the plan is checked.

use super::manoeuvre::{Kind, Manoeuvre};
use crate::physics::{cushion, map};
use crate::vehicle::Vehicle;

/// Commands of a manoeuvre to a car over one interval.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// Engine torque, N·m.
    pub t_e: f64,
    /// Bearing position, mm.
    pub x_to: f64,
    /// Whether the brake holds the disc.
    pub brake: bool,
}

/// Idle speed, and flywheel speed that is held while the clutch slips, rad/s.
const IDLE: f64 = 105.0;
const SLIPPING: f64 = 150.0;
/// Engine torque that the governor may ask for, N·m, beyond what clutch and drag take.
const GOVERNOR_MOST: f64 = 60.0;
/// Proportional and integral gain of the governor, N·m·s/rad and N·m/rad, for a flywheel of 0.19 kg·m²; both scale with the flywheel's inertia.
const GOVERNOR: [f64; 2] = [0.8, 0.8];
const GOVERNED_INERTIA: f64 = 0.19;
/// Distance of the open position before the kiss point and of the closed position beyond the closed point, mm.
const OPEN_MM: f64 = 0.8;
const CLOSED_MM: f64 = 0.3;
/// Slip below which a launch counts as locked, rad/s, and the time for which it must stay there, s.
const LOCKED_SLIP: f64 = 3.0;
const MET_S: f64 = 0.03;

/// Driver of one manoeuvre.
#[derive(Clone, Debug)]
pub struct Driver<'a> {
    what: &'a Manoeuvre,
    vehicle: &'a Vehicle,
    dt: f64,
    sum: f64,
    near_s: f64,
    /// Time at which the clutch began to close, s, and the position, mm, and engine torque, N·m, at that time.
    closing: Option<(f64, f64, f64)>,
}

impl<'a> Driver<'a> {
    /// A driver who knows the nominal car and issues a command every `dt` seconds.
    pub fn new(what: &'a Manoeuvre, vehicle: &'a Vehicle, dt: f64) -> Self {
        Self { what, vehicle, dt, sum: 0.0, near_s: 0.0, closing: None }
    }

    /// Speeds of flywheel and disc at the start, rad/s.
    pub fn start(&self) -> [f64; 2] {
        match self.what.kind {
            Kind::OpenRev => [IDLE + 15.0, 0.7 * IDLE],
            Kind::TipIn => [IDLE, IDLE],
            Kind::CoastDown => [IDLE, 1.6 * IDLE],
            Kind::Reengage => [1.6 * IDLE, IDLE],
            Kind::BrakedRamp | Kind::Chirp | Kind::ConstantPosition | Kind::HeatAndRest => [SLIPPING, 0.0],
            Kind::Launch | Kind::Creep | Kind::KissPoint => [IDLE, 0.0],
        }
    }

    /// Command from time `t` on, s, given the speeds measured then, rad/s.
    pub fn command(&mut self, t: f64, omega_f: f64, omega_c: f64) -> Command {
        let what = self.what;
        let (top, a) = (what.torque_nm, self.contact());
        let open = a.x_cnt - OPEN_MM;
        let shut = a.x_cls + CLOSED_MM;
        match what.kind {
            Kind::OpenRev => {
                let level = steps(t, &[(0.0, 0.4), (0.5, 1.3), (1.6, -0.2), (2.8, 0.5)]);
                Command { t_e: level * top, x_to: open, brake: false }
            }
            Kind::TipIn => {
                let level = steps(t, &[(0.0, 0.3), (0.5, 1.0), (1.5, 0.0), (2.4, 0.8), (3.3, -0.1)]);
                Command { t_e: level * top, x_to: shut, brake: false }
            }
            Kind::CoastDown => Command { t_e: self.governed(IDLE, omega_f, 0.0), x_to: open, brake: false },
            Kind::BrakedRamp => {
                let share = triangle((t - 0.4) / (0.5 * (what.seconds - 0.6)));
                self.slip(share * top, SLIPPING, omega_f, omega_c, true)
            }
            Kind::HeatAndRest => {
                let slips = t < 0.15 * what.seconds || t > 0.85 * what.seconds;
                let torque = if slips { top * smooth(t / 0.4) } else { 0.0 };
                self.slip(torque, SLIPPING, omega_f, omega_c, true)
            }
            Kind::KissPoint => {
                let share = triangle((t - 0.3) / (0.5 * (what.seconds - 0.6)));
                let x = a.x_cnt - 0.3 + share * (self.position(top, 100.0) - a.x_cnt + 0.3);
                self.at(x, SLIPPING, omega_f, omega_c)
            }
            Kind::Creep => {
                let (low, high) = (self.position(0.3 * top, 80.0), self.position(top, 80.0));
                let swing = 0.5 - 0.5 * (std::f64::consts::TAU * (t - 0.3) / 1.5).cos();
                let x = open + (low + swing * (high - low) - open) * smooth(t / 0.3);
                self.at(x, SLIPPING, omega_f, omega_c)
            }
            Kind::Chirp => {
                let middle = self.position(0.6 * top, 80.0);
                let phase = std::f64::consts::TAU * (0.75 * t + 0.6 * t * t);
                let swing = 0.4 * (self.position(top, 80.0) - a.x_cnt) * smooth((t - 0.25) / 0.35) * phase.sin();
                self.at(open + (middle + swing - open) * smooth(t / 0.3), SLIPPING, omega_f, omega_c)
            }
            Kind::ConstantPosition => {
                let x = self.position(top, 80.0);
                self.at(open + (x - open) * smooth(t / 0.3), SLIPPING, omega_f, omega_c)
            }
            Kind::Launch | Kind::Reengage => self.launch(t, omega_f, omega_c),
        }
    }

    fn contact(&self) -> map::Contact {
        map::contact(&self.vehicle.actuator, self.what.theta_c)
    }

    /// Position at which the nominal clutch carries a torque at this slip, mm.
    fn position(&self, torque: f64, slip: f64) -> f64 {
        let v = self.vehicle;
        map::inverse(&v.friction, &v.actuator, &v.cushion_spring, torque.max(0.0), slip.max(1.0), self.what.theta_c)
    }

    /// Torque that the nominal clutch carries at a position, N·m.
    fn carried(&self, x: f64, slip: f64) -> f64 {
        let v = self.vehicle;
        let spring = &v.cushion_spring;
        let force = cushion::force(spring, cushion::contact_point(spring), map::normalised_position(self.contact(), x));
        map::torque_capacity(&v.friction, force, slip.max(0.0), self.what.theta_c)
    }

    /// Engine torque that holds a speed while the clutch takes `taken`, N·m.
    fn governed(&mut self, speed: f64, omega_f: f64, taken: f64) -> f64 {
        let scale = self.vehicle.driveline.J_f / GOVERNED_INERTIA;
        let off = speed - omega_f;
        if off.abs() < 25.0 {
            self.sum = (self.sum + self.dt * GOVERNOR[1] * scale * off).clamp(-GOVERNOR_MOST, GOVERNOR_MOST);
        }
        let drag = self.vehicle.driveline.b_f * omega_f;
        taken + drag + (GOVERNOR[0] * scale * off + self.sum).clamp(-GOVERNOR_MOST, GOVERNOR_MOST)
    }

    /// Command for slipping with a clutch torque, N·m; the clutch opens if the torque is 0.
    fn slip(&mut self, torque: f64, speed: f64, omega_f: f64, omega_c: f64, brake: bool) -> Command {
        let slip = omega_f - omega_c;
        let x_to = if torque > 0.0 { self.position(torque, slip) } else { self.contact().x_cnt - OPEN_MM };
        Command { t_e: self.governed(speed, omega_f, torque), x_to, brake }
    }

    /// Command for slipping at a position, mm.
    fn at(&mut self, x_to: f64, speed: f64, omega_f: f64, omega_c: f64) -> Command {
        let slip = omega_f - omega_c;
        // Once the car has caught up, the torque of the clutch is no longer fed forward, and the engine is governed to at least 5 rad/s above the disc.
        let taken = if slip > LOCKED_SLIP { self.carried(x_to, slip) } else { 0.0 };
        Command { t_e: self.governed(speed.max(omega_c + 5.0), omega_f, taken), x_to, brake: false }
    }

    fn launch(&mut self, t: f64, omega_f: f64, omega_c: f64) -> Command {
        let (top, slip, a) = (self.what.torque_nm, omega_f - omega_c, self.contact());
        let (fill, ramp) = (0.2, 0.5);
        let Some((since, from, torque)) = self.closing else {
            let plan = top * smooth((t - fill) / ramp);
            let rolling = self.what.kind == Kind::Reengage;
            let speed = if rolling { omega_f } else { IDLE + 0.3 * top * smooth(t / 0.8) };
            let x_to = if t < fill { a.x_cnt - OPEN_MM * (1.0 - smooth(t / fill)) } else { self.position(plan.max(0.5), slip) };
            let t_e = if rolling { 0.6 * plan } else { self.governed(speed, omega_f, plan) };
            self.near_s = if slip < LOCKED_SLIP && t > fill { self.near_s + self.dt } else { 0.0 };
            if self.near_s > MET_S || t > 0.75 * self.what.seconds {
                self.closing = Some((t, x_to, t_e));
            }
            return Command { t_e, x_to, brake: false };
        };
        let s = t - since;
        let x_to = from + (a.x_cls + CLOSED_MM - from) * smooth(s / 0.35);
        let base = 0.6 * top;
        let after = steps(s, &[(0.0, 0.0), (0.6, 0.4), (1.1, -0.4)]) * top;
        Command { t_e: torque + (base - torque) * smooth(s / 0.3) + after, x_to, brake: false }
    }
}

/// Smooth step from 0 to 1 with zero slope at both ends.
fn smooth(s: f64) -> f64 {
    let s = s.clamp(0.0, 1.0);
    s * s * (3.0 - 2.0 * s)
}

/// 0 to 1 over the first unit, back to 0 over the second.
fn triangle(s: f64) -> f64 {
    (1.0 - (s - 1.0).abs()).clamp(0.0, 1.0)
}

/// Piecewise constant level of a plan of start times (s) and levels; each transition begins at its start time and takes 60 ms.
fn steps(t: f64, plan: &[(f64, f64)]) -> f64 {
    let mut level = plan[0].1;
    for &(at, next) in &plan[1..] {
        level += (next - level) * smooth((t - at) / 0.06);
    }
    level
}

#[cfg(test)]
mod tests {
    use super::super::manoeuvre::built_in;
    use super::*;

    #[test]
    fn shapes_pass_through_their_marks() {
        assert_eq!([smooth(-1.0), smooth(0.0), smooth(0.25), smooth(0.5), smooth(1.0), smooth(3.0)], [0.0, 0.0, 0.156_25, 0.5, 1.0, 1.0]);
        assert_eq!([triangle(-0.5), triangle(0.25), triangle(1.0), triangle(1.75), triangle(2.5)], [0.0, 0.25, 1.0, 0.25, 0.0]);
        let plan = [(0.0, 2.0), (0.5, 6.0), (1.6, -2.0)];
        for (t, level) in [(-1.0, 2.0), (0.5, 2.0), (0.53, 4.0), (0.56, 6.0), (1.6, 6.0), (1.63, 2.0), (9.0, -2.0)] {
            assert!((steps(t, &plan) - level).abs() < 1e-12, "{t}: {}", steps(t, &plan));
        }
    }

    fn of(kind: Kind, torque_nm: f64, seconds: f64) -> Manoeuvre {
        Manoeuvre { name: "m".into(), kind, torque_nm, theta_c: 25.0, theta_b: 25.0, seconds, prepare_s: 20.0 }
    }

    /// First command of a driver, at this time and these speeds.
    fn asked(kind: Kind, torque: f64, seconds: f64, t: f64, speeds: [f64; 2]) -> Command {
        let (vehicle, what) = (Vehicle::paper(), of(kind, torque, seconds));
        Driver::new(&what, &vehicle, 0.01).command(t, speeds[0], speeds[1])
    }

    #[test]
    fn torque_steps_are_shares_of_what_they_are_about() {
        let v = Vehicle::paper();
        let (open, shut) = (v.actuator.x_cnt_0 - 0.8, v.actuator.x_cls_0 + 0.3);
        for (kind, x, levels) in [
            (Kind::OpenRev, open, [(0.2, 0.4), (1.0, 1.3), (2.0, -0.2), (3.5, 0.5)].as_slice()),
            (Kind::TipIn, shut, &[(0.2, 0.3), (1.0, 1.0), (2.0, 0.0), (3.0, 0.8), (3.8, -0.1)]),
        ] {
            for (t, level) in levels {
                let c = asked(kind, 60.0, 4.0, *t, [120.0, 80.0]);
                assert!((c.t_e - 60.0 * level).abs() < 1e-9 && (c.x_to - x).abs() < 0.05 && !c.brake, "{kind:?} {t}: {c:?}");
            }
        }
    }

    /// Torque that the nominal clutch carries at a position, by the equations of its parts.
    fn carried(x: f64, slip: f64) -> f64 {
        let v = Vehicle::paper();
        let spring = &v.cushion_spring;
        let xi = map::normalised_position(map::contact(&v.actuator, 25.0), x);
        map::torque_capacity(&v.friction, cushion::force(spring, cushion::contact_point(spring), xi), slip, 25.0)
    }

    #[test]
    fn a_braked_disc_slips_with_the_torque_that_the_ramp_asks_for() {
        let (v, speeds) = (Vehicle::paper(), [SLIPPING, 0.0]);
        let drag = v.driveline.b_f * SLIPPING;
        // A ramp over 2.7 s from 0.4 s on, and back.
        for (t, share) in [(1.75, 0.5), (3.1, 1.0), (4.45, 0.5)] {
            let c = asked(Kind::BrakedRamp, 40.0, 6.0, t, speeds);
            assert!(
                c.brake && (carried(c.x_to, 150.0) - 40.0 * share).abs() < 0.01 && (c.t_e - 40.0 * share - drag).abs() < 1e-9,
                "{t}: {c:?}"
            );
        }
        let open = v.actuator.x_cnt_0 - 0.8;
        for (t, slips) in [(0.0, false), (0.4, true), (2.9, true), (3.1, false), (10.0, false), (16.9, false), (17.1, true)] {
            let c = asked(Kind::HeatAndRest, 40.0, 20.0, t, speeds);
            assert!(c.brake && ((carried(c.x_to, 150.0) - 40.0).abs() < 0.01) == slips, "{t}: {c:?}");
            assert!(slips || (c.x_to - open).abs() < 0.05 && (c.t_e - drag).abs() < 1e-9, "{t}: {c:?}");
        }
        let coast = asked(Kind::CoastDown, 0.0, 12.0, 5.0, [IDLE, 100.0]);
        assert!(!coast.brake && (coast.x_to - open).abs() < 0.05 && (coast.t_e - v.driveline.b_f * IDLE).abs() < 1e-9, "{coast:?}");
    }

    #[test]
    fn positions_swing_and_ramp_between_torques_of_the_map() {
        let (v, speeds) = (Vehicle::paper(), [SLIPPING, 70.0]);
        let (what, contact) = (of(Kind::Creep, 40.0, 5.5), map::contact(&v.actuator, 25.0));
        let at = |torque: f64, slip: f64| Driver::new(&what, &v, 0.01).position(torque, slip);
        let near = |c: Command, x: f64, what: &str| assert!((c.x_to - x).abs() < 1e-9 && !c.brake, "{what}: {c:?} {x}");
        // From 0.3 mm before the kiss point to the position of the torque and back.
        for (t, share) in [(0.3, 0.0), (2.15, 0.5), (4.0, 1.0), (5.85, 0.5)] {
            let from = contact.x_cnt - 0.3;
            near(asked(Kind::KissPoint, 20.0, 8.0, t, speeds), from + share * (at(20.0, 100.0) - from), "kiss point");
        }
        let (low, high) = (at(12.0, 80.0), at(40.0, 80.0));
        for (t, share) in [(0.3, 0.0), (0.675, 0.5), (1.05, 1.0), (1.8, 0.0)] {
            near(asked(Kind::Creep, 40.0, 5.5, t, speeds), low + share * (high - low), "creep");
        }
        // Phase of a chirp: 2π(0.75 t + 0.6 t²).
        let open = contact.x_cnt - OPEN_MM;
        for t in [0.8_f64, 1.3, 2.0] {
            let swing = 0.4 * (high - contact.x_cnt) * (std::f64::consts::TAU * (0.75 * t + 0.6 * t * t)).sin();
            near(asked(Kind::Chirp, 40.0, 4.5, t, speeds), at(24.0, 80.0) + swing, "chirp");
        }
        near(asked(Kind::Chirp, 40.0, 4.5, 0.15, speeds), open + 0.5 * (at(24.0, 80.0) - open), "chirp, closing");
        for (t, share) in [(0.0, 0.0), (0.15, 0.5), (0.3, 1.0), (4.0, 1.0)] {
            near(asked(Kind::ConstantPosition, 40.0, 5.0, t, speeds), open + share * (at(40.0, 80.0) - open), "constant");
        }
        // The engine supplies the torque that the clutch takes at this slip, and none for it once the car has caught up.
        let drag = v.driveline.b_f * SLIPPING;
        let slips = asked(Kind::ConstantPosition, 40.0, 5.0, 1.0, speeds);
        assert!((slips.t_e - carried(slips.x_to, 80.0) - drag).abs() < 1e-6, "{slips:?}");
        let caught = asked(Kind::ConstantPosition, 40.0, 5.0, 1.0, [SLIPPING, SLIPPING - 2.0]);
        // It is governed to 5 rad/s above the disc, which is 3 rad/s above its present speed.
        let scale = v.driveline.J_f / 0.19;
        assert!((caught.t_e - drag - scale * 0.8 * 3.0 * 1.01).abs() < 1e-6, "{caught:?}");
    }

    /// Proportional and integral gain of 0.8 N·m·s/rad and 0.8 N·m/rad for a flywheel of 0.19 kg·m², each limited to 60 N·m; the integral is held while the speed is far off.
    #[test]
    fn the_engine_is_governed_to_a_speed() {
        let (v, what) = (Vehicle::paper(), of(Kind::CoastDown, 0.0, 12.0));
        let scale = v.driveline.J_f / 0.19;
        let mut driver = Driver::new(&what, &v, 0.01);
        let drag = |omega: f64| v.driveline.b_f * omega;
        assert!((driver.governed(100.0, 90.0, 7.0) - 7.0 - drag(90.0) - scale * (8.0 + 0.08)).abs() < 1e-9);
        assert!((driver.governed(100.0, 90.0, 0.0) - drag(90.0) - scale * (8.0 + 0.16)).abs() < 1e-9);
        let sum = driver.sum;
        assert!((driver.governed(100.0, 130.0, 0.0) - drag(130.0) - (sum - scale * 24.0).max(-60.0)).abs() < 1e-9 && driver.sum == sum);
        assert!((driver.governed(500.0, 100.0, 0.0) - drag(100.0) - 60.0).abs() < 1e-9);
        (0..100_000).for_each(|_| {
            driver.governed(100.0, 80.0, 0.0);
        });
        assert_eq!(driver.sum, 60.0);
    }

    #[test]
    fn a_launch_fills_ramps_locks_pulls_and_coasts() {
        let (v, what) = (Vehicle::paper(), of(Kind::Launch, 60.0, 4.0));
        let contact = map::contact(&v.actuator, 25.0);
        let mut driver = Driver::new(&what, &v, 0.01);
        assert_eq!(driver.start(), [IDLE, 0.0]);
        let fills = driver.command(0.1, IDLE, 0.0);
        assert!((fills.x_to - contact.x_cnt + 0.4).abs() < 1e-9, "{fills:?}");
        let half = driver.command(0.45, IDLE + 5.0, 5.0);
        assert!((carried(half.x_to, IDLE) - 30.0).abs() < 0.01, "{half:?}");
        // The set point of the engine speed rises by 0.3 rad/s for each N·m within 0.8 s.
        let mut fresh = Driver::new(&what, &v, 0.01);
        let led = fresh.command(0.8, IDLE + 18.0, 0.0);
        assert!((led.t_e - 60.0 - v.driveline.b_f * (IDLE + 18.0)).abs() < 1e-9, "{led:?}");
        // The speeds have met once the slip has been small for more than 30 ms: then the clutch closes within 0.35 s, and the car pulls and coasts.
        for k in 0..4 {
            assert!(driver.closing.is_none(), "{k}");
            driver.command(1.0 + 0.01 * f64::from(k), 100.0, 98.0);
        }
        let (since, from, torque) = driver.closing.unwrap();
        assert!((since - 1.03).abs() < 1e-12);
        let mut at = |after: f64| driver.command(since + after, 110.0, 110.0);
        let shut = contact.x_cls + CLOSED_MM;
        let middle = at(0.175);
        assert!((middle.x_to - 0.5 * (from + shut)).abs() < 1e-9, "{middle:?}");
        assert!((at(0.15).t_e - 0.5 * (torque + 36.0)).abs() < 1e-9);
        for (after, t_e) in [(0.5, 36.0), (0.7, 36.0 + 24.0), (1.3, 36.0 - 24.0)] {
            let c = at(after);
            assert!((c.t_e - t_e).abs() < 1e-9 && (c.x_to - shut).abs() < 1e-9, "{after}: {c:?}");
        }
        // A launch whose speeds do not meet closes after three quarters of its time.
        let mut slips = Driver::new(&what, &v, 0.01);
        slips.command(2.9, 150.0, 20.0);
        assert!(slips.closing.is_none());
        slips.command(3.01, 150.0, 20.0);
        assert!(slips.closing.is_some());
        // On a rolling car, the engine gives 0.6 of the torque that the ramp has reached.
        let rolling = of(Kind::Reengage, 60.0, 3.5);
        let c = Driver::new(&rolling, &v, 0.01).command(0.45, 160.0, 100.0);
        assert!((c.t_e - 18.0).abs() < 1e-9, "{c:?}");
    }

    #[test]
    fn manoeuvres_start_as_they_are_called_and_take_their_time() {
        let v = Vehicle::paper();
        let start = |kind: Kind| Driver::new(&of(kind, 1.0, 1.0), &v, 0.01).start();
        for (kind, speeds) in [
            (Kind::OpenRev, [120.0, 73.5]),
            (Kind::TipIn, [105.0, 105.0]),
            (Kind::CoastDown, [105.0, 168.0]),
            (Kind::Reengage, [168.0, 105.0]),
            (Kind::Chirp, [150.0, 0.0]),
            (Kind::KissPoint, [105.0, 0.0]),
        ] {
            let found = start(kind);
            assert!((found[0] - speeds[0]).abs() < 1e-9 && (found[1] - speeds[1]).abs() < 1e-9, "{kind:?}: {found:?}");
        }
        assert!((of(Kind::Launch, 1.0, 40.0).minutes() - 1.0).abs() < 1e-12);
        let all = built_in(&v);
        let most = carried(v.actuator.x_cls_0, 0.0);
        let one = |name: &str| all.iter().find(|m| m.name == name).unwrap();
        for (name, share, theta, prepare) in
            [("launch", 0.45, 25.0, 20.0), ("launch_hot", 0.45, 120.0, 180.0), ("kiss_point", 0.1, 25.0, 20.0)]
        {
            let m = one(name);
            assert!((m.torque_nm - share * most).abs() < 0.02 * most && (m.theta_c, m.prepare_s) == (theta, prepare), "{m:?} of {most}");
        }
    }
}
