//! `fmi2FMUstate`: a saved state that the importer holds a pointer to.

use super::guard::fill;
use super::instance::Instance;
use super::refusal::Refusal;
use super::types::Status;
use super::words;
use std::ffi::{c_char, c_void};

/// Marks a saved state that has not been freed.
const ALIVE: u64 = 0x4b69_7373_5361_7665;

/// Longest serialized state that is accepted: a greater size is a mistake.
const MOST_BYTES: usize = 1 << 20;

/// What `fmi2FMUstate` points to.
#[repr(C)]
struct Saved {
    magic: u64,
    /// GUID of the model whose state it is.
    guid: &'static str,
    payload: Vec<u64>,
}

fn saved<'a>(pointer: *mut c_void) -> Result<&'a mut Saved, Refusal> {
    let pointer = pointer.cast::<Saved>();
    if pointer.is_null() {
        return Err(Refusal::Null("FMUstate"));
    }
    // SAFETY: the importer promises a pointer that fmi2GetFMUstate gave; the magic number is read first to see whether it did.
    let alive = pointer.is_aligned() && unsafe { (&raw const (*pointer).magic).read() == ALIVE };
    // SAFETY: fmi2GetFMUstate gave it, and only one call at a time uses it.
    if alive { Ok(unsafe { &mut *pointer }) } else { Err(Refusal::DamagedState("the pointer is none that fmi2GetFMUstate gave")) }
}

fn of_model<'a>(instance: &Instance, pointer: *mut c_void) -> Result<&'a mut Saved, Refusal> {
    let state = saved(pointer)?;
    if state.guid == instance.description.guid { Ok(state) } else { Err(Refusal::DamagedState("it belongs to another model")) }
}

fn put(target: *mut *mut c_void, payload: Vec<u64>, guid: &'static str) {
    let state = Box::new(Saved { magic: ALIVE, guid, payload });
    // SAFETY: the callers have checked the target.
    unsafe { target.write(Box::into_raw(state).cast()) };
}

fn check_target(target: *mut *mut c_void) -> Result<(), Refusal> {
    match target {
        t if t.is_null() => Err(Refusal::Null("FMUstate")),
        t if !t.is_aligned() => Err(Refusal::Pointer("FMUstate")),
        _ => Ok(()),
    }
}

/// `fmi2GetFMUstate`: an existing state is overwritten, which allocates nothing. Values that were written directly are checked first, so that a state holds checked values only.
pub(super) fn get(instance: &mut Instance, target: *mut *mut c_void) -> Result<Status, Refusal> {
    check_target(target)?;
    instance.check_direct_writes()?;
    // SAFETY: checked; the standard requires the importer to set it to NULL or to an earlier state.
    let present = unsafe { target.read() };
    if present.is_null() {
        let mut payload = Vec::with_capacity(instance.most_words());
        instance.save(&mut payload);
        put(target, payload, instance.description.guid);
    } else {
        let state = of_model(instance, present)?;
        state.payload.clear();
        instance.save(&mut state.payload);
    }
    Ok(Status::Ok)
}

/// `fmi2SetFMUstate`.
pub(super) fn set(instance: &mut Instance, pointer: *mut c_void) -> Result<Status, Refusal> {
    let state = of_model(instance, pointer)?;
    instance.load(&state.payload)
}

/// `fmi2FreeFMUstate`: NULL, either as the argument or behind it, is accepted and has no effect.
pub(super) fn free(target: *mut *mut c_void) -> Result<Status, Refusal> {
    if target.is_null() {
        return Ok(Status::Ok);
    }
    check_target(target)?;
    // SAFETY: checked.
    let pointer = unsafe { target.read() };
    if pointer.is_null() {
        return Ok(Status::Ok);
    }
    saved(pointer)?.magic = 0;
    // SAFETY: `put` made it with Box, and the magic number showed that it has not been freed.
    unsafe {
        drop(Box::from_raw(pointer.cast::<Saved>()));
        target.write(std::ptr::null_mut());
    }
    Ok(Status::Ok)
}

/// `fmi2SerializedFMUstateSize`.
pub(super) fn size(instance: &Instance, pointer: *mut c_void, size: *mut usize) -> Result<Status, Refusal> {
    let bytes = words::size(&of_model(instance, pointer)?.payload);
    fill(size, 1, "size", |_| Ok(bytes))
}

/// `fmi2SerializeFMUstate`.
pub(super) fn serialize(instance: &Instance, pointer: *mut c_void, bytes: *mut c_char, size: usize) -> Result<Status, Refusal> {
    let state = of_model(instance, pointer)?;
    if size != words::size(&state.payload) {
        return Err(Refusal::Argument("size", size as f64, "not what fmi2SerializedFMUstateSize gave"));
    }
    let mut source = words::bytes(instance.description.guid, &state.payload);
    fill(bytes, size, "serializedState", |_| Ok(source.next().unwrap_or(0) as c_char))
}

/// `fmi2DeSerializeFMUstate`: always creates a new state, because the pointer at the target may have any value.
pub(super) fn deserialize(instance: &Instance, bytes: *const c_char, size: usize, target: *mut *mut c_void) -> Result<Status, Refusal> {
    check_target(target)?;
    if size > MOST_BYTES {
        return Err(Refusal::Argument("size", size as f64, "larger than any state of this model"));
    }
    let bytes = super::guard::array(bytes.cast::<u8>(), size, "serializedState")?;
    let mut payload = words::payload(instance.description.guid, bytes).map_err(Refusal::DamagedState)?;
    instance.check_state(&payload)?;
    // Reserves room, so that it can be overwritten in real time, like a state that fmi2GetFMUstate gave.
    payload.reserve_exact(instance.most_words().saturating_sub(payload.len()));
    put(target, payload, instance.description.guid);
    Ok(Status::Ok)
}
