//! `kisspoint blind --plan`: the predictions of a plan against the results with drawn cars.
//!
//! 1. **Splits.** A car drives three launches only and is diagnosed. If more than one explanation remains credible, the real car drives the manoeuvre that the plan recommends,
//!    which is added to the campaign; separately, it drives one that is drawn at random. The number of cars whose explanations are then told apart is compared with the sum of
//!    the predicted probabilities.
//! 2. **Limits.** Before a car is recorded, the plan predicts from its vehicle file how large an effect must be to show. That car then drives the planned campaign with the
//!    effect at 0, ½, 1, 2 and 4 times this limit, and is diagnosed. The rate at which a gap is found is compared with the theory.
//!
//! The cars are `realcar`'s, which share no law and no code with the plant that the plan is computed with. They are driven by the plan's own driver, which knows the vehicle
//! file alone.

use super::scores::wilson;
use crate::campaign::{Campaign, Recording};
use crate::cli::error::CommandError;
use crate::cli::output::{print, print_json};
use crate::cli::progress::Progress;
use crate::effects::{PARAMETERS, REGISTRY, find};
use crate::gap::diagnosis::{Diagnosis, diagnose};
use crate::gap::infer::screen::Limit;
use crate::gap::plan::driver::Driver;
use crate::gap::plan::manoeuvre::{Manoeuvre, built_in};
use crate::gap::plan::reach::{Reach, reach};
use crate::gap::plan::rehearse::Logger;
use crate::gap::plan::{Planner, Sensors};
use crate::gap::verdict::{NAMED_BESIDE, Verdict};
use crate::plots::chart::{Panel, Series, render};
use crate::vehicle::Vehicle;
use rayon::prelude::*;
use realcar::effects::Deviation;
use realcar::ordered::{Asked, Order};
use realcar::{Car, Kind, Place, catalogue, draw_car_sized};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Sizes at which effects are drawn, as multiples of the limit of detection.
const SIZES_IN_LIMITS: [f64; 5] = [0.0, 0.5, 1.0, 2.0, 4.0];

/// Manoeuvres of the planned campaign, by name: an everyday campaign.
const CAMPAIGN: [&str; 5] = ["launch", "launch_hot", "creep", "open_rev", "tip_in"];

/// Number of launches after which a car is first diagnosed in the first part.
const LAUNCHES: usize = 3;

/// Ratio of the number of cars in the first part to that in the second, because most cars of the first part are not left open.
const SPLIT_CARS_PER_LIMIT_CAR: usize = 3;

/// Size of the effects in the first part, as a share of the usual size; larger effects leave few cars open.
const SMALL: f64 = 0.3;

/// A car of the first part whose cause was left open, and what became of it.
struct Split {
    effect: &'static str,
    rivals: Vec<(Vec<usize>, f64)>,
    /// Trials with the recommended manoeuvre and with one drawn at random.
    tried: [Trial; 2],
}

/// One manoeuvre that was driven.
struct Trial {
    name: String,
    nats: f64,
    predicted: f64,
    told: bool,
    /// Whether the most probable rival that remains is the truth.
    right: bool,
}

/// One effect at one size.
struct Found {
    effect: &'static str,
    times: f64,
    predicted: f64,
    found: bool,
    named: bool,
}

/// Options of `kisspoint blind --plan`.
pub struct Options<'a> {
    /// Number of cars in the second part; the first part draws three times as many.
    pub cars: usize,
    /// Seed.
    pub seed: u64,
    /// Print JSON.
    pub json: bool,
    /// File for the curve.
    pub curve: Option<&'a PathBuf>,
}

/// Runs both parts.
///
/// # Errors
/// A curve that cannot be written.
pub fn run(o: &Options, pool: &rayon::ThreadPool) -> Result<(), CommandError> {
    let bar = Progress::new();
    let done = AtomicUsize::new(0);
    let all = (1 + SPLIT_CARS_PER_LIMIT_CAR) * o.cars;
    let tell = |what: &str| {
        let count = 1 + done.fetch_add(1, Ordering::Relaxed);
        bar.tell(&format!("{what}, {count} of {all}"), count as f64 / all as f64);
    };
    let one_told = |k: usize| {
        let told = test_split(o.seed, k);
        tell("telling apart");
        told
    };
    let one_limit = |k: usize| {
        let found = limits(o.seed, k);
        tell("limits");
        found
    };
    let (told, found): (Vec<Option<Split>>, Vec<Vec<Found>>) = pool.install(|| {
        (
            (0..SPLIT_CARS_PER_LIMIT_CAR * o.cars).into_par_iter().map(one_told).collect(),
            (0..o.cars).into_par_iter().map(one_limit).collect(),
        )
    });
    bar.finish();
    let told: Vec<Split> = told.into_iter().flatten().collect();
    let found: Vec<Found> = found.into_iter().flatten().collect();
    if let Some(path) = o.curve {
        crate::cli::files::write_new(path, &curve(&found), true)?;
    }
    if o.json {
        return print_json(&as_json(o, &told, &found));
    }
    print(&as_text(o, &told, &found))
}

/// The library effect of car `k`: a permutation of the effects given by the seed, repeated cyclically.
fn turn(seed: u64, k: usize) -> &'static str {
    let mut all = catalogue::drawn(Place::Bench);
    let mut dice = Dice(seed);
    for i in (1..all.len()).rev() {
        all.swap(i, dice.below(i + 1));
    }
    all[k % all.len()].0
}

/// A campaign of this car in memory, without files.
fn campaign(car: &Car, recordings: Vec<Recording>) -> Campaign {
    let vehicle_json = serde_json::from_str(&car.campaign.vehicle_json).expect("the generator writes JSON");
    Campaign {
        dir: PathBuf::new(),
        vehicle_path: PathBuf::new(),
        vehicle_json,
        recordings,
        left_out: Vec::new(),
        notes: Vec::new(),
        fingerprint: String::new(),
    }
}

/// A recording of the generator in the form in which the reader would return it.
fn taken_over(r: &realcar::Recording, name: &str, manoeuvre: &str) -> Recording {
    Recording {
        name: name.to_owned(),
        manoeuvre: manoeuvre.to_owned(),
        sample_rate_hz: r.sample_rate_hz,
        time: r.time_s.clone(),
        theta_c0: r.theta_c0_deg_c,
        theta_b0: r.theta_b0_deg_c,
        theta_0_sigma: [1.0; 2],
        slip_angle_0: 0.0,
        omega_f: r.omega_f_rad_s.clone(),
        omega_c: r.omega_c_rad_s.clone(),
        t_e: r.t_e_nm.clone(),
        x_to_cmd: r.x_to_cmd_mm.clone(),
        theta_h: r.theta_h_deg_c.clone(),
        x_to: r.bench.as_ref().map(|b| b.x_to_mm.clone()),
        t_fc: r.bench.as_ref().map(|b| b.t_fc_nm.clone()),
        theta_c: r.bench.as_ref().map(|b| b.theta_c_deg_c.clone()),
        brake: r.brake.clone(),
        control_interval_s: None,
        input_rows: [None, None],
    }
}

/// Drives a manoeuvre with the real car.
fn driven(car: &Car, what: &Manoeuvre, vehicle: &Vehicle, rate_hz: f64, bench: bool, number: u64, seen: &mut Deviation) -> Recording {
    let mut driver = Driver::new(what, vehicle, 1.0 / rate_hz);
    let order = Order { rate_hz, length_s: what.seconds, theta_deg_c: [what.theta_c, what.theta_b], omega_rad_s: driver.start(), bench };
    let recorded = car.real.record(&order, number, seen, |t, f, c| {
        let command = driver.command(t, f, c);
        Asked { torque_nm: command.t_e, position_mm: command.x_to, brake: command.brake }
    });
    taken_over(&recorded, &format!("p{number:02}"), &what.name)
}

fn vehicle_of(car: &Car) -> Vehicle {
    Vehicle::from_json(&car.campaign.vehicle_json).expect("the generator's vehicles are sound")
}

/// Probability of each rival in an answer, relative to the sum over all rivals; `None` if none of the rivals remains.
fn shares(d: &Diagnosis, rivals: &[(Vec<usize>, f64)]) -> Option<Vec<f64>> {
    let of = |set: &[usize]| -> f64 {
        let same = |w: &&crate::gap::answer::Weighed| {
            let mut ids: Vec<usize> = w.effects.iter().filter_map(|id| find(id)).collect();
            ids.sort_unstable();
            ids == set
        };
        d.answer.which.explanations.iter().filter(same).map(|w| w.probability.0).sum()
    };
    let all: Vec<f64> = rivals.iter().map(|(set, _)| of(set)).collect();
    let sum: f64 = all.iter().sum();
    (sum > 0.0).then(|| all.iter().map(|p| p / sum).collect())
}

fn test_split(seed: u64, k: usize) -> Option<Split> {
    let effect = turn(seed, k);
    let car = draw_car_sized(Place::Bench, seed, k, Kind::Single(effect), SMALL);
    let vehicle = vehicle_of(&car);
    let first = &car.campaign.recordings[0];
    let (rate, bench) = (first.sample_rate_hz, first.bench.is_some());
    let begun: Vec<Recording> = (0..LAUNCHES).map(|i| taken_over(&car.campaign.recordings[i], &format!("r{i:02}"), "launch")).collect();
    let before = diagnose(&campaign(&car, begun.clone()), &|_, _| {}).ok()?;
    let outlook = &before.outlook;
    let ranked = outlook.ranked_for_all();
    let best = ranked.first()?;
    let mut dice = Dice(seed ^ (k as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let random = &ranked[dice.below(ranked.len())];
    let rivals: Vec<(Vec<usize>, f64)> = outlook.rivals.iter().map(|r| (r.effects.clone(), r.probability)).collect();
    let truth = vec![find(effect)?];
    let trial = |w: &crate::gap::plan::Worth, number: u64| {
        let what = &outlook.manoeuvres[w.manoeuvre];
        let mut recordings = begun.clone();
        recordings.push(driven(&car, what, &vehicle, rate, bench, number, &mut Deviation::default()));
        let after = diagnose(&campaign(&car, recordings), &|_, _| {}).ok()?;
        let left = shares(&after, &rivals);
        // If all rivals have vanished, they count as told apart, by the explanation that replaced them.
        let (told, right) = left.map_or((true, false), |left| {
            let most = (0..left.len()).max_by(|a, b| left[*a].total_cmp(&left[*b])).unwrap_or(0);
            let beside = |j: usize| left[j] / (left[j] + left[most]);
            ((0..left.len()).all(|j| j == most || beside(j) < NAMED_BESIDE), rivals[most].0 == truth)
        });
        Some(Trial { name: what.name.clone(), nats: w.nats, predicted: w.splits, told, right })
    };
    Some(Split { effect, tried: [trial(best, 50)?, trial(random, 51)?], rivals })
}

/// A pseudo-random generator for choices, splitmix64.
struct Dice(u64);

impl Dice {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % n as u64) as usize
    }
}

/// Drives the planned campaign. Returns its recordings, and the parameters that the effect had in the library's terms.
fn drive_all(car: &Car, plan: &[Manoeuvre], vehicle: &Vehicle, effect: &str) -> (Vec<Recording>, Vec<(&'static str, f64)>) {
    let mut seen = Deviation::default();
    let subsystem = catalogue::find(effect).map_or("", |e| e.1);
    let all = plan.iter().enumerate().map(|(k, m)| driven(car, m, vehicle, 100.0, false, k as u64, &mut seen)).collect();
    let told = seen.seen().into_iter().find(|(s, _)| *s == subsystem).map_or_else(Vec::new, |(_, seen)| seen.parameters());
    (all, told)
}

fn limits(seed: u64, k: usize) -> Vec<Found> {
    let effect = turn(seed, k);
    let Some(place) = find(effect) else { return Vec::new() };
    let car_of = |size: f64| draw_car_sized(Place::Bench, seed, k, Kind::Single(effect), size);
    let healthy = car_of(0.0);
    let vehicle = vehicle_of(&healthy);
    let plan: Vec<Manoeuvre> = built_in(&vehicle).into_iter().filter(|m| CAMPAIGN.contains(&m.name.as_str())).collect();
    let document: Value = serde_json::from_str(&healthy.campaign.vehicle_json).expect("the generator writes JSON");
    let noise = healthy.real.noise();
    let sensors = Sensors { speed: healthy.real.noise_rad_s(), torque: noise.torque, ..Sensors::default() };
    let logger = Logger { rate_hz: 100.0, bench: [false; 3], theta_0_sigma: [1.0; 2] };
    let Ok(planner) = Planner::before(&vehicle, &document, sensors, logger, plan.clone()) else { return Vec::new() };
    let Some(predicted) = reach(&planner, None, &planner.nominal()) else { return Vec::new() };
    let Some(limit) = Reach::of(&predicted.with_all, place).filter(|l| l.size.is_finite()) else { return Vec::new() };
    // One more launch is driven, to serve as the held-out recording.
    let mut driven_plan = plan;
    driven_plan.extend(driven_plan.iter().find(|m| m.name == "launch").cloned().map(|m| Manoeuvre { name: "again".to_owned(), ..m }));
    SIZES_IN_LIMITS.iter().filter_map(|&times| one_size(&car_of, &driven_plan, &vehicle, effect, limit, times)).collect()
}

/// An effect at `times` its limit, diagnosed; `None` if the generator cannot express the size of its effect in the library's terms, or cannot reach the wanted size.
fn one_size(
    car_of: &dyn Fn(f64) -> Car,
    plan: &[Manoeuvre],
    vehicle: &Vehicle,
    effect: &'static str,
    limit: &Limit,
    times: f64,
) -> Option<Found> {
    let p = &PARAMETERS[limit.parameter];
    let departure = |told: &[(&'static str, f64)]| told.iter().find(|(name, _)| *name == p.name).map(|(_, v)| (v - p.null).abs());
    let target = times * limit.size;
    let mut size = 1.0;
    let mut recordings = Vec::new();
    let mut reached = 0.0;
    if times == 0.0 {
        recordings = drive_all(&car_of(0.0), plan, vehicle, effect).0;
    } else {
        // The generator measures sizes differently from the library, so the size is scaled proportionally over up to three drives, until it is within 2 % of the wanted one.
        for attempt in 0..3 {
            if attempt > 0 {
                size *= target / reached;
            }
            let (all, told) = drive_all(&car_of(size), plan, vehicle, effect);
            reached = departure(&told).filter(|d| *d > 0.0)?;
            recordings = all;
            if (reached / target - 1.0).abs() < 0.02 {
                break;
            }
        }
        if !(0.8..1.25).contains(&(reached / target)) {
            return None;
        }
    }
    let car = car_of(size);
    let d = diagnose(&campaign(&car, recordings), &|_, _| {}).ok()?;
    let found = d.answer.verdict != Verdict::NoGap;
    let named = d.answer.which.effects.iter().any(|e| e.id == effect || e.ambiguous_with.contains(&effect));
    Some(Found { effect, times, predicted: if times == 0.0 { 0.0 } else { limit.power(reached) }, found, named })
}

/// Number of gaps found, number of effects named, number of cars, and predicted number of gaps found, for one size.
fn by_size(found: &[Found], times: f64) -> (usize, usize, usize, f64) {
    let those = || found.iter().filter(|f| f.times == times);
    (those().filter(|f| f.found).count(), those().filter(|f| f.named).count(), those().count(), those().map(|f| f.predicted).sum())
}

fn share(hits: usize, count: usize) -> String {
    let [low, high] = wilson(hits as f64, count.max(1));
    format!("{hits:>3} of {count:<3} {:>5.1} % ({:.0} to {:.0} %)", 100.0 * hits as f64 / count.max(1) as f64, 100.0 * low, 100.0 * high)
}

fn as_text(o: &Options, told: &[Split], found: &[Found]) -> String {
    let mut text = format!(
        "{} cars with one small effect each, seed {}, generator {}: {LAUNCHES} launches leave {} of them open.\n",
        SPLIT_CARS_PER_LIMIT_CAR * o.cars,
        o.seed,
        realcar::VERSION,
        told.len()
    );
    for (which, name) in ["recommended", "at random"].into_iter().enumerate() {
        let trials: Vec<&Trial> = told.iter().map(|t| &t.tried[which]).collect();
        let split = trials.iter().filter(|t| t.told).count();
        let right = trials.iter().filter(|t| t.told && t.right).count();
        let predicted: f64 = trials.iter().map(|t| t.predicted).fold(0.0, |a, b| a + b);
        text += &format!(
            "  manoeuvre {name:<12} told apart {}, predicted {predicted:.1}; the truth is what is left in {right}\n",
            share(split, trials.len())
        );
    }
    for t in told {
        let rivals: Vec<String> = t.rivals.iter().map(|(set, p)| format!("{} {:.0} %", set_name(set), 100.0 * p)).collect();
        let one =
            |t: &Trial| format!("{} {:.1} nats, {:.0} %: {}", t.name, t.nats, 100.0 * t.predicted, if t.told { "told" } else { "open" });
        text += &format!("    {} ({}): {}; {}\n", t.effect, rivals.join(", "), one(&t.tried[0]), one(&t.tried[1]));
    }
    text += &format!("\nEffects at multiples of the limit that was planned from the vehicle file ({} manoeuvres):\n", CAMPAIGN.len());
    text += &format!("{:>8}  {:<34} {:<34} {:>10}\n", "limits", "gap found", "effect named", "theory");
    for times in SIZES_IN_LIMITS {
        let (hits, named, count, predicted) = by_size(found, times);
        let theory = if times == 0.0 { "–".to_owned() } else { format!("{:.1} %", 100.0 * predicted / count.max(1) as f64) };
        text += &format!("{times:>8}  {:<34} {:<34} {theory:>10}\n", share(hits, count), share(named, count));
    }
    let missed: Vec<String> = found
        .iter()
        .filter(|f| f.times > 0.0 && (f64::from(u8::from(f.found)) - f.predicted).abs() > 0.5)
        .map(|f| {
            format!("{} at {} ({}, theory {:.0} %)", f.effect, f.times, if f.found { "found" } else { "not found" }, 100.0 * f.predicted)
        })
        .collect();
    if missed.is_empty() { text } else { text + &format!("against the theory: {}\n", missed.join("; ")) }
}

fn set_name(set: &[usize]) -> String {
    if set.is_empty() { "none".to_owned() } else { set.iter().map(|&e| REGISTRY[e].id).collect::<Vec<_>>().join("+") }
}

fn as_json(o: &Options, told: &[Split], found: &[Found]) -> Value {
    let trial = |t: &Trial| json!({"manoeuvre": t.name, "nats": t.nats, "predicted": t.predicted, "told_apart": t.told, "right": t.right});
    let open: Vec<Value> = told
        .iter()
        .map(|t| {
            let rivals: Vec<Value> = t
                .rivals
                .iter()
                .map(|(set, p)| json!({"effects": set.iter().map(|&e| REGISTRY[e].id).collect::<Vec<_>>(), "probability": p}))
                .collect();
            json!({"effect": t.effect, "rivals": rivals, "recommended": trial(&t.tried[0]), "random": trial(&t.tried[1])})
        })
        .collect();
    let sizes: Vec<Value> = SIZES_IN_LIMITS
        .iter()
        .map(|&times| {
            let (hits, named, count, predicted) = by_size(found, times);
            json!({"limits": times, "found": hits, "named": named, "count": count, "predicted": predicted,
                "interval": wilson(hits as f64, count.max(1))})
        })
        .collect();
    let each: Vec<Value> = found
        .iter()
        .map(|f| json!({"effect": f.effect, "limits": f.times, "predicted": f.predicted, "found": f.found, "named": f.named}))
        .collect();
    json!({"seed": o.seed, "cars": o.cars, "generator": realcar::VERSION, "open": open, "detection": sizes, "outcomes": each})
}

/// Plot of the share found over the size in limits: drawn cars with their intervals, and the theory.
fn curve(found: &[Found]) -> String {
    let of = |get: &dyn Fn(f64) -> f64| SIZES_IN_LIMITS.iter().map(|&t| (t, 100.0 * get(t))).collect::<Vec<_>>();
    let rate = |t: f64| by_size(found, t);
    let bound = |side: usize| move |t: f64| wilson(rate_of(found, t).0, rate_of(found, t).1)[side];
    let series = |name: &str, points, dashed| Series { name: name.to_owned(), points, dashed };
    let panel = Panel {
        x_label: "size in planned limits".to_owned(),
        y_label: "gap found, %".to_owned(),
        series: vec![
            series("drawn cars", of(&|t| rate(t).0 as f64 / rate(t).2.max(1) as f64), false),
            series("theory", of(&|t| rate(t).3 / rate(t).2.max(1) as f64), true),
            series("95 % interval, low", of(&bound(0)), true),
            series("95 % interval, high", of(&bound(1)), true),
        ],
    };
    render("Effects of drawn cars at multiples of the planned limit", &[panel])
}

fn rate_of(found: &[Found], times: f64) -> (f64, usize) {
    let (hits, _, count, _) = by_size(found, times);
    (hits as f64, count.max(1))
}
