//! A level: the Gaussians of an earlier block with parameters of their own at a later level.
//!
//! Triangles, and how the Gaussians fall into groups, are the block's, so that both can be walked side by
//! side ([`crate::walk`]).

use crate::block::{Records, has_valid_ranges};
use crate::error::{Error, malformed};
use crate::header::Header;
use crate::order::BLOCK_LEN;
use crate::record::{BlockRecord, GroupRecord, plane, take_plane};

/// A checked level of a block.
#[derive(Clone, Copy, Debug)]
pub struct Level<'a> {
    /// Index of its region.
    pub region: u8,
    /// Index of the layer that ends the level: later than the block's.
    pub level: u8,
    /// Rank in the region's order of its first Gaussian, as of the block it belongs to.
    pub first: u32,
    /// Gaussians in it, as in the block.
    pub count: u32,
    /// Ranges; of the same counts and base triangles as the block's.
    pub groups: &'a [GroupRecord],
    /// Each Gaussian: discs.
    pub records: Records<'a>,
}

impl<'a> Level<'a> {
    /// Splits a level's payload into planes. Lengths are checked, numbers are not.
    pub(crate) fn split(payload: &'a [u8]) -> Option<Self> {
        let (head, groups, rest) = split_groups(payload)?;
        let count = head.count.get();
        let records = plane(rest)?;
        let level = Self {
            region: head.region,
            level: head.layer,
            first: head.first.get(),
            count,
            groups,
            records: Records::Disc(records),
        };
        (count > 0 && count <= BLOCK_LEN && records.len() == count as usize).then_some(level)
    }

    /// Checks every number.
    pub(crate) fn check(&self, header: &Header) -> Result<(), Error> {
        if self.region >= header.regions || self.level >= header.layers {
            return malformed("LEVL", "its region or level does not exist");
        }
        if !self.groups.iter().all(|group| has_valid_ranges(group, 255)) {
            return malformed("LEVL", "a range is not finite, descends or is too large");
        }
        let sum: u32 = self.groups.iter().map(|group| u32::from(group.count_less_one) + 1).sum();
        if sum != self.count {
            return malformed("LEVL", "its groups do not add up to its Gaussians");
        }
        Ok(())
    }
}

/// What blocks and levels start with: their head and groups, and the rest.
pub(crate) fn split_groups(payload: &[u8]) -> Option<(&BlockRecord, &[GroupRecord], &[u8])> {
    let (head, rest) = take_plane::<BlockRecord>(payload, 1)?;
    let head = head.first()?;
    let (groups, rest) = take_plane(rest, usize::from(head.groups.get()))?;
    Some((head, groups, rest))
}
