//! MDF4 files (ASAM MDF 4): one group of channels per rate, each with its own clock; or frames of a CAN bus with a database (DBC).
//!
//! `falcon_mdf` decodes every layout of the records, including unsorted files and files that a recorder did not finalise. An invalid sample becomes
//! NaN. A conversion to text is read as numbers: a sample with a name ("SNA") is missing, the others go through the conversion's own scale; if all
//! values of a channel have names, as those of a gear, the raw numbers are taken.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use falcon_mdf::{CanDatabase, Channel, ChannelGroup, Conversion, Mf4Error, Mf4File, Signal, SignalValues};

use super::error::{Defect, RecordingError};
use super::limits::FILE_ROWS;
use super::table::{Group, Measurement, Rows, Series, Tell, Wanted};

/// Reads an MDF4 file; `file` is its name in messages.
pub(crate) fn read(file: &str, path: &Path, dbc: Option<&Path>, wanted: Wanted<'_>, tell: Tell<'_>) -> Result<Measurement, RecordingError> {
    // The library promises errors instead of panics on a damaged file; should it panic nevertheless, the file is damaged.
    let mut m = catch_unwind(AssertUnwindSafe(|| decode(path, dbc, wanted, tell)))
        .unwrap_or_else(|_| Err((None, Defect::Damaged("its blocks do not fit together".to_string()))))
        .map_err(|(channel, defect)| match channel {
            Some(channel) => defect.at(file, channel, None),
            None => defect.in_file(file),
        })?;
    m.file = file.to_string();
    Ok(m)
}

/// A result whose error may belong to a channel.
type Decoded<T> = Result<T, (Option<String>, Defect)>;

fn decode(path: &Path, dbc: Option<&Path>, wanted: Wanted<'_>, tell: Tell<'_>) -> Decoded<Measurement> {
    let file = open(path).map_err(|e| (None, defect(e)))?;
    let mut m = Measurement { rows: Rows::Records, ..Measurement::default() };
    if file.unfinalized().is_some() {
        m.notes.push("the recorder did not finalise the file: it is read up to the last whole record".to_string());
    }
    let groups = file.data_groups().iter().flat_map(|d| &d.channel_groups).filter(|g| !g.is_vlsd());
    let all = groups.clone().count();
    for (index, group) in groups.enumerate() {
        tell(index as f64 / all as f64);
        if let Some(group) = decode_group(&file, index, group, wanted, &mut m.names, &mut m.notes)? {
            m.groups.push(group);
        }
    }
    let frames = !file.can_frame_groups().is_empty();
    match dbc {
        Some(dbc) if frames => decode_frames(&file, dbc, wanted, &mut m)?,
        None if frames && m.groups.is_empty() => return Err((None, Defect::RawFrames("CAN frames in MDF4"))),
        _ => {}
    }
    Ok(m)
}

/// Opens a file. Version 4.30 or later is read as 4.20: blocks that the library does not know are refused one by one, but the version alone is no reason to refuse a file.
fn open(path: &Path) -> Result<Mf4File, Mf4Error> {
    match Mf4File::open_buffered(path) {
        Err(Mf4Error::UnsupportedVersion { major: 4, minor: 30.. }) => {
            let mut bytes = std::fs::read(path)?;
            bytes[28..30].copy_from_slice(&420_u16.to_le_bytes());
            Mf4File::from_bytes(bytes)
        }
        other => other,
    }
}

/// One group, or `None` if nothing in it is wanted.
fn decode_group(
    file: &Mf4File,
    index: usize,
    group: &ChannelGroup,
    wanted: Wanted<'_>,
    names: &mut Vec<String>,
    notes: &mut Vec<String>,
) -> Decoded<Option<Group>> {
    let name = if group.acquisition_name.is_empty() { &group.comment } else { &group.acquisition_name };
    let mut out = Group { name: plain_text(name), index, ..Group::default() };
    // Bus frames are not signals; see `decode_frames`.
    if group.is_bus_event() {
        return Ok(None);
    }
    if group.sample_count > FILE_ROWS && group.channels.iter().any(|c| wanted(&c.name)) {
        return Err((None, Defect::TooManyRows(FILE_ROWS)));
    }
    let mut any = false;
    for channel in &group.channels {
        names.push(channel.name.clone());
        let (master, named) = (channel.is_master(), wanted(&channel.name));
        if !master && !named {
            continue;
        }
        any |= named;
        // A master channel that counts an angle or a distance is not a clock.
        if channel.is_time_channel() && master {
            out.master = Some(out.series.len());
        }
        out.series.push(decode_channel(file, channel, notes)?);
    }
    Ok(any.then_some(out))
}

fn decode_channel(file: &Mf4File, channel: &Channel, notes: &mut Vec<String>) -> Decoded<Series> {
    let at = |e: Mf4Error| (Some(channel.name.clone()), defect(e));
    let unit = unit(file, channel).map_err(at)?.filter(|t| !matches!(t.as_str(), "" | "-" | "1"));
    let signal = file.signal(channel).map_err(at)?;
    let mut series = Series { name: channel.name.clone(), unit, ..Series::default() };
    series.values = match &channel.conversion {
        Conversion::ValueToText { .. } | Conversion::RangeToText { .. } => beside_text(&signal, channel, notes).map_err(at)?,
        _ => match signal.values().map_err(at)? {
            SignalValues::F64(values) => values,
            SignalValues::Str(texts) => {
                series.text = texts.first().map(|t| (0, t.clone()));
                vec![f64::NAN; texts.len()]
            }
            other => {
                let values = other.to_f64();
                // Bytes, arrays and dates are not series of numbers.
                if values.len() == other.len() && values.iter().any(|v| !v.is_nan()) { values } else { vec![f64::NAN; other.len()] }
            }
        },
    };
    if let Some(valid) = signal.validity() {
        series.values.iter_mut().zip(valid).filter(|(_, valid)| !valid).for_each(|(v, _)| *v = f64::NAN);
    }
    // An infinite value is no measurement either.
    series.values.iter_mut().filter(|v| v.is_infinite()).for_each(|v| *v = f64::NAN);
    Ok(series)
}

/// Indices of links in their blocks: a channel's conversion and unit, a conversion's unit.
const CN_CONVERSION: u64 = 4;
const CN_UNIT: u64 = 6;
const CC_UNIT: u64 = 1;

/// Bytes in front of a block's links: identifier, length, number of links.
const BLOCK_HEAD: u64 = 24;

/// Longest unit text that is read, bytes.
const UNIT_BYTES: u64 = 4096;

/// Unit of a channel: its own or, if it links to none, that of its conversion, which `falcon_mdf` does not read.
fn unit(file: &Mf4File, channel: &Channel) -> Result<Option<String>, Mf4Error> {
    let block = channel.block_offset();
    if link(file, block, CN_UNIT)? != 0 {
        return Ok(Some(plain_text(&channel.unit)));
    }
    let conversion = link(file, block, CN_CONVERSION)?;
    let at = if conversion == 0 { 0 } else { link(file, conversion, CC_UNIT)? };
    if at == 0 {
        return Ok(None);
    }
    let length = word(file, at.saturating_add(8))?.saturating_sub(BLOCK_HEAD).min(UNIT_BYTES);
    let bytes = file.read_raw(at.saturating_add(BLOCK_HEAD), length as usize)?;
    let text = bytes.split(|b| *b == 0).next().unwrap_or_default();
    Ok(Some(plain_text(&String::from_utf8_lossy(text))))
}

/// Link number `k` of a block; 0 if the block has no such link.
fn link(file: &Mf4File, block: u64, k: u64) -> Result<u64, Mf4Error> {
    if k < word(file, block.saturating_add(16))? { word(file, block.saturating_add(BLOCK_HEAD + 8 * k)) } else { Ok(0) }
}

fn word(file: &Mf4File, at: u64) -> Result<u64, Mf4Error> {
    Ok(file.read_raw(at, 8)?.first_chunk().map_or(0, |b| u64::from_le_bytes(*b)))
}

/// The numbers of a channel whose conversion gives names to some of its values.
fn beside_text(signal: &Signal, channel: &Channel, notes: &mut Vec<String>) -> Result<Vec<f64>, Mf4Error> {
    let raw = signal.raw_values()?.to_f64();
    let number = |raw: f64| match &channel.conversion {
        // If the conversion has no rule for other values, they keep their raw number.
        Conversion::ValueToText { keys, default: None, .. } if !keys.contains(&raw) => raw,
        conversion => conversion.convert(raw, channel.is_float()),
    };
    let values: Vec<f64> = raw.iter().map(|&raw| number(raw)).collect();
    let named = values.iter().filter(|v| v.is_nan()).count();
    if named == values.len() {
        notes.push(format!("{}: all values are names; the numbers behind them are taken", channel.name));
        return Ok(raw);
    }
    if let Some(at) = values.iter().position(|v| v.is_nan()) {
        let text = channel.conversion.convert_text(raw[at], channel.is_float()).unwrap_or_default();
        notes.push(format!("{}: {named} samples are a text and no number (the first is \"{text}\"), left out", channel.name));
    }
    Ok(values)
}

/// Adds the signals that a database decodes from the frames, each as a group with a clock of its own.
fn decode_frames(file: &Mf4File, dbc: &Path, wanted: Wanted<'_>, m: &mut Measurement) -> Decoded<()> {
    let database =
        CanDatabase::from_dbc_path(dbc).map_err(|e| (None, Defect::Database { dbc: dbc.display().to_string(), why: e.to_string() }))?;
    let signals = file.decode_bus(&database).map_err(|e| (None, defect(e)))?;
    for (k, signal) in signals.iter().enumerate() {
        m.names.push(signal.name.to_string());
        if !wanted(signal.name) {
            continue;
        }
        let unit = Some(signal.unit.trim().to_string()).filter(|t| !matches!(t.as_str(), "" | "-" | "1"));
        let time = Series { name: "time".to_string(), unit: Some("s".to_string()), values: signal.timestamps.clone(), text: None };
        let labelled = (0..signal.len()).map(|i| signal.text_at(i).is_some()).collect::<Vec<bool>>();
        let some = labelled.iter().any(|l| !l);
        let value = |(v, named): (&f64, &bool)| if *named && some { f64::NAN } else { *v };
        let values = signal.values.iter().zip(&labelled).map(value).collect();
        let series = Series { name: signal.name.to_string(), unit, values, text: None };
        m.groups.push(Group { name: signal.message.to_string(), index: k, master: Some(0), series: vec![time, series] });
    }
    Ok(())
}

/// The text inside an XML comment block, or the text itself.
fn plain_text(text: &str) -> String {
    let inner = text.split_once("<TX>").and_then(|(_, rest)| rest.split_once("</TX>")).map(|(inner, _)| inner);
    inner.unwrap_or(text).trim().to_string()
}

fn defect(error: Mf4Error) -> Defect {
    match error {
        Mf4Error::Io(e) => Defect::Unreadable(e.to_string()),
        Mf4Error::UnsupportedVersion { major, minor } => Defect::OldMdf(format!("{major}.{minor:02}")),
        Mf4Error::Unsupported { .. } => Defect::Unsupported(error.to_string()),
        _ => Defect::Damaged(error.to_string()),
    }
}
