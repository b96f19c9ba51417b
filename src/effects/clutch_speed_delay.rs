//! The disc speed arrives late: it passes a filter of first order, smoothing · ṡ + s = ω_c, and a dead time; what is sensed is s(t − delay).
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
    amplitudes: &[param::clutch_speed_delay::delay, param::clutch_speed_delay::smoothing],
    act: Act::Constants(apply),
    starts: &[&[(param::clutch_speed_delay::delay, 0.02)], &[(param::clutch_speed_delay::delay, 0.05)]],
    shown_by: "strong changes of the disc speed while locked, where both speeds should agree",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.clutch_speed_delay = SignalDelay { dead_time: p[param::clutch_speed_delay::delay], smoothing: p[param::clutch_speed_delay::smoothing] };
}
