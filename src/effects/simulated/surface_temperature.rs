//! The faces are hotter than the disc: friction is evaluated at θ_c + Δ, τ Δ̇ + Δ = R P/√(1 + ω/ω_0), P being the friction power.
//!
//! Heat enters through the contact spots. As long as a spot rests, its temperature rise is proportional to the heat; a spot that slides away before it has warmed through takes
//! up less the faster it is, as 1/√ω. Only friction depends on this temperature: contact point and cushion spring follow the disc's.
//!
//! Source: Blok, *Theoretical study of temperature rise at surfaces of actual contact under oiliness lubricating conditions*, Proc. IMechE General Discussion on
//! Lubrication 2, 1937; Jaeger, *Moving sources of heat and the temperature at sliding contacts*, J. Proc. Roy. Soc. New South Wales 76, 1942. The lag
//! stands for the layer below the spots.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | R, `resistance` | rise per friction power at low slip speed | K/W |
//! | ω_0, `speed` | slip speed from which on spots no longer warm through | rad/s |
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
