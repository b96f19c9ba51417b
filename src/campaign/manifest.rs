//! recordings.json: manoeuvre, rate and start temperatures of each recording. Keys that begin with `_` are comments.

use std::path::Path;

use serde_json::{Map, Value};

use super::channel_map::ChannelMap;
use super::error::CampaignError;
use crate::json::Fault;

/// One entry of recordings.json.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Entry {
    /// The recording's name.
    pub name: String,
    /// Manoeuvre in the engineer's words.
    pub manoeuvre: String,
    /// Stated sample rate, Hz, used to check the clock's unit.
    pub sample_rate_hz: Option<f64>,
    /// Disc and body temperature at the start, °C, if they are known.
    pub theta_0: Option<[f64; 2]>,
    /// Standard deviations of these temperatures, K.
    pub theta_0_sigma: [f64; 2],
    /// File, with or without its extension, if it is not named after the recording.
    pub file: Option<String>,
    /// Part of the file that is the recording, s on the file's clock.
    pub window: Option<[f64; 2]>,
    /// Ratio from the measured speed to the disc's, in place of the channel map's.
    pub ratio: Option<f64>,
    /// Entries in place of the channel map's.
    pub map: Option<ChannelMap>,
}

/// Reads the entries, sorted by name.
pub(crate) fn entries(file: &Path, text: &str) -> Result<Vec<Entry>, CampaignError> {
    let value = json(file, text)?;
    let Some(object) = value.as_object() else {
        return Err(CampaignError::Shape {
            file: file.to_path_buf(),
            what: "is not an object of recordings".to_string(),
            remedy: "Write {\"r01\": {\"manoeuvre\": …}, …}".to_string(),
        });
    };
    let listed = object.iter().filter(|(name, _)| !name.starts_with('_'));
    let mut entries = listed.map(|(name, fields)| entry(file, name, fields)).collect::<Result<Vec<_>, _>>()?;
    if entries.is_empty() {
        return Err(CampaignError::EmptyCampaign(file.to_path_buf()));
    }
    entries.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(entries)
}

/// Parses JSON; a syntax error is returned with its line and column.
pub(crate) fn json(file: &Path, text: &str) -> Result<Value, CampaignError> {
    crate::json::parse(text).map_err(|Fault { line, column, what }| CampaignError::Syntax {
        file: file.to_path_buf(),
        format: "JSON",
        line,
        column,
        what,
    })
}

fn entry(file: &Path, name: &str, fields: &Value) -> Result<Entry, CampaignError> {
    let wrong = |key, value: &Value, why| CampaignError::WrongValue {
        file: file.to_path_buf(),
        recording: name.to_string(),
        key,
        value: value.to_string(),
        why,
    };
    if name.is_empty() || name.contains(['/', '\\']) || name.starts_with('.') {
        let why = "can't be the name of a recording. Use the file's name without its ending, e.g. r01";
        return Err(wrong("name", &Value::from(name), why));
    }
    let not_object = "is not an object. Give manoeuvre, sample_rate_Hz, theta_c0_degC and theta_b0_degC";
    let fields = fields.as_object().ok_or_else(|| wrong("entry", fields, not_object))?;
    let manoeuvre = field(file, name, fields, "manoeuvre", "\"launch\"")?;
    let word = manoeuvre.as_str().filter(|m| !m.trim().is_empty());
    let word = word.ok_or_else(|| wrong("manoeuvre", manoeuvre, "is not a word. Name the manoeuvre, e.g. \"launch\""))?;
    let number = |key, range: std::ops::RangeInclusive<f64>, why| match fields.get(key).filter(|v| !v.is_null()) {
        None => Ok(None),
        Some(value) => value.as_f64().filter(|v| range.contains(v)).map(Some).ok_or_else(|| wrong(key, value, why)),
    };
    let not_rate = "is not a rate from 20 to 100000. Give samples per second, e.g. 100 or 1000";
    let not_disc = "is not the temperature of a clutch disc, -60 to 600 °C. Give it as it was at the start";
    let not_body = "is not the temperature of a clutch body, -60 to 250 °C. Give it in °C, as it was at the start";
    let not_sigma = "is not a standard deviation from 0.1 to 200 K. Give how well the temperature at the start is known";
    let missing = |key, example| CampaignError::MissingKey { file: file.to_path_buf(), recording: name.to_string(), key, example };
    let disc = number("theta_c0_degC", -60.0..=600.0, not_disc)?;
    let body = number("theta_b0_degC", -60.0..=250.0, not_body)?;
    let theta_0 = match (disc, body) {
        (Some(disc), Some(body)) => Some([disc, body]),
        (None, None) => None,
        (None, Some(_)) => return Err(missing("theta_c0_degC", "25.0")),
        (Some(_), None) => return Err(missing("theta_b0_degC", "25.0")),
    };
    let window = match fields.get("window_s").filter(|v| !v.is_null()) {
        None => None,
        Some(value) => {
            let ends: Option<Vec<f64>> = value.as_array().map(|a| a.iter().filter_map(Value::as_f64).collect());
            let ends = ends.filter(|e| e.len() == 2 && e[0] < e[1]);
            let ends = ends.ok_or_else(|| wrong("window_s", value, "is no window. Give [from, to] in seconds on the file's clock"))?;
            Some([ends[0], ends[1]])
        }
    };
    let not_file = "is not the name of a file beside recordings.json. Give it with or without its ending";
    let named = match fields.get("file").filter(|v| !v.is_null()) {
        None => None,
        Some(value) => match value.as_str().filter(|f| !f.is_empty() && !f.contains(['/', '\\'])) {
            Some(text) => Some(text.to_string()),
            None => return Err(wrong("file", value, not_file)),
        },
    };
    let over = fields.get("channel_map").filter(|v| !v.is_null());
    let over = over.map(|v| ChannelMap::from_value(&format!("{}, recording `{name}`, channel_map", file.display()), v, "")).transpose()?;
    let sigma = |key| number(key, 0.1..=200.0, not_sigma).map(|sigma| sigma.unwrap_or(1.0));
    let entry = Entry {
        name: name.to_string(),
        manoeuvre: word.to_string(),
        sample_rate_hz: number("sample_rate_Hz", 20.0..=1e5, not_rate)?,
        theta_0,
        theta_0_sigma: [sigma("theta_c0_sigma_K")?, sigma("theta_b0_sigma_K")?],
        file: named,
        window,
        ratio: number("ratio", 0.05..=100.0, "is no ratio from 0.05 to 100. Give gear times final drive")?,
        map: over,
    };
    match fields.keys().find(|key| !key.starts_with('_') && !KEYS.contains(&key.as_str())) {
        None => Ok(entry),
        Some(key) => Err(CampaignError::UnknownKey {
            file: file.to_path_buf(),
            recording: name.to_string(),
            key: key.clone(),
            remedy: format!("Correct or remove it, or let it begin with _ as a comment; known are {}", KEYS.join(", ")),
        }),
    }
}

/// Draft of a recordings.json, with an entry for every file in the folder of `file` that has the same extension, in the order of their names. It can
/// be used as it is; the start temperatures are then unknown.
///
/// # Errors
/// The folder cannot be read.
pub fn draft(file: &Path) -> std::io::Result<String> {
    let folder = file.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let ending = |p: &Path| p.extension().map(|e| e.to_string_lossy().to_lowercase());
    let mut names: Vec<String> = Vec::new();
    for there in std::fs::read_dir(folder)? {
        let path = there?.path();
        let name = path.file_stem().map(|s| s.to_string_lossy().into_owned()).filter(|s| !s.starts_with('.'));
        names.extend(name.filter(|_| path.is_file() && ending(&path) == ending(file)));
    }
    names.sort();
    let entry = |name: &String| {
        let name = Value::from(name.as_str());
        format!("  {name}: {{\"manoeuvre\": \"recording\", \"theta_c0_degC\": null, \"theta_b0_degC\": null}}")
    };
    Ok(format!("{{\n{}\n}}\n", names.iter().map(entry).collect::<Vec<_>>().join(",\n")))
}

/// Keys of an entry.
const KEYS: [&str; 10] = [
    "manoeuvre",
    "sample_rate_Hz",
    "theta_c0_degC",
    "theta_b0_degC",
    "theta_c0_sigma_K",
    "theta_b0_sigma_K",
    "file",
    "window_s",
    "ratio",
    "channel_map",
];

fn field<'a>(
    file: &Path,
    recording: &str,
    fields: &'a Map<String, Value>,
    key: &'static str,
    example: &'static str,
) -> Result<&'a Value, CampaignError> {
    fields.get(key).filter(|v| !v.is_null()).ok_or_else(|| CampaignError::MissingKey {
        file: file.to_path_buf(),
        recording: recording.to_string(),
        key,
        example,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(text: &str) -> String {
        entries(Path::new("recordings.json"), text).unwrap_err().to_string()
    }

    #[test]
    fn a_missing_key_is_named() {
        let message = fault(r#"{"r01": {"manoeuvre": "launch", "sample_rate_Hz": 100, "theta_c0_degC": 20}}"#);
        assert!(message.contains("`r01` has no key `theta_b0_degC`"), "{message}");
    }

    #[test]
    fn an_unknown_key_is_named_and_a_comment_is_not() {
        let with = |key: &str| format!(r#"{{"r01": {{"manoeuvre": "drive", "{key}": 12}}}}"#);
        let message = fault(&with("theta_c_sigma_K"));
        assert!(message.contains("a key `theta_c_sigma_K` that is not known") && message.contains("theta_c0_sigma_K"), "{message}");
        let read = entries(Path::new("recordings.json"), &with("_driver")).unwrap();
        let read_with_comment =
            entries(Path::new("recordings.json"), &with("_driver").replacen('{', "{\"_comment\": \"wet road\", ", 1)).unwrap();
        assert_eq!(read_with_comment, read);
        assert!(fault(r#"{"_comment": "none yet"}"#).contains("lists no recording"));
        assert_eq!((read[0].theta_0, read[0].theta_0_sigma, read[0].sample_rate_hz), (None, [1.0; 2], None));
    }

    #[test]
    fn impossible_values_are_named() {
        let with = |key: &str, value: &str| {
            let mut fields: Map<String, Value> =
                serde_json::from_str(r#"{"manoeuvre": "launch", "sample_rate_Hz": 100, "theta_c0_degC": 20, "theta_b0_degC": 20}"#)
                    .unwrap();
            fields.insert(key.into(), serde_json::from_str(value).unwrap());
            serde_json::json!({ "r01": fields }).to_string()
        };
        for (key, value) in [
            ("sample_rate_Hz", "0"),
            ("sample_rate_Hz", "\"100\""),
            ("theta_c0_degC", "1000"),
            ("theta_b0_degC", "298.15"),
            ("theta_c0_sigma_K", "0"),
            ("window_s", "[3,2]"),
            ("file", "\"../r02.csv\""),
            ("ratio", "0"),
            ("manoeuvre", "3"),
        ] {
            let message = fault(&with(key, value));
            assert!(message.contains(&format!("key `{key}`: {value}")), "{message}");
        }
    }

    #[test]
    fn broken_json_gives_line_and_column() {
        assert!(fault("{\n\"r01\": }").ends_with("line 2, column 8: expected value. Correct the JSON there"));
        assert!(fault("").ends_with("line 1, column 1: the file is empty. Correct the JSON there"));
        assert!(
            fault("{\"r01\": {},\n\"r01\": {}}")
                .contains("recordings.json, line 2, column 1: the key \"r01\" stands in its object already")
        );
        assert!(fault("{}").contains("lists no recording"));
        assert!(fault("[]").contains("is not an object"));
    }
}
