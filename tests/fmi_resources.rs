//! The GUID identifies the car: an FMU starts as the car that its GUID names, or not at all.

use kisspoint::effects;
use kisspoint::fmi2::model::{MODELS, Registered, put_vehicle};
use kisspoint::fmi2::{controller, exports::*, guid, plant, types::*};
use kisspoint::vehicle::Vehicle;
use std::ffi::{CString, c_void};
use std::path::{Path, PathBuf};
use std::{fs, ptr};

const OTHER_J_C: f64 = 0.75;

/// A resource folder of a car with a different inertia, and that car.
fn other_car(name: &str) -> (PathBuf, Vehicle) {
    let mut vehicle = Vehicle::paper();
    vehicle.driveline.J_c = OTHER_J_C;
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    resources(&folder, &vehicle);
    (folder, vehicle)
}

fn resources(folder: &Path, vehicle: &Vehicle) {
    fs::create_dir_all(folder).unwrap();
    fs::write(folder.join("vehicle.json"), vehicle.to_value().to_string()).unwrap();
}

/// The GUID of an FMU with this car: the GUID of its interface, with a tail that identifies the start values.
fn guid(model: &Registered, vehicle: &Vehicle) -> String {
    let mut values: Vec<f64> = model.description.variables.iter().map(|v| v.start).collect();
    put_vehicle(model.description, vehicle, &effects::null(), &mut values);
    let tail = guid::tail(values.into_iter());
    format!("{}{}", &model.description.guid[..guid::OF_INTERFACE], std::str::from_utf8(&tail).unwrap())
}

#[cfg(feature = "cli")]
#[test]
fn a_model_description_bears_the_guid_of_its_start_values() {
    use kisspoint::fmu::description;
    let (_, other) = other_car("described");
    for model in &kisspoint::fmu::MODELS {
        for vehicle in [Vehicle::paper(), other] {
            let xml = description::complete(model, &vehicle, &effects::null());
            let written = xml.lines().find_map(|line| description::attribute(line, "guid")).unwrap();
            assert!(MODELS.iter().any(|model| guid(model, &vehicle) == written), "{written}");
        }
    }
}

fn instantiate(guid: &str, location: Option<&[u8]>) -> *mut c_void {
    let (guid, location) = (CString::new(guid).unwrap(), location.map(|bytes| CString::new(bytes).unwrap()));
    let location = location.as_ref().map_or(ptr::null(), |text| text.as_ptr());
    fmi2Instantiate(c"x".as_ptr(), CO_SIMULATION, guid.as_ptr(), location, &CallbackFunctions::NONE, 0, 0)
}

/// J_c with which an instance starts; `None` if it was refused.
fn inertia(guid: &str, location: Option<&[u8]>) -> Option<f64> {
    let c = instantiate(guid, location);
    if c.is_null() {
        return None;
    }
    let mut value = f64::NAN;
    assert_eq!(fmi2EnterInitializationMode(c), Status::Ok);
    assert_eq!(fmi2GetReal(c, &plant::vr::driveline_J_c, 1, &mut value), Status::Ok);
    fmi2FreeInstance(c);
    Some(value)
}

fn uri(folder: &Path) -> Vec<u8> {
    format!("file://{}", folder.display()).into_bytes()
}

#[test]
fn an_fmu_starts_as_its_own_car_or_not_at_all() {
    let (folder, other) = other_car("other");
    let paper_folder = folder.with_file_name("paper");
    resources(&paper_folder, &Vehicle::paper());
    let paper_j_c = Vehicle::paper().driveline.J_c;
    for model in &MODELS {
        let (of_paper, of_other) = (guid(model, &Vehicle::paper()), guid(model, &other));
        assert_eq!(inertia(&of_other, Some(&uri(&folder))), Some(OTHER_J_C));
        assert_eq!(inertia(&of_paper, Some(&uri(&paper_folder))), Some(paper_j_c));
        // The resources of another FMU.
        assert_eq!(inertia(&of_other, Some(&uri(&paper_folder))), None);
        assert_eq!(inertia(&of_paper, Some(&uri(&folder))), None);
        // No resources, a folder that does not exist, a Latin-1 path that does not exist, and a URL: the built-in start values are used if they are the FMU's own.
        for absent in [None, Some(&b"file:///nowhere"[..]), Some(b"file:///m\xfcll"), Some(b"http://example.org/x")] {
            assert_eq!(inertia(&of_other, absent), None);
            assert_eq!(inertia(&of_paper, absent), Some(paper_j_c));
        }
    }
}

/// A vehicle file that was read for one instance is reused for others only while the file is unchanged.
#[test]
fn a_vehicle_file_that_changes_between_instances_is_read_again() {
    let (folder, other) = other_car("changed");
    let of_other = guid(&MODELS[0], &other);
    let location = uri(&folder);
    // The file's content is cached as long as there are instances.
    let held = instantiate(&of_other, Some(&location));
    assert!(!held.is_null());
    for _ in 0..2 {
        assert_eq!(inertia(&of_other, Some(&location)), Some(OTHER_J_C));
    }
    assert_eq!(inertia(&guid(&MODELS[0], &Vehicle::paper()), Some(&location)), None, "the cached file is that of another car");
    let file = folder.join("vehicle.json");
    let text = fs::read_to_string(&file).unwrap();
    fs::write(&file, format!("{}\n", Vehicle::paper().to_value())).unwrap();
    assert_eq!(inertia(&of_other, Some(&location)), None, "it is another car's now");
    fs::write(&file, format!("{text}\n\n")).unwrap();
    assert_eq!(inertia(&of_other, Some(&location)), Some(OTHER_J_C));
    fs::remove_file(&file).unwrap();
    assert_eq!(inertia(&of_other, Some(&location)), None, "it is gone");
    fmi2FreeInstance(held);
}

#[cfg(unix)]
#[test]
fn a_folder_named_in_latin_1_is_found() {
    use std::os::unix::ffi::OsStrExt;
    let (folder, other) = other_car("latin");
    let latin = folder.join(std::ffi::OsStr::from_bytes(b"m\xfcll"));
    resources(&latin, &other);
    let (model, plain) = (&MODELS[1], uri(&folder));
    let guid = guid(model, &other);
    assert_eq!(inertia(&guid, Some(&[&plain[..], b"/m\xfcll"].concat())), Some(OTHER_J_C));
    assert_eq!(inertia(&guid, Some(&[&plain[..], b"/m%FCll"].concat())), Some(OTHER_J_C));
}

#[test]
fn measurements_take_any_value_and_commands_do_not() {
    for (guid, reference, status) in
        [(controller::GUID, controller::vr::omega_f, Status::Ok), (plant::GUID, plant::vr::x_to, Status::Error)]
    {
        let c = instantiate(guid, None);
        for value in [f64::NAN, f64::INFINITY, 2500.0, -1e300] {
            assert_eq!(fmi2SetReal(c, &reference, 1, &value), status, "{value}");
        }
        fmi2FreeInstance(c);
    }
}

#[test]
fn every_bit_of_every_start_value_tells_in_the_guid() {
    use guid::tail;
    let starts = [0.189, 0.0, 25.0, -7.06e-6, 3.1];
    let mut tails = std::collections::HashSet::from([tail(starts.into_iter())]);
    for place in 0..starts.len() {
        // The sign of a zero does not matter.
        for bit in (0..64).filter(|bit| starts[place] != 0.0 || *bit != 63) {
            let mut other = starts;
            other[place] = f64::from_bits(other[place].to_bits() ^ (1 << bit));
            assert!(tails.insert(tail(other.into_iter())), "value {place}, bit {bit}");
        }
    }
    assert_eq!(tail([0.0].into_iter()), tail([-0.0].into_iter()));
}
