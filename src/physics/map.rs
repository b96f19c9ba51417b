//! Torque map: normalised position (2) from position and temperature, torque capacity (1), and the inverse of the map.
//!
//! ξ = sat_0^1((x_to − x_cnt(θ)) / (x_cls(θ) − x_cnt(θ))), T_cap = 2 R_μ(ω, θ) F(ξ).
//!
//! | symbol | meaning | unit | source |
//! |---|---|---|---|
//! | x_to | throwout-bearing position | mm | paper eq. (2) |
//! | x_cnt, x_cls | kiss point and closed point, quadratic in θ − 25 °C | mm | eq. (2) |
//! | T_cap | torque capacity of both faces | N·m | eq. (1) |

use super::cushion::{self, CushionSpring};
use super::friction::{self, Friction};

/// Temperature at which the constant terms of x_cnt and x_cls hold, °C.
pub const THETA_REFERENCE: f64 = 25.0;

/// Number of friction faces, eq. (1).
pub const FACES: f64 = 2.0;

/// Kiss point and closed point as polynomials in θ − 25 °C.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Actuator {
    /// Kiss point at 25 °C, mm.
    pub x_cnt_0: f64,
    /// Kiss point, linear term, mm/K.
    pub x_cnt_1: f64,
    /// Kiss point, quadratic term, mm/K².
    pub x_cnt_2: f64,
    /// Closed point at 25 °C, mm.
    pub x_cls_0: f64,
    /// Closed point, linear term, mm/K.
    pub x_cls_1: f64,
    /// Closed point, quadratic term, mm/K².
    pub x_cls_2: f64,
}

/// Where contact begins and where the clutch is closed, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Kiss point, mm.
    pub x_cnt: f64,
    /// Closed point, mm.
    pub x_cls: f64,
}

/// Kiss point and closed point at `theta` in °C.
#[inline]
pub fn contact(p: &Actuator, theta: f64) -> Contact {
    let d = theta - THETA_REFERENCE;
    Contact { x_cnt: p.x_cnt_0 + d * (p.x_cnt_1 + d * p.x_cnt_2), x_cls: p.x_cls_0 + d * (p.x_cls_1 + d * p.x_cls_2) }
}

/// Normalised position ξ of eq. (2), in 0..1, at `x_to` in mm.
///
/// If an effect or heat has driven the kiss point to or beyond the closed point, no travel is left between open and closed: ξ is then 0 up to the kiss point and 1 above it.
#[inline]
pub fn normalised_position(contact: Contact, x_to: f64) -> f64 {
    if contact.x_cls <= contact.x_cnt {
        return if x_to > contact.x_cnt { 1.0 } else { 0.0 };
    }
    ((x_to - contact.x_cnt) / (contact.x_cls - contact.x_cnt)).clamp(0.0, 1.0)
}

/// Torque capacity 2 R_μ F in N·m for a spring force in N, at slip `omega` ≥ 0 in rad/s and `theta` in °C; eq. (1).
#[inline]
pub fn torque_capacity(p: &Friction, force: f64, omega: f64, theta: f64) -> f64 {
    if force == 0.0 { 0.0 } else { torque_at_radius(friction::equivalent_radius(p, omega, theta), force) }
}

/// As [`torque_capacity`], for a given equivalent radius `radius` in m.
#[inline]
pub fn torque_at_radius(radius: f64, force: f64) -> f64 {
    FACES * radius * force
}

/// Torque in N·m for a friction coefficient `mu`, uniform over the facing, under a spring force in N; eq. (1), (3).
#[inline]
pub fn torque_of(p: &Friction, force: f64, mu: f64) -> f64 {
    FACES * friction::mean_radius(p) * mu * force
}

/// Throwout position in mm at which the nominal clutch carries `torque` ≥ 0 N·m: the inverse of eq. (1) on its monotone
/// branch, between the true contact point and the closed point.
pub fn inverse(f: &Friction, a: &Actuator, c: &CushionSpring, torque: f64, omega: f64, theta: f64) -> f64 {
    inverse_above(f, a, c, cushion::contact_point(c), torque, omega, theta)
}

/// As [`inverse`], for a given true contact point `xi_0`, which saves computing it in repeated calls.
#[inline]
pub fn inverse_above(f: &Friction, a: &Actuator, c: &CushionSpring, xi_0: f64, torque: f64, omega: f64, theta: f64) -> f64 {
    inverse_with_slope(f, a, c, xi_0, torque, omega, theta).0
}

/// As [`inverse_above`]; returns the position in mm and the slope of the torque over position there, N·m/mm.
#[inline]
pub fn inverse_with_slope(f: &Friction, a: &Actuator, c: &CushionSpring, xi_0: f64, torque: f64, omega: f64, theta: f64) -> (f64, f64) {
    let contact = contact(a, theta);
    let per_force = FACES * friction::equivalent_radius(f, omega, theta);
    let xi = cushion::inverse(c, xi_0, torque / per_force);
    let travel = contact.x_cls - contact.x_cnt;
    (contact.x_cnt + xi * travel, per_force * cushion::slope(c, xi) / travel)
}
