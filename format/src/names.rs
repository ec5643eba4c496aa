//! Names of joints and regions, one after the other.

use crate::record::take_plane;

/// Walks strings, each led by its length in bytes (u8).
#[derive(Clone, Copy, Debug)]
pub struct Names<'a> {
    rest: &'a [u8],
}

impl<'a> Names<'a> {
    pub(crate) fn of(bytes: &'a [u8]) -> Self {
        Self { rest: bytes }
    }

    /// Whether there are `count` names and no byte after them.
    pub(crate) fn is_whole(mut self, count: usize) -> bool {
        self.by_ref().count() == count && self.rest.is_empty()
    }
}

impl<'a> Iterator for Names<'a> {
    type Item = &'a str;

    fn next(&mut self) -> Option<&'a str> {
        let (len, rest) = take_plane::<u8>(self.rest, 1)?;
        let (name, rest) = rest.split_at_checked(usize::from(*len.first()?))?;
        let name = core::str::from_utf8(name).ok()?;
        self.rest = rest;
        Some(name)
    }
}
