//! Packed bytes to a file, section by section.

use super::reader::Memory;
use super::{MOST_EXPANSION, SectionHead, file};
use crate::error::{Error, malformed};
use crate::header::Header;
use crate::section::{self, Section, preamble, section_crc};

/// Unpacks into memory that the caller lends, a section at a time: what stands there is a prefix of the file, for
/// [`Avatar::parse_prefix`](crate::Avatar::parse_prefix), from mesh and rig on. It takes 72 KB itself, and no heap.
#[derive(Debug)]
pub struct Unpacker<'p, 'f> {
    rest: &'p [u8],
    out: &'f mut [u8],
    /// Bytes of `out` that are done.
    len: usize,
    /// Bytes of the whole file.
    total: usize,
    /// Sections that have begun.
    sections: usize,
    header: Header,
    memory: Memory,
}

impl<'p, 'f> Unpacker<'p, 'f> {
    /// Unpacks preamble and header of `packed` to the start of `out`, which has as many bytes as
    /// [`super::unpacked_len`] says, or more.
    ///
    /// # Errors
    ///
    /// Where `packed` is not packed, damaged or ends before its first section, and where `out` is too short.
    pub fn new(packed: &'p [u8], out: &'f mut [u8]) -> Result<Self, Error> {
        let (needed, present) = (super::unpacked_len(packed)?, out.len());
        let Some(out) = out.get_mut(..needed) else {
            return Err(Error::Room { needed: needed as u64, present: present as u64 });
        };
        Self::to_prefix(packed, out)
    }

    /// The same where there may be room for the first sections alone.
    fn to_prefix(packed: &'p [u8], out: &'f mut [u8]) -> Result<Self, Error> {
        let total = super::unpacked_len(packed)?;
        let rest = packed.get(file::LEN..).unwrap_or(&[]);
        let (bytes, sections) = section::split_header(rest)?;
        let header = Header::parse(bytes)?;
        let len = preamble::LEN + bytes.len();
        match (out.get_mut(..len), rest.get(..len)) {
            (Some(to), Some(from)) => to.copy_from_slice(from),
            _ => return malformed("packed file", "it is longer than it says"),
        }
        let memory = Memory::default();
        Ok(Self { rest: sections, out, len, total, sections: 0, header, memory })
    }

    /// What is unpacked so far: the file's first bytes.
    pub fn done(&self) -> &[u8] {
        self.out.get(..self.len).unwrap_or(&[])
    }

    /// Unpacks the next section; `false` after the last one.
    ///
    /// # Errors
    ///
    /// Where the section is damaged or cut short. What is done before it stays.
    pub fn next_section(&mut self) -> Result<bool, Error> {
        if self.rest.is_empty() {
            let (needed, present) = (self.total as u64, self.len as u64);
            let whole = needed == present;
            let cut = Error::Truncated { place: "unpacked file", needed, present };
            return if whole { Ok(false) } else { Err(cut) };
        }
        self.sections += 1;
        super::check_sections(self.sections)?;
        let (SectionHead { tag, len, crc }, coded, rest) = super::split_section(self.rest)?;
        let room = self.out.split_at_mut_checked(self.len).and_then(|(before, room)| {
            let room = room.get_mut(..section::head::LEN.checked_add(len)?)?;
            let (fixed, payload) = room.split_at_mut_checked(section::head::LEN)?;
            Some((before, fixed, payload))
        });
        let Some((before, fixed, payload)) = room else {
            return malformed("packed section", "the file is longer than it says");
        };
        if coded.len() == len {
            payload.copy_from_slice(coded);
        } else {
            if len > coded.len().saturating_mul(MOST_EXPANSION) {
                return malformed("packed section", "no section is so much shorter when packed");
            }
            payload.fill(0);
            self.memory.decode(tag, payload, &self.header, before, coded)?;
        }
        if crc != section_crc(&Section { tag, payload }) {
            return Err(Error::Damaged { place: "packed section" });
        }
        fixed[section::head::TAG].copy_from_slice(&tag);
        fixed[section::head::PAYLOAD_LEN].copy_from_slice(&(len as u32).to_le_bytes());
        fixed[section::head::CRC].copy_from_slice(&crc.to_le_bytes());
        self.len += section::head::LEN + len;
        self.rest = rest;
        Ok(true)
    }
}

#[cfg(feature = "std")]
pub use all::{unpack, unpack_prefix};

#[cfg(feature = "std")]
mod all {
    use super::Unpacker;
    use crate::error::Error;
    use crate::packed::{MOST_EXPANSION, unpacked_len};

    /// The file that was packed, all of it.
    ///
    /// # Errors
    ///
    /// As of [`Unpacker`].
    pub fn unpack(packed: &[u8]) -> Result<Vec<u8>, Error> {
        let (file, cut) = unpack_sections(packed)?;
        cut.map_or(Ok(file), Err)
    }

    /// The first bytes of the file that was packed, as far as `packed`, its first bytes, has whole sections: for
    /// [`Avatar::parse_prefix`](crate::Avatar::parse_prefix).
    ///
    /// # Errors
    ///
    /// As of [`Unpacker`], but where `packed` only ends too early after the header.
    pub fn unpack_prefix(packed: &[u8]) -> Result<Vec<u8>, Error> {
        match unpack_sections(packed)? {
            (file, None | Some(Error::Truncated { .. })) => Ok(file),
            (_, Some(error)) => Err(error),
        }
    }

    /// What could be unpacked, and why no more.
    fn unpack_sections(packed: &[u8]) -> Result<(Vec<u8>, Option<Error>), Error> {
        // No memory is set aside for what cannot be there.
        let most = packed.len().saturating_mul(MOST_EXPANSION);
        let mut out = vec![0; unpacked_len(packed)?.min(most)];
        let mut unpacker = Unpacker::to_prefix(packed, &mut out)?;
        let cut = loop {
            match unpacker.next_section() {
                Ok(true) => {}
                Ok(false) => break None,
                Err(error) => break Some(error),
            }
        };
        let len = unpacker.done().len();
        out.truncate(len);
        Ok((out, cut))
    }
}
