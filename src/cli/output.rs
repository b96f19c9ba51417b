//! Results on standard output.

use super::error::CommandError;
use serde_json::Value;
use std::io::{ErrorKind, Write};

/// Prints `text` as it stands.
///
/// # Errors
/// Output that cannot be written. A reader that closes the pipe early, such as `head`, has what it wants: that is no error.
pub fn print(text: &str) -> Result<(), CommandError> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(CommandError::Output(e)),
        _ => Ok(()),
    }
}

/// Prints one JSON document.
///
/// # Errors
/// As [`print`].
pub fn print_json(document: &Value) -> Result<(), CommandError> {
    print(&format!("{document:#}\n"))
}
