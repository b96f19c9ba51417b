//! Prepares a campaign for fitting: tracks, noise, tolerances, filters.

use super::clock::CONTROL_INTERVAL_S;
use super::filter::{Disturbances, Filter, filter};
use super::lock_up;
use super::missing;
use super::noise::{self, Noise};
use super::replay;
use super::tolerance::{self, Car, Logger, Tolerances, Wander};
use super::track::Track;
use super::unknown_clutch;
use crate::campaign::Recording;
use crate::gap::infer::belief::EXACT;
use crate::gap::infer::density::Problem;
use crate::gap::progress::Work;
use crate::vehicle::Vehicle;
use rayon::prelude::*;

/// Torque on the car's side that no file declares, due to wind and an uneven road: standard deviation, N·m, and correlation time, s.
const LOAD: Wander = Wander { sigma: 0.15, time_s: 1.0 };

/// Clutch torque beyond its map, since no map is exact: standard deviation as a share of the transmitted torque, and correlation time, s.
pub const CLUTCH: Wander = Wander { sigma: 0.004, time_s: 0.3 };

/// No disturbance.
const NONE: Wander = Wander { sigma: 0.0, time_s: 1.0 };

/// Disturbances of a healthy car: sensor noise as estimated from the recordings, the rest as declared or by default.
pub fn disturbances(tracks: &[Track], tolerances: &Tolerances) -> Disturbances {
    let with = healthy(noise::channels(tracks), noise::of_report(tracks), noise::report_quantum(tracks), tolerances);
    Disturbances { skew: lock_up::skew(tracks, &with, tolerances.skew()), stamps: noise::stamps(tracks), ..with }
}

/// Disturbances of a healthy car with this sensor noise, and a torque report with this noise and this quantisation step, N·m.
pub fn healthy(noise: [Noise; 5], report_noise: f64, quantum: f64, tolerances: &Tolerances) -> Disturbances {
    // The quantisation error of the report lasts as long as the report does not change, so it is added to the slow error.
    let sigma = tolerances.report.sigma.hypot(0.29 * quantum);
    Disturbances {
        noise,
        report_noise,
        report: Wander { sigma, ..tolerances.report },
        load: LOAD,
        clutch: CLUTCH,
        bearing: NONE,
        sensors: [NONE; 2],
        late: [0.0; 2],
        skew: 0.0,
        stamps: 0.0,
    }
}

/// How a car's recordings were logged.
pub fn logger(tracks: &[Track]) -> Logger {
    let mut all: Vec<f64> = tracks.iter().map(Track::speed_interval).collect();
    all.sort_by(f64::total_cmp);
    let interval_s = all.get(all.len() / 2).copied().unwrap_or(CONTROL_INTERVAL_S);
    let loose = tracks.iter().any(|t| t.misses_commands() || t.jitters());
    Logger { interval_s, loose }
}

/// Recordings of a car with these disturbances, ready to be fitted.
pub fn problem(tracks: Vec<Track>, vehicle: &Vehicle, tolerances: &Tolerances, with: &Disturbances) -> Problem {
    let filters: Vec<Filter> = tracks.par_iter().map(|t| filter_of(t, vehicle, with)).collect();
    let (shared, own) = (tolerances.shared.clone(), tolerances.own.clone());
    let car = Car::nominal(vehicle);
    let states = tracks.par_iter().zip(&filters).map(|(t, f)| missing::states(t, f, &car, t.theta_0)).collect();
    let mut problem = Problem { tracks, filters, vehicle: *vehicle, shared, own, states, powers: EXACT, work: Work::default() };
    problem.coarsen();
    problem
}

/// The filter of a recording. Its clutch disturbance is a share of the clutch torque of the nominal car in a corrected replay.
pub fn filter_of(track: &Track, vehicle: &Vehicle, with: &Disturbances) -> Filter {
    let without = filter(track, vehicle, &Disturbances { clutch: NONE, ..*with }, &[]);
    if with.clutch.sigma == 0.0 || track.position_free {
        return without;
    }
    let torque = replay::torques(track, &without, &Car::nominal(vehicle), track.theta_0);
    filter(track, vehicle, with, &torque)
}

/// Tracks and tolerances of recordings.
///
/// # Errors
/// Returns an error if a tolerance is invalid.
pub fn read(recordings: &[&Recording], vehicle_json: &serde_json::Value) -> Result<(Vec<Track>, Tolerances), tolerance::ToleranceError> {
    let mut tracks: Vec<Track> = recordings.iter().map(|r| Track::new(r)).collect();
    let stamps = noise::stamps(&tracks);
    tracks.iter_mut().for_each(|t| t.sampled_loosely(stamps));
    let (white, quantum) = (noise::of_report(&tracks), noise::report_quantum(&tracks));
    tracks.par_iter_mut().for_each(|t| t.set_engine_torque(&noise::without_noise(&t.report_time, &t.reported, white, quantum)));
    let sensors = noise::channels(&tracks);
    unknown_clutch::find(&mut tracks, &sensors);
    let tolerances = tolerance::read(vehicle_json, logger(&tracks))?;
    Ok((tracks, tolerances))
}

/// The bundled campaign, for tests.
#[cfg(test)]
pub struct Example {
    /// The campaign.
    pub campaign: crate::campaign::Campaign,
    /// The car of its vehicle file.
    pub vehicle: Vehicle,
}

#[cfg(test)]
impl Example {
    /// Reads it from tests/data.
    pub fn read() -> Self {
        let campaign = crate::campaign::read(std::path::Path::new("tests/data/campaigns/example"), &Default::default()).unwrap();
        let vehicle = Vehicle::from_value(&campaign.vehicle_json).unwrap();
        Self { campaign, vehicle }
    }

    /// Prepares recordings of its car for fitting, and returns their disturbances as well.
    pub fn problem(&self, recordings: &[&Recording]) -> (Problem, Disturbances) {
        let (tracks, tolerances) = read(recordings, &self.campaign.vehicle_json).unwrap();
        let with = disturbances(&tracks, &tolerances);
        (problem(tracks, &self.vehicle, &tolerances, &with), with)
    }
}
