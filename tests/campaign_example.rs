//! The bundled campaign is complete and is read without a remark.

use kisspoint::campaign::{self, ReadOptions};
use kisspoint::vehicle::Vehicle;
use std::path::{Path, PathBuf};

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
