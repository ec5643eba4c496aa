//! A level: the Gaussians of an earlier block with parameters of their own at a later level.
//!
//! Triangles are the block's, so that both can be walked side by side ([`crate::walk`]).

use crate::block::{have_valid_ranges, split_head};
use crate::discs::Discs;
use crate::error::{Error, malformed};
use crate::header::Header;
use crate::section::{Section, name, tag};

/// A checked level of a block.
#[derive(Clone, Copy, Debug)]
pub struct Level<'a> {
    /// Which numbers are its own: all ([`tag::LEVEL`]), or scales and opacity alone ([`tag::SHAPE`]).
    pub tag: [u8; 4],
    /// Index of its region.
    pub region: u8,
    /// Index of the layer that ends the level: later than the block's.
    pub level: u8,
    /// Rank in the region's order of its first Gaussian, as of the block it belongs to.
    pub first: u32,
    /// Gaussians in it, as in the block.
    pub count: u32,
    /// Each Gaussian; of a shape the other numbers mean nothing.
    pub discs: Discs<'a>,
}

impl<'a> Level<'a> {
    /// Whether a section is a level.
    pub(crate) fn is_one(section: &Section<'_>) -> bool {
        [tag::LEVEL, tag::SHAPE].contains(&section.tag)
    }

    /// Splits a level's payload into planes. Lengths are checked, numbers are not. `None` of other sections.
    pub(crate) fn split(section: Section<'a>) -> Option<Self> {
        let (head, rest) = split_head(section.payload).filter(|_| Self::is_one(&section))?;
        let count = u32::from(head.count.get());
        let (discs, rest) = Discs::split(rest, count as usize)?;
        let (region, level, first) = (head.region, head.layer, head.first.get());
        let tag = section.tag;
        rest.is_empty().then_some(Self { tag, region, level, first, count, discs })
    }

    /// Checks every number.
    pub(crate) fn check(&self, header: &Header) -> Result<(), Error> {
        let place = name(self.tag);
        if self.region >= header.regions || self.level >= header.layers {
            return malformed(place, "its region or level does not exist");
        }
        if !have_valid_ranges(&self.discs) {
            return malformed(place, "a range is not finite, descends or is too large");
        }
        let widths = self.discs.layout().widths();
        if self.tag == tag::SHAPE && widths != widths.of_shape() {
            return malformed(place, "it has bits for more than scales and opacity");
        }
        Ok(())
    }
}
