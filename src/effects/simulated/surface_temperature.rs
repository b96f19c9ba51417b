//! The faces are hotter than the disc: friction sees θ_c + Δ, τ Δ̇ + Δ = R P/√(1 + ω/ω_0), P the friction power.
//!
//! Heat enters through the spots that carry. As long as a spot rests, its rise goes with the heat; one that slides away before it warms through
//! takes up the less, the faster it is: as 1/√ω. Only friction asks for it: contact point and cushion follow the disc.
//!
//! Source: Blok, *Theoretical study of temperature rise at surfaces of actual contact under oiliness lubricating conditions*, Proc. IMechE General Discussion on
//! Lubrication 2, 1937; Jaeger, *Moving sources of heat and the temperature at sliding contacts*, J. Proc. Roy. Soc. New South Wales 76, 1942. The lag
//! stands for the layer below the spots.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | R, `resistance` | rise per friction power of faces that hardly slip | K/W |
//! | ω_0, `speed` | slip speed from which on spots warm through no more | rad/s |
//! | τ, `time_constant` | time in which the rise builds up | s |

use super::{Act, Constants, Effect, Parameters, Subsystem, Surface, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Thermal,
    amplitudes: &[param::surface_temperature::resistance],
    act: Act::Constants(apply),
    starts: &[&[(param::surface_temperature::resistance, 0.01)]],
    shown_by: "friction in a hard launch beside that in a creep at the same disc temperature",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    c.surface = Surface {
        resistance: p[param::surface_temperature::resistance],
        speed: p[param::surface_temperature::speed],
        time_constant: p[param::surface_temperature::time_constant],
    };
}
