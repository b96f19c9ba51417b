//! From position, slip and temperature to torque capacity.
//!
//! The friction function is averaged over the facing in closed form, not by a quadrature rule. With u = ρ/ρ_m and
//! k = α_2 ω the average of (μ_d + (μ_0 − μ_d + α_1 ω u) e^(−k u)) u needs only
//!
//! ∫ u e^(−k u) du = −e^(−k u) (u/k + 1/k²), ∫ u² e^(−k u) du = −e^(−k u) (u²/k + 2u/k² + 2/k³)
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | ω | slip speed, its magnitude | rad/s |
//! | ρ, ρ_m | radius, mean radius | m |
//! | ξ | normalised position | - |
//!
//! The floor of 0.02 on the friction coefficient is never reached between −40 °C and 350 °C.

use crate::vehicle::Vehicle;

/// Friction times radius, averaged over the facing, m.
pub fn friction_radius_m(v: &Vehicle, slip_rad_s: f64, theta_c: f64) -> f64 {
    let [r1, r2] = v.radii_m;
    let mean = 0.5 * (r1 + r2);
    let (a, b) = (r1 / mean, r2 / mean);
    let dynamic = mu_dynamic(v, theta_c);
    let omega = slip_rad_s.abs();
    let flat = 0.5 * (b * b - a * a);
    let (first, second) = decayed_moments(v.alpha_2 * omega, a, b);
    let sum = dynamic * flat + (v.mu_0 - dynamic) * first + v.alpha_1 * omega * second;
    // ρ dρ = ρ_m² u du, over the facing's width.
    v.mu_factor * sum * mean * mean / (r2 - r1)
}

/// Dynamic friction coefficient at a disc temperature in °C.
pub fn mu_dynamic(v: &Vehicle, theta_c: f64) -> f64 {
    v.mu_d[0] + theta_c * (v.mu_d[1] + theta_c * v.mu_d[2])
}

/// Integrals of u e^(−k u) and u² e^(−k u) over [a, b].
fn decayed_moments(k: f64, a: f64, b: f64) -> (f64, f64) {
    if k < 1e-3 {
        // The closed form would cancel; two terms of the series are exact to 1e-7 here.
        let m = |n: i32| (b.powi(n + 1) - a.powi(n + 1)) / f64::from(n + 1);
        return (m(1) - k * m(2), m(2) - k * m(3));
    }
    let (ea, eb) = ((-k * a).exp(), (-k * b).exp());
    let (r, rr) = (1.0 / k, 1.0 / (k * k));
    let first = ea * (a * r + rr) - eb * (b * r + rr);
    let tail = |u: f64| u * u * r + 2.0 * u * rr + 2.0 * rr * r;
    (first, ea * tail(a) - eb * tail(b))
}

/// Cushion force at a normalised position, N.
pub fn cushion_force_n(v: &Vehicle, xi: f64) -> f64 {
    let xi = xi.clamp(0.0, 1.0);
    if xi <= contact(v) {
        return 0.0;
    }
    xi * (v.beta[0] + xi * (v.beta[1] + xi * v.beta[2]))
}

/// Normalised position above which the cushion carries force.
pub fn contact(v: &Vehicle) -> f64 {
    let [b1, b2, b3] = v.beta;
    (-b2 + (b2 * b2 - 4.0 * b3 * b1).sqrt()) / (2.0 * b3)
}

/// Position that transmits a torque at a temperature with the friction of a fast slip, mm.
///
/// This is the controller's feedforward; it knows the vehicle file alone.
pub fn position_for_torque_mm(v: &Vehicle, torque_nm: f64, theta_c: f64) -> f64 {
    let radius = friction_radius_m(v, 80.0, theta_c);
    let wanted = (torque_nm / (2.0 * radius)).max(0.0);
    let (mut low, mut high) = (contact(v), 1.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if cushion_force_n(v, middle) < wanted {
            low = middle;
        } else {
            high = middle;
        }
    }
    v.x_cnt + 0.5 * (low + high) * (v.x_cls - v.x_cnt)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A fine midpoint sum over the facing is the oracle of the closed form.
    #[test]
    fn closed_form_is_the_average_over_the_facing() {
        let v = Vehicle::reference();
        for slip in [0.0, 1e-4, 0.004, 0.3, 7.0, 60.0, 300.0] {
            for theta in [20.0, 120.0] {
                let [r1, r2] = v.radii_m;
                let mean = 0.5 * (r1 + r2);
                let n = 20_000;
                let width = (r2 - r1) / f64::from(n);
                let mut sum = 0.0;
                for i in 0..n {
                    let rho = r1 + (f64::from(i) + 0.5) * width;
                    let w = slip * rho / mean;
                    let d = mu_dynamic(&v, theta);
                    sum += (d + (v.mu_0 - d + v.alpha_1 * w) * (-v.alpha_2 * w).exp()) * rho * width;
                }
                let got = friction_radius_m(&v, slip, theta);
                assert!((got - sum / (r2 - r1)).abs() < 1e-9, "{slip} {theta}: {got}");
            }
        }
    }

    #[test]
    fn position_inverts_the_map() {
        let v = Vehicle::reference();
        for torque in [1.0, 20.0, 90.0] {
            let x = position_for_torque_mm(&v, torque, 40.0);
            let f = cushion_force_n(&v, (x - v.x_cnt) / (v.x_cls - v.x_cnt));
            assert!((2.0 * friction_radius_m(&v, 80.0, 40.0) * f - torque).abs() < 1e-6);
        }
    }
}
