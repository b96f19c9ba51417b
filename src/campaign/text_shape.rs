//! The layout of a text file: separator, decimal comma, lines in front of the header, names, units, and where the data begin.
//!
//! The data begin at the first line that consists mostly of numbers, has as many cells as a line of names above it, and is followed only by such lines, as far
//! as the file is examined: what loggers write in front of a table (a sample rate, a duration) has numbers, too. The separator that yields the most cells is
//! chosen. Rows of units or other words, and titles, may stand between names and data. `sep=;` in the first line states the separator.

use super::text_cells::{Cells, is_comment, number, stamp};
use super::{guess, text_stamps, units};
use std::collections::HashSet;

/// The layout of a text file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Shape {
    /// Separator between cells; a blank stands for any number of blanks.
    pub separator: u8,
    /// Whether `1,5` is a number.
    pub decimal_comma: bool,
    /// Names and, from brackets or a row of their own, units.
    pub columns: Vec<(String, Option<String>)>,
    /// Number of lines above the data.
    pub above: usize,
    /// Number of lines above the names.
    pub preamble: usize,
}

impl Shape {
    /// Indices of the clocks, if several blocks stand side by side: columns with the same name and unit, those of a clock. The columns behind a clock have its stamps.
    pub fn clocks(&self) -> Vec<usize> {
        let first = self.columns.iter().find(|(name, unit)| guess::is_time(name, unit.as_deref()));
        let alike: Vec<usize> = (0..self.columns.len()).filter(|k| first == Some(&self.columns[*k])).collect();
        if alike.len() > 1 { alike } else { Vec::new() }
    }

    /// Whether the names are those of a table of CAN frames: an identifier, and the bytes of its data.
    pub fn is_of_frames(&self) -> bool {
        const IDENTIFIERS: [&str; 8] = ["id", "canid", "can_id", "can id", "identifier", "arbitration_id", "addr", "address"];
        const DATA: [&str; 10] = ["data", "databytes", "data bytes", "data_bytes", "payload", "d0", "d1", "b0", "b1", "data0"];
        let has = |words: &[&str]| self.columns.iter().any(|(name, _)| words.contains(&name.to_lowercase().as_str()));
        has(&IDENTIFIERS) && has(&DATA)
    }
}

/// Determines the layout of a file from its first lines; `None` if these are empty or comments.
pub(crate) fn shape(head: &[u8]) -> Option<Shape> {
    let lines: Vec<&[u8]> = head.split(|&b| b == b'\n').map(|l| l.strip_suffix(b"\r").unwrap_or(l)).collect();
    let first = lines.iter().position(|l| !is_comment(l))?;
    if let Some(shape) = text_stamps::shape(&lines) {
        return Some(shape);
    }
    let stated = lines[first].trim_ascii().strip_prefix(b"sep=").and_then(|s| s.first().copied());
    let separators = stated.map_or_else(|| vec![b'\t', b';', b',', b' '], |s| vec![s]);
    let skip = if stated.is_some() { first + 1 } else { 0 };
    let widest = |follow: usize| {
        let all = separators.iter().rev().filter_map(|&s| with_separator(&lines, skip, s, follow));
        all.max_by_key(|shape| shape.columns.len())
    };
    // A table that is damaged near its beginning is recognised as one all the same; reading it names the line.
    widest(FOLLOW).filter(|shape| shape.columns.len() > 1).or_else(|| widest(0)).or_else(|| header_alone(&lines, skip, &separators))
}

/// Number of lines of data that must follow the first one, if the file has as many.
const FOLLOW: usize = 12;

/// The layout for this separator, if the first line of data is followed by `follow` more.
fn with_separator(lines: &[&[u8]], skip: usize, separator: u8, follow: usize) -> Option<Shape> {
    let decimal_comma = separator != b',';
    let mut cells = Cells::new(separator);
    // Rows of words above the data, as line and cells: all of them have the same number of cells.
    let mut words: Vec<(usize, Vec<String>)> = Vec::new();
    for (at, line) in lines.iter().enumerate().skip(skip) {
        // Some tools write the names into the last comment.
        let comment = line.trim_ascii().strip_prefix(b"#");
        if line.trim_ascii().is_empty() || comment.is_some_and(|c| !matches_data(lines, at, c, separator)) {
            continue;
        }
        let row = cells.split(comment.map_or(*line, |c| c.trim_ascii())).texts();
        if is_data(&row, decimal_comma) {
            let is_named = words.first().is_some_and(|(_, names)| names.len() == row.len());
            if is_named && is_followed(lines, at, separator, row.len(), follow) {
                return Some(named(words, separator, at, skip));
            }
            // A row of numbers between names and data describes the channels if it has as many cells; rows of words with another number of cells belong to no table.
            words.retain(|(_, other)| other.len() == row.len());
        } else if row.len() > 1 || words.first().is_none_or(|(_, names)| names.len() == 1) {
            words.retain(|(_, other)| other.len() == row.len());
            words.push((at, row));
        }
    }
    None
}

/// Whether most of a row's cells are numbers.
pub(crate) fn is_data(row: &[String], decimal_comma: bool) -> bool {
    let numbers = row.iter().filter(|c| is_number(c, decimal_comma)).count();
    2 * numbers >= row.iter().filter(|c| !c.is_empty()).count() && numbers > 0
}

/// Whether the next lines are data with as many cells. The last of the examined lines may be cut off, so that it is not judged.
fn is_followed(lines: &[&[u8]], at: usize, separator: u8, cells_of_row: usize, follow: usize) -> bool {
    let mut cells = Cells::new(separator);
    let mut next = lines[at + 1..lines.len().max(at + 2) - 1].iter().filter(|l| !is_comment(l)).take(follow);
    next.all(|line| {
        let row = cells.split(line).texts();
        // Some tools end each row, but not the header, with a separator.
        let ends = row.len() == cells_of_row + 1 && row.last().is_some_and(String::is_empty);
        (row.len() == cells_of_row || ends) && is_data(&row, separator != b',')
    })
}

/// Whether a comment is followed by a row of as many numbers.
fn matches_data(lines: &[&[u8]], at: usize, comment: &[u8], separator: u8) -> bool {
    let mut cells = Cells::new(separator);
    let count = cells.split(comment.trim_ascii()).len();
    let next = lines[at + 1..].iter().find(|l| !is_comment(l));
    count > 1 && next.is_some_and(|l| cells.split(l).len() == count && cells.texts().iter().all(|c| is_number(c, separator != b',')))
}

fn is_number(cell: &str, decimal_comma: bool) -> bool {
    number(cell.as_bytes(), decimal_comma).is_some_and(|v| !v.is_nan()) || stamp(cell).is_some()
}

/// The layout from the rows of words above the data: names, and units in any row below them.
///
/// The row of names is the one with the most different entries, because names differ from each other and no column lacks one. Of several such rows it
/// is the first in the unbroken sequence of lines that ends with the last of them.
fn named(words: Vec<(usize, Vec<String>)>, separator: u8, data: usize, skip: usize) -> Shape {
    let of_units = |row: &[String]| row.iter().filter(|c| units::parse(c).is_some()).count();
    let different = |row: &[String]| row.iter().filter(|c| !c.is_empty()).collect::<HashSet<_>>().len();
    // A channel may be called RPM, but most cells in a row of names are not units.
    let is_name = |k: &usize| *k == 0 || 2 * of_units(&words[*k].1) < different(&words[*k].1);
    let most = (0..words.len()).filter(is_name).map(|k| different(&words[k].1)).max().unwrap_or(0);
    let mut all = (0..words.len()).filter(is_name).filter(|k| different(&words[*k].1) == most).rev();
    let last = all.next().unwrap_or(0);
    let place = all.fold(last, |below, k| if words[k].0 + 1 == words[below].0 { k } else { below });
    let (names_at, names) = &words[place];
    let below = words[place + 1..].iter().rev().map(|(_, row)| (of_units(row), row));
    let stated =
        below.filter(|(units, row)| *units > 0 && row.iter().all(|c| c.len() < 16)).max_by_key(|(units, _)| *units).map(|(_, row)| row);
    let column = |(k, name): (usize, &String)| {
        let (name, bracket) = units::split_header(name);
        let below = stated.map(|row| row[k].trim().trim_matches(['[', ']', '(', ')']).to_string());
        (name, bracket.or(below.filter(|u| !matches!(u.as_str(), "" | "-"))))
    };
    let columns = names.iter().enumerate().map(column).collect();
    Shape { separator, decimal_comma: separator != b',', columns, above: data, preamble: names_at - skip }
}

/// The layout of a header without data: its most frequent separator counts.
fn header_alone(lines: &[&[u8]], skip: usize, separators: &[u8]) -> Option<Shape> {
    let at = (skip..lines.len()).find(|&i| !is_comment(lines[i]))?;
    let separator = separators.iter().copied().max_by_key(|s| lines[at].iter().filter(|b| *b == s).count())?;
    let names = Cells::new(separator).split(lines[at]).texts();
    Some(Shape { preamble: 0, ..named(vec![(at, names)], separator, at + 1, skip) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Shape {
        shape(text.as_bytes()).unwrap()
    }

    fn names(shape: &Shape) -> Vec<&str> {
        shape.columns.iter().map(|(n, _)| n.as_str()).collect()
    }

    #[test]
    fn separators_preambles_and_units() {
        let s = of("Measured by;A. Driver\nDate;2026-11-22\n\ntime;n;grade\ns;1/min;%\n0,01;1000,5;0\n");
        assert_eq!((s.separator, s.above, s.preamble, s.decimal_comma), (b';', 5, 3, true));
        assert_eq!(s.columns[1], ("n".into(), Some("1/min".into())));
        assert_eq!(s.columns[2], ("grade".into(), Some("%".into())));
        assert_eq!(names(&of("sep=;\nt;a\n0;1\n")), ["t", "a"]);
        assert_eq!(of("t,a\n0,1\n").separator, b',');
        assert_eq!(of("t\ta\n0\t1,5\n").separator, b'\t');
        let blanks = of("  t    speed\n  0.0   1.5\n  0.1   2.5\n");
        assert_eq!((blanks.separator, names(&blanks)), (b' ', vec!["t", "speed"]));
        assert_eq!(names(&of("# made by a tool\n# t,speed\n0,1\n1,2\n")), ["t", "speed"]);
    }

    #[test]
    fn a_column_of_words_and_time_stamps_are_data() {
        let s = of("stamp,gear,n\n2026-11-22T05:14:00.010,D,900\n");
        assert_eq!((s.above, names(&s)), (1, vec!["stamp", "gear", "n"]));
        let s = of("t,channel,v\n0.1,speed,3\n");
        assert_eq!(s.above, 1);
    }

    /// What common tools write in front of a table has numbers too, and sometimes as many cells as the table.
    #[test]
    fn tables_are_found_below_what_loggers_write_in_front() {
        let rows = |row: &dyn Fn(usize) -> String| (0..20).map(|k| row(k) + "\n").collect::<String>();
        let quoted = rows(&|k| format!("\"0.{k:02}\",\"{}\",\"12.5\"", 900 + k));
        let columns = |s: &Shape| s.columns.iter().map(|(n, u)| format!("{n}/{}", u.as_deref().unwrap_or(""))).collect::<Vec<_>>();

        // The names occur twice, below pairs of words and numbers.
        let above = "\"Format\",\"Table\"\n\"Date\",\"Sunday, November 22, 2026\"\n\"Sample Rate\",\"50\"\n\"Duration\",\"90.0\"\n\"Segment\",\"Session\"\n\n";
        let names = "\"Time\",\"RPM\",\"GPS Speed\"\n";
        let s = of(&format!("{above}{names}{names}\"s\",\"rpm\",\"km/h\"\n\n{quoted}"));
        assert_eq!((columns(&s), s.above, s.preamble), (vec!["Time/s".into(), "RPM/rpm".into(), "GPS Speed/km/h".into()], 10, 6));

        // Numbers and their units above the names, in as many cells as the table has.
        let above =
            "\"Format\",\"File\",\"\"\n\"Sample Rate\",\"100.000\",\"Hz\"\n\"Duration\",\"90.0\",\"s\"\n\"Range\",\"all\",\"of it\"\n\n";
        let s = of(&format!("{above}{names}\"s\",\"rpm\",\"km/h\"\n{quoted}"));
        assert_eq!((columns(&s), s.above), (vec!["Time/s".into(), "RPM/rpm".into(), "GPS Speed/km/h".into()], 7));

        // Sections with titles, and channel numbers above the names.
        let s = of(&format!(
            "Log File\nVersion: 1.0\n\n[Channels]\n0,12,13\nOffset,Engine RPM,Speed\ns,rpm,km/h\n\n[Data]\n{}",
            rows(&|k| format!("0.{k:02},{},12", 900 + k))
        ));
        assert_eq!((columns(&s), s.above), (vec!["Offset/s".into(), "Engine RPM/rpm".into(), "Speed/km/h".into()], 9));

        // Names, types, dimensions and units, below a first line of as many cells.
        let s = of(&format!(
            "Items\trecord\t0\nsamples\t20\ntime\tnmot\tvfzg\nf8\tf8\tf8\n1\t1\t1\ns\trpm\tkm/h\n{}",
            rows(&|k| format!("0.{k:02}\t{}\t12", 900 + k))
        ));
        assert_eq!((columns(&s), s.above), (vec!["time/s".into(), "nmot/rpm".into(), "vfzg/km/h".into()], 6));

        // Units, then the source of each channel.
        let s = of(&format!(
            "Made by a tool\nFormat,3\n\ntimestamp,rpm,speed\nunix time,rpm,m/s\n,obd,obd\n{}",
            rows(&|k| format!("0.{k:02},{},12", 900 + k))
        ));
        assert_eq!(columns(&s), ["timestamp/unix time", "rpm/rpm", "speed/m/s"]);
    }

    /// A table whose third row lacks a cell gets the layout of an undamaged one; the reader reports where it is damaged.
    #[test]
    fn a_damaged_table_is_one_all_the_same() {
        let s = of("t,a\n0,1\n1\n2,3\n");
        assert_eq!((names(&s), s.above), (vec!["t", "a"], 1));
    }

    #[test]
    fn a_header_alone() {
        let s = of("time_s,omega_f_rad_s\n");
        assert_eq!((s.separator, s.columns.len(), s.above), (b',', 2, 1));
        assert_eq!(shape(b""), None);
        assert_eq!(shape(b"\n\n"), None);
    }
}
