//! Lags of first and second order, and one that rises slower than it falls.

/// How an output trails its input.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Shape {
    /// No lag at all.
    #[default]
    None,
    /// First order; time constant in s.
    First(f64),
    /// Second order; time that it trails a ramp by, in s, and damping ratio.
    Second(f64, f64),
    /// First order with one time constant for a growing output and another for a falling one, s.
    UpDown(f64, f64),
}

/// A lag and its state.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lag {
    /// How it trails.
    pub shape: Shape,
    y: f64,
    v: f64,
}

impl Lag {
    /// A lag of the given shape.
    pub fn new(shape: Shape) -> Self {
        Self { shape, ..Self::default() }
    }

    /// Puts the lag at rest at a value.
    pub fn rest(&mut self, value: f64) {
        (self.y, self.v) = (value, 0.0);
    }

    /// Goes on by `h` seconds with a constant input.
    pub fn step(&mut self, h: f64, u: f64) -> f64 {
        self.y = match self.shape {
            Shape::First(tau) => first(self.y, u, h, tau),
            Shape::UpDown(up, down) => first(self.y, u, h, if u > self.y { up } else { down }),
            Shape::Second(ramp, zeta) if ramp > h => {
                // A ramp is trailed by 2 ζ / ω_n.
                let wn = 2.0 * zeta / ramp;
                self.v += h * (wn * wn * (u - self.y) - 2.0 * zeta * wn * self.v);
                self.y + h * self.v
            }
            Shape::None | Shape::Second(..) => u,
        };
        self.y
    }
}

fn first(y: f64, u: f64, h: f64, tau: f64) -> f64 {
    if tau <= 0.0 { u } else { u + (y - u) * (-h / tau).exp() }
}
