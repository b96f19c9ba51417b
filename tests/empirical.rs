//! Laws that are learned for gaps that no effect of the library explains: the share that they close on recordings that did not take part in learning, and when they are
//! refused.
//!
//! `realcar` draws the cars. The tests state which law to learn, so that no search is needed first.
#![cfg(feature = "cli")]

use kisspoint::campaign::{self, ReadOptions};
use kisspoint::cli::blind::closed;
use kisspoint::effects::{self, PARAMETERS, Subsystem};
use kisspoint::gap::answer::plant_parameters;
use kisspoint::gap::empirical::{Judge, Refusal, Tried, learn_law};
use kisspoint::gap::held_out::split;
use kisspoint::gap::infer::fit::{Free, fit};
use kisspoint::gap::infer::posterior::Explanation;
use kisspoint::gap::measure::{self, Closed};
use kisspoint::gap::model::prepare;
use kisspoint::gap::retune::Followed;
use kisspoint::gap::verdict::{Conclusion, Verdict};
use kisspoint::vehicle::Vehicle;
use realcar::catalogue::{NEW, OUTSIDE};
use realcar::{Car, Kind, Place, draw_car_of};

/// The first car of this kind that is recorded at 100 Hz and without a bench.
fn everyday(seed: u64, kind: Kind) -> Car {
    let plain = |car: &Car| car.campaign.recordings.iter().all(|r| r.bench.is_none() && r.sample_rate_hz == 100.0);
    (0..1000).map(|index| draw_car_of(Place::Bench, seed, index, kind)).find(plain).unwrap()
}

/// Learns a law for a gap at `place`. Returns the attempt, and the gap on the held-out recordings: before, with the law, floor.
fn learned(car: &Car, place: Subsystem) -> (Tried, Closed) {
    learned_at(car, place, &[])
}

/// The same if the gap may also lie at other places.
fn learned_at(car: &Car, place: Subsystem, or_at: &[Subsystem]) -> (Tried, Closed) {
    let folder = tempfile::tempdir().unwrap();
    car.write(folder.path()).unwrap();
    let campaign = campaign::read(folder.path(), &ReadOptions::default()).unwrap();
    let vehicle = Vehicle::from_value(&campaign.vehicle_json).unwrap();
    let split = split(&campaign.recordings, None);
    let fitted_part: Vec<_> = split.fitted_part.iter().collect();
    let (tracks, tolerances) = prepare::read(&fitted_part, &campaign.vehicle_json).unwrap();
    let with = prepare::disturbances(&tracks, &tolerances);
    let problem = prepare::problem(tracks, &vehicle, &tolerances, &with);
    let nominal = problem.nominal();
    let explanation = Explanation {
        place: Some(place),
        probability: 1.0,
        fit: Some(fit(&problem, Free::default(), &nominal, 0, None)),
        ..Explanation::default()
    };
    let conclusion = Conclusion {
        verdict: Verdict::Unexplained,
        probability: 1.0,
        explanation,
        effects: Vec::new(),
        unexplained_at: Some(place),
        shares: vec![(place, 1.0)],
        or_at: or_at.to_vec(),
        taken_back: None,
        irregular: Vec::new(),
        mistake: None,
    };
    let null = effects::null();
    let held_out = &campaign.recordings[split.judge];
    let declared: Vec<_> = tolerances.own.iter().filter(|n| n.declared).cloned().collect();
    let floor = measure::floor(held_out, (&vehicle, &null), &declared, tolerances.declared_report, split.last_engagement);
    let floors: Vec<f64> =
        fitted_part.iter().map(|r| measure::floor(r, (&vehicle, &null), &declared, tolerances.declared_report, false)).collect();
    let judge = Judge {
        fitted_part: Followed { recordings: &split.fitted_part, floors: &floors },
        held_out,
        last_engagement: split.last_engagement,
        floor,
        nominal: &vehicle,
        tuned: (&vehicle, &null),
    };
    let tried = learn_law(&problem, &conclusion, &nominal, None, &judge).unwrap();
    let closed = Closed { noise: floor, ..Closed::of(&tried.held_out) };
    let parameters = serde_json::to_value(plant_parameters(&tried.vehicle, &tried.effects)).unwrap();
    let unseen = closed::on(&car.unseen, &car.campaign.vehicle_json, &parameters, &car.real).and_then(|c| c.fraction());
    println!(
        "unseen {unseen:.2?}; {:?} by {:?}: left out {:.2}, held out {:.2} to {:.2} rad/s above {floor:.2}: {:.0} %, {:?}",
        car.truth.effects.first().map(|e| e.id),
        tried.learned.curves.iter().map(|c| c.name).collect::<Vec<_>>(),
        tried.share_left_out(),
        closed.before,
        closed.after,
        100.0 * closed.fraction(),
        tried.refused
    );
    (tried, closed)
}

/// Facings that wear in have no formula in the library; the learned law closes the gap that they leave, also on later recordings.
#[test]
fn a_learned_law_closes_the_gap_of_recordings_that_did_not_teach_it() {
    let car = everyday(3, Kind::Outside("wear_in"));
    let (tried, closed) = learned(&car, Subsystem::Friction);
    assert_eq!((tried.laws[0], tried.refused), (Subsystem::Friction, None));
    assert!(closed.fraction() > 0.8 && tried.share_left_out() > 0.5);
    assert!(tried.stands_out());
    let parameters = serde_json::to_value(plant_parameters(&tried.vehicle, &tried.effects)).unwrap();
    let later = closed::on(&car.unseen, &car.campaign.vehicle_json, &parameters, &car.real).unwrap();
    assert!(later.fraction().unwrap() > 0.8, "{later:?}");
    for c in &tried.learned.curves {
        let sigma = tried.learned.sigma(c);
        for (i, k) in c.parameters().enumerate() {
            let (p, value) = (&PARAMETERS[k], tried.effects[k]);
            assert!((p.min..=p.max).contains(&value), "{} = {value}", p.variable);
            let pinned = c.reference == Some(i);
            assert_eq!(pinned, sigma[i] == 0.0, "{}: σ = {}", p.variable, sigma[i]);
            assert!(!pinned || value == 0.0);
            assert!(sigma[i] <= 1.01 * p.nominal, "{}: wider than its prior", p.variable);
        }
    }
}

/// Two laws are missing: the second one is learned beside the first, and closes the gap that the first leaves.
#[test]
fn a_second_law_is_learned_beside_the_first() {
    let car = everyday(3, Kind::Pair("engine_torque_lag", "road_load"));
    let (one, closed_by_one) = learned(&car, Subsystem::Engine);
    let (both, closed) = learned_at(&car, Subsystem::Engine, &[Subsystem::Driveline]);
    assert_eq!(
        (&one.laws[..], &both.laws[..], both.refused),
        (&[Subsystem::Engine][..], &[Subsystem::Engine, Subsystem::Driveline][..], None)
    );
    // A lag of the engine cannot be represented by a table of torques.
    assert!(both.learned.curves.iter().any(|c| c.name == "engine_time"));
    assert!(both.share_left_out() > one.share_left_out() + 0.03 && closed.fraction() > closed_by_one.fraction().max(0.9));
    assert_eq!(both.places, [Subsystem::Engine, Subsystem::Driveline]);
}

/// Gusts occur at any time, so no curve over a state of the plant carries over from one recording to the next.
#[test]
fn a_law_that_does_not_carry_over_is_refused() {
    let (tried, _) = learned(&everyday(3, Kind::Outside("gusts")), Subsystem::Driveline);
    assert_eq!(tried.refused, Some(Refusal::LeftOut));
    assert!(tried.share_left_out() < 0.5);
}

/// Prints how much a law learned at the true place closes, for cars with each of the effects outside the library.
#[test]
#[ignore = "takes minutes; prints a table"]
fn what_is_learned_of_each_effect_outside_the_library() {
    let chosen = |id: &str| std::env::var("KISSPOINT_EFFECTS").map_or(true, |ids| ids.split(',').any(|c| c == id));
    for (id, place) in OUTSIDE.into_iter().chain(NEW).filter(|e| chosen(e.0)) {
        let place = Subsystem::ALL.into_iter().find(|s| s.id() == place).unwrap();
        for seed in [3, 4] {
            print!("{id} ({}) ", place.id());
            learned(&everyday(seed, Kind::Outside(id)), place);
        }
    }
}
