//! Delay lines: the last values of signals with their times, in rings of fixed size.
//!
//! The longest delay (0.2 s) is kept at a resolution of [`RESOLUTION`]: of values that come faster the newest replaces its
//! predecessor, so that a ring never loses its oldest needed value, however short the steps.

/// Values that each line keeps.
pub const CAPACITY: usize = 1024;

/// Age up to which values are surely kept, s.
pub const LONGEST: f64 = 0.2;

/// Least time between two values kept, but for the newest, s. A full line then reaches back over 1022 such times, which is [`LONGEST`]; steps of 0.2 ms keep every value.
pub const RESOLUTION: f64 = 1.96e-4;

const _: () = assert!((CAPACITY - 2) as f64 * RESOLUTION >= LONGEST);

/// How many signals have a line.
const LINES: usize = 3;

/// A signal that may come late.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    /// Position command.
    Command,
    /// Speed of the flywheel.
    Flywheel,
    /// Speed of the disc.
    Disc,
}

/// All of them, in the order in which a saved state has them.
pub const SIGNALS: [Signal; LINES] = [Signal::Command, Signal::Flywheel, Signal::Disc];

/// A time and a value.
type Pair = (f64, f64);

/// Where the pairs of a line stand in its ring.
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
    /// Slots of the rings, side by side; on the heap, for a task with a small stack makes plants too. All the room is there from the beginning, but a
    /// slot is first written to when a line gets there: most plants have no delay, and pay nothing for untouched memory.
    slots: Vec<[Pair; LINES]>,
    spans: [Span; LINES],
}

impl History {
    /// Empty lines.
    pub fn new() -> Self {
        Self { slots: Vec::with_capacity(CAPACITY), spans: [Span::default(); LINES] }
    }

    /// The line of a signal, to be read.
    pub fn line(&self, signal: Signal) -> Line<'_> {
        Line { slots: &self.slots, span: self.spans[signal as usize], signal }
    }

    /// Forgets a signal.
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

    /// Appends a pair that [`Line::iter`] gave, as it stands; false when the line is full.
    pub fn restore(&mut self, signal: Signal, time: f64, value: f64) -> bool {
        let span = &mut self.spans[signal as usize];
        if span.len == CAPACITY {
            return false;
        }
        span.len += 1;
        *self.newest(signal) = (time, value);
        true
    }

    /// Adds a value at a time that is not before the last one.
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

    /// Moves the values by `by`, and by what has `grown` up to their age in s: what an observer finds wrong of a moment ago was wrong before it, and has been
    /// getting worse since. Nothing is asked for any more that is older than the `oldest`, s, but the value before it.
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

/// A copy has all the room, too.
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
    /// Whether nothing is kept.
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

    /// Value held at `time`: that of the last event at or before it, or the oldest; none of an empty line.
    pub fn held(&self, time: f64) -> Option<f64> {
        (!self.is_empty()).then(|| self.at(self.before(time).unwrap_or(0)).1)
    }

    /// Time of the first event after `time`.
    pub fn next_event(&self, time: f64) -> Option<f64> {
        let next = self.before(time).map_or(0, |k| k + 1);
        (next < self.span.len).then(|| self.at(next).0)
    }

    /// Value at `time`, linear between samples; after the last one towards `value_now` at `now`.
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
