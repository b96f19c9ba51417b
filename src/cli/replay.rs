//! `kisspoint replay`: drives the plant with a car's recordings and prints the gap.

use crate::campaign::{self, CampaignError, ChannelMap, ReadOptions};
use crate::effects;
use crate::gap::gap::{HeldOut, evaluate, unit};
use crate::vehicle::{Vehicle, VehicleError};
use serde_json::json;
use std::path::PathBuf;

/// Options of `kisspoint replay`.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "Each recording is replayed freely from its first sample, driven by the reported torque and the commanded position.\n\nExamples:\n  kisspoint replay measurements/car_17"
)]
pub struct Args {
    /// Folder with vehicle.json, recordings.json and the recordings
    #[arg(value_name = "CAMPAIGN")]
    campaign: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Another vehicle file than the campaign's; its effects are in force
    #[arg(long, value_name = "FILE")]
    vehicle: Option<PathBuf>,
    /// Names and units of the channels, TOML or JSON
    #[arg(long, value_name = "FILE")]
    channel_map: Option<PathBuf>,
}

/// What can go wrong.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The campaign.
    #[error(transparent)]
    Campaign(#[from] CampaignError),
    /// The vehicle file.
    #[error("{}: {source}", path.display())]
    Vehicle {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: VehicleError,
    },
    /// The vehicle file cannot be read.
    #[error("{}: {source}; check path and permissions", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
}

/// Runs the subcommand.
///
/// # Errors
/// A campaign or vehicle file that cannot be read.
pub fn run(args: &Args) -> Result<(), ReplayError> {
    let channel_map = args.channel_map.as_deref().map(ChannelMap::from_file).transpose()?;
    let campaign = campaign::read(&args.campaign, &ReadOptions { channel_map, strict: false })?;
    let path = args.vehicle.clone().unwrap_or_else(|| campaign.vehicle_path.clone());
    let wrong = |source| ReplayError::Vehicle { path: path.clone(), source };
    let document = match &args.vehicle {
        None => campaign.vehicle_json.clone(),
        Some(file) => {
            let text = std::fs::read_to_string(file).map_err(|source| ReplayError::File { path: file.clone(), source })?;
            serde_json::from_str(&text).map_err(|e| wrong(VehicleError::Json(e.to_string())))?
        }
    };
    let vehicle = Vehicle::from_value(&document).map_err(wrong)?;
    let effects = effects::from_value(&document).map_err(wrong)?;
    let car = (&vehicle, &effects);
    let gaps: Vec<(String, HeldOut)> =
        campaign.recordings.iter().flat_map(|r| evaluate(r, car, car).into_iter().map(|h| (r.manoeuvre.clone(), h))).collect();
    if args.json {
        let rows: Vec<serde_json::Value> = gaps
            .iter()
            .map(|(m, h)| json!({"recording": h.recording, "manoeuvre": m, "channel": h.channel.column(), "unit": unit(h.channel), "rms": h.before, "noise": h.noise}))
            .collect();
        println!("{:#}", serde_json::Value::Array(rows));
    } else {
        println!("{:<12} {:<14} {:<15} {:>10} {:>10}  unit", "recording", "manoeuvre", "channel", "rms gap", "noise");
        for (m, h) in &gaps {
            println!("{:<12} {:<14} {:<15} {:>10.4} {:>10.4}  {}", h.recording, m, h.channel.column(), h.before, h.noise, unit(h.channel));
        }
    }
    for left in &campaign.left_out {
        eprintln!("left out: {}: {}", left.recording, left.reason);
    }
    Ok(())
}
