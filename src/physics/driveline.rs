//! Driveline: the two balances of paper eq. (7), the load, and the torque that holds a locked clutch.
//!
//! J_f ω̇_f = −b_f ω_f + T_e − T_fc, J_c ω̇_c = −b_c ω_c + T_fc − T_L,
//! T_L = T_L0 tanh(ω_c/ω_L) + k_L ω_c |ω_c| + T_load.
//!
//! | symbol | meaning | unit | source |
//! |---|---|---|---|
//! | ω_f, ω_c | flywheel and disc speed | rad/s | eq. (7) |
//! | J_f, J_c | inertias | kg·m² | Table I (printed without unit for J_c) |
//! | b_f, b_c | damping | N·m·s/rad | Table I (printed in N·m·s) |
//! | T_L0, ω_L, k_L | rolling load, its speed scale, aerodynamic load | N·m, rad/s, N·m·s²/rad² | open in the paper |

/// Parameters of the driveline.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[allow(non_snake_case)]
pub struct Driveline {
    /// Engine and flywheel inertia, kg·m².
    pub J_f: f64,
    /// Driveline and vehicle inertia at the clutch, kg·m².
    pub J_c: f64,
    /// Engine damping, N·m·s/rad.
    pub b_f: f64,
    /// Driveline damping, N·m·s/rad.
    pub b_c: f64,
    /// Rolling load, N·m.
    pub T_L0: f64,
    /// Speed scale of the rolling load, rad/s.
    pub omega_L: f64,
    /// Aerodynamic load, N·m·s²/rad².
    pub k_L: f64,
    /// Load torque of a vertical grade, N·m: weight times wheel radius over ratio.
    pub mgR_over_i: f64,
}

/// Argument beyond which tanh is 1 to the last place.
const SATURATED: f64 = 19.1;

/// tanh, accurate to rounding, in a third of the time of the standard library: every stage of every step evaluates it.
#[inline(always)]
pub fn tanh(z: f64) -> f64 {
    let size = z.abs();
    if size > SATURATED {
        1.0_f64.copysign(z)
    } else if size < 0.5 {
        z.tanh()
    } else {
        (1.0 - 2.0 / ((2.0 * size).exp() + 1.0)).copysign(z)
    }
}

/// Load torque T_L in N·m at `omega_c` rad/s, without the input T_load.
#[inline(always)]
pub fn load_torque(p: &Driveline, omega_c: f64) -> f64 {
    p.T_L0 * tanh(omega_c * (1.0 / p.omega_L)) + p.k_L * omega_c * omega_c.abs()
}

/// Acceleration of the flywheel in rad/s², eq. (7a).
#[inline(always)]
pub fn flywheel_acceleration(p: &Driveline, omega_f: f64, t_e: f64, t_fc: f64) -> f64 {
    (t_e - p.b_f * omega_f - t_fc) * (1.0 / p.J_f)
}

/// Clutch torque in N·m that follows from eq. (7a) for the engine torque `t_e` in N·m, the flywheel speed in rad/s and its rate in rad/s²: the inverse of
/// [`flywheel_acceleration`].
pub fn clutch_torque(p: &Driveline, t_e: f64, omega_f: f64, omega_f_rate: f64) -> f64 {
    t_e - p.b_f * omega_f - p.J_f * omega_f_rate
}

/// Torque in N·m that resists the driveline at `omega` rad/s: damping, load, and `extra` (N·m); from eq. (7b).
#[inline(always)]
pub fn resistance(p: &Driveline, omega: f64, extra: f64) -> f64 {
    p.b_c * omega + load_torque(p, omega) + extra
}

/// Acceleration in rad/s² of an inertia `j` (kg·m²) behind the clutch, eq. (7b).
#[inline(always)]
pub fn driveline_acceleration(j: f64, t_fc: f64, resist: f64) -> f64 {
    (t_fc - resist) * (1.0 / j)
}

/// Static clutch torque in N·m that keeps ω_fc = 0 with both sides at `omega`: (7a) and (7b) with equal accelerations.
///
/// `j` is the inertia that turns with the disc (kg·m²) and `resist` the total torque that resists it (N·m).
#[inline]
pub fn holding_torque(p: &Driveline, j: f64, omega: f64, t_e: f64, resist: f64) -> f64 {
    (j * (t_e - p.b_f * omega) + p.J_f * resist) / (p.J_f + j)
}
