//! A long drive is divided where the car stands: its parts have the same likelihood as the whole, and no sample is lost.

use kisspoint::campaign::{self, Campaign, ReadOptions, Recording};
use kisspoint::gap::divide::divided;
use kisspoint::gap::model::filter::Disturbances;
use kisspoint::gap::model::tolerance::Car;
use kisspoint::gap::model::track::Track;
use kisspoint::gap::model::{prepare, replay};
use kisspoint::vehicle::Vehicle;
use realcar::{Driven, draw_long};
use std::borrow::Cow;

/// Ten minutes of a healthy car at 100 Hz, which is more than a diagnosis fits at once.
fn drive() -> Campaign {
    let driven = Driven { drives: Some(1), length_s: Some(620.0) };
    let is_fit = |car: &realcar::Car| car.campaign.recordings[0].sample_rate_hz == 100.0 && car.truth.effects.is_empty();
    let car = (0..40).map(|index| draw_long(4, index, driven)).find(is_fit).unwrap();
    let folder = tempfile::tempdir().unwrap();
    car.write(folder.path()).unwrap();
    campaign::read(folder.path(), &ReadOptions::default()).unwrap()
}

fn innovations(r: &Recording, vehicle: &Vehicle, with: &Disturbances) -> Vec<f64> {
    let track = Track::new(r);
    let filter = prepare::filter_of(&track, vehicle, with);
    replay::innovations(&track, &filter, &Car::nominal(vehicle), [r.theta_c0, r.theta_b0], None)
}

#[test]
fn a_long_drive_goes_on_in_its_parts_where_it_stood() {
    let whole = drive();
    let Cow::Owned(parts) = divided(&whole).unwrap() else { panic!("the drive is not divided") };
    let r = &whole.recordings[0];
    // Each part begins at rest under the brake, a minute or more after the previous one, and together the parts are the whole drive.
    assert!(parts.recordings.len() > 5, "{}", parts.recordings.len());
    assert!(parts.recordings[1..].iter().all(|p| p.brake.as_ref().unwrap()[0] && p.omega_c[0].abs() < 2.0 && p.time[0] == 0.0));
    assert!(parts.recordings.iter().rev().skip(1).all(|p| p.time.len() >= 6_000));
    let together: Vec<f64> = parts.recordings.iter().flat_map(|p| p.omega_f.iter().copied()).collect();
    assert!(together.len() == r.omega_f.len() && together.iter().zip(&r.omega_f).all(|(a, b)| a.to_bits() == b.to_bits()));
    // Their names say when they begin, and a note says that they are parts. Parts are not divided again.
    let names: Vec<&str> = parts.recordings.iter().map(|p| p.name.as_str()).collect();
    let begins = |k: usize| r.time[parts.recordings[..k].iter().map(|p| p.time.len()).sum::<usize>()];
    assert!(names.iter().enumerate().all(|(k, n)| *n == format!("{} from {:.0} s", r.name, begins(k))), "{names:?}");
    assert!(parts.notes.iter().any(|n| n.recording == r.name && n.text.contains(&format!("{} parts", names.len()))), "{:?}", parts.notes);
    assert!(matches!(divided(&parts).unwrap(), Cow::Borrowed(_)));

    // Replayed with the knowledge of their start, they have the same innovations as the whole drive.
    let vehicle = Vehicle::from_value(&whole.vehicle_json).unwrap();
    let (tracks, tolerances) = prepare::read(&[r], &whole.vehicle_json).unwrap();
    let with = prepare::disturbances(&tracks, &tolerances);
    let all = innovations(r, &vehicle, &with);
    let square = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
    let mut row = 0;
    for part in &parts.recordings {
        let of = |row: usize| 2 * if row < r.time.len() { tracks[0].observation_of(row) } else { tracks[0].observations() };
        let was = &all[of(row)..of(row + part.time.len())];
        let is = innovations(part, &vehicle, &with);
        // A difference of five nats in ten thousand is allowed, because at its start a part lacks what the filter of the whole drive has learned by then.
        assert!(is.len() == was.len() && (square(&is) - square(was)).abs() < 10.0, "{}: {} for {}", part.name, square(&is), square(was));
        row += part.time.len();
    }
}
