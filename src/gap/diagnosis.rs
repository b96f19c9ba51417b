//! The diagnosis of one campaign: where, which, how far, and what stays in doubt.

use super::answer;
use super::decide::{Decision, FIRST_GAIN, STRUCTURED, Unseen, Verdict, decide};
use super::fit::{Fit, fit};
use super::locate::{self, Location};
use super::measure::{self, HeldOut};
use super::nuisance::{self, ToleranceError};
use super::predict::{Follow, HORIZON_S};
use super::problem::{Point, Problem};
use super::screen;
use super::select::{Hypothesis, Search, search};
use super::series::Series;
use crate::campaign::{Campaign, Recording};
use crate::effects::{self, Parameters};
use crate::report::Overlay;
use crate::vehicle::{Vehicle, VehicleError};

/// Why a campaign cannot be diagnosed.
#[derive(Debug, thiserror::Error)]
pub enum DiagnosisError {
    /// The vehicle file.
    #[error("vehicle.json: {0}")]
    Vehicle(#[from] VehicleError),
    /// Its tolerances.
    #[error(transparent)]
    Tolerance(#[from] ToleranceError),
    /// Too little to hold anything out.
    #[error("the campaign has {0} usable recording(s); at least 2 are needed, one of them to judge on what took no part in the fit")]
    TooFew(usize),
}

/// The answer, and what the report shows beside it.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// Content of diagnosis.json.
    pub json: serde_json::Value,
    /// Real, before and after, per recording.
    pub overlays: Vec<Overlay>,
    /// The retuned car.
    pub vehicle: Vehicle,
    /// Its effects.
    pub effects: Parameters,
    /// The car as its file gives it.
    pub nominal: Vehicle,
}

/// What the parts of the answer are made from.
pub(super) struct Findings<'a> {
    pub campaign: &'a Campaign,
    pub problem: &'a Problem,
    pub search: &'a Search,
    pub decision: &'a Decision,
    pub location: &'a Location,
    pub blind_spots: &'a [usize],
    pub held_out: &'a [HeldOut],
    pub unseen: &'a Unseen,
    pub retuned: (&'a Vehicle, &'a Parameters),
}

/// Recordings that take no part in choosing or fitting: of a manoeuvre with at least three recordings, the one whose start temperature is in the
/// middle; without one, the last.
fn hold_out(recordings: &[Recording]) -> usize {
    let siblings = |r: &Recording| recordings.iter().filter(|o| o.manoeuvre == r.manoeuvre).count();
    let most = recordings.iter().map(siblings).max().unwrap_or(0);
    if most < 3 {
        return recordings.len() - 1;
    }
    let mut family: Vec<usize> = (0..recordings.len()).filter(|&k| siblings(&recordings[k]) == most).collect();
    family.sort_by(|&a, &b| recordings[a].theta_c0.total_cmp(&recordings[b].theta_c0).then(a.cmp(&b)));
    family[family.len() / 2]
}

/// Gain in cost around the threshold that is worth a second look at the full rate.
const BORDERLINE: std::ops::Range<f64> = 0.5 * FIRST_GAIN..5.0 * FIRST_GAIN;

/// Diagnoses a campaign. `progress` is told what is being done, with the share of the work done.
///
/// # Errors
/// A vehicle file or tolerances that are not sound; fewer than two recordings.
pub fn diagnose(campaign: &Campaign, progress: &(dyn Fn(&str, f64) + Sync)) -> Result<Diagnosis, DiagnosisError> {
    let vehicle = Vehicle::from_value(&campaign.vehicle_json)?;
    let nuisances = nuisance::read(&campaign.vehicle_json)?;
    if campaign.recordings.len() < 2 {
        return Err(DiagnosisError::TooFew(campaign.recordings.len()));
    }
    let held = hold_out(&campaign.recordings);
    let taught: Vec<&Recording> = campaign.recordings.iter().enumerate().filter(|(k, _)| *k != held).map(|(_, r)| r).collect();
    let of = |recordings: &[&Recording], prepare: fn(&Recording) -> Series| Problem {
        series: recordings.iter().map(|r| prepare(r)).collect(),
        vehicle,
        nuisances: nuisances.clone(),
        follow: Follow::Horizon(HORIZON_S),
    };
    let coarse = of(&taught, Series::coarse);
    let mut search = search(&coarse, &|what, share| progress(what, 0.85 * share));
    progress("decision", 0.85);
    let native = of(&taught, Series::native);
    let fast = native.series.iter().any(|s| s.block > 1);
    if fast {
        look_again(&native, &mut search);
    }
    let decided = decide(&search);
    let problem = if fast { &native } else { &coarse };
    progress("held-out recordings", 0.9);
    let nominal = (vehicle, effects::null());
    let unseen = Unseen::of(&of(&[&campaign.recordings[held]], Series::coarse), &decided.chosen.fit.point);
    let decision = decided.tested(&search, &unseen);
    let point = &decision.chosen.fit.point;
    // Nuisances that a gap of unknown cause has dragged along retune nothing: the car is handed back as it came.
    let retuned = decision.verdict != Verdict::Unexplained;
    let (tuned, effects) = if retuned { coarse.plant_at(point) } else { nominal };
    let held_out = measure::evaluate(&campaign.recordings[held], (&nominal.0, &nominal.1), (&tuned, &effects));
    progress("location", 0.95);
    let location = locate::locate(&coarse, &search, &decision);
    let blind_spots = screen::blind_spots(&coarse, &search.base.fit, FIRST_GAIN);
    let findings = Findings {
        campaign,
        problem,
        search: &search,
        decision: &decision,
        location: &location,
        blind_spots: &blind_spots,
        held_out: &held_out,
        unseen: &unseen,
        retuned: (&tuned, &effects),
    };
    let json = answer::json(&findings);
    let shift = |r: &Recording| taught.iter().position(|t| retuned && t.name == r.name).map_or([0.0; 2], |k| point.theta_shift[k]);
    let overlays = campaign
        .recordings
        .iter()
        .enumerate()
        .map(|(k, r)| measure::overlay(r, k == held, (&vehicle, &effects::null()), (&tuned, &effects), shift(r)))
        .collect();
    progress("done", 1.0);
    Ok(Diagnosis { json, overlays, vehicle: tuned, effects, nominal: vehicle })
}

/// A fast campaign was searched at a lower rate. Where its first or its second effect hangs in the balance, the hypotheses are fitted
/// again at the full rate.
fn look_again(native: &Problem, search: &mut Search) {
    let cost = |h: Option<&Hypothesis>| h.map_or(f64::NAN, |h| h.fit.cost);
    let (single, pair) = (cost(search.singles.first()), cost(search.pairs.first()));
    let least = [search.base.fit.cost, single, pair].into_iter().fold(f64::INFINITY, f64::min);
    let structured = (STRUCTURED..LARGE_STRUCTURE).contains(&(least / search.noise_cost));
    if !structured && !BORDERLINE.contains(&(search.base.fit.cost - single)) && !BORDERLINE.contains(&(single - pair)) {
        return;
    }
    let again = |h: &Hypothesis| Hypothesis { effects: h.effects.clone(), fit: refit(native, &h.effects, &h.fit.point) };
    let best = |all: &[Hypothesis]| {
        let mut again: Vec<Hypothesis> = all.iter().take(LOOKED_AT_AGAIN).map(again).collect();
        again.sort_by(|a, b| a.score().total_cmp(&b.score()));
        again
    };
    search.base = again(&search.base);
    search.singles = best(&search.singles);
    search.pairs = best(&search.pairs);
    search.noise_cost = native.noise_cost();
}

/// Cost per residual above which structure is there at any rate.
const LARGE_STRUCTURE: f64 = 4.0;

/// Hypotheses of each size that are fitted again at the full rate.
const LOOKED_AT_AGAIN: usize = 2;
/// Iterations of a fit that starts near its end.
const REFIT_ITERATIONS: usize = 4;

fn refit(problem: &Problem, effects: &[usize], point: &Point) -> Fit {
    fit(problem, effects, point, REFIT_ITERATIONS, None)
}

/// Name of a verdict in diagnosis.json.
pub fn verdict_id(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::NoGap => "no_gap",
        Verdict::Explained => "explained",
        Verdict::PartlyExplained => "partly_explained",
        Verdict::Unexplained => "unexplained",
    }
}
