//! Writes recordings in the contract's format, so that what is read back equals what was written.

use std::io::Write;
use std::path::Path;

use serde_json::{Map, Value, json};

use super::channels::CHANNELS;
use super::{CampaignError, Recording};

/// Writes a recording as CSV. Numbers have as many digits as they need to come back the same.
///
/// The file appears under its name only when it is complete.
pub fn write_csv(recording: &Recording, path: &Path) -> Result<(), CampaignError> {
    let mut columns: Vec<(&str, &[f64])> = vec![
        (CHANNELS[1].column, &recording.omega_f),
        (CHANNELS[2].column, &recording.omega_c),
        (CHANNELS[3].column, &recording.t_e),
        (CHANNELS[4].column, &recording.x_to_cmd),
        (CHANNELS[5].column, &recording.theta_h),
    ];
    let bench = [&recording.x_to, &recording.t_fc, &recording.theta_c];
    columns.extend(CHANNELS[6..].iter().zip(bench).filter_map(|(spec, v)| v.as_deref().map(|v| (spec.column, v))));
    if let Some((column, values)) = columns.iter().find(|(_, v)| v.len() != recording.omega_f.len()) {
        return Err(CampaignError::Shape {
            file: path.to_path_buf(),
            what: format!("{column} has {} samples where omega_f_rad_s has {}", values.len(), recording.omega_f.len()),
            remedy: "Give every channel the same length".to_string(),
        });
    }
    whole(path, |out| {
        write!(out, "{}", CHANNELS[0].column)?;
        columns.iter().try_for_each(|(name, _)| write!(out, ",{name}"))?;
        for i in 0..recording.omega_f.len() {
            write!(out, "\n{}", i as f64 / recording.sample_rate_hz)?;
            columns.iter().try_for_each(|(_, values)| write!(out, ",{}", values[i]))?;
        }
        writeln!(out)
    })
}

/// Writes recordings.json for these recordings.
pub fn write_recordings_json(recordings: &[Recording], path: &Path) -> Result<(), CampaignError> {
    let entry = |r: &Recording| {
        json!({
            "manoeuvre": r.manoeuvre,
            "sample_rate_Hz": r.sample_rate_hz,
            "theta_c0_degC": r.theta_c0,
            "theta_b0_degC": r.theta_b0,
        })
    };
    let all: Map<String, Value> = recordings.iter().map(|r| (r.name.clone(), entry(r))).collect();
    whole(path, |out| writeln!(out, "{:#}", Value::Object(all)))
}

/// Writes beside the file and renames, so that an interruption leaves nothing half-written under its name.
fn whole(path: &Path, fill: impl FnOnce(&mut std::io::BufWriter<std::fs::File>) -> std::io::Result<()>) -> Result<(), CampaignError> {
    let mut part = path.as_os_str().to_owned();
    part.push(".part");
    let written = std::fs::File::create(&part).and_then(|file| {
        let mut out = std::io::BufWriter::new(file);
        fill(&mut out)?;
        out.into_inner().map_err(std::io::IntoInnerError::into_error)?.sync_all()?;
        std::fs::rename(&part, path)
    });
    written.map_err(|source| CampaignError::Io { file: path.to_path_buf(), source })
}
