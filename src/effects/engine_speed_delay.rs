//! The engine speed arrives late: it passes a filter of first order, smoothing · ṡ + s = ω_f, and a dead time; what is sensed is s(t − delay).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `delay` | dead time of the signal | s |
//! | `smoothing` | time constant of the filter | s |

use super::{Act, Constants, Effect, Parameters, SignalDelay, Subsystem, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Sensors,
    amplitudes: &[param::engine_speed_delay::delay, param::engine_speed_delay::smoothing],
    act: Act::Constants(apply),
    starts: &[&[(param::engine_speed_delay::delay, 0.02)], &[(param::engine_speed_delay::delay, 0.05)]],
    shown_by: "strong changes of the engine speed while locked, where both speeds should agree",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.engine_speed_delay = SignalDelay { dead_time: p[param::engine_speed_delay::delay], smoothing: p[param::engine_speed_delay::smoothing] };
}
