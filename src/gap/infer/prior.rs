//! Prior of a set of effects: the odds of that many, and that none of them is small.

use super::coordinate::Coordinate;
use super::density::{STRAINS, size};
use super::fit::Fit;
use crate::effects::{PARAMETERS, REGISTRY};

/// Prior probability of each effect of the library: about one car in four that somebody has reason to diagnose holds one.
pub const EFFECT_PRIOR: f64 = 0.01;

/// Logarithm of the prior odds of that many effects over none.
pub fn log_prior(effects: usize) -> f64 {
    effects as f64 * (EFFECT_PRIOR / (1.0 - EFFECT_PRIOR)).ln()
}

/// Nats by which the evidence of these effects changes because an effect that is there is not small.
///
/// A normal prior around null gives most weight to what nobody would call an effect. The moment prior (Johnson and Rossell 2010, "On the use of non-local
/// prior densities in Bayesian hypothesis tests") multiplies it by the square of the size in units of its standard deviation, so that the evidence is
/// multiplied by that square's mean over the normal prior's posterior; and [`moment`] takes away what is negligible.
pub fn moments(fit: &Fit, effects: &[usize]) -> f64 {
    let Some(covariance) = fit.covariance() else { return f64::NEG_INFINITY };
    let square = |k: usize| {
        let place = fit.shared.iter().position(|c| *c == Coordinate::Effect(k));
        let variance = place.map_or(0.0, |i| covariance[(i, i)]);
        ((fit.point.effects[k] - PARAMETERS[k].null).powi(2) + variance) / size(k).powi(2)
    };
    let one = |e: &usize| {
        // A parameter that only goes with another one is not what makes the effect.
        let leads = |k: &&usize| STRAINS.iter().all(|s| s.follower != **k);
        let squares: Vec<f64> = REGISTRY[*e].effect.amplitudes.iter().filter(leads).map(|k| square(*k)).collect();
        moment(squares.iter().sum::<f64>() / squares.len() as f64)
    };
    effects.iter().map(one).sum()
}

/// Square of the size, in units of a noticeable effect, below which a departure is the form of something else rather than an effect: a tenth of the size.
const NEGLIGIBLE: f64 = 0.01;

/// Logarithm of the factor that the prior of an effect has over a normal one, from the mean square of its size in units of a noticeable effect. It vanishes faster
/// than any power at null (the inverse moment prior of Johnson and Rossell): an effect of a tenth of the size pays one nat for that, one of a fiftieth 25.
pub fn moment(square: f64) -> f64 {
    square.ln() - NEGLIGIBLE / square
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_costs_its_odds_and_a_small_one_more() {
        assert!((log_prior(2) + 2.0 * 99.0_f64.ln()).abs() < 1e-12 && log_prior(0) == 0.0);
        // A usual size pays nothing worth naming, a tenth of it one nat beside its square, a fiftieth twenty-five.
        for (share, pays) in [(1.0_f64, 0.01), (0.1, 1.0), (0.02, 25.0)] {
            assert!((moment(share * share) - 2.0 * share.ln() + pays).abs() < 1e-9, "{share}: {}", moment(share * share));
        }
    }
}
