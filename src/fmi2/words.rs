//! Saved states as 64-bit words, and their bytes.
//!
//! A state is described once, as a walk over its fields, which both writing and reading use. Serialized form, little endian:
//!
//! ```text
//! magic and version | GUID hash | number of words | words … | checksum
//! ```
//!
//! The words contain no pointers, and equal states give equal bytes. The checksum is FNV-1a over words: each of its steps is a bijection of the sum,
//! so that a change of any single byte is always detected.

/// `KissFMU` and the version of the layout.
const MAGIC: u64 = u64::from_le_bytes(*b"KissFMU\x01");

/// Words before and after the payload.
const FRAME: usize = 4;

/// Walks over the fields of a state, writing or reading them.
pub trait Words {
    /// A number.
    fn real(&mut self, value: &mut f64);
    /// Several numbers in sequence.
    fn reals(&mut self, values: &mut [f64]) {
        values.iter_mut().for_each(|value| self.real(value));
    }
    /// Several numbers in sequence, each of which must lie within its bounds when read from outside.
    fn reals_within(&mut self, values: &mut [f64], _: impl Iterator<Item = (f64, f64)>) {
        self.reals(values);
    }
    /// A number that need not be finite.
    fn any_real(&mut self, value: &mut f64) {
        let mut word = value.to_bits();
        self.word(&mut word, |_| true);
        *value = f64::from_bits(word);
    }
    /// A word, which must satisfy `valid` when it is read.
    fn word(&mut self, value: &mut u64, valid: impl Fn(u64) -> bool);
    /// A flag.
    fn flag(&mut self, value: &mut bool) {
        let mut word = u64::from(*value);
        self.word(&mut word, |w| w <= 1);
        *value = word == 1;
    }
    /// One of a few numbered values.
    fn choice<T: Copy>(&mut self, value: &mut T, number: fn(T) -> u64, all: &[T]) {
        let mut word = number(*value);
        self.word(&mut word, |w| all.iter().any(|t| number(*t) == w));
        if let Some(found) = all.iter().find(|t| number(**t) == word) {
            *value = *found;
        }
    }
}

/// Appends words.
pub struct Writer<'a>(pub &'a mut Vec<u64>);

impl Words for Writer<'_> {
    fn real(&mut self, value: &mut f64) {
        self.0.push(value.to_bits());
    }
    fn reals(&mut self, values: &mut [f64]) {
        self.0.extend(values.iter().map(|value| value.to_bits()));
    }
    fn word(&mut self, value: &mut u64, _: impl Fn(u64) -> bool) {
        self.0.push(*value);
    }
}

/// Takes words from the front; `failed` is set once one is missing or invalid.
pub struct Reader<'a> {
    /// The remaining words.
    pub words: &'a [u64],
    /// Whether something was missing or invalid.
    pub failed: bool,
    /// Whether the words come from outside. Those that an instance of this process saved are numbers within their bounds, because they were checked
    /// when they were set or computed.
    pub foreign: bool,
}

impl Reader<'_> {
    fn next(&mut self) -> Option<u64> {
        let (first, rest) = self.words.split_first()?;
        self.words = rest;
        Some(*first)
    }
}

impl Words for Reader<'_> {
    fn real(&mut self, value: &mut f64) {
        match self.next().map(f64::from_bits) {
            Some(read) if read.is_finite() => *value = read,
            _ => self.failed = true,
        }
    }
    fn reals(&mut self, values: &mut [f64]) {
        let Some((taken, rest)) = self.words.split_at_checked(values.len()) else {
            self.failed = true;
            return;
        };
        self.words = rest;
        for (value, word) in values.iter_mut().zip(taken) {
            *value = f64::from_bits(*word);
        }
        self.failed |= self.foreign && values.iter().any(|value| !value.is_finite());
    }
    fn reals_within(&mut self, values: &mut [f64], bounds: impl Iterator<Item = (f64, f64)>) {
        if !self.foreign {
            return self.reals(values);
        }
        for (value, (min, max)) in values.iter_mut().zip(bounds) {
            match self.next().map(f64::from_bits) {
                Some(read) if (min..=max).contains(&read) => *value = read,
                _ => self.failed = true,
            }
        }
    }
    fn word(&mut self, value: &mut u64, valid: impl Fn(u64) -> bool) {
        match self.next() {
            Some(read) if valid(read) => *value = read,
            _ => self.failed = true,
        }
    }
}

/// Number of bytes that `payload` takes.
pub fn size(payload: &[u64]) -> usize {
    8 * (FRAME + payload.len())
}

/// Hash of a GUID.
pub fn guid_hash(guid: &str) -> u64 {
    checksum(guid.bytes().map(u64::from))
}

fn checksum(words: impl Iterator<Item = u64>) -> u64 {
    words.fold(0xcbf2_9ce4_8422_2325, |sum, word| (sum ^ word).wrapping_mul(0x0000_0100_0000_01b3))
}

/// The bytes of a state of the model with this GUID.
pub fn bytes<'a>(guid: &str, payload: &'a [u64]) -> impl Iterator<Item = u8> + use<'a> {
    let head = [MAGIC, guid_hash(guid), payload.len() as u64];
    let all = move || head.into_iter().chain(payload.iter().copied());
    all().chain(std::iter::once(checksum(all()))).flat_map(u64::to_le_bytes)
}

/// Checks bytes and takes out the payload.
///
/// # Errors
/// What is wrong with the bytes.
pub fn payload(guid: &str, bytes: &[u8]) -> Result<Vec<u64>, &'static str> {
    if !bytes.len().is_multiple_of(8) || bytes.len() < 8 * FRAME {
        return Err("its length is not that of a serialized state");
    }
    let words: Vec<u64> = bytes.as_chunks::<8>().0.iter().map(|c| u64::from_le_bytes(*c)).collect();
    let (body, sum) = words.split_at(words.len() - 1);
    if body[0] != MAGIC {
        return Err("it does not begin with this version's magic number");
    }
    if body[1] != guid_hash(guid) {
        return Err("it belongs to another model or another version of it");
    }
    if body[2] != (body.len() - 3) as u64 {
        return Err("its length is not the one that was written");
    }
    if checksum(body.iter().copied()) != sum[0] {
        return Err("its checksum does not agree");
    }
    Ok(body[3..].to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_changed_byte_is_seen() {
        let state = [1.5_f64.to_bits(), 0, 7, u64::MAX];
        let good: Vec<u8> = bytes("guid", &state).collect();
        assert_eq!(good.len(), size(&state));
        assert_eq!(payload("guid", &good), Ok(state.to_vec()));
        for k in 0..good.len() {
            for change in 1..=255 {
                let mut bad = good.clone();
                bad[k] ^= change;
                assert!(payload("guid", &bad).is_err(), "byte {k} xor {change}");
            }
        }
        assert!((0..good.len()).all(|n| payload("guid", &good[..n]).is_err()));
        assert!(payload("other", &good).is_err());
    }

    /// Words from outside that are not finite numbers are refused, however many there are.
    #[test]
    fn a_second_fault_does_not_make_up_for_the_first() {
        let read = |all: [f64; 4], foreign: bool| {
            let words = all.map(f64::to_bits);
            let mut reader = Reader { words: &words, failed: false, foreign };
            let (mut first, mut second) = ([0.0], [0.0; 2]);
            reader.reals(&mut first);
            reader.reals(&mut second);
            reader.reals_within(&mut first, std::iter::once((0.0, 5.0)));
            reader.failed
        };
        let nan = f64::NAN;
        for (all, failed) in [([1.0, 2.0, 3.0, 4.0], false), ([nan, 2.0, 3.0, 4.0], true), ([nan, nan, 3.0, 4.0], true)] {
            assert_eq!((read(all, true), read(all, false)), (failed, false), "{all:?}");
        }
        assert!(read([1.0, 2.0, 3.0, 6.0], true) && read([nan, 2.0, nan, 6.0], true));
    }
}
