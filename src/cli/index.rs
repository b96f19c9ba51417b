//! `kisspoint index`: one page for many answers.

use super::error::{CommandError, at};
use super::files::write_all;
use super::output::{print, print_json};
use crate::report::fleet;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Options of `kisspoint index`.
#[derive(clap::Args, Debug)]
#[command(
    override_usage = "kisspoint index [OPTIONS] <ANSWER>...\n       kisspoint index [OPTIONS] --rows <FILE>",
    after_help = "With several campaigns, `kisspoint diagnose` and `kisspoint fleet` write this page themselves.\n\nExamples:\n  kisspoint index out/*/ --out out/index.html\n  kisspoint index before/ after/ --out index.html --title 'Car 17'"
)]
pub struct Args {
    /// Folders of answers, each with diagnosis.json and report.html
    #[arg(value_name = "ANSWER", required_unless_present = "rows")]
    answers: Vec<PathBuf>,
    /// Cars as JSON Lines, as `kisspoint fleet` gives them, in place of folders
    #[arg(long, value_name = "FILE", conflicts_with = "answers")]
    rows: Option<PathBuf>,
    /// What they have in common: fleet.json
    #[arg(long, value_name = "FILE")]
    population: Option<PathBuf>,
    /// The page; links to reports are relative to its folder
    #[arg(long, value_name = "FILE", default_value = "index.html")]
    out: PathBuf,
    /// Title of the page
    #[arg(long, value_name = "TEXT", default_value = "", hide_default_value = true)]
    title: String,
    /// Print the rows as JSON and write no page
    #[arg(long)]
    json: bool,
}

/// Runs the subcommand.
///
/// # Errors
/// Answers that cannot be read, a page that cannot be written.
pub fn run(args: &Args) -> Result<(), CommandError> {
    let folder = args.out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let rows: Vec<Value> = match &args.rows {
        Some(file) => lines(file)?,
        None => args.answers.iter().map(|answer| row(answer, folder)).collect::<Result<_, _>>()?,
    };
    let population = args.population.as_deref().map(read).transpose()?.unwrap_or(Value::Null);
    if args.json {
        return print_json(&json!({ "cars": rows }));
    }
    write(&args.out, &args.title, &rows, &population)?;
    print(&format!("{}\n", args.out.display()))
}

/// Writes the page of these rows.
///
/// # Errors
/// A folder or a file that cannot be written.
pub fn write(out: &Path, title: &str, rows: &[Value], population: &Value) -> Result<(), CommandError> {
    let name = out.file_name().ok_or_else(|| at(out)(std::io::ErrorKind::InvalidFilename.into()))?;
    let folder = out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    write_all(folder, &[(name.to_string_lossy(), fleet::html(title, rows, population).into_bytes())])
}

/// Reads an answer.
///
/// # Errors
/// A file that cannot be read, or is not JSON.
pub fn read(file: &Path) -> Result<Value, CommandError> {
    let text = std::fs::read_to_string(file).map_err(at(file))?;
    serde_json::from_str(&text)
        .map_err(|e| CommandError::Refused(format!("{}: is not JSON: {e}; give a file that kisspoint wrote", file.display())))
}

fn lines(file: &Path) -> Result<Vec<Value>, CommandError> {
    let text = std::fs::read_to_string(file).map_err(at(file))?;
    let one = |(k, line): (usize, &str)| {
        serde_json::from_str(line).map_err(|e| CommandError::Refused(format!("{}, line {}: is not JSON: {e}", file.display(), k + 1)))
    };
    text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()).map(one).collect()
}

/// The table row of a folder with an answer.
fn row(answer: &Path, page: &Path) -> Result<Value, CommandError> {
    let diagnosis = read(&answer.join("diagnosis.json"))?;
    let name = std::fs::canonicalize(answer).ok().and_then(|p| p.file_name().map(|n| n.to_string_lossy().into_owned())).unwrap_or_default();
    Ok(fleet::row(&name, &link(&answer.join("report.html"), page), &diagnosis))
}

/// A relative link from a page in `folder` to a file.
pub fn link(file: &Path, folder: &Path) -> String {
    let whole = |p: &Path| std::fs::canonicalize(p).or_else(|_| std::path::absolute(p)).unwrap_or_else(|_| p.to_owned());
    let (file, folder) = (whole(file), whole(folder));
    let shared = file.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    let up = folder.components().skip(shared).map(|_| "..".to_owned());
    let down = file.components().skip(shared).map(|c| escaped(&c.as_os_str().to_string_lossy()));
    up.chain(down).collect::<Vec<_>>().join("/")
}

/// A path component, percent-encoded for a link: every byte other than ASCII letters, digits, `-`, `.`, `_` and `~` is escaped.
pub fn escaped(part: &str) -> String {
    let plain = |b: u8| b.is_ascii_alphanumeric() || b"-._~".contains(&b);
    part.bytes().map(|b| if plain(b) { char::from(b).to_string() } else { format!("%{b:02X}") }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_are_relative_and_survive_odd_names() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("a/b c#1")).unwrap();
        std::fs::write(folder.path().join("a/b c#1/report.html"), "").unwrap();
        std::fs::create_dir_all(folder.path().join("pages")).unwrap();
        assert_eq!(link(&folder.path().join("a/b c#1/report.html"), &folder.path().join("pages")), "../a/b%20c%231/report.html");
        assert_eq!(link(&folder.path().join("a/b c#1/report.html"), &folder.path().join("a")), "b%20c%231/report.html");
    }
}
