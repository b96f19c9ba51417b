//! The inference recovers what was put into the data.

use crate::made_up::{example, first, made_up, made_up_under};
use kisspoint::effects::{self, REGISTRY, Subsystem, param};
use kisspoint::gap::infer::coordinate::Coordinate;
use kisspoint::gap::infer::density::{Basis, Problem, WHOLE, cost, misfit};
use kisspoint::gap::infer::exchange::exchange;
use kisspoint::gap::infer::fit::{Fit, Free, LOOK, fit};
use kisspoint::gap::infer::form::forms;
use kisspoint::gap::infer::irregular::irregular;
use kisspoint::gap::infer::posterior::posterior;
use kisspoint::gap::infer::pulsation;
use kisspoint::gap::infer::search::{Hypothesis, search, taken_over};
use kisspoint::gap::infer::strained::Strained;
use kisspoint::gap::model::replay::Missing;
use kisspoint::gap::model::{missing, prepare, tolerance};

#[test]
fn an_effect_that_is_there_is_found_and_one_more_is_not_believed() {
    let problem = made_up(|e| e[param::vehicle_mass::factor] = 1.12);
    let found = search(&problem, None, &|_, _| {});
    let mass = effects::find("vehicle_mass").unwrap();
    assert_eq!(found.best().effects, [mass]);
    let factor = found.best().fit.point.effects[param::vehicle_mass::factor];
    assert!((factor - 1.12).abs() < 0.06, "{factor}");
    // A set of effects never fits worse than a subset.
    let base = found.base().fit.cost;
    for h in &found.hypotheses {
        assert!(h.fit.cost < base + 1.0, "{:?}: {} {base}", h.effects, h.fit.cost);
    }
}

#[test]
fn a_healthy_car_stays_healthy() {
    let found = search(&made_up(|_| {}), None, &|_, _| {});
    assert!(found.best().effects.is_empty(), "{:?}", found.best().effects);
}

#[test]
fn the_order_of_a_ripple_is_found() {
    let judder = effects::find("judder").unwrap();
    for order in [0.6, 1.7, 3.1] {
        let problem = made_up(|e| (e[param::judder::sine], e[param::judder::order]) = (0.2, order));
        let starts = pulsation::starts(&problem, &problem.nominal(), 0.0);
        let found: Vec<f64> = starts.iter().map(|(_, p)| p.effects[param::judder::order]).collect();
        assert!(starts.iter().all(|(e, _)| *e == judder) && found.iter().any(|f| (f - order).abs() < 0.01), "order {order}: {found:?}");
    }
}

/// The price of an order is that of having searched for it; it does not depend on the distance of the order from one per revolution.
#[test]
fn a_ripple_is_believed_whatever_its_order() {
    let judder = effects::find("judder").unwrap();
    for order in [1.3, 3.1, 5.0] {
        let problem = made_up(|e| (e[param::judder::sine], e[param::judder::order]) = (0.1, order));
        let found = search(&problem, None, &|_, _| {});
        assert_eq!(found.best().effects, [judder], "order {order}");
    }
}

/// A gain of the disc speed shifts the slip angle by tens of radians, so that the apparent order of a ripple differs from the true one until the gain is known. An effect of
/// negligible size that the search picked up on the way is dropped again.
#[test]
fn a_ripple_is_found_beside_what_moves_the_slip_angle() {
    let [judder, gain] = ["judder", "clutch_speed_gain"].map(|id| effects::find(id).unwrap());
    let order = 2.3;
    let car = made_up(|e| {
        (e[param::judder::sine], e[param::judder::order], e[param::clutch_speed_gain::gain]) = (0.1, order, 0.94);
    });
    let problem = first(4, car);
    let mut found = search(&problem, None, &|_, _| {});
    exchange(&problem, &mut found);
    let best = found.best();
    let fitted = best.fit.point.effects[param::judder::order];
    assert!(best.effects == [judder, gain] && (fitted - order).abs() < 0.01, "{:?} {fitted}", best.effects);
}

#[test]
fn the_forms_of_an_effect_change_an_eighth_of_it_and_add_up_in_the_innovations() {
    let problem = made_up(|_| {});
    let mass = effects::find("vehicle_mass").unwrap();
    let mut point = problem.nominal();
    point.effects[param::vehicle_mass::factor] = 1.2;
    let (here, without) = (problem.all_residuals(&point, None), problem.all_residuals(&problem.nominal(), None));
    let functions = forms(&problem, &point, &[mass]);
    assert!(functions.len() >= 10 && functions.iter().flat_map(|f| f.iter()).all(|f| f.is_linear()), "{}", functions.len());
    let square = |all: &mut dyn Iterator<Item = f64>| all.map(|x| x * x).sum::<f64>();
    let effect = square(&mut here.iter().zip(&without).flat_map(|(a, b)| a.iter().zip(b).map(|(a, b)| a - b)));
    let expected = functions.iter().flat_map(|f| f.iter()).map(|f| f.innovations.square()).sum::<f64>();
    assert!((expected / effect - 0.0144).abs() < 1e-6, "{expected} of {effect}");
    point.missing = (0..functions.len()).map(|k| if k < 2 { 0.5 } else { 0.0 }).collect();
    let both = problem.all_residuals(&point, Some(&functions));
    for (r, (a, b)) in both.iter().zip(&here).enumerate() {
        let mut form = vec![0.0; a.len()];
        (0..2).for_each(|k| functions[k][r].innovations.add_to(&mut form, 0.5));
        assert!(a.iter().zip(b).zip(&form).all(|((a, b), form)| (a - b - form).abs() < 1e-9));
    }
}

#[test]
fn without_recordings_the_sizes_of_a_form_are_as_likely_as_each_other() {
    let problem = made_up(|e| e[param::vehicle_mass::factor] = 1.2);
    let mass = effects::find("vehicle_mass").unwrap();
    let h = Hypothesis::fitted(&problem, vec![mass], &problem.nominal(), 12, None);
    let (_, blind) = h.formed.weighed(&problem, &h.basis, 0, [0.0; 3]);
    let expected = ((0.04_f64.powi(2) + 0.2_f64.powi(2) + 1.0) / 3.0).sqrt();
    assert!((blind.form_size - expected).abs() < 1e-6, "{} {expected}", blind.form_size);
    // With recordings, the size of the form remains uncertain within the range from the smallest to the largest of its sizes.
    assert!((0.04..=1.0).contains(&h.fit.form_size), "{}", h.fit.form_size);
}

#[test]
fn an_effect_that_sets_in_later_differs_by_its_form_alone() {
    let problem = made_up(|_| {});
    let mass = effects::find("vehicle_mass").unwrap();
    let mut point = problem.nominal();
    point.effects[param::vehicle_mass::factor] = 1.2;
    let (with, without) = (problem.all_residuals(&point, None), problem.all_residuals(&problem.nominal(), None));
    let functions = forms(&problem, &point, &[mass]);
    // Difference in the innovations of both speeds between the effect 20 ms late and the effect as it is.
    let (track, d) = (&problem.tracks[0], with[0].iter().zip(&without[0]).map(|(a, b)| a - b).collect::<Vec<_>>());
    let late = (0.02 / track.observation_interval()).round() as usize;
    assert!(late >= 1);
    let n = 2 * track.observations();
    let missed: Vec<f64> = (0..n).map(|i| if i < 2 * late { -d[i] } else { d[i - 2 * late] - d[i] }).collect();
    // The first two functions suffice to represent it.
    let [first, second] = [0, 1].map(|k| functions[k][0].innovations.values().take(n).collect::<Vec<f64>>());
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let (aa, ab, bb) = (dot(&first, &first), dot(&first, &second), dot(&second, &second));
    let (am, bm) = (dot(&first, &missed), dot(&second, &missed));
    let (x, y) = ((bb * am - ab * bm) / (aa * bb - ab * ab), (aa * bm - ab * am) / (aa * bb - ab * ab));
    let left: Vec<f64> = (0..n).map(|i| missed[i] - x * first[i] - y * second[i]).collect();
    // To the accuracy of single precision.
    assert!(dot(&left, &left) < 1e-10 * dot(&missed, &missed), "{x} {y} {}", dot(&left, &left) / dot(&missed, &missed));
    // Both functions have the same size.
    let sum = |k: usize| functions[k].iter().map(|f| f.innovations.square()).sum::<f64>();
    assert!((sum(0) / sum(1) - 1.0).abs() < 1e-6);
}

#[test]
fn the_larger_the_gap_the_less_its_likelihood_is_believed() {
    let [healthy, ill] = [1.0, 1.3].map(|factor| made_up(|e| e[param::vehicle_mass::factor] = factor));
    let least = |p: &Problem| p.steering().into_iter().fold(1.0, f64::min);
    assert!(least(&healthy) > 0.9 && least(&ill) < 0.7 * least(&healthy), "{:?} {:?}", healthy.powers, ill.powers);
    // The reciprocal powers are 1 plus half the squared relative accuracy of the laws times the excess of the file's residuals over noise, plus half of 0.005² times the number
    // of samples.
    let all = ill.all_residuals(&ill.nominal(), None);
    let (mut left, mut samples) = ([0.0; 3], [0.0; 3]);
    for (r, all) in all.iter().enumerate() {
        for (i, x) in all.iter().enumerate().filter(|(_, x)| **x != 0.0) {
            let phase = ill.filters[r].phase[(i / 2).min(ill.filters[r].phase.len() - 1)] as usize - 1;
            (left[phase], samples[phase]) =
                (left[phase] + if x.abs() > 4.0 { 4.0 * (2.0 * x.abs() - 4.0) } else { x * x }, samples[phase] + 1.0);
        }
    }
    for (c, powers) in [0.02_f64, 0.04, 0.08].into_iter().zip(ill.powers) {
        for phase in 0..3 {
            let expected = 1.0 / (1.0 + 0.5 * c * c * (left[phase] - samples[phase]).max(0.0) + 0.5 * 0.005 * 0.005 * samples[phase]);
            assert!((powers[phase] - expected).abs() < 1e-9, "{c} {phase}: {} {expected}", powers[phase]);
        }
    }
    // And the smaller, the less accurate the laws are assumed to be.
    let worst = ill.powers.map(|powers| powers.into_iter().fold(1.0, f64::min));
    assert!(worst.is_sorted_by(|a, b| a > b), "{worst:?}");
    // The less accurate the laws, the smaller the difference in evidence between two sets, while the difference in cost stays.
    let mass = effects::find("vehicle_mass").unwrap();
    let apart = |problem: &Problem| {
        let of = |effects: &[usize]| Hypothesis::fitted(problem, effects.to_vec(), &problem.nominal(), 12, None);
        let (with, without) = (of(&[mass]), of(&[]));
        // The interval takes the inaccuracy of the laws into account: it is wider than noise alone would make it.
        let (exact, variances) =
            (with.fit.exact.clone().cholesky().unwrap().inverse(), with.fit.mean_covariance.as_ref().unwrap().diagonal());
        let at = with.fit.shared.iter().position(|c| *c == Coordinate::Effect(param::vehicle_mass::factor)).unwrap();
        assert!(variances[at] > 1.05 * exact[(at, at)], "{} {}", variances[at], exact[(at, at)]);
        let by_accuracy: Vec<f64> = with.by_accuracy.iter().zip(without.by_accuracy).map(|(with, without)| with - without).collect();
        assert!(by_accuracy.is_sorted_by(|a, b| a > b), "{by_accuracy:?}");
        (with.exact_log_posterior - without.exact_log_posterior, with.log_posterior - without.log_posterior)
    };
    let (lead, believed) = apart(&ill);
    assert!(lead > 0.0 && believed > 0.0 && believed < lead, "{lead} {believed}");
}

/// A law that acts while the clutch slips lowers the power of the samples in that phase, and not of those before.
#[test]
fn a_gap_of_one_phase_leaves_the_others_their_power() {
    let problem = made_up(|e| e[param::friction_level::factor] = 1.4);
    let [open, slipping, _] = problem.steering();
    assert!(slipping < 0.6 && open > 0.95 && problem.power() <= slipping, "{:?}", problem.steering());
    let here = problem.all_residuals(&problem.nominal(), None);
    let whole = misfit(&here);
    assert!((problem.misfits(&here).iter().sum::<f64>() - whole).abs() < 1e-9 * whole);
}

/// The evidence does not depend on the start of a fit: forms are those of the effect's final size.
#[test]
fn evidence_does_not_depend_on_where_a_fit_began() {
    let problem = made_up(|e| e[param::vehicle_mass::factor] = 1.12);
    let mass = effects::find("vehicle_mass").unwrap();
    let from = |factor: f64| {
        let mut start = problem.nominal();
        start.effects[param::vehicle_mass::factor] = factor;
        Hypothesis::fitted(&problem, vec![mass], &start, 12, None)
    };
    let (near, far) = (from(1.1), from(1.6));
    assert!((near.exact_log_posterior - far.exact_log_posterior).abs() < 0.3, "{} {}", near.exact_log_posterior, far.exact_log_posterior);
    // A hypothesis whose basis was dropped to save memory is restored as it was.
    let let_go = Hypothesis { basis: Vec::new(), formed: Fit { columns: Default::default(), ..near.formed.clone() }, ..near.clone() };
    let whole = let_go.whole(&problem);
    assert!(
        !whole.basis.is_empty() && (whole.exact_log_posterior - near.exact_log_posterior).abs() < 0.3,
        "{} {}",
        whole.exact_log_posterior,
        near.exact_log_posterior
    );
}

/// A torque that changes every 40 ms with equal probability of both signs: it corresponds to no systematic behaviour of a car.
#[test]
fn something_irregular_is_seen_and_placed() {
    let torque = |t: f64| {
        let mut step = ((t / 0.04) as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        step ^= step >> 31;
        if step.wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 63 == 0 { -8.0 } else { 8.0 }
    };
    for (torque, place) in [(&torque as &dyn Fn(f64) -> f64, Some(Subsystem::Driveline)), (&|_| 0.0, None)] {
        let problem = made_up_under(|_| {}, torque);
        let (_, vehicle_json) = example();
        let tolerances = tolerance::read(&vehicle_json, prepare::logger(&problem.tracks)).unwrap();
        let with = prepare::disturbances(&problem.tracks, &tolerances);
        let nominal = problem.nominal();
        let found = irregular(&problem, &nominal, &problem.all_residuals(&nominal, None), &with);
        assert_eq!(found.as_ref().map(|f| f.places[0]), place);
        if let Some(found) = found {
            let under = prepare::problem(problem.tracks.clone(), &problem.vehicle, &tolerances, &found.with);
            let square = |p: &Problem| misfit(&p.all_residuals(&p.nominal(), None)) / p.samples() as f64;
            assert!(square(&problem) > 1.5 && (0.4..1.2).contains(&square(&under)), "{} {}", square(&problem), square(&under));
        }
    }
}

#[test]
fn derivatives_that_are_kept_lead_to_the_same_mode() {
    let problem = made_up(|e| e[param::friction_level::factor] = 1.15);
    let level = [effects::find("friction_level").unwrap()];
    let base = fit(&problem, Free::default(), &problem.nominal(), 12, None);
    let fresh = fit(&problem, Free { effects: &level, basis: None }, &problem.nominal(), 12, None);
    let kept = fit(&problem, Free { effects: &level, basis: None }, &base.point, 12, base.known());
    assert!((fresh.cost - kept.cost).abs() < 1.0, "{} {}", fresh.cost, kept.cost);
    let factor = |f: &kisspoint::gap::infer::fit::Fit| f.point.effects[param::friction_level::factor];
    assert!((factor(&fresh) - factor(&kept)).abs() < 0.01 && (factor(&fresh) - 1.15).abs() < 0.05);
    assert_eq!(REGISTRY[level[0]].id, "friction_level");
}

/// The car's friction is too high, and the fit contains a missing law of friction. When the law is extended, derivatives kept from its first part lead to the same mode as new
/// ones.
#[test]
fn derivatives_of_a_law_that_are_kept_lead_to_the_same_mode() {
    let problem = made_up(|e| e[param::friction_level::factor] = 1.15);
    let nominal = problem.nominal();
    let by_track = problem.tracks.iter().enumerate().map(|(k, track)| {
        missing::functions(
            Subsystem::Friction,
            track,
            &problem.filters[k],
            &problem.car(&nominal, Some(k)),
            problem.temperatures(&nominal, k),
        )
    });
    let by_track: Vec<Vec<Missing>> = by_track.collect();
    let mut law: Basis = (0..by_track[0].len()).map(|f| by_track.iter().map(|t| t[f].clone()).collect()).collect();
    let part = fit(&problem, Free { effects: &[], basis: Some(&law) }, &nominal, 6, None);
    // A further linear function of the law.
    let more = |r: usize| Missing { innovations: part.columns[r][0].times(0.1), ..Missing::default() };
    law.push((0..problem.tracks.len()).map(more).collect());
    let whole = |known| fit(&problem, Free { effects: &[], basis: Some(&law) }, &part.point, LOOK, known);
    let work = |known| {
        let before = problem.work.rows();
        let fit = whole(known);
        (fit, problem.work.rows() - before)
    };
    let ((fresh, much), (kept, little)) = (work(None), work(part.known_with_law()));
    assert!((fresh.cost - kept.cost).abs() < 0.5, "{} {}", fresh.cost, kept.cost);
    assert!(2 * little < much, "{little} of {much} rows");
}

#[test]
fn an_effect_far_below_its_usual_size_is_no_effect() {
    use kisspoint::gap::infer::prior::moments;
    let level = effects::find("friction_level").unwrap();
    let nats = |factor: f64| {
        let problem = made_up(|e| e[param::friction_level::factor] = factor);
        let free = Free { effects: &[level], basis: None };
        moments(&fit(&problem, free, &problem.nominal(), 12, None), &[level])
    };
    let (usual, tiny) = (nats(1.15), nats(1.005));
    assert!(tiny < usual - 2.0, "{usual} {tiny}");
}

/// If a time constant is at its bound, a step towards the priors does not drag along the unknowns that are correlated with it. The returned point is the one that belongs to
/// the stated cost.
#[test]
fn a_weighed_fit_stays_within_the_bounds() {
    let mut problem = made_up(|_| {});
    let smoothing = problem.shared.iter().position(|n| n.name == "actuator.command_smoothing").unwrap();
    // The command is logged slightly after it acted, so that the best value would be less than no smoothing.
    for track in &mut problem.tracks {
        (1..track.ticks.len()).rev().for_each(|k| track.ticks[k].x_to = track.ticks[k - 1].x_to);
    }
    let fitted = fit(&problem, Free::default(), &problem.nominal(), 12, None);
    assert_eq!(fitted.point.shared[smoothing], 0.0);
    let (_, weighed) = fitted.weighed(&problem, &Vec::new(), 0, WHOLE);
    let at = cost(&weighed.point, &problem.all_residuals(&weighed.point, None));
    assert!((at / fitted.cost - 1.0).abs() < 0.005, "{at} {}", fitted.cost);
}

/// A tolerance that is pulled by more than two and a half standard deviations is replaced by the effect of the same meaning, and the car stays the same.
#[test]
fn a_tolerance_that_is_pulled_hands_over_to_its_effect() {
    let problem = made_up(|_| {});
    let place = |name: &str| problem.shared.iter().position(|n| n.name == name).unwrap();
    let (at, mass) = (place("driveline.J_c"), effects::find("vehicle_mass").unwrap());
    let mut pulled = problem.nominal();
    pulled.shared[at] = 2.4;
    assert!(taken_over(&problem, &pulled, &[]).is_empty());
    pulled.shared[at] = 2.6;
    let found = taken_over(&problem, &pulled, &[3]);
    assert_eq!(found.len(), 1);
    let (set, point) = &found[0];
    assert_eq!((set.as_slice(), point.shared[at]), (&[3, mass][..], 0.0));
    let expected = (2.6 * problem.shared[at].sigma).exp();
    assert!((point.effects[param::vehicle_mass::factor] - expected).abs() < 1e-9);
    assert!(taken_over(&problem, &pulled, &[mass]).is_empty());
}

/// A sensor latency within three standard deviations of its declared tolerance is normal, and does not count as an effect.
#[test]
fn a_latency_that_is_declared_is_no_effect() {
    let (_, mut vehicle_json) = example();
    vehicle_json["tolerance"]["sensors.omega_c_latency"] = serde_json::json!({"abs": 0.004});
    let logger = tolerance::Logger::UNIFORM;
    let problem = Problem { shared: tolerance::read(&vehicle_json, logger).unwrap().shared, ..made_up(|_| {}) };
    let late = |id: &str, parameter: usize, by: f64| {
        let mut point = problem.nominal();
        point.effects[parameter] += by;
        problem.is_tolerated(&point, effects::find(id).unwrap())
    };
    let disc = |by| late("clutch_speed_delay", param::clutch_speed_delay::delay, by);
    assert_eq!([disc(0.0), disc(0.0119), disc(0.0121)], [true, true, false]);
    assert!(!late("engine_speed_delay", param::engine_speed_delay::delay, 0.001), "that one is not declared");
    assert!(!late("vehicle_mass", param::vehicle_mass::factor, 0.0));
}

/// A leading pair with one superfluous member: the set without that member is tried, and preferred.
#[test]
fn a_member_that_does_nothing_is_dropped() {
    let problem = made_up(|e| e[param::vehicle_mass::factor] = 1.2);
    let [mass, level] = ["vehicle_mass", "friction_level"].map(|id| effects::find(id).unwrap());
    let mut found = search(&problem, None, &|_, _| {});
    let pair = Hypothesis::fitted(&problem, vec![mass, level], &found.best().formed.point, 12, None);
    found.hypotheses.retain(|h| h.effects.is_empty());
    found.hypotheses.insert(0, pair);
    exchange(&problem, &mut found);
    assert_eq!(found.best().effects, [mass]);
    assert!((found.best().fit.point.effects[param::vehicle_mass::factor] - 1.2).abs() < 0.06);
}

/// An effect beside a missing law may be superfluous; it is dropped if the remaining set is more probable.
#[test]
fn an_effect_that_only_came_along_beside_a_law_is_dropped() {
    let gusts = |t: f64| 6.0 * ((1.7 * t).sin() + (3.1 * t + 0.5).sin());
    let problem = first(4, made_up_under(|e| e[param::engine_torque_gain::gain] = 1.15, gusts));
    let [gain, level] = ["engine_torque_gain", "friction_level"].map(|id| effects::find(id).unwrap());
    let mut found = search(&problem, None, &|_, _| {});
    let pair = Hypothesis::fitted(&problem, vec![gain, level], &found.best().formed.point, 12, None);
    found.hypotheses.retain(|h| h.effects.is_empty());
    found.hypotheses.insert(0, pair);
    let weights = posterior(&problem, &found, Strained::default());
    let beside = |set: &[usize]| weights.explanations.iter().find(|e| e.effects == set && e.place.is_some() && e.fit.is_some());
    let mut both = [gain, level];
    both.sort_unstable();
    assert!(
        beside(&both).is_some() && beside(&[gain]).is_some(),
        "{:?}",
        weights.explanations.iter().map(|e| (&e.effects, e.place)).collect::<Vec<_>>()
    );
    assert!(beside(&[gain]).unwrap().probability > beside(&both).unwrap().probability);
}
