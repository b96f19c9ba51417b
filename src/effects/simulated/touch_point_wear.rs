//! Facings wear, and the touch point drifts with the work that they have done: x_cnt + r (W_0 + W), x_cls + c r (W_0 + W).
//!
//! The worn depth is proportional to the friction work per area (Archard's law). W_0 carries the work of earlier runs over to this one: a run continues from an earlier one if
//! its W_0 is the W_0 + E_d of that run.
//!
//! Source: Archard, *Contact and rubbing of flat surfaces*, J. Applied Physics 24, 1953.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | r, `rate` | drift of the touch point per friction work | mm/J |
//! | W_0, `work_before` | friction work before this run | J |
//! | c, `closed_share` | share of the drift that applies to the closed point | 1 |
//! | W | friction work of this run, E_d | J |

use super::{Act, Contact, Effect, Parameters, Subsystem, param};

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::ClutchForce,
    amplitudes: &[param::touch_point_wear::rate],
    act: Act::Worn(apply),
    starts: &[&[(param::touch_point_wear::rate, 1e-8), (param::touch_point_wear::work_before, 2e7)]],
    shown_by: "the touch point over many launches",
};

fn apply(p: &Parameters, work: f64, contact: &mut Contact) {
    let drift = p[param::touch_point_wear::rate] * (p[param::touch_point_wear::work_before] + work);
    contact.x_cnt += drift;
    contact.x_cls += p[param::touch_point_wear::closed_share] * drift;
}
