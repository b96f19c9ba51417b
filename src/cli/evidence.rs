//! The evidence of a diagnosis in one archive, `evidence.ssp`: the retuned plant, its parameters, the held-out data as an experiment, the answer and the report, each with its
//! checksum.
//!
//! | file | standard |
//! |---|---|
//! | `SystemStructure.ssd`, `resources/` | SSP 1.0 |
//! | `extra/org.ssp-standard.ssp-traceability.stmd/SimulationTask.stmd` | STMD of SSP Traceability 1.0: the task, its inputs and outputs |
//! | `resources/*.srmd` | SRMD of SSP Traceability 1.0: a resource's name and SHA3-256 |
//! | `extra/org.fmi-standard.fmi-ls-ref/fmi-ls-manifest.xml` in the FMU | FMI-LS-REF: the purpose of each file |
//!
//! The archive holds no time stamp and no name of a person, so equal answers give equal bytes; whoever releases it signs it.

use crate::campaign::{self, Campaign, CampaignError, Recording};
use crate::fmu::{FmuError, archive_of, system};
use crate::gap::diagnosis::Diagnosis;
use serde_json::{Map, Value};
use sha3::{Digest, Sha3_256};
use std::fmt::Write;

/// A resource of the archive: path below `resources/`, its kind in SSP Traceability, its role in FMI-LS-REF, MIME type, description, and content.
struct Resource<'a> {
    path: String,
    kind: &'static str,
    role: &'static str,
    mime: &'static str,
    meaning: &'a str,
    bytes: Vec<u8>,
}

const LS_REF: &str = "extra/org.fmi-standard.fmi-ls-ref";
const STMD: &str = "extra/org.ssp-standard.ssp-traceability.stmd/SimulationTask.stmd";
const TRACEABILITY: &str = "http://ssp-standard.org/SSPTraceability1";
const SSC: &str = "xmlns:ssc=\"http://ssp-standard.org/SSP1/SystemStructureCommon\"";

/// Instructions for reproducing the numbers of the answer.
const PROCEDURE: &str = "Instantiate DrivelinePlant.fmu. Set omega_f_start and omega_c_start to the first sample of the experiment (omega_c divided by \
effect.clutch_speed_gain.gain; both to their mean if they differ by less than 0.6 rad/s with the clutch more than half closed), theta_c_start and \
theta_b_start to the temperatures noted in recordings.json, and the inputs to the first row. At every row compare the outputs, then set x_to, T_e_ref and \
theta_h to the row's x_to_cmd_mm, T_e_Nm and theta_h_degC and step to the next row. The root mean square of the differences is how_far.per_recording.after of \
diagnosis.json, or how_far.empirical.per_recording.after where a learned law was taken; with plant.nominal_parameters set before initialization it is before. \
The temperatures at which an engagement of a drive begins are those of the retuned plant; before was computed from those of the nominal one, so that it comes out \
a few per cent different.";

/// Why no archive was made.
#[derive(Debug, thiserror::Error)]
pub enum EvidenceError {
    /// A recording has no position command to drive the retuned plant with.
    #[error(
        "evidence repeats the answer by driving the retuned FMU with x_to_cmd_mm, which {0} does not have; record it, or leave --evidence out"
    )]
    NoPosition(String),
    /// A recording cannot be written.
    #[error(transparent)]
    Campaign(#[from] CampaignError),
    /// The archive cannot be made.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// A temporary file cannot be read or written.
    #[error("the evidence cannot be put together: {0}")]
    File(#[from] std::io::Error),
}

/// The bytes of `evidence.ssp`. `files` holds the names and bytes of the answer's own files: diagnosis.json, report.html, plant.ssv and DrivelinePlant.fmu.
///
/// # Errors
/// A recording or the archive that cannot be written.
pub fn archive(diagnosis: &Diagnosis, files: &[(&str, Vec<u8>)], campaign: &Campaign) -> Result<Vec<u8>, EvidenceError> {
    if let Some(r) = campaign.recordings.iter().find(|r| r.x_to_cmd.is_empty()) {
        return Err(EvidenceError::NoPosition(r.name.clone()));
    }
    let file = |name: &str| files.iter().find(|f| f.0 == name).map(|f| f.1.clone()).unwrap_or_default();
    let of = |path: &str, kind, role, mime, meaning, bytes| Resource { path: path.to_owned(), kind, role, mime, meaning, bytes };
    let mut resources = vec![
        of(
            "plant.ssv",
            "parameter",
            "parameter",
            "application/x-ssp-parameter-set",
            "Parameters that make the plant this vehicle",
            file("plant.ssv"),
        ),
        of("diagnosis.json", "result", "result", "application/json", "The answer: where, which, how far", file("diagnosis.json")),
        of("report.html", "report", "report", "text/html", "The answer with its curves, for people", file("report.html")),
        of(
            "vehicle.json",
            "parameter",
            "other",
            "application/json",
            "The vehicle as the campaign has it",
            format!("{:#}\n", campaign.vehicle_json).into_bytes(),
        ),
    ];
    for (name, bytes) in written(&diagnosis.held_out)? {
        let (mime, meaning) = match name.ends_with(".csv") {
            true => ("text/csv", "What took no part in the fit"),
            false => ("application/json", "Manoeuvre and start temperatures of the experiment"),
        };
        resources.push(of(&format!("experiments/{name}"), "testcase", "experiment/validation", mime, meaning, bytes));
    }
    let fmu = with_references(&file("DrivelinePlant.fmu"), &resources)?;
    resources.insert(0, of("DrivelinePlant.fmu", "model", "model", "application/x-fmu-sharedlibrary", "The retuned plant", fmu));
    let mut all = vec![("SystemStructure.ssd".to_owned(), system::single("evidence", "plant", "DrivelinePlant").into_bytes())];
    all.push((STMD.to_owned(), task(&diagnosis.json, &resources).into_bytes()));
    for r in resources {
        all.push((format!("resources/{}.srmd", r.path), metadata(&r, name(&r.path)).into_bytes()));
        all.push((format!("resources/{}", r.path), r.bytes));
    }
    Ok(archive_of(&all)?)
}

fn name(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or(path)
}

/// The experiment as files of a campaign. Spaces in its name are replaced, because references must not contain any.
fn written(experiment: &Recording) -> Result<Vec<(String, Vec<u8>)>, EvidenceError> {
    let folder = std::env::temp_dir().join(format!("kisspoint-evidence-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let write = || -> Result<Vec<(String, Vec<u8>)>, EvidenceError> {
        let mut files = Vec::new();
        let recording = Recording { name: experiment.name.replace(' ', "_"), ..experiment.clone() };
        let name = format!("{}.csv", recording.name);
        campaign::write_csv(&recording, &folder.join(&name))?;
        files.push((name.clone(), std::fs::read(folder.join(&name))?));
        campaign::write_recordings_json(&[recording], &folder.join("recordings.json"))?;
        files.push(("recordings.json".to_owned(), std::fs::read(folder.join("recordings.json"))?));
        Ok(files)
    };
    let files = write();
    std::fs::remove_dir_all(&folder)?;
    files
}

/// SHA3-256 in hexadecimal digits.
fn checksum(bytes: &[u8]) -> String {
    Sha3_256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

fn metadata(resource: &Resource, data: &str) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<srmd:SimulationResourceMetaData xmlns:srmd=\"{TRACEABILITY}/SimulationResourceMetaData\" \
         xmlns:stc=\"{TRACEABILITY}/SSPTraceabilityCommon\" version=\"1.0.0\" name=\"{0}\" data=\"{data}\" checksum=\"{1}\" checksumType=\"SHA3-256\" \
         generationTool=\"kisspoint {2}\">\n  <stc:Classification type=\"org.kisspoint.evidence\">\n    \
         <stc:ClassificationEntry keyword=\"role\">{3}</stc:ClassificationEntry>\n    \
         <stc:ClassificationEntry keyword=\"meaning\">{4}</stc:ClassificationEntry>\n  </stc:Classification>\n</srmd:SimulationResourceMetaData>\n",
        resource.path,
        checksum(&resource.bytes),
        env!("CARGO_PKG_VERSION"),
        resource.role,
        resource.meaning
    )
}

/// The STMD file.
fn task(answer: &Value, resources: &[Resource]) -> String {
    let listed = |kinds: &[&str]| {
        let mut text = String::new();
        for r in resources.iter().filter(|r| kinds.contains(&r.kind)) {
            writeln!(
                text,
                "        <stc:Resource kind=\"{}\" type=\"{}\" source=\"../../resources/{}\" description=\"{}\"/>",
                r.kind, r.mime, r.path, r.meaning
            )
            .expect("a String takes all text");
        }
        text
    };
    let all: String = resources.iter().map(|r| checksum(&r.bytes)).collect();
    let guid = checksum(all.as_bytes());
    let how_far = &answer["how_far"];
    let figures: Map<String, Value> =
        ["metric", "before", "after", "closed_fraction"].into_iter().map(|key| (key.to_owned(), how_far[key].clone())).collect();
    let mut entries = format!(
        "      <stc:ClassificationEntry keyword=\"verdict\">{}</stc:ClassificationEntry>\n",
        answer["verdict"].as_str().unwrap_or("")
    );
    for (key, value) in &figures {
        let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned).replace('&', "&amp;").replace('<', "&lt;");
        writeln!(entries, "      <stc:ClassificationEntry keyword=\"{key}\">{value}</stc:ClassificationEntry>")
            .expect("a String takes all text");
    }
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<stmd:SimulationTaskMetaData xmlns:stmd=\"{TRACEABILITY}/SimulationTaskMetaData\" \
         xmlns:stc=\"{TRACEABILITY}/SSPTraceabilityCommon\" {SSC} version=\"1.0.0\" name=\"Retuned plant on recordings that took no part in the fit\" \
         GUID=\"{}-{}-{}-{}-{}\" generationTool=\"kisspoint {}\">\n  <stmd:ExecutionPhase>\n    <stmd:ExecuteSimulation>\n      <stc:Input>\n{}      </stc:Input>\n      \
         <stc:Procedure>\n        <stc:Resource kind=\"method\" type=\"text/plain\"><stc:Content>{PROCEDURE}</stc:Content></stc:Resource>\n      </stc:Procedure>\n      \
         <stc:Output>\n{}      </stc:Output>\n    </stmd:ExecuteSimulation>\n  </stmd:ExecutionPhase>\n  <stmd:EvaluationPhase>\n    <stmd:EvaluateSimulationResults>\n      \
         <stc:Output>\n{}      </stc:Output>\n    </stmd:EvaluateSimulationResults>\n  </stmd:EvaluationPhase>\n  <stc:Classification type=\"org.kisspoint.evidence\">\n{entries}  </stc:Classification>\n\
         </stmd:SimulationTaskMetaData>\n",
        &guid[..8],
        &guid[8..12],
        &guid[12..16],
        &guid[16..20],
        &guid[20..32],
        env!("CARGO_PKG_VERSION"),
        listed(&["model", "parameter", "testcase"]),
        listed(&["result"]),
        listed(&["report"]),
    )
}

/// The FMU with the resources and their metadata added, and the FMI-LS-REF manifest that states the purpose of each file.
fn with_references(fmu: &[u8], resources: &[Resource]) -> Result<Vec<u8>, EvidenceError> {
    let mut manifest =
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiReferences xmlns:fmi-ls=\"http://fmi-standard.org/fmi-ls-manifest\" \
        fmi-ls:fmi-ls-name=\"org.fmi-standard.fmi-ls-ref\" fmi-ls:fmi-ls-version=\"1.0.0-alpha.1\" \
        fmi-ls:fmi-ls-description=\"Layered Standard providing information on related files included in an FMU.\">\n"
            .to_owned();
    let mut files = crate::fmu::files_of(fmu)?;
    for r in resources {
        let Resource { path, role, mime, meaning, .. } = r;
        writeln!(manifest, "  <Related type=\"{mime}\" source=\"{path}\" role=\"{role}\" description=\"{meaning}\"/>")
            .expect("a String takes all text");
        writeln!(manifest, "  <Related type=\"application/x-srmd-meta-data\" source=\"{path}.srmd\" role=\"meta-data\" description=\"Checksum of {path}\"/>")
            .expect("a String takes all text");
        files.push((format!("{LS_REF}/{path}"), r.bytes.clone()));
        files.push((format!("{LS_REF}/{path}.srmd"), metadata(r, name(path)).into_bytes()));
    }
    files.push((format!("{LS_REF}/fmi-ls-manifest.xml"), (manifest + "</fmiReferences>\n").into_bytes()));
    Ok(archive_of(&files)?)
}
