//! Changed heat exchange between disc, body and air: factors on γ_1 and γ_2.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `body_factor` | factor on γ_1 | 1 |
//! | `air_factor` | factor on γ_2 | 1 |

use super::{Act, Constants, Effect, Parameters, Subsystem, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Thermal,
    amplitudes: &[param::clutch_cooling::body_factor, param::clutch_cooling::air_factor],
    act: Act::Constants(apply),
    starts: &[
        &[(param::clutch_cooling::body_factor, 2.0)],
        &[(param::clutch_cooling::body_factor, 0.5)],
        &[(param::clutch_cooling::air_factor, 3.0)],
    ],
    shown_by: "the disc thermocouple after a hard launch",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.thermal.gamma_1 *= p[param::clutch_cooling::body_factor];
    c.thermal.gamma_2 *= p[param::clutch_cooling::air_factor];
}
