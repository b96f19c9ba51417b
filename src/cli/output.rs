//! Output of results to standard output and of errors to standard error.

use super::error::CommandError;
use serde_json::Value;
use std::io::{ErrorKind, IsTerminal, Write};

/// Prints `text` unchanged.
///
/// # Errors
/// Output that cannot be written. A closed pipe is no error, because its reader, such as `head`, has what it wants.
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
/// As [`print()`].
pub fn print_json(document: &Value) -> Result<(), CommandError> {
    print(&format!("{document:#}\n"))
}

/// Colour of a piece of text on a terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colour {
    /// Reliable as it stands.
    Green,
    /// In doubt.
    Yellow,
    /// Wrong.
    Red,
}

/// `text` in bold and colour on a terminal; unchanged elsewhere, or if NO_COLOR is set.
pub fn coloured(text: &str, colour: Colour, terminal: bool) -> String {
    if !terminal || std::env::var_os("NO_COLOR").is_some_and(|v| !v.is_empty()) {
        return text.to_owned();
    }
    let code = match colour {
        Colour::Green => 32,
        Colour::Yellow => 33,
        Colour::Red => 31,
    };
    format!("\u{1b}[1;{code}m{text}\u{1b}[0m")
}

/// Prints an error to standard error.
pub fn alarm(error: &CommandError) {
    const NAME: &str = "kisspoint:";
    let terminal = std::io::stderr().is_terminal();
    // Folded together with the name, before the name is coloured, because escape codes have no width.
    let text = folded(&in_words(&format!("{NAME} {error}")), width(terminal), "");
    eprintln!("{}{}", coloured(NAME, Colour::Red, terminal), &text[NAME.len()..]);
}

/// Replaces messages of the operating system by plain words and removes its error numbers.
fn in_words(text: &str) -> String {
    let text = text
        .replace("No such file or directory (os error 2)", "no such file or folder")
        .replace("Permission denied (os error 13)", "permission denied");
    match text.split_once(" (os error ") {
        Some((before, after)) => format!("{before}{}", after.split_once(')').map_or("", |(_, rest)| rest)),
        None => text,
    }
}

/// Line width in columns: $COLUMNS or the width of the terminal; unlimited if the output is not a terminal.
pub fn width(terminal: bool) -> usize {
    let asked = || std::env::var("COLUMNS").ok().and_then(|c| c.parse().ok());
    let found = || terminal_size::terminal_size().map(|(width, _)| usize::from(width.0));
    if terminal { asked().or_else(found).unwrap_or(usize::MAX) } else { usize::MAX }
}

/// Breaks lines longer than `width` between words. Continuation lines have the indentation of the line and `more` in addition.
pub fn folded(text: &str, width: usize, more: &str) -> String {
    let fold = |line: &str| {
        if line.chars().count() <= width {
            return line.to_owned();
        }
        let margin: String = line.chars().take_while(|c| *c == ' ').collect();
        let mut out = margin.clone();
        let mut used = margin.chars().count();
        for (k, word) in line.split_whitespace().enumerate() {
            let long = word.chars().count();
            if k > 0 && used + 1 + long > width {
                out += &format!("\n{margin}{more}");
                used = margin.chars().count() + more.chars().count();
            } else if k > 0 {
                out.push(' ');
                used += 1;
            }
            out += word;
            used += long;
        }
        out
    };
    if width == usize::MAX { text.to_owned() } else { text.split('\n').map(fold).collect::<Vec<_>>().join("\n") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_break_between_words() {
        let text = "one two three\n  four five six";
        assert_eq!(folded(text, 9, "  "), "one two\n  three\n  four\n    five\n    six");
        assert_eq!(folded(text, usize::MAX, "  "), text);
    }

    #[test]
    fn only_a_terminal_has_colours() {
        assert_eq!(coloured("no", Colour::Red, false), "no");
    }
}
