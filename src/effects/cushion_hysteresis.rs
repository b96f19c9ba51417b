//! Force differs between closing and opening: F (1 + width · z / 2), z from −1 (opening) to +1 (closing).
//!
//! Each branch is approached exponentially over half the travel `stroke`, as in Dahl's model: dz/dx = 2 (sign(dx) − z) sign(dx)/stroke.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `width` | relative difference of the two branches | 1 |
//! | `stroke` | travel from one branch to the other | mm |

use super::{Act, Constants, Effect, Parameters, Subsystem, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::ClutchForce,
    amplitudes: &[param::cushion_hysteresis::width],
    act: Act::Constants(apply),
    starts: &[
        &[(param::cushion_hysteresis::width, 0.1)],
        &[(param::cushion_hysteresis::width, 0.3), (param::cushion_hysteresis::stroke, 0.4)],
    ],
    shown_by: "a position chirp or a creep sweep, which reverse the bearing",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.hysteresis_width = p[param::cushion_hysteresis::width];
    c.hysteresis_stroke = p[param::cushion_hysteresis::stroke];
}
