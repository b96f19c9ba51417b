//! `kisspoint blind`: draws new cars, diagnoses them, and only then unseals the truth and scores the answers.
//!
//! The cars come from `realcar`, which shares no code with the plant. The truth about a car is sealed: the diagnosis receives a folder of recordings and nothing else, and the
//! seal opens only in exchange for a finished answer, of which only fields of the schema of diagnosis.json are read.
//!
//! - [`examine`]: one car, from its folder to an outcome
//! - [`closed`]: share of the gap that the retuned plant closes on recordings that the diagnosis never saw
//! - [`predicted`]: the predicted standard deviation of the clutch torque against the errors on those recordings
//! - [`scores`]: counts, shares and their intervals
//! - [`reliability`]: calibration of the claimed probabilities and intervals
//! - [`planned`]: predictions of a plan against the results with drawn cars
//! - [`kept`]: answers kept from an interrupted examination
//! - [`folder`]: a temporary folder that is removed at the end, even if the run is interrupted

pub mod closed;
pub mod examine;
pub mod folder;
pub mod kept;
pub mod planned;
pub mod predicted;
pub mod reliability;
pub mod scores;

use super::error::{CommandError, at};
use super::output::{print, print_json};
use super::progress::Progress;
use examine::{Outcome, Subject};
use folder::Temporary;
use kept::Kept;
use rayon::prelude::*;
use realcar::fleet::{self, Population};
use realcar::{Driven, Place};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Options of `kisspoint blind`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  kisspoint blind --cars 40 --seed 7\n  kisspoint blind --cars 200 --json > score.json\n  \
    kisspoint blind --plan --cars 24 --seed 1 --curve limits.svg\n  \
    kisspoint blind --road --cars 20 --seed 3 --draw-only --keep drawn")]
pub struct Args {
    /// Cars to draw, at least one
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..))]
    cars: u32,
    /// Seed of the draw; without one, the clock gives it
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Draw drives on the road instead of bench campaigns
    #[arg(long, conflicts_with = "altered")]
    road: bool,
    /// Drives that each campaign has, about a minute each; without it, 2 to 5 are drawn
    #[arg(long, value_name = "N", requires = "road", conflicts_with = "new_outside", value_parser = clap::value_parser!(u32).range(1..=500))]
    drives: Option<u32>,
    /// Length of each drive of a campaign, s; without it, 20 to 80 s are drawn
    #[arg(long, value_name = "S", requires = "road", conflicts_with = "new_outside", value_parser = clap::value_parser!(u32).range(20..=7200))]
    drive_length: Option<u32>,
    /// Draw bench campaigns as a worse logger would write them: each kind of damage in turn
    #[arg(long)]
    altered: bool,
    /// Draw a fleet: bench campaigns of one vehicle file, whose numbers are off by what population.json in --keep says; some cars carry an effect
    #[arg(long, conflicts_with_all = ["road", "altered", "new_outside", "plan"], requires = "keep")]
    fleet: bool,
    /// Draw only effects outside the library that were never used while the diagnosis was developed
    #[arg(long, conflicts_with = "altered")]
    new_outside: bool,
    /// Check what `kisspoint plan` promises: the manoeuvres it recommends and the limits it predicts
    #[arg(long, conflicts_with_all = ["road", "altered", "new_outside", "keep"])]
    plan: bool,
    /// File for the curve of --plan: how often effects at multiples of the predicted limit are found, SVG
    #[arg(long, value_name = "FILE", requires = "plan")]
    curve: Option<PathBuf>,
    /// Keep the campaigns, the truth about them and each diagnosis in this folder; an interrupted run continues from there
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    /// Draw the campaigns without diagnosing them; needs --keep
    #[arg(long, requires = "keep")]
    draw_only: bool,
    /// Print the score as JSON
    #[arg(long)]
    json: bool,
    /// Threads; 0 takes all cores
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
}

impl Args {
    /// The car with this index, and how its log is degraded.
    fn draw(&self, seed: u64, index: usize) -> Subject {
        if self.altered {
            let (car, alteration) = realcar::altered::draw_altered(seed, index);
            return Subject { car, alteration: Some(alteration) };
        }
        if self.fleet {
            return Subject { car: fleet::draw_member(&Population::draw(seed), index), alteration: None };
        }
        if self.drives.is_some() || self.drive_length.is_some() {
            let driven = Driven { drives: self.drives.map(|n| n as usize), length_s: self.drive_length.map(f64::from) };
            return Subject { car: realcar::draw_long(seed, index, driven), alteration: None };
        }
        let place = if self.road { Place::Road } else { Place::Bench };
        let car = if self.new_outside { realcar::draw_new(place, seed, index) } else { realcar::draw_car(place, seed, index) };
        Subject { car, alteration: None }
    }

    fn what(&self) -> &'static str {
        match (self.road, self.altered, self.fleet) {
            (true, ..) => "road",
            (_, true, _) => "altered",
            (.., true) => "fleet",
            _ => "bench",
        }
    }
}

/// Runs the subcommand.
///
/// # Errors
/// Files that cannot be written.
pub fn run(args: &Args) -> Result<(), CommandError> {
    let clock = || std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).map_or(0, |d| d.as_secs());
    let seed = args.seed.unwrap_or_else(clock);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads).build()?;
    let cars = args.cars as usize;
    if args.plan {
        let options = planned::Options { cars, seed, json: args.json, curve: args.curve.as_ref() };
        return planned::run(&options, &pool);
    }
    if let Some(folder) = &args.keep {
        let moves = pool.install(|| keep(folder, cars, |k| args.draw(seed, k)))?;
        if args.fleet {
            write_population(folder, &Population::draw(seed), moves)?;
        }
        if args.draw_only {
            let drawn = json!({"seed": seed, "cars": cars, "drawn": args.what(), "generator": realcar::VERSION, "folder": folder});
            return if args.json {
                print_json(&drawn)
            } else {
                print(&format!("{cars} campaign{} and answers.json in {}\n", if cars == 1 { "" } else { "s" }, folder.display()))
            };
        }
    }
    let bar = Progress::new();
    let kept = args.keep.as_deref().map(Kept::beside).transpose()?;
    let mut temporary = None;
    let folder = match &args.keep {
        Some(folder) => folder.as_path(),
        None => temporary.insert(Temporary::new(seed)?).path(),
    };
    let done = AtomicUsize::new(0);
    let one = |k: usize| {
        let began = Instant::now();
        let name = case(k);
        let outcome = examine::examine(&folder.join(&name), args.draw(seed, k), kept.as_ref())?;
        let count = 1 + done.fetch_add(1, Ordering::Relaxed);
        bar.line(&format!("{count:>3} of {cars}  {name}  {:>4.0} s  {}", began.elapsed().as_secs_f64(), outcome.line()));
        bar.tell(&format!("car {count} of {cars}"), count as f64 / cars as f64);
        Ok(outcome)
    };
    let outcomes: Result<Vec<Outcome>, CommandError> = pool.install(|| (0..cars).into_par_iter().map(one).collect());
    bar.finish();
    report(&outcomes?, seed, args)
}

/// Name of the car with this index.
fn case(index: usize) -> String {
    format!("case_{:03}", index + 1)
}

/// Writes the truth about a fleet to population.json: mean and standard deviation of each number over the fleet, and by how many standard deviations of its tolerance each
/// number of each car is off.
fn write_population(folder: &Path, population: &Population, cars: serde_json::Map<String, Value>) -> Result<(), CommandError> {
    let number = |(name, [mean, spread]): &(&str, [f64; 2])| ((*name).to_owned(), json!({"mean": mean, "spread": spread}));
    let numbers: serde_json::Map<String, Value> = population.numbers.iter().map(number).collect();
    let document = json!({"seed": population.seed, "effect": population.effect, "numbers": numbers, "cars": cars});
    let file = folder.join("population.json");
    std::fs::write(&file, format!("{document:#}\n")).map_err(at(file))
}

/// Writes the campaigns as `case_001` and so on, and the truth about them as `answers.json` and `shapes.json`. Returns how far the numbers of each car are from its vehicle
/// file.
fn keep(folder: &Path, cars: usize, draw: impl Fn(usize) -> Subject + Sync) -> Result<serde_json::Map<String, Value>, CommandError> {
    let one = |k: usize| {
        let Subject { car, alteration } = draw(k);
        let name = case(k);
        car.write(&folder.join(&name)).map_err(at(folder))?;
        let ids: Vec<&str> = car.truth.effects.iter().map(|e| e.id).collect();
        let told: Vec<String> = car.truth.effects.iter().map(|e| format!("{}: {}", e.id, e.shape)).collect();
        let moves: serde_json::Map<String, Value> = car.real.moves().iter().map(|(n, z)| ((*n).to_owned(), json!(z))).collect();
        Ok((name, ids, json!({"alteration": alteration.map(scores::row_name), "shapes": told}), Value::Object(moves)))
    };
    let drawn: Result<Vec<(String, Vec<&str>, Value, Value)>, CommandError> = (0..cars).into_par_iter().map(one).collect();
    let mut answers = serde_json::Map::new();
    let mut shapes = serde_json::Map::new();
    let mut moves = serde_json::Map::new();
    for (name, ids, told, moved) in drawn? {
        answers.insert(name.clone(), json!(ids));
        shapes.insert(name.clone(), told);
        moves.insert(name, moved);
    }
    for (name, content) in [("answers.json", answers), ("shapes.json", shapes)] {
        let file = folder.join(name);
        std::fs::write(&file, format!("{:#}\n", Value::Object(content))).map_err(at(file))?;
    }
    Ok(moves)
}

fn report(outcomes: &[Outcome], seed: u64, args: &Args) -> Result<(), CommandError> {
    let table = scores::table(outcomes);
    let claims = reliability::of(outcomes);
    let torque = predicted::Summary::of(outcomes.iter().flat_map(|o| &o.predicted));
    if args.json {
        let cars: Vec<Value> = outcomes.iter().map(Outcome::as_json).collect();
        return print_json(&json!({
            "seed": seed, "cars": outcomes.len(), "drawn": args.what(), "generator": realcar::VERSION,
            "scores": scores::as_json(&table), "reliability": claims.as_json(), "torque_sigma": torque.as_json(), "outcomes": cars,
        }));
    }
    let (count, s) = (outcomes.len(), if outcomes.len() == 1 { "" } else { "s" });
    let head = format!("{count} car{s} drawn with seed {seed}: {}, generator {}\n", args.what(), realcar::VERSION);
    let errors: String = outcomes.iter().filter_map(|o| o.error.as_ref()).map(|e| format!("not diagnosed: {e}\n")).collect();
    print(&format!("{head}{}{}{}{errors}", scores::as_text(&table), claims.as_text(), torque.as_text()))
}
