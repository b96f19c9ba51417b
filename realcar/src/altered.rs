//! Bench campaigns that a worse logger wrote: the same cars, with one thing wrong with all their recordings.
//!
//! A car is drawn at 100 Hz as any other; what is altered here is what stands in its files, never how it drives.

use crate::channels::{Bench, Recording};
use crate::draw::{Car, Kind, Place, draw_car_sized, kind, mix};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};

/// What can be wrong with a campaign's logging.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Alteration {
    /// Every second sample is kept.
    EverySecond,
    /// Every fifth sample is kept.
    EveryFifth,
    /// The reported torque is stamped 10 ms late.
    TorqueLate10,
    /// The reported torque is stamped 20 ms late.
    TorqueLate20,
    /// Both speeds carry first-order noise, 0.9 from one sample to the next, 0.15 rad/s.
    ColouredNoise,
    /// The reported torque has another bias in each recording, 0.5 N·m.
    DriftingBias,
    /// Every second disc speed is missing.
    HalfBlank,
    /// One row in two hundred is lost.
    LostFrames,
    /// One speed sample of one recording holds 0xFFFF.
    Spike,
    /// Disc speeds below 3 rad/s read zero.
    DeadBand,
    /// All start temperatures are given as 25 °C, give or take 50 K.
    UnknownTemperatures,
    /// Samples are taken up to 4.5 ms off their tick, and stamped so.
    JitteredSamples,
    /// Stamps are up to 4.5 ms off the sample.
    JitteredStamps,
    /// Nothing is wrong, but the effect has a tenth of its usual size.
    SmallEffect,
}

use Alteration as A;

/// All of them, with the name of their row in the scores.
pub const ALTERATIONS: [(Alteration, &str); 14] = [
    (A::EverySecond, "every second sample"),
    (A::EveryFifth, "every fifth sample"),
    (A::TorqueLate10, "torque 10 ms late"),
    (A::TorqueLate20, "torque 20 ms late"),
    (A::ColouredNoise, "coloured speed noise"),
    (A::DriftingBias, "torque bias per recording"),
    (A::HalfBlank, "every second disc speed blank"),
    (A::LostFrames, "0.5 % of frames lost"),
    (A::Spike, "one sample 0xFFFF"),
    (A::DeadBand, "dead band of 3 rad/s"),
    (A::UnknownTemperatures, "start temperatures unknown"),
    (A::JitteredSamples, "jitter of the samples"),
    (A::JitteredStamps, "jitter of the stamps"),
    (A::SmallEffect, "effects of a tenth"),
];

/// The car of this index with its altered recordings: each alteration in turn, on a healthy car and on one with an effect.
pub fn draw_altered(seed: u64, index: usize) -> (Car, Alteration) {
    let alteration = ALTERATIONS[index % ALTERATIONS.len()].0;
    let round = index / ALTERATIONS.len();
    let wants = |k: Kind| match alteration {
        A::SmallEffect => matches!(k, Kind::Single(_)),
        _ if round % 2 == 0 => k == Kind::Healthy,
        _ => matches!(k, Kind::Single(_)),
    };
    let size = if alteration == A::SmallEffect { 0.1 } else { 1.0 };
    let mut car = (index * 1000..)
        .filter(|&i| wants(kind(Place::Bench, seed, i)))
        .map(|i| draw_car_sized(Place::Bench, seed, i, kind(Place::Bench, seed, i), size))
        .find(|car| car.campaign.recordings[0].sample_rate_hz == 100.0)
        .expect("most cars are logged at 100 Hz");
    let mut rng = StdRng::seed_from_u64(mix(seed, 0xa17e, index));
    let count = car.campaign.recordings.len();
    let spiked = rng.random_range(0..count);
    for (k, r) in car.campaign.recordings.iter_mut().enumerate() {
        alter(r, alteration, k == spiked, &mut rng);
    }
    (car, alteration)
}

fn alter(r: &mut Recording, alteration: Alteration, spiked: bool, rng: &mut StdRng) {
    match alteration {
        A::EverySecond => thin(r, 2),
        A::EveryFifth => thin(r, 5),
        A::TorqueLate10 => late(&mut r.t_e_nm, 1),
        A::TorqueLate20 => late(&mut r.t_e_nm, 2),
        A::ColouredNoise => {
            coloured(&mut r.omega_f_rad_s, rng);
            coloured(&mut r.omega_c_rad_s, rng);
        }
        A::DriftingBias => {
            let bias = (5.0 * normal(rng)).round() * 0.1;
            r.t_e_nm.iter_mut().for_each(|t| *t += bias);
        }
        A::HalfBlank => r.omega_c_rad_s.iter_mut().skip(1).step_by(2).for_each(|w| *w = f64::NAN),
        A::LostFrames => {
            let kept: Vec<bool> = (0..r.time_s.len()).map(|i| i == 0 || !rng.random_bool(0.005)).collect();
            retain(r, |i| kept[i]);
        }
        A::Spike => {
            let at = rng.random_range(r.time_s.len() / 5..r.time_s.len());
            // A speed channel of 0.015 rad/s per bit.
            let value = 65535.0 * 0.015;
            match (spiked, rng.random_bool(0.5)) {
                (true, true) => r.omega_f_rad_s[at] = value,
                (true, false) => r.omega_c_rad_s[at] = value,
                _ => {}
            }
        }
        A::DeadBand => r.omega_c_rad_s.iter_mut().filter(|w| w.abs() < 3.0).for_each(|w| *w = 0.0),
        A::UnknownTemperatures => {
            (r.theta_c0_deg_c, r.theta_b0_deg_c, r.theta_sigma_k) = (25.0, 25.0, Some([50.0; 2]));
        }
        A::JitteredSamples => {
            let to: Vec<f64> = jittered(r, rng);
            let mut sensed = vec![&mut r.omega_f_rad_s, &mut r.omega_c_rad_s];
            if let Some(Bench { x_to_mm, t_fc_nm, theta_c_deg_c }) = &mut r.bench {
                sensed.extend([x_to_mm, t_fc_nm, theta_c_deg_c]);
            }
            for column in sensed {
                *column = resample(&r.time_s, column, &to);
            }
            // What is commanded holds from its tick on: a sample before the tick still sees the last command.
            for column in [&mut r.t_e_nm, &mut r.x_to_cmd_mm] {
                let was = column.clone();
                (1..was.len()).filter(|&i| to[i] < r.time_s[i]).for_each(|i| column[i] = was[i - 1]);
            }
            r.time_s = to;
        }
        A::JitteredStamps => r.time_s = jittered(r, rng),
        A::SmallEffect => {}
    }
}

fn normal(rng: &mut StdRng) -> f64 {
    StandardNormal.sample(rng)
}

fn thin(r: &mut Recording, every: usize) {
    r.sample_rate_hz /= every as f64;
    retain(r, |i| i % every == 0);
}

fn retain(r: &mut Recording, keep: impl Fn(usize) -> bool) {
    let mut columns =
        vec![&mut r.time_s, &mut r.omega_f_rad_s, &mut r.omega_c_rad_s, &mut r.t_e_nm, &mut r.x_to_cmd_mm, &mut r.theta_h_deg_c];
    if let Some(Bench { x_to_mm, t_fc_nm, theta_c_deg_c }) = &mut r.bench {
        columns.extend([x_to_mm, t_fc_nm, theta_c_deg_c]);
    }
    for column in columns {
        let mut i = 0;
        column.retain(|_| {
            i += 1;
            keep(i - 1)
        });
    }
}

fn late(column: &mut [f64], samples: usize) {
    for i in (1..column.len()).rev() {
        column[i] = column[i.saturating_sub(samples)];
    }
}

fn coloured(column: &mut [f64], rng: &mut StdRng) {
    let mut noise = 0.15 * normal(rng);
    for w in column {
        *w += noise;
        noise = 0.9 * noise + 0.15 * (1.0f64 - 0.81).sqrt() * normal(rng);
    }
}

/// The recording's stamps, all but the first up to 4.5 ms off, to a tenth of a millisecond.
fn jittered(r: &Recording, rng: &mut StdRng) -> Vec<f64> {
    let off = |i: usize, rng: &mut StdRng| if i == 0 { 0.0 } else { f64::from(rng.random_range(-45..=45)) * 1e-4 };
    r.time_s.iter().enumerate().map(|(i, t)| t + off(i, rng)).collect()
}

/// A column of even samples at other times, by straight lines.
fn resample(time: &[f64], column: &[f64], to: &[f64]) -> Vec<f64> {
    let dt = time[1] - time[0];
    let at = |t: f64| {
        let i = ((t / dt) as usize).min(column.len() - 2);
        column[i] + (column[i + 1] - column[i]) * (t / dt - i as f64)
    };
    to.iter().map(|&t| at(t)).collect()
}
