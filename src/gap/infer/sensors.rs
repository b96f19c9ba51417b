//! Noise of the speed sensors by maximum likelihood, at an explanation of the car; and whether a slow logger misses commands.
//!
//! White noise is known from the recordings alone. Noise with a memory is not: it looks like motion. It is looked for where innovations that should be
//! white are not, and taken if the innovations' likelihood under the filter that knows of it asks for it. A sensor is a good sensor: its coloured noise is
//! at most twice its white noise, or a gap could hide behind it.

use super::density::{Point, Problem, Residuals, misfit};
use super::search::Hypothesis;
use crate::effects::Parameters;
use crate::gap::model::clock::misses;
use crate::gap::model::filter::Disturbances;
use crate::gap::model::noise::Noise;
use crate::gap::model::prepare;
use crate::gap::model::track::Track;
use rayon::prelude::*;

/// Correlation of neighbouring innovations from which a memory is looked for.
const CORRELATED: f64 = 0.08;
/// Sizes, in white noises, and memories in s that are tried.
const SIZES: [f64; 3] = [0.5, 1.0, 2.0];
const MEMORIES_S: [f64; 3] = [0.03, 0.1, 0.3];
/// Nats that a memory has to gain, two parameters of a sensor, and a control unit as slow as its logger, which is rare.
const WORTH_NATS: f64 = 8.0;

/// Whether a logger is so slow that it may miss commands, or the control unit as slow as it is. Stamps that jitter are no control unit's.
pub fn may_be_held(tracks: &[Track]) -> bool {
    tracks.iter().all(|t| misses(t.speed_interval()) && !t.jitters())
}

/// Whether recordings whose inputs are held (`held`) may be likelier than the same ones whose inputs are not (`straight`): they are so with the effects that suit the latter best.
pub fn worth_holding(held: &Problem, straight: &Problem, best: &Hypothesis) -> bool {
    let fitted = Hypothesis::fitted(held, best.effects.clone(), &best.fit.point, TOLD_APART, None);
    rather_held((held, &fitted), (straight, best))
}

/// Whether recordings whose inputs are held are likelier than the same ones whose inputs are not, each with a set of effects.
pub fn rather_held(held: (&Problem, &Hypothesis), straight: (&Problem, &Hypothesis)) -> bool {
    let likely = |(p, h): (&Problem, &Hypothesis)| h.fit.log_evidence - 0.5 * p.filters.iter().map(|f| f.log_det).sum::<f64>();
    likely(held) > likely(straight) + WORTH_NATS
}

/// Iterations that tell inputs that are held from inputs that are not.
const TOLD_APART: usize = 4;

/// Disturbances with the noise that the innovations at `point` ask for; none if they are as they should be.
pub fn refined(problem: &Problem, point: &Point, residuals: &[Residuals], with: &Disturbances) -> Option<Disturbances> {
    let mut best = *with;
    let mut found = None;
    for c in 0..2 {
        if correlation(problem, residuals, c) < CORRELATED {
            continue;
        }
        let white = with.noise[c].white;
        let tried = SIZES.iter().flat_map(|size| MEMORIES_S.iter().map(move |m| Noise { white, coloured: size * white, memory_s: *m }));
        // Part of what looked white was the memory's.
        let tried = tried.flat_map(|n| [1.0, 0.8].map(|share| Noise { white: share * white, ..n }));
        let mut most = minus_log_likelihood(problem, point, &best) - 2.0 * WORTH_NATS;
        for noise in tried {
            let mut changed = best;
            changed.noise[c] = noise;
            let cost = minus_log_likelihood(problem, point, &changed);
            if cost < most {
                (most, found) = (cost, Some(changed));
            }
        }
        best = found.unwrap_or(best);
    }
    found
}

/// Correlation of neighbouring innovations of a speed, outliers cut.
fn correlation(problem: &Problem, residuals: &[Residuals], c: usize) -> f64 {
    let (mut products, mut squares) = (0.0, 0.0);
    for (filter, r) in problem.filters.iter().zip(residuals) {
        let v: Vec<f64> = (0..filter.gains.len()).map(|k| r[2 * k + c].clamp(-4.0, 4.0)).collect();
        products += v.windows(2).map(|w| w[0] * w[1]).sum::<f64>();
        squares += v.iter().map(|x| x * x).sum::<f64>();
    }
    products / squares.max(1e-9)
}

/// Twice, up to a constant.
pub fn minus_log_likelihood(problem: &Problem, point: &Point, with: &Disturbances) -> f64 {
    let filters: Vec<_> = problem.tracks.par_iter().map(|t| prepare::filter_of(t, &problem.vehicle, with)).collect();
    let changed = Problem { filters, ..problem.clone() };
    misfit(&changed.all_residuals(point, None)) + changed.filters.iter().map(|f| f.log_det).sum::<f64>()
}

/// Intervals of the logger, or time in s, from which a sensor's delay changes when the clutch is seen to lock.
const LATE_INTERVALS: f64 = 1.5;
const LATE_S: f64 = 0.03;

/// Whether one of the speeds is sensed that late, s, under a logger of this interval, s.
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

    #[test]
    fn a_sensor_is_late_for_the_lock_by_three_hundredths_of_a_second_or_one_and_a_half_samples() {
        for (interval, least) in [(0.001, 0.03), (0.01, 0.03), (0.02, 0.03), (0.03, 0.045), (0.1, 0.15)] {
            for side in 0..2 {
                let late = |by: f64| sees_the_lock_late(if side == 0 { [by, 0.0] } else { [0.0, by] }, interval);
                assert_eq!([late(0.99 * least), late(1.01 * least)], [false, true], "side {side}, interval {interval} s");
            }
        }
    }

    /// Eight nats are what it takes; a filter of greater covariance is one that explains less.
    #[test]
    fn inputs_are_held_if_that_is_likelier_by_more_than_a_parameter_costs() {
        use crate::gap::infer::fit::Fit;
        let mut straight = crate::gap::model::prepare::Example::read();
        straight.campaign.recordings.truncate(1);
        let (straight, _) = straight.problem(&straight.campaign.recordings.iter().collect::<Vec<_>>());
        let mut wider = straight.clone();
        wider.filters[0].log_det += 20.0;
        let of = |log_evidence: f64| Hypothesis::made_up(&[], Fit { log_evidence, ..Fit::made_up(Vec::new()) });
        let held = |problem: &Problem, by: f64| rather_held((problem, &of(100.0 + by)), (&straight, &of(100.0)));
        assert_eq!([held(&straight, 7.9), held(&straight, 8.1), held(&wider, 17.9), held(&wider, 18.1)], [false, true, false, true]);
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
