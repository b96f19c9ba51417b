//! `kisspoint diagnose`: where a simulation departs from a car, which effect causes it, how far the gap shrinks.

use super::error::CommandError;
use super::files::{writable, write_all};
use super::index::escaped;
use super::output::{alarm, print};
use super::progress::Progress;
use super::summary::summary;
use crate::campaign::{self, Campaign, ChannelMap, ReadOptions, Recording};
use crate::effects::REGISTRY;
use crate::fmu::{self, Beside, Extras, FmuError, library, ssv};
use crate::gap::answer::plant_parameters;
use crate::gap::diagnosis::{Diagnosis, diagnose};
use crate::gap::divide::divided;
use crate::gap::map::{HIGH_TORQUE_NM, HOT_DEGC};
use crate::report::{self, fleet};
use serde_json::json;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// Options of `kisspoint diagnose`.
#[derive(clap::Args, Debug)]
#[command(
    override_usage = "kisspoint diagnose [OPTIONS] --out <DIR> <CAMPAIGN>...\n       kisspoint diagnose [OPTIONS] --json <CAMPAIGN>...",
    after_help = "Writes diagnosis.json, report.html, plant.ssv and DrivelinePlant.fmu into DIR. Exit code 0 whatever the verdict.\n\nExamples:\n  kisspoint diagnose measurements/car_17 --out out/car_17\n  kisspoint diagnose measurements/car_17 --out out/car_17 --evidence\n  kisspoint diagnose measurements/* --out out\n  kisspoint diagnose measurements/* --json > answers.jsonl"
)]
pub struct Args {
    /// Folders with vehicle.json, recordings.json and the recordings
    #[arg(value_name = "CAMPAIGN", required = true)]
    campaigns: Vec<PathBuf>,
    /// Folder for the answer, required unless --json is given; several campaigns each get a subfolder, and index.html links to them
    #[arg(long, value_name = "DIR", required_unless_present = "json")]
    out: Option<PathBuf>,
    /// Print one line for each campaign to standard output, with `campaign` and `diagnosis` (the content of diagnosis.json) or `error`
    #[arg(long)]
    json: bool,
    /// Names and units of the channels, TOML or JSON
    #[arg(long, value_name = "FILE")]
    channel_map: Option<PathBuf>,
    /// Also write evidence.ssp: retuned FMU, held-out recordings, answer and report, with checksums, in the format of SSP Traceability
    #[arg(long, requires = "out")]
    evidence: bool,
    /// Also write curves.json: the car, the nominal and the retuned model, for every recording and channel
    #[arg(long, requires = "out")]
    curves: bool,
    /// Do not write DrivelinePlant.fmu: no shared library is needed, and plant.ssv still holds the retuned numbers
    #[arg(long, conflicts_with_all = ["evidence", "library"])]
    no_fmu: bool,
    /// Refuse the campaign if any recording has a defect
    #[arg(long)]
    strict: bool,
    /// Threads, at most 256; 0 takes all cores. The answer does not depend on it
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u16).range(..=256))]
    threads: u16,
    /// Shared library for the retuned FMU, one per platform; by default $KISSPOINT_LIBRARY, or the one beside this program
    #[arg(long, value_name = "FILE")]
    library: Vec<PathBuf>,
}

/// Runs the subcommand.
///
/// # Errors
/// A campaign that cannot be read or diagnosed, a missing shared library, a folder that cannot be written.
pub fn run(args: &Args) -> Result<(), CommandError> {
    // Checked before the work begins, because a missing library or an unwritable folder should not be reported only after it.
    args.out.as_deref().map(writable).transpose()?;
    let libraries = if args.out.is_some() && !args.no_fmu { library::find(&args.library)? } else { Vec::new() };
    let channel_map = args.channel_map.as_deref().map(ChannelMap::from_file).transpose()?;
    let options = ReadOptions { channel_map, strict: args.strict };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads.into()).build()?;
    let answer =
        |path: &Path, out: Option<&Path>, label: &str| one(path, out, label, [args.evidence, args.curves], &options, &pool, &libraries);
    let [path] = args.campaigns.as_slice() else { return several(args, answer) };
    match answer(path, args.out.as_deref(), "") {
        Ok(diagnosis) if args.json => print(&line(path, &json!({ "diagnosis": diagnosis.json }))),
        Ok(diagnosis) => print(&summary(&diagnosis, args.out.as_deref())),
        Err(error) => {
            if args.json {
                print(&line(path, &json!({ "error": error.to_string() })))?;
            }
            Err(error)
        }
    }
}

/// One line of JSON: the campaign, and its answer or error.
fn line(path: &Path, what: &serde_json::Value) -> String {
    let mut line = what.clone();
    line["campaign"] = path.display().to_string().into();
    format!("{line}\n")
}

/// Diagnoses the campaigns one after the other. A campaign that cannot be read or diagnosed does not stop the following ones.
fn several(args: &Args, answer: impl Fn(&Path, Option<&Path>, &str) -> Result<Diagnosis, CommandError>) -> Result<(), CommandError> {
    let all = args.campaigns.len();
    for (k, path) in args.campaigns.iter().enumerate() {
        if let Some(other) = args.campaigns[..k].iter().find(|other| name(other) == name(path)) {
            return Err(CommandError::SameName(other.clone(), path.clone()));
        }
    }
    let mut failed = 0;
    let mut rows = Vec::new();
    for (k, path) in args.campaigns.iter().enumerate() {
        let label = format!("{} ({} of {all}): ", name(path).display(), k + 1);
        let out = args.out.as_ref().map(|out| out.join(name(path)));
        let shown = path.display().to_string();
        let called = name(path).display().to_string();
        let found = answer(path, out.as_deref(), &label);
        rows.push(match &found {
            Ok(diagnosis) => fleet::row(&called, &format!("{}/report.html", escaped(&called)), &diagnosis.json),
            Err(error) => json!({"name": called, "error": error.to_string(), "effects": []}),
        });
        match found {
            Ok(diagnosis) if args.json => print(&line(path, &json!({ "diagnosis": diagnosis.json })))?,
            Ok(diagnosis) => print(&format!("{shown}\n{}", summary(&diagnosis, out.as_deref())))?,
            Err(error @ (CommandError::Campaign(_) | CommandError::Diagnosis { .. })) => {
                failed += 1;
                alarm(&error);
                if args.json {
                    print(&line(path, &json!({ "error": error.to_string() })))?;
                }
            }
            Err(error) => return Err(error),
        }
    }
    if let Some(out) = &args.out {
        let title = std::fs::canonicalize(out).ok().and_then(|p| p.file_name().map(|n| n.to_string_lossy().into_owned()));
        super::index::write(&out.join("index.html"), &title.unwrap_or_default(), &rows, &serde_json::Value::Null)?;
    }
    if failed == 0 { Ok(()) } else { Err(CommandError::Some { failed, all }) }
}

/// Name of the campaign's folder without its parents; also resolves `.`.
fn name(path: &Path) -> PathBuf {
    std::fs::canonicalize(path).ok().and_then(|p| p.file_name().map(PathBuf::from)).unwrap_or_default()
}

/// Reads and diagnoses a campaign, and writes the answer if there is a folder for it.
fn one(
    path: &Path,
    out: Option<&Path>,
    label: &str,
    [evidence, curves]: [bool; 2],
    options: &ReadOptions,
    pool: &rayon::ThreadPool,
    libraries: &[library::Library],
) -> Result<Diagnosis, CommandError> {
    let bar = Progress::new();
    let read = campaign::read_telling(path, options, &|file, share| bar.tell(&format!("{label}reading {file}"), share));
    bar.finish();
    let campaign = in_parts(read?, path)?;
    // Remarks go to standard error, because standard output may be read by a machine.
    eprint!("{}", campaign.remarks());
    super::memory::has_room(path, &campaign)?;
    let bar = Progress::new();
    let found = pool.install(|| diagnose(&campaign, &|what, share| bar.tell(&format!("{label}{what}"), share)));
    let refused = |source| CommandError::Diagnosis { path: path.to_owned(), source, left_out: campaign.left_out.clone() };
    // On an error the bar is dropped with its owner, so that the message does not appear behind it.
    let diagnosis = found.map_err(refused)?;
    bar.say(&format!("{label}report"));
    let shown = name(path).display().to_string();
    if let Some(out) = out {
        let mut files = files(&diagnosis, &shown, &provenance(&campaign, diagnosis.read.recordings.len(), options), libraries)?;
        if evidence {
            files.push(("evidence.ssp", super::evidence::archive(&diagnosis, &files, &campaign)?));
        }
        if curves {
            files.push(("curves.json", curves_json(&diagnosis).into_bytes()));
        }
        write_all(out, &files)?;
    }
    bar.finish();
    Ok(diagnosis)
}

/// The campaign as it is diagnosed: long drives are divided into parts, and all statements about recordings refer to these parts.
pub(super) fn in_parts(campaign: Campaign, path: &Path) -> Result<Campaign, CommandError> {
    let parts = divided(&campaign).map(Cow::into_owned);
    parts.map_err(|e| CommandError::Diagnosis { path: path.to_owned(), source: e.into(), left_out: campaign.left_out })
}

/// The curves of the report as numbers; samples for which the car has no value are null.
fn curves_json(diagnosis: &Diagnosis) -> String {
    let all = diagnosis.overlays.iter().map(|o| {
        let channels: serde_json::Map<String, serde_json::Value> = o
            .channels
            .iter()
            .map(|c| (c.column.to_owned(), json!({"unit": c.unit, "real": c.real, "before": c.before, "after": c.after})))
            .collect();
        json!({"recording": o.recording, "manoeuvre": o.manoeuvre, "held_out": o.held_out, "dt_s": o.dt, "channels": channels})
    });
    format!("{}\n", json!({ "recordings": all.collect::<Vec<_>>() }))
}

/// Facts that a reader needs to reproduce the answer or to question it.
fn provenance(campaign: &Campaign, used: usize, options: &ReadOptions) -> Vec<(String, String)> {
    let recordings = &campaign.recordings;
    let mut rates: Vec<f64> = recordings.iter().map(|r| r.sample_rate_hz).collect();
    rates.sort_by(f64::total_cmp);
    rates.dedup();
    let rates: Vec<String> = rates.iter().map(|rate| format!("{rate} Hz")).collect();
    let bench = |has: fn(&Recording) -> bool, what| recordings.iter().any(has).then_some(what);
    let bench = [
        bench(|r| r.x_to.is_some(), "position"),
        bench(|r| r.t_fc.is_some(), "clutch torque"),
        bench(|r| r.theta_c.is_some(), "disc temperature"),
    ];
    let bench: Vec<&str> = bench.into_iter().flatten().collect();
    let tolerances = campaign.vehicle_json["tolerance"].as_object().map_or(0, serde_json::Map::len);
    let left_out = campaign.left_out.len() + recordings.len() - used;
    let facts = [
        ("kisspoint", env!("CARGO_PKG_VERSION").to_owned()),
        ("recordings", format!("{used} used at {}, {left_out} left out", rates.join(" and "))),
        ("bench channels", if bench.is_empty() { "none".to_owned() } else { bench.join(", ") }),
        ("candidates", format!("{} effects, up to three at a time, with {tolerances} declared tolerances free", REGISTRY.len())),
        ("channel map", if options.channel_map.is_some() { "yes" } else { "none: the files have the standard channel names" }.to_owned()),
        (
            "recordings with defects",
            match (options.strict, left_out) {
                (true, _) => "refused (--strict)",
                (false, 0) => "none",
                (false, _) => "left out, and named above",
            }
            .to_owned(),
        ),
        ("data fingerprint (SHA-256)", campaign.fingerprint.clone()),
    ];
    facts.map(|(k, v)| (k.to_owned(), v)).to_vec()
}

fn files(
    diagnosis: &Diagnosis,
    name: &str,
    provenance: &[(String, String)],
    libraries: &[library::Library],
) -> Result<Vec<(&'static str, Vec<u8>)>, FmuError> {
    let campaign = &diagnosis.read;
    let traces = super::laws::traces(campaign, diagnosis);
    let report = report::html(&report::Input {
        name,
        diagnosis: &diagnosis.json,
        overlays: &diagnosis.overlays,
        drives: &diagnosis.drives,
        provenance,
        regions: &format!("cold is a disc below {HOT_DEGC} °C, low torque a clutch torque below {HIGH_TORQUE_NM} N·m"),
        traces: &traces,
        laws: &super::laws::laws(campaign, diagnosis, &traces),
        known: super::known::known(campaign, diagnosis).as_ref(),
        what_if: Some(&super::what_if::of(campaign, diagnosis, library::module())),
    });
    let plant = fmu::MODELS.iter().find(|m| m.description.name == "DrivelinePlant").expect("the plant is one of the models");
    let named = plant_parameters(&diagnosis.vehicle, &diagnosis.effects);
    let set: Vec<ssv::Parameter> = plant
        .description
        .variables
        .iter()
        .filter_map(|v| named.get(v.name).map(|&value| ssv::Parameter { name: v.name, value, unit: v.unit }))
        .collect();
    let mut files = vec![
        ("diagnosis.json", format!("{:#}\n", diagnosis.json).into_bytes()),
        ("report.html", report.into_bytes()),
        ("plant.ssv", ssv::write("retuned", &set).into_bytes()),
    ];
    // Libraries were looked up if and only if an FMU is wanted.
    if !libraries.is_empty() {
        let beside = Beside { validated: Some(&diagnosis.validated), ..Beside::default() };
        let extras = Extras { beside, ..Extras::default() };
        files.push(("DrivelinePlant.fmu", fmu::with_extras(plant, libraries, extras, &diagnosis.vehicle, &diagnosis.effects)?));
    }
    Ok(files)
}
