//! The command `kisspoint`: one file per subcommand.
//!
//! Every subcommand is a struct of arguments and a function `run` that returns an error whose message says what is wrong, where, and what to do. This file holds only the
//! dispatch, the shared help and the exit codes.

pub mod blind;
pub mod compare;
pub mod diagnose;
pub mod error;
mod evidence;
pub mod files;
pub mod fleet;
pub mod fmu;
pub mod index;
pub mod inspect;
mod known;
pub mod launch;
pub mod launch_drawn;
mod laws;
mod memory;
pub mod output;
pub mod plan;
pub mod plausible;
pub mod progress;
pub mod replay;
pub mod summary;
pub mod survey;
pub mod vehicle;
mod what_if;

use clap::{CommandFactory, Parser, Subcommand};
use error::CommandError;
use std::process::ExitCode;

const EXAMPLES: &str = "Examples:
  kisspoint launch
      the start-up of the paper, beside its Table II
  kisspoint fmu --out out
      both FMUs, and their coupling
  kisspoint inspect drive.mf4 --draft-map map.toml
      what a measurement holds, and a channel map for it
  kisspoint vehicle new --out vehicle.json
      a vehicle file to fill in
  kisspoint vehicle check vehicle.json
      what is implausible in it
  kisspoint plan --vehicle vehicle.json
      how small an effect a campaign will show
  kisspoint plan measurements/car_17
      what to measure next
  kisspoint replay measurements/car_17
      the gap per recording and channel
  kisspoint diagnose measurements/car_17 --out out
      where the simulation is off, which effect causes it, and by how much
  kisspoint compare out/before out/after
      what a repair has changed
  kisspoint fleet 'measurements/*' --out out
      many cars: what is wrong with all of them, and what with one
  kisspoint survey drive.mf4
      gears, launches, shifts and sensors of a log
  kisspoint blind --cars 20 --seed 1
      how often the diagnosis is right about cars it does not know

Exit codes:
  0  done
  1  an input or a file is wrong; the message says which and what to do
  2  the command line is wrong

Results go to standard output, messages to standard error. Colours appear on a terminal only; NO_COLOR turns them off.";

/// A dry clutch for co-simulation, and a diagnosis of where its simulation departs from a car.
#[derive(Parser, Debug)]
#[command(name = "kisspoint", version, after_help = EXAMPLES, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Simulate the coupled start-up and compare it with Table II of the paper
    Launch(launch::Args),
    /// Write ClutchController.fmu and DrivelinePlant.fmu, and their coupling as SSP and OSP files
    Fmu(fmu::Args),
    /// Say where a simulation departs from a car, which effect causes it, and how far the gap shrinks
    Diagnose(diagnose::Args),
    /// Predict what a planned campaign will show, or say what to measure next
    Plan(plan::Args),
    /// Drive the plant with a car's recordings and print the gap
    Replay(replay::Args),
    /// Test the diagnosis on freshly drawn cars whose faults it is not told
    Blind(blind::Args),
    /// Diagnose many campaigns and say what they have in common (needs the Python package)
    Fleet(fleet::Args),
    /// Compare two diagnoses of one car: before and after a repair, or two software levels
    Compare(compare::Args),
    /// Write one page about many diagnoses, with links to their reports
    Index(index::Args),
    /// Draft a vehicle file, check one, or correct it
    Vehicle(vehicle::Args),
    /// Show what a measurement file holds, and draft a channel map
    Inspect(inspect::InspectArgs),
    /// Take a first look at any log: gears, launches, shifts, sensors, and which channel may be the engine torque
    Survey(survey::Args),
    /// Print a completion script for a shell
    #[command(after_help = "Examples:\n  \
        kisspoint completions bash > /etc/bash_completion.d/kisspoint\n  \
        kisspoint completions zsh > ~/.zfunc/_kisspoint\n  \
        kisspoint completions fish > ~/.config/fish/completions/kisspoint.fish")]
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
}

/// Runs the command line.
pub fn run() -> ExitCode {
    match Cli::parse().command {
        Command::Launch(args) => finish("launch", launch::run(&args)),
        Command::Fmu(args) => finish("fmu", fmu::run(&args)),
        Command::Diagnose(args) => finish("diagnose", diagnose::run(&args)),
        Command::Plan(args) => finish("plan", plan::run(&args)),
        Command::Replay(args) => finish("replay", replay::run(&args)),
        Command::Blind(args) => finish("blind", blind::run(&args)),
        Command::Fleet(args) => fleet::run(&args),
        Command::Compare(args) => finish("compare", compare::run(&args)),
        Command::Index(args) => finish("index", index::run(&args)),
        Command::Vehicle(args) => finish(args.name(), vehicle::run(&args)),
        Command::Inspect(args) => finish("inspect", inspect::run(&args)),
        Command::Survey(args) => finish("survey", survey::run(&args)),
        Command::Completions { shell } => finish("completions", completions(shell)),
    }
}

/// Writes the completion script of `shell`.
fn completions(shell: clap_complete::Shell) -> Result<(), CommandError> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "kisspoint", &mut script);
    output::print(&String::from_utf8_lossy(&script))
}

/// Turns the result of the subcommand `name` into a message and an exit code.
fn finish(name: &str, result: Result<(), CommandError>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            output::alarm(&error);
            eprintln!("For usage and examples: kisspoint {name} --help");
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_sound() {
        Cli::command().debug_assert();
    }

    /// Every subcommand, nested ones included, with the words that call it.
    fn all(command: &clap::Command, words: &str) -> Vec<(String, clap::Command)> {
        let one = |c: &clap::Command| {
            let words = format!("{words} {}", c.get_name());
            let below = all(c, &words);
            std::iter::once((words, c.clone())).chain(below).collect::<Vec<_>>()
        };
        command.get_subcommands().flat_map(one).collect()
    }

    #[test]
    fn every_subcommand_explains_itself() {
        for (words, command) in all(&Cli::command(), "kisspoint") {
            assert!(command.get_about().is_some(), "{words} has no description");
            let text = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(text.contains("Examples:") && text.contains(&words), "{words} has no examples");
            let silent: Vec<&str> = command.get_arguments().filter(|a| a.get_help().is_none()).map(|a| a.get_id().as_str()).collect();
            assert!(silent.is_empty(), "{words}: {silent:?} have no help");
        }
    }

    #[test]
    fn the_documentation_names_every_command_and_option() {
        let page = include_str!("../../docs/command-line.md");
        for (words, command) in all(&Cli::command(), "kisspoint") {
            if command.has_subcommands() {
                continue;
            }
            let row =
                page.lines().find(|line| line.starts_with(&format!("| `{words}`"))).unwrap_or_else(|| panic!("{words} is not documented"));
            for option in command.get_arguments().filter_map(clap::Arg::get_long) {
                let named = if option == "json" { !row.ends_with("| |") } else { row.contains(&format!("--{option}")) };
                assert!(named, "{words} --{option} is not documented");
            }
        }
    }
}
