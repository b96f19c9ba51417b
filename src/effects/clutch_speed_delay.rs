//! The disc speed arrives late: it passes a dead time and a filter of first order. What is sensed is ω_c(t − delay − τ) in the mean over
//! the filter's memory, τ ~ Exp(smoothing), at the two nodes of Gauss and Laguerre, which keep its first three moments.
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
