//! Files that commands read and write.

use super::error::{CommandError, at};
use crate::effects::{self, Parameters};
use crate::faults::Faults;
use crate::validated::Validated;
use crate::vehicle::{Vehicle, VehicleError};
use serde_json::Value;
use std::fs::File;
use std::io::{ErrorKind, Write};
use std::path::Path;
use tempfile::NamedTempFile;

/// Content of a vehicle file.
pub struct VehicleFile {
    /// The whole document.
    pub document: Value,
    /// The vehicle's numbers.
    pub vehicle: Vehicle,
    /// Parameters of the effects that it sets.
    pub effects: Parameters,
    /// The domain in which a campaign validated the plant, if stated.
    pub validated: Option<Validated>,
}

/// Reads a vehicle file.
///
/// # Errors
/// A file that cannot be read, or is malformed.
pub fn read_vehicle(path: &Path) -> Result<VehicleFile, CommandError> {
    let text = std::fs::read_to_string(path).map_err(at(path))?;
    let document = crate::json::parse(&text).map_err(VehicleError::Json);
    let parse = |document: Value| {
        let (vehicle, effects) = (Vehicle::from_value(&document)?, effects::from_value(&document)?);
        let validated = Validated::from_value(&document["validated"]).map_err(|e| VehicleError::Implausible(e.to_string()))?;
        Ok(VehicleFile { document, vehicle, effects, validated })
    };
    document.and_then(parse).map_err(|source| CommandError::Vehicle { path: path.to_owned(), source })
}

/// Reads a file of faults.
///
/// # Errors
/// A file that cannot be read, or is malformed.
pub fn read_faults(path: &Path) -> Result<Faults, CommandError> {
    let text = std::fs::read_to_string(path).map_err(at(path))?;
    let wrong = |what: String| CommandError::Faults { path: path.to_owned(), what };
    let document = crate::json::parse(&text).map_err(|e| wrong(e.to_string()))?;
    Faults::from_value(&document).map_err(|e| wrong(e.to_string()))
}

/// Writes a file; overwrites an existing one only with `force`.
///
/// # Errors
/// A file that exists, or cannot be written.
pub fn write_new(path: &Path, text: &str, force: bool) -> Result<(), CommandError> {
    path.file_name().ok_or_else(|| at(path)(ErrorKind::InvalidFilename.into()))?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(at(folder))?;
    let file = beside(folder, text.as_bytes()).map_err(at(path))?;
    let placed = if force { file.persist(path) } else { file.persist_noclobber(path) };
    match placed {
        Ok(_) => Ok(()),
        Err(e) if !force && e.error.kind() == ErrorKind::AlreadyExists => Err(CommandError::Exists(path.to_owned())),
        Err(e) => Err(at(path)(e.error)),
    }
}

/// Writes files into a folder as one answer. All files are first written completely under temporary names beside their destinations, and renamed when the last one is complete.
/// A full disk or an interruption before that leaves the old files untouched. If two runs write into one folder, the folder is locked during the renaming where the system
/// allows it, so that the later answer remains whole.
///
/// Each single file is whole at any moment. If the process is killed during the renaming, files of both answers remain, along with temporary files: no system can move several
/// files at once into a folder that holds others.
///
/// # Errors
/// A folder or a file that cannot be written.
pub fn write_all(folder: &Path, files: &[(impl AsRef<str>, Vec<u8>)]) -> Result<(), CommandError> {
    std::fs::create_dir_all(folder).map_err(at(folder))?;
    let place = |name: &str| folder.join(name);
    let complete = |(name, bytes): &(_, Vec<u8>)| {
        let path = place(AsRef::<str>::as_ref(name));
        beside(folder, bytes).map(|file| (file, path.clone())).map_err(at(path))
    };
    let complete: Vec<_> = files.iter().map(complete).collect::<Result<_, _>>()?;
    // The folder is locked where the system supports it. The lock is released when the handle is dropped.
    let lock = File::open(folder).ok();
    let _ = lock.as_ref().map(File::lock);
    for (file, path) in complete {
        file.persist(&path).map_err(|e| at(path)(e.error))?;
    }
    Ok(())
}

/// Checks whether files can be written into a folder, before the work for them begins. Nothing is left behind, and the folder is not created.
///
/// # Errors
/// A path that is a file or leads through one, or a folder that cannot be written to.
pub fn writable(folder: &Path) -> Result<(), CommandError> {
    // A folder that does not exist yet will be created in its nearest existing ancestor.
    let there = folder.ancestors().find(|p| p.as_os_str().is_empty() || p.symlink_metadata().is_ok()).unwrap_or(Path::new("."));
    let there = if there.as_os_str().is_empty() { Path::new(".") } else { there };
    if !there.is_dir() {
        return Err(at(there)(ErrorKind::NotADirectory.into()));
    }
    tempfile::tempfile_in(there).map(drop).map_err(at(there))
}

/// A complete temporary file in `folder`; it is deleted if it is dropped before it is renamed.
fn beside(folder: &Path, bytes: &[u8]) -> std::io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".kisspoint-").suffix(".partial");
    // Readable by others as any file that the user creates; temporary files are private by default.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    Ok(file)
}
