//! The survey of a synthetic log with known gears, engagements, latency and dead band; and of a real log, if it is beside the repository.

use kisspoint::campaign;
use kisspoint::survey::{Known, Survey, survey};
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

const RATIOS: [f64; 3] = [3.4, 2.0, 1.3];
const FINAL_DRIVE: f64 = 3.9;
const RADIUS: f64 = 0.31;
/// Times at which engine and disc speed meet in each gear, s.
const MEET: [f64; 3] = [3.0, 8.0, 13.0];
/// Frequency of the oscillation after that, Hz.
const RINGING: f64 = 5.2;

/// Index of the gear, and road speed in m/s.
fn car(t: f64) -> (usize, f64) {
    let gear = MEET.iter().filter(|m| t > **m - 1.0).count().clamp(1, 3) - 1;
    (gear, (2.0 * (t - 2.0)).clamp(0.0, 30.0))
}

/// Engine speed in rad/s: the speed that the gear imposes, with slip that vanishes when the speeds meet, followed by an oscillation.
fn engine(t: f64) -> f64 {
    let (gear, v) = car(t);
    let locked = RATIOS[gear] * FINAL_DRIVE / RADIUS * v;
    let late = t - MEET[gear];
    if late < 0.0 {
        let start = if gear == 0 { 90.0 } else { 60.0 };
        return locked.max(if gear == 0 { 90.0 - 2.0 * t } else { 0.0 }) + if late > -1.0 { start * late * late } else { 0.0 };
    }
    locked + 6.0 * (-late / 1.0).exp() * (TAU * RINGING * late).sin()
}

/// A table in long form: the road speed 12 ms late and 0 below 0.5 m/s, a torque with an offset, a pedal made of two switches.
fn log(folder: &Path) -> PathBuf {
    let mut text = String::from("time;channel;value;unit\n");
    for k in 0..1800 {
        let t = f64::from(k) * 0.01;
        writeln!(text, "{t:.4};nEngine;{:.2};1/min", engine(t) * 60.0 / TAU).unwrap();
        if k % 2 == 1 {
            let (late, noise) = (t + 0.003 - 0.012, f64::from(k * 7919 % 13) * 1e-3);
            let v = car(late).1 + noise;
            writeln!(text, "{:.4};vVehicle;{:.2};km/h", t + 0.003, if v < 0.5 { 0.0 } else { 3.6 * v }).unwrap();
        }
        let torque = 30.0 + if t > 2.0 { 50.0 } else { 20.0 * (1.0 - t).max(0.0) } + f64::from(k % 3);
        writeln!(text, "{t:.4};TqShaft;{torque:.1};Nm").unwrap();
        writeln!(text, "{t:.4};clutchPedal;{};%", if t < 2.0 { 100 } else { 0 }).unwrap();
    }
    std::fs::create_dir_all(folder).unwrap();
    let path = folder.join("made_up.txt");
    std::fs::write(&path, text).unwrap();
    path
}

fn of(path: &Path, known: &Known) -> Survey {
    survey(campaign::open(path, None, &|_| {}).unwrap_or_else(|e| panic!("{e}")), known)
}

fn near(got: f64, expected: f64, within: f64, what: &str) {
    assert!((got - expected).abs() <= within, "{what}: {got} for {expected}");
}

#[test]
fn a_made_up_log_gives_back_what_was_put_in() {
    let path = log(&Path::new(env!("CARGO_TARGET_TMPDIR")).join("survey"));
    let given = Known { ratios: RATIOS.to_vec(), final_drive: Some(FINAL_DRIVE), ..Known::default() };
    for known in [Known::default(), given] {
        let s = of(&path, &known);
        assert_eq!(s.gears.levels.len(), 3, "{}", s.to_text());
        for (level, ratio) in s.gears.levels.iter().zip(RATIOS) {
            near(*level, ratio * FINAL_DRIVE / RADIUS, 0.01 * level, "ratio");
        }
        assert_eq!(s.engagements.iter().map(|e| e.launch).collect::<Vec<_>>(), [true, false, false]);
        for (e, meet) in s.engagements.iter().zip(MEET) {
            near(e.met, meet, 0.1, "meeting");
            let ringing = e.ringing.as_ref().unwrap();
            near(ringing.frequency, RINGING, 0.2, "ringing");
            assert!(ringing.set.iter().any(|(a, b)| (*a - 0.05..*b + 0.05).contains(&RINGING)), "{ringing:?}");
        }
        let road = &s.log.channels[s.road.unwrap()];
        near(road.dead_band.unwrap(), 0.5, 0.05, "dead band");
        let lag = s.latency.unwrap();
        assert!((lag.interval.0 - 0.004..lag.interval.1 + 0.004).contains(&0.012), "{lag:?}");
        near(s.torques[0].idle.unwrap().2, 31.0, 1.0, "torque at standstill");
        assert_eq!(s.switches[0].levels, [0.0, 100.0]);
        assert!(!s.has_position);
        assert!(s.to_json()["engagements"].as_array().unwrap().len() == 3);
    }
    let s = of(&path, &Known { ratios: RATIOS.to_vec(), final_drive: Some(FINAL_DRIVE), ..Known::default() });
    near(s.tyre_radius.unwrap(), RADIUS, 0.005, "tyre radius");
    let inertia = kisspoint::survey::export::inertia(&s, 1400.0, 1).unwrap();
    near(inertia, 1400.0 * (RADIUS / (RATIOS[1] * FINAL_DRIVE)).powi(2), 0.03 * inertia, "J_c");
    assert_eq!(kisspoint::survey::export::recordings(&s, "TqShaft", Some(1)).unwrap().len(), 1);
}

/// The inertia at the disc is the same whether the speed is that of a wheel or of the output shaft; where it cannot be known, the error says what is missing.
#[test]
fn inertia_follows_from_what_lies_between_the_speed_and_the_road() {
    let path = log(&Path::new(env!("CARGO_TARGET_TMPDIR")).join("survey_inertia"));
    let given = Known { ratios: RATIOS.to_vec(), final_drive: Some(FINAL_DRIVE), tyre_radius: Some(RADIUS), ..Known::default() };
    let expected = 1400.0 * (RADIUS / (RATIOS[1] * FINAL_DRIVE)).powi(2);
    // The ratio of engine speed to the measured speed is that of the gear times the ratio between the measured shaft and the wheels.
    for (name, factor) in [("wheel_speed_fl", FINAL_DRIVE), ("output_shaft_speed", 1.0)] {
        for known in [&Known { tyre_radius: Some(RADIUS), ..Known::default() }, &given] {
            let mut s = of(&path, known);
            let road = s.road.unwrap();
            (s.log.channels[road].name, s.log.channels[road].quantity) = (name.into(), Some(kisspoint::campaign::Quantity::Speed));
            s.gears.levels = RATIOS.iter().map(|ratio| ratio * factor).collect();
            s.gears.common = s.gears.given.then_some(factor);
            match kisspoint::survey::export::inertia(&s, 1400.0, 1) {
                Ok(inertia) => near(inertia, expected, 1e-9, name),
                Err(said) => {
                    assert!(name == "output_shaft_speed" && !s.gears.given && said.contains("--ratios and --final-drive"), "{name}: {said}")
                }
            }
        }
    }
}

/// A log of VCDS at 3 Hz, with separate time stamps for engine and road speed: the gears are found, and the survey says that the log is too slow for launches and shifts.
#[test]
fn a_slow_log_in_blocks_side_by_side_has_its_gears() {
    let mut text = String::from(
        "Monday,2,March,2026\n\n,Group A:,'001,Group B:,'005\n,,Engine,,Vehicle\n,TIME,Speed,TIME,Speed\nMarker,STAMP, /min,STAMP, km/h\n",
    );
    for k in 0..54 {
        let t = f64::from(k) / 3.0;
        let (n, v) = (engine(t) * 60.0 / TAU, car(t + 0.15).1 * 3.6);
        writeln!(text, ",{t:.2},{n:.0},{:.2},{v:.1}", t + 0.15).unwrap();
    }
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("slow.csv");
    std::fs::write(&path, text).unwrap();
    let s = of(&path, &Known::default());
    assert_eq!(s.gears.levels.len(), 3, "{}", s.to_text());
    for (gear, ratio) in RATIOS.iter().enumerate() {
        let expected = ratio * FINAL_DRIVE / RADIUS;
        near(s.gears.factor(gear), expected, 0.02 * expected, "gear");
    }
    assert!(s.engagements.iter().all(|e| e.ringing.is_none()));
    let slow = "Engine Speed has 3.0 samples a second, Vehicle Speed has 3.0 samples a second: that is enough for gears, but";
    assert!(s.remarks.iter().any(|r| r.starts_with(slow)), "{:?}", s.remarks);
}

#[test]
fn the_campaign_of_a_survey_is_read_back() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("survey_campaign");
    let s = of(&log(&folder), &Known::default());
    let recordings = kisspoint::survey::export::recordings(&s, "TqShaft", None).unwrap();
    assert!(kisspoint::survey::export::recordings(&s, "Tq", None).unwrap_err().contains("TqShaft"));
    campaign::write_recordings_json(&recordings, &folder.join("recordings.json")).unwrap();
    std::fs::write(folder.join("vehicle.json"), "{}").unwrap();
    for r in &recordings {
        campaign::write_csv(r, &folder.join(format!("{}.csv", r.name))).unwrap();
    }
    let read = campaign::read(&folder, &campaign::ReadOptions::default()).unwrap();
    assert_eq!(read.recordings.len(), 3, "{:?}", read.left_out);
    assert!(read.recordings.iter().all(|r| r.x_to_cmd.is_empty() && r.theta_0_sigma == [40.0; 2]));
    // Two clocks, so that most rows have only one of the speeds.
    let r = &read.recordings[1];
    let count = |v: &[f64]| v.iter().filter(|v| !v.is_nan()).count() as f64;
    near(count(&r.omega_f) / count(&r.omega_c), 2.0, 0.1, "rates");
    // The torque is written at its own time stamps only, and the sample rate is that of the faster speed.
    let own = r.input_rows[0].as_ref().map(Vec::len);
    assert!(own.is_none_or(|n| n < r.time.len()));
    let steps: Vec<f64> = r.time.iter().zip(&r.omega_f).filter(|(_, v)| v.is_finite()).map(|(t, _)| *t).collect();
    near(r.sample_rate_hz, (steps.len() - 1) as f64 / (steps[steps.len() - 1] - steps[0]), 2.0, "rate of the engine speed");
    near(recordings[1].sample_rate_hz, r.sample_rate_hz, 0.01 * r.sample_rate_hz, "rate as written");
}

#[test]
fn a_log_without_the_speeds_says_so() {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("no_speed.csv");
    std::fs::write(&path, "t [s],temp [°C]\n0,20\n1,21\n2,22\n").unwrap();
    let s = of(&path, &Known::default());
    assert!(s.to_text().contains("no channel is the engine's speed"), "{}", s.to_text());
}

/// Checks against the description of this log in `../shared/real/README.md`.
#[test]
fn a_real_log_in_three_formats() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/real/gt350");
    if !folder.is_dir() {
        eprintln!("skipped: ../shared/real/gt350 is not there");
        return;
    }
    let known = Known { ratios: vec![3.25, 2.23, 1.61, 1.24, 1.0, 0.63], final_drive: Some(3.73), ..Known::default() };
    for ending in ["long.csv", "mf4", "wide_nan.parquet"] {
        let s = of(&folder.join(format!("gt350_jackstand_gears1to6.{ending}")), &known);
        let (from, to) = s.span();
        near(to - from, 33.2, 0.05, "length");
        let (engine, road) = (&s.log.channels[s.engine.unwrap()], &s.log.channels[s.road.unwrap()]);
        for gear in 0..6 {
            near(s.gears.locked_ratio(gear, engine.trace(), road.trace()), 1.0, 0.01, "locked ratio");
        }
        assert_eq!(s.engagements.len(), 6, "{ending}");
        assert!(s.engagements.iter().enumerate().all(|(k, e)| e.gear == k && e.launch == (k == 0)));
        for (e, meet) in s.engagements.iter().zip([2.81, 9.11, 12.47, 16.38, 19.70, 25.37]) {
            near(e.met, meet, 0.1, "meeting");
        }
        for (gear, frequency) in [(1, 4.5), (2, 3.3), (5, 6.9)] {
            near(s.engagements[gear].ringing.as_ref().unwrap().frequency, frequency, 0.6, "ringing");
        }
        near(road.dead_band.unwrap() / s.tyre_radius.unwrap(), 0.95, 0.1, "dead band at the wheel");
        let torque = s.torques.iter().find(|t| s.log.channels[t.channel].name.starts_with("transmission_input")).unwrap();
        near(torque.idle.unwrap().2, 40.0, 4.0, "torque at standstill");
        assert!(torque.verdict.contains("can't be T_e"), "{}", torque.verdict);
        assert_eq!(s.switches[0].levels, [0.0, 50.0, 100.0]);
        assert_eq!(s.to_json()["not_assessable"], serde_json::json!(["actuator", "clutch_force", "thermal"]));
    }
}
