//! The single entry point for calls from C: null check, identity check, call-sequence mask, `catch_unwind`, and, at the very end, the log line.

use super::call::{CallState, Function};
use super::instance::Instance;
use super::log::Category;
use super::refusal::Refusal;
use super::resource::forget_latest;
use super::types::Status;
use std::cell::UnsafeCell;
use std::ffi::{CStr, c_char, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Marks a component that has not been freed.
const ALIVE: u64 = 0x4b69_7373_506f_696e;

/// Largest number of values in one call: a greater count is a mistake.
const MOST_VALUES: usize = 1 << 20;

/// What `fmi2Component` points to.
#[repr(C)]
pub(super) struct Component {
    magic: u64,
    /// Whether a call is running; any other call on the instance is then refused.
    busy: AtomicBool,
    instance: UnsafeCell<Instance>,
}

/// Number of instances that the importer holds. What they share is dropped with the last one, so that a library that is unloaded leaves nothing behind.
static HELD: AtomicUsize = AtomicUsize::new(0);

/// Gives an instance to the importer.
pub(super) fn hand_out(instance: Instance) -> *mut c_void {
    HELD.fetch_add(1, Ordering::Relaxed);
    let component = Component { magic: ALIVE, busy: AtomicBool::new(false), instance: UnsafeCell::new(instance) };
    Box::into_raw(Box::new(component)).cast()
}

fn component<'a>(pointer: *mut c_void) -> Option<&'a Component> {
    let pointer = pointer.cast::<Component>();
    if pointer.is_null() || !pointer.is_aligned() {
        return None;
    }
    // SAFETY: the importer promises a pointer that fmi2Instantiate gave; the magic number is read first to see whether it did.
    unsafe { ((&raw const (*pointer).magic).read() == ALIVE).then(|| &*pointer) }
}

/// Takes an instance back and drops it; any other pointer is ignored.
pub(super) fn take_back(pointer: *mut c_void) {
    let Some(held) = component(pointer) else { return };
    if held.busy.load(Ordering::Relaxed) {
        return;
    }
    let pointer = pointer.cast::<Component>();
    // A panic while dropping must not reach C either.
    let _ = catch_unwind(AssertUnwindSafe(|| {
        // SAFETY: hand_out made it with Box, and the magic number, cleared here, shows that it has not been taken back before.
        unsafe {
            (&raw mut (*pointer).magic).write_volatile(0);
            drop(Box::from_raw(pointer));
        }
        if HELD.fetch_sub(1, Ordering::AcqRel) == 1 {
            forget_latest();
        }
    }));
}

/// Runs `body` on the instance behind `pointer` if `function` may be called now.
#[inline]
pub(super) fn guard(
    pointer: *mut c_void,
    function: &'static Function,
    body: impl FnOnce(&mut Instance) -> Result<Status, Refusal>,
) -> Status {
    let Some(component) = component(pointer) else { return Status::Error };
    // Plain loads and stores suffice, because an instance belongs to one thread at a time. A logger may call back, because it is called after everything else.
    if component.busy.load(Ordering::Relaxed) {
        return Status::Error;
    }
    component.busy.store(true, Ordering::Relaxed);
    // SAFETY: no other call is running on this instance.
    let instance = unsafe { &mut *component.instance.get() };
    let outcome = if instance.call_state as u8 & function.allowed == 0 {
        Err(Refusal::CallSequence(instance.call_state))
    } else {
        catch_unwind(AssertUnwindSafe(|| body(instance))).unwrap_or_else(|_| {
            instance.call_state = CallState::Failed;
            Err(Refusal::Panic)
        })
    };
    let status = outcome.unwrap_or_else(|refusal| report(instance, function, &refusal));
    let message = instance.log.take();
    component.busy.store(false, Ordering::Relaxed);
    // Nothing is accessed after this: the logger may have freed the instance, or may never return.
    if let Some(message) = message {
        message.send();
    }
    status
}

#[cold]
fn report(instance: &mut Instance, function: &Function, refusal: &Refusal) -> Status {
    let status = refusal.status();
    instance.log.write(status, Category::Error, format_args!("{}: {refusal}", function.name));
    status
}

/// The importer's array of `count` values.
///
/// # Errors
/// NULL although `count` is not 0, an excessive count, or a pointer that is not aligned.
pub(super) fn array<'a, T>(pointer: *const T, count: usize, name: &'static str) -> Result<&'a [T], Refusal> {
    check_array(pointer, count, name)?;
    // SAFETY: checked above; that `count` values are there is the importer's responsibility.
    Ok(if count == 0 { &[] } else { unsafe { std::slice::from_raw_parts(pointer, count) } })
}

/// Writes `count` values into the importer's array.
///
/// # Errors
/// Those of [`array()`] and of `value`.
pub(super) fn fill<T>(
    pointer: *mut T,
    count: usize,
    name: &'static str,
    mut value: impl FnMut(usize) -> Result<T, Refusal>,
) -> Result<Status, Refusal> {
    check_array(pointer, count, name)?;
    for k in 0..count {
        // SAFETY: as in `array`; the memory need not be initialized, so it is written through the pointer.
        unsafe { pointer.add(k).write(value(k)?) };
    }
    Ok(Status::Ok)
}

fn check_array<T>(pointer: *const T, count: usize, name: &'static str) -> Result<(), Refusal> {
    if count > MOST_VALUES {
        return Err(Refusal::Argument("nvr", count as f64, "more than any model has variables"));
    }
    match pointer {
        _ if count == 0 => Ok(()),
        p if p.is_null() => Err(Refusal::Null(name)),
        p if !p.is_aligned() => Err(Refusal::Pointer(name)),
        _ => Ok(()),
    }
}

/// The importer's string; `None` if it is NULL.
pub(super) fn text<'a>(pointer: *const c_char) -> Option<&'a CStr> {
    // SAFETY: the importer promises NUL-terminated strings.
    (!pointer.is_null()).then(|| unsafe { CStr::from_ptr(pointer) })
}
