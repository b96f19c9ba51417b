//! Torque is transmitted with the clutch open: (torque · tanh(ω_fc/ω_0) + viscosity · ω_fc) · s(F), ω_0 = 3 rad/s.
//!
//! s falls from 1 to `engaged_share` as the force F presses the faces together, with e^(−F/200 N). At zero slip the drag vanishes. The drag churns air and oil, which carry its
//! heat away, so it does not warm the clutch.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `torque` | drag at any slip | N·m |
//! | `viscosity` | drag per slip speed | N·m·s/rad |
//! | `engaged_share` | share that remains once the faces press | 1 |

use super::{Act, Effect, Parameters, Subsystem, param};

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Friction,
    amplitudes: &[param::clutch_drag::torque, param::clutch_drag::viscosity],
    act: Act::Drag(apply),
    starts: &[
        &[(param::clutch_drag::torque, 2.0)],
        &[(param::clutch_drag::viscosity, 0.02)],
        &[(param::clutch_drag::torque, 2.0), (param::clutch_drag::engaged_share, 0.2)],
    ],
    shown_by: "an open-clutch rev, where no torque should pass",
};

/// Slip speed ω_0 over which the drag changes its sign, rad/s.
const SIGN_SPEED: f64 = 3.0;

/// Force on the faces over which the drag decays to `engaged_share`, N.
const PRESSING_FORCE: f64 = 200.0;

fn apply(p: &Parameters, slip: f64, force: f64) -> f64 {
    let share = p[param::clutch_drag::engaged_share];
    let drag = p[param::clutch_drag::torque] * (slip / SIGN_SPEED).tanh() + p[param::clutch_drag::viscosity] * slip;
    drag * (share + (1.0 - share) * (-force / PRESSING_FORCE).exp())
}
