//! From throwout position to torque capacity: paper eq. (1) to (4) with the effects that modify them.

use super::config::Config;
use super::motion::{Motion, index};
use crate::effects::empirical;
use crate::physics::{cushion, friction, map};

/// Kiss point and closed point at the disc temperature `theta` in °C, after `work` J of friction work, which wears the facings.
#[inline]
fn contact(config: &Config, theta: f64, work: f64) -> map::Contact {
    let mut contact = map::contact(&config.vehicle.actuator, theta);
    contact.x_cnt += config.constants.contact_shift.x_cnt;
    contact.x_cls += config.constants.contact_shift.x_cls;
    for effect in config.contact.iter() {
        effect(&config.parameters, theta, &mut contact);
    }
    for effect in config.worn.iter() {
        effect(&config.parameters, work, &mut contact);
    }
    contact
}

/// Normalised position ξ of eq. (2) at the bearing position `x` in mm and the disc temperature `theta` in °C, before any friction work of the run.
#[inline]
pub fn normalised_position(config: &Config, x: f64, theta: f64) -> f64 {
    worn_position(config, x, theta, 0.0)
}

/// As [`normalised_position`], after `work` J of friction work in the run.
#[inline]
fn worn_position(config: &Config, x: f64, theta: f64, work: f64) -> f64 {
    map::normalised_position(contact(config, theta, work), x)
}

/// Closing ratio of the clutch at the bearing position `x` in mm and the disc temperature `theta` in °C: 0 at the true contact point ξ_0, 1 at the closed point; before any
/// friction work of the run.
#[inline]
pub fn closing(config: &Config, x: f64, theta: f64) -> f64 {
    closing_after(config, x, theta, 0.0)
}

/// As [`closing`], after `work` J of friction work in the run.
#[inline]
pub fn closing_after(config: &Config, x: f64, theta: f64, work: f64) -> f64 {
    (worn_position(config, x, theta, work) - config.xi_0) / (1.0 - config.xi_0)
}

/// Bearing position in mm with the closing ratio `closing`: the inverse of [`closing`].
pub fn position_of(config: &Config, closing: f64, theta: f64) -> f64 {
    let contact = contact(config, theta, 0.0);
    contact.x_cnt + (config.xi_0 + closing * (1.0 - config.xi_0)) * (contact.x_cls - contact.x_cnt)
}

/// As [`FaceCache::engaged`], at the bearing position `x` in mm and the disc temperature `theta` in °C, before any friction work of the run.
#[inline]
pub fn engaged(config: &Config, x: f64, theta: f64) -> bool {
    engaged_after(config, x, theta, 0.0)
}

/// As [`engaged`], after `work` J of friction work in the run.
#[inline]
pub fn engaged_after(config: &Config, x: f64, theta: f64, work: f64) -> bool {
    worn_position(config, x, theta, work) > config.xi_0
}

/// Cache of normalised position and equivalent radius, each with the arguments that it was computed for. At the end of a step its outputs need these values, and so does the
/// beginning of the next step.
#[derive(Clone, Copy, Debug)]
pub struct FaceCache {
    /// Bearing position, mm.
    x: f64,
    /// Disc temperature, °C.
    theta: f64,
    /// Friction work that has worn the faces, J.
    work: f64,
    /// Normalised position for these arguments.
    xi: f64,
    /// Slip speed ≥ 0 that `radius` was computed for, rad/s.
    slip: f64,
    /// Equivalent radius at `slip` and `theta`, m.
    radius: f64,
}

/// Always equal: the cache follows from the rest of a plant, so two plants never differ by it alone.
impl PartialEq for FaceCache {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl FaceCache {
    /// An empty cache: its arguments are NaN, which no number equals.
    pub const EMPTY: Self = Self { x: f64::NAN, theta: f64::NAN, work: f64::NAN, xi: f64::NAN, slip: f64::NAN, radius: f64::NAN };

    /// Returns the cache with the normalised position at `x` mm and the temperature and wear of `y`; a radius for another temperature becomes invalid.
    #[inline]
    pub fn with_position(self, config: &Config, x: f64, y: &Motion) -> Self {
        let (theta, work) = (y[index::THETA_C], y[index::E_D]);
        let slip = if theta == self.theta { self.slip } else { f64::NAN };
        Self { x, theta, work, xi: self.position(config, x, theta, work), slip, ..self }
    }

    /// Returns the cache with the equivalent radius at a slip of `slip` ≥ 0 rad/s and the cached temperature.
    #[inline]
    pub fn with_radius(self, config: &Config, slip: f64) -> Self {
        Self { slip, radius: self.radius(config, slip, self.theta), ..self }
    }

    /// Whether the faces touch: ξ > ξ_0, the thermal model's δ_1.
    #[inline]
    pub fn engaged(&self, config: &Config) -> bool {
        self.xi > config.xi_0
    }

    #[inline]
    fn position(&self, config: &Config, x: f64, theta: f64, work: f64) -> f64 {
        if x == self.x && theta == self.theta && work == self.work { self.xi } else { worn_position(config, x, theta, work) }
    }

    #[inline]
    fn radius(&self, config: &Config, slip: f64, theta: f64) -> f64 {
        if slip == self.slip && theta == self.theta {
            self.radius
        } else {
            friction::equivalent_radius(&config.vehicle.friction, slip, theta)
        }
    }
}

/// Memory of the force hysteresis: last bearing position, and branch.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Branch {
    /// Bearing position, mm.
    pub x: f64,
    /// −1 on the opening branch, +1 on the closing one.
    pub z: f64,
}

/// Memory after the bearing has moved to `x` mm. Each branch is approached exponentially with half the stroke as length constant, as in Dahl's model.
#[inline]
pub fn advance_branch(config: &Config, memory: Branch, x: f64) -> Branch {
    let travel = x - memory.x;
    if travel == 0.0 {
        return memory;
    }
    let target = travel.signum();
    let kept = (-2.0 * travel.abs() / config.constants.hysteresis_stroke).exp();
    Branch { x, z: target + (memory.z - target) * kept }
}

/// Force on the faces in N at bearing position `x` mm, hysteresis memory `memory` and the disc temperature of `y`.
#[inline]
pub fn force(config: &Config, found: &FaceCache, x: f64, memory: Branch, y: &Motion) -> f64 {
    let theta = y[index::THETA_C];
    let xi = found.position(config, x, theta, y[index::E_D]);
    let mut force = cushion::force(&config.vehicle.cushion_spring, config.xi_0, xi);
    if config.constants.hysteresis_width != 0.0 {
        force *= 1.0 + 0.5 * config.constants.hysteresis_width * advance_branch(config, memory, x).z;
    }
    for effect in config.force.iter() {
        force *= effect(&config.parameters, theta);
    }
    if config.empirical.force {
        let direction = if config.empirical.direction { advance_branch(config, memory, x).z } else { 0.0 };
        force *= empirical::force(&config.parameters, xi, direction, theta);
    }
    force
}

/// Temperature in °C at which friction is evaluated: the disc's, plus the excess temperature of the faces where that effect is active.
#[inline]
fn face_temperature(config: &Config, y: &Motion) -> f64 {
    if config.constants.surface.resistance == 0.0 { y[index::THETA_C] } else { y[index::THETA_C] + y[index::SURFACE] }
}

/// Torque capacity in N·m under a force in N at slip speed `slip` ≥ 0 rad/s, eq. (1).
#[inline]
pub fn capacity_under(config: &Config, found: &FaceCache, force: f64, slip: f64, y: &Motion) -> f64 {
    if force == 0.0 {
        return 0.0;
    }
    let theta = face_temperature(config, y);
    let mut torque = config.constants.friction_factor * map::torque_at_radius(found.radius(config, slip, theta), force);
    for effect in config.friction_added.iter() {
        let per_mu = map::torque_of(&config.vehicle.friction, force, 1.0);
        torque += per_mu * effect(&config.parameters, slip, torque / per_mu);
    }
    for effect in config.friction.iter() {
        torque *= effect(&config.parameters, slip, theta);
    }
    for effect in config.pressure.iter() {
        torque *= effect(&config.parameters, force);
    }
    for effect in config.pulsation.iter() {
        torque *= effect(&config.parameters, y[index::ANGLE], slip);
    }
    for effect in config.shafts.iter() {
        torque *= effect(&config.parameters, [y[index::CRANK], y[index::CRANK] - y[index::ANGLE]]);
    }
    if config.empirical.friction {
        let closed = cushion::force(&config.vehicle.cushion_spring, config.xi_0, 1.0);
        torque *= empirical::friction(&config.parameters, slip, theta, force / closed, y[index::E_D]);
    }
    torque.max(0.0)
}

/// Torque capacity in N·m at bearing position `x` mm and slip speed `slip` ≥ 0 rad/s, eq. (1).
#[inline]
pub fn capacity(config: &Config, x: f64, memory: Branch, slip: f64, y: &Motion) -> f64 {
    let found = &FaceCache::EMPTY;
    capacity_under(config, found, force(config, found, x, memory, y), slip, y)
}

/// Torques in N·m of a slipping clutch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slipping {
    /// Friction of the faces: capacity in the direction of slip, eq. (1).
    pub friction: f64,
    /// Drag. It churns air and oil, which carry its heat away, so it does not heat the clutch: eq. (5) has no friction power while the clutch is open.
    pub drag: f64,
}

impl Slipping {
    /// T_fc.
    #[inline]
    pub fn total(self) -> f64 {
        self.friction + self.drag
    }
}

/// Slip speed in rad/s at which friction is evaluated: the slip in its `direction`, at least 0.
#[inline]
pub fn along(direction: f64, slip: f64) -> f64 {
    (direction * slip).max(0.0)
}

/// Torques of a clutch that slips in `direction` ±1; `slip` is signed, rad/s.
#[inline]
pub fn slipping(config: &Config, found: &FaceCache, x: f64, memory: Branch, direction: f64, slip: f64, y: &Motion) -> Slipping {
    let force = force(config, found, x, memory, y);
    let drag: f64 = config.drag.iter().map(|effect| effect(&config.parameters, slip, force)).sum();
    Slipping { friction: direction * capacity_under(config, found, force, along(direction, slip), y), drag }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects;
    use crate::plant::{Inputs, Plant, Start};
    use crate::vehicle::Vehicle;

    /// No torque is transmitted up to the true contact point, and the closed point is the vehicle's.
    #[test]
    fn closing_counts_from_the_true_contact_to_the_closed_point() {
        let config = Config::new(&Vehicle::paper(), &effects::null());
        for theta in [25.0, 180.0] {
            let mut y = Motion::default();
            y[index::THETA_C] = theta;
            for part in [-0.1, 0.0, 0.3, 1.0] {
                assert!((closing(&config, position_of(&config, part, theta), theta) - part).abs() < 1e-12, "{part} at {theta}");
            }
            let carried = |part: f64| {
                let x = position_of(&config, part, theta);
                capacity(&config, x, Branch { x, z: 0.0 }, 50.0, &y)
            };
            assert_eq!(carried(-0.01), 0.0);
            assert!(carried(0.05) > 0.0 && carried(1.0) > carried(0.05));
            assert!((position_of(&config, 1.0, theta) - map::contact(&config.vehicle.actuator, theta).x_cls).abs() < 1e-12);
        }
    }

    /// Eq. (2): ξ rises linearly from 0 at the kiss point to 1 at the closed point and is limited to that range.
    #[test]
    fn a_normalised_position_counts_from_the_contact_to_the_closed_point() {
        let config = Config::new(&Vehicle::paper(), &effects::null());
        for theta in [25.0, 180.0] {
            let map::Contact { x_cnt, x_cls } = map::contact(&config.vehicle.actuator, theta);
            for part in [-0.2, 0.0, 0.4, 1.0, 1.2_f64] {
                let found = normalised_position(&config, x_cnt + part * (x_cls - x_cnt), theta);
                assert!((found - part.clamp(0.0, 1.0)).abs() < 1e-12, "{part} at {theta}: {found}");
            }
        }
    }

    #[test]
    fn a_plant_knows_its_slip_and_its_closing() {
        let start = Start { omega_f: 100.0, omega_c: 30.0, theta_c: 90.0, theta_b: 40.0 };
        let plant = Plant::new(&Vehicle::paper(), &effects::null(), &start, &Inputs { x_to: 5.0, ..Inputs::default() });
        assert_eq!(plant.slip(), 70.0);
        assert_eq!(plant.closing(), closing(plant.config(), 5.0, 90.0));
    }
}
