//! `kisspoint plan`: predicts before measuring what a campaign will show, and says after a diagnosis what to measure next.

use super::error::{CommandError, at};
use super::files::{read_vehicle, write_all};
use super::output::{folded, print, print_json, width};
use super::progress::Progress;
use crate::campaign::{self, ChannelMap, ReadOptions, SLOWEST_HZ};
use crate::effects::{PARAMETERS, REGISTRY};
use crate::gap::answer::Real;
use crate::gap::diagnosis::{DiagnosisError, diagnose_with};
use crate::gap::infer::density::size;
use crate::gap::infer::limit::POWER;
use crate::gap::infer::screen::Limit;
use crate::gap::plan::manoeuvre::{Manoeuvre, built_in};
use crate::gap::plan::reach::{Reach, TOO_LARGE, reach};
use crate::gap::plan::rehearse::Logger;
use crate::gap::plan::{Outlook, Planner, Sensors};
use crate::report::names;
use crate::report::plan as picture;
use crate::report::text::{number, unit};
use crate::report::verdict;
use crate::vehicle::Vehicle;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::io::IsTerminal;
use std::path::{Path, PathBuf};

/// Options of `kisspoint plan`.
#[derive(clap::Args, Debug)]
#[command(
    override_usage = "kisspoint plan [OPTIONS] <CAMPAIGN>\n       kisspoint plan [OPTIONS] --vehicle <FILE>",
    after_help = "Before measuring (--vehicle): the smallest size of every effect that these manoeuvres, each driven once, will show, beside the size of a usual fault.\n\
After measuring (CAMPAIGN): which manoeuvre best settles what the diagnosis leaves open, in expected nats (units of log odds) per minute.\n\nExamples:\n  \
kisspoint plan --vehicle vehicle.json\n  \
kisspoint plan --vehicle vehicle.json --drive launch,launch_hot,creep,tip_in \\\n      --bench\n  \
kisspoint plan --list > bench.toml\n  \
kisspoint plan measurements/car_17 --manoeuvres bench.toml"
)]
pub struct Args {
    /// Folder with vehicle.json, recordings.json and the recordings
    #[arg(value_name = "CAMPAIGN", required_unless_present_any = ["vehicle", "list"], conflicts_with_all = ["vehicle", "list"])]
    campaign: Option<PathBuf>,
    /// Vehicle file of a car that has not been recorded yet
    #[arg(long, value_name = "FILE")]
    vehicle: Option<PathBuf>,
    /// Manoeuvres that the car or the bench can drive, TOML as --list prints it; else the built-in ones
    #[arg(long, value_name = "FILE")]
    manoeuvres: Option<PathBuf>,
    /// Drive only the manoeuvres of these names
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    drive: Vec<String>,
    /// Print the manoeuvres as a file for --manoeuvres, and stop
    #[arg(long, conflicts_with_all = ["json", "out"])]
    list: bool,
    /// Sample rate before measuring, Hz
    #[arg(long, value_name = "HZ", default_value_t = 100.0, value_parser = rate, conflicts_with = "campaign")]
    rate: f64,
    /// Bearing position, clutch torque and disc temperature will also be measured
    #[arg(long, conflicts_with = "campaign")]
    bench: bool,
    /// Noise of both speeds before measuring: one standard deviation of a sample, rad/s
    #[arg(long, value_name = "RAD/S", default_value_t = Sensors::default().speed, value_parser = noise, conflicts_with = "campaign")]
    speed_noise: f64,
    /// Noise of the torque report before measuring: one standard deviation of a sample, N·m
    #[arg(long, value_name = "NM", default_value_t = Sensors::default().torque, value_parser = noise, conflicts_with = "campaign")]
    torque_noise: f64,
    /// Names and units of the channels, TOML or JSON
    #[arg(long, value_name = "FILE", requires = "campaign")]
    channel_map: Option<PathBuf>,
    /// Also write plan.json and plan.svg into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Threads, at most 256; 0 takes all cores. The answer does not depend on it
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u16).range(..=256))]
    threads: u16,
}

fn rate(text: &str) -> Result<f64, String> {
    within(text, SLOWEST_HZ, 10_000.0, "Hz")
}

fn noise(text: &str) -> Result<f64, String> {
    within(text, 1e-3, 100.0, "")
}

fn within(text: &str, least: f64, most: f64, unit: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "it is no number".to_owned())?;
    if (least..=most).contains(&value) {
        Ok(value)
    } else {
        Err(format!("it must be within {least} and {most} {unit}").trim_end().to_owned())
    }
}

/// The file of manoeuvres.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    manoeuvre: Vec<Manoeuvre>,
}

/// Runs the subcommand.
///
/// # Errors
/// A vehicle file, a campaign or a file of manoeuvres that cannot be used.
pub fn run(args: &Args) -> Result<(), CommandError> {
    args.out.as_deref().map(super::files::writable).transpose()?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads.into()).build()?;
    match &args.campaign {
        Some(campaign) => after(args, campaign, &pool),
        None => before(args, &pool),
    }
}

/// Manoeuvres of the file, or the built-in ones, restricted to those that --drive names.
fn manoeuvres(args: &Args, vehicle: &Vehicle) -> Result<Vec<Manoeuvre>, CommandError> {
    let all = match &args.manoeuvres {
        Some(path) => read(path)?,
        None => built_in(vehicle),
    };
    if args.drive.is_empty() {
        return Ok(all);
    }
    let names = || all.iter().map(|m| m.name.as_str()).collect::<Vec<_>>().join(", ");
    args.drive
        .iter()
        .map(|name| {
            let found = all.iter().find(|m| m.name == name.trim());
            found
                .cloned()
                .ok_or_else(|| CommandError::Refused(format!("--drive {name}: no manoeuvre has that name; there are {}", names())))
        })
        .collect()
}

fn read(path: &Path) -> Result<Vec<Manoeuvre>, CommandError> {
    let wrong = |what: String| CommandError::Refused(format!("{}: {what}", path.display()));
    let text = std::fs::read_to_string(path).map_err(at(path))?;
    let file: File = toml::from_str(&text)
        .map_err(|e| wrong(format!("{}\n`kisspoint plan --list` prints a file to start from", e.to_string().trim_end())))?;
    if file.manoeuvre.is_empty() {
        return Err(wrong("it has no [[manoeuvre]]; `kisspoint plan --list` prints a file to start from".to_owned()));
    }
    for (k, m) in file.manoeuvre.iter().enumerate() {
        if let Some(fault) = m.fault() {
            return Err(wrong(format!("manoeuvre \"{}\": {fault}", m.name)));
        }
        if file.manoeuvre[..k].iter().any(|other| other.name == m.name) {
            return Err(wrong(format!("two manoeuvres have the name \"{}\"; give each its own", m.name)));
        }
    }
    Ok(file.manoeuvre)
}

const HEAD: &str = "# What the car or the bench can drive: delete what it cannot, change torques, temperatures and times.
# kind: launch, creep, kiss_point, braked_ramp, chirp, constant_position, open_rev, tip_in, coast_down, reengage, heat_and_rest
# prepare_s is what it takes to come to the start: to stand, to warm the clutch.
";

fn before(args: &Args, pool: &rayon::ThreadPool) -> Result<(), CommandError> {
    let file = args.vehicle.as_deref().map(read_vehicle).transpose()?;
    let paper = Vehicle::paper();
    let vehicle = file.as_ref().map_or(&paper, |f| &f.vehicle);
    let manoeuvres = manoeuvres(args, vehicle)?;
    if args.list {
        let text = toml::to_string(&File { manoeuvre: manoeuvres }).expect("manoeuvres are plain data");
        return print(&format!("{HEAD}\n{text}"));
    }
    let (Some(file), Some(path)) = (&file, &args.vehicle) else { unreachable!("clap asks for a vehicle without a campaign") };
    let sensors = Sensors { speed: args.speed_noise, torque: args.torque_noise, ..Sensors::default() };
    let logger = Logger { rate_hz: args.rate, bench: [args.bench; 3], theta_0_sigma: [1.0; 2] };
    let refused = |source: DiagnosisError| CommandError::Diagnosis { path: path.clone(), source, left_out: Vec::new() };
    let planner = Planner::before(vehicle, &file.document, sensors, logger, manoeuvres).map_err(|e| refused(e.into()))?;
    let bar = Progress::new();
    bar.tell("rehearsing the manoeuvres", 0.3);
    let found = pool.install(|| reach(&planner, None, &planner.nominal()));
    bar.finish();
    let Some(found) = found else {
        return Err(CommandError::Refused("there is nothing to drive; name at least one manoeuvre".to_owned()));
    };
    let rows = rows(&found.with_all, Some(&found), &planner.manoeuvres);
    let json = json!({
        "vehicle": path, "power": POWER, "rate_Hz": args.rate, "bench": args.bench, "manoeuvres": planner.manoeuvres,
        "effects": rows.iter().map(Row::as_json).collect::<Vec<_>>(),
    });
    write(args, &json)?;
    if args.json {
        return print_json(&json);
    }
    let (seconds, minutes) = planner.manoeuvres.iter().fold((0.0, 0.0), |(s, m), one| (s + one.seconds, m + one.minutes()));
    let head = format!(
        "{} manoeuvres, each driven once: {seconds:.0} s of recordings, {minutes:.0} min with preparation.\n\
         An effect of the size under \"shows from\" is found with a probability of {:.0} %, tolerances and start temperatures allowed for.\n\n",
        planner.manoeuvres.len(),
        100.0 * POWER
    );
    print(&format!("{head}{}{}", table(&rows, "shows from"), hidden(&rows)))
}

fn after(args: &Args, path: &Path, pool: &rayon::ThreadPool) -> Result<(), CommandError> {
    let channel_map = args.channel_map.as_deref().map(ChannelMap::from_file).transpose()?;
    let bar = Progress::new();
    let read = campaign::read_telling(path, &ReadOptions { channel_map, strict: false }, &|file, share| {
        bar.tell(&format!("reading {file}"), share)
    });
    bar.finish();
    let campaign = super::diagnose::in_parts(read?, path)?;
    eprint!("{}", campaign.remarks());
    super::memory::has_room(path, &campaign)?;
    let file = read_vehicle(&campaign.vehicle_path)?;
    let manoeuvres = manoeuvres(args, &file.vehicle)?;
    let bar = Progress::new();
    let found = pool.install(|| diagnose_with(&campaign, Some(manoeuvres), &|what, share| bar.tell(what, share)));
    bar.finish();
    let refused = |source| CommandError::Diagnosis { path: path.to_owned(), source, left_out: campaign.left_out.clone() };
    let diagnosis = found.map_err(refused)?;
    let outlook = &diagnosis.outlook;
    let rows = rows(&outlook.limits, outlook.reach.as_ref(), &outlook.manoeuvres);
    let json = json!({
        "campaign": path, "sentence": diagnosis.answer.sentence, "measure_next": diagnosis.answer.measure_next, "power": POWER,
        "manoeuvres": outlook.manoeuvres, "effects": rows.iter().map(Row::as_json).collect::<Vec<_>>(),
    });
    write(args, &json)?;
    if args.json {
        return print_json(&json);
    }
    let shown = format!(
        "\nThe smallest effects that these recordings show, found with a probability of {:.0} %, and the manoeuvre that would show more per minute:\n\n",
        100.0 * POWER
    );
    let wide = width(std::io::stdout().is_terminal());
    let headline = folded(&verdict::headline(&diagnosis.json), wide, "");
    print(&format!("{headline}\n\n{}{}{}{}", open(outlook), folded(&shown, wide, ""), table(&rows, "shown from"), hidden(&rows)))
}

/// The rivals that are still open, and the expected effect of each manoeuvre.
fn open(outlook: &Outlook) -> String {
    let ranked = outlook.ranked_for_all();
    if ranked.is_empty() {
        return "One explanation stands alone: nothing is open.\n".to_owned();
    }
    let mut text = "Still open:\n".to_owned();
    for r in &outlook.rivals {
        let names: Vec<String> = r.effects.iter().map(|&e| format!("{} ({})", names::effect(REGISTRY[e].id), REGISTRY[e].id)).collect();
        let name = if names.is_empty() { "within the tolerances".to_owned() } else { names.join(" and ") };
        text += &format!("  {:>5.1} %  {name}\n", 100.0 * r.probability);
    }
    text += "\nWhat would settle it, ranked by the expected evidence for the true explanation:\n\n";
    text += &format!("{:<20} {:>8} {:>8} {:>10} {:>10}\n", "manoeuvre", "minutes", "nats", "nats/min", "splits");
    for w in &ranked {
        let m = &outlook.manoeuvres[w.manoeuvre];
        let (nats, rate) = (number(w.nats, 3), number(w.nats_per_minute, 3));
        text += &format!("{:<20} {:>8.1} {nats:>8} {rate:>10} {:>8.0} %\n", m.name, m.minutes(), 100.0 * w.splits);
    }
    let best = &outlook.manoeuvres[ranked[0].manoeuvre];
    text + &format!(
        "\nDrive {}: {}, {:.0} N·m, disc at {:.0} °C, {:.0} s.\n",
        best.name,
        best.kind.words(),
        best.torque_nm,
        best.theta_c,
        best.seconds
    )
}

/// One effect with its limit of detection, and the manoeuvre that shows it best.
struct Row {
    limit: Limit,
    best: Option<(String, Limit)>,
}

impl Row {
    fn as_json(&self) -> Value {
        let p = &PARAMETERS[self.limit.parameter];
        let usual = size(self.limit.parameter);
        let best = self.best.as_ref().map(|(name, l)| json!({"manoeuvre": name, "relative": Real(l.in_sizes())}));
        json!({
            "id": REGISTRY[self.limit.effect].id, "parameter": p.name, "unit": p.unit, "usual": Real(usual), "limit": Real(self.limit.size),
            "relative": Real(self.limit.in_sizes()), "found_if_usual": Real(self.limit.power(usual)), "shown_best_by": best,
        })
    }
}

/// A row for each effect, the one with the largest relative limit first.
fn rows(limits: &[Limit], reach: Option<&Reach>, manoeuvres: &[Manoeuvre]) -> Vec<Row> {
    let row = |l: &Limit| {
        let best = reach.and_then(|r| {
            let k = r.best_for(l.effect, manoeuvres)?;
            Some((manoeuvres[k].name.clone(), *Reach::of(&r.with[k], l.effect)?))
        });
        Row { limit: *l, best }
    };
    let mut all: Vec<Row> = limits.iter().map(row).collect();
    all.sort_by(|a, b| b.limit.in_sizes().total_cmp(&a.limit.in_sizes()).then(a.limit.effect.cmp(&b.limit.effect)));
    all
}

fn table(rows: &[Row], what: &str) -> String {
    let mut text = format!("{:<26} {:<34} {:>10} {:>12} {:>11}  {}\n", "effect", "parameter", "usual", what, "of usual", "shown best by");
    for row in rows {
        let p = &PARAMETERS[row.limit.parameter];
        let named = format!("{} {}", p.name, unit(p.unit));
        let finite = |x: f64, digits: i32| if x < 1e3 * size(row.limit.parameter) { number(x, digits) } else { "–".to_owned() };
        let share = if row.limit.in_sizes() < 1e3 { number(row.limit.in_sizes(), 2) } else { "not shown".to_owned() };
        text += &format!(
            "{:<26} {:<34} {:>10} {:>12} {share:>11}  {}\n",
            REGISTRY[row.limit.effect].id,
            named.trim_end(),
            number(size(row.limit.parameter), 2),
            finite(row.limit.size, 2),
            row.best.as_ref().map_or("", |(name, _)| name)
        );
    }
    text
}

/// Lists the effects that stay hidden.
fn hidden(rows: &[Row]) -> String {
    let names = |least: f64, most: f64| -> Vec<&str> {
        let within = rows.iter().filter(|r| r.limit.in_sizes() > least && r.limit.in_sizes() <= most);
        within.map(|r| REGISTRY[r.limit.effect].id).collect()
    };
    let line = |names: Vec<&str>, said: &str| if names.is_empty() { String::new() } else { format!("\n{said}: {}\n", names.join(", ")) };
    line(names(TOO_LARGE, f64::INFINITY), "Not assessable, for a usual fault would have to be three times as large")
        + &line(names(1.0, TOO_LARGE), "Shown only if larger than usual")
}

fn write(args: &Args, json: &Value) -> Result<(), CommandError> {
    let Some(out) = &args.out else { return Ok(()) };
    write_all(out, &[("plan.json", format!("{json:#}\n").into_bytes()), ("plan.svg", picture::svg(json).into_bytes())])
}
