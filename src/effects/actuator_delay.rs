//! Pure transport delay of the position command: x(t) = x_cmd(t − delay).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `delay` | transport delay | s |

use super::{Act, Constants, Effect, Parameters, Subsystem, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Actuator,
    amplitudes: &[param::actuator_delay::delay],
    act: Act::Constants(apply),
    starts: &[&[(param::actuator_delay::delay, 0.015)], &[(param::actuator_delay::delay, 0.05)]],
    shown_by: "a position chirp, or the bearing position sensor",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.command_delay += p[param::actuator_delay::delay];
}
