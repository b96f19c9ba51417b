//! The channel map: it assigns the channels of a user's file to ours.
//!
//! ```toml
//! [omega_f_rad_s]
//! name = "nEngine"      # the channel in the file
//! unit = "rpm"          # converted to ours; left out, the file's unit counts
//!
//! [x_to_cmd_mm]
//! name = "BearingSet"
//! scale = 0.01          # value · scale + offset is in `unit`, or in our unit if `unit` is left out
//! offset = -0.35
//! group = "CAN1"        # only where an MDF file has the name in several groups: its name or number
//!
//! [omega_c_rad_s]         # a production car has no sensor at the disc
//! name = "vVehicle"
//! unit = "km/h"
//! tyre_radius_m = 0.317   # where the channel is a road speed
//! ratio = 12.4            # gear times final drive, from the speed that is measured to the disc's
//!
//! [T_e_Nm]
//! name = "TqPercent"
//! reference_Nm = 350      # what 100 % are
//! kind = "brake"          # at the flywheel; or "indicated", of combustion
//! ```
//!
//! `theta_h_degC = { value = 35.0 }` gives a constant in place of a channel that was not recorded. `dbc = "car.dbc"`, beside the entries, names the database
//! of a CAN bus whose frames a file holds. `T_e_Nm = "TqEng"` is short for an entry with a name only. JSON of the same structure is read, too.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::channels::{CHANNELS, Channel};
use super::error::CampaignError;
use super::units::{self, Quantity};

/// Source of each of our channels. A channel without an entry is looked for under the contract's column name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ChannelMap {
    entries: BTreeMap<Channel, Mapped>,
    /// The database of a CAN bus whose frames the files hold.
    dbc: Option<PathBuf>,
    /// The map's text, which is part of a campaign's fingerprint.
    pub(crate) text: String,
}

/// One entry of the map.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mapped {
    /// The channel's name in the file.
    pub name: Option<String>,
    /// Unit of the value after scale and offset.
    pub unit: Option<String>,
    /// Factor applied to the stored value.
    pub scale: Option<f64>,
    /// Offset added after the factor.
    pub offset: Option<f64>,
    /// Group by name or number, if the name occurs in several groups.
    pub group: Option<String>,
    /// Constant value in place of a channel, in our unit.
    pub value: Option<f64>,
    /// Speeds: factor from the measured speed to the disc's, i.e. gear ratio times final drive.
    pub ratio: Option<f64>,
    /// Speeds: rolling radius of the tyre, m, if the channel is a road speed.
    pub tyre_radius: Option<f64>,
    /// Torques: torque that 100 % stands for, N·m.
    pub reference: Option<f64>,
    /// Engine torque: which torque the channel reports.
    pub kind: Option<TorqueKind>,
}

/// Which engine torque a channel reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TorqueKind {
    /// Torque at the flywheel: friction and accessories are already subtracted.
    Brake,
    /// Indicated torque, that of combustion: friction is still included.
    Indicated,
}

impl ChannelMap {
    /// Reads a map, as JSON if the file's extension is `json`, otherwise as TOML.
    pub fn from_file(path: &Path) -> Result<ChannelMap, CampaignError> {
        let io = |source| CampaignError::Io { file: path.to_path_buf(), source };
        let text = std::fs::read_to_string(path).map_err(io)?;
        let json = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
        if json { Self::from_json(&path.display().to_string(), &text) } else { Self::from_toml(&path.display().to_string(), &text) }
    }

    /// Reads TOML; `file` is its name in messages.
    pub fn from_toml(file: &str, text: &str) -> Result<ChannelMap, CampaignError> {
        let value: Value = toml::from_str(text).map_err(|e: toml::de::Error| {
            let (line, column) = line_column(text, e.span().map_or(0, |s| s.start));
            syntax(file, "TOML", line, column, e.message())
        })?;
        Self::from_value(file, &value, text)
    }

    /// Reads JSON; `file` is its name in messages.
    pub fn from_json(file: &str, text: &str) -> Result<ChannelMap, CampaignError> {
        let value = crate::json::parse(text).map_err(|e| syntax(file, "JSON", e.line, e.column, &e.what))?;
        Self::from_value(file, &value, text)
    }

    /// The entry of a channel, if there is one.
    pub fn get(&self, channel: Channel) -> Option<&Mapped> {
        self.entries.get(&channel)
    }

    /// The database (DBC) that turns frames into signals.
    pub fn dbc(&self) -> Option<&Path> {
        self.dbc.as_deref()
    }

    /// This map, with the entries of `over` replacing its own for the same channels.
    pub fn overlaid(&self, over: &ChannelMap) -> ChannelMap {
        let mut map = self.clone();
        map.entries.extend(over.entries.iter().map(|(channel, mapped)| (*channel, mapped.clone())));
        map.dbc = over.dbc.clone().or(map.dbc);
        map
    }

    /// This map with another ratio for the disc speed.
    pub fn with_ratio(&self, ratio: f64) -> ChannelMap {
        let mut map = self.clone();
        map.entries.entry(Channel::OmegaC).or_default().ratio = Some(ratio);
        map
    }

    /// Adds or replaces an entry.
    pub fn insert(&mut self, channel: Channel, mapped: Mapped) {
        self.text.push_str(&format!("{channel:?} {mapped:?}\n"));
        self.entries.insert(channel, mapped);
    }

    /// Builds a map from JSON that has already been parsed; `file` is its name in messages.
    pub(crate) fn from_value(file: &str, value: &Value, text: &str) -> Result<ChannelMap, CampaignError> {
        let fail = |what: String, remedy: String| CampaignError::ChannelMap { file: file.to_string(), what, remedy };
        let Some(object) = value.as_object() else {
            return Err(fail("is not a table of channels".into(), "Write one entry per channel, e.g. T_e_Nm = \"TqEng\"".into()));
        };
        let mut entries = BTreeMap::new();
        let mut dbc = None;
        for (column, entry) in object {
            if column == "dbc" {
                let name = entry.as_str().ok_or_else(|| fail("`dbc` is not a text".into(), "Give the name of a DBC file".into()))?;
                // A relative path starts at the folder of the map.
                dbc = Some(Path::new(file).parent().unwrap_or(Path::new("")).join(name));
                continue;
            }
            let Some(channel) = Channel::from_column(column) else {
                let known: Vec<&str> = CHANNELS.iter().map(|s| s.column).collect();
                return Err(fail(format!("`{column}` is none of our channels"), format!("Use one of {}", known.join(", "))));
            };
            let mapped = mapped(entry).and_then(|m| check(channel, m));
            entries.insert(channel, mapped.map_err(|(what, remedy)| fail(format!("entry {column}: {what}"), remedy))?);
        }
        Ok(ChannelMap { entries, dbc, text: text.to_string() })
    }
}

fn mapped(entry: &Value) -> Result<Mapped, (String, String)> {
    if let Some(name) = entry.as_str() {
        return Ok(Mapped { name: Some(name.to_string()), ..Mapped::default() });
    }
    let shape = || ("is neither a name nor a table".to_string(), "Write \"name\" or { name = \"…\", unit = \"…\" }".to_string());
    let mut out = Mapped::default();
    for (key, value) in entry.as_object().ok_or_else(shape)? {
        let text = || {
            let number = value.as_i64().map(|n| n.to_string());
            let text = value.as_str().map(str::to_string).or(number);
            text.ok_or_else(|| (format!("`{key}` is not a text"), "Put it in quotation marks".to_string()))
        };
        let number = || {
            let number = value.as_f64().filter(|v| v.is_finite());
            number.ok_or_else(|| (format!("`{key}` is not a number"), "Write it as a plain number".to_string()))
        };
        match key.as_str() {
            "name" => out.name = Some(text()?),
            "unit" => out.unit = Some(text()?),
            "group" => out.group = Some(text()?),
            "scale" => out.scale = Some(number()?),
            "offset" => out.offset = Some(number()?),
            "value" => out.value = Some(number()?),
            "ratio" => out.ratio = Some(number()?),
            "tyre_radius_m" => out.tyre_radius = Some(number()?),
            "reference_Nm" => out.reference = Some(number()?),
            "kind" => out.kind = Some(kind(&text()?)?),
            _ => {
                let known = "Use name, unit, scale, offset, group, value, ratio, tyre_radius_m, reference_Nm or kind".to_string();
                return Err((format!("the key `{key}` is not known"), known));
            }
        }
    }
    Ok(out)
}

fn kind(text: &str) -> Result<TorqueKind, (String, String)> {
    match text {
        "brake" => Ok(TorqueKind::Brake),
        "indicated" => Ok(TorqueKind::Indicated),
        "gearbox_input" => Err((
            "the torque at the gearbox input is the clutch's, not the engine's".to_string(),
            "Map it to T_fc_Nm, and another channel, brake or indicated torque, to T_e_Nm".to_string(),
        )),
        _ => Err((
            format!("\"{text}\" is no kind of torque"),
            "Use brake (at the flywheel), indicated (of combustion) or gearbox_input".to_string(),
        )),
    }
}

fn check(channel: Channel, mapped: Mapped) -> Result<Mapped, (String, String)> {
    let is_speed = channel.spec().quantity == Quantity::Speed;
    let is_torque = channel.spec().quantity == Quantity::Torque;
    let positive = |v: Option<f64>| v.is_none_or(|v| v > 0.0);
    if !(positive(mapped.ratio) && positive(mapped.tyre_radius) && positive(mapped.reference)) {
        return Err(("ratio, tyre_radius_m and reference_Nm are positive".to_string(), "Correct the one that is not".to_string()));
    }
    if (mapped.ratio.is_some() || mapped.tyre_radius.is_some()) && !is_speed {
        return Err(("ratio and tyre_radius_m belong to a speed".to_string(), "Use scale for another channel".to_string()));
    }
    if (mapped.reference.is_some() && !is_torque) || (mapped.kind.is_some() && channel != Channel::TE) {
        return Err(("reference_Nm belongs to a torque, kind to T_e_Nm".to_string(), "Remove them here".to_string()));
    }
    if mapped.reference.is_some() && channel == Channel::TE && mapped.kind.is_none() {
        let what = "a percentage of torque has a kind that its numbers don't show".to_string();
        return Err((what, "Add kind = \"brake\" (at the flywheel) or \"indicated\" (of combustion, with friction)".to_string()));
    }
    if mapped.value.is_some() && (mapped.name.is_some() || mapped.scale.is_some() || mapped.offset.is_some() || is_speed) {
        return Err(("value stands for a channel that there is none of, and not for a speed".to_string(), "Give value alone".to_string()));
    }
    let quantity = match mapped {
        Mapped { tyre_radius: Some(_), .. } => Quantity::Velocity,
        Mapped { reference: Some(_), .. } => Quantity::Share,
        _ => channel.spec().quantity,
    };
    if mapped.scale == Some(0.0) {
        return Err(("scale is 0".to_string(), "Give the factor from the stored value to the unit, or leave scale out".to_string()));
    }
    match &mapped.unit {
        Some(unit) if units::parse(unit).is_none_or(|u| u.quantity != quantity) => Err((
            format!("\"{unit}\" is no unit of {}", units::quantity_name(quantity)),
            format!("Use one of {}, or scale and offset to our unit {}", units::examples(quantity), channel.spec().unit),
        )),
        _ => Ok(mapped),
    }
}

fn syntax(file: &str, format: &'static str, line: usize, column: usize, what: &str) -> CampaignError {
    CampaignError::Syntax { file: file.into(), format, line, column, what: what.trim().replace('\n', " ") }
}

/// Line and column of a byte offset, both counted from 1.
fn line_column(text: &str, at: usize) -> (usize, usize) {
    let before = text.get(..at).unwrap_or(text);
    let line = before.matches('\n').count() + 1;
    (line, before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn toml_and_json_say_the_same() {
        let t =
            ChannelMap::from_toml("map.toml", "T_e_Nm = \"TqEng\"\n[omega_f_rad_s]\nname = \"n\"\nunit = \"rpm\"\ngroup = 2\n").unwrap();
        let j = ChannelMap::from_json("map.json", r#"{"T_e_Nm": "TqEng", "omega_f_rad_s": {"name": "n", "unit": "rpm", "group": "2"}}"#)
            .unwrap();
        assert_eq!(t.entries, j.entries);
        assert_eq!(t.get(Channel::TE).unwrap().name.as_deref(), Some("TqEng"));
    }

    #[test]
    fn a_map_may_be_overlaid() {
        let of = |text| ChannelMap::from_toml("map", text).unwrap();
        let both = of("T_e_Nm = \"a\"\nx_to_cmd_mm = \"x\"").overlaid(&of("T_e_Nm = \"b\"")).with_ratio(12.5);
        let name = |channel| both.get(channel).and_then(|m| m.name.as_deref());
        assert_eq!((name(Channel::TE), name(Channel::XToCmd)), (Some("b"), Some("x")));
        assert_eq!(both.get(Channel::OmegaC).unwrap().ratio, Some(12.5));
    }

    #[test]
    fn a_unit_is_of_what_the_channel_is_measured_by() {
        let sound = |entry: &str| ChannelMap::from_toml("map", entry).is_ok();
        for (column, more, units) in [
            ("T_e_Nm", "", ["Nm", "%"]),
            ("T_e_Nm", "reference_Nm = 250, kind = \"brake\", ", ["%", "Nm"]),
            ("omega_c_rad_s", "", ["rpm", "km/h"]),
            ("omega_c_rad_s", "tyre_radius_m = 0.3, ratio = 8.0, ", ["km/h", "rpm"]),
        ] {
            let of = units.map(|unit| sound(&format!("{column} = {{ name = \"a\", {more}unit = \"{unit}\" }}")));
            assert_eq!(of, [true, false], "{column}, {more}{units:?}");
        }
    }

    #[test]
    fn faults_name_the_entry_and_the_remedy() {
        let fault = |text: &str| ChannelMap::from_toml("map.toml", text).unwrap_err().to_string();
        let cases = [
            ("omega_g = \"n\"", "`omega_g` is none of our channels"),
            ("T_e_Nm = { name = \"a\", unit = \"rpm\" }", "entry T_e_Nm: \"rpm\" is no unit of a torque"),
            ("T_e_Nm = { name = \"a\", factor = 2 }", "the key `factor` is not known"),
            ("T_e_Nm = { name = \"a\", scale = 0.0 }", "scale is 0"),
            ("T_e_Nm = { name = \"a\", scale = \"2\" }", "`scale` is not a number"),
            ("T_e_Nm = { name = \"a\", unit = \"%\", reference_Nm = 300 }", "has a kind that its numbers don't show"),
            ("T_e_Nm = { name = \"a\", kind = \"gearbox_input\" }", "is the clutch's, not the engine's"),
            ("T_e_Nm = { name = \"a\", ratio = 3 }", "belong to a speed"),
            ("omega_c_rad_s = { name = \"v\", unit = \"rpm\", tyre_radius_m = 0.3 }", "\"rpm\" is no unit of a road speed"),
            ("omega_c_rad_s = { value = 3 }", "not for a speed"),
            ("T_e_Nm = 3", "neither a name nor a table"),
            ("x = 1\ny = = 2", "line 2"),
        ];
        for (text, expected) in cases {
            let message = fault(text);
            assert!(message.starts_with("map.toml") && message.contains(expected), "{text}: {message}");
        }
    }
}
