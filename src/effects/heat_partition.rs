//! Changed share of the friction heat that enters the disc: γ_3 + share_change, in 0..1.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `share_change` | change of γ_3 | 1 |

use super::{Act, Constants, Effect, Parameters, Subsystem, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Thermal,
    amplitudes: &[param::heat_partition::share_change],
    act: Act::Constants(apply),
    starts: &[&[(param::heat_partition::share_change, 0.15)], &[(param::heat_partition::share_change, -0.15)]],
    shown_by: "the disc thermocouple during a hard launch",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.thermal.gamma_3 = (c.thermal.gamma_3 + p[param::heat_partition::share_change]).clamp(0.0, 1.0);
}
