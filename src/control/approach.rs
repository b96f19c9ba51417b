//! Phase before the facings bite: limit of the torque request while no clutch torque is observed, and the speed of the bearing from the time of the bite.
//!
//! T ≤ T_s + min(r_s (t − t_s), T_m − T_s) + r_m (t − t_s) for t > t_s, and T ≤ T_s before. At the bite v = (x_touch − x_open)/(t_b − A − O), and from then on the command
//! moves no faster than [`FOLLOWED`] v, so that a slow bearing or a late touch point is not commanded further than it can follow.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | t, t_b | time since the engagement began, and that of the bite | s |
//! | T_s, t_s | torque limit at first, and the time that a bearing as planned needs | N·m, s |
//! | r_s, T_m, r_m | rate of its rise after that, level at which that rise ends, and rate of a second, unbounded rise | N·m/s, N·m, N·m/s |
//! | v | speed of the bearing on its way to the touch point | mm/s |
//! | A, O | lags of actuator and torque observer | s |

/// T_s and t_s.
const FIRST: (f64, f64) = (20.0, 0.22);

/// r_s and T_m − T_s: a touch point that is 0.4 mm late is found with them.
const SEEKING: (f64, f64) = (100.0, 25.0);

/// r_m: if no clutch torque is observed after another quarter of a second, the bearing is slow.
const WAITING: f64 = 5.0;

/// Maximum speed of the command as a share of the bearing's speed.
pub const FOLLOWED: f64 = 0.7;

/// Time of the bite in s beyond which the bearing must be slow: its command is then ahead of it and is taken back.
pub const SLOW: f64 = 0.9;

/// Greatest torque request in N·m `elapsed` s after the engagement began, while the facings have not bitten.
pub fn most(elapsed: f64) -> f64 {
    let late = (elapsed - FIRST.1).max(0.0);
    FIRST.0 + (SEEKING.0 * late).min(SEEKING.1) + WAITING * late
}

/// Speed in mm/s of a bearing that has moved `way` mm in `elapsed` s, of which `lags` s are the lags of the chain; infinite if `elapsed` is not longer than those.
pub fn speed(way: f64, elapsed: f64, lags: f64) -> f64 {
    if elapsed > lags { way / (elapsed - lags) } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_is_asked_for_the_longer_nothing_is_felt() {
        assert_eq!(most(0.1), 20.0);
        assert!((most(0.42) - 41.0).abs() < 1e-9);
        assert!((most(1.22) - 50.0).abs() < 1e-9);
        assert!((0..300).all(|k| most(0.01 * f64::from(k + 1)) >= most(0.01 * f64::from(k))));
    }

    #[test]
    fn a_bearing_s_speed_is_its_way_over_its_time() {
        assert!((speed(5.0, 2.6, 0.1) - 2.0).abs() < 1e-12);
        assert_eq!(speed(5.0, 0.1, 0.1), f64::INFINITY);
    }
}
