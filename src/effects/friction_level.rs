//! Friction coefficient off by a factor at every speed and temperature.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `factor` | factor on μ | 1 |

use super::{Act, Constants, Effect, Parameters, Subsystem, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Friction,
    amplitudes: &[param::friction_level::factor],
    act: Act::Constants(apply),
    starts: &[&[(param::friction_level::factor, 1.15)], &[(param::friction_level::factor, 0.85)]],
    shown_by: "slip at several torque levels, cold and hot",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.friction_factor *= p[param::friction_level::factor];
}
