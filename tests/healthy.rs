//! Healthy cars that the generator draws: neither the verdict nor the residual map finds anything in them, beyond the error rates that they state.
#![cfg(feature = "cli")]

use kisspoint::campaign::{self, ReadOptions};
use kisspoint::gap::diagnosis::diagnose;
use kisspoint::gap::verdict::Verdict;
use rayon::prelude::*;
use realcar::{Kind, Place, draw_car_of};
use std::ops::Range;

/// Of these cars how many are flagged, and in how many the map frames a cell.
fn alarms(cars: Range<usize>) -> [usize; 2] {
    let one = |k: usize| {
        let folder = tempfile::tempdir().unwrap();
        draw_car_of(Place::Bench, 20_261_125, k, Kind::Healthy).write(folder.path()).unwrap();
        let answer = diagnose(&campaign::read(folder.path(), &ReadOptions::default()).unwrap(), &|_, _| {}).unwrap().answer;
        let (flagged, framed) = (answer.verdict != Verdict::NoGap, answer.place.equations.iter().any(|e| e.significant));
        [flagged, framed].map(usize::from)
    };
    let count = cars.len();
    let found = cars.into_par_iter().map(one).reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
    println!("of {count} healthy cars {} flagged, {} with a framed cell in the residual map", found[0], found[1]);
    found
}

/// At 1 % each, two of twelve come once in 160 draws.
#[test]
fn a_dozen_healthy_cars_raise_no_alarm() {
    let [flagged, framed] = alarms(0..12);
    assert!(flagged == 0 && framed <= 1, "{flagged} flagged, {framed} with a framed cell");
}

/// The family-wise error of the map: at 1 % more than three of a hundred come once in 54 draws. Takes minutes.
#[test]
#[ignore = "a hundred cars take minutes: run by name when the model of the data changes"]
fn a_hundred_healthy_cars_raise_few_alarms() {
    let [flagged, framed] = alarms(0..100);
    assert!(flagged <= 3 && framed <= 3, "{flagged} flagged, {framed} with a framed cell");
}
