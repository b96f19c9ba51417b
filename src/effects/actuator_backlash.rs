//! Play between command and bearing: the bearing moves once the command has crossed the play.
//!
//! x = clamp(x, x_cmd − play/2, x_cmd + play/2), a play operator; it starts in the middle of the play.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `play` | width of the play | mm |

use super::{Act, Constants, Effect, Parameters, Subsystem, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Actuator,
    amplitudes: &[param::actuator_backlash::play],
    act: Act::Constants(apply),
    starts: &[&[(param::actuator_backlash::play, 0.05)], &[(param::actuator_backlash::play, 0.2)]],
    shown_by: "a position chirp or a creep sweep, which reverse the bearing; or the bearing position sensor",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.play = p[param::actuator_backlash::play];
}
