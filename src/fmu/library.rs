//! The shared libraries that go into an FMU, found and recognised by their headers.

use super::{FmuError, Model};
use std::path::{Path, PathBuf};
use std::{env, fs};

/// Environment variable that names the library.
pub const VARIABLE: &str = "KISSPOINT_LIBRARY";

/// Folders of the platforms that libraries can be built for.
pub const PLATFORMS: [&str; 3] = ["linux64", "win64", "aarch64-linux"];

/// A shared library that has been read.
#[derive(Clone, Debug)]
pub struct Library {
    /// Path that it was read from.
    pub path: PathBuf,
    /// Platform folder of the FMU in which it is placed.
    pub platform: &'static str,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

impl Library {
    /// Reads a library and recognises its platform.
    ///
    /// # Errors
    /// The file cannot be read, or is no shared library for a known platform.
    pub fn read(path: &Path) -> Result<Self, FmuError> {
        let bytes = fs::read(path).map_err(|source| FmuError::File { path: path.to_owned(), source })?;
        let platform = platform(&bytes).map_err(|what| FmuError::NotALibrary { path: path.to_owned(), what })?;
        Ok(Self { path: path.to_owned(), platform, bytes: without_build_paths(bytes) })
    }

    /// Its name in the archive of a model: the model identifier, which is the model's name.
    pub fn entry(&self, model: &Model) -> String {
        let ending = if self.platform.starts_with("win") { "dll" } else { "so" };
        format!("binaries/{}/{}.{ending}", self.platform, model.description.name)
    }

    /// Checks that the library holds the model's GUID among its constants.
    pub(super) fn check(&self, model: &Model) -> Result<(), FmuError> {
        let guid = model.description.guid.as_bytes();
        if self.bytes.windows(guid.len()).any(|window| window == guid) {
            return Ok(());
        }
        Err(FmuError::Outdated { path: self.path.clone(), model: model.description.name })
    }
}

/// The library as a WebAssembly module, with which a report replays the plant in a browser: `libraries/wasm32/kisspoint.wasm` beside the executable, or
/// where `packaging/sources.sh` has put it. `None` if there is none, or if it was built from other sources, because it would be another plant.
pub fn module() -> Option<Vec<u8>> {
    let exe = env::current_exe().ok()?;
    let places = ["libraries/wasm32/kisspoint.wasm", "../fmu-sources/kisspoint.wasm"];
    let found = places.iter().find_map(|place| fs::read(exe.parent()?.join(place)).ok())?;
    let sources = concat!("kisspoint-sources:", env!("KISSPOINT_SOURCES")).as_bytes();
    found.windows(sources.len()).any(|window| window == sources).then_some(found)
}

/// Overwrites the paths of the folders that the library was built in with slashes, which keeps every length: an FMU reveals nothing of the machine that made it.
fn without_build_paths(mut bytes: Vec<u8>) -> Vec<u8> {
    for place in env!("KISSPOINT_PLACES").split('|').filter(|place| place.len() > 1) {
        let finder = |bytes: &[u8], from: usize| bytes[from..].windows(place.len()).position(|w| w == place.as_bytes()).map(|k| from + k);
        let mut from = 0;
        while let Some(found) = finder(&bytes, from) {
            bytes[found..found + place.len()].fill(b'/');
            from = found + place.len();
        }
    }
    bytes
}

/// Platform folder of FMI 2.0 according to the file's header. AArch64 has none in the standard and gets the name that tools use.
fn platform(bytes: &[u8]) -> Result<&'static str, &'static str> {
    let half = |at: usize| bytes.get(at..at + 2).map(|b| u16::from_le_bytes([b[0], b[1]]));
    if bytes.starts_with(b"\x7fELF\x02\x01") {
        return match half(18) {
            Some(0x3e) => Ok("linux64"),
            Some(0xb7) => Ok("aarch64-linux"),
            _ => Err("an ELF file for another processor"),
        };
    }
    if bytes.starts_with(b"MZ") {
        let header = bytes.get(0x3c..0x40).map_or(0, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
        return match (bytes.get(header..header + 4), half(header + 4)) {
            (Some(b"PE\0\0"), Some(0x8664)) => Ok("win64"),
            (Some(b"PE\0\0"), _) => Err("a DLL for another processor"),
            _ => Err("not a DLL"),
        };
    }
    Err("not a shared library")
}

/// The named libraries or, if none is named, those that are found: the one in the environment variable, otherwise all in the folder `libraries`
/// beside the executable, otherwise the one beside the executable or installed with it.
///
/// # Errors
/// None is found, one is invalid, or two are for the same platform.
pub fn find(named: &[PathBuf]) -> Result<Vec<Library>, FmuError> {
    let paths = if named.is_empty() { search()? } else { named.to_vec() };
    let mut libraries: Vec<Library> = Vec::new();
    for path in paths {
        let library = Library::read(&path)?;
        if let Some(other) = libraries.iter().find(|other| other.platform == library.platform) {
            let (first, second) = (other.path.clone(), library.path);
            return Err(FmuError::Twice { platform: library.platform, first, second });
        }
        libraries.push(library);
    }
    libraries.sort_by_key(|library| library.platform);
    Ok(libraries)
}

fn search() -> Result<Vec<PathBuf>, FmuError> {
    if let Some(path) = env::var_os(VARIABLE).filter(|path| !path.is_empty()).map(PathBuf::from) {
        return if path.is_file() { Ok(vec![path]) } else { Err(FmuError::InVariable(path)) };
    }
    let name = if cfg!(windows) { "kisspoint.dll" } else { "libkisspoint.so" };
    let beside = env::current_exe().ok().and_then(|exe| Some(exe.parent()?.to_owned())).unwrap_or_default();
    let every =
        |platform: &str| fs::read_dir(beside.join("libraries").join(platform)).into_iter().flatten().flatten().map(|entry| entry.path());
    let all: Vec<PathBuf> = PLATFORMS.into_iter().flat_map(every).collect();
    if !all.is_empty() {
        return Ok(all);
    }
    let places = [beside.join(name), beside.join("../lib/kisspoint").join(name)];
    let looked_at = || places.each_ref().map(|p| p.display().to_string()).join(", ");
    places.iter().find(|p| p.is_file()).map(|p| vec![p.clone()]).ok_or_else(|| FmuError::NoLibrary(format!("${VARIABLE}, {}", looked_at())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_place_of_the_build_is_wiped_out() {
        let text = concat!("before ", env!("CARGO_MANIFEST_DIR"), "/src/lib.rs after").as_bytes().to_vec();
        let wiped = String::from_utf8(without_build_paths(text.clone())).unwrap();
        assert_eq!(wiped.len(), text.len());
        assert!(
            wiped.starts_with("before //") && wiped.ends_with("//src/lib.rs after") && !wiped.contains(env!("CARGO_MANIFEST_DIR")),
            "{wiped}"
        );
    }

    #[test]
    fn platforms_are_recognised() {
        let mut elf = b"\x7fELF\x02\x01".to_vec();
        elf.resize(64, 0);
        elf[18] = 0x3e;
        assert_eq!(platform(&elf), Ok("linux64"));
        elf[18] = 0xb7;
        assert_eq!(platform(&elf), Ok("aarch64-linux"));
        let mut dll = b"MZ".to_vec();
        dll.resize(0x90, 0);
        dll[0x3c] = 0x80;
        dll[0x80..0x86].copy_from_slice(b"PE\0\0\x64\x86");
        assert_eq!(platform(&dll), Ok("win64"));
        assert!([&elf, &dll].iter().all(|bytes| PLATFORMS.contains(&platform(bytes).unwrap())));
        assert!(platform(b"MZ").is_err() && platform(b"").is_err() && platform(b"\x7fELF\x02\x01").is_err());
    }
}
