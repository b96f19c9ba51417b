//! `kisspoint fmu`: writes both FMUs, and their coupling for masters.

use crate::effects::{self, Parameters};
use crate::fmu::{FmuError, library, write_all};
use crate::vehicle::{Vehicle, VehicleError};
use std::path::{Path, PathBuf};

/// Options of `kisspoint fmu`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    kisspoint fmu --out fmus\n  \
    kisspoint fmu --out fmus --vehicle vehicle.json\n  \
    kisspoint fmu --out fmus --library linux/libkisspoint.so --library windows/kisspoint.dll")]
pub struct Args {
    /// Directory that the FMUs are written into
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Start values are this vehicle's, not the paper's
    #[arg(long, value_name = "FILE")]
    vehicle: Option<PathBuf>,
    /// Shared library that goes in, one per platform; else $KISSPOINT_LIBRARY, or the one beside this program
    #[arg(long, value_name = "FILE")]
    library: Vec<PathBuf>,
}

/// What can go wrong.
#[derive(Debug, thiserror::Error)]
pub enum FmuCommandError {
    /// In writing.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// The vehicle file is not sound.
    #[error("{}: {source}", path.display())]
    Vehicle {
        /// The file.
        path: PathBuf,
        /// What is wrong in it.
        source: VehicleError,
    },
}

/// Runs the subcommand.
///
/// # Errors
/// A vehicle file that is missing or not sound; no library, or an unsound one; a directory that cannot be written.
pub fn run(args: &Args) -> Result<(), FmuCommandError> {
    let (vehicle, effects) = args.vehicle.as_deref().map_or(Ok((Vehicle::paper(), effects::null())), read_vehicle)?;
    let libraries = library::find(&args.library)?;
    for path in write_all(&args.out, &libraries, &vehicle, &effects)? {
        println!("{}", path.display());
    }
    let platforms: Vec<&str> = libraries.iter().map(|l| l.platform).collect();
    println!("binaries: {}", platforms.join(", "));
    let missing: Vec<&str> = library::PLATFORMS.into_iter().filter(|p| !platforms.contains(p)).collect();
    if !missing.is_empty() {
        println!("no binaries for {}: `packaging/cross.sh` builds them, --library names them, once for each", missing.join(", "));
    }
    Ok(())
}

fn read_vehicle(path: &Path) -> Result<(Vehicle, Parameters), FmuCommandError> {
    let file = |source| FmuError::File { path: path.to_owned(), source };
    let text = std::fs::read_to_string(path).map_err(file)?;
    let wrong = |source| FmuCommandError::Vehicle { path: path.to_owned(), source };
    let document = serde_json::from_str(&text).map_err(|e| wrong(VehicleError::Json(e.to_string())))?;
    Ok((Vehicle::from_value(&document).map_err(wrong)?, effects::from_value(&document).map_err(wrong)?))
}
