//! From `fmuResourceLocation` to a folder.
//!
//! Importers write the URI as `file:///dir`, `file:/dir` or `file://localhost/dir`, percent-encoded or not, some as a plain path.

use std::path::PathBuf;

/// Folder that the URI names; none if it is no file URI.
pub fn folder(uri: &str) -> Option<PathBuf> {
    let path = match uri.get(..5) {
        Some(scheme) if scheme.eq_ignore_ascii_case("file:") => percent_decoded(without_authority(&uri[5..]))?,
        _ if uri.contains("://") || uri.is_empty() => return None,
        _ => uri.to_owned(),
    };
    Some(PathBuf::from(without_slash_before_drive(&path)))
}

fn without_authority(rest: &str) -> &str {
    match rest.strip_prefix("//") {
        Some(after) if after.starts_with('/') => after,
        Some(after) => after.strip_prefix("localhost").filter(|path| path.starts_with('/')).unwrap_or(rest),
        None => rest,
    }
}

/// `/C:/dir` is `C:/dir`.
fn without_slash_before_drive(path: &str) -> &str {
    let bytes = path.as_bytes();
    let drive = bytes.len() > 2 && bytes[0] == b'/' && bytes[1].is_ascii_alphabetic() && bytes[2] == b':';
    if drive { &path[1..] } else { path }
}

fn percent_decoded(text: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let [first, tail @ ..] = rest {
        let code = (*first == b'%').then(|| tail.get(..2)).flatten().and_then(|d| Some(hex(d[0])? * 16 + hex(d[1])?));
        // A lone percent sign stands for itself: some importers do not encode.
        bytes.push(code.unwrap_or(*first));
        rest = if code.is_some() { &tail[2..] } else { tail };
    }
    String::from_utf8(bytes).ok()
}

fn hex(digit: u8) -> Option<u8> {
    (digit as char).to_digit(16).map(|d| d as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_form_of_uri_names_its_folder() {
        for (uri, path) in [
            ("file:///tmp/a%20b/resources", Some("/tmp/a b/resources")),
            ("file:/tmp/x", Some("/tmp/x")),
            ("FILE://localhost/tmp/x/", Some("/tmp/x/")),
            ("file:///C:/Temp/r", Some("C:/Temp/r")),
            ("file:///C%3a/Temp", Some("C:/Temp")),
            ("file://server/share", Some("//server/share")),
            ("/tmp/100%/x", Some("/tmp/100%/x")),
            ("file:///tmp/100%zz", Some("/tmp/100%zz")),
            ("file:///%ff", None),
            ("http://example.org/x", None),
            ("", None),
            ("fil", Some("fil")),
        ] {
            assert_eq!(folder(uri), path.map(PathBuf::from), "{uri}");
        }
    }
}
