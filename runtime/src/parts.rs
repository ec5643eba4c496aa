//! The projection of a frame in shares that any thread may do.

use core::ops::Range;

use dermis_format::{Block, Records};

use crate::coded::{Coded, Coding};
use crate::lanes::MAX_LANES;
use crate::plan::{Plan, RegionPlan};
use crate::posed::Posed;
use crate::screen::{Slots, SplatCamera};
use crate::select::{for_each_block, for_each_of_block};
use crate::tiles::TileGrid;

/// Shares of a frame's projection at most.
pub const MAX_PARTS: usize = 64;

/// What splats are made of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Source<'p, 'a> {
    pub(crate) posed: &'p Posed<'p, 'a>,
    pub(crate) plan: &'p Plan,
    pub(crate) camera: &'p SplatCamera,
    /// Bit t % 16 of word t / 16: whether triangle t shows anything.
    pub(crate) visible: &'p [u32],
    pub(crate) grid: TileGrid,
}

/// A share of a frame's projection: some blocks of the file, in a row.
#[derive(Debug)]
pub struct Part<'p, 'a> {
    source: Source<'p, 'a>,
    /// Of those that the plan draws from.
    blocks: Range<usize>,
    /// Index of the first slot.
    start: usize,
    /// As many as the plan has Gaussians in these blocks.
    slots: Slots<'p>,
    filled: usize,
}

impl<'p, 'a> Source<'p, 'a> {
    /// Cuts the plan's blocks into shares of about as many Gaussians, with a slot for each.
    pub(crate) fn split(
        self,
        mut slots: Slots<'p>,
        parts: usize,
    ) -> heapless::Vec<Part<'p, 'a>, MAX_PARTS> {
        let parts = parts.clamp(1, MAX_PARTS) as u64;
        let total = slots.splats.len() as u64;
        let mut shares = heapless::Vec::new();
        let (mut blocks, mut start, mut end) = (0..0, 0, 0);
        for_each_block(self.posed.avatar(), self.plan, |_, _, drawn| {
            blocks.end += 1;
            end += drawn as usize;
            // A share ends with the block in which an even division would end it.
            if end as u64 * parts >= total * (shares.len() as u64 + 1) {
                let share = blocks.clone();
                blocks.start = blocks.end;
                let _ = shares.push(Part {
                    source: self,
                    blocks: share,
                    start,
                    slots: slots.take(end - start),
                    filled: 0,
                });
                start = end;
            }
        });
        shares
    }
}

impl Part<'_, '_> {
    /// Projects this share's Gaussians.
    pub fn project(&mut self) {
        self.filled = 0;
        let mut index = 0;
        let Self { source, blocks, slots, filled, .. } = self;
        for_each_block(source.posed.avatar(), source.plan, |block, region, drawn| {
            if blocks.contains(&index) {
                let free = slots.behind(*filled);
                *filled += match block.records {
                    Records::Disc(discs) => source.project(block, discs, region, drawn, free),
                    Records::Full(fulls) => source.project(block, fulls, region, drawn, free),
                };
            }
            index += 1;
        });
    }

    /// Slots that hold splats.
    pub(crate) fn filled(&self) -> Range<usize> {
        self.start..self.start + self.filled
    }
}

impl<'a> Source<'_, 'a> {
    /// Fills `slots` with the splats of a block's Gaussians that can be seen; returns how many.
    fn project<R: Coding<'a>>(
        &self,
        block: &Block<'a>,
        records: R,
        region: &RegionPlan,
        drawn: u32,
        mut slots: Slots<'_>,
    ) -> usize {
        let mut filled = 0;
        let mut gathered = Coded::new(block, records);
        let mut flush = |gathered: &mut Coded<'a, R>| {
            let (kernel, free) = (self.posed.kernel(), slots.behind(filled));
            let touching = self.camera.splats(kernel, gathered, &self.grid, free);
            filled += touching.count_ones() as usize;
            gathered.clear();
        };
        let shows = |triangle: u32| {
            let word = self.visible.get(triangle as usize / MAX_LANES);
            word.is_some_and(|word| word >> (triangle as usize % MAX_LANES) & 1 == 1)
        };
        for_each_of_block(block, region, drawn, shows, |place| {
            if !gathered.takes(&place) {
                flush(&mut gathered);
            }
            let frame = place.triangle.and_then(|triangle| self.posed.frame_rows(triangle));
            gathered.push(&place, frame);
        });
        flush(&mut gathered);
        filled
    }
}
