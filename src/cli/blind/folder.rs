//! A temporary folder that is gone afterwards, also after an interruption.

use crate::cli::error::{CommandError, at};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Exit code after an interruption from the keyboard, as shells have it.
const INTERRUPTED: i32 = 130;

/// What an interruption has to remove.
static OPEN: Mutex<Option<PathBuf>> = Mutex::new(None);
static STOPPED: AtomicBool = AtomicBool::new(false);

/// A folder that is removed when it is dropped, and when the process is interrupted or told to end.
pub struct Temporary(PathBuf);

impl Temporary {
    /// An empty folder of this process.
    ///
    /// # Errors
    /// A folder that cannot be made.
    pub fn new(seed: u64) -> Result<Self, CommandError> {
        let path = std::env::temp_dir().join(format!("kisspoint-blind-{}-{seed}", std::process::id()));
        std::fs::create_dir_all(&path).map_err(at(&path))?;
        *OPEN.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Some(path.clone());
        // A second folder of one process finds the handler there already.
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
        // A thread that is writing a car just now may need a moment to notice.
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
