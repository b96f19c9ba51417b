//! Friction: the torque of a slipping clutch at 6 mm, at a held speed and temperature.

use crate::bench::{Bench, Law, MU, X_CLS, X_CNT, force, t_fc, theta_c, torque};
use kisspoint::effects::param::{
    clutch_drag as drag, friction_fade as fade, friction_level as level, friction_pressure as pressure, friction_slip_gradient as gradient,
    judder, shaft_judder as shaft,
};
use kisspoint::plant::Plant;

fn slipping(slip: f64, theta: f64) -> Bench {
    Bench::held(100.0, 100.0 - slip, theta, 6.0)
}

fn open(slip: f64) -> Bench {
    Bench::held(100.0, 100.0 - slip, 25.0, 0.0)
}

/// Share of the fade at `theta`: a logistic step with an e-fold width of width/8, averaged evenly over the width by Simpson's rule.
fn faded(theta: f64, onset: f64, width: f64) -> f64 {
    let n = 2000;
    let at = |k: usize| {
        let shift = width * (k as f64 / n as f64 - 0.5);
        1.0 / (1.0 + (-8.0 * (theta - onset + shift) / width).exp())
    };
    let inner: f64 = (1..n).map(|k| at(k) * if k % 2 == 1 { 4.0 } else { 2.0 }).sum();
    (at(0) + inner + at(n)) / (3.0 * n as f64)
}

fn dissipated(plant: &Plant) -> f64 {
    plant.outputs().e_d
}

pub fn laws() -> Vec<Law> {
    let law = Law::new;
    let normal = torque(6.0, MU);
    let fading = [(fade::depth, 0.4), (fade::onset, 130.0), (fade::width, 60.0)];
    let pressing = |exponent, reference| [(pressure::exponent, exponent), (pressure::reference_force, reference)];
    let slope = [(gradient::slope, 0.001), (gradient::reach, 40.0)];
    let stribeck = |n| vec![(gradient::stribeck, 0.1), (gradient::speed, 15.0), (gradient::exponent, n)];
    // The angle of 50 rad/s over 0.13 s.
    let turned: f64 = 6.5;
    let pressed = 3.0 * 1.0_f64.tanh() * (0.3 + 0.7 * (-force(6.0, X_CNT, X_CLS) / 200.0).exp());
    let churned = 3.0 * (20.0_f64 / 3.0).tanh() + 0.02 * 20.0;
    let churning = [(drag::torque, 3.0), (drag::viscosity, 0.02)];
    let warm = |mut bench: Bench| {
        bench.vehicle.thermal.C_1 = 70.0;
        bench
    };
    vec![
        law("level", &[(level::factor, 0.7)], slipping(50.0, 25.0), 0.01, t_fc, 0.7 * normal),
        law("level, disc faster", &[(level::factor, 1.4)], slipping(-50.0, 25.0), 0.01, t_fc, -1.4 * normal),
        law("fade at its onset", &fading, slipping(50.0, 130.0), 0.01, t_fc, 0.8 * normal),
        law("fade below its onset", &fading, slipping(50.0, 120.0), 0.01, t_fc, (1.0 - 0.4 * faded(120.0, 130.0, 60.0)) * normal),
        law("fade at its upper corner", &fading, slipping(50.0, 160.0), 0.01, t_fc, (1.0 - 0.4 * faded(160.0, 130.0, 60.0)) * normal),
        law("hot fade", &fading, slipping(50.0, 500.0), 0.01, t_fc, 0.6 * normal),
        law("cold fade", &fading, slipping(50.0, -70.0), 0.01, t_fc, normal).limit(),
        law("slope", &slope, slipping(20.0, 25.0), 0.01, t_fc, torque(6.0, MU + 0.02)),
        law("slope, disc faster", &slope, slipping(-20.0, 25.0), 0.01, t_fc, -torque(6.0, MU + 0.02)),
        law("slope beyond its reach", &slope, slipping(70.0, 25.0), 0.01, t_fc, torque(6.0, MU + 0.04)),
        law("slope down", &[(gradient::slope, -0.001)], slipping(20.0, 25.0), 0.01, t_fc, torque(6.0, MU - 0.02)),
        law("slope down to no friction", &[(gradient::slope, -0.02)], slipping(50.0, 25.0), 0.01, t_fc, 0.0).absolute(1e-9),
        law("Stribeck at its speed", &stribeck(2.0), slipping(15.0, 25.0), 0.01, t_fc, torque(6.0, MU + 0.1 * (-1.0_f64).exp())),
        law("rounded Stribeck", &stribeck(2.0), slipping(30.0, 25.0), 0.01, t_fc, torque(6.0, MU + 0.1 * (-4.0_f64).exp())),
        law("exponential Stribeck", &stribeck(1.0), slipping(30.0, 25.0), 0.01, t_fc, torque(6.0, MU + 0.1 * (-2.0_f64).exp())),
        law(
            "proportional share",
            &[slope[0], (gradient::proportional_share, 0.4), (level::factor, 2.0)],
            slipping(20.0, 25.0),
            0.01,
            t_fc,
            torque(6.0, 2.0 * MU + 0.02 * (1.0 - 0.4 + 0.4 * 2.0)),
        ),
        law("proportional at usual friction", &[slope[0], (gradient::proportional_share, 1.0)], slipping(20.0, 25.0), 0.01, t_fc, {
            torque(6.0, MU + 0.02)
        }),
        law("drag takes its sign", &[(drag::torque, 3.0)], open(3.0), 0.01, t_fc, 3.0 * 1.0_f64.tanh()),
        law("drag, disc faster", &[(drag::torque, 3.0)], open(-3.0), 0.01, t_fc, -3.0 * 1.0_f64.tanh()),
        law("viscous drag", &[(drag::viscosity, 0.02)], open(40.0), 0.01, t_fc, 0.8),
        law(
            "drag between pressed faces",
            &[(drag::torque, 3.0), (drag::engaged_share, 0.3)],
            slipping(3.0, 25.0),
            0.01,
            t_fc,
            normal + pressed,
        ),
        law("all drag between pressed faces", &[(drag::torque, 3.0)], slipping(3.0, 25.0), 0.01, t_fc, normal + 3.0 * 1.0_f64.tanh()),
        law("drag dissipates", &churning, open(20.0), 0.5, dissipated, churned * 20.0 * 0.5),
        law("drag and friction dissipate", &churning, slipping(20.0, 25.0), 0.5, dissipated, (churned + normal) * 20.0 * 0.5),
        law("drag warms no disc", &churning, warm(open(20.0)), 0.5, theta_c, 25.0).limit(),
        law("friction alone warms the disc", &churning, warm(slipping(20.0, 25.0)), 0.5, theta_c, {
            25.0 + 0.3 * normal * 20.0 * 0.5 / 70.0
        })
        .limit(),
        law("judder at the start", &[(judder::cosine, 0.2)], slipping(50.0, 25.0), 0.0, t_fc, 1.2 * normal),
        law("judder's cosine", &[(judder::cosine, 0.2)], slipping(50.0, 25.0), 0.13, t_fc, (1.0 + 0.2 * turned.cos()) * normal),
        law("judder's sine", &[(judder::sine, 0.2), (judder::order, 1.3)], slipping(50.0, 25.0), 0.13, t_fc, {
            (1.0 + 0.2 * (1.3 * turned).sin()) * normal
        }),
        law("judder, disc faster", &[(judder::sine, 0.2)], slipping(-50.0, 25.0), 0.13, t_fc, -(1.0 - 0.2 * turned.sin()) * normal),
        law("friction under a light force", &pressing(-0.2, 3000.0), slipping(50.0, 25.0), 0.01, t_fc, {
            normal * (force(6.0, X_CNT, X_CLS).hypot(100.0) / 3000.0_f64.hypot(100.0)).powf(-0.2)
        }),
        law("friction under a great force", &pressing(0.3, 200.0), slipping(-50.0, 25.0), 0.01, t_fc, {
            -normal * (force(6.0, X_CNT, X_CLS).hypot(100.0) / 200.0_f64.hypot(100.0)).powf(0.3)
        }),
        law("friction at the reference force", &pressing(0.3, force(6.0, X_CNT, X_CLS)), slipping(50.0, 25.0), 0.01, t_fc, normal).limit(),
        // 100 rad/s (engine) and 50 rad/s (input shaft) for 0.13 s.
        law("judder of the engine", &[(shaft::engine, 0.2)], slipping(50.0, 25.0), 0.13, t_fc, (1.0 + 0.2 * 13.0_f64.cos()) * normal),
        law("judder of the engine, twice a turn", &[(shaft::engine, 0.2), (shaft::engine_order, 2.0)], slipping(50.0, 25.0), 0.13, t_fc, {
            (1.0 + 0.2 * 26.0_f64.cos()) * normal
        }),
        law("judder of the input shaft", &[(shaft::input, -0.2), (shaft::input_order, 3.0)], slipping(50.0, 25.0), 0.13, t_fc, {
            (1.0 - 0.2 * 19.5_f64.cos()) * normal
        }),
        law("judder that fades to half", &[(judder::cosine, 0.2), (judder::fading, 1.0 / 2500.0)], slipping(50.0, 25.0), 0.13, t_fc, {
            (1.0 + 0.1 * turned.cos()) * normal
        }),
    ]
}
