//! The engine speed arrives late: sensed ω_f(t) is ω_f(t − delay).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `delay` | delay of the signal | s |

use super::{Act, Constants, Effect, Parameters, Subsystem, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Sensors,
    amplitudes: &[param::engine_speed_delay::delay],
    act: Act::Constants(apply),
    starts: &[&[(param::engine_speed_delay::delay, 0.02)], &[(param::engine_speed_delay::delay, 0.05)]],
    shown_by: "strong changes of the engine speed while locked, where both speeds should agree",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.engine_speed_delay = p[param::engine_speed_delay::delay];
}
