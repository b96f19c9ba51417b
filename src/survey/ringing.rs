//! Oscillation of the driveline after an engagement: the peak of the spectrum of the slip, with its interval.
//!
//! The slip ω_e − ω_c at the road speed's own stamps, less its running mean over half a second, is fitted by one sinusoid over the two seconds after the speeds meet,
//! at every frequency of the band. The spectrum is the share of the variance that the sinusoid explains. The 95 % set contains all frequencies whose residual is below
//! the least one times 1 + 3.84 / N, where N = 2 B T is the number of independent values of a band B within the time T: noise beside a ringing driveline is coloured,
//! so that N is not the number of samples. Where the set has several parts, the data do not determine which of them is the driveline's.
//!
//! The peak is called an oscillation if noise in that band has so large a peak after at most one engagement in ten, and if it is larger than what
//! quantisation makes of speeds that rise evenly: a sawtooth, whose first harmonic has an amplitude of 1/π of the step.

use super::Trace;
use std::f64::consts::{PI, TAU};

/// Band of a car's driveline and its neighbours, Hz.
const BAND: (f64, f64) = (2.0, 12.0);
/// Distance between frequencies, Hz.
const FINE: f64 = 0.02;
/// Longest time after the speeds meet that is analysed, s.
const LONGEST_S: f64 = 2.0;
/// Width of the running mean, s.
const MEAN_S: f64 = 0.5;
/// Width of the bins over which denser samples are averaged, s: its inverse is far above the band.
const BIN_S: f64 = 0.01;
/// Share of engagements after which noise may be taken for an oscillation.
const FALSE_ALARMS: f64 = 0.1;
/// Largest gain that subtracting the running mean has on a sinusoid: 1 − sin x / x.
const MOST_GAIN: f64 = 1.22;

/// An oscillation.
#[derive(Clone, Debug)]
pub struct Ringing {
    /// Frequency, Hz.
    pub frequency: f64,
    /// Share of the variance that it explains.
    pub share: f64,
    /// The 95 % set of the frequency, as intervals, Hz.
    pub set: Vec<(f64, f64)>,
}

/// The oscillation after `met`; `None` if there is none or the gear is left too soon. `factor` is engine speed over road speed, `quantum` the
/// quantisation step of their difference.
pub fn after(engine: Trace<'_>, road: Trace<'_>, (factor, quantum): (f64, f64), met: f64, until: f64) -> Option<Ringing> {
    let end = until.min(met + LONGEST_S);
    let seconds = end - met;
    if seconds < 3.0 / BAND.0 * 0.5 {
        return None;
    }
    let slip = |k: usize| (road.time[k], engine.at(road.time[k]) - factor * road.values[k]);
    let around: Vec<(f64, f64)> = road.within(met, end + MEAN_S).map(slip).filter(|(t, _)| *t <= until).collect();
    let around: Vec<(f64, f64)> = around.chunk_by(|a, b| bin(a.0 - met) == bin(b.0 - met)).map(mean).collect();
    let points: Vec<(f64, f64)> = around.iter().filter(|(t, _)| *t <= end).map(|&(t, s)| (t - met, s - mean_around(&around, t))).collect();
    let total: f64 = points.iter().map(|p| p.1 * p.1).sum();
    if points.len() < 20 || total == 0.0 {
        return None;
    }
    // Frequencies above a third of the sample rate have fewer than three samples per period; a peak there may be an alias.
    let of_engine = engine.within(met, end).len() as f64 / seconds;
    let rate = of_engine.min((points.len() - 1) as f64 / seconds);
    let highest = BAND.1.min(rate / 3.0);
    if highest < BAND.0 {
        return None;
    }
    let count = ((highest - BAND.0) / FINE) as usize;
    let spectrum: Vec<(f64, f64)> = (0..=count).map(|k| BAND.0 + k as f64 * FINE).map(|f| (f, share(&points, f) / total)).collect();
    let &(frequency, best) = spectrum.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let independent = 2.0 * (highest - BAND.0) * seconds;
    let amplitude = (2.0 * best * total / points.len() as f64).sqrt();
    if best < least_share(independent) || amplitude < MOST_GAIN * quantum / PI {
        return None;
    }
    let enough = 1.0 - (1.0 - best) * (1.0 + 3.84 / independent);
    let mut set: Vec<(f64, f64)> = Vec::new();
    for (f, _) in spectrum.iter().filter(|(_, s)| *s >= enough) {
        match set.last_mut() {
            Some((_, high)) if f - *high < 1.5 * FINE => *high = *f,
            _ => set.push((*f, *f)),
        }
    }
    Some(Ringing { frequency, share: best, set })
}

/// Share of the variance of this number of independent values that the largest peak of noise exceeds after one engagement in ten: Baluev, Mon. Not.
/// R. Astron. Soc. 385 (2008) 1279, for his statistic z₁ without parameters besides the sinusoid.
fn least_share(independent: f64) -> f64 {
    // Bandwidth times effective duration, which for evenly spaced stamps is √(4π/12) of the duration.
    let width = 0.5 * independent * (PI / 3.0).sqrt();
    let alarms = |share: f64| width * (0.5 * independent * share).sqrt() * (1.0 - share).powf(0.5 * independent - 1.5);
    let above = (0..1000).map(|k| f64::from(k) / 1000.0).rfind(|s| independent <= 3.0 || alarms(*s) > FALSE_ALARMS);
    above.unwrap_or_default()
}

/// Bin of a time since the speeds met; every bin begins half a microsecond early, because stamps are rounded.
fn bin(since: f64) -> i64 {
    ((since + 5e-7) / BIN_S).floor() as i64
}

fn mean(points: &[(f64, f64)]) -> (f64, f64) {
    let n = points.len() as f64;
    (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n)
}

fn mean_around(points: &[(f64, f64)], t: f64) -> f64 {
    // Near the ends the window shrinks symmetrically, because a ramp would be biased otherwise.
    let reach = (0.5 * MEAN_S).min(t - points[0].0).min(points[points.len() - 1].0 - t);
    let near = points.iter().filter(|p| (p.0 - t).abs() <= reach + 1e-9);
    let (sum, n) = near.fold((0.0, 0.0), |(sum, n), p| (sum + p.1, n + 1.0));
    sum / n
}

/// Part of the sum of squares that the best sinusoid of a frequency explains.
fn share(points: &[(f64, f64)], f: f64) -> f64 {
    let (mut cc, mut ss, mut cs, mut yc, mut ys) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for &(t, y) in points {
        let (s, c) = (TAU * f * t).sin_cos();
        cc += c * c;
        ss += s * s;
        cs += c * s;
        yc += y * c;
        ys += y * s;
    }
    let determinant = cc * ss - cs * cs;
    (yc * yc * ss - 2.0 * yc * ys * cs + ys * ys * cc) / determinant
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Result for a slip after the speeds meet at 0, with samples at `rate` and a road speed of 10 m/s that is read exactly.
    fn found(rate: f64, quantum: f64, slip: impl Fn(f64) -> f64) -> Option<Ringing> {
        let time: Vec<f64> = (0..(4.0 * rate) as usize).map(|k| k as f64 / rate).collect();
        let (engine, road): (Vec<f64>, Vec<f64>) = time.iter().map(|&t| (100.0 + slip(t), 10.0)).unzip();
        after(Trace { time: &time, values: &engine }, Trace { time: &time, values: &road }, (10.0, quantum), 0.0, 3.9)
    }

    /// Noise in the band seldom has so large a peak; with a few independent values nothing can be concluded.
    #[test]
    fn a_peak_is_one_that_noise_seldom_has() {
        assert!((0.28..0.3).contains(&least_share(40.0)), "{}", least_share(40.0));
        assert!(least_share(3.0) > 0.99 && least_share(8.0) > 0.8);
        // Noise of the band from 2 to 12 Hz.
        let mut seed = 3_u64;
        let mut normal = || {
            let mut uniform = || {
                seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                (seed >> 11) as f64 / (1_u64 << 53) as f64
            };
            (0..12).map(|_| uniform()).sum::<f64>() - 6.0
        };
        let count = (0..400).filter(|_| {
            let waves: Vec<(f64, f64, f64)> = (0..40).map(|k| (2.125 + 0.25 * f64::from(k), normal(), normal())).collect();
            let slip = |t: f64| waves.iter().map(|(f, a, b)| a * (TAU * f * t).sin() + b * (TAU * f * t).cos()).sum();
            found(100.0, 0.0, slip).is_some()
        });
        let count = count.count();
        assert!((20..=60).contains(&count), "{count} of 400");
    }

    #[test]
    fn steps_of_the_readings_are_no_oscillation() {
        let ramp = |t: f64| (5.0 * t / 2.0).floor() * 2.0 - 5.0 * t;
        assert!(found(50.0, 0.0, ramp).is_some_and(|r| (r.frequency - 2.5).abs() < 0.1));
        assert!(found(50.0, 2.0, ramp).is_none());
        let rings = |t: f64| 1.5 * (TAU * 4.0 * t).sin();
        assert!(found(50.0, 2.0, rings).is_some_and(|r| (r.frequency - 4.0).abs() < 0.1));
    }
}
