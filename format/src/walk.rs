//! Blocks as they are at a level, or between two: their records side by side.

use crate::block::{Block, Records, split_head};
use crate::discs::Discs;
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
    upper: [Run<'a>; MAX_REGIONS],
    lower: [Run<'a>; MAX_REGIONS],
}

/// What a region's blocks are at a level: the last records of all numbers up to it, and its shapes.
#[derive(Clone, Copy)]
struct Run<'a> {
    whole: Part<'a>,
    shapes: Part<'a>,
}

/// Levels in a row.
#[derive(Clone, Copy)]
struct Part<'a> {
    /// From the next block's on.
    sections: Sections<'a>,
    /// Blocks of earlier layers have one.
    level: u8,
}

impl<'a> Runs<'a> {
    /// One pass over the sections' heads.
    pub(crate) fn find(mut sections: Sections<'a>, levels: impl Fn(u8) -> Levels) -> Self {
        let none = Part { sections: Sections::new(&[]), level: 0 };
        let none = [Run { whole: none, shapes: none }; MAX_REGIONS];
        let mut runs = Self { upper: none, lower: none };
        loop {
            let here = sections;
            let Some(section) = sections.next() else { return runs };
            if !Level::is_one(&section) {
                continue;
            }
            let Some((head, _)) = split_head(section.payload) else { continue };
            if head.first.get() > 0 {
                continue;
            }
            let (wanted, region) = (levels(head.region), usize::from(head.region));
            let part = Part { sections: here, level: head.layer };
            let both = [(&mut runs.upper, Some(wanted.upper)), (&mut runs.lower, wanted.lower)];
            for (run, wanted) in both {
                let (Some(run), Some(wanted)) = (run.get_mut(region), wanted) else { continue };
                // A region's levels ascend: the last one stays.
                match section.tag {
                    tag::SHAPE if head.layer == wanted => run.shapes = part,
                    tag::LEVEL if head.layer <= wanted => run.whole = part,
                    _ => {}
                }
            }
        }
    }

    /// The next block of a region, seen where its `levels` say. One of a later layer stays as it is.
    pub(crate) fn at(&mut self, mut block: Block<'a>, levels: Levels) -> Block<'a> {
        let Records::Disc(own) = block.records else { return block };
        if block.layer >= levels.upper {
            return block;
        }
        let region = usize::from(block.region);
        if levels.lower.is_some_and(|lower| block.layer <= lower)
            && let Some(run) = self.lower.get_mut(region)
        {
            block.below = Some(run.next(own, block.layer));
        }
        if let Some(run) = self.upper.get_mut(region) {
            block.records = Records::Disc(run.next(own, block.layer));
        }
        block
    }
}

impl<'a> Run<'a> {
    /// The next block, one of `layer` whose records are its `own`.
    fn next(&mut self, own: Discs<'a>, layer: u8) -> Discs<'a> {
        let whole = self.whole.next(tag::LEVEL, layer).unwrap_or(own);
        match self.shapes.next(tag::SHAPE, layer) {
            Some(shape) => whole.shaped(shape),
            None => whole,
        }
    }
}

impl<'a> Part<'a> {
    fn next(&mut self, tag: [u8; 4], layer: u8) -> Option<Discs<'a>> {
        if layer >= self.level {
            return None;
        }
        let section = self.sections.find(|section| section.tag == tag)?;
        Level::split(section).map(|level| level.discs)
    }
}
