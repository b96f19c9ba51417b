//! How a text file is laid out: separator, decimal comma, lines in front of the header, names, units, and where the data begin.
//!
//! The data begin at the first line that consists mostly of numbers and has as many cells as a line of names above it; the separator that
//! gives most cells wins. Between names and data there may be rows of units or other words. `sep=;` in the first line settles the separator.

use super::text_cells::{Cells, is_comment, number, stamp};
use super::units;

/// The layout of a text file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Shape {
    /// Between cells; a blank stands for any number of them.
    pub separator: u8,
    /// Whether `1,5` is a number.
    pub decimal_comma: bool,
    /// Names and, from brackets or a row of their own, units.
    pub columns: Vec<(String, Option<String>)>,
    /// Lines up to the first one of data.
    pub above: usize,
    /// Lines in front of the names that say something else.
    pub preamble: usize,
}

/// Lays out a file by its first lines; `None` if there is no line at all.
pub(crate) fn shape(head: &[u8]) -> Option<Shape> {
    let lines: Vec<&[u8]> = head.split(|&b| b == b'\n').map(|l| l.strip_suffix(b"\r").unwrap_or(l)).collect();
    let first = lines.iter().position(|l| !is_comment(l))?;
    let stated = lines[first].trim_ascii().strip_prefix(b"sep=").and_then(|s| s.first().copied());
    let separators = stated.map_or_else(|| vec![b'\t', b';', b',', b' '], |s| vec![s]);
    let skip = if stated.is_some() { first + 1 } else { 0 };
    let found = separators.iter().rev().filter_map(|&s| with_separator(&lines, skip, s)).max_by_key(|shape| shape.columns.len());
    found.or_else(|| header_alone(&lines, skip, &separators))
}

/// The layout if this is the separator.
fn with_separator(lines: &[&[u8]], skip: usize, separator: u8) -> Option<Shape> {
    let decimal_comma = separator != b',';
    let mut cells = Cells::new(separator);
    // Rows of words above, as line and cells: all of them have the same number of cells.
    let mut words: Vec<(usize, Vec<String>)> = Vec::new();
    for (at, line) in lines.iter().enumerate().skip(skip) {
        // Some tools put the names into the last comment.
        let comment = line.trim_ascii().strip_prefix(b"#");
        if line.trim_ascii().is_empty() || comment.is_some_and(|c| !matches_data(lines, at, c, separator)) {
            continue;
        }
        let row = cells.split(comment.map_or(*line, |c| c.trim_ascii())).texts();
        let numbers = row.iter().filter(|c| is_number(c, decimal_comma)).count();
        let there = row.iter().filter(|c| !c.is_empty()).count();
        if 2 * numbers >= there && numbers > 0 {
            if words.first().is_some_and(|(_, names)| names.len() == row.len()) {
                return Some(named(words, separator, at, skip));
            }
            words.clear();
        } else {
            words.retain(|(_, other)| other.len() == row.len());
            words.push((at, row));
        }
    }
    None
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

/// The layout from the rows of words above the data: names first, units in any of the others.
fn named(words: Vec<(usize, Vec<String>)>, separator: u8, data: usize, skip: usize) -> Shape {
    let is_units = |row: &Vec<String>| row.iter().any(|c| units::parse(c).is_some()) && row.iter().all(|c| c.len() < 16);
    let (names_at, names) = &words[0];
    let stated = words[1..].iter().map(|(_, row)| row).find(|row| is_units(row));
    let column = |(k, name): (usize, &String)| {
        let (name, bracket) = units::split_header(name);
        let below = stated.map(|row| row[k].trim().trim_matches(['[', ']', '(', ')']).to_string());
        (name, bracket.or(below.filter(|u| !matches!(u.as_str(), "" | "-"))))
    };
    let columns = names.iter().enumerate().map(column).collect();
    Shape { separator, decimal_comma: separator != b',', columns, above: data, preamble: names_at - skip }
}

/// A header without data: its commonest separator.
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

    #[test]
    fn a_header_alone() {
        let s = of("time_s,omega_f_rad_s\n");
        assert_eq!((s.separator, s.columns.len(), s.above), (b',', 2, 1));
        assert_eq!(shape(b""), None);
        assert_eq!(shape(b"\n\n"), None);
    }
}
