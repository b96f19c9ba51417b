//! The start values, from `fmuResourceLocation`.
//!
//! The vehicle in the resources must be the one that the GUID identifies. If none can be read, the start values of the model description are used,
//! provided that the GUID identifies those; otherwise instantiation is refused, because the FMU would start as the wrong car.
//!
//! Importers write the URI as `file:///dir`, `file:/dir` or `file://localhost/dir`, percent-encoded or not, some as a plain path.
//! The URI's bytes are in the encoding of the file system: on Unix any bytes are a path, elsewhere they must be UTF-8.

use super::guid;
use super::log::{Category, Log};
use super::model::put_vehicle;
use super::types::Status;
use super::variables::Description;
use crate::effects::{self, Parameters};
use crate::faults::Faults;
use crate::validated::Validated;
use crate::vehicle::{Vehicle, VehicleError};
use std::borrow::Cow;
use std::ffi::OsStr;
use std::fs;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::SystemTime;

/// File with the vehicle's numbers in the resources.
const VEHICLE_FILE: &str = "vehicle.json";

/// Prefix of a URI that contains the text of the vehicle file.
const IN_ITSELF: &[u8] = b"data:application/json,";

enum Missing {
    /// There is no vehicle file that can be read.
    Absent(String),
    /// The vehicle file was read and is invalid.
    Wrong(String),
}

/// Start values, faults, and what a campaign has found of the car.
pub type Started = (Box<[f64]>, Faults, Option<Validated>);

/// Start values of the FMU with this GUID.
///
/// # Errors
/// The vehicle file is invalid, or its values are not those that the GUID identifies.
pub fn start_values(description: &Description, guid: &str, location: Option<&[u8]>, log: &mut Log) -> Result<Started, String> {
    let place = place_of(location);
    let stamp = place.as_ref().ok().and_then(Place::stamp);
    let latest = || LATEST.lock().unwrap_or_else(PoisonError::into_inner);
    if stamp.is_some()
        && let Some(same) = latest().as_ref().filter(|latest| latest.guid == guid && latest.stamp == stamp)
    {
        return Ok(same.started.clone());
    }
    let started = checked_start_values(description, guid, place, log)?;
    if stamp.is_some() {
        *latest() = Some(Latest { guid: guid.into(), stamp, started: started.clone() });
    }
    Ok(started)
}

/// The vehicle file that was read last, and the result: usually many instances are made of one FMU. The stored values are those that the GUID
/// identifies, so that a file that has changed without its stamp cannot start another car.
struct Latest {
    guid: String,
    stamp: Option<Stamp>,
    started: Started,
}

static LATEST: Mutex<Option<Latest>> = Mutex::new(None);

/// Forgets the vehicle file that was read last.
pub fn forget_latest() {
    *LATEST.lock().unwrap_or_else(PoisonError::into_inner) = None;
}

/// Path, length and modification time of a file, which show whether it is still the one that was read.
type Stamp = (PathBuf, u64, SystemTime);

fn checked_start_values(
    description: &Description,
    guid: &str,
    place: Result<Place<'_>, Missing>,
    log: &mut Log,
) -> Result<Started, String> {
    let mut fresh: Box<[f64]> = description.variables.iter().map(|v| v.start).collect();
    let (mut faults, mut validated) = (Faults::default(), None);
    let absent = match place.and_then(|place| place.read()) {
        Ok(Read { vehicle, effects, faults: read, validated: found }) => {
            put_vehicle(description, &vehicle, &effects, &mut fresh);
            // Only a model with effects can play faults or be validated.
            if description.has_effects() {
                (faults, validated) = (read, found);
            }
            None
        }
        Err(Missing::Absent(why)) => Some(why),
        Err(Missing::Wrong(why)) => return Err(why),
    };
    let numbers = fresh.iter().copied().chain(faults.numbers()).chain(validated.iter().flat_map(|v| v.numbers()));
    let is_meant = guid.as_bytes().ends_with(&guid::tail(numbers));
    match absent {
        None if is_meant => {}
        Some(why) if is_meant => log.write(
            Status::Warning,
            Category::Warning,
            format_args!("{why}; the start values of the paper's car are used, which are those of this FMU"),
        ),
        None => {
            return Err(format!(
                "{VEHICLE_FILE} in fmuResourceLocation is another car's than fmuGUID \"{guid}\" names; pass the resources of the same FMU, or write it anew with `kisspoint fmu --vehicle`"
            ));
        }
        Some(why) => {
            return Err(format!(
                "{why}; without it this FMU, \"{guid}\", would start as another car: pass the folder `resources` of the unpacked FMU"
            ));
        }
    }
    Ok((fresh, faults, validated))
}

/// Contents of the vehicle file.
struct Read {
    vehicle: Vehicle,
    effects: Parameters,
    faults: Faults,
    validated: Option<Validated>,
}

/// Location of the vehicle file.
enum Place<'a> {
    File(PathBuf),
    /// The file's text. An FMU built from C sources, which may have no file system, passes it in the URI itself.
    Text(Cow<'a, str>),
}

fn place_of(location: Option<&[u8]>) -> Result<Place<'_>, Missing> {
    let location = location.ok_or_else(|| Missing::Absent("fmuResourceLocation is NULL".into()))?;
    if let Some(text) = location.strip_prefix(IN_ITSELF) {
        return Ok(Place::Text(String::from_utf8_lossy(text)));
    }
    let folder = folder(location).ok_or_else(|| {
        Missing::Absent(format!("fmuResourceLocation \"{}\" names no folder on this machine", String::from_utf8_lossy(location)))
    })?;
    Ok(Place::File(folder.join(VEHICLE_FILE)))
}

impl Place<'_> {
    fn stamp(&self) -> Option<Stamp> {
        let Self::File(path) = self else { return None };
        let about = fs::metadata(path).ok()?;
        Some((path.clone(), about.len(), about.modified().ok()?))
    }

    fn read(&self) -> Result<Read, Missing> {
        match self {
            Self::Text(text) => read(VEHICLE_FILE, text),
            Self::File(path) => {
                let place = path.display();
                let text = fs::read_to_string(path).map_err(|e| Missing::Absent(format!("{place} cannot be read: {e}")))?;
                read(&place.to_string(), &text)
            }
        }
    }
}

fn read(place: &str, text: &str) -> Result<Read, Missing> {
    let wrong = |e: VehicleError| Missing::Wrong(format!("{place}: {e}"));
    let document = crate::json::parse(text).map_err(|e| wrong(VehicleError::Json(e)))?;
    let faults = Faults::from_value(&document["faults"]).map_err(|e| Missing::Wrong(format!("{place}: {e}")))?;
    let validated = Validated::from_value(&document["validated"]).map_err(|e| Missing::Wrong(format!("{place}: {e}")))?;
    let (vehicle, effects) = (Vehicle::from_value(&document).map_err(wrong)?, effects::from_value(&document).map_err(wrong)?);
    Ok(Read { vehicle, effects, faults, validated })
}

/// Folder that the URI names; `None` if it is empty or has a scheme other than `file`.
pub fn folder(uri: &[u8]) -> Option<PathBuf> {
    let path = match uri.split_at_checked(5) {
        Some((scheme, rest)) if scheme.eq_ignore_ascii_case(b"file:") => Cow::Owned(percent_decoded(without_authority(rest))),
        _ if uri.is_empty() || uri.windows(3).any(|three| three == b"://") => return None,
        _ => Cow::Borrowed(uri),
    };
    as_path(without_slash_before_drive(&path))
}

fn as_path(bytes: &[u8]) -> Option<PathBuf> {
    #[cfg(unix)]
    let path = Some(<OsStr as std::os::unix::ffi::OsStrExt>::from_bytes(bytes));
    #[cfg(not(unix))]
    let path = std::str::from_utf8(bytes).ok().map(OsStr::new);
    path.map(PathBuf::from)
}

fn without_authority(rest: &[u8]) -> &[u8] {
    match rest.strip_prefix(b"//") {
        Some(after) if after.starts_with(b"/") => after,
        Some(after) => after.strip_prefix(b"localhost").filter(|path| path.starts_with(b"/")).unwrap_or(rest),
        None => rest,
    }
}

/// Turns `/C:/dir` into `C:/dir`.
fn without_slash_before_drive(path: &[u8]) -> &[u8] {
    let drive = path.len() > 2 && path[0] == b'/' && path[1].is_ascii_alphabetic() && path[2] == b':';
    if drive { &path[1..] } else { path }
}

fn percent_decoded(text: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text;
    while let [first, tail @ ..] = rest {
        let code = (*first == b'%').then(|| tail.get(..2)).flatten().and_then(|d| Some(hex(d[0])? * 16 + hex(d[1])?));
        // A lone percent sign stands for itself: some importers do not encode.
        bytes.push(code.unwrap_or(*first));
        rest = if code.is_some() { &tail[2..] } else { tail };
    }
    bytes
}

fn hex(digit: u8) -> Option<u8> {
    (digit as char).to_digit(16).map(|d| d as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_form_of_uri_names_its_folder() {
        for (uri, path) in [
            ("file:///tmp/a%20b/resources", Some("/tmp/a b/resources")),
            ("file:/tmp/x", Some("/tmp/x")),
            ("FILE://localhost/tmp/x/", Some("/tmp/x/")),
            ("file:///C:/Temp/r", Some("C:/Temp/r")),
            ("file:///C%3a/Temp", Some("C:/Temp")),
            ("file://server/share", Some("//server/share")),
            ("/tmp/100%/x", Some("/tmp/100%/x")),
            ("file:///tmp/100%zz", Some("/tmp/100%zz")),
            ("http://example.org/x", None),
            ("", None),
            ("fil", Some("fil")),
        ] {
            assert_eq!(folder(uri.as_bytes()), path.map(PathBuf::from), "{uri}");
        }
        // A folder named in Latin-1, as on an old file system, encoded or not.
        #[cfg(unix)]
        assert_eq!((folder(b"file:///m\xfcll"), folder(b"file:///m%fcll")), (as_path(b"/m\xfcll"), as_path(b"/m\xfcll")));
    }
}
