//! A campaign: one vehicle and several recordings of it.
//!
//! [`read`] takes a folder with `vehicle.json`, `recordings.json` and one CSV, MDF4 or Parquet file per recording. A defect of
//! the two JSON files or of the channel map is an error. A defect of one recording leaves that recording out with the reason,
//! unless none remains or [`ReadOptions::strict`] is set. Whatever is held, cut, converted or left out is noted, and nothing is
//! interpolated: the rows of a recording are real samples.
//!
//! A file passes through these stages: bytes, [`table`] (csv, mdf, parquet), [`pick`] (channel map, units), [`checks`], [`span`] (with [`clock`]),
//! [`raster`], [`assemble`] (with [`rows`]), [`Recording`].

mod assemble;
mod channel_map;
mod channels;
mod checks;
mod clock;
mod csv;
mod doubt;
mod error;
mod folder;
mod guess;
mod inspect;
mod limits;
mod log;
mod manifest;
mod mdf;
mod parquet;
mod pick;
mod raster;
mod repeats;
mod rows;
mod span;
mod table;
mod text_cells;
mod text_long;
mod text_shape;
mod text_stamps;
mod thrift;
mod units;
mod write;

use std::ops::Range;
use std::path::PathBuf;

pub use channel_map::{ChannelMap, Mapped, TorqueKind};
pub use channels::{CHANNELS, Channel, Lasting, Presence, Spec};
pub use error::{CampaignError, Defect, Place, RecordingError, lines};
pub use folder::{read, read_one, read_telling};
pub use inspect::{ChannelInfo, Inspection, draft_channel_map, inspect};
pub use log::{Log, LogChannel, open};
pub use manifest::draft as draft_recordings;
pub(crate) use span::{SLOWEST_HZ, is_slow};
pub use units::{Quantity, Unit, parse as parse_unit};
pub use write::{write_csv, write_recordings_json};

/// One vehicle and the recordings of it that can be used.
#[derive(Clone, Debug)]
pub struct Campaign {
    /// The campaign's folder.
    pub dir: PathBuf,
    /// The vehicle file.
    pub vehicle_path: PathBuf,
    /// Its contents.
    pub vehicle_json: serde_json::Value,
    /// The recordings, sorted by name.
    pub recordings: Vec<Recording>,
    /// Recordings and files that could not be used, and why.
    pub left_out: Vec<LeftOut>,
    /// Notes on what was done to the recordings that are used.
    pub notes: Vec<Note>,
    /// SHA-256, in hex, over names and contents of all files that were read and over the channel map.
    pub fingerprint: String,
}

/// A recording that is not used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// Name of the recording, or of a file that is not listed.
    pub recording: String,
    /// File, channel, row, what is wrong and what to do.
    pub reason: String,
}

impl LeftOut {
    /// A line for a terminal. The name is not repeated if the reason begins with it or with the name of the recording's file.
    fn line(&self) -> String {
        let LeftOut { recording, reason } = self;
        let named = reason.strip_prefix(recording.as_str()).is_some_and(|rest| rest.starts_with(['.', ',', ':']));
        if named { format!("left out: {reason}\n") } else { format!("left out: {recording}: {reason}\n") }
    }
}

/// Note on a recording without a commanded position.
pub const NO_POSITION: &str = "x_to_cmd_mm: not recorded: actuator, clutch force, friction and thermal parts can't be assessed; record the position that the TCU commands";

/// Note on a drive without a brake switch.
pub const NO_BRAKE: &str =
    "brake: not recorded: braking will look like a gap in the driveline; record the brake switch, or leave braking out with window_s";

/// Something that was done to a recording and that its user should know of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// Name of the recording.
    pub recording: String,
    /// What was done.
    pub text: String,
}

impl Campaign {
    /// What was left out and what was done, one line each, for a terminal; a note that several recordings share appears once.
    pub fn remarks(&self) -> String {
        let mut text: String = self.left_out.iter().map(LeftOut::line).collect();
        let mut said: Vec<(&str, Vec<&str>)> = Vec::new();
        for note in &self.notes {
            match said.iter_mut().find(|(text, _)| *text == note.text) {
                Some((_, recordings)) => recordings.push(&note.recording),
                None => said.push((&note.text, vec![&note.recording])),
            }
        }
        text.extend(said.iter().map(|(what, recordings)| format!("note: {}: {what}\n", recordings.join(", "))));
        text
    }
}

/// How to read a campaign.
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// Assignment of the user's channels to ours.
    pub channel_map: Option<ChannelMap>,
    /// Leaves nothing out: the first recording with a defect is an error.
    pub strict: bool,
}

/// One recording. Its rows are the stamps at which any channel except the housing air has a sample; all vectors have the length of `time`.
///
/// A sensor is NaN in a row in which it has no sample of its own, or one that cannot be trusted. Inputs are held and never NaN.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Name of the recording in recordings.json.
    pub name: String,
    /// Manoeuvre as recordings.json names it.
    pub manoeuvre: String,
    /// Nominal rate, Hz, of the faster of the two speeds.
    pub sample_rate_hz: f64,
    /// Stamps of the rows, s, from 0, strictly increasing.
    pub time: Vec<f64>,
    /// Disc temperature at the start, °C.
    pub theta_c0: f64,
    /// Body temperature at the start, °C.
    pub theta_b0: f64,
    /// Standard deviations of these two temperatures, K: disc and body.
    pub theta_0_sigma: [f64; 2],
    /// Angle by which the disc lags behind the flywheel at the start, rad; 0 unless the recording is a part of a longer one.
    pub slip_angle_0: f64,
    /// Flywheel speed as sensed, rad/s.
    pub omega_f: Vec<f64>,
    /// Disc speed as sensed, rad/s.
    pub omega_c: Vec<f64>,
    /// Engine torque as reported, N·m; held.
    pub t_e: Vec<f64>,
    /// Throwout position as commanded, mm; held. Empty if it was not recorded.
    pub x_to_cmd: Vec<f64>,
    /// Housing air temperature, °C; held.
    pub theta_h: Vec<f64>,
    /// Throwout position as sensed, mm (bench only).
    pub x_to: Option<Vec<f64>>,
    /// Clutch torque transducer, N·m (bench only).
    pub t_fc: Option<Vec<f64>>,
    /// Disc thermocouple, °C (bench only).
    pub theta_c: Option<Vec<f64>>,
    /// Whether the driver brakes, held (drives only).
    pub brake: Option<Vec<bool>>,
    /// Interval at which the control unit is assumed to compute, s; `None` for the usual one. A logger that is slower misses commands, and inputs are
    /// then taken to change steadily from each sample to the next one; otherwise they are held.
    pub control_interval_s: Option<f64>,
    /// Rows at which torque report and command, in this order, have samples of their own; `None` if every row has one, except for samples that were lost.
    pub input_rows: [Option<Vec<usize>>; 2],
}

impl Recording {
    /// These rows as a recording that begins at 0 s. The start temperatures remain those of the whole recording.
    ///
    /// # Panics
    /// If the recording does not have these rows.
    pub fn part(&self, rows: Range<usize>) -> Self {
        let of = |column: &Vec<f64>| column.get(rows.clone()).unwrap_or_default().to_vec();
        let begin = self.time[rows.start];
        let own = |own: &Vec<usize>| {
            let within = own.iter().filter(|row| rows.contains(row)).map(|row| row - rows.start);
            // The value of a held input is known where a later part begins, even if it was sampled earlier.
            let first = (rows.start > 0).then_some(0);
            first.into_iter().chain(within.filter(|row| Some(*row) != first)).collect()
        };
        Self {
            name: self.name.clone(),
            manoeuvre: self.manoeuvre.clone(),
            time: self.time[rows.clone()].iter().map(|t| t - begin).collect(),
            omega_f: of(&self.omega_f),
            omega_c: of(&self.omega_c),
            t_e: of(&self.t_e),
            x_to_cmd: of(&self.x_to_cmd),
            theta_h: of(&self.theta_h),
            x_to: self.x_to.as_ref().map(of),
            t_fc: self.t_fc.as_ref().map(of),
            theta_c: self.theta_c.as_ref().map(of),
            brake: self.brake.as_ref().map(|b| b[rows.clone()].to_vec()),
            input_rows: self.input_rows.each_ref().map(|rows| rows.as_ref().map(own)),
            ..*self
        }
    }
}

impl Default for Recording {
    /// A recording without rows. Start temperatures are known to 1 K, as on a bench.
    fn default() -> Self {
        Self {
            name: String::new(),
            manoeuvre: String::new(),
            sample_rate_hz: 0.0,
            time: Vec::new(),
            theta_c0: 0.0,
            theta_b0: 0.0,
            theta_0_sigma: [1.0; 2],
            slip_angle_0: 0.0,
            omega_f: Vec::new(),
            omega_c: Vec::new(),
            t_e: Vec::new(),
            x_to_cmd: Vec::new(),
            theta_h: Vec::new(),
            x_to: None,
            t_fc: None,
            theta_c: None,
            brake: None,
            control_interval_s: None,
            input_rows: [None, None],
        }
    }
}
