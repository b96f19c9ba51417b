//! A measurement file as read, before anything in it is checked: groups of series that share a clock.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::error::{Defect, RecordingError};
use super::text_cells::text;

/// Contents of a file. An MDF file has one group per rate, a long text table one per channel, a text file with blocks side by side one per block, and any other file one in all.
#[derive(Debug, Default)]
pub(crate) struct Measurement {
    /// File name, for messages.
    pub file: String,
    /// Groups in the order of the file.
    pub groups: Vec<Group>,
    /// Names of all channels, including those that were not decoded.
    pub names: Vec<String>,
    /// How rows are counted.
    pub rows: Rows,
    /// What the reader did and the user should know of.
    pub notes: Vec<String>,
}

/// Series with one clock.
#[derive(Debug, Default)]
pub(crate) struct Group {
    /// Name, may be empty.
    pub name: String,
    /// Index in the file.
    pub index: usize,
    /// Index of the clock in `series`, if the format states it.
    pub master: Option<usize>,
    /// Its channels.
    pub series: Vec<Series>,
}

/// One channel; a missing or invalid sample is NaN.
#[derive(Clone, Debug, Default)]
pub(crate) struct Series {
    /// Name without a unit in brackets.
    pub name: String,
    /// Unit as the file states it.
    pub unit: Option<String>,
    /// Samples.
    pub values: Vec<f64>,
    /// First cell that holds text: sample and text.
    pub text: Option<(usize, String)>,
}

/// How to name the row of a sample.
#[derive(Debug, Default)]
pub(crate) enum Rows {
    /// Lines of a text file, one per sample.
    Lines(Vec<u32>),
    /// Records of an MDF group, from 1.
    Records,
    /// Rows of a table, from 1.
    #[default]
    Table,
}

/// Which series a reader must decode: those whose name satisfies the predicate.
pub(crate) type Wanted<'a> = &'a dyn Fn(&str) -> bool;

impl Measurement {
    /// The row of a sample, for messages.
    pub fn row(&self, sample: usize) -> Option<(&'static str, u64)> {
        match &self.rows {
            Rows::Lines(lines) => lines.get(sample).map(|&line| ("line", u64::from(line))),
            Rows::Records => Some(("record", sample as u64 + 1)),
            Rows::Table => Some(("row", sample as u64 + 1)),
        }
    }

    /// The row of a sample as a text.
    pub fn row_text(&self, sample: usize) -> String {
        self.row(sample).map_or_else(String::new, |(word, row)| format!("{word} {row}"))
    }

    /// Position of a series, for messages.
    pub fn place(&self, group: usize, at: usize, series: &Series) -> String {
        match (self.groups.len(), self.groups[group].name.as_str()) {
            (1, _) => format!("`{}` at position {}", series.name, at + 1),
            (_, "") => format!("`{}` in group {}", series.name, self.groups[group].index),
            (_, name) => format!("`{}` in group {} \"{name}\"", series.name, self.groups[group].index),
        }
    }

    /// A defect of the file.
    pub fn defect(&self, defect: Defect) -> RecordingError {
        defect.in_file(&self.file)
    }

    /// A defect at a channel and, where it applies, a sample.
    pub fn defect_at(&self, defect: Defect, channel: &str, sample: Option<usize>) -> RecordingError {
        defect.at(&self.file, channel, sample.and_then(|i| self.row(i)))
    }
}

/// Which format a file is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Text,
    Mdf,
    Parquet,
}

impl Format {
    /// File endings that are read.
    pub const ENDINGS: [(&'static str, Format); 7] = [
        ("csv", Format::Text),
        ("txt", Format::Text),
        ("dat", Format::Text),
        ("tsv", Format::Text),
        ("mf4", Format::Mdf),
        ("parquet", Format::Parquet),
        ("pq", Format::Parquet),
    ];

    /// Format by the file's extension.
    pub fn from_ending(ending: &str) -> Option<Format> {
        let lower = ending.to_ascii_lowercase();
        Self::ENDINGS.iter().find(|(e, _)| *e == lower).map(|(_, f)| *f)
    }

    /// Format by the file's first bytes; anything without a signature counts as text.
    pub fn from_bytes(bytes: &[u8]) -> Format {
        match bytes {
            [b'M', b'D', b'F', b' ', ..] | [b'U', b'n', b'F', b'i', b'n', b'M', b'F', ..] => Format::Mdf,
            [b'P', b'A', b'R', b'1', ..] => Format::Parquet,
            _ => Format::Text,
        }
    }

    /// Name of the format, for messages.
    pub fn name(self) -> &'static str {
        match self {
            Format::Text => "a text file",
            Format::Mdf => "an MDF file",
            Format::Parquet => "a Parquet file",
        }
    }
}

/// Recognises files of other kinds by their extension or first bytes; the defect says what to do with them.
fn other_kind(path: &Path, head: &[u8]) -> Option<Defect> {
    let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    // Many tools use .log or .asc for their tables, so that the first line decides.
    let line = text(head).trim_start().to_ascii_lowercase();
    let frames = match ending.as_str() {
        "blf" => Some("Vector BLF"),
        "trc" => Some("PCAN TRC"),
        _ if head.starts_with(b"LOGG") => Some("Vector BLF"),
        _ if line.starts_with(";$fileversion") => Some("PCAN TRC"),
        _ if line.starts_with("date ") || line.starts_with("base hex") || line.starts_with("base dec") => Some("Vector ASC"),
        _ if is_candump(&line) => Some("candump"),
        _ => None,
    };
    let unpack = match head {
        [0x1f, 0x8b, ..] => Some("gunzip"),
        [b'B', b'Z', b'h', ..] => Some("bunzip2"),
        [0xfd, b'7', b'z', b'X', b'Z', ..] => Some("unxz"),
        [0x28, 0xb5, 0x2f, 0xfd, ..] => Some("unzstd"),
        _ if ending == "zip" => Some("unzip"),
        _ => None,
    };
    if let Some(tool) = unpack {
        return Some(Defect::Compressed(tool));
    }
    match (frames, ending.as_str()) {
        (Some(kind), _) => Some(Defect::RawFrames(kind)),
        (None, "xlsx" | "xlsm" | "xls" | "ods") => Some(Defect::Workbook),
        (None, "mdf") if head.starts_with(b"MDF     3") || head.starts_with(b"MDF     2") => Some(Defect::OldMdf(text(&head[8..12]))),
        _ if head.starts_with(b"PK\x03\x04") => Some(Defect::Workbook),
        _ => None,
    }
}

/// Whether a line is a frame as candump writes it: `(1674148739.212264) can0 112#FF0015`.
fn is_candump(line: &str) -> bool {
    let stamp = line.strip_prefix('(').and_then(|rest| rest.split_once(')'));
    stamp.is_some_and(|(time, rest)| time.trim().parse::<f64>().is_ok() && rest.lines().next().is_some_and(|l| l.contains('#')))
}

/// Name of a file in messages.
pub(crate) fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(|| path.display().to_string(), |n| n.to_string_lossy().into_owned())
}

/// Format of a file, by its first bytes; an extension that belongs to another format is a defect.
pub(crate) fn format(path: &Path) -> Result<Format, RecordingError> {
    let file = file_name(path);
    let mut head = Vec::new();
    let read = File::open(path).and_then(|f| f.take(64).read_to_end(&mut head));
    read.map_err(|e| Defect::Unreadable(e.to_string()).in_file(&file))?;
    if head.is_empty() {
        return Err(Defect::Empty.in_file(&file));
    }
    if let Some(defect) = other_kind(path, &head) {
        return Err(defect.in_file(&file));
    }
    let found = Format::from_bytes(&head);
    match path.extension().and_then(|e| Format::from_ending(&e.to_string_lossy())) {
        Some(expected) if expected != found => {
            let found = if found == Format::Text { "text or of an unknown kind" } else { found.name() };
            Err(Defect::WrongFormat { found, expected: expected.name() }.in_file(&file))
        }
        _ => Ok(found),
    }
}

/// Receives the progress as a share.
pub(crate) type Tell<'a> = &'a dyn Fn(f64);

/// Reads a file with the reader for its format; a database (DBC) turns frames of a CAN bus into signals.
pub(crate) fn read(path: &Path, dbc: Option<&Path>, wanted: Wanted<'_>, tell: Tell<'_>) -> Result<Measurement, RecordingError> {
    let file = file_name(path);
    let mut read = match format(path)? {
        Format::Text => super::csv::read(&file, path, wanted, tell),
        Format::Mdf => super::mdf::read(&file, path, dbc, wanted, tell),
        Format::Parquet => super::parquet::read(&file, path, wanted, tell),
    }?;
    super::guess::units_of_clocks(&mut read);
    Ok(read)
}
