//! The engine's torque pulsates with the crank angle: T_e + (torque + share · |T_e|) cos(n α).
//!
//! A four-stroke engine fires twice a turn with four cylinders (n = 2), three times in two turns with three (n = 1.5). The pulsation by compression is independent of the load,
//! that by combustion is proportional to the torque. The amplitudes are those behind the crankshaft's own damper: at the flywheel's rim they are several times as large.
//!
//! Source: Heywood, *Internal Combustion Engine Fundamentals*, 1988, chapter 2; Crowther, Zhang, Liu and Jeyakumaran, *Analysis and simulation of clutch engagement judder and
//! stick–slip in automotive powertrain systems*, Proc. IMechE D 218, 2004 (pulsation during an engagement).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `torque` | amplitude at any load | N·m |
//! | `share` | amplitude over the mean torque | 1 |
//! | n, `order` | pulsations per turn of the crankshaft | 1 |
//! | α | crank angle since the start | rad |

use super::{Act, Effect, Parameters, Subsystem, param};

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Engine,
    amplitudes: &[param::combustion_pulsation::torque, param::combustion_pulsation::share],
    act: Act::Engine(apply),
    starts: &[&[(param::combustion_pulsation::torque, 10.0)], &[(param::combustion_pulsation::share, 0.5)]],
    shown_by: "the flywheel's speed sampled several times per firing",
};

fn apply(p: &Parameters, torque: f64, _: f64, angle: f64) -> f64 {
    let amplitude = p[param::combustion_pulsation::torque] + p[param::combustion_pulsation::share] * torque.abs();
    torque + amplitude * (p[param::combustion_pulsation::order] * angle).cos()
}
