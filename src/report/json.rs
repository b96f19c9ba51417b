//! Lenient reading of diagnosis.json: an entry that is missing, empty or of another type is `None`, or an empty list.

use serde_json::Value;

/// A non-empty text.
pub fn text<'a>(value: &'a Value, key: &str) -> Option<&'a str> {
    value[key].as_str().filter(|t| !t.is_empty())
}

/// A finite number.
pub fn real(value: &Value, key: &str) -> Option<f64> {
    value[key].as_f64().filter(|v| v.is_finite())
}

/// A list.
pub fn list<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value[key].as_array().map_or(&[], Vec::as_slice)
}

/// The texts of a list.
pub fn texts<'a>(value: &'a Value, key: &str) -> Vec<&'a str> {
    list(value, key).iter().filter_map(Value::as_str).collect()
}

/// Whether a flag is set.
pub fn flag(value: &Value, key: &str) -> bool {
    value[key].as_bool() == Some(true)
}
