//! Property: for every sound vehicle, the inverse of the torque map is monotone and inverts the map.

use kisspoint::physics::{cushion, map};
use kisspoint::vehicle::Vehicle;

/// A pseudo-random number in 0..1 that depends on `seed` alone (splitmix64).
fn share(seed: u64) -> f64 {
    let mut z = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// A car with a different spring, friction and kiss point: F = s ξ (ξ − ξ_0)(ξ + r) has its largest root at ξ_0 and increases above it.
fn vehicle(seed: u64) -> Vehicle {
    let draw = |k: u64, low: f64, high: f64| low + (high - low) * share(16 * seed + k);
    let (xi_0, r, s) = (draw(0, 0.0, 0.6), draw(1, 0.0, 2.0), draw(2, 500.0, 12_000.0));
    let mut v = Vehicle::paper();
    (v.cushion_spring.beta_3, v.cushion_spring.beta_2, v.cushion_spring.beta_1) = (s, s * (r - xi_0), -s * xi_0 * r);
    v.actuator.x_cnt_0 = draw(3, 0.0, 6.0);
    v.actuator.x_cls_0 = v.actuator.x_cnt_0 + draw(4, 1.0, 8.0);
    (v.actuator.x_cnt_1, v.actuator.x_cls_1) = (draw(5, -2e-3, 2e-3), draw(6, -1e-3, 1e-3));
    (v.friction.mu_0, v.friction.alpha_1, v.friction.alpha_2) = (draw(7, 0.1, 0.4), draw(8, 0.0, 0.05), draw(9, 0.05, 1.0));
    v.friction.m_0 = draw(10, 0.1, 0.4);
    v.check().expect("drawn vehicles are sound");
    v
}

#[test]
fn the_inverse_is_monotone_and_inverts_for_every_sound_vehicle() {
    for seed in 0..200 {
        let v = vehicle(seed);
        let xi_0 = cushion::contact_point(&v.cushion_spring);
        for (theta, slip) in [(-20.0, 0.0), (25.0, 3.0), (120.0, 40.0), (220.0, 150.0)] {
            let forward = |x: f64| {
                let xi = map::normalised_position(map::contact(&v.actuator, theta), x);
                map::torque_capacity(&v.friction, cushion::force(&v.cushion_spring, xi_0, xi), slip, theta)
            };
            let most = forward(map::contact(&v.actuator, theta).x_cls);
            let mut last = f64::NEG_INFINITY;
            for k in 0..=64 {
                let torque = most * f64::from(k) / 64.0;
                let x = map::inverse(&v.friction, &v.actuator, &v.cushion_spring, torque, slip, theta);
                assert!(x > last, "seed {seed}: {torque} N·m at {slip} rad/s, {theta} °C gives {x} mm after {last} mm");
                assert!((forward(x) - torque).abs() < 1e-9 * most.max(1.0), "seed {seed}: {} for {torque} N·m", forward(x));
                last = x;
            }
        }
    }
}
