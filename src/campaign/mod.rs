//! A campaign: one vehicle and several recordings of it.
//!
//! [`read`] takes a folder with `vehicle.json`, `recordings.json` and one CSV, MDF4 or Parquet file per recording. A defect of
//! the two JSON files or of the channel map is an error. A defect of one recording leaves that recording out with the reason,
//! unless none remains or [`ReadOptions::strict`] is set. Whatever is bridged, cut, converted or resampled is noted: nothing
//! is invented silently.
//!
//! The way of a file: bytes, [`table`] (csv, mdf, parquet), [`pick`] (channel map, units), [`checks`], [`span`] (with
//! [`clock`]), [`assemble`] (with [`resample`]), [`Recording`].

mod assemble;
mod channel_map;
mod channels;
mod checks;
mod clock;
mod csv;
mod error;
mod folder;
mod guess;
mod inspect;
mod manifest;
mod mdf;
mod mdf_blocks;
mod parquet;
mod pick;
mod resample;
mod span;
mod table;
mod thrift;
mod units;
mod write;

use std::path::PathBuf;

pub use channel_map::{ChannelMap, Mapped};
pub use channels::{CHANNELS, Channel, Lasting, Spec};
pub use error::{CampaignError, Defect, Place, RecordingError, lines};
pub use folder::{read, read_one};
pub use inspect::{ChannelInfo, Inspection, draft_channel_map, inspect};
pub use units::Quantity;
pub use write::{write_csv, write_recordings_json};

/// One vehicle and the recordings of it that can be used.
#[derive(Clone, Debug)]
pub struct Campaign {
    /// The campaign's folder.
    pub dir: PathBuf,
    /// The vehicle file.
    pub vehicle_path: PathBuf,
    /// What it holds.
    pub vehicle_json: serde_json::Value,
    /// The recordings, sorted by name.
    pub recordings: Vec<Recording>,
    /// What could not be used, and why.
    pub left_out: Vec<LeftOut>,
    /// What was done to recordings that are used.
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

/// Something that was done to a recording and that its user should know.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// Name of the recording.
    pub recording: String,
    /// What was done.
    pub text: String,
}

/// How to read a campaign.
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// Which of the user's channels is which of ours.
    pub channel_map: Option<ChannelMap>,
    /// Leave nothing out: the first recording with a defect is an error.
    pub strict: bool,
}

/// One recording with uniform time from 0; all vectors have the length of `omega_f`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// Name of the recording: its file's stem.
    pub name: String,
    /// Manoeuvre as recordings.json names it.
    pub manoeuvre: String,
    /// Sample rate, Hz.
    pub sample_rate_hz: f64,
    /// Disc temperature at the start, °C.
    pub theta_c0: f64,
    /// Body temperature at the start, °C.
    pub theta_b0: f64,
    /// Flywheel speed as sensed, rad/s.
    pub omega_f: Vec<f64>,
    /// Disc speed as sensed, rad/s.
    pub omega_c: Vec<f64>,
    /// Engine torque as reported, N·m; held to the next sample.
    pub t_e: Vec<f64>,
    /// Throwout position as commanded, mm; held to the next sample.
    pub x_to_cmd: Vec<f64>,
    /// Housing air temperature, °C.
    pub theta_h: Vec<f64>,
    /// Throwout position as sensed, mm (bench only).
    pub x_to: Option<Vec<f64>>,
    /// Clutch torque transducer, N·m (bench only).
    pub t_fc: Option<Vec<f64>>,
    /// Disc thermocouple, °C (bench only).
    pub theta_c: Option<Vec<f64>>,
}
