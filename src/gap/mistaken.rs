//! Whether the channels of the recordings are mapped wrongly: the speeds exchanged, a torque or a position that counts the other way, or a disc speed that is another shaft's.
//!
//! Each mistake is a further explanation: another reading of the channels, with the prior of a missing law. Its likelihood is that of the same samples, so that it can be compared
//! with the best explanation of the recordings as they are mapped, with both likelihoods raised to the same powers. Only a reading under which the car of the file follows the
//! recordings better is searched.

use super::diagnosis::DiagnosisError;
use super::infer::belief::{ByAccuracy, overall};
use super::infer::density::{PHASES, Problem, size};
use super::infer::search::Search;
use super::infer::weigh::log_sum;
use super::infer::{irregular, sensors};
use super::prose::three_digits;
use super::ready::Ready;
use super::verdict::BEYOND_A_CAR;
use crate::campaign::{Campaign, Recording};
use crate::effects::{PARAMETERS, param};
use crate::vehicle::Vehicle;

/// A mistake in the channel map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mistake {
    /// The speeds of flywheel and disc are exchanged.
    Speeds,
    /// The engine torque has the other sign.
    Torque,
    /// The position counts the other way: it increases where it should decrease.
    Position,
    /// The disc speed is the speed of another shaft, on which the disc turns by this ratio faster.
    Shaft(f64),
}

/// A mistake that explains the recordings, and its probability.
#[derive(Clone, Copy, Debug)]
pub struct Mistaken {
    /// The mistake.
    pub mistake: Mistake,
    /// Probability of the mistake, where every reading is represented by its best explanation.
    pub probability: f64,
}

impl Mistake {
    /// The mistakes that these recordings may contain.
    fn possible(recordings: &[Recording]) -> Vec<Self> {
        [Self::Speeds, Self::Torque, Self::Position].into_iter().chain(ratio(recordings).map(Self::Shaft)).collect()
    }

    /// The change of the channels that undoes the mistake, in words.
    pub fn words(self) -> String {
        match self {
            Self::Speeds => "with flywheel and disc speed exchanged".to_owned(),
            Self::Torque => "with the opposite sign of the engine torque".to_owned(),
            Self::Position => "with a position that counts the other way".to_owned(),
            Self::Shaft(ratio) => format!("with a disc speed {} times as high", three_digits(ratio)),
        }
    }

    /// What to do about the mistake.
    pub fn remedy(self) -> &'static str {
        match self {
            Self::Shaft(_) => {
                "Check the channel map: omega_c_rad_s is the speed of the disc on the gearbox input; the speed of another shaft, or of a wheel, needs its ratio."
            }
            _ => "Check the channel map.",
        }
    }

    /// The recordings with the mistake undone; none if they do not have the channel. A position is mirrored within the range of its command.
    fn with_mistake_undone(self, recordings: &[Recording]) -> Option<Vec<Recording>> {
        let mut all = recordings.to_vec();
        match self {
            Self::Speeds => all.iter_mut().for_each(|r| std::mem::swap(&mut r.omega_f, &mut r.omega_c)),
            Self::Torque => all.iter_mut().flat_map(|r| &mut r.t_e).for_each(|t| *t = -*t),
            Self::Position => {
                let range = |(least, most): (f64, f64), x: &f64| (least.min(*x), most.max(*x));
                let (least, most) = all.iter().flat_map(|r| &r.x_to_cmd).fold((f64::INFINITY, f64::NEG_INFINITY), range);
                if least > most {
                    return None;
                }
                let turn =
                    |r: &mut Recording| r.x_to_cmd.iter_mut().chain(r.x_to.iter_mut().flatten()).for_each(|x| *x = least + most - *x);
                all.iter_mut().for_each(turn);
            }
            Self::Shaft(ratio) => all.iter_mut().flat_map(|r| &mut r.omega_c).for_each(|w| *w *= ratio),
        }
        Some(all)
    }
}

/// Flywheel speed above which the engine runs, rad/s.
const RUNNING: f64 = 40.0;
/// Relative width of the ratios that count as one: a locked driveline rings by less.
const ONE_RATIO: f64 = 0.02;

/// Ratio of flywheel to disc speed that the recordings hold for longest, as a locked clutch does; none if the disc speed would be off by no more than a sensor may be, which is an
/// effect's to explain.
fn ratio(recordings: &[Recording]) -> Option<f64> {
    let top = recordings.iter().flat_map(|r| &r.omega_c).copied().fold(0.0, f64::max);
    let mut ratios: Vec<f64> = Vec::new();
    for r in recordings {
        // Channels with their own clocks have no sample in the rows of the others.
        let mut latest = [f64::NAN; 2];
        for (f, c) in r.omega_f.iter().zip(&r.omega_c) {
            [(f, 0), (c, 1)].into_iter().filter(|(w, _)| w.is_finite()).for_each(|(w, k)| latest[k] = *w);
            let [f, c] = latest;
            if f > RUNNING && c > 0.1 * top {
                ratios.push(f / c);
            }
        }
    }
    ratios.sort_by(f64::total_cmp);
    let held = |first: usize| first..ratios.partition_point(|r| *r <= (1.0 + ONE_RATIO) * ratios[first]);
    let longest = (0..ratios.len()).map(held).max_by_key(ExactSizeIterator::len)?;
    let ratio = ratios[longest.start.midpoint(longest.end)];
    let gain = param::clutch_speed_gain::gain;
    ((1.0 / ratio - PARAMETERS[gain].null).abs() > BEYOND_A_CAR * size(gain)).then_some(ratio)
}

/// The mistake that is more probable than not, if there is one. A mistake is considered if the recordings with it undone are more likely at the car of the file (with a probability
/// of at least one half); it is then represented by the best explanation that a search finds. `found` is the search for the recordings as they are mapped.
///
/// # Errors
/// [`DiagnosisError`] if the campaign with a mistake undone cannot be prepared for the fit, although the campaign itself could.
pub(super) fn mistaken(
    campaign: &Campaign,
    vehicle: &Vehicle,
    ready: &Ready,
    found: &Search,
    searched: &dyn Fn(&Problem, Option<&Search>) -> Search,
) -> Result<Option<Mistaken>, DiagnosisError> {
    let powers = ready.problem.powers;
    let nominal = |r: &Ready| -0.5 * sensors::minus_two_log_likelihood(&r.problem, &r.problem.nominal(), &r.with);
    let (as_mapped, explained) = (nominal(ready), believed(&ready.problem, found));
    let mut read: Vec<(Mistake, ByAccuracy<f64>)> = Vec::new();
    for mistake in Mistake::possible(&ready.split.fitted_part) {
        let Some(with_mistake_undone) = mistake.with_mistake_undone(&ready.split.fitted_part) else { continue };
        let mut other = ready.with_channels(with_mistake_undone, campaign, vehicle)?;
        if mean(irregular::probability(&ready.problem, nominal(&other) - as_mapped)) < 0.5 {
            continue;
        }
        // Both readings are of the same samples, so that their likelihoods are raised to the same powers: to the overall ones, since a phase of one reading is another in the other.
        other.problem.powers = powers.map(|power| [overall(power); PHASES]);
        read.push((mistake, believed(&other.problem, &searched(&other.problem, None))));
    }
    let probability = |mistake: Mistake, of: &ByAccuracy<f64>| {
        let others = |a: usize| log_sum(&read.iter().filter(|r| r.0 != mistake).map(|r| r.1[a]).chain([explained[a]]).collect::<Vec<_>>());
        mean(std::array::from_fn(|a| irregular::posterior(of[a] - others(a))))
    };
    let mut all = read.iter().map(|(mistake, of)| Mistaken { mistake: *mistake, probability: probability(*mistake, of) });
    Ok(all.find(|m| m.probability > 0.5))
}

fn mean(of: ByAccuracy<f64>) -> f64 {
    of.iter().sum::<f64>() / of.len() as f64
}

/// Log posterior of the best explanation that was found, for each accuracy that it may have, including the determinant of the innovation covariance, which differs between
/// readings.
fn believed(problem: &Problem, found: &Search) -> ByAccuracy<f64> {
    let scale: f64 = 0.5 * problem.filters.iter().map(|f| f.log_det).sum::<f64>();
    let best = |a: usize| found.hypotheses.iter().map(|h| h.by_accuracy[a]).fold(f64::NEG_INFINITY, f64::max);
    std::array::from_fn(|a| best(a) - overall(problem.powers[a]) * scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gap::infer::search::Hypothesis;
    use crate::gap::model::prepare::Example;
    use crate::gap::progress::Work;

    /// Each mistake is recognised in recordings that contain it, and none in recordings without one. Here, a search fits only the car of the file.
    #[test]
    fn each_mistake_is_known_by_the_car_that_fits_without_it() {
        let example = Example::read();
        let alone = |problem: &Problem, _: Option<&Search>| {
            Search::made_up(vec![Hypothesis::fitted(problem, Vec::new(), &problem.nominal(), 2, None)])
        };
        let of = |recordings: Vec<Recording>| {
            let campaign = Campaign { recordings, ..example.campaign.clone() };
            let ready = Ready::judged_by(None, &campaign, &example.vehicle, &Work::default()).unwrap();
            mistaken(&campaign, &example.vehicle, &ready, &alone(&ready.problem, None), &alone).unwrap()
        };
        let right = &example.campaign.recordings;
        assert!(of(right.clone()).is_none());
        let made = [Mistake::Speeds, Mistake::Torque, Mistake::Position, Mistake::Shaft(0.28), Mistake::Shaft(2.5)];
        for mistake in made {
            let found = of(mistake.with_mistake_undone(right).unwrap()).unwrap_or_else(|| panic!("{mistake:?} is not known"));
            let same = match (mistake, found.mistake) {
                (Mistake::Shaft(made), Mistake::Shaft(ratio)) => (made * ratio - 1.0).abs() < 0.01,
                (made, found) => made == found,
            };
            assert!(same && found.probability > 0.9, "{mistake:?}: {found:?}");
        }
    }
}
