//! Friction of the release bearing: x = x_a − ½ width (z + s (w − z)), where x_a is the bearing position without friction.
//!
//! z and w move from −1 to 1 with the travel, and back after a reversal, dz/dx_a = 2 (sign − z) sign/travel and dw/dx_a = 8 (sign − w) sign/travel: in a steady motion in
//! either direction the bearing lags behind x_a by half of the width. Just after a reversal it sticks by more, because w is ahead of z until both have settled.
//!
//! Source: Dahl, *Solid friction damping of mechanical vibrations*, AIAA Journal 14, 1976; Armstrong-Hélouvry, Dupont and Canudas de Wit, *A survey of models, analysis tools
//! and compensation methods for the control of machines with friction*, Automatica 30, 1994 (break-away over a presliding travel).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `width` | difference between the bearing's positions when opening and when closing | mm |
//! | `travel` | travel from one to the other | mm |
//! | s, `stiction` | weight of the additional friction just after a reversal | 1 |

use super::{Act, Constants, Effect, Parameters, Release, Subsystem, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Actuator,
    amplitudes: &[param::release_friction::width],
    act: Act::Constants(apply),
    starts: &[
        &[(param::release_friction::width, 0.1)],
        &[(param::release_friction::width, 0.1), (param::release_friction::stiction, 0.8)],
    ],
    shown_by: "a slow position sweep to and fro with a sensor of the bearing",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.release = Release {
        width: p[param::release_friction::width],
        travel: p[param::release_friction::travel],
        stiction: p[param::release_friction::stiction],
    };
}
