//! The importer's logger.
//!
//! A call leaves at most one message. Its `%` signs are doubled, because the logger interprets it like `printf`, and its category is always one that the model description
//! declares. The logger is called when the call has done everything else and the instance is free again: a logger may call back, or jump away and never return.

use super::refusal::Refusal;
use super::types::{LoggerFn, Status};
use std::ffi::{CStr, CString, c_char, c_int, c_void};
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
    /// `logAll`: switches all categories.
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

/// Destination of an instance's messages: a copy of what is needed from the callbacks struct.
pub struct Log {
    logger: Option<LoggerFn>,
    environment: *mut c_void,
    instance: CString,
    enabled: [bool; 4],
    /// Status and category of the message in `line`, if one is waiting.
    waiting: Option<(Status, Category)>,
    line: Line,
}

impl Log {
    /// Errors and warnings are enabled at first, events only if `debug`.
    pub fn new(logger: Option<LoggerFn>, environment: *mut c_void, instance: CString, debug: bool) -> Self {
        Self { logger, environment, instance, enabled: [true, true, debug, debug], waiting: None, line: Line::EMPTY }
    }

    /// Whether messages of this category are wanted.
    pub fn wants(&self, category: Category) -> bool {
        self.logger.is_some() && self.enabled[category as usize]
    }

    /// `fmi2SetDebugLogging`: without names it switches all categories.
    ///
    /// # Errors
    /// A category is not declared; nothing is changed then.
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

    /// Stores a message, to be sent at the end of the call, if its category is wanted.
    pub fn write(&mut self, status: Status, category: Category, message: fmt::Arguments) {
        if self.wants(category) {
            self.line = Line::EMPTY;
            // A message that is too long is cut off, which is not an error.
            let _ = self.line.write_fmt(message);
            self.waiting = Some((status, category));
        }
    }

    /// Takes the waiting message, if there is one.
    #[inline]
    pub fn take(&mut self) -> Option<Message> {
        self.waiting.is_some().then(|| self.taken()).flatten()
    }

    #[cold]
    fn taken(&mut self) -> Option<Message> {
        let ((status, category), logger) = (self.waiting.take()?, self.logger?);
        Some(Message { logger, environment: self.environment, instance: self.instance.as_ptr(), status, category, line: self.line })
    }
}

/// A message that is ready to be sent. All it needs from the instance is its name, which lives until the importer frees the instance.
#[derive(Clone, Copy)]
pub struct Message {
    logger: LoggerFn,
    environment: *mut c_void,
    instance: *const c_char,
    status: Status,
    category: Category,
    line: Line,
}

impl Message {
    /// The message with the importer's own copy of the instance's name, for an instance that could not be made.
    pub fn named(self, name: &CStr) -> Self {
        Self { instance: name.as_ptr(), ..self }
    }

    /// Calls the logger.
    pub fn send(&self) {
        let name = CATEGORIES[self.category as usize].1;
        // SAFETY: the importer promises a logger of this type; all pointers are NUL-terminated and live until it returns.
        unsafe { (self.logger)(self.environment, self.instance, self.status as c_int, name.as_ptr(), self.line.bytes.as_ptr().cast()) }
    }
}

/// A message under construction; its last byte is always NUL.
#[derive(Clone, Copy)]
struct Line {
    bytes: [u8; LONGEST],
    len: usize,
}

impl Line {
    const EMPTY: Self = Self { bytes: [0; LONGEST], len: 0 };
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
        let mut line = Line::EMPTY;
        write!(line, "100 % of\n%s").unwrap();
        assert_eq!(CStr::from_bytes_until_nul(&line.bytes).unwrap(), c"100 %% of %%s");
        assert!(write!(line, "{}", "ä%".repeat(LONGEST)).is_err());
        let text = CStr::from_bytes_until_nul(&line.bytes).unwrap().to_str().unwrap();
        assert!(text.len() < LONGEST && text.matches('%').count().is_multiple_of(2));
        // All bytes but the last one may be text.
        for (one, most) in [("a", 1023), ("ä", 511), ("%", 511)] {
            let mut line = Line::EMPTY;
            assert!(line.write_str(&one.repeat(most)).is_ok() && line.write_str(one).is_err(), "{one}");
            assert_eq!(CStr::from_bytes_until_nul(&line.bytes).unwrap().count_bytes(), most * if one == "a" { 1 } else { 2 });
        }
    }
}
