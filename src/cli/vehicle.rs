//! `kisspoint vehicle`: drafts a vehicle file, explains what is implausible in one, and applies corrections learned from a fleet.

use super::error::{CommandError, at};
use super::files::{VehicleFile, read_vehicle, write_new};
use super::output::{print, print_json};
use super::plausible::{self, Finding};
use crate::control::Settings;
use crate::gap::answer::Real;
use crate::gap::model::tolerance::{self, Car, Logger};
use crate::report::text::meaning;
use crate::vehicle::{NUMBERS, Number, Vehicle, written};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Options of `kisspoint vehicle`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    kisspoint vehicle new --out vehicle.json\n  \
    kisspoint vehicle check vehicle.json\n  \
    kisspoint vehicle correct vehicle.json --by corrections.json \\\n      --out corrected.json")]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

impl Args {
    /// Words of the command line, for messages.
    pub fn name(&self) -> &'static str {
        match self.action {
            Action::New { .. } => "vehicle new",
            Action::Check { .. } => "vehicle check",
            Action::Correct { .. } => "vehicle correct",
        }
    }
}

#[derive(clap::Subcommand, Debug)]
enum Action {
    /// Draft a vehicle file with the paper's numbers, each with its unit, meaning and bounds
    #[command(after_help = "Examples:\n  \
        kisspoint vehicle new --out vehicle.json\n  \
        kisspoint vehicle new --json > bare.json")]
    New {
        /// File to write; without it the draft is printed
        #[arg(long, value_name = "FILE")]
        out: Option<PathBuf>,
        /// Overwrite the file if it exists
        #[arg(long, requires = "out")]
        force: bool,
        /// Leave out the comments: numbers and tolerances alone
        #[arg(long)]
        json: bool,
    },
    /// Explain what is wrong or implausible in a vehicle file; warnings leave the exit code at 0
    #[command(after_help = "Examples:\n  \
        kisspoint vehicle check vehicle.json\n  \
        kisspoint vehicle check vehicle.json --observer -300 4252\n  \
        kisspoint vehicle check vehicle.json --json")]
    Check {
        /// The vehicle file
        file: PathBuf,
        /// Gains of the torque observer (9) to check with this vehicle, instead of the controller's own
        #[arg(long, num_args = 2, value_names = ["L_1", "L_2"], allow_negative_numbers = true)]
        observer: Option<Vec<f64>>,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Move numbers by standard deviations of their tolerance, and scale the tolerances: what a fleet of such cars has taught
    #[command(
        after_help = "FILE of --by is JSON: {\"actuator.x_cnt\": {\"sigmas\": 1.4, \"tolerance_factor\": 0.6}, …}, names as in `tolerance`; \
        `kisspoint fleet` writes such a file.\n\nExamples:\n  \
        kisspoint vehicle correct vehicle.json --by corrections.json \\\n      --out corrected.json\n  \
        kisspoint vehicle correct vehicle.json --by corrections.json --json"
    )]
    Correct {
        /// The vehicle file; it stays as it is
        file: PathBuf,
        /// Corrections by name: `sigmas`, `tolerance_factor`, or both
        #[arg(long, value_name = "FILE")]
        by: PathBuf,
        /// File to write; without it the corrected file is printed
        #[arg(long, value_name = "FILE")]
        out: Option<PathBuf>,
        /// Overwrite the file if it exists
        #[arg(long, requires = "out")]
        force: bool,
        /// Print what was changed as JSON: `vehicle`, and `not_in_file`, corrections of numbers that no vehicle file holds
        #[arg(long, conflicts_with = "out")]
        json: bool,
    },
}

/// Runs the subcommand.
///
/// # Errors
/// A file that cannot be read or written; a vehicle that cannot be used.
pub fn run(args: &Args) -> Result<(), CommandError> {
    match &args.action {
        Action::New { out, force, json } => {
            let text = if *json { format!("{:#}\n", bare()) } else { draft() };
            match out {
                Some(path) => {
                    write_new(path, &text, *force)?;
                    print(&format!("{0}: replace the numbers with your car's, then run `kisspoint vehicle check {0}`\n", path.display()))
                }
                None => print(&text),
            }
        }
        Action::Check { file, observer, json } => {
            let settings = Settings::robust();
            let gains = observer.as_ref().map_or((settings.l_1, settings.l_2), |g| (g[0], g[1]));
            check(file, gains, *json)
        }
        Action::Correct { file, by, out, force, json } => {
            let (document, not_in_file) = correct(file, by)?;
            if *json {
                return print_json(&json!({"vehicle": document, "not_in_file": not_in_file}));
            }
            for (name, sigmas) in &not_in_file {
                let what = "which no vehicle file holds: correct it where the torque report is mapped (scale, offset of the channel map)";
                eprintln!("{name}: off by {sigmas} standard deviations, {what}");
            }
            let text = format!("{document:#}\n");
            match out {
                Some(path) => write_new(path, &text, *force),
                None => print(&text),
            }
        }
    }
}

/// The corrected document, and the corrections (in standard deviations) of quantities that it holds no number for.
fn correct(path: &Path, by: &Path) -> Result<(Value, BTreeMap<String, f64>), CommandError> {
    let VehicleFile { mut document, vehicle, .. } = read_vehicle(path)?;
    let refused = |what: String| CommandError::Refused(format!("{}: {what}", by.display()));
    let text = std::fs::read_to_string(by).map_err(at(by))?;
    let corrections: BTreeMap<String, Correction> = serde_json::from_str(&text)
        .map_err(|e| refused(format!("{e}; expected are names of tolerances, each with \"sigmas\", \"tolerance_factor\" or both")))?;
    let known = tolerance::read(&document, Logger::UNIFORM).map_err(|e| refused(e.to_string()))?;
    let mut not_in_file = BTreeMap::new();
    let mut car = Car::nominal(&vehicle);
    for (name, Correction { sigmas, tolerance_factor }) in &corrections {
        let one = known.shared.iter().find(|n| n.declared && n.name == *name);
        let one =
            one.ok_or_else(|| refused(format!("\"{name}\" is not a tolerance in {}; remove it or declare it there", path.display())))?;
        if !(sigmas.is_finite() && *tolerance_factor > 0.0 && tolerance_factor.is_finite()) {
            return Err(refused(format!(
                "\"{name}\" has sigmas {sigmas} and tolerance_factor {tolerance_factor}; both are finite, the latter positive"
            )));
        }
        let before = car.vehicle;
        car.apply(std::slice::from_ref(one), &[*sigmas]);
        if car.vehicle == before && *sigmas != 0.0 {
            not_in_file.insert(name.clone(), *sigmas);
        }
        for size in document["tolerance"][name.as_str()].as_object_mut().into_iter().flat_map(|o| o.iter_mut()) {
            if let (true, Some(value)) = (matches!(size.0.as_str(), "abs" | "rel"), size.1.as_f64()) {
                *size.1 = json!(Real(value * tolerance_factor));
            }
        }
    }
    car.vehicle.check().map_err(|source| CommandError::Vehicle { path: path.to_owned(), source })?;
    // Only numbers that moved are written; all others stay as their author wrote them.
    let (old, new) = (vehicle.to_value(), car.vehicle.to_value());
    for (group, content) in new.as_object().into_iter().flatten() {
        for (key, value) in content.as_object().into_iter().flatten().filter(|(key, value)| old[group][key.as_str()] != **value) {
            let rounded = |v: &Value| json!(Real(v.as_f64().unwrap_or(f64::NAN)));
            document[group][key.as_str()] = value.as_array().map_or_else(|| rounded(value), |list| list.iter().map(rounded).collect());
        }
    }
    Ok((document, not_in_file))
}

/// Correction of a number.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Correction {
    /// Shift of the number, in standard deviations of its tolerance.
    #[serde(default)]
    sigmas: f64,
    /// Factor on the tolerance.
    #[serde(default = "one")]
    tolerance_factor: f64,
}

fn one() -> f64 {
    1.0
}

fn check(path: &Path, gains: (f64, f64), as_json: bool) -> Result<(), CommandError> {
    let name = path.display().to_string();
    let file = read_vehicle(path);
    if let (Err(CommandError::Vehicle { source, .. }), true) = (&file, as_json) {
        print_json(&json!({"file": name, "usable": false, "error": source.to_string(), "findings": []}))?;
    }
    let VehicleFile { document, vehicle, .. } = file?;
    // A tolerance that a diagnosis would refuse makes the file unusable, not just implausible.
    let tolerances = tolerance::read(&document, Logger::UNIFORM);
    if let (Err(e), true) = (&tolerances, as_json) {
        print_json(&json!({"file": name, "usable": false, "error": e.to_string(), "findings": []}))?;
    }
    tolerances.map_err(|e| CommandError::Refused(format!("{name}: {e}")))?;
    let findings = plausible::findings(&document, &vehicle, gains);
    let facts = plausible::facts(&vehicle, gains);
    if !as_json {
        return print(&as_text(path, &findings, &facts));
    }
    let facts: serde_json::Map<String, Value> =
        facts.iter().map(|f| (f.name.to_owned(), json!({"value": f.value, "unit": f.unit}))).collect();
    let findings: Vec<Value> = findings.iter().map(Finding::to_json).collect();
    print_json(&json!({"file": name, "usable": true, "findings": findings, "derived": facts}))
}

fn as_text(file: &Path, findings: &[Finding], facts: &[plausible::Fact]) -> String {
    let mut text = format!("{}: usable\n\nWhat follows from the numbers:\n", file.display());
    for fact in facts {
        writeln!(text, "  {:<52}{:>12.4} {}", fact.meaning, fact.value, written(fact.unit)).expect("a String takes any text");
    }
    text.push_str(if findings.is_empty() { "\nNothing is implausible.\n" } else { "\nImplausible, though it can be used:\n" });
    for f in findings {
        writeln!(text, "  {}: {}\n    {}", f.number, f.what, f.remedy).expect("a String takes any text");
    }
    text
}

/// Name, kind (`rel` or `abs`), standard deviation, reason.
type Tolerance = (&'static str, &'static str, f64, &'static str);

/// Standard deviations that are usual for an engineer's knowledge of each number.
const TOLERANCES: [Tolerance; 12] = [
    ("driveline.J_f", "rel", 0.01, "from CAD data and a run-down test"),
    ("driveline.J_c", "rel", 0.02, "vehicle mass with an unknown load"),
    ("driveline.b_f", "rel", 0.1, "from run-down tests"),
    ("driveline.b_c", "rel", 0.1, "from run-down tests"),
    ("driveline.T_L0", "rel", 0.1, "tyres and oil, warm or cold"),
    ("actuator.x_cnt", "abs", 0.015, "mm; repeatability of a kiss-point adaptation"),
    ("cushion_spring.beta", "rel", 0.01, "one factor on the whole force curve"),
    ("friction.mu", "rel", 0.015, "one factor on the whole friction function"),
    ("thermal.C_1", "rel", 0.05, "mass and specific heat of the disc"),
    ("thermal.gamma_1", "rel", 0.05, "from a cooling test"),
    ("engine.T_e_bias", "abs", 0.2, "N·m; torque that the engine's report leaves out"),
    ("engine.T_e_gain", "rel", 0.005, "factor on the reported torque"),
];

/// The paper's vehicle with the usual tolerances.
fn bare() -> Value {
    let mut document = Vehicle::paper().to_value();
    document["tolerance"] = TOLERANCES.iter().map(|(name, kind, size, _)| ((*name).to_owned(), json!({*kind: size}))).collect();
    document
}

/// The same document with a comment on each number; keys that begin with `_` are comments.
fn draft() -> String {
    let document = bare();
    let mut text = String::from(
        "{\n \"_\": \"Vehicle file of kisspoint: replace every number with your car's. Keys that begin with _ are comments.\"",
    );
    for group in ["friction", "actuator", "cushion_spring", "thermal", "driveline"] {
        write!(text, ",\n \"{group}\": {{").expect("a String takes any text");
        let content = document[group].as_object().expect("a group of the vehicle is an object");
        for (k, key) in keys(group, content).into_iter().enumerate() {
            let numbers: Vec<&Number<Vehicle>> = NUMBERS.iter().filter(|n| belongs(n.name, group, &key)).collect();
            let comment: Vec<String> = numbers
                .iter()
                .map(|n| {
                    format!(
                        "{} [{}], {} to {}",
                        meaning(n.meaning),
                        if n.unit == "1" { "1".to_owned() } else { written(n.unit) },
                        n.min,
                        n.max
                    )
                })
                .collect();
            let comma = if k == 0 { "" } else { "," };
            write!(text, "{comma}\n  \"_{key}\": {},\n  \"{key}\": {}", json!(comment.join("; ")), content[&key])
                .expect("a String takes any text");
        }
        text.push_str("\n }");
    }
    text.push_str(",\n \"_tolerance\": \"One standard deviation of what you know of a number, rel(ative) or abs(olute); a diagnosis forgives that much.\"");
    let entries = |one: fn(&Tolerance) -> String| TOLERANCES.iter().map(one).collect::<Vec<_>>().join(",\n  ");
    let sizes = entries(|(name, kind, size, _)| format!("\"{name}\": {{\"{kind}\": {size}}}"));
    let reasons = entries(|(name, _, _, why)| format!("\"{name}\": {}", json!(why)));
    text + ",\n \"tolerance\": {\n  " + &sizes + "\n },\n \"_tolerances\": {\n  " + &reasons + "\n }\n}\n"
}

/// The keys of a group in the order of the model description.
fn keys(group: &str, content: &serde_json::Map<String, Value>) -> Vec<String> {
    let mut keys: Vec<String> = content.keys().cloned().collect();
    keys.sort_by_key(|key| NUMBERS.iter().position(|n| belongs(n.name, group, key)));
    keys
}

/// Whether the number with this flat name is stored in the file under `group.key`, alone or as an element of that array.
fn belongs(flat: &str, group: &str, key: &str) -> bool {
    let Some(name) = flat.strip_prefix(group).and_then(|rest| rest.strip_prefix('.')) else { return false };
    let stem = if group == "friction" && key == "mu_d" { "m" } else { key };
    name == key
        || name
            .strip_prefix(stem)
            .and_then(|rest| rest.strip_prefix('_'))
            .is_some_and(|n| matches!(n, "0" | "1" | "2" | "3") && key != "mu")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_draft_is_the_papers_vehicle_and_explains_every_number() {
        let document: Value = serde_json::from_str(&draft()).unwrap();
        assert_eq!(Vehicle::from_value(&document), Ok(Vehicle::paper()));
        let read = tolerance::read(&document, Logger::UNIFORM).unwrap();
        assert_eq!(read.shared.iter().filter(|n| n.declared).count(), TOLERANCES.len());
        for number in &NUMBERS {
            assert!(draft().contains(&meaning(number.meaning)), "{} is not explained", number.name);
        }
    }

    #[test]
    fn a_correction_moves_what_the_diagnosis_moves_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let (file, by) = (folder.path().join("vehicle.json"), folder.path().join("by.json"));
        std::fs::write(&file, draft()).unwrap();
        std::fs::write(&by, r#"{"driveline.J_f": {"sigmas": -2}, "actuator.x_cnt": {"sigmas": 3, "tolerance_factor": 0.5}, "engine.T_e_bias": {"sigmas": 1}}"#).unwrap();
        let (document, not_in_file) = correct(&file, &by).unwrap();
        let (was, is) = (Vehicle::paper(), Vehicle::from_value(&document).unwrap());
        assert!((is.driveline.J_f / (was.driveline.J_f * (-0.02f64).exp()) - 1.0).abs() < 1e-5);
        assert!((is.actuator.x_cnt_0 - was.actuator.x_cnt_0 - 0.045).abs() < 1e-5);
        assert_eq!(document["tolerance"]["actuator.x_cnt"]["abs"], 0.0075);
        assert_eq!(document["tolerance"]["driveline.J_f"], bare()["tolerance"]["driveline.J_f"]);
        assert_eq!((not_in_file.len(), not_in_file["engine.T_e_bias"]), (1, 1.0));
        assert_eq!((is.thermal, is.friction), (was.thermal, was.friction));
        assert!(document.to_string().contains("Keys that begin with _ are comments"));
        std::fs::write(&by, r#"{"driveline.J_x": {"sigmas": 1}}"#).unwrap();
        assert!(correct(&file, &by).unwrap_err().to_string().contains("\"driveline.J_x\" is not a tolerance"));
    }

    #[test]
    fn the_draft_is_plausible() {
        let settings = Settings::robust();
        let findings = plausible::findings(&bare(), &Vehicle::paper(), (settings.l_1, settings.l_2));
        assert!(findings.is_empty(), "{findings:?}");
    }
}
