//! Writes recordings in the contract's format, so that what is read back equals what was written.

use std::io::Write;
use std::path::Path;

use serde_json::{Map, Value, json};

use super::channels::Channel;
use super::{CampaignError, Recording};

/// Writes a recording as CSV. Numbers have as many digits as they need to be read back unchanged. A value that is not a number becomes an empty cell,
/// and so does an input where it has no sample of its own.
///
/// The file appears under its name only when it is complete.
pub fn write_csv(recording: &Recording, path: &Path) -> Result<(), CampaignError> {
    let r = recording;
    let brake: Option<Vec<f64>> = r.brake.as_ref().map(|b| b.iter().map(|&on| f64::from(u8::from(on))).collect());
    let own = |values: &[f64], rows: &Option<Vec<usize>>| {
        rows.as_ref().map_or_else(
            || values.to_vec(),
            |rows| (0..values.len()).map(|row| if rows.binary_search(&row).is_ok() { values[row] } else { f64::NAN }).collect(),
        )
    };
    let [report, command] = [own(&r.t_e, &r.input_rows[0]), own(&r.x_to_cmd, &r.input_rows[1])];
    let columns: Vec<(&str, &[f64])> = [
        (Channel::OmegaF, Some(&r.omega_f)),
        (Channel::OmegaC, Some(&r.omega_c)),
        (Channel::TE, Some(&report)),
        (Channel::XToCmd, Some(&command).filter(|v| !v.is_empty())),
        (Channel::ThetaH, Some(&r.theta_h)),
        (Channel::XTo, r.x_to.as_ref()),
        (Channel::TFc, r.t_fc.as_ref()),
        (Channel::ThetaC, r.theta_c.as_ref()),
        (Channel::Brake, brake.as_ref()),
    ]
    .into_iter()
    .filter_map(|(channel, values)| Some((channel.spec().column, values?.as_slice())))
    .collect();
    if let Some((column, values)) = columns.iter().find(|(_, v)| v.len() != r.time.len()) {
        return Err(CampaignError::Shape {
            file: path.to_path_buf(),
            what: format!("{column} has {} samples where time_s has {}", values.len(), r.time.len()),
            remedy: "Give every channel the same length".to_string(),
        });
    }
    whole(path, |out| {
        write!(out, "{}", Channel::Time.spec().column)?;
        columns.iter().try_for_each(|(name, _)| write!(out, ",{name}"))?;
        for (i, time) in r.time.iter().enumerate() {
            write!(out, "\n{time}")?;
            columns.iter().try_for_each(|(_, values)| if values[i].is_nan() { write!(out, ",") } else { write!(out, ",{}", values[i]) })?;
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
            "theta_c0_sigma_K": r.theta_0_sigma[0],
            "theta_b0_sigma_K": r.theta_0_sigma[1],
        })
    };
    let all: Map<String, Value> = recordings.iter().map(|r| (r.name.clone(), entry(r))).collect();
    whole(path, |out| writeln!(out, "{:#}", Value::Object(all)))
}

/// Writes to a temporary file beside `path` and renames it, so that an interruption leaves nothing half-written under the name.
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
