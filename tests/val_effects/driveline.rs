//! Driveline: a coasting disc with the clutch open, J_c ω̇_c = −T_L.

use crate::bench::{Bench, Law, omega_c};
use kisspoint::effects::param::{driveline_compliance as shafts, road_load as road, vehicle_mass as mass};

const J: f64 = 0.5;
const START: f64 = 100.0;

fn coasting(start: f64, t_load: f64) -> Bench {
    let mut bench = Bench::held(0.0, start, 25.0, 0.0);
    bench.vehicle.driveline.J_c = J;
    bench.rest.t_load = t_load;
    bench.step = 1e-4;
    bench
}

const DISC: f64 = 0.2 * J;
const BEYOND: f64 = 0.8 * J;
const LOAD: f64 = 50.0;
const COMPLIANCE: f64 = 1e-3;

/// Disc speed from the momentum of both inertias after `t` s and the speed `twisting` of the shafts, rad/s.
fn disc(t: f64, twisting: f64) -> f64 {
    START + (BEYOND * twisting - LOAD * t) / J
}

/// Speed of the twist after `t` s under the load's step, with a stiffness (N·m/rad) and damping (N·m·s/rad): a damped oscillator.
fn twisting(stiffness: f64, damping: f64, t: f64) -> f64 {
    let reduced = DISC * BEYOND / J;
    let decay = 0.5 * damping / reduced;
    let turn = (stiffness / reduced - decay * decay).sqrt();
    LOAD / BEYOND / turn * (-decay * t).exp() * (turn * t).sin()
}

/// The same for a lash of ± `angle` rad without damping: free until the lash is taken up, then an oscillator that begins with a speed.
fn lashing(angle: f64, t: f64) -> f64 {
    let pull = LOAD / BEYOND;
    let taken_up = (2.0 * angle / pull).sqrt();
    let turn = (J / (COMPLIANCE * DISC * BEYOND)).sqrt();
    let phase = turn * (t - taken_up);
    pull / turn * phase.sin() + pull * taken_up * phase.cos()
}

pub fn laws() -> Vec<Law> {
    let law = Law::new;
    let twist = |damping, angle, share| {
        let sizes = [(shafts::compliance, COMPLIANCE), (shafts::disc_share, 0.2), (shafts::damping, damping)];
        [&sizes[..], &[(shafts::soft_angle, angle), (shafts::soft_share, share)]].concat()
    };
    let rolled = |t: f64| 0.5 * ((1.0_f64 / 0.5).sinh() * (-8.0 * t / (J * 0.5)).exp()).asinh();
    let grade = |g: f64| 400.0 * g.atan().sin() / J;
    vec![
        law("shafts", &twist(0.3, 0.0, 0.3), coasting(START, LOAD), 0.05, omega_c, disc(0.05, twisting(1.0 / COMPLIANCE, 0.3, 0.05))),
        law(
            "damped shafts",
            &twist(5.0, 0.0, 0.3),
            coasting(START, LOAD),
            0.03,
            omega_c,
            disc(0.03, twisting(1.0 / COMPLIANCE, 5.0, 0.03)),
        ),
        law(
            "soft shafts",
            &twist(0.3, 1.0, 0.25),
            coasting(START, LOAD),
            0.05,
            omega_c,
            disc(0.05, twisting(0.25 / COMPLIANCE, 0.3, 0.05)),
        ),
        law("lash", &twist(0.0, 0.004, 0.0), coasting(START, LOAD), 0.05, omega_c, disc(0.05, lashing(0.004, 0.05))).within(1e-6),
        law("lash the other way", &twist(0.0, 0.004, 0.0), coasting(-START, -LOAD), 0.05, omega_c, -disc(0.05, lashing(0.004, 0.05)))
            .within(1e-6),
        law("uphill", &[(road::grade, 0.05)], coasting(START, 0.0), 0.5, omega_c, START - grade(0.05) * 0.5),
        law("downhill", &[(road::grade, -0.05)], coasting(START, 0.0), 0.5, omega_c, START + grade(0.05) * 0.5),
        law("45 degrees", &[(road::grade, 1.0)], coasting(START, 0.0), 0.1, omega_c, START - 400.0 / 2.0_f64.sqrt() * 0.1 / J),
        law("uphill backwards", &[(road::grade, 0.05)], coasting(-START, 0.0), 0.5, omega_c, -START - grade(0.05) * 0.5),
        law("rolling", &[(road::rolling_torque, 8.0)], coasting(START, 0.0), 0.5, omega_c, START - 8.0 * 0.5 / J),
        law("rolling backwards", &[(road::rolling_torque, 8.0)], coasting(-START, 0.0), 0.5, omega_c, -START + 8.0 * 0.5 / J),
        law("rolling to a halt", &[(road::rolling_torque, 8.0)], coasting(1.0, 0.0), 0.03, omega_c, rolled(0.03)),
        law("mass", &[(mass::factor, 1.4)], coasting(START, 20.0), 0.5, omega_c, START - 20.0 * 0.5 / (1.4 * J)),
    ]
}
