//! The diagnosis of drawn cars, end to end: a healthy car, a car with one effect, a car with an effect outside the library.
//!
//! `realcar` draws the cars when the test runs and shares no code with the plant, so the diagnosis cannot simply recover its own formulas.

use kisspoint::campaign::{self, Campaign, ReadOptions};
use kisspoint::effects::REGISTRY;
use kisspoint::fmu;
use kisspoint::gap::diagnosis::{Diagnosis, DiagnosisError, diagnose};
use kisspoint::gap::verdict::Verdict;
use realcar::{Car, Kind, Place, draw_car_of};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

const SEED: u64 = 41;

/// A folder that is removed when the test ends.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("kisspoint-diagnosis-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    /// A folder that holds the campaign of `car`.
    fn of(name: &str, car: &Car) -> Self {
        let folder = Self::new(name);
        car.write(&folder.0).unwrap();
        folder
    }

    fn read(&self) -> Campaign {
        campaign::read(&self.0, &ReadOptions::default()).unwrap()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Index of the first car of this seed for which the assertions below hold.
const FIRST: usize = 3;

/// The first car of this kind that is recorded at 100 Hz without a bench and with all manoeuvres: the everyday campaign, and the fastest to diagnose.
fn everyday(kind: Kind) -> Car {
    let is_everyday = |car: &Car| {
        let r = &car.campaign.recordings;
        r.len() == 9 && r.iter().all(|r| r.bench.is_none() && r.sample_rate_hz == 100.0)
    };
    (FIRST..1000).map(|index| draw_car_of(Place::Bench, SEED, index, kind)).find(is_everyday).unwrap()
}

/// The same car with only the recordings at these indices.
fn with_only(mut car: Car, places: &[usize]) -> Car {
    car.campaign.recordings = places.iter().map(|&k| car.campaign.recordings[k].clone()).collect();
    car
}

fn answer(campaign: &Campaign) -> Diagnosis {
    diagnose(campaign, &|_, _| {}).unwrap()
}

/// A worn car, whose kiss point has moved. It is diagnosed once for all tests that use the answer.
fn worn() -> &'static Diagnosis {
    static ANSWER: OnceLock<Diagnosis> = OnceLock::new();
    ANSWER.get_or_init(|| answer(&Folder::of("worn", &everyday(Kind::Single("kiss_point_offset"))).read()))
}

/// Launches of a healthy car: the smallest campaign that is worth a diagnosis.
fn two_launches() -> Car {
    with_only(everyday(Kind::Healthy), &[0, 1])
}

/// The torque of a healthy car with its sign reversed is not a fault of the car: the answer says which channel is wrong, and names no effect.
#[test]
fn a_torque_that_counts_the_other_way_is_a_mistake_in_the_map() {
    let mut campaign = Folder::of("sign", &with_only(everyday(Kind::Healthy), &[0, 1, 2])).read();
    campaign.recordings.iter_mut().flat_map(|r| &mut r.t_e).for_each(|t| *t = -*t);
    let answer = diagnose(&campaign, &|_, _| {}).unwrap().answer;
    assert!(
        answer.sentence.starts_with("These inputs do not fit this vehicle: with the opposite sign of the engine torque"),
        "{}",
        answer.sentence
    );
    assert!(answer.which.effects.is_empty() && answer.place.primary.is_none() && answer.confidence.0 > 0.9, "{:?}", answer.confidence);
}

/// So is a wheel's speed that is mapped as the disc's. Its map lacks the ratio, which the locked clutch shows.
#[test]
fn the_speed_of_another_shaft_is_a_mistake_in_the_map() {
    let mut campaign = Folder::of("shaft", &with_only(everyday(Kind::Healthy), &[0, 1, 2])).read();
    campaign.recordings.iter_mut().flat_map(|r| &mut r.omega_c).for_each(|w| *w *= 0.08);
    let answer = diagnose(&campaign, &|_, _| {}).unwrap().answer;
    assert!(
        answer.sentence.starts_with("These inputs do not fit this vehicle: with a disc speed 12.5 times as high"),
        "{}",
        answer.sentence
    );
    assert!(answer.which.effects.is_empty() && answer.place.primary.is_none() && answer.confidence.0 > 0.9, "{:?}", answer.confidence);
}

/// If only the recording that was to be held out shows a gap, the car is not called healthy: another recording judges instead.
#[test]
fn a_gap_that_only_the_held_out_recording_shows_is_found() {
    let mut campaign = Folder::of("judge", &everyday(Kind::Healthy)).read();
    let healthy = diagnose(&campaign, &|_, _| {}).unwrap().answer;
    assert_eq!(healthy.verdict, Verdict::NoGap);
    let [judge] = healthy.how_far.held_out.as_slice() else { panic!("{:?}", healthy.how_far.held_out) };
    // In this recording alone the engine gives more torque than it reports.
    let held_out = campaign.recordings.iter_mut().find(|r| r.name == *judge).unwrap();
    held_out.t_e.iter_mut().for_each(|t| *t *= 0.6);
    let answer = diagnose(&campaign, &|_, _| {}).unwrap().answer;
    assert!(answer.verdict != Verdict::NoGap && answer.place.primary == Some("engine"), "{}", answer.sentence);
    assert!(!answer.how_far.held_out.contains(judge), "{:?}", answer.how_far.held_out);
    let told = format!("{judge} was to be held out, but the others show no gap and it does");
    assert!(answer.notes.iter().any(|n| n.starts_with(&told)), "{:?}", answer.notes);
}

#[test]
fn a_healthy_car_has_no_gap() {
    let found = answer(&Folder::of("healthy", &everyday(Kind::Healthy)).read()).json;
    assert_eq!(found["verdict"], "no_gap", "{}", found["which"]);
    assert_eq!(found["where"]["primary"], Value::Null);
    assert_eq!(found["which"]["effects"], Value::Array(Vec::new()));
    check_structure(&found);
}

#[test]
fn one_effect_is_named_and_closes_the_gap() {
    let found = &worn().json;
    assert_eq!(found["verdict"], "explained");
    assert_eq!(found["where"]["primary"], "clutch_force");
    let effects = found["which"]["effects"].as_array().unwrap();
    assert_eq!(effects.len(), 1, "{effects:?}");
    assert_eq!(effects[0]["id"], "kiss_point_offset");
    let far = &found["how_far"];
    assert!(far["closed_fraction"].as_f64().unwrap() > 0.95, "{far}");
    assert!(far["before"].as_f64().unwrap() > 10.0 * far["after"].as_f64().unwrap(), "{far}");
    check_structure(found);
}

#[test]
fn an_effect_outside_the_library_is_flagged_and_located() {
    let car = with_only(everyday(Kind::Outside("gusts")), &[0, 2, 4, 6]);
    let found = answer(&Folder::of("outside", &car).read()).json;
    let verdict = found["verdict"].as_str().unwrap();
    assert!(["unexplained", "partly_explained"].contains(&verdict), "{verdict}: {}", found["which"]["effects"]);
    assert_eq!(found["where"]["unexplained_at"], "driveline");
    assert!(found["confidence"].as_f64().unwrap() > 0.5, "{}", found["confidence"]);
    // The residual map shows the gap, with tolerances that the gap has not pulled away.
    let cells = found["where"]["equations"].as_array().unwrap();
    let worst = cells
        .iter()
        .filter(|c| c["phase"] == "open")
        .max_by(|a, b| a["sigma"].as_f64().unwrap().total_cmp(&b["sigma"].as_f64().unwrap()))
        .unwrap();
    assert!(worst["equation"] == "driveline balance" && worst["significant"] == true, "{worst}");
    check_structure(&found);
}

#[test]
fn a_facing_that_dries_is_found_in_friction() {
    // Few recordings, for which a change of cushion spring, temperature dependence and lag together would be nearly equivalent.
    let car = with_only(everyday(Kind::Outside("damp_facing")), &[0, 1, 2, 3, 4]);
    let found = answer(&Folder::of("damp", &car).read()).json;
    assert_eq!(found["verdict"], "unexplained", "{}", found["which"]["explanations"]);
    assert_eq!(found["where"]["unexplained_at"], "friction", "{}", found["which"]["explanations"]);
    check_structure(&found);
}

/// An irregular disturbance, which depends on no state of the car, is allowed for and reported, but not named as an effect.
#[test]
fn something_irregular_is_said() {
    let car = with_only(everyday(Kind::Outside("misfire")), &[0, 5]);
    let found = answer(&Folder::of("irregular", &car).read()).json;
    let notes: Vec<&str> = found["notes"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert!(
        notes.iter().any(|n| n.contains("something irregular is left")),
        "{} {} {notes:?}",
        found["verdict"],
        found["where"]["unexplained_at"]
    );
    check_structure(&found);
}

#[test]
fn effects_that_look_alike_are_left_open() {
    // Three launches, one of which is held out: a kiss point that moves with temperature and a cushion spring that changes with temperature cannot be told apart.
    let car = with_only(everyday(Kind::Single("kiss_point_thermal")), &[0, 1, 2]);
    let found = answer(&Folder::of("alike", &car).read()).json;
    let effects = found["which"]["effects"].as_array().unwrap();
    let rivals = effects[0]["ambiguous_with"].as_array().unwrap();
    let named: Vec<&str> = rivals.iter().chain([&effects[0]["id"]]).map(|id| id.as_str().unwrap()).collect();
    assert!(effects.len() == 1 && named.len() > 1 && named.contains(&"kiss_point_thermal"), "{named:?}");
    let sentence = found["sentence"].as_str().unwrap();
    assert!(sentence.contains(" or "), "{sentence}");
    check_structure(&found);
}

/// A pair of effects in few recordings, so that the search for a second effect is exercised.
fn pair() -> Car {
    with_only(everyday(Kind::Pair("kiss_point_offset", "engine_torque_gain")), &[0, 2, 3, 5, 8])
}

fn answer_on(threads: usize, campaign: &Campaign) -> Diagnosis {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| answer(campaign))
}

/// The answer to the pair on two threads, for both tests that compare another answer with it.
fn answer_to_pair() -> &'static Diagnosis {
    static ANSWER: OnceLock<Diagnosis> = OnceLock::new();
    ANSWER.get_or_init(|| answer_on(2, &Folder::of("pair", &pair()).read()))
}

#[test]
fn threads_change_no_byte() {
    let [one, two] = [&answer_on(1, &Folder::of("threads", &pair()).read()), answer_to_pair()].map(|found| format!("{:#}", found.json));
    assert!(one.contains("\"explained\""), "{one}");
    assert_eq!(one, two);
}

#[test]
fn two_recordings_are_enough_and_one_is_held_out() {
    let found = answer(&Folder::of("two", &two_launches()).read()).json;
    assert_eq!(found["verdict"], "no_gap", "{}", found["which"]);
    assert_eq!(found["how_far"]["held_out"].as_array().unwrap().len(), 1);
    check_structure(&found);
}

#[test]
fn what_is_held_out_takes_no_part() {
    // The flywheel speed in every row of the held-out recording is changed: only the gap figures may change.
    let folder = Folder::of("leak", &pair());
    let before = &answer_to_pair().json;
    let held = before["how_far"]["held_out"][0].as_str().unwrap().to_owned();
    edit(&folder.0.join(format!("{held}.csv")), |rows| {
        for (k, row) in rows.iter_mut().enumerate().skip(1) {
            let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
            cells[1] = format!("{:.3}", cells[1].parse::<f64>().unwrap() + ((k * 7919) % 13) as f64 * 0.5);
            *row = cells.join(",");
        }
    });
    let after = answer(&folder.read()).json;
    assert_ne!(before["how_far"]["after"], after["how_far"]["after"]);
    for part in ["verdict", "confidence", "where", "which", "plant"] {
        assert_eq!(before[part], after[part], "{part}");
    }
}

#[test]
fn one_recording_is_refused() {
    let folder = Folder::of("one", &with_only(two_launches(), &[0]));
    let refusal = diagnose(&folder.read(), &|_, _| {}).unwrap_err();
    assert!(matches!(refusal, DiagnosisError::TooFew(1)), "{refusal:?}");
    assert_eq!(
        refusal.to_string(),
        "the campaign has 1 usable recording; at least 2 are needed, or a drive with two engagements, so that one can be held out to judge the fit"
    );
}

#[test]
fn recordings_that_cannot_be_used_are_left_out_with_a_word() {
    let folder = Folder::of("defects", &with_only(everyday(Kind::Healthy), &[0, 1, 2, 3, 4]));
    edit(&folder.0.join("r03.csv"), |rows| rows.truncate(40));
    edit(&folder.0.join("r04.csv"), |rows| rows[1..].iter_mut().for_each(|row| *row = without_flywheel_speed(row)));
    // A sensor that fails permanently one second into the recording.
    edit(&folder.0.join("r05.csv"), |rows| rows[101..].iter_mut().for_each(|row| *row = without_flywheel_speed(row)));
    let found = answer(&folder.read()).json;
    let left_out = found["left_out"].as_array().unwrap();
    let reason = |name: &str| left_out.iter().find(|l| l["recording"] == name).map_or("", |l| l["reason"].as_str().unwrap());
    assert_eq!(left_out.len(), 2, "{left_out:?}");
    assert!(reason("r03").contains("r03.csv") && reason("r03").contains("ends here, 0.380 s after its start"), "{left_out:?}");
    assert!(reason("r04").contains("r04.csv, channel omega_f_rad_s"), "{left_out:?}");
    let notes: Vec<&str> = found["notes"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert!(notes.iter().any(|n| n.starts_with("r05") && n.contains("omega_f_rad_s")), "{notes:?}");
}

fn without_flywheel_speed(row: &str) -> String {
    let mut cells: Vec<&str> = row.split(',').collect();
    cells[1] = "NaN";
    cells.join(",")
}

#[test]
fn plant_parameters_are_variables_that_can_be_set() {
    let plant = fmu::MODELS.iter().find(|m| m.description.name == "DrivelinePlant").unwrap();
    for set in ["parameters", "nominal_parameters"] {
        let named = worn().json["plant"][set].as_object().unwrap();
        for (name, value) in named {
            let variable = plant.description.variables.iter().find(|v| v.name == name.as_str());
            assert!(variable.is_some(), "{set}: the plant has no variable {name}");
            assert!(value.as_f64().is_some_and(f64::is_finite), "{set}: {name} = {value}");
        }
    }
    let value = |set: &str, name: &str| worn().json["plant"][set][name].as_f64().unwrap();
    let offset = "effect.kiss_point_offset.offset";
    assert_eq!(value("nominal_parameters", offset), 0.0);
    assert!(value("parameters", offset) != 0.0);
}

fn edit(file: &Path, change: impl FnOnce(&mut Vec<String>)) {
    let text = std::fs::read_to_string(file).unwrap();
    let mut rows: Vec<String> = text.lines().map(str::to_owned).collect();
    change(&mut rows);
    std::fs::write(file, rows.join("\n") + "\n").unwrap();
}

/// The keys and ranges that the schema requires. `tests/python/test_diagnosis.py` validates an answer against the schema itself.
fn check_structure(found: &Value) {
    let has = |at: &str, keys: &[&str]| {
        let object = found.pointer(at).and_then(Value::as_object).unwrap_or_else(|| panic!("{at} is no object"));
        for key in keys {
            assert!(object.contains_key(*key), "{at}/{key} is missing");
        }
    };
    has("", &["schema", "verdict", "where", "which", "how_far", "plant"]);
    has("/where", &["primary", "subsystems"]);
    has("/which", &["effects", "ranked"]);
    has("/how_far", &["metric", "before", "after", "closed_fraction", "held_out"]);
    has("/plant", &["parameters", "nominal_parameters"]);
    assert_eq!(found["schema"], "kisspoint-diagnosis/1");
    let doubted = found["where"]["ambiguous_with"].as_array().unwrap();
    assert!(!doubted.contains(&found["where"]["primary"]) && !doubted.contains(&found["where"]["unexplained_at"]), "{doubted:?}");
    for number in ["before", "after", "noise_floor", "closed_fraction"] {
        assert!(found["how_far"][number].as_f64().is_some_and(f64::is_finite), "how_far/{number}: {}", found["how_far"][number]);
    }
    let share = |v: &Value| v.as_f64().is_some_and(|s| (0.0..=1.0).contains(&s));
    assert!(found["where"]["subsystems"].as_array().unwrap().iter().all(|s| s["id"].is_string() && share(&s["share"])));
    let explains = ["explained", "partly_explained"].contains(&found["verdict"].as_str().unwrap());
    assert_eq!(explains, !found["which"]["effects"].as_array().unwrap().is_empty(), "{}: {}", found["verdict"], found["which"]["effects"]);
    for effect in found["which"]["effects"].as_array().unwrap() {
        assert!(effect["id"].is_string() && share(&effect["probability"]) && effect["ambiguous_with"].is_array(), "{effect}");
        for (name, p) in effect["parameters"].as_object().unwrap() {
            let [low, value, high] = ["low", "value", "high"].map(|k| p[k].as_f64().unwrap_or(f64::NAN));
            assert!(low <= value && value <= high, "{name}: {p}");
        }
    }
    // The confidence is the sum over the explanations that state the same.
    let explanations = found["which"]["explanations"].as_array().unwrap();
    let number = |v: &Value| v.as_f64().unwrap_or(f64::NAN);
    let same = |e: &&Value| match found["verdict"].as_str() {
        Some("unexplained") => e["missing_law"] == explanations[0]["missing_law"],
        Some("no_gap") => e["effects"] == explanations[0]["effects"] && e["missing_law"].is_null(),
        _ => e["effects"] == explanations[0]["effects"],
    };
    let (believed, rest): (f64, f64) = (
        explanations.iter().filter(same).map(|e| number(&e["probability"])).sum(),
        1.0 - explanations.iter().map(|e| number(&e["probability"])).sum::<f64>(),
    );
    let confidence = number(&found["confidence"]);
    assert!(confidence > believed - 1e-4 && confidence < believed + rest + 1e-4, "{confidence} {believed} {rest}");
    let ranked = found["which"]["ranked"].as_array().unwrap();
    assert_eq!(ranked.len(), REGISTRY.len(), "every effect of the library is weighed");
    // An effect that recordings would show only from three times its usual size on is not assessable from them.
    for r in ranked.iter().filter(|r| r["smallest_visible"].is_object()) {
        let (size, usual) = (number(&r["smallest_visible"]["size"]), number(&r["smallest_visible"]["usual"]));
        assert!((r["verdict"] == "not assessable") == (size > 3.0 * usual) || r["verdict"] == "chosen", "{r}");
    }
    // The evidence of effects that were never fitted is relative to the same explanation as that of the others. For a healthy car, most of these effects trail by prior odds
    // and parameter volume, not by the whole evidence of the recordings.
    let screened = ranked.iter().filter(|r| r["reason"].as_str().is_some_and(|why| why.starts_with("screened")));
    let mut behind: Vec<f64> = screened.map(|r| number(&r["evidence"])).collect();
    behind.sort_by(f64::total_cmp);
    if found["verdict"] == "no_gap" {
        assert!(behind[behind.len() / 2] > -100.0 && behind[behind.len() - 1] < 0.5, "{behind:?}");
    }
    assert!(ranked.iter().all(|r| r["id"].is_string() && r["verdict"].is_string() && r["reason"].is_string()));
}

/// After two launches it is open whether a small actuator lag is a lag or a delay; the answer says what would split them, as the plan has computed it.
#[test]
fn what_is_open_comes_with_what_would_split_it() {
    let small = (0..40).map(|index| realcar::draw_car_sized(Place::Bench, 1, index, Kind::Single("actuator_lag"), 0.3));
    let quick = |car: &Car| car.campaign.recordings[0].sample_rate_hz == 100.0 && car.campaign.recordings[0].bench.is_none();
    let mut answers = small.filter(quick).map(|car| answer(&Folder::of("open", &with_only(car, &[0, 1, 2])).read()));
    let d = answers.find(|d| d.answer.which.effects.iter().any(|e| !e.ambiguous_with.is_empty())).unwrap();
    let next = d.answer.measure_next.as_ref().unwrap();
    let sum: f64 = next.rivals.iter().map(|r| r.probability.0).sum();
    assert!((sum - 1.0).abs() < 1e-9 && next.rivals.len() > 1);
    assert!(next.manoeuvres.windows(2).all(|w| w[0].nats_per_minute.0 >= w[1].nats_per_minute.0));
    assert!(next.manoeuvres.iter().all(|m| m.nats.0 >= 0.0 && (0.0..=1.0).contains(&m.splits.0)));
    let e = d.answer.which.effects.iter().find(|e| !e.ambiguous_with.is_empty()).unwrap();
    assert!(next.manoeuvres.iter().any(|m| e.separated_by.contains(&m.name)) && e.separated_by.contains("nats"), "{}", e.separated_by);
}

#[test]
fn what_is_only_simulated_is_in_no_answer() {
    use kisspoint::effects::{self, PARAMETERS, SIMULATED};
    let answered = kisspoint::gap::answer::plant_parameters(&kisspoint::vehicle::Vehicle::paper(), &effects::null());
    for p in &PARAMETERS {
        let simulated = SIMULATED.iter().any(|entry| entry.id == p.effect);
        assert_eq!(answered.contains_key(p.variable), !simulated, "{}", p.variable);
    }
}
