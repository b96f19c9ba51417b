//! Friction of the facings: paper eq. (3), (4).
//!
//! μ(ω, θ) = μ_d(θ) + (μ_0 − μ_d(θ) + α_1 ω) e^(−α_2 ω), never below 0.02, with μ_d(θ) = m_0 + m_1 θ + m_2 θ²;
//! R_μ(ω, θ) = 1/(R_2 − R_1) ∫ μ(ω ρ/ρ_m, θ) ρ dρ over R_1..R_2, ρ_m = (R_1 + R_2)/2.
//!
//! | symbol | meaning | unit | source |
//! |---|---|---|---|
//! | ω | slip speed, ≥ 0 | rad/s | eq. (4), in the units that α_1 and α_2 are printed in |
//! | θ | disc temperature | °C | eq. (4) |
//! | μ_0, α_1, α_2 | friction at zero slip, slip coefficients | 1, s/rad, s/rad | text after eq. (4) |
//! | m_0, m_1, m_2 | dynamic friction | 1, 1/K, 1/K² | text; the quadratic term is lost in the paper |
//! | R_1, R_2 | inner and outer radius of the facings | m | text after eq. (4) |
//!
//! The paper writes the speed in (3) as a tangential velocity, but prints α in rad/s units: ω ρ/ρ_m serves both.

/// Least friction coefficient: keeps the polynomial μ_d from turning friction into drive far outside its range.
pub const MU_MIN: f64 = 0.02;

/// Numbers of the friction function.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[allow(non_snake_case)]
pub struct Friction {
    /// Inner radius, m.
    pub R_1: f64,
    /// Outer radius, m.
    pub R_2: f64,
    /// Friction coefficient at zero slip.
    pub mu_0: f64,
    /// Linear slip coefficient, s/rad.
    pub alpha_1: f64,
    /// Exponential slip coefficient, s/rad.
    pub alpha_2: f64,
    /// Dynamic friction, constant term.
    pub m_0: f64,
    /// Dynamic friction, linear term, 1/K.
    pub m_1: f64,
    /// Dynamic friction, quadratic term, 1/K².
    pub m_2: f64,
}

/// Dynamic friction coefficient μ_d at `theta` in °C.
#[inline]
pub fn dynamic_friction(p: &Friction, theta: f64) -> f64 {
    p.m_0 + theta * (p.m_1 + theta * p.m_2)
}

/// Friction coefficient μ(ω, θ) of eq. (4); `omega` ≥ 0 in rad/s, `theta` in °C.
#[inline]
pub fn friction_coefficient(p: &Friction, omega: f64, theta: f64) -> f64 {
    coefficient_at(p, omega, dynamic_friction(p, theta))
}

#[inline]
fn coefficient_at(p: &Friction, omega: f64, mu_d: f64) -> f64 {
    (mu_d + (p.mu_0 - mu_d + p.alpha_1 * omega) * (-p.alpha_2 * omega).exp()).max(MU_MIN)
}

/// Abscissae and weights of the four-point Gauss–Legendre rule on [−1, 1]; the exponential varies by at most e^±0.2α_2ω
/// over the facing, which it integrates to better than 1e-9.
const GAUSS: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
    (-0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
];

/// Mean radius ρ_m, m.
#[inline]
pub fn mean_radius(p: &Friction) -> f64 {
    0.5 * (p.R_1 + p.R_2)
}

/// Equivalent radius R_μ of eq. (3), in m; `omega` ≥ 0 in rad/s, `theta` in °C.
#[inline(always)]
pub fn equivalent_radius(p: &Friction, omega: f64, theta: f64) -> f64 {
    let mean = mean_radius(p);
    let half = 0.5 * (p.R_2 - p.R_1);
    let mu_d = dynamic_friction(p, theta);
    if omega == 0.0 {
        // The integrand is linear in ρ: its mean is its value in the middle.
        return coefficient_at(p, 0.0, mu_d) * mean;
    }
    let (mut sum, scale) = (0.0, omega / mean);
    for (node, weight) in GAUSS {
        let rho = mean + half * node;
        sum += weight * coefficient_at(p, scale * rho, mu_d) * rho;
    }
    0.5 * sum
}
