//! Time lines of drives: both speeds over the whole drive, with the phases of the clutch, the brakes and the replayed engagements.

use super::chart::{Scale, path, range};
use super::text::plain;
use super::{Drive, Input, laws};
use std::fmt::Write as _;

/// Number of points of a curve.
const POINTS: usize = 400;
/// Number of drives shown at once; further ones are folded.
const AT_ONCE: usize = 6;
/// Top and height of the bars of engagements and brakes, in user units.
const ENGAGED: (f64, f64) = (9.0, 5.0);
const BRAKED: (f64, f64) = (182.0, 6.0);

/// Time lines of all drives; empty if there is none.
pub fn section(input: &Input) -> String {
    if input.drives.is_empty() {
        return String::new();
    }
    let figures: Vec<String> = input.drives.iter().map(figure).collect();
    let (first, rest) = figures.split_at(figures.len().min(AT_ONCE));
    let more = if rest.is_empty() {
        String::new()
    } else {
        format!("<details><summary>{} more drives</summary><div class=\"figures\">{}</div></details>\n", rest.len(), rest.concat())
    };
    format!(
        "<h3>Drives from beginning to end</h3>\n<p class=\"states\"><span class=\"s0\">open</span> <span class=\"s1\">slipping</span> <span class=\"s2\">locked</span></p>\n\
         <p class=\"note\">Solid: speed of the flywheel; dashed: of the disc, as measured. Bars above: engagements that are replayed freely, those held out in orange. Bars below: the brakes are on. \
         Phases are as the speeds show them; what took no part in the fit has none.</p>\n<div class=\"figures\">{}</div>\n{more}",
        first.concat()
    )
}

fn figure(drive: &Drive) -> String {
    let begin = drive.time.first().copied().unwrap_or(0.0);
    let end = drive.time.last().copied().unwrap_or(1.0).max(begin + 1e-3);
    let x = Scale { low: begin, high: end, a: laws::LEFT, b: 512.0 };
    let (low, high) = range(drive.speeds.iter().flatten());
    let y = Scale { low, high, a: 180.0, b: 18.0 };
    let bar = |class: &str, [from, to]: [f64; 2], (top, height): (f64, f64)| {
        format!(
            "<rect class=\"{class}\" x=\"{:.1}\" width=\"{:.1}\" y=\"{top}\" height=\"{height}\"/>",
            x.at(from),
            (x.at(to) - x.at(from)).max(0.5)
        )
    };
    let mut drawing = String::new();
    for (span, phase) in &drive.phases {
        drawing += &bar(["s0", "s1", "s2"][usize::from(*phase)], *span, (y.b, y.a - y.b));
    }
    drawing += &laws::frame(&x, &y, "time, s");
    for (span, held_out) in &drive.engagements {
        drawing += &bar(if *held_out { "engaged held" } else { "engaged" }, *span, ENGAGED);
    }
    for span in &drive.braked {
        drawing += &bar("braked", *span, BRAKED);
    }
    let step = drive.time.len().div_ceil(POINTS).max(1);
    let kept: Vec<usize> = (0..drive.time.len()).step_by(step).collect();
    for (class, values) in ["drive-f", "drive-c"].into_iter().zip(&drive.speeds) {
        let line = path(kept.iter().map(|&k| (x.at(drive.time[k]), y.at(values[k]))));
        write!(drawing, "<path class=\"{class}\" d=\"{line}\"/>").expect("a String takes any text");
    }
    let mut csv = "time s,omega_f rad/s,omega_c rad/s,brake\n".to_owned();
    for k in kept {
        let t = drive.time[k];
        let on = drive.braked.iter().any(|[from, to]| (*from..*to).contains(&t));
        let [f, c] = [0, 1].map(|side| if drive.speeds[side][k].is_finite() { plain(drive.speeds[side][k], 5) } else { String::new() });
        writeln!(csv, "{},{f},{c},{}", plain(t, 6), u8::from(on)).expect("a String takes any text");
    }
    let count = drive.engagements.len();
    let note = format!("{count} engagement{}", if count == 1 { "" } else { "s" });
    laws::figure(&format!("{} from beginning to end", drive.recording), "rad/s", &drawing, &csv, &note)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drive(name: &str) -> Drive {
        Drive {
            recording: name.to_owned(),
            time: (0..=100).map(|k| 0.1 * f64::from(k)).collect(),
            speeds: [vec![100.0; 101], vec![f64::NAN; 101]],
            phases: vec![([0.0, 2.5], 0), ([2.5, 5.0], 1), ([5.0, 10.0], 2)],
            braked: vec![[0.0, 1.0], [9.0, 10.0]],
            engagements: vec![([1.0, 5.0], false), ([5.0, 9.0], true)],
        }
    }

    #[test]
    fn a_drive_shows_its_phases_brakes_and_engagements() {
        let d = serde_json::json!({});
        let drives = [drive("r<1")];
        let html = section(&Input { drives: &drives, ..Input::empty(&d) });
        let count = |what: &str| html.matches(what).count();
        assert_eq!((count("rect class=\"s0\""), count("rect class=\"s1\""), count("rect class=\"s2\"")), (1, 1, 1));
        assert_eq!((count("rect class=\"braked\""), count("rect class=\"engaged\""), count("rect class=\"engaged held\"")), (2, 1, 1));
        // 10 s are drawn on 452 units from 60 on.
        assert!(html.contains("rect class=\"s1\" x=\"173.0\" width=\"113.0\"") && html.contains("2 engagements"));
        assert!(html.contains("r&lt;1 from") || html.contains("r&amp;lt;1 from"));
        assert!(!html.contains("NaN") && html.contains("\n9,100,,1\n") && html.contains("\n5,100,,0\n"));
        assert!(section(&Input::empty(&d)).is_empty());
        let many: Vec<Drive> = (0..9).map(|k| drive(&format!("r{k}"))).collect();
        assert!(section(&Input { drives: &many, ..Input::empty(&d) }).contains("3 more drives"));
    }
}
