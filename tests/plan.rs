//! `kisspoint plan` as a command: its output, its refusals, and its list of manoeuvres, which can be edited.

use serde_json::Value;
use std::process::{Command, Output};

fn plan(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_kisspoint")).arg("plan").args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

const VEHICLE: &str = "tests/data/campaigns/example/vehicle.json";

#[test]
fn every_effect_has_its_limit_before_anything_is_measured() {
    let output = plan(&["--vehicle", VEHICLE, "--drive", "launch,open_rev", "--json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let effects = found["effects"].as_array().unwrap();
    assert_eq!((effects.len(), found["manoeuvres"].as_array().unwrap().len()), (24, 2));
    for e in effects {
        let (usual, limit) = (e["usual"].as_f64().unwrap(), e["limit"].as_f64());
        assert!(usual > 0.0 && limit.is_none_or(|l| l > 0.0), "{e}");
        let sure = e["found_if_usual"].as_f64().unwrap();
        assert_eq!(sure >= 0.95, limit.is_some_and(|l| l <= usual * 1.000_01), "{e}");
    }
}

#[test]
fn the_list_is_a_file_of_manoeuvres() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bench.toml");
    let listed = text(&plan(&["--list", "--drive", "open_rev,tip_in"]).stdout);
    std::fs::write(&path, listed.replace("tip_in\"\nkind", "pedal\"\nkind")).unwrap();
    let path = path.to_str().unwrap();
    let output = plan(&["--vehicle", VEHICLE, "--manoeuvres", path, "--out", folder.path().to_str().unwrap()]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("pedal"), "{}", text(&output.stdout));
    let picture = std::fs::read_to_string(folder.path().join("plan.svg")).unwrap();
    assert!(roxmltree::Document::parse(&picture).is_ok() && picture.contains("Judder"));
    // A manoeuvre that cannot be driven.
    std::fs::write(folder.path().join("wrong.toml"), listed.replacen("seconds = 4.0", "seconds = 0.0", 1)).unwrap();
    let output = plan(&["--vehicle", VEHICLE, "--manoeuvres", folder.path().join("wrong.toml").to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("open_rev") && text(&output.stderr).contains("seconds = 0"), "{}", text(&output.stderr));
}

#[test]
fn what_is_wrong_is_named_with_what_to_do() {
    for (arguments, code, said) in [
        (&[][..], 2, "CAMPAIGN"),
        (&["--vehicle", VEHICLE, "--drive", "wheelie"][..], 1, "launch_hot"),
        (&["--vehicle", VEHICLE, "--rate", "19"][..], 2, "within 20 and 10000 Hz"),
        (&["--vehicle", "nowhere.json"][..], 1, "nowhere.json"),
        (&["campaign", "--vehicle", VEHICLE][..], 2, "cannot be used with"),
        (&["--vehicle", VEHICLE, "--manoeuvres", "Cargo.toml"][..], 1, "--list"),
    ] {
        let output = plan(arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}");
        assert!(text(&output.stderr).contains(said), "{arguments:?}: {}", text(&output.stderr));
    }
}
