//! Torque is transmitted with the clutch open: torque · tanh(ω_fc/ω_0) + viscosity · ω_fc, ω_0 = 2 rad/s.
//!
//! It acts in every phase; at zero slip it vanishes.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `torque` | drag at any slip | N·m |
//! | `viscosity` | drag per slip speed | N·m·s/rad |

use super::{Act, Effect, Parameters, Subsystem, param};

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Friction,
    amplitudes: &[param::clutch_drag::torque, param::clutch_drag::viscosity],
    act: Act::Drag(apply),
    starts: &[&[(param::clutch_drag::torque, 2.0)], &[(param::clutch_drag::viscosity, 0.02)]],
    shown_by: "an open-clutch rev, where no torque should pass",
};

/// Slip over which the drag takes its sign, rad/s.
const SIGN_SPEED: f64 = 2.0;

fn apply(p: &Parameters, slip: f64) -> f64 {
    p[param::clutch_drag::torque] * (slip / SIGN_SPEED).tanh() + p[param::clutch_drag::viscosity] * slip
}
