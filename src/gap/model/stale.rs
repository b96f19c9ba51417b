//! Stale samples: a speed signal that repeats an earlier value while the car goes on, for instance because messages are lost or a counter is not updated.
//!
//! A speed is the integral of torques: it may bend, but not jump. If samples that agree with each other end in a jump off the line through the two samples after it, by more than
//! noise explains, they may be stale. They are only candidates, because twisted shafts let a disc speed jump as well. Whether they are stale depends on how much more likely the
//! recordings are without them ([`ready`](crate::gap::ready)). The density of the stale samples themselves is that of noise around the value that they repeat.

use super::track::{Channel, Track};
use crate::gap::infer::weigh::log_sum;
use std::f64::consts::PI;

/// Deviation from the line through the two later samples beyond which the step to them counts as a jump, in standard deviations of noise: hardly exceeded by chance even among
/// millions of samples.
const LEAP: f64 = 5.0;
/// Difference within which samples count as repeating each other, in standard deviations of noise.
const ALIKE: f64 = 4.0;

/// Rows of a recording at which a speed may be stale, one group for each standstill of the signal.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stale {
    /// Rows, in order, and the value that they repeat, rad/s.
    pub groups: Vec<(Vec<usize>, f64)>,
}

/// Finds the samples that may be stale in a speed with this white noise, rad/s.
pub fn stale(time: &[f64], speed: &[f64], white: f64) -> Stale {
    let known: Vec<usize> = (0..speed.len()).filter(|&k| speed[k].is_finite()).collect();
    let at = |k: usize| (time[known[k]], speed[known[k]]);
    let leaps = |k: usize| {
        let [(t, v), (t1, v1), (t2, v2)] = [k, k + 1, k + 2].map(at);
        let far = (t1 - t) / (t2 - t1);
        // Limit from the noise of all three samples, where the line through the two later ones is extrapolated to this sample.
        let off = LEAP * white * (1.0 + (1.0 + far).powi(2) + far * far).sqrt();
        (v1 - v).abs() > ALIKE * white && (v - v1 + far * (v2 - v1)).abs() > off
    };
    let mut groups = Vec::new();
    for last in (1..known.len().saturating_sub(2)).filter(|&k| leaps(k)) {
        let (mut first, mut sum, mut count) = (last, at(last).1, 1.0);
        while first > 0 && (at(first - 1).1 - sum / count).abs() <= ALIKE * white {
            first -= 1;
            sum += at(first).1;
            count += 1.0;
        }
        // The first sample of a group is valid; the others repeat it.
        if first < last {
            groups.push((known[first + 1..=last].to_vec(), sum / count));
        }
    }
    Stale { groups }
}

impl Stale {
    /// Number of standstills.
    pub fn times(&self) -> usize {
        self.groups.len()
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.groups.iter().map(|(rows, _)| rows.len()).sum()
    }

    /// Minus twice the log density of the stale samples, without the constant that every sample has: noise of this standard deviation around the value that they repeat. Like a
    /// track, it takes the mean over the samples of an observation.
    pub fn minus_log_density(&self, track: &Track, speed: Channel, white: f64) -> f64 {
        let of = |(rows, value): &(Vec<usize>, f64)| {
            let mut sum = 0.0;
            let mut from = 0;
            while from < rows.len() {
                let observation = track.observation_of(rows[from]);
                let to = from + rows[from..].iter().take_while(|row| track.observation_of(**row) == observation).count();
                // An observation that keeps other samples exists without the stale ones as well and is not counted.
                let count = (to - from) as f64;
                if track.mean(speed, observation).1 == to - from {
                    let mean = rows[from..to].iter().map(|&row| track.measured[speed as usize][row]).sum::<f64>() / count;
                    let variance = white * white / count;
                    sum += (mean - value).powi(2) / variance + variance.ln();
                }
                from = to;
            }
            sum
        };
        self.groups.iter().map(of).sum()
    }
}

/// Log prior probability of the places of this many standstills among this many samples. All numbers of standstills are equally likely, and so are all places of their beginnings
/// and ends.
pub fn log_prior(times: usize, samples: usize) -> f64 {
    let (n, k) = (samples as f64, (2 * times).min(samples) as f64);
    // Stirling's formula, whose next term is less than a twelfth.
    let log_factorial = |x: f64| if x > 0.0 { x * x.ln() - x + 0.5 * (2.0 * PI * x).ln() } else { 0.0 };
    log_factorial(k) + log_factorial(n - k) - log_factorial(n) - (n + 1.0).ln()
}

/// Largest share of messages that a logger may lose and replace by the last one; a larger share is attributed to the sensor.
const LOST: f64 = 0.01;

/// Log odds, from the number of standstills among `stretches` stretches of that length, of a sensor that stands still in any share of them against a logger that loses at most
/// [`LOST`]. In both cases every possible share is equally likely.
pub fn log_odds_of_fault(times: f64, stretches: f64) -> f64 {
    const STEPS: u32 = 1000;
    let log_likelihood = |share: f64| times * share.ln() + (stretches - times) * (1.0 - share).ln();
    let mean = |to: f64| log_sum(&(0..STEPS).map(|k| log_likelihood(to * (f64::from(k) + 0.5) / f64::from(STEPS))).collect::<Vec<_>>());
    mean(1.0) - mean(LOST)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Recording;

    /// A speed that rises, repeats itself twice, and has a bend without a jump; its noise alternates.
    fn speed() -> (Vec<f64>, Vec<f64>) {
        let time: Vec<f64> = (0..200).map(|k| 0.01 * f64::from(k)).collect();
        let noise = |k: usize| [0.1, -0.1, 0.05, -0.05][k % 4];
        let true_speed = |t: f64| if t < 1.0 { 60.0 * t } else { 60.0 - 80.0 * (t - 1.0) };
        let mut speed: Vec<f64> = time.iter().enumerate().map(|(k, t)| true_speed(*t) + noise(k)).collect();
        for (from, to) in [(31, 40), (120, 123)] {
            (from..to).for_each(|k| speed[k] = true_speed(time[from - 1]) + noise(k));
        }
        (time, speed)
    }

    #[test]
    fn samples_that_repeat_one_before_end_with_a_leap() {
        let (time, mut values) = speed();
        let found = stale(&time, &values, 0.1);
        let rows: Vec<Vec<usize>> = found.groups.iter().map(|g| g.0.clone()).collect();
        assert_eq!(rows, [(31..40).collect::<Vec<_>>(), (120..123).collect()]);
        assert!((found.groups[0].1 - 18.0).abs() < 0.05 && found.samples() == 12);
        // Rows without a sample are passed over.
        (0..200).filter(|k| k % 3 == 1 || *k == 35).for_each(|k| values[k] = f64::NAN);
        let rows: Vec<usize> = stale(&time, &values, 0.1).groups.into_iter().flat_map(|g| g.0).collect();
        assert_eq!(rows, [32, 33, 36, 38, 39, 120, 122]);
        // With that much noise, a jump of 6 rad/s is not significant.
        assert_eq!(stale(&time, &speed().1, 1.0), Stale::default());
    }

    /// Noise around the repeated value, with one sample per observation.
    #[test]
    fn stale_samples_have_the_density_of_noise() {
        let (time, omega_c) = speed();
        let track = Track::new(&Recording {
            sample_rate_hz: 100.0,
            omega_f: vec![0.0; 200],
            t_e: vec![0.0; 200],
            x_to_cmd: vec![0.0; 200],
            theta_h: vec![25.0; 200],
            time,
            omega_c,
            ..Recording::default()
        });
        let one = Stale { groups: vec![(vec![31, 32, 33], 18.0)] };
        let expected = [-0.05_f64, 0.1, -0.1].iter().map(|x| (x / 0.2).powi(2) + 0.04_f64.ln()).sum::<f64>();
        assert!((one.minus_log_density(&track, Channel::OmegaC, 0.2) - expected).abs() < 1e-9);
    }

    /// One standstill in a thousand stretches is normal for a logger, one in ten is a faulty sensor; a few are no evidence.
    #[test]
    fn a_sensor_is_at_fault_if_it_stands_still_more_often_than_messages_are_lost() {
        // Without standstills, the mean likelihoods are 1/(n + 1) for the sensor and (1 − (1 − c)^(n + 1))/(c (n + 1)) for the logger.
        let none = (0.01 / (1.0 - 0.99_f64.powi(301))).ln();
        assert!((log_odds_of_fault(0.0, 300.0) - none).abs() < 0.01, "{} {none}", log_odds_of_fault(0.0, 300.0));
        let odds = [(1.0, 1000.0), (5.0, 1000.0), (10.0, 1000.0), (20.0, 1000.0), (100.0, 1000.0)].map(|(m, n)| log_odds_of_fault(m, n));
        assert!(odds.is_sorted() && odds[1] < -4.0 && odds[2] < -3.0 && odds[3] > 0.0 && odds[4] > 100.0, "{odds:?}");
    }

    #[test]
    fn any_number_of_standstills_is_as_likely_and_so_is_any_place() {
        // Two standstills have four beginnings and ends among ten samples: 210 combinations, times eleven possible numbers.
        assert!((log_prior(2, 10) + (210.0_f64 * 11.0).ln()).abs() < 0.05, "{}", log_prior(2, 10));
        assert!((log_prior(0, 10) + 11.0_f64.ln()).abs() < 1e-9 && log_prior(100, 10) < 0.0);
    }
}
