//! The command `kisspoint`: one file per subcommand.

pub mod fmu;
pub mod launch;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// A dry clutch for co-simulation, and a diagnosis of where its simulation departs from a car.
#[derive(Parser, Debug)]
#[command(name = "kisspoint", version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Simulate the coupled start-up and compare it with Table II of the paper
    Launch(launch::Args),
    /// Write ClutchController.fmu and DrivelinePlant.fmu, and their coupling for masters
    Fmu(fmu::Args),
}

/// Runs the command line.
pub fn run() -> ExitCode {
    match Cli::parse().command {
        Command::Launch(args) => finish(launch::run(&args)),
        Command::Fmu(args) => finish(fmu::run(&args)),
    }
}

fn finish<E: std::error::Error>(result: Result<(), E>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("kisspoint: {error}");
            ExitCode::FAILURE
        }
    }
}
