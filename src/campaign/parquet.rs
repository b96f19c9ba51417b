//! Parquet files: one row per sample, one column per channel.
//!
//! Plain columns are read without the arrow stack. A null is a missing sample. A column of time stamps counts from its first
//! value. Units stand in brackets in the column name, or in the file's metadata as a JSON object of column to unit: under the
//! key `units` (pyarrow's `with_metadata`) or in `units` of pandas' `DataFrame.attrs`.

use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};

use ::parquet::basic::{ConvertedType, LogicalType, TimeUnit};
use ::parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use ::parquet::data_type::DataType;
use ::parquet::errors::ParquetError;
use ::parquet::file::metadata::ColumnChunkMetaData;
use ::parquet::file::reader::{FileReader, SerializedFileReader};
use ::parquet::schema::types::ColumnDescriptor;
use bytes::Bytes;

use super::error::{Defect, RecordingError};
use super::table::{Group, Measurement, Rows, Series, Wanted};
use super::{thrift, units};

/// Rows of a file, at most: a day at a kilohertz. A count above it is damage, for a few bytes may claim any number of equal values.
const MOST_ROWS: usize = 1 << 27;

const ENDLESS: &str = "a count in it is larger than the file";

/// Reads a Parquet file.
pub(crate) fn read(file: &str, bytes: Vec<u8>, wanted: Wanted<'_>) -> Result<Measurement, RecordingError> {
    // The library beneath takes some promises of a damaged file for granted; a panic there is a damaged file and nothing else.
    catch_unwind(AssertUnwindSafe(|| decode(file, bytes, wanted)))
        .unwrap_or_else(|_| Err(Defect::Damaged("its pages do not fit together".into()).in_file(file)))
}

fn decode(file: &str, bytes: Vec<u8>, wanted: Wanted<'_>) -> Result<Measurement, RecordingError> {
    let damaged = |e: ParquetError| Defect::Damaged(e.to_string()).in_file(file);
    let bytes = Bytes::from(bytes);
    thrift::check_footer(&bytes).map_err(|_| Defect::Damaged(ENDLESS.into()).in_file(file))?;
    let reader = SerializedFileReader::new(bytes.clone()).map_err(damaged)?;
    let units = stated_units(&reader);
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let rows = usize::try_from(reader.metadata().file_metadata().num_rows()).unwrap_or(0);
    if rows == 0 {
        return Err(Defect::NoRows.in_file(file));
    }
    if rows > MOST_ROWS {
        return Err(Defect::Damaged(format!("it claims {rows} rows")).in_file(file));
    }
    let mut series = Vec::new();
    let mut names = Vec::new();
    for (index, column) in schema.columns().iter().enumerate() {
        let path = column.path().string();
        let (name, bracket) = units::split_header(&path);
        names.push(name.clone());
        if column.max_rep_level() > 0 || !wanted(&name) {
            continue;
        }
        let unit = bracket.or_else(|| units.get(&path).cloned()).or_else(|| stamp_unit(column).map(str::to_string));
        let mut one = Series { name, unit, ..Series::default() };
        // The count is the file's claim; the values that are there decide.
        one.values.reserve(rows.min(1 << 24));
        read_column(&reader, &bytes, index, rows, &mut one).map_err(damaged)?;
        if one.values.len() != rows {
            let what = format!("column {path} holds {} of {rows} rows", one.values.len());
            return Err(Defect::Damaged(what).in_file(file));
        }
        series.push(one);
    }
    let group = Group { series, ..Group::default() };
    Ok(Measurement { file: file.to_string(), groups: vec![group], names, rows: Rows::Table, notes: Vec::new() })
}

/// Appends every row group's part of one column.
fn read_column(
    reader: &SerializedFileReader<Bytes>,
    bytes: &Bytes,
    index: usize,
    rows: usize,
    into: &mut Series,
) -> Result<(), ParquetError> {
    // Time stamps since 1970 in nanoseconds need more digits than a double has; counted from the first they fit.
    let mut first: Option<i64> = None;
    for group in 0..reader.num_row_groups() {
        let part = reader.get_row_group(group)?;
        let chunk = part.metadata().column(index);
        let pages = place(chunk).and_then(|range| bytes.get(range)).unwrap_or_default();
        thrift::check_pages(pages).map_err(|_| ParquetError::General(ENDLESS.into()))?;
        let descriptor = chunk.column_descr_ptr();
        let stamp = stamp_unit(&descriptor).is_some();
        match part.get_column_reader(index)? {
            ColumnReader::DoubleColumnReader(r) => append(r, &descriptor, rows, into, |v| v)?,
            ColumnReader::FloatColumnReader(r) => append(r, &descriptor, rows, into, f64::from)?,
            ColumnReader::Int32ColumnReader(r) if !is_decimal(&descriptor) => append(r, &descriptor, rows, into, f64::from)?,
            ColumnReader::Int64ColumnReader(r) if stamp => {
                append(r, &descriptor, rows, into, |v: i64| v.saturating_sub(*first.get_or_insert(v)) as f64)?;
            }
            ColumnReader::Int64ColumnReader(r) if !is_decimal(&descriptor) => append(r, &descriptor, rows, into, |v| v as f64)?,
            _ => {
                into.text.get_or_insert_with(|| (0, format!("a value of type {}", descriptor.physical_type())));
                let here = usize::try_from(part.metadata().num_rows()).unwrap_or(0);
                into.values.extend(std::iter::repeat_n(f64::NAN, here.min(rows - into.values.len())));
            }
        }
    }
    Ok(())
}

/// Where the pages of a column chunk stand in the file.
fn place(chunk: &ColumnChunkMetaData) -> Option<std::ops::Range<usize>> {
    let start = chunk.dictionary_page_offset().unwrap_or(chunk.data_page_offset()).min(chunk.data_page_offset());
    let (start, length) = (usize::try_from(start).ok()?, usize::try_from(chunk.compressed_size()).ok()?);
    Some(start..start.checked_add(length)?)
}

fn append<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    descriptor: &ColumnDescriptor,
    most: usize,
    into: &mut Series,
    mut to_f64: impl FnMut(T::T) -> f64,
) -> Result<(), ParquetError> {
    const CHUNK: usize = 65_536;
    let present = descriptor.max_def_level();
    let (mut levels, mut values) = (Vec::new(), Vec::new());
    loop {
        levels.clear();
        values.clear();
        let (rows, _, _) = reader.read_records(CHUNK, Some(&mut levels), None, &mut values)?;
        if rows == 0 {
            return Ok(());
        }
        if rows > most - into.values.len() {
            return Err(ParquetError::General(format!("a column holds more than the {most} rows that the file claims")));
        }
        let mut values = values.drain(..);
        if present == 0 {
            into.values.extend(values.map(&mut to_f64));
        } else {
            into.values.extend(levels.iter().map(|&level| match level == present {
                true => values.next().map_or(f64::NAN, &mut to_f64),
                false => f64::NAN,
            }));
        }
    }
}

fn is_decimal(descriptor: &ColumnDescriptor) -> bool {
    descriptor.converted_type() == ConvertedType::DECIMAL
}

/// The unit of a time stamp's ticks, `None` for any other column.
fn stamp_unit(descriptor: &ColumnDescriptor) -> Option<&'static str> {
    match (descriptor.logical_type_ref(), descriptor.converted_type()) {
        (Some(LogicalType::Timestamp(stamp)), _) => Some(match stamp.unit {
            TimeUnit::MILLIS => "ms",
            TimeUnit::MICROS => "us",
            TimeUnit::NANOS => "ns",
        }),
        (_, ConvertedType::TIMESTAMP_MILLIS) => Some("ms"),
        (_, ConvertedType::TIMESTAMP_MICROS) => Some("us"),
        _ => None,
    }
}

/// Units by column, as the file's metadata states them.
fn stated_units(reader: &SerializedFileReader<Bytes>) -> HashMap<String, String> {
    let mut units = HashMap::new();
    for pair in reader.metadata().file_metadata().key_value_metadata().into_iter().flatten() {
        let Some(json) = pair.value.as_deref().and_then(|v| serde_json::from_str::<serde_json::Value>(v).ok()) else {
            continue;
        };
        let object = match pair.key.as_str() {
            "units" => Some(&json),
            "PANDAS_ATTRS" => json.get("units"),
            _ => None,
        };
        for (column, unit) in object.and_then(|o| o.as_object()).into_iter().flatten() {
            if let Some(unit) = unit.as_str() {
                units.insert(column.clone(), unit.to_string());
            }
        }
    }
    units
}
