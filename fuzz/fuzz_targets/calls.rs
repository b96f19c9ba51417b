//! Arbitrary sequences of FMI calls on two instances, with arbitrary values: never a crash, and after an accepted step every output is finite.
#![no_main]

mod bytes;

use bytes::{Bytes, instance, models};
use kisspoint::fmi2::variables::{Causality, Description, Kind};
use kisspoint::fmi2::{exports::*, model_exchange::*, types::*};
use libfuzzer_sys::fuzz_target;
use std::ffi::{c_char, c_void};
use std::ptr;

/// Step sizes and times that an importer may pass; long ones would only be slow.
const TIMES: [f64; 10] = [1e-3, 1e-2, 1e-4, 1e-6, 0.0, -1e-3, 5e-2, f64::NAN, f64::INFINITY, 1e300];

struct Used {
    component: *mut c_void,
    description: &'static Description,
    state: *mut c_void,
    time: f64,
}

impl Used {
    fn outputs_are_numbers(&self) {
        for v in self.description.variables.iter().filter(|v| v.causality == Causality::Output && v.kind == Kind::Real) {
            let mut x = f64::NAN;
            assert_eq!(fmi2GetReal(self.component, &v.value_reference, 1, &mut x), Status::Ok);
            assert!(x.is_finite(), "{} = {x}", v.name);
        }
    }

    fn set(&self, bytes: &mut Bytes) {
        let v = &self.description.variables[bytes.below(self.description.variables.len())];
        let reference = if bytes.byte() == 255 { bytes.word() as u32 } else { v.value_reference };
        let value = bytes.value(v.start, v.min, v.max);
        match v.kind {
            Kind::Real => fmi2SetReal(self.component, &reference, 1, &value),
            Kind::Boolean => fmi2SetBoolean(self.component, &reference, 1, &(value as i32)),
            _ => fmi2SetInteger(self.component, &reference, 1, &(value as i32)),
        };
    }

    fn step(&mut self, bytes: &mut Bytes) {
        let h = TIMES[bytes.below(TIMES.len())];
        let point = if bytes.byte() == 255 { TIMES[bytes.below(TIMES.len())] } else { self.time };
        if fmi2DoStep(self.component, point, h, 1) == Status::Ok {
            self.time = point + h;
            self.outputs_are_numbers();
        }
    }

    /// Serializes the saved state and deserializes the bytes, some of them changed if `spoil` is set.
    fn serialize(&mut self, bytes: &mut Bytes, spoil: bool) {
        let mut size = 0;
        if fmi2SerializedFMUstateSize(self.component, self.state, &mut size) != Status::Ok {
            return;
        }
        let mut stored = vec![0_u8; size];
        assert_eq!(fmi2SerializeFMUstate(self.component, self.state, stored.as_mut_ptr().cast::<c_char>(), size), Status::Ok);
        if spoil {
            let place = bytes.below(size);
            stored[place] ^= bytes.byte() | 1;
        }
        let mut back = ptr::null_mut();
        let status = fmi2DeSerializeFMUstate(self.component, stored.as_ptr().cast::<c_char>(), size, &mut back);
        assert!(!spoil || status != Status::Ok, "a changed byte was not seen");
        fmi2FreeFMUstate(self.component, &mut back);
    }

    fn call(&mut self, bytes: &mut Bytes) {
        let c = self.component;
        match bytes.byte() % 24 {
            0..=3 => self.set(bytes),
            4..=7 => self.step(bytes),
            8 => {
                _ = fmi2SetupExperiment(
                    c,
                    i32::from(bytes.byte()),
                    TIMES[bytes.below(10)],
                    TIMES[bytes.below(10)],
                    i32::from(bytes.byte() & 1),
                    1.0,
                )
            }
            9 => _ = fmi2EnterInitializationMode(c),
            10 => {
                if fmi2ExitInitializationMode(c) == Status::Ok {
                    self.outputs_are_numbers();
                }
            }
            11 => _ = fmi2Terminate(c),
            12 => {
                assert_eq!(fmi2Reset(c), Status::Ok);
                self.time = 0.0;
            }
            13 | 14 => _ = fmi2GetFMUstate(c, &mut self.state),
            15 => _ = fmi2SetFMUstate(c, self.state),
            16 => _ = fmi2FreeFMUstate(c, &mut self.state),
            17 => {
                let spoil = bytes.byte() & 1 == 1;
                self.serialize(bytes, spoil);
            }
            18 => {
                let mut integer = 0;
                _ = fmi2GetInteger(c, &(bytes.word() as u32), 1, &mut integer);
                _ = fmi2GetBoolean(c, ptr::null(), bytes.below(3), &mut integer);
            }
            19 => {
                let (mut real, mut status) = (0.0, Status::Ok);
                _ = fmi2GetRealStatus(c, i32::from(bytes.byte() as i8), &mut real);
                _ = fmi2GetStatus(c, i32::from(bytes.byte() as i8), &mut status);
            }
            20 => _ = fmi2SetDebugLogging(c, 1, 1, [c"logAll".as_ptr(), ptr::null()].as_ptr().wrapping_add(bytes.below(2))),
            21 => _ = fmi2SetTime(c, bytes.value(0.0, -1.0, 1.0)),
            22 => _ = fmi2CancelStep(c),
            _ => _ = fmi2GetDirectionalDerivative(c, ptr::null(), 0, ptr::null(), 0, ptr::null(), ptr::null_mut()),
        }
    }
}

fuzz_target!(|data: &[u8]| {
    let mut bytes = Bytes(data);
    let mut used = models().map(|(guid, description)| Used { component: instance(guid), description, state: ptr::null_mut(), time: 0.0 });
    if bytes.byte() & 1 == 1 {
        // Initializes directly, so that not every input has to find the way to stepping by itself.
        for u in &used {
            assert_eq!(fmi2EnterInitializationMode(u.component), Status::Ok);
            assert_eq!(fmi2ExitInitializationMode(u.component), Status::Ok);
        }
    }
    for _ in 0..300 {
        if bytes.is_empty() {
            break;
        }
        let which = usize::from(bytes.byte() & 1);
        used[which].call(&mut bytes);
    }
    for mut u in used {
        fmi2FreeFMUstate(u.component, &mut u.state);
        fmi2FreeInstance(u.component);
    }
});
