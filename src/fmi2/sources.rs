//! What the C sources of an FMU (`packaging/sources`) and the plant in a report (`src/report/plant.js`) need beyond the functions of FMI 2.0: memory
//! for arguments, a logger, and an identification of the sources from which the module was built.
//!
//! There the library has a memory of its own. The caller copies arguments in and results out, and passes messages on.

use std::alloc::{Layout, alloc, dealloc};
use std::ffi::{c_char, c_int, c_void};

const ALIGNMENT: usize = 8;

/// Placed among the constants of the module, so that a module of another version can be recognised.
static SOURCES: &str = concat!("kisspoint-sources:", env!("KISSPOINT_SOURCES"));

/// Address of the text that identifies the sources.
#[unsafe(no_mangle)]
pub extern "C" fn kisspoint_sources() -> *const u8 {
    SOURCES.as_ptr()
}

#[link(wasm_import_module = "env")]
unsafe extern "C" {
    /// The caller's logger.
    fn kisspoint_log(environment: *mut c_void, name: *const c_char, status: c_int, category: *const c_char, message: *const c_char);
}

/// Memory of `size` bytes; NULL if there is none.
#[unsafe(no_mangle)]
pub extern "C" fn kisspoint_allocate(size: usize) -> *mut u8 {
    // SAFETY: the size is not 0.
    Layout::from_size_align(size.max(1), ALIGNMENT).map_or(std::ptr::null_mut(), |layout| unsafe { alloc(layout) })
}

/// Releases memory that [`kisspoint_allocate`] returned for `size` bytes.
///
/// # Safety
/// [`kisspoint_allocate`] must have returned `room` for this `size`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kisspoint_release(room: *mut u8, size: usize) {
    if let Ok(layout) = Layout::from_size_align(size.max(1), ALIGNMENT) {
        // SAFETY: the caller's responsibility.
        unsafe { dealloc(room, layout) };
    }
}

/// The last argument stands for the variadic arguments, which this target passes as a single pointer.
unsafe extern "C" fn logger(
    environment: *mut c_void,
    name: *const c_char,
    status: c_int,
    category: *const c_char,
    message: *const c_char,
    _: *const c_void,
) {
    // SAFETY: all pointers come from a message that is being sent.
    unsafe { kisspoint_log(environment, name, status, category, message) };
}

/// Address of the logger to be passed to `fmi2Instantiate`.
#[unsafe(no_mangle)]
pub extern "C" fn kisspoint_logger() -> usize {
    logger as *const () as usize
}
