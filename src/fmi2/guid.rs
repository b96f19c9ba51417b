//! The GUID of an FMU: its first 24 characters identify the model and its interface, the last twelve its start values.
//!
//! An importer that keeps FMUs by their GUID cannot take one car for another, and the library refuses to start with values other than those that the
//! GUID identifies. `build.rs` shares this file.

/// Length of a GUID.
pub const LENGTH: usize = 36;

/// Number of characters that identify the model and its interface.
pub const OF_INTERFACE: usize = 24;

const BASIS: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
const PRIME: u128 = 0x0000_0000_0100_0000_0000_0000_0000_013b;

/// FNV-1a with 128 bits.
pub fn hash(bytes: impl Iterator<Item = u8>) -> u128 {
    bytes.fold(BASIS, |sum, byte| (sum ^ u128::from(byte)).wrapping_mul(PRIME))
}

/// The twelve characters for these start values, in the order of the model description, followed by the numbers of faults and of a campaign's findings.
pub fn tail(starts: impl Iterator<Item = f64>) -> [u8; LENGTH - OF_INTERFACE] {
    // Like `hash`, but one 64-bit word at a time, because every instance computes it. Folding in the upper half lets high bits affect low ones, and
    // two more words do so for the bits of the last one. Adding 0.0 turns −0 into +0.
    let folded = starts.chain([0.0; 2]).fold(BASIS, |sum, x| {
        let product = (sum ^ u128::from((x + 0.0).to_bits())).wrapping_mul(PRIME);
        product ^ (product >> 64)
    });
    std::array::from_fn(|k| b"0123456789abcdef"[(folded >> (4 * k)) as usize & 0xf])
}
