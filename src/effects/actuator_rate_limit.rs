//! Finite speed of the bearing: |ẋ| ≤ 1/inverse_speed towards its command, slowing down in proportion to the distance over the last
//! `approach`.
//!
//! The inverse speed keeps the null value finite: 0 is a bearing without limit.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `inverse_speed` | inverse of the greatest speed | s/mm |
//! | `approach` | distance over which the bearing slows down | mm |

use super::{Act, Constants, Effect, Parameters, Subsystem, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Actuator,
    amplitudes: &[param::actuator_rate_limit::inverse_speed],
    act: Act::Constants(apply),
    starts: &[
        &[(param::actuator_rate_limit::inverse_speed, 0.06)],
        &[(param::actuator_rate_limit::inverse_speed, 0.15)],
        &[(param::actuator_rate_limit::inverse_speed, 0.3)],
    ],
    shown_by: "fast strokes: a strong launch and its lock-up, or the bearing position sensor",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.inverse_speed = p[param::actuator_rate_limit::inverse_speed];
    c.approach = p[param::actuator_rate_limit::approach];
}
