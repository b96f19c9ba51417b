//! The bundled campaign: whole, readable without a remark, and what its command writes.

use kisspoint::campaign::{self, ReadOptions};
use kisspoint::vehicle::Vehicle;
use realcar::{Kind, Place, draw_car_of};
use std::path::{Path, PathBuf};

/// The seed of `realcar/examples/example_campaign.rs`.
const SEED: u64 = 20_111;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/campaigns/example")
}

#[test]
fn it_is_read_whole_and_without_a_remark() {
    let options = ReadOptions { strict: true, ..ReadOptions::default() };
    let read = campaign::read(&folder(), &options).unwrap();
    assert_eq!(read.recordings.len(), 9);
    assert!(read.notes.is_empty(), "{:?}", read.notes);
    assert!(Vehicle::from_value(&read.vehicle_json).is_ok());
    let manoeuvres: std::collections::BTreeSet<&str> = read.recordings.iter().map(|r| r.manoeuvre.as_str()).collect();
    assert_eq!(manoeuvres.len(), 5, "{manoeuvres:?}");
}

#[test]
fn the_generator_writes_it_again() {
    let car = (0..1000)
        .map(|index| draw_car_of(Place::Bench, SEED, index, Kind::Single("kiss_point_thermal")))
        .find(|car| {
            let recordings = &car.campaign.recordings;
            recordings.len() == 9 && recordings.iter().all(|r| r.bench.is_none() && r.sample_rate_hz < 500.0)
        })
        .unwrap();
    for (k, recording) in car.campaign.recordings.iter().enumerate() {
        let shipped = std::fs::read_to_string(folder().join(format!("r{:02}.csv", k + 1))).unwrap();
        assert_eq!(realcar::write::csv(recording), shipped, "r{:02}.csv", k + 1);
    }
}
