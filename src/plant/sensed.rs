//! Speeds as sensed: behind a first-order filter, τ ṡ + s = ω, and a dead time.
//!
//! Between two instants a speed is taken as the cubic through both speeds and accelerations, for which the filter is solved exactly: no τ is stiff, however short it is, and
//! the filter vanishes as τ goes to zero. The delay line stores the output of the filter, because filter and dead time may be interchanged.

use super::State;
use super::config::Config;
use super::history::{self, History, Signal};
use super::motion::{Motion, index};
use crate::effects::{Parameters, SignalDelay, empirical, param};

/// Delay lines of flywheel and disc.
pub const LINES: [Signal; 2] = [Signal::Flywheel, Signal::Disc];

/// Indices of flywheel and disc speed among the states.
pub const PLACES: [usize; 2] = [index::OMEGA_F, index::OMEGA_C];

#[inline]
fn delay(config: &Config, k: usize) -> SignalDelay {
    if k == 0 { config.constants.engine_speed_delay } else { config.constants.clutch_speed_delay }
}

/// Dead time of channel `k`, s.
#[inline]
pub fn dead_time(config: &Config, k: usize) -> f64 {
    delay(config, k).dead_time
}

/// Time constant of the filter of channel `k` at a speed in rad/s, s.
#[inline]
pub fn smoothing(config: &Config, k: usize, speed: f64) -> f64 {
    let learned = if config.empirical.filters { empirical::smoothing(&config.parameters, k, speed) } else { 0.0 };
    delay(config, k).smoothing + learned
}

/// Whether channel `k` has a filter, even if its time constant is zero at the current speed.
#[inline]
pub fn filters(config: &Config, k: usize) -> bool {
    delay(config, k).smoothing > 0.0 || config.empirical.filters
}

/// Current speed of channel `k` behind its filter, rad/s.
#[inline]
fn filtered(config: &Config, state: &State, k: usize) -> f64 {
    if filters(config, k) { state.filtered[k] } else { state.y[PLACES[k]] }
}

/// Sensor output of channel `k`, with its scale errors, for a speed behind filter and dead time, rad/s.
#[inline]
pub fn shown(config: &Config, k: usize, speed: f64) -> f64 {
    let scaled = if k == 1 { config.constants.clutch_speed_gain * speed } else { speed };
    if config.empirical.scales { scaled * empirical::scale(&config.parameters, k, speed) } else { scaled }
}

/// Steady speed for which the sensor of channel `k` outputs `seen`, rad/s. It is exact except that a learned scale is evaluated at a speed that still contains the scale's own
/// error.
pub fn meant(effects: &Parameters, k: usize, seen: f64) -> f64 {
    let speed = if k == 1 { seen / effects[param::clutch_speed_gain::gain] } else { seen };
    speed / empirical::scale(effects, k, speed)
}

/// Both speeds as currently sensed, without the scale errors of [`shown`], rad/s.
#[inline]
pub fn speeds(config: &Config, state: &State, history: &History) -> [f64; 2] {
    std::array::from_fn(|k| {
        let (now, dead_time) = (filtered(config, state, k), dead_time(config, k));
        if dead_time <= 0.0 {
            return now;
        }
        history.line(LINES[k]).interpolate(state.time - dead_time.min(history::LONGEST), state.time, now)
    })
}

/// Appends the present filtered speeds to the delay lines of delayed channels.
#[inline]
pub fn record(config: &Config, state: &State, history: &mut History) {
    if (0..2).any(|k| dead_time(config, k) > 0.0) {
        push(config, state, history);
    }
}

#[inline(never)]
fn push(config: &Config, state: &State, history: &mut History) {
    for k in (0..2).filter(|&k| dead_time(config, k) > 0.0) {
        history.push(LINES[k], state.time, filtered(config, state, k));
    }
}

/// Advances the filters by `h` s, in which the speeds go to those of `y`, with the accelerations at the beginning and at the end in rad/s².
pub fn advance(config: &Config, state: &mut State, y: &Motion, accelerations: [[f64; 2]; 2], h: f64) {
    for (k, place) in PLACES.into_iter().enumerate().filter(|(k, _)| filters(config, *k)) {
        let (u, v) = ([state.y[place], y[place]], accelerations.map(|a| a[k]));
        let through = |s: f64, [from, to]: [[f64; 2]; 2], h: f64| {
            let tau = 0.5 * (smoothing(config, k, from[0]) + smoothing(config, k, to[0]));
            if tau > 0.0 { filter(s, [from[0], to[0]], [from[1], to[1]], tau, h) } else { to[0] }
        };
        let (begin, end) = ([u[0], v[0]], [u[1], v[1]]);
        state.filtered[k] = if config.empirical.filters {
            // A time constant that changes with the speed is replaced by a mean over either half.
            let middle = [0.5 * (u[0] + u[1]) + 0.125 * h * (v[0] - v[1]), 1.5 * (u[1] - u[0]) / h - 0.25 * (v[0] + v[1])];
            through(through(state.filtered[k], [begin, middle], 0.5 * h), [middle, end], 0.5 * h)
        } else {
            through(state.filtered[k], [begin, end], h)
        };
    }
}

/// Response of a filter with time constant `tau` s to a ramp of slope 1 per second that began `time` s ago.
pub fn ramp(time: f64, tau: f64) -> f64 {
    if tau > 0.0 { time + tau * (-time / tau).exp_m1() } else { time }
}

/// Share of the time constant below which a step is integrated by [`GAUSS`], because the closed form would suffer from cancellation.
const SHORT: f64 = 0.5;

/// Abscissae and weights of the four-point Gauss–Legendre rule on [0, 1].
const GAUSS: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// Output of τ ṡ + s = u after `h` s from `s`, where u is the cubic with the given values and slopes at both ends.
fn filter(s: f64, [u_0, u_1]: [f64; 2], [v_0, v_1]: [f64; 2], tau: f64, h: f64) -> f64 {
    // u = u_0 + x (b + x (c + x d)), x from 0 to 1.
    let (b, rise) = (v_0 * h, u_1 - u_0);
    let (c, d) = (3.0 * rise - (2.0 * v_0 + v_1) * h, (v_0 + v_1) * h - 2.0 * rise);
    let n = h / tau;
    if n < SHORT {
        let part = |(x, w): (f64, f64)| w * (u_0 - s + x * (b + x * (c + x * d))) * (-n * (1.0 - x)).exp();
        return s + n * GAUSS.into_iter().map(part).sum::<f64>();
    }
    // The steady response is u − u'/n + u''/n² − u'''/n³, with derivatives over x; the deviation from it decays.
    let steady = |u: f64, first: f64, second: f64| u - (first - (second - 6.0 * d / n) / n) / n;
    let (from, to) = (steady(u_0, b, 2.0 * c), steady(u_1, v_1 * h, 2.0 * c + 6.0 * d));
    to + (s - from) * (-n).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Filter with the input t³ − 2t + 1, against its analytical steady response plus the decaying deviation from it.
    #[test]
    fn a_filter_of_a_cubic_is_exact_for_every_step() {
        let (u, v) = (|t: f64| t.powi(3) - 2.0 * t + 1.0, |t: f64| 3.0 * t * t - 2.0);
        for (tau, h) in [(0.05, 1e-3), (0.05, 0.0249), (0.05, 0.0251), (0.05, 0.3), (1e-5, 1e-3), (1e-9, 0.02), (0.05, 1e-9)] {
            let steady = |t: f64| u(t) - tau * v(t) + tau * tau * 6.0 * t - 6.0 * tau.powi(3);
            let expected = steady(0.7 + h) + (0.3 - steady(0.7)) * (-h / tau).exp();
            let found = filter(0.3, [u(0.7), u(0.7 + h)], [v(0.7), v(0.7 + h)], tau, h);
            assert!((found - expected).abs() < 1e-10, "time constant {tau}, step {h}: {found} against {expected}");
        }
    }

    #[test]
    fn a_sensor_shows_the_speed_that_it_is_meant_for() {
        let mut effects = crate::effects::null();
        effects[param::clutch_speed_gain::gain] = 0.8;
        assert_eq!([meant(&effects, 0, 80.0), meant(&effects, 1, 80.0)], [80.0, 100.0]);
        let config = Config::new(&crate::vehicle::Vehicle::paper(), &effects);
        assert_eq!([0, 1].map(|k| shown(&config, k, meant(&effects, k, 80.0))), [80.0; 2]);
    }

    #[test]
    fn a_ramp_trails_by_the_time_constant() {
        assert!((ramp(5.0, 0.02) - 4.98).abs() < 1e-12 && ramp(0.3, 0.0) == 0.3 && ramp(0.0, 0.02) == 0.0);
        assert!((ramp(1e-4, 0.02) - 0.5e-8 / 0.02).abs() < 1e-9);
    }
}
