//! Missing laws, and effects beside them.

use crate::made_up::{first, made_up_under};
use kisspoint::effects::{self, Subsystem, param};
use kisspoint::gap::infer::posterior::posterior;
use kisspoint::gap::infer::search::{Hypothesis, search};
use kisspoint::gap::infer::strained::Strained;
use kisspoint::gap::infer::unknown::{beside, places};
use kisspoint::gap::verdict::{Verdict, conclude};

/// Beside a missing law that explains the gap, an effect has size zero and therefore no form that could explain anything, however large it was at the start of the fit.
#[test]
fn an_effect_that_a_law_leaves_nothing_to_do_has_no_form() {
    let problem = made_up_under(|_| {}, |t: f64| 6.0 * ((1.7 * t).sin() + (3.1 * t + 0.5).sin()));
    let base = Hypothesis::fitted(&problem, Vec::new(), &problem.nominal(), 12, None);
    let laws = places(&problem, &base, base.exact_log_posterior);
    let gusts = laws.iter().find(|u| u.law.place == Subsystem::Driveline && u.fit.is_some()).expect("it leads");
    let point = &gusts.fit.as_ref().unwrap().point;
    let lag = effects::find("engine_torque_lag").unwrap();
    let of = |seconds: f64| {
        let mut start = point.clone();
        start.effects[param::engine_torque_lag::time_constant] = seconds;
        beside(&problem, &[lag], &gusts.law, &start, None)
    };
    let (near, far) = (of(0.001), of(0.3));
    assert!((near.log_posterior - far.log_posterior).abs() < 2.0, "{} {}", near.log_posterior, far.log_posterior);
}

/// Gusts of wind depend on no state of the car; they are located in the driveline, and no effect of the library is named for them.
#[test]
fn what_comes_and_goes_by_itself_is_placed_and_not_named() {
    let gusts = |t: f64| 6.0 * ((1.7 * t).sin() + (3.1 * t + 0.5).sin());
    let problem = first(5, made_up_under(|_| {}, gusts));
    let found = search(&problem, None, &|_, _| {});
    let weights = posterior(&problem, &found, Strained::default());
    // A road load beside the gusts is their mean. It belongs to the place of the missing law and is not named.
    let conclusion = conclude(&problem, &found, &weights);
    assert_eq!(
        (conclusion.verdict, conclusion.unexplained_at),
        (Verdict::Unexplained, Some(Subsystem::Driveline)),
        "{:?}",
        conclusion.effects
    );
    assert_eq!(conclusion.probability, weights.of_place(Subsystem::Driveline));
    assert!(weights.of_place(Subsystem::Driveline) > 0.95, "{}", weights.of_place(Subsystem::Driveline));
}
