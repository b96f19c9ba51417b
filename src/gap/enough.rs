//! Chooses what is fitted of a long log: as many recordings (or parts of drives, [`divide`](super::divide)) as a diagnosis has time for, the most informative ones.
//!
//! Computing time and memory grow with the samples, but their information does not: a replay has a systematic error of ε times the noise
//! ([`of_replay`](super::infer::belief::of_replay)), so that n samples of one phase of the clutch count as n/(1 + ½ ε² n) exact ones. Recordings are taken one after the other, up
//! to [`MOST_SAMPLES`]: each time the one that adds most per sample to the information on tolerances and effects in those already taken, measured by the logarithm of its
//! determinant (D-optimal design).

use super::infer::density::Problem;
use super::infer::screen::{Anchor, information_of_starts};
use super::prose::listed;
use super::ready::Ready;
use crate::campaign::Campaign;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Maximum number of samples of both speeds and the bench channels that are fitted: 20 minutes of both speeds at 50 Hz, which take minutes of computing time. If each phase of the
/// clutch has a third of them, they count as 80 000 exact ones, or as 40 000 if the logger is slower than the control unit.
pub const MOST_SAMPLES: usize = 120_000;

/// Upper bound of the number of rows of a campaign that are fitted. A row holds both speeds; the recording that judges is kept whatever its length, and so is one other recording.
pub fn most_rows(campaign: &Campaign) -> usize {
    let rows = campaign.recordings.iter().map(|r| r.time.len());
    let longest = rows.clone().max().unwrap_or(0);
    rows.sum::<usize>().min(longest + longest.max(MOST_SAMPLES / 2))
}

/// The part of a campaign that is fitted, with the recording that judges, and a note on the selection; none if the whole campaign is fitted.
pub(super) fn enough_of(campaign: &Campaign, ready: &Ready, most: usize) -> Option<(Campaign, String)> {
    let judge = &campaign.recordings[ready.split.judge].name;
    let tracks = &ready.problem.tracks;
    let taken = most_informative(&ready.problem, tracks.iter().position(|t| t.name == *judge), most)?;
    let is_taken = |name: &str| name == judge || taken.iter().any(|&r| tracks[r].name == name);
    let (used, unused): (Vec<_>, Vec<_>) = campaign.recordings.iter().cloned().partition(|r| is_taken(&r.name));
    // The note has the shorter of the two lists.
    let (what, named, rest) =
        if used.len() < unused.len() { ("These are", &used, "; the others are not used") } else { ("Not used:", &unused, "") };
    let names: Vec<&str> = named.iter().map(|r| r.name.as_str()).collect();
    let note = format!(
        "{} of {} recordings are fitted, those that say most of tolerances and effects: {most} samples are the most that a diagnosis takes, and as a replay is \
         not exact, more of them would add less and less. {what} {}{rest}",
        used.len(),
        campaign.recordings.len(),
        listed(&names, " and ")
    );
    Some((Campaign { recordings: used, ..campaign.clone() }, note))
}

/// Indices of the most informative recordings that have at most `most` samples together, `first` among them, and at least one recording in any case. None if all recordings
/// together have no more samples, or if the information of one of them cannot be computed.
fn most_informative(problem: &Problem, first: Option<usize>, most: usize) -> Option<Vec<usize>> {
    if problem.samples() <= most {
        return None;
    }
    let said: Vec<DMatrix<f64>> =
        (0..problem.tracks.len()).into_par_iter().map(|r| information_of_recording(problem, r)).collect::<Option<_>>()?;
    let samples = |r: usize| problem.filters[r].samples.max(1);
    let log_det = |m: &DMatrix<f64>| -> f64 { m.clone().cholesky().map_or(0.0, |l| 2.0 * l.l_dirty().diagonal().map(f64::ln).sum()) };
    let (mut taken, mut room) = (Vec::new(), most);
    let mut all = DMatrix::identity(said[0].nrows(), said[0].nrows());
    let mut now = 0.0;
    // What a recording adds only falls as others are taken, so that its earlier value is an upper bound and need not be updated while it is the smaller one.
    let mut adds: Vec<(usize, f64)> = (0..said.len()).map(|r| (r, f64::INFINITY)).collect();
    let mut next = first;
    loop {
        adds.retain(|(r, _)| samples(*r) <= room || taken.is_empty());
        let most_promising = || (0..adds.len()).max_by(|a, b| adds[*a].1.total_cmp(&adds[*b].1).then(b.cmp(a)));
        let Some(place) = next.map_or_else(most_promising, |r| adds.iter().position(|a| a.0 == r)) else { break };
        let r = adds[place].0;
        let with = &all + &said[r];
        let there = log_det(&with);
        let add = (there - now) / samples(r) as f64;
        if next.is_none() && adds.iter().any(|(other, bound)| *other != r && *bound > add) {
            adds[place].1 = add;
            continue;
        }
        adds.swap_remove(place);
        taken.push(r);
        room = room.saturating_sub(samples(r));
        (all, now, next) = (with, there, None);
    }
    taken.sort_unstable();
    (taken.len() < said.len()).then_some(taken)
}

/// Information matrix of a recording on tolerances, in their standard deviations, and on the start values of effects, in units of these; the recording's own unknowns are
/// eliminated.
fn information_of_recording(problem: &Problem, r: usize) -> Option<DMatrix<f64>> {
    let alone = problem.of_recording(r);
    let anchor = Anchor::new(&alone, &alone.nominal(), &[], None, None)?;
    Some(information_of_starts(&alone, &anchor))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Recording;
    use crate::gap::diagnosis::of_samples;
    use crate::gap::infer::belief::of_replay;
    use crate::gap::infer::density::PHASES;
    use crate::gap::model::prepare::Example;
    use crate::gap::model::track::Track;

    /// The chosen recordings are nearly as informative as the best of all choices within the limit.
    #[test]
    fn recordings_are_taken_that_say_what_others_do_not() {
        let example = Example::read();
        let all: Vec<_> = example.campaign.recordings.iter().collect();
        let (problem, _) = example.problem(&all);
        let samples = |of: &[usize]| of.iter().map(|&r| problem.filters[r].samples).sum::<usize>();
        assert_eq!(most_informative(&problem, None, problem.samples()), None);
        let said: Vec<DMatrix<f64>> = (0..all.len()).map(|r| information_of_recording(&problem, r).unwrap()).collect();
        let worth = |of: &[usize]| {
            let none = DMatrix::identity(said[0].nrows(), said[0].nrows());
            of.iter().fold(none, |sum, &r| sum + &said[r]).cholesky().unwrap().l().diagonal().map(f64::ln).sum()
        };
        let most = problem.samples() / 3;
        let taken = most_informative(&problem, None, most).unwrap();
        let choices = (1..1_usize << all.len()).map(|bits| (0..all.len()).filter(|r| bits >> r & 1 == 1).collect::<Vec<_>>());
        let best = choices.filter(|c| samples(c) <= most).map(|c| worth(&c)).fold(0.0, f64::max);
        assert!(samples(&taken) <= most && worth(&taken) > 0.95 * best, "{taken:?}: {} of {best}", worth(&taken));
        // The recording that judges is kept in any case; without one, the most informative recording per sample is kept.
        assert_eq!(most_informative(&problem, Some(2), 1).unwrap(), [2]);
        let densest =
            (0..all.len()).max_by(|a, b| (worth(&[*a]) / samples(&[*a]) as f64).total_cmp(&(worth(&[*b]) / samples(&[*b]) as f64)));
        assert_eq!(most_informative(&problem, None, 1).unwrap(), [densest.unwrap()]);
    }

    /// The part keeps the recording that judges, and the note lists the recordings that are used or those that are not, whichever are fewer.
    #[test]
    fn what_is_not_used_is_said() {
        let Example { campaign, vehicle } = Example::read();
        let ready = Ready::judged_by(None, &campaign, &vehicle, &Default::default()).unwrap();
        let judge = &campaign.recordings[ready.split.judge].name;
        let all = campaign.recordings.len();
        for (share, what) in [(0.8, "Not used: "), (0.3, "These are ")] {
            let (part, note) = enough_of(&campaign, &ready, (share * ready.problem.samples() as f64) as usize).unwrap();
            let used = |name: &str| part.recordings.iter().any(|p| p.name == name);
            assert!(used(judge) && part.recordings.len() < all);
            assert!(note.starts_with(&format!("{} of {all} recordings are fitted", part.recordings.len())), "{note}");
            let named = note.split_once(what).unwrap().1.trim_end_matches("; the others are not used");
            let is_named = |name: &str| named.split(", ").flat_map(|n| n.split(" and ")).any(|n| n == name);
            assert!(campaign.recordings.iter().all(|r| is_named(&r.name) == (used(&r.name) == (share < 0.5))), "{note}");
        }
    }

    /// Copies of the recordings exceed the limit of a diagnosis. `read` has those that are fitted, and they lead to the effect that all recordings would show.
    #[test]
    fn a_campaign_of_many_recordings_is_diagnosed_in_part() {
        let mut campaign = Example::read().campaign;
        let once = campaign.recordings.clone();
        let most = once.iter().map(|r| 2 * r.time.len()).sum::<usize>() / 2;
        let copy = |k: usize| once.iter().cloned().map(move |r| Recording { name: format!("{}x{k}", r.name), ..r });
        campaign.recordings = (0..3).flat_map(copy).collect();
        let found = of_samples(most, &campaign, None, &|_, _| {}).unwrap();
        assert_eq!(found.answer.which.effects.iter().map(|e| e.id).collect::<Vec<_>>(), ["kiss_point_thermal"]);
        let (all, read) = (campaign.recordings.len(), &found.read.recordings);
        let note = found.answer.notes.iter().find(|n| n.starts_with(&format!("{} of {all} recordings are fitted", read.len()))).unwrap();
        assert!(read.len() < all / 2 && read.iter().all(|r| note.contains(&r.name)), "{note}");
        // The one that judges is read as well.
        let fitted: usize = read.iter().map(|r| 2 * r.time.len()).sum();
        let ready = Ready::judged_by(None, &campaign, &Example::read().vehicle, &Default::default()).unwrap();
        assert_eq!(found.answer.how_far.held_out, [ready.split.name]);
        let judge = 2 * found.held_out.time.len();
        assert!(fitted - judge <= most && fitted > most / 2, "{fitted} with {judge} of {most}");
    }

    #[test]
    fn a_long_campaign_is_fitted_in_part() {
        let mut campaign = Example::read().campaign;
        let rows: usize = campaign.recordings.iter().map(|r| r.time.len()).sum();
        assert_eq!(most_rows(&campaign), rows);
        let longer: Vec<f64> = (0..50_000).map(f64::from).collect();
        campaign.recordings.iter_mut().for_each(|r| r.time = longer.clone());
        assert_eq!(most_rows(&campaign), 50_000 + MOST_SAMPLES / 2);
    }

    /// As the documentation of the bound says.
    #[test]
    fn as_many_samples_as_are_fitted_are_believed_like_fewer() {
        let mut recording = Example::read().campaign.recordings.swap_remove(0);
        let of_phase = MOST_SAMPLES as f64 / PHASES as f64;
        let believed = |r: &Recording| PHASES as f64 * of_phase / (1.0 + of_replay(&Track::new(r)) * of_phase);
        assert!((believed(&recording) / 80_000.0 - 1.0).abs() < 0.01);
        recording.control_interval_s = Some(0.1 / recording.sample_rate_hz);
        assert!((believed(&recording) / 40_000.0 - 1.0).abs() < 0.01);
    }
}
