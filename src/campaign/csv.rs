//! Text files: a header, optionally a row of units, then one row per sample.
//!
//! Comma, semicolon and tab are told apart by the header; with semicolons or tabs a decimal comma is understood. Lines that
//! start with `#` are comments. A cell that is empty or says NaN is a missing sample. A last row that was cut off while
//! writing is dropped and reported; a ragged row before it is an error.

use csv::{ByteRecord, Position, ReaderBuilder};

use super::error::{Defect, RecordingError};
use super::table::{Group, Measurement, Rows, Series, Wanted};
use super::units;

/// Reads a text file.
pub(crate) fn read(file: &str, bytes: &[u8], wanted: Wanted<'_>) -> Result<Measurement, RecordingError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let delimiter = delimiter(bytes);
    let mut reader = ReaderBuilder::new().has_headers(false).flexible(true).delimiter(delimiter).comment(Some(b'#')).from_reader(bytes);
    let mut record = ByteRecord::new();
    let unreadable = |e: ::csv::Error| Defect::Unreadable(e.to_string()).in_file(file);
    if !reader.read_byte_record(&mut record).map_err(unreadable)? {
        return Err(Defect::Empty.in_file(file));
    }
    let mut lines = LineCounter { bytes, at: 0, line: 1 };
    let mut table = Table::new(file, &record, wanted, delimiter != b',');
    let mut first = true;
    // A short row is judged when the next one has been seen: only the last may be short.
    let mut short: Option<(u64, usize)> = None;
    while reader.read_byte_record(&mut record).map_err(unreadable)? {
        let line = lines.of(record.position());
        if let Some((line, found)) = short {
            return Err(ragged(file, line, found, table.header));
        }
        if record.len() != table.header {
            if record.len() > table.header {
                return Err(ragged(file, line, record.len(), table.header));
            }
            short = Some((line, record.len()));
            continue;
        }
        if !(std::mem::take(&mut first) && table.take_units(&record)) {
            table.push(&record, line);
        }
    }
    table.finish(short, bytes)
}

/// Counts lines along with the reader, whose own positions lie in front of blank lines and comments.
struct LineCounter<'a> {
    bytes: &'a [u8],
    at: usize,
    line: u64,
}

impl LineCounter<'_> {
    /// The line, from 1, on which the record at or after a position starts.
    fn of(&mut self, position: Option<&Position>) -> u64 {
        let mut start = position.map_or(self.at, |p| usize::try_from(p.byte()).unwrap_or(usize::MAX)).min(self.bytes.len());
        loop {
            match self.bytes.get(start) {
                Some(b'\r' | b'\n') => start += 1,
                Some(b'#') => start += self.bytes[start..].iter().position(|&b| b == b'\n').unwrap_or(0).max(1),
                _ => break,
            }
        }
        self.line += self.bytes.get(self.at..start).map_or(0, |b| b.iter().filter(|&&b| b == b'\n').count() as u64);
        self.at = self.at.max(start);
        self.line
    }
}

/// Columns under construction.
struct Table<'a> {
    file: &'a str,
    header: usize,
    series: Vec<Series>,
    /// Column of the file for each series.
    columns: Vec<usize>,
    names: Vec<String>,
    lines: Vec<u32>,
    decimal_comma: bool,
    /// Decimals of the last cell in the row before the last: a shorter one at the end of the file was cut off.
    decimals: [usize; 2],
}

impl<'a> Table<'a> {
    fn new(file: &'a str, header: &ByteRecord, wanted: Wanted<'_>, decimal_comma: bool) -> Self {
        let mut series = Vec::new();
        let mut columns = Vec::new();
        let mut names = Vec::new();
        for (column, cell) in header.iter().enumerate() {
            let (name, unit) = units::split_header(&text(cell));
            names.push(name.clone());
            if wanted(&name) {
                series.push(Series { name, unit, ..Series::default() });
                columns.push(column);
            }
        }
        Table { file, header: header.len(), series, columns, names, lines: Vec::new(), decimal_comma, decimals: [0; 2] }
    }

    /// Some exporters put the units into the second row; it is one if no cell is a number and all are units or empty.
    fn take_units(&mut self, record: &ByteRecord) -> bool {
        let cells: Vec<String> = record.iter().map(|c| text(c).trim().to_string()).collect();
        let known = |c: &String| c.is_empty() || c == "-" || units::parse(c).is_some();
        let some = cells.iter().any(|c| units::parse(c).is_some());
        if !some || !cells.iter().all(known) {
            return false;
        }
        for (series, &column) in self.series.iter_mut().zip(&self.columns) {
            if series.unit.is_none() && units::parse(&cells[column]).is_some() {
                series.unit = Some(cells[column].clone());
            }
        }
        true
    }

    fn push(&mut self, record: &ByteRecord, line: u64) {
        let sample = self.lines.len();
        self.lines.push(u32::try_from(line).unwrap_or(u32::MAX));
        for (series, &column) in self.series.iter_mut().zip(&self.columns) {
            let cell = &record[column];
            let value = number(cell, self.decimal_comma).unwrap_or_else(|| {
                series.text.get_or_insert_with(|| (sample, text(cell)));
                f64::NAN
            });
            series.values.push(value);
        }
        let last = &record[self.header - 1];
        self.decimals = [self.decimals[1], last.iter().rev().position(|&b| b == b'.').unwrap_or(0)];
    }

    fn finish(mut self, short: Option<(u64, usize)>, bytes: &[u8]) -> Result<Measurement, RecordingError> {
        let mut notes = Vec::new();
        if let Some((line, found)) = short {
            notes.push(format!("line {line} (the last) has {found} of {} cells: cut off while writing, dropped", self.header));
        } else if !bytes.ends_with(b"\n") && self.lines.len() > 2 && self.decimals[1] < self.decimals[0] {
            let line = self.lines.pop().unwrap_or(0);
            for series in &mut self.series {
                series.values.pop();
            }
            notes.push(format!("line {line} (the last) ends inside a number: cut off while writing, dropped"));
        }
        if self.lines.is_empty() {
            return Err(Defect::NoRows.in_file(self.file));
        }
        // Text in the row that was dropped is no defect.
        for series in &mut self.series {
            series.text = series.text.take().filter(|(sample, _)| *sample < self.lines.len());
        }
        let group = Group { series: self.series, ..Group::default() };
        Ok(Measurement { file: self.file.to_string(), groups: vec![group], names: self.names, rows: Rows::Lines(self.lines), notes })
    }
}

fn ragged(file: &str, line: u64, found: usize, expected: usize) -> RecordingError {
    let mut error = Defect::RaggedRow { found, expected }.in_file(file);
    error.place.row = Some(("line", line));
    error
}

/// The separator that occurs most often in the header line.
fn delimiter(bytes: &[u8]) -> u8 {
    let header = bytes.split(|&b| b == b'\n').find(|line| !line.is_empty() && line[0] != b'#').unwrap_or(b"");
    let count = |d: u8| header.iter().filter(|&&b| b == d).count();
    // The comma comes last: max_by_key keeps the last of equals, and a file with one column has none of them.
    [b'\t', b';', b','].into_iter().max_by_key(|&d| count(d)).unwrap_or(b',')
}

/// UTF-8, or Latin-1 as older tools write it.
fn text(cell: &[u8]) -> String {
    std::str::from_utf8(cell).map_or_else(|_| cell.iter().map(|&b| b as char).collect(), str::to_string)
}

/// A cell as a number, NaN where it says that the sample is missing, `None` where it is text.
fn number(cell: &[u8], decimal_comma: bool) -> Option<f64> {
    let cell = cell.trim_ascii();
    let text = std::str::from_utf8(cell).ok()?;
    if let Ok(value) = text.parse::<f64>() {
        return Some(if value.is_finite() { value } else { f64::NAN });
    }
    if decimal_comma && cell.iter().filter(|&&b| b == b',').count() == 1 && !cell.contains(&b'.') {
        return text.replace(',', ".").parse().ok();
    }
    let missing = ["", "-", "na", "n/a", "#n/a", "null", "none"];
    missing.iter().any(|m| text.eq_ignore_ascii_case(m)).then_some(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(text: &[u8]) -> Result<Measurement, RecordingError> {
        read("r.csv", text, &|_| true)
    }

    #[test]
    fn names_units_values_and_lines() {
        let m = all(b"# note\ntime_s,n [rpm],gear\n0,1000,D\n\n0.01,,D\n0.02,NaN,D\n").unwrap();
        let s = &m.groups[0].series;
        assert_eq!((s[1].name.as_str(), s[1].unit.as_deref()), ("n", Some("rpm")));
        assert_eq!(s[0].values, [0.0, 0.01, 0.02]);
        assert_eq!(s[1].values[0], 1000.0);
        assert!(s[1].values[1].is_nan() && s[1].values[2].is_nan());
        assert_eq!(s[2].text, Some((0, "D".to_string())));
        assert_eq!(m.row(1), Some(("line", 5)));
    }

    #[test]
    fn lines_are_counted_through_comments_blanks_and_carriage_returns() {
        let m = all(b"# a\r\nt,a\r\n0,1\r\n\r\n# b\r\n1,2\r\n2,3\r\n").unwrap();
        assert_eq!([0, 1, 2].map(|i| m.row(i).unwrap().1), [3, 6, 7]);
    }

    #[test]
    fn semicolons_with_decimal_commas_and_a_row_of_units() {
        let m = all(b"t;n;T\ns;1/min;\xb0C\n0,0;1000,5;20,0\n0,01;1001,5;20,1\n").unwrap();
        let s = &m.groups[0].series;
        assert_eq!(s[1].unit.as_deref(), Some("1/min"));
        assert_eq!(s[2].unit.as_deref(), Some("°C"));
        assert_eq!(s[1].values, [1000.5, 1001.5]);
    }

    #[test]
    fn a_last_row_cut_off_is_dropped_and_reported() {
        let m = all(b"t,a\n0.00,1.25\n0.01,1.50\n0.02,1.75\n0.03").unwrap();
        assert_eq!(m.groups[0].series[1].values, [1.25, 1.5, 1.75]);
        assert!(m.notes[0].contains("line 5"), "{:?}", m.notes);
        let m = all(b"t,a\n0.00,1.25\n0.01,1.50\n0.02,1.7").unwrap();
        assert_eq!(m.groups[0].series[1].values, [1.25, 1.5]);
        assert!(m.notes[0].contains("line 4"), "{:?}", m.notes);
        let whole = all(b"t,a\n0.00,1.25\n0.01,1.50\n0.02,1.75").unwrap();
        assert!(whole.notes.is_empty());
    }

    #[test]
    fn a_ragged_row_in_the_middle_is_an_error_with_its_line() {
        let e = all(b"t,a\n0,1\n0.01\n0.02,3\n").unwrap_err();
        assert_eq!(*e.defect, Defect::RaggedRow { found: 1, expected: 2 });
        assert_eq!(e.place.row, Some(("line", 3)));
        let e = all(b"t,a\n0,1,7\n0.02,3\n").unwrap_err();
        assert_eq!(e.place.row, Some(("line", 2)));
    }

    #[test]
    fn nothing_but_a_header() {
        assert_eq!(all(b"t,a\n").unwrap_err().defect.as_ref(), &Defect::NoRows);
        assert_eq!(all(b"\n\n").unwrap_err().defect.as_ref(), &Defect::Empty);
    }
}
