//! Which part of a recording is used.
//!
//! The span starts where every channel that is needed has started; engine and actuator are known to be at rest only at the start,
//! so a late channel can't be mended by dropping the beginning. It ends where one of them ends, or in front of the first gap of an
//! input that is too long to hold the value before it. A sensor may have gaps: there it says nothing.

use super::channels::{Channel, Lasting, Presence};
use super::clock::{Gap, Spacing, spacing};
use super::error::{Defect, RecordingError};
use super::manifest::Entry;
use super::pick::Signal;
use super::rows::SAME_S;
use super::table::Measurement;

/// Longest stretch of missing samples over which an input holds its value, s.
const HOLD_S: f64 = 0.1;
/// A channel may start this much later than the others, s.
const EDGE_S: f64 = 0.1;
/// Shortest recording, s.
const SHORTEST_S: f64 = 0.5;
/// Slowest rate of the speeds, Hz.
const SLOWEST_HZ: f64 = 20.0;
/// A part of the step that is rounding of the clock.
const ROUNDING: f64 = 0.02;

/// A channel with its spacing.
pub(crate) struct Track {
    pub signal: Signal,
    pub spacing: Spacing,
}

impl Track {
    /// How its values last.
    pub fn lasting(&self) -> Lasting {
        self.signal.channel.spec().lasting
    }

    /// Whether it bounds the recording: the inputs and the speeds.
    fn bounds(&self) -> bool {
        self.lasting() == Lasting::Held || self.signal.channel.spec().presence == Presence::Always
    }

    /// The first gap over which an input may not be held.
    fn cut(&self) -> Option<Gap> {
        let long = |g: &&Gap| g.missing_s(self.spacing.step) > HOLD_S + ROUNDING * self.spacing.step + 3.0 * self.spacing.jitter;
        self.spacing.gaps.iter().filter(|_| self.lasting() == Lasting::Held).find(long).copied()
    }

    /// Until when the sample at `at`, the last one in front of a gap or the end, says something.
    fn end(&self, at: f64) -> f64 {
        if self.lasting() == Lasting::Held { at + self.spacing.step * (1.0 - ROUNDING) } else { at }
    }
}

/// The spacing of every channel; one that is needed has to have a valid sample.
pub(crate) fn tracks(m: &Measurement, signals: Vec<Signal>, notes: &mut Vec<String>) -> Result<Vec<Track>, RecordingError> {
    let mut tracks = Vec::new();
    for signal in signals {
        match spacing(&signal.time, &signal.values) {
            Some(spacing) => tracks.push(Track { signal, spacing }),
            None if signal.channel.spec().presence == Presence::Always => {
                return Err(m.defect_at(Defect::NothingValid, &signal.label, None));
            }
            None => notes.push(format!("{}: not one valid sample; the channel is not used", signal.label)),
        }
    }
    Ok(tracks)
}

/// Refuses a clock that can't be in the unit that it claims, and speeds too slow to follow an engagement.
pub(crate) fn check_rate(m: &Measurement, tracks: &[Track], entry: &Entry, notes: &mut Vec<String>) -> Result<(), RecordingError> {
    let speeds = tracks.iter().filter(|t| matches!(t.signal.channel, Channel::OmegaF | Channel::OmegaC));
    let step = speeds.map(|t| t.spacing.step).filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min);
    if !step.is_finite() {
        return Err(too_short(m, tracks, 0.0));
    }
    let own = 1.0 / step;
    if let Some(stated) = entry.sample_rate_hz {
        let near = |factor: f64| (own * factor / stated - 1.0).abs() < 0.1;
        let hints =
            [(1e3, "; it looks like ms"), (1e6, "; it looks like µs"), (1e9, "; it looks like ns"), (1.0 / 60.0, "; it looks like min")];
        if let Some((_, hint)) = hints.iter().find(|(factor, _)| near(*factor)) {
            return Err(m.defect(Defect::ClockUnit { rate_hz: own, stated_hz: stated, hint }));
        }
        if !near(1.0) {
            notes.push(format!("recordings.json says {stated} Hz, the speeds come at {} Hz; their clock is believed", round(own)));
        }
    }
    if own < SLOWEST_HZ { Err(m.defect(Defect::TooSlow(own))) } else { Ok(()) }
}

/// Six digits: a clock with rounded times is not known better.
pub(crate) fn round(rate: f64) -> f64 {
    let unit = 10f64.powi(rate.log10().floor() as i32 - 5);
    (rate / unit).round() * unit
}

/// First and last time that all channels that are needed cover.
pub(crate) fn span(m: &Measurement, tracks: &[Track], notes: &mut Vec<String>) -> Result<(f64, f64), RecordingError> {
    let needed: Vec<&Track> = tracks.iter().filter(|t| t.bounds()).collect();
    let earliest = needed.iter().map(|t| t.spacing.first).fold(f64::INFINITY, f64::min);
    let start = needed.iter().map(|t| t.spacing.first).fold(f64::NEG_INFINITY, f64::max);
    if let Some(late) = needed.iter().find(|t| t.spacing.first - earliest > EDGE_S) {
        let seconds = late.spacing.first - earliest;
        return Err(m.defect_at(Defect::LateStart { seconds }, &late.signal.label, first_valid(&late.signal)));
    }
    if earliest != 0.0 {
        notes.push(format!("the clock starts at {earliest} s; time counts from there"));
    }
    if start - earliest > SAME_S {
        notes.push(format!("the first {:.1} ms, which not all channels cover, are left out", 1e3 * (start - earliest)));
    }
    let full = needed.iter().map(|t| t.end(t.spacing.last)).fold(f64::INFINITY, f64::min);
    let cut = needed.iter().filter_map(|t| t.cut().map(|g| (*t, g))).min_by(|a, b| a.1.from.total_cmp(&b.1.from));
    let end = match cut {
        Some((track, gap)) => cut_at(m, track, gap, start, full, notes)?,
        None => full,
    };
    if end - start < SHORTEST_S - SAME_S {
        return Err(too_short(m, tracks, (end - start).max(0.0)));
    }
    let longest = needed.iter().map(|t| t.spacing.last).fold(end, f64::max);
    let step = needed.iter().map(|t| t.spacing.step).fold(f64::INFINITY, f64::min);
    if cut.is_none() && longest - end > 1.5 * step {
        let short = needed.iter().min_by(|a, b| a.end(a.spacing.last).total_cmp(&b.end(b.spacing.last)));
        let label = short.map_or("", |t| &t.signal.label);
        notes.push(format!("{label}: no valid sample in the last {:.3} s, which are left out", longest - end));
    }
    Ok((start, end))
}

/// The end in front of a gap, if enough remains there.
fn cut_at(m: &Measurement, track: &Track, gap: Gap, start: f64, full: f64, notes: &mut Vec<String>) -> Result<f64, RecordingError> {
    let end = gap.from.min(full);
    let (seconds, kept) = (gap.missing_s(track.spacing.step), (end - start).max(0.0));
    let label = &track.signal.label;
    if kept < SHORTEST_S - SAME_S {
        return Err(m.defect_at(Defect::Gap { seconds, kept }, label, Some(gap.sample)));
    }
    notes.push(format!(
        "{label}, {}: a gap of {seconds:.3} s; the recording is cut in front of it, {kept:.3} s remain and {:.3} s are left out",
        m.row_text(gap.sample),
        full - end
    ));
    Ok(end)
}

/// Placed where the first of the channels that are needed ends.
fn too_short(m: &Measurement, tracks: &[Track], seconds: f64) -> RecordingError {
    let first_to_end = tracks.iter().filter(|t| t.bounds()).min_by(|a, b| a.spacing.last.total_cmp(&b.spacing.last)).map(|t| &t.signal);
    let last = first_to_end.and_then(|s| s.values.iter().rposition(|v| !v.is_nan()));
    m.defect_at(Defect::TooShort { seconds }, first_to_end.map_or("", |s| &s.label), last)
}

fn first_valid(signal: &Signal) -> Option<usize> {
    signal.values.iter().position(|v| !v.is_nan())
}
