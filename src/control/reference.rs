//! The two speed references of paper Figure 3.
//!
//! ω_c,ref = ω_c0 + (ω_end − ω_c0)(3a² − 2a³) + s t_r a²(a − 1), ω_f,ref = ω_f0 + (ω_end − ω_f0)(3a² − 2a³), a = t/t_r ≤ 1.
//!
//! | symbol | meaning | unit | source |
//! |---|---|---|---|
//! | ω_c0, ω_f0 | speeds when the engagement begins | rad/s | measured |
//! | ω_end | speed at which both end | rad/s | `reference_speed`; the clutch's own if it is faster |
//! | t_r | duration | s | `reference_time`, shortened when the clutch has less left to accelerate |
//! | s | slope of the clutch reference at its end: the intended slip acceleration at lock-up | rad/s² | `reference_slope` |
//!
//! The paper gives no references; this cubic reproduces its Figure 4 and Table II.

use super::settings::Settings;

/// References of one engagement, fixed when it begins.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Plan {
    /// t_r, s.
    pub duration: f64,
    /// ω_c0, rad/s.
    pub omega_c_start: f64,
    /// ω_f0, rad/s.
    pub omega_f_start: f64,
    /// ω_end, rad/s.
    pub end: f64,
    /// s, rad/s².
    pub slope: f64,
}

/// Reference speeds, rad/s.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct References {
    /// Of the engine.
    pub omega_f: f64,
    /// Of the clutch disc.
    pub omega_c: f64,
}

/// Plans an engagement from the present speeds of engine and clutch: a launch from standstill takes the whole `reference_time`, a re-engagement a share of it in proportion to
/// the speed that is left to gain, at least `reference_least_share`.
pub fn plan(s: &Settings, omega_f: f64, omega_c: f64) -> Plan {
    let end = s.reference_speed.max(omega_c);
    let left = ((end - omega_c) / s.reference_speed).min(1.0);
    Plan {
        duration: s.reference_time * left.max(s.reference_least_share),
        omega_c_start: omega_c,
        omega_f_start: omega_f,
        end,
        slope: s.reference_slope * left,
    }
}

/// References `elapsed` seconds after the engagement began.
#[inline]
pub fn references(plan: &Plan, elapsed: f64) -> References {
    let a = elapsed / plan.duration;
    if a >= 1.0 {
        return References { omega_f: plan.end, omega_c: plan.end };
    }
    let rise = a * a * (3.0 - 2.0 * a);
    References {
        omega_f: plan.omega_f_start + (plan.end - plan.omega_f_start) * rise,
        omega_c: plan.omega_c_start + (plan.end - plan.omega_c_start) * rise + plan.slope * plan.duration * a * a * (a - 1.0),
    }
}

/// Maximum speed in rad/s by which the governed clutch reference may run past the common end speed, in order to close the remaining slip.
pub const OVERRUN: f64 = 12.0;

/// References of the governed law and their slopes in rad/s²: as [`references`], but the clutch reference continues with its final slope until the slip is gone.
#[inline]
pub fn governed(plan: &Plan, elapsed: f64) -> (References, References) {
    let a = elapsed / plan.duration;
    if a >= 1.0 {
        let over = plan.slope * (elapsed - plan.duration);
        let references = References { omega_f: plan.end, omega_c: plan.end + over.min(OVERRUN) };
        return (references, References { omega_f: 0.0, omega_c: plan.slope });
    }
    let rise = 6.0 * a * (1.0 - a) / plan.duration;
    let slopes = References {
        omega_f: (plan.end - plan.omega_f_start) * rise,
        omega_c: (plan.end - plan.omega_c_start) * rise + plan.slope * a * (3.0 * a - 2.0),
    };
    (references(plan, elapsed), slopes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn references_begin_at_the_speeds_and_end_at_one() {
        let s = Settings::paper();
        for (omega_f, omega_c) in [(104.7, 0.0), (80.0, 60.0), (60.0, 130.0), (120.0, -10.0)] {
            let p = plan(&s, omega_f, omega_c);
            assert_eq!(references(&p, 0.0), References { omega_f, omega_c });
            let end = references(&p, p.duration);
            assert_eq!(end.omega_f, end.omega_c);
            assert!(end.omega_c >= omega_c && p.duration <= s.reference_time);
        }
    }

    #[test]
    fn slopes_are_those_of_the_references() {
        let p = plan(&Settings::robust(), 104.7, -3.0);
        for t in [0.1, 0.6, 1.2, 1.35] {
            let (after, before) = (governed(&p, t + 1e-6).0, governed(&p, t - 1e-6).0);
            let slopes = governed(&p, t).1;
            assert!(((after.omega_c - before.omega_c) / 2e-6 - slopes.omega_c).abs() < 1e-4, "at {t} s");
            assert!(((after.omega_f - before.omega_f) / 2e-6 - slopes.omega_f).abs() < 1e-4, "at {t} s");
        }
    }

    #[test]
    fn the_clutch_reference_rises_and_ends_with_its_slope() {
        for s in [Settings::paper(), Settings::robust()] {
            let p = plan(&s, 104.7, 0.0);
            let at = |t: f64| references(&p, t).omega_c;
            assert!((1..1000).all(|k| at(f64::from(k) * 1e-3 * p.duration) >= at(f64::from(k - 1) * 1e-3 * p.duration)));
            let slope = (at(p.duration) - at(p.duration - 1e-6)) / 1e-6;
            assert!((slope - s.reference_slope).abs() < 1e-3, "{slope}");
        }
    }
}
