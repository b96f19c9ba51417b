//! The channel map: which of a user's channels is which of ours.
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
//! ```
//!
//! `dbc = "car.dbc"`, beside the map, names the database of a CAN bus whose frames a file holds. `T_e_Nm = "TqEng"` is short for a name alone. JSON of the same shape is read too.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::channels::{CHANNELS, Channel};
use super::error::CampaignError;
use super::units;

/// Where each of our channels comes from; channels that are not named come from the contract's columns.
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
    /// Factor on the stored value.
    pub scale: Option<f64>,
    /// Added after the factor.
    pub offset: Option<f64>,
    /// Group by name or number, if the name occurs in several.
    pub group: Option<String>,
}

impl ChannelMap {
    /// Reads a map; the ending tells JSON from TOML.
    pub fn from_file(path: &Path) -> Result<ChannelMap, CampaignError> {
        let io = |source| CampaignError::Io { file: path.to_path_buf(), source };
        let text = std::fs::read_to_string(path).map_err(io)?;
        let json = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
        if json { Self::from_json(&path.display().to_string(), &text) } else { Self::from_toml(&path.display().to_string(), &text) }
    }

    /// Reads TOML; `file` is what messages call it.
    pub fn from_toml(file: &str, text: &str) -> Result<ChannelMap, CampaignError> {
        let value: Value = toml::from_str(text).map_err(|e: toml::de::Error| {
            let (line, column) = line_column(text, e.span().map_or(0, |s| s.start));
            syntax(file, "TOML", line, column, e.message())
        })?;
        Self::from_value(file, &value, text)
    }

    /// Reads JSON; `file` is what messages call it.
    pub fn from_json(file: &str, text: &str) -> Result<ChannelMap, CampaignError> {
        let value: Value = serde_json::from_str(text).map_err(|e| syntax(file, "JSON", e.line(), e.column(), &e.to_string()))?;
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

    /// Adds or replaces an entry.
    pub fn insert(&mut self, channel: Channel, mapped: Mapped) {
        self.text.push_str(&format!("{channel:?} {mapped:?}\n"));
        self.entries.insert(channel, mapped);
    }

    fn from_value(file: &str, value: &Value, text: &str) -> Result<ChannelMap, CampaignError> {
        let fail = |what: String, remedy: String| CampaignError::ChannelMap { file: file.to_string(), what, remedy };
        let Some(object) = value.as_object() else {
            return Err(fail("is not a table of channels".into(), "Write one entry per channel, e.g. T_e_Nm = \"TqEng\"".into()));
        };
        let mut entries = BTreeMap::new();
        let mut dbc = None;
        for (column, entry) in object {
            if column == "dbc" {
                let name = entry.as_str().ok_or_else(|| fail("`dbc` is not a text".into(), "Give the name of a DBC file".into()))?;
                // Beside the map, unless it says otherwise.
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
            _ => return Err((format!("the key `{key}` is not known"), "Use name, unit, scale, offset or group".to_string())),
        }
    }
    Ok(out)
}

fn check(channel: Channel, mapped: Mapped) -> Result<Mapped, (String, String)> {
    let quantity = channel.spec().quantity;
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

/// Line and column, from 1, of a byte.
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
    fn faults_name_the_entry_and_the_remedy() {
        let fault = |text: &str| ChannelMap::from_toml("map.toml", text).unwrap_err().to_string();
        let cases = [
            ("omega_g = \"n\"", "`omega_g` is none of our channels"),
            ("T_e_Nm = { name = \"a\", unit = \"rpm\" }", "entry T_e_Nm: \"rpm\" is no unit of a torque"),
            ("T_e_Nm = { name = \"a\", factor = 2 }", "the key `factor` is not known"),
            ("T_e_Nm = { name = \"a\", scale = 0.0 }", "scale is 0"),
            ("T_e_Nm = { name = \"a\", scale = \"2\" }", "`scale` is not a number"),
            ("T_e_Nm = 3", "neither a name nor a table"),
            ("x = 1\ny = = 2", "line 2"),
        ];
        for (text, expected) in cases {
            let message = fault(text);
            assert!(message.starts_with("map.toml") && message.contains(expected), "{text}: {message}");
        }
    }
}
