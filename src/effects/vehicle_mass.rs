//! Changed vehicle inertia: factor · J_c.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `factor` | factor on J_c | 1 |

use super::{Act, Constants, Effect, Parameters, Subsystem, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Driveline,
    amplitudes: &[param::vehicle_mass::factor],
    act: Act::Constants(apply),
    starts: &[&[(param::vehicle_mass::factor, 1.1)], &[(param::vehicle_mass::factor, 0.9)]],
    shown_by: "acceleration with the clutch locked at several torques",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.driveline.J_c *= p[param::vehicle_mass::factor];
}
