//! A temporary folder that is removed at the end, even if the run is interrupted.

use crate::cli::error::{CommandError, at};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Exit code after Ctrl-C, by the convention of shells (128 + SIGINT).
const INTERRUPTED: i32 = 130;

/// Folder that the interrupt handler has to remove.
static OPEN: Mutex<Option<PathBuf>> = Mutex::new(None);
static STOPPED: AtomicBool = AtomicBool::new(false);

/// A folder that is removed when it is dropped, and when the process is interrupted or terminated.
pub struct Temporary(PathBuf);

impl Temporary {
    /// Creates an empty folder for this process.
    ///
    /// # Errors
    /// A folder that cannot be created.
    pub fn new(seed: u64) -> Result<Self, CommandError> {
        let path = std::env::temp_dir().join(format!("kisspoint-blind-{}-{seed}", std::process::id()));
        std::fs::create_dir_all(&path).map_err(at(&path))?;
        *OPEN.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Some(path.clone());
        // If the process creates a second folder, the handler is installed already and this call fails harmlessly.
        let _ = ctrlc::set_handler(leave);
        Ok(Self(path))
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Whether the process is about to end, so that nothing more may be written.
pub fn stopped() -> bool {
    STOPPED.load(Ordering::SeqCst)
}

fn leave() {
    STOPPED.store(true, Ordering::SeqCst);
    let open = OPEN.lock().unwrap_or_else(std::sync::PoisonError::into_inner).take();
    if let Some(path) = open {
        // A thread that is still writing a car may need a moment to notice the stop flag.
        for _ in 0..20 {
            let _ = std::fs::remove_dir_all(&path);
            std::thread::sleep(Duration::from_millis(20));
            if !path.exists() {
                break;
            }
        }
    }
    std::process::exit(INTERRUPTED);
}
