//! Properties over drawn cases: a recording reads the same however it is formatted, and what is written is read back bit for bit.

use kisspoint::campaign::{self, ChannelMap, ReadOptions, Recording};
use kisspoint::effects::PARAMETERS;
use kisspoint::fmi2::{exports::*, plant, types::*};
use kisspoint::fmu::ssv;
use kisspoint::vehicle::{NUMBERS, Vehicle};
use proptest::prelude::*;
use std::ffi::{CString, c_char, c_void};
use std::path::{Path, PathBuf};
use std::ptr;
use std::sync::atomic::{AtomicU32, Ordering};

/// Number of cases of each property; set PROPTEST_CASES for more.
fn some(cases: u32) -> ProptestConfig {
    let cases = std::env::var("PROPTEST_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(cases);
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/campaign").join(name)
}

/// Units of one quantity: name, and factor and offset to the library's unit.
type Units = &'static [(&'static str, f64, f64)];
const SPEED: Units = &[("rad/s", 1.0, 0.0), ("rpm", std::f64::consts::PI / 30.0, 0.0), ("deg/s", std::f64::consts::PI / 180.0, 0.0)];
const TORQUE: Units = &[("Nm", 1.0, 0.0), ("kNm", 1e3, 0.0), ("N·mm", 1e-3, 0.0), ("lbf·ft", 4.448_221_615_260_5 * 0.304_8, 0.0)];
const LENGTH: Units = &[("mm", 1.0, 0.0), ("m", 1e3, 0.0), ("in", 25.4, 0.0)];
const WARMTH: Units = &[("°C", 1.0, 0.0), ("K", 1.0, -273.15), ("°F", 5.0 / 9.0, -160.0 / 9.0)];
const TIME: Units = &[("s", 1.0, 0.0), ("ms", 1e-3, 0.0), ("us", 1e-6, 0.0)];
/// Units of the seed's columns, in their order.
const COLUMNS: [Units; 9] = [TIME, SPEED, SPEED, TORQUE, LENGTH, WARMTH, LENGTH, TORQUE, WARMTH];

/// A format in which the seed is written.
#[derive(Clone, Debug)]
struct Style {
    units: Vec<usize>,
    order: Vec<usize>,
    begin: f64,
    separator: char,
    line_end: &'static str,
    bom: bool,
}

fn styles() -> impl Strategy<Value = Style> {
    let order = Just((0..9).collect::<Vec<usize>>()).prop_shuffle();
    let separators = prop_oneof![Just(','), Just(';'), Just('\t')];
    let line_ends = prop_oneof![Just("\n"), Just("\r\n")];
    (proptest::collection::vec(0..12_usize, 9), order, 0.0..5000.0, separators, line_ends, any::<bool>()).prop_map(
        |(units, order, begin, separator, line_end, bom): (_, _, f64, _, _, _)| Style {
            units,
            order,
            begin: (begin * 100.0_f64).round() / 100.0,
            separator,
            line_end,
            bom,
        },
    )
}

/// The seed recording in a format, and the channel map that describes it.
fn written(style: &Style) -> (String, String) {
    let seed = std::fs::read_to_string(data("seed/r01.csv")).unwrap();
    let names: Vec<&str> = seed.lines().next().unwrap().split(',').collect();
    let unit = |column: usize| COLUMNS[column][style.units[column] % COLUMNS[column].len()];
    let mut map = String::new();
    for (column, name) in names.iter().enumerate() {
        map += &format!("[{name}]\nname = \"channel {column}\"\nunit = \"{}\"\n", unit(column).0);
    }
    let join = |cells: Vec<String>| cells.join(&style.separator.to_string()) + style.line_end;
    let mut text = if style.bom { "\u{feff}".to_owned() } else { String::new() };
    text += &join(style.order.iter().map(|column| format!("channel {column}")).collect());
    for line in seed.lines().skip(1) {
        let values: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let cell = |column: usize| {
            let (_, factor, offset) = unit(column);
            let begin = if column == 0 { style.begin } else { 0.0 };
            format!("{:?}", (values[column] + begin - offset) / factor)
        };
        text += &join(style.order.iter().map(|column| cell(*column)).collect());
    }
    (text, map)
}

/// Reads one recording as a campaign that contains nothing else.
fn read(text: &str, map: &str) -> Recording {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    let folder = std::env::temp_dir().join(format!("kisspoint-properties-{}-{number}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let entry = r#"{"r01": {"manoeuvre": "launch", "sample_rate_Hz": 100, "theta_c0_degC": 36.0, "theta_b0_degC": 30.0}}"#;
    for (name, content) in [("vehicle.json", "{}"), ("recordings.json", entry), ("r01.csv", text)] {
        std::fs::write(folder.join(name), content).unwrap();
    }
    let channel_map = Some(ChannelMap::from_toml("map", map).unwrap());
    let found = campaign::read(&folder, &ReadOptions { channel_map, ..ReadOptions::default() });
    std::fs::remove_dir_all(&folder).unwrap();
    found.unwrap_or_else(|e| panic!("{e}\n{map}\n{text}")).recordings.remove(0)
}

fn channels(r: &Recording) -> Vec<Vec<f64>> {
    let bench = [&r.x_to, &r.t_fc, &r.theta_c].map(|channel| channel.clone().expect("the seed has it"));
    [r.time.clone(), r.omega_f.clone(), r.omega_c.clone(), r.t_e.clone(), r.x_to_cmd.clone(), r.theta_h.clone()]
        .into_iter()
        .chain(bench)
        .collect()
}

proptest! {
    #![proptest_config(some(48))]

    #[test]
    fn however_it_is_written_it_is_the_same_recording(style in styles()) {
        let (text, map) = written(&style);
        let plain = Style { units: vec![0; 9], order: (0..9).collect(), begin: 0.0, separator: ',', line_end: "\n", bom: false };
        let (seed_text, seed_map) = written(&plain);
        let (found, seed) = (read(&text, &map), read(&seed_text, &seed_map));
        for (column, (found, seed)) in channels(&found).iter().zip(channels(&seed)).enumerate() {
            prop_assert_eq!(found.len(), seed.len());
            for (f, s) in found.iter().zip(seed) {
                prop_assert!((f - s).abs() <= 1e-8 * s.abs().max(1.0), "channel {}: {} for {}", column, f, s);
            }
        }
    }
}

proptest! {
    #![proptest_config(some(128))]

    #[test]
    fn a_vehicle_is_read_back_as_it_was_written(shares in proptest::collection::vec(0.0..=1.0_f64, NUMBERS.len())) {
        let mut vehicle = Vehicle::paper();
        for (number, share) in NUMBERS.iter().zip(shares) {
            // Near the paper's values, so that the numbers do not contradict each other.
            let drawn = number.default * (0.999 + 0.002 * share);
            *(number.get_mut)(&mut vehicle) = drawn.clamp(number.min, number.max);
        }
        let text = vehicle.to_value().to_string();
        prop_assert_eq!(Vehicle::from_json(&text).unwrap(), vehicle);
    }

    #[test]
    fn a_parameter_set_holds_its_values_to_the_last_bit(values in proptest::collection::vec(proptest::num::f64::NORMAL | proptest::num::f64::ZERO, PARAMETERS.len())) {
        let set: Vec<ssv::Parameter> = PARAMETERS.iter().zip(&values).map(|(p, v)| ssv::Parameter { name: p.variable, value: *v, unit: p.unit }).collect();
        let text = ssv::write("drawn", &set);
        let document = roxmltree::Document::parse(&text).unwrap();
        let read = document.descendants().filter(|n| n.has_tag_name(("http://ssp-standard.org/SSP1/SystemStructureParameterValues", "Parameter")));
        let read: Vec<(&str, u64)> = read
            .map(|n| (n.attribute("name").unwrap(), n.first_element_child().unwrap().attribute("value").unwrap().parse::<f64>().unwrap().to_bits()))
            .collect();
        let expected: Vec<(&str, u64)> = set.iter().map(|p| (p.name, p.value.to_bits())).collect();
        prop_assert_eq!(read, expected);
    }
}

fn instance() -> *mut c_void {
    let guid = CString::new(plant::GUID).unwrap();
    fmi2Instantiate(c"x".as_ptr(), CO_SIMULATION, guid.as_ptr(), ptr::null(), &CallbackFunctions::NONE, 0, 0)
}

fn step(c: *mut c_void, k: u32, inputs: &[(f64, f64)]) -> Status {
    let (x_to, t_e) = inputs[k as usize % inputs.len()];
    assert_eq!(fmi2SetReal(c, [plant::vr::x_to, plant::vr::T_e_ref].as_ptr(), 2, [x_to, t_e].as_ptr()), Status::Ok);
    fmi2DoStep(c, f64::from(k) * 2e-3, 2e-3, 1)
}

fn outputs(c: *mut c_void) -> Vec<u64> {
    let all = [
        plant::vr::omega_f,
        plant::vr::omega_c,
        plant::vr::T_fc,
        plant::vr::theta_c,
        plant::vr::theta_b,
        plant::vr::x_to_actual,
        plant::vr::E_d,
    ];
    let mut values = vec![0.0; all.len()];
    assert_eq!(fmi2GetReal(c, all.as_ptr(), all.len(), values.as_mut_ptr()), Status::Ok);
    values.into_iter().map(f64::to_bits).collect()
}

proptest! {
    #![proptest_config(some(64))]

    #[test]
    fn a_state_goes_on_bit_for_bit_whatever_the_effects(
        shares in proptest::collection::vec(proptest::option::weighted(0.4, 0.0..=0.3_f64), PARAMETERS.len()),
        inputs in proptest::collection::vec((3.0..8.0_f64, -60.0..120.0_f64), 1..40),
        before in 1..120_u32,
    ) {
        let (first, second) = (instance(), instance());
        prop_assert_eq!(fmi2SetReal(first, &plant::vr::omega_f_start, 1, &100.0), Status::Ok);
        for (p, share) in PARAMETERS.iter().zip(&shares) {
            let compliance = p.variable == "effect.driveline_compliance.compliance";
            let bound = if compliance { 0.01 } else { p.max };
            if let Some(share) = share.filter(|share| !compliance || *share > 0.05) {
                let value = p.null + share * (bound - p.null);
                prop_assert_eq!(fmi2SetReal(first, &p.value_reference, 1, &value), Status::Ok, "{} = {}", p.variable, value);
            }
        }
        for c in [first, second] {
            prop_assert_eq!(fmi2EnterInitializationMode(c), Status::Ok);
            prop_assume!(fmi2ExitInitializationMode(c) == Status::Ok);
        }
        for k in 0..before {
            prop_assume!(step(first, k, &inputs) == Status::Ok);
        }
        let (mut state, mut size) = (ptr::null_mut(), 0);
        prop_assert_eq!(fmi2GetFMUstate(first, &mut state), Status::Ok);
        prop_assert_eq!(fmi2SerializedFMUstateSize(first, state, &mut size), Status::Ok);
        let mut bytes = vec![0 as c_char; size];
        prop_assert_eq!(fmi2SerializeFMUstate(first, state, bytes.as_mut_ptr(), size), Status::Ok);
        let mut taken = ptr::null_mut();
        prop_assert_eq!(fmi2DeSerializeFMUstate(second, bytes.as_ptr(), size, &mut taken), Status::Ok);
        prop_assert_eq!(fmi2SetFMUstate(second, taken), Status::Ok);
        for k in before..before + 60 {
            prop_assert_eq!(step(first, k, &inputs), step(second, k, &inputs));
            prop_assert_eq!(outputs(first), outputs(second), "step {}", k);
        }
        prop_assert_eq!((fmi2FreeFMUstate(first, &mut state), fmi2FreeFMUstate(second, &mut taken)), (Status::Ok, Status::Ok));
        fmi2FreeInstance(first);
        fmi2FreeInstance(second);
    }
}
