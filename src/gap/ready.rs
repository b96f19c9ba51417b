//! Prepares a campaign for the fit, leaves out its stale samples, and determines how its inputs are read between their samples, which depends on the interval of the control unit.

use super::diagnosis::DiagnosisError;
use super::held_out::{Split, split};
use super::infer::belief::ACCURACIES;
use super::infer::density::{Problem, misfit};
use super::infer::exchange::exchange;
use super::infer::irregular::{self, Irregular};
use super::infer::search::{Hypothesis, Search};
use super::infer::sensors::{self, TOLD_APART};
use super::model::filter::Disturbances;
use super::model::prepare;
use super::model::stale::{Stale, log_odds_of_fault, log_prior, stale};
use super::model::tolerance::Tolerances;
use super::model::track::{Channel, Track};
use super::progress::Work;
use crate::campaign::{Campaign, Recording};
use crate::effects::Subsystem;
use crate::vehicle::Vehicle;

/// A campaign, ready to be fitted.
pub(super) struct Ready {
    pub(super) split: Split,
    pub(super) problem: Problem,
    pub(super) tolerances: Tolerances,
    pub(super) with: Disturbances,
}

impl Ready {
    /// Prepares another reading of the campaign, or a part of it, which is judged by the same recording.
    pub(super) fn of(&self, campaign: &Campaign, other: &Campaign, vehicle: &Vehicle) -> Result<Self, DiagnosisError> {
        let judge = campaign.recordings[self.split.judge].name.as_str();
        Self::judged_by(Some(judge), other, vehicle, &self.problem.work)
    }

    /// Prepares a campaign, judged by the recording of this name, or by the one that [`split`] chooses.
    pub(super) fn judged_by(judge: Option<&str>, campaign: &Campaign, vehicle: &Vehicle, work: &Work) -> Result<Self, DiagnosisError> {
        let split = split(&campaign.recordings, judge);
        if split.fitted_part.is_empty() {
            return Err(DiagnosisError::TooFew(campaign.recordings.len()));
        }
        Self::prepared(split, campaign, vehicle, work)
    }

    /// Prepares `fitted_part`: the same rows of the campaign's recordings with other values in their channels.
    pub(super) fn with_channels(
        &self,
        fitted_part: Vec<Recording>,
        campaign: &Campaign,
        vehicle: &Vehicle,
    ) -> Result<Self, DiagnosisError> {
        let Split { judge, last_engagement, ref name, .. } = self.split;
        Self::prepared(Split { fitted_part, judge, last_engagement, name: name.clone() }, campaign, vehicle, &self.problem.work)
    }

    fn prepared(split: Split, campaign: &Campaign, vehicle: &Vehicle, work: &Work) -> Result<Self, DiagnosisError> {
        let fitted_part: Vec<&Recording> = split.fitted_part.iter().collect();
        let (tracks, tolerances) = prepare::read(&fitted_part, &campaign.vehicle_json)?;
        let with = prepare::disturbances(&tracks, &tolerances);
        let problem = Problem { work: work.clone(), ..prepare::problem(tracks, vehicle, &tolerances, &with) };
        Ok(Self { split, problem, tolerances, with })
    }
}

/// A campaign without its stale samples, and the search that was done with it.
pub(super) struct WithoutStaleSamples {
    pub(super) campaign: Campaign,
    pub(super) ready: Ready,
    pub(super) found: Search,
    /// Speeds of which samples were left out, each with the probability that the sensor is at fault and not a logger that loses messages.
    pub(super) stale: Vec<Irregular>,
}

/// Searches, and leaves out the samples of a speed that seem to be stale, if the recordings are more likely without them. This is tested twice: first at the car of the file, where
/// the gain must be so large that no explanation is likely to make up for it, and then beside the explanation that suits the recordings best without these samples.
pub(super) fn read_without_stale(
    campaign: &Campaign,
    vehicle: &Vehicle,
    ready: Ready,
    searched: &dyn Fn(&Problem, Option<&Search>) -> Search,
) -> Result<WithoutStaleSamples, DiagnosisError> {
    let (mut campaign, mut ready, mut stale) = (campaign.clone(), ready, Vec::new());
    let (mut found, mut earlier): (Option<Search>, Option<Search>) = (None, None);
    for speed in [Channel::OmegaF, Channel::OmegaC] {
        let Some(standstill) = Standstill::of(&ready, speed) else { continue };
        let without = standstill.left_out_of(&campaign);
        let other = ready.of(&campaign, &without, vehicle)?;
        let nominal = ready.problem.nominal();
        let cost = |r: &Ready| sensors::minus_two_log_likelihood(&r.problem, &nominal, &r.with);
        // The car of the file does not explain anything yet, so that only the gain that would remain at the lowest of the accuracies counts.
        let least =
            irregular::probability(&ready.problem, 0.5 * (cost(&ready) - cost(&other)) + standstill.log_density)[ACCURACIES.len() - 1];
        if least < 0.5 {
            continue;
        }
        let there = searched(&other.problem, found.as_ref());
        let best = there.best();
        let here = Hypothesis::fitted(&ready.problem, best.effects.clone(), &best.fit.point, TOLD_APART, None);
        let gain = sensors::log_likelihood(&other.problem, best) + standstill.log_density - sensors::log_likelihood(&ready.problem, &here);
        let probability = irregular::probability(&ready.problem, gain).iter().sum::<f64>() / ACCURACIES.len() as f64;
        if probability > 0.5 {
            let explained = 0.5 * (misfit(&other.problem.all_residuals(&nominal, None)) - best.fit.misfit()).max(0.0);
            let (what, with) = (standstill.words(&ready.problem.tracks), other.with);
            let probability = probability * standstill.probability_of_fault();
            let share = gain / (gain + explained);
            let gain = other.problem.power() * gain;
            stale.push(Irregular { places: vec![Subsystem::Sensors], what, share, probability, gain, with });
            (campaign, ready, found) = (without, other, Some(there));
        } else {
            earlier = Some(there);
        }
    }
    earlier.iter_mut().for_each(Search::let_go_of_all);
    let found = found.unwrap_or_else(|| searched(&ready.problem, earlier.as_ref()));
    Ok(WithoutStaleSamples { campaign, ready, found, stale })
}

/// Places at which a speed may stand still, i.e. repeat its last value.
struct Standstill {
    speed: Channel,
    white: f64,
    /// Samples that may be stale, by recording of the fit.
    by_recording: Vec<Stale>,
    /// Logarithm of the density of these samples and of the prior probability of the places.
    log_density: f64,
    /// Number of samples of the speed.
    samples: usize,
}

impl Standstill {
    fn of(ready: &Ready, speed: Channel) -> Option<Self> {
        let (tracks, white) = (&ready.problem.tracks, ready.with.noise[speed as usize].white);
        let by_recording: Vec<Stale> = tracks.iter().map(|t| stale(&t.time, &t.measured[speed as usize], white)).collect();
        let times: usize = by_recording.iter().map(Stale::times).sum();
        let samples = tracks.iter().map(|t| t.measured[speed as usize].iter().filter(|v| v.is_finite()).count()).sum();
        let own: f64 = tracks.iter().zip(&by_recording).map(|(t, s)| s.minus_log_density(t, speed, white)).sum();
        (times > 0).then(|| Self { speed, white, by_recording, log_density: log_prior(times, samples) - 0.5 * own, samples })
    }

    /// The campaign without the stale samples. They are looked for in the whole recordings, so that those in the held-out data are left out as well.
    fn left_out_of(&self, campaign: &Campaign) -> Campaign {
        let mut campaign = campaign.clone();
        for r in &mut campaign.recordings {
            let values = if self.speed == Channel::OmegaF { &mut r.omega_f } else { &mut r.omega_c };
            let all = stale(&r.time, values, self.white);
            all.groups.iter().flat_map(|(rows, _)| rows).for_each(|&row| values[row] = f64::NAN);
        }
        campaign
    }

    /// How often the speed stands still, and the number of samples for which it does.
    fn extent(&self) -> [f64; 2] {
        let sum = |of: fn(&Stale) -> usize| self.by_recording.iter().map(of).sum::<usize>() as f64;
        [sum(Stale::times), sum(Stale::samples)]
    }

    /// Probability that the sensor is at fault, which has the prior of a missing law, rather than a logger that loses messages.
    fn probability_of_fault(&self) -> f64 {
        let [times, stale] = self.extent();
        irregular::posterior(log_odds_of_fault(times, self.samples as f64 * times / stale))
    }

    fn words(&self, tracks: &[Track]) -> String {
        let name = if self.speed == Channel::OmegaF { "flywheel" } else { "disc" };
        let [times, stale] = self.extent();
        let interval = tracks.iter().map(Track::speed_interval).fold(f64::INFINITY, f64::min);
        let often = if times == 1.0 { "once, for".to_owned() } else { format!("{times} times, on average for") };
        format!(
            "the {name} speed repeats what it showed before, {often} {:.2} s ({stale} of {} samples)",
            stale * interval / times,
            self.samples
        )
    }
}

/// A campaign with the control unit that suits it, and the search that was done with it.
pub(super) struct Read {
    pub(super) ready: Ready,
    pub(super) found: Search,
    /// Interval at which the control unit computes, s; none if it is the usual one.
    pub(super) control_interval_s: Option<f64>,
}

/// Tries a control unit other than the usual one, with which `ready` was prepared and `found` was searched. Each of the two is judged with the effects that suit it best, which
/// need not be the same.
pub(super) fn read_with_control_unit(
    campaign: &Campaign,
    vehicle: &Vehicle,
    ready: Ready,
    mut found: Search,
    searched: &dyn Fn(&Problem, Option<&Search>) -> Search,
) -> Result<Read, DiagnosisError> {
    if let Some(interval) = sensors::other_control_interval(&ready.problem.tracks) {
        let other = ready.of(campaign, &commanded_every(campaign, interval), vehicle)?;
        if sensors::other_control_unit_is_worth_a_search(&other.problem, &ready.problem, found.best()) {
            let mut there = searched(&other.problem, Some(&found));
            exchange(&ready.problem, &mut found);
            exchange(&other.problem, &mut there);
            if sensors::prefers_other_control_unit((&other.problem, there.best()), (&ready.problem, found.best())) {
                return Ok(Read { ready: other, found: there, control_interval_s: Some(interval) });
            }
        }
    }
    Ok(Read { ready, found, control_interval_s: None })
}

/// The campaign, read as one with a control unit that computes at this interval, s.
pub fn commanded_every(campaign: &Campaign, interval: f64) -> Campaign {
    let mut campaign = campaign.clone();
    campaign.recordings.iter_mut().for_each(|r| r.control_interval_s = Some(interval));
    campaign
}
