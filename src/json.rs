//! Reads JSON that people write: errors have a line and a column, and a key that occurs twice in an object is an error, because it is unclear which of the two should count.

use serde_json::Value;
use std::collections::HashSet;

/// Why a text can't be read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}, column {column}: {what}")]
pub struct Fault {
    /// Line, from 1.
    pub line: usize,
    /// Column, from 1.
    pub column: usize,
    /// What is wrong there.
    pub what: String,
}

/// Reads a document; a byte order mark in front of it is skipped.
///
/// # Errors
/// The first syntax error (an empty text is one), or else the first key that occurs twice in its object.
pub fn parse(text: &str) -> Result<Value, Fault> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if text.trim().is_empty() {
        return Err(Fault { line: 1, column: 1, what: "the file is empty".to_string() });
    }
    let value = serde_json::from_str(text).map_err(|e| {
        let (line, column, said) = (e.line(), e.column(), e.to_string());
        let what = said.strip_suffix(&format!(" at line {line} column {column}")).unwrap_or(&said).to_string();
        Fault { line, column, what }
    })?;
    match repeated(text) {
        None => Ok(value),
        Some((at, key)) => {
            let before = &text[..at];
            let line = before.matches('\n').count() + 1;
            let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
            Err(Fault { line, column, what: format!("the key {key} stands in its object already; keep one of the two") })
        }
    }
}

/// The first key that its object already has: its byte offset and the key in quotes. `text` must be valid JSON.
fn repeated(text: &str) -> Option<(usize, &str)> {
    // Keys found so far in each object or array that is open; arrays have none.
    let mut open: Vec<HashSet<String>> = Vec::new();
    // A character may be written as itself or as an escape.
    let key_of = |quoted: &str| serde_json::from_str(quoted).unwrap_or_else(|_| quoted.to_owned());
    let mut at = 0;
    while let Some(step) = text[at..].find(['"', '{', '[', '}', ']']) {
        at += step;
        let end = match text.as_bytes()[at] {
            b'"' => at + length_of_string(&text[at..]),
            b'{' | b'[' => {
                open.push(HashSet::new());
                at + 1
            }
            _ => {
                open.pop();
                at + 1
            }
        };
        let is_key = text.as_bytes()[at] == b'"' && text[end..].trim_start().starts_with(':');
        if is_key && !open.last_mut()?.insert(key_of(&text[at..end])) {
            return Some((at, &text[at..end]));
        }
        at = end;
    }
    None
}

/// Length in bytes of the string literal with which `text` begins, including its quotes.
fn length_of_string(text: &str) -> usize {
    let mut escaped = false;
    let end = text.bytes().skip(1).position(|b| {
        let ends = b == b'"' && !escaped;
        escaped = b == b'\\' && !escaped;
        ends
    });
    end.map_or(text.len(), |k| k + 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_that_stands_twice_is_named_with_its_place() {
        let sound = r#"{"a": {"b": 1, "c": "\"b\": {"}, "b": [{"a": 1}, {"a": 2}, "a"], "d": "b"}"#;
        assert_eq!(parse(sound).unwrap(), serde_json::from_str::<Value>(sound).unwrap());
        let fault = parse("\u{feff}{\"a\": {\"b\": 1},\n \"c\": [{\"b\": 1, \"b\": 2}]}").unwrap_err();
        assert_eq!(fault.to_string(), "line 2, column 17: the key \"b\" stands in its object already; keep one of the two");
        let escaped = parse(r#"{"a": 1, "\u0061": 2}"#).unwrap_err();
        assert!(escaped.to_string().starts_with(r#"line 1, column 10: the key "\u0061" stands"#), "{escaped}");
    }

    #[test]
    fn line_and_column_are_told_once() {
        assert_eq!(parse("{\n\"a\": }").unwrap_err().to_string(), "line 2, column 6: expected value");
        assert_eq!(parse(" \n").unwrap_err().what, "the file is empty");
    }
}
