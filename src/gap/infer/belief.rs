//! How far the likelihood is believed: the powers to which it is raised.
//!
//! The recordings are at some distance, in nats, from what even the true explanation predicts. A law is right only to within the relative error c of what it changes (one of
//! [`ACCURACIES`]): with G, the misfit beyond the number of samples that the car as its file gives it leaves unexplained, this distance is ½ c² G. The replay of a healthy car is
//! not exact either: n samples add ½ ε² n ([`REPLAY`]). A posterior that is conditioned on data within the distance R, and not on the data themselves, has the likelihood raised to
//! the power 1/(1 + R) (Miller and Dunson 2019, "Robust Bayesian inference via coarsening"). Each phase of the clutch has its own power, because a law that acts in one phase is
//! inexact in that phase.

use super::density::{ByPhase, PHASES, Problem, Residuals, WHOLE};
use crate::gap::model::track::Track;

/// Relative errors c that an effect and its form may have in what they change in the recordings.
pub const ACCURACIES: [f64; 3] = [0.02, 0.04, 0.08];

/// Index of the accuracy that steers a search.
pub const STEERING: usize = 0;

/// One for each of [`ACCURACIES`].
pub type ByAccuracy<T> = [T; ACCURACIES.len()];

/// Powers of one: the full likelihood, whatever the accuracy.
pub const EXACT: ByAccuracy<ByPhase<f64>> = [WHOLE; ACCURACIES.len()];

/// Systematic error ε of an innovation of a healthy car, relative to its standard deviation, because a replay is not exactly the car: first where every step of the inputs is
/// known, then where the logger is slower than the control unit. What the inputs do between samples is not independent noise: a driver's torque responds to the noise of the very
/// speed sample with which the replay is compared.
const REPLAY: [f64; 2] = [0.005, 0.01];

/// Distance of one sample of a recording from its replay, ½ ε², nats.
pub fn of_replay(track: &Track) -> f64 {
    0.5 * REPLAY[usize::from(track.misses_commands())].powi(2)
}

impl Problem {
    /// Sets the powers of the likelihood that follow from the problem's own recordings: from the misfit of the nominal car to them and from their samples.
    pub fn coarsen(&mut self) {
        let here = self.all_residuals(&self.nominal(), None);
        let (misfits, samples) = (self.misfits(&here), self.by_sample(&here, |_| 1.0));
        self.powers = coarsened(EXACT, self.by_sample(&here, of_replay), std::array::from_fn(|p| misfits[p] - samples[p]));
    }

    /// Sums `of(track)` over the samples of each recording (innovations other than zero), by phase of the clutch.
    pub fn by_sample(&self, residuals: &[Residuals], of: impl Fn(&Track) -> f64) -> ByPhase<f64> {
        let mut sums = [0.0; PHASES];
        for (r, residuals) in residuals.iter().enumerate() {
            let one = of(&self.tracks[r]);
            residuals.iter().enumerate().filter(|(_, x)| **x != 0.0).for_each(|(i, _)| sums[self.phase(r, i)] += one);
        }
        sums
    }

    /// Powers of the likelihood that steer a search.
    pub fn steering(&self) -> ByPhase<f64> {
        self.powers[STEERING]
    }

    /// Power of the likelihood as a whole in a search, see [`overall`].
    pub fn power(&self) -> f64 {
        overall(self.steering())
    }
}

/// Powers of the likelihood, by accuracy and phase of the clutch, after recordings are added to those to which `powers` belong: `replayed` is the distance of the added recordings
/// from their replays in nats, `unexplained` their G.
pub fn coarsened(powers: ByAccuracy<ByPhase<f64>>, replayed: ByPhase<f64>, unexplained: ByPhase<f64>) -> ByAccuracy<ByPhase<f64>> {
    let of_law = |a: usize, p: usize| 0.5 * ACCURACIES[a].powi(2) * unexplained[p].max(0.0);
    std::array::from_fn(|a| std::array::from_fn(|p| 1.0 / (1.0 / powers[a][p] + replayed[p] + of_law(a, p))))
}

/// Single power of the likelihood that corresponds to these powers of its phases: the distances R of the phases add up.
pub fn overall(powers: ByPhase<f64>) -> f64 {
    1.0 / (1.0 + powers.iter().map(|power| 1.0 / power - 1.0).sum::<f64>())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A power is 1/(1 + ½ c² G + r), no matter whether the recordings are added together or one after the other.
    #[test]
    fn what_is_left_unexplained_lowers_the_powers() {
        let once = coarsened(EXACT, [0.0; PHASES], [1000.0, -5.0, 250.0]);
        assert!((once[0][0] - 1.0 / 1.2).abs() < 1e-12 && (once[2][0] - 1.0 / 4.2).abs() < 1e-12, "{once:?}");
        assert!(once[1][1] == 1.0 && (once[1][2] - 1.0 / 1.2).abs() < 1e-12, "{once:?}");
        let twice = coarsened(coarsened(EXACT, [0.0; PHASES], [400.0, 0.0, 250.0]), [0.0; PHASES], [600.0, 0.0, 0.0]);
        assert!(once.iter().flatten().zip(twice.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-12));
        let replayed = coarsened(EXACT, [0.5, 1.0, 0.0], [1000.0, -5.0, 250.0]);
        assert!((replayed[0][0] - 1.0 / 1.7).abs() < 1e-12 && replayed[1][1] == 0.5 && replayed[2][2] == once[2][2], "{replayed:?}");
    }

    #[test]
    fn powers_join_as_the_distances_that_they_stand_for() {
        // The powers 1/2 and 1/4 stand for the distances 1 and 3; their sum of 4 gives the power 1/5.
        assert!((overall([0.5, 0.25, 1.0]) - 0.2).abs() < 1e-12);
        assert_eq!(overall(WHOLE), 1.0);
    }
}
