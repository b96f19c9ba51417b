//! Geometric judder: the torque pulsates with the angle of a shaft, T (1 + engine · cos(n α_f) + input · cos(m α_c)).
//!
//! The pulsation of a wobbling crankshaft or pressure plate is locked to the engine, that of a bent input shaft or of a disc with run-out to the input shaft. Unlike `judder`,
//! which follows the slip angle, the former keeps its frequency while the slip fades, and the latter begins when the car starts to move.
//!
//! Source: Maucher, *Clutch chatter*, 4th LuK Symposium, 1990; Centea, Rahnejat and Menday, *Non-linear multi-body dynamic analysis for the study of clutch torsional
//! vibrations (judder)*, Applied Mathematical Modelling 25, 2001.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `engine`, `input` | relative amplitude locked to engine and input shaft | 1 |
//! | n, m, `engine_order`, `input_order` | pulsations per turn of the respective shaft | 1 |
//! | α_f, α_c | angles of engine and input shaft since the start | rad |

use super::{Act, Effect, Parameters, Subsystem, param};

/// See the module.
pub const EFFECT: Effect = Effect {
    subsystem: Subsystem::Friction,
    amplitudes: &[param::shaft_judder::engine, param::shaft_judder::input],
    act: Act::Shafts(apply),
    starts: &[&[(param::shaft_judder::engine, 0.1)], &[(param::shaft_judder::input, 0.1)]],
    shown_by: "slip at constant position at several engine speeds",
};

fn apply(p: &Parameters, [engine, input]: [f64; 2]) -> f64 {
    let part = |size: f64, order: f64, angle: f64| size * (order * angle).cos();
    1.0 + part(p[param::shaft_judder::engine], p[param::shaft_judder::engine_order], engine)
        + part(p[param::shaft_judder::input], p[param::shaft_judder::input_order], input)
}
