//! Properties of a logger and its sensors are distinguished from the behaviour of the car: commands between samples, coloured noise.

use crate::made_up::{answered, answered_at, example, mean_square_from, normals, prepared, shown};
use crate::thinned::every;
use kisspoint::campaign::{self, Campaign, Recording};
use kisspoint::effects;
use kisspoint::gap::diagnosis::diagnose;
use kisspoint::gap::infer::sensors::{minus_two_log_likelihood, refined};
use kisspoint::gap::model::noise::Noise;
use kisspoint::gap::model::prepare;
use kisspoint::gap::model::tolerance::Car;
use kisspoint::gap::model::track::Channel;
use kisspoint::gap::verdict::Verdict;
use kisspoint::vehicle::Vehicle;
use std::path::Path;

/// Inputs (torque, position) of a clutch that closes slowly from 5.3 mm on, by `closes` mm per row, plus a first-order autoregressive disturbance whose innovations have a
/// standard deviation of `wanders` mm.
fn wandering(rows: u32, seed: u64, closes: f64, wanders: f64) -> Vec<[f64; 2]> {
    let (mut normal, mut wander) = (normals(seed), 0.0);
    let mut row = |k: u32| {
        wander = 0.9 * wander + wanders * normal();
        [40.0, 5.3 + closes * f64::from(k) + wander]
    };
    (0..rows).map(&mut row).collect()
}

#[test]
fn a_command_that_a_slow_logger_misses_is_noise_of_the_torque() {
    let (_, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let moving = |row: usize, now: [f64; 2]| if row == 0 && now == [0.0; 2] { [150.0, 20.0] } else { now };
    let whole = answered(&Car::nominal(&vehicle), &wandering(150, 23, 0.005, 0.08), 0.1, |_| false, moving);
    for step in [1, 2, 5] {
        let left = mean_square_from(&prepared(&every(step, &whole)), effects::null(), 0.1);
        assert!((0.3..1.25).contains(&left), "every {step}: {left}");
    }
}

/// A logger that averages its samples still misses commands of a faster control unit, if its recordings are read that way.
#[test]
fn a_command_between_averaged_samples_is_noise_as_well() {
    let (_, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let moving = |row: usize, now: [f64; 2]| if row == 0 && now == [0.0; 2] { [250.0, 20.0] } else { now };
    let whole = answered_at(1e3, &Car::nominal(&vehicle), &wandering(3000, 37, 3e-4, 0.15), 0.06, |_| false, moving);
    let left = |step: usize, control_interval_s: Option<f64>| {
        let problem = prepared(&Recording { control_interval_s, ..every(step, &whole) });
        let n = problem.tracks[0].observations();
        let all = &problem.all_residuals(&problem.nominal(), None)[0][20..2 * n];
        all.iter().map(|r| r * r).sum::<f64>() / all.len() as f64
    };
    let all = left(1, None);
    assert!((0.3..1.25).contains(&all), "{all}");
    let [held, straight] = [None, Some(0.0025)].map(|control| left(5, control));
    assert!(held > 5.0 * straight && (0.3..2.0).contains(&straight), "{held} {straight}");
}

/// The same with a measured bearing position: just before a sample it follows the last command, which a slow logger has not seen.
#[test]
fn a_command_that_a_slow_logger_misses_is_noise_of_the_position() {
    let (_, vehicle_json) = example();
    let vehicle = Vehicle::from_value(&vehicle_json).unwrap();
    let mut normal = normals(29);
    let mut command = 5.3;
    let inputs: Vec<[f64; 2]> = (0..300)
        .map(|_| {
            command += 0.05 * normal() - 0.02 * (command - 5.3);
            [40.0, command]
        })
        .collect();
    let moving = |row: usize, now: [f64; 2]| if row == 0 && now == [0.0; 2] { [250.0, 20.0] } else { now };
    let mut whole = answered(&Car::nominal(&vehicle), &inputs, 0.1, |_| false, moving);
    // A bearing that follows immediately, sampled just before the next command.
    whole.x_to = Some((0..300_usize).map(|k| inputs[k.saturating_sub(1)][1] + 0.015 * normal()).collect());
    for step in [1, 2, 5] {
        let r = every(step, &whole);
        let mut problem = prepared(&r);
        // A command that wanders freely hides the sensor noise from an estimate by neighbouring samples; here the noise is given, not estimated.
        let mut with = prepare::disturbances(&problem.tracks, &prepare::read(&[&r], &vehicle_json).unwrap().1);
        with.noise[Channel::XTo as usize].white = 0.015;
        problem.filters = problem.tracks.iter().map(|t| prepare::filter_of(t, &vehicle, &with)).collect();
        let n = problem.tracks[0].observations();
        let all = &problem.all_residuals(&problem.nominal(), None)[0][2 * n + 2..3 * n];
        let left = all.iter().map(|r| r * r).sum::<f64>() / all.len() as f64;
        // How far a command has moved unseen is estimated from its curvature at two samples only, which leaves a mean square above one; if it were not allowed for, it would be
        // six or more.
        assert!((0.5..2.5).contains(&left), "every {step}: {left}");
    }
}

/// Recordings of the bundled campaign, and the nominal car.
fn bundled(names: &[&str]) -> (Campaign, Car) {
    let mut campaign = campaign::read(Path::new("tests/data/campaigns/example"), &Default::default()).unwrap();
    campaign.recordings.retain(|r| names.contains(&r.name.as_str()));
    let car = Car::nominal(&Vehicle::from_value(&campaign.vehicle_json).unwrap());
    (campaign, car)
}

/// Replaces both speeds and the bearing position by the response of a car to the recording's inputs, plus what `sensors` adds at each sample interval (s); other bench channels
/// are removed.
fn answer(r: &mut Recording, car: &Car, mut sensors: impl FnMut(f64) -> [f64; 3]) {
    let interval = 1.0 / r.sample_rate_hz;
    let mut sensed = |now: [f64; 3]| {
        let added = sensors(interval);
        std::array::from_fn(|channel| now[channel] + added[channel])
    };
    let found: Vec<[f64; 3]> = shown(r, car).into_iter().map(&mut sensed).collect();
    let of = |channel: usize| found.iter().map(|v| v[channel]).collect::<Vec<f64>>();
    (r.omega_f, r.omega_c, r.x_to) = (of(0), of(1), Some(of(2)));
    (r.t_fc, r.theta_c) = (None, None);
}

/// Recordings of the bundled campaign, decimated to every `step`-th row, as the nominal car would give them. `control` is the interval of its control unit in s, and `sensors`
/// returns what is added to both speeds at each sample interval (s).
fn replayed(names: &[&str], step: usize, control: Option<f64>, mut sensors: impl FnMut(f64) -> [f64; 2]) -> Campaign {
    let (mut campaign, car) = bundled(names);
    for r in &mut campaign.recordings {
        (r.x_to, r.control_interval_s) = (None, control);
        *r = every(step, r);
        answer(r, &car, |interval| {
            let [f, c] = sensors(interval);
            [f, c, 0.0]
        });
        (r.x_to, r.control_interval_s) = (None, None);
    }
    campaign
}

/// A control unit that computes at 33 Hz, logged at 33 Hz: its commands hold from sample to sample, and the diagnosis finds that out by itself.
#[test]
fn commands_that_change_only_as_often_as_they_are_logged_are_held() {
    let mut normal = normals(11);
    let campaign = replayed(&["r01", "r02", "r03", "r05"], 3, Some(f64::INFINITY), |_| [0.1 * normal(), 0.1 * normal()]);
    let found = diagnose(&campaign, &|_, _| {}).unwrap();
    assert_eq!((found.read.recordings[0].control_interval_s, found.answer.verdict), (Some(f64::INFINITY), Verdict::NoGap));
    assert!(found.answer.notes.iter().any(|n| n.contains("held from sample to sample")), "{:?}", found.answer.notes);
}

/// A control unit that computes at 1 kHz, logged at 100 Hz: its commands change between the samples, which the diagnosis also finds out.
#[test]
fn commands_that_change_between_their_samples_go_on_between_them() {
    const FASTER: usize = 10;
    let mut normal = normals(13);
    let (mut campaign, car) = bundled(&["r01", "r02", "r03", "r05"]);
    for r in &mut campaign.recordings {
        let rows = FASTER * (r.time.len() - 1) + 1;
        for v in [&mut r.time, &mut r.t_e, &mut r.x_to_cmd, &mut r.theta_h] {
            let between = |k: usize| v[k / FASTER] + (k % FASTER) as f64 / FASTER as f64 * (v[k.div_ceil(FASTER)] - v[k / FASTER]);
            *v = (0..rows).map(between).collect();
        }
        (r.omega_f, r.omega_c) = ([r.omega_f[0]].repeat(rows), [r.omega_c[0]].repeat(rows));
        r.sample_rate_hz *= FASTER as f64;
        answer(r, &car, |_| [0.1 * normal(), 0.1 * normal(), 0.01 * normal()]);
        *r = every(FASTER, r);
    }
    let found = diagnose(&campaign, &|_, _| {}).unwrap();
    assert_eq!((found.read.recordings[0].control_interval_s, found.answer.verdict), (Some(0.005), Verdict::NoGap));
    assert!(found.answer.notes.iter().any(|n| n.contains("straight from sample to sample")), "{:?}", found.answer.notes);
    // The summary may be folded to the width of a terminal, so it is compared with single spaces.
    let told = kisspoint::cli::summary::summary(&found, None).split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(told.contains("- The commands seem to change more often than they are logged"), "{told}");
}

/// The disc speed repeats its last value for `rows` of every `every` rows, plus the noise `again`.
fn repeated(campaign: &mut Campaign, rows: usize, every: usize, mut again: impl FnMut() -> f64) {
    for r in &mut campaign.recordings {
        for k in (0..r.omega_c.len()).filter(|k| k % every >= every - rows) {
            r.omega_c[k] = r.omega_c[k - k % every + every - rows - 1] + again();
        }
    }
}

/// A sensor whose messages are lost for 80 ms at a time: the repeated samples are left out, and the verdict is a gap in the sensors, not an effect of the car.
#[test]
fn a_speed_that_repeats_itself_is_left_out_and_is_a_gap_in_the_sensors() {
    let mut normal = normals(17);
    let mut campaign = replayed(&["r01", "r02", "r03", "r05"], 1, None, |_| [0.1 * normal(), 0.1 * normal()]);
    repeated(&mut campaign, 8, 70, || 0.0);
    let found = diagnose(&campaign, &|_, _| {}).unwrap();
    let answer = &found.answer;
    assert_eq!((answer.verdict, answer.place.unexplained_at), (Verdict::Unexplained, Some("sensors")), "{:?}", answer.notes);
    let what = &answer.place.irregular;
    assert!(
        answer.which.effects.is_empty() && what.len() == 1 && what[0].starts_with("the disc speed repeats what it showed before"),
        "{what:?}"
    );
    assert!(answer.notes.iter().any(|n| n.contains(&what[0])), "{:?}", answer.notes);
    // All repeats are left out where the car's speed changed meanwhile, and hardly any other sample.
    let (mut stale, mut left_out, mut fresh) = (0, 0, 0);
    for (was, is) in campaign.recordings.iter().zip(&found.read.recordings) {
        for begin in (0..was.omega_c.len().saturating_sub(72)).step_by(70) {
            let gone = (begin..begin + 70).filter(|k| is.omega_c[*k].is_nan());
            let (repeats, others): (Vec<usize>, Vec<usize>) = gone.partition(|k| k % 70 >= 62);
            if (was.omega_c[begin + 70] - was.omega_c[begin + 69]).abs() > 2.0 {
                (stale, left_out) = (stale + 8, left_out + repeats.len());
            }
            fresh += others.len();
        }
    }
    assert!(stale > 50 && left_out == stale && 10 * fresh < stale, "{left_out} of {stale}, and {fresh}");
}

/// Every logger occasionally loses a message: the repeated values are left out and reported, and are no gap.
#[test]
fn a_few_messages_that_are_lost_are_no_gap() {
    let mut normal = normals(37);
    let mut campaign = replayed(&["r01", "r02", "r03", "r05"], 1, None, |_| [0.1 * normal(), 0.1 * normal()]);
    let steepest = |v: &[f64]| (1..v.len() - 5).max_by(|a, b| (v[a + 5] - v[*a]).total_cmp(&(v[b + 5] - v[*b]))).unwrap();
    for r in &mut campaign.recordings[..2] {
        let from = steepest(&r.omega_c);
        (1..5).for_each(|k| r.omega_c[from + k] = r.omega_c[from]);
    }
    let found = diagnose(&campaign, &|_, _| {}).unwrap();
    assert_eq!((found.answer.verdict, found.answer.place.irregular.len()), (Verdict::NoGap, 0), "{:?}", found.answer.notes);
    assert!(found.answer.notes.iter().any(|n| n.contains("left out, as few as a logger may lose")), "{:?}", found.answer.notes);
    assert!(found.read.recordings.iter().flat_map(|r| &r.omega_c).filter(|v| v.is_nan()).count() >= 8);
}

/// With such a sensor, the effect of the bundled campaign is still named; its car was not simulated with this plant.
#[test]
fn an_effect_beside_a_speed_that_repeats_itself_is_named() {
    let (mut campaign, _) = bundled(&["r01", "r02", "r03", "r04", "r05", "r06", "r07", "r08", "r09"]);
    let mut normal = normals(19);
    repeated(&mut campaign, 6, 90, || 0.15 * normal());
    let answer = diagnose(&campaign, &|_, _| {}).unwrap().answer;
    let named: Vec<&str> = answer.which.effects.iter().map(|e| e.id).collect();
    assert_eq!(
        (answer.verdict, named, answer.place.unexplained_at),
        (Verdict::PartlyExplained, vec!["kiss_point_thermal"], Some("sensors"))
    );
}

/// Elastic shafts also let the disc speed jump. This is behaviour of the car, and no sample is left out.
#[test]
fn a_disc_that_leaps_behind_soft_shafts_is_not_stale() {
    let mut normal = normals(31);
    let (mut campaign, mut car) = bundled(&["r01", "r02", "r03", "r05"]);
    car.effects[effects::param::driveline_compliance::compliance] = 0.011;
    car.effects[effects::param::driveline_compliance::damping] = 0.3;
    for r in &mut campaign.recordings {
        r.x_to = None;
        answer(r, &car, |_| [0.1 * normal(), 0.1 * normal(), 0.0]);
        r.x_to = None;
    }
    let found = diagnose(&campaign, &|_, _| {}).unwrap();
    let named: Vec<&str> = found.answer.which.effects.iter().map(|e| e.id).collect();
    assert_eq!((found.answer.verdict, named), (Verdict::Explained, vec!["driveline_compliance"]));
    assert!(found.read.recordings.iter().all(|r| r.omega_c.iter().all(|v| v.is_finite())));
}

/// Coloured noise with a time constant of 0.1 s, beside white noise: the search is repeated with a filter that models it, and the answer says so.
#[test]
fn noise_with_a_memory_is_allowed_for_in_a_second_search() {
    let mut normal = normals(7);
    let mut slow = [0.0_f64; 2];
    let campaign = replayed(&["r01", "r03", "r05"], 1, None, |interval| {
        let kept = (-interval / 0.1).exp();
        slow = slow.map(|x| kept * x + 0.15 * (1.0 - kept * kept).sqrt() * normal());
        slow.map(|x| x + 0.1 * normal())
    });
    let answer = diagnose(&campaign, &|_, _| {}).unwrap().answer;
    let said = |words: &str| answer.notes.iter().any(|n| n.contains(words));
    assert!(answer.verdict == Verdict::NoGap && said("correlated in time"), "{:?} {:?}", answer.verdict, answer.notes);
}

/// Coloured sensor noise is modelled if neighbouring innovations have a correlation of at least 0.08 and the gain in log likelihood exceeds the price of 8 nats for each of its
/// two parameters.
#[test]
fn a_memory_has_to_show_and_to_be_worth_its_price() {
    let (mut weak, mut cheap) = (0, 0);
    for (names, size) in [
        (&["r01", "r02", "r03", "r04", "r05", "r06"][..], 0.06),
        (&["r01", "r02", "r03", "r04", "r05", "r06"], 0.08),
        (&["r03"], 0.08),
        (&["r03"], 0.09),
        (&["r03"], 0.1),
        (&["r03"], 0.2),
    ] {
        let (mut normal, mut slow) = (normals(23), 0.0);
        let campaign = replayed(names, 1, None, |interval| {
            let kept = (-interval / 0.1_f64).exp();
            slow = kept * slow + size * (1.0 - kept * kept).sqrt() * normal();
            [slow + 0.1 * normal(), 0.1 * normal()]
        });
        let all: Vec<&Recording> = campaign.recordings.iter().collect();
        let (tracks, tolerances) = prepare::read(&all, &campaign.vehicle_json).unwrap();
        let with = prepare::disturbances(&tracks, &tolerances);
        let problem = prepare::problem(tracks, &Vehicle::from_value(&campaign.vehicle_json).unwrap(), &tolerances, &with);
        let point = problem.nominal();
        let residuals = problem.all_residuals(&point, None);
        let (mut products, mut squares) = (0.0, 0.0);
        for (filter, r) in problem.filters.iter().zip(&residuals) {
            let v: Vec<f64> = (0..filter.gains.len()).map(|k| r[2 * k].clamp(-4.0, 4.0)).collect();
            products += v.windows(2).map(|w| w[0] * w[1]).sum::<f64>();
            squares += v.iter().map(|x| x * x).sum::<f64>();
        }
        let correlation = products / squares;
        let tried = [0.5, 1.0, 2.0].into_iter().flat_map(|size| [0.03, 0.1, 0.3].map(|memory_s| (size, memory_s)));
        let costs = tried.flat_map(|(size, memory_s)| {
            [1.0, 0.8].map(|share| {
                let (mut changed, white) = (with, with.noise[0].white);
                changed.noise[0] = Noise { white: share * white, coloured: size * white, memory_s };
                minus_two_log_likelihood(&problem, &point, &changed)
            })
        });
        let nats = 0.5 * (minus_two_log_likelihood(&problem, &point, &with) - costs.fold(f64::INFINITY, f64::min));
        let taken = refined(&problem, &point, &residuals, &with).is_some_and(|found| found.noise[0].coloured > 0.0);
        assert_eq!(taken, correlation >= 0.08 && nats > 8.0, "{names:?}, {size} rad/s: {correlation}, {nats} nats");
        weak += u32::from(taken && correlation < 0.24);
        cheap += u32::from(taken && nats < 24.0);
    }
    assert!(weak > 0 && cheap > 0, "{weak} {cheap}");
}
