//! A level: the Gaussians of an earlier block with parameters of their own at a later level.
//!
//! Triangles are the block's, so that both can be walked side by side ([`crate::walk`]).

use crate::block::{have_valid_ranges, split_head};
use crate::discs::Discs;
use crate::error::{Error, malformed};
use crate::header::Header;

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
    /// Each Gaussian.
    pub discs: Discs<'a>,
}

impl<'a> Level<'a> {
    /// Splits a level's payload into planes. Lengths are checked, numbers are not.
    pub(crate) fn split(payload: &'a [u8]) -> Option<Self> {
        let (head, rest) = split_head(payload)?;
        let count = u32::from(head.count.get());
        let (discs, rest) = Discs::split(rest, count as usize)?;
        let (region, level, first) = (head.region, head.layer, head.first.get());
        rest.is_empty().then_some(Self { region, level, first, count, discs })
    }

    /// Checks every number.
    pub(crate) fn check(&self, header: &Header) -> Result<(), Error> {
        if self.region >= header.regions || self.level >= header.layers {
            return malformed("LEVL", "its region or level does not exist");
        }
        if !have_valid_ranges(&self.discs) {
            return malformed("LEVL", "a range is not finite, descends or is too large");
        }
        Ok(())
    }
}
