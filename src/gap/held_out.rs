//! What takes no part in choosing or fitting, and judges in the open: of a bench campaign one recording, of drives the last engagement of the longest.

use super::measure::stretches;
use super::model::track::Track;
use crate::campaign::Recording;

/// What is held out, and what is left to learn from.
pub struct Split {
    /// Recordings to learn from.
    pub taught: Vec<Recording>,
    /// Place of the recording that judges.
    pub judge: usize,
    /// Whether only its last engagement does; what came before is part of the learning.
    pub last_engagement: bool,
    /// Name of what is held out.
    pub name: String,
}

/// Splits the recordings.
pub fn split(recordings: &[Recording]) -> Split {
    let is_drive = |r: &Recording| r.brake.as_ref().is_some_and(|b| b.iter().any(|b| *b));
    let engagements: Vec<usize> = recordings.iter().map(|r| if is_drive(r) { stretches(&Track::new(r)).len() } else { 0 }).collect();
    if let Some(judge) = (0..recordings.len()).filter(|&k| engagements[k] >= 2).max_by_key(|&k| (engagements[k], usize::MAX - k)) {
        let last = stretches(&Track::new(&recordings[judge])).pop().expect("it has two");
        let mut taught = recordings.to_vec();
        taught[judge] = cut(&recordings[judge], last.start);
        let name = format!("the engagement at {:.1} s of {}", recordings[judge].time[last.start], recordings[judge].name);
        return Split { taught, judge, last_engagement: true, name };
    }
    let judge = of_bench(recordings);
    let taught = recordings.iter().enumerate().filter(|(k, _)| *k != judge).map(|(_, r)| r.clone()).collect();
    Split { taught, judge, last_engagement: false, name: recordings[judge].name.clone() }
}

/// Of a manoeuvre with at least three recordings the one whose start temperature is in the middle; without one, the last recording.
fn of_bench(recordings: &[Recording]) -> usize {
    let siblings = |r: &Recording| recordings.iter().filter(|o| o.manoeuvre == r.manoeuvre).count();
    let most = recordings.iter().map(siblings).max().unwrap_or(0);
    if most < 3 {
        return recordings.len() - 1;
    }
    let mut family: Vec<usize> = (0..recordings.len()).filter(|&k| siblings(&recordings[k]) == most).collect();
    family.sort_by(|&a, &b| recordings[a].theta_c0.total_cmp(&recordings[b].theta_c0).then(a.cmp(&b)));
    family[family.len() / 2]
}

/// The first `rows` of a recording.
fn cut(r: &Recording, rows: usize) -> Recording {
    let mut all = r.clone();
    let columns = [&mut all.time, &mut all.omega_f, &mut all.omega_c, &mut all.t_e, &mut all.x_to_cmd, &mut all.theta_h];
    columns.into_iter().for_each(|c| c.truncate(rows));
    [&mut all.x_to, &mut all.t_fc, &mut all.theta_c].into_iter().flatten().for_each(|c| c.truncate(rows));
    if let Some(b) = all.brake.as_mut() {
        b.truncate(rows);
    }
    all
}
