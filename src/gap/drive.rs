//! Drives as they were recorded, from beginning to end: what happened when.

use super::measure::stretches;
use super::model::track::{Channel, Track};
use crate::campaign::Recording;
use crate::plant::Phase;
use std::ops::Range;

/// A drive as it was recorded, from beginning to end.
#[derive(Clone, Debug)]
pub struct Drive {
    /// Name of the recording.
    pub recording: String,
    /// Stamps, s.
    pub time: Vec<f64>,
    /// Speeds of flywheel and disc, rad/s; not finite where there is no sample.
    pub speeds: [Vec<f64>; 2],
    /// Phases of the clutch as the speeds show them (0 open, 1 slipping, 2 locked), each from an instant to another, s; none where a part took no part in the fit.
    pub phases: Vec<([f64; 2], u8)>,
    /// When the driver brakes, s.
    pub braked: Vec<[f64; 2]>,
    /// Engagements that are replayed freely, s, and whether they took no part in choosing or fitting.
    pub engagements: Vec<([f64; 2], bool)>,
}

/// A recording as a drive, if the driver brakes in it. `phases` are those by observation of the part that was fitted.
pub fn drive(recording: &Recording, held_out: impl Fn(usize, usize) -> bool, phases: Option<(&Track, &[Phase])>) -> Option<Drive> {
    let track = Track::new(recording);
    let all = stretches(&track);
    if track.brake.iter().all(|b| !b) {
        return None;
    }
    let span = |rows: Range<usize>| [track.time[rows.start], track.time[rows.end.min(track.rows() - 1)]];
    let runs = |n: usize, same: &dyn Fn(usize, usize) -> bool| -> Vec<Range<usize>> {
        let begins: Vec<usize> = (0..n).filter(|&k| k == 0 || !same(k - 1, k)).collect();
        begins.iter().enumerate().map(|(i, &k)| k..begins.get(i + 1).copied().unwrap_or(n)).collect()
    };
    let braked = runs(track.rows(), &|a, b| track.brake[a] == track.brake[b]);
    let phases = phases.into_iter().flat_map(|(fitted, phase)| {
        let at = |k: usize| fitted.time[fitted.rows_of(k.min(phase.len() - 1)).start];
        let last = fitted.time[fitted.rows() - 1];
        let one = move |run: Range<usize>| {
            ([at(run.start), if run.end < phase.len() { at(run.end) } else { last }], phase[run.start] as u8 - Phase::Open as u8)
        };
        runs(phase.len(), &|a, b| phase[a] == phase[b]).into_iter().map(one)
    });
    Some(Drive {
        recording: recording.name.clone(),
        phases: phases.collect(),
        braked: braked.into_iter().filter(|run| track.brake[run.start]).map(span).collect(),
        engagements: all.iter().enumerate().map(|(k, rows)| (span(rows.clone()), held_out(k, all.len()))).collect(),
        speeds: [Channel::OmegaF, Channel::OmegaC].map(|c| track.measured[c as usize].clone()),
        time: track.time,
    })
}
