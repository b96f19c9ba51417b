//! A survey as a picture: both speeds with the gears that were found, their difference, and the torque.

use super::Survey;
use crate::campaign::LogChannel;
use crate::plots::chart::{Panel, Series, render};

/// Largest number of points in a line; more would only make the file large.
const POINTS: usize = 3000;

/// Number of letters for which the legend has room.
const LEGEND: usize = 22;

/// The picture as SVG; `None` without both speeds.
pub fn svg(s: &Survey) -> Option<String> {
    let (engine, road) = (&s.log.channels[s.engine?], &s.log.channels[s.road?]);
    // Ratio at a time, from the engagement to which it belongs: one lasts from its slip to the slip of the next.
    let gear_at = |t: f64| s.engagements.iter().rev().find(|e| t >= e.from).or(s.engagements.first()).map(|e| s.gears.factor(e.gear));
    let disc: Vec<(f64, f64)> = line(road).into_iter().filter_map(|(t, v)| Some((t, gear_at(t)? * v))).collect();
    let slip: Vec<(f64, f64)> = disc.iter().map(|&(t, c)| (t, engine.trace().at(t) - c)).collect();
    let series = |name: &str, points: Vec<(f64, f64)>| Series { name: name.to_string(), points, dashed: false };
    let panel = |y: &str, series: Vec<Series>| Panel { x_label: "time [s]".into(), y_label: y.into(), series };
    let mut speeds = vec![series("engine", line(engine)), series("behind the clutch × ratio", disc)];
    let top = engine.values.iter().copied().fold(0.0, f64::max);
    let met = s.engagements.iter().flat_map(|e| [(e.met, 0.0), (e.met, top), (e.met, f64::NAN)]).collect();
    speeds.push(Series { dashed: true, ..series("speeds meet", met) });
    let mut panels = vec![panel("speed [rad/s]", speeds), panel("slip [rad/s]", vec![series("engine less disc", slip)])];
    if !s.torques.is_empty() {
        let lines = s.torques.iter().take(3).map(|t| &s.log.channels[t.channel]).map(|c| series(&escaped(&shortened(&c.name)), line(c)));
        panels.push(panel("torque [N·m]", lines.collect()));
    }
    panels.retain(|p| p.series.iter().any(|s| !s.points.is_empty()));
    Some(render(&escaped(&s.log.file), &panels))
}

fn line(c: &LogChannel) -> Vec<(f64, f64)> {
    let step = c.values.len().div_ceil(POINTS).max(1);
    c.time.iter().copied().zip(c.values.iter().copied()).step_by(step).collect()
}

/// Shortens a name to the legend's room by keeping its beginning and its end.
fn shortened(name: &str) -> String {
    let letters: Vec<char> = name.chars().collect();
    if letters.len() <= LEGEND {
        return name.to_string();
    }
    let half = LEGEND / 2;
    let (begin, end) = (&letters[..half], &letters[letters.len() + 1 - half..]);
    begin.iter().chain(&['…']).chain(end).collect()
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_name_keeps_its_beginning_and_its_end() {
        assert_eq!(shortened("engine_torque_nm"), "engine_torque_nm");
        let short = shortened("transmission_input_torque_nm");
        assert_eq!((short.as_str(), short.chars().count()), ("transmissio…_torque_nm", LEGEND));
    }
}
