//! What the C sources of an FMU (`packaging/sources`) and the plant in a report (`src/report/plant.js`) need beside the functions of FMI 2.0: memory for
//! arguments, a logger, and a word of what the module is made of.
//!
//! There the library lies behind a memory of its own. The other side copies arguments in and results out, and hands messages on.

use std::alloc::{Layout, alloc, dealloc};
use std::ffi::{c_char, c_int, c_void};

const ALIGNMENT: usize = 8;

/// Stands among the constants of the module, so that one of another version is seen for what it is.
static SOURCES: &str = concat!("kisspoint-sources:", env!("KISSPOINT_SOURCES"));

/// Address of the words that name the sources.
#[unsafe(no_mangle)]
pub extern "C" fn kisspoint_sources() -> *const u8 {
    SOURCES.as_ptr()
}

#[link(wasm_import_module = "env")]
unsafe extern "C" {
    /// The other side's logger.
    fn kisspoint_log(environment: *mut c_void, name: *const c_char, status: c_int, category: *const c_char, message: *const c_char);
}

/// Room for `size` bytes; NULL if there is none.
#[unsafe(no_mangle)]
pub extern "C" fn kisspoint_allocate(size: usize) -> *mut u8 {
    // SAFETY: the size is not 0.
    Layout::from_size_align(size.max(1), ALIGNMENT).map_or(std::ptr::null_mut(), |layout| unsafe { alloc(layout) })
}

/// Gives room back that [`kisspoint_allocate`] gave for `size` bytes.
///
/// # Safety
/// It did.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kisspoint_release(room: *mut u8, size: usize) {
    if let Ok(layout) = Layout::from_size_align(size.max(1), ALIGNMENT) {
        // SAFETY: the caller's promise.
        unsafe { dealloc(room, layout) };
    }
}

/// The last argument stands for those that a variadic function takes on this target.
unsafe extern "C" fn logger(
    environment: *mut c_void,
    name: *const c_char,
    status: c_int,
    category: *const c_char,
    message: *const c_char,
    _: *const c_void,
) {
    // SAFETY: all come from a message on its way.
    unsafe { kisspoint_log(environment, name, status, category, message) };
}

/// Address of the logger that `fmi2Instantiate` is to be given.
#[unsafe(no_mangle)]
pub extern "C" fn kisspoint_logger() -> usize {
    logger as *const () as usize
}
