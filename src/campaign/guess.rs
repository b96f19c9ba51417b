//! Guesses which of a user's channels is which of ours, from the unit and the words in the name.
//!
//! A unit of another quantity rules a channel out. Otherwise a name scores points for a fitting unit and for each word that is typical of the channel, and
//! loses points for each word that is typical of a similar one. A guess is a draft to be checked: the best score wins, and ties are left open.

use super::channels::{CHANNELS, Channel};
use super::clock;
use super::table::{Group, Measurement, Series};
use super::units;

/// Our channel for each of the given names with units, as far as it can be guessed. No channel is assigned twice.
pub(crate) fn guess(series: &[(&str, Option<&str>)]) -> Vec<Option<Channel>> {
    let mut scored: Vec<(i32, usize, Channel)> = Vec::new();
    for spec in &CHANNELS[1..] {
        let scores: Vec<i32> = series.iter().map(|(name, unit)| score(spec.channel, name, *unit)).collect();
        let Some(best) = scores.iter().copied().max().filter(|s| *s >= ENOUGH) else { continue };
        if scores.iter().filter(|s| **s == best).count() == 1 {
            scored.extend(scores.iter().position(|s| *s == best).map(|at| (best, at, spec.channel)));
        }
    }
    scored.sort_by_key(|(score, _, _)| std::cmp::Reverse(*score));
    let mut out = vec![None; series.len()];
    for (_, at, channel) in scored {
        out[at].get_or_insert(channel);
    }
    out
}

/// Names that several channels share and that would be assigned to one of ours if they occurred only once: name, number of occurrences, our channel.
pub(crate) fn shared<'a>(series: &[(&'a str, Option<&str>)]) -> Vec<(&'a str, usize, Channel)> {
    let mut once: Vec<(&'a str, Option<&str>)> = Vec::new();
    for one in series {
        if once.iter().all(|(name, _)| *name != one.0) {
            once.push(*one);
        }
    }
    let count = |name: &str| series.iter().filter(|(other, _)| *other == name).count();
    let taken = once.iter().zip(guess(&once)).filter_map(|((name, _), channel)| Some((*name, count(name), channel?)));
    taken.filter(|(_, count, _)| *count > 1).collect()
}

/// Whether a name can only be that of a clock.
pub(crate) fn is_time(name: &str, unit: Option<&str>) -> bool {
    let other = unit.and_then(units::parse).is_some_and(|u| u.quantity != units::Quantity::Time);
    !other && matches!(name.to_lowercase().as_str(), "time_s" | "time" | "t" | "timestamps" | "timestamp" | "zeit" | "times" | "seconds")
}

/// Index of the clock: a series whose name can only be a clock's, or otherwise the first whose name mentions time and whose values increase.
fn clock(series: &[Series]) -> Option<usize> {
    let exact = series.iter().position(|s| is_time(&s.name, s.unit.as_deref()));
    exact.or_else(|| series.iter().position(|s| speaks_of_time(&s.name, s.unit.as_deref()) && runs(&s.values)))
}

/// Index of a group's clock: the one that the file names, or otherwise the likeliest.
pub(crate) fn clock_of(group: &Group) -> Option<usize> {
    group.master.or_else(|| clock(&group.series))
}

/// Sets the unit of clocks that state none: to the one at the end of their name, or to the one that the first stamp implies if it counts from 1970, which is noted.
pub(crate) fn units_of_clocks(m: &mut Measurement) {
    for group in &mut m.groups {
        let Some(clock) = clock_of(group).map(|at| &mut group.series[at]) else { continue };
        if clock.unit.as_deref().and_then(units::parse).is_some() {
            continue;
        }
        if let Some(unit) = words(&clock.name).pop().filter(|last| ["ms", "us", "ns"].contains(&last.as_str())) {
            clock.unit = Some(unit);
        } else if let Some(unit) = clock.values.first().and_then(|first| clock::since_1970(*first)) {
            clock.unit = Some(unit.to_string());
            m.notes.push(format!("no unit is given for {}: its stamps are taken for {unit} since 1970", clock.name));
        }
    }
}

fn speaks_of_time(name: &str, unit: Option<&str>) -> bool {
    const WORDS: [&str; 8] = ["time", "zeit", "temps", "tiempo", "stamp", "elapsed", "seconds", "offset"];
    let other = unit.and_then(units::parse).is_some_and(|u| u.quantity != units::Quantity::Time);
    !other && words(name).iter().any(|word| WORDS.iter().any(|known| fits(word, known)))
}

/// Whether the values increase strictly, as the stamps of a clock do.
fn runs(values: &[f64]) -> bool {
    values.len() > 1 && values.windows(2).all(|w| w[1] > w[0])
}

/// Least score for a guess: a unit alone is not enough, nor is a single weak word.
const ENOUGH: i32 = 4;

fn score(channel: Channel, name: &str, unit: Option<&str>) -> i32 {
    let spec = channel.spec();
    if name.eq_ignore_ascii_case(spec.column) {
        return 100;
    }
    let unit_points = match unit.and_then(units::parse) {
        Some(u) if u.quantity == spec.quantity => 2,
        Some(_) => return 0,
        None => 0,
    };
    if name.eq_ignore_ascii_case(spec.stem) {
        return 50 + unit_points;
    }
    let words = words(name);
    let points: i32 = VOCABULARY
        .iter()
        .filter(|(c, _, _)| *c == channel)
        .map(|(_, word, points)| if words.iter().any(|w| fits(w, word)) { *points } else { 0 })
        .sum();
    if points <= 0 { 0 } else { points + unit_points }
}

/// Whether a word matches a known one. Short known words must stand alone; longer ones may be a part of the word (`engine` in `nengine`).
fn fits(word: &str, known: &str) -> bool {
    word == known || (known.len() >= 4 && word.contains(known))
}

/// Words of a name in lower case: it is split at characters that are neither letters nor digits, and where an upper-case letter follows a lower-case one.
pub(crate) fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut small = false;
    for c in name.chars() {
        if !c.is_alphanumeric() || (small && c.is_uppercase()) {
            words.push(String::new());
        }
        if c.is_alphanumeric() {
            words.last_mut().expect("never empty").extend(c.to_lowercase());
        }
        small = c.is_lowercase();
    }
    words.retain(|w| !w.is_empty());
    words
}

/// Channel, word, and the points that the word scores for it.
const VOCABULARY: &[(Channel, &str, i32)] = {
    use Channel::{OmegaC, OmegaF, TE, TFc, ThetaC, ThetaH, XTo, XToCmd};
    &[
        (OmegaF, "engine", 3),
        (OmegaF, "eng", 3),
        (OmegaF, "neng", 4),
        (OmegaF, "nmot", 4),
        (OmegaF, "mot", 2),
        (OmegaF, "motor", 2),
        (OmegaF, "flywheel", 4),
        (OmegaF, "crank", 3),
        (OmegaF, "moteur", 2),
        (OmegaF, "régime", 3),
        (OmegaF, "speed", 1),
        (OmegaF, "rpm", 4),
        (OmegaF, "drehzahl", 4),
        (OmegaF, "n", 1),
        (OmegaF, "wheel", -6),
        (OmegaF, "turbine", -6),
        (OmegaF, "gearbox", -6),
        (OmegaF, "transmission", -6),
        (OmegaF, "trans", -6),
        (OmegaF, "input", -6),
        (OmegaF, "output", -6),
        (OmegaF, "getriebe", -6),
        (OmegaF, "abtrieb", -6),
        (OmegaF, "kupplung", -6),
        (OmegaF, "raddrehzahl", -6),
        (OmegaF, "desired", -6),
        (OmegaF, "target", -6),
        (OmegaF, "limit", -6),
        (OmegaF, "torque", -6),
        (OmegaF, "tq", -6),
        (OmegaF, "temp", -6),
        (OmegaF, "temperature", -6),
        (OmegaF, "set", -3),
        (OmegaC, "clutch", 3),
        (OmegaC, "disc", 3),
        (OmegaC, "disk", 3),
        (OmegaC, "gearbox", 3),
        (OmegaC, "getriebe", 3),
        (OmegaC, "eingang", 2),
        (OmegaC, "drehzahl", 1),
        (OmegaC, "gbx", 3),
        (OmegaC, "transmission", 3),
        (OmegaC, "trans", 2),
        (OmegaC, "input", 2),
        (OmegaC, "shaft", 1),
        (OmegaC, "speed", 1),
        (OmegaC, "n", 1),
        (OmegaC, "output", -4),
        (OmegaC, "torque", -6),
        (OmegaC, "tq", -6),
        (OmegaC, "temp", -6),
        (OmegaC, "temperature", -6),
        (OmegaC, "pos", -6),
        (OmegaC, "position", -6),
        (TE, "torque", 2),
        (TE, "tq", 2),
        (TE, "trq", 2),
        (TE, "moment", 2),
        (TE, "motor", 2),
        (TE, "md", 2),
        (TE, "engine", 2),
        (TE, "eng", 2),
        (TE, "mot", 2),
        (TE, "crank", 2),
        (TE, "clutch", -4),
        (TE, "clu", -4),
        (TE, "speed", -6),
        (TE, "req", -1),
        (XToCmd, "cmd", 3),
        (XToCmd, "command", 3),
        (XToCmd, "set", 3),
        (XToCmd, "setpoint", 3),
        (XToCmd, "target", 3),
        (XToCmd, "desired", 3),
        (XToCmd, "des", 3),
        (XToCmd, "soll", 3),
        (XToCmd, "ref", 2),
        (XToCmd, "req", 2),
        (XToCmd, "bearing", 2),
        (XToCmd, "throwout", 2),
        (XToCmd, "release", 2),
        (XToCmd, "clutch", 1),
        (XToCmd, "actuator", 1),
        (XToCmd, "pos", 1),
        (XToCmd, "position", 1),
        (XToCmd, "torque", -6),
        (XToCmd, "tq", -6),
        (XToCmd, "speed", -6),
        (ThetaH, "housing", 4),
        (ThetaH, "bell", 3),
        (ThetaH, "ambient", 3),
        (ThetaH, "air", 2),
        (ThetaH, "temp", 2),
        (ThetaH, "temperature", 2),
        (ThetaH, "disc", -4),
        (ThetaH, "disk", -4),
        (ThetaH, "water", -4),
        (ThetaH, "coolant", -4),
        (ThetaH, "oil", -4),
        (XTo, "bearing", 3),
        (XTo, "throwout", 3),
        (XTo, "release", 2),
        (XTo, "clutch", 1),
        (XTo, "actuator", 1),
        (XTo, "pos", 2),
        (XTo, "position", 2),
        (XTo, "act", 1),
        (XTo, "ist", 1),
        (XTo, "measured", 1),
        (XTo, "cmd", -6),
        (XTo, "command", -6),
        (XTo, "set", -6),
        (XTo, "setpoint", -6),
        (XTo, "target", -6),
        (XTo, "desired", -6),
        (XTo, "des", -6),
        (XTo, "soll", -6),
        (XTo, "ref", -6),
        (XTo, "req", -6),
        (TFc, "clutch", 3),
        (TFc, "transducer", 4),
        (TFc, "shaft", 2),
        (TFc, "torque", 1),
        (TFc, "tq", 1),
        (TFc, "trq", 1),
        (TFc, "engine", -6),
        (TFc, "eng", -6),
        (TFc, "speed", -6),
        (TFc, "temp", -6),
        (TFc, "pos", -6),
        (ThetaC, "clutch", 2),
        (ThetaC, "disc", 3),
        (ThetaC, "disk", 3),
        (ThetaC, "facing", 3),
        (ThetaC, "thermocouple", 3),
        (ThetaC, "temp", 2),
        (ThetaC, "temperature", 2),
        (ThetaC, "housing", -6),
        (ThetaC, "speed", -6),
        (ThetaC, "torque", -6),
    ]
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_usual_names() {
        assert_eq!(words("nEngine"), ["n", "engine"]);
        assert_eq!(words("Clutch_Pos.Set"), ["clutch", "pos", "set"]);
        assert_eq!(words("TqEng"), ["tq", "eng"]);
    }

    #[test]
    fn a_car_logger_is_understood() {
        let series = [
            ("nEngine", Some("rpm")),
            ("nGbxInput", Some("rpm")),
            ("TqEng", Some("Nm")),
            ("BearingPosSet", Some("mm")),
            ("BearingPos", Some("mm")),
            ("TempBellHousing", Some("°C")),
            ("TqClutch", Some("Nm")),
            ("TempClutchDisc", Some("K")),
            ("tOil", Some("°C")),
            ("gear", None),
            ("vVehicle", Some("km/h")),
        ];
        use Channel::{OmegaC, OmegaF, TE, TFc, ThetaC, ThetaH, XTo, XToCmd};
        let expected = [Some(OmegaF), Some(OmegaC), Some(TE), Some(XToCmd), Some(XTo), Some(ThetaH), Some(TFc), Some(ThetaC)];
        let got = guess(&series);
        assert_eq!(got[..8], expected);
        assert_eq!(got[8..], [None, None, None]);
    }

    #[test]
    fn contract_columns_are_certain_and_strangers_unknown() {
        let names: Vec<(&str, Option<&str>)> = CHANNELS.iter().map(|s| (s.column, None)).collect();
        let expected: Vec<Option<Channel>> = CHANNELS.iter().map(|s| Some(s.channel).filter(|c| *c != Channel::Time)).collect();
        assert_eq!(guess(&names), expected);
        assert_eq!(guess(&[("foo", Some("rpm")), ("engine", Some("V"))])[0], None);
    }

    /// Words typical of a channel raise its score, those of a similar channel lower it; a unit of its quantity helps, another one rules it out.
    #[test]
    fn every_word_counts_the_way_it_is_listed() {
        for spec in &CHANNELS[1..] {
            let words = || VOCABULARY.iter().filter(|(c, _, _)| *c == spec.channel);
            let alone = |word: &&str| words().all(|w| w.1 == *word || !fits(word, w.1));
            let Some((_, base, most)) = words().filter(|w| alone(&w.1)).max_by_key(|w| w.2) else { continue };
            let score = |name: &str, unit| score(spec.channel, name, unit);
            assert_eq!(
                [score(base, None), score(base, Some(spec.unit)), score(base, Some(if spec.unit == "mm" { "rpm" } else { "mm" }))],
                [*most, most + 2, 0],
                "{base}"
            );
            for (_, word, points) in words().filter(|(_, word, _)| !fits(base, word)) {
                let also: i32 = words().filter(|w| fits(word, w.1) && w.1 != *word && !fits(base, w.1)).map(|w| w.2).sum();
                assert_eq!(score(&format!("{base}_{word}"), None), (most + points + also).max(0), "{base} {word}");
                assert!(points.abs() < 7 && (*points > 0 || score(&format!("{base}_{word}"), None) < *most), "{word}");
            }
            assert_eq!([score(spec.stem, None), score(&spec.column.to_uppercase(), None)], [50, 100]);
        }
        assert!(
            fits("nengine", "engine") && !fits("target", "tq") && !fits("engine", "eng") && fits("eng", "eng") && fits("gbxtemp", "temp")
        );
    }

    /// Names that tuning and workshop tools and data loggers of race cars use; speeds of other shafts are not taken for the engine's.
    #[test]
    fn the_engine_speed_of_many_tools_is_known() {
        for name in ["RPM", "rpm", "Engine RPM", "Engine Speed", "Motordrehzahl", "Drehzahl", "nmot", "Régime moteur"] {
            assert_eq!(guess(&[("Fahrgeschwindigkeit", None), (name, None)])[1], Some(Channel::OmegaF), "{name}");
        }
        for name in [
            "Wheel RPM",
            "Turbine RPM",
            "Transmission Output RPM",
            "Raddrehzahl VL",
            "Getriebeeingangsdrehzahl",
            "Desired Idle RPM",
            "Rev limit rpm",
        ] {
            assert_ne!(guess(&[(name, None)]), [Some(Channel::OmegaF)], "{name}");
        }
        assert_eq!(guess(&[("Motormoment", Some("Nm"))]), [Some(Channel::TE)]);
    }

    #[test]
    fn a_clock_is_what_is_called_so_or_speaks_of_time_and_runs() {
        let series = |name: &str, unit: Option<&str>, values: &[f64]| Series {
            name: name.into(),
            unit: unit.map(str::to_owned),
            values: values.to_vec(),
            text: None,
        };
        let (up, down) = ([0.0, 0.1, 0.2], [0.0, 0.2, 0.1]);
        let of = |all: &[(&str, Option<&str>, &[f64])]| clock(&all.iter().map(|(n, u, v)| series(n, *u, v)).collect::<Vec<_>>());
        assert_eq!(of(&[("Lap Time", Some("s"), &down), ("Time", Some("s"), &up)]), Some(1));
        assert_eq!(of(&[("GPS Time", None, &[f64::NAN; 3]), ("Device Time", Some("s"), &up)]), Some(1));
        assert_eq!(of(&[("rpm", None, &up), ("Offset", Some("s"), &up)]), Some(1));
        assert_eq!(of(&[("elapsed_time", Some("s"), &up), ("RPM", None, &up)]), Some(0));
        assert_eq!(of(&[("Régime moteur", Some("tr/min"), &up), ("Temps", Some("s"), &up)]), Some(1));
        assert_eq!(of(&[("Offset", Some("mm"), &up), ("runtime", Some("s"), &down), ("n", None, &up)]), None);
        assert_eq!(of(&[("Time of day", None, &[1.0])]), None);
    }

    #[test]
    fn a_clock_without_a_unit_has_the_one_of_its_name_or_its_stamps() {
        for (name, unit, first, told, notes) in [
            ("elapsed_ms", None, 0.0, Some("ms"), 0),
            ("timestampUs", None, 1.7e15, Some("us"), 0),
            ("timestamp", None, 1.7e12, Some("ms"), 1),
            ("timestamp", Some("s"), 1.7e12, Some("s"), 0),
            ("timestamp", None, 1.7e9, None, 0),
            ("time_s", None, 0.0, None, 0),
        ] {
            let clock = Series { name: name.into(), unit: unit.map(str::to_owned), values: vec![first, first + 20.0], text: None };
            let mut m = Measurement { groups: vec![Group { series: vec![clock], ..Group::default() }], ..Measurement::default() };
            units_of_clocks(&mut m);
            assert_eq!((m.groups[0].series[0].unit.as_deref(), m.notes.len()), (told, notes), "{name} {unit:?}");
        }
    }

    #[test]
    fn a_tie_is_left_open_and_a_clock_is_one_by_name_and_unit() {
        assert_eq!(guess(&[("disc_a", Some("rpm")), ("disc_b", Some("rpm"))]), [None, None]);
        assert_eq!(guess(&[("disc_a", Some("rpm"))]), [Some(Channel::OmegaC)]);
        let twice = [("nmot", Some("rpm")), ("tqmot", Some("Nm")), ("nmot", Some("rpm"))];
        assert_eq!((guess(&twice)[0], shared(&twice)), (None, vec![("nmot", 2, Channel::OmegaF)]));
        assert_eq!(shared(&twice[..2]), []);
        for (name, unit, clock) in [
            ("Time", None, true),
            ("t", Some("ms"), true),
            ("t", Some("rpm"), false),
            ("t_oil", Some("s"), false),
            ("zeit", Some("?"), true),
        ] {
            assert_eq!(is_time(name, unit), clock, "{name}");
        }
    }
}
