//! Determines which part of a recording is used.
//!
//! The span starts where every required channel has started. Engine and actuator are known to be at rest only at the start, so that dropping the
//! beginning is no remedy for a channel that starts late. The span ends where one of these channels ends, or in front of the first gap of an input
//! that is too long for the value before it to be held. A sensor may have gaps, in which it has no value.

use super::channels::{Channel, Lasting, Presence};
use super::clock::{Gap, Spacing, spacing};
use super::error::{Defect, RecordingError};
use super::manifest::Entry;
use super::pick::Signal;
use super::rows::SAME_S;
use super::table::Measurement;

/// Longest stretch of missing samples over which an input holds its value, s.
const HOLD_S: f64 = 0.1;
/// Longest time by which a channel may start later than the others, s.
const EDGE_S: f64 = 0.1;
/// Shortest recording, s.
const SHORTEST_S: f64 = 0.5;
/// Lowest rate of the speeds at which an engagement can be followed, Hz.
pub(crate) const SLOWEST_HZ: f64 = 20.0;
/// Largest relative error by which a logger's clock may run slow.
const CLOCK_OFF: f64 = 0.01;
/// Share of the step that may be due to rounding of the clock.
const ROUNDING: f64 = 0.02;

/// A channel with its spacing.
pub(crate) struct Track {
    pub signal: Signal,
    pub spacing: Spacing,
}

impl Track {
    /// How long its values hold.
    pub fn lasting(&self) -> Lasting {
        self.signal.channel.spec().lasting
    }

    /// Whether it bounds the recording, as the inputs and the speeds do.
    fn bounds(&self) -> bool {
        self.lasting() == Lasting::Held || self.signal.channel.spec().presence == Presence::Always
    }

    /// The first gap that is too long for an input to be held.
    fn cut(&self) -> Option<Gap> {
        let long = |g: &&Gap| g.missing_s(self.spacing.step) > HOLD_S + ROUNDING * self.spacing.step + 3.0 * self.spacing.jitter;
        self.spacing.gaps.iter().filter(|_| self.lasting() == Lasting::Held).find(long).copied()
    }

    /// Time until which the sample at `at`, the last one in front of a gap or the end, is valid.
    fn end(&self, at: f64) -> f64 {
        if self.lasting() == Lasting::Held { at + self.spacing.step * (1.0 - ROUNDING) } else { at }
    }
}

/// The spacing of every channel; a required one must have a valid sample.
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

/// Rate of the faster speed's rows, Hz. Refuses a clock that cannot be in its stated unit, and speeds that are too slow to follow an engagement.
pub(crate) fn check_rate(m: &Measurement, tracks: &[Track], entry: &Entry) -> Result<f64, RecordingError> {
    let speeds = tracks.iter().filter(|t| matches!(t.signal.channel, Channel::OmegaF | Channel::OmegaC));
    let step = speeds.map(|t| t.spacing.step).filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min);
    if !step.is_finite() {
        return Err(too_short(m, tracks, 0.0));
    }
    let own = 1.0 / step;
    if let Some(stated) = entry.sample_rate_hz {
        let near = |factor: f64| is_near(own * factor, stated);
        let hints =
            [(1e3, "; it looks like ms"), (1e6, "; it looks like µs"), (1e9, "; it looks like ns"), (1.0 / 60.0, "; it looks like min")];
        if let Some((_, hint)) = hints.iter().find(|(factor, _)| near(*factor)) {
            return Err(m.defect(Defect::ClockUnit { rate_hz: own, stated_hz: stated, hint }));
        }
    }
    if is_slow(step) { Err(m.defect(Defect::TooSlow(own))) } else { Ok(own) }
}

/// Whether a rate agrees with the stated one, as far as clocks are exact.
fn is_near(rate: f64, stated: f64) -> bool {
    (rate / stated - 1.0).abs() < 0.1
}

/// A note if the stated rate is neither that of the rows nor that of the samples, which may be fewer.
pub(crate) fn rate_note(entry: &Entry, [rows_hz, samples_hz]: [f64; 2]) -> Option<String> {
    let stated = entry.sample_rate_hz.filter(|stated| !is_near(rows_hz, *stated) && !is_near(samples_hz, *stated))?;
    Some(format!("recordings.json says {stated} Hz, the speeds come at {} Hz; their clock is believed", round(samples_hz)))
}

/// Whether samples this far apart, s, are too slow to follow an engagement, allowing for inexact clocks.
pub(crate) fn is_slow(step: f64) -> bool {
    step * SLOWEST_HZ > 1.0 + CLOCK_OFF
}

/// Rounds a rate to six digits: a clock with rounded times does not determine it any better.
pub(crate) fn round(rate: f64) -> f64 {
    let unit = 10f64.powi(rate.log10().floor() as i32 - 5);
    (rate / unit).round() * unit
}

/// First and last time that all required channels cover.
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

/// The end of the span in front of a gap, if enough of the recording remains.
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

/// The error for a recording that is too short, placed where the first of the required channels ends.
fn too_short(m: &Measurement, tracks: &[Track], seconds: f64) -> RecordingError {
    let first_to_end = tracks.iter().filter(|t| t.bounds()).min_by(|a, b| a.spacing.last.total_cmp(&b.spacing.last)).map(|t| &t.signal);
    let last = first_to_end.and_then(|s| s.values.iter().rposition(|v| !v.is_nan()));
    m.defect_at(Defect::TooShort { seconds }, first_to_end.map_or("", |s| &s.label), last)
}

fn first_valid(signal: &Signal) -> Option<usize> {
    signal.values.iter().position(|v| !v.is_nan())
}

#[cfg(test)]
mod tests {
    use super::super::channels::Channel::{OmegaC, OmegaF, TE, TFc, ThetaH, XToCmd};
    use super::*;
    use std::rc::Rc;

    /// A channel with samples at these times.
    fn at(channel: Channel, time: Vec<f64>) -> Signal {
        let values = vec![1.0; time.len()];
        Signal { channel, label: channel.spec().column.into(), time: Rc::new(time), values }
    }

    /// `count` samples of a channel with this step, from a given time on.
    fn every(channel: Channel, from: f64, step: f64, count: usize) -> Signal {
        at(channel, (0..count).map(|k| from + step * k as f64).collect())
    }

    /// The span of these channels, or why there is none, and the notes.
    fn spanned(signals: Vec<Signal>) -> (Result<(f64, f64), String>, Vec<String>) {
        let (m, mut notes) = (Measurement::default(), Vec::new());
        let found = tracks(&m, signals, &mut notes).and_then(|tracks| span(&m, &tracks, &mut notes));
        (found.map_err(|e| e.to_string()), notes)
    }

    fn rated(step: f64, stated: Option<f64>) -> (String, Vec<String>) {
        let (m, mut notes) = (Measurement::default(), Vec::new());
        let tracks = tracks(&m, vec![every(OmegaF, 0.0, step, 50), every(OmegaC, 0.0, 2.0 * step, 25)], &mut notes).unwrap();
        let entry = Entry { sample_rate_hz: stated, ..Entry::default() };
        let said = check_rate(&m, &tracks, &entry);
        notes.extend(said.iter().filter_map(|rows_hz| rate_note(&entry, [*rows_hz; 2])));
        (said.err().map(|e| e.to_string()).unwrap_or_default(), notes)
    }

    #[test]
    fn a_clock_is_compared_with_the_rate_that_is_stated() {
        for (step, stated, error, note) in [
            (0.01, None, "", ""),
            (0.01, Some(100.0), "", ""),
            (1.0 / 109.0, Some(100.0), "", ""),
            (1.0 / 91.0, Some(100.0), "", ""),
            (1.0 / 112.0, Some(100.0), "", "says 100 Hz, the speeds come at 112 Hz"),
            (1.0 / 88.0, Some(100.0), "", "says 100 Hz, the speeds come at 88 Hz"),
            (
                10.0,
                Some(100.0),
                "ticks at 0.1000 Hz where recordings.json says 100 Hz. Check the unit of the time channel; it looks like ms",
                "",
            ),
            (1e4, Some(100.0), "it looks like µs", ""),
            (1e7, Some(100.0), "it looks like ns", ""),
            (0.01 / 60.0, Some(100.0), "it looks like min", ""),
            (0.049, None, "", ""),
            (0.051, None, "below 20 Hz", ""),
            (0.0504, None, "", ""),
        ] {
            let (said, notes) = rated(step, stated);
            assert!(said.contains(error) && said.is_empty() == error.is_empty(), "{step}: {said}");
            assert!(notes.join("").contains(note) && notes.is_empty() == note.is_empty(), "{step}: {notes:?}");
        }
        let m = Measurement::default();
        let one = tracks(&m, vec![every(OmegaF, 0.0, 1.0, 1)], &mut Vec::new()).unwrap();
        assert!(check_rate(&m, &one, &Entry::default()).unwrap_err().to_string().contains("ends here, 0.000 s"));
        assert_eq!([round(99.999_96), round(1_234_567.0), round(0.012_345_678)], [100.0, 1_234_570.0, 0.012_345_7]);
    }

    #[test]
    fn it_begins_where_all_that_is_needed_has_begun() {
        let late = |by: f64| spanned(vec![every(OmegaF, 3.0, 0.01, 200), every(OmegaC, 3.0 + by, 0.01, 200), every(ThetaH, 9.0, 1.0, 2)]);
        let (found, notes) = late(0.0);
        assert!((found.unwrap().0 - 3.0).abs() < 1e-12 && notes == ["the clock starts at 3 s; time counts from there"], "{notes:?}");
        let (found, notes) = late(0.09);
        assert!((found.unwrap().0 - 3.09).abs() < 1e-12 && notes[1].contains("the first 90.0 ms"), "{notes:?}");
        assert!(late(0.11).0.unwrap_err().contains("channel omega_c_rad_s, row 1: starts 0.110 s after"));
    }

    #[test]
    fn it_ends_where_something_that_is_needed_ends() {
        // An input is valid for nearly a step beyond its last sample, a sensor only up to it; a bench channel does not bound the span.
        let (speeds, short) = (|count| every(OmegaF, 0.0, 0.01, count), |count| every(TE, 0.0, 0.1, count));
        let (found, notes) = spanned(vec![speeds(301), short(21), every(TFc, 0.0, 0.01, 60)]);
        assert!((found.unwrap().1 - 2.098).abs() < 1e-9);
        assert!(notes.len() == 1 && notes[0].starts_with("T_e_Nm: no valid sample in the last 0.902 s"), "{notes:?}");
        let (found, notes) = spanned(vec![speeds(201), short(21)]);
        assert!((found.unwrap().1 - 2.0).abs() < 1e-9 && notes.is_empty(), "{notes:?}");
        // Half a second is enough.
        assert!(spanned(vec![speeds(51), short(10)]).0.is_ok());
        let refused = spanned(vec![speeds(50), short(10)]).0.unwrap_err();
        assert!(refused.contains("channel omega_f_rad_s, row 50: the recording ends here, 0.490 s after"), "{refused}");
    }

    #[test]
    fn an_input_is_held_for_a_tenth_of_a_second_and_no_longer() {
        let without = |channel: Channel, lost: std::ops::Range<usize>| {
            at(channel, (0..300).filter(|k| !lost.contains(k)).map(|k| 0.01 * k as f64).collect())
        };
        let with = |input: Signal| spanned(vec![every(OmegaF, 0.0, 0.01, 300), input]);
        for channel in [TE, XToCmd] {
            let (found, notes) = with(without(channel, 100..110));
            assert!((found.unwrap().1 - 2.99).abs() < 1e-9 && notes.is_empty(), "{notes:?}");
            let (found, notes) = with(without(channel, 100..112));
            assert!((found.unwrap().1 - 0.99).abs() < 1e-9, "{notes:?}");
            assert!(
                notes[0].contains(", row 101: a gap of 0.120 s") && notes[0].contains("0.990 s remain and 2.000 s are left out"),
                "{notes:?}"
            );
        }
        assert_eq!(with(without(OmegaC, 100..200)).0.map(|s| (100.0 * s.1).round()), Ok(299.0));
        // The first of two gaps counts, and it may come too early for a usable recording.
        let refused = with(without(TE, 40..60)).0.unwrap_err();
        assert!(
            refused.contains("row 41: the samples are missing") && refused.contains("0.200 s from here on; 0.390 s remain"),
            "{refused}"
        );
        let early = spanned(vec![every(OmegaF, 0.0, 0.01, 300), without(XToCmd, 200..250), without(TE, 100..150)]);
        assert!((early.0.unwrap().1 - 0.99).abs() < 1e-9 && early.1[0].starts_with("T_e_Nm, "), "{:?}", early.1);
    }

    #[test]
    fn a_channel_without_a_valid_sample_is_needed_or_left_out() {
        let nothing = |channel| Signal { values: vec![f64::NAN; 100], ..every(channel, 0.0, 0.01, 100) };
        assert!(
            spanned(vec![every(OmegaF, 0.0, 0.01, 100), nothing(OmegaC)]).0.unwrap_err().contains("omega_c_rad_s: not one valid sample")
        );
        let (found, notes) = spanned(vec![every(OmegaF, 0.0, 0.01, 100), nothing(TFc)]);
        assert!(found.is_ok() && notes.iter().any(|n| n.contains("T_fc_Nm")), "{notes:?}");
    }
}
