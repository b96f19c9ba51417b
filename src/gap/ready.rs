//! A campaign, ready to be fitted; and how its inputs are read between their samples, which depends on how often the control unit computes.

use super::diagnosis::DiagnosisError;
use super::held_out::{Split, split};
use super::infer::density::Problem;
use super::infer::exchange::exchange;
use super::infer::search::Search;
use super::infer::sensors;
use super::model::filter::Disturbances;
use super::model::prepare;
use super::model::tolerance::Tolerances;
use super::progress::Work;
use crate::campaign::{Campaign, Recording};
use crate::vehicle::Vehicle;

/// A campaign, ready to be fitted.
pub(super) struct Ready {
    pub(super) split: Split,
    pub(super) problem: Problem,
    pub(super) tolerances: Tolerances,
    pub(super) with: Disturbances,
}

impl Ready {
    pub(super) fn new(campaign: &Campaign, vehicle: &Vehicle, work: &Work) -> Result<Self, DiagnosisError> {
        let split = split(&campaign.recordings);
        if split.taught.is_empty() {
            return Err(DiagnosisError::TooFew(campaign.recordings.len()));
        }
        let taught: Vec<&Recording> = split.taught.iter().collect();
        let (tracks, tolerances) = prepare::read(&taught, &campaign.vehicle_json)?;
        let with = prepare::disturbances(&tracks, &tolerances);
        let problem = Problem { work: work.clone(), ..prepare::problem(tracks, vehicle, &tolerances, &with) };
        Ok(Self { split, problem, tolerances, with })
    }
}

/// A campaign with the control unit that suits it, and what was found with that.
pub(super) struct Read {
    pub(super) ready: Ready,
    pub(super) found: Search,
    /// Interval at which the control unit computes, s; none if it is the usual one.
    pub(super) control_interval_s: Option<f64>,
}

/// Tries another control unit than the usual one, with which `ready` was `found`: each with the effects that suit it best, which need not be the same.
pub(super) fn read_with_control_unit(
    campaign: &Campaign,
    vehicle: &Vehicle,
    ready: Ready,
    mut found: Search,
    searched: &dyn Fn(&Problem, Option<&Search>) -> Search,
) -> Result<Read, DiagnosisError> {
    if let Some(interval) = sensors::other_control_interval(&ready.problem.tracks) {
        let other = Ready::new(&commanded_every(campaign, interval), vehicle, &ready.problem.work)?;
        if sensors::worth_another(&other.problem, &ready.problem, found.best()) {
            let mut there = searched(&other.problem, Some(&found));
            exchange(&ready.problem, &mut found);
            exchange(&other.problem, &mut there);
            if sensors::rather_other((&other.problem, there.best()), (&ready.problem, found.best())) {
                return Ok(Read { ready: other, found: there, control_interval_s: Some(interval) });
            }
        }
    }
    Ok(Read { ready, found, control_interval_s: None })
}

/// The same campaign from a control unit that computes at this interval, s.
pub fn commanded_every(campaign: &Campaign, interval: f64) -> Campaign {
    let mut campaign = campaign.clone();
    campaign.recordings.iter_mut().for_each(|r| r.control_interval_s = Some(interval));
    campaign
}

/// Says that a control unit of this interval in s is not the usual one.
pub(super) fn control_note(interval: f64) -> &'static str {
    if interval.is_infinite() {
        "the commands seem to change only as often as they are logged: inputs are taken as held from sample to sample, which these data make likelier than a logger that misses some"
    } else {
        "the commands seem to change more often than they are logged: inputs are taken to go straight from sample to sample, which these data make likelier than commands that are held. Feed the retuned plant likewise. Play in the actuator can look the same; a log as fast as the control unit would tell"
    }
}
