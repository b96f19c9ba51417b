//! The bundled campaign as a road logger would have recorded it: lost or wrong samples are left out, all others are read unchanged.

use kisspoint::campaign::{self, Campaign, ReadOptions};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// The cells of a recording without its header.
type Rows = Vec<Vec<String>>;

const TIME: usize = 0;
const OMEGA_F: usize = 1;
const OMEGA_C: usize = 2;

fn bundled() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/campaigns/example")
}

/// The campaign with every recording's rows changed; the first argument is the recording's number.
fn altered(name: &str, change: impl Fn(usize, &mut Rows)) -> Campaign {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("altered").join(name);
    std::fs::create_dir_all(&folder).unwrap();
    let mut files: Vec<PathBuf> = std::fs::read_dir(bundled()).unwrap().map(|e| e.unwrap().path()).collect();
    files.sort();
    let mut number = 0;
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        let target = folder.join(file.file_name().unwrap());
        if file.extension().is_none_or(|e| e != "csv") {
            std::fs::write(target, text).unwrap();
            continue;
        }
        let mut lines = text.lines();
        let header = lines.next().unwrap();
        let mut rows: Rows = lines.map(|l| l.split(',').map(str::to_string).collect()).collect();
        number += 1;
        change(number, &mut rows);
        let rows: Vec<String> = rows.iter().map(|r| r.join(",")).collect();
        std::fs::write(target, format!("{header}\n{}\n", rows.join("\n"))).unwrap();
    }
    campaign::read(&folder, &ReadOptions::default()).unwrap()
}

fn whole() -> Campaign {
    campaign::read(&bundled(), &ReadOptions::default()).unwrap()
}

/// The notes of a campaign as one text.
fn notes(c: &Campaign) -> String {
    c.notes.iter().map(|n| format!("{}: {}\n", n.recording, n.text)).collect()
}

fn number(cell: &str) -> f64 {
    cell.parse().unwrap()
}

/// A pseudo-random number from 0 to 1.
fn drawn(k: usize) -> f64 {
    f64::from((k as u32).wrapping_mul(2_654_435_761).rotate_left(13).wrapping_mul(0x9e37_79b9) >> 8) / f64::from(1_u32 << 24)
}

#[test]
fn as_it_is_there_is_nothing_to_say() {
    let c = whole();
    assert_eq!((c.recordings.len(), c.left_out.len(), notes(&c).as_str()), (9, 0, ""));
}

#[test]
fn every_second_sample_of_the_disc_speed_is_missing() {
    let c = altered("half", |_, rows| rows.iter_mut().skip(1).step_by(2).for_each(|r| r[OMEGA_C].clear()));
    assert_eq!((c.recordings.len(), notes(&c).as_str()), (9, ""));
    for (r, w) in c.recordings.iter().zip(&whole().recordings) {
        // A last row without a disc speed does not belong to the recording.
        let n = r.time.len();
        assert_eq!((&r.time[..], &r.omega_f[..], r.sample_rate_hz), (&w.time[..n], &w.omega_f[..n], w.sample_rate_hz));
        assert!(n + 1 >= w.time.len());
        let same = |k: usize| if k % 2 == 0 { r.omega_c[k] == w.omega_c[k] } else { r.omega_c[k].is_nan() };
        assert!((0..r.time.len()).all(same));
    }
}

#[test]
fn both_speeds_at_half_the_rate() {
    let c = altered("slow", |_, rows| {
        rows.iter_mut().skip(1).step_by(2).for_each(|r| {
            r[OMEGA_F].clear();
            r[OMEGA_C].clear();
        });
    });
    assert_eq!(c.recordings.len(), 9);
    for (r, w) in c.recordings.iter().zip(&whole().recordings) {
        let n = r.time.len();
        assert!(n + 1 >= w.time.len());
        assert_eq!((&r.time[..], &r.t_e[..], &r.x_to_cmd[..]), (&w.time[..n], &w.t_e[..n], &w.x_to_cmd[..n]));
        assert!(r.omega_f.iter().skip(1).step_by(2).chain(r.omega_c.iter().skip(1).step_by(2)).all(|v| v.is_nan()));
    }
}

#[test]
fn one_code_for_not_available() {
    let c = altered("code", |number, rows| {
        if number == 4 {
            rows[120][OMEGA_C] = "983.025".into();
        }
    });
    assert_eq!(c.recordings.len(), 9);
    assert!(notes(&c).contains("r04: omega_c_rad_s: 1 sample is not believed and left out"), "{}", notes(&c));
    assert!(notes(&c).contains("line 122: 983.025 rad/s"), "{}", notes(&c));
    let (r, w) = (&c.recordings[3], &whole().recordings[3]);
    assert!((0..r.time.len()).all(|k| if k == 120 { r.omega_c[k].is_nan() } else { r.omega_c[k] == w.omega_c[k] }));
}

#[test]
fn every_command_says_what_is_not_believed() {
    _ = altered("said", |_, rows| rows[100][OMEGA_F] = "983.025".into());
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("altered/said");
    let file = folder.join("r01.csv");
    for (command, path) in [("inspect", &file), ("survey", &file), ("replay", &folder)] {
        let out = std::process::Command::new(env!("CARGO_BIN_EXE_kisspoint")).arg(command).arg(path).output().unwrap();
        let text = String::from_utf8(out.stdout).unwrap();
        assert!(text.contains("1 sample is not believed and left out"), "{command}: {text}");
    }
}

#[test]
fn a_dead_band_of_the_disc_speed() {
    let c = altered("dead", |_, rows| {
        rows.iter_mut().filter(|r| number(&r[OMEGA_C]).abs() < 3.0).for_each(|r| r[OMEGA_C] = "0".into());
    });
    assert_eq!(c.left_out, []);
    let mut hidden = 0;
    for (r, w) in c.recordings.iter().zip(&whole().recordings) {
        // Zeros are not accepted while the speed passes through the sensor's dead band; values above it are unchanged.
        let passes = w.omega_c.iter().any(|v| v.abs() < 1.0) && w.omega_c.iter().any(|v| *v > 20.0);
        assert!(!passes || r.omega_c.iter().all(|v| *v != 0.0), "{}: {}", r.name, notes(&c));
        assert!(r.omega_c.iter().zip(&w.omega_c).all(|(r, w)| w.abs() < 3.0 || r == w));
        hidden += usize::from(passes);
    }
    assert!(hidden >= 4 && notes(&c).contains("the sensor reads 0 below 3."), "{}", notes(&c));
}

#[test]
fn lost_frames_lose_themselves_alone() {
    let c = altered("lost", |number, rows| {
        let mut k = 0;
        rows.retain(|_| {
            k += 1;
            k == 1 || drawn(10_000 * number + k) > 0.005
        });
    });
    assert_eq!((c.recordings.len(), c.left_out.len()), (9, 0), "{:?}", c.left_out);
    let (mut lost, mut all) = (0, 0);
    for (r, w) in c.recordings.iter().zip(&whole().recordings) {
        all += w.time.len();
        lost += w.time.len() - r.time.len();
        // Every frame that was not lost keeps its time and value.
        let at = |t: f64| w.time.partition_point(|s| *s < t - 1e-9);
        assert!(r.time.iter().zip(&r.omega_f).all(|(t, v)| w.omega_f[at(*t)] == *v), "{}", r.name);
        assert!((r.time.last().unwrap() - w.time.last().unwrap()).abs() < 0.05, "{}", r.name);
    }
    assert!((0.002..0.01).contains(&(lost as f64 / all as f64)), "{lost} of {all}");
    assert!(notes(&c).contains("the value before is held"), "{}", notes(&c));
}

#[test]
fn stamps_jitter_by_almost_half_of_the_interval() {
    let shift = |row: usize| 0.009 * (drawn(row) - 0.5);
    let c = altered("jitter", |_, rows| {
        for (k, r) in rows.iter_mut().enumerate().skip(1) {
            r[TIME] = format!("{:.5}", number(&r[TIME]) + shift(k));
        }
    });
    assert_eq!((c.recordings.len(), c.left_out.len()), (9, 0), "{:?}", c.left_out);
    for (r, w) in c.recordings.iter().zip(&whole().recordings) {
        assert_eq!(r.omega_c, w.omega_c);
        assert!(r.time.iter().zip(&w.time).enumerate().skip(1).all(|(k, (r, w))| (r - w - shift(k)).abs() < 1e-5));
    }
}

/// The effect named first, followed by its rivals.
fn named(c: &Campaign) -> Vec<String> {
    let found = kisspoint::gap::diagnosis::diagnose(c, &|_, _| {}).unwrap().json;
    let first = &found["which"]["effects"][0];
    let rivals = first["ambiguous_with"].as_array().into_iter().flatten();
    std::iter::once(&first["id"]).chain(rivals).map(|id| id.as_str().unwrap_or("nothing").to_string()).collect()
}

/// The kiss point of the bundled car moves as the clutch heats, and the diagnosis of a degraded log finds the same.
#[test]
fn the_diagnosis_of_a_worse_log_is_the_same() {
    let blank = |_: usize, rows: &mut Rows| rows.iter_mut().skip(1).step_by(2).for_each(|r| r[OMEGA_C].clear());
    let slow =
        |_: usize, rows: &mut Rows| rows.iter_mut().skip(1).step_by(2).for_each(|r| [OMEGA_F, OMEGA_C].iter().for_each(|c| r[*c].clear()));
    let code = |number: usize, rows: &mut Rows| {
        if number == 4 {
            rows[120][OMEGA_C] = "983.025".into()
        }
    };
    let dead = |_: usize, rows: &mut Rows| {
        rows.iter_mut().filter(|r| number(&r[OMEGA_C]).abs() < 3.0).for_each(|r| r[OMEGA_C] = "0".into());
    };
    let lost = |number: usize, rows: &mut Rows| {
        let mut k = 0;
        rows.retain(|_| {
            k += 1;
            k == 1 || drawn(10_000 * number + k) > 0.005
        });
    };
    let all: [(&str, &(dyn Fn(usize, &mut Rows) + Sync)); 5] = [
        ("blank-diagnosed", &blank),
        ("slow-diagnosed", &slow),
        ("code-diagnosed", &code),
        ("dead-diagnosed", &dead),
        ("lost-diagnosed", &lost),
    ];
    // In parallel, so that no core is idle.
    all.into_par_iter().for_each(|(name, change)| assert_eq!(named(&altered(name, change)), ["kiss_point_thermal"], "{name}"));
}

/// The temperature of the clutch at the start was not noted: 25 °C with a standard deviation of 50 K.
#[test]
fn the_diagnosis_without_start_temperatures_names_the_effect_first() {
    let mut c = whole();
    for r in &mut c.recordings {
        (r.theta_c0, r.theta_b0) = (25.0, 25.0);
        r.theta_0_sigma = [50.0; 2];
    }
    assert!(named(&c).contains(&"kiss_point_thermal".to_string()));
}

/// In an export to a faster raster, held or interpolated, the added rows are left out and the original samples are read unchanged.
#[test]
fn a_faster_raster_reads_as_what_was_sampled() {
    let whole = whole();
    for (name, every, interpolates) in [("raster_held", 10, false), ("raster_interpolated", 5, true), ("raster_twice", 2, false)] {
        let exported = altered(name, |_, rows| {
            let value = |row: &[String], c: usize| number(&row[c]);
            let between = |k: usize, part: usize| -> Vec<String> {
                let (this, next) = (&rows[k], &rows[k + 1]);
                let share = part as f64 / every as f64;
                let cell = |c: usize| {
                    let slope = if c == TIME || interpolates { value(next, c) - value(this, c) } else { 0.0 };
                    format!("{:.5}", value(this, c) + share * slope)
                };
                (0..this.len()).map(cell).collect()
            };
            let all: Rows =
                (0..rows.len() - 1).flat_map(|k| (0..every).map(move |part| (k, part))).map(|(k, part)| between(k, part)).collect();
            let last = rows.pop().unwrap();
            *rows = all;
            rows.push(last);
        });
        for (was, is) in whole.recordings.iter().zip(&exported.recordings) {
            let near = |a: &[f64], b: &[f64]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4);
            assert!((is.sample_rate_hz - was.sample_rate_hz).abs() < 1e-6, "{name}, {}: {} Hz", is.name, is.sample_rate_hz);
            let columns = [
                (&was.time, &is.time),
                (&was.omega_f, &is.omega_f),
                (&was.omega_c, &is.omega_c),
                (&was.t_e, &is.t_e),
                (&was.x_to_cmd, &is.x_to_cmd),
            ];
            for (c, (was, is)) in columns.into_iter().enumerate() {
                assert!(near(was, is), "{name}, {}, column {c}: {} rows instead of {}", is.len(), is.len(), was.len());
            }
            assert_eq!(is.input_rows, was.input_rows);
        }
        let said = if interpolates { "are interpolated and are left out" } else { "repeat it and are left out" };
        let lines = notes(&exported);
        assert_eq!(lines.matches(said).count(), whole.recordings.len(), "{lines}");
        assert!(lines.contains(&format!("one row in {every} is a sample")), "{lines}");
    }
}

/// Speeds sampled at 50 Hz that a logger repeats at 100 Hz, beside inputs sampled at 100 Hz.
#[test]
fn speeds_that_a_logger_repeats_have_samples_where_they_change() {
    let whole = whole();
    let repeated = altered("repeated_speeds", |_, rows| {
        for k in (1..rows.len()).step_by(2) {
            for c in [OMEGA_F, OMEGA_C] {
                rows[k][c] = rows[k - 1][c].clone();
            }
        }
    });
    for (was, is) in whole.recordings.iter().zip(&repeated.recordings) {
        assert_eq!((is.sample_rate_hz, &is.t_e, &is.x_to_cmd), (50.0, &was.t_e, &was.x_to_cmd));
        let kept = |k: usize| is.omega_f[k] == was.omega_f[k] && is.omega_c[k] == was.omega_c[k];
        assert!(
            (0..is.time.len()).all(|k| if k % 2 == 0 { kept(k) } else { is.omega_f[k].is_nan() && is.omega_c[k].is_nan() }),
            "{}",
            is.name
        );
    }
}

/// Speeds sampled at 40 Hz that a logger at 100 Hz repeats alternately twice and once; both speeds, or only one of them.
#[test]
fn speeds_that_a_logger_repeats_unevenly_have_samples_where_they_change() {
    let repeated = |name: &str, speeds: &[usize]| {
        altered(name, |_, rows| {
            let source: Vec<usize> = (0..rows.len()).map(|k| ((k as f64 / 2.5).floor() * 2.5).ceil() as usize).collect();
            for k in (0..rows.len()).filter(|k| source[*k] != *k) {
                for &c in speeds {
                    rows[k][c] = rows[source[k]][c].clone();
                }
            }
        })
    };
    let both = repeated("uneven_speeds", &[OMEGA_F, OMEGA_C]);
    let said = "rows repeat the sample before them, unevenly, and are left out";
    let lines = notes(&both);
    assert!(both.recordings.iter().all(|r| lines.contains(&format!("{}: omega_f_rad_s", r.name))) && lines.contains(said), "{lines}");
    for (is, was) in both.recordings.iter().zip(&whole().recordings) {
        assert_eq!((&is.t_e, &is.x_to_cmd), (&was.t_e, &was.x_to_cmd), "{}", is.name);
        let (kept, all) = (is.omega_f.iter().filter(|v| !v.is_nan()).count(), is.omega_f.len());
        assert!((0.3..0.45).contains(&(kept as f64 / all as f64)), "{}: {kept} of {all}", is.name);
    }
    let one = notes(&repeated("uneven_speed", &[OMEGA_F]));
    assert!(one.contains(said) && !one.contains("omega_c_rad_s"), "{one}");
}
