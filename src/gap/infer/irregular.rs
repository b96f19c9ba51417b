//! Irregular disturbances, which come and go too fast for a law, as a hypothesis beside all explanations.
//!
//! The best explanation may still leave more than noise: misfires, a tone wheel that wobbles, an actuator that wanders. The hypothesis is a disturbance in one place, a first-order
//! Gauss–Markov process of unknown size and correlation time in the filter. The likelihood of the innovations, Σ ρ(e) + ln det S, tells where it acts, how large it is and how long
//! it lasts. Under the filter that contains it, effects count for what they explain beyond it.

use super::belief::{ByAccuracy, overall};
use super::density::{PHASES, Point, Problem, Residuals, misfit};
use super::sensors::minus_two_log_likelihood;
use super::unknown::PLACE_PRIOR;
use crate::effects::Subsystem;
use crate::gap::model::filter::Disturbances;
use crate::gap::model::tolerance::Wander;

/// An irregular disturbance that the recordings support.
#[derive(Clone, Debug)]
pub struct Irregular {
    /// Subsystems in which it may arise, the most likely first.
    pub places: Vec<Subsystem>,
    /// Description in words, with its size.
    pub what: String,
    /// Share of the disturbance in what explanation and disturbance together gain over the car as its file gives it, both in nats.
    pub share: f64,
    /// Probability that the disturbance is present, given the explanation.
    pub probability: f64,
    /// Gain in log likelihood, nats, scaled by [`Problem::power`], the power of the likelihood in the search.
    pub gain: f64,
    /// All disturbances of the filter, including this one.
    pub with: Disturbances,
}

/// Where a disturbance acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum At {
    Engine,
    Bearing,
    Clutch,
    Driveline,
    Flywheel,
    Disc,
}

const ALL: [At; 6] = [At::Engine, At::Bearing, At::Clutch, At::Driveline, At::Flywheel, At::Disc];

/// Sizes that are tried, all equally likely: torques in N·m, bearing positions in mm, clutch torques as a share of the transmitted torque, speeds in multiples of their white
/// noise.
const TORQUES_NM: [f64; 3] = [3.0, 10.0, 30.0];
const POSITIONS_MM: [f64; 3] = [0.02, 0.06, 0.2];
const SHARES: [f64; 3] = [0.02, 0.05, 0.15];
const SPEEDS: [f64; 3] = [2.0, 5.0, 15.0];
/// Correlation times that are tried, s; an error that lasts longer is a law of time.
const MEMORIES_S: [f64; 3] = [0.02, 0.1, 0.5];

/// Distance in nats behind the most likely place within which another one is not ruled out.
const NEARLY_NATS: f64 = 3.0;

impl At {
    fn sizes(self) -> [f64; 3] {
        match self {
            Self::Engine | Self::Driveline => TORQUES_NM,
            Self::Bearing => POSITIONS_MM,
            Self::Clutch => SHARES,
            Self::Flywheel | Self::Disc => SPEEDS,
        }
    }

    fn added(self, size: f64, time_s: f64, to: &Disturbances) -> Disturbances {
        let mut with = *to;
        let one = |scale: f64| Wander { sigma: size * scale, time_s };
        match self {
            Self::Engine => with.report = one(1.0),
            Self::Bearing => with.bearing = one(1.0),
            Self::Clutch => with.clutch = one(1.0),
            Self::Driveline => with.load = one(1.0),
            Self::Flywheel => with.sensors[0] = one(to.noise[0].white),
            Self::Disc => with.sensors[1] = one(to.noise[1].white),
        }
        with
    }

    /// Whether the changed disturbance does more at low frequencies, where its power is σ²τ, than the slow error that it replaces; always true where it replaces none.
    fn is_more(self, changed: &Disturbances, than: &Disturbances) -> bool {
        let power = |w: Wander| w.sigma.powi(2) * w.time_s;
        match self {
            Self::Engine => power(changed.report) > power(than.report),
            Self::Clutch => power(changed.clutch) > power(than.clutch),
            Self::Driveline => power(changed.load) > power(than.load),
            Self::Bearing | Self::Flywheel | Self::Disc => true,
        }
    }

    /// Subsystems in which a disturbance that acts here may arise.
    fn places(self) -> &'static [Subsystem] {
        match self {
            Self::Engine => &[Subsystem::Engine],
            Self::Bearing => &[Subsystem::Actuator],
            Self::Clutch => &[Subsystem::Friction, Subsystem::ClutchForce, Subsystem::Actuator],
            Self::Driveline => &[Subsystem::Driveline],
            Self::Flywheel | Self::Disc => &[Subsystem::Sensors],
        }
    }

    fn words(self, with: &Disturbances) -> String {
        match self {
            Self::Engine => format!("a torque of {:.0} N·m at the engine", with.report.sigma),
            Self::Bearing => format!("{:.2} mm of the bearing's position", with.bearing.sigma),
            Self::Clutch => format!("{:.0} % of the clutch torque", 100.0 * with.clutch.sigma),
            Self::Driveline => format!("a torque of {:.0} N·m on the car's side", with.load.sigma),
            Self::Flywheel => format!("{:.2} rad/s of the flywheel speed", with.sensors[0].sigma),
            Self::Disc => format!("{:.2} rad/s of the disc speed", with.sensors[1].sigma),
        }
    }
}

/// Posterior probability of a hypothesis that has the prior of a missing law in one place and by which the recordings gain `log_odds` nats.
pub fn posterior(log_odds: f64) -> f64 {
    1.0 / (1.0 + (-log_odds - (PLACE_PRIOR / (1.0 - PLACE_PRIOR)).ln()).exp())
}

/// Probability that something is irregular in one place, for each accuracy that explanations may have, if the full likelihood gains this many nats by it.
pub fn probability(problem: &Problem, gain: f64) -> ByAccuracy<f64> {
    problem.powers.map(|powers| posterior(overall(powers) * gain))
}

/// Gain in log likelihood, nats, if the innovations of each phase of the clutch may have a variance of their own, with the likelihood raised to the powers that steer the search.
fn overdispersion_gain(problem: &Problem, residuals: &[Residuals]) -> f64 {
    let mut samples = [0.0; PHASES];
    for (r, residuals) in residuals.iter().enumerate() {
        residuals.iter().enumerate().filter(|(_, x)| **x != 0.0).for_each(|(i, _)| samples[problem.phase(r, i)] += 1.0);
    }
    let gain = |(misfit, n): (f64, f64)| if misfit > n && n > 0.0 { 0.5 * (misfit - n - n * (misfit / n).ln()) } else { 0.0 };
    problem.misfits(residuals).into_iter().zip(samples).map(gain).zip(problem.steering()).map(|(gain, power)| gain * power).sum()
}

/// Finds the disturbance that the innovations of an explanation support, starting from the disturbances `with` for which the problem's filters were computed. There is none if the
/// innovations are no larger than their covariance allows, or if no disturbance is worth its price.
pub fn irregular(problem: &Problem, point: &Point, residuals: &[Residuals], with: &Disturbances) -> Option<Irregular> {
    let price = -(PLACE_PRIOR / (1.0 - PLACE_PRIOR)).ln();
    if overdispersion_gain(problem, residuals) < price {
        return None;
    }
    let point = &Point { missing: Vec::new(), ..point.clone() };
    // The explanation is credited with its forms and laws, whereas a disturbance is weighed without them.
    let log_det = problem.filters.iter().map(|f| f.log_det).sum::<f64>();
    let without = minus_two_log_likelihood(problem, point, with).min(misfit(residuals) + log_det);
    let power = problem.power();
    let gain = |changed: &Disturbances| 0.5 * power * (without - minus_two_log_likelihood(problem, point, changed));
    let of = |at: At| {
        let all = at.sizes().into_iter().flat_map(move |size| MEMORIES_S.map(|memory| (at, at.added(size, memory, with), memory)));
        all.filter(move |(_, changed, _)| at.is_more(changed, with))
    };
    let mut all: Vec<(f64, At, Disturbances, f64)> =
        ALL.into_iter().flat_map(of).map(|(at, changed, memory)| (gain(&changed), at, changed, memory)).collect();
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (most, at, with, memory) = all[0];
    // Sizes and correlation times share the prior of their place.
    let lead = most - price - (TORQUES_NM.len() as f64 * MEMORIES_S.len() as f64).ln();
    if lead < 0.0 {
        return None;
    }
    let mut places: Vec<Subsystem> = Vec::new();
    let near = all.iter().filter(|(gain, ..)| most - gain < NEARLY_NATS);
    for place in near.flat_map(|(_, at, ..)| at.places()) {
        if !places.contains(place) {
            places.push(*place);
        }
    }
    let nominal = misfit(&problem.all_residuals(&problem.nominal(), None));
    let explained = 0.5 * power * (nominal - misfit(residuals)).max(0.0);
    let what = format!("{} (rms), for some {memory} s at a time", at.words(&with));
    Some(Irregular { places, what, share: most / (most + explained), probability: 1.0 / (1.0 + (-lead).exp()), gain: most, with })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gap::model::prepare::Example;

    /// A place is named beside the most likely one if it is at most three nats behind. The probability follows from the prior odds and the likelihood ratio.
    #[test]
    fn places_are_named_within_three_nats() {
        let example = Example::read();
        let (mut told_apart, mut doubtful) = (0, 0);
        // The likelihood has such low powers that places come close to each other.
        for (r, power) in example.campaign.recordings.iter().flat_map(|r| [0.02, 0.005, 0.003].map(|power| (r, power))) {
            let (mut problem, with) = example.problem(&[r]);
            problem.powers = [[power; PHASES]; 3];
            let point = problem.nominal();
            let Some(found) = irregular(&problem, &point, &problem.all_residuals(&point, None), &with) else { continue };
            let least = |at: At| {
                let costs = at.sizes().into_iter().flat_map(|size| MEMORIES_S.map(|memory| at.added(size, memory, &with)));
                costs.map(|changed| minus_two_log_likelihood(&problem, &point, &changed)).fold(f64::INFINITY, f64::min)
            };
            let costs = ALL.map(least);
            let best = costs.iter().copied().fold(f64::INFINITY, f64::min);
            // Odds that something is irregular in this place: the prior odds, shared by nine combinations of size and correlation time, times the likelihood ratio.
            let before = PLACE_PRIOR / (1.0 - PLACE_PRIOR) / 9.0;
            let odds = before * (0.5 * problem.power() * (minus_two_log_likelihood(&problem, &point, &with) - best)).exp();
            assert!(odds >= 1.0 && (found.probability - odds / (1.0 + odds)).abs() < 1e-6, "{}: {odds} {}", r.name, found.probability);
            doubtful += u32::from(found.probability < 0.99);
            for (at, cost) in ALL.into_iter().zip(costs) {
                let behind = 0.5 * problem.power() * (cost - best);
                let named = at.places().iter().all(|place| found.places.contains(place));
                assert!(behind > 3.0 || named, "{}: {at:?} is {behind} nats behind and not named", r.name);
                let alone = ALL.into_iter().all(|other| other == at || !other.places().iter().any(|p| at.places().contains(p)));
                assert!(behind <= 3.0 || !alone || !named, "{}: {at:?} is {behind} nats behind and named", r.name);
                told_apart += u32::from((3.0..9.0).contains(&behind) && alone);
            }
        }
        assert!(told_apart > 0 && doubtful > 0, "some places are a few nats apart, and some are not sure: {told_apart} {doubtful}");
    }
}
