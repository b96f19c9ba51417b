//! MDF4 and Parquet files against what asammdf and pyarrow, which wrote them, read back.
//!
//! The files and `expected.json` are made by `tests/python/make_measurements.py` from `seed/r01.csv`.

use std::path::{Path, PathBuf};

use kisspoint::campaign::{self, ChannelMap, Note, Recording};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/campaign").join(name)
}

fn about() -> Recording {
    Recording {
        name: "r01".into(),
        manoeuvre: "launch".into(),
        sample_rate_hz: 100.0,
        theta_c0: 36.0,
        theta_b0: 30.0,
        ..Recording::default()
    }
}

fn read(name: &str, map: &str) -> (Recording, Vec<Note>) {
    let map = ChannelMap::from_toml("map", map).unwrap();
    campaign::read_one(&data(name), &about(), &map).unwrap_or_else(|e| panic!("{e}"))
}

fn seed() -> Recording {
    read("seed/r01.csv", "").0
}

const LOGGER: &str = r#"
omega_f_rad_s = "nEngine"
omega_c_rad_s = "nGbxInput"
T_e_Nm = "TqEng"
x_to_cmd_mm = "BearingPosSet"
theta_h_degC = "TempBellHousing"
"#;

fn assert_near(got: &[f64], expected: &[f64], tolerance: f64, what: &str) {
    assert_eq!(got.len(), expected.len(), "{what}");
    for (i, (g, e)) in got.iter().zip(expected).enumerate() {
        assert!((g - e).abs() <= tolerance, "{what}, sample {i}: {g} for {e}");
    }
}

#[test]
fn mdf_of_every_packing_equals_the_seed() {
    let seed = seed();
    assert_eq!(seed.omega_f.len(), 151);
    for name in ["plain", "deflate", "transposed", "fragments", "v430"] {
        let (recording, notes) = read(&format!("measurements/{name}.mf4"), "");
        assert_eq!(recording, seed, "{name}");
        assert_eq!(notes, [], "{name}");
    }
}

#[test]
fn sums_are_those_of_asammdf() {
    let text = std::fs::read_to_string(data("measurements/expected.json")).unwrap();
    let expected: serde_json::Value = serde_json::from_str(&text).unwrap();
    let seed = seed();
    for (file, channels) in expected.as_object().unwrap() {
        let inspection = campaign::inspect(&data("measurements").join(file), None, &|_| {}).unwrap();
        for (name, about) in channels.as_object().unwrap() {
            let channel = inspection.channels.iter().find(|c| &c.name == name).unwrap();
            assert_eq!(channel.unit.as_deref(), about["unit"].as_str(), "{file} {name}");
            assert_eq!((channel.count - channel.invalid) as u64, about["count"].as_u64().unwrap(), "{file} {name}");
        }
        // The file with invalid samples is compared with the seed elsewhere, sample by sample.
        if channels.get("omega_f_rad_s").is_none() || file == "invalid.mf4" {
            continue;
        }
        let bench = |channel: &Option<Vec<f64>>| channel.clone().unwrap();
        for (name, values) in [
            ("omega_f_rad_s", seed.omega_f.clone()),
            ("omega_c_rad_s", seed.omega_c.clone()),
            ("T_e_Nm", seed.t_e.clone()),
            ("x_to_cmd_mm", seed.x_to_cmd.clone()),
            ("theta_h_degC", seed.theta_h.clone()),
            ("x_to_mm", bench(&seed.x_to)),
            ("T_fc_Nm", bench(&seed.t_fc)),
            ("theta_c_degC", bench(&seed.theta_c)),
        ] {
            let sum = channels[name]["sum"].as_f64().unwrap();
            assert!((values.iter().sum::<f64>() - sum).abs() < 1e-7, "{file} {name}");
        }
    }
}

#[test]
fn three_rates_keep_their_own_stamps() {
    let seed = seed();
    let (recording, notes) = read("measurements/rates.mf4", LOGGER);
    let quarter_rpm = 0.125 * std::f64::consts::PI / 30.0 + 1e-9;
    assert_near(&recording.omega_f, &seed.omega_f, quarter_rpm, "omega_f");
    assert_near(&recording.omega_c, &seed.omega_c, quarter_rpm, "omega_c");
    let held: Vec<f64> = (0..151).map(|i| seed.t_e[i / 2 * 2]).collect();
    assert_near(&recording.t_e, &held, 0.0, "T_e holds its previous value");
    assert_near(&recording.theta_h, &seed.theta_h, 1e-9, "theta_h");
    let expected = "nEngine (omega_f_rad_s): rpm converted to rad/s";
    assert!(notes.iter().any(|n| n.text == expected), "{expected} is not in {notes:?}");
}

#[test]
fn invalid_samples_have_no_value() {
    let seed = seed();
    let (recording, notes) = read("measurements/invalid.mf4", "");
    assert_near(&recording.omega_c[..40], &seed.omega_c[..40], 0.0, "before");
    assert_near(&recording.omega_c[43..], &seed.omega_c[43..], 0.0, "after");
    assert!(recording.omega_c[40..43].iter().all(|v| v.is_nan()));
    let torque = recording.t_fc.unwrap();
    let there = torque.iter().zip(seed.t_fc.as_ref().unwrap()).filter(|(t, _)| !t.is_nan());
    assert_eq!(there.clone().count(), 151 - 30);
    assert!(there.into_iter().all(|(t, s)| t == s));
    let texts: Vec<&str> = notes.iter().map(|n| n.text.as_str()).collect();
    assert!(
        texts.contains(&"omega_c_rad_s: 1 gap (3 samples, the longest 30 ms, the first at record 41); no value is put there"),
        "{texts:?}"
    );
    assert!(texts.iter().any(|t| t.starts_with("T_fc_Nm: 1 gap (30 samples, the longest 300 ms")), "{texts:?}");
}

#[test]
fn parquet_equals_the_seed() {
    let seed = seed();
    assert_eq!(read("measurements/plain.parquet", ""), (seed.clone(), vec![]));
    let (packed, notes) = read("measurements/zstd.parquet", "");
    assert_near(&packed.omega_f, &seed.omega_f, 1e-4, "single precision");
    assert_near(&packed.omega_c[43..], &seed.omega_c[43..], 0.0, "after the nulls");
    assert!(notes.iter().any(|n| n.text.contains("the first at row 41")), "{notes:?}");
    let (logger, _) = read("measurements/logger.parquet", LOGGER);
    assert_near(&logger.omega_f, &seed.omega_f, 1e-9, "rpm by metadata");
    assert_near(&logger.omega_c, &seed.omega_c, 1e-9, "rpm in brackets");
    assert_near(&logger.x_to_cmd, &seed.x_to_cmd, 1e-9, "µm as integers");
    assert_near(&logger.theta_h, &seed.theta_h, 1e-9, "°F");
}

#[test]
fn an_unfinalised_file_is_read_to_its_end_and_said_so() {
    let (recording, notes) = read("measurements/unfinalised.mf4", "");
    assert_eq!(recording, seed());
    assert!(notes.iter().any(|n| n.text.contains("did not finalise")), "{notes:?}");
}

#[test]
fn a_file_cut_anywhere_is_refused_or_whole_and_never_wrong() {
    let dir = tempdir("cut");
    for (name, step) in [("deflate.mf4", 97), ("plain.mf4", 131), ("fragments.mf4", 113), ("plain.parquet", 101)] {
        let bytes = std::fs::read(data("measurements").join(name)).unwrap();
        let whole = read(&format!("measurements/{name}"), "").0;
        for length in (0..bytes.len()).step_by(step) {
            let path = dir.join(name);
            std::fs::write(&path, &bytes[..length]).unwrap();
            match campaign::read_one(&path, &about(), &ChannelMap::default()) {
                Ok((recording, _)) => assert_eq!(recording, whole, "{name} cut to {length} bytes"),
                Err(e) => assert!(e.to_string().starts_with(name), "{e}"),
            }
        }
    }
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn a_drafted_map_reads_the_file_that_it_was_drafted_for() {
    for name in ["measurements/rates.mf4", "measurements/logger.parquet"] {
        let map = campaign::draft_channel_map(&campaign::inspect(&data(name), None, &|_| {}).unwrap());
        let (drafted, _) = read(name, &map);
        assert_eq!(format!("{drafted:?}"), format!("{:?}", read(name, LOGGER).0), "{map}");
    }
    // With our names, and with or without units in the file.
    for name in ["measurements/plain.mf4", "measurements/invalid.mf4", "measurements/plain.parquet", "seed/r01.csv"] {
        let map = campaign::draft_channel_map(&campaign::inspect(&data(name), None, &|_| {}).unwrap());
        // As texts: an invalid sample is NaN, which equals nothing.
        assert_eq!(format!("{:?}", read(name, &map)), format!("{:?}", read(name, "")), "{map}");
    }
}

fn tempdir(name: &str) -> PathBuf {
    let dir = std::env::temp_dir().join(format!("kisspoint-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    dir
}
