//! Choices derived from the fuzzer's bytes; when they run out, all further choices are 0.

use kisspoint::fmi2::types::CallbackFunctions;
use kisspoint::fmi2::variables::Description;
use kisspoint::fmi2::{controller, exports::*, plant, types::CO_SIMULATION};
use std::ffi::{CString, c_void};
use std::ptr;

/// Both models.
pub fn models() -> [(&'static str, &'static Description); 2] {
    [(plant::GUID, &plant::DESCRIPTION), (controller::GUID, &controller::DESCRIPTION)]
}

/// A new instance without a logger.
pub fn instance(guid: &str) -> *mut c_void {
    let guid = CString::new(guid).expect("a GUID holds no zero");
    let made = fmi2Instantiate(c"fuzzed".as_ptr(), CO_SIMULATION, guid.as_ptr(), ptr::null(), &CallbackFunctions::NONE, 0, 0);
    assert!(!made.is_null());
    made
}

/// The remaining bytes.
pub struct Bytes<'a>(pub &'a [u8]);

impl Bytes<'_> {
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
    pub fn byte(&mut self) -> u8 {
        let Some((first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        *first
    }
    pub fn below(&mut self, n: usize) -> usize {
        let wide = usize::from(self.byte()) << 8 | usize::from(self.byte());
        wide % n
    }
    pub fn word(&mut self) -> u64 {
        u64::from_le_bytes(std::array::from_fn(|_| self.byte()))
    }
    #[allow(dead_code, reason = "of one target alone")]
    /// A value that is often a bound, often between the bounds, and sometimes arbitrary.
    pub fn value(&mut self, start: f64, min: f64, max: f64) -> f64 {
        let share = f64::from(self.byte()) / 255.0;
        match self.byte() % 8 {
            0 => min,
            1 => max,
            2 => 0.0,
            3 => f64::from_bits(self.word()),
            4 => start,
            5 => start * (0.5 + share),
            _ if min.is_finite() && max.is_finite() => min + (max - min) * share,
            _ => 1e3 * (share - 0.5),
        }
    }
}
