//! From a file's channels to a recording: one span, one grid, gaps bridged or cut, and a note of everything that was done.

use super::Recording;
use super::channel_map::ChannelMap;
use super::channels::{Channel, Lasting};
use super::checks;
use super::clock::Gap;
use super::error::{Defect, RecordingError};
use super::manifest::Entry;
use super::pick::pick;
use super::resample::{Grid, SNAP, resample};
use super::span::{Track, covers, rate, round, span, tracks};
use super::table::Measurement;

/// Most samples that may be bridged, as a part of all.
const MOST_BRIDGED: f64 = 0.05;

/// Builds the recording; the notes say what was done to it.
pub(crate) fn assemble(mut m: Measurement, map: &ChannelMap, entry: &Entry) -> Result<(Recording, Vec<String>), RecordingError> {
    let mut notes = std::mem::take(&mut m.notes);
    let picked = pick(&mut m, map)?;
    notes.extend(picked.notes);
    let mut tracks = tracks(&m, picked.signals, &mut notes)?;
    let rate_hz = rate(&m, &tracks, entry, &mut notes)?;
    let (start, end) = span(&m, &tracks, rate_hz, &mut notes)?;
    // After the clock: three samples are too short to be called a wrong unit.
    for track in &tracks {
        checks::plausible(&m, &track.signal, entry)?;
    }
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
        m.row_text(first.sample)
    ));
    Ok(())
}

fn plural(count: usize, word: &str) -> String {
    format!("{count} {word}{}", if count == 1 { "" } else { "s" })
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
