//! MDF4 and Parquet files are read as asammdf and pyarrow, which wrote them, read them back.
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
    for name in ["plain", "deflate", "transposed", "fragments", "value_blocks", "v430"] {
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
        // The file with invalid samples is compared with the seed sample by sample in another test.
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

/// If a channel block has no link to a unit, the unit is that of its conversion (`cc_md_unit`); if it links to an empty text, it has no unit.
#[test]
fn a_unit_may_stand_with_the_conversion() {
    let bytes = std::fs::read(data("measurements/rates.mf4")).unwrap();
    let word = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
    // The links of a block begin at byte 24: in a channel the fifth is its conversion and the seventh its unit; in a conversion the second is its unit.
    let channels = (0..bytes.len() - 160).step_by(8).filter(|&at| bytes[at..].starts_with(b"##CN"));
    let converted: Vec<usize> = channels.filter(|&at| word(at + 24 + 8 * 4) != 0 && word(at + 24 + 8 * 6) != 0).collect();
    assert!(converted.len() >= 2, "{converted:?}");
    let dir = tempdir("unit");
    let with = |name: &str, unit_of_channel: &dyn Fn(usize) -> usize| {
        let mut moved = bytes.clone();
        for &at in &converted {
            let (conversion, unit) = (word(at + 24 + 8 * 4), word(at + 24 + 8 * 6));
            moved[conversion + 32..conversion + 40].copy_from_slice(&(unit as u64).to_le_bytes());
            moved[at + 72..at + 80].copy_from_slice(&(unit_of_channel(unit) as u64).to_le_bytes());
        }
        // An empty text at the end of the file.
        moved.extend(b"##TX\0\0\0\0\x20\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0");
        std::fs::write(dir.join(name), moved).unwrap();
        campaign::read_one(&dir.join(name), &about(), &ChannelMap::from_toml("map", LOGGER).unwrap()).map_err(|e| e.to_string())
    };
    assert_eq!(with("conversion.mf4", &|_| 0), Ok(read("measurements/rates.mf4", LOGGER)));
    let without = with("empty.mf4", &|_| bytes.len()).unwrap_err();
    assert!(without.contains("channel nEngine") && without.contains("the unit can't be right"), "an empty text overrules: {without}");
    std::fs::remove_dir_all(dir).unwrap();
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
fn an_unsorted_file_is_sorted_by_its_record_numbers() {
    let names = ["omega_f_rad_s", "omega_c_rad_s", "T_e_Nm", "x_to_cmd_mm", "theta_h_degC", "x_to_mm", "T_fc_Nm", "theta_c_degC"];
    let map = |group: usize| -> String { names.iter().map(|n| format!("{n} = {{ group = \"{group}\" }}\n")).collect() };
    assert_eq!(read("measurements/unsorted.mf4", &map(0)).0, seed());
    let (third, _) = read("measurements/unsorted.mf4", &map(1));
    let expected: Vec<f64> = seed().omega_f.into_iter().step_by(3).collect();
    assert_eq!(third.omega_f, expected);
    let both = campaign::read_one(&data("measurements/unsorted.mf4"), &about(), &ChannelMap::default()).unwrap_err().to_string();
    assert!(both.contains("occurs 2 times") && both.contains("give `group` in the channel map"), "{both}");
}

#[test]
fn values_with_a_name_are_missing_and_the_others_are_scaled() {
    let (recording, notes) = read("measurements/named.mf4", "");
    let seed = seed();
    assert!(recording.omega_c[20..24].iter().all(|v| v.is_nan()));
    assert_near(&recording.omega_c[24..], &seed.omega_c[24..], 0.0126, "omega_c");
    assert!(notes.iter().any(|n| n.text.contains("4 samples are a text and no number (the first is \"SNA\")")), "{notes:?}");
}

#[test]
fn frames_of_a_bus_need_a_database() {
    let path = data("measurements/frames.mf4");
    let without = campaign::read_one(&path, &about(), &ChannelMap::default()).unwrap_err().to_string();
    assert!(without.contains("raw frames (CAN frames in MDF4)") && without.contains("dbc = \"car.dbc\""), "{without}");
    let map = format!("dbc = {:?}\n{}", data("measurements/frames.dbc"), LOGGER.replace("theta_h_degC = \"TempBellHousing\"", ""));
    let (recording, notes) = read("measurements/frames.mf4", &map);
    let seed = seed();
    // Two messages, 3 ms apart: every row has the signals of only one of them.
    let there = |v: &[f64]| v.iter().copied().filter(|v| !v.is_nan()).collect::<Vec<f64>>();
    let quarter_rpm = 0.1251 * std::f64::consts::PI / 30.0;
    // The engine's first frame precedes the clutch's; the recording begins where both are available.
    assert_near(&there(&recording.omega_f), &seed.omega_f[1..], quarter_rpm, "omega_f");
    let disc: Vec<f64> = seed.omega_c.iter().enumerate().filter(|(k, _)| *k != 50).map(|(_, v)| *v).collect();
    let got = there(&recording.omega_c);
    assert_near(&got, &disc[..got.len()], quarter_rpm, "omega_c");
    assert!(notes.iter().any(|n| n.text.contains("theta_h_degC: not recorded")), "{notes:?}");
    let missing = ChannelMap::from_toml("map", "dbc = \"nowhere.dbc\"").unwrap();
    assert!(campaign::read_one(&path, &about(), &missing).unwrap_err().to_string().contains("nowhere.dbc can't be read"));
}

#[test]
fn more_kinds_of_parquet_columns() {
    let seed = seed();
    for name in ["int96_brotli", "lz4"] {
        let (recording, _) = read(&format!("measurements/{name}.parquet"), "[time_s]\nname = \"time\"");
        assert_near(&recording.time, &seed.time, 1e-9, "time");
        assert_near(&recording.omega_f, &seed.omega_f, 0.0, "omega_f");
        assert_near(&recording.omega_c, &seed.omega_c, 1e-12, "decimals");
        assert_near(&recording.x_to_cmd, &seed.x_to_cmd, 1e-12, "decimals");
        assert_near(&recording.t_e, &seed.t_e, 0.04, "half precision");
        assert_eq!(recording.brake.unwrap().iter().position(|on| *on), Some(140));
    }
}

/// The seed written as text in another layout, read back.
fn text(name: &str, bytes: &[u8]) -> (Recording, Vec<Note>) {
    let path = tempdir("texts").join(name);
    std::fs::write(&path, bytes).unwrap();
    campaign::read_one(&path, &about(), &ChannelMap::default()).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn texts_of_every_layout_equal_the_seed() {
    let plain = std::fs::read_to_string(data("seed/r01.csv")).unwrap();
    let semicolons = plain.replace(',', ";").replace('.', ",");
    let tabs = plain.replace(',', "\t");
    let blanks = plain.replace(',', "   ");
    let preamble = format!("Recorder;X200\nDriver;A. Driver\n\n{semicolons}");
    let utf16: Vec<u8> = "\u{feff}".encode_utf16().chain(semicolons.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    let rows = || plain.lines().skip(1);
    let dated = rows().map(|l| {
        let (time, rest) = l.split_once(',').unwrap();
        let seconds: f64 = time.parse().unwrap();
        format!("2026-11-22T05:59:{:06.3}Z,{rest}\n", 59.0_f64.min(seconds + 12.0))
    });
    let dated = format!("{}\n{}", plain.lines().next().unwrap(), dated.collect::<String>());
    let names: Vec<&str> = plain.lines().next().unwrap().split(',').collect();
    let long = rows().flat_map(|l| {
        let cells: Vec<&str> = l.split(',').collect();
        (1..cells.len()).map(|k| format!("{},{},{}\n", cells[0], names[k], cells[k])).collect::<Vec<_>>()
    });
    let long = format!("t,channel,value\n{}", long.collect::<String>());
    // A second block of columns, from the torque on, that begins with the time stamps again.
    let blocks = plain.lines().map(|l| {
        let cells: Vec<&str> = l.split(',').collect();
        format!("{},{},{}\n", cells[..3].join(","), cells[0], cells[3..].join(","))
    });
    let blocks: String = blocks.collect();
    let units = "s,rad/s,rad/s,daNm,mm,degC,mm,Nm,degC";
    let cases: [(&str, Vec<u8>); 10] = [
        ("plain.txt", plain.clone().into()),
        ("sep.csv", format!("sep=;\n{semicolons}").into()),
        ("semicolons.csv", semicolons.clone().into()),
        ("tabs.dat", tabs.into()),
        ("blanks.dat", blanks.into()),
        ("preamble.csv", preamble.into()),
        ("utf16.csv", utf16),
        ("dated.csv", dated.into()),
        ("long.csv", long.into()),
        ("blocks.csv", blocks.into()),
    ];
    let seed = seed();
    for (name, bytes) in cases {
        let (recording, notes) = text(name, &bytes);
        assert_near(&recording.time, &seed.time, 1e-9, name);
        assert_eq!((&recording.omega_f, &recording.t_e, &recording.theta_c), (&seed.omega_f, &seed.t_e, &seed.theta_c), "{name}");
        assert_eq!(notes.iter().any(|n| n.text.contains("in front of the header")), name == "preamble.csv", "{notes:?}");
    }
    // Units in a row of their own, one of which (daNm) differs from the library's.
    let stems = plain.replacen("T_e_Nm", "T_e", 1).replacen('\n', &format!("\n{units}\n"), 1);
    let (recording, notes) = text("units.csv", stems.as_bytes());
    let tenfold: Vec<f64> = seed.t_e.iter().map(|t| 10.0 * t).collect();
    assert_near(&recording.t_e, &tenfold, 1e-9, &format!("{notes:?}"));
}

#[test]
fn files_of_other_kinds_are_named_with_the_step_to_take() {
    let fault = |name: &str, bytes: &[u8]| {
        let path = tempdir("kinds").join(name);
        std::fs::write(&path, bytes).unwrap();
        campaign::read_one(&path, &about(), &ChannelMap::default()).unwrap_err().to_string()
    };
    for (name, bytes, expected) in [
        ("a.blf", &b"LOGG...."[..], "raw frames (Vector BLF)"),
        ("a.asc", b"date Mon", "raw frames (Vector ASC)"),
        ("a.trc", b";$FILEVERSION=1.1", "raw frames (PCAN TRC)"),
        ("a.log", b"(0.0) can0 1#00", "raw frames (candump)"),
        ("a.txt", b"\n(1742339035.686920) can0 108#06D507B007DE00DD\n", "raw frames (candump)"),
        ("a.csv", b"Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2\n5300,00000410,false,Rx,0,2,11,00,", "raw frames (as a table"),
        ("a.xlsx", b"PK\x03\x04....", "the file is a workbook"),
    ] {
        let message = fault(name, bytes);
        assert!(message.contains(expected), "{message}");
        assert!(message.contains("can_logconvert") || message.contains("Save the sheet as CSV"), "{message}");
    }
    // A table may have the file name of a log.
    let table = b"Time (s),Engine RPM,Speed MPH\n0.0,800,0\n0.1,810,0\n";
    for name in ["a.log", "a.asc"] {
        assert!(!fault(name, table).contains("raw frames"), "{}", fault(name, table));
    }
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
    // With the library's channel names, and with or without units in the file.
    for name in ["measurements/plain.mf4", "measurements/invalid.mf4", "measurements/plain.parquet", "seed/r01.csv"] {
        let map = campaign::draft_channel_map(&campaign::inspect(&data(name), None, &|_| {}).unwrap());
        // Compared as texts, because an invalid sample is NaN, which equals nothing.
        assert_eq!(format!("{:?}", read(name, &map)), format!("{:?}", read(name, "")), "{map}");
    }
}

fn tempdir(name: &str) -> PathBuf {
    let dir = std::env::temp_dir().join(format!("kisspoint-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    dir
}
