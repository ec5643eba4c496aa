//! The bytes of a file: 24 of a head, then postcard's.

use std::borrow::Cow;
use std::ops::Range;

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};

use super::fingerprint::Fingerprint;
use crate::optimize::descend::State;
use crate::train::Trained;

/// The last byte counts versions of what follows.
const MAGIC: [u8; 8] = *b"DRMSCKP\x04";

/// Where things stand in the head.
mod field {
    use super::{Fingerprint, Range};

    pub(super) const MAGIC: Range<usize> = 0..8;
    /// Of everything behind it.
    pub(super) const CRC: Range<usize> = 8..12;
    pub(super) const FINGERPRINT: Range<usize> = 12..12 + Fingerprint::LEN;
}

/// What a file holds.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Content<'a> {
    /// A descent, the `index`-th of its run.
    Descent { index: u32, state: State<'a> },
    /// All of it.
    Trained(Cow<'a, Trained>),
}

/// Why bytes cannot be used.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Fault {
    /// Cut, changed, or never ours.
    Damaged,
    /// Of a training with this.
    Foreign(&'static str),
}

/// A file of `content`, `about` so many bytes.
pub(super) fn encode(
    fingerprint: Fingerprint,
    content: &Content<'_>,
    about: usize,
) -> Result<Vec<u8>> {
    let mut bytes = Vec::with_capacity(field::FINGERPRINT.end + about);
    bytes.extend(MAGIC);
    bytes.extend([0; 4]);
    bytes.extend(fingerprint.to_bytes());
    let mut bytes =
        postcard::to_extend(content, bytes).context("a checkpoint cannot be encoded")?;
    let crc = crc32fast::hash(&bytes[field::CRC.end..]);
    bytes[field::CRC].copy_from_slice(&crc.to_le_bytes());
    Ok(bytes)
}

/// What follows the head of a file that is whole and of this training.
pub(super) fn check(bytes: &[u8], ours: Fingerprint) -> Result<&[u8], Fault> {
    let (head, content) =
        bytes.split_first_chunk::<{ field::FINGERPRINT.end }>().ok_or(Fault::Damaged)?;
    let crc = crc32fast::hash(&bytes[field::CRC.end..]).to_le_bytes();
    if head[field::MAGIC] != MAGIC || head[field::CRC] != crc {
        return Err(Fault::Damaged);
    }
    let theirs = head.last_chunk().ok_or(Fault::Damaged)?;
    match ours.difference(Fingerprint::from_bytes(theirs)) {
        Some(part) => Err(Fault::Foreign(part)),
        None => Ok(content),
    }
}

/// What such bytes hold.
pub(super) fn decode(bytes: &[u8], ours: Fingerprint) -> Result<Content<'static>, Fault> {
    match postcard::take_from_bytes(check(bytes, ours)?) {
        Ok((content, [])) => Ok(content),
        _ => Err(Fault::Damaged),
    }
}
