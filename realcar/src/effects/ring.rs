//! A transport delay on the fine step.

/// A delay line; it grows on first use to what it has to hold.
#[derive(Clone, Debug, Default)]
pub struct Ring {
    values: Vec<f64>,
    at: usize,
}

impl Ring {
    /// A line full of one value, for delays of at most `steps` fine steps.
    pub fn full(value: f64, steps: usize) -> Self {
        Self { values: vec![value; steps + 1], at: 0 }
    }

    /// Fills the line with a value, for delays of at most `steps` fine steps.
    pub fn rest(&mut self, value: f64, steps: usize) {
        *self = Self::full(value, steps);
    }

    /// Puts a value in and takes out the one of `steps` fine steps ago.
    pub fn step(&mut self, value: f64, steps: usize) -> f64 {
        let n = self.values.len();
        if n == 0 {
            return value;
        }
        self.at = (self.at + 1) % n;
        self.values[self.at] = value;
        self.values[(self.at + n - steps.min(n - 1)) % n]
    }
}
