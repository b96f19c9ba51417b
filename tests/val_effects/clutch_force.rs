//! Clutch force: the torque of a slipping clutch at a held position, T = 2 μ R F(ξ).

use crate::bench::{Bench, F_1, Law, MU, RADIUS, X_CLS, X_CNT, force, t_fc, torque};
use kisspoint::effects::param::{
    cushion_hysteresis as hysteresis, cushion_stiffness_thermal as stiffness, kiss_point_offset as offset, kiss_point_thermal as thermal,
    touch_point_wear as wear,
};

fn slipping(theta: f64, x: f64) -> Bench {
    Bench::held(100.0, 50.0, theta, x)
}

/// Torque at 6 mm in N·m, with the contact point and the closed point shifted by `cnt` and `cls` mm.
fn moved(cnt: f64, cls: f64) -> f64 {
    2.0 * MU * RADIUS * force(6.0, X_CNT + cnt, X_CLS + cls)
}

/// Torque in N·m at 6 mm after `t` s of slip at 50 rad/s, with a wear of `rate` mm/J that shifts both points: the remaining travel w beyond contact obeys ẇ = −rate · P(w),
/// with a power P proportional to w³.
fn wearing(rate: f64, t: f64) -> f64 {
    let cube = 2.0 * MU * RADIUS * F_1 / (X_CLS - X_CNT).powi(3);
    let left = 2.0 / (1.0 + 2.0 * rate * cube * 50.0 * 4.0 * t).sqrt();
    cube * left.powi(3)
}

pub fn laws() -> Vec<Law> {
    let law = Law::new;
    let shift = [(thermal::slope, 0.004), (thermal::curvature, 1e-5)];
    let worn = |share| [(wear::rate, 1e-8), (wear::work_before, 3e7), (wear::closed_share, share)];
    let memory = [(hysteresis::width, 0.4), (hysteresis::stroke, 0.8)];
    // 1 mm up from the middle, then 0.3 mm down.
    let up = 1.0 - (-2.0_f64 / 0.8).exp();
    let back = -1.0 + (up + 1.0) * (-0.6_f64 / 0.8).exp();
    let reversed = || slipping(25.0, 5.0).moved(0.01, 6.0).moved(0.02, 5.7);
    vec![
        law("contact later", &[(offset::offset, 0.3)], slipping(25.0, 6.0), 0.01, t_fc, moved(0.3, 0.0)),
        law("contact earlier", &[(offset::offset, -0.3)], slipping(25.0, 6.0), 0.01, t_fc, moved(-0.3, 0.0)),
        law("closed point", &[(offset::closed_offset, -0.4)], slipping(25.0, 6.0), 0.01, t_fc, moved(0.0, -0.4)),
        law("both points", &[(offset::offset, 0.3), (offset::closed_offset, 0.3)], slipping(25.0, 6.0), 0.01, t_fc, torque(5.7, MU)),
        law("no contact yet", &[(offset::offset, 0.3)], slipping(25.0, 4.2), 0.01, t_fc, 0.0).absolute(1e-9 * F_1 * RADIUS),
        law("hot contact", &shift, slipping(105.0, 6.0), 0.01, t_fc, moved(0.004 * 80.0 + 1e-5 * 6400.0, 0.0)),
        law("cold contact", &shift, slipping(5.0, 6.0), 0.01, t_fc, moved(-0.004 * 20.0 + 1e-5 * 400.0, 0.0)),
        law("contact at 25 °C", &shift, slipping(25.0, 6.0), 0.01, t_fc, torque(6.0, MU)).limit(),
        law("closed point in part", &[shift[0], (thermal::closed_share, 0.5)], slipping(105.0, 6.0), 0.01, t_fc, moved(0.32, 0.16)),
        law("hot spring", &[(stiffness::slope, 0.002), (stiffness::curvature, 1e-5)], slipping(105.0, 6.0), 0.01, t_fc, {
            (1.0 + 0.002 * 80.0 + 1e-5 * 6400.0) * torque(6.0, MU)
        }),
        law("cold spring", &[(stiffness::slope, 0.002)], slipping(5.0, 6.0), 0.01, t_fc, (1.0 - 0.04) * torque(6.0, MU)),
        law("a spring that does not pull", &[(stiffness::slope, -0.02)], slipping(105.0, 6.0), 0.01, t_fc, 0.0).absolute(1e-9),
        law("closing", &memory, slipping(25.0, 5.0).moved(0.01, 6.0), 0.02, t_fc, (1.0 + 0.2 * up) * torque(6.0, MU)),
        law("opening again", &memory, reversed(), 0.03, t_fc, (1.0 + 0.2 * back) * torque(5.7, MU)),
        law("opening", &memory, slipping(25.0, 7.0).moved(0.01, 6.0), 0.02, t_fc, (1.0 - 0.2 * up) * torque(6.0, MU)),
        law(
            "closing far",
            &[memory[0], (hysteresis::stroke, 0.02)],
            slipping(25.0, 5.0).moved(0.01, 6.0),
            0.02,
            t_fc,
            1.2 * torque(6.0, MU),
        ),
        law("worn facings", &worn(0.5), slipping(25.0, 6.0), 0.0, t_fc, moved(0.3, 0.15)),
        law("facings that grew", &[(wear::rate, -1e-8), (wear::work_before, 3e7)], slipping(25.0, 6.0), 0.0, t_fc, torque(6.3, MU)),
        law("facings that wear", &[(wear::rate, 1e-6)], slipping(25.0, 6.0), 0.8, t_fc, wearing(1e-6, 0.8)),
        law("neither closing nor opening", &memory, slipping(25.0, 6.0), 0.02, t_fc, torque(6.0, MU)).limit(),
    ]
}
