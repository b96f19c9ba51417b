//! Campaigns without a position: engine, driveline and sensors are diagnosed, effects hidden in the clutch torque are not, and inputs that fit no such car are refused.
//!
//! The campaigns are bundled ones without their position, some with an artificial fault of the torque report.

use kisspoint::campaign::{self, Campaign, ReadOptions};
use kisspoint::effects::REGISTRY;
use kisspoint::gap::answer::Answer;
use kisspoint::gap::diagnosis::diagnose;
use kisspoint::gap::infer::density::Problem;
use kisspoint::gap::model::{prepare, replay, unknown_clutch::HIDDEN};
use kisspoint::gap::verdict::Verdict;
use kisspoint::vehicle::Vehicle;
use std::path::Path;

/// The bundled campaign without its position; its car has a kiss point that moves with heat.
fn without_position() -> Campaign {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/campaigns/example");
    let mut campaign = campaign::read(&folder, &ReadOptions::default()).unwrap();
    for r in &mut campaign.recordings {
        r.x_to_cmd.clear();
        r.x_to = None;
    }
    campaign
}

/// A launch, a rev and locked drives of that campaign, with a torque report that is too large by the factor `times`.
fn reported(times: f64) -> Campaign {
    let mut campaign = without_position();
    campaign.recordings.retain(|r| ["r01", "r03", "r05", "r07", "r09"].contains(&r.name.as_str()));
    campaign.recordings.iter_mut().flat_map(|r| &mut r.t_e).for_each(|t| *t *= times);
    campaign
}

fn answer(campaign: &Campaign) -> Answer {
    diagnose(campaign, &|_, _| {}).unwrap().answer
}

fn problem(campaign: &Campaign) -> Problem {
    let vehicle = Vehicle::from_value(&campaign.vehicle_json).unwrap();
    let all: Vec<_> = campaign.recordings.iter().collect();
    let (tracks, tolerances) = prepare::read(&all, &campaign.vehicle_json).unwrap();
    let with = prepare::disturbances(&tracks, &tolerances);
    prepare::problem(tracks, &vehicle, &tolerances, &with)
}

/// A fault of the kiss point is invisible without a position, and is not attributed to visible effects. The answer says what is hidden, and what to record.
#[test]
fn what_hides_is_not_assessable_and_nothing_else_is_blamed() {
    let answer = answer(&without_position());
    assert_eq!(answer.verdict, Verdict::NoGap, "{}", answer.sentence);
    for entry in REGISTRY.iter().filter(|e| HIDDEN.contains(&e.effect.subsystem)) {
        let open = answer.which.not_assessable.iter().find(|n| n.id == entry.id);
        assert!(open.is_some_and(|n| n.measure.contains("x_to_cmd_mm")), "{}", entry.id);
    }
    let seen = |id: &str| answer.which.not_assessable.iter().all(|n| n.id != id);
    assert!(["engine_torque_gain", "engine_torque_lag", "vehicle_mass", "clutch_speed_delay"].into_iter().all(seen));
    assert!(answer.notes.iter().any(|n| n.contains("x_to_cmd_mm is not recorded in r01, r02")), "{:?}", answer.notes);
    // The replay is given the clutch torque, and follows the car with the fitted numbers.
    assert!(answer.how_far.after.0 < 3.0 * answer.how_far.noise_floor.0, "{} {}", answer.how_far.after.0, answer.how_far.noise_floor.0);
    // The clutch was never observed in operation.
    assert!(answer.domain.places.is_empty());
}

#[test]
fn a_report_that_is_off_by_a_factor_is_found() {
    let answer = answer(&reported(1.0 / 0.85));
    assert_eq!(answer.verdict, Verdict::Explained, "{}", answer.sentence);
    let [effect] = answer.which.effects.as_slice() else { panic!("{}", answer.sentence) };
    let gain = effect.parameters["gain"].value.0;
    assert!(effect.id == "engine_torque_gain" && (gain - 0.85).abs() < 0.02, "{} {gain}", effect.id);
    assert!(answer.how_far.closed_fraction.0 > 0.9);
}

/// The torque of a different engine is not a torque gain.
#[test]
fn inputs_of_another_car_do_not_fit() {
    let answer = answer(&reported(3.0));
    assert_eq!(answer.verdict, Verdict::InputsDoNotFit, "{}", answer.sentence);
    assert!(answer.sentence.starts_with("These inputs do not fit this vehicle: "));
    assert!(answer.place.primary.is_none() && answer.place.subsystems.is_empty() && answer.which.effects.is_empty());
}

/// Changes of the bearing, the facings or the temperatures do not change a residual of such recordings by a single bit, so derivatives alone show that nothing is known about
/// them.
#[test]
fn nothing_that_hides_moves_a_replay() {
    let problem = problem(&without_position());
    let nominal = problem.nominal();
    let before = problem.residuals(0, &nominal, None);
    for entry in &REGISTRY {
        let mut point = nominal.clone();
        entry.effect.starts[0].iter().for_each(|&(k, v)| point.effects[k] = v);
        let same = problem.residuals(0, &point, None) == before;
        assert_eq!(same, HIDDEN.contains(&entry.effect.subsystem), "{}", entry.id);
    }
}

/// The torque that the filter estimates satisfies the flywheel's balance, and the disc's balance closes with it: the innovations are white with unit variance.
#[test]
fn both_balances_close_with_one_torque() {
    let problem = problem(&without_position());
    let nominal = problem.nominal();
    let (mut squares, mut count) = (0.0, 0.0);
    for (k, (track, filter)) in problem.tracks.iter().zip(&problem.filters).enumerate() {
        let mut most = 0.0_f64;
        let e = replay::corrected(track, filter, &problem.car(&nominal, Some(k)), track.theta_0, None, |_, now, _| {
            most = most.max(now.t_fc.abs())
        });
        assert!(most < 200.0, "{}: {most} N·m", track.name);
        for j in (0..track.observations()).filter(|j| filter.pinned[*j]) {
            assert_eq!(e[2 * j], 0.0);
            squares += e[2 * j + 1].powi(2);
            count += 1.0;
        }
    }
    assert!(count > 1000.0 && (0.7..1.5).contains(&(squares / count)), "{} of {count}", squares / count);
}

/// A sensor that shows the disc speed 50 ms late: lock-up is still found at the right time, and no other cause is named.
#[test]
fn a_late_disc_speed_is_found() {
    let mut campaign = without_position();
    campaign.recordings.retain(|r| ["r01", "r03", "r05", "r07", "r09"].contains(&r.name.as_str()));
    for r in &mut campaign.recordings {
        let by = (0.05 * r.sample_rate_hz).round() as usize;
        let first = r.omega_c[0];
        r.omega_c.rotate_right(by);
        r.omega_c[..by].fill(first);
    }
    let answer = answer(&campaign);
    let [effect] = answer.which.effects.as_slice() else { panic!("{}", answer.sentence) };
    let (delay, smoothing) = (effect.parameters["delay"].value.0, effect.parameters["smoothing"].value.0);
    assert!(effect.id == "clutch_speed_delay" && (delay + smoothing - 0.05).abs() < 0.006, "{} {delay} {smoothing}", effect.id);
}

/// A campaign may contain recordings with and without a position; those with one show what is hidden in the others.
#[test]
fn recordings_with_and_without_a_position_go_together() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/campaigns/example");
    let mut campaign = campaign::read(&folder, &ReadOptions::default()).unwrap();
    campaign.recordings[7].x_to_cmd.clear();
    let problem = problem(&campaign);
    let mut point = problem.nominal();
    point.shared.fill(0.5);
    let all = problem.all_residuals(&point, None);
    assert!(all.iter().flatten().all(|e| e.is_finite()));
    assert!(problem.tracks.iter().filter(|t| t.position_free).count() == 1);
}
