//! Linear lag of second order, solved exactly: y + τ ẏ + κ τ² ÿ = u.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | τ | time constant | s |
//! | a | asymmetry: τ is (1 + a) times as long upwards and (1 − a) times downwards | 1 |
//! | κ | second-order share: 0 is a first-order lag, 1/4 two equal ones, above that it overshoots | 1 |
//! | u | input, constant or a ramp over the step | any |
//!
//! Engine torque and throwout bearing lag by the same law, hence one function; the exact solution keeps every τ stable.

/// Coefficients of the lag; `time_constant` 0 is no lag at all.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Lag {
    /// τ, s.
    pub time_constant: f64,
    /// κ.
    pub curvature: f64,
    /// a, between −1 and 1.
    pub asymmetry: f64,
}

impl Lag {
    /// Time constant in s while the output is `short` of its input: the one upwards if `short` is not negative, else the one downwards.
    pub fn towards(&self, short: f64) -> f64 {
        self.time_constant * (1.0 + if short >= 0.0 { self.asymmetry } else { -self.asymmetry })
    }
}

/// Output and its rate.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct LagState {
    /// Output, in the input's unit.
    pub value: f64,
    /// Rate of the output, per second.
    pub rate: f64,
}

/// Time constant in s up to which a lag counts as none: it settles within the shortest step, and its rates would overflow.
const SHORTEST: f64 = 1e-12;

/// State after `h` seconds with the input `u + slope·t`.
pub fn advance(lag: &Lag, state: LagState, u: f64, slope: f64, h: f64) -> LagState {
    if lag.time_constant <= SHORTEST {
        return LagState { value: u + slope * h, rate: slope };
    }
    let tau = lag.towards(u - state.value);
    let lag = &Lag { time_constant: tau, ..*lag };
    // Steady response to the ramp: it trails by τ. The rest decays freely.
    let (z0, v0) = (state.value - (u - slope * tau), state.rate - slope);
    let trail = u + slope * (h - tau);
    let (z, v) = free_response(lag, z0, v0, h);
    LagState { value: trail + z, rate: slope + v }
}

/// Mean output over the `h` > 0 seconds in which the lag went from one state to another with the input held at `u`, from the integral of the differential equation.
pub fn mean(lag: &Lag, from: LagState, to: LagState, u: f64, h: f64) -> f64 {
    let tau = lag.towards(u - from.value);
    let bent = if lag.curvature < FIRST_ORDER { 0.0 } else { lag.curvature * tau * (to.rate - from.rate) };
    u - tau / h * (to.value - from.value + bent)
}

/// κ below which the lag is treated as first-order: the second pole is then more than 1000 times as fast as the first.
pub const FIRST_ORDER: f64 = 1e-3;

fn free_response(lag: &Lag, z0: f64, v0: f64, h: f64) -> (f64, f64) {
    let (tau, kappa) = (lag.time_constant, lag.curvature);
    if kappa < FIRST_ORDER {
        let z = z0 * (-h / tau).exp();
        return (z, -z / tau);
    }
    let half = 1.0 / (2.0 * kappa * tau);
    let stiffness = 1.0 / (kappa * tau * tau);
    let discriminant = half * half - stiffness;
    let scale = (-half * h).exp();
    // z = e^(−half·h) (z0 C + (v0 + half z0) S), with C, S circular or hyperbolic.
    let (c, s) = if discriminant < -1e-9 * stiffness {
        let w = (-discriminant).sqrt();
        ((w * h).cos(), (w * h).sin() / w)
    } else if discriminant > 1e-9 * stiffness {
        let w = discriminant.sqrt();
        // The growing part of the hyperbolic functions is combined with the decay; otherwise it would overflow at small τ.
        let (grow, fade) = ((w * h - half * h).exp(), (-w * h - half * h).exp());
        let (c, s) = (0.5 * (grow + fade), 0.5 * (grow - fade) / w);
        let a = v0 + half * z0;
        return (z0 * c + a * s, v0 * c - (half * v0 + stiffness * z0) * s);
    } else {
        (1.0, h)
    };
    let a = v0 + half * z0;
    (scale * (z0 * c + a * s), scale * (v0 * c - (half * v0 + stiffness * z0) * s))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compared with the mean of 20 000 instants.
    #[test]
    fn the_mean_is_that_of_the_way_there() {
        for (curvature, asymmetry) in [(0.0, 0.0), (5e-4, 0.3), (0.2, -0.4), (0.25, 0.0), (0.8, 0.2)] {
            let lag = Lag { time_constant: 0.03, curvature, asymmetry };
            let (from, u, h) = (LagState { value: 20.0, rate: -35.0 }, 90.0, 0.1);
            let n = 20_000;
            let sum: f64 = (0..n).map(|k| advance(&lag, from, u, 0.0, h * (f64::from(k) + 0.5) / f64::from(n)).value).sum();
            let found = mean(&lag, from, advance(&lag, from, u, 0.0, h), u, h);
            assert!((found - sum / f64::from(n)).abs() < 1e-5, "{curvature} {asymmetry}: {found} {}", sum / f64::from(n));
        }
    }
}
