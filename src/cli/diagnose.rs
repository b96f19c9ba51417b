//! `kisspoint diagnose`: where a simulation departs from a car, which effect causes it, how far the gap shrinks.

use super::progress::Progress;
use crate::campaign::{self, CampaignError, ChannelMap, ReadOptions};
use crate::fmu::{self, FmuError, library, ssv};
use crate::gap::answer::plant_parameters;
use crate::gap::diagnosis::{Diagnosis, DiagnosisError, diagnose};
use crate::report;
use std::path::{Path, PathBuf};

/// Options of `kisspoint diagnose`.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "Writes diagnosis.json, report.html, plant.ssv and DrivelinePlant.fmu into DIR. Exit code 0 whatever the verdict.\n\nExamples:\n  kisspoint diagnose measurements/car_17 --out out/car_17\n  kisspoint diagnose measurements/* --out out"
)]
pub struct Args {
    /// Folders with vehicle.json, recordings.json and the recordings
    #[arg(value_name = "CAMPAIGN", required = true)]
    campaigns: Vec<PathBuf>,
    /// Folder for the answer; of several campaigns, each has a folder of its name in it
    #[arg(long, value_name = "DIR", required_unless_present = "json")]
    out: Option<PathBuf>,
    /// Print diagnosis.json to standard output
    #[arg(long)]
    json: bool,
    /// Names and units of the channels, TOML or JSON
    #[arg(long, value_name = "FILE")]
    channel_map: Option<PathBuf>,
    /// Refuse the campaign if any recording has a defect
    #[arg(long)]
    strict: bool,
    /// Threads; 0 takes all cores. The answer does not depend on it
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// Shared library for the retuned FMU, one per platform; else $KISSPOINT_LIBRARY, or the one beside this program
    #[arg(long, value_name = "FILE")]
    library: Vec<PathBuf>,
}

/// What can go wrong.
#[derive(Debug, thiserror::Error)]
pub enum DiagnoseError {
    /// The campaign.
    #[error(transparent)]
    Campaign(#[from] CampaignError),
    /// The diagnosis.
    #[error("{}: {source}", path.display())]
    Diagnosis {
        /// The campaign.
        path: PathBuf,
        /// What is wrong.
        source: DiagnosisError,
    },
    /// The FMU.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// Two campaigns would share a folder.
    #[error("{} and {} have one name, so that their answers would overwrite each other; diagnose them one by one", .0.display(), .1.display())]
    SameName(PathBuf, PathBuf),
    /// Threads.
    #[error("threads cannot be started: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// A file.
    #[error("{}: {source}; check path and permissions", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
}

/// Runs the subcommand.
///
/// # Errors
/// A campaign that cannot be read or diagnosed, a missing shared library, a folder that cannot be written.
pub fn run(args: &Args) -> Result<(), DiagnoseError> {
    // Found before the work begins: nobody wants to hear of a missing library after it.
    let libraries = if args.out.is_some() { library::find(&args.library)? } else { Vec::new() };
    let channel_map = args.channel_map.as_deref().map(ChannelMap::from_file).transpose()?;
    let options = ReadOptions { channel_map, strict: args.strict };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads).build()?;
    let several = args.campaigns.len() > 1;
    let folder_of = |path: &Path| std::fs::canonicalize(path).ok().and_then(|p| p.file_name().map(PathBuf::from)).unwrap_or_default();
    for (k, path) in args.campaigns.iter().enumerate() {
        let same = args.campaigns[..k].iter().find(|other| folder_of(other) == folder_of(path));
        if let Some(other) = same.filter(|_| several) {
            return Err(DiagnoseError::SameName(other.clone(), path.clone()));
        }
    }
    for path in &args.campaigns {
        let out = args.out.as_ref().map(|out| if several { out.join(folder_of(path)) } else { out.clone() });
        if several && !args.json {
            println!("{}", path.display());
        }
        one(path, out.as_deref(), args.json, &options, &pool, &libraries)?;
    }
    Ok(())
}

fn one(
    path: &Path,
    out: Option<&Path>,
    as_json: bool,
    options: &ReadOptions,
    pool: &rayon::ThreadPool,
    libraries: &[library::Library],
) -> Result<(), DiagnoseError> {
    let campaign = campaign::read(path, options)?;
    let bar = Progress::new();
    let diagnosis = pool
        .install(|| diagnose(&campaign, &|what, share| bar.tell(what, share)))
        .map_err(|source| DiagnoseError::Diagnosis { path: path.to_owned(), source })?;
    bar.finish();
    let text = format!("{:#}\n", diagnosis.json);
    if let Some(out) = out {
        write(out, &files(&diagnosis, &text, &provenance(&campaign.fingerprint), libraries)?)?;
    }
    if as_json {
        print!("{text}");
    } else {
        summary(&diagnosis, out);
    }
    Ok(())
}

fn provenance(fingerprint: &str) -> Vec<(String, String)> {
    [("kisspoint", env!("CARGO_PKG_VERSION")), ("data fingerprint (SHA-256)", fingerprint)]
        .map(|(k, v)| (k.to_owned(), v.to_owned()))
        .to_vec()
}

fn files(
    diagnosis: &Diagnosis,
    text: &str,
    provenance: &[(String, String)],
    libraries: &[library::Library],
) -> Result<Vec<(&'static str, Vec<u8>)>, FmuError> {
    let report = report::html(&report::Input { diagnosis: &diagnosis.json, overlays: &diagnosis.overlays, provenance });
    let plant = fmu::MODELS.iter().find(|m| m.description.name == "DrivelinePlant").expect("the plant is one of the models");
    let archive = fmu::archive(plant, libraries, &diagnosis.vehicle, &diagnosis.effects)?;
    let named = plant_parameters(&diagnosis.vehicle, &diagnosis.effects);
    let set: Vec<ssv::Parameter> = plant
        .description
        .variables
        .iter()
        .filter_map(|v| {
            named.get(v.name).and_then(serde_json::Value::as_f64).map(|value| ssv::Parameter { name: v.name, value, unit: v.unit })
        })
        .collect();
    Ok(vec![
        ("diagnosis.json", text.as_bytes().to_vec()),
        ("report.html", report.into_bytes()),
        ("plant.ssv", ssv::write("retuned", &set).into_bytes()),
        ("DrivelinePlant.fmu", archive),
    ])
}

/// Writes every file beside its place first and renames it then, so that an interruption leaves nothing half-written.
fn write(out: &Path, files: &[(&'static str, Vec<u8>)]) -> Result<(), DiagnoseError> {
    let at = |path: &Path| {
        let path = path.to_owned();
        move |source| DiagnoseError::File { path, source }
    };
    std::fs::create_dir_all(out).map_err(at(out))?;
    for (name, bytes) in files {
        let (path, partial) = (out.join(name), out.join(format!(".{name}.partial")));
        std::fs::write(&partial, bytes).and_then(|()| std::fs::rename(&partial, &path)).map_err(at(&path))?;
    }
    Ok(())
}

fn summary(diagnosis: &Diagnosis, out: Option<&Path>) {
    let json = &diagnosis.json;
    println!("{}", json["sentence"].as_str().unwrap_or_default());
    for effect in json["which"]["effects"].as_array().into_iter().flatten() {
        println!("  {} (probability {})", effect["id"].as_str().unwrap_or_default(), effect["probability"]);
        for (name, p) in effect["parameters"].as_object().into_iter().flatten() {
            println!("    {name} = {} [{}, {}] {}", p["value"], p["low"], p["high"], p["unit"].as_str().unwrap_or_default());
        }
        let group: Vec<&str> = effect["ambiguous_with"].as_array().into_iter().flatten().filter_map(serde_json::Value::as_str).collect();
        if !group.is_empty() {
            println!("    not told apart from: {}", group.join(", "));
        }
    }
    let far = &json["how_far"];
    println!("  speed error on held-out recordings: {} -> {} rad/s (noise {})", far["before"], far["after"], far["noise_floor"]);
    for left in json["left_out"].as_array().into_iter().flatten() {
        println!("  left out: {}: {}", left["recording"].as_str().unwrap_or_default(), left["reason"].as_str().unwrap_or_default());
    }
    if let Some(out) = out {
        println!("  written: {}", out.join("report.html").display());
    }
}
