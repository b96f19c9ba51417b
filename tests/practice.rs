//! Campaigns with answers that lie beside the checkout, if they are there: every one is replayed, diagnosed and scored.
//!
//! They are looked for in `../shared/practice`, or where `KISSPOINT_PRACTICE` says. `cargo test --profile quick --test practice --
//! --nocapture` prints the score.
#![cfg(feature = "cli")]

use kisspoint::campaign::{self, ReadOptions};
use kisspoint::effects::{self, REGISTRY};
use kisspoint::gap::diagnosis::diagnose;
use kisspoint::gap::measure::evaluate;
use kisspoint::vehicle::Vehicle;
use std::path::PathBuf;

#[test]
fn practice_campaigns_are_replayed_and_diagnosed() {
    let folder = std::env::var_os("KISSPOINT_PRACTICE").map_or_else(|| PathBuf::from("../shared/practice"), PathBuf::from);
    let Ok(answers) = std::fs::read_to_string(folder.join("answers.json")) else {
        println!("no practice campaigns in {}: nothing was tested here", folder.display());
        return;
    };
    let answers: serde_json::Value = serde_json::from_str(&answers).expect("answers.json is JSON");
    let (mut healthy, mut flagged, mut known, mut named, mut extra, mut others, mut unknown) = (0, 0, 0, 0, 0, 0, 0);
    for (case, truth) in answers.as_object().expect("answers.json maps cases to effects") {
        let campaign = campaign::read(&folder.join(case), &ReadOptions::default()).expect("a practice campaign can be read");
        let vehicle = Vehicle::from_value(&campaign.vehicle_json).expect("a practice vehicle is sound");
        let nominal = effects::null();
        for recording in &campaign.recordings {
            let gaps = evaluate(recording, (&vehicle, &nominal), (&vehicle, &nominal));
            assert!(gaps.iter().all(|g| g.before.is_finite()), "{case} {}", recording.name);
        }
        let json = diagnose(&campaign, &|_, _| {}).expect("a practice campaign can be diagnosed").json;
        let truth: Vec<&str> = truth.as_array().into_iter().flatten().filter_map(serde_json::Value::as_str).collect();
        let verdict = json["verdict"].as_str().unwrap_or_default();
        let got: Vec<&str> = json["which"]["effects"].as_array().into_iter().flatten().filter_map(|e| e["id"].as_str()).collect();
        println!("{case} {truth:?}: {verdict} {got:?}");
        if truth.is_empty() {
            healthy += 1;
            flagged += usize::from(verdict != "no_gap");
        } else if truth.iter().all(|id| REGISTRY.iter().any(|e| e.id == *id)) {
            known += truth.len();
            named += truth.iter().filter(|id| got.contains(id)).count();
            extra += got.iter().filter(|id| !truth.contains(id)).count();
        } else {
            others += 1;
            unknown += usize::from(verdict == "unexplained" || verdict == "partly_explained");
        }
    }
    println!(
        "healthy flagged {flagged}/{healthy}, effects named {named}/{known}, extra {extra}, outside the library flagged {unknown}/{others}"
    );
    assert_eq!(flagged, 0, "a healthy car was flagged");
    assert!(named * 100 >= 95 * known, "{named} of {known} effects were named");
    assert!(extra * 20 <= answers.as_object().map_or(0, serde_json::Map::len), "{extra} effects too many");
    assert_eq!(unknown, others, "an effect outside the library was taken for a known one");
}
