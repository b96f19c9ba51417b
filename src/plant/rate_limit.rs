//! An actuator of limited speed, which may slow down near its target, and a lag behind it.

use super::State;
use super::actuation::SHORTEST_PIECE;
use super::config::Config;
use crate::physics::lag::{self, LagState};

/// State of the lag behind a rate limit that reaches `limited` mm within `h` seconds. The input of the lag is approximated by a ramp at full speed, a ramp with the same mean
/// delay as the exponential approach (twice its time constant long), and rest for the remaining time.
pub fn behind_the_limit(config: &Config, state: &State, x_cmd: f64, limited: f64, h: f64) -> LagState {
    let c = &config.constants;
    let approach = c.approach.max(0.0);
    let full = (((x_cmd - state.limited).abs() - approach).max(0.0) * c.inverse_speed).min(h);
    let slowing = (2.0 * approach * c.inverse_speed).min(h - full);
    let there = rate_limited(c.inverse_speed, approach, state.limited, x_cmd, full);
    let mut at = state.lagged;
    for (from, to, seconds) in [(state.limited, there, full), (there, limited, slowing), (limited, limited, h - full - slowing)] {
        // A part that takes no time is a jump of the lag's input.
        if seconds > SHORTEST_PIECE {
            at = lag::advance(&c.actuator_lag, at, from, (to - from) / seconds, seconds);
        }
    }
    at
}

/// Position in mm after `h` seconds of an actuator of limited speed on its way to `to`.
#[inline]
pub fn rate_limited(inverse_speed: f64, approach: f64, from: f64, to: f64, h: f64) -> f64 {
    if inverse_speed <= 0.0 {
        return to;
    }
    let (most, distance) = (h / inverse_speed, (to - from).abs());
    if approach <= 0.0 || distance - most >= approach {
        return from + (to - from).clamp(-most, most);
    }
    // Full speed until the approach begins; from there the remaining distance decays exponentially.
    let slowing = h - (distance - approach).max(0.0) * inverse_speed;
    let left = distance.min(approach) * (-slowing / (approach * inverse_speed)).exp();
    to - left * (to - from).signum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::{actuation, events};

    /// A very fast rate limit acts like none, however long the step: the error is bounded by the time that the motion takes. With an approach, too.
    #[test]
    fn a_lag_behind_a_fast_rate_limit_is_the_lag_of_what_is_commanded() {
        use crate::effects::{null, param};
        use crate::plant::{Inputs, Start};
        let position = |inverse_speed: f64, approach: f64, steps: usize| {
            let mut effects = null();
            effects[param::actuator_lag::time_constant] = 0.01;
            effects[param::actuator_rate_limit::inverse_speed] = inverse_speed;
            effects[param::actuator_rate_limit::approach] = approach;
            let config = Config::new(&crate::vehicle::Vehicle::paper(), &effects);
            let start = Start { omega_f: 100.0, omega_c: 0.0, theta_c: 30.0, theta_b: 30.0 };
            let mut state = events::initial(&start, &Inputs { x_to: 1.0, t_e_ref: 0.0, theta_h: 25.0, t_load: 0.0 });
            (state.limited, state.lagged) = (1.0, LagState { value: 1.0, rate: 0.0 });
            for _ in 0..steps {
                actuation::advance(&config, &state, 2.0, 0.01 / steps as f64).store(&mut state);
            }
            state.lagged.value
        };
        let jumped = 2.0 - (-1.0_f64).exp();
        for inverse_speed in [0.0, 1e-13, 1e-9, 1e-6] {
            let found = position(inverse_speed, 0.0, 1);
            assert!((found - jumped).abs() < 50.0 * inverse_speed + 1e-9, "{inverse_speed}: {found}, not {jumped}");
        }
        // A limit that takes part of the step, and one that slows down on its way, against short steps.
        for (inverse_speed, approach, bound) in [(0.004, 0.0, 1e-9), (0.02, 0.0, 1e-9), (0.004, 0.2, 2e-3), (0.004, 0.6, 2e-2)] {
            let (one, fine) = (position(inverse_speed, approach, 1), position(inverse_speed, approach, 1000));
            assert!((one - fine).abs() < bound, "{inverse_speed} s/mm, {approach} mm: {one}, not {fine}");
        }
    }
}
