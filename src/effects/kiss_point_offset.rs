//! Shifted kiss point and closed point: x_cnt + offset, x_cls + closed_offset (wear, adjustment).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `offset` | shift of the contact point | mm |
//! | `closed_offset` | shift of the closed point | mm |

use super::{Act, Constants, Effect, Parameters, Subsystem, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::ClutchForce,
    amplitudes: &[param::kiss_point_offset::offset, param::kiss_point_offset::closed_offset],
    act: Act::Constants(apply),
    starts: &[
        &[(param::kiss_point_offset::offset, 0.2), (param::kiss_point_offset::closed_offset, 0.2)],
        &[(param::kiss_point_offset::offset, -0.2), (param::kiss_point_offset::closed_offset, -0.2)],
        &[(param::kiss_point_offset::offset, 0.2)],
        &[(param::kiss_point_offset::offset, -0.2)],
    ],
    shown_by: "slow engagement from open at a known temperature: a creep sweep",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.contact_shift.x_cnt += p[param::kiss_point_offset::offset];
    c.contact_shift.x_cls += p[param::kiss_point_offset::closed_offset];
}
