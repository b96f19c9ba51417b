//! Linear system of second order with its input held over a step, solved exactly: ẋ = A x + b.
//!
//! x(t+h) = Φ x + Γ b with Φ = e^(A h), Γ = h φ_1(A h), φ_1(M) = M⁻¹ (e^M − 1).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | A | system matrix | 1/s |
//! | b | input, constant over the step | state per s |
//! | h | step, s, of any length | s |
//!
//! A stable A stays stable at every step, whereas an explicit step of the printed observer would be unstable beyond 1 ms. φ_1 is computed from its series for a small fraction
//! of h and then by doubling, which works for a singular A as well.

/// A row-major 2×2 matrix.
pub type Matrix = [[f64; 2]; 2];

/// A linear system with the transition matrices of its last step length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    a: Matrix,
    h: f64,
    phi: Matrix,
    gamma: Matrix,
}

const IDENTITY: Matrix = [[1.0, 0.0], [0.0, 1.0]];

/// Number of terms of the series of φ_1 at a norm of at most 1/2: the next one is below 2e-15.
const TERMS: usize = 13;

/// Maximum number of doublings; 2^60 of the shortest time constant in one step is beyond any use.
const DOUBLINGS: i32 = 60;

impl Held {
    /// The system ẋ = `a` x + b.
    pub fn new(a: Matrix) -> Self {
        Self { a, h: 0.0, phi: IDENTITY, gamma: [[0.0; 2]; 2] }
    }

    /// State after `h` seconds with `b` held. The transition matrices are recomputed only when `h` changes.
    #[inline]
    pub fn advance(&mut self, x: [f64; 2], b: [f64; 2], h: f64) -> [f64; 2] {
        if h != self.h {
            (self.phi, self.gamma) = transition(&self.a, h);
            self.h = h;
        }
        let (p, g) = (&self.phi, &self.gamma);
        std::array::from_fn(|i| p[i][0] * x[0] + p[i][1] * x[1] + g[i][0] * b[0] + g[i][1] * b[1])
    }
}

/// Φ and Γ over `h` seconds.
pub fn transition(a: &Matrix, h: f64) -> (Matrix, Matrix) {
    let m = scale(a, h);
    let norm = (m[0][0].abs() + m[0][1].abs()).max(m[1][0].abs() + m[1][1].abs());
    let doublings = if norm > 0.5 { (2.0 * norm).log2().ceil().min(f64::from(DOUBLINGS)) as i32 } else { 0 };
    let m = scale(&m, 0.5_f64.powi(doublings));
    let mut phi_1 = IDENTITY;
    for k in (2..=TERMS).rev() {
        phi_1 = add(&IDENTITY, &scale(&product(&m, &phi_1), 1.0 / k as f64));
    }
    let mut exponential = add(&IDENTITY, &product(&m, &phi_1));
    for _ in 0..doublings {
        // φ_1(2M) = (e^M + 1) φ_1(M) / 2.
        phi_1 = scale(&product(&add(&exponential, &IDENTITY), &phi_1), 0.5);
        exponential = product(&exponential, &exponential);
    }
    (exponential, scale(&phi_1, h))
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][0] * b[0][j] + a[i][1] * b[1][j]))
}

fn add(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] + b[i][j]))
}

fn scale(a: &Matrix, f: f64) -> Matrix {
    a.map(|row| row.map(|x| f * x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_diagonal_system_decays_by_its_exponentials() {
        let a = [[-1573.0, 0.0], [0.0, -14.3]];
        for h in [1e-6, 1e-4, 1e-3, 0.02, 1.0, 50.0] {
            let (phi, gamma) = transition(&a, h);
            for i in 0..2 {
                let exact = (a[i][i] * h).exp();
                assert!((phi[i][i] - exact).abs() <= 1e-13 * exact.max(1e-3), "h {h}: {} against {exact}", phi[i][i]);
                let exact = (a[i][i] * h).exp_m1() / a[i][i];
                assert!((gamma[i][i] - exact).abs() <= 1e-13 * exact.abs(), "h {h}: {} against {exact}", gamma[i][i]);
            }
        }
    }

    #[test]
    fn a_singular_and_a_turning_system_are_exact_too() {
        let (phi, gamma) = transition(&[[0.0, 1.0], [0.0, 0.0]], 0.3);
        assert_eq!(phi, [[1.0, 0.3], [0.0, 1.0]]);
        assert!((gamma[0][1] - 0.045).abs() < 1e-16);
        let (phi, _) = transition(&[[0.0, -5.0], [5.0, 0.0]], 2.0);
        assert!((phi[0][0] - 10.0_f64.cos()).abs() < 1e-13 && (phi[1][0] - 10.0_f64.sin()).abs() < 1e-13);
    }
}
