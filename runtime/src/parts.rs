//! The projection of a frame in shares that any thread may do.

use core::ops::Range;

use dermis_format::record::{DiscRecord, FullRecord};
use dermis_format::{Block, Records};

use crate::coded::{Coded, Record};
use crate::lanes::MAX_LANES;
use crate::lists::ListKey;
use crate::plan::{Plan, RegionPlan};
use crate::posed::Posed;
use crate::project::Splat;
use crate::screen::SplatCamera;
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
    slots: &'p mut [Splat],
    keys: &'p mut [ListKey],
    filled: usize,
}

impl<'p, 'a> Source<'p, 'a> {
    /// Cuts the plan's blocks into shares of about as many Gaussians, with a slot for each.
    pub(crate) fn split(
        self,
        mut slots: &'p mut [Splat],
        mut keys: &'p mut [ListKey],
        parts: usize,
    ) -> heapless::Vec<Part<'p, 'a>, MAX_PARTS> {
        let parts = parts.clamp(1, MAX_PARTS) as u64;
        let total = slots.len() as u64;
        let mut shares = heapless::Vec::new();
        let (mut blocks, mut start, mut end) = (0..0, 0, 0);
        for_each_block(self.posed.avatar(), self.plan, |_, _, drawn| {
            blocks.end += 1;
            end += drawn as usize;
            // A share ends with the block in which an even division would end it.
            if end as u64 * parts >= total * (shares.len() as u64 + 1) {
                let taken = core::mem::take(&mut slots).split_at_mut_checked(end - start);
                let (front, rest) = taken.unwrap_or_default();
                slots = rest;
                let taken = core::mem::take(&mut keys).split_at_mut_checked(end - start);
                let (front_keys, rest) = taken.unwrap_or_default();
                keys = rest;
                let share = blocks.clone();
                blocks.start = blocks.end;
                let _ = shares.push(Part {
                    source: self,
                    blocks: share,
                    start,
                    slots: front,
                    keys: front_keys,
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
        let Self { source, blocks, slots, keys, filled, .. } = self;
        for_each_block(source.posed.avatar(), source.plan, |block, region, drawn| {
            if blocks.contains(&index) {
                let rest = slots.get_mut(*filled..).unwrap_or(&mut []);
                let keys = keys.get_mut(*filled..).unwrap_or(&mut []);
                *filled += match block.records {
                    Records::Disc(_) => {
                        source.project::<DiscRecord>(block, region, drawn, rest, keys)
                    }
                    Records::Full(_) => {
                        source.project::<FullRecord>(block, region, drawn, rest, keys)
                    }
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

impl Source<'_, '_> {
    /// Fills `slots` with the splats of a block's Gaussians that can be seen; returns how many.
    fn project<R: Record>(
        &self,
        block: &Block<'_>,
        region: &RegionPlan,
        drawn: u32,
        slots: &mut [Splat],
        keys: &mut [ListKey],
    ) -> usize {
        let mut filled = 0;
        let mut gathered = Coded::<R>::new();
        let mut flush = |gathered: &mut Coded<'_, R>| {
            let free = slots.get_mut(filled..).unwrap_or(&mut []);
            let keys = keys.get_mut(filled..).unwrap_or(&mut []);
            let touching =
                self.camera.splats(self.posed.kernel(), gathered, &self.grid, free, keys);
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
