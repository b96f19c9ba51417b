//! A memory on the fine step.

/// The last values of a signal; it grows on first use to what it has to hold.
#[derive(Clone, Debug, Default)]
pub struct Ring {
    values: Vec<f64>,
    at: usize,
}

impl Ring {
    /// A memory of one value, for ages of at most `steps` fine steps.
    pub fn full(value: f64, steps: usize) -> Self {
        Self { values: vec![value; steps + 1], at: 0 }
    }

    /// Fills it with a value, for ages of at most `steps` fine steps.
    pub fn rest(&mut self, value: f64, steps: usize) {
        *self = Self::full(value, steps);
    }

    /// Fills it with a signal that has grown by `per_step` to zero.
    pub fn ramp(&mut self, per_step: f64, steps: usize) {
        *self = Self::full(0.0, steps);
        (0..=steps).for_each(|age| {
            let n = self.values.len();
            self.values[(n - age) % n] = -per_step * age as f64;
        });
    }

    /// Puts a value in.
    pub fn push(&mut self, value: f64) {
        let n = self.values.len();
        if n > 0 {
            self.at = (self.at + 1) % n;
            self.values[self.at] = value;
        }
    }

    /// The value of `steps` fine steps ago.
    pub fn ago(&self, steps: usize) -> f64 {
        let n = self.values.len();
        self.values.get((self.at + n - steps.min(n.saturating_sub(1))) % n.max(1)).copied().unwrap_or(0.0)
    }

    /// Puts a value in and takes out the one of `steps` fine steps ago.
    pub fn step(&mut self, value: f64, steps: usize) -> f64 {
        if self.values.is_empty() {
            return value;
        }
        self.push(value);
        self.ago(steps)
    }
}
