//! Cushion spring: its force over the normalised throwout position, and the inverse.
//!
//! F(ξ) = β_1 ξ + β_2 ξ² + β_3 ξ³ above the true contact point ξ_0, and 0 at and below it.
//!
//! | symbol | meaning | unit | source |
//! |---|---|---|---|
//! | ξ | normalised position, 0..1 | 1 | paper eq. (2) |
//! | β_1, β_2, β_3 | spring polynomial | N | text after eq. (4), printed in kN |
//! | ξ_0 | largest root of F in [0, 1): where contact really begins | 1 | the printed polynomial is negative below 0.202 |

/// Coefficients of the spring polynomial, N.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct CushionSpring {
    /// Linear term, N.
    pub beta_1: f64,
    /// Quadratic term, N.
    pub beta_2: f64,
    /// Cubic term, N.
    pub beta_3: f64,
}

#[inline]
fn polynomial(p: &CushionSpring, xi: f64) -> f64 {
    xi * (p.beta_1 + xi * (p.beta_2 + xi * p.beta_3))
}

/// Slope of the spring force over the normalised position, N.
#[inline]
pub fn slope(p: &CushionSpring, xi: f64) -> f64 {
    p.beta_1 + xi * (2.0 * p.beta_2 + 3.0 * xi * p.beta_3)
}

/// True contact point ξ_0: the largest root of F in [0, 1).
pub fn contact_point(p: &CushionSpring) -> f64 {
    let inside = |root: f64| if root > 0.0 && root < 1.0 { root } else { 0.0 };
    if p.beta_3 == 0.0 {
        return if p.beta_2 == 0.0 { 0.0 } else { inside(-p.beta_1 / p.beta_2) };
    }
    let discriminant = p.beta_2 * p.beta_2 - 4.0 * p.beta_1 * p.beta_3;
    if discriminant < 0.0 {
        return 0.0;
    }
    // q carries the sign of β_2, so that neither root loses digits to cancellation.
    let q = -0.5 * (p.beta_2 + discriminant.sqrt().copysign(p.beta_2));
    let roots = [q / p.beta_3, if q == 0.0 { 0.0 } else { p.beta_1 / q }];
    inside(roots[0]).max(inside(roots[1]))
}

/// Spring force in N at the normalised position `xi`, with `xi_0` from [`contact_point`].
#[inline]
pub fn force(p: &CushionSpring, xi_0: f64, xi: f64) -> f64 {
    if xi <= xi_0 { 0.0 } else { polynomial(p, xi).max(0.0) }
}

/// Maximum number of Newton and bisection steps in [`inverse`]; bisection alone would need 53.
pub const INVERSE_ITERATIONS: usize = 64;

/// Normalised position at which the spring force is `wanted` N: ξ_0 for a force of zero, 1 where the spring cannot give as much.
///
/// The branch above ξ_0 is monotone for a sound vehicle. `kisspoint vehicle check` reports any other vehicle, which can be simulated all the same, because the search stays
/// within its bracket.
pub fn inverse(p: &CushionSpring, xi_0: f64, wanted: f64) -> f64 {
    if wanted <= 0.0 {
        return xi_0;
    }
    if wanted >= polynomial(p, 1.0) { 1.0 } else { searched(p, xi_0, wanted).0 }
}

/// The position, and the number of steps that it took to find it.
fn searched(p: &CushionSpring, xi_0: f64, wanted: f64) -> (f64, usize) {
    let (mut low, mut high, mut xi) = (xi_0, 1.0, 1.0);
    for step in 1..=INVERSE_ITERATIONS {
        let excess = polynomial(p, xi) - wanted;
        if excess > 0.0 {
            high = xi
        } else {
            low = xi
        }
        let newton = xi - excess / slope(p, xi);
        if (newton - xi).abs() <= f64::EPSILON {
            return (xi, step);
        }
        xi = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
    }
    (xi, INVERSE_ITERATIONS)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Also where the first Newton step leaves the bracket, as for a spring that is stiffest at the contact.
    #[test]
    fn newton_finds_a_position_in_a_few_steps() {
        let paper = CushionSpring { beta_1: 26.1195, beta_2: -1304.6, beta_3: 5818.5 };
        let stiffest_first = CushionSpring { beta_1: 4000.0, beta_2: -1900.0, beta_3: 10.0 };
        for (p, xi_0) in [(paper, contact_point(&paper)), (stiffest_first, 0.0)] {
            for share in [1e-6, 1e-3, 0.01, 0.1, 0.5, 0.9, 0.999] {
                let wanted = share * polynomial(&p, 1.0);
                let (xi, steps) = searched(&p, xi_0, wanted);
                assert!(((polynomial(&p, xi) - wanted) / wanted).abs() < 1e-9 && steps < 20, "{share}: {xi} in {steps} steps");
                assert_eq!(inverse(&p, xi_0, wanted), xi);
            }
        }
    }
}
