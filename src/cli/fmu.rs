//! `kisspoint fmu`: writes both FMUs and the description of their coupling for co-simulation masters.

use super::error::CommandError;
use super::files::{read_faults, read_vehicle, write_all};
use super::output::{print, print_json};
use crate::effects;
use crate::fmu::sources::Sources;
use crate::fmu::{Beside, Extras, all, library};
use crate::vehicle::Vehicle;
use serde_json::json;
use std::path::PathBuf;

/// Options of `kisspoint fmu`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    kisspoint fmu --out fmus\n  \
    kisspoint fmu --out fmus --vehicle vehicle.json\n  \
    kisspoint fmu --out fmus --json\n  \
    kisspoint fmu --out fmus --library linux/libkisspoint.so \\\n      --library windows/kisspoint.dll")]
pub struct Args {
    /// Directory that the FMUs are written into
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Take the start values from this vehicle file instead of the paper's
    #[arg(long, value_name = "FILE")]
    vehicle: Option<PathBuf>,
    /// Shared library to pack, one per platform; by default $KISSPOINT_LIBRARY, or the one beside this program
    #[arg(long, value_name = "FILE")]
    library: Vec<PathBuf>,
    /// Include the C sources in this folder, made by `packaging/sources.sh`, for targets that compile FMUs themselves
    #[arg(long, value_name = "DIR")]
    sources: Option<PathBuf>,
    /// Faults for the plant to play: a JSON list of parameter, time_s, ramp_s and value
    #[arg(long, value_name = "FILE")]
    faults: Option<PathBuf>,
    /// Print the files written and the platforms as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the subcommand.
///
/// # Errors
/// A vehicle file that is missing or malformed; a shared library that is missing or unsuitable; a directory that cannot be written.
pub fn run(args: &Args) -> Result<(), CommandError> {
    let (vehicle, effects, validated) = match &args.vehicle {
        None => (Vehicle::paper(), effects::null(), None),
        Some(path) => read_vehicle(path).map(|file| (file.vehicle, file.effects, file.validated))?,
    };
    let libraries = library::find(&args.library)?;
    let sources = args.sources.as_deref().map(Sources::read).transpose()?;
    let faults = args.faults.as_deref().map(read_faults).transpose()?;
    let extras = Extras { sources: sources.as_ref(), beside: Beside { faults: faults.as_ref(), validated: validated.as_ref() } };
    let files = all(&libraries, extras, &vehicle, &effects)?;
    write_all(&args.out, &files)?;
    let written: Vec<String> = files.iter().map(|(name, _)| args.out.join(name).display().to_string()).collect();
    let platforms: Vec<&str> = libraries.iter().map(|l| l.platform).collect();
    let missing: Vec<&str> = library::PLATFORMS.into_iter().filter(|p| !platforms.contains(p)).collect();
    if args.json {
        return print_json(&json!({"written": written, "platforms": platforms, "missing": missing}));
    }
    let mut text = format!("{}\nbinaries: {}\n", written.join("\n"), platforms.join(", "));
    if !missing.is_empty() {
        text += &format!("no binaries for {}: `packaging/cross.sh` builds them, --library names them, once for each\n", missing.join(", "));
    }
    print(&text)
}
