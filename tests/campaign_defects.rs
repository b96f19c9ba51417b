//! Faulty input: every defect is reported with file, channel, row and remedy, and a sound recording beside it is still read.
//!
//! Each case changes the sound recording `seed/r01.csv` in one way.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use kisspoint::campaign::{self, Campaign, CampaignError, ChannelMap, ReadOptions};

const ENTRY: &str = r#"{"manoeuvre": "launch", "sample_rate_Hz": 100, "theta_c0_degC": 36.0, "theta_b0_degC": 30.0}"#;

/// The folder of a campaign, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Folder {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let dir = std::env::temp_dir().join(format!("kisspoint-defects-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&dir).unwrap();
        let folder = Folder(dir);
        folder.file("vehicle.json", "{}");
        folder
    }

    /// The sound recording as r01 and another as r02.
    fn with(second: &str) -> Folder {
        let folder = Folder::new();
        folder.file("recordings.json", &format!(r#"{{"r02": {ENTRY}, "r01": {ENTRY}}}"#));
        folder.file("r01.csv", &seed());
        folder.file("r02.csv", second);
        folder
    }

    fn file(&self, name: &str, text: &str) {
        std::fs::write(self.0.join(name), text).unwrap();
    }

    fn read(&self) -> Result<Campaign, CampaignError> {
        campaign::read(&self.0, &ReadOptions::default())
    }

    fn fault(&self) -> String {
        self.read().unwrap_err().to_string()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn seed() -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/campaign/seed/r01.csv")).unwrap()
}

/// The seed recording with cells changed; column 0 is time, and rows count from 0.
fn changed(change: impl Fn(usize, usize, f64) -> String) -> String {
    let seed = seed();
    let mut lines = seed.lines();
    let mut out = lines.next().unwrap().to_string();
    for (row, line) in lines.enumerate() {
        let cells = line.split(',').enumerate().map(|(column, cell)| change(row, column, cell.parse().unwrap()));
        out.push('\n');
        out.push_str(&cells.collect::<Vec<_>>().join(","));
    }
    out.push('\n');
    out
}

fn column(at: usize, change: impl Fn(usize, f64) -> String) -> String {
    changed(|row, column, value| if column == at { change(row, value) } else { value.to_string() })
}

/// Reads the sound recording and the changed one, which must be left out for a reason that contains all of these texts.
fn left_out(second: &str, expected: &[&str]) {
    let campaign = Folder::with(second).read().unwrap();
    assert_eq!(campaign.recordings.len(), 1);
    assert_eq!(campaign.recordings[0].name, "r01");
    let [left_out] = campaign.left_out.as_slice() else { panic!("{:?}", campaign.left_out) };
    assert_eq!(left_out.recording, "r02");
    for text in expected {
        assert!(left_out.reason.contains(text), "`{text}` is not in: {}", left_out.reason);
    }
}

/// Reads the changed recording, which must be used, with notes that contain each of these texts.
fn noted(second: &str, expected: &[&str]) -> Campaign {
    let campaign = Folder::with(second).read().unwrap();
    assert_eq!(campaign.left_out, []);
    let notes: Vec<&str> = campaign.notes.iter().filter(|n| n.recording == "r02").map(|n| n.text.as_str()).collect();
    for text in expected {
        assert!(notes.iter().any(|n| n.contains(text)), "`{text}` is not in {notes:?}");
    }
    campaign
}

#[test]
fn a_sound_campaign_is_sorted_and_has_nothing_to_say() {
    let campaign = Folder::with(&column(1, |_, v| format!("{}", v + 0.025))).read().unwrap();
    let names: Vec<&str> = campaign.recordings.iter().map(|r| r.name.as_str()).collect();
    assert_eq!(names, ["r01", "r02"]);
    assert!(campaign.left_out.is_empty() && campaign.notes.is_empty());
    assert_eq!(campaign.recordings[0].omega_f[0].to_string(), seed().lines().nth(1).unwrap().split(',').nth(1).unwrap());
    assert_eq!(campaign.fingerprint.len(), 64);
}

#[test]
fn missing_channel() {
    let text = seed().replace("omega_c_rad_s", "n_disc");
    left_out(&text, &["r02.csv, channel omega_c_rad_s", "is not in the file, which has time_s, omega_f_rad_s, n_disc", "channel map"]);
    left_out(&seed().replace("time_s", "clock"), &["r02.csv, channel time_s"]);
}

#[test]
fn missing_and_wrong_cells() {
    let long = column(1, |row, v| if (60..70).contains(&row) { "NaN".into() } else { v.to_string() });
    let open = noted(&long, &["omega_f_rad_s: 1 gap (10 samples, the longest 100 ms, the first at line 62); no value is put there"]);
    let (got, whole) = (&open.recordings[1], &open.recordings[0]);
    assert!(got.omega_f[60..70].iter().all(|v| v.is_nan()));
    assert_eq!((got.omega_f[59], got.omega_f[70]), (whole.omega_f[59], whole.omega_f[70]));
    assert_eq!((&got.time, &got.omega_c, &got.t_e), (&whole.time, &whole.omega_c, &whole.t_e));
    let sprinkled = column(1, |row, v| if row % 9 == 5 { String::new() } else { v.to_string() });
    noted(&sprinkled, &["omega_f_rad_s: 17 gaps (17 samples, the longest 10 ms, the first at line 7)"]);
    let text = column(3, |row, v| if row == 7 { "open".into() } else { v.to_string() });
    left_out(&text, &["r02.csv, channel T_e_Nm, line 9", "\"open\" is not a number"]);
    left_out(&column(2, |_, _| "NaN".into()), &["r02.csv, channel omega_c_rad_s", "not one valid sample"]);
    let late = column(1, |row, v| if row < 15 { "NaN".into() } else { v.to_string() });
    left_out(&late, &["r02.csv, channel omega_f_rad_s, line 17", "starts 0.150 s after"]);
}

#[test]
fn inputs_are_held_over_a_tenth_of_a_second() {
    let input = |rows: std::ops::Range<usize>| column(4, move |row, v| if rows.contains(&row) { String::new() } else { v.to_string() });
    let held =
        noted(&input(100..110), &["x_to_cmd_mm: 1 gap (10 samples, the longest 100 ms, the first at line 102); the value before is held"]);
    let (got, whole) = (&held.recordings[1], &held.recordings[0]);
    assert_eq!(got.time, whole.time);
    assert!(got.x_to_cmd[100..110].iter().all(|v| *v == whole.x_to_cmd[99]));
    assert_eq!(got.x_to_cmd[110..], whole.x_to_cmd[110..]);
    let cut = noted(&input(100..111), &["x_to_cmd_mm, line 102: a gap of 0.110 s; the recording is cut in front of it, 0.990 s remain"]);
    assert_eq!(cut.recordings[1].time, whole.time[..100]);
    left_out(&input(20..40), &["r02.csv, channel x_to_cmd_mm, line 22", "0.190 s remain", "Record again"]);
    // A lost frame loses no other sample.
    let lost: String = seed().lines().enumerate().filter(|(i, _)| *i != 81).map(|(_, l)| format!("{l}\n")).collect();
    let lost =
        noted(&lost, &["omega_f_rad_s, omega_c_rad_s, x_to_mm, T_fc_Nm, theta_c_degC: 1 gap (1 sample", "T_e_Nm, x_to_cmd_mm: 1 gap"]);
    assert_eq!(lost.recordings[1].time.len(), whole.time.len() - 1);
    assert_eq!(lost.recordings[1].omega_f[80..], whole.omega_f[81..]);
}

#[test]
fn jittered_stamps_are_kept_as_they_are() {
    let stamp = |row: usize| (row as f64 + 0.9 * ((row * row * 7919 % 1000) as f64 / 1000.0 - 0.5)) / 100.0 + 0.0045;
    let campaign = noted(&column(0, |row, _| stamp(row).to_string()), &["the clock starts at"]);
    let got = &campaign.recordings[1];
    assert!(got.time.iter().enumerate().all(|(k, t)| (t - (stamp(k) - stamp(0))).abs() < 1e-12));
    assert_eq!(got.omega_f, campaign.recordings[0].omega_f);
}

#[test]
fn channels_of_a_drive() {
    let with = |name: &str, cell: fn(usize) -> &'static str| -> String {
        let lines =
            seed().lines().enumerate().map(|(i, l)| format!("{l},{}\n", if i == 0 { name } else { cell(i - 1) })).collect::<Vec<_>>();
        lines.concat()
    };
    let braked = noted(&with("brake", |row| if row >= 120 { "1" } else { "0" }), &[]);
    let brake = braked.recordings[1].brake.as_ref().unwrap();
    assert!(brake.iter().enumerate().all(|(k, on)| *on == (k >= 120)));
    assert_eq!(braked.recordings[0].brake, None);
    left_out(&with("brake", |_| "7"), &["channel brake", "7 is neither 0 nor 1"]);
    let doubted =
        noted(&with("valid", |row| if (50..55).contains(&row) { "0" } else { "1" }), &["valid: 5 samples marked as not to be believed"]);
    let (got, whole) = (&doubted.recordings[1], &doubted.recordings[0]);
    assert_eq!(got.omega_f[..50], whole.omega_f[..50]);
    assert_eq!((got.time.len(), got.omega_f[50], got.time[50]), (whole.time.len() - 5, whole.omega_f[55], whole.time[55]));
}

#[test]
fn start_temperatures_may_be_uncertain_or_unknown() {
    let folder = Folder::with(&column(1, |_, v| format!("{}", v + 0.025)));
    let vague = r#"{"manoeuvre": "drive", "theta_c0_degC": 36, "theta_b0_degC": 30, "theta_c0_sigma_K": 12, "theta_b0_sigma_K": 9.5}"#;
    folder.file("recordings.json", &format!(r#"{{"r01": {vague}, "r02": {{"manoeuvre": "drive"}}}}"#));
    let campaign = folder.read().unwrap();
    let [known, unknown] = campaign.recordings.as_slice() else { panic!() };
    assert_eq!((known.theta_0_sigma, known.theta_c0), ([12.0, 9.5], 36.0));
    let air = unknown.theta_h[0];
    assert_eq!((unknown.theta_0_sigma, unknown.theta_c0, unknown.theta_b0), ([40.0; 2], air, air));
    assert!(campaign.notes.iter().any(|n| n.recording == "r02" && n.text.contains("give or take 40 K")), "{:?}", campaign.notes);
    folder.file("recordings.json", &format!(r#"{{"r01": {vague}, "r02": {{"manoeuvre": "drive", "theta_c0_sigma": 12}}}}"#));
    assert!(folder.fault().contains("recording `r02` has a key `theta_c0_sigma` that is not known"), "{}", folder.fault());
}

#[test]
fn without_position_or_housing_air() {
    let text = seed().replace("x_to_cmd_mm", "pedal").replace("theta_h_degC", "oil");
    let campaign = noted(&text, &["theta_h_degC: not recorded; 30 °C is taken throughout: as warm as the body at the start"]);
    assert!(campaign.recordings[1].x_to_cmd.is_empty());
    assert!(campaign.notes.iter().any(|n| n.text.starts_with("x_to_cmd_mm: not recorded: actuator, clutch force")));
    assert!(campaign.recordings[1].theta_h.iter().all(|t| *t == 30.0));
}

#[test]
fn clocks() {
    let back = column(0, |row, v| if row == 50 { "0.3".into() } else { v.to_string() });
    left_out(&back, &["r02.csv, channel time_s, line 52", "runs back from 0.49 s to 0.3 s"]);
    let twice = column(0, |row, v| if row == 50 { "0.49".into() } else { v.to_string() });
    left_out(&twice, &["r02.csv, channel time_s, line 52", "occurs twice"]);
    let hole = column(0, |row, v| if row == 50 { String::new() } else { v.to_string() });
    left_out(&hole, &["r02.csv, channel time_s, line 52", "the time is missing"]);
    left_out(&column(0, |_, v| (v * 1000.0).to_string()), &["r02.csv", "ticks at 0.1000 Hz", "it looks like ms"]);
    left_out(&column(0, |_, v| (v * 10.0).to_string()), &["r02.csv", "10.000 Hz"]);
    noted(&column(0, |_, v| (v + 12.5).to_string()), &["the clock starts at 12.5 s"]);
    noted(&column(0, |_, v| (v / 2.0).to_string()), &["recordings.json says 100 Hz, the speeds come at 200 Hz"]);
    let odd = noted(&column(0, |_, v| (v * 100.0 / 97.0).to_string()), &[]);
    assert_eq!(odd.recordings[1].sample_rate_hz, 97.0);
    assert_eq!(odd.recordings[1].omega_f, odd.recordings[0].omega_f);
    let lost: String = seed().lines().enumerate().filter(|(i, _)| !(81..100).contains(i)).map(|(_, l)| format!("{l}\n")).collect();
    noted(&lost, &["line 82: a gap of 0.190 s; the recording is cut in front of it"]);
}

#[test]
fn units_that_cannot_be_right() {
    let rpm = 30.0 / std::f64::consts::PI;
    let cases: [(usize, f64, f64, &str, &str); 10] = [
        (1, rpm, 0.0, "omega_f_rad_s", "It looks like rpm"),
        (1, 0.5 / std::f64::consts::PI, 0.0, "omega_f_rad_s", "It looks like Hz"),
        (1, -1.0, 0.0, "omega_f_rad_s", "turn backwards"),
        (3, 1e-3, 0.0, "T_e_Nm", "It looks like kN·m"),
        (3, 1e3, 0.0, "T_e_Nm", "It looks like N·mm"),
        (4, 1e-3, 0.0, "x_to_cmd_mm", "It looks like m:"),
        (4, 12.0, 0.0, "x_to_cmd_mm", "It looks like percent of the travel: give scale and offset"),
        (4, 1e3, 0.0, "x_to_cmd_mm", "It looks like um"),
        (5, 1.0, 273.15, "theta_h_degC", "It looks like K"),
        (8, 1.0, 273.15, "theta_c_degC", "It looks like K"),
    ];
    for (at, scale, offset, name, looks) in cases {
        let text = column(at, |_, v| (v * scale + offset).to_string());
        left_out(&text, &["r02.csv, channel ", name, ", line ", "the unit can't be right", looks]);
    }
}

/// Recordings of one logger share their units: where most of them are impossible, none is used.
#[test]
fn a_unit_that_cannot_be_right_in_most_recordings_is_wrong_in_all() {
    let percent = |share: f64| column(4, |_, v| (v * 12.0 * share).to_string());
    let folder = Folder::with(&percent(1.0));
    folder.file("recordings.json", &format!(r#"{{"r01": {ENTRY}, "r02": {ENTRY}, "r03": {ENTRY}}}"#));
    folder.file("r03.csv", &percent(1.01));
    let fault = folder.fault();
    assert!(fault.contains("no recording is usable") && fault.contains("r02.csv, channel x_to_cmd_mm"), "{fault}");
    assert!(fault.contains("r01.csv: in most recordings the unit of x_to_cmd_mm can't be right, see r02"), "{fault}");
}

#[test]
fn stated_units() {
    let rpm = column(1, |_, v| (v * 30.0 / std::f64::consts::PI).to_string());
    let converted = noted(&rpm.replace("omega_f_rad_s", "omega_f [rpm]"), &["omega_f (omega_f_rad_s): rpm converted to rad/s"]);
    let (got, expected) = (&converted.recordings[1].omega_f, &converted.recordings[0].omega_f);
    assert!(got.iter().zip(expected).all(|(g, e)| (g - e).abs() < 1e-9));
    left_out(
        &rpm.replace("omega_f_rad_s", "omega_f_rad_s [rpm]"),
        &["omega_f_rad_s", "the channel's name says the unit is rad/s, the file says rpm"],
    );
    left_out(
        &seed().replace("omega_f_rad_s", "omega_f [1/s]"),
        &["the unit \"1/s\" is not known for a rotational speed", "rad/s, rpm, Hz"],
    );
    left_out(&seed().replace("T_e_Nm", "T_e [mm]"), &["the unit \"mm\" can't be right: the channel is a torque"]);
}

#[test]
fn files() {
    left_out("", &["r02.csv: the file is empty"]);
    left_out("time_s,omega_f_rad_s\n", &["r02.csv: there is a header but no row"]);
    let some = |n: usize| seed().lines().take(n).map(|l| format!("{l}\n")).collect::<String>();
    left_out(&some(31), &["r02.csv, channel omega_f_rad_s, line 31: the recording ends here, 0.290 s after its start", "Record longer"]);
    left_out(&some(2), &["r02.csv, channel omega_f_rad_s, line 2: the recording ends here", "0.5 s or more"]);
    // The engine torque is still near zero there; this must not be mistaken for a wrong unit.
    let early = column(3, |_, v| (v * 1e-3).to_string());
    left_out(&early.lines().take(4).map(|l| format!("{l}\n")).collect::<String>(), &["line 4: the recording ends here, 0.020 s"]);
    noted(&format!("{}0.8,120", some(81)), &["line 82 (the last) has 2 of 9 cells: cut off while writing, dropped"]);
    left_out(&format!("{}0.8,120\n{}", some(81), "0.81,1,1,1,1,1,1,1,1\n"), &["r02.csv, line 82", "2 cells where the header has 9"]);
    left_out(
        &seed().replace("theta_h_degC", "T_e_Nm"),
        &["channel T_e_Nm", "occurs 2 times (`T_e_Nm` at position 4, `T_e_Nm` at position 6)"],
    );
    left_out(&seed(), &["r02.csv: holds the same bytes as r01.csv"]);
    left_out("PAR1abc", &["r02.csv: the file is a Parquet file, not a text file"]);
}

#[test]
fn channels_that_say_nothing() {
    left_out(&column(1, |_, _| "105".into()), &["r02.csv, channel omega_f_rad_s", "105 in every sample"]);
    left_out(&column(2, |_, _| "0".into()), &["r02.csv, channel omega_c_rad_s", "0 in every sample"]);
    left_out(&column(4, |_, _| "3.5".into()), &["r02.csv, channel x_to_cmd_mm", "3.5 mm throughout, which is no launch"]);
    let both = changed(|_, c, v| if c == 3 || c == 4 { "5".into() } else { v.to_string() });
    left_out(&both, &["r02.csv, channel T_e_Nm and x_to_cmd_mm: constant input", "export the right channels"]);
    let frozen = noted(&column(6, |_, _| "3.5".into()), &["x_to_mm: the value is 3.5 in every sample; the channel is not used"]);
    assert_eq!(frozen.recordings[1].x_to, None);
    noted(&column(3, |_, _| "50".into()), &["T_e_Nm: the value is 50 in every sample"]);
    // A torque that is constant in all recordings of a campaign was not measured.
    let folder = Folder::with(&column(3, |_, _| "50".into()));
    folder.file("r01.csv", &column(3, |_, _| "0".into()));
    let fault = folder.fault();
    assert!(fault.contains("r01.csv, channel T_e_Nm: the engine torque is 0 N·m in every sample of every recording"), "{fault}");
    folder.file(
        "recordings.json",
        &format!(r#"{{"r01": {ENTRY}, "r02": {}}}"#, ENTRY.replacen('{', r#"{"channel_map": {"T_e_Nm": {"value": 50}}, "#, 1)),
    );
    assert_eq!(folder.read().unwrap().left_out, []);
}

#[test]
fn a_file_of_another_kind_is_named_once() {
    let folder = Folder::with("");
    std::fs::remove_file(folder.0.join("r02.csv")).unwrap();
    let remarks = || folder.read().unwrap().remarks();
    assert!(remarks().starts_with("left out: r02: recordings.json lists it, but there is no such file"), "{}", remarks());
    for (name, bytes, said) in [
        ("r02.xlsx", &b"PK\x03\x04"[..], "left out: r02.xlsx: the file is a workbook"),
        ("r02.csv.gz", &[0x1f, 0x8b, 8][..], "left out: r02.csv.gz: the file is compressed. Unpack it, e.g. with gunzip"),
        ("r02.log", &b"t,a\n0,1\n"[..], "left out: r02.log: recordings.json lists it, but files with this ending are not read"),
    ] {
        std::fs::write(folder.0.join(name), bytes).unwrap();
        assert!(remarks().starts_with(said), "{}", remarks());
        std::fs::remove_file(folder.0.join(name)).unwrap();
    }
}

#[test]
fn kelvin_and_a_missing_brake_are_noted() {
    let folder = Folder::with(&column(1, |_, v| format!("{}", v + 0.025)));
    let kelvin = ENTRY.replace("36.0", "303.15").replace("launch", "drive");
    folder.file("recordings.json", &format!(r#"{{"_comment": "wet road", "r01": {ENTRY}, "r02": {kelvin}}}"#));
    let remarks = folder.read().unwrap().remarks();
    assert!(
        remarks
            .contains("note: r02: theta_c0_degC = 303.15 is 278 K above the 25 °C around it: it looks like kelvin; if it is, write 30.00"),
        "{remarks}"
    );
    assert!(remarks.contains("note: r02: brake: not recorded: braking will look like a gap"), "{remarks}");
    assert!(!remarks.contains("r01"), "{remarks}");
}

#[test]
fn a_car_at_rest_may_read_no_disc_speed_with_the_clutch_open() {
    let folder = Folder::with(&column(2, |_, _| "0".into()));
    folder.file("recordings.json", &format!(r#"{{"r01": {ENTRY}, "r02": {}}}"#, ENTRY.replace("launch", "open_rev")));
    assert_eq!(folder.read().unwrap().left_out, []);
}

#[test]
fn the_folder() {
    let folder = Folder::new();
    assert!(folder.fault().contains("recordings.json: file not found"));
    folder.file("recordings.json", "{}");
    assert!(folder.fault().contains("lists no recording"));
    folder.file("recordings.json", &format!(r#"{{"r01": {ENTRY}, "r03": {ENTRY}, "r04": {ENTRY}}}"#));
    let fault = folder.fault();
    assert!(fault.contains("no recording is usable\n  r01: recordings.json lists it, but there is no such file"), "{fault}");
    folder.file("r01.csv", &seed());
    folder.file("r02.csv", &seed());
    folder.file("r04.csv", &seed());
    folder.file("r04.mf4", "x");
    folder.file("notes.txt", "ignored");
    let campaign = folder.read().unwrap();
    let reasons: Vec<&str> = campaign.left_out.iter().map(|l| l.reason.as_str()).collect();
    assert_eq!(reasons.len(), 3, "{reasons:?}");
    assert!(reasons[0].starts_with("r03: recordings.json lists it"), "{reasons:?}");
    assert!(reasons[1].starts_with("r04: there are several files of that name: r04.csv, r04.mf4"), "{reasons:?}");
    assert!(reasons[2].starts_with("r02.csv: recordings.json does not list it"), "{reasons:?}");
    let strict = campaign::read(&folder.0, &ReadOptions { strict: true, channel_map: None }).unwrap_err();
    assert!(strict.to_string().starts_with("r03: "), "{strict}");
    folder.file("vehicle.json", "{\"friction\": }");
    assert!(folder.fault().contains("vehicle.json, line 1, column 14"));
    folder.file("vehicle.json", "[]");
    assert!(folder.fault().contains("vehicle.json: is not an object"));
    std::fs::remove_file(folder.0.join("vehicle.json")).unwrap();
    assert!(folder.fault().contains("vehicle.json: file not found"));
    let within = folder.0.join("car_17");
    std::fs::create_dir(&within).unwrap();
    std::fs::write(within.join("vehicle.json"), "{}").unwrap();
    assert!(folder.fault().contains("is no campaign but holds some. Give one of them, e.g. "), "{}", folder.fault());
    assert!(campaign::inspect(&within, None, &|_| {}).unwrap_err().to_string().contains("is a folder. Name one file in it"));
    let missing = campaign::read(&folder.0.join("nowhere"), &ReadOptions::default()).unwrap_err();
    assert!(missing.to_string().contains("nowhere: no such folder"));
}

#[test]
fn the_fingerprint_is_of_the_contents() {
    let other = column(1, |_, v| format!("{}", v + 0.025));
    let (a, b) = (Folder::with(&other), Folder::with(&other));
    assert_eq!(a.read().unwrap().fingerprint, b.read().unwrap().fingerprint);
    let first = a.read().unwrap().fingerprint;
    a.file("vehicle.json", "{ }");
    assert_ne!(a.read().unwrap().fingerprint, first);
    let map = ChannelMap::from_toml("map", "T_e_Nm = { scale = 1.0 }").unwrap();
    let mapped = campaign::read(&b.0, &ReadOptions { strict: false, channel_map: Some(map) }).unwrap();
    assert_ne!(mapped.fingerprint, first);
}

#[test]
fn the_channel_map_scales_and_overrules() {
    let folder = Folder::with(&seed().replace("T_e_Nm", "TqEng [Nm]").replace("x_to_cmd_mm", "counts"));
    let read = |map: &str| {
        let map = ChannelMap::from_toml("map", map).unwrap();
        campaign::read(&folder.0, &ReadOptions { strict: false, channel_map: Some(map) })
    };
    let only_second = read("T_e_Nm = \"TqEng\"\nx_to_cmd_mm = { name = \"counts\", scale = 2.0, offset = -3.0 }").unwrap();
    assert_eq!(only_second.recordings[0].name, "r02");
    assert!(only_second.left_out[0].reason.contains("r01.csv, channel T_e_Nm: no channel for T_e_Nm"));
    let plain = Folder::with(&column(1, |_, v| format!("{}", v + 0.025))).read().unwrap();
    for (got, raw) in only_second.recordings[0].x_to_cmd.iter().zip(&plain.recordings[0].x_to_cmd) {
        assert!((got - (2.0 * raw - 3.0)).abs() < 1e-12);
    }
    let fault = read("T_e_Nm = { name = \"TqEng\", unit = \"kNm\" }\nx_to_cmd_mm = \"counts\"").unwrap_err().to_string();
    assert!(fault.contains("the channel map says the unit is kNm, the file says Nm"), "{fault}");
    let fault = read("T_e_Nm = \"TqEng\"\nx_to_cmd_mm = \"counts\"\nx_to_mm = \"counts\"").unwrap_err().to_string();
    assert!(fault.contains("is already taken for x_to_cmd_mm"), "{fault}");
}

#[test]
fn a_production_car_has_a_road_speed_a_percentage_and_no_air() {
    let (radius, ratio, reference) = (0.31, 12.4, 350.0);
    let text = changed(|_, c, v| match c {
        2 => format!("{}", v * 3.6 * radius / ratio),
        3 => format!("{}", v * 100.0 / reference),
        _ => v.to_string(),
    });
    let text = text.replace("omega_c_rad_s", "v [km/h]").replace("T_e_Nm", "Tq [%]").replace("theta_h_degC", "oil");
    let folder = Folder::with(&text);
    let read = |map: &str| {
        let map = ChannelMap::from_toml("map", map).unwrap();
        campaign::read(&folder.0, &ReadOptions { strict: true, channel_map: Some(map) })
    };
    let plain = "[omega_c_rad_s]\nname = \"v\"\n[T_e_Nm]\nname = \"Tq\"\n";
    std::fs::remove_file(folder.0.join("r01.csv")).unwrap();
    folder.file("recordings.json", &format!(r#"{{"r02": {ENTRY}}}"#));
    assert!(read(plain).unwrap_err().to_string().contains("\"km/h\" is a road speed. Give `tyre_radius_m` and `ratio`"));
    let speed = plain.replace("\"v\"", "\"v\"\ntyre_radius_m = 0.31\nratio = 12.4");
    assert!(read(&speed).unwrap_err().to_string().contains("the torque is a percentage. Give `reference_Nm`"));
    let both = speed.replace("\"Tq\"", "\"Tq\"\nreference_Nm = 350\nkind = \"indicated\"") + "[theta_h_degC]\nvalue = 35.0\n";
    let campaign = read(&both).unwrap();
    let (got, whole) = (&campaign.recordings[0], Folder::with(&seed()).read().unwrap().recordings.remove(0));
    let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9 * (1.0 + b.abs()));
    assert!(near(&got.omega_c, &whole.omega_c) && near(&got.t_e, &whole.t_e) && got.theta_h.iter().all(|t| *t == 35.0));
    assert!(campaign.notes.iter().any(|n| n.text.contains("indicated torque")), "{:?}", campaign.notes);
    // The ratio of a recording's gear is given in recordings.json.
    let entry = ENTRY.replace('}', r#", "ratio": 6.2, "channel_map": {"theta_h_degC": {"value": 12}}}"#);
    folder.file("recordings.json", &format!(r#"{{"r02": {entry}}}"#));
    let slower = read(&both).unwrap();
    let half: Vec<f64> = whole.omega_c.iter().map(|v| 0.5 * v).collect();
    assert!(near(&slower.recordings[0].omega_c, &half) && slower.recordings[0].theta_h[0] == 12.0);
}

#[test]
fn one_file_may_hold_several_recordings() {
    let folder = Folder::new();
    folder.file("log.csv", &seed());
    let entry = |window: &str| ENTRY.replace('}', &format!(r#", "file": "log.csv", "window_s": {window}}}"#));
    folder.file("recordings.json", &format!(r#"{{"a": {}, "b": {}}}"#, entry("[0, 0.7]"), entry("[0.7, 1.45]")));
    let campaign = folder.read().unwrap();
    assert_eq!(campaign.left_out, []);
    let [a, b] = campaign.recordings.as_slice() else { panic!() };
    assert_eq!((a.time.len(), b.time.len(), b.time[0]), (71, 76, 0.0));
    assert_eq!(b.omega_f[0], a.omega_f[70]);
    folder.file("recordings.json", &format!(r#"{{"a": {}, "b": {}}}"#, entry("[0, 0.7]"), entry("[0.6, 1.45]")));
    let overlap = folder.read().unwrap();
    assert!(overlap.left_out[0].reason.contains("log.csv: a is taken from the same file"), "{:?}", overlap.left_out);
    folder.file("recordings.json", &format!(r#"{{"a": {}}}"#, entry("[5, 7]")));
    assert!(folder.fault().contains("the window of 5 to 7 s holds no sample; the file has 0.000 to 1.500 s"), "{}", folder.fault());
}

#[test]
fn what_is_written_is_read_back() {
    let folder = Folder::with(&column(1, |_, v| format!("{}", v + 0.025)));
    let campaign = folder.read().unwrap();
    let copy = Folder::new();
    campaign::write_recordings_json(&campaign.recordings, &copy.0.join("recordings.json")).unwrap();
    for recording in &campaign.recordings {
        campaign::write_csv(recording, &copy.0.join(format!("{}.csv", recording.name))).unwrap();
    }
    let again = copy.read().unwrap();
    assert_eq!(again.recordings, campaign.recordings);
    assert!(again.notes.is_empty() && again.left_out.is_empty());
}
