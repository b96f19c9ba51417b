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
//! | m_0, m_1, m_2 | dynamic friction | 1, 1/K, 1/K² | text; the quadratic term is missing from the paper |
//! | R_1, R_2 | inner and outer radius of the facings | m | text after eq. (4) |
//!
//! The paper writes the speed in (3) as a tangential velocity, but prints α in s/rad: ω ρ/ρ_m is the speed at radius ρ in those units.

/// Least friction coefficient: without it, the polynomial μ_d could become negative far outside its range and friction would drive.
pub const MU_MIN: f64 = 0.02;

/// Parameters of the friction function.
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
    coefficient_at(p, omega, dynamic_friction(p, theta), (-p.alpha_2 * omega).exp())
}

/// Friction coefficient for a given value `decay` of the exponential e^(−α_2 ω).
#[inline]
fn coefficient_at(p: &Friction, omega: f64, mu_d: f64, decay: f64) -> f64 {
    (mu_d + (p.mu_0 - mu_d + p.alpha_1 * omega) * decay).max(MU_MIN)
}

/// Abscissae −a, −b, b, a and weights of the four-point Gauss–Legendre rule on [−1, 1]. The exponential varies by at most e^±0.2α_2ω over the facing, and the rule integrates
/// it to better than 1e-9.
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
        return coefficient_at(p, 0.0, mu_d, 1.0) * mean;
    }
    // The two outer gaps between the nodes are equal, so three exponentials give all four, which decay outwards; none of them can overflow.
    let (reach, alpha) = (half / mean, p.alpha_2 * omega);
    let fade = |gap: f64| (-alpha * (reach * gap)).exp();
    let (outer, inner) = (fade(GAUSS[1].0 - GAUSS[0].0), fade(GAUSS[2].0 - GAUSS[1].0));
    let first = (-alpha * (1.0 + reach * GAUSS[0].0)).exp();
    let second = first * outer;
    let third = second * inner;
    let mut sum = 0.0;
    for ((node, weight), decay) in GAUSS.into_iter().zip([first, second, third, third * outer]) {
        let share = 1.0 + reach * node;
        sum += weight * share * coefficient_at(p, omega * share, mu_d, decay);
    }
    0.5 * mean * sum
}
