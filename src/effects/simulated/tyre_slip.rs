//! Slip of the tyres: J_c splits into the inertia that turns before the road and the car, with a tyre between them that builds up its force over a rolled distance.
//!
//! T = u/(s σ) / (1 + |u|/(s σ G)), u̇ = ω_c − ω_v − ½ (|ω_c| + |ω_v|) u/σ: at a steady torque the slip speed of the tyre is s T/(1 − |T|/G) times the speed at which it rolls,
//! and a standing tyre is a spring. u is the deflection as an angle at the clutch. Where the drive shafts are elastic as well, they are in series with the tyre, and the share
//! of the inertia before the road is `driveline_compliance.disc_share`.
//!
//! Range: straight ahead, up to spinning wheels. Source: Pacejka, *Tire and Vehicle Dynamics*, 3rd ed. 2012, chapters 1 and 7 (force over slip, relaxation
//! length); Bernard and Clover, *Tire modeling for low-speed and high-speed calculations*, SAE 950311, 1995 (the same from standstill on).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | s, `slip_per_torque` | slip per torque of a tyre that grips; 0 is none | 1/(N·m) |
//! | σ, `relaxation` | angle of the disc over which the tyre builds up its force | rad |
//! | G, `grip` | greatest torque that the road takes | N·m |
//! | `wheel_share` | share of J_c before the road, where the shafts are rigid | 1 |
//! | `damping` | damping of the tyre, where the shafts are rigid | N·m·s/rad |

use super::{Act, Constants, Effect, Parameters, Subsystem, Tyre, param};
use crate::vehicle::Vehicle;

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Driveline,
    amplitudes: &[param::tyre_slip::slip_per_torque],
    act: Act::Constants(apply),
    starts: &[
        &[(param::tyre_slip::slip_per_torque, 3e-4)],
        &[(param::tyre_slip::slip_per_torque, 3e-4), (param::tyre_slip::grip, 60.0), (param::tyre_slip::wheel_share, 0.3)],
    ],
    shown_by: "a hard launch, with the speed of a wheel that is not driven",
};

fn apply(p: &Parameters, _: &Vehicle, c: &mut Constants) {
    let relaxation = p[param::tyre_slip::relaxation];
    c.tyre = Tyre { softness: p[param::tyre_slip::slip_per_torque] * relaxation, relaxation, grip: p[param::tyre_slip::grip] };
    if c.compliance <= 0.0 {
        c.disc_share = p[param::tyre_slip::wheel_share];
        c.shaft_damping = p[param::tyre_slip::damping];
    }
}
