//! C sources in an FMU, for targets that compile FMUs themselves: the output of `packaging/sources.sh`, under the model's own names.
//!
//! The library is compiled to WebAssembly and that is translated to C99, so that the sources are the same program as the binaries. One file, `all.c`, includes the others.

use super::{File, FmuError, Model};
use std::fs;
use std::path::Path;

/// The files that `packaging/sources.sh` makes.
const FILES: [&str; 6] = ["all.c", "fmi2_functions.c", "runtime.c", "kisspoint.c", "kisspoint.h", "wasm-rt.h"];

/// C sources that have been read.
#[derive(Clone, Debug)]
pub struct Sources(Vec<(&'static str, String)>);

impl Sources {
    /// Reads the folder that `packaging/sources.sh` has filled.
    ///
    /// # Errors
    /// A file is missing or cannot be read.
    pub fn read(folder: &Path) -> Result<Self, FmuError> {
        let read = |name: &'static str| {
            let path = folder.join(name);
            fs::read_to_string(&path).map(|text| (name, text)).map_err(|source| FmuError::Sources { path, source })
        };
        FILES.into_iter().map(read).collect::<Result<_, _>>().map(Self)
    }

    /// The source files for an FMU of this model: all names that a linker sees begin with the model's name.
    ///
    /// # Errors
    /// The sources were made from another model description.
    pub(super) fn files(&self, model: &Model, document: &serde_json::Value) -> Result<Vec<File>, FmuError> {
        let name = model.description.name;
        if !self.0.iter().any(|(_, text)| text.contains(model.description.guid)) {
            return Err(FmuError::SourcesOutdated { model: name });
        }
        let own = |text: &str| {
            text.replace("Z_MODEL", &format!("Z_{name}"))
                .replace("Z_env", &format!("{name}_env"))
                .replace("wasm_rt_", &format!("{name}_rt_"))
        };
        let mut files: Vec<File> = self.0.iter().map(|(file, text)| (format!("sources/{file}"), own(text).into_bytes())).collect();
        let text = document.to_string();
        let header = format!("/* resources/vehicle.json of this FMU. */\n#define KISSPOINT_VEHICLE {text:?}\n");
        files.push(("sources/vehicle.h".to_owned(), header.into_bytes()));
        Ok(files)
    }
}

/// The model description with the source file declared.
pub(super) fn declared(xml: &str) -> String {
    xml.replacen(
        "canSerializeFMUstate=\"true\"/>",
        "canSerializeFMUstate=\"true\">\n    <SourceFiles><File name=\"all.c\"/></SourceFiles>\n  </CoSimulation>",
        1,
    )
}
