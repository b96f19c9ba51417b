//! Makes an MDF4 file plain: every data group's bytes in one `##DT` block.
//!
//! A data group may hold its records as one block (`##DT`), as a list of blocks (`##DL`), deflated (`##DZ`), deflated after a
//! transposition of the records' bytes, or as a list of those (`##HL`). Blocks may end inside a record. The reader downstream
//! knows only whole plain records, so the bytes of each group are joined, appended to the file as one `##DT`, and the group's
//! link is turned to it. Every address is checked: a damaged file gives a defect and never a wrong number.
//!
//! Layout of a block: id (4 bytes), 4 reserved, length (u64), number of links (u64), the links (u64 each), the data.
//! Source: ASAM MDF 4.1, sections on HD, DG, DT, DL, DZ and HL blocks.

use std::collections::HashSet;
use std::io::Read;

use super::error::Defect;

/// A list of blocks without end would otherwise exhaust the memory before its length could be judged.
const MAX_BYTES: u64 = 16 << 30;

/// Blocks that describe channels; the reader downstream trusts the counts in them.
const DESCRIPTIONS: [&[u8; 4]; 5] = [b"##HD", b"##DG", b"##CG", b"##CN", b"##CC"];

/// Checks that every block that describes channels lies in the file with its links, and that no text is longer than the file: a damaged
/// count would otherwise be asked memory for.
pub(crate) fn check_descriptions(file: &[u8]) -> Result<(), Defect> {
    let mut seen = HashSet::new();
    let mut open = vec![64];
    while let Some(address) = open.pop() {
        if !seen.insert(address) {
            continue;
        }
        let block = Block::at(file, address, &DESCRIPTIONS)?;
        for link in (0..block.links).filter_map(|i| block.link(i).ok()) {
            let id = usize::try_from(link).ok().and_then(|at| file.get(at..at.checked_add(4)?));
            match id {
                Some(id) if DESCRIPTIONS.iter().any(|d| id == *d) => open.push(link),
                Some(b"##TX" | b"##MD" | b"##SI") => _ = Block::at(file, link, &[])?,
                // What else there is, or is not, the reader needs not or says so itself.
                _ => {}
            }
        }
    }
    Ok(())
}

/// Joins, inflates and relinks the data of every data group in place.
pub(crate) fn make_plain(file: &mut Vec<u8>) -> Result<(), Defect> {
    let mut group = Block::at(file, 64, &[b"##HD"])?.link(0)?;
    let mut seen = HashSet::new();
    while group != 0 {
        if !seen.insert(group) {
            return Err(damaged("the list of data groups has no end"));
        }
        let block = Block::at(file, group, &[b"##DG"])?;
        let (next, channel_group, data) = (block.link(0)?, block.link(1)?, block.link(2)?);
        if channel_group != 0 && Block::at(file, channel_group, &[b"##CG"])?.link(0)? != 0 {
            return Err(Defect::Unsorted);
        }
        if data != 0 && &Block::at(file, data, &[])?.id != b"##DT" {
            let joined = join(file, data)?;
            let address = append(file, &joined);
            // The third link of the group: 24 bytes of block header, 8 bytes a link.
            let at = group as usize + 24 + 2 * 8;
            file[at..at + 8].copy_from_slice(&address.to_le_bytes());
        }
        group = next;
    }
    Ok(())
}

/// The records' bytes of a chain of blocks.
fn join(file: &[u8], first: u64) -> Result<Vec<u8>, Defect> {
    let mut out = Vec::new();
    let mut list = first;
    let mut seen = HashSet::new();
    while list != 0 {
        if !seen.insert(list) {
            return Err(damaged("a list of data blocks has no end"));
        }
        let block = Block::at(file, list, &[])?;
        list = match &block.id {
            b"##HL" => block.link(0)?,
            b"##DL" => {
                for i in 1..block.links {
                    let address = block.link(i)?;
                    if address != 0 {
                        data_of(&Block::at(file, address, &[])?, &mut out)?;
                    }
                }
                block.link(0)?
            }
            b"##LD" => return Err(Defect::Unsupported("the records are stored by column (MDF 4.2 ##LD)".to_string())),
            _ => {
                data_of(&block, &mut out)?;
                0
            }
        };
    }
    Ok(out)
}

/// Appends the bytes of one data block, inflated if need be.
fn data_of(block: &Block<'_>, out: &mut Vec<u8>) -> Result<(), Defect> {
    match &block.id {
        b"##DT" => out.extend_from_slice(block.data),
        b"##DZ" => inflate(block.data, out)?,
        other => return Err(Defect::Unsupported(format!("a data block of type {}", String::from_utf8_lossy(other)))),
    }
    Ok(())
}

/// A deflated block: original id (2), kind (1), reserved (1), columns (u32), original length (u64), packed length (u64), data.
fn inflate(data: &[u8], out: &mut Vec<u8>) -> Result<(), Defect> {
    if data.len() < 24 {
        return Err(damaged("a deflated block is cut short"));
    }
    let kind = data[2];
    let columns = u32::from_le_bytes([data[4], data[5], data[6], data[7]]) as usize;
    let (length, packed) = (read_u64(data, 8)?, read_u64(data, 16)?);
    let packed = usize::try_from(packed).ok().and_then(|n| data.get(24..24 + n.min(data.len())));
    let packed = packed.ok_or_else(|| damaged("a deflated block is cut short"))?;
    if &data[..2] != b"DT" || kind > 1 {
        return Err(Defect::Unsupported(format!("a deflated block of kind {kind}")));
    }
    if out.len() as u64 + length > MAX_BYTES {
        return Err(damaged("a deflated block claims more than 16 GiB"));
    }
    let mut plain = Vec::new();
    let read = flate2::read::ZlibDecoder::new(packed).take(length + 1).read_to_end(&mut plain);
    if read.is_err() || plain.len() as u64 != length {
        return Err(damaged("a deflated block does not inflate to its stated length"));
    }
    match kind {
        1 => transpose_back(&plain, columns, out),
        _ => out.extend_from_slice(&plain),
    }
    Ok(())
}

/// Undoes the transposition: stored are `columns` runs of one byte per record; what is left over follows untouched.
fn transpose_back(stored: &[u8], columns: usize, out: &mut Vec<u8>) {
    let records = stored.len().checked_div(columns).unwrap_or(0);
    for record in 0..records {
        out.extend((0..columns).map(|column| stored[column * records + record]));
    }
    out.extend_from_slice(&stored[records * columns..]);
}

/// Appends a `##DT` block, aligned to 8 bytes; gives its address.
fn append(file: &mut Vec<u8>, data: &[u8]) -> u64 {
    file.resize(file.len().next_multiple_of(8), 0);
    let address = file.len() as u64;
    file.extend_from_slice(b"##DT\0\0\0\0");
    file.extend_from_slice(&(24 + data.len() as u64).to_le_bytes());
    file.extend_from_slice(&0u64.to_le_bytes());
    file.extend_from_slice(data);
    address
}

/// A block whose header, links and data lie inside the file.
struct Block<'a> {
    id: [u8; 4],
    links: u64,
    link_bytes: &'a [u8],
    data: &'a [u8],
}

impl<'a> Block<'a> {
    /// The block at an address; `ids` names what may stand there, an empty list allows all.
    fn at(file: &'a [u8], address: u64, ids: &[&[u8; 4]]) -> Result<Block<'a>, Defect> {
        let outside = || damaged("a link points outside the file");
        let start = usize::try_from(address).map_err(|_| outside())?;
        let rest = file.get(start..).filter(|r| r.len() >= 24).ok_or_else(outside)?;
        let id = [rest[0], rest[1], rest[2], rest[3]];
        if &id[..2] != b"##" || (!ids.is_empty() && !ids.contains(&&id)) {
            return Err(damaged("a link does not lead to the block that it should"));
        }
        let (length, links) = (read_u64(rest, 8)?, read_u64(rest, 16)?);
        let body = usize::try_from(length).ok().and_then(|n| rest.get(24..n));
        let body = body.ok_or_else(|| damaged("a block ends beyond the end of the file"))?;
        let split = links.checked_mul(8).and_then(|n| usize::try_from(n).ok()).filter(|&n| n <= body.len());
        let split = split.ok_or_else(|| damaged("a block has more links than room"))?;
        Ok(Block { id, links, link_bytes: &body[..split], data: &body[split..] })
    }

    fn link(&self, i: u64) -> Result<u64, Defect> {
        read_u64(self.link_bytes, (i as usize).saturating_mul(8)).map_err(|_| damaged("a block lacks a link"))
    }
}

fn read_u64(bytes: &[u8], at: usize) -> Result<u64, Defect> {
    let eight = bytes.get(at..at.saturating_add(8)).ok_or_else(|| damaged("a block is cut short"))?;
    Ok(u64::from_le_bytes(eight.try_into().expect("the slice has eight bytes")))
}

fn damaged(what: &str) -> Defect {
    Defect::Damaged(what.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transposition_comes_back() {
        // Three records of four bytes and two bytes over.
        let plain: Vec<u8> = (0..14).collect();
        let mut stored: Vec<u8> = (0..4).flat_map(|c| (0..3).map(move |r| r * 4 + c)).collect();
        stored.extend([12, 13]);
        let mut out = Vec::new();
        transpose_back(&stored, 4, &mut out);
        assert_eq!(out, plain);
    }

    #[test]
    fn garbage_is_a_defect() {
        assert!(make_plain(&mut vec![0; 200]).is_err());
        assert!(make_plain(&mut b"MDF     ".to_vec()).is_err());
    }
}
