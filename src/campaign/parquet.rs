//! Parquet files: one row per sample, one column per channel.
//!
//! Plain columns are read one chunk at a time, without the arrow crates. A null is a missing sample. Numbers of every width, decimals, flags and
//! half-precision numbers are read; time stamps (also INT96) count from their first value. Units are given in brackets in the column name, or in the file's
//! metadata as a JSON object that maps columns to units: under the key `units` (pyarrow's `with_metadata`) or in `units` of pandas' `DataFrame.attrs`.

use std::collections::HashMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use ::parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type as PhysicalType};
use ::parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use ::parquet::data_type::{DataType, Int96};
use ::parquet::errors::ParquetError;
use ::parquet::file::metadata::ColumnChunkMetaData;
use ::parquet::file::reader::{FileReader, SerializedFileReader};
use ::parquet::schema::types::ColumnDescriptor;
use half::f16;

use super::error::{Defect, RecordingError};
use super::limits::FILE_ROWS;
use super::table::{Group, Measurement, Rows, Series, Tell, Wanted};
use super::{thrift, units};

const ENDLESS: &str = "a count in it is larger than the file";

/// Reads a Parquet file; `file` is its name in messages.
pub(crate) fn read(file: &str, path: &Path, wanted: Wanted<'_>, tell: Tell<'_>) -> Result<Measurement, RecordingError> {
    // The underlying library relies on some properties that a damaged file may lack; a panic there means a damaged file and nothing else.
    catch_unwind(AssertUnwindSafe(|| decode(file, path, wanted, tell)))
        .unwrap_or_else(|_| Err(Defect::Damaged("its pages do not fit together".into()).in_file(file)))
}

fn decode(file: &str, path: &Path, wanted: Wanted<'_>, tell: Tell<'_>) -> Result<Measurement, RecordingError> {
    let damaged = |e: ParquetError| Defect::Damaged(e.to_string()).in_file(file);
    let unreadable = |e: std::io::Error| Defect::Unreadable(e.to_string()).in_file(file);
    let mut pages = File::open(path).map_err(unreadable)?;
    thrift::check_footer(&footer(&mut pages).map_err(unreadable)?).map_err(|_| Defect::Damaged(ENDLESS.into()).in_file(file))?;
    let reader = SerializedFileReader::new(pages.try_clone().map_err(unreadable)?).map_err(damaged)?;
    let units = stated_units(&reader);
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let rows = usize::try_from(reader.metadata().file_metadata().num_rows()).unwrap_or(0);
    if rows == 0 {
        return Err(Defect::NoRows.in_file(file));
    }
    // A larger count may also be due to damage: a few bytes can claim any number of equal values.
    if rows as u64 > FILE_ROWS {
        return Err(Defect::TooManyRows(FILE_ROWS).in_file(file));
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
        // The row count is only the file's claim, so that the memory reserved for it is limited; the values that are found decide.
        one.values.reserve(rows.min(1 << 24));
        read_column(&reader, &mut pages, index, rows, &mut one).map_err(damaged)?;
        if one.values.len() != rows {
            let what = format!("column {path} holds {} of {rows} rows", one.values.len());
            return Err(Defect::Damaged(what).in_file(file));
        }
        series.push(one);
        tell((index + 1) as f64 / schema.num_columns() as f64);
    }
    let group = Group { series, ..Group::default() };
    Ok(Measurement { file: file.to_string(), groups: vec![group], names, rows: Rows::Table, notes: Vec::new() })
}

/// Appends the values of one column from every row group.
fn read_column(
    reader: &SerializedFileReader<File>,
    file: &mut File,
    index: usize,
    rows: usize,
    into: &mut Series,
) -> Result<(), ParquetError> {
    // Nanoseconds since 1970 need more digits than a double has; nanoseconds from the first stamp fit.
    let mut first: Option<i64> = None;
    let mut since = |v: i64| v.saturating_sub(*first.get_or_insert(v)) as f64;
    for group in 0..reader.num_row_groups() {
        let part = reader.get_row_group(group)?;
        let chunk = part.metadata().column(index);
        let pages = place(chunk).map(|range| bytes_at(file, range)).transpose()?.unwrap_or_default();
        thrift::check_pages(&pages).map_err(|_| ParquetError::General(ENDLESS.into()))?;
        let d = chunk.column_descr_ptr();
        let stamp = stamp_unit(&d).is_some();
        let scale = is_decimal(&d).then(|| 10f64.powi(d.type_scale()));
        match part.get_column_reader(index)? {
            ColumnReader::BoolColumnReader(r) => append(r, &d, rows, into, |v| f64::from(u8::from(v)))?,
            ColumnReader::DoubleColumnReader(r) => append(r, &d, rows, into, |v| v)?,
            ColumnReader::FloatColumnReader(r) => append(r, &d, rows, into, f64::from)?,
            ColumnReader::Int32ColumnReader(r) if is_unsigned(&d) => append(r, &d, rows, into, |v| f64::from(v as u32))?,
            ColumnReader::Int64ColumnReader(r) if is_unsigned(&d) => append(r, &d, rows, into, |v| (v as u64) as f64)?,
            ColumnReader::Int32ColumnReader(r) => append(r, &d, rows, into, |v| f64::from(v) / scale.unwrap_or(1.0))?,
            ColumnReader::Int64ColumnReader(r) if stamp => append(r, &d, rows, into, &mut since)?,
            ColumnReader::Int64ColumnReader(r) => append(r, &d, rows, into, |v| v as f64 / scale.unwrap_or(1.0))?,
            ColumnReader::Int96ColumnReader(r) => append(r, &d, rows, into, |v: Int96| since(v.to_nanos()))?,
            ColumnReader::FixedLenByteArrayColumnReader(r) if is_half(&d) => append(r, &d, rows, into, |v| half(v.data()))?,
            ColumnReader::FixedLenByteArrayColumnReader(r) if scale.is_some() => {
                append(r, &d, rows, into, |v| big_endian(v.data()) / scale.unwrap_or(1.0))?;
            }
            ColumnReader::ByteArrayColumnReader(r) if scale.is_some() => {
                append(r, &d, rows, into, |v| big_endian(v.data()) / scale.unwrap_or(1.0))?;
            }
            _ => {
                into.text.get_or_insert_with(|| (0, format!("a value of type {}", d.physical_type())));
                let here = usize::try_from(part.metadata().num_rows()).unwrap_or(0);
                into.values.extend(std::iter::repeat_n(f64::NAN, here.min(rows - into.values.len())));
            }
        }
    }
    // An infinite value is no measurement either.
    into.values.iter_mut().filter(|v| v.is_infinite()).for_each(|v| *v = f64::NAN);
    Ok(())
}

/// The metadata at the end of the file, with its length and the file's signature.
fn footer(file: &mut File) -> std::io::Result<Vec<u8>> {
    let size = file.seek(SeekFrom::End(0))?;
    let tail = bytes_at(file, size.saturating_sub(8)..size)?;
    let length = tail.first_chunk::<4>().map_or(0, |b| u64::from(u32::from_le_bytes(*b)));
    bytes_at(file, size.saturating_sub(length.saturating_add(8))..size)
}

/// The bytes of the file in this range, as far as they exist.
fn bytes_at(file: &mut File, range: std::ops::Range<u64>) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    file.seek(SeekFrom::Start(range.start))?;
    file.take(range.end.saturating_sub(range.start)).read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn half(bytes: &[u8]) -> f64 {
    bytes.first_chunk::<2>().map_or(f64::NAN, |b| f16::from_le_bytes(*b).to_f64())
}

/// A signed integer of any width (two's complement), most significant byte first.
fn big_endian(bytes: &[u8]) -> f64 {
    let sign = if bytes.first().is_some_and(|b| b & 0x80 != 0) { -1.0 } else { 0.0 };
    bytes.iter().fold(sign, |value, &b| value * 256.0 + f64::from(b))
}

/// Position of a column chunk's pages in the file.
fn place(chunk: &ColumnChunkMetaData) -> Option<std::ops::Range<u64>> {
    let start = chunk.dictionary_page_offset().unwrap_or(chunk.data_page_offset()).min(chunk.data_page_offset());
    let (start, length) = (u64::try_from(start).ok()?, u64::try_from(chunk.compressed_size()).ok()?);
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
    descriptor.converted_type() == ConvertedType::DECIMAL || matches!(descriptor.logical_type_ref(), Some(LogicalType::Decimal { .. }))
}

/// Whether integers are unsigned: they are stored as signed numbers with the same bits.
fn is_unsigned(descriptor: &ColumnDescriptor) -> bool {
    use ConvertedType::{UINT_8, UINT_16, UINT_32, UINT_64};
    matches!(descriptor.converted_type(), UINT_8 | UINT_16 | UINT_32 | UINT_64)
        || matches!(descriptor.logical_type_ref(), Some(LogicalType::Integer(integer)) if !integer.is_signed)
}

fn is_half(descriptor: &ColumnDescriptor) -> bool {
    matches!(descriptor.logical_type_ref(), Some(LogicalType::Float16))
}

/// The unit of a time stamp's ticks; `None` for any other column.
fn stamp_unit(descriptor: &ColumnDescriptor) -> Option<&'static str> {
    match (descriptor.logical_type_ref(), descriptor.converted_type()) {
        (Some(LogicalType::Timestamp(stamp)), _) => Some(match stamp.unit {
            TimeUnit::MILLIS => "ms",
            TimeUnit::MICROS => "us",
            TimeUnit::NANOS => "ns",
        }),
        (_, ConvertedType::TIMESTAMP_MILLIS) => Some("ms"),
        (_, ConvertedType::TIMESTAMP_MICROS) => Some("us"),
        _ if descriptor.physical_type() == PhysicalType::INT96 => Some("ns"),
        _ => None,
    }
}

/// Units by column, as stated in the file's metadata.
fn stated_units(reader: &SerializedFileReader<File>) -> HashMap<String, String> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use ::parquet::schema::types::{ColumnPath, Type};
    use std::sync::Arc;

    fn column(physical: PhysicalType, converted: ConvertedType, logical: Option<LogicalType>, length: i32) -> ColumnDescriptor {
        let builder =
            Type::primitive_type_builder("c", physical).with_converted_type(converted).with_logical_type(logical).with_length(length);
        ColumnDescriptor::new(Arc::new(builder.build().unwrap()), 0, 0, ColumnPath::from("c"))
    }

    /// Old writers give converted types only, new ones logical types as well.
    #[test]
    fn stamps_have_the_unit_that_either_kind_of_type_gives() {
        let stamp = |unit| Some(LogicalType::timestamp(true, unit));
        for (physical, converted, logical, unit) in [
            (PhysicalType::INT64, ConvertedType::TIMESTAMP_MILLIS, None, Some("ms")),
            (PhysicalType::INT64, ConvertedType::TIMESTAMP_MICROS, None, Some("us")),
            (PhysicalType::INT64, ConvertedType::NONE, stamp(TimeUnit::MILLIS), Some("ms")),
            (PhysicalType::INT64, ConvertedType::NONE, stamp(TimeUnit::MICROS), Some("us")),
            (PhysicalType::INT64, ConvertedType::NONE, stamp(TimeUnit::NANOS), Some("ns")),
            (PhysicalType::INT96, ConvertedType::NONE, None, Some("ns")),
            (PhysicalType::INT64, ConvertedType::NONE, None, None),
            (PhysicalType::DOUBLE, ConvertedType::NONE, None, None),
        ] {
            assert_eq!(stamp_unit(&column(physical, converted, logical, 0)), unit, "{physical} {converted}");
        }
        assert!(is_half(&column(PhysicalType::FIXED_LEN_BYTE_ARRAY, ConvertedType::NONE, Some(LogicalType::Float16), 2)));
        assert!(!is_half(&column(PhysicalType::FIXED_LEN_BYTE_ARRAY, ConvertedType::NONE, None, 2)));
        assert!(!is_decimal(&column(PhysicalType::INT32, ConvertedType::NONE, None, 0)));
    }

    /// The values are read back from a file that declares them as unsigned in either way.
    #[test]
    fn integers_without_a_sign_count_beyond_the_greatest_with_one() {
        use ::parquet::data_type::{Int32Type, Int64Type};
        let message = "message m { required int32 a (INTEGER(32,false)); required int32 b; required int64 c (UINT_64); required int64 d; }";
        let schema = Arc::new(::parquet::schema::parser::parse_message_type(message).unwrap());
        let path = std::env::temp_dir().join(format!("kisspoint-unsigned-{}.parquet", std::process::id()));
        let file = File::create(&path).unwrap();
        let mut writer = ::parquet::file::writer::SerializedFileWriter::new(file, schema, Arc::default()).unwrap();
        let mut group = writer.next_row_group().unwrap();
        for wide in [false, false, true, true] {
            let mut column = group.next_column().unwrap().unwrap();
            if wide {
                column.typed::<Int64Type>().write_batch(&[1, -1, i64::MIN], None, None).unwrap();
            } else {
                column.typed::<Int32Type>().write_batch(&[1, -1, i32::MIN], None, None).unwrap();
            }
            column.close().unwrap();
        }
        group.close().unwrap();
        writer.close().unwrap();
        let read = read("a.parquet", &path, &|_| true, &|_| ());
        std::fs::remove_file(&path).unwrap();
        let [a, b, c, d] = &read.unwrap().groups[0].series[..] else { panic!("four columns") };
        assert_eq!(
            (a.values.as_slice(), b.values.as_slice()),
            (&[1.0, 4_294_967_295.0, 2_147_483_648.0][..], &[1.0, -1.0, -2_147_483_648.0][..])
        );
        let two_to = |n: i32| 2_f64.powi(n);
        assert_eq!((c.values.as_slice(), d.values.as_slice()), (&[1.0, two_to(64), two_to(63)][..], &[1.0, -1.0, -two_to(63)][..]));
    }

    #[test]
    fn numbers_of_bytes_have_their_sign_and_order() {
        for (bytes, value) in [(&[][..], 0.0), (&[0x7f], 127.0), (&[0x80], -128.0), (&[0xff, 0xfe], -2.0), (&[0x01, 0x02, 0x03], 66_051.0)]
        {
            assert_eq!(big_endian(bytes), value);
        }
        assert_eq!(half(&[0x00, 0x3e]), 1.5);
        assert!(half(&[0]).is_nan());
    }
}
