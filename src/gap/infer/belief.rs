//! How far the likelihood is believed.
//!
//! What the car as its file gives it leaves unexplained, G, is explained by laws that are right to a share c of what they change, one of [`ACCURACIES`]; the recordings then are as far as ½ c² G
//! nats from what even the true explanation predicts. Nor is the replay of a healthy car exact: n samples are ½ ε² n nats from it ([`REPLAY`]). A posterior that is given data of such a distance R, and
//! not the data themselves, has the likelihood to the power of 1/(1 + R) (Miller and Dunson 2019, "Robust Bayesian inference via coarsening"). Each phase of the clutch has a power of its
//! own: a law that acts in one of them is inexact there.

use super::density::{ByPhase, PHASES, Problem, Residuals, WHOLE};
use crate::gap::model::track::Track;

/// Shares of what an effect changes in the recordings to which it and its form may describe what a real one changes.
pub const ACCURACIES: [f64; 3] = [0.02, 0.04, 0.08];

/// The one by which a search is steered.
pub const STEERING: usize = 0;

/// One for each of [`ACCURACIES`].
pub type ByAccuracy<T> = [T; ACCURACIES.len()];

/// The whole likelihood, whatever the accuracy.
pub const EXACT: ByAccuracy<ByPhase<f64>> = [WHOLE; ACCURACIES.len()];

/// Share of its standard deviation by which an innovation of a healthy car may be off because a replay is not the car: where every step of the inputs is known, and where the logger is
/// slower than the control unit. What inputs do between samples is no chance: a driver's torque answers to the noise of the very sample that it is compared with.
const REPLAY: [f64; 2] = [0.005, 0.01];

/// How far one sample of a recording is from its replay, nats.
pub fn of_replay(track: &Track) -> f64 {
    0.5 * REPLAY[usize::from(track.misses_commands())].powi(2)
}

impl Problem {
    /// Takes the powers that belong to its recordings.
    pub fn coarsen(&mut self) {
        let here = self.all_residuals(&self.nominal(), None);
        let (misfits, samples) = (self.misfits(&here), self.by_sample(&here, |_| 1.0));
        self.powers = coarsened(EXACT, self.by_sample(&here, of_replay), std::array::from_fn(|p| misfits[p] - samples[p]));
    }

    /// Sum over the samples of innovations, phase by phase of the clutch, of what each sample of a recording has.
    pub fn by_sample(&self, residuals: &[Residuals], of: impl Fn(&Track) -> f64) -> ByPhase<f64> {
        let mut sums = [0.0; PHASES];
        for (r, residuals) in residuals.iter().enumerate() {
            let one = of(&self.tracks[r]);
            residuals.iter().enumerate().filter(|(_, x)| **x != 0.0).for_each(|(i, _)| sums[self.phase(r, i)] += one);
        }
        sums
    }

    /// The powers by which a search is steered.
    pub fn steering(&self) -> ByPhase<f64> {
        self.powers[STEERING]
    }

    /// Power that the whole likelihood would have in a search.
    pub fn power(&self) -> f64 {
        overall(self.steering())
    }
}

/// Powers of the likelihood where recordings beyond those that have these are that many nats from their replays and leave G more unexplained, in each phase of the clutch.
pub fn coarsened(powers: ByAccuracy<ByPhase<f64>>, replayed: ByPhase<f64>, unexplained: ByPhase<f64>) -> ByAccuracy<ByPhase<f64>> {
    let of_law = |a: usize, p: usize| 0.5 * ACCURACIES[a].powi(2) * unexplained[p].max(0.0);
    std::array::from_fn(|a| std::array::from_fn(|p| 1.0 / (1.0 / powers[a][p] + replayed[p] + of_law(a, p))))
}

/// Power that the whole likelihood would have if its phases have these.
pub fn overall(powers: ByPhase<f64>) -> f64 {
    1.0 / (1.0 + powers.iter().map(|power| 1.0 / power - 1.0).sum::<f64>())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 1/(1 + ½ c² G + r), and the same whether recordings come together or one after the other.
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
        // 1/(1 + R) of the sum of R: 1 and 3 make 4.
        assert!((overall([0.5, 0.25, 1.0]) - 0.2).abs() < 1e-12);
        assert_eq!(overall(WHOLE), 1.0);
    }
}
