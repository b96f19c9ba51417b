//! The balances as rates of the state, and the Runge–Kutta step.
//!
//! Paper eq. (6), (7) and (10) with stick and slip: while the clutch slips, T_fc = ±T_cap; while it sticks, flywheel and disc are one inertia and T_fc is the torque that keeps
//! them together. Work and losses are integrated as states, so that every run carries its energy balance.

use super::actuation::Drive;
use super::clutch::{self, Branch, FaceCache, Slipping};
use super::config::{Config, Coupling};
use super::rest::Rest;
use crate::effects::empirical;
use crate::physics::{driveline, thermal};

/// Number of continuous states.
pub const N: usize = 12;

/// Continuous states.
pub type Motion = [f64; N];

/// Indices in [`Motion`].
pub mod index {
    /// Flywheel speed, rad/s.
    pub const OMEGA_F: usize = 0;
    /// Disc speed, rad/s.
    pub const OMEGA_C: usize = 1;
    /// Vehicle speed behind the shafts, referred to the clutch, rad/s; equal to the disc's while they are rigid.
    pub const OMEGA_V: usize = 2;
    /// Twist of shafts and tyres together, rad.
    pub const TWIST: usize = 3;
    /// Disc temperature, °C.
    pub const THETA_C: usize = 4;
    /// Body temperature, °C.
    pub const THETA_B: usize = 5;
    /// Slip angle, rad.
    pub const ANGLE: usize = 6;
    /// Energy dissipated by the clutch, J.
    pub const E_D: usize = 7;
    /// Work of the engine, J.
    pub const WORK_IN: usize = 8;
    /// Work of damping and load, J.
    pub const LOSSES: usize = 9;
    /// Crank angle, rad.
    pub const CRANK: usize = 10;
    /// Excess temperature of the faces over the disc, K.
    pub const SURFACE: usize = 11;
}
use index::{ANGLE, CRANK, E_D, LOSSES, OMEGA_C, OMEGA_F, OMEGA_V, SURFACE, THETA_B, THETA_C, TWIST, WORK_IN};

/// State of a plant at rest with the disc at `theta` °C and everything else zero.
pub fn warm(theta: f64) -> Motion {
    let mut y = [0.0; N];
    y[THETA_C] = theta;
    y
}

/// Quantities that do not change within one integration step.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// Whether flywheel and disc turn as one.
    pub stuck: bool,
    /// Direction of slip, ±1.
    pub direction: f64,
    /// Whether the faces touch.
    pub engaged: bool,
    /// Cached position and radius of the faces for the first stage.
    pub found: FaceCache,
    /// Memory of the force hysteresis.
    pub memory: Branch,
    /// Standstill of car and engine, and the brakes.
    pub rest: Rest,
    /// Housing air, °C.
    pub theta_h: f64,
    /// Additional load torque, N·m.
    pub t_load: f64,
}

/// Speed in rad/s below which an accessory takes constant torque, not constant power.
const ACCESSORY_SPEED: f64 = 50.0;

/// Crankshaft torque in N·m at `omega_f` rad/s and a crank angle in rad: what the engine delivers for a requested torque of `t_e` N·m, minus accessories, plus the learned law.
#[inline(always)]
fn crankshaft_torque(config: &Config, t_e: f64, omega_f: f64, angle: f64) -> f64 {
    let mut given = t_e;
    for effect in config.engine.iter() {
        given = effect(&config.parameters, given, omega_f, angle);
    }
    let power = config.constants.accessory_power;
    let given = if power == 0.0 { given } else { given - power / omega_f.max(ACCESSORY_SPEED) };
    if config.empirical.engine { given + empirical::engine(&config.parameters, omega_f, t_e) } else { given }
}

/// Crankshaft torque in N·m in the state `y`, for a requested torque of `t_e` N·m.
#[inline(always)]
pub fn engine_torque(config: &Config, y: &Motion, t_e: f64) -> f64 {
    crankshaft_torque(config, t_e, y[OMEGA_F], y[CRANK])
}

/// Torque in N·m with which the driveline behind the disc resists it: the shaft torque, or in a rigid driveline damping and load including `braking` N·m from brakes.
#[inline(always)]
pub fn resistance(config: &Config, y: &Motion, t_load: f64, braking: f64) -> f64 {
    if config.compliant() { shaft_torque(config, y) } else { vehicle_resistance(config, y[OMEGA_C], t_load + braking) }
}

/// Elastic element between disc and car: its spring torque in N·m, the tyres' part of its twist in rad, and the tyres' slip speed in rad/s.
#[derive(Clone, Copy, Debug)]
struct Shafts {
    torque: f64,
    tyres: f64,
    slip: f64,
}

/// Solves for the torque T of shafts and tyres in series, whose twist is φ = φ_s(T) + u(T); where the shafts are linear, this is a quadratic equation in T.
#[inline(always)]
fn shafts(config: &Config, y: &Motion) -> Shafts {
    let c = &config.constants;
    let within = y[TWIST].clamp(-c.soft_angle, c.soft_angle);
    if c.tyre.softness <= 0.0 {
        return Shafts { torque: (y[TWIST] - (1.0 - c.soft_share) * within) / c.compliance, tyres: 0.0, slip: 0.0 };
    }
    let tyre = &c.tyre;
    // Slope and offset of the shafts' twist over torque: those beyond the soft range if the twist exceeds that of shafts and tyres together at its end.
    let end = if c.compliance > 0.0 { c.soft_share * c.soft_angle / c.compliance } else { 0.0 };
    let twist = y[TWIST].abs();
    let soft = twist < c.soft_angle + tyre.deflection(end);
    let (slope, offset) = match (soft, c.soft_share > 0.0) {
        (true, true) => (c.compliance / c.soft_share, 0.0),
        // Lash transmits no torque.
        (true, false) => return Shafts { torque: 0.0, tyres: 0.0, slip: 0.0 },
        (false, _) => (c.compliance, (1.0 - c.soft_share) * c.soft_angle),
    };
    let left = twist - offset;
    let half = 0.5 * (slope + tyre.softness + left / tyre.grip);
    let torque = left / (half + (half * half - slope * left / tyre.grip).max(0.0).sqrt());
    let tyres = (left - slope * torque).copysign(y[TWIST]);
    let slip = 0.5 * (y[OMEGA_C].abs() + y[OMEGA_V].abs()) * tyres / tyre.relaxation;
    Shafts { torque: torque.copysign(y[TWIST]), tyres, slip }
}

#[inline(always)]
fn shaft_torque(config: &Config, y: &Motion) -> f64 {
    let s = shafts(config, y);
    s.torque + config.constants.shaft_damping * (y[OMEGA_C] - y[OMEGA_V] - s.slip)
}

/// Torque in N·m of the spring between disc and car.
pub fn spring_torque(config: &Config, y: &Motion) -> f64 {
    shafts(config, y).torque
}

/// Twist in rad at which shafts and tyres at rest carry `torque` N·m: the inverse of their characteristic.
pub fn twist_under(config: &Config, torque: f64) -> f64 {
    let c = &config.constants;
    let tyres = if c.tyre.softness > 0.0 { c.tyre.deflection(torque) } else { 0.0 };
    if c.compliance <= 0.0 {
        return tyres;
    }
    let soft = c.soft_share * c.soft_angle / c.compliance;
    let shafts = if torque.abs() > soft || c.soft_share <= 0.0 {
        torque * c.compliance + (1.0 - c.soft_share) * c.soft_angle.copysign(torque)
    } else {
        torque * c.compliance / c.soft_share
    };
    shafts + tyres
}

/// Torque in N·m with which damping and load resist the vehicle at `omega` rad/s.
#[inline(always)]
pub fn vehicle_resistance(config: &Config, omega: f64, t_load: f64) -> f64 {
    let mut added: f64 = config.load.iter().map(|effect| effect(&config.parameters, &config.vehicle, omega)).sum();
    if config.empirical.load {
        added += empirical::load(&config.parameters, omega, config.constants.driveline.omega_L);
    }
    driveline::resistance(&config.constants.driveline, omega, t_load + added)
}

/// Slip ω_f − ω_c, rad/s.
#[inline(always)]
pub fn slip(y: &Motion) -> f64 {
    y[OMEGA_F] - y[OMEGA_C]
}

/// Clutch torques while slipping in `direction`, eq. (1).
#[inline]
pub fn slipping(config: &Config, found: &FaceCache, y: &Motion, direction: f64, memory: Branch, x: f64) -> Slipping {
    clutch::slipping(config, found, x, memory, direction, slip(y), y)
}

/// Clutch torque in N·m that keeps a stuck clutch together, eq. (7).
#[inline]
pub fn sticking_torque(config: &Config, y: &Motion, t_e: f64, t_load: f64, rest: &Rest) -> f64 {
    let resist = resistance(config, y, t_load, rest.braking());
    holding_torque(config, y, engine_torque(config, y, t_e), resist, rest)
}

/// As [`sticking_torque`], with `t_e` N·m at the crankshaft and `resist` N·m behind the disc. If one side is held at a standstill, the clutch torque is the torque of the other
/// side.
#[inline(always)]
fn holding_torque(config: &Config, y: &Motion, t_e: f64, resist: f64, rest: &Rest) -> f64 {
    if rest.car && !config.compliant() {
        t_e
    } else if rest.engine {
        resist
    } else {
        driveline::holding_torque(&config.constants.driveline, config.disc_inertia(), y[OMEGA_F], t_e, resist)
    }
}

/// Clutch torque in N·m that brings a slipping flywheel to `omega_f` rad/s within `h` seconds; `t_e` is the engine's mean torque over that time, N·m.
pub fn torque_to(config: &Config, y: &Motion, t_e: f64, omega_f: f64, h: f64) -> f64 {
    let mean = 0.5 * (y[OMEGA_F] + omega_f);
    driveline::clutch_torque(&config.constants.driveline, crankshaft_torque(config, t_e, mean, y[CRANK]), mean, (omega_f - y[OMEGA_F]) / h)
}

/// Rates of all states.
#[inline(always)]
fn rates(config: &Config, set: &Setting, found: &FaceCache, y: &Motion, drive: Drive) -> Motion {
    let c = &config.constants;
    let d = &c.driveline;
    let rest = &set.rest;
    let resist = resistance(config, y, set.t_load, rest.braking());
    let t_e = engine_torque(config, y, drive.t_e);
    let mut dy = [0.0; N];
    let (t_fc, slip, heating) = if set.stuck {
        let t_fc = holding_torque(config, y, t_e, resist, rest);
        let stands = rest.engine || rest.car && !config.compliant();
        let common = if stands { 0.0 } else { driveline::flywheel_acceleration(d, y[OMEGA_F], t_e, t_fc) };
        dy[OMEGA_F] = common;
        dy[OMEGA_C] = common;
        (t_fc, 0.0, 0.0)
    } else {
        let slip = slip(y);
        let (t_fc, heating) = if let Some(Coupling::Torque(torque)) = config.coupling {
            (torque, torque * slip)
        } else {
            let slipping = slipping(config, found, y, set.direction, set.memory, drive.x);
            (slipping.total(), slipping.friction * slip)
        };
        dy[OMEGA_F] = if rest.engine { 0.0 } else { driveline::flywheel_acceleration(d, y[OMEGA_F], t_e, t_fc) };
        let held = rest.car && !config.compliant();
        dy[OMEGA_C] = if held { 0.0 } else { driveline::driveline_acceleration(config.disc_inertia(), t_fc, resist) };
        (t_fc, slip, heating)
    };
    dy[LOSSES] = d.b_f * y[OMEGA_F] * y[OMEGA_F];
    if config.compliant() {
        let shafts = shafts(config, y);
        let twist_rate = y[OMEGA_C] - y[OMEGA_V] - shafts.slip;
        let load = vehicle_resistance(config, y[OMEGA_V], set.t_load + rest.braking());
        dy[TWIST] = twist_rate;
        dy[OMEGA_V] = if rest.car { 0.0 } else { driveline::driveline_acceleration(d.J_c - config.disc_inertia(), resist, load) };
        dy[LOSSES] += load * y[OMEGA_V] + c.shaft_damping * twist_rate * twist_rate;
        if c.tyre.softness > 0.0 {
            dy[LOSSES] += resist * shafts.slip;
        }
    } else {
        dy[OMEGA_V] = dy[OMEGA_C];
        dy[LOSSES] += resist * y[OMEGA_C];
    }
    (dy[THETA_C], dy[THETA_B]) = thermal::single_rates(&c.thermal, y[THETA_C], y[THETA_B], set.theta_h, set.engaged, heating);
    if c.surface.resistance > 0.0 {
        let rise = c.surface.resistance * heating / (1.0 + slip.abs() / c.surface.speed).sqrt();
        dy[SURFACE] = (rise - y[SURFACE]) / c.surface.time_constant;
    }
    dy[ANGLE] = slip;
    dy[CRANK] = y[OMEGA_F];
    dy[E_D] = t_fc * slip;
    dy[WORK_IN] = t_e * y[OMEGA_F];
    dy
}

/// One Runge–Kutta step of `h` seconds; `drive` at its start, middle and end.
#[inline]
pub fn runge_kutta(config: &Config, set: &Setting, y: &Motion, drive: [Drive; 3], h: f64) -> Motion {
    let at = |k: &Motion, f: f64| -> Motion { std::array::from_fn(|i| y[i] + f * k[i]) };
    let k1 = rates(config, set, &set.found, y, drive[0]);
    let later = &FaceCache::EMPTY;
    let k2 = rates(config, set, later, &at(&k1, 0.5 * h), drive[1]);
    let k3 = rates(config, set, later, &at(&k2, 0.5 * h), drive[1]);
    let k4 = rates(config, set, later, &at(&k3, h), drive[2]);
    let mut next: Motion = std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
    if set.stuck {
        next[OMEGA_C] = next[OMEGA_F];
    }
    if !config.compliant() {
        next[OMEGA_V] = next[OMEGA_C];
    }
    next
}

/// Kinetic energy plus the elastic energy of shafts and tyres, J.
pub fn stored_energy(config: &Config, y: &Motion) -> f64 {
    let d = &config.constants.driveline;
    let disc = config.disc_inertia();
    let c = &config.constants;
    let spring = if config.compliant() {
        let tyres = shafts(config, y).tyres.abs();
        let twist = y[TWIST].abs() - tyres;
        let within = twist.min(c.soft_angle);
        let shafts =
            if c.compliance > 0.0 { (twist * twist - (1.0 - c.soft_share) * within * (2.0 * twist - within)) / c.compliance } else { 0.0 };
        let bend = c.tyre.softness * c.tyre.grip;
        let tyre = if bend > 0.0 { 2.0 * c.tyre.grip * (tyres - bend * (tyres / bend).ln_1p()) } else { 0.0 };
        shafts + tyre
    } else {
        0.0
    };
    0.5 * (d.J_f * y[OMEGA_F] * y[OMEGA_F] + disc * y[OMEGA_C] * y[OMEGA_C] + (d.J_c - disc) * y[OMEGA_V] * y[OMEGA_V] + spring)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{null, param};
    use crate::vehicle::Vehicle;

    /// Shafts and tyres in series transmit the same torque: it is recovered from the sum of the twists that it causes in each of them, within the soft range and beyond.
    #[test]
    fn the_torque_of_shafts_and_tyres_is_found_from_their_common_twist() {
        let (compliance, angle, slip_per_torque) = (1e-3, 0.02, 3e-4);
        for share in [1.0, 0.3, 0.0] {
            let mut p = null();
            p[param::driveline_compliance::compliance] = compliance;
            p[param::driveline_compliance::soft_angle] = angle;
            p[param::driveline_compliance::soft_share] = share;
            p[param::tyre_slip::slip_per_torque] = slip_per_torque;
            p[param::tyre_slip::grip] = 60.0;
            let config = Config::new(&Vehicle::paper(), &p);
            let end = share * angle / compliance;
            for torque in [0.5_f64, 5.9, 6.1, 19.0, 30.0, 55.0] {
                let of_shafts = if torque < end { torque * compliance / share } else { (1.0 - share) * angle + torque * compliance };
                let of_tyres = config.constants.tyre.deflection(torque);
                for sign in [1.0, -1.0] {
                    let mut y = [0.0; N];
                    (y[TWIST], y[OMEGA_C], y[OMEGA_V]) = (sign * (of_shafts + of_tyres), 12.0, 8.0);
                    let found = shafts(&config, &y);
                    let near = |value: f64, expected: f64| (value - sign * expected).abs() < 1e-9 * (1.0 + expected);
                    assert!(near(found.torque, torque) && near(found.tyres, of_tyres), "{share} {torque}: {found:?}");
                    assert!(near(found.slip, 10.0 * of_tyres / config.constants.tyre.relaxation), "{share} {torque}: {found:?}");
                }
            }
        }
        // Lash transmits no torque.
        let mut p = null();
        p[param::driveline_compliance::compliance] = compliance;
        p[param::driveline_compliance::soft_angle] = angle;
        p[param::driveline_compliance::soft_share] = 0.0;
        p[param::tyre_slip::slip_per_torque] = slip_per_torque;
        let mut y = [0.0; N];
        y[TWIST] = 0.9 * angle;
        assert_eq!(shafts(&Config::new(&Vehicle::paper(), &p), &y).torque, 0.0);
    }
}
