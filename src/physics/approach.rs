//! Approach to a target whose time constant depends on the remaining distance: ė = −e/τ(e).
//!
//! A constant τ is a first-order lag; a τ in proportion to the distance, τ = e/v, is a speed limit v. The equation is solved exactly, so that no τ is stiff.

/// Distance that is left after `h` s, starting from `from` ≥ 0. `time` are the time constants in s at the `distance`s, which rise from 0; τ is linear in between and constant
/// beyond the last one.
///
/// Between two distances τ = a + b e, and the time from e_0 to e is a ln(e_0/e) + b (e_0 − e). A `from` that is not finite is returned as it is.
pub fn left<const N: usize>(distance: [f64; N], time: [f64; N], from: f64, h: f64) -> f64 {
    if !from.is_finite() {
        return from;
    }
    let (mut left, mut remaining) = (from, h);
    for k in (0..N).rev().filter(|&k| from > distance[k]) {
        let lower = distance[k];
        let b = if k + 1 < N { (time[k + 1] - time[k]) / (distance[k + 1] - lower) } else { 0.0 };
        let a = time[k] - b * lower;
        let through = if lower > 0.0 {
            a * (left / lower).ln() + b * (left - lower)
        } else if a > 0.0 {
            f64::INFINITY
        } else {
            b * left
        };
        if remaining < through {
            return within(a, b, [lower, left], remaining);
        }
        (left, remaining) = (lower, remaining - through);
    }
    0.0
}

/// Logarithm of the share of a distance that counts as zero.
const LEAST_LOGARITHM: f64 = -700.0;

/// Maximum number of search steps; bisection alone would converge within them.
const MOST_SEARCHED: usize = 60;

/// The distance e after `time` s from e_0, at least `lower`: solves a ln(e_0/e) + b (e_0 − e) = `time` by Newton's method in ln e, kept within a bracket.
fn within(a: f64, b: f64, [lower, e_0]: [f64; 2], time: f64) -> f64 {
    if b == 0.0 {
        return e_0 * (-time / a).exp();
    }
    if a == 0.0 {
        return (e_0 - time / b).max(lower);
    }
    // s = ln(e/e_0) ≤ 0: a s + b e_0 (eˢ − 1) + time = 0, whose slope over s is τ.
    let at = |s: f64| a * s + b * e_0 * s.exp_m1() + time;
    let (mut low, mut high) = if lower > 0.0 { ((lower / e_0).ln(), 0.0) } else { (-1.0, 0.0) };
    while lower == 0.0 && at(low) > 0.0 && low > LEAST_LOGARITHM {
        (low, high) = (2.0 * low, low);
    }
    let mut s = 0.5 * (low + high);
    for _ in 0..MOST_SEARCHED {
        let found = at(s);
        if found > 0.0 {
            high = s
        } else {
            low = s
        }
        let newton = s - found / (a + b * e_0 * s.exp());
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - s).abs() <= 1e-15 * next.abs() {
            break;
        }
        s = next;
    }
    e_0 * s.exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT: [f64; 4] = [0.0, 0.5, 2.0, 6.0];

    fn tau(time: [f64; 4], e: f64) -> f64 {
        let k = (0..3).rfind(|&k| e >= AT[k]).unwrap();
        time[k] + ((e - AT[k]) / (AT[k + 1] - AT[k])).min(1.0) * (time[k + 1] - time[k])
    }

    /// Compared with many small steps; several pieces give the same result as one.
    #[test]
    fn a_distance_is_closed_as_its_time_constants_say() {
        for time in [[0.02, 0.04, 0.1, 0.5], [0.1, 0.0, 0.2, 0.2], [0.0, 0.02, 0.4, 0.1], [0.02, 0.05, 0.2, 0.3], [0.0, 0.01, 0.07, 0.47]] {
            for from in [9.0, 6.0, 4.0, 1.3, 0.5, 0.2] {
                let (mut e, steps): (f64, i32) = (from, 20_000);
                let h = 0.15 / f64::from(steps);
                for k in 1..=steps {
                    let half = e * (-0.5 * h / tau(time, e).max(1e-12)).exp();
                    e *= (-h / tau(time, half).max(1e-12)).exp();
                    if k % 5_000 == 0 {
                        let found = left(AT, time, from, f64::from(k) * h);
                        assert!((found - e).abs() < 3e-3 * from, "{time:?} from {from}: {found} against {e}");
                        let pieces = (0..4).fold(from, |e, _| left(AT, time, e, 0.25 * f64::from(k) * h));
                        assert!((pieces - found).abs() < 1e-12 * from, "{time:?} from {from}: {pieces} against {found}");
                    }
                }
            }
        }
    }

    #[test]
    fn one_time_constant_is_a_lag_one_in_proportion_a_speed_and_none_a_leap() {
        let close = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found} against {expected}");
        close(left(AT, [0.08; 4], 5.0, 0.1), 5.0 * (-0.1_f64 / 0.08).exp());
        // 10 mm/s, up to the last distance.
        let speed = [0.0, 0.05, 0.2, 0.6];
        close(left(AT, speed, 5.5, 0.2), 3.5);
        close(left(AT, speed, 5.5, 0.55), 0.0);
        close(left(AT, [0.0; 4], 5.5, 1e-9), 0.0);
        // A distance without a time constant is closed at once, down to where there is a time constant again.
        close(left(AT, [0.1, 0.1, 0.0, 0.0], 9.0, 0.0), 2.0);
        close(left(AT, [0.1; 4], 0.0, 0.01), 0.0);
        assert!(left(AT, [0.1; 4], f64::NAN, 0.01).is_nan() && left(AT, [0.1; 4], f64::INFINITY, 0.01) == f64::INFINITY);
    }
}
