//! Long tables: one row per sample with time, channel and value, and perhaps a unit. Every channel has stamps of its own.

use std::collections::HashMap;
use std::io::Read;

use super::csv::{Column, Lines, ragged};
use super::error::{Defect, RecordingError};
use super::table::{Group, Measurement, Rows, Series, Wanted};
use super::text_cells::{Cells, decimals, is_comment, text};
use super::text_shape::Shape;
use super::{guess, units};

/// Which column of a long table is which.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Roles {
    time: usize,
    channel: usize,
    value: usize,
    unit: Option<usize>,
}

/// The roles of the columns, if their names are those of a long table.
pub(crate) fn roles(shape: &Shape) -> Option<Roles> {
    let at = |names: &[&str]| shape.columns.iter().position(|(name, _)| names.iter().any(|n| name.eq_ignore_ascii_case(n)));
    let time = shape.columns.iter().position(|(name, unit)| guess::is_time(name, unit.as_deref()))?;
    let channel = at(&["channel", "signal", "name", "variable", "parameter", "kanal", "signal_name", "channel_name", "pid"])?;
    let value = at(&["value", "v", "val", "wert", "y"])?;
    let unit = at(&["unit", "units", "einheit"]);
    // If there is a column of units, any other columns may follow, such as the position of the car.
    (shape.columns.len() <= 4 || unit.is_some()).then_some(Roles { time, channel, value, unit })
}

/// Reads a long table: one group per channel, with the rows of each counted separately.
pub(crate) fn read<R: Read>(
    file: &str,
    shape: &Shape,
    roles: Roles,
    lines: &mut Lines<R>,
    wanted: Wanted<'_>,
) -> Result<Measurement, RecordingError> {
    let mut cells = Cells::new(shape.separator);
    let mut groups: Vec<Option<Samples>> = Vec::new();
    let mut known: HashMap<Vec<u8>, usize> = HashMap::new();
    let mut m = Measurement { rows: Rows::Table, ..Measurement::default() };
    let (time_name, time_unit) = &shape.columns[roles.time];
    // Dates count from the first row of the file, so that all channels have the same origin.
    let mut clock = Column::new(time_name, time_unit.as_deref(), roles.time);
    // Channel of the last row, if the file ends without a line feed.
    let mut unended = None;
    while let Some(line) = lines.next().map_err(|d| d.in_file(file))? {
        if is_comment(line) {
            continue;
        }
        if cells.split(line).len() != shape.columns.len() {
            if !lines.ended {
                m.notes.push(format!("line {} (the last) was cut off while writing, dropped", lines.number));
                break;
            }
            return Err(ragged(file, lines.number, cells.len(), shape.columns.len()));
        }
        clock.push(cells.cell(roles.time), shape.decimal_comma);
        let at = *known.entry(cells.cell(roles.channel).to_vec()).or_insert_with(|| {
            let (name, bracket) = units::split_header(&text(cells.cell(roles.channel)));
            let unit = bracket.or_else(|| roles.unit.map(|u| text(cells.cell(u)).trim().to_string()).filter(|u| !u.is_empty()));
            let column = Column::new(&name, unit.as_deref(), roles.value);
            groups.push(wanted(&name).then(|| Samples { time: Vec::new(), column, decimals: [0; 2] }));
            m.names.push(name);
            groups.len() - 1
        });
        if let Some(group) = &mut groups[at] {
            group.time.push(clock.series.values.last().copied().unwrap_or(f64::NAN));
            group.column.push(cells.cell(roles.value), shape.decimal_comma);
            group.decimals = [group.decimals[1], decimals(cells.cell(shape.columns.len() - 1), shape.decimal_comma)];
        }
        unended = (!lines.ended).then_some(at);
    }
    if let Some(group) = unended.and_then(|at: usize| groups[at].as_mut()).filter(|group| group.is_cut_off()) {
        group.time.pop();
        group.column.pop();
        clock.pop();
        m.notes.push(format!("line {} (the last) ends inside a number: cut off while writing, dropped", lines.number));
    }
    if m.names.is_empty() {
        return Err(Defect::NoRows.in_file(file));
    }
    m.notes.extend(clock.midnight());
    if let Some((row, word)) = clock.series.text {
        return Err(Defect::NotANumber(word).at(file, time_name.as_str(), Some(("row", row as u64 + 1))));
    }
    let unit = clock.series.unit;
    m.groups = groups.into_iter().flatten().enumerate().map(|(index, rows)| rows.group(index, time_name, unit.clone())).collect();
    Ok(m)
}

/// The samples of one channel.
struct Samples {
    time: Vec<f64>,
    column: Column,
    /// Numbers of decimals in the last cells of its last row but one and of its last row.
    decimals: [usize; 2],
}

impl Samples {
    /// Whether its last row ends inside a number, provided that nothing follows that row.
    fn is_cut_off(&self) -> bool {
        self.time.len() > 2 && self.decimals[1] < self.decimals[0]
    }

    fn group(self, index: usize, time_name: &str, unit: Option<String>) -> Group {
        let name = self.column.series.name.clone();
        let time = Series { name: time_name.to_string(), unit, values: self.time, text: None };
        Group { name, index, master: Some(0), series: vec![time, self.column.series] }
    }
}
