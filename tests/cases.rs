//! Campaigns of the repository with their expected answers: each folder of `tests/data/cases`.
#![cfg(feature = "cli")]

use kisspoint::campaign::{self, ReadOptions};
use kisspoint::effects;
use kisspoint::gap::diagnosis::diagnose;
use serde_json::Value;
use std::path::{Path, PathBuf};

fn cases() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/cases");
    let entries = std::fs::read_dir(&folder).unwrap().map(|e| e.unwrap().path());
    let mut all: Vec<PathBuf> = entries.filter(|p| p.join("expected.json").is_file()).collect();
    all.sort();
    all
}

fn texts(value: &Value) -> Vec<&str> {
    value.as_array().unwrap().iter().map(|v| v.as_str().unwrap()).collect()
}

/// What is wrong with the answer to a case, in words; nothing if it is right.
fn wrong(case: &Path) -> Option<String> {
    let expected: Value = serde_json::from_slice(&std::fs::read(case.join("expected.json")).unwrap()).unwrap();
    let campaign = campaign::read(&case.join("campaign"), &ReadOptions::default()).unwrap();
    let json = diagnose(&campaign, &|_, _| {}).unwrap().json;
    let (carried, places) = (texts(&expected["effects"]), texts(&expected["where"]));
    let verdict = json["verdict"].as_str().unwrap();
    let mut named: Vec<&str> = json["which"]["effects"].as_array().unwrap().iter().map(|e| e["id"].as_str().unwrap()).collect();
    named.sort_unstable();
    let mut known: Vec<&str> = carried.iter().copied().filter(|id| effects::find(id).is_some()).collect();
    known.sort_unstable();
    let right_verdict = match (carried.len(), known.len()) {
        (0, _) => verdict == "no_gap",
        (all, library) if all == library => verdict == "explained",
        _ => matches!(verdict, "unexplained" | "partly_explained"),
    };
    let at = json["where"]["primary"].as_str();
    let right_place = at.map_or(places.is_empty(), |at| places.contains(&at));
    let right = right_verdict && right_place && (named == known || carried.len() > known.len());
    (!right).then(|| format!("{}: {verdict} {named:?} at {at:?} where the car carries {carried:?}", case.display()))
}

#[test]
fn every_case_gets_its_expected_answer() {
    let all = cases();
    assert!(all.len() >= 6, "{} cases", all.len());
    let wrong: Vec<String> = all.iter().filter_map(|c| wrong(c)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
