//! Recorded drives from beginning to end: when the driver braked, when the clutch was open, slipping or locked, and when it engaged.

use super::free::stretches;
use super::model::track::{Channel, Track};
use crate::campaign::Recording;
use crate::plant::Phase;
use std::ops::Range;

/// A drive as it was recorded, from beginning to end.
#[derive(Clone, Debug)]
pub struct Drive {
    /// Name of the recording.
    pub recording: String,
    /// Time stamps, s.
    pub time: Vec<f64>,
    /// Speeds of flywheel and disc, rad/s; not finite where there is no sample.
    pub speeds: [Vec<f64>; 2],
    /// Phases of the clutch as the measured speeds show them (0 open, 1 slipping, 2 locked), each with its beginning and end, s. Rows that took no part in the fit have no phases.
    pub phases: Vec<([f64; 2], u8)>,
    /// Beginning and end of each braking, s.
    pub braked: Vec<[f64; 2]>,
    /// Beginning and end, s, of each engagement that is replayed freely, and whether it was held out.
    pub engagements: Vec<([f64; 2], bool)>,
}

/// The recording as a drive; none if the driver never brakes in it. `held_out` gets the index of an engagement and the number of engagements; `phases` are the track of the part
/// that was fitted and its phase at each observation.
pub fn drive(recording: &Recording, held_out: impl Fn(usize, usize) -> bool, phases: Option<(&Track, &[Phase])>) -> Option<Drive> {
    let track = Track::new(recording);
    if track.brake.iter().all(|b| !b) {
        return None;
    }
    let all = stretches(&track);
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The brake is on until 1 s, released at rest, and on again from 3 s to the end; the last 0.5 s took no part in the fit.
    #[test]
    fn a_drive_says_when_it_brakes_engages_and_locks() {
        let time: Vec<f64> = (0..400).map(|k| 0.01 * f64::from(k)).collect();
        let brake: Vec<bool> = time.iter().map(|t| *t < 0.995 || *t > 2.995).collect();
        let r = Recording {
            name: "r01".into(),
            sample_rate_hz: 100.0,
            omega_f: vec![100.0; 400],
            omega_c: vec![0.0; 400],
            t_e: vec![10.0; 400],
            x_to_cmd: vec![3.0; 400],
            theta_h: vec![25.0; 400],
            brake: Some(brake),
            time,
            ..Recording::default()
        };
        let cut = |v: &Vec<f64>| v[..350].to_vec();
        let fitted = Recording { time: cut(&r.time), omega_f: cut(&r.omega_f), omega_c: cut(&r.omega_c), t_e: cut(&r.t_e), ..r.clone() };
        let fitted = Track::new(&Recording {
            x_to_cmd: cut(&r.x_to_cmd),
            theta_h: cut(&r.theta_h),
            brake: r.brake.as_ref().map(|b| b[..350].to_vec()),
            ..fitted
        });
        let phases: Vec<Phase> = (0..350)
            .map(|k| {
                if k < 120 {
                    Phase::Open
                } else if k < 200 {
                    Phase::Slipping
                } else {
                    Phase::Locked
                }
            })
            .collect();
        let d = drive(&r, |k, count| k + 1 == count, Some((&fitted, &phases))).unwrap();
        let close = |found: [f64; 2], expected: [f64; 2]| found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(d.braked.len() == 2 && close(d.braked[0], [0.0, 1.0]) && close(d.braked[1], [3.0, 3.99]), "{:?}", d.braked);
        assert!(d.engagements.len() == 1 && close(d.engagements[0].0, [1.0, 3.0]) && d.engagements[0].1, "{:?}", d.engagements);
        let expected = [([0.0, 1.2], 0), ([1.2, 2.0], 1), ([2.0, 3.49], 2)];
        assert_eq!(d.phases.len(), 3);
        assert!(d.phases.iter().zip(expected).all(|(found, (span, phase))| close(found.0, span) && found.1 == phase), "{:?}", d.phases);
        assert!(d.recording == "r01" && d.time.len() == 400 && d.speeds[0][7] == 100.0 && d.speeds[1][7] == 0.0);
        assert!(drive(&r, |_, _| false, None).unwrap().phases.is_empty());
        assert!(drive(&Recording { brake: None, ..r }, |_, _| false, None).is_none());
    }
}
