//! What happens at random while a car drives.

/// A small generator (a Weyl sequence, scrambled) that can be cloned with the car's state.
#[derive(Clone, Debug, Default)]
pub struct Road(u64);

impl Road {
    /// One generator for each recording, so that no recording depends on another.
    pub fn new(seed: u64, recording: u64) -> Self {
        let mut road = Self(seed ^ recording.wrapping_mul(0xd1b5_4a32_d192_ed03));
        road.uniform();
        road
    }

    /// Evenly spread over 0..1.
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Evenly spread over a range.
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Whether something of this chance happens.
    pub fn happens(&mut self, chance: f64) -> bool {
        self.uniform() < chance
    }

    /// Mean 0 and variance 1; near enough to a normal distribution for wind.
    pub fn normal(&mut self) -> f64 {
        (0..4).map(|_| self.uniform() - 0.5).sum::<f64>() * 3f64.sqrt()
    }
}
