//! Checks between a file and a recording: units, bounds that reveal a wrong unit, values that are not numbers, names that lead out of the folder.

use kisspoint::campaign::{self, Campaign, CampaignError, ChannelMap, ReadOptions, Recording};
use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

const ENTRY: &str = r#"{"manoeuvre": "launch", "sample_rate_Hz": 100, "theta_c0_degC": 36.0, "theta_b0_degC": 30.0}"#;

/// A campaign with the sound recording r01 and, as r02, the text that a test writes; removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(second: &str) -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let folder = Self(std::env::temp_dir().join(format!("kisspoint-guards-{}-{number}", std::process::id())));
        std::fs::create_dir_all(&folder.0).unwrap();
        folder.file("vehicle.json", b"{}");
        folder.file("recordings.json", format!(r#"{{"r01": {ENTRY}, "r02": {ENTRY}}}"#).as_bytes());
        folder.file("r01.csv", &std::fs::read(data("seed/r01.csv")).unwrap());
        folder.file("r02.csv", second.as_bytes());
        folder
    }

    fn file(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.0.join(name), bytes).unwrap();
    }

    fn read(&self) -> Result<Campaign, CampaignError> {
        campaign::read(&self.0, &ReadOptions::default())
    }

    /// Why r02 was left out.
    fn left_out(&self) -> String {
        let read = self.read().unwrap();
        let reason = read.left_out.iter().find(|l| l.recording == "r02").map(|l| l.reason.clone());
        reason.unwrap_or_else(|| panic!("r02 is used; left out are {:?}", read.left_out))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/campaign").join(name)
}

/// The seed recording with the header and the cells of one column changed.
fn changed(column: usize, header: &str, change: impl Fn(usize, f64) -> f64) -> String {
    let seed = std::fs::read_to_string(data("seed/r01.csv")).unwrap();
    let line = |(row, line): (usize, &str)| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        cells[column] = if row == 0 { header.to_owned() } else { format!("{:?}", change(row - 1, cells[column].parse().unwrap())) };
        cells.join(",") + "\n"
    };
    seed.lines().enumerate().map(line).collect()
}

/// The library's unit of each column that is changed.
const UNITS: [(usize, &str); 5] = [(0, "s"), (1, "rad/s"), (3, "Nm"), (6, "mm"), (8, "degC")];

type Read = fn(&Recording) -> Vec<f64>;

#[test]
fn every_unit_that_is_documented_is_read_by_its_factor() {
    // Factor and offset from each unit to the library's, by the definitions of the units.
    let foot_pound = 4.448_221_615_260_5 * 0.304_8;
    let speed: (usize, &str, Read) = (1, "omega_f_rad_s", |r| r.omega_f.clone());
    let torque: (usize, &str, Read) = (3, "T_e_Nm", |r| r.t_e.clone());
    let position: (usize, &str, Read) = (6, "x_to_mm", |r| r.x_to.clone().unwrap());
    let disc: (usize, &str, Read) = (8, "theta_c_degC", |r| r.theta_c.clone().unwrap());
    let time: (usize, &str, Read) = (0, "time_s", |r| r.omega_f.clone());
    let cases = [
        (speed, "rpm", 2.0 * PI / 60.0, 0.0),
        (speed, "1/min", 2.0 * PI / 60.0, 0.0),
        (speed, "Hz", 2.0 * PI, 0.0),
        (speed, "rev/s", 2.0 * PI, 0.0),
        (speed, "deg/s", PI / 180.0, 0.0),
        (speed, "°/s", PI / 180.0, 0.0),
        (torque, "N·m", 1.0, 0.0),
        (torque, "kN·m", 1e3, 0.0),
        (torque, "mN·m", 1e-3, 0.0),
        (torque, "daN·m", 10.0, 0.0),
        (torque, "N·mm", 1e-3, 0.0),
        (torque, "lbf·ft", foot_pound, 0.0),
        (torque, "ft-lb", foot_pound, 0.0),
        (position, "m", 1e3, 0.0),
        (position, "cm", 10.0, 0.0),
        (position, "µm", 1e-3, 0.0),
        (position, "in", 25.4, 0.0),
        (disc, "°C", 1.0, 0.0),
        (disc, "K", 1.0, -273.15),
        (disc, "°F", 5.0 / 9.0, -32.0 * 5.0 / 9.0),
        (time, "min", 60.0, 0.0),
        (time, "ms", 1e-3, 0.0),
        (time, "µs", 1e-6, 0.0),
        (time, "ns", 1e-9, 0.0),
    ];
    for ((column, name, values), unit, factor, offset) in cases {
        let ours = UNITS.iter().find(|u| u.0 == column).unwrap().1;
        let folder = Folder::new(&changed(column, &format!("measured [{unit}]"), |_, ours| (ours - offset) / factor));
        folder.file("r01.csv", changed(column, &format!("measured [{ours}]"), |_, ours| ours).as_bytes());
        let map = ChannelMap::from_toml("map", &format!("{name} = \"measured\"")).unwrap();
        let read = campaign::read(&folder.0, &ReadOptions { channel_map: Some(map), ..ReadOptions::default() }).unwrap();
        assert_eq!(read.left_out, [], "{unit}");
        let (expected, found) = (values(&read.recordings[0]), values(&read.recordings[1]));
        assert_eq!(expected.len(), found.len(), "{unit}");
        for (e, f) in expected.iter().zip(found) {
            assert!((e - f).abs() <= 1e-9 * e.abs().max(1.0), "{unit}: {f} for {e}");
        }
    }
}

#[test]
fn a_speed_that_no_car_turns_is_another_unit() {
    // A fifth of the recording is at 1600 rad/s, reached and left in ramps, so that it is neither a spike nor most of the recording.
    let burst = |row: usize| ((row as f64 - 45.0) / 15.0).min((105.0 - row as f64) / 15.0).clamp(0.0, 1.0);
    let at = |top: f64| Folder::new(&changed(1, "omega_f_rad_s", |row, ours| ours + burst(row) * (top - ours)));
    let reason = at(1600.0).left_out();
    assert!(reason.contains("r02.csv") && reason.contains("omega_f_rad_s") && reason.contains("rpm"), "{reason}");
    assert_eq!(at(560.0).read().unwrap().left_out, [], "an engine at its limit is believed");
}

#[test]
fn a_value_in_an_mdf_that_is_no_number_is_no_value() {
    let plain = std::fs::read(data("measurements/plain.mf4")).unwrap();
    let sound = {
        let folder = Folder::new("");
        std::fs::remove_file(folder.0.join("r02.csv")).unwrap();
        folder.file("r02.mf4", &plain);
        folder.read().unwrap().recordings[1].clone()
    };
    let wanted = sound.omega_c[75];
    let places: Vec<usize> = (0..plain.len() - 8).filter(|k| plain[*k..*k + 8] == wanted.to_le_bytes()).collect();
    assert_eq!(places.len(), 1, "the value stands once in the file");
    for bad in [f64::INFINITY, f64::NEG_INFINITY, f64::NAN] {
        let mut bytes = plain.clone();
        bytes[places[0]..places[0] + 8].copy_from_slice(&bad.to_le_bytes());
        let folder = Folder::new("");
        std::fs::remove_file(folder.0.join("r02.csv")).unwrap();
        folder.file("r02.mf4", &bytes);
        let read = folder.read().unwrap();
        assert_eq!(read.left_out, [], "{bad}");
        let found = &read.recordings[1];
        assert!(found.omega_c.iter().all(|v| !v.is_infinite()), "{bad} was kept");
        assert_eq!(found.omega_c.iter().filter(|v| v.is_finite()).count(), 150, "{bad}: only that sample is none");
        assert!(read.notes.iter().any(|n| n.recording == "r02" && n.text.contains("omega_c")), "{bad}: it is said, {:?}", read.notes);
        // Nor does it become the minimum or maximum that `inspect` shows.
        let seen = campaign::inspect(&folder.0.join("r02.mf4"), None, &|_| {}).unwrap();
        assert!(seen.channels.iter().all(|c| c.min.is_none_or(f64::is_finite) && c.max.is_none_or(f64::is_finite)), "{bad}: {seen:?}");
        assert_eq!(seen.channels.iter().map(|c| c.invalid).sum::<usize>(), 1, "{bad}");
    }
}

#[test]
fn the_name_of_a_recording_leads_nowhere_else() {
    for name in ["../r01", "a/b", r"a\\b", ".hidden", "", "..", "/etc/passwd"] {
        let folder = Folder::new("");
        folder.file("recordings.json", format!(r#"{{"r01": {ENTRY}, "{name}": {ENTRY}}}"#).as_bytes());
        let said = folder.read().unwrap_err().to_string();
        assert!(said.contains("recordings.json") && said.contains("can't be the name of a recording"), "{name}: {said}");
    }
}

#[test]
fn a_campaign_that_is_too_large_is_refused_before_it_is_read() {
    let folder = Folder::new("");
    let entries: Vec<String> = (0..=1000).map(|k| format!(r#""r{k:04}": {ENTRY}"#)).collect();
    folder.file("recordings.json", format!("{{{}}}", entries.join(",")).as_bytes());
    let refused = folder.read().unwrap_err().to_string();
    assert!(refused.contains("recordings.json: 1001 recordings") && refused.contains("the 1000 that"), "{refused}");
    // A huge sparse file, which takes no room on the disk.
    std::fs::File::create(folder.0.join("recordings.json")).unwrap().set_len(1 << 30).unwrap();
    let refused = folder.read().unwrap_err().to_string();
    assert!(refused.contains("recordings.json: is larger than 16 MB"), "{refused}");
    let folder = Folder::new("");
    std::fs::File::create(folder.0.join("r02.csv")).unwrap().set_len(1 << 30).unwrap();
    assert!(folder.left_out().contains("r02.csv: the file is not text"), "{}", folder.left_out());
    folder.file("r02.csv", &vec![b'x'; 17 << 20]);
    assert!(folder.left_out().contains("r02.csv: line 1 is longer than 16 MB"), "{}", folder.left_out());
}

#[test]
fn recordings_that_are_too_long_together_are_refused() {
    // 1.2 million rows each, at 100 kHz: one such recording is accepted, two are too many.
    let text = |skip: usize| {
        let mut text = String::from("time_s,omega_f_rad_s,omega_c_rad_s,T_e_Nm,x_to_cmd_mm\n");
        (skip..1_200_000 + skip).for_each(|k| {
            let v = k % 7;
            text.push_str(&format!("{}e-5,{}.5,{}.25,{},{}\n", k - skip, 100 + v, 90 + v, 30 + v, 5 + v % 3));
        });
        text
    };
    let folder = Folder::new(&text(1));
    let entry = ENTRY.replace(": 100,", ": 100000,");
    folder.file("recordings.json", format!(r#"{{"r01": {ENTRY}, "r02": {entry}, "r03": {entry}}}"#).as_bytes());
    assert_eq!(folder.read().unwrap().recordings.iter().filter(|r| r.time.len() == 1_200_000).count(), 1);
    folder.file("r03.csv", text(2).as_bytes());
    let refused = folder.read().unwrap_err().to_string();
    assert!(refused.contains("rows are more than the 2000000") && refused.contains("window_s"), "{refused}");
}
