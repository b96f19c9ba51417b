//! The GUID of an FMU: its first 24 characters name model and interface, the twelve after them its start values.
//!
//! An importer that keeps FMUs by their GUID cannot take one car for another, and the library refuses to start with other values than
//! those that the GUID names. `build.rs` shares this file.

/// Length of a GUID.
pub const LENGTH: usize = 36;

/// Characters that name the model and its interface.
pub const OF_INTERFACE: usize = 24;

/// FNV-1a with 128 bits.
pub fn hash(bytes: impl Iterator<Item = u8>) -> u128 {
    bytes.fold(0x6c62_272e_07bb_0142_62b8_2175_6295_c58d, |sum, byte| {
        (sum ^ u128::from(byte)).wrapping_mul(0x0000_0000_0100_0000_0000_0000_0000_013b)
    })
}

/// The twelve characters for these start values, in the order of the model description, followed by the numbers of faults.
pub fn tail(starts: impl Iterator<Item = f64>) -> [u8; LENGTH - OF_INTERFACE] {
    // A sum with 0 makes one zero of both.
    let sum = hash(starts.flat_map(|x| (x + 0.0).to_bits().to_le_bytes()));
    let folded = sum ^ (sum >> 64);
    std::array::from_fn(|k| b"0123456789abcdef"[(folded >> (4 * k)) as usize & 0xf])
}
