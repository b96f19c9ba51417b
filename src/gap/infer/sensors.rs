//! Noise of the sensors by maximum likelihood, given an explanation of the car; and whether the logger misses commands.
//!
//! White noise is known from the recordings alone. Noise with a memory is not, because it looks like motion. It is considered where innovations that should be white are
//! correlated, and adopted if the likelihood of the innovations under a filter with such noise supports it. Sensors are taken to be good: coloured noise is at most twice the white
//! noise that the recordings show, or a gap could hide behind it. A gap could also hide behind a lasting error of a position or a clutch torque, which no disturbance of the car
//! absorbs. Noise of these two therefore has the shortest memory that is tried, 0.01 s, like that of an interpolated channel.

use super::density::{Point, Problem, Residuals, misfit};
use super::search::Hypothesis;
use crate::effects::Parameters;
use crate::gap::model::filter::{Disturbances, Filter};
use crate::gap::model::noise::Noise;
use crate::gap::model::prepare;
use crate::gap::model::track::{Channel, Track};
use rayon::prelude::*;

/// Correlation of neighbouring innovations above which noise with a memory is considered.
const CORRELATED: f64 = 0.08;
/// Sizes, in multiples of the white noise, and memories in s that are tried.
const SIZES: [f64; 3] = [0.5, 1.0, 2.0];
const MEMORIES_S: [f64; 4] = [0.01, 0.03, 0.1, 0.3];
/// Gain in nats that is required of noise with a memory, which adds two parameters of a sensor, and of a control unit that is as slow as a slow logger or faster than a fast one,
/// which is rare.
const WORTH_NATS: f64 = 8.0;

/// Interval, s, of a control unit other than the usual one that may be behind these recordings, if they could tell: one that computes between the samples of a fast logger, or one
/// that is as slow as a slow logger, of which nothing is missed (infinity). Twice as often as the logger stands for all faster units, whose commands it shifts by less than a
/// quarter of an interval. None if some of the recordings miss commands and others do not, or if time stamps jitter, since a control unit's do not.
pub fn other_control_interval(tracks: &[Track]) -> Option<f64> {
    let missing = tracks.iter().filter(|t| t.misses_commands()).count();
    let shortest = tracks.iter().map(Track::speed_interval).fold(f64::INFINITY, f64::min);
    let other = if missing == 0 { Some(0.5 * shortest) } else { (missing == tracks.len()).then_some(f64::INFINITY) };
    other.filter(|_| !tracks.iter().any(Track::jitters))
}

/// Whether the inputs of another control unit are worth a search: the recordings must be more likely with them already beside the effects that suit the usual unit's inputs best.
pub fn other_control_unit_is_worth_a_search(other: &Problem, usual: &Problem, best: &Hypothesis) -> bool {
    // Nuisances of the timing are converted: their standard deviations depend on the logger, and differ between the two readings.
    let mut start = best.fit.point.clone();
    start.shared.iter_mut().zip(usual.shared.iter().zip(&other.shared)).for_each(|(z, (of, to))| *z *= of.sigma / to.sigma);
    let fitted = Hypothesis::fitted(other, best.effects.clone(), &start, TOLD_APART, None);
    prefers_other_control_unit((other, &fitted), (usual, best))
}

/// Whether the recordings are more likely with the inputs of another control unit, each reading with a set of effects of its own.
pub fn prefers_other_control_unit(other: (&Problem, &Hypothesis), usual: (&Problem, &Hypothesis)) -> bool {
    log_likelihood(other.0, other.1) > log_likelihood(usual.0, usual.1) + WORTH_NATS
        && (!other.0.tracks.iter().any(Track::misses_commands) || explains_more(other, usual))
}

/// Log marginal likelihood of the recordings as they are read, beside a set of effects, with all unknowns integrated out; up to a constant.
pub fn log_likelihood(problem: &Problem, set: &Hypothesis) -> f64 {
    set.fit.log_evidence - 0.5 * problem.filters.iter().map(|f| f.log_det).sum::<f64>()
}

/// Further conditions where the other reading leaves more open, which makes it more likely wherever something is wrong. It must be more likely as well under filters that leave as
/// much open in both readings, and it must strain tolerances less: if commands that change between samples are replayed as held, they are late, which strains the tolerances.
fn explains_more((other, best): (&Problem, &Hypothesis), (usual, best_there): (&Problem, &Hypothesis)) -> bool {
    let as_open = Problem { filters: other.filters.clone(), powers: other.powers, ..usual.clone() };
    let held = Hypothesis::fitted(&as_open, best_there.effects.clone(), &best_there.fit.point, TOLD_APART, None).fit;
    let relief = 0.5 * (held.squares() - best.fit.squares());
    best.fit.log_evidence > held.log_evidence + WORTH_NATS && relief > WORTH_NATS
}

/// Iterations of the fits by which two readings are compared.
pub const TOLD_APART: usize = 4;

/// Disturbances with the noise that the innovations at `point` support; none if the innovations are as they should be.
pub fn refined(problem: &Problem, point: &Point, residuals: &[Residuals], with: &Disturbances) -> Option<Disturbances> {
    let mut best = *with;
    let mut found = None;
    for c in [Channel::OmegaF, Channel::OmegaC, Channel::XTo, Channel::TFc].map(|channel| channel as usize) {
        if correlation(problem, residuals, c) < CORRELATED {
            continue;
        }
        let white = with.noise[c].white;
        let memories = if c < 2 { &MEMORIES_S[..] } else { &MEMORIES_S[..1] };
        let tried = SIZES.iter().flat_map(|size| memories.iter().map(move |m| Noise { white, coloured: size * white, memory_s: *m }));
        // Part of what looked white belongs to the coloured noise.
        let tried = tried.flat_map(|n| [1.0, 0.8].map(|share| Noise { white: share * white, ..n }));
        let mut most = minus_two_log_likelihood(problem, point, &best) - 2.0 * WORTH_NATS;
        for noise in tried {
            let mut changed = best;
            changed.noise[c] = noise;
            let cost = minus_two_log_likelihood(problem, point, &changed);
            if cost < most {
                (most, found) = (cost, Some(changed));
            }
        }
        best = found.unwrap_or(best);
    }
    found
}

/// Correlation of neighbouring innovations of a channel, with outliers clipped.
fn correlation(problem: &Problem, residuals: &[Residuals], c: usize) -> f64 {
    let (mut products, mut squares) = (0.0, 0.0);
    for (filter, r) in problem.filters.iter().zip(residuals) {
        let v: Vec<f64> = of_channel(filter, r, c).map(|x| x.clamp(-4.0, 4.0)).collect();
        products += v.windows(2).map(|w| w[0] * w[1]).sum::<f64>();
        squares += v.iter().map(|x| x * x).sum::<f64>();
    }
    products / squares.max(1e-9)
}

/// Innovations of a channel.
fn of_channel<'a>(filter: &Filter, residuals: &'a Residuals, c: usize) -> impl Iterator<Item = f64> + 'a {
    let speeds = 2 * filter.gains.len();
    let (first, count, step) = match c.checked_sub(2) {
        None => (c, speeds / 2, 2),
        Some(place) => (speeds + filter.bench[..place].iter().map(Vec::len).sum::<usize>(), filter.bench[place].len(), 1),
    };
    residuals[first..].iter().step_by(step).take(count).copied()
}

/// Minus twice the log likelihood of the recordings at `point` under filters for the disturbances `with`, up to a constant.
pub fn minus_two_log_likelihood(problem: &Problem, point: &Point, with: &Disturbances) -> f64 {
    let filters: Vec<_> = problem.tracks.par_iter().map(|t| prepare::filter_of(t, &problem.vehicle, with)).collect();
    let changed = Problem { filters, ..problem.clone() };
    misfit(&changed.all_residuals(point, None)) + changed.filters.iter().map(|f| f.log_det).sum::<f64>()
}

/// Delay of a speed sensor from which on the delay changes when the clutch is seen to lock: the larger of this many intervals of the logger and this time in s.
const LATE_INTERVALS: f64 = 1.5;
const LATE_S: f64 = 0.03;

/// Whether one of the speeds is sensed so late, s, that the lock-up is seen late, with a logger of this interval, s.
pub fn sees_the_lock_late(late: [f64; 2], interval: f64) -> bool {
    late.iter().any(|l| *l > LATE_S.max(LATE_INTERVALS * interval))
}

/// How late the speeds are sensed in a car with these effects, s.
pub fn late(effects: &Parameters) -> [f64; 2] {
    use crate::effects::param::{clutch_speed_delay, engine_speed_delay};
    [
        effects[engine_speed_delay::delay] + effects[engine_speed_delay::smoothing],
        effects[clutch_speed_delay::delay] + effects[clutch_speed_delay::smoothing],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Recording;

    #[test]
    fn a_sensor_is_late_for_the_lock_by_three_hundredths_of_a_second_or_one_and_a_half_samples() {
        for (interval, least) in [(0.001, 0.03), (0.01, 0.03), (0.02, 0.03), (0.03, 0.045), (0.1, 0.15)] {
            for side in 0..2 {
                let late = |by: f64| sees_the_lock_late(if side == 0 { [by, 0.0] } else { [0.0, by] }, interval);
                assert_eq!([late(0.99 * least), late(1.01 * least)], [false, true], "side {side}, interval {interval} s");
            }
        }
    }

    #[test]
    fn a_slow_logger_may_be_as_slow_as_its_control_unit_and_a_quick_one_slower() {
        let every = |interval: f64, jitter: f64| {
            let time = (0..200).map(|k| interval * (f64::from(k) + jitter * f64::from(k % 3))).collect();
            let input = vec![0.0; 200];
            let [omega_f, omega_c, t_e, x_to_cmd, theta_h] = std::array::from_fn(|_| input.clone());
            Track::new(&Recording {
                time,
                sample_rate_hz: 1.0 / interval,
                omega_f,
                omega_c,
                t_e,
                x_to_cmd,
                theta_h,
                ..Recording::default()
            })
        };
        for (interval, other) in [(0.001, 0.0005), (0.01, 0.005), (0.02, f64::INFINITY), (0.05, f64::INFINITY)] {
            let found = other_control_interval(&[every(interval, 0.0)]).unwrap();
            assert!(found == other || (found - other).abs() < 1e-9, "{interval}: {found}");
            assert_eq!(other_control_interval(&[every(interval, 0.0), every(interval, 0.1)]), None, "stamps jitter");
        }
        assert_eq!(other_control_interval(&[every(0.01, 0.0), every(0.02, 0.0)]), None, "one of each");
    }

    /// The other reading must be more likely by eight nats; a filter with a larger innovation covariance counts against it.
    #[test]
    fn a_control_unit_is_another_if_that_is_likelier_by_more_than_a_parameter_costs() {
        use crate::gap::infer::fit::Fit;
        let mut usual = crate::gap::model::prepare::Example::read();
        usual.campaign.recordings.truncate(1);
        let (usual, _) = usual.problem(&usual.campaign.recordings.iter().collect::<Vec<_>>());
        let mut wider = usual.clone();
        wider.filters[0].log_det += 20.0;
        let of = |log_evidence: f64| Hypothesis::made_up(&[], Fit { log_evidence, ..Fit::made_up(Vec::new()) });
        let other = |problem: &Problem, by: f64| prefers_other_control_unit((problem, &of(100.0 + by)), (&usual, &of(100.0)));
        assert_eq!([other(&usual, 7.9), other(&usual, 8.1), other(&wider, 17.9), other(&wider, 18.1)], [false, true, false, true]);
    }

    /// The mean of two neighbours, as an interpolating logger writes halfway between its samples, has noise with a memory.
    #[test]
    fn interpolated_channels_have_noise_with_a_memory() {
        use crate::gap::model::prepare::{disturbances, problem, read};
        use crate::{campaign, vehicle::Vehicle};
        let campaign = campaign::read(std::path::Path::new("tests/data/cases/3/campaign"), &Default::default()).unwrap();
        let vehicle = Vehicle::from_value(&campaign.vehicle_json).unwrap();
        let noise = |campaign: &campaign::Campaign| {
            let (tracks, tolerances) = read(&campaign.recordings.iter().take(3).collect::<Vec<_>>(), &campaign.vehicle_json).unwrap();
            let with = disturbances(&tracks, &tolerances);
            let problem = problem(tracks, &vehicle, &tolerances, &with);
            let point = problem.nominal();
            (with.noise, refined(&problem, &point, &problem.all_residuals(&point, None), &with).unwrap_or(with).noise)
        };
        let (white, sampled) = noise(&campaign);
        let mut halfway = campaign.clone();
        for r in &mut halfway.recordings {
            for column in [r.x_to.as_mut(), r.t_fc.as_mut()].into_iter().flatten() {
                (1..column.len()).rev().for_each(|k| column[k] = 0.5 * (column[k] + column[k - 1]));
            }
        }
        let (_, interpolated) = noise(&halfway);
        for c in [Channel::XTo, Channel::TFc].map(|channel| channel as usize) {
            let (is, was) = (interpolated[c], white[c].white);
            assert!(is.coloured > 0.0 && is.memory_s == 0.01, "{is:?}");
            // The interpolated channel has half the variance of the sampled one.
            let whole = is.white.hypot(is.coloured) / was;
            assert!((whole - 0.5f64.sqrt()).abs() < 0.25, "{whole} of {sampled:?}");
        }
    }

    #[test]
    fn a_delay_and_a_smoothing_both_make_a_sensor_late() {
        use crate::effects::{null, param};
        let mut effects = null();
        (effects[param::engine_speed_delay::delay], effects[param::engine_speed_delay::smoothing]) = (0.01, 0.03);
        (effects[param::clutch_speed_delay::delay], effects[param::clutch_speed_delay::smoothing]) = (0.02, 0.05);
        assert_eq!(late(&effects), [0.01 + 0.03, 0.02 + 0.05]);
    }
}
