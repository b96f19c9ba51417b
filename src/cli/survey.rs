//! `kisspoint survey`: quality of a log, the gears, launches and shifts it shows, and which channels may be the engine torque.

use super::error::CommandError;
use super::files::write_all;
use super::output::{print, print_json};
use super::progress::Progress;
use crate::campaign;
use crate::survey::{self, Known, Survey, export, picture};
use crate::vehicle::Vehicle;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Options of `kisspoint survey`.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "Needs neither a position nor a vehicle file.\n\nExamples:\n  kisspoint survey drive.mf4\n  kisspoint survey drive.csv --ratios 3.25,2.23,1.61,1.24,1.00,0.63 \\\n      --final-drive 3.73 --out out\n  kisspoint survey frames.mf4 --dbc car.dbc --engine EngSpeed \\\n      --road VehSpeed --json"
)]
pub struct Args {
    /// Measurement files: text, MDF4, Parquet
    #[arg(value_name = "LOG", required = true)]
    logs: Vec<PathBuf>,
    /// Ratios of the gears, first gear first; without it they are learned
    #[arg(long, value_name = "I1,I2,…", value_delimiter = ',')]
    ratios: Vec<f64>,
    /// Ratio of the final drive
    #[arg(long, value_name = "I", requires = "ratios")]
    final_drive: Option<f64>,
    /// Rolling radius of the tyre, m; without it, it follows from ratios and final drive
    #[arg(long, value_name = "M", requires = "ratios")]
    tyre_radius: Option<f64>,
    /// Channel of the engine speed, if its name does not say so
    #[arg(long, value_name = "NAME")]
    engine: Option<String>,
    /// Channel of a speed behind the clutch: gearbox input, output shaft, wheel or road
    #[arg(long, value_name = "NAME")]
    road: Option<String>,
    /// Database (DBC) of the CAN bus whose frames an MDF4 file holds
    #[arg(long, value_name = "FILE")]
    dbc: Option<PathBuf>,
    /// Folder for survey.json and survey.svg; with several logs, each gets a folder of its own in it
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Channel of the engine torque: also writes a campaign for `kisspoint diagnose` into DIR/campaign
    #[arg(long, value_name = "NAME", requires = "out")]
    torque: Option<String>,
    /// Gear of that campaign, from 1; J_c differs from gear to gear
    #[arg(long, value_name = "N", requires = "torque", value_parser = clap::value_parser!(u8).range(1..))]
    gear: Option<u8>,
    /// Mass of the car, kg, which gives that campaign's J_c
    #[arg(long, value_name = "KG", requires = "gear")]
    mass: Option<f64>,
    /// Vehicle file for that campaign; without it, the paper's numbers, for you to replace
    #[arg(long, value_name = "FILE", requires = "torque")]
    vehicle: Option<PathBuf>,
    /// Print JSON; with several logs, one line each
    #[arg(long)]
    json: bool,
}

/// Runs the subcommand.
///
/// # Errors
/// A log that can't be read, options that do not fit it, a folder that can't be written.
pub fn run(args: &Args) -> Result<(), CommandError> {
    let known = Known {
        ratios: args.ratios.clone(),
        final_drive: args.final_drive,
        tyre_radius: args.tyre_radius,
        engine: args.engine.clone(),
        road: args.road.clone(),
    };
    if let Some(wrong) = known.ratios.iter().chain(&known.final_drive).chain(&known.tyre_radius).find(|v| !(**v > 0.0 && v.is_finite())) {
        return Err(CommandError::Refused(format!("{wrong} is not a ratio or radius. Give positive numbers")));
    }
    for path in &args.logs {
        let log = {
            let bar = Progress::new();
            let log = campaign::open(path, args.dbc.as_deref(), &|share| bar.tell(&format!("reading {}", path.display()), share));
            bar.finish();
            log?
        };
        let absent = |n: &&String| log.channels.iter().all(|c| &c.name != *n);
        if let Some(name) = args.engine.iter().chain(&args.road).find(absent) {
            let there: Vec<&str> = log.channels.iter().map(|c| c.name.as_str()).collect();
            return Err(CommandError::Refused(format!("{}: no channel is called `{name}`; there are {}", log.file, there.join(", "))));
        }
        let found = survey::survey(log, &known);
        let several = args.logs.len() > 1;
        let out = args.out.as_ref().map(|out| if several { out.join(path.file_stem().unwrap_or_default()) } else { out.clone() });
        let written = out.map(|out| write(&out, &found, args)).transpose()?;
        match args.json {
            true if several => print(&format!("{}\n", found.to_json()))?,
            true => print_json(&found.to_json())?,
            false => print(&(found.to_text() + &written.unwrap_or_default()))?,
        }
    }
    Ok(())
}

/// Writes the survey and, if a torque channel is given, the campaign. Returns the lines that say where.
fn write(out: &Path, found: &Survey, args: &Args) -> Result<String, CommandError> {
    let mut files = vec![("survey.json", format!("{:#}\n", found.to_json()).into_bytes())];
    files.extend(picture::svg(found).map(|svg| ("survey.svg", svg.into_bytes())));
    write_all(out, &files)?;
    let mut text: String = files.iter().map(|(name, _)| format!("wrote {}\n", out.join(name).display())).collect();
    let Some(torque) = &args.torque else { return Ok(text) };
    let gear = args.gear.map(|g| usize::from(g) - 1);
    let recordings = export::recordings(found, torque, gear).map_err(CommandError::Refused)?;
    let mut vehicle = vehicle(args.vehicle.as_deref())?;
    if let (Some(mass), Some(gear)) = (args.mass, gear) {
        vehicle["driveline"]["J_c"] = export::inertia(found, mass, gear).map_err(CommandError::Refused)?.into();
    }
    let folder = out.join("campaign");
    write_all(&folder, &[("vehicle.json", format!("{vehicle:#}\n").into_bytes())])?;
    campaign::write_recordings_json(&recordings, &folder.join("recordings.json"))?;
    for recording in &recordings {
        campaign::write_csv(recording, &folder.join(format!("{}.csv", recording.name)))?;
    }
    let whose = if args.vehicle.is_some() { "" } else { "; its vehicle.json has the paper's numbers: put in the car's" };
    let mut gears: Vec<usize> = found.engagements.iter().map(|e| e.gear).collect();
    gears.dedup();
    if gear.is_none() && gears.len() > 1 {
        text += "the campaign holds several gears, each with a J_c of its own: choose one with --gear, and give --mass\n";
    }
    text += &format!("wrote {} with {} recordings{whose}\n", folder.display(), recordings.len());
    Ok(text)
}

/// The vehicle file unchanged, or the paper's vehicle with a note.
fn vehicle(path: Option<&Path>) -> Result<Value, CommandError> {
    if let Some(path) = path {
        return Ok(super::files::read_vehicle(path)?.document);
    }
    let mut paper = Vehicle::paper().to_value();
    paper["_note"] = "the paper's car: replace every number with this car's".into();
    Ok(paper)
}
