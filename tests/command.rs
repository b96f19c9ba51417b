//! The command as scripts use it: exit codes, one JSON document each, pipes that close early, error messages with a remedy.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

const EXAMPLE: &str = "tests/data/campaigns/example";

fn kisspoint(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_kisspoint"));
    command.args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).stdin(Stdio::null());
    command
}

fn run(arguments: &[&str]) -> Output {
    kisspoint(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// Standard output of a command that succeeds.
fn printed(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

fn document(arguments: &[&str]) -> Value {
    serde_json::from_str(&printed(arguments)).unwrap_or_else(|e| panic!("{arguments:?}: {e}"))
}

/// A folder that is removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Folder {
        let path = std::env::temp_dir().join(format!("kisspoint-command-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    fn path(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }

    /// The bundled campaign with a changed vehicle file.
    fn campaign(&self, change: impl Fn(&mut Value)) -> String {
        for item in std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join(EXAMPLE)).unwrap() {
            let path = item.unwrap().path();
            std::fs::copy(&path, self.0.join(path.file_name().unwrap())).unwrap();
        }
        let mut vehicle: Value = serde_json::from_str(&std::fs::read_to_string(self.0.join("vehicle.json")).unwrap()).unwrap();
        change(&mut vehicle);
        std::fs::write(self.0.join("vehicle.json"), vehicle.to_string()).unwrap();
        self.0.display().to_string()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[test]
fn a_reader_that_leaves_early_is_no_error() {
    for arguments in [
        &["launch", "--json"][..],
        &["launch"],
        &["replay", EXAMPLE],
        &["inspect", "tests/data/campaign/measurements/plain.mf4"],
        &["vehicle", "new"],
        &["vehicle", "check", "tests/data/campaigns/example/vehicle.json"],
        &["completions", "zsh"],
    ] {
        let mut child = kisspoint(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert_eq!((output.status.code(), text(&output.stderr).as_str()), (Some(0), ""), "{arguments:?}");
    }
}

#[test]
fn every_json_is_one_document_with_what_the_documentation_promises() {
    assert_eq!(document(&["launch", "--json"])["table_ii"].as_array().unwrap().len(), 3);
    let gaps = document(&["replay", EXAMPLE, "--json"]);
    assert!(gaps["gaps"][0]["rms"].is_number() && gaps["left_out"].is_array() && gaps["notes"].is_array());
    assert!(document(&["inspect", "tests/data/campaign/measurements/rates.mf4", "--json"])["channels"][0]["name"].is_string());
    let checked = document(&["vehicle", "check", "tests/data/campaigns/example/vehicle.json", "--json"]);
    assert_eq!(checked["usable"], true);
    assert!(document(&["vehicle", "new", "--json"])["driveline"]["J_f"].is_number());
}

/// One command drafts the list of recordings that a folder with recordings and a vehicle file lacks. The draft can be replayed as it is, and does not overwrite an existing
/// file without --force.
#[test]
fn a_drafted_list_of_recordings_makes_a_campaign() {
    let folder = Folder::new("drafted");
    let path = folder.campaign(|_| {});
    let [first, list] = ["r01.csv", "recordings.json"].map(|name| folder.path(name));
    let refused = run(&["inspect", &first, "--draft-recordings", &list]);
    assert!(refused.status.code() == Some(1) && text(&refused.stderr).contains("--force"), "{}", text(&refused.stderr));
    std::fs::write(folder.0.join(".r00.csv"), "hidden").unwrap();
    let said = printed(&["inspect", &first, "--draft-recordings", &list, "--force"]);
    assert!(said.contains("omega_f_rad_s") && said.contains("name each manoeuvre"), "{said}");
    let drafted: Value = serde_json::from_str(&std::fs::read_to_string(&list).unwrap()).unwrap();
    assert_eq!(
        drafted.as_object().unwrap().keys().collect::<Vec<_>>(),
        (1..=9).map(|k| format!("r0{k}")).collect::<Vec<_>>().iter().collect::<Vec<_>>()
    );
    assert_eq!(document(&["inspect", &first, "--draft-recordings", "-"]), drafted);
    assert!(printed(&["replay", &path]).contains("r09"));
}

/// A tolerance that a diagnosis would refuse is an error, not a warning.
#[test]
fn a_tolerance_that_no_diagnosis_takes_fails_the_check() {
    let folder = Folder::new("tolerance");
    folder.campaign(|vehicle| vehicle["tolerance"]["driveline.J_x"] = serde_json::json!({"rel": 0.01}));
    let file = folder.path("vehicle.json");
    let refused = run(&["vehicle", "check", &file]);
    assert!(refused.status.code() == Some(1) && text(&refused.stderr).contains("driveline.J_x"), "{}", text(&refused.stderr));
    let refused = run(&["vehicle", "check", &file, "--json"]);
    let document: Value = serde_json::from_str(&text(&refused.stdout)).unwrap();
    assert!(
        refused.status.code() == Some(1) && document["usable"] == false && document["error"].as_str().unwrap().contains("driveline.J_x")
    );
}

#[test]
fn of_several_campaigns_each_has_a_line_and_a_bad_one_stops_nothing() {
    let bad = Folder::new("several");
    let path = bad.campaign(|vehicle| vehicle["driveline"]["J_x"] = 1.into());
    let output = run(&["diagnose", &path, EXAMPLE, "--json"]);
    assert_eq!(output.status.code(), Some(1));
    let lines: Vec<Value> = text(&output.stdout).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len(), 2);
    assert_eq!(lines[0]["campaign"], path);
    assert!(lines[0]["error"].as_str().unwrap().contains("driveline.J_x"), "{}", lines[0]);
    assert_eq!(lines[1]["diagnosis"]["verdict"], "explained");
    let said = text(&output.stderr);
    assert!(said.contains("did you mean \"driveline.J_f\"") && said.contains("1 of 2 campaigns"), "{said}");
}

#[test]
fn a_file_is_no_folder_and_a_folder_for_the_answer_is_tried_before_the_work() {
    let said = text(&run(&["diagnose", "Cargo.toml", "--json"]).stderr);
    assert!(said.contains("this is a file") && !said.contains("no such folder"), "{said}");
    let begun = std::time::Instant::now();
    let said = text(&run(&["diagnose", EXAMPLE, "--out", "Cargo.toml/answer"]).stderr);
    assert!(said.contains("Cargo.toml") && !said.contains("r01"), "{said}");
    assert!(begun.elapsed().as_secs_f64() < 2.0, "nothing was diagnosed before that");
}

#[test]
fn one_campaign_gives_the_same_line_as_many() {
    let output = run(&["diagnose", "no-such-folder", "--json"]);
    let line: Value = serde_json::from_str(&text(&output.stdout)).unwrap();
    assert_eq!(line["campaign"], "no-such-folder");
    assert!(line["error"].as_str().unwrap().contains("no such folder"));
}

#[test]
fn exit_codes_are_those_of_the_help() {
    for (arguments, code) in [
        (&["--help"][..], 0),
        (&["--version"], 0),
        (&["inspect", "no-such-file.csv"], 1),
        (&["vehicle", "check", "Cargo.toml"], 1),
        (&["diagnose", "no-such-folder", "--json"], 1),
        (&["launch", "--vehicle", "no-such-file.json"], 1),
        (&["diagnose", EXAMPLE], 2),
        (&["diagnose", EXAMPLE, "--out", "Cargo.toml/answer"], 1),
        (&["diagnose", "Cargo.toml", "--json"], 1),
        (&["lunch"], 2),
        (&[], 2),
    ] {
        let output = run(arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {}", text(&output.stderr));
        let said = text(&output.stderr);
        let named = arguments.iter().any(|a| !a.is_empty() && said.contains(a));
        assert!(code != 1 || (said.starts_with("kisspoint: ") && named), "{arguments:?}: {said}");
    }
}

#[test]
fn no_colours_where_there_is_no_terminal() {
    for arguments in [&["--help"][..], &["lunch"], &["launch", "--help"]] {
        let output = run(arguments);
        assert!(!output.stdout.contains(&0x1b) && !output.stderr.contains(&0x1b), "{arguments:?}");
    }
}

type Change = dyn Fn(&mut Value);

#[test]
fn what_is_wrong_with_a_vehicle_is_named_with_its_file() {
    let folder = Folder::new("vehicle");
    let cases: [(&Change, &[&str]); 4] = [
        (&|v| v["driveline"]["J_x"] = 1.into(), &["vehicle.json", "unknown vehicle number \"driveline.J_x\"", "did you mean"]),
        (&|v| v["thermal"]["gamma_3"] = 50.into(), &["vehicle.json", "thermal.gamma_3", "outside 0 to 1", "check its unit"]),
        (&|v| v["tolerance"]["driveline.J_x"] = serde_json::json!({"rel": 0.1}), &["vehicle.json", "driveline.J_x", "remove it"]),
        (&|v| drop(v["driveline"].as_object_mut().unwrap().remove("J_f")), &["vehicle.json", "driveline.J_f", "is missing; add it"]),
    ];
    for (change, expected) in cases {
        let output = run(&["diagnose", &folder.campaign(change), "--json"]);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1));
        assert!(expected.iter().all(|part| said.contains(part)), "{said}");
    }
}

#[test]
fn one_usable_recording_is_too_few_and_the_others_are_accounted_for() {
    let folder = Folder::new("few");
    let campaign = folder.campaign(|_| {});
    for k in 2..=9 {
        std::fs::write(folder.0.join(format!("r{k:02}.csv")), "time_s\n").unwrap();
    }
    let said = text(&run(&["diagnose", &campaign, "--json"]).stderr);
    assert!(said.contains("at least 2 are needed") && said.contains("\n  r02.csv: there is a header but no row of data"), "{said}");
}

#[test]
fn nothing_is_overwritten_without_force_and_nothing_half_written_remains() {
    let folder = Folder::new("files");
    let path = folder.path("vehicle.json");
    printed(&["vehicle", "new", "--out", &path]);
    let again = run(&["vehicle", "new", "--out", &path]);
    assert_eq!(again.status.code(), Some(1));
    assert!(text(&again.stderr).contains("--force"));
    printed(&["vehicle", "new", "--out", &path, "--force"]);
    printed(&["launch", "--plots", &folder.path("figures")]);
    let written: Vec<PathBuf> = std::fs::read_dir(folder.path("figures")).unwrap().map(|item| item.unwrap().path()).collect();
    assert_eq!(written.len(), 8);
    assert!(written.iter().all(|path| path.extension().is_some_and(|e| e == "svg")), "{written:?}");
}
