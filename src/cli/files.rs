//! Files that commands read and write.

use super::error::{CommandError, at};
use crate::effects::{self, Parameters};
use crate::faults::Faults;
use crate::vehicle::{Vehicle, VehicleError};
use serde_json::Value;
use std::io::ErrorKind;
use std::path::Path;

/// What a vehicle file holds.
pub struct VehicleFile {
    /// All of it.
    pub document: Value,
    /// Its numbers.
    pub vehicle: Vehicle,
    /// The effects that it puts in force.
    pub effects: Parameters,
}

/// Reads a vehicle file.
///
/// # Errors
/// A file that cannot be read, or is not sound.
pub fn read_vehicle(path: &Path) -> Result<VehicleFile, CommandError> {
    let text = std::fs::read_to_string(path).map_err(at(path))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let document: Result<Value, _> = serde_json::from_str(text).map_err(|e| VehicleError::Json(e.to_string()));
    let parse = |document: Value| {
        let (vehicle, effects) = (Vehicle::from_value(&document)?, effects::from_value(&document)?);
        Ok(VehicleFile { document, vehicle, effects })
    };
    document.and_then(parse).map_err(|source| CommandError::Vehicle { path: path.to_owned(), source })
}

/// Reads a file with faults.
///
/// # Errors
/// A file that cannot be read, or is not sound.
pub fn read_faults(path: &Path) -> Result<Faults, CommandError> {
    let text = std::fs::read_to_string(path).map_err(at(path))?;
    let wrong = |what: String| CommandError::Faults { path: path.to_owned(), what };
    let document = serde_json::from_str(&text).map_err(|e| wrong(e.to_string()))?;
    Faults::from_value(&document).map_err(|e| wrong(e.to_string()))
}

/// Writes a file that is there already only with `force`.
///
/// # Errors
/// A file that exists, or cannot be written.
pub fn write_new(path: &Path, text: &str, force: bool) -> Result<(), CommandError> {
    if path.exists() && !force {
        return Err(CommandError::Exists(path.to_owned()));
    }
    let unnamed = || at(path)(ErrorKind::InvalidFilename.into());
    let name = path.file_name().ok_or_else(unnamed)?.to_string_lossy();
    write_all(path.parent().unwrap_or(Path::new("")), &[(name, text.as_bytes().to_vec())])
}

/// Writes files into a folder: every one beside its place first, and into it when it is complete, so that an interruption leaves nothing
/// half-written under its name.
///
/// # Errors
/// A folder or a file that cannot be written.
pub fn write_all(folder: &Path, files: &[(impl AsRef<str>, Vec<u8>)]) -> Result<(), CommandError> {
    std::fs::create_dir_all(folder).map_err(at(folder))?;
    for (name, bytes) in files {
        let name = name.as_ref();
        let (path, partial) = (folder.join(name), folder.join(format!(".{name}.partial")));
        std::fs::write(&partial, bytes).and_then(|()| std::fs::rename(&partial, &path)).map_err(at(path))?;
    }
    Ok(())
}
