//! Which part of a recording is used, and at which rate.
//!
//! The span starts where every required channel has started; engine and actuator are known to be at rest only at the start,
//! so a late channel can't be mended by dropping the beginning. It ends where a required channel ends, or in front of the
//! first gap that is too long to bridge. A bench channel that does not cover the span is left out of this recording.

use super::channels::{Channel, Lasting};
use super::clock::{Gap, Spacing, spacing};
use super::error::{Defect, RecordingError};
use super::manifest::Entry;
use super::pick::Signal;
use super::resample::SNAP;
use super::table::Measurement;

/// A channel may start or, on the bench, end this much later or earlier than the others, s.
const EDGE_S: f64 = 0.1;
/// Shortest recording, s.
const SHORTEST_S: f64 = 0.5;
/// Slowest rate of the speeds, Hz.
const SLOWEST_HZ: f64 = 20.0;
/// Rates that the diagnosis works with, Hz.
const RATES_HZ: std::ops::RangeInclusive<f64> = 100.0..=1000.0;

/// A channel with its spacing.
pub(crate) struct Track {
    pub signal: Signal,
    pub spacing: Spacing,
}

impl Track {
    /// Whether a recording can't do without it.
    pub fn required(&self) -> bool {
        self.signal.channel.spec().required
    }

    /// How its values last.
    pub fn lasting(&self) -> Lasting {
        self.signal.channel.spec().lasting
    }

    /// The first gap that a straight line may not bridge.
    fn cut(&self) -> Option<Gap> {
        let bridge = self.signal.channel.spec().bridge_s;
        // A part of the step is rounding of the clock.
        let long = |g: &&Gap| g.missing_s(self.spacing.step) > bridge + SNAP * self.spacing.step;
        self.spacing.gaps.iter().find(long).copied()
    }

    /// Until when the last sample before `at` holds, if grid points lie this far apart.
    fn end(&self, at: f64, rate_hz: f64) -> f64 {
        let hold = if self.lasting() == Lasting::Held { self.spacing.step - 1.0 / rate_hz } else { 0.0 };
        at + hold.max(0.0)
    }
}

/// The spacing of every channel; a required one needs a valid sample.
pub(crate) fn tracks(m: &Measurement, signals: Vec<Signal>, notes: &mut Vec<String>) -> Result<Vec<Track>, RecordingError> {
    let mut tracks = Vec::new();
    for signal in signals {
        match spacing(&signal.time, &signal.values) {
            Some(spacing) => tracks.push(Track { signal, spacing }),
            None if signal.channel.spec().required => return Err(m.defect_at(Defect::NothingValid, &signal.label, None)),
            None => notes.push(format!("{}: not one valid sample; the channel is not used", signal.label)),
        }
    }
    Ok(tracks)
}

/// The grid's rate: as stated if the speeds come at about that rate, else their own.
pub(crate) fn rate(m: &Measurement, tracks: &[Track], entry: &Entry, notes: &mut Vec<String>) -> Result<f64, RecordingError> {
    let speeds = tracks.iter().filter(|t| matches!(t.signal.channel, Channel::OmegaF | Channel::OmegaC));
    let step = speeds.map(|t| t.spacing.step).filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min);
    if !step.is_finite() {
        return Err(too_short(m, tracks, 0.0));
    }
    let (own, stated) = (1.0 / step, entry.sample_rate_hz);
    let near = |factor: f64| (own * factor / stated - 1.0).abs() < 0.1;
    let hints =
        [(1e3, "; it looks like ms"), (1e6, "; it looks like µs"), (1e9, "; it looks like ns"), (1.0 / 60.0, "; it looks like min")];
    if let Some((_, hint)) = hints.iter().find(|(factor, _)| near(*factor)) {
        return Err(m.defect(Defect::ClockUnit { rate_hz: own, stated_hz: stated, hint }));
    }
    if own < SLOWEST_HZ {
        return Err(m.defect(Defect::TooSlow(own)));
    }
    let own_or_stated = if near(1.0) { stated } else { round(own) };
    if !near(1.0) {
        notes.push(format!("recordings.json says {stated} Hz, the speeds come at {own_or_stated} Hz; their clock is believed"));
    }
    Ok(own_or_stated.clamp(*RATES_HZ.start(), *RATES_HZ.end()))
}

/// Six digits: a mean over a clock with rounded times is not known better.
pub(crate) fn round(rate: f64) -> f64 {
    let unit = 10f64.powi(rate.log10().floor() as i32 - 5);
    (rate / unit).round() * unit
}

/// First and last time that all required channels cover.
pub(crate) fn span(m: &Measurement, tracks: &[Track], rate_hz: f64, notes: &mut Vec<String>) -> Result<(f64, f64), RecordingError> {
    let needed: Vec<&Track> = tracks.iter().filter(|t| t.required() && t.lasting() != Lasting::Slow).collect();
    let earliest = needed.iter().map(|t| t.signal.time[0]).fold(f64::INFINITY, f64::min);
    let start = needed.iter().map(|t| t.spacing.first).fold(f64::NEG_INFINITY, f64::max);
    if let Some(late) = needed.iter().find(|t| t.spacing.first - earliest > EDGE_S) {
        let seconds = late.spacing.first - earliest;
        return Err(m.defect_at(Defect::LateStart { seconds }, &late.signal.label, first_valid(&late.signal)));
    }
    if earliest != 0.0 {
        notes.push(format!("the clock starts at {earliest} s; time counts from there"));
    }
    if start - earliest > SNAP / rate_hz {
        notes.push(format!("the first {:.1} ms, which not all channels cover, are left out", 1e3 * (start - earliest)));
    }
    let full = needed.iter().map(|t| t.end(t.spacing.last, rate_hz)).fold(f64::INFINITY, f64::min);
    let cut = needed.iter().filter_map(|t| t.cut().map(|g| (*t, g))).min_by(|a, b| a.1.from.total_cmp(&b.1.from));
    let end = match cut {
        Some((track, gap)) => cut_at(m, track, gap, start, full, rate_hz, notes)?,
        None => full,
    };
    if end - start < SHORTEST_S - SNAP / rate_hz {
        return Err(too_short(m, tracks, (end - start).max(0.0)));
    }
    let longest = needed.iter().map(|t| *t.signal.time.last().unwrap_or(&end)).fold(end, f64::max);
    if cut.is_none() && longest - end > 1.5 / rate_hz {
        let short = needed.iter().min_by(|a, b| a.end(a.spacing.last, rate_hz).total_cmp(&b.end(b.spacing.last, rate_hz)));
        let label = short.map_or("", |t| &t.signal.label);
        notes.push(format!("{label}: no valid sample in the last {:.3} s, which are left out", longest - end));
    }
    Ok((start, end))
}

/// The end in front of a gap, if enough remains there.
fn cut_at(
    m: &Measurement,
    track: &Track,
    gap: Gap,
    start: f64,
    full: f64,
    rate_hz: f64,
    notes: &mut Vec<String>,
) -> Result<f64, RecordingError> {
    let end = track.end(gap.from, rate_hz).min(full);
    let (seconds, kept) = (gap.missing_s(track.spacing.step), (end - start).max(0.0));
    let label = &track.signal.label;
    if kept < SHORTEST_S - SNAP / rate_hz {
        return Err(m.defect_at(Defect::Gap { seconds, kept }, label, Some(gap.sample)));
    }
    notes.push(format!(
        "{label}, {}: a gap of {seconds:.3} s; the recording is cut in front of it, {kept:.3} s remain and {:.3} s are left out",
        m.row_text(gap.sample),
        full - end
    ));
    Ok(end)
}

/// Whether a bench channel covers the span well enough to be used.
pub(crate) fn covers(track: &Track, start: f64, end: f64, notes: &mut Vec<String>) -> bool {
    let slack = EDGE_S.max(track.spacing.step);
    let label = &track.signal.label;
    if track.spacing.first > start + slack || track.spacing.last < end - slack {
        notes.push(format!("{label}: does not cover the whole recording; the channel is not used"));
        return false;
    }
    match track.cut().filter(|g| g.from < end) {
        None => true,
        Some(gap) => {
            let seconds = gap.missing_s(track.spacing.step);
            notes.push(format!("{label}: a gap of {seconds:.3} s at {:.3} s; the channel is not used", gap.from - start));
            false
        }
    }
}

/// Placed where the first of the required channels ends.
fn too_short(m: &Measurement, tracks: &[Track], seconds: f64) -> RecordingError {
    let needed = tracks.iter().filter(|t| t.required() && t.lasting() != Lasting::Slow);
    let first_to_end = needed.min_by(|a, b| a.spacing.last.total_cmp(&b.spacing.last)).map(|t| &t.signal);
    let last = first_to_end.and_then(|s| s.values.iter().rposition(|v| !v.is_nan()));
    m.defect_at(Defect::TooShort { seconds }, first_to_end.map_or("", |s| &s.label), last)
}

fn first_valid(signal: &Signal) -> Option<usize> {
    signal.values.iter().position(|v| !v.is_nan())
}
