//! `kisspoint vehicle`: drafts a vehicle file, and explains what is implausible in one.

use super::error::CommandError;
use super::files::{VehicleFile, read_vehicle, write_new};
use super::output::{print, print_json};
use super::plausible::{self, Finding};
use crate::control::Settings;
use crate::vehicle::{NUMBERS, Number, Vehicle};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Options of `kisspoint vehicle`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    kisspoint vehicle new --out vehicle.json\n  \
    kisspoint vehicle check vehicle.json")]
pub struct Args {
    #[command(subcommand)]
    action: Action,
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
                    print(&format!("{0}: replace the numbers by your car's, then run `kisspoint vehicle check {0}`\n", path.display()))
                }
                None => print(&text),
            }
        }
        Action::Check { file, observer, json } => {
            let settings = Settings::robust();
            let gains = observer.as_ref().map_or((settings.l_1, settings.l_2), |g| (g[0], g[1]));
            check(file, gains, *json)
        }
    }
}

fn check(path: &Path, gains: (f64, f64), as_json: bool) -> Result<(), CommandError> {
    let name = path.display().to_string();
    let file = read_vehicle(path);
    if let (Err(CommandError::Vehicle { source, .. }), true) = (&file, as_json) {
        print_json(&json!({"file": name, "usable": false, "error": source.to_string(), "findings": []}))?;
    }
    let VehicleFile { document, vehicle, .. } = file?;
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
        writeln!(text, "  {:<52}{:>12.4} {}", fact.meaning, fact.value, fact.unit).expect("a String takes any text");
    }
    text.push_str(if findings.is_empty() { "\nNothing is implausible.\n" } else { "\nImplausible, though it can be used:\n" });
    for f in findings {
        writeln!(text, "  {}: {}\n    {}", f.number, f.what, f.remedy).expect("a String takes any text");
    }
    text
}

/// Name, `rel` or `abs`, size, why.
type Tolerance = (&'static str, &'static str, f64, &'static str);

/// Standard deviations that an engineer usually has.
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

/// The paper's vehicle with usual tolerances.
fn bare() -> Value {
    let mut document = Vehicle::paper().to_value();
    document["tolerance"] = TOLERANCES.iter().map(|(name, kind, size, _)| ((*name).to_owned(), json!({*kind: size}))).collect();
    document
}

/// The same with a comment on each number; keys that begin with `_` are comments.
fn draft() -> String {
    let document = bare();
    let mut text =
        String::from("{\n \"_\": \"Vehicle file of kisspoint: replace every number by your car's. Keys that begin with _ are comments.\"");
    for group in ["friction", "actuator", "cushion_spring", "thermal", "driveline"] {
        write!(text, ",\n \"{group}\": {{").expect("a String takes any text");
        let content = document[group].as_object().expect("a group of the vehicle is an object");
        for (k, key) in keys(group, content).into_iter().enumerate() {
            let numbers: Vec<&Number<Vehicle>> = NUMBERS.iter().filter(|n| belongs(n.name, group, &key)).collect();
            let comment: Vec<String> = numbers.iter().map(|n| format!("{} [{}], {} to {}", n.meaning, n.unit, n.min, n.max)).collect();
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

/// Whether the number of this flat name stands in the file under `group.key`, alone or in the array of that name.
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
    use crate::gap::model::tolerance::{self, Logger};

    #[test]
    fn the_draft_is_the_papers_vehicle_and_explains_every_number() {
        let document: Value = serde_json::from_str(&draft()).unwrap();
        assert_eq!(Vehicle::from_value(&document), Ok(Vehicle::paper()));
        let read = tolerance::read(&document, Logger::UNIFORM).unwrap();
        assert_eq!(read.shared.iter().filter(|n| n.declared).count(), TOLERANCES.len());
        for number in &NUMBERS {
            assert!(draft().contains(number.meaning), "{} is not explained", number.name);
        }
    }

    #[test]
    fn the_draft_is_plausible() {
        let settings = Settings::robust();
        let findings = plausible::findings(&bare(), &Vehicle::paper(), (settings.l_1, settings.l_2));
        assert!(findings.is_empty(), "{findings:?}");
    }
}
