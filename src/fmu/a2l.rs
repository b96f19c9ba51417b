//! A2L (ASAM MCD-2 MC 1.6) for the calibration bench, placed in the FMU as FMI-LS-XCP 1.0 requires: measurements and characteristics of a model.
//!
//! An instance keeps every variable as a 64-bit float in one block, in the order of the model description. The address of a variable is its offset in
//! that block, in bytes; `kisspoint_values` gives the address of the block, which an XCP service adds as its base. Values that the service writes are
//! checked before the next step as `fmi2SetReal` would check them.

use super::Model;
use super::description::attribute;
use crate::fmi2::variables::{Causality, Kind, Variability, Variable};
use std::collections::BTreeSet;
use std::fmt::Write;

/// Folder of the layered standard in an FMU.
pub const FOLDER: &str = "extra/org.fmi-standard.fmi-ls-xcp";

/// Magnitude of the bound that is written where a variable has none.
const UNBOUNDED: f64 = 1e300;

const DESCRIPTION: &str = "Layered standard based on FMI 2.0 and FMI 3.0 for describing and implementing XCP support for FMUs, which can either provide an XCP service or allow direct memory access via A2L files.";

/// `fmi-ls-manifest.xml`.
pub fn manifest(model: &Model) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiLayeredStandardManifest xmlns:fmi-ls=\"http://fmi-standard.org/fmi-ls-manifest\" \
         fmi-ls:fmi-ls-name=\"org.fmi-standard.fmi-ls-xcp\" fmi-ls:fmi-ls-version=\"1.0.0\" fmi-ls:fmi-ls-description=\"{DESCRIPTION}\">\n  \
         <Interface definition=\"{0}.a2l\" types=\"CoSimulation\" description=\"Variables of {0}; addresses count from kisspoint_values\" supportsDirectMemoryAccess=\"true\"/>\n\
         </fmiLayeredStandardManifest>\n",
        model.description.name
    )
}

/// The A2L file of a model, from its completed model description.
pub fn write(model: &Model, xml: &str) -> String {
    let (name, variables) = (model.description.name, model.description.variables);
    let mut text = format!(
        "ASAP2_VERSION 1 61\n/begin PROJECT {name} \"kisspoint {0}\"\n  /begin MODULE {name} \"FMI 2.0 co-simulation\"\n    \
         /begin MOD_COMMON \"\" BYTE_ORDER MSB_LAST ALIGNMENT_FLOAT64_IEEE 8 /end MOD_COMMON\n    \
         /begin RECORD_LAYOUT Number FNC_VALUES 1 FLOAT64_IEEE ROW_DIR DIRECT /end RECORD_LAYOUT\n",
        env!("CARGO_PKG_VERSION")
    );
    let units: BTreeSet<&str> = variables.iter().map(|v| v.unit).collect();
    for unit in units {
        let method = method(unit);
        writeln!(text, "    /begin COMPU_METHOD {method} \"\" IDENTICAL \"%16.8\" \"{unit}\" /end COMPU_METHOD")
            .expect("a String takes all text");
    }
    let meaning = |v: &Variable| {
        let line = xml.lines().find(|line| line.contains("<ScalarVariable") && attribute(line, "name") == Some(v.name));
        line.and_then(|line| attribute(line, "description"))
            .unwrap_or_default()
            .replace("&gt;", ">")
            .replace("&lt;", "<")
            .replace("&amp;", "&")
    };
    for (index, v) in variables.iter().enumerate() {
        let (address, meaning, method) = (8 * index, meaning(v), method(v.unit));
        let (least, most) = if v.kind == Kind::Boolean { (0.0, 1.0) } else { (v.min.max(-UNBOUNDED), v.max.min(UNBOUNDED)) };
        let line = match v.causality {
            Causality::Parameter => {
                let fixed = if v.variability == Variability::Tunable { "" } else { " READ_ONLY" };
                format!(
                    "/begin CHARACTERISTIC {} \"{meaning}\" VALUE {address:#x} Number 0 {method} {least:?} {most:?}{fixed} /end CHARACTERISTIC",
                    v.name
                )
            }
            _ => {
                let input = if v.causality == Causality::Input { " READ_WRITE" } else { "" };
                format!(
                    "/begin MEASUREMENT {} \"{meaning}\" FLOAT64_IEEE {method} 0 0 {least:?} {most:?} ECU_ADDRESS {address:#x}{input} /end MEASUREMENT",
                    v.name
                )
            }
        };
        writeln!(text, "    {line}").expect("a String takes all text");
    }
    text + "  /end MODULE\n/end PROJECT\n"
}

/// Name of the conversion method for a unit.
fn method(unit: &str) -> String {
    let plain: String = unit.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    format!("Unit_{plain}")
}
