//! Eq. (5) in full: two discs and a body in every combination of open and engaged, compared with the matrix exponential of the linear system, which is written independently
//! here, and with the heat balance.

use kisspoint::physics::thermal::{DualThermal, dual_rates, single_rates};
use kisspoint::vehicle::Vehicle;
use nalgebra::{Matrix4, Vector4};

const AIR: f64 = 40.0;
const START: [f64; 3] = [180.0, 60.0, 90.0];
const POWER: [f64; 2] = [3000.0, 1200.0];

fn dual() -> DualThermal {
    DualThermal { first: Vehicle::paper().thermal, C_2: 55.0, body_loss: 7.0 }
}

/// Temperatures (disc 1, disc 2, body) after `t` s with constant inputs: e^(A t) of the system, with the constant term as a fourth state.
fn exact(p: &DualThermal, engaged: [bool; 2], t: f64) -> [f64; 3] {
    let (g1, g2, g3) = (p.first.gamma_1, p.first.gamma_2, p.first.gamma_3);
    let [d1, d2] = engaged.map(f64::from);
    let (c1, c2, cb) = (p.first.C_1, p.C_2, p.first.C_b);
    let air = g2 * (2.0 - d1 - d2) + p.body_loss;
    #[rustfmt::skip]
    let a = Matrix4::new(
        -(g1 * d1 + g2 * (1.0 - d1)) / c1, 0.0, g1 * d1 / c1, (g2 * (1.0 - d1) * AIR + g3 * POWER[0]) / c1,
        0.0, -(g1 * d2 + g2 * (1.0 - d2)) / c2, g1 * d2 / c2, (g2 * (1.0 - d2) * AIR + g3 * POWER[1]) / c2,
        g1 * d1 / cb, g1 * d2 / cb, -(g1 * (d1 + d2) + air) / cb, (air * AIR + (1.0 - g3) * (POWER[0] + POWER[1])) / cb,
        0.0, 0.0, 0.0, 0.0,
    );
    let x = (a * t).exp() * Vector4::new(START[0], START[1], START[2], 1.0);
    [x[0], x[1], x[2]]
}

/// The same by Runge–Kutta steps with the model's rates.
fn integrated(p: &DualThermal, engaged: [bool; 2], t: f64) -> [f64; 3] {
    let rates = |x: [f64; 3]| {
        let (disc, body) = dual_rates(p, [x[0], x[1]], x[2], AIR, engaged, POWER);
        [disc[0], disc[1], body]
    };
    let along = |x: [f64; 3], k: [f64; 3], h: f64| -> [f64; 3] { std::array::from_fn(|i| x[i] + h * k[i]) };
    let (mut x, h) = (START, 1e-3);
    for _ in 0..(t / h).round() as usize {
        let k1 = rates(x);
        let k2 = rates(along(x, k1, 0.5 * h));
        let k3 = rates(along(x, k2, 0.5 * h));
        let k4 = rates(along(x, k3, h));
        x = std::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
    }
    x
}

#[test]
fn all_four_combinations_agree_with_the_matrix_exponential() {
    for engaged in [[true, true], [true, false], [false, true], [false, false]] {
        let (found, expected) = (integrated(&dual(), engaged, 10.0), exact(&dual(), engaged, 10.0));
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b).abs() < 1e-8, "{engaged:?}: {found:?} against {expected:?}");
        }
    }
}

#[test]
fn heat_is_conserved() {
    let p = dual();
    for engaged in [[true, true], [true, false], [false, false]] {
        let (disc, body) = dual_rates(&p, [START[0], START[1]], START[2], AIR, engaged, POWER);
        let stored = p.first.C_1 * disc[0] + p.C_2 * disc[1] + p.first.C_b * body;
        let open = engaged.map(|e| f64::from(!e));
        let lost = p.first.gamma_2 * (open[0] * (START[0] - AIR) + open[1] * (START[1] - AIR) + (open[0] + open[1]) * (START[2] - AIR))
            + p.body_loss * (START[2] - AIR);
        assert!((stored + lost - POWER[0] - POWER[1]).abs() < 1e-9, "{engaged:?}: {stored} W stored, {lost} W lost");
    }
}

#[test]
fn between_two_closed_clutches_the_body_cools_by_its_own_loss_alone() {
    let printed = DualThermal::equal(&Vehicle::paper().thermal);
    let (_, body) = dual_rates(&printed, [90.0, 90.0], 90.0, AIR, [true, true], [0.0, 0.0]);
    assert_eq!(body, 0.0);
    let (_, body) = dual_rates(&DualThermal { body_loss: 7.0, ..printed }, [90.0, 90.0], 90.0, AIR, [true, true], [0.0, 0.0]);
    assert!((body + 7.0 * 50.0 / printed.first.C_b).abs() < 1e-12);
}

#[test]
fn one_clutch_is_the_reduction() {
    let p = Vehicle::paper().thermal;
    for engaged in [true, false] {
        let (disc, body) = dual_rates(&DualThermal::equal(&p), [120.0, 70.0], 70.0, AIR, [engaged, false], [900.0, 0.0]);
        assert_eq!((disc[0], body), single_rates(&p, 120.0, 70.0, AIR, engaged, 900.0));
    }
}
