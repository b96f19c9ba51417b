//! Direct access to the values of an instance, for a calibration tool that knows them by the FMU's A2L file.
#![allow(clippy::not_unsafe_ptr_arg_deref)]

use super::call::Function;
use super::guard::{fill, guard};
use super::types::Status;
use std::ffi::c_void;

const VALUES: &Function = &Function { name: "kisspoint_values", allowed: u8::MAX };

/// Writes the address of the instance's values, 64-bit floats in the order of the model description, and their number. They may be read and
/// written between calls until the instance is freed; what is written is checked before the model starts and before the next step.
#[unsafe(no_mangle)]
pub extern "C" fn kisspoint_values(c: *mut c_void, values: *mut *mut f64, count: *mut usize) -> Status {
    guard(c, VALUES, |instance| {
        let shared = instance.share_values();
        let (pointer, length) = (shared.as_mut_ptr(), shared.len());
        fill(values, 1, "values", |_| Ok(pointer))?;
        fill(count, 1, "count", |_| Ok(length))
    })
}
