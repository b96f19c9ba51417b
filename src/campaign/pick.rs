//! Finds each of our channels in a file and converts it to our unit.
//!
//! Without a map entry a channel is found by the contract's column (`omega_f_rad_s`), or by that name without its unit (`omega_f`) if the file states
//! a unit. The unit is the first of these that applies:
//!
//! 1. `scale` or `offset` in the map: value · scale + offset is in the map's `unit`, or in ours if the map states none; the file's unit is ignored.
//! 2. `unit` in the map; a file that states another one is refused as contradictory.
//! 3. the unit that the file states; a column whose name implies another one is refused as contradictory.
//! 4. percent, if the map has a `reference_Nm`; for a road speed (`tyre_radius_m`) no unit can be assumed.
//! 5. our unit.

use std::rc::Rc;

use super::channel_map::{ChannelMap, Mapped, TorqueKind};
use super::channels::{CHANNELS, Channel, Presence, Spec};
use super::error::{Defect, RecordingError};
use super::table::{Group, Measurement, Series};
use super::units::{self, Quantity, Unit};

/// One of our channels as found in a file, in our unit, with its clock.
#[derive(Clone, Debug)]
pub(crate) struct Signal {
    /// Which channel.
    pub channel: Channel,
    /// Its name in messages.
    pub label: String,
    /// Time of each sample, s.
    pub time: Rc<Vec<f64>>,
    /// Samples, NaN where missing.
    pub values: Vec<f64>,
}

/// All channels that the file holds, including every required one, and notes on what was converted.
pub(crate) struct Picked {
    pub signals: Vec<Signal>,
    pub notes: Vec<String>,
}

/// Whether a reader has to decode a series of this name.
pub(crate) fn wanted(map: &ChannelMap, name: &str) -> bool {
    CHANNELS.iter().any(|spec| candidate(spec, map.get(spec.channel), name))
}

/// Picks every channel; a required one that is missing is a defect.
pub(crate) fn pick(m: &mut Measurement, map: &ChannelMap) -> Result<Picked, RecordingError> {
    let mut found = Vec::new();
    for spec in &CHANNELS[1..] {
        match find(m, spec, map)? {
            _ if constant(spec, map).is_some() => {}
            Some(place) => found.push((spec, place)),
            None if spec.presence == Presence::Always => return Err(missing(m, spec, map)),
            None => {}
        }
    }
    for (i, (spec, place)) in found.iter().enumerate() {
        if let Some((other, _)) = found[..i].iter().find(|(_, p)| p == place) {
            let label = label(&m.groups[place.0].series[place.1], spec);
            return Err(m.defect_at(Defect::TakenTwice(other.column), &label, None));
        }
    }
    let mut notes = Vec::new();
    let mut clocks: Vec<Option<Rc<Vec<f64>>>> = vec![None; m.groups.len()];
    for &(_, (group, _)) in &found {
        if clocks[group].is_none() {
            clocks[group] = Some(Rc::new(clock(m, group, map, &mut notes)?));
        }
    }
    let mut signals = Vec::new();
    for (spec, (group, at)) in found {
        let time = clocks[group].clone().expect("every group that is used got its clock");
        let label = label(&m.groups[group].series[at], spec);
        let values = convert(m, group, at, spec, map, &mut notes)?;
        signals.push(Signal { channel: spec.channel, label, time, values });
    }
    // A constant has a sample at every stamp of the flywheel speed.
    let clock = signals.iter().find(|s| s.channel == Channel::OmegaF).map(|s| s.time.clone()).unwrap_or_default();
    for (spec, value) in CHANNELS.iter().filter_map(|spec| Some((spec, constant(spec, map)?))) {
        notes.push(format!("{}: {value} {} throughout, as the channel map says", spec.column, spec.unit));
        let values = vec![value; clock.len()];
        signals.push(Signal { channel: spec.channel, label: spec.column.to_string(), time: clock.clone(), values });
    }
    if map.get(Channel::TE).is_some_and(|m| m.kind == Some(TorqueKind::Indicated)) {
        notes.push("T_e_Nm: indicated torque, as the channel map says: b_f has to hold the engine's friction and accessories".to_string());
    }
    Ok(Picked { signals, notes })
}

/// The constant that the map gives in place of a channel.
fn constant(spec: &Spec, map: &ChannelMap) -> Option<f64> {
    map.get(spec.channel)?.value
}

/// Group and index of the one series that belongs to a channel.
fn find(m: &Measurement, spec: &Spec, map: &ChannelMap) -> Result<Option<(usize, usize)>, RecordingError> {
    let entry = map.get(spec.channel);
    let all = m
        .groups
        .iter()
        .enumerate()
        .filter(|(_, g)| in_group(g, entry))
        .flat_map(|(i, g)| g.series.iter().enumerate().filter(|(at, _)| g.master != Some(*at)).map(move |(at, s)| ((i, at), s)));
    let all: Vec<((usize, usize), &Series)> = all.filter(|(_, s)| candidate(spec, entry, &s.name)).collect();
    // The full column name takes precedence over the name without a unit.
    let exact: Vec<_> = all.iter().filter(|(_, s)| s.name == wanted_name(spec, entry)).collect();
    let named_alone = |s: &Series| entry.is_some() || s.unit.is_some() || s.name.eq_ignore_ascii_case(spec.column);
    let chosen: Vec<_> = if exact.is_empty() { all.iter().filter(|(_, s)| named_alone(s)).collect() } else { exact };
    match chosen.as_slice() {
        [] => Ok(None),
        [(place, _)] => Ok(Some(*place)),
        several => {
            let places: Vec<String> = several.iter().map(|((g, at), s)| m.place(*g, *at, s)).collect();
            let defect = Defect::DuplicateChannel { count: several.len(), places: places.join(", ") };
            Err(m.defect_at(defect, &label(several[0].1, spec), None))
        }
    }
}

fn in_group(group: &Group, entry: Option<&Mapped>) -> bool {
    let Some(wanted) = entry.and_then(|e| e.group.as_deref()) else { return true };
    group.name == wanted || wanted.parse() == Ok(group.index)
}

/// The name that is looked for, as given in messages.
fn wanted_name<'a>(spec: &'a Spec, entry: Option<&'a Mapped>) -> &'a str {
    entry.and_then(|e| e.name.as_deref()).unwrap_or(spec.column)
}

fn candidate(spec: &Spec, entry: Option<&Mapped>, name: &str) -> bool {
    match entry.and_then(|e| e.name.as_deref()) {
        Some(wanted) => wanted == name || units::split_header(wanted).0 == name,
        None => name.eq_ignore_ascii_case(spec.column) || name.eq_ignore_ascii_case(spec.stem),
    }
}

fn missing(m: &Measurement, spec: &Spec, map: &ChannelMap) -> RecordingError {
    let names: Vec<String> = m.names.iter().take(20).cloned().collect();
    let more = if m.names.len() > 20 { format!(" and {} more", m.names.len() - 20) } else { String::new() };
    let there = if names.is_empty() { "no channel".to_string() } else { format!("{}{more}", names.join(", ")) };
    let wanted = wanted_name(spec, map.get(spec.channel)).to_string();
    m.defect_at(Defect::MissingChannel { column: spec.column, unit: spec.unit, wanted, there }, spec.column, None)
}

/// The clock of a group: the master of an MDF group, the time column of a table. Checked and in seconds.
fn clock(m: &mut Measurement, group: usize, map: &ChannelMap, notes: &mut Vec<String>) -> Result<Vec<f64>, RecordingError> {
    let spec = Channel::Time.spec();
    let at = match m.groups[group].master {
        Some(at) => at,
        None => match find_in(m, group, spec, map) {
            Some(at) => at,
            None if m.groups.len() > 1 => {
                let name = m.groups[group].name.clone();
                return Err(m.defect_at(Defect::NoMaster, &format!("group `{name}`"), None));
            }
            None => return Err(missing(m, spec, map)),
        },
    };
    let label = label(&m.groups[group].series[at], spec);
    let time = convert(m, group, at, spec, map, notes)?;
    super::clock::check(&time).map_err(|(defect, sample)| m.defect_at(defect, &label, Some(sample)))?;
    Ok(time)
}

fn find_in(m: &Measurement, group: usize, spec: &Spec, map: &ChannelMap) -> Option<usize> {
    let entry = map.get(spec.channel);
    let series = &m.groups[group].series;
    series.iter().position(|s| s.name == wanted_name(spec, entry)).or_else(|| {
        let fits = |s: &Series| {
            candidate(spec, entry, &s.name) && (entry.is_some() || s.unit.is_some() || s.name.eq_ignore_ascii_case(spec.column))
        };
        series.iter().position(fits)
    })
}

/// Takes a series out of the file and converts it to our unit.
fn convert(
    m: &mut Measurement,
    group: usize,
    at: usize,
    spec: &Spec,
    map: &ChannelMap,
    notes: &mut Vec<String>,
) -> Result<Vec<f64>, RecordingError> {
    let series = std::mem::take(&mut m.groups[group].series[at].values);
    let about = &m.groups[group].series[at];
    let label = label(about, spec);
    if let Some((sample, text)) = &about.text {
        return Err(m.defect_at(Defect::NotANumber(text.clone()), &label, Some(*sample)));
    }
    let (scale, offset, said) = factors(about, spec, map.get(spec.channel)).map_err(|d| m.defect_at(d, &label, None))?;
    if scale == 1.0 && offset == 0.0 {
        return Ok(series);
    }
    notes.push(format!("{label}: {said} converted to {}", spec.unit));
    Ok(series.into_iter().map(|v| v * scale + offset).collect())
}

/// Factor and offset to our unit, and a text on what they are derived from.
fn factors(series: &Series, spec: &Spec, entry: Option<&Mapped>) -> Result<(f64, f64, String), Defect> {
    let scaled = entry.filter(|e| e.scale.is_some() || e.offset.is_some());
    let in_file = series.unit.as_deref().filter(|_| scaled.is_none());
    let stated = entry.and_then(|e| e.unit.as_deref());
    let implied = if stated.or(in_file).is_none() { implied_unit(entry)? } else { None };
    if let Some(entry) = scaled {
        let stated = stated.or(implied);
        let (scale, offset) = (entry.scale.unwrap_or(1.0), entry.offset.unwrap_or(0.0));
        let unit = stated.map_or(Ok(OURS), |u| understood(u, spec, Some(entry)))?;
        let ratio = entry.ratio.unwrap_or(1.0);
        let (scale, offset) = (scale * ratio, offset * ratio);
        let said = format!("value · {scale} + {offset} {}", stated.unwrap_or(""));
        return Ok((scale * unit.factor, offset * unit.factor + unit.offset, said.trim_end().to_string()));
    }
    let ratio = entry.and_then(|e| e.ratio).unwrap_or(1.0);
    let unit = match (stated, in_file.or(implied)) {
        (Some(stated), in_file) => {
            let unit = understood(stated, spec, entry)?;
            if let Some(text) = in_file.filter(|t| understood(t, spec, entry).is_ok_and(|u| !same(u, unit))) {
                return Err(contradiction(("the channel map", stated), ("the file", text)));
            }
            unit
        }
        (None, Some(text)) => {
            let unit = understood(text, spec, entry)?;
            if series.name.eq_ignore_ascii_case(spec.column) && !same(unit, OURS) {
                let who = if implied.is_some() { "the channel map's reference_Nm" } else { "the file" };
                return Err(contradiction(("the channel's name", spec.unit), (who, text)));
            }
            unit
        }
        (None, None) => OURS,
    };
    let said = stated.or(in_file).unwrap_or(if implied.is_some() { "% (no unit is stated, and reference_Nm is of per cent)" } else { "" });
    let through = if ratio == 1.0 { said.to_string() } else { format!("{said} times a ratio of {ratio}") };
    Ok((unit.factor * ratio, unit.offset * ratio, through.trim().to_string()))
}

/// Unit that the map implies for a series for which none is stated.
///
/// # Errors
/// A road speed, which may equally well be in km/h, m/s or mph.
fn implied_unit(entry: Option<&Mapped>) -> Result<Option<&'static str>, Defect> {
    match entry {
        Some(Mapped { tyre_radius: Some(_), .. }) => Err(Defect::RoadSpeedUnit),
        Some(Mapped { reference: Some(_), .. }) => Ok(Some("%")),
        _ => Ok(None),
    }
}

/// The identity; its quantity is not used.
const OURS: Unit = Unit { quantity: units::Quantity::Time, factor: 1.0, offset: 0.0 };

fn same(a: Unit, b: Unit) -> bool {
    a.factor == b.factor && a.offset == b.offset
}

fn contradiction(first: (&'static str, &str), second: (&'static str, &str)) -> Defect {
    Defect::UnitContradiction { first: first.0, first_unit: first.1.to_string(), second: second.0, second_unit: second.1.to_string() }
}

/// A unit of the channel, or of the quantity from which the map converts it: a road speed with a tyre radius, a percentage with its reference torque.
fn understood(text: &str, spec: &Spec, entry: Option<&Mapped>) -> Result<Unit, Defect> {
    let (quantity, known) = (units::quantity_name(spec.quantity), units::examples(spec.quantity));
    let (radius, reference) = (entry.and_then(|e| e.tyre_radius), entry.and_then(|e| e.reference));
    match units::parse(text) {
        Some(unit) if unit.quantity == Quantity::Velocity && spec.quantity == Quantity::Speed => match radius {
            Some(radius) => Ok(Unit { quantity: spec.quantity, factor: unit.factor / radius, offset: 0.0 }),
            None => Err(Defect::RoadSpeed(text.to_string())),
        },
        Some(unit) if unit.quantity == Quantity::Share && spec.quantity == Quantity::Torque => match reference {
            Some(reference) => Ok(Unit { quantity: spec.quantity, factor: unit.factor * reference / 100.0, offset: 0.0 }),
            None => Err(Defect::Percentage),
        },
        None => Err(Defect::UnknownUnit { unit: text.to_string(), quantity, known }),
        Some(unit) if unit.quantity != spec.quantity => Err(Defect::WrongQuantity { unit: text.to_string(), quantity, known }),
        Some(unit) => Ok(unit),
    }
}

fn label(series: &Series, spec: &Spec) -> String {
    if series.name == spec.column { spec.column.to_string() } else { format!("{} ({})", series.name, spec.column) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(name: &str, unit: Option<&str>) -> Series {
        Series { name: name.into(), unit: unit.map(str::to_owned), values: vec![1.0, 2.0, 3.0], text: None }
    }

    fn group(name: &str, index: usize, names: &[(&str, Option<&str>)]) -> Group {
        Group { name: name.into(), index, master: None, series: names.iter().map(|(n, u)| series(n, *u)).collect() }
    }

    const NEEDED: [(&str, Option<&str>); 3] = [("omega_f_rad_s", None), ("omega_c", Some("rpm")), ("T_e_Nm", None)];

    fn picked(groups: Vec<Group>) -> Result<Picked, String> {
        let names = groups.iter().flat_map(|g| &g.series).map(|s| s.name.clone()).collect();
        pick(&mut Measurement { file: "r.mf4".into(), groups, names, ..Measurement::default() }, &ChannelMap::default())
            .map_err(|e| e.to_string())
    }

    fn with(more: &[(&'static str, Option<&'static str>)]) -> Vec<(&'static str, Option<&'static str>)> {
        NEEDED.iter().chain(more).copied().collect()
    }

    #[test]
    fn channels_are_found_by_column_or_by_name_and_unit_and_come_in_our_unit() {
        let p = picked(vec![group("", 0, &with(&[("time_s", None), ("theta_h", None)]))]).unwrap();
        let found: Vec<(Channel, f64)> = p.signals.iter().map(|s| (s.channel, s.values[2])).collect();
        // A name without its unit is not accepted if the file states no unit.
        assert_eq!(found.len(), 3);
        assert!(found[0] == (Channel::OmegaF, 3.0) && (found[1].1 - std::f64::consts::PI / 10.0).abs() < 1e-12, "{found:?}");
        assert!(p.notes.len() == 1 && p.notes[0].contains("omega_c (omega_c_rad_s): rpm converted to rad/s"), "{:?}", p.notes);
        assert!(p.signals.iter().all(|s| *s.time == [1.0, 2.0, 3.0]));
        assert!(wanted(&ChannelMap::default(), "OMEGA_F") && !wanted(&ChannelMap::default(), "omega"));
    }

    #[test]
    fn each_group_has_a_clock_of_its_own() {
        let none = picked(vec![group("", 0, &NEEDED)]).err().unwrap();
        assert!(none.contains("no channel for time_s (s)"), "{none}");
        let other = group("slow", 1, &[("gear", None), ("time_s", None)]);
        let several = picked(vec![group("fast", 0, &NEEDED), other]).err().unwrap();
        assert!(several.contains("channel group `fast`: no channel is the clock"), "{several}");
        let mut with_master = group("fast", 0, &with(&[("stamp", Some("ms"))]));
        with_master.master = Some(3);
        assert_eq!(*picked(vec![with_master]).unwrap().signals[0].time, [0.001, 0.002, 0.003]);
        let mut back = group("", 0, &with(&[("time_s", None)]));
        back.series[3].values = vec![1.0, 2.0, 1.5];
        assert!(picked(vec![back]).err().unwrap().contains("row 3: the clock runs back from 2 s to 1.5 s"));
    }

    #[test]
    fn what_is_there_twice_or_not_at_all_is_named() {
        let twice =
            picked(vec![group("a", 0, &with(&[("time_s", None)])), group("b", 4, &[("time_s", None), ("T_e_Nm", None)])]).err().unwrap();
        assert!(
            twice.contains("the name occurs 2 times") && twice.contains("`T_e_Nm` in group 0 \"a\", `T_e_Nm` in group 4 \"b\""),
            "{twice}"
        );
        let many: Vec<String> = (0..25).map(|k| format!("x{k}")).collect();
        let names: Vec<(&str, Option<&str>)> = many.iter().map(|n| (n.as_str(), None)).collect();
        let missing = picked(vec![group("", 0, &names)]).err().unwrap();
        assert!(missing.contains("x18, x19 and 5 more") && !missing.contains("x20"), "{missing}");
        assert!(picked(vec![group("", 0, &[])]).err().unwrap().contains("which has no channel"));
        assert!(picked(vec![group("", 0, &names[..20])]).err().unwrap().contains("x19. "));
    }

    #[test]
    fn units_that_contradict_each_other_are_refused() {
        let of = |name: &str, unit: Option<&str>| factors(&series(name, unit), Channel::OmegaF.spec(), None);
        assert_eq!(of("omega_f_rad_s", Some("rad/s")).unwrap().0, 1.0);
        assert!(matches!(of("omega_f_rad_s", Some("rpm")), Err(Defect::UnitContradiction { .. })));
        assert!((of("omega_f", Some("rpm")).unwrap().0 - std::f64::consts::PI / 30.0).abs() < 1e-12);
        assert!(matches!(of("omega_f", Some("V")), Err(Defect::UnknownUnit { .. })));
        assert!(matches!(of("omega_f", Some("mm")), Err(Defect::WrongQuantity { .. })));
        assert!(matches!(of("omega_f", Some("km/h")), Err(Defect::RoadSpeed(_))));
        assert!(matches!(factors(&series("T_e", Some("%")), Channel::TE.spec(), None), Err(Defect::Percentage)));
        // A percentage with a reference torque needs no stated unit; a road speed with a tyre radius does.
        let share = Mapped { reference: Some(350.0), ..Mapped::default() };
        let torque = |name: &str, unit: Option<&str>, entry: &Mapped| factors(&series(name, unit), Channel::TE.spec(), Some(entry));
        let (factor, offset, said) = torque("TqPercent", None, &share).unwrap();
        assert!((factor, offset) == (3.5, 0.0) && said.starts_with("% (no unit is stated"), "{factor}, {offset}, {said}");
        assert_eq!(torque("TqPercent", Some("Nm"), &share).unwrap().0, 1.0, "the file says what it holds");
        assert!(matches!(torque("T_e_Nm", None, &share), Err(Defect::UnitContradiction { second: "the channel map's reference_Nm", .. })));
        let counts = Mapped { scale: Some(0.5), ..share };
        assert_eq!(torque("TqCounts", Some("V"), &counts).unwrap().0, 0.5 * 3.5);
        let road = Mapped { tyre_radius: Some(0.317), ratio: Some(12.4), ..Mapped::default() };
        let scaled = Mapped { scale: Some(0.01), ..road.clone() };
        let speed = |unit: Option<&str>, entry: &Mapped| factors(&series("v", unit), Channel::OmegaC.spec(), Some(entry));
        for (unit, entry) in [(None, &road), (None, &scaled), (Some("km/h"), &scaled)] {
            assert_eq!(speed(unit, entry), Err(Defect::RoadSpeedUnit), "{unit:?}");
        }
        assert!((speed(Some("km/h"), &road).unwrap().0 - 12.4 / 0.317 / 3.6).abs() < 1e-12);
        let celsius = factors(&series("theta_h", Some("K")), Channel::ThetaH.spec(), None).unwrap();
        assert!((celsius.0, celsius.1) == (1.0, -273.15));
    }
}
