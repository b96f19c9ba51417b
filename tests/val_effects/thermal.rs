//! Heat: the temperatures of disc and body under a known friction power, or none.

use crate::bench::{Bench, Law, MU, t_fc, theta_b, theta_c, torque};
use kisspoint::effects::param::{clutch_cooling as cooling, heat_partition as partition, surface_temperature as surface};

const C_1: f64 = 70.0;
const C_B: f64 = 700.0;
/// Friction power at 6 mm and a slip of 50 rad/s, W.
fn power() -> f64 {
    50.0 * torque(6.0, MU)
}

/// A slipping clutch with a heat share of 0.3 into the disc and no other heat exchange.
fn heated(slip: f64) -> Bench {
    let mut bench = Bench::held(100.0, 100.0 - slip, 30.0, 6.0);
    (bench.vehicle.thermal.C_1, bench.vehicle.thermal.C_b) = (C_1, C_B);
    bench
}

/// A clutch without friction power, with a hot disc: locked at 6 mm, or open at 0 mm.
fn cooling_down(x: f64, gamma_1: f64, gamma_2: f64) -> Bench {
    let mut bench = Bench::held(100.0, 100.0, 20.0, x);
    let t = &mut bench.vehicle.thermal;
    (t.C_1, t.C_b, t.gamma_1, t.gamma_2) = (C_1, C_B, gamma_1, gamma_2);
    (bench.start.theta_c, bench.start.theta_b) = (180.0, 60.0);
    bench
}

/// A clutch whose friction decreases with the temperature of the faces, at a held disc temperature and slip.
fn fading(slip: f64) -> Bench {
    let mut bench = Bench::held(100.0, 100.0 - slip, 25.0, 6.0);
    let f = &mut bench.vehicle.friction;
    (f.m_0, f.m_1, f.alpha_2) = (MU + 25.0 * LOST, -LOST, 100.0);
    bench
}

/// Decrease of the friction coefficient with temperature, 1/K.
const LOST: f64 = 1e-3;

/// Torque in N·m of that clutch after `t` s: the temperature rise reduces the power linearly, and is driven by it linearly.
fn faded(slip: f64, per_watt: f64, tau: f64, t: f64) -> f64 {
    let power = slip * torque(6.0, MU);
    let loop_gain = per_watt * power * LOST / MU;
    let rise = per_watt * power / (1.0 + loop_gain) * (1.0 - (-(1.0 + loop_gain) / tau * t).exp());
    torque(6.0, MU - LOST * rise)
}

pub fn laws() -> Vec<Law> {
    let law = Law::new;
    let share = |change| [(partition::share_change, change)];
    let body = [(cooling::body_factor, 2.0)];
    let air = [(cooling::air_factor, 3.0)];
    // Two bodies: their temperature difference decays, and their total heat is constant.
    let difference = 120.0 * (-2.0 * 15.0 * (1.0 / C_1 + 1.0 / C_B) * 2.0_f64).exp();
    let mean = (C_1 * 180.0 + C_B * 60.0) / (C_1 + C_B);
    let faces = [(surface::resistance, 0.02), (surface::speed, 20.0), (surface::time_constant, 0.08)];
    vec![
        law("hotter faces", &faces, fading(50.0), 0.05, t_fc, faded(50.0, 0.02 / (1.0_f64 + 2.5).sqrt(), 0.08, 0.05)),
        law("hotter faces, disc faster", &faces, fading(-20.0), 0.2, t_fc, -faded(20.0, 0.02 / 2.0_f64.sqrt(), 0.08, 0.2)),
        law("hotter faces warm no disc", &faces, fading(50.0), 0.05, theta_c, 25.0).limit(),
        law("more heat into the disc", &share(0.15), heated(50.0), 1.0, theta_c, 30.0 + 0.45 * power() / C_1),
        law("less heat into the body", &share(0.15), heated(50.0), 1.0, theta_b, 30.0 + 0.55 * power() / C_B),
        law("less heat into the disc", &share(-0.1), heated(-50.0), 1.0, theta_c, 30.0 + 0.2 * power() / C_1),
        law("no heat into the disc", &share(-0.5), heated(50.0), 1.0, theta_c, 30.0),
        law("no heat into the body", &share(0.9), heated(50.0), 1.0, theta_b, 30.0),
        law("the disc cools into the body", &body, cooling_down(6.0, 15.0, 0.0), 2.0, theta_c, mean + difference * C_B / (C_1 + C_B)),
        law("the body is heated by the disc", &body, cooling_down(6.0, 15.0, 0.0), 2.0, theta_b, mean - difference * C_1 / (C_1 + C_B)),
        law("an open clutch keeps its heat", &body, cooling_down(0.0, 15.0, 0.0), 2.0, theta_c, 180.0).limit(),
        law(
            "the disc cools into the air",
            &air,
            cooling_down(0.0, 0.0, 5.0),
            2.0,
            theta_c,
            20.0 + 160.0 * (-3.0 * 5.0 * 2.0_f64 / C_1).exp(),
        ),
        // Both sides of the body lose heat to the air while the clutch is open, and one side while it is closed.
        law("the body cools into the air", &air, cooling_down(0.0, 0.0, 5.0), 2.0, theta_b, {
            20.0 + 40.0 * (-2.0 * 3.0 * 5.0 * 2.0_f64 / C_B).exp()
        }),
        law(
            "a closed clutch cools by half",
            &air,
            cooling_down(6.0, 0.0, 5.0),
            2.0,
            theta_b,
            20.0 + 40.0 * (-3.0 * 5.0 * 2.0_f64 / C_B).exp(),
        ),
    ]
}
