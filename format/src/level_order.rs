//! Whether every level stands where it must: each layer of a region but its first one is led by a run of
//! levels, one for each earlier block, in their order.
//!
//! A run is compared with what stands since the run before: that run, and then the blocks of the layer
//! it leads. So each section is looked at a bounded number of times, and nothing is remembered of it.

use crate::block::{Block, split_head};
use crate::error::{Error, malformed};
use crate::header::MAX_REGIONS;
use crate::level::Level;
use crate::section::{Section, Sections, holds_gaussians, name};

/// What was seen on the way through the sections.
pub(crate) struct LevelOrder<'a> {
    regions: [Region<'a>; MAX_REGIONS],
    /// The run that no block has followed yet.
    run: Option<Run<'a>>,
}

#[derive(Clone, Copy)]
struct Region<'a> {
    /// Layer of the last block; none: no block yet.
    layer: Option<u8>,
    /// Sections from the last run on: it names all blocks before.
    since: Sections<'a>,
}

#[derive(Clone, Copy)]
struct Run<'a> {
    region: u8,
    level: u8,
    tag: [u8; 4],
    /// Rank that follows its last Gaussian.
    next: u32,
    /// What its levels belong to, one by one.
    of: Sections<'a>,
}

impl<'a> LevelOrder<'a> {
    /// `sections`: all of the file.
    pub(crate) fn new(sections: Sections<'a>) -> Self {
        Self { regions: [Region { layer: None, since: sections }; MAX_REGIONS], run: None }
    }

    /// The next section is this level; `here`: it and all after it.
    pub(crate) fn level(&mut self, level: &Level<'_>, here: Sections<'a>) -> Result<(), Error> {
        let place = name(level.tag);
        let Some(region) = self.regions.get_mut(usize::from(level.region)) else {
            return malformed(place, "its region does not exist");
        };
        let run = match &mut self.run {
            Some(run) => run,
            None => {
                if region.layer.is_none_or(|layer| level.level <= layer) {
                    return malformed(place, "it is not later than the blocks before it");
                }
                let of = core::mem::replace(&mut region.since, here);
                let Level { tag, region, level, .. } = *level;
                self.run.insert(Run { region, level, tag, next: 0, of })
            }
        };
        if (run.region, run.level, run.tag) != (level.region, level.level, level.tag) {
            return malformed(place, "it stands among those of another region, level or kind");
        }
        let of = run.of.find(|section| is_of(section, run.region));
        let fits =
            level.first == run.next && of.is_some_and(|section| agrees(level, section.payload));
        if !fits {
            return malformed(place, "it is not that of the next earlier block");
        }
        // Its block is as long, and blocks were counted.
        run.next = run.next.saturating_add(level.count);
        Ok(())
    }

    /// The next section is this block.
    pub(crate) fn block(&mut self, block: &Block<'_>) -> Result<(), Error> {
        let Some(region) = self.regions.get_mut(usize::from(block.region)) else {
            return malformed("block", "its region does not exist");
        };
        let led = match self.run.take() {
            Some(run) => {
                (run.region, run.level, run.next) == (block.region, block.layer, block.first)
            }
            None => region.layer.is_none_or(|layer| layer == block.layer),
        };
        if !led {
            return malformed("block", "the levels of the blocks before its layer do not lead it");
        }
        region.layer = Some(block.layer);
        Ok(())
    }

    /// Region and level of the levels that no block has followed yet.
    pub(crate) fn open(&self) -> Option<(u8, u8)> {
        self.run.as_ref().map(|run| (run.region, run.level))
    }

    /// There is no other section.
    pub(crate) fn end(&self) -> Result<(), Error> {
        match self.run {
            Some(run) => malformed(name(run.tag), "no block of its level follows"),
            None => Ok(()),
        }
    }
}

/// Whether a section is a block of a region or a level of one.
fn is_of(section: &Section<'_>, region: u8) -> bool {
    holds_gaussians(section.tag) && section.payload.first() == Some(&region)
}

/// Whether a block, or a level of it, has the same Gaussians.
fn agrees(level: &Level<'_>, payload: &[u8]) -> bool {
    let head = split_head(payload);
    head.is_some_and(|(head, _)| {
        (head.first.get(), u32::from(head.count.get())) == (level.first, level.count)
    })
}
