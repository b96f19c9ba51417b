//! Prior of a set of effects: the odds of their number, and the moment prior, under which none of them is small.

use super::coordinate::Coordinate;
use super::density::{COUPLED_PRIORS, size};
use super::fit::Fit;
use crate::effects::{PARAMETERS, REGISTRY};

/// Prior probability of each effect of the library: about one in four of the cars that somebody has reason to diagnose has one of them.
pub const EFFECT_PRIOR: f64 = 0.01;

/// Logarithm of the prior odds of a set with this number of effects against no effect.
pub fn log_prior(effects: usize) -> f64 {
    effects as f64 * (EFFECT_PRIOR / (1.0 - EFFECT_PRIOR)).ln()
}

/// Change of the log evidence of these effects, nats, by the moment prior, under which an effect is not small.
///
/// A normal prior around null gives most weight to what nobody would call an effect. The moment prior (Johnson and Rossell 2010, "On the use of non-local prior densities in
/// Bayesian hypothesis tests") multiplies it by the square of the size in units of its standard deviation, so that the evidence is multiplied by the mean of that square over the
/// posterior under the normal prior. [`moment`] also removes negligible sizes.
pub fn moments(fit: &Fit, effects: &[usize]) -> f64 {
    let Some(covariance) = fit.covariance() else { return f64::NEG_INFINITY };
    let square = |k: usize| {
        let place = fit.shared.iter().position(|c| *c == Coordinate::Effect(k));
        let variance = place.map_or(0.0, |i| covariance[(i, i)]);
        ((fit.point.effects[k] - PARAMETERS[k].null).powi(2) + variance) / size(k).powi(2)
    };
    let one = |e: &usize| {
        // A parameter that only follows another one does not make the effect.
        let leads = |k: &&usize| COUPLED_PRIORS.iter().all(|s| s.follower != **k);
        let squares: Vec<f64> = REGISTRY[*e].effect.amplitudes.iter().filter(leads).map(|k| square(*k)).collect();
        moment(squares.iter().sum::<f64>() / squares.len() as f64)
    };
    effects.iter().map(one).sum()
}

/// Square of the size, in units of a noticeable effect, below which a departure is the form of something else rather than an effect; it corresponds to a tenth of the size.
const NEGLIGIBLE: f64 = 0.01;

/// Logarithm of the factor by which the prior of an effect differs from a normal one, from the mean square of its size in units of a noticeable effect. The factor vanishes faster
/// than any power at null (the inverse moment prior of Johnson and Rossell): besides the square, an effect of a tenth of the size pays one nat, one of a fiftieth 25.
pub fn moment(square: f64) -> f64 {
    square.ln() - NEGLIGIBLE / square
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_costs_its_odds_and_a_small_one_more() {
        assert!((log_prior(2) + 2.0 * 99.0_f64.ln()).abs() < 1e-12 && log_prior(0) == 0.0);
        // Beside the logarithm of its square, the usual size pays next to nothing, a tenth of it one nat, and a fiftieth 25 nats.
        for (share, pays) in [(1.0_f64, 0.01), (0.1, 1.0), (0.02, 25.0)] {
            assert!((moment(share * share) - 2.0 * share.ln() + pays).abs() < 1e-9, "{share}: {}", moment(share * share));
        }
    }
}
