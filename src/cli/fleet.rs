//! `kisspoint fleet`: runs the Python package, which implements storage, execution engines and the population model.

use super::error::CommandError;
use super::output::alarm;
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::{Command, ExitCode};

/// Usage that is printed if the package is missing; its own help has the rest.
const USAGE: &str = "Usage: kisspoint fleet [OPTIONS] --out <DIR> <CAMPAIGN>...\n\nExamples:\n  kisspoint fleet 'cars/*' --out out\n  \
    kisspoint fleet 's3://bucket/cars/*' --out s3://bucket/out --workers 8";

/// Options of `kisspoint fleet`.
#[derive(clap::Args, Debug)]
#[command(disable_help_flag = true, after_help = "Examples:\n  kisspoint fleet 'measurements/*' --out out\n  kisspoint fleet --help")]
pub struct Args {
    /// Campaigns and options; `kisspoint fleet --help` lists them
    #[arg(value_name = "CAMPAIGN", trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

/// Runs the subcommand: `python3 -m kisspoint.fleet`, which uses this very executable for the diagnoses.
pub fn run(args: &Args) -> ExitCode {
    let python = std::env::var_os("KISSPOINT_PYTHON").map_or_else(|| PathBuf::from("python3"), PathBuf::from);
    let mut command = Command::new(&python);
    command.args(["-m", "kisspoint.fleet"]).args(&args.arguments);
    if let Ok(own) = std::env::current_exe() {
        command.env("KISSPOINT", own);
    }
    let there = Command::new(&python).args(["-c", "import kisspoint.fleet.__main__"]).output();
    let refused = match there {
        Ok(done) if done.status.success() => match command.status() {
            Ok(status) => return status.code().and_then(|code| u8::try_from(code).ok()).map_or(ExitCode::FAILURE, ExitCode::from),
            Err(e) => format!("{} cannot be run: {e}", python.display()),
        },
        Ok(done) => format!(
            "{}: {}",
            python.display(),
            String::from_utf8_lossy(&done.stderr).lines().last().unwrap_or("it does not find the package kisspoint")
        ),
        Err(e) => format!("{} cannot be run: {e}", python.display()),
    };
    alarm(&CommandError::Refused(format!(
        "{refused}\nkisspoint fleet needs the Python package with its extra: in a checkout pip install '.[fleet]', of a wheel pip install 'FILE.whl[fleet]'; or name the Python that has it in KISSPOINT_PYTHON.\n\n{USAGE}"
    )));
    ExitCode::FAILURE
}
