//! Samples that cannot be trusted: codes for "not available", spikes, and zeros below a speed sensor's threshold.
//!
//! | kind | what it is | how it is found |
//! |---|---|---|
//! | beyond | a value that no car reaches | rare, and outside the bounds of its quantity; if it is frequent, the unit is wrong, see [`super::checks`] |
//! | code | a fixed value for "not available" (0xFF… in the frame) | the channel's greatest or least value, further from the next one than all others are from each other |
//! | spike | a sample of a speed that the samples before and after it contradict | see [`spikes`] |
//! | dead band | zeros of a speed that never reads the values next to zero, though it passes through them | see [`dead_band`] |
//!
//! The first three are faults and are reported as such. A dead band is a property of the sensor: below its threshold the speed is unknown.

use super::channels::Channel;
use super::pick::Signal;
use super::table::Measurement;

/// Largest share of a channel's samples that may be faults; more of them mean another unit or channel.
const RARE: f64 = 0.05;

/// Least number of different values beside a code: two or three values do not show how far apart the channel's values lie.
const SEVERAL: usize = 8;

/// Least ratio of a spike's height to the roughness of the samples around it.
const FAR: f64 = 10.0;

/// Longest spike, samples.
const LONGEST_SPIKE: usize = 3;

/// Number of samples on either side of a spike from which the roughness of the signal is taken.
const AROUND: usize = 6;

/// Sets the faults in a recording's channel to NaN; the note says how many there are, where the first is, and what it reads.
pub(crate) fn faults(m: &Measurement, signal: &mut Signal) -> Option<String> {
    let moves = matches!(signal.channel, Channel::OmegaF | Channel::OmegaC);
    let found = take_out(&signal.time, &mut signal.values, bounds(signal.channel), moves);
    let (first, said) = said(&found)?;
    let (at, unit) = (m.row_text(first), signal.channel.spec().unit);
    Some(format!("{}: {said}, the first at {at}: {} {unit}", signal.label, shown(found[0].1)))
}

/// Like [`faults`], for any series in some unit and without bounds; `moves` tells whether it is a speed and is searched for spikes.
pub(crate) fn faults_of((name, unit): (&str, &str), time: &[f64], values: &mut [f64], moves: bool) -> Option<String> {
    let found = take_out(time, values, None, moves);
    let (first, said) = said(&found)?;
    Some(format!("{name}: {said}, the first at {:.3} s: {} {unit}", time[first], shown(found[0].1)))
}

/// Formats a value that may have been converted: three decimals, without trailing zeros.
fn shown(value: f64) -> String {
    format!("{value:.3}").trim_end_matches('0').trim_end_matches('.').to_string()
}

/// Index of the sample, its value and the reason.
type Fault = (usize, f64, &'static str);

/// Index of the first fault, and a text that says how many there are and of which kinds.
fn said(found: &[Fault]) -> Option<(usize, String)> {
    let mut kinds: Vec<&str> = found.iter().map(|(_, _, kind)| *kind).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let count = found.len();
    let samples = if count == 1 { "1 sample is" } else { &format!("{count} samples are") };
    Some((found.first()?.0, format!("{samples} not believed and left out ({})", kinds.join(", "))))
}

/// Sets faults to NaN and returns them in order.
fn take_out(time: &[f64], values: &mut [f64], bounds: Option<(f64, f64)>, moves: bool) -> Vec<Fault> {
    let mut found = Vec::new();
    if quantum(values) == 0.0 {
        return found;
    }
    let mut take = |values: &mut [f64], at: Vec<usize>, why| {
        found.extend(at.into_iter().map(|i| (i, std::mem::replace(&mut values[i], f64::NAN), why)));
    };
    let at = bounds.map_or_else(Vec::new, |bounds| beyond(bounds, values));
    take(values, at, "no car reaches that value");
    let at = code(values);
    take(values, at, "a code for \"not available\"");
    if moves {
        let at = spikes(time, values);
        take(values, at, "contradicted by the samples around");
    }
    found.sort_unstable_by_key(|(i, _, _)| *i);
    found
}

/// Bounds of a channel's values, in our units.
fn bounds(channel: Channel) -> Option<(f64, f64)> {
    match channel {
        Channel::OmegaF | Channel::OmegaC => Some((-1500.0, 1500.0)),
        Channel::TE | Channel::TFc => Some((-3000.0, 3000.0)),
        Channel::XToCmd | Channel::XTo => Some((-100.0, 100.0)),
        Channel::ThetaH => Some((-60.0, 200.0)),
        Channel::ThetaC => Some((-60.0, 1000.0)),
        Channel::Time | Channel::Brake | Channel::Valid => None,
    }
}

/// Samples outside the bounds of the quantity, if they are rare.
fn beyond((low, high): (f64, f64), values: &[f64]) -> Vec<usize> {
    let at: Vec<usize> = (0..values.len()).filter(|&i| values[i] < low || values[i] > high).collect();
    if is_rare(at.len(), values) { at } else { Vec::new() }
}

fn is_rare(count: usize, values: &[f64]) -> bool {
    count as f64 <= RARE * values.iter().filter(|v| !v.is_nan()).count() as f64
}

/// Samples at an extreme value that stands apart from all others, if they are rare.
fn code(values: &[f64]) -> Vec<usize> {
    let there = || values.iter().copied().filter(|v| !v.is_nan());
    let extreme = |pick: fn(f64, f64) -> f64| {
        let outer = there().reduce(pick)?;
        let rest = || there().filter(|v| *v != outer);
        let (low, high) = (rest().reduce(f64::min)?, rest().reduce(f64::max)?);
        let distance = (outer - low).abs().min((outer - high).abs());
        let at: Vec<usize> = (0..values.len()).filter(|&i| values[i] == outer).collect();
        (distance > high - low && is_rare(at.len(), values) && has_several(rest())).then_some(at)
    };
    extreme(f64::max).or_else(|| extreme(f64::min)).unwrap_or_default()
}

/// Whether a series has at least [`SEVERAL`] different values.
fn has_several(values: impl Iterator<Item = f64>) -> bool {
    let mut seen: Vec<f64> = Vec::new();
    for value in values {
        if !seen.contains(&value) {
            seen.push(value);
        }
        if seen.len() >= SEVERAL {
            return true;
        }
    }
    false
}

/// Samples of a speed, up to three in a row, that deviate to the same side from the line through the two samples before them and from the line
/// through the two after them, by more than [`FAR`] times the deviations of the surrounding samples from the lines between their neighbours.
///
/// A real speed cannot do that: to leave a line and return to it within a few samples takes two torques of opposite sign, each far larger than any
/// that acts before or after. At a kink, as where a clutch locks up, samples deviate from only one of the lines.
pub(crate) fn spikes(time: &[f64], values: &[f64]) -> Vec<usize> {
    let points = Points::of(time, values);
    let n = points.len();
    if n < 2 * AROUND {
        return Vec::new();
    }
    let mut some: Vec<f64> = (1..n - 1).step_by(n.div_ceil(100_000)).map(|k| points.off(k)).collect();
    // The median magnitude of the deviations, converted to the standard deviation of normal noise.
    let floor = quantum(values).max(super::clock::middle(&mut some) / 0.6745);
    let (mut found, mut k) = (Vec::new(), 2);
    while k + 2 < n {
        // Nearly all samples continue the line through the two before them and need no closer look.
        let (t, v) = points.at(k);
        if (v - line(points.at(k - 2), points.at(k - 1), t)).abs() <= FAR * floor {
            k += 1;
            continue;
        }
        let length = (1..=LONGEST_SPIKE).find(|&length| k + length + 1 < n && points.is_spike(k, length, floor));
        found.extend((k..k + length.unwrap_or(0)).map(|k| points.index(k)));
        k += length.unwrap_or(1);
    }
    found
}

/// The valid samples of a series.
struct Points<'a> {
    time: &'a [f64],
    values: &'a [f64],
    /// Indices of the valid samples, if some are missing.
    there: Option<Vec<usize>>,
}

impl<'a> Points<'a> {
    fn of(time: &'a [f64], values: &'a [f64]) -> Points<'a> {
        let some_missing = values.iter().any(|v| v.is_nan());
        let there = some_missing.then(|| (0..values.len()).filter(|&i| !values[i].is_nan()).collect());
        Points { time, values, there }
    }

    fn len(&self) -> usize {
        self.there.as_ref().map_or(self.values.len(), Vec::len)
    }

    fn index(&self, k: usize) -> usize {
        self.there.as_ref().map_or(k, |there| there[k])
    }

    fn at(&self, k: usize) -> (f64, f64) {
        let i = self.index(k);
        (self.time[i], self.values[i])
    }

    /// Distance of a point from the line between its neighbours.
    fn off(&self, k: usize) -> f64 {
        let (t, v) = self.at(k);
        (v - line(self.at(k - 1), self.at(k + 1), t)).abs()
    }

    /// Whether the `length` points from `k` on deviate from the lines of both sides far enough.
    fn is_spike(&self, k: usize, length: usize, floor: f64) -> bool {
        let end = k + length;
        let [b2, b1, a1, a2] = [k - 2, k - 1, end, end + 1].map(|i| self.at(i));
        let mut least = f64::INFINITY;
        for (t, v) in (k..end).map(|i| self.at(i)) {
            let (before, after) = (v - line(b2, b1, t), v - line(a1, a2, t));
            least = least.min(before.signum() * after.signum() * before.abs().min(after.abs()));
            if least <= FAR * floor {
                return false;
            }
        }
        // Points with a neighbour in the spike are left out.
        let near = (k.saturating_sub(1 + AROUND).max(1)..k - 1).chain(end + 1..(end + 1 + AROUND).min(self.len() - 1));
        least > FAR * near.map(|i| self.off(i)).fold(floor, f64::max)
    }
}

/// Value at `t` of the line through two points.
fn line(a: (f64, f64), b: (f64, f64), t: f64) -> f64 {
    a.1 + (b.1 - a.1) * (t - a.0) / (b.0 - a.0)
}

/// Quantisation step: the least difference of consecutive values beyond rounding errors; 0 for a series that never changes.
pub(crate) fn quantum(values: &[f64]) -> f64 {
    let mut there = values.iter().copied().filter(|v| !v.is_nan());
    let Some(mut before) = there.next() else { return 0.0 };
    let mut least = f64::INFINITY;
    for v in there.take(200_000) {
        let step = (v - before).abs();
        if step > 1e-9 * (1.0 + v.abs()) {
            least = least.min(step);
        }
        before = v;
    }
    if least.is_finite() { least } else { 0.0 }
}

/// Samples that a dead band must hide for its zeros to be left out, see [`dead_band`].
pub(crate) const SURE: f64 = 3.0;

/// Samples that a dead band must hide to be mentioned.
pub(crate) const LIKELY: f64 = 1.5;

/// Threshold below which a speed sensor reads zero, and the indices of its zeros; `None` without a dead band.
///
/// The threshold is the smallest magnitude other than zero. It marks a dead band if a speed that goes on changing at its rate next to the zeros should have been
/// sampled in between: if it takes more than `samples` samples from zero to that value, at more than half of the places where zero is left or reached.
pub(crate) fn dead_band(time: &[f64], values: &[f64], samples: f64) -> Option<(f64, Vec<usize>)> {
    let threshold = values.iter().map(|v| v.abs()).filter(|v| *v > 0.0).reduce(f64::min)?;
    let zeros: Vec<usize> = (0..values.len()).filter(|&i| values[i] == 0.0).collect();
    if zeros.len() < 3 || threshold < 2.5 * quantum(values) {
        return None;
    }
    let points = Points::of(time, values);
    let at = |k: usize| points.at(k);
    let (mut slow, mut edges) = (0, 0);
    for k in 0..points.len().saturating_sub(4) {
        let rising = at(k).1 == 0.0 && (k + 1..k + 5).all(|i| at(i).1 != 0.0);
        let falling = at(k + 4).1 == 0.0 && (k..k + 4).all(|i| at(i).1 != 0.0);
        let ends = if rising { (at(k + 1), at(k + 4)) } else { (at(k + 3), at(k)) };
        if rising || falling {
            let step = (at(k + 4).0 - at(k).0) / 4.0;
            let slope = ((ends.1.1 - ends.0.1) / (ends.1.0 - ends.0.0)).abs();
            edges += 1;
            slow += usize::from(ends.0.1.abs() > samples * slope * step);
        }
    }
    (2 * slow > edges).then_some((threshold, zeros))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A launch at 100 Hz: standstill, kink, ramp of 40 rad/s², kink, steady speed with a 6 Hz oscillation; noise of ±0.1 rad/s, rounded to a quarter of a revolution per minute.
    fn launch() -> (Vec<f64>, Vec<f64>) {
        let time: Vec<f64> = (0..400).map(|i| f64::from(i) * 0.01).collect();
        let noise = |i: usize| f64::from((i as u32).wrapping_mul(2_654_435_761) >> 20) / 4096.0 - 0.5;
        let clean = |t: f64| {
            let ring = if t > 3.0 { 4.0 * (-(t - 3.0) / 0.2).exp() * (37.7 * (t - 3.0)).sin() } else { 0.0 };
            (40.0 * (t - 1.0)).clamp(0.0, 80.0) + ring
        };
        let values = time.iter().enumerate().map(|(i, t)| ((clean(*t) + 0.2 * noise(i)) / 0.026).round() * 0.026).collect();
        (time, values)
    }

    #[test]
    fn a_launch_with_kinks_and_ringing_has_no_fault() {
        let (time, values) = launch();
        assert_eq!(spikes(&time, &values), [0; 0]);
        assert_eq!(code(&values), [0; 0]);
        assert_eq!(dead_band(&time, &values, SURE), None);
    }

    #[test]
    fn spikes_of_one_to_three_samples_are_found_wherever_they_are() {
        for length in 1..=3 {
            for k in [20, 99, 150, 250, 299, 305, 380] {
                let (time, mut values) = launch();
                values[k..k + length].iter_mut().for_each(|v| *v -= 30.0);
                assert_eq!(spikes(&time, &values), (k..k + length).collect::<Vec<_>>(), "{length} from {k}");
            }
        }
        let (time, mut values) = launch();
        values[310] = f64::NAN;
        values[150] += 6.0;
        assert_eq!(spikes(&time, &values), [150]);
    }

    #[test]
    fn a_code_stands_apart_and_a_last_step_does_not() {
        let (_, mut values) = launch();
        values[40] = 983.025;
        values[300..310].fill(983.025);
        assert_eq!(code(&values), std::iter::once(40).chain(300..310).collect::<Vec<_>>());
        // A command of three steps, the last one far from the others.
        let command: Vec<f64> = (0..300)
            .map(|i| {
                if i < 100 {
                    3.3
                } else if i < 290 {
                    3.4
                } else {
                    8.0
                }
            })
            .collect();
        assert_eq!(code(&command), [0; 0]);
    }

    #[test]
    fn a_dead_band_is_found_with_its_threshold() {
        let (time, values) = launch();
        let sensed: Vec<f64> = values.iter().map(|v| if v.abs() < 3.0 { 0.0 } else { *v }).collect();
        let (threshold, zeros) = dead_band(&time, &sensed, SURE).unwrap();
        assert!((3.0..3.3).contains(&threshold), "{threshold}");
        assert!(zeros.len() > 100 && zeros.iter().all(|&i| i < 110));
        // A coarse sensor has no values below its step.
        let coarse: Vec<f64> = values.iter().map(|v| (v / 0.5).round() * 0.5).collect();
        assert_eq!(dead_band(&time, &coarse, SURE), None);
    }

    #[test]
    fn the_quantum_is_the_least_step_beyond_rounding() {
        for (values, least) in [
            (&[0.0, 2.0, 2.5, 4.0][..], 0.5),
            (&[4.0, 3.0, f64::NAN, 1.0], 1.0),
            (&[2.0, 2.0], 0.0),
            (&[], 0.0),
            (&[1.0, 1.0 + 1e-9, 3.0], 2.0),
        ] {
            assert!((quantum(values) - least).abs() < 1e-8, "{values:?}: {}", quantum(values));
        }
    }

    /// Tests the bounds of each quantity from both sides; values beyond them are no faults if they are frequent.
    #[test]
    fn what_no_car_reaches_is_rare_and_outside_its_bounds() {
        use Channel::{Brake, OmegaC, OmegaF, TE, TFc, ThetaC, ThetaH, XTo, XToCmd};
        let limits = [
            (OmegaF, 1500.0),
            (OmegaC, 1500.0),
            (TE, 3000.0),
            (TFc, 3000.0),
            (XToCmd, 100.0),
            (XTo, 100.0),
            (ThetaH, 200.0),
            (ThetaC, 1000.0),
        ];
        for (channel, most) in limits {
            let (low, high) = bounds(channel).unwrap();
            assert_eq!((low, high), (if matches!(channel, ThetaH | ThetaC) { -60.0 } else { -most }, most));
            let mut values = vec![1.0; 40];
            (values[3], values[5]) = (high, low);
            assert_eq!(beyond((low, high), &values), [0; 0]);
            (values[7], values[9]) = (high + 0.1, low - 0.1);
            assert_eq!(beyond((low, high), &values), [7, 9]);
            values[11] = high + 0.1;
            assert_eq!(beyond((low, high), &values), [0; 0], "three of forty are common");
        }
        assert_eq!(bounds(Brake), None);
    }

    #[test]
    fn what_is_left_out_is_said_with_its_first_sample() {
        let (time, mut values) = launch();
        (values[60], values[250]) = (5000.0, values[250] - 30.0);
        let (first, said) = said(&take_out(&time, &mut values, Some((-1500.0, 1500.0)), true)).unwrap();
        assert_eq!(first, 60);
        assert!(
            said.starts_with("2 samples are not believed") && said.contains("contradicted") && said.contains("no car reaches"),
            "{said}"
        );
        assert!(values[60].is_nan() && values[250].is_nan() && values.iter().filter(|v| v.is_nan()).count() == 2);
        let text = faults_of(
            ("n", "rad/s"),
            &time,
            &mut launch().1.iter().enumerate().map(|(k, v)| v + 30.0 * f64::from(u8::from(k == 40))).collect::<Vec<_>>(),
            true,
        );
        assert!(
            text.as_ref()
                .is_some_and(|t| t.starts_with("n: 1 sample is not") && t.contains("the first at 0.400 s: 30") && t.ends_with(" rad/s")),
            "{text:?}"
        );
        assert_eq!([1_715.623_748, 983.0, -0.5, 0.0].map(shown), ["1715.624", "983", "-0.5", "0"]);
        assert_eq!(faults_of(("n", "rad/s"), &time, &mut [2.0; 400], true), None);
        assert!(!has_several([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 1.0].into_iter()) && has_several((0..8).map(f64::from)));
    }

    /// A sample halfway up a step deviates from the lines of both sides, but in opposite directions.
    #[test]
    fn a_step_through_its_middle_is_no_spike() {
        let time: Vec<f64> = (0..60).map(|k| 0.01 * f64::from(k)).collect();
        let noise = |k: usize| 0.02 * ((k * k) as f64).sin();
        let step: Vec<f64> = (0..60)
            .map(|k| {
                noise(k)
                    + if k < 30 {
                        0.0
                    } else if k == 30 {
                        25.0
                    } else {
                        50.0
                    }
            })
            .collect();
        assert_eq!(spikes(&time, &step), [0; 0]);
        let mut spike: Vec<f64> = (0..60).map(noise).collect();
        spike[30] = 25.0;
        assert_eq!(spikes(&time, &spike), [30]);
    }
}
