//! The disc speed arrives late: sensed ω_c(t) is ω_c(t − delay).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `delay` | delay of the signal | s |

use super::{Act, Constants, Effect, Parameters, Subsystem, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Sensors,
    amplitudes: &[param::clutch_speed_delay::delay],
    act: Act::Constants(apply),
    starts: &[&[(param::clutch_speed_delay::delay, 0.02)], &[(param::clutch_speed_delay::delay, 0.05)]],
    shown_by: "strong changes of the disc speed while locked, where both speeds should agree",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.clutch_speed_delay = p[param::clutch_speed_delay::delay];
}
