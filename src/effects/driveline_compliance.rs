//! Shafts between disc and vehicle twist: J_c splits in two, with a spring and a damper between them.
//!
//! T_s = (φ − (1 − q) φ_a)/compliance + damping (ω_c − ω_v), φ̇ = ω_c − ω_v, φ_a being φ limited to ±a; the disc keeps disc_share · J_c, and the
//! load acts on the rest. A pre-damper is soft within ±a; with q = 0 it is lash.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `compliance` | twist per torque, outside the soft range; 0 is rigid | rad/(N·m) |
//! | `disc_share` | share of J_c on the disc side | 1 |
//! | `damping` | damping of the shafts | N·m·s/rad |
//! | a | `soft_angle` | rad |
//! | q | `soft_share` of the stiffness within the soft angle | 1 |

use super::{Act, Constants, Effect, Parameters, Subsystem, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Driveline,
    amplitudes: &[param::driveline_compliance::compliance],
    act: Act::Constants(apply),
    // A search that starts at one oscillation frequency does not find its way to another.
    starts: &[
        &[(param::driveline_compliance::compliance, 0.003)],
        &[(param::driveline_compliance::compliance, 0.006)],
        &[(param::driveline_compliance::compliance, 0.010)],
        &[(param::driveline_compliance::compliance, 0.015), (param::driveline_compliance::damping, 0.5)],
    ],
    shown_by: "torque steps with the clutch locked (tip-in, tip-out)",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.compliance = p[param::driveline_compliance::compliance];
    c.disc_share = p[param::driveline_compliance::disc_share];
    c.shaft_damping = p[param::driveline_compliance::damping];
    c.soft_angle = p[param::driveline_compliance::soft_angle];
    c.soft_share = p[param::driveline_compliance::soft_share];
}
