//! Blocks as they are at a level, or between two: their records side by side.

use crate::block::{Block, Records, split_head};
use crate::header::MAX_REGIONS;
use crate::level::Level;
use crate::section::{Sections, tag};

/// Where a region's Gaussians are seen: layers that end levels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Levels {
    /// The level; its own layer's Gaussians have their blocks' records there.
    pub upper: u8,
    /// A level below it, if the Gaussians that are in both are between them.
    pub lower: Option<u8>,
}

/// Where each region's levels start. All levels of one kind stand in a row, in the order of their blocks:
/// the next block's is the next one.
pub(crate) struct Runs<'a> {
    upper: [Sections<'a>; MAX_REGIONS],
    lower: [Sections<'a>; MAX_REGIONS],
}

impl<'a> Runs<'a> {
    /// One pass over the sections' heads.
    pub(crate) fn find(mut sections: Sections<'a>, levels: impl Fn(u8) -> Levels) -> Self {
        let none = [Sections::new(&[]); MAX_REGIONS];
        let mut runs = Self { upper: none, lower: none };
        loop {
            let here = sections;
            let Some(section) = sections.next() else { return runs };
            if section.tag != tag::LEVEL {
                continue;
            }
            let Some((head, _)) = split_head(section.payload) else { continue };
            if head.first.get() > 0 {
                continue;
            }
            let (wanted, region) = (levels(head.region), usize::from(head.region));
            let start = |run: &mut [Sections<'a>]| {
                run.get_mut(region).into_iter().for_each(|run| *run = here);
            };
            if wanted.upper == head.layer {
                start(&mut runs.upper);
            }
            if wanted.lower == Some(head.layer) {
                start(&mut runs.lower);
            }
        }
    }

    /// The next block of a region, seen where its `levels` say. One of a later layer stays as it is.
    pub(crate) fn at(&mut self, mut block: Block<'a>, levels: Levels) -> Block<'a> {
        if block.layer >= levels.upper {
            return block;
        }
        let region = usize::from(block.region);
        if let Some(lower) = levels.lower
            && block.layer <= lower
            && let Records::Disc(own) = block.records
        {
            let is_older = block.layer < lower;
            let level = is_older.then(|| next(self.lower.get_mut(region))).flatten();
            block.below = Some(level.map_or(own, |level| level.discs));
        }
        if let Some(Level { discs, .. }) = next(self.upper.get_mut(region)) {
            block.records = Records::Disc(discs);
        }
        block
    }
}

fn next<'a>(run: Option<&mut Sections<'a>>) -> Option<Level<'a>> {
    let section = run?.find(|section| section.tag == tag::LEVEL)?;
    Level::split(section.payload)
}
