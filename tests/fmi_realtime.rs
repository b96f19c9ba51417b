//! After initialization, an FMU allocates no memory in stepping, getting, setting, tuning, refusing, and saving into an existing state. The work of a step is bounded, whatever
//! happens in it.

use kisspoint::fmi2::{controller, exports::*, plant, types::*};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::ffi::{CString, c_char, c_int, c_void};
use std::ptr;

struct Counting;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call is forwarded to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|n| n.set(n.get() + 1));
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        COUNT.with(|n| n.set(n.get() + 1));
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations(work: impl FnOnce()) -> usize {
    let before = COUNT.get();
    work();
    COUNT.get() - before
}

/// A C implementation of `fmi2CallbackLogger` may declare fewer parameters than it is called with.
unsafe extern "C" fn silent(_: *mut c_void, _: *const c_char, _: c_int, _: *const c_char, _: *const c_char) {}

fn initialized(guid: &str) -> *mut c_void {
    // SAFETY: the calling convention lets a C function ignore trailing arguments.
    let logger: LoggerFn = unsafe {
        std::mem::transmute::<unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char), LoggerFn>(silent)
    };
    let callbacks = CallbackFunctions { logger: Some(logger), ..CallbackFunctions::NONE };
    let guid = CString::new(guid).unwrap();
    let c = fmi2Instantiate(c"x".as_ptr(), CO_SIMULATION, guid.as_ptr(), ptr::null(), &callbacks, 0, 1);
    assert!(!c.is_null());
    assert_eq!(fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0), Status::Ok);
    assert_eq!(fmi2EnterInitializationMode(c), Status::Ok);
    assert_eq!(fmi2ExitInitializationMode(c), Status::Ok);
    c
}

fn set(c: *mut c_void, vr: u32, value: f64) -> Status {
    fmi2SetReal(c, &vr, 1, &value)
}

/// A deserialized state can also be overwritten without allocation, even after delay lines have grown that it did not contain.
#[test]
fn nothing_is_allocated_in_saving_into_a_state_that_was_deserialized() {
    for guid in [plant::GUID, controller::GUID] {
        let c = initialized(guid);
        let (mut first, mut size, mut state) = (ptr::null_mut(), 0, ptr::null_mut());
        assert_eq!((fmi2GetFMUstate(c, &mut first), fmi2SerializedFMUstateSize(c, first, &mut size)), (Status::Ok, Status::Ok));
        let mut bytes = vec![0_i8; size];
        assert_eq!(fmi2SerializeFMUstate(c, first, bytes.as_mut_ptr().cast(), size), Status::Ok);
        assert_eq!(fmi2DeSerializeFMUstate(c, bytes.as_ptr().cast(), size, &mut state), Status::Ok);
        if guid == plant::GUID {
            for vr in [
                plant::vr::effect_actuator_delay_delay,
                plant::vr::effect_clutch_speed_delay_delay,
                plant::vr::effect_engine_speed_delay_delay,
            ] {
                assert_eq!(set(c, vr, 0.1), Status::Ok);
            }
        }
        let count = allocations(|| {
            for k in 0..2000 {
                if guid == plant::GUID {
                    assert_eq!(set(c, plant::vr::x_to, 1e-3 * f64::from(k)), Status::Ok);
                }
                assert_eq!(fmi2DoStep(c, f64::from(k) * 1e-3, 1e-3, 0), Status::Ok);
                assert_eq!(fmi2GetFMUstate(c, &mut state), Status::Ok);
            }
        });
        assert_eq!(count, 0, "allocations and frees in 2000 saved steps");
        for state in [&mut first, &mut state] {
            assert_eq!(fmi2FreeFMUstate(c, state), Status::Ok);
        }
        fmi2FreeInstance(c);
    }
}

#[test]
fn nothing_is_allocated_after_initialization() {
    let (p, k) = (initialized(plant::GUID), initialized(controller::GUID));
    let (mut saved_p, mut saved_k) = (ptr::null_mut(), ptr::null_mut());
    assert_eq!((fmi2GetFMUstate(p, &mut saved_p), fmi2GetFMUstate(k, &mut saved_k)), (Status::Ok, Status::Ok));
    let from_plant = [plant::vr::omega_f, plant::vr::omega_c, plant::vr::T_e];
    let to_controller = [controller::vr::omega_f, controller::vr::omega_c, controller::vr::T_e];
    let from_controller = [controller::vr::x_to, controller::vr::T_e_ref];
    let to_plant = [plant::vr::x_to, plant::vr::T_e_ref];
    let mut locked = false;
    let count = allocations(|| {
        for n in 0..3000 {
            let t = f64::from(n) * 1e-3;
            let (mut y, mut u) = ([0.0; 3], [0.0; 2]);
            assert_eq!(fmi2GetReal(p, from_plant.as_ptr(), 3, y.as_mut_ptr()), Status::Ok);
            assert_eq!(fmi2SetReal(k, to_controller.as_ptr(), 3, y.as_ptr()), Status::Ok);
            assert_eq!(fmi2DoStep(k, t, 1e-3, 1), Status::Ok);
            assert_eq!(fmi2GetReal(k, from_controller.as_ptr(), 2, u.as_mut_ptr()), Status::Ok);
            assert_eq!(fmi2SetReal(p, to_plant.as_ptr(), 2, u.as_ptr()), Status::Ok);
            assert_eq!(fmi2GetFMUstate(p, &mut saved_p), Status::Ok);
            assert_eq!(fmi2GetFMUstate(k, &mut saved_k), Status::Ok);
            assert_eq!(fmi2DoStep(p, t, 1e-3, 0), Status::Ok);
            // Roll back, inject effects that have states of their own, and repeat the step.
            assert_eq!(fmi2SetFMUstate(p, saved_p), Status::Ok);
            if n % 100 == 50 {
                assert_eq!(set(p, plant::vr::effect_actuator_delay_delay, 0.02), Status::Ok);
                assert_eq!(set(p, plant::vr::effect_clutch_speed_delay_delay, 0.001), Status::Ok);
                assert_eq!(set(p, plant::vr::effect_driveline_compliance_compliance, 1e-4), Status::Ok);
                assert_eq!(set(p, plant::vr::effect_cushion_hysteresis_width, 0.1), Status::Ok);
                assert_eq!(set(k, controller::vr::controller_kp_engine, 2.1), Status::Ok);
            }
            assert_eq!(fmi2DoStep(p, t, 1e-3, 0), Status::Ok);
            assert_eq!(set(p, plant::vr::x_to, f64::NAN), Status::Error);
            assert_eq!(fmi2DoStep(p, t, -1.0, 0), Status::Error);
            let mut phase = 0;
            assert_eq!(fmi2GetInteger(p, &plant::vr::phase, 1, &mut phase), Status::Ok);
            locked |= phase == 3;
        }
    });
    assert_eq!(count, 0, "allocations and frees in 3000 coupled steps");
    assert!(locked, "the run must pass through lock-up");
    for (c, state) in [(p, &mut saved_p), (k, &mut saved_k)] {
        assert_eq!(fmi2FreeFMUstate(c, state), Status::Ok);
        fmi2FreeInstance(c);
    }
}
