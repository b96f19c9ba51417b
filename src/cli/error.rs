//! Errors of commands. Every message says what is wrong, where, and what to do.

use crate::campaign::{CampaignError, LeftOut, lines};
use crate::fmu::FmuError;
use crate::gap::diagnosis::DiagnosisError;
use crate::vehicle::VehicleError;
use std::io::ErrorKind;
use std::path::PathBuf;

/// Why a command stopped; its exit code is 1.
#[derive(Debug, thiserror::Error)]
pub enum CommandError {
    /// A campaign, a measurement file or a channel map that is missing or faulty.
    #[error(transparent)]
    Campaign(#[from] CampaignError),
    /// A campaign that was read but cannot be diagnosed.
    #[error("{}: {source}{}", path.display(), lines(left_out))]
    Diagnosis {
        /// The campaign.
        path: PathBuf,
        /// What is wrong.
        source: DiagnosisError,
        /// Recordings that could not be used.
        left_out: Vec<LeftOut>,
    },
    /// Options that do not fit the file or each other; the message explains why.
    #[error("{0}")]
    Refused(String),
    /// Some of several campaigns failed; each failure has been reported already.
    #[error("{failed} of {all} campaigns could not be diagnosed; the messages above say why")]
    Some {
        /// Campaigns without an answer.
        failed: usize,
        /// Campaigns that were asked for.
        all: usize,
    },
    /// Two campaigns would write their answers into the same folder.
    #[error("{} and {} have the same name, so their answers would overwrite each other; diagnose them one by one", .0.display(), .1.display())]
    SameName(PathBuf, PathBuf),
    /// A malformed vehicle file.
    #[error("{}: {source}", path.display())]
    Vehicle {
        /// The file.
        path: PathBuf,
        /// The defect.
        source: VehicleError,
    },
    /// Evidence that cannot be assembled.
    #[error(transparent)]
    Evidence(#[from] super::evidence::EvidenceError),
    /// A malformed file of faults.
    #[error("{}: {what}", path.display())]
    Faults {
        /// The file.
        path: PathBuf,
        /// The defect.
        what: String,
    },
    /// An error with an FMU, or with the shared library that goes into it.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// A file that cannot be read or written.
    #[error("{}: {}; check path and permissions", path.display(), plainly(source))]
    File {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The output file exists already.
    #[error("{} exists already; choose another name, or add --force to overwrite it", .0.display())]
    Exists(PathBuf),
    /// The results cannot be printed.
    #[error("the results cannot be written to standard output: {0}; check where it goes and whether there is space")]
    Output(std::io::Error),
    /// Threads that cannot be started.
    #[error("threads cannot be started: {0}; give fewer with --threads")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// Returns a function that wraps an error of the operating system as an error at `path`.
pub fn at(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> CommandError {
    let path = path.into();
    move |source| CommandError::File { path, source }
}

/// The error of the operating system, in plain words for the usual kinds.
fn plainly(source: &std::io::Error) -> String {
    match source.kind() {
        ErrorKind::NotFound => "no such file or folder".to_owned(),
        ErrorKind::PermissionDenied => "permission denied".to_owned(),
        ErrorKind::AlreadyExists | ErrorKind::NotADirectory => "a file is where a folder is needed".to_owned(),
        ErrorKind::IsADirectory => "this is a folder, not a file".to_owned(),
        ErrorKind::InvalidData => "this is not text in UTF-8".to_owned(),
        _ => source.to_string(),
    }
}
