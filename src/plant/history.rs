//! Delay line: the last values of a signal with their times, in a ring of fixed size.
//!
//! The longest delay (0.2 s) is kept at a resolution of [`RESOLUTION`]: values that come faster replace their
//! predecessor, so that the ring never loses its oldest needed value, however short the steps.

/// Values kept.
pub const CAPACITY: usize = 1024;

/// Age up to which values are surely kept, s.
pub const LONGEST: f64 = 0.2;

/// Least time between two values kept, s.
pub const RESOLUTION: f64 = 2e-4;

/// A delay line.
#[derive(Clone, Debug)]
pub struct History {
    /// Pairs (time, value); on the heap, for a task with a small stack makes plants too.
    ring: Box<[(f64, f64)]>,
    first: usize,
    len: usize,
}

impl PartialEq for History {
    fn eq(&self, other: &Self) -> bool {
        self.iter().eq(other.iter())
    }
}

impl History {
    /// An empty line.
    pub fn new() -> Self {
        Self { ring: vec![(0.0, 0.0); CAPACITY].into_boxed_slice(), first: 0, len: 0 }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.first = 0;
        self.len = 0;
    }

    /// Whether nothing is kept.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    fn slot(&self, k: usize) -> usize {
        (self.first + k) % CAPACITY
    }

    fn at(&self, k: usize) -> (f64, f64) {
        self.ring[self.slot(k)]
    }

    /// The pairs (time, value) kept, oldest first.
    pub fn iter(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        (0..self.len).map(|k| self.at(k))
    }

    /// Appends a pair that [`History::iter`] gave, as it stands; false when the line is full.
    pub fn restore(&mut self, time: f64, value: f64) -> bool {
        if self.len == CAPACITY {
            return false;
        }
        let slot = self.slot(self.len);
        self.ring[slot] = (time, value);
        self.len += 1;
        true
    }

    /// Adds a value at a time that is not before the last one.
    pub fn push(&mut self, time: f64, value: f64) {
        // The newest value is replaced while the one before it is close; the first value of all always stays.
        let crowded = self.len >= 2 && time - self.at(self.len - 2).0 < RESOLUTION;
        if !crowded {
            if self.len == CAPACITY {
                self.first = self.slot(1);
            } else {
                self.len += 1;
            }
        }
        let slot = self.slot(self.len - 1);
        self.ring[slot] = (time, value);
    }

    /// Moves the values by `by`, and by `rate` per second for what came after the last `since` seconds began: what an observer finds wrong of a moment ago
    /// was wrong before it, and has been getting worse since.
    pub fn correct(&mut self, by: f64, rate: f64, since: f64, now: f64) {
        // Newest first; what is older than the longest delay is not asked for any more, but for the value that held at its beginning.
        for k in (0..self.len).rev() {
            let slot = self.slot(k);
            let age = now - self.ring[slot].0;
            self.ring[slot].1 += by + rate * (since - age).max(0.0);
            if age > LONGEST {
                return;
            }
        }
    }

    /// Index of the last value at or before `time`.
    fn before(&self, time: f64) -> Option<usize> {
        let (mut low, mut high) = (0, self.len);
        while low < high {
            let middle = (low + high) / 2;
            if self.at(middle).0 <= time { low = middle + 1 } else { high = middle }
        }
        low.checked_sub(1)
    }

    /// Value held at `time`: that of the last event at or before it, or the oldest.
    pub fn held(&self, time: f64) -> f64 {
        self.at(self.before(time).unwrap_or(0)).1
    }

    /// Time of the first event after `time`.
    pub fn next_event(&self, time: f64) -> Option<f64> {
        let next = self.before(time).map_or(0, |k| k + 1);
        (next < self.len).then(|| self.at(next).0)
    }

    /// Value at `time`, linear between samples; after the last one towards `value_now` at `now`.
    pub fn interpolate(&self, time: f64, now: f64, value_now: f64) -> f64 {
        let Some(k) = self.before(time) else {
            return if self.is_empty() { value_now } else { self.at(0).1 };
        };
        let (t0, v0) = self.at(k);
        let (t1, v1) = if k + 1 < self.len { self.at(k + 1) } else { (now, value_now) };
        if t1 > t0 { v0 + (v1 - v0) * ((time - t0) / (t1 - t0)).min(1.0) } else { v1 }
    }
}

impl Default for History {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_delay_is_kept_however_short_the_steps() {
        let mut line = History::new();
        let h = 1e-5;
        for k in 0..200_000 {
            line.push(f64::from(k) * h, f64::from(k) * h);
        }
        let now = 199_999.0 * h;
        for delay in [0.0, 1e-3, 0.05, 0.199] {
            let got = line.interpolate(now - delay, now, now);
            assert!((got - (now - delay)).abs() < 1e-9, "delay {delay}: {got}");
        }
    }

    #[test]
    fn a_held_signal_changes_at_its_events() {
        let mut line = History::new();
        for (t, v) in [(0.0, 1.0), (0.5, 2.0), (1.0, 3.0)] {
            line.push(t, v);
        }
        assert_eq!((line.held(-1.0), line.held(0.49), line.held(0.5), line.held(9.0)), (1.0, 1.0, 2.0, 3.0));
        assert_eq!((line.next_event(0.5), line.next_event(1.0)), (Some(1.0), None));
    }
}
