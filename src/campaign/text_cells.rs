//! The cells of a line of text: splitting, numbers, time stamps.

use super::units;
use csv_core::{ReadRecordResult, Reader, ReaderBuilder};
use jiff::civil::{Date, DateTime, Time};

/// Splits lines into cells; quotation marks are handled.
pub(crate) struct Cells {
    reader: Reader,
    separator: u8,
    buffer: Vec<u8>,
    ends: Vec<usize>,
    count: usize,
    blanks: Vec<u8>,
}

impl Cells {
    /// Splits at this separator; a blank stands for any number of blanks.
    pub fn new(separator: u8) -> Cells {
        let reader = ReaderBuilder::new().delimiter(separator).build();
        Cells { reader, separator, buffer: vec![0; 1024], ends: vec![0; 64], count: 0, blanks: Vec::new() }
    }

    /// Splits a line, without its end.
    pub fn split(&mut self, line: &[u8]) -> &Cells {
        if self.separator == b' ' {
            self.blanks.clear();
            for word in line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()) {
                self.blanks.extend_from_slice(word);
                self.blanks.push(b' ');
            }
            self.blanks.pop();
        }
        self.reader.reset();
        let (mut at, mut out, mut ends) = (0, 0, 0);
        loop {
            let input = if self.separator == b' ' { &self.blanks[at..] } else { &line[at..] };
            let (result, read, wrote, ended) = self.reader.read_record(input, &mut self.buffer[out..], &mut self.ends[ends..]);
            (at, out, ends) = (at + read, out + wrote, ends + ended);
            match result {
                ReadRecordResult::OutputFull => self.buffer.resize(2 * self.buffer.len(), 0),
                ReadRecordResult::OutputEndsFull => self.ends.resize(2 * self.ends.len(), 0),
                // The empty input that follows tells the reader that the line is over.
                ReadRecordResult::InputEmpty => {}
                ReadRecordResult::Record | ReadRecordResult::End => break,
            }
        }
        self.count = ends;
        self
    }

    /// Number of cells of the last line.
    pub fn len(&self) -> usize {
        self.count
    }

    /// A cell of the last line.
    pub fn cell(&self, k: usize) -> &[u8] {
        let start = if k == 0 { 0 } else { self.ends[k - 1] };
        &self.buffer[start..self.ends[k]]
    }

    /// All cells of the last line, trimmed.
    pub fn texts(&self) -> Vec<String> {
        (0..self.count).map(|k| text(self.cell(k)).trim().to_string()).collect()
    }
}

/// Whether a line is empty or a comment.
pub(crate) fn is_comment(line: &[u8]) -> bool {
    matches!(line.trim_ascii().first(), None | Some(b'#'))
}

/// Decodes UTF-8, or Latin-1 as older tools write it.
pub(crate) fn text(cell: &[u8]) -> String {
    std::str::from_utf8(cell).map_or_else(|_| cell.iter().map(|&b| b as char).collect(), str::to_string)
}

/// Words that mark a missing sample.
const MISSING: [&str; 12] = ["", "-", "--", "na", "n/a", "#n/a", "null", "none", "nan", "sna", "invalid", "error"];

/// A cell as a number; NaN if it marks a missing sample, `None` if it is text.
pub(crate) fn number(cell: &[u8], decimal_comma: bool) -> Option<f64> {
    let cell = cell.trim_ascii();
    let text = std::str::from_utf8(cell).ok()?;
    if let Ok(value) = text.parse::<f64>() {
        return Some(if value.is_finite() { value } else { f64::NAN });
    }
    if decimal_comma && cell.iter().filter(|&&b| b == b',').count() == 1 && !cell.contains(&b'.') {
        return text.replace(',', ".").parse().ok();
    }
    if !decimal_comma && is_grouped(text) {
        return text.replace(',', "").parse().ok();
    }
    MISSING.iter().any(|m| text.eq_ignore_ascii_case(m)).then_some(f64::NAN)
}

/// A cell as a number and the unit behind it. A single letter is not taken for a unit, because it may mean anything.
pub(crate) fn quantity(cell: &str, decimal_comma: bool) -> Option<(f64, &str)> {
    let end = cell.find(|c: char| !matches!(c, '0'..='9' | '.' | ',' | '+' | '-'))?;
    let (value, unit) = (number(&cell.as_bytes()[..end], decimal_comma)?, cell[end..].trim());
    let is_unit = (unit == "%" || unit.len() > 1) && units::parse(unit).is_some();
    Some((value, unit)).filter(|_| is_unit && end > 0)
}

/// Whether commas separate the thousands: `1,234.5`.
fn is_grouped(text: &str) -> bool {
    let whole = text.trim_start_matches('-').split('.').next().unwrap_or("");
    let groups: Vec<&str> = whole.split(',').collect();
    let digits = |g: &&str| !g.is_empty() && g.bytes().all(|b| b.is_ascii_digit());
    groups.len() > 1 && groups.iter().all(digits) && groups[0].len() <= 3 && groups[1..].iter().all(|g| g.len() == 3)
}

/// Number of characters behind the decimal point or comma of a cell. Fewer than usual in the last cell of a file mean that the number was cut off.
pub(crate) fn decimals(cell: &[u8], decimal_comma: bool) -> usize {
    cell.trim_ascii().iter().rev().position(|&b| b == b'.' || decimal_comma && b == b',').unwrap_or(0)
}

/// Nanoseconds of a day.
pub(crate) const DAY_NS: i128 = 86_400_000_000_000;

/// Whether a stamp is a time of day without a date, which restarts at midnight.
pub(crate) fn is_time_of_day(at: i128) -> bool {
    (0..DAY_NS).contains(&at)
}

/// A date with a time of day as nanoseconds since 1970, or a time of day alone as nanoseconds since midnight; `None` for anything else.
pub(crate) fn stamp(cell: &str) -> Option<i128> {
    let cell = cell.trim();
    if !cell.as_bytes().first().is_some_and(u8::is_ascii_digit) || !cell.contains(':') {
        return None;
    }
    if let Ok(instant) = cell.parse::<jiff::Timestamp>() {
        return Some(instant.as_nanosecond());
    }
    let point = cell.replace(',', ".");
    let day = Date::constant(1970, 1, 1);
    let civil = point
        .parse::<DateTime>()
        .or_else(|_| DateTime::strptime("%d.%m.%Y %H:%M:%S%.f", &point))
        .or_else(|_| DateTime::strptime("%Y/%m/%d %H:%M:%S%.f", &point))
        .or_else(|_| DateTime::strptime("%d-%b-%Y %H:%M:%S%.f", &point))
        .or_else(|_| DateTime::strptime("%m/%d/%Y %I:%M:%S%.f %p", &point))
        .or_else(|_| DateTime::strptime("%m/%d/%Y %H:%M:%S%.f", &point))
        .or_else(|_| {
            // Minutes and seconds are distinguished from hours and minutes by their fraction.
            let minutes = point.matches(':').count() == 1 && point.contains('.');
            let point = if minutes { format!("0:{point}") } else { point.clone() };
            let time = point
                .parse::<Time>()
                .or_else(|_| Time::strptime("%I:%M:%S%.f %p", &point))
                .or_else(|_| Time::strptime("%H:%M:%S%.f", &point));
            time.map(|t| t.on(day.year(), day.month(), day.day()))
        });
    Some(civil.ok()?.to_zoned(jiff::tz::TimeZone::UTC).ok()?.timestamp().as_nanosecond())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_of_lines() {
        let mut cells = Cells::new(b',');
        assert_eq!(cells.split(b"a,\"b, c\",,d").texts(), ["a", "b, c", "", "d"]);
        assert_eq!(cells.split(b"1,2").texts(), ["1", "2"]);
        assert_eq!(cells.split(b"\"open").len(), 1);
        let many = vec!["1234567"; 500].join(",");
        assert_eq!(cells.split(many.as_bytes()).len(), 500);
        assert_eq!(Cells::new(b' ').split(b"  1   2 3 ").texts(), ["1", "2", "3"]);
    }

    #[test]
    fn commas_between_thousands_are_none_of_the_number() {
        for (cell, value) in [
            ("1,234.5", Some(1234.5)),
            ("-12,345", Some(-12345.0)),
            ("1,234,567", Some(1_234_567.0)),
            ("1,23", None),
            ("1234,567", None),
            (",123", None),
        ] {
            assert_eq!(number(cell.as_bytes(), false), value, "{cell}");
        }
        assert_eq!(number(b"1,234", true), Some(1.234));
    }

    #[test]
    fn stamps_of_several_kinds_count_alike() {
        let seconds = |a: &str, b: &str| (stamp(b).unwrap() - stamp(a).unwrap()) as f64 * 1e-9;
        for (a, b) in [
            ("2026-11-22T05:14:00.000", "2026-11-22T05:14:01.250"),
            ("2026-11-22 05:14:00", "2026-11-22 05:14:01.25"),
            ("2026-11-22T05:14:00Z", "2026-11-22T05:14:01.250Z"),
            ("2026-11-22T05:14:00+01:00", "2026-11-22T05:14:01.250+01:00"),
            ("22.11.2026 05:14:00,000", "22.11.2026 05:14:01,250"),
            ("22-Nov-2026 05:14:00.000", "22-Nov-2026 05:14:01.250"),
            ("05:14:00.000", "05:14:01.250"),
            ("11/22/2026 12:59:59.500 AM", "11/22/2026 01:00:00.750 AM"),
            ("11:59:59.500 AM", "12:00:00.750 PM"),
            ("0:59.500", "1:00.750"),
        ] {
            assert_eq!(seconds(a, b), 1.25, "{a}");
        }
        for no in ["", "D", "12", "1:2:3:4", "3rd gear: on"] {
            assert_eq!(stamp(no), None, "{no}");
        }
    }
}
