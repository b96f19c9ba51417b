//! The GUID of an FMU: its first 24 characters name model and interface, the twelve after them its start values.
//!
//! An importer that keeps FMUs by their GUID cannot take one car for another, and the library refuses to start with other values than
//! those that the GUID names. `build.rs` shares this file.

/// Length of a GUID.
pub const LENGTH: usize = 36;

/// Characters that name the model and its interface.
pub const OF_INTERFACE: usize = 24;

const BASIS: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
const PRIME: u128 = 0x0000_0000_0100_0000_0000_0000_0000_013b;

/// FNV-1a with 128 bits.
pub fn hash(bytes: impl Iterator<Item = u8>) -> u128 {
    bytes.fold(BASIS, |sum, byte| (sum ^ u128::from(byte)).wrapping_mul(PRIME))
}

/// The twelve characters for these start values, in the order of the model description, followed by the numbers of faults and of what a campaign has found.
pub fn tail(starts: impl Iterator<Item = f64>) -> [u8; LENGTH - OF_INTERFACE] {
    // As above, but a word at a time, for every instance asks: the upper half is folded in, or high bits would not come down, and two words more
    // bring those of the last one down. A sum with 0 makes one zero of both.
    let folded = starts.chain([0.0; 2]).fold(BASIS, |sum, x| {
        let product = (sum ^ u128::from((x + 0.0).to_bits())).wrapping_mul(PRIME);
        product ^ (product >> 64)
    });
    std::array::from_fn(|k| b"0123456789abcdef"[(folded >> (4 * k)) as usize & 0xf])
}
