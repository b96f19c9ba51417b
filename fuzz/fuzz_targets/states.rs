//! Serialized states: arbitrary bytes are refused. If words are changed and the checksum renewed, the state is refused, or steps from it give numbers or an error, and a reset
//! recovers.
#![no_main]

mod bytes;

use bytes::{Bytes, instance, models};
use kisspoint::fmi2::variables::{Causality, Kind};
use kisspoint::fmi2::{exports::*, types::*, words};
use libfuzzer_sys::fuzz_target;
use std::ffi::{c_char, c_void};
use std::ptr;

fn serialized(c: *mut c_void) -> Vec<u8> {
    let (mut state, mut size) = (ptr::null_mut(), 0);
    assert_eq!(fmi2GetFMUstate(c, &mut state), Status::Ok);
    assert_eq!(fmi2SerializedFMUstateSize(c, state, &mut size), Status::Ok);
    let mut stored = vec![0_u8; size];
    assert_eq!(fmi2SerializeFMUstate(c, state, stored.as_mut_ptr().cast::<c_char>(), size), Status::Ok);
    assert_eq!(fmi2FreeFMUstate(c, &mut state), Status::Ok);
    stored
}

/// Deserializes the bytes and sets the state. Returns whether they were accepted.
fn take_up(c: *mut c_void, stored: &[u8]) -> bool {
    let mut state = ptr::null_mut();
    if fmi2DeSerializeFMUstate(c, stored.as_ptr().cast::<c_char>(), stored.len(), &mut state) != Status::Ok {
        assert!(state.is_null(), "a refused state was handed out");
        return false;
    }
    assert_eq!(fmi2SetFMUstate(c, state), Status::Ok, "a state that was accepted must be one");
    assert_eq!(fmi2FreeFMUstate(c, &mut state), Status::Ok);
    true
}

fuzz_target!(|data: &[u8]| {
    let mut bytes = Bytes(data);
    let (guid, description) = models()[usize::from(bytes.byte() & 1)];
    let c = instance(guid);
    assert_eq!(fmi2EnterInitializationMode(c), Status::Ok);
    assert_eq!(fmi2ExitInitializationMode(c), Status::Ok);
    for v in description.variables.iter().filter(|v| v.name.ends_with(".delay")) {
        // A state with delay lines is longer.
        _ = fmi2SetReal(c, &v.value_reference, 1, &(f64::from(bytes.byte() % 4) * 0.01));
    }
    let steps = bytes.byte() % 64;
    for k in 0..steps {
        assert_eq!(fmi2DoStep(c, f64::from(k) * 0.01, 0.01, 1), Status::Ok);
    }
    let good = serialized(c);
    let raw = bytes.byte() == 0;
    if raw {
        assert!(bytes.0 == good || !take_up(c, bytes.0), "loose bytes were accepted");
    }
    let mut payload = words::payload(guid, &good).expect("our own state");
    while !bytes.is_empty() {
        let place = bytes.below(payload.len());
        match bytes.byte() % 4 {
            0 => payload.truncate(place + 1),
            1 => payload[place] = bytes.word(),
            2 => payload[place] = u64::from(bytes.byte()),
            _ => payload[place] = (f64::from_bits(payload[place]) * f64::from(bytes.byte())).to_bits(),
        }
    }
    let sealed: Vec<u8> = words::bytes(guid, &payload).collect();
    if take_up(c, &sealed) {
        // A zero may lose its sign, since that changes no value.
        let same = |a: &u64, b: &u64| a == b || (a | b) << 1 == 0;
        let again = words::payload(guid, &serialized(c)).expect("our own state");
        assert!(again.len() == payload.len() && again.iter().zip(&payload).all(|(a, b)| same(a, b)), "a state that was taken up is written as it was read");
        let mut t = 0.0;
        _ = fmi2GetRealStatus(c, LAST_SUCCESSFUL_TIME, &mut t);
        for _ in 0..5 {
            if fmi2DoStep(c, t, 1e-3, 1) != Status::Ok {
                break;
            }
            t += 1e-3;
            for v in description.variables.iter().filter(|v| v.causality == Causality::Output && v.kind == Kind::Real) {
                let mut x = f64::NAN;
                assert_eq!(fmi2GetReal(c, &v.value_reference, 1, &mut x), Status::Ok);
                assert!(x.is_finite(), "{} = {x}", v.name);
            }
        }
    }
    assert_eq!(fmi2Reset(c), Status::Ok);
    assert!(take_up(c, &good));
    assert_eq!(serialized(c), good);
    fmi2FreeInstance(c);
});
