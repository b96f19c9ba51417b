//! The importer's logger.
//!
//! The message is preformatted into a buffer on the stack: `%` is doubled, because the logger is called in the manner of `printf`,
//! and the category is always one that the model description declares.

use super::refusal::Refusal;
use super::types::{LoggerFn, Status};
use std::ffi::{CStr, CString, c_int, c_void};
use std::fmt::{self, Write};

/// A declared log category.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Category {
    /// `logStatusError`.
    Error,
    /// `logStatusWarning`.
    Warning,
    /// `logEvents`.
    Events,
    /// `logAll`: switches all of them.
    All,
}

const CATEGORIES: [(Category, &CStr); 4] = [
    (Category::Error, c"logStatusError"),
    (Category::Warning, c"logStatusWarning"),
    (Category::Events, c"logEvents"),
    (Category::All, c"logAll"),
];

/// Longest message, in bytes.
const LONGEST: usize = 1024;

/// Where an instance's messages go: what of the callbacks struct is needed, copied.
pub struct Log {
    logger: Option<LoggerFn>,
    environment: *mut c_void,
    instance: CString,
    enabled: [bool; 4],
}

impl Log {
    /// Errors and warnings are always on at first, events if `debug`.
    pub fn new(logger: Option<LoggerFn>, environment: *mut c_void, instance: CString, debug: bool) -> Self {
        Self { logger, environment, instance, enabled: [true, true, debug, debug] }
    }

    /// Whether messages of this category are wanted.
    pub fn wants(&self, category: Category) -> bool {
        self.logger.is_some() && self.enabled[category as usize]
    }

    /// `fmi2SetDebugLogging`: no category named means all.
    ///
    /// # Errors
    /// A category that is not declared; then nothing is changed.
    pub fn switch(&mut self, on: bool, names: &[&CStr]) -> Result<(), Refusal> {
        let mut enabled = if names.is_empty() { [on; 4] } else { self.enabled };
        for name in names {
            let found = CATEGORIES.iter().find(|c| c.1 == *name);
            let (category, _) = found.ok_or_else(|| Refusal::UnknownCategory(name.to_string_lossy().into_owned()))?;
            match category {
                Category::All => enabled = [on; 4],
                one => enabled[*one as usize] = on,
            }
        }
        self.enabled = enabled;
        Ok(())
    }

    /// Sends a message if its category is wanted.
    pub fn send(&self, status: Status, category: Category, message: fmt::Arguments) {
        let Some(logger) = self.logger.filter(|_| self.enabled[category as usize]) else { return };
        let mut line = Line { bytes: [0; LONGEST], len: 0 };
        // A message that is too long ends early, which is no error.
        let _ = line.write_fmt(message);
        let name = CATEGORIES[category as usize].1;
        // SAFETY: the importer promises a logger of this type; all pointers are NUL-terminated and live through the call.
        unsafe {
            logger(self.environment, self.instance.as_ptr(), status as c_int, name.as_ptr(), line.bytes.as_ptr().cast());
        }
    }
}

/// A message under construction; its last byte is always NUL.
struct Line {
    bytes: [u8; LONGEST],
    len: usize,
}

impl Write for Line {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for c in text.chars().map(|c| if c.is_control() { ' ' } else { c }) {
            let copies = if c == '%' { 2 } else { 1 };
            if self.len + copies * c.len_utf8() >= LONGEST {
                return Err(fmt::Error);
            }
            for _ in 0..copies {
                self.len += c.encode_utf8(&mut self.bytes[self.len..]).len();
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_double_percent_signs_and_end_in_time() {
        let mut line = Line { bytes: [0; LONGEST], len: 0 };
        write!(line, "100 % of\n%s").unwrap();
        assert_eq!(CStr::from_bytes_until_nul(&line.bytes).unwrap(), c"100 %% of %%s");
        assert!(write!(line, "{}", "ä%".repeat(LONGEST)).is_err());
        let text = CStr::from_bytes_until_nul(&line.bytes).unwrap().to_str().unwrap();
        assert!(text.len() < LONGEST && text.matches('%').count().is_multiple_of(2));
    }
}
