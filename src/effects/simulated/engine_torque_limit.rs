//! The engine torque is limited to full load: T = min(T_asked, T_max (1 − f ((ω_f − ω_m)/ω_m)²)), T_max = 1/`inverse_torque`.
//!
//! The parabola is never less than a tenth of T_max, and the corner is rounded: min(a, b) = ½ (a + b − √((a − b)² + ε²)) + ½ (√(b² + ε²) − b), ε = 2 N·m,
//! which leaves a request of zero unchanged.
//!
//! Source: Heywood, *Internal Combustion Engine Fundamentals*, 1988, chapter 15 (full-load torque over speed); Guzzella and Onder, *Introduction to Modeling and Control of
//! Internal Combustion Engine Systems*, 2nd ed. 2010, chapter 2.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `inverse_torque` | inverse of the greatest torque; 0 is no limit | 1/(N·m) |
//! | ω_m, `best_speed` | speed at which T_max is reached | rad/s |
//! | f, `falling` | share that is lost at standstill and at twice that speed | 1 |

use super::{Act, Effect, Parameters, Subsystem, param};

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Engine,
    amplitudes: &[param::engine_torque_limit::inverse_torque],
    act: Act::Engine(apply),
    starts: &[&[(param::engine_torque_limit::inverse_torque, 0.02)]],
    shown_by: "full load over the range of engine speeds",
};

/// Width of the rounded corner, N·m.
const CORNER: f64 = 2.0;

/// Least share of the greatest torque that is left at any speed.
const LEAST: f64 = 0.1;

fn apply(p: &Parameters, asked: f64, omega_f: f64, _: f64) -> f64 {
    let best = p[param::engine_torque_limit::best_speed];
    let away = omega_f / best - 1.0;
    let share = (1.0 - p[param::engine_torque_limit::falling] * away * away).max(LEAST);
    let most = share / p[param::engine_torque_limit::inverse_torque];
    // Both terms are differences between a large and a small number, written so that no digits are lost in them.
    let (over, spare) = (most - asked, most);
    let rounded = |gap: f64| 0.5 * CORNER * CORNER / (gap.hypot(CORNER) + gap.abs());
    asked + over.min(0.0) - rounded(over) + rounded(spare)
}
