//! Lumped thermal model of the clutch: paper eq. (5) for two discs and a body, (6) for one disc.
//!
//! Disc i:  C_i θ̇_ci = γ_1 δ_i (θ_b − θ_ci) + γ_2 (1 − δ_i)(θ_h − θ_ci) + γ_3 P_i
//! Body:    C_b θ̇_b = −γ_1 Σ δ_i (θ_b − θ_ci) + (γ_2 (2 − Σ δ_i) + γ_b)(θ_h − θ_b) + (1 − γ_3) Σ P_i
//!
//! | symbol | meaning | unit | source |
//! |---|---|---|---|
//! | θ_c, θ_b, θ_h | disc, body (pressure plate and flywheel), housing air | °C | eq. (5) |
//! | δ | 1 while the clutch is not open | 1 | eq. (5) |
//! | P | friction power T_fc ω_fc | W | eq. (5) |
//! | C_1, C_2, C_b | heat capacities | J/K | Table I; C_2 is not given |
//! | γ_b | conductance from the body to the air, whatever state the clutches are in | W/K | not in the paper |
//! | γ_1, γ_2 | conductances disc–body and to the air | W/K | Table I |
//! | γ_3 | share of P that enters the disc | 1 | Table I |
//!
//! The paper assigns γ_3 P to disc and body alike, which conserves energy only for γ_3 = 1/2; the body's share is therefore read as 1 − γ_3. With both clutches engaged the
//! factor 2 − Σ δ_i vanishes, so a body between two closed clutches would never cool; γ_b is the missing heat loss, and γ_b = 0 is the paper as printed. Eq. (6b) follows with
//! δ_2 = 0; the paper prints δ_2 = 1, which would cancel γ_2.

/// Coefficients of the thermal model.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[allow(non_snake_case)]
pub struct Thermal {
    /// Capacity of a disc, J/K.
    pub C_1: f64,
    /// Capacity of the body, J/K.
    pub C_b: f64,
    /// Conductance disc–body, W/K.
    pub gamma_1: f64,
    /// Conductance to the housing air, W/K.
    pub gamma_2: f64,
    /// Share of the friction power that enters the disc.
    pub gamma_3: f64,
}

/// Coefficients of two clutches with a body between them.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[allow(non_snake_case)]
pub struct DualThermal {
    /// Coefficients of the first clutch, and those that both clutches share.
    pub first: Thermal,
    /// Capacity of the second disc, J/K.
    pub C_2: f64,
    /// γ_b, W/K.
    pub body_loss: f64,
}

impl DualThermal {
    /// Two equal clutches with eq. (5) as the paper prints it.
    pub fn equal(p: &Thermal) -> Self {
        Self { first: *p, C_2: p.C_1, body_loss: 0.0 }
    }
}

/// Temperature rates in K/s of both discs and the body, eq. (5a) to (5c).
///
/// `theta_c`, `engaged` and `power` (W) hold the values of disc 1 and disc 2; `theta_b`, `theta_h` in °C.
#[inline]
pub fn dual_rates(
    dual: &DualThermal,
    theta_c: [f64; 2],
    theta_b: f64,
    theta_h: f64,
    engaged: [bool; 2],
    power: [f64; 2],
) -> ([f64; 2], f64) {
    let (p, capacity) = (&dual.first, [dual.first.C_1, dual.C_2]);
    let mut disc = [0.0; 2];
    let mut body = dual.body_loss * (theta_h - theta_b);
    for i in 0..2 {
        let heat = if engaged[i] {
            let exchange = p.gamma_1 * (theta_b - theta_c[i]);
            body -= exchange;
            exchange
        } else {
            body += p.gamma_2 * (theta_h - theta_b);
            p.gamma_2 * (theta_h - theta_c[i])
        };
        disc[i] = (heat + p.gamma_3 * power[i]) * (1.0 / capacity[i]);
        body += (1.0 - p.gamma_3) * power[i];
    }
    (disc, body * (1.0 / p.C_b))
}

/// Temperature rates in K/s of disc and body of a single clutch: eq. (6), the reduction of (5) with the second clutch open
/// and at the body's temperature.
#[inline]
pub fn single_rates(p: &Thermal, theta_c: f64, theta_b: f64, theta_h: f64, engaged: bool, power: f64) -> (f64, f64) {
    let (disc, body) = dual_rates(&DualThermal::equal(p), [theta_c, theta_b], theta_b, theta_h, [engaged, false], [power, 0.0]);
    (disc[0], body)
}
