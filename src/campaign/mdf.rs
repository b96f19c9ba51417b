//! MDF4 files (ASAM MDF 4.10 and later): one group of channels per rate, each with its own clock.
//!
//! The file is first made plain (see [`super::mdf_blocks`]), then `mf4-rs` decodes records, conversions and invalidation bits;
//! an invalid sample becomes NaN. Files that were not finalised or not sorted are refused: their record counts and clocks
//! can't be trusted. The number of decoded samples is held against the count that the group states.

use std::panic::{AssertUnwindSafe, catch_unwind};

use mf4_rs::api::channel::Channel;
use mf4_rs::api::channel_group::ChannelGroup;
use mf4_rs::api::mdf::MDF;
use mf4_rs::blocks::common::{DataType, read_string_block};
use mf4_rs::error::MdfError;

use super::error::{Defect, RecordingError};
use super::mdf_blocks::{check_descriptions, make_plain};
use super::table::{Group, Measurement, Rows, Series, Wanted};

/// Reads an MDF4 file.
pub(crate) fn read(file: &str, mut bytes: Vec<u8>, wanted: Wanted<'_>) -> Result<Measurement, RecordingError> {
    check_identification(&bytes)
        .and_then(|()| check_descriptions(&bytes))
        .and_then(|()| make_plain(&mut bytes))
        .map_err(|d| d.in_file(file))?;
    // mf4-rs indexes some links of a damaged file without a check; a panic there is a damaged file and nothing else.
    let (groups, names) = catch_unwind(AssertUnwindSafe(|| decode(bytes, wanted)))
        .unwrap_or_else(|_| Err((None, Defect::Damaged("its blocks do not fit together".to_string()))))
        .map_err(|(channel, defect)| match channel {
            Some(channel) => defect.at(file, channel, None),
            None => defect.in_file(file),
        })?;
    Ok(Measurement { file: file.to_string(), groups, names, rows: Rows::Records, notes: Vec::new() })
}

/// The first 64 bytes: what the file is, its version, and whether it was finalised.
fn check_identification(bytes: &[u8]) -> Result<(), Defect> {
    if bytes.len() < 168 {
        return Err(Defect::Damaged(format!("it has {} bytes, fewer than its own header", bytes.len())));
    }
    if bytes.starts_with(b"UnFinMF") || bytes[60..64] != [0; 4] {
        return Err(Defect::Unfinalised);
    }
    let version = String::from_utf8_lossy(&bytes[8..16]).trim_matches(['\0', ' ']).to_string();
    let number = u16::from_le_bytes([bytes[28], bytes[29]]);
    if number < 410 {
        return Err(Defect::OldMdf(version));
    }
    Ok(())
}

type Decoded<T> = Result<T, (Option<String>, Defect)>;

fn decode(bytes: Vec<u8>, wanted: Wanted<'_>) -> Decoded<(Vec<Group>, Vec<String>)> {
    let mdf = MDF::from_bytes(bytes).map_err(|e| (None, damaged(&e)))?;
    let (mut groups, mut names) = (Vec::new(), Vec::new());
    for (index, group) in mdf.channel_groups().iter().enumerate() {
        if let Some(group) = decode_group(index, group, wanted, &mut names)? {
            groups.push(group);
        }
    }
    Ok((groups, names))
}

/// One group, or `None` if nothing in it is wanted.
fn decode_group(index: usize, group: &ChannelGroup<'_>, wanted: Wanted<'_>, names: &mut Vec<String>) -> Decoded<Option<Group>> {
    let metadata = |e: MdfError| (None, damaged(&e));
    let name = group.name().map_err(metadata)?.unwrap_or_default();
    let cycles = group.raw_channel_group().block.cycles_nr as usize;
    // Every record takes a byte at least: a count beyond that would only be asked memory for.
    if cycles > group.mmap().len() {
        return Err((None, Defect::Damaged(format!("a group claims {cycles} records, more than the file has bytes"))));
    }
    let mut out = Group { name, index, ..Group::default() };
    let mut any = false;
    for channel in group.channels() {
        let master = matches!(channel.block().channel_type, 2 | 3);
        let name = channel.name().map_err(metadata)?.unwrap_or_default();
        names.push(name.clone());
        if !master && !wanted(&name) {
            continue;
        }
        any |= !master || wanted(&name);
        // A master that counts an angle or a distance is no clock.
        if master && channel.block().sync_type == 1 {
            out.master = Some(out.series.len());
        }
        out.series.push(decode_channel(&channel, name, cycles, group.mmap())?);
    }
    Ok(any.then_some(out))
}

fn decode_channel(channel: &Channel<'_>, name: String, cycles: usize, file: &[u8]) -> Decoded<Series> {
    let at = |e: MdfError| (Some(name.clone()), damaged(&e));
    let unit = unit(channel, file).map_err(at)?;
    if !is_number(&channel.block().data_type) {
        let text = Some((0, "text".to_string()));
        return Ok(Series { name, unit, values: vec![f64::NAN; cycles], text });
    }
    let values: Vec<f64> = channel.values_as_f64().map_err(at)?;
    if values.len() < cycles {
        let what = format!("{} of {cycles} records are there", values.len());
        return Err((Some(name), Defect::Damaged(what)));
    }
    // An infinite value is no measurement either.
    let mut values: Vec<f64> = values.into_iter().map(|v| if v.is_finite() { v } else { f64::NAN }).collect();
    values.truncate(cycles);
    Ok(Series { name, unit, values, text: None })
}

/// The channel's unit, or that of its conversion, where some tools keep it.
fn unit(channel: &Channel<'_>, file: &[u8]) -> Result<Option<String>, MdfError> {
    let own = channel.unit()?;
    let text = match (own, &channel.block().conversion) {
        (Some(unit), _) => Some(unit),
        (None, Some(conversion)) => read_string_block(file, conversion.cc_md_unit.unwrap_or(0))?,
        (None, None) => None,
    };
    Ok(text.map(|t| plain_text(&t)).filter(|t| !matches!(t.as_str(), "" | "-" | "1")))
}

/// The text inside an XML comment block, or the text itself.
fn plain_text(text: &str) -> String {
    let inner = text.split_once("<TX>").and_then(|(_, rest)| rest.split_once("</TX>")).map(|(inner, _)| inner);
    inner.unwrap_or(text).trim().to_string()
}

fn is_number(kind: &DataType) -> bool {
    use DataType::{FloatBE, FloatLE, SignedIntegerBE, SignedIntegerLE, UnsignedIntegerBE, UnsignedIntegerLE};
    matches!(kind, FloatBE | FloatLE | SignedIntegerBE | SignedIntegerLE | UnsignedIntegerBE | UnsignedIntegerLE)
}

fn damaged(error: &MdfError) -> Defect {
    Defect::Damaged(match error {
        MdfError::TooShortBuffer { .. } => "a block ends beyond the end of the file".to_string(),
        other => other.to_string(),
    })
}
