//! From a file's channels to a recording: one span, one grid, gaps bridged or cut, and a note of everything that was done.
//!
//! The span starts where every required channel has started; engine and actuator are known to be at rest only at the start,
//! so a late channel can't be mended by dropping the beginning. It ends where a required channel ends, or in front of the
//! first gap that is too long to bridge. A bench channel that does not cover the span is left out of this recording.

use super::Recording;
use super::channel_map::ChannelMap;
use super::channels::{Channel, Lasting};
use super::checks;
use super::clock::{Gap, Spacing, spacing};
use super::error::{Defect, RecordingError};
use super::manifest::Entry;
use super::pick::{Signal, pick};
use super::resample::{Grid, SNAP, resample};
use super::table::Measurement;

/// A channel may start or, on the bench, end this much later or earlier than the others, s.
const EDGE_S: f64 = 0.1;
/// Shortest recording, s.
const SHORTEST_S: f64 = 0.5;
/// Slowest rate of the speeds, Hz.
const SLOWEST_HZ: f64 = 20.0;
/// Rates that the diagnosis works with, Hz.
const RATES_HZ: std::ops::RangeInclusive<f64> = 100.0..=1000.0;
/// Most samples that may be bridged, as a part of all.
const MOST_BRIDGED: f64 = 0.05;

/// Builds the recording; the notes say what was done to it.
pub(crate) fn assemble(mut m: Measurement, map: &ChannelMap, entry: &Entry) -> Result<(Recording, Vec<String>), RecordingError> {
    let mut notes = std::mem::take(&mut m.notes);
    let picked = pick(&mut m, map)?;
    notes.extend(picked.notes);
    for signal in &picked.signals {
        checks::plausible(&m, signal, entry)?;
    }
    let mut tracks = tracks(&m, picked.signals, &mut notes)?;
    let rate_hz = rate(&m, &tracks, entry, &mut notes)?;
    let (start, end) = span(&m, &tracks, rate_hz, &mut notes)?;
    tracks.retain(|t| t.required() || covers(t, start, end, &mut notes));
    let grid = Grid { start, rate_hz, count: ((end - start) * rate_hz + SNAP).floor() as usize + 1 };
    let labels: Vec<(Channel, String)> = tracks.iter().map(|t| (t.signal.channel, t.signal.label.clone())).collect();
    let mut recording = Recording {
        name: entry.name.clone(),
        manoeuvre: entry.manoeuvre.clone(),
        sample_rate_hz: rate_hz,
        theta_c0: entry.theta_c0,
        theta_b0: entry.theta_b0,
        ..Recording::default()
    };
    for track in tracks {
        note_bridges(&m, &track, end, rate_hz, &mut notes)?;
        let channel = track.signal.channel;
        put(&mut recording, channel, on_grid(track, grid, &mut notes));
    }
    let label = |channel| labels.iter().find(|(c, _)| *c == channel).map_or_else(String::new, |(_, l)| l.clone());
    checks::says_something(&m.file, label, &mut recording, &mut notes)?;
    Ok((recording, notes))
}

/// A channel with its spacing.
struct Track {
    signal: Signal,
    spacing: Spacing,
}

impl Track {
    fn required(&self) -> bool {
        self.signal.channel.spec().required
    }

    fn lasting(&self) -> Lasting {
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

fn tracks(m: &Measurement, signals: Vec<Signal>, notes: &mut Vec<String>) -> Result<Vec<Track>, RecordingError> {
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
fn rate(m: &Measurement, tracks: &[Track], entry: &Entry, notes: &mut Vec<String>) -> Result<f64, RecordingError> {
    let speeds = tracks.iter().filter(|t| matches!(t.signal.channel, Channel::OmegaF | Channel::OmegaC));
    let step = speeds.map(|t| t.spacing.step).filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min);
    if !step.is_finite() {
        return Err(m.defect(Defect::TooShort { seconds: 0.0 }));
    }
    let (own, stated) = (1.0 / step, entry.sample_rate_hz);
    let near = |factor: f64| (own * factor / stated - 1.0).abs() < 0.1;
    let hints = [(1e3, "; it looks like ms"), (1e6, "; it looks like µs"), (1e9, "; it looks like ns"), (1.0 / 60.0, "; it looks like min")];
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
fn round(rate: f64) -> f64 {
    let unit = 10f64.powi(rate.log10().floor() as i32 - 5);
    (rate / unit).round() * unit
}

/// First and last time that all required channels cover.
fn span(m: &Measurement, tracks: &[Track], rate_hz: f64, notes: &mut Vec<String>) -> Result<(f64, f64), RecordingError> {
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
        return Err(m.defect(Defect::TooShort { seconds: (end - start).max(0.0) }));
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
        row(m, gap.sample),
        full - end
    ));
    Ok(end)
}

/// Whether a bench channel covers the span well enough to be used.
fn covers(track: &Track, start: f64, end: f64, notes: &mut Vec<String>) -> bool {
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

/// Reports the gaps that a straight line bridges, and refuses a channel that consists of them.
fn note_bridges(m: &Measurement, track: &Track, end: f64, rate_hz: f64, notes: &mut Vec<String>) -> Result<(), RecordingError> {
    let step = track.spacing.step;
    let gaps: Vec<&Gap> = track.spacing.gaps.iter().filter(|g| g.to <= end + SNAP / rate_hz).collect();
    let Some(first) = gaps.first() else { return Ok(()) };
    let missing = |g: &&Gap| (g.missing_s(step) / step).round();
    let (count, longest) = (gaps.iter().map(missing).sum::<f64>(), gaps.iter().map(|g| g.missing_s(step)).fold(0.0, f64::max));
    let part = count / (count + track.spacing.count as f64);
    let label = &track.signal.label;
    if part > MOST_BRIDGED && track.lasting() != Lasting::Slow {
        return Err(m.defect_at(Defect::TooManyGaps { percent: 100.0 * part }, label, Some(first.sample)));
    }
    let (gap_word, sample_word) = (plural(gaps.len(), "gap"), plural(count as usize, "sample"));
    notes.push(format!(
        "{label}: {gap_word} ({sample_word}, the longest {:.0} ms, the first at {}) bridged by a straight line",
        1e3 * longest,
        row(m, first.sample)
    ));
    Ok(())
}

fn plural(count: usize, word: &str) -> String {
    format!("{count} {word}{}", if count == 1 { "" } else { "s" })
}

fn row(m: &Measurement, sample: usize) -> String {
    m.row(sample).map_or_else(String::new, |(word, row)| format!("{word} {row}"))
}

/// The channel on the grid, with a note if it was not there already.
fn on_grid(track: Track, grid: Grid, notes: &mut Vec<String>) -> Vec<f64> {
    let Track { signal, spacing } = track;
    let lasting = signal.channel.spec().lasting;
    let out = resample(&signal.time, &signal.values, lasting, grid);
    let bridged: f64 = spacing.gaps.iter().map(|g| (g.missing_s(spacing.step) * grid.rate_hz).round()).sum();
    let how = match lasting {
        Lasting::Held => "each value kept until the next",
        Lasting::Sensed | Lasting::Slow => "along straight lines",
    };
    let (own, rate) = (if spacing.step > 0.0 { round(1.0 / spacing.step) } else { 0.0 }, grid.rate_hz);
    let label = &signal.label;
    if spacing.step == 0.0 {
        notes.push(format!("{label}: a single sample, taken for all times"));
    } else if out.between as f64 > bridged + 1.0 {
        notes.push(format!("{label}: brought from {own} Hz to the {rate} Hz grid, {how}"));
    } else if spacing.step * rate < 0.9 {
        notes.push(format!("{label}: brought from {own} Hz to the {rate} Hz grid by leaving samples out"));
    }
    out.values
}

fn first_valid(signal: &Signal) -> Option<usize> {
    signal.values.iter().position(|v| !v.is_nan())
}

fn put(recording: &mut Recording, channel: Channel, values: Vec<f64>) {
    match channel {
        Channel::Time => {}
        Channel::OmegaF => recording.omega_f = values,
        Channel::OmegaC => recording.omega_c = values,
        Channel::TE => recording.t_e = values,
        Channel::XToCmd => recording.x_to_cmd = values,
        Channel::ThetaH => recording.theta_h = values,
        Channel::XTo => recording.x_to = Some(values),
        Channel::TFc => recording.t_fc = Some(values),
        Channel::ThetaC => recording.theta_c = Some(values),
    }
}
