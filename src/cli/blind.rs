//! `kisspoint blind`: draws fresh cars, diagnoses them, then opens the answers and scores.
//!
//! The cars come from `realcar`, which shares no code with the plant. What is true of a car is [`Sealed`]: the diagnosis is handed a folder of
//! recordings and nothing else, and the seal opens only against a finished answer.

use super::error::{CommandError, at};
use super::output::{print, print_json};
use super::progress::Progress;
use crate::campaign::{self, ReadOptions};
use crate::effects;
use crate::gap::diagnosis::{Diagnosis, diagnose};
use crate::gap::measure::evaluate;
use crate::gap::series::Channel;
use rayon::prelude::*;
use realcar::{Car, Place, Truth};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Options of `kisspoint blind`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  kisspoint blind --cars 40 --seed 7\n  kisspoint blind --cars 200 --json > score.json\n  \
    kisspoint blind --road --cars 20 --seed 3 --draw-only --keep drawn")]
pub struct Args {
    /// Cars to draw
    #[arg(long, value_name = "N", default_value_t = 20)]
    cars: usize,
    /// Seed of the draw; without one, the clock gives it
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Draw drives on the road in place of bench campaigns
    #[arg(long)]
    road: bool,
    /// Keep the campaigns and their answers in this folder
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    /// Draw the campaigns and diagnose none; needs --keep
    #[arg(long, requires = "keep")]
    draw_only: bool,
    /// Print the score as JSON
    #[arg(long)]
    json: bool,
    /// Threads; 0 takes all cores
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
}

/// What is true of a car, closed until it has been diagnosed.
struct Sealed(Truth);

impl Sealed {
    /// Opens against an answer.
    fn open(self, _answer: &Diagnosis) -> Truth {
        self.0
    }
}

/// A diagnosed car with its seal open.
struct Outcome {
    truth: Truth,
    verdict: String,
    primary: Option<String>,
    unexplained_at: Option<String>,
    doubted: Vec<String>,
    named: Vec<(String, Vec<String>)>,
    closed: f64,
}

/// Runs the subcommand.
///
/// # Errors
/// Temporary files that cannot be written.
pub fn run(args: &Args) -> Result<(), CommandError> {
    let clock = || std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).map_or(0, |d| d.as_secs());
    let seed = args.seed.unwrap_or_else(clock);
    let place = if args.road { Place::Road } else { Place::Bench };
    let bar = Progress::new();
    if let Some(folder) = &args.keep {
        keep(folder, place, seed, args.cars)?;
        if args.draw_only {
            return Ok(());
        }
    }
    let folder = std::env::temp_dir().join(format!("kisspoint-blind-{}-{seed}", std::process::id()));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads).build()?;
    let done = std::sync::atomic::AtomicUsize::new(0);
    let one = |k: usize| {
        let outcome = examine(&folder.join(format!("car_{k:04}")), realcar::draw_car(realcar::Place::Bench, seed, k));
        let count = 1 + done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        bar.tell(&format!("car {count} of {}", args.cars), count as f64 / args.cars as f64);
        outcome
    };
    let outcomes: Result<Vec<Outcome>, CommandError> = pool.install(|| (0..args.cars).into_par_iter().map(one).collect());
    bar.finish();
    let _ = std::fs::remove_dir_all(&folder);
    report(&outcomes?, seed, args.json)
}

/// Writes the campaigns as `case_001` and on, and what is true of them as `answers.json`.
fn keep(folder: &Path, place: Place, seed: u64, cars: usize) -> Result<(), CommandError> {
    let drawn: Result<Vec<(String, Vec<&str>)>, CommandError> = (0..cars)
        .into_par_iter()
        .map(|k| {
            let car = realcar::draw_car(place, seed, k);
            let name = format!("case_{:03}", k + 1);
            car.write(&folder.join(&name)).map_err(at(folder))?;
            Ok((name, car.truth.effects.iter().map(|e| e.id).collect()))
        })
        .collect();
    let answers: std::collections::BTreeMap<_, _> = drawn?.into_iter().collect();
    let file = folder.join("answers.json");
    std::fs::write(&file, format!("{:#}\n", json!(answers))).map_err(at(file))
}

/// Draws into a folder, diagnoses the folder, opens the seal.
fn examine(folder: &Path, car: Car) -> Result<Outcome, CommandError> {
    let (shown, unseen) = (folder.join("shown"), folder.join("unseen"));
    car.write(&shown).map_err(at(folder))?;
    let sealed = Sealed(car.truth.clone());
    let answer = diagnose(&campaign::read(&shown, &ReadOptions::default())?, &|_, _| {}).map_err(|source| CommandError::Diagnosis {
        path: shown.clone(),
        source,
        left_out: Vec::new(),
    })?;
    car.write_unseen(&unseen).map_err(at(folder))?;
    let closed = closed_on(&campaign::read(&unseen, &ReadOptions::default())?, &answer);
    let _ = std::fs::remove_dir_all(folder);
    let text = |v: &serde_json::Value| v.as_str().map(str::to_owned);
    let json = &answer.json;
    let named = json["which"]["effects"].as_array().into_iter().flatten().map(|e| {
        let group = e["ambiguous_with"].as_array().into_iter().flatten().filter_map(text).collect();
        (text(&e["id"]).unwrap_or_default(), group)
    });
    Ok(Outcome {
        verdict: text(&json["verdict"]).unwrap_or_default(),
        primary: text(&json["where"]["primary"]),
        unexplained_at: text(&json["where"]["unexplained_at"]),
        doubted: json["where"]["ambiguous_with"].as_array().into_iter().flatten().filter_map(text).collect(),
        named: named.collect(),
        closed,
        truth: sealed.open(&answer),
    })
}

/// Share of the speed gap that the retuned car closes on recordings that the diagnosis never saw.
fn closed_on(unseen: &campaign::Campaign, answer: &Diagnosis) -> f64 {
    let (before, after) = ((&answer.nominal, &effects::null()), (&answer.vehicle, &answer.effects));
    let speeds = unseen
        .recordings
        .iter()
        .flat_map(|r| evaluate(r, before, after))
        .filter(|h| matches!(h.channel, Channel::OmegaF | Channel::OmegaC));
    let (b, a, n) = speeds.fold((0.0, 0.0, 0.0), |(b, a, n), h| (b + h.before, a + h.after, n + h.noise));
    ((b - a) / (b - n)).min(1.0)
}

/// Mean of a score over the outcomes that it concerns; none if there are none.
fn mean<'a>(outcomes: impl Iterator<Item = &'a Outcome>, score: impl Fn(&Outcome) -> f64) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0);
    for outcome in outcomes {
        sum += score(outcome);
        count += 1;
    }
    (count > 0).then(|| sum / f64::from(count))
}

/// Share of the true effects that are named; one that is named as a group counts 1/size.
fn credit(o: &Outcome) -> f64 {
    let of = |id: &str| {
        let found = o.named.iter().find(|(named, group)| named == id || group.iter().any(|g| g == id));
        found.map_or(0.0, |(_, group)| 1.0 / (1 + group.len()) as f64)
    };
    o.truth.effects.iter().map(|e| of(e.id)).sum::<f64>() / o.truth.effects.len() as f64
}

/// Effects named beyond the true ones.
fn extra(o: &Outcome) -> f64 {
    let is_true = |named: &(String, Vec<String>)| o.truth.effects.iter().any(|e| e.id == named.0 || named.1.iter().any(|g| g == e.id));
    o.named.iter().filter(|named| !is_true(named)).count() as f64
}

/// The one score that counts effects; the others are shares.
const EXTRA: &str = "extra effects per car";

fn hit(condition: bool) -> f64 {
    f64::from(u8::from(condition))
}

fn report(outcomes: &[Outcome], seed: u64, as_json: bool) -> Result<(), CommandError> {
    let known = |o: &&Outcome| o.truth.effects.iter().all(|e| e.in_library);
    let of_size = |n: usize| outcomes.iter().filter(known).filter(move |o| o.truth.effects.len() == n);
    let faulty = || outcomes.iter().filter(|o| !o.truth.effects.is_empty());
    let outside = || outcomes.iter().filter(|o| !known(o));
    let at = |o: &Outcome, place: &Option<String>| o.truth.effects.iter().any(|e| Some(e.subsystem) == place.as_deref());
    let placed = |o: &Outcome| at(o, &o.unexplained_at) || at(o, &o.primary);
    let left_open = |o: &Outcome| o.truth.effects.iter().any(|e| o.doubted.iter().any(|s| s == e.subsystem));
    let mut closed: Vec<f64> = of_size(1).chain(of_size(2)).chain(of_size(3)).map(|o| o.closed).collect();
    closed.sort_by(f64::total_cmp);
    let quantile = |q: f64| (!closed.is_empty()).then(|| closed[((closed.len() - 1) as f64 * q).round() as usize]);
    let unknown = |o: &Outcome| matches!(o.verdict.as_str(), "unexplained" | "partly_explained");
    let rows = [
        ("healthy cars flagged", mean(of_size(0), |o| hit(o.verdict != "no_gap"))),
        ("gaps detected", mean(faulty(), |o| hit(o.verdict != "no_gap"))),
        ("located", mean(faulty(), |o| hit(at(o, &o.primary)))),
        ("single effects attributed", mean(of_size(1), credit)),
        (EXTRA, mean(outcomes.iter(), extra)),
        ("pairs attributed", mean(of_size(2), credit)),
        ("triples attributed", mean(of_size(3), credit)),
        ("effects outside the library flagged", mean(outside(), |o| hit(unknown(o)))),
        ("effects outside the library located", mean(outside(), |o| hit(placed(o)))),
        ("effects outside the library located or left open", mean(outside(), |o| hit(placed(o) || left_open(o)))),
        ("gap closed on unseen recordings, median", quantile(0.5)),
        ("gap closed on unseen recordings, tenth percentile", quantile(0.1)),
    ];
    if as_json {
        let scores: serde_json::Map<String, serde_json::Value> = rows.iter().map(|(name, v)| ((*name).to_owned(), json!(v))).collect();
        let cars: Vec<serde_json::Value> = outcomes.iter().map(row).collect();
        return print_json(&json!({"seed": seed, "cars": outcomes.len(), "scores": scores, "outcomes": cars}));
    }
    let shown = |name: &str, value: f64| if name == EXTRA { format!("{value:.2}") } else { format!("{:.1} %", 100.0 * value) };
    let row = |(name, value): &(&str, Option<f64>)| format!("  {name:<50} {}\n", value.map_or("-".to_owned(), |v| shown(name, v)));
    let rows: String = rows.iter().map(row).collect();
    print(&format!("{} cars drawn with seed {seed}\n{rows}", outcomes.len()))
}

fn row(o: &Outcome) -> serde_json::Value {
    let truth: Vec<&str> = o.truth.effects.iter().map(|e| e.id).collect();
    json!({"truth": truth, "verdict": o.verdict, "primary": o.primary, "unexplained_at": o.unexplained_at, "doubted": o.doubted, "named": o.named, "closed": o.closed})
}
