//! Divides long drives where the car stands, since only temperatures and the slip angle carry over from there.
//!
//! This makes it possible to fit only a part of a long log ([`enough`](super::enough)). A part begins at rest under the brake, like a drive of its own, at the temperatures and the
//! slip angle that the file's car has there in a corrected replay of the drive.

use super::enough::MOST_SAMPLES;
use super::free::{prepare, rests};
use super::model::filter::RESTED_S;
use crate::campaign::{Campaign, Note, Recording};
use crate::effects;
use crate::vehicle::{Vehicle, VehicleError};
use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;

/// Minimum number of rows of a part. With two speeds per row, these are a tenth of the samples that are fitted.
const PART_ROWS: usize = MOST_SAMPLES / 20;

/// Standard deviation of the temperatures of disc and body at the beginning of a part, as a share of what they have warmed since the drive began. It is added, in squares, to that
/// of the drive's start temperatures.
const WARMED: f64 = 0.5;

/// Divides the long drives of a campaign that has more samples than are fitted, and adds a note for each of them. A campaign that has already been divided is returned unchanged.
///
/// # Errors
/// An invalid vehicle file.
pub fn divided(campaign: &Campaign) -> Result<Cow<'_, Campaign>, VehicleError> {
    let rows: usize = campaign.recordings.iter().map(|r| r.time.len()).sum();
    if 2 * rows <= MOST_SAMPLES {
        return Ok(Cow::Borrowed(campaign));
    }
    let vehicle = Vehicle::from_value(&campaign.vehicle_json)?;
    let all: Vec<Vec<Range<usize>>> = campaign.recordings.iter().map(|r| parts(r, &vehicle)).collect();
    if all.iter().all(|parts| parts.len() == 1) {
        return Ok(Cow::Borrowed(campaign));
    }
    let divided: Vec<Vec<Recording>> = campaign.recordings.par_iter().zip(&all).map(|(r, parts)| apart(r, &vehicle, parts)).collect();
    let notes = campaign.recordings.iter().zip(&all).filter(|(_, parts)| parts.len() > 1).map(|(r, parts)| Note {
        recording: r.name.clone(),
        text: format!("the drive is taken in {} parts, each from a standstill on; their names say when they begin", parts.len()),
    });
    let notes = campaign.notes.iter().cloned().chain(notes).collect();
    Ok(Cow::Owned(Campaign { recordings: divided.into_iter().flatten().collect(), notes, ..campaign.clone() }))
}

/// Rows of the parts of a recording.
fn parts(r: &Recording, vehicle: &Vehicle) -> Vec<Range<usize>> {
    let rows = r.time.len();
    let Some(brake) = r.brake.as_ref().filter(|_| rows >= 2 * PART_ROWS) else { return std::iter::once(0..rows).collect() };
    let half_closed = 0.5 * (vehicle.actuator.x_cnt_0 + vehicle.actuator.x_cls_0);
    let (mut begins, mut rest) = (vec![0], None);
    let rests = rests(r.omega_c.iter().copied());
    for (row, brakes) in brake.iter().enumerate() {
        let is_open = r.x_to_cmd.get(row).is_none_or(|x| *x < half_closed);
        rest = (*brakes && rests[row] && is_open).then(|| rest.unwrap_or(r.time[row]));
        let has_settled = rest.is_some_and(|since| r.time[row] - since >= RESTED_S) && r.omega_f[row].is_finite();
        if has_settled && row - begins[begins.len() - 1] >= PART_ROWS {
            begins.push(row);
        }
    }
    begins.iter().zip(begins[1..].iter().chain([&rows])).map(|(from, to)| *from..*to).collect()
}

/// The parts as recordings.
fn apart(r: &Recording, vehicle: &Vehicle, parts: &[Range<usize>]) -> Vec<Recording> {
    if parts.len() == 1 {
        return vec![r.clone()];
    }
    let null = effects::null();
    let along = prepare(r, vehicle).along((vehicle, &null), [r.theta_c0, r.theta_b0]);
    let one = |rows: &Range<usize>| {
        let (theta, slip_angle_0) = along[rows.start];
        let sigma = |node: usize| r.theta_0_sigma[node].hypot(WARMED * (theta[node] - [r.theta_c0, r.theta_b0][node]));
        Recording {
            name: format!("{} from {:.0} s", r.name, r.time[rows.start]),
            theta_c0: theta[0],
            theta_b0: theta[1],
            theta_0_sigma: [sigma(0), sigma(1)],
            slip_angle_0,
            ..r.part(rows.clone())
        }
    };
    let first = Recording { name: format!("{} from 0 s", r.name), ..r.part(parts[0].clone()) };
    std::iter::once(first).chain(parts[1..].iter().map(one)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive at 100 Hz that stands from 60 s to 63 s, from 130 s to 130.3 s, from 140 s to 143 s with its clutch closed, from 150 s to 153 s without the brake, and from 170 s to
    /// 173 s.
    fn drive() -> Recording {
        let time: Vec<f64> = (0..20_000).map(|k| 0.01 * f64::from(k)).collect();
        let within = |t: f64, spans: &[[f64; 2]]| spans.iter().any(|[from, to]| (from - 0.005..to - 0.005).contains(&t));
        let stands = [[60.0, 63.0], [130.0, 130.3], [140.0, 143.0], [150.0, 153.0], [170.0, 173.0]];
        let of = |value: &dyn Fn(f64) -> f64| time.iter().map(|t| value(*t)).collect::<Vec<f64>>();
        Recording {
            name: "r01".into(),
            sample_rate_hz: 100.0,
            omega_f: of(&|_| 150.0),
            omega_c: of(&|t| if within(t, &stands) { 0.0 } else { 80.0 }),
            t_e: of(&|_| 10.0),
            x_to_cmd: of(&|t| if within(t, &[[139.0, 144.0]]) { 12.0 } else { 1.0 }),
            theta_h: of(&|_| 25.0),
            brake: Some(time.iter().map(|t| within(*t, &stands) && !within(*t, &stands[3..4])).collect()),
            input_rows: [Some((0..20_000).step_by(7).collect()), None],
            time,
            ..Recording::default()
        }
    }

    #[test]
    fn a_part_begins_when_an_open_car_has_stood_under_its_brake() {
        let (vehicle, r) = (Vehicle::paper(), drive());
        assert_eq!(parts(&r, &vehicle), [0..6_050, 6_050..17_050, 17_050..20_000]);
        // Without a position, standing under the brake is sufficient. A recording without a brake, or a short one, is not divided.
        let without = Recording { x_to_cmd: Vec::new(), ..r.clone() };
        assert_eq!(parts(&without, &vehicle), [0..6_050, 6_050..14_050, 14_050..20_000]);
        assert_eq!(parts(&Recording { brake: None, ..r.clone() }, &vehicle), [0..20_000]);
        assert_eq!(parts(&r.part(0..2 * PART_ROWS - 1), &vehicle), [0..2 * PART_ROWS - 1]);
    }

    #[test]
    fn a_part_has_the_rows_of_the_whole_and_inputs_known_from_its_first_one_on() {
        let r = drive();
        let part = r.part(6_050..17_050);
        assert!(part.time.len() == 11_000 && part.time[0] == 0.0 && (part.time[100] - 1.0).abs() < 1e-9);
        assert!(part.omega_c[..] == r.omega_c[6_050..17_050] && part.brake.unwrap()[..] == r.brake.as_ref().unwrap()[6_050..17_050]);
        let own = part.input_rows[0].as_ref().unwrap();
        // 6 055 is the next multiple of 7.
        assert_eq!((own[0], own[1], own[2]), (0, 5, 12));
        assert_eq!(r.part(0..100).input_rows[0].as_ref().unwrap()[..3], [0, 7, 14]);
    }
}
