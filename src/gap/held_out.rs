//! Held-out data, which take no part in selection or fitting and by which the result is judged: one recording of a bench campaign; among drives, the last engagement of the drive
//! with the most engagements.

use super::free::stretches;
use super::model::track::Track;
use crate::campaign::Recording;

/// Division of the recordings into those of the fit and the held-out data.
pub struct Split {
    /// Recordings of the fit.
    pub fitted_part: Vec<Recording>,
    /// Index of the recording that judges, which contains the held-out data.
    pub judge: usize,
    /// Whether only its last engagement is held out; the rows before that are part of the fit.
    pub last_engagement: bool,
    /// Name of the held-out data.
    pub name: String,
}

/// Splits the recordings. The recording with the name `judge` judges, if there is one, so that a part of a campaign is judged by the same recording as the whole campaign.
pub fn split(recordings: &[Recording], judge: Option<&str>) -> Split {
    let is_drive = |r: &Recording| r.brake.as_ref().is_some_and(|b| b.iter().any(|b| *b));
    let of_drive = |r: &Recording| if is_drive(r) { stretches(&Track::new(r)) } else { Vec::new() };
    let engagements: Vec<usize> = recordings.iter().map(|r| of_drive(r).len()).collect();
    let of_drives = || (0..recordings.len()).filter(|&k| engagements[k] >= 2).max_by_key(|&k| (engagements[k], usize::MAX - k));
    let named = recordings.iter().position(|r| judge == Some(&r.name));
    let judge = named.or_else(of_drives).unwrap_or_else(|| of_bench(recordings));
    if let Some(last) = of_drive(&recordings[judge]).pop().filter(|_| engagements[judge] >= 2) {
        let mut fitted_part = recordings.to_vec();
        fitted_part[judge] = recordings[judge].part(0..last.start);
        let name = format!("the engagement at {:.1} s of {}", recordings[judge].time[last.start], recordings[judge].name);
        return Split { fitted_part, judge, last_engagement: true, name };
    }
    let fitted_part = recordings.iter().enumerate().filter(|(k, _)| *k != judge).map(|(_, r)| r.clone()).collect();
    Split { fitted_part, judge, last_engagement: false, name: recordings[judge].name.clone() }
}

/// Index of the recording that judges a bench campaign: of the manoeuvre with the most recordings, the one whose start temperature is in the middle; or the last recording, if no
/// manoeuvre has at least three.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn recording(name: &str, manoeuvre: &str, theta_c0: f64, rows: usize) -> Recording {
        let column = |value: f64| vec![value; rows];
        Recording {
            name: name.into(),
            manoeuvre: manoeuvre.into(),
            sample_rate_hz: 100.0,
            time: (0..rows).map(|k| 0.01 * k as f64).collect(),
            theta_c0,
            omega_f: column(100.0),
            omega_c: column(0.0),
            t_e: column(10.0),
            x_to_cmd: column(3.0),
            theta_h: column(25.0),
            ..Recording::default()
        }
    }

    /// A drive that stands and goes by turns: brake on for a second, then off for two.
    fn drive(name: &str, engagements: usize) -> Recording {
        let rows = 300 * engagements;
        let all = recording(name, "drive", 40.0, rows);
        Recording { brake: Some((0..rows).map(|k| k % 300 < 100).collect()), x_to: Some(vec![1.0; rows]), ..all }
    }

    fn names(split: &Split) -> Vec<&str> {
        split.fitted_part.iter().map(|r| r.name.as_str()).collect()
    }

    #[test]
    fn of_a_bench_campaign_the_middle_of_the_largest_family_judges_and_teaches_nothing() {
        let of = |name: &str, theta: f64| recording(name, "launch", theta, 50);
        let all = [of("a", 90.0), recording("b", "creep", 20.0, 50), of("c", 20.0), of("d", 50.0), recording("e", "creep", 50.0, 50)];
        let split = split(&all, None);
        assert_eq!((split.judge, split.last_engagement, split.name.as_str()), (3, false, "d"));
        assert_eq!(names(&split), ["a", "b", "c", "e"]);
        // Of two recordings of a manoeuvre, none is in the middle: the last recording of the campaign judges.
        let few = super::split(&all[..3], None);
        assert_eq!((few.judge, names(&few)), (2, vec!["a", "b"]));
        assert!(super::split(&all[..1], None).fitted_part.is_empty());
    }

    /// Without a name, another drive or another bench recording may judge a part of the campaign than the whole of it.
    #[test]
    fn what_judges_a_campaign_judges_a_part_of_it() {
        let drives = [drive("a", 3), drive("b", 2)];
        let by = |all: &[Recording], judge| (split(all, judge).judge, split(all, judge).last_engagement);
        assert_eq!([by(&drives, None), by(&drives, Some("b")), by(&drives, Some("gone"))], [(0, true), (1, true), (0, true)]);
        let of = |name: &str, theta: f64| recording(name, "launch", theta, 50);
        let benches = [of("cold", 20.0), of("warm", 50.0), of("hot", 90.0)];
        assert_eq!([by(&benches, None), by(&benches[..2], None), by(&benches[..2], Some("cold"))], [(1, false), (1, false), (0, false)]);
    }

    #[test]
    fn of_drives_the_last_engagement_of_the_longest_judges_and_what_came_before_teaches() {
        let all = [drive("short", 1), drive("long", 3), drive("as long", 3), drive("medium", 2)];
        let split = split(&all, None);
        assert_eq!((split.judge, split.last_engagement), (1, true));
        assert_eq!(split.name, "the engagement at 7.0 s of long");
        assert_eq!(names(&split), ["short", "long", "as long", "medium"]);
        let rows = |r: &Recording| {
            let columns = [&r.time, &r.omega_f, &r.omega_c, &r.t_e, &r.x_to_cmd, &r.theta_h, r.x_to.as_ref().unwrap()];
            assert!(columns.iter().all(|c| c.len() == columns[0].len()) && r.brake.as_ref().unwrap().len() == columns[0].len());
            columns[0].len()
        };
        assert_eq!(split.fitted_part.iter().map(rows).collect::<Vec<_>>(), [300, 700, 900, 600]);
        // If all drives have a single engagement, one of them is held out as a whole.
        let single = super::split(&[drive("a", 1), drive("b", 1)], None);
        assert_eq!((single.judge, single.last_engagement, names(&single)), (1, false, vec!["a"]));
    }
}
