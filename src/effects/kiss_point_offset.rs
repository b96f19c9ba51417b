//! Contact begins elsewhere: x_cnt + offset, x_cls + closed_share · offset (wear, adjustment).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `offset` | shift of the contact point | mm |
//! | `closed_share` | share of it that the closed point takes | 1 |

use super::{Act, Constants, Effect, Parameters, Subsystem, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::ClutchForce,
    amplitudes: &[param::kiss_point_offset::offset],
    act: Act::Constants(apply),
    starts: &[
        &[(param::kiss_point_offset::offset, 0.1)],
        &[(param::kiss_point_offset::offset, -0.1)],
        &[(param::kiss_point_offset::offset, 0.2), (param::kiss_point_offset::closed_share, 1.0)],
        &[(param::kiss_point_offset::offset, -0.2), (param::kiss_point_offset::closed_share, 1.0)],
    ],
    shown_by: "slow engagement from open at a known temperature: a creep sweep",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    let offset = p[param::kiss_point_offset::offset];
    c.contact_shift.x_cnt += offset;
    c.contact_shift.x_cls += p[param::kiss_point_offset::closed_share] * offset;
}
