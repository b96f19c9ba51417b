//! The contents of a measurement file, and a draft of the channel map for it.

use std::fmt::Write;
use std::path::Path;

use serde_json::{Value, json};

use super::CampaignError;
use super::channels::{CHANNELS, Channel, Presence};
use super::clock;
use super::doubt;
use super::guess;
use super::raster;
use super::table::{self, Format, Group, Series};
use super::units;

/// Contents of a measurement file.
#[derive(Clone, Debug, PartialEq)]
pub struct Inspection {
    /// File name.
    pub file: String,
    /// "text", "MDF4" or "Parquet".
    pub format: &'static str,
    /// Every channel, in the order of the file.
    pub channels: Vec<ChannelInfo>,
    /// Notes of the reader.
    pub notes: Vec<String>,
}

/// One channel of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelInfo {
    /// Name in the file.
    pub name: String,
    /// Unit as the file states it.
    pub unit: Option<String>,
    /// Group by number, and by name where it has one.
    pub group: (usize, String),
    /// Sample rate outside gaps, Hz.
    pub rate_hz: Option<f64>,
    /// Number of samples, invalid ones included.
    pub count: usize,
    /// Number of missing or invalid samples.
    pub invalid: usize,
    /// Least valid value.
    pub min: Option<f64>,
    /// Greatest valid value.
    pub max: Option<f64>,
    /// True if the channel holds text.
    pub text: bool,
    /// Which of our channels it seems to be.
    pub guess: Option<Channel>,
}

/// Inspects a measurement file; a database (DBC) decodes the frames of a CAN bus. `tell` receives the share that has been read.
pub fn inspect(path: &Path, dbc: Option<&Path>, tell: &dyn Fn(f64)) -> Result<Inspection, CampaignError> {
    if path.is_dir() {
        let remedy = "Name one file in it; `kisspoint replay` and `kisspoint diagnose` take a folder".to_string();
        return Err(CampaignError::Shape { file: path.to_path_buf(), what: "is a folder".to_string(), remedy });
    }
    // A missing file is not a defect of a recording.
    std::fs::metadata(path).map_err(|source| CampaignError::Io { file: path.to_path_buf(), source })?;
    let measurement = table::read(path, dbc, &|_| true, tell)?;
    let format = match table::format(path)? {
        Format::Text => "text",
        Format::Mdf => "MDF4",
        Format::Parquet => "Parquet",
    };
    let mut notes = measurement.notes;
    let mut channels: Vec<ChannelInfo> = measurement.groups.iter().flat_map(channels_of).collect();
    notes.extend(mark(&mut channels));
    notes.extend(measurement.groups.iter().flat_map(|g| faults(g, &channels)));
    Ok(Inspection { file: measurement.file, format, channels, notes })
}

impl Inspection {
    /// The inspection as JSON.
    pub fn to_json(&self) -> Value {
        let channel = |c: &ChannelInfo| {
            json!({
                "name": c.name,
                "unit": c.unit,
                "group": c.group.0,
                "group_name": c.group.1,
                "rate_Hz": c.rate_hz,
                "count": c.count,
                "invalid": c.invalid,
                "min": c.min,
                "max": c.max,
                "text": c.text,
                "guess": c.guess.map(|g| g.spec().column),
            })
        };
        json!({
            "file": self.file,
            "format": self.format,
            "channels": self.channels.iter().map(channel).collect::<Vec<_>>(),
            "notes": self.notes,
        })
    }
}

/// Draft of a channel map in TOML. Each of our channels has an entry; one that was not found is commented out.
pub fn draft_channel_map(inspection: &Inspection) -> String {
    let mut out = format!(
        "# Channel map for {}, drafted by name and unit: check every entry.\n\
         # unit is what the file's values are in; value * scale + offset, where given, is in that unit.\n",
        inspection.file
    );
    // Writing to a String can't fail.
    for spec in &CHANNELS {
        let whose = match spec.presence {
            Presence::Always => "",
            Presence::Usual => ", may be missing",
            Presence::Bench => ", bench only",
            Presence::Road => ", drives only",
        };
        let _ = write!(out, "\n# {} in {}{whose}\n", spec.column, spec.unit);
        match inspection.channels.iter().find(|c| c.guess == Some(spec.channel)) {
            Some(channel) => out.push_str(&entry(spec.column, channel, inspection)),
            None => {
                let candidates = candidates(spec.quantity, inspection);
                let _ = write!(out, "# not found{candidates}\n# [{}]\n# name = \"\"\n# unit = \"{}\"\n", spec.column, spec.unit);
            }
        }
    }
    out
}

fn entry(column: &str, channel: &ChannelInfo, inspection: &Inspection) -> String {
    let mut out = format!("[{column}]\nname = {}\n", toml_text(&channel.name));
    match channel.unit.as_deref() {
        Some(unit) if units::parse(unit).is_some() => {
            let _ = writeln!(out, "unit = {}", toml_text(unit));
        }
        Some(unit) => {
            let _ = writeln!(
                out,
                "# the file says {}, which is not known: give scale and offset\n# scale = 1.0\n# offset = 0.0",
                toml_text(unit)
            );
        }
        None => out.push_str("# the file states no unit\n# unit = \"\"\n"),
    }
    if inspection.channels.iter().filter(|c| c.name == channel.name && c.guess != Some(Channel::Time)).count() > 1 {
        let _ = writeln!(out, "group = \"{}\"", channel.group.0);
    }
    out
}

/// A comment that names the channels of the right quantity that have not been assigned.
fn candidates(quantity: units::Quantity, inspection: &Inspection) -> String {
    let fits = |c: &&ChannelInfo| c.guess.is_none() && c.unit.as_deref().and_then(units::parse).is_some_and(|u| u.quantity == quantity);
    let names: Vec<&str> = inspection.channels.iter().filter(fits).map(|c| c.name.as_str()).take(8).collect();
    if names.is_empty() { String::new() } else { format!("; of that kind: {}", names.join(", ").replace('\n', " ")) }
}

fn toml_text(text: &str) -> String {
    toml::Value::String(text.to_string()).to_string()
}

/// A group's stamps, s; `None` if it has no clock or they do not increase.
fn clock_of(group: &Group) -> Option<Vec<f64>> {
    let series = &group.series[guess::clock_of(group)?];
    let factor = series.unit.as_deref().and_then(units::parse).map_or(1.0, |u| u.factor);
    let time: Vec<f64> = series.values.iter().map(|t| t * factor).collect();
    clock::check(&time).is_ok().then_some(time)
}

fn channels_of(group: &Group) -> Vec<ChannelInfo> {
    let (at, time) = (guess::clock_of(group), clock_of(group));
    let one = |(i, series): (usize, &Series)| {
        let valid = || series.values.iter().copied().filter(|v| !v.is_nan());
        let spacing = time.as_deref().and_then(|t| clock::spacing(t, &series.values));
        ChannelInfo {
            name: series.name.clone(),
            unit: series.unit.clone(),
            group: (group.index, group.name.clone()),
            rate_hz: spacing.filter(|s| s.step > 0.0).map(|s| 1.0 / s.step),
            count: series.values.len(),
            invalid: series.values.len() - valid().count(),
            min: valid().reduce(f64::min),
            max: valid().reduce(f64::max),
            text: series.text.is_some(),
            guess: (at == Some(i)).then_some(Channel::Time),
        }
    };
    group.series.iter().enumerate().map(one).collect()
}

/// Notes on the samples that would be left out if these channels became a recording.
fn faults(group: &Group, channels: &[ChannelInfo]) -> Vec<String> {
    let guess = |series: &Series| channels.iter().find(|c| c.group.0 == group.index && c.name == series.name).and_then(|c| c.guess);
    let Some(time) = clock_of(group) else { return Vec::new() };
    let fault = |series: &Series| {
        let channel = guess(series).filter(|c| *c != Channel::Time)?;
        let moves = matches!(channel, Channel::OmegaF | Channel::OmegaC);
        let mut values = series.values.clone();
        let unit = series.unit.as_deref().unwrap_or(channel.spec().unit);
        let fault = doubt::faults_of((&series.name, unit), &time, &mut values, moves);
        let between = if moves { raster::samples_of(&series.name, &time, &mut values) } else { None };
        Some([fault, between].into_iter().flatten())
    };
    group.series.iter().filter_map(fault).flatten().collect()
}

/// Adds guesses for all channels except clocks and texts; notes the names that several channels share, for which no guess is made.
fn mark(channels: &mut [ChannelInfo]) -> Vec<String> {
    let open: Vec<usize> = (0..channels.len()).filter(|&i| channels[i].guess.is_none() && !channels[i].text).collect();
    let names: Vec<(&str, Option<&str>)> = open.iter().map(|&i| (channels[i].name.as_str(), channels[i].unit.as_deref())).collect();
    let guesses = guess::guess(&names);
    let how = |name: &str| {
        let mut groups: Vec<String> = channels.iter().filter(|c| c.name == name).map(|c| c.group.0.to_string()).collect();
        groups.dedup();
        match groups.len() {
            1 => "rename all but one".to_string(),
            _ => format!("choose one with `group` in the channel map, of groups {}", groups.join(" and ")),
        }
    };
    let say = |(name, count, channel): (&str, usize, Channel)| {
        let column = channel.spec().column;
        format!("{count} channels are called {name}, so that none is taken for {column}: {}", how(name))
    };
    let said = guess::shared(&names).into_iter().map(say).collect();
    for (i, guess) in open.into_iter().zip(guesses) {
        channels[i].guess = guess;
    }
    said
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(name: &str, unit: Option<&str>, group: usize, guess: Option<Channel>) -> ChannelInfo {
        ChannelInfo {
            name: name.into(),
            unit: unit.map(str::to_owned),
            group: (group, String::new()),
            rate_hz: None,
            count: 0,
            invalid: 0,
            min: None,
            max: None,
            text: false,
            guess,
        }
    }

    /// Entry of the draft for one of our channels.
    fn drafted(column: &str, channels: Vec<ChannelInfo>) -> String {
        let draft = draft_channel_map(&Inspection { file: "a.mf4".into(), format: "MDF4", channels, notes: Vec::new() });
        let from = draft.find(&format!("# {column} in ")).unwrap();
        draft[from..].split("\n\n").next().unwrap().trim().to_owned()
    }

    #[test]
    fn a_draft_has_name_unit_and_the_group_where_a_name_stands_in_several() {
        let known = Some(Channel::OmegaF);
        let one = drafted(
            "omega_f_rad_s",
            vec![channel("n", Some("rpm"), 1, known), channel("t", None, 0, Some(Channel::Time)), channel("m", None, 2, None)],
        );
        assert_eq!(one, "# omega_f_rad_s in rad/s\n[omega_f_rad_s]\nname = \"n\"\nunit = \"rpm\"");
        let twice = drafted("omega_f_rad_s", vec![channel("n", Some("rpm"), 1, known), channel("n", Some("rpm"), 2, None)]);
        assert!(twice.ends_with("unit = \"rpm\"\ngroup = \"1\""), "{twice}");
        // A clock with the same name does not count as a second channel.
        let clock = drafted("omega_f_rad_s", vec![channel("n", Some("rpm"), 1, known), channel("n", None, 2, Some(Channel::Time))]);
        assert!(!clock.contains("group"), "{clock}");
        let strange = drafted("omega_f_rad_s", vec![channel("n", Some("furlong"), 1, known)]);
        assert!(strange.contains("# the file says \"furlong\", which is not known") && !strange.contains("\nunit"), "{strange}");
        assert!(drafted("omega_f_rad_s", vec![channel("n", None, 1, known)]).contains("# the file states no unit"));
        let missing = drafted(
            "T_fc_Nm",
            vec![channel("a", Some("Nm"), 1, None), channel("b", Some("mm"), 1, None), channel("c", Some("Nm"), 1, Some(Channel::TE))],
        );
        assert_eq!(missing, "# T_fc_Nm in N·m, bench only\n# not found; of that kind: a\n# [T_fc_Nm]\n# name = \"\"\n# unit = \"N·m\"");
    }

    #[test]
    fn a_channel_is_told_with_its_rate_its_range_and_what_is_missing() {
        let series = |name: &str, unit: Option<&str>, values: Vec<f64>| Series {
            name: name.into(),
            unit: unit.map(str::to_owned),
            values,
            text: None,
        };
        let group = Group {
            index: 3,
            series: vec![series("time", Some("ms"), vec![0.0, 20.0, 40.0, 60.0]), series("n", None, vec![2.0, f64::NAN, -1.0, 5.0])],
            ..Group::default()
        };
        let all = channels_of(&group);
        assert_eq!((all[0].guess, all[1].guess, all[0].group.0), (Some(Channel::Time), None, 3));
        assert!((all[0].rate_hz.unwrap() - 50.0).abs() < 1e-9);
        assert_eq!((all[1].count, all[1].invalid, all[1].min, all[1].max), (4, 1, Some(-1.0), Some(5.0)));
        let back = Group { series: vec![series("time", None, vec![1.0, 0.0]), series("n", None, vec![2.0, 3.0])], ..Group::default() };
        assert!(channels_of(&back).iter().all(|c| c.rate_hz.is_none()));
    }

    /// Faults are reported for the channel that was guessed, not for one of the same name in another group.
    #[test]
    fn faults_are_those_of_a_channel_that_is_used() {
        let speed: Vec<f64> = (0..100).map(|k| if k == 40 { 900.0 } else { 0.5 * f64::from(k) }).collect();
        let series = |name: &str, values: Vec<f64>| Series { name: name.into(), unit: None, values, text: None };
        let time = (0..100).map(|k| 0.01 * f64::from(k)).collect();
        let group = Group { index: 1, series: vec![series("time", time), series("n", speed)], ..Group::default() };
        let all = [channel("n", None, 2, Some(Channel::OmegaC)), channel("n", None, 1, Some(Channel::OmegaF))];
        let said = faults(&group, &all);
        assert!(said.len() == 1 && said[0].contains("0.400 s"), "{said:?}");
        assert!(faults(&group, &all[..1]).is_empty() && faults(&group, &[]).is_empty());
        // In a channel that is not a speed, a spike is a value like any other.
        assert!(faults(&group, &[channel("n", None, 1, Some(Channel::TE))]).iter().all(|f| !f.contains("contradicted")));
    }
}
