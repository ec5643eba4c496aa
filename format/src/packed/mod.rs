//! The packed form, for the wire: every section's payload entropy-coded, column by column, and exactly the file again.
//!
//! A packed file is not read in place; [`Unpacker`] makes the file of it, section by section, in memory that the
//! caller lends. Like the file it is progressive: whatever has arrived unpacks to a prefix that can be drawn.
//!
//! 1. `mesh`: triangles told from edge to edge, first weights as sums, in place.
//! 2. `columns`: a payload as columns, each the same number of every record.
//! 3. `predict`, `earlier`, `between`: what each number is likely to be, from the one before it, from the level before, or from
//!    blocks on either side.
//! 4. `table`, `rans`: how often each difference comes, and the bits that it takes.
//! 5. `reader` fills a payload in, `unpack` leads through all of them.
//! 6. `sides` finds which blocks stand beside each other, `survey` counts what comes and chooses, `pack` writes (feature `std`).

mod between;
mod columns;
mod earlier;
mod mesh;
#[cfg(feature = "std")]
mod pack;
mod predict;
mod rans;
mod reader;
#[cfg(feature = "std")]
mod sides;
#[cfg(feature = "std")]
mod survey;
mod table;
mod unpack;

#[cfg(feature = "std")]
pub use pack::pack;
pub use unpack::Unpacker;
#[cfg(feature = "std")]
pub use unpack::{unpack, unpack_prefix};

use crate::error::{Error, malformed};
use crate::section;

/// The first bytes of a packed file.
pub const MAGIC: [u8; 8] = *b"DERMPK\r\n";
/// The version of the packed form that this crate reads and writes.
pub const VERSION: u16 = 3;

/// Byte ranges of the fields before the file's own preamble.
mod file {
    use core::ops::Range;
    pub(super) const MAGIC: Range<usize> = 0..8;
    /// u16.
    pub(super) const VERSION: Range<usize> = 8..10;
    /// u32, bytes of the file that was packed.
    pub(super) const UNPACKED_LEN: Range<usize> = 10..14;
    /// u32, CRC32 of what is before it.
    pub(super) const CRC: Range<usize> = 14..18;
    pub(super) const LEN: usize = 18;
}

/// Byte ranges of a packed section's head.
mod head {
    use core::ops::Range;
    pub(super) const TAG: Range<usize> = 0..4;
    /// u32, bytes of the payload.
    pub(super) const PAYLOAD_LEN: Range<usize> = 4..8;
    /// u32, bytes that follow this head.
    pub(super) const CODED_LEN: Range<usize> = 8..12;
    /// u32, CRC32 of the section as the file has it.
    pub(super) const CRC: Range<usize> = 12..16;
    pub(super) const LEN: usize = 16;
}

/// A file has no more sections, as a reader looks for earlier ones section by section.
const MOST_SECTIONS: usize = 1 << 14;

/// No payload, and no file, is more than so many times as long as its packed form.
const MOST_EXPANSION: usize = 64;

/// How the numbers of a column stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Coding {
    /// As they are, in the side information.
    Raw,
    /// As symbols, by the table that was last in its place.
    SameTable,
    /// As symbols, by the table that follows.
    NewTable,
}

/// Bits that say which.
const CODING_BITS: u32 = 2;

impl Coding {
    fn of(code: u32) -> Option<Self> {
        [Self::Raw, Self::SameTable, Self::NewTable].get(code as usize).copied()
    }
}

/// A step to a triangle that is this or more stands in the side information, in so many bits; between two others the triangle
/// itself does.
const ESCAPE: u8 = 255;
const ESCAPED_BITS: u32 = 25;
/// Bits of how many triangles of a block that stands between others are told by a step.
const COUNT_BITS: u32 = 13;

/// What stands before a packed section.
#[derive(Clone, Copy, Debug)]
struct SectionHead {
    tag: [u8; 4],
    /// Bytes of the payload.
    len: usize,
    crc: u32,
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(crate::bits::chunk(bytes, at))
}

fn check_sections(count: usize) -> Result<(), Error> {
    if count > MOST_SECTIONS {
        return malformed("packed file", "of more than 16,384 sections none is made");
    }
    Ok(())
}

/// Whether bytes begin as a packed file does.
pub fn is_packed(bytes: &[u8]) -> bool {
    bytes.starts_with(&MAGIC)
}

/// Bytes of the file that was packed.
///
/// # Errors
///
/// Where `packed` does not begin as a packed file of this version, or is damaged there.
pub fn unpacked_len(packed: &[u8]) -> Result<usize, Error> {
    if packed.get(file::MAGIC) != Some(&MAGIC[..]) {
        return malformed("packed file", "it does not start with DERMPK, as packed avatars do");
    }
    let Some(fixed) = packed.get(..file::LEN) else {
        let (needed, present) = (file::LEN as u64, packed.len() as u64);
        return Err(Error::Truncated { place: "packed file", needed, present });
    };
    let version = u16::from_le_bytes(crate::bits::chunk(fixed, file::VERSION.start));
    if version != VERSION {
        return Err(Error::PackedVersion { found: version });
    }
    if u32_at(fixed, file::CRC.start) != crc32fast::hash(&fixed[..file::CRC.start]) {
        return Err(Error::Damaged { place: "packed file" });
    }
    Ok(u32_at(fixed, file::UNPACKED_LEN.start) as usize)
}

/// The head, what follows it, and the rest.
fn split_section(bytes: &[u8]) -> Result<(SectionHead, &[u8], &[u8]), Error> {
    let present = bytes.len() as u64;
    let truncated = |needed: u64| Error::Truncated { place: "packed section", needed, present };
    let Some((fixed, rest)) = bytes.split_at_checked(head::LEN) else {
        return Err(truncated(head::LEN as u64));
    };
    let coded_len = u32_at(fixed, head::CODED_LEN.start);
    let Some((coded, rest)) = rest.split_at_checked(coded_len as usize) else {
        return Err(truncated(head::LEN as u64 + u64::from(coded_len)));
    };
    let [a, b, c, d] = crate::bits::chunk(fixed, head::TAG.start);
    let len = u32_at(fixed, head::PAYLOAD_LEN.start) as usize;
    let crc = u32_at(fixed, head::CRC.start);
    Ok((SectionHead { tag: [a, b, c, d], len, crc }, coded, rest))
}

/// Bytes that blocks and levels take in a packed file, heads included.
///
/// # Errors
///
/// Where `packed` is not packed, or ends too early.
pub fn bytes_of_gaussians(packed: &[u8]) -> Result<usize, Error> {
    unpacked_len(packed)?;
    let (_, mut rest) = section::split_header(packed.get(file::LEN..).unwrap_or(&[]))?;
    let mut bytes = 0;
    while !rest.is_empty() {
        let (SectionHead { tag, .. }, coded, others) = split_section(rest)?;
        if section::holds_gaussians(tag) {
            bytes += head::LEN + coded.len();
        }
        rest = others;
    }
    Ok(bytes)
}

/// Bytes of the length of the side information, before it.
const SIDE_LEN_BYTES: usize = 4;

/// The side information, and the symbols behind it.
fn split_side(coded: &[u8]) -> Result<(&[u8], &[u8]), Error> {
    let rest = coded.get(SIDE_LEN_BYTES..).unwrap_or(&[]);
    match rest.split_at_checked(u32_at(coded, 0) as usize) {
        Some(parts) => Ok(parts),
        None => malformed("packed section", "its side information is longer than it is"),
    }
}
