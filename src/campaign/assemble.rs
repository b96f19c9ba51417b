//! Builds a recording from the channels of a file: one common span of time, every channel at its own stamps, and a note of everything that was done.

use super::channel_map::ChannelMap;
use super::channels::{Channel, Lasting};
use super::checks;
use super::clock::{Gap, middle};
use super::doubt;
use super::error::{Defect, RecordingError};
use super::manifest::Entry;
use super::pick::{Signal, pick};
use super::raster::samples_alone;
use super::repeats::Repeats;
use super::rows::{SAME_S, held, own_rows, rows, sensed};
use super::span::{Track, check_rate, rate_note, round, span, tracks};
use super::table::Measurement;
use super::{NO_BRAKE, NO_POSITION, Recording};

/// Temperature of the housing air if nothing states it, °C.
const DEFAULT_AIR_DEGC: f64 = 20.0;

/// Standard deviation of start temperatures that are not given, K: the car may have stood all night or may just have climbed a hill.
const UNKNOWN_K: f64 = 40.0;

/// A recording, and what was found while reading it.
pub(super) struct Assembled {
    pub(super) recording: Recording,
    /// What was done to the recording, for its user.
    pub(super) notes: Vec<String>,
    /// Counts of rows in which its speeds repeat the sample before.
    pub(super) repeats: Repeats,
    /// Defect of a recording whose engine torque never changes. It applies only if the torque does not change in any other recording either.
    pub(super) still_torque: Option<RecordingError>,
}

/// Builds the recording. `all` holds the repeated rows counted in the speeds of all recordings of a campaign, once these have been read.
pub(super) fn assemble(mut m: Measurement, map: &ChannelMap, entry: &Entry, all: Option<&Repeats>) -> Result<Assembled, RecordingError> {
    let mut notes = std::mem::take(&mut m.notes);
    let picked = pick(&mut m, map)?;
    notes.extend(picked.notes);
    let mut signals = picked.signals;
    within_window(&m, &mut signals, entry)?;
    set_aside(&mut signals, &mut notes);
    notes.extend(signals.iter_mut().filter_map(|s| doubt::faults(&m, s)));
    let mut tracks = tracks(&m, signals, &mut notes)?;
    let clock_hz = check_rate(&m, &tracks, entry)?;
    let (start, end) = span(&m, &tracks, &mut notes)?;
    // Units are checked after the clock: a recording of three samples is refused because it is too short, not because of a wrong unit.
    for track in &tracks {
        checks::plausible(&m, &track.signal, map, entry)?;
    }
    let (repeats, left_out) = samples_alone(&mut tracks, all);
    notes.extend(left_out);
    // A sensor's dead band does not bound the recording: the speed is unknown there, but the recording goes on.
    notes.extend(tracks.iter_mut().filter_map(|t| below_threshold(&mut t.signal)));
    let mut time = rows(tracks.iter().map(|t| &t.signal).filter(|s| s.channel != Channel::ThetaH), start, end);
    note_gaps(&m, &tracks, end, &mut notes);
    let labels: Vec<(Channel, String)> = tracks.iter().map(|t| (t.signal.channel, t.signal.label.clone())).collect();
    let mut recording = Recording { name: entry.name.clone(), manoeuvre: entry.manoeuvre.clone(), ..Recording::default() };
    for Track { signal, .. } in tracks {
        let channel = signal.channel;
        if let Some(k) = [Channel::TE, Channel::XToCmd].iter().position(|c| *c == channel) {
            recording.input_rows[k] = own_rows(&signal, &time);
        }
        let values = if channel.spec().lasting == Lasting::Sensed { sensed(signal, &time) } else { held(&signal, &time) };
        put(&mut recording, channel, values);
    }
    time.iter_mut().for_each(|t| *t = (*t - start).max(0.0));
    recording.sample_rate_hz = rate(&time, [&recording.omega_f, &recording.omega_c]);
    notes.extend(rate_note(entry, [clock_hz, recording.sample_rate_hz]));
    recording.time = time;
    temperatures(&mut recording, entry, &mut notes);
    if recording.x_to_cmd.is_empty() {
        notes.push(NO_POSITION.to_owned());
    }
    if recording.manoeuvre == "drive" && recording.brake.is_none() {
        notes.push(NO_BRAKE.to_owned());
    }
    let label = |channel| labels.iter().find(|(c, _)| *c == channel).map_or_else(String::new, |(_, l)| l.clone());
    checks::check_information(&m.file, label, &mut recording, &mut notes)?;
    // A torque that the channel map gives as a constant is meant to be constant.
    let still = checks::constant(&recording.t_e).filter(|_| map.get(Channel::TE).is_none_or(|mapped| mapped.value.is_none()));
    let still_torque = still.map(|value| Defect::StillTorque { value }.at(&m.file, label(Channel::TE), None));
    Ok(Assembled { recording, notes, repeats, still_torque })
}

/// Nominal rate of the faster of two speeds with these rows, Hz: the inverse of the median step between its samples; 0 if neither has two samples.
fn rate(time: &[f64], speeds: [&[f64]; 2]) -> f64 {
    let step = |speed: &[f64]| {
        let own: Vec<f64> = time.iter().zip(speed).filter(|(_, v)| v.is_finite()).map(|(t, _)| *t).collect();
        let mut steps: Vec<f64> = own.windows(2).map(|w| w[1] - w[0]).collect();
        if steps.is_empty() { f64::INFINITY } else { middle(&mut steps) }
    };
    let step = speeds.map(step).into_iter().fold(f64::INFINITY, f64::min);
    if step.is_finite() { round(1.0 / step) } else { 0.0 }
}

/// Sets the samples outside the recording's window to NaN, except those of slow channels.
fn within_window(m: &Measurement, signals: &mut [Signal], entry: &Entry) -> Result<(), RecordingError> {
    let Some([from, to]) = entry.window else { return Ok(()) };
    let ends = signals.iter().filter_map(|s| Some((*s.time.first()?, *s.time.last()?)));
    let (first, last) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), (f, l)| (a.min(f), b.max(l)));
    if from > last || to < first {
        return Err(m.defect(Defect::EmptyWindow { from, to, first, last }));
    }
    for signal in signals.iter_mut().filter(|s| s.channel.spec().lasting != Lasting::Slow) {
        let outside = signal.time.iter().zip(&mut signal.values).filter(|(t, _)| **t < from - SAME_S || **t > to + SAME_S);
        outside.for_each(|(_, v)| *v = f64::NAN);
    }
    Ok(())
}

/// Sets the samples that the channel `valid` marks as invalid to NaN, and removes that channel.
fn set_aside(signals: &mut Vec<Signal>, notes: &mut Vec<String>) {
    let Some(at) = signals.iter().position(|s| s.channel == Channel::Valid) else { return };
    let mark = signals.remove(at);
    let mut most = 0;
    for signal in signals.iter_mut() {
        let believed = held(&mark, &signal.time);
        let doubted = signal.values.iter_mut().zip(believed).filter(|(v, b)| *b < 0.5 && !v.is_nan());
        most = most.max(doubted.map(|(v, _)| *v = f64::NAN).count());
    }
    if most > 0 {
        notes.push(format!("{}: {} marked as not to be believed and left out", mark.label, plural(most, "sample")));
    }
}

/// Sets the zeros of a speed sensor that reads nothing below its threshold to NaN. Returns a note if there are any.
fn below_threshold(signal: &mut Signal) -> Option<String> {
    let speed = matches!(signal.channel, Channel::OmegaF | Channel::OmegaC);
    let (threshold, zeros) = doubt::dead_band(&signal.time, &signal.values, doubt::SURE).filter(|_| speed)?;
    zeros.iter().for_each(|&i| signal.values[i] = f64::NAN);
    let (label, count) = (&signal.label, plural(zeros.len(), "zero"));
    Some(format!("{label}: the sensor reads 0 below {threshold:.3} rad/s; what it does there is not known ({count} left out)"))
}

/// Notes the gaps, in which sensors have no value and inputs hold their last one. Channels with the same gaps share one note.
fn note_gaps(m: &Measurement, tracks: &[Track], end: f64, notes: &mut Vec<String>) {
    let mut said: Vec<(String, Vec<&str>)> = Vec::new();
    for track in tracks.iter().filter(|t| t.lasting() != Lasting::Slow) {
        let Some(text) = gaps_text(m, track, end) else { continue };
        match said.iter_mut().find(|(t, _)| *t == text) {
            Some((_, labels)) => labels.push(&track.signal.label),
            None => said.push((text, vec![&track.signal.label])),
        }
    }
    notes.extend(said.into_iter().map(|(text, labels)| format!("{}: {text}", labels.join(", "))));
}

fn gaps_text(m: &Measurement, track: &Track, end: f64) -> Option<String> {
    let step = track.spacing.step;
    let gaps: Vec<&Gap> = track.spacing.gaps.iter().filter(|g| g.to <= end + SAME_S).collect();
    let first = gaps.first()?;
    let count: f64 = gaps.iter().map(|g| (g.missing_s(step) / step).round().max(1.0)).sum();
    let longest = gaps.iter().map(|g| g.missing_s(step)).fold(0.0, f64::max);
    let (gap_word, sample_word) = (plural(gaps.len(), "gap"), plural(count as usize, "sample"));
    let (at, ms) = (m.row_text(first.sample), 1e3 * longest);
    let outcome = if track.lasting() == Lasting::Held { "the value before is held" } else { "no value is put there" };
    Some(format!("{gap_word} ({sample_word}, the longest {ms:.0} ms, the first at {at}); {outcome}"))
}

fn plural(count: usize, word: &str) -> String {
    format!("{count} {word}{}", if count == 1 { "" } else { "s" })
}

/// Sets the start temperatures, to that of the housing air if none are given, and a constant housing air temperature where it was not recorded.
fn temperatures(recording: &mut Recording, entry: &Entry, notes: &mut Vec<String>) {
    if recording.theta_h.is_empty() {
        let (air, from) = match entry.theta_0 {
            Some([_, body]) => (body, "as warm as the body at the start"),
            None => (DEFAULT_AIR_DEGC, "nothing says how warm it is"),
        };
        notes.push(format!("theta_h_degC: not recorded; {air} °C is taken throughout: {from}"));
        recording.theta_h = vec![air; recording.time.len()];
    }
    let air = recording.theta_h.first().copied().unwrap_or(DEFAULT_AIR_DEGC);
    let sigma = entry.theta_0_sigma;
    if entry.theta_0.is_none() {
        notes.push(format!("no temperatures at the start are given: {air} °C is taken, the housing air's, give or take {UNKNOWN_K} K"));
    }
    if let Some([disc, body]) = entry.theta_0 {
        let kelvin = |value: f64, other: f64| (value - other - 273.15).abs() < 20.0;
        for (key, value, others) in [("theta_c0_degC", disc, [air, body]), ("theta_b0_degC", body, [air, air])] {
            let around = others.into_iter().find(|other| kelvin(value, *other));
            notes.extend(around.map(|other| {
                let (above, celsius) = (value - other, value - 273.15);
                format!("{key} = {value} is {above:.0} K above the {other} °C around it: it looks like kelvin; if it is, write {celsius:.2} into recordings.json")
            }));
        }
    }
    [recording.theta_c0, recording.theta_b0] = entry.theta_0.unwrap_or([air; 2]);
    recording.theta_0_sigma = if entry.theta_0.is_some() { sigma } else { [UNKNOWN_K; 2] };
}

fn put(recording: &mut Recording, channel: Channel, values: Vec<f64>) {
    match channel {
        Channel::Time | Channel::Valid => {}
        Channel::OmegaF => recording.omega_f = values,
        Channel::OmegaC => recording.omega_c = values,
        Channel::TE => recording.t_e = values,
        Channel::XToCmd => recording.x_to_cmd = values,
        Channel::ThetaH => recording.theta_h = values,
        Channel::XTo => recording.x_to = Some(values),
        Channel::TFc => recording.t_fc = Some(values),
        Channel::ThetaC => recording.theta_c = Some(values),
        Channel::Brake => recording.brake = Some(values.into_iter().map(|v| v > 0.5).collect()),
    }
}
