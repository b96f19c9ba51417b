//! Thrift's compact protocol, as far as needed for counting: whether a structure claims more elements than its bytes can hold.
//!
//! Parquet's footer and page headers are such structures. Its reader skips a list of flags without consuming a byte per flag, so that a damaged count
//! of two thousand million would keep it busy for ever. Structures are therefore checked here first.

/// Number of elements that a structure may have beyond its number of bytes.
const RESERVE: usize = 1 << 16;

/// Greatest depth of nested structures; the reader follows 64.
const DEPTH: usize = 70;

/// Kinds of values, as the protocol numbers them.
mod kind {
    pub const STOP: u8 = 0;
    pub const BYTE: u8 = 3;
    pub const DOUBLE: u8 = 7;
    pub const BINARY: u8 = 8;
    pub const LIST: u8 = 9;
    pub const SET: u8 = 10;
    pub const MAP: u8 = 11;
    pub const STRUCT: u8 = 12;
    pub const UUID: u8 = 13;
}

/// Why a walk over a structure stopped early.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stop {
    /// The bytes end, or are invalid: the reader will report that itself.
    Damaged,
    /// There are more elements than the bytes can hold.
    TooManyElements,
}

/// A structure that claims more than it holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TooManyElements;

/// What is needed from a page header.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Found {
    /// Field 3 of the outermost structure, if it is a number: the size of a page.
    third: Option<i64>,
}

struct Walk<'a> {
    bytes: &'a [u8],
    left: usize,
}

impl Walk<'_> {
    fn skip(&mut self, count: u64) -> Result<(), Stop> {
        let count = usize::try_from(count).map_err(|_| Stop::Damaged)?;
        self.bytes = self.bytes.get(count..).ok_or(Stop::Damaged)?;
        Ok(())
    }

    fn byte(&mut self) -> Result<u8, Stop> {
        let (first, rest) = self.bytes.split_first().ok_or(Stop::Damaged)?;
        self.bytes = rest;
        Ok(*first)
    }

    fn number(&mut self) -> Result<u64, Stop> {
        let mut value = 0;
        for shift in (0..70).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f).checked_shl(shift).unwrap_or(0);
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Err(Stop::Damaged)
    }

    fn elements(&mut self, kinds: &[u8], count: u64, depth: usize) -> Result<(), Stop> {
        for _ in 0..count {
            for kind in kinds {
                self.value(*kind, depth)?;
            }
        }
        Ok(())
    }

    fn value(&mut self, kind: u8, depth: usize) -> Result<(), Stop> {
        self.left = self.left.checked_sub(1).ok_or(Stop::TooManyElements)?;
        let deeper = depth.checked_sub(1).ok_or(Stop::Damaged)?;
        match kind {
            1 | 2 => Ok(()),
            kind::BYTE => self.skip(1),
            4..=6 => self.number().map(|_| ()),
            kind::DOUBLE => self.skip(8),
            kind::BINARY => self.number().and_then(|length| self.skip(length)),
            kind::LIST | kind::SET => {
                let head = self.byte()?;
                let count = if head >> 4 == 15 { self.number()? } else { u64::from(head >> 4) };
                self.elements(&[head & 15], count, deeper)
            }
            kind::MAP => match self.number()? {
                0 => Ok(()),
                count => self.byte().and_then(|kinds| self.elements(&[kinds >> 4, kinds & 15], count, deeper)),
            },
            kind::STRUCT => self.structure(deeper).map(|_| ()),
            kind::UUID => self.skip(16),
            _ => Err(Stop::Damaged),
        }
    }

    fn structure(&mut self, depth: usize) -> Result<Found, Stop> {
        let (mut found, mut id) = (Found::default(), 0_i64);
        loop {
            let head = self.byte()?;
            let kind = head & 15;
            if kind == kind::STOP {
                return Ok(found);
            }
            id = if head >> 4 == 0 { zigzag(self.number()?) } else { id + i64::from(head >> 4) };
            if id == 3 && (4..=6).contains(&kind) {
                found.third = Some(zigzag(self.number()?));
            } else {
                self.value(kind, depth)?;
            }
        }
    }
}

fn zigzag(value: u64) -> i64 {
    (value >> 1) as i64 ^ -((value & 1) as i64)
}

fn walk(bytes: &[u8]) -> Result<Option<(usize, Found)>, TooManyElements> {
    let mut walk = Walk { bytes, left: bytes.len().saturating_add(RESERVE) };
    match walk.structure(DEPTH) {
        Ok(found) => Ok(Some((bytes.len() - walk.bytes.len(), found))),
        Err(Stop::Damaged) => Ok(None),
        Err(Stop::TooManyElements) => Err(TooManyElements),
    }
}

/// Checks a Parquet file's footer.
///
/// # Errors
/// It claims more elements than its bytes can hold.
pub(crate) fn check_footer(file: &[u8]) -> Result<(), TooManyElements> {
    let Some((rest, tail)) = file.split_last_chunk::<8>() else { return Ok(()) };
    let length = u32::from_le_bytes([tail[0], tail[1], tail[2], tail[3]]) as usize;
    let footer = rest.len().checked_sub(length).map_or(rest, |start| &rest[start..]);
    walk(footer).map(|_| ())
}

/// Checks the headers of the pages of a column chunk.
///
/// # Errors
/// A header claims more elements than the bytes can hold.
pub(crate) fn check_pages(mut chunk: &[u8]) -> Result<(), TooManyElements> {
    while let Some((length, Found { third: Some(size) })) = walk(chunk)? {
        let Some(rest) = usize::try_from(size).ok().and_then(|size| chunk.get(length.saturating_add(size)..)) else { break };
        chunk = rest;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A structure whose field 1 is a list of `count` flags.
    fn flags(count: u64) -> Vec<u8> {
        let mut bytes = vec![0x19, 0xf1];
        let mut left = count;
        while left > 0x7f {
            bytes.push(0x80 | (left & 0x7f) as u8);
            left >>= 7;
        }
        bytes.extend([left as u8, 0]);
        bytes
    }

    #[test]
    fn a_count_beyond_the_bytes_is_seen() {
        assert_eq!(walk(&flags(1000)).map(|w| w.map(|(length, _)| length)), Ok(Some(5)));
        assert_eq!(walk(&flags(1 << 31)), Err(TooManyElements));
        let mut file = flags(1 << 31);
        let length = file.len() as u32;
        file.extend(length.to_le_bytes());
        file.extend(b"PAR1");
        assert_eq!(check_footer(&file), Err(TooManyElements));
    }

    #[test]
    fn pages_are_followed_by_their_sizes() {
        // i32 field 3 = 2 (zigzag 4), stop, two bytes of page; then a header with too many flags.
        let mut chunk = vec![0x35, 4, 0, 7, 7];
        assert_eq!(check_pages(&chunk), Ok(()));
        chunk.extend(flags(1 << 40));
        assert_eq!(check_pages(&chunk), Err(TooManyElements));
    }
}
