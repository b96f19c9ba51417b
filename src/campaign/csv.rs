//! Text files: a header, optionally a row of units, then one row per sample; or a long table of time, channel and value.
//!
//! The encoding is UTF-8, UTF-16 with a byte order mark, or Latin-1. Lines that start with `#` are comments; [`super::text_shape`] determines the rest
//! of the layout. A cell that is empty or says NaN, SNA and the like is a missing sample. A column of dates or times of day is converted to seconds
//! since its first cell. Several columns with the same clock name divide the table into blocks, each with its own stamps. A last row that was cut off
//! while writing is dropped and reported; a row with a wrong number of cells before it is an error. The file is read as a stream.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use encoding_rs_io::DecodeReaderBytesBuilder;

use super::error::{Defect, RecordingError};
use super::limits::{FILE_ROWS, TEXT_BYTES};
use super::table::{Group, Measurement, Rows, Series, Tell, Wanted};
use super::text_cells::{Cells, DAY_NS, decimals, is_comment, is_time_of_day, number, quantity, stamp, text};
use super::text_long;
use super::text_shape::{Shape, is_data, shape};

/// Number of bytes at the start of a file from which its layout is determined.
const HEAD: u64 = 256 << 10;

/// Reads a text file; `file` is its name in messages.
pub(crate) fn read(file: &str, path: &Path, wanted: Wanted<'_>, tell: Tell<'_>) -> Result<Measurement, RecordingError> {
    let input = File::open(path).map_err(|e| Defect::Unreadable(e.to_string()).in_file(file))?;
    let size = input.metadata().map_or(0, |m| m.len());
    read_from(file, Counted { input, size, read: 0, tell }, wanted)
}

/// A file that reports the share of it that has been read.
struct Counted<'a> {
    input: File,
    size: u64,
    read: u64,
    tell: Tell<'a>,
}

impl Read for Counted<'_> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        let n = self.input.read(into)?;
        let before = self.read;
        self.read += n as u64;
        // A report every 4 MB is often enough.
        if self.read >> 22 != before >> 22 {
            (self.tell)(self.read as f64 / self.size.max(1) as f64);
        }
        Ok(n)
    }
}

fn read_from(file: &str, input: impl Read, wanted: Wanted<'_>) -> Result<Measurement, RecordingError> {
    let unreadable = |e: std::io::Error| Defect::Unreadable(e.to_string()).in_file(file);
    let mut input = DecodeReaderBytesBuilder::new().utf8_passthru(true).strip_bom(true).build(input);
    let mut head = Vec::new();
    input.by_ref().take(HEAD).read_to_end(&mut head).map_err(unreadable)?;
    if head.contains(&0) {
        return Err(Defect::NotText.in_file(file));
    }
    // Lines that are separated by carriage returns alone. A single one may stand at the end of the file.
    if !head.contains(&b'\n') && head.iter().filter(|b| **b == b'\r').count() > 1 {
        return Err(Defect::CarriageReturns.in_file(file));
    }
    let Some(shape) = shape(&head) else { return Err(Defect::Empty.in_file(file)) };
    let names: Vec<String> = shape.columns.iter().map(|(name, _)| name.clone()).collect();
    if is_data(&names, shape.decimal_comma) {
        let mut error = Defect::NoHeader.in_file(file);
        error.place.row = Some(("line", shape.above as u64));
        return Err(error);
    }
    if shape.is_of_frames() {
        return Err(Defect::RawFrames("as a table: save them as .asc, .trc or .mf4 first").in_file(file));
    }
    let mut lines = Lines { input: BufReader::with_capacity(1 << 20, head.chain(input)), line: Vec::new(), number: 0, ended: true };
    for _ in 0..shape.above {
        lines.next().map_err(|d| d.in_file(file))?;
    }
    let mut m = match text_long::roles(&shape) {
        Some(roles) => text_long::read(file, &shape, roles, &mut lines, wanted)?,
        None => read_wide(file, &shape, &mut lines, wanted)?,
    };
    if shape.preamble > 0 {
        let plural = if shape.preamble == 1 { "line" } else { "lines" };
        m.notes.insert(0, format!("{} {plural} in front of the header skipped", shape.preamble));
    }
    m.file = file.to_string();
    Ok(m)
}

/// The lines of a file, without their ends, counted.
pub(crate) struct Lines<R> {
    input: BufReader<R>,
    line: Vec<u8>,
    /// Number of the last line read, from 1.
    pub number: u64,
    /// Whether the last line read ended with a line feed.
    pub ended: bool,
}

impl<R: Read> Lines<R> {
    /// The next line, or `None` at the end.
    ///
    /// The file cannot be read further, a line is too long, or there are too many lines.
    /// A file that cannot be read on, a line that is too long, or too many of them.
    pub fn next(&mut self) -> Result<Option<&[u8]>, Defect> {
        self.line.clear();
        let most = TEXT_BYTES as u64 + 1;
        let read = self.input.by_ref().take(most).read_until(b'\n', &mut self.line).map_err(|e| Defect::Unreadable(e.to_string()))?;
        if read == 0 {
            return Ok(None);
        }
        self.number += 1;
        if self.line.len() > TEXT_BYTES {
            return Err(Defect::LongLine { line: self.number, most: TEXT_BYTES });
        }
        if self.number > FILE_ROWS {
            return Err(Defect::TooManyRows(FILE_ROWS));
        }
        self.ended = self.line.last() == Some(&b'\n');
        let line = self.line.strip_suffix(b"\n").unwrap_or(&self.line);
        Ok(Some(line.strip_suffix(b"\r").unwrap_or(line)))
    }
}

fn read_wide<R: Read>(file: &str, shape: &Shape, lines: &mut Lines<R>, wanted: Wanted<'_>) -> Result<Measurement, RecordingError> {
    let mut cells = Cells::new(shape.separator);
    let mut table = Table::new(file, shape, wanted);
    // A short row can be judged only when the next one has been seen, because the last row alone may be short.
    let mut short: Option<(u64, usize)> = None;
    while let Some(line) = lines.next().map_err(|d| d.in_file(file))? {
        if is_comment(line) {
            continue;
        }
        let found = cells.split(line).len();
        if let Some((line, found)) = short {
            return Err(ragged(file, line, found, table.header));
        }
        match found.cmp(&table.header) {
            std::cmp::Ordering::Less => short = Some((lines.number, found)),
            std::cmp::Ordering::Equal => table.push(&cells, lines.number),
            // Some tools end each row, but not the header, with a separator.
            std::cmp::Ordering::Greater if found == table.header + 1 && cells.cell(found - 1).is_empty() => {
                table.push(&cells, lines.number)
            }
            std::cmp::Ordering::Greater => return Err(ragged(file, lines.number, found, table.header)),
        }
    }
    table.finish(short, lines.ended)
}

/// A table under construction.
struct Table<'a> {
    file: &'a str,
    header: usize,
    columns: Vec<Column>,
    /// Indices of the columns that begin a block, if several blocks stand side by side.
    clocks: Vec<usize>,
    names: Vec<String>,
    lines: Vec<u32>,
    decimal_comma: bool,
    /// Numbers of decimals in the last cells of the last two rows: fewer in the final row of a file mean that it was cut off.
    decimals: [usize; 2],
}

/// Longest step between two times of day across midnight, ns: one hour.
const MIDNIGHT_NS: i128 = 3_600_000_000_000;

/// A column that is being read.
pub(crate) struct Column {
    /// The values read so far.
    pub series: Series,
    /// Index of the column in the file.
    at: usize,
    /// First time stamp, ns, if the cells are dates or times of day.
    first: Option<i128>,
    /// Last time stamp, ns, including the days that have passed.
    last: i128,
    /// Number of midnights that the times of day have passed.
    midnights: i128,
}

impl Column {
    /// An empty column.
    pub fn new(name: &str, unit: Option<&str>, at: usize) -> Column {
        let series = Series { name: name.to_string(), unit: unit.map(str::to_string), ..Series::default() };
        Column { series, at, first: None, last: 0, midnights: 0 }
    }

    /// Appends a cell.
    pub fn push(&mut self, cell: &[u8], decimal_comma: bool) {
        let sample = self.series.values.len();
        let value = number(cell, decimal_comma)
            .or_else(|| self.stamped(cell))
            .or_else(|| self.measured(cell, decimal_comma))
            .unwrap_or_else(|| {
                self.series.text.get_or_insert_with(|| (sample, text(cell)));
                f64::NAN
            });
        self.series.values.push(value);
    }

    /// Removes the last cell; if it was the first text of the column, the column is numeric again.
    pub fn pop(&mut self) {
        self.series.values.pop();
        let left = self.series.values.len();
        self.series.text = self.series.text.take().filter(|(sample, _)| *sample < left);
    }

    /// Seconds from the column's first time stamp to this one; `None` if the cell is not a time stamp or the column began with numbers.
    fn stamped(&mut self, cell: &[u8]) -> Option<f64> {
        if self.first.is_none() && !self.series.values.is_empty() {
            return None;
        }
        let at = stamp(std::str::from_utf8(cell).ok()?)?;
        let first = *self.first.get_or_insert(at);
        self.series.unit = Some("s".to_string());
        // Times of day that jump back by nearly a day have passed midnight; rows in the wrong order jump back by less.
        let today = at + self.midnights * DAY_NS;
        self.midnights += i128::from(is_time_of_day(first) && is_time_of_day(at) && self.last - today > DAY_NS - MIDNIGHT_NS);
        self.last = at + self.midnights * DAY_NS;
        Some((self.last - first) as f64 * 1e-9)
    }

    /// A note on the midnights that were passed, if any.
    pub fn midnight(&self) -> Option<String> {
        let how_often = if self.midnights == 1 { "midnight".to_string() } else { format!("{} midnights", self.midnights) };
        (self.midnights > 0).then(|| format!("{}: the times of day pass {how_often}; time counts on", self.series.name))
    }

    /// Reads a number that is followed by its unit, as some loggers write each cell: `1009RPM`. The unit has to be the column's, which the first number sets if none is stated.
    fn measured(&mut self, cell: &[u8], decimal_comma: bool) -> Option<f64> {
        let cell = text(cell);
        let (value, unit) = quantity(cell.trim(), decimal_comma)?;
        if self.series.unit.is_none() && self.series.values.iter().all(|v| v.is_nan()) {
            self.series.unit = Some(unit.to_string());
        }
        Some(value).filter(|_| self.series.unit.as_deref() == Some(unit))
    }
}

impl<'a> Table<'a> {
    fn new(file: &'a str, shape: &Shape, wanted: Wanted<'_>) -> Self {
        let clocks = shape.clocks();
        let columns = shape.columns.iter().enumerate().filter(|(at, (name, _))| wanted(name) || clocks.contains(at));
        Table {
            file,
            header: shape.columns.len(),
            columns: columns.map(|(at, (name, unit))| Column::new(name, unit.as_deref(), at)).collect(),
            names: shape.columns.iter().map(|(name, _)| name.clone()).collect(),
            clocks,
            lines: Vec::new(),
            decimal_comma: shape.decimal_comma,
            decimals: [0; 2],
        }
    }

    fn push(&mut self, cells: &Cells, line: u64) {
        self.lines.push(u32::try_from(line).unwrap_or(u32::MAX));
        for column in &mut self.columns {
            column.push(cells.cell(column.at), self.decimal_comma);
        }
        let last = cells.cell(self.header - 1);
        self.decimals = [self.decimals[1], decimals(last, self.decimal_comma)];
    }

    fn finish(mut self, short: Option<(u64, usize)>, ended: bool) -> Result<Measurement, RecordingError> {
        let mut notes = Vec::new();
        if let Some((line, found)) = short {
            notes.push(format!("line {line} (the last) has {found} of {} cells: cut off while writing, dropped", self.header));
        } else if !ended && self.lines.len() > 2 && self.decimals[1] < self.decimals[0] {
            let line = self.lines.pop().unwrap_or(0);
            self.columns.iter_mut().for_each(Column::pop);
            notes.push(format!("line {line} (the last) ends inside a number: cut off while writing, dropped"));
        }
        if self.lines.is_empty() {
            return Err(Defect::NoRows.in_file(self.file));
        }
        notes.extend(self.columns.iter().filter_map(Column::midnight));
        let groups = blocks(self.columns, &self.clocks);
        Ok(Measurement { file: String::new(), groups, names: self.names, rows: Rows::Lines(self.lines), notes })
    }
}

/// Splits the columns into one group per block; columns in front of the first clock belong to its block. A block that ends before the others is cut
/// after its last row that is not empty.
fn blocks(columns: Vec<Column>, clocks: &[usize]) -> Vec<Group> {
    let mut groups: Vec<Group> = (0..clocks.len().max(1)).map(|index| Group { index, ..Group::default() }).collect();
    for column in columns {
        let at = clocks.iter().filter(|c| **c <= column.at).count().saturating_sub(1);
        if clocks.get(at) == Some(&column.at) {
            groups[at].master = Some(groups[at].series.len());
        }
        groups[at].series.push(column.series);
    }
    for group in groups.iter_mut().filter(|g| g.master.is_some()) {
        let filled = group.series.iter().filter_map(|s| s.values.iter().rposition(|v| !v.is_nan())).max();
        group.series.iter_mut().for_each(|s| s.values.truncate(filled.map_or(0, |last| last + 1)));
    }
    groups
}

pub(crate) fn ragged(file: &str, line: u64, found: usize, expected: usize) -> RecordingError {
    let mut error = Defect::RaggedRow { found, expected }.in_file(file);
    error.place.row = Some(("line", line));
    error
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(text: &[u8]) -> Result<Measurement, RecordingError> {
        read_from("r.csv", text, &|_| true)
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
    fn what_is_no_table_says_so() {
        for (text, said) in [
            (&b"\x13\xc0\x00\x08\n1"[..], "r.csv: the file is not text"),
            (b"t,a\r0,1\r1,2\r", "r.csv: its lines end with carriage returns alone"),
            (b"# log\n0,1\n1,2\n", "r.csv, line 2: the line holds numbers where the names of the channels are expected"),
        ] {
            let error = all(text).unwrap_err().to_string();
            assert!(error.starts_with(said), "{error}");
        }
    }

    #[test]
    fn times_of_day_count_on_over_midnight() {
        let m = all(b"time,a\n23:59:59.980,1\n23:59:59.990,2\n00:00:00.000,3\n00:00:00.010,4\n").unwrap();
        assert!(m.groups[0].series[0].values.iter().zip([0.0, 0.01, 0.02, 0.03]).all(|(t, expected)| (t - expected).abs() < 1e-9));
        assert_eq!(m.notes, ["time: the times of day pass midnight; time counts on"]);
        // Neither rows in the wrong order nor dates count as passing midnight.
        for back in ["time,a\n12:00:01,1\n12:00:00,2\n", "time,a\n2026-11-22 23:59:59,1\n2026-11-22 00:00:00,2\n"] {
            let m = all(back.as_bytes()).unwrap();
            assert!(m.groups[0].series[0].values[1] < 0.0 && m.notes.is_empty(), "{back}");
        }
    }

    #[test]
    fn cells_may_have_a_unit_each() {
        let m = all(b"t,n,v,T,data,mode\n0,1009RPM,0km/h,20 Nm,0C,1rpm\n1,,12.5km/h,-3.5 Nm,FF,2 km/h\n2,1010RPM,13km/h,4 Nm,1F,3rpm\n")
            .unwrap();
        let s = &m.groups[0].series;
        assert_eq!((s[1].unit.as_deref(), s[1].values[2], s[1].values[1].is_nan()), (Some("RPM"), 1010.0, true));
        assert_eq!((s[2].unit.as_deref(), s[2].values.as_slice()), (Some("km/h"), &[0.0, 12.5, 13.0][..]));
        assert_eq!((s[3].unit.as_deref(), s[3].values.as_slice()), (Some("Nm"), &[20.0, -3.5, 4.0][..]));
        assert!(s[1..4].iter().all(|s| s.text.is_none()) && s[4].text.is_some());
        // A number with a unit other than the column's is text.
        assert_eq!(s[5].text, Some((1, "2 km/h".to_string())));
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
        let m = all(b"t;a\n0,00;1000,25\n0,01;1000,50\n0,02;1000,").unwrap();
        assert_eq!(m.groups[0].series[1].values, [1000.25, 1000.5]);
        assert_eq!(m.notes, ["line 4 (the last) ends inside a number: cut off while writing, dropped"]);
        assert!(all(b"t;a\n0,00;1000,25\n0,01;1000,50\n0,02;1000,75").unwrap().notes.is_empty());
    }

    /// In a long table a number has as many decimals as the others of its own channel, and the time may be the last column.
    #[test]
    fn a_last_number_cut_off_is_seen_in_a_long_table() {
        for (head, rows, cut) in [
            ("time_s,channel,value", ["0.00,n,100.25", "0.00,x,5", "0.01,n,100.50", "0.01,x,6", "0.02,n,100.7"], true),
            ("time_s,channel,value", ["0.00,n,100.25", "0.00,x,5", "0.01,n,100.50", "0.02,n,100.75", "0.02,x,6"], false),
            ("time_s;channel;value", ["0,00;n;100,25", "0,00;x;5", "0,01;n;100,50", "0,01;x;6", "0,02;n;100,7"], true),
            ("value,channel,time_s", ["100.25,n,0.00", "5,x,0.00", "100.50,n,0.01", "6,x,0.01", "100.75,n,0.0"], true),
            (
                "time_s,value,channel,unit",
                ["0.00,100.25,n,rpm", "0.00,5,x,mm", "0.01,100.50,n,rpm", "0.01,6,x,mm", "0.02,100.75,n,rp"],
                false,
            ),
        ] {
            let text = format!("{head}\n{}", rows.join("\n"));
            let m = all(text.as_bytes()).unwrap();
            let (n, expected): (_, &[f64]) = (&m.groups[0].series, if cut { &[100.25, 100.5] } else { &[100.25, 100.5, 100.75] });
            assert_eq!((n[1].values.as_slice(), n[0].values.len()), (expected, expected.len()), "{text}");
            let note = "line 6 (the last) ends inside a number: cut off while writing, dropped";
            assert_eq!(m.notes, if cut { vec![note] } else { vec![] }, "{text}");
            // A file that ends with a line feed was written completely.
            let ended = all((text + "\n").as_bytes()).unwrap();
            assert!(ended.notes.is_empty() && ended.groups[0].series[1].values.len() == 3);
        }
    }

    /// If each row states the unit, any other columns may follow.
    #[test]
    fn a_long_table_may_say_more_of_each_row() {
        let head = "\"SECONDS\";\"PID\";\"VALUE\";\"UNITS\";\"LATITUDE\";\n";
        let rows =
            ["9.1\";\"Engine RPM\";\"800\";\"rpm\";\"48.1", "9.2\";\"Speed\";\"1\";\"km/h\";\"", "9.3\";\"Engine RPM\";\"810\";\"rpm\";\""];
        let rows: String = rows.iter().map(|row| format!("\"{row}\";\n")).collect();
        let m = all(format!("{head}{rows}").as_bytes()).unwrap();
        let of = |g: usize| {
            let [time, value] = &m.groups[g].series[..] else { panic!("a clock and a channel") };
            (time.values.clone(), value.values.clone(), value.unit.clone().unwrap_or_default())
        };
        assert_eq!(m.names, ["Engine RPM", "Speed"]);
        assert_eq!(of(0), (vec![9.1, 9.3], vec![800.0, 810.0], "rpm".to_owned()));
        assert_eq!(of(1), (vec![9.2], vec![1.0], "km/h".to_owned()));
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
    fn a_line_without_end_is_no_table() {
        // A terabyte of digits: only a bounded part of it is read.
        let endless = b"t,a\n0,1\n".chain(std::io::repeat(b'7').take(1 << 40));
        let e = read_from("r.csv", endless, &|_| true).unwrap_err();
        assert_eq!(*e.defect, Defect::LongLine { line: 3, most: TEXT_BYTES });
        assert!(e.to_string().starts_with("r.csv: line 3 is longer than 16 MB"), "{e}");
        let one = read_from("r.csv", std::io::repeat(b'7').take(1 << 40), &|_| true).unwrap_err();
        assert_eq!(*one.defect, Defect::LongLine { line: 1, most: TEXT_BYTES });
    }

    #[test]
    fn more_rows_than_are_read_are_refused() {
        let mut lines = Lines { input: BufReader::new(&b"1\n2\n"[..]), line: Vec::new(), number: FILE_ROWS - 1, ended: true };
        assert_eq!(lines.next(), Ok(Some(&b"1"[..])));
        assert_eq!(lines.next(), Err(Defect::TooManyRows(FILE_ROWS)));
    }

    #[test]
    fn blocks_side_by_side_have_stamps_of_their_own() {
        let m = read_from("r.csv", &b"mark,time,a,b,time,c\n,0.0,1,2,0.05,3\n,0.1,4,5,0.15,6\n,0.2,7,,,\n"[..], &|n| n != "b").unwrap();
        let of = |g: usize| m.groups[g].series.iter().map(|s| (s.name.as_str(), s.values.clone())).collect::<Vec<_>>();
        assert_eq!(of(0)[1..], [("time", vec![0.0, 0.1, 0.2]), ("a", vec![1.0, 4.0, 7.0])]);
        assert_eq!(of(1), [("time", vec![0.05, 0.15]), ("c", vec![3.0, 6.0])]);
        assert_eq!([m.groups[0].master, m.groups[1].master, m.row(1).map(|(_, line)| line as usize)], [Some(1), Some(0), Some(3)]);
        // A missing stamp does not end the block if others follow.
        let m = all(b"time,a,time,c\n0,1,,2\n1,2,1.5,3\n").unwrap();
        assert!(m.groups[1].series[0].values[0].is_nan() && m.groups[1].series[1].values == [2.0, 3.0]);
        assert_eq!(all(b"time,a,elapsed_time,c\n0,1,0,2\n1,2,1,3\n").unwrap().groups.len(), 1);
    }

    #[test]
    fn a_table_of_frames_is_none_of_signals() {
        for head in ["time,addr,bus,data", "TimestampEpoch;BusChannel;ID;DataBytes", "Time Stamp,ID,Extended,LEN,D1,D2"] {
            let separator = if head.contains(';') { ";" } else { "," };
            let row = vec!["1"; head.split([',', ';']).count()].join(separator) + "\n";
            let e = all(format!("{head}\n{row}{row}").as_bytes()).unwrap_err();
            assert!(matches!(*e.defect, Defect::RawFrames(_)), "{head}");
        }
        assert!(all(b"time,id,n\n0,1,2\n").is_ok());
    }

    #[test]
    fn nothing_but_a_header() {
        assert_eq!(all(b"t,a\n").unwrap_err().defect.as_ref(), &Defect::NoRows);
        assert_eq!(all(b"\n\n").unwrap_err().defect.as_ref(), &Defect::Empty);
    }

    #[test]
    fn a_large_file_tells_how_much_of_it_is_read() {
        let path = std::env::temp_dir().join(format!("kisspoint-told-{}.csv", std::process::id()));
        let rows = 600_000;
        std::fs::write(&path, "time_s,a\n".to_owned() + &"0.123456789,1.2\n".repeat(rows)).unwrap();
        let told = std::cell::RefCell::new(Vec::new());
        let read = read("a.csv", &path, &|_| true, &|share| told.borrow_mut().push(share));
        std::fs::remove_file(&path).unwrap();
        assert_eq!(read.unwrap().groups[0].series[1].values.len(), rows);
        let told = told.into_inner();
        assert!(told.len() == 2 && (0.4..0.5).contains(&told[0]) && (0.8..0.95).contains(&told[1]), "{told:?}");
    }
}
