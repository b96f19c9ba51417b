//! Delay lines: the last values of signals with their times, in rings of fixed size.
//!
//! The longest delay (0.2 s) is covered at a resolution of [`RESOLUTION`]: where values arrive faster, the newest replaces its predecessor, so that a ring never loses the
//! oldest value that is still needed, however short the steps are.

/// Number of values that each line holds.
pub const CAPACITY: usize = 1024;

/// Age up to which values are guaranteed to be kept, s.
pub const LONGEST: f64 = 0.2;

/// Minimum time between two stored values except for the newest, s. A full line then spans 1022 such intervals, which is [`LONGEST`]; with steps of 0.2 ms every value is kept.
pub const RESOLUTION: f64 = 1.96e-4;

const _: () = assert!((CAPACITY - 2) as f64 * RESOLUTION >= LONGEST);

/// Number of signals with a delay line.
const LINES: usize = 3;

/// A signal that can be delayed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    /// Position command.
    Command,
    /// Speed of the flywheel.
    Flywheel,
    /// Speed of the disc.
    Disc,
}

/// All signals, in the order of a saved state.
pub const SIGNALS: [Signal; LINES] = [Signal::Command, Signal::Flywheel, Signal::Disc];

/// A time and a value.
type Pair = (f64, f64);

/// Range of slots that a line occupies in its ring.
#[derive(Clone, Copy, Debug, Default)]
struct Span {
    first: usize,
    len: usize,
}

impl Span {
    fn slot(&self, k: usize) -> usize {
        (self.first + k) % CAPACITY
    }
}

/// The delay lines of a plant.
#[derive(Debug)]
pub struct History {
    /// Slots of all rings side by side. They are on the heap because tasks with a small stack create plants too. The full capacity is reserved at the beginning, but a slot is
    /// written to only once a line reaches it: most plants have no delay, and untouched memory costs them nothing.
    slots: Vec<[Pair; LINES]>,
    spans: [Span; LINES],
}

impl History {
    /// Empty lines.
    pub fn new() -> Self {
        Self { slots: Vec::with_capacity(CAPACITY), spans: [Span::default(); LINES] }
    }

    /// The line of a signal, for reading.
    pub fn line(&self, signal: Signal) -> Line<'_> {
        Line { slots: &self.slots, span: self.spans[signal as usize], signal }
    }

    /// Empties the line of a signal.
    pub fn clear(&mut self, signal: Signal) {
        self.spans[signal as usize] = Span::default();
    }

    /// The slot of the newest pair of a line.
    fn newest(&mut self, signal: Signal) -> &mut Pair {
        let span = self.spans[signal as usize];
        let slot = span.slot(span.len - 1);
        if slot >= self.slots.len() {
            self.slots.resize(slot + 1, [(0.0, 0.0); LINES]);
        }
        &mut self.slots[slot][signal as usize]
    }

    /// Appends a pair from [`Line::iter`] unchanged; returns false if the line is full.
    pub fn restore(&mut self, signal: Signal, time: f64, value: f64) -> bool {
        let span = &mut self.spans[signal as usize];
        if span.len == CAPACITY {
            return false;
        }
        span.len += 1;
        *self.newest(signal) = (time, value);
        true
    }

    /// Adds a value; `time` must not be before that of the last one.
    pub fn push(&mut self, signal: Signal, time: f64, value: f64) {
        let line = self.line(signal);
        // The newest value is replaced while it is close to the one before it; the first value of all always stays.
        let crowded = line.span.len >= 2 && line.at(line.span.len - 1).0 - line.at(line.span.len - 2).0 < RESOLUTION;
        if !crowded {
            let span = &mut self.spans[signal as usize];
            if span.len == CAPACITY {
                span.first = span.slot(1);
            } else {
                span.len += 1;
            }
        }
        *self.newest(signal) = (time, value);
    }

    /// Corrects the stored values by `by` plus `grown` at their age in s: an error that an observer finds in a past value was already present before it, and has grown since.
    /// The correction ends with the first value older than `oldest` s, because none before it can be requested any more.
    pub fn correct(&mut self, signal: Signal, by: f64, grown: impl Fn(f64) -> f64, now: f64, oldest: f64) {
        let span = self.spans[signal as usize];
        for k in (0..span.len).rev() {
            let (time, value) = &mut self.slots[span.slot(k)][signal as usize];
            let age = now - *time;
            *value += by + grown(age);
            if age > oldest {
                return;
            }
        }
    }
}

/// The copy reserves the full capacity as well.
impl Clone for History {
    fn clone(&self) -> Self {
        let mut copy = Self { spans: self.spans, ..Self::new() };
        copy.slots.extend_from_slice(&self.slots);
        copy
    }
}

impl PartialEq for History {
    fn eq(&self, other: &Self) -> bool {
        SIGNALS.iter().all(|s| self.line(*s).iter().eq(other.line(*s).iter()))
    }
}

impl Default for History {
    fn default() -> Self {
        Self::new()
    }
}

/// The line of one signal.
#[derive(Clone, Copy)]
pub struct Line<'a> {
    slots: &'a [[Pair; LINES]],
    span: Span,
    signal: Signal,
}

impl<'a> Line<'a> {
    /// Whether the line is empty.
    pub fn is_empty(&self) -> bool {
        self.span.len == 0
    }

    fn at(&self, k: usize) -> Pair {
        self.slots[self.span.slot(k)][self.signal as usize]
    }

    /// The pairs (time, value) kept, oldest first.
    pub fn iter(self) -> impl ExactSizeIterator<Item = (f64, f64)> + 'a {
        (0..self.span.len).map(move |k| self.at(k))
    }

    /// Index of the last value at or before `time`.
    fn before(&self, time: f64) -> Option<usize> {
        let (mut low, mut high) = (0, self.span.len);
        while low < high {
            let middle = (low + high) / 2;
            if self.at(middle).0 <= time { low = middle + 1 } else { high = middle }
        }
        low.checked_sub(1)
    }

    /// Value of a piecewise constant signal at `time`: the last one at or before it, or else the oldest; `None` if the line is empty.
    pub fn held(&self, time: f64) -> Option<f64> {
        (!self.is_empty()).then(|| self.at(self.before(time).unwrap_or(0)).1)
    }

    /// Time of the first event after `time`.
    pub fn next_event(&self, time: f64) -> Option<f64> {
        let next = self.before(time).map_or(0, |k| k + 1);
        (next < self.span.len).then(|| self.at(next).0)
    }

    /// Value at `time`, linear between samples, and after the last one linear towards `value_now` at `now`.
    pub fn interpolate(&self, time: f64, now: f64, value_now: f64) -> f64 {
        let Some(k) = self.before(time) else {
            return if self.is_empty() { value_now } else { self.at(0).1 };
        };
        let (t0, v0) = self.at(k);
        let (t1, v1) = if k + 1 < self.span.len { self.at(k + 1) } else { (now, value_now) };
        if t1 > t0 { v0 + (v1 - v0) * ((time - t0) / (t1 - t0)).min(1.0) } else { v1 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_delay_is_kept_however_short_the_steps() {
        for h in [1e-5, 7e-5, 1e-4, 1.25e-4, 1.5e-4, 1.9e-4, 1.96e-4, 2e-4, 3.3e-4, 5e-4, 1e-3] {
            let mut all = History::new();
            let steps = (2.0 / h) as u32;
            for k in 0..=steps {
                all.push(Signal::Disc, f64::from(k) * h, f64::from(k) * h);
            }
            let (now, line) = (f64::from(steps) * h, all.line(Signal::Disc));
            for delay in [0.0, 1e-3, 0.05, 0.15, LONGEST] {
                let got = line.interpolate(now - delay, now, now);
                assert!((got - (now - delay)).abs() < 1e-9, "delay {delay} in steps of {h}: {got}");
            }
            let gaps = line.iter().skip(1).zip(line.iter()).map(|(b, a)| b.0 - a.0);
            assert!(gaps.fold(0.0, f64::max) < RESOLUTION + h, "steps of {h}");
            assert!(h < 2e-4 || line.iter().len() == CAPACITY.min(steps as usize + 1), "every step of {h} is kept");
        }
    }

    #[test]
    fn a_held_signal_changes_at_its_events() {
        let mut all = History::new();
        for (t, v) in [(0.0, 1.0), (0.5, 2.0), (1.0, 3.0)] {
            all.push(Signal::Disc, t, v);
        }
        let line = all.line(Signal::Disc);
        assert_eq!([-1.0, 0.49, 0.5, 9.0].map(|t| line.held(t)), [1.0, 1.0, 2.0, 3.0].map(Some));
        assert_eq!((all.line(Signal::Command).held(1.0), all.line(Signal::Command).is_empty()), (None, true));
        assert_eq!((line.next_event(0.5), line.next_event(1.0)), (Some(1.0), None));
    }
}
