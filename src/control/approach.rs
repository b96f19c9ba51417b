//! Until the facings bite: how much may be asked of a clutch that is not felt yet, and what the bite tells of the bearing.
//!
//! T ≤ T_s + r_s (t − t_s) until T_m, then + r_m (t − t_s). At the bite v = (x_touch − x_open)/(t_b − A − O), and the command goes no faster than
//! [`FOLLOWED`] v from then on: neither a bearing that is slow nor a touch point that lies late is asked for what it will only deliver later.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | t, t_b | time since the engagement began, and that of the bite | s |
//! | T_s, t_s | torque asked for at first, and how long a bearing as planned needs | N·m, s |
//! | r_s, T_m, r_m | rise after that, where it ends, and the rise beyond | N·m/s, N·m |
//! | v | speed of the bearing on its way to the touch point | mm/s |
//! | A, O | lags of actuator and torque observer | s |

/// T_s and t_s.
const FIRST: (f64, f64) = (20.0, 0.22);

/// r_s and T_m − T_s: a touch point that is 0.4 mm late is found with them.
const SEEKING: (f64, f64) = (100.0, 25.0);

/// r_m: a clutch that is not felt after a quarter of a second more has a slow bearing.
const WAITING: f64 = 5.0;

/// Share of the bearing's speed that the command takes.
pub const FOLLOWED: f64 = 0.7;

/// Time of the bite in s from which the bearing must be slow: its command is then ahead of it, and comes back.
pub const SLOW: f64 = 0.9;

/// Greatest torque in N·m that is asked for `elapsed` s after the engagement began, while nothing has bitten.
pub fn most(elapsed: f64) -> f64 {
    let late = (elapsed - FIRST.1).max(0.0);
    FIRST.0 + (SEEKING.0 * late).min(SEEKING.1) + WAITING * late
}

/// Speed of the bearing in mm/s that has gone `way` mm in `elapsed` s, of which `lags` s are those of the chain; infinite if it has not been slow.
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
