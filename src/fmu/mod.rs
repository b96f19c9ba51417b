//! Writing FMUs: the shared library, the final model description, and the other files in the archive.
//!
//! - [`library`]: which shared libraries are included, and for which platform each is
//! - [`description`]: the model description with GUID, version and a vehicle's start values
//! - [`sources`]: the library as C99, for targets that compile FMUs themselves
//! - [`html`]: the documentation
//! - [`a2l`]: addresses for the calibration bench
//! - [`ssv`]: parameter sets of SSP 1.0
//! - [`system`]: both FMUs coupled, for co-simulation masters
//!
//! The bytes are reproducible: fixed order, fixed times, no `./` before names.

pub mod a2l;
pub mod description;
pub mod html;
pub mod library;
pub mod sources;
pub mod ssv;
pub mod system;

use crate::effects::{self, Parameters};
use crate::faults::Faults;
use crate::fmi2::{controller, plant, variables};
use crate::validated::Validated;
use crate::vehicle::Vehicle;
use library::Library;
use sources::Sources;
use std::io::{Cursor, Read, Write};
use std::path::PathBuf;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// One of the two models.
#[derive(Clone, Copy, Debug)]
pub struct Model {
    /// Its model description, as tables.
    pub description: &'static variables::Description,
    /// The source of its model description.
    pub xml: &'static str,
}

/// Both models.
pub static MODELS: [Model; 2] = [
    Model { description: &controller::DESCRIPTION, xml: include_str!("../../modelDescription/ClutchController.xml") },
    Model { description: &plant::DESCRIPTION, xml: include_str!("../../modelDescription/DrivelinePlant.xml") },
];

const ICON: &[u8] = include_bytes!("../../packaging/model.png");

const LICENCES: [(&str, &str); 4] = [
    ("licenses/Apache-2.0.txt", include_str!("../../packaging/licenses/Apache-2.0.txt")),
    ("licenses/MIT.txt", include_str!("../../packaging/licenses/MIT.txt")),
    ("licenses/ZPL-2.1.txt", include_str!("../../packaging/licenses/ZPL-2.1.txt")),
    ("licenses/third-party.txt", include_str!("../../packaging/licenses/third-party.txt")),
];

/// What can go wrong in writing an FMU.
#[derive(Debug, thiserror::Error)]
pub enum FmuError {
    /// No shared library anywhere.
    #[error(
        "no shared library of kisspoint was found (looked at {0}); build it with `cargo build --release --lib --no-default-features` or name it with --library"
    )]
    NoLibrary(String),
    /// The environment variable names a library that does not exist.
    #[error("{}, which the environment variable {} names, is no file; correct the variable, unset it, or name the library with --library", .0.display(), library::VARIABLE)]
    InVariable(PathBuf),
    /// A file is not a shared library that an FMU can hold.
    #[error("{}: {what}; give an ELF .so or a PE .dll for x86-64 or AArch64", path.display())]
    NotALibrary {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: &'static str,
    },
    /// A library was built from another version of the model description.
    #[error("{} does not hold the GUID of {model}: it was built from another model description; build it again with `cargo build --release --lib --no-default-features`", path.display())]
    Outdated {
        /// The file.
        path: PathBuf,
        /// The model.
        model: &'static str,
    },
    /// Two libraries for one platform.
    #[error("{} and {} are both for {platform}; name one of them", first.display(), second.display())]
    Twice {
        /// The platform.
        platform: &'static str,
        /// One file.
        first: PathBuf,
        /// The other.
        second: PathBuf,
    },
    /// C sources are missing.
    #[error("{}: {source}; packaging/sources.sh makes the C sources, --sources names their folder", path.display())]
    Sources {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// C sources were made from another version of the model description.
    #[error(
        "the C sources do not hold the GUID of {model}: they were made from another model description; make them again with `packaging/sources.sh`"
    )]
    SourcesOutdated {
        /// The model.
        model: &'static str,
    },
    /// A file cannot be read or written.
    #[error("{}: {source}; check path and permissions", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The archive cannot be made.
    #[error("the archive cannot be made: {0}")]
    Archive(#[from] zip::result::ZipError),
    /// The archive cannot be filled.
    #[error("the archive cannot be filled: {0}")]
    Fill(#[from] std::io::Error),
}

/// A file: its name and its bytes.
pub type File = (String, Vec<u8>);

/// Both FMUs, `launch.ssp` and `OspSystemStructure.xml`.
///
/// # Errors
/// A library or the sources do not fit the models, or an archive cannot be made.
pub fn all(libraries: &[Library], extras: Extras, vehicle: &Vehicle, effects: &Parameters) -> Result<Vec<File>, FmuError> {
    let mut fmus = Vec::new();
    for model in &MODELS {
        fmus.push((model, with_extras(model, libraries, extras, vehicle, effects)?));
    }
    let mut files: Vec<File> =
        vec![("launch.ssp".into(), system::ssp(&fmus, vehicle)?), ("OspSystemStructure.xml".into(), system::osp(vehicle).into_bytes())];
    files.extend(fmus.into_iter().map(|(model, bytes)| (format!("{}.fmu", model.description.name), bytes)));
    Ok(files)
}

/// The vehicle document of the resources. It also holds the effects that are not null, faults, and what a campaign has found, so that the FMU starts with them in every importer.
fn document(vehicle: &Vehicle, effects: &Parameters, beside: &Beside) -> serde_json::Value {
    let mut document = vehicle.to_value();
    if *effects != effects::null() {
        document["effects"] = effects::to_value(effects);
    }
    if let Some(faults) = beside.faults.filter(|f| !f.is_empty()) {
        document["faults"] = faults.to_value();
    }
    if let Some(validated) = beside.validated {
        document["validated"] = validated.to_value();
    }
    document
}

/// What an importer passes in order to start an instance of a model: GUID, and the text of `resources/vehicle.json`.
pub fn start(model: &Model, vehicle: &Vehicle, effects: &Parameters) -> (String, String) {
    let none = Beside::default();
    (description::guid(model, vehicle, effects, &none), document(vehicle, effects, &none).to_string())
}

/// Optional contents of an FMU besides binaries and a vehicle.
#[derive(Clone, Copy, Debug, Default)]
pub struct Extras<'a> {
    /// C sources.
    pub sources: Option<&'a Sources>,
    /// What the plant's vehicle file holds besides its car.
    pub beside: Beside<'a>,
}

/// What a plant's vehicle file may hold besides its car.
#[derive(Clone, Copy, Debug, Default)]
pub struct Beside<'a> {
    /// Faults to be played.
    pub faults: Option<&'a Faults>,
    /// Where a campaign has validated the plant, and how well its clutch torque is known there.
    pub validated: Option<&'a Validated>,
}

impl Beside<'_> {
    /// All numbers, which enter the GUID.
    fn numbers(&self) -> impl Iterator<Item = f64> {
        self.faults.into_iter().flat_map(Faults::numbers).chain(self.validated.into_iter().flat_map(Validated::numbers))
    }
}

/// The bytes of an FMU with these extras.
///
/// # Errors
/// A library or sources that do not belong to this model.
pub fn with_extras(
    model: &Model,
    libraries: &[Library],
    extras: Extras,
    vehicle: &Vehicle,
    effects: &Parameters,
) -> Result<Vec<u8>, FmuError> {
    let beside = if model.description.has_effects() { extras.beside } else { Beside::default() };
    let mut xml = description::complete_with(model, vehicle, effects, &beside);
    if extras.sources.is_some() {
        xml = sources::declared(&xml);
    }
    let mut files: Vec<File> = vec![
        ("modelDescription.xml".into(), xml.clone().into_bytes()),
        ("model.png".into(), ICON.to_vec()),
        ("documentation/index.html".into(), html::page(model, &xml).into_bytes()),
        ("resources/vehicle.json".into(), format!("{:#}\n", document(vehicle, effects, &beside)).into_bytes()),
    ];
    files.push((format!("{}/fmi-ls-manifest.xml", a2l::FOLDER), a2l::manifest(model).into_bytes()));
    for library in libraries {
        let folder = format!("{}/{}", a2l::FOLDER, library.platform);
        files.push((format!("{folder}/{}.a2l", model.description.name), a2l::write(model, &xml).into_bytes()));
    }
    files.extend(LICENCES.map(|(name, text)| (name.to_owned(), text.as_bytes().to_vec())));
    for library in libraries {
        library.check(model)?;
        files.push((library.entry(model), library.bytes.clone()));
    }
    if let Some(sources) = extras.sources {
        files.extend(sources.files(model, &document(vehicle, effects, &beside))?);
    }
    archive_of(&files)
}

/// An archive of these files. Every entry has the earliest time that the format allows, so that equal contents give equal bytes.
///
/// # Errors
/// A name or size that the format does not allow.
pub fn archive_of(files: &[File]) -> Result<Vec<u8>, FmuError> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated).last_modified_time(zip::DateTime::default());
    for (name, bytes) in files {
        let mode = if name.starts_with("binaries/") { 0o755 } else { 0o644 };
        zip.start_file(name.as_str(), options.unix_permissions(mode))?;
        zip.write_all(bytes)?;
    }
    Ok(zip.finish()?.into_inner())
}

/// The files of an archive, in its order.
///
/// # Errors
/// The bytes are not an archive.
pub fn files_of(archive: &[u8]) -> Result<Vec<File>, FmuError> {
    let mut zip = zip::ZipArchive::new(Cursor::new(archive))?;
    let mut files = Vec::with_capacity(zip.len());
    for index in 0..zip.len() {
        let mut entry = zip.by_index(index)?;
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes)?;
        files.push((entry.name()?.into_owned(), bytes));
    }
    Ok(files)
}
