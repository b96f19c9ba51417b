//! Logs of VCDS: measuring blocks side by side, each with stamps of its own, below a header of `TIME` over `STAMP`.
//!
//! Its older logs have the names in the row of `TIME` and the one above it, and the units in the row of `STAMP`; its newer ones have the names in the
//! row of `STAMP`, and the units below it. Rows above the data have varying numbers of cells.

use super::text_cells::Cells;
use super::text_shape::{Shape, is_data};

/// The layout, if one line has `STAMP` wherever the line above it has `TIME`.
pub(crate) fn shape(lines: &[&[u8]]) -> Option<Shape> {
    [b',', b';', b'\t'].into_iter().find_map(|separator| with_separator(lines, separator))
}

/// Number of lines within which the data must begin.
const HEAD: usize = 50;

fn with_separator(lines: &[&[u8]], separator: u8) -> Option<Shape> {
    let mut cells = Cells::new(separator);
    let rows: Vec<Vec<String>> = lines.iter().take(HEAD).map(|line| cells.split(line).texts()).collect();
    let places = |row: usize, word: &str| (0..rows[row].len()).filter(|k| rows[row][*k] == word).collect::<Vec<_>>();
    let is_head = |at: &usize| {
        let stamps = places(*at, "STAMP");
        !stamps.is_empty() && stamps == places(at - 1, "TIME")
    };
    let at = (1..rows.len()).find(is_head)?;
    let decimal_comma = separator != b',';
    let data = (at + 1..rows.len()).find(|&below| is_data(&rows[below], decimal_comma))?;
    let units_below = data > at + 1;
    let cell = |row: Option<usize>, k: usize| row.and_then(|r| rows[r].get(k)).cloned().unwrap_or_default();
    let stamp = |k: usize| cell(Some(at), k);
    let column = |k: usize| match stamp(k).as_str() {
        "STAMP" => ("TIME".to_string(), Some("s".to_string())),
        name if units_below => (name.to_string(), stated(cell(Some(at + 1), k))),
        // The first column holds marks of rows.
        name if k == 0 => (name.to_string(), None),
        unit => (format!("{} {}", cell(at.checked_sub(2), k), cell(Some(at - 1), k)).trim().to_string(), stated(unit.to_string())),
    };
    let columns = (0..rows[data].len()).map(column).collect();
    Some(Shape { separator, decimal_comma, columns, above: data, preamble: at - if units_below { 1 } else { 2.min(at) } })
}

/// A unit, if there is one; an asterisk stands for the degree sign.
fn stated(unit: String) -> Option<String> {
    Some(unit.replace('*', "°")).filter(|u| !u.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn columns(text: &str) -> (Vec<String>, usize, usize) {
        let lines: Vec<&[u8]> = text.lines().map(str::as_bytes).collect();
        let s = shape(&lines).unwrap();
        (s.columns.iter().map(|(n, u)| format!("{n}/{}", u.as_deref().unwrap_or(""))).collect(), s.above, s.preamble)
    }

    #[test]
    fn names_in_two_rows_above_the_units() {
        let head = "Monday,2,March,2026,12:00:00,Version 1\nX,,engine\n\n,Group A:,'001,,Group B:,'005\n";
        let names = ",,Engine Speed,Coolant,,Vehicle,\n,TIME,,Temp,TIME,Speed,\nMarker,STAMP, /min, *C,STAMP, km/h,\n";
        let (found, above, preamble) = columns(&format!("{head}{names},0.00,800,90,0.10,0,\n"));
        assert_eq!(found, ["Marker/", "TIME/s", "Engine Speed//min", "Coolant Temp/°C", "TIME/s", "Vehicle Speed/km/h", "/"]);
        assert_eq!((above, preamble), (7, 4));
    }

    #[test]
    fn names_in_one_row_above_the_units() {
        let head = "Monday,2,March,2026,12:00:00,Version 2\nX,,engine\n,,G004,F0,G008,F0\n\n";
        let names = "Marker,TIME,Loc. 21,TIME,Loc. 75\n,STAMP,Engine speed,STAMP,Vehicle speed\n,, /min,, km/h\n";
        let (found, above, preamble) = columns(&format!("{head}{names},0.00,800,0.10,0\n"));
        assert_eq!(found, ["/", "TIME/s", "Engine speed//min", "TIME/s", "Vehicle speed/km/h"]);
        assert_eq!((above, preamble), (7, 4));
    }

    #[test]
    fn no_other_table_is_taken_for_one() {
        for other in ["TIME,STAMP\n0,1\n", "STAMP,a\n0,1\n", "TIME,a\n,STAMP\n0,1\n", "TIME,a\nSTAMP,b\n", "", "\n\n"] {
            let lines: Vec<&[u8]> = other.lines().map(str::as_bytes).collect();
            assert_eq!(shape(&lines), None, "{other}");
        }
    }
}
