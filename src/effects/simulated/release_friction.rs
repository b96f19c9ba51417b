//! Friction holds the release bearing: x = x_a − ½ width (z + s (w − z)), x_a where the actuator would have it.
//!
//! z and w go from −1 to 1 with the travel and back after a reversal, dz/dx_a = 2 (sign − z) sign/travel and dw/dx_a = 8 (sign − w) sign/travel: behind a position that
//! opens or closes the bearing stays back by half of the width, and it sticks by more at first, for w is ahead of z until both have arrived.
//!
//! Source: Dahl, *Solid friction damping of mechanical vibrations*, AIAA Journal 14, 1976; Armstrong-Hélouvry, Dupont and Canudas de Wit, *A survey of models, analysis tools
//! and compensation methods for the control of machines with friction*, Automatica 30, 1994 (break-away over a presliding travel).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `width` | difference of the bearing's positions, opening and closing | mm |
//! | `travel` | travel from one to the other | mm |
//! | s, `stiction` | how much more it sticks at first | 1 |

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
