//! Refuses values that cannot be in the unit that they claim, and channels that carry no information.
//!
//! The bounds are far outside what a road vehicle with a dry clutch reaches, so that only a wrong unit or a wrong channel exceeds them.
//!
//! | channel | refused | taken for |
//! |---|---|---|
//! | speeds | magnitude above 1500 rad/s, or more than half of the samples above 600 rad/s (5700 rpm) | rpm |
//! | flywheel speed | never above 40 rad/s (380 rpm), below any idle | revolutions per second |
//! | flywheel speed | more than half of the samples at or below -1 rad/s | a wrong sign |
//! | torques | magnitude above 3000 N·m | N·mm |
//! | engine torque | changes, but its magnitude never reaches 0.5 N·m | kN·m |
//! | positions | positive somewhere, but the magnitude never reaches 0.05 mm | m |
//! | positions | magnitude above 60 mm | percent of the travel up to 150, µm from 1000 on, otherwise a wrong channel |
//! | temperatures | above 200 °C in the housing; a disc that starts 253 to 293 K above its stated start temperature | K |
//! | temperatures | below -60 °C | a wrong channel |
//! | flags | below 0 or above 1 | a wrong channel |

use super::Recording;
use super::channel_map::ChannelMap;
use super::channels::Channel;
use super::clock::valid;
use super::error::{Defect, RecordingError};
use super::manifest::Entry;
use super::pick::Signal;
use super::table::Measurement;

/// Refuses a channel whose unit can't be right.
pub(crate) fn plausible(m: &Measurement, signal: &Signal, map: &ChannelMap, entry: &Entry) -> Result<(), RecordingError> {
    let Some(range) = Range::of(signal) else { return Ok(()) };
    let found = match signal.channel {
        Channel::OmegaF | Channel::OmegaC => speed(signal, &range),
        Channel::TE | Channel::TFc => torque(signal.channel, &range),
        Channel::XToCmd | Channel::XTo => position(&range),
        Channel::ThetaH => housing(&range),
        Channel::ThetaC => entry.theta_0.map_or_else(|| too_cold(&range), |[theta_c0, _]| disc(&range, theta_c0)),
        Channel::Brake | Channel::Valid => flag(&range),
        Channel::Time => None,
    };
    match found {
        None => Ok(()),
        Some((sample, what, taken_for)) => {
            let column = signal.channel.spec().column;
            let ratio = map.get(signal.channel).and_then(|mapped| mapped.ratio);
            let remedy = match (taken_for, ratio) {
                (Some(_), Some(ratio)) => format!(
                    "The ratio of {ratio} was applied to it: check that first. It is gear times final drive, and stays out where the channel is the disc's own speed. Then check the unit in the channel map"
                ),
                (Some(PERCENT), _) => format!(
                    "It looks like percent of the travel: give scale and offset in a channel map, e.g. {column} = {{ name = \"…\", scale = 0.08, offset = 0.0 }}, where scale is the bearing's travel in mm per percent and offset its position in mm at 0 %"
                ),
                (Some(unit), _) => {
                    format!("It looks like {unit}: say so in a channel map, e.g. {column} = {{ name = \"…\", unit = \"{unit}\" }}")
                }
                (None, _) => "Check that it is the right channel, and its scale, offset and sign in the channel map".to_string(),
            };
            Err(m.defect_at(Defect::UnitCannotBeRight { what, remedy }, &signal.label, Some(sample)))
        }
    }
}

/// Apparent unit of a position that runs from 0 to 100. It is no unit of length, so that the channel map needs a scale.
const PERCENT: &str = "%";

/// Index of the sample, what is wrong, and the unit that the values seem to be in.
type Suspicion = Option<(usize, String, Option<&'static str>)>;

struct Range {
    first: (usize, f64),
    min: (usize, f64),
    max: (usize, f64),
}

impl Range {
    fn of(signal: &Signal) -> Option<Range> {
        let mut points = valid(&signal.time, &signal.values).map(|(i, _, v)| (i, v));
        let first = points.next()?;
        let mut range = Range { first, min: first, max: first };
        for point in points {
            if point.1 < range.min.1 {
                range.min = point;
            }
            if point.1 > range.max.1 {
                range.max = point;
            }
        }
        Some(range)
    }

    /// The sample of greatest magnitude.
    fn peak(&self) -> (usize, f64) {
        if -self.min.1 > self.max.1 { self.min } else { self.max }
    }
}

fn speed(signal: &Signal, range: &Range) -> Suspicion {
    let (at, peak) = range.peak();
    if peak.abs() > 1500.0 {
        return Some((at, format!("{} rad/s would be {:.0} rpm", short(peak), rpm(peak)), Some("rpm")));
    }
    let above = |limit: f64| valid(&signal.time, &signal.values).filter(|(_, _, v)| *v > limit).count();
    let half = valid(&signal.time, &signal.values).count().div_ceil(2);
    if peak > 600.0 && above(600.0) > half {
        return Some((at, format!("most samples lie above 600 rad/s ({:.0} rpm)", rpm(600.0)), Some("rpm")));
    }
    if signal.channel == Channel::OmegaF {
        if above(-1.0) < half {
            return Some((range.min.0, format!("the engine would turn backwards at {} rad/s", short(range.min.1)), None));
        }
        let (at, fastest) = range.max;
        if fastest < 40.0 {
            return Some((at, format!("the engine would never turn faster than {:.0} rpm", rpm(fastest)), Some("Hz")));
        }
    }
    None
}

fn rpm(rad_s: f64) -> f64 {
    rad_s * 30.0 / std::f64::consts::PI
}

fn torque(channel: Channel, range: &Range) -> Suspicion {
    let (at, peak) = range.peak();
    if peak.abs() > 3000.0 {
        return Some((at, format!("{} N·m is more than a dry clutch carries", short(peak)), Some("N·mm")));
    }
    // Clutch torque is not checked here: the clutch may be open throughout and transmit nothing, whereas the engine needs torque to keep itself turning.
    let idle = channel == Channel::TE && peak.abs() < 0.5 && range.max.1 > range.min.1;
    idle.then(|| (at, format!("the engine torque never exceeds {} N·m", short(peak)), Some("kN·m")))
}

fn position(range: &Range) -> Suspicion {
    let (at, peak) = range.peak();
    if peak.abs() < 0.05 && range.max.1 > 0.0 {
        return Some((at, format!("the bearing would never be beyond {} mm", short(peak)), Some("m")));
    }
    let looks_like = match peak {
        p if p.abs() >= 1000.0 => Some("um"),
        p if (0.0..150.0).contains(&p) => Some(PERCENT),
        _ => None,
    };
    (peak.abs() > 60.0).then(|| (at, format!("{} mm is no travel of a throwout bearing", short(peak)), looks_like))
}

fn housing(range: &Range) -> Suspicion {
    if range.max.1 > 200.0 {
        return Some((range.max.0, format!("{} °C is no air temperature", short(range.max.1)), Some("K")));
    }
    too_cold(range)
}

fn disc(range: &Range, theta_c0: f64) -> Suspicion {
    let (at, start) = range.first;
    if (start - theta_c0 - 273.15).abs() < 20.0 {
        return Some((at, format!("it starts at {} °C where recordings.json says theta_c0_degC = {theta_c0}", short(start)), Some("K")));
    }
    too_cold(range)
}

fn too_cold(range: &Range) -> Suspicion {
    (range.min.1 < -60.0).then(|| (range.min.0, format!("{} °C is colder than any road", short(range.min.1)), None))
}

fn flag(range: &Range) -> Suspicion {
    let off = if range.min.1 < 0.0 { range.min } else { range.max };
    (!(0.0..=1.0).contains(&off.1)).then(|| (off.0, format!("{} is neither 0 nor 1", off.1), None))
}

/// Formats a value with up to four decimals, without trailing zeros.
fn short(value: f64) -> String {
    format!("{value:.4}").trim_end_matches('0').trim_end_matches('.').to_string()
}

/// Refuses a recording whose speeds or inputs never change; drops a bench position or torque that never changes while the command is not constant.
pub(crate) fn check_information(
    file: &str,
    label: impl Fn(Channel) -> String,
    recording: &mut Recording,
    notes: &mut Vec<String>,
) -> Result<(), RecordingError> {
    let at = |defect: Defect, channel| Err(defect.at(file, label(channel), None));
    if let Some(value) = constant(&recording.omega_f) {
        return at(Defect::Frozen { value }, Channel::OmegaF);
    }
    // With the clutch open and the car at rest, a noise-free sensor reads 0 throughout.
    if let Some(value) = constant(&recording.omega_c).filter(|v| *v != 0.0 || recording.manoeuvre != "open_rev") {
        return at(Defect::Frozen { value }, Channel::OmegaC);
    }
    let command = constant(&recording.x_to_cmd);
    if command.is_some() && constant(&recording.t_e).is_some() {
        let both = format!("{} and {}", label(Channel::TE), label(Channel::XToCmd));
        return Err(Defect::ConstantInput.at(file, both, None));
    }
    if let Some(value) = command.filter(|_| matches!(recording.manoeuvre.as_str(), "launch" | "creep" | "modulate")) {
        let defect = Defect::ConstantCommand { value, manoeuvre: recording.manoeuvre.clone() };
        return at(defect, Channel::XToCmd);
    }
    if let Some(value) = constant(&recording.t_e) {
        notes.push(format!("{}: the value is {} in every sample; check that the channel was connected", label(Channel::TE), short(value)));
    }
    let moving = command.is_none();
    for (channel, series) in [(Channel::XTo, &mut recording.x_to), (Channel::TFc, &mut recording.t_fc)] {
        if let Some(value) = series.as_deref().and_then(constant).filter(|_| moving) {
            notes.push(format!("{}: the value is {value} in every sample; the channel is not used", label(channel)));
            *series = None;
        }
    }
    Ok(())
}

/// The value of a series whose valid samples are all equal.
pub(super) fn constant(values: &[f64]) -> Option<f64> {
    let mut there = values.iter().copied().filter(|v| !v.is_nan());
    let first = there.next()?;
    there.all(|v| v == first).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::rc::Rc;

    fn told(channel: Channel, values: &[f64], theta_0: Option<[f64; 2]>) -> Option<String> {
        let time = Rc::new((0..values.len()).map(|k| 0.01 * k as f64).collect());
        let signal = Signal { channel, label: "it".into(), time, values: values.to_vec() };
        let map = ChannelMap::default();
        plausible(&Measurement::default(), &signal, &map, &Entry { theta_0, ..Entry::default() }).err().map(|e| e.to_string())
    }

    /// Tests each bound of the table from both sides: sample, what is wrong, and the unit that the values seem to be in.
    #[test]
    fn bounds_lie_where_the_table_has_them() {
        use Channel::{Brake, OmegaC, OmegaF, TE, TFc, ThetaC, ThetaH, Time, XTo, XToCmd};
        type Told = (usize, &'static str, &'static str);
        const SOUND: Told = (0, "", "");
        let cases: &[(Channel, &[f64], Told)] = &[
            (OmegaF, &[100.0, 1500.0], SOUND),
            (OmegaF, &[100.0, 1501.0, 1501.0], (2, "1501 rad/s would be 14333 rpm", "rpm")),
            (OmegaC, &[100.0, 0.0, -1501.0], (3, "-1501 rad/s would be -14333 rpm", "rpm")),
            (OmegaF, &[700.0, 700.0, 100.0, 100.0], SOUND),
            (OmegaF, &[600.0, 600.0, 600.0, 601.0], SOUND),
            (OmegaF, &[700.0, f64::NAN, 710.0, 720.0, 100.0], (4, "most samples lie above 600 rad/s (5730 rpm)", "rpm")),
            (OmegaF, &[-1.0, -50.0, -50.0, 100.0], (2, "the engine would turn backwards at -50 rad/s", "sign in the channel map")),
            (OmegaF, &[-50.0, -50.0, 100.0, 100.0], SOUND),
            (OmegaC, &[-50.0, -50.0, -50.0, 10.0], SOUND),
            (OmegaF, &[30.0, 39.0], (2, "the engine would never turn faster than 372 rpm", "Hz")),
            (OmegaF, &[30.0, 40.0], SOUND),
            (TE, &[0.0, 3000.0], SOUND),
            (TE, &[0.0, 3001.0, -3001.0], (2, "3001 N·m is more than a dry clutch carries", "N·mm")),
            (TFc, &[0.0, -3001.0], (2, "-3001 N·m", "N·mm")),
            (TE, &[0.1, 0.4], (2, "the engine torque never exceeds 0.4 N·m", "kN·m")),
            (TE, &[0.1, 0.5], SOUND),
            (TE, &[0.4, 0.4], SOUND),
            (TFc, &[0.1, 0.4], SOUND),
            (XToCmd, &[0.01, 0.04], (2, "the bearing would never be beyond 0.04 mm", "m")),
            (XTo, &[0.01, 0.05], SOUND),
            (XTo, &[0.0, 0.0], SOUND),
            (XTo, &[0.0, 60.0], SOUND),
            (XTo, &[0.0, 101.6], (2, "101.6 mm is no travel", "percent of the travel")),
            (XTo, &[0.0, 400.0], (2, "400 mm is no travel", "sign in the channel map")),
            (XTo, &[0.0, 4021.3], (2, "4021.3 mm is no travel", "um")),
            (XTo, &[0.0, -101.0], (2, "-101 mm is no travel", "sign in the channel map")),
            (ThetaH, &[-60.0, 200.0], SOUND),
            (ThetaH, &[20.0, 201.0], (2, "201 °C is no air temperature", "K")),
            (ThetaH, &[20.0, -61.0], (2, "-61 °C is colder than any road", "sign in the channel map")),
            (ThetaC, &[20.0, 290.0], SOUND),
            (ThetaC, &[20.0, -61.0, -61.0], (2, "-61 °C", "sign in the channel map")),
            (Brake, &[0.0, 1.0], SOUND),
            (Brake, &[0.0, 1.5], (2, "1.5 is neither 0 nor 1", "sign in the channel map")),
            (Brake, &[0.0, -0.5, 2.0], (2, "-0.5 is neither", "sign in the channel map")),
            (Time, &[1e9], SOUND),
            (OmegaF, &[f64::NAN], SOUND),
        ];
        for (channel, values, (row, what, looks_like)) in cases {
            match told(*channel, values, None) {
                None => assert_eq!(*row, 0, "{channel:?} {values:?}"),
                Some(text) => {
                    let unit = if looks_like.contains(' ') { (*looks_like).to_owned() } else { format!("It looks like {looks_like}: ") };
                    assert!(text.contains(&format!("row {row}:")) && text.contains(what) && text.contains(&unit), "{values:?}: {text}");
                }
            }
        }
    }

    #[test]
    fn a_ratio_that_was_applied_is_doubted_first() {
        let time = Rc::new(vec![0.0, 0.01]);
        let signal = Signal { channel: Channel::OmegaC, label: "it".into(), time, values: vec![0.0, 1_793.100_000_000_000_1] };
        let map = ChannelMap::default().with_ratio(12.0);
        let said = plausible(&Measurement::default(), &signal, &map, &Entry::default()).unwrap_err().to_string();
        assert!(said.contains("1793.1 rad/s would be 17123 rpm. The ratio of 12 was applied to it"), "{said}");
    }

    #[test]
    fn a_disc_that_starts_273_degrees_from_what_is_stated_is_in_kelvin() {
        let cold = Some([20.0, 60.0]);
        for (start, kelvin) in [(273.0, false), (273.3, true), (293.0, true), (313.0, true), (313.3, false)] {
            let told = told(Channel::ThetaC, &[start, 400.0], cold);
            assert_eq!(told.is_some(), kelvin, "{told:?}");
            assert!(
                told.is_none_or(|t| t.contains(&format!("starts at {start} °C"))
                    && t.contains("theta_c0_degC = 20")
                    && t.contains("like K:"))
            );
        }
        assert!(told(Channel::ThetaC, &[20.0, -61.0], cold).unwrap().contains("colder"));
    }

    fn shown(manoeuvre: &str, change: impl Fn(&mut Recording)) -> (Result<(), String>, Recording, Vec<String>) {
        let ramp: Vec<f64> = (0..4).map(f64::from).collect();
        let (mut recording, mut notes) = (Recording { manoeuvre: manoeuvre.into(), ..Recording::default() }, Vec::new());
        for series in [&mut recording.omega_f, &mut recording.omega_c, &mut recording.t_e, &mut recording.x_to_cmd] {
            *series = ramp.clone();
        }
        change(&mut recording);
        let said = check_information("r.csv", |c| c.spec().column.to_owned(), &mut recording, &mut notes).map_err(|e| e.to_string());
        (said, recording, notes)
    }

    #[test]
    fn channels_that_never_change_are_told_from_those_that_may_not() {
        let frozen = || vec![2.0, f64::NAN, 2.0, 2.0];
        let refused = |manoeuvre: &str, change: &dyn Fn(&mut Recording)| shown(manoeuvre, change).0.err().unwrap_or_default();
        assert!(refused("drive", &|r| r.omega_f = frozen()).contains("omega_f_rad_s: the value is 2 "));
        assert!(refused("drive", &|r| r.omega_c = frozen()).contains("omega_c_rad_s: the value is 2 "));
        // A disc speed of 0 throughout is accepted in an `open_rev` only.
        assert!(refused("drive", &|r| r.omega_c.fill(0.0)).contains("omega_c_rad_s"));
        assert!(refused("open_rev", &|r| r.omega_c = frozen()).contains("omega_c_rad_s"));
        assert_eq!(refused("open_rev", &|r| r.omega_c.fill(0.0)), "");
        // One input may be constant, but not both, and no launch, creep or modulation has a constant command.
        assert_eq!(refused("drive", &|r| r.t_e = frozen()), "");
        assert!(shown("drive", |r| r.t_e = frozen()).2[0].starts_with("T_e_Nm: the value is 2 in every sample"));
        assert_eq!(refused("drive", &|r| r.x_to_cmd = frozen()), "");
        assert!(refused("drive", &|r| (r.t_e, r.x_to_cmd) = (frozen(), frozen())).contains("T_e_Nm and x_to_cmd_mm: constant input"));
        for manoeuvre in ["launch", "creep", "modulate"] {
            assert!(refused(manoeuvre, &|r| r.x_to_cmd = frozen()).contains(&format!("2 mm throughout, which is no {manoeuvre}")));
        }
        // A bench channel that is constant while the command changes is dropped; it is kept if the command is constant as well.
        let (said, r, notes) = shown("drive", |r| (r.x_to, r.t_fc) = (Some(frozen()), Some(vec![1.0, 2.0, 3.0, 4.0])));
        assert!(
            said.is_ok() && r.x_to.is_none() && r.t_fc.is_some() && notes.len() == 1 && notes[0].starts_with("x_to_mm: the value is 2")
        );
        let (said, r, notes) = shown("drive", |r| (r.x_to_cmd, r.t_fc) = (frozen(), Some(frozen())));
        assert!(said.is_ok() && r.t_fc.is_some() && notes.is_empty());
    }
}
