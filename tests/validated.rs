//! Self-assessment of a retuned plant: where it was validated, and how well its clutch torque is known.
#![cfg(feature = "cli")]

use kisspoint::campaign::{self, ReadOptions};
use kisspoint::cli::blind::predicted::{self, Predicted, Summary};
use kisspoint::effects::{self, Parameters, param};
use kisspoint::fmi2::{exports::*, plant::vr, types::*};
use kisspoint::fmu::{Beside, MODELS, description};
use kisspoint::gap::diagnosis::diagnose;
use kisspoint::validated::{CLOSING, Place as At, SLIPS, TABLE, THETA, UNKNOWN_NM, Validated};
use kisspoint::vehicle::Vehicle;
use realcar::{Car, Kind, Place, draw_car_of};
use serde_json::Value;
use std::ffi::{CString, c_void};

/// The diagnosis of this car, and the errors of its predictions for each recording that it never saw.
fn diagnosed(car: &Car) -> (Value, Vec<Predicted>) {
    let folder = tempfile::tempdir().unwrap();
    car.write(folder.path()).unwrap();
    let campaign = campaign::read(folder.path(), &ReadOptions::default()).unwrap();
    let found = diagnose(&campaign, &|_, _| {}).unwrap();
    assert_eq!(predicted::validated(&found.json["domain"]).as_ref(), Some(&found.validated), "answer and FMU say the same");
    (found.json.clone(), predicted::on(&car.unseen, &car.campaign.vehicle_json, &found.json, &car.real))
}

/// Five cars without and with effects: where the plant is valid, the errors of its torque on later recordings are as large as predicted, within the scatter expected of five
/// cars, because errors within one car are correlated.
#[test]
fn the_predicted_deviation_is_that_of_recordings_that_came_later() {
    let kinds =
        [Kind::Healthy, Kind::Healthy, Kind::Single("friction_level"), Kind::Single("kiss_point_offset"), Kind::Single("friction_fade")];
    let mut all = Vec::new();
    for (k, kind) in kinds.into_iter().enumerate() {
        // A car that is logged at 100 Hz, which is fast to diagnose.
        let car = (k..).step_by(kinds.len()).map(|i| draw_car_of(Place::Bench, 11, i, kind));
        let car = car.into_iter().find(|c| c.campaign.recordings[0].sample_rate_hz == 100.0).unwrap();
        let (json, found) = diagnosed(&car);
        println!("{kind:?} {}: {found:.3?}", json["verdict"]);
        all.extend(found);
    }
    let sum = Summary::of(all.iter());
    println!("{}", sum.as_text());
    let inside = sum.all.inside;
    assert!(inside.count > 1000 && sum.recordings[0] >= 10);
    assert!(inside.within as f64 > 0.8 * inside.count as f64, "{} of {} within 2 σ", inside.within, inside.count);
    assert!((0.2..2.0).contains(&inside.ratio()), "errors are {:.2} of what was predicted", inside.ratio());
}

/// An answer contains its validated domain, and a joint covariance and precision that are inverse to each other.
#[test]
fn an_answer_carries_its_covariance_and_its_domain() {
    let car = draw_car_of(Place::Bench, 11, 5, Kind::Healthy);
    let (json, _) = diagnosed(&car);
    let full = |name: &str| {
        let rows: Vec<Vec<f64>> = serde_json::from_value(json["joint"][name].clone()).unwrap();
        nalgebra::DMatrix::from_fn(rows.len(), rows.len(), |i, j| rows[i.max(j)][i.min(j)])
    };
    let (precision, covariance) = (full("precision"), full("covariance"));
    assert_eq!(json["joint"]["unknowns"].as_array().unwrap().len(), covariance.nrows());
    let scale = |i: usize| covariance[(i, i)].sqrt();
    let off = |i: usize, j: usize| ((&precision * &covariance)[(i, j)] - f64::from(u8::from(i == j))) * scale(i) / scale(j);
    let worst = (0..covariance.nrows())
        .flat_map(|i| (0..covariance.nrows()).map(move |j| (i, j)))
        .map(|(i, j)| off(i, j).abs())
        .fold(0.0, f64::max);
    assert!(worst < 1e-2, "precision · covariance is off by {worst}");
    let domain = &json["domain"];
    assert!(domain["places"].as_array().unwrap().len() > 20);
    assert_eq!(domain["quantities"].as_array().unwrap().len(), 4);
    let sigma = &domain["torque_sigma"];
    let sizes = [&sigma["closing"], &sigma["theta_c_degC"], &sigma["slip_rad_s"]].map(|v| v.as_array().unwrap().len());
    assert_eq!(sizes, [CLOSING.len(), THETA.len(), SLIPS.len()]);
    // σ grows with the torque, and is nearly zero before contact.
    let at = |i: usize| sigma["sigma_Nm"][i][1][4].as_f64().unwrap();
    assert!(at(0) < 0.05 && at(5) > at(3) && at(9) > at(6), "{} {} {} {} {}", at(0), at(3), at(5), at(6), at(9));
}

/// Validated only at 25 °C with an open clutch, with a σ of 3 N·m everywhere.
fn known() -> Validated {
    Validated::new([At { slip: 0.0, theta: 25.0, closing: -0.1, torque: 0.0 }].into_iter(), [3.0; TABLE].into_iter())
}

/// An instance of the plant with these effects and validation data, in initialization mode.
fn instance(effects: &Parameters, validated: Option<&Validated>) -> *mut c_void {
    let (model, vehicle) = (&MODELS[1], Vehicle::paper());
    let beside = Beside { validated, ..Beside::default() };
    let guid = CString::new(description::guid(model, &vehicle, effects, &beside)).unwrap();
    let mut document = vehicle.to_value();
    document["effects"] = effects::to_value(effects);
    document["validated"] = validated.map_or(Value::Null, Validated::to_value);
    let location = CString::new(format!("data:application/json,{document}")).unwrap();
    let c = fmi2Instantiate(c"plant".as_ptr(), CO_SIMULATION, guid.as_ptr(), location.as_ptr(), &CallbackFunctions::NONE, 0, 0);
    assert!(!c.is_null());
    assert_eq!(fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0), Status::Ok);
    assert_eq!(fmi2EnterInitializationMode(c), Status::Ok);
    set(c, vr::omega_f_start, 0.0);
    set(c, vr::omega_c_start, 0.0);
    c
}

fn get<const N: usize>(c: *mut c_void, references: [u32; N]) -> [f64; N] {
    let mut values = [f64::NAN; N];
    assert_eq!(fmi2GetReal(c, references.as_ptr(), N, values.as_mut_ptr()), Status::Ok);
    values
}

fn set(c: *mut c_void, reference: u32, value: f64) {
    assert_eq!(fmi2SetReal(c, &reference, 1, &value), Status::Ok);
}

const OF_ITSELF: [u32; 2] = [vr::validity, vr::T_fc_sigma];

#[test]
fn an_fmu_says_where_it_was_validated() {
    let mut effects = effects::null();
    effects[param::friction_level::factor] = 0.9;
    let c = instance(&effects, Some(&known()));
    assert_eq!(get(c, OF_ITSELF), [1.0, 3.0]);
    assert_eq!(fmi2ExitInitializationMode(c), Status::Ok);
    let step = |k: usize| assert_eq!(fmi2DoStep(c, k as f64 * 0.01, 0.01, 1), Status::Ok);
    step(0);
    assert_eq!(get(c, OF_ITSELF), [1.0, 3.0]);
    // Closing the clutch under engine torque leaves the validated domain.
    set(c, vr::x_to, 6.0);
    set(c, vr::T_e_ref, 45.0);
    step(1);
    let [validity, sigma] = get(c, OF_ITSELF);
    assert!(validity < 0.01 && sigma == 3.0, "{validity} {sigma}");
    set(c, vr::x_to, 0.0);
    step(2);
    let opened = get(c, OF_ITSELF);
    assert!(opened[0] > validity);
    // An injected effect invalidates the plant until it is removed.
    set(c, vr::effect_friction_fade_depth, 0.3);
    step(3);
    assert_eq!(get(c, OF_ITSELF), [0.0, UNKNOWN_NM]);
    set(c, vr::effect_friction_fade_depth, 0.0);
    step(4);
    assert!(get(c, OF_ITSELF)[0] > 0.0);
    assert_eq!(fmi2Reset(c), Status::Ok);
    assert_eq!(fmi2EnterInitializationMode(c), Status::Ok);
    set(c, vr::driveline_J_f, 0.2);
    assert_eq!(get(c, OF_ITSELF), [0.0, UNKNOWN_NM]);
    fmi2FreeInstance(c);
}

/// A plant that no campaign has retuned was validated nowhere, and its motion equals that of a validated one to the last bit.
#[test]
fn what_a_plant_says_of_itself_moves_nothing() {
    let [plain, telling] = [None, Some(&known())].map(|v| instance(&effects::null(), v));
    assert_eq!(get(plain, OF_ITSELF), [0.0, UNKNOWN_NM]);
    for k in 0..300 {
        let moved = [plain, telling].map(|c| {
            if k == 0 {
                assert_eq!(fmi2ExitInitializationMode(c), Status::Ok);
                set(c, vr::x_to, 6.2);
                set(c, vr::T_e_ref, 45.0);
            }
            assert_eq!(fmi2DoStep(c, f64::from(k) * 0.005, 0.005, 1), Status::Ok);
            get(c, [vr::omega_f, vr::omega_c, vr::T_fc, vr::theta_c]).map(f64::to_bits)
        });
        assert_eq!(moved[0], moved[1], "step {k}");
    }
    [plain, telling].into_iter().for_each(|c| fmi2FreeInstance(c));
}

/// Resources with other validated places or deviations than those of the GUID belong to another FMU.
#[test]
fn the_guid_names_what_a_campaign_has_found() {
    let other = Validated::new(std::iter::empty(), [2.0; TABLE].into_iter());
    let of = |v: Option<&Validated>| {
        let beside = Beside { validated: v, ..Beside::default() };
        description::guid(&MODELS[1], &Vehicle::paper(), &effects::null(), &beside)
    };
    let (known, none) = (known(), of(None));
    let all = [of(Some(&known)), of(Some(&other)), none];
    assert!(all[0] != all[1] && all[1] != all[2] && all[0] != all[2]);
}
