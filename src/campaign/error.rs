//! Defects of a campaign: where each one is, what it is, and what to do about it.
//!
//! A [`CampaignError`] stops the reading: the folder, `vehicle.json`, `recordings.json` or the channel map is at fault, or
//! nothing usable is left. A [`RecordingError`] concerns one recording, which is left out for that reason.

use std::path::PathBuf;

use thiserror::Error;

use super::LeftOut;

/// Formats a time to the nanosecond, beyond which digits are rounding errors.
fn seconds(time: &f64) -> String {
    format!("{time:.9}").trim_end_matches('0').trim_end_matches('.').to_string()
}

/// Why a campaign can't be read at all.
#[derive(Debug, Error)]
pub enum CampaignError {
    /// There is no folder at the path.
    #[error("{}: no such folder. Give the folder that holds vehicle.json, recordings.json and the recordings", .0.display())]
    NoFolder(PathBuf),
    /// The path is a file.
    #[error("{}: this is a file. A campaign is a folder with vehicle.json, recordings.json and the recordings; give that folder. What a measurement file holds: kisspoint inspect", .0.display())]
    IsFile(PathBuf),
    /// One of the two JSON files is not there.
    #[error("{}: file not found. {remedy}", .file.display())]
    NoFile {
        /// The missing file.
        file: PathBuf,
        /// What to do.
        remedy: &'static str,
    },
    /// The operating system refused to read or write.
    #[error("{}: {source}. Check the path and its permissions", .file.display())]
    Io {
        /// The file concerned.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file is not JSON or not TOML.
    #[error("{}, line {line}, column {column}: {what}. Correct the {format} there", .file.display())]
    Syntax {
        /// The file concerned.
        file: PathBuf,
        /// Name of its format.
        format: &'static str,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What the parser said.
        what: String,
    },
    /// A file is JSON, but not of the expected structure.
    #[error("{}: {what}. {remedy}", .file.display())]
    Shape {
        /// The file concerned.
        file: PathBuf,
        /// What is wrong.
        what: String,
        /// What to do.
        remedy: String,
    },
    /// A recording's entry has an unknown key.
    #[error("{}: recording `{recording}` has a key `{key}` that is not known. {remedy}", .file.display())]
    UnknownKey {
        /// recordings.json.
        file: PathBuf,
        /// The recording's name.
        recording: String,
        /// The key.
        key: String,
        /// What to do.
        remedy: String,
    },
    /// A recording's entry lacks a key.
    #[error("{}: recording `{recording}` has no key `{key}`. Add `\"{key}\": {example}`", .file.display())]
    MissingKey {
        /// recordings.json.
        file: PathBuf,
        /// The recording's name.
        recording: String,
        /// The key that is missing.
        key: &'static str,
        /// An example of a value.
        example: &'static str,
    },
    /// A recording's entry holds an impossible value.
    #[error("{}: recording `{recording}`, key `{key}`: {value} {why}", .file.display())]
    WrongValue {
        /// recordings.json.
        file: PathBuf,
        /// The recording's name.
        recording: String,
        /// The key concerned.
        key: &'static str,
        /// The value.
        value: String,
        /// Why it is impossible, and what to do.
        why: &'static str,
    },
    /// The campaign exceeds a limit of what is read.
    #[error("{}: {count} {what} are more than the {most} that one campaign may have. {remedy}", .file.display())]
    TooMuch {
        /// recordings.json.
        file: PathBuf,
        /// What exceeds the limit.
        what: &'static str,
        /// Count so far.
        count: usize,
        /// Greatest count allowed.
        most: usize,
        /// What to do.
        remedy: &'static str,
    },
    /// recordings.json lists nothing.
    #[error("{}: lists no recording. Add one entry per recording, e.g. \"r01\": {{\"manoeuvre\": \"launch\", \"sample_rate_Hz\": 100, \"theta_c0_degC\": 25, \"theta_b0_degC\": 25}}", .0.display())]
    EmptyCampaign(PathBuf),
    /// The channel map is at fault.
    #[error("{file}: {what}. {remedy}")]
    ChannelMap {
        /// File of the map, or a word for where it came from.
        file: String,
        /// What is wrong.
        what: String,
        /// What to do.
        remedy: String,
    },
    /// A file cannot be used, and either only that file was asked for or nothing may be left out.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Every recording was left out.
    #[error("{}: no recording is usable{}", .dir.display(), lines(.left_out))]
    NothingUsable {
        /// The campaign's folder.
        dir: PathBuf,
        /// All of them, with reasons.
        left_out: Vec<LeftOut>,
    },
}

/// Lists the first few of the recordings that were left out below a message, one per line, and the number of the others.
pub fn lines(left_out: &[LeftOut]) -> String {
    let shown: String = left_out.iter().take(5).map(|l| format!("\n  {}", l.reason)).collect();
    let more = left_out.len().saturating_sub(5);
    if more > 0 { format!("{shown}\n  and {more} more") } else { shown }
}

/// Position of a defect in a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// File name, or the recording's name if there is no file.
    pub file: String,
    /// Channel as the file calls it, with our name where it differs.
    pub channel: Option<String>,
    /// Row, from 1, with the word that says what is counted: the line of a text file, the record of an MDF channel group.
    pub row: Option<(&'static str, u64)>,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.file)?;
        if let Some(channel) = &self.channel {
            write!(f, ", channel {channel}")?;
        }
        if let Some((word, row)) = self.row {
            write!(f, ", {word} {row}")?;
        }
        Ok(())
    }
}

/// Why one recording can't be used.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{place}: {defect}")]
pub struct RecordingError {
    /// Where it is.
    pub place: Box<Place>,
    /// What it is, and what to do.
    pub defect: Box<Defect>,
}

/// A defect of one recording; the message says what is wrong and what to do.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "each variant's message says what it and its fields mean")]
pub enum Defect {
    #[error(
        "recordings.json lists it, but there is no such file with the ending .csv, .txt, .dat, .mf4 or .parquet. Add the file or remove the entry"
    )]
    NoFile,
    #[error("there are several files of that name: {0}. Keep one of them")]
    SeveralFiles(String),
    #[error(
        "recordings.json does not list it. Add an entry with manoeuvre, sample_rate_Hz, theta_c0_degC and theta_b0_degC, or move the file away"
    )]
    NotListed,
    #[error("holds the same bytes as {0}; counting one measurement twice would make the intervals too narrow. Remove one of the two")]
    SameAs(String),
    #[error("can't be read: {0}. Check the path and its permissions")]
    Unreadable(String),
    #[error("the file is empty. Export the recording again")]
    Empty,
    #[error("line {line} is longer than {} MB, so that this is no table of numbers. Export the recording again", .most >> 20)]
    LongLine { line: u64, most: usize },
    #[error("the file has more than {0} rows, which is more than is read. Split it, or export a part of it or at a lower rate")]
    TooManyRows(u64),
    #[error("there is a header but no row of data. Export the recording again")]
    NoRows,
    #[error("the file is not text: it holds bytes that no text has. Give it the ending that fits, or export it as CSV, MDF4 or Parquet")]
    NotText,
    #[error("its lines end with carriage returns alone. Save it with line feeds, e.g. tr '\\r' '\\n' < FILE > r01.csv")]
    CarriageReturns,
    #[error(
        "the line holds numbers where the names of the channels are expected. Add a line with the names above it, e.g. time_s,omega_f_rad_s,…"
    )]
    NoHeader,
    #[error("the file is compressed. Unpack it, e.g. with {0}, and give the file that comes out")]
    Compressed(&'static str),
    #[error(
        "recordings.json lists it, but files with this ending are not read. Give it the ending .csv, .txt, .dat, .mf4 or .parquet if it is such a file, or export it as one"
    )]
    OtherEnding,
    #[error("the file is {found}, not {expected}. Give it the ending that fits, or export it again")]
    WrongFormat { found: &'static str, expected: &'static str },
    #[error("MDF version {0} is older than 4. Convert it, e.g. with asammdf: MDF(file).convert(\"4.10\").save(file)")]
    OldMdf(String),
    #[error("{0}. Save the file as MDF 4.10 without it, e.g. with asammdf: MDF(file).save(file)")]
    Unsupported(String),
    #[error(
        "the file is a workbook, which is not read. Save the sheet as CSV (UTF-8), or in Python: pandas.read_excel(file).to_csv(\"r01.csv\", index=False)"
    )]
    Workbook,
    #[error(
        "the file holds raw frames ({0}), not signals. Decode them: write them as MDF4 with python-can, `can_logconvert FILE r01.mf4`, if they are in another format, and name the bus's database with `dbc = \"car.dbc\"` in a channel map, or with --dbc"
    )]
    RawFrames(&'static str),
    #[error("the database {dbc} can't be read: {why}. Give a DBC file")]
    Database { dbc: String, why: String },
    #[error("the file is damaged or cut short: {0}. Copy it again from the recorder, or export it again")]
    Damaged(String),
    #[error(
        "no channel for {column} ({unit}): `{wanted}` is not in the file, which has {there}. Export it too, or say which channel it is in a channel map, which `kisspoint inspect FILE --draft-map MAP` drafts and `--channel-map MAP` reads"
    )]
    MissingChannel { column: &'static str, unit: &'static str, wanted: String, there: String },
    #[error("the name occurs {count} times ({places}). Rename one, or give `group` in the channel map")]
    DuplicateChannel { count: usize, places: String },
    #[error("is already taken for {0}. Name another channel in the channel map")]
    TakenTwice(&'static str),
    #[error("no channel is the clock. Call the one that is `time`, `t` or `timestamp`, or save the file with a time master for each group")]
    NoMaster,
    #[error("\"{0}\" is not a number. Correct the cell, or leave it empty if the sample is missing")]
    NotANumber(String),
    #[error("the row has {found} cells where the header has {expected}. Correct the row or export the recording again")]
    RaggedRow { found: usize, expected: usize },
    #[error(
        "the unit \"{unit}\" is not known for {quantity}. Use one of {known}, or give `unit`, or `scale` and `offset`, in a channel map"
    )]
    UnknownUnit { unit: String, quantity: &'static str, known: &'static str },
    #[error(
        "the unit \"{unit}\" can't be right: the channel is {quantity}. Use one of {known}, or check that the channel map names the right channel"
    )]
    WrongQuantity { unit: String, quantity: &'static str, known: &'static str },
    #[error(
        "\"{0}\" is a road speed. Give `tyre_radius_m` and `ratio`, gear times final drive, in a channel map or, gear by gear, in recordings.json; `kisspoint survey` finds both"
    )]
    RoadSpeed(String),
    #[error(
        "the channel map has a tyre_radius_m for it, so it is a road speed, but no unit is stated. Add unit = \"km/h\", \"m/s\" or \"mph\" to its entry in the channel map"
    )]
    RoadSpeedUnit,
    #[error("the torque is a percentage. Give `reference_Nm`, what 100 % are, and `kind`, \"brake\" or \"indicated\", in a channel map")]
    Percentage,
    #[error("the window of {from} to {to} s holds no sample; the file has {first:.3} to {last:.3} s. Correct window_s in recordings.json")]
    EmptyWindow { from: f64, to: f64, first: f64, last: f64 },
    #[error(
        "{0} is taken from the same file; counting one measurement twice would make the intervals too narrow. Give both a window_s, apart from each other"
    )]
    SharedWindow(String),
    #[error(
        "{first} says the unit is {first_unit}, {second} says {second_unit}. Correct the one that is wrong; a channel map can state the unit together with `scale = 1` to overrule the file"
    )]
    UnitContradiction { first: &'static str, first_unit: String, second: &'static str, second_unit: String },
    #[error("the unit can't be right: {what}. {remedy}")]
    UnitCannotBeRight { what: String, remedy: String },
    #[error(
        "in most recordings the unit of {channel} can't be right, see {recording}; this one comes from the same logger. Correct the channel map, or move the recordings with another unit away"
    )]
    SameUnitCannotBeRight { recording: String, channel: String },
    #[error("the clock runs back from {} s to {} s. Remove or re-sort the rows, or split the file there", seconds(.from), seconds(.to))]
    ClockBack { from: f64, to: f64 },
    #[error("the time {} s occurs twice. Remove the repeated row", seconds(.0))]
    ClockRepeats(f64),
    #[error("the time is missing or not a finite number. Correct it or remove the row")]
    ClockInvalid,
    #[error("the clock ticks at {rate_hz:.4} Hz where recordings.json says {stated_hz} Hz. Check the unit of the time channel{hint}")]
    ClockUnit { rate_hz: f64, stated_hz: f64, hint: &'static str },
    #[error("the samples come at {0:.3} Hz; below 20 Hz an engagement can't be followed. Record at 100 Hz or faster")]
    TooSlow(f64),
    #[error("the recording ends here, {seconds:.3} s after its start; 0.5 s or more are needed. Record longer, or remove the entry")]
    TooShort { seconds: f64 },
    #[error(
        "the samples are missing or not a number for {seconds:.3} s from here on; {kept:.3} s remain in front of them and 0.5 s are needed. Record again, or export the channel without the gap"
    )]
    Gap { seconds: f64, kept: f64 },
    #[error(
        "starts {seconds:.3} s after the other channels. Engine and actuator are known to be at rest only where a recording starts, so that part can't be dropped: export all channels from the same moment"
    )]
    LateStart { seconds: f64 },
    #[error("not one valid sample. Check the sensor and the export")]
    NothingValid,
    #[error("the value is {value} in every sample: the sensor was frozen or not connected. Check the sensor, or remove the recording")]
    Frozen { value: f64 },
    #[error(
        "the engine torque is {value} N·m in every sample of every recording: the channel was frozen or not connected. Map the right channel to T_e_Nm; a torque that is known to be constant stands in the channel map as T_e_Nm = {{ value = {value} }}"
    )]
    StillTorque { value: f64 },
    #[error(
        "constant input: engine torque and commanded position never change, so the recording shows nothing. Remove it, or export the right channels"
    )]
    ConstantInput,
    #[error(
        "constant input: the commanded position is {value} mm throughout, which is no {manoeuvre}. Export the channel that the TCU commands, or correct the manoeuvre"
    )]
    ConstantCommand { value: f64, manoeuvre: String },
}

impl Defect {
    /// Places the defect in a file.
    pub fn in_file(self, file: &str) -> RecordingError {
        RecordingError { place: Box::new(Place { file: file.to_string(), channel: None, row: None }), defect: Box::new(self) }
    }

    /// Places the defect at a channel of a file and, if given, a row.
    pub fn at(self, file: &str, channel: impl Into<String>, row: Option<(&'static str, u64)>) -> RecordingError {
        RecordingError { place: Box::new(Place { file: file.to_string(), channel: Some(channel.into()), row }), defect: Box::new(self) }
    }
}
