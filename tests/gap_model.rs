//! The model of the data against cars that the plant itself makes up: what it takes for noise is noise, and what it finds is what was put in.

use kisspoint::campaign::{self, Recording};
use kisspoint::effects::{self, REGISTRY, Subsystem, param};
use kisspoint::gap::infer::density::{Problem, misfit};
use kisspoint::gap::infer::fit::{Fit, Free, fit};
use kisspoint::gap::infer::form::forms;
use kisspoint::gap::infer::irregular::irregular;
use kisspoint::gap::infer::posterior::posterior;
use kisspoint::gap::infer::pulsation;
use kisspoint::gap::infer::search::{Hypothesis, search};
use kisspoint::gap::model::replay::{Missing, replay, start};
use kisspoint::gap::model::tolerance::{self, Car};
use kisspoint::gap::model::track::{Channel, Track};
use kisspoint::gap::model::{filter, prepare};
use kisspoint::gap::verdict::{Verdict, conclude};
use kisspoint::plant::Phase;
use kisspoint::vehicle::Vehicle;
use std::path::Path;

/// Standard normal numbers, the same ones every time.
fn normals(mut seed: u64) -> impl FnMut() -> f64 {
    move || {
        let mut uniform = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((seed >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }
}

fn example() -> (Vec<Recording>, serde_json::Value) {
    let campaign = campaign::read(Path::new("tests/data/campaigns/example"), &Default::default()).unwrap();
    (campaign.recordings, campaign.vehicle_json)
}

/// The bundled campaign's inputs, as a car with these effects would have answered them, with white sensor noise of 0.1 rad/s.
fn made_up(change: impl Fn(&mut effects::Parameters)) -> Problem {
    made_up_under(change, |_| 0.0)
}

/// The same with a torque in N·m on the car's side that follows time alone, from the second given.
fn made_up_under(change: impl Fn(&mut effects::Parameters), torque: impl Fn(f64) -> f64) -> Problem {
    let (mut recordings, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let mut normal = normals(3);
    for r in &mut recordings {
        (r.x_to, r.t_fc, r.theta_c) = (None, None, None);
        let track = Track::new(r);
        let mut car = Car::nominal(&vehicle);
        change(&mut car.effects);
        let mut speeds = [vec![0.0; track.rows()], vec![0.0; track.rows()]];
        let begin = start(&track, &Car::nominal(&vehicle), 0, track.theta_0, 0.1);
        let missing = Missing { torque: [Vec::new(), track.time.iter().map(|t| torque(*t)).collect()], ..Missing::default() };
        replay(&track, &car, &begin, 0..track.rows(), Some(&missing), |row, now, _, _| {
            (speeds[0][row], speeds[1][row]) = (now.omega_f + 0.1 * normal(), now.omega_c + 0.1 * normal());
        });
        [r.omega_f, r.omega_c] = speeds;
    }
    let all: Vec<&Recording> = recordings.iter().collect();
    let (tracks, tolerances) = prepare::read(&all, &vehicle_json).unwrap();
    let with = prepare::disturbances(&tracks, &tolerances);
    prepare::problem(tracks, &vehicle, &tolerances, &with)
}

#[test]
fn innovations_of_the_true_car_are_white_and_of_unit_variance_at_most() {
    let problem = made_up(|_| {});
    let all = problem.all_residuals(&problem.nominal(), None);
    for (r, f) in all.iter().zip(&problem.filters) {
        for c in 0..2 {
            let v: Vec<f64> = (0..f.gains.len()).map(|k| r[2 * k + c]).collect();
            let n = v.len() as f64;
            let variance = v.iter().map(|x| x * x).sum::<f64>() / n;
            let neighbours = v.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / (n * variance);
            // Disturbances that this car does not have are allowed for, so that less than one is left.
            assert!((0.5..1.2).contains(&variance), "variance {variance}");
            assert!(neighbours.abs() < 0.3, "correlation {neighbours}");
        }
    }
}

#[test]
fn an_effect_that_is_there_is_found_and_one_more_is_not_believed() {
    let problem = made_up(|e| e[param::vehicle_mass::factor] = 1.12);
    let found = search(&problem, &|_, _| {});
    let mass = effects::find("vehicle_mass").unwrap();
    assert_eq!(found.best().effects, [mass]);
    let factor = found.best().fit.point.effects[param::vehicle_mass::factor];
    assert!((factor - 1.12).abs() < 0.06, "{factor}");
    // A set never fits worse than one that it holds.
    let base = found.base().fit.cost;
    for h in &found.hypotheses {
        assert!(h.fit.cost < base + 1.0, "{:?}: {} {base}", h.effects, h.fit.cost);
    }
}

#[test]
fn a_healthy_car_stays_healthy() {
    let found = search(&made_up(|_| {}), &|_, _| {});
    assert!(found.best().effects.is_empty(), "{:?}", found.best().effects);
}

#[test]
fn the_order_of_a_ripple_is_found() {
    let judder = effects::find("judder").unwrap();
    for order in [0.6, 1.7, 3.1] {
        let problem = made_up(|e| (e[param::judder::sine], e[param::judder::order]) = (0.2, order));
        let starts = pulsation::starts(&problem, &problem.nominal());
        let found: Vec<f64> = starts.iter().map(|(_, p)| p.effects[param::judder::order]).collect();
        assert!(starts.iter().all(|(e, _)| *e == judder) && found.iter().any(|f| (f - order).abs() < 0.01), "order {order}: {found:?}");
    }
}

/// What an order costs is that it was looked for, not how far it is from once a turn.
#[test]
fn a_ripple_is_believed_whatever_its_order() {
    let judder = effects::find("judder").unwrap();
    for order in [1.3, 3.1, 5.0] {
        let problem = made_up(|e| (e[param::judder::sine], e[param::judder::order]) = (0.1, order));
        let found = search(&problem, &|_, _| {});
        assert_eq!(found.best().effects, [judder], "order {order}");
    }
}

#[test]
fn the_forms_of_an_effect_change_an_eighth_of_it_and_add_up_in_the_innovations() {
    let problem = made_up(|_| {});
    let mass = effects::find("vehicle_mass").unwrap();
    let mut point = problem.nominal();
    point.effects[param::vehicle_mass::factor] = 1.2;
    let (here, without) = (problem.all_residuals(&point, None), problem.all_residuals(&problem.nominal(), None));
    let functions = forms(&problem, &point, &[mass]);
    assert!(functions.len() >= 10 && functions.iter().flatten().all(|f| f.is_linear()), "{}", functions.len());
    let square = |all: &mut dyn Iterator<Item = f64>| all.map(|x| x * x).sum::<f64>();
    let effect = square(&mut here.iter().zip(&without).flat_map(|(a, b)| a.iter().zip(b).map(|(a, b)| a - b)));
    let expected = square(&mut functions.iter().flatten().flat_map(|f| f.innovations.iter().copied()));
    assert!((expected / effect - 0.0144).abs() < 1e-6, "{expected} of {effect}");
    point.missing = (0..functions.len()).map(|k| if k < 2 { 0.5 } else { 0.0 }).collect();
    let both = problem.all_residuals(&point, Some(&functions));
    for (r, (a, b)) in both.iter().zip(&here).enumerate() {
        for (i, (a, b)) in a.iter().zip(b).enumerate() {
            let form = 0.5 * (functions[0][r].innovations[i] + functions[1][r].innovations[i]);
            assert!((a - b - form).abs() < 1e-9);
        }
    }
}

#[test]
fn the_larger_the_gap_the_less_its_likelihood_is_believed() {
    let [healthy, ill] = [1.0, 1.3].map(|factor| made_up(|e| e[param::vehicle_mass::factor] = factor));
    let least = |p: &Problem| p.powers.iter().copied().fold(1.0, f64::min);
    assert!(least(&healthy) > 0.9 && least(&ill) < 0.7 * least(&healthy), "{:?} {:?}", healthy.powers, ill.powers);
    // Evidence between two sets shrinks with it, while what they cost stays.
    let mass = effects::find("vehicle_mass").unwrap();
    let apart = |problem: &Problem| {
        let of = |effects: &[usize]| Hypothesis::fitted(problem, effects.to_vec(), &problem.nominal(), 12, None);
        let (with, without) = (of(&[mass]), of(&[]));
        (with.lead - without.lead, with.log_posterior - without.log_posterior)
    };
    let (lead, believed) = apart(&ill);
    assert!(lead > 0.0 && believed > 0.0 && believed < lead, "{lead} {believed}");
}

/// A law that acts where the clutch slips takes belief from the samples in which it does, and not from those before.
#[test]
fn a_gap_of_one_phase_leaves_the_others_their_power() {
    let problem = made_up(|e| e[param::friction_level::factor] = 1.4);
    let [open, slipping, _] = problem.powers;
    assert!(slipping < 0.6 && open > 0.95 && problem.power() <= slipping, "{:?}", problem.powers);
    let here = problem.all_residuals(&problem.nominal(), None);
    let whole = misfit(&here);
    assert!((problem.misfits(&here).iter().sum::<f64>() - whole).abs() < 1e-9 * whole);
}

/// Where a fit began says nothing of what it found: forms belong to the size that the effect has in the end.
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
    assert!((near.lead - far.lead).abs() < 0.3, "{} {}", near.lead, far.lead);
    // What was let go comes back as it was.
    let let_go = Hypothesis { basis: Vec::new(), formed: Fit { columns: Default::default(), ..near.formed.clone() }, ..near.clone() };
    let whole = let_go.whole(&problem);
    assert!(!whole.basis.is_empty() && (whole.lead - near.lead).abs() < 0.3, "{} {}", whole.lead, near.lead);
}

/// The example's inputs by a logger of 1 kHz: what an effect changes is nearly the same in steps of an observation, and the same where the torque pulsates.
#[test]
fn changes_in_steps_of_an_observation_are_nearly_those_of_every_row() {
    const FASTER: usize = 10;
    let (mut recordings, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let times = |v: &[f64]| v.iter().flat_map(|x| [*x; FASTER]).collect::<Vec<f64>>();
    for r in &mut recordings {
        let h = 1.0 / r.sample_rate_hz / FASTER as f64;
        (r.x_to, r.t_fc, r.theta_c, r.brake) = (None, None, None, None);
        r.time = (0..FASTER * r.time.len()).map(|k| k as f64 * h).collect();
        r.sample_rate_hz *= FASTER as f64;
        for v in [&mut r.omega_f, &mut r.omega_c, &mut r.t_e, &mut r.x_to_cmd, &mut r.theta_h] {
            *v = times(v);
        }
    }
    let all: Vec<&Recording> = recordings.iter().collect();
    let (tracks, tolerances) = prepare::read(&all, &vehicle_json).unwrap();
    let with = prepare::disturbances(&tracks, &tolerances);
    let problem = prepare::problem(tracks, &vehicle, &tolerances, &with);
    assert_eq!(problem.tracks[0].rows_per_observation, FASTER);
    let nominal = problem.nominal();
    let here = problem.residuals(0, &nominal, None);
    let from = problem.baseline(0, &nominal, None, Some(&here));
    for (parameter, value, most) in
        [(param::vehicle_mass::factor, 1.2, 0.03), (param::friction_level::factor, 0.9, 0.03), (param::judder::sine, 0.1, 0.0)]
    {
        let mut to = nominal.clone();
        to.effects[parameter] = value;
        let rows: Vec<f64> = problem.residuals(0, &to, None).iter().zip(&here).map(|(a, b)| a - b).collect();
        let steps = problem.change(0, &from, &to, None);
        let square = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>();
        let (off, whole) = (square(&mut rows.iter().zip(&steps).map(|(a, b)| a - b)), square(&mut rows.iter().copied()));
        assert!(whole > 100.0 && off <= most * most * whole, "{parameter}: {} of {}", off.sqrt(), whole.sqrt());
    }
}

/// Gusts of wind: no state of the car says when they come, and no effect of the library is named for them.
#[test]
fn what_comes_and_goes_by_itself_is_placed_and_not_named() {
    let gusts = |t: f64| 6.0 * ((1.7 * t).sin() + (3.1 * t + 0.5).sin());
    let problem = made_up_under(|_| {}, gusts);
    let found = search(&problem, &|_, _| {});
    let weights = posterior(&problem, &found, &[]);
    // A load beside the gusts is their mean: it lies in the law's own place, and is not named.
    let conclusion = conclude(&problem, &found, &weights);
    assert_eq!(
        (conclusion.verdict, conclusion.unexplained_at),
        (Verdict::Unexplained, Some(Subsystem::Driveline)),
        "{:?}",
        conclusion.effects
    );
    assert!(weights.of_place(Subsystem::Driveline) > 0.95, "{}", weights.of_place(Subsystem::Driveline));
}

/// A torque that changes every 40 ms, as often up as down: nothing that a car does on average.
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
fn a_brake_is_no_gap() {
    let (mut recordings, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let r = recordings.iter_mut().find(|r| r.manoeuvre == "open_rev").unwrap();
    // From the middle on the car's side is pulled by 100 N·m that nobody reports.
    let half = r.time.len() / 2;
    let begin = r.time[half];
    let speed = r.omega_c[half];
    for k in half..r.time.len() {
        r.omega_c[k] = (speed - 100.0 / 0.6 * (r.time[k] - begin)).max(0.0);
    }
    let marked: Vec<bool> = (0..r.time.len()).map(|k| k >= half).collect();
    let cost = |brake: Option<Vec<bool>>| {
        let track = Track::new(&Recording { brake, ..r.clone() });
        let (_, tolerances) = prepare::read(&[&*r], &vehicle_json).unwrap();
        let with = prepare::disturbances(std::slice::from_ref(&track), &tolerances);
        let filter = prepare::filter_of(&track, &vehicle, &with);
        let n = track.observations();
        let all = kisspoint::gap::model::replay::innovations(&track, &filter, &Car::nominal(&vehicle), track.theta_0, None);
        assert_eq!(all.len(), 2 * n);
        misfit(&[(0..n).map(|k| all[2 * k + 1]).collect()]) / n as f64
    };
    let (without, with) = (cost(None), cost(Some(marked)));
    assert!(with < 4.0 && without > 20.0 * with, "marked {with}, not marked {without}");
}

#[test]
fn derivatives_that_are_kept_lead_to_the_same_mode() {
    let problem = made_up(|e| e[param::friction_level::factor] = 1.15);
    let level = [effects::find("friction_level").unwrap()];
    let base = fit(&problem, Free::default(), &problem.nominal(), 12, None);
    let fresh = fit(&problem, Free { effects: &level, basis: None }, &problem.nominal(), 12, None);
    let kept = fit(&problem, Free { effects: &level, basis: None }, &base.point, 12, Some(&base.columns));
    assert!((fresh.cost - kept.cost).abs() < 1.0, "{} {}", fresh.cost, kept.cost);
    let factor = |f: &kisspoint::gap::infer::fit::Fit| f.point.effects[param::friction_level::factor];
    assert!((factor(&fresh) - factor(&kept)).abs() < 0.01 && (factor(&fresh) - 1.15).abs() < 0.05);
    assert_eq!(REGISTRY[level[0]].id, "friction_level");
}

#[test]
fn samples_that_are_not_there_are_not_made_up() {
    let (mut recordings, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let r = &mut recordings[0];
    (1..r.omega_c.len()).step_by(2).for_each(|k| r.omega_c[k] = f64::NAN);
    let (tracks, tolerances) = prepare::read(&[&*r], &vehicle_json).unwrap();
    let with = prepare::disturbances(&tracks, &tolerances);
    let f = filter::filter(&tracks[0], &vehicle, &with, &[]);
    let known = |c: usize| f.gains.iter().filter(|g| g.weight[c] > 0.0).count();
    assert_eq!(known(0), tracks[0].observations());
    assert_eq!(known(1), tracks[0].observations().div_ceil(2));
    assert!(tracks[0].measured[Channel::OmegaC as usize].iter().any(|v| v.is_nan()));
}

#[test]
fn speeds_that_cross_while_the_clutch_is_open_are_not_locked() {
    let (mut recordings, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let r = &mut recordings[0];
    let n = r.time.len();
    // Open all along; the disc's speed passes the flywheel's in the middle.
    for k in 0..n {
        let part = k as f64 / n as f64;
        (r.x_to_cmd[k], r.omega_f[k], r.omega_c[k]) = (vehicle.actuator.x_cnt_0 - 0.5, 100.0, 60.0 + 80.0 * part);
    }
    let (tracks, tolerances) = prepare::read(&[&*r], &vehicle_json).unwrap();
    let with = prepare::disturbances(&tracks, &tolerances);
    assert!(filter::filter(&tracks[0], &vehicle, &with, &[]).phase.iter().all(|p| *p != Phase::Locked));
    // Closed while they are equal, then commanded open: locked until they part.
    for k in 0..n {
        let slip = if k < n / 2 { 0.0 } else { 40.0 * (k - n / 2) as f64 / n as f64 };
        let closed = k < n / 4;
        r.x_to_cmd[k] = if closed { vehicle.actuator.x_cls_0 } else { vehicle.actuator.x_cnt_0 - 0.5 };
        (r.omega_f[k], r.omega_c[k]) = (100.0, 100.0 - slip);
    }
    let (tracks, tolerances) = prepare::read(&[&*r], &vehicle_json).unwrap();
    let with = prepare::disturbances(&tracks, &tolerances);
    let locked: Vec<bool> = filter::filter(&tracks[0], &vehicle, &with, &[]).phase.iter().map(|p| *p == Phase::Locked).collect();
    let last = locked.iter().rposition(|l| *l).unwrap();
    assert!(locked[..last].iter().all(|l| *l), "a lock that nothing shows to end goes on");
    assert!((locked.len() / 2..locked.len() * 2 / 3).contains(&last), "{last} of {}", locked.len());
}

/// Two cars whose torques and inertias differ by one factor move alike: a likelihood that tells them apart judges the corrections, not the car.
#[test]
fn a_common_factor_on_torques_and_inertias_changes_nothing() {
    let problem = made_up(|_| ());
    let misfit_of = |f: f64| {
        let mut vehicle = problem.vehicle;
        let d = &mut vehicle.driveline;
        for number in [&mut d.J_f, &mut d.J_c, &mut d.b_f, &mut d.b_c, &mut d.T_L0, &mut d.k_L] {
            *number *= f;
        }
        let friction = &mut vehicle.friction;
        for number in [&mut friction.mu_0, &mut friction.alpha_1, &mut friction.m_0, &mut friction.m_1, &mut friction.m_2] {
            *number *= f;
        }
        // As warm under more heat.
        let thermal = &mut vehicle.thermal;
        for number in [&mut thermal.C_1, &mut thermal.C_b, &mut thermal.gamma_1, &mut thermal.gamma_2] {
            *number *= f;
        }
        let changed = kisspoint::gap::infer::density::Problem { vehicle, ..problem.clone() };
        let mut point = changed.nominal();
        point.effects[param::engine_torque_gain::gain] = f;
        misfit(&changed.all_residuals(&point, None))
    };
    let (plain, scaled) = (misfit_of(1.0), misfit_of(1.08));
    assert!((plain - scaled).abs() < 0.01 * plain, "{plain} {scaled}");
}

#[test]
fn an_effect_far_below_its_usual_size_is_no_effect() {
    use kisspoint::gap::infer::search::moments;
    let level = effects::find("friction_level").unwrap();
    let nats = |factor: f64| {
        let problem = made_up(|e| e[param::friction_level::factor] = factor);
        let free = Free { effects: &[level], basis: None };
        moments(&fit(&problem, free, &problem.nominal(), 12, None), &[level])
    };
    let (usual, tiny) = (nats(1.15), nats(1.005));
    assert!(tiny < usual - 2.0, "{usual} {tiny}");
}

#[test]
fn a_wheel_that_shows_nothing_yet_stands_nearly_still() {
    let mut problem = made_up(|_| ());
    let misfit_of = |p: &Problem| misfit(&p.all_residuals(&p.nominal(), None)) / p.samples() as f64;
    let whole = misfit_of(&problem);
    // The disc's sensor has a threshold of 3 rad/s.
    for track in &mut problem.tracks {
        track.measured[Channel::OmegaC as usize].iter_mut().filter(|v| v.abs() < 3.0).for_each(|v| *v = f64::NAN);
    }
    let (_, vehicle_json) = example();
    let logger = kisspoint::gap::model::tolerance::Logger::UNIFORM;
    let tolerances = kisspoint::gap::model::tolerance::read(&vehicle_json, logger).unwrap();
    let with = prepare::disturbances(&problem.tracks, &tolerances);
    let hidden = prepare::problem(problem.tracks, &problem.vehicle, &tolerances, &with);
    assert!(hidden.tracks.iter().any(|t| t.measured[Channel::OmegaC as usize][0].is_nan()), "some begin at rest");
    assert!(misfit_of(&hidden) < 1.1 * whole, "{} {whole}", misfit_of(&hidden));
}

/// A recording of the bundled vehicle as this car answers these inputs (torque, position, brake torque by row), with white noise of so many rad/s.
fn answered(
    car: &Car,
    inputs: &[[f64; 2]],
    noise: f64,
    brake: impl Fn(usize) -> bool,
    speeds: impl Fn(usize, [f64; 2]) -> [f64; 2],
) -> Recording {
    let n = inputs.len();
    let time: Vec<f64> = (0..n).map(|k| 0.01 * k as f64).collect();
    let mut r = Recording {
        name: "made up".into(),
        sample_rate_hz: 100.0,
        time,
        theta_c0: 40.0,
        theta_b0: 40.0,
        omega_f: vec![speeds(0, [0.0; 2])[0]; n],
        omega_c: vec![speeds(0, [0.0; 2])[1]; n],
        t_e: inputs.iter().map(|i| i[0]).collect(),
        x_to_cmd: inputs.iter().map(|i| i[1]).collect(),
        theta_h: vec![30.0; n],
        brake: (0..n).any(&brake).then(|| (0..n).map(&brake).collect()),
        ..Recording::default()
    };
    let track = Track::new(&r);
    let mut normal = normals(17);
    let begin = start(&track, car, 0, track.theta_0, 0.1);
    let mut found = [vec![0.0; n], vec![0.0; n]];
    replay(&track, car, &begin, 0..n, None, |row, now, _, _| {
        let truth = speeds(row, [now.omega_f, now.omega_c]);
        (found[0][row], found[1][row]) = (truth[0] + noise * normal(), truth[1] + noise * normal());
    });
    [r.omega_f, r.omega_c] = found;
    r
}

fn prepared(recording: &Recording) -> Problem {
    let (_, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let (tracks, tolerances) = prepare::read(&[recording], &vehicle_json).unwrap();
    let with = prepare::disturbances(&tracks, &tolerances);
    prepare::problem(tracks, &vehicle, &tolerances, &with)
}

/// Mean square of the innovations of a car with these effects from a time on, s.
fn mean_square_from(problem: &Problem, effects: effects::Parameters, begin: f64) -> f64 {
    let point = kisspoint::gap::infer::density::Point { effects, ..problem.nominal() };
    let time = &problem.tracks[0].time;
    let first = time.iter().position(|t| *t >= begin).unwrap();
    let all = &problem.all_residuals(&point, None)[0][2 * first..2 * time.len()];
    all.iter().map(|r| r * r).sum::<f64>() / all.len() as f64
}

#[test]
fn a_command_that_a_slow_logger_misses_is_noise_of_the_torque() {
    let (_, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let mut normal = normals(23);
    let mut wander = 0.0;
    // A slow closing, with a command that goes its own way from tick to tick.
    let inputs: Vec<[f64; 2]> = (0..150)
        .map(|k| {
            wander = 0.9 * wander + 0.08 * normal();
            [40.0, 5.3 + 0.005 * k as f64 + wander]
        })
        .collect();
    let moving = |row: usize, now: [f64; 2]| if row == 0 && now == [0.0; 2] { [150.0, 20.0] } else { now };
    let whole = answered(&Car::nominal(&vehicle), &inputs, 0.1, |_| false, moving);
    let every = |v: &[f64], step: usize| v.iter().copied().step_by(step).collect::<Vec<f64>>();
    let slow = |step: usize| Recording {
        sample_rate_hz: 100.0 / step as f64,
        time: every(&whole.time, step),
        omega_f: every(&whole.omega_f, step),
        omega_c: every(&whole.omega_c, step),
        t_e: every(&whole.t_e, step),
        x_to_cmd: every(&whole.x_to_cmd, step),
        theta_h: every(&whole.theta_h, step),
        ..whole.clone()
    };
    for step in [1, 2, 5] {
        let left = mean_square_from(&prepared(&slow(step)), effects::null(), 0.1);
        assert!((0.3..1.25).contains(&left), "every {step}: {left}");
    }
}

#[test]
fn shafts_of_a_car_that_its_brakes_hold_are_at_rest() {
    let (_, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let mut car = Car::nominal(&vehicle);
    car.effects[param::driveline_compliance::compliance] = 0.011;
    car.effects[param::driveline_compliance::damping] = 0.3;
    let idle = 100.0;
    let inputs = vec![[vehicle.driveline.b_f * idle, vehicle.actuator.x_cnt_0 - 0.5]; 400];
    // The brakes hold the car. What the flywheel shows is the same; noise of the disc's sensor would set a model's shafts swinging.
    let recording = answered(&car, &inputs, 0.4, |_| true, |_, _| [idle, 0.0]);
    let mut problem = prepared(&recording);
    let of_disc = |p: &Problem| {
        let point = kisspoint::gap::infer::density::Point { effects: car.effects, ..p.nominal() };
        p.all_residuals(&point, None)[0][200..].iter().skip(1).step_by(2).map(|r| r * r).sum::<f64>()
    };
    let held = of_disc(&problem);
    problem.filters[0].stands.fill(false);
    let swings = of_disc(&problem);
    assert!(held < 0.6 * swings, "{held} {swings}");
}

#[test]
fn a_clutch_that_opens_while_both_sides_slow_down_alike_is_not_held() {
    let (_, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let (open, closed) = (vehicle.actuator.x_cnt_0 - 0.5, vehicle.actuator.x_cls_0);
    let inputs: Vec<[f64; 2]> = (0..250).map(|k| if k < 100 { [20.0, closed] } else { [-10.0, open] }).collect();
    // Locked for a second; then the engine falls by itself and the brakes slow the car down nearly as much.
    let speeds = |k: usize, now: [f64; 2]| match k {
        0 => [150.0; 2],
        1..100 => now,
        _ => {
            let t = 0.01 * (k - 100) as f64;
            [now[0], now[0] + 0.4 * (t / 0.3).min(1.0) * (1.0 + 4.0 * (t - 0.6).max(0.0))]
        }
    };
    let recording = answered(&Car::nominal(&vehicle), &inputs, 0.1, |k| k >= 100, speeds);
    let left = mean_square_from(&prepared(&recording), effects::null(), 1.05);
    assert!(left < 1.5, "{left}");
}
