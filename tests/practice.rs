//! Practice campaigns with known answers beside the checkout, if there are any: every third of them is replayed, diagnosed and scored.
//!
//! They are looked for in `../shared/practice`, or in the folder that `KISSPOINT_PRACTICE` names. `KISSPOINT_PRACTICE_ALL=1 cargo test --profile quick --test practice --
//! --nocapture` takes all of them, and prints the score.
#![cfg(feature = "cli")]

mod logger;

use kisspoint::campaign::{self, ReadOptions};
use kisspoint::effects::{self, REGISTRY};
use kisspoint::gap::diagnosis::diagnose;
use kisspoint::gap::measure::evaluate;
use kisspoint::vehicle::Vehicle;
use logger::{LOGGERS, Logger};
use rayon::prelude::*;
use realcar::catalogue::find;
use std::path::PathBuf;

#[test]
fn practice_campaigns_are_replayed_and_diagnosed() {
    judge(None);
}

/// Speeds at 40 Hz in rows at 100 Hz. Takes as long.
#[test]
#[ignore = "a second round of diagnoses: run by name when the reading of rasters changes"]
fn practice_campaigns_are_diagnosed_where_a_logger_repeats_speeds_unevenly() {
    judge(Some(&LOGGERS[0]));
}

/// Half of the samples of all channels. Takes as long.
#[test]
#[ignore = "a second round of diagnoses: run by name when the model of the data changes"]
fn practice_campaigns_are_diagnosed_at_half_their_rate() {
    judge(LOGGERS.iter().find(|l| l.name == "all channels every second row"));
}

/// Scores the campaigns as they are, or as this logger would have written them.
fn judge(logger: Option<&Logger>) {
    let folder = std::env::var_os("KISSPOINT_PRACTICE").map_or_else(|| PathBuf::from("../shared/practice"), PathBuf::from);
    let Ok(answers) = std::fs::read_to_string(folder.join("answers.json")) else {
        println!("no practice campaigns in {}: nothing was tested here", folder.display());
        return;
    };
    let answers: serde_json::Value = serde_json::from_str(&answers).expect("answers.json is JSON");
    let mut score = Score::default();
    let mut answers: Vec<_> = answers.as_object().expect("answers.json maps cases to effects").iter().collect();
    // Healthy cars come first, so that at least one of them is selected.
    answers.sort_by_key(|(_, truth)| truth.as_array().map_or(0, Vec::len));
    let step = if std::env::var_os("KISSPOINT_PRACTICE_ALL").is_some() { 1 } else { 3 };
    let chosen: Vec<_> = answers.into_iter().step_by(step).collect();
    let diagnosed = |(case, _): &(&String, _)| {
        let copy = tempfile::tempdir().unwrap();
        let mut path = folder.join(case);
        if let Some(logger) = logger {
            for file in std::fs::read_dir(&path).unwrap().map(|e| e.unwrap().path()) {
                std::fs::copy(&file, copy.path().join(file.file_name().unwrap())).unwrap();
            }
            path = copy.path().to_path_buf();
            logger.repeat_rows(&path);
        }
        let campaign = campaign::read(&path, &ReadOptions::default()).expect("a practice campaign can be read");
        let vehicle = Vehicle::from_value(&campaign.vehicle_json).expect("a practice vehicle is sound");
        let nominal = effects::null();
        for recording in &campaign.recordings {
            let gaps = evaluate(recording, (&vehicle, &nominal), (&vehicle, &nominal));
            assert!(gaps.iter().all(|g| g.before.is_finite()), "{case} {}", recording.name);
        }
        diagnose(&campaign, &|_, _| {}).expect("a practice campaign can be diagnosed").json
    };
    // In parallel, so that no core is idle.
    let all: Vec<serde_json::Value> = chosen.par_iter().map(diagnosed).collect();
    for ((case, truth), json) in chosen.into_iter().zip(&all) {
        let truth: Vec<&str> = truth.as_array().into_iter().flatten().filter_map(serde_json::Value::as_str).collect();
        score.count(case, &truth, json);
    }
    println!("{} practice campaigns, {}", score.cars, logger.map_or("as recorded", |l| l.name));
    score.judge();
}

/// Number of hits and number of tries.
#[derive(Default)]
struct Share(f64, f64);

impl Share {
    fn count(&mut self, hit: f64) {
        (self.0, self.1) = (self.0 + hit, self.1 + 1.0);
    }

    /// Prints the share, and fails if it is below `least`.
    fn at_least(&self, name: &str, least: f64) {
        println!("  {name:<50} {} of {}", self.0, self.1);
        assert!(self.0 >= least * self.1, "{name}: {} of {}, not {least}", self.0, self.1);
    }
}

/// The scores of `kisspoint blind`; gaps are closed on the recordings that the diagnosis held out.
#[derive(Default)]
struct Score {
    healthy: Share,
    detected: Share,
    located: Share,
    singles: Share,
    pairs: Share,
    unknown: Share,
    unknown_located: Share,
    extra: usize,
    closed: Vec<f64>,
    cars: usize,
}

impl Score {
    fn count(&mut self, case: &str, truth: &[&str], json: &serde_json::Value) {
        let texts =
            |v: &serde_json::Value| v.as_array().into_iter().flatten().filter_map(|e| e.as_str().map(str::to_owned)).collect::<Vec<_>>();
        let verdict = json["verdict"].as_str().unwrap_or_default();
        let named: Vec<Vec<String>> = json["which"]["effects"]
            .as_array()
            .into_iter()
            .flatten()
            .map(|e| e["id"].as_str().map(str::to_owned).into_iter().chain(texts(&e["ambiguous_with"])).collect())
            .collect();
        println!("{case} {truth:?}: {verdict} {named:?}");
        self.cars += 1;
        self.extra += named.iter().filter(|group| !group.iter().any(|id| truth.contains(&id.as_str()))).count();
        if truth.is_empty() {
            return self.healthy.count(f64::from(u8::from(verdict == "no_gap")));
        }
        let found = |hit: bool| f64::from(u8::from(hit));
        let at = |place: &str| truth.iter().any(|id| find(id).is_some_and(|(_, subsystem, _)| json["where"][place] == subsystem));
        self.detected.count(found(verdict != "no_gap"));
        self.located.count(found(at("primary")));
        if !truth.iter().all(|id| REGISTRY.iter().any(|e| e.id == *id)) {
            self.unknown.count(found(verdict == "unexplained" || verdict == "partly_explained"));
            return self.unknown_located.count(found(at("primary") || at("unexplained_at")));
        }
        let credit = |id: &&str| named.iter().find(|group| group.iter().any(|n| n == id)).map_or(0.0, |group| 1.0 / group.len() as f64);
        let attributed = truth.iter().map(credit).sum::<f64>() / truth.len() as f64;
        if truth.len() == 1 { &mut self.singles } else { &mut self.pairs }.count(attributed);
        self.closed.extend(json["how_far"]["closed_fraction"].as_f64());
    }

    fn judge(mut self) {
        self.healthy.at_least("healthy cars not flagged", 1.0);
        self.detected.at_least("gaps detected", 0.99);
        self.located.at_least("located", 0.97);
        self.singles.at_least("single effects attributed", 0.95);
        self.pairs.at_least("pairs attributed", 0.9);
        self.unknown.at_least("effects outside the library flagged", 0.9);
        self.unknown_located.at_least("effects outside the library located", 0.9);
        self.closed.sort_by(f64::total_cmp);
        let quantile = |q: f64| self.closed[((self.closed.len() - 1) as f64 * q).round() as usize];
        println!("  extra effects {} in {} cars", self.extra, self.cars);
        println!("  gap closed on held-out recordings: median {:.3}, tenth percentile {:.3}", quantile(0.5), quantile(0.1));
        // One is tolerated: for the dragging brake, which is not in the library, an earlier build named a road load in addition to the missing law (docs/validation-log.md).
        assert!(self.extra <= 1, "{} effects too many", self.extra);
        assert!(quantile(0.5) >= 0.97 && quantile(0.1) >= 0.9);
    }
}
