//! The projection of a frame in shares that any thread may do.

use core::ops::Range;

use dermis_format::{Block, Records};

use crate::batch::Batch;
use crate::coded::{Coded, Coding};
use crate::lanes::MAX_LANES;
use crate::plan::{Plan, RegionPlan};
use crate::posed::Posed;
use crate::screen::{Eye, Slots, SplatCamera, splats};
use crate::select::{for_each_block, for_each_of_block};
use crate::tiles::TileGrid;

/// Shares of a frame's projection at most.
pub const MAX_PARTS: usize = 64;

/// What splats are made of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Source<'p, 'a, const EYES: usize> {
    pub(crate) posed: &'p Posed<'p, 'a>,
    pub(crate) plan: &'p Plan,
    pub(crate) lookers: &'p [Looker<'p>; EYES],
}

/// A camera, and what it looks at.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Looker<'p> {
    pub(crate) camera: SplatCamera,
    /// Bit t % 16 of word t / 16: whether triangle t shows anything.
    pub(crate) visible: &'p [u32],
    pub(crate) grid: TileGrid,
}

impl Looker<'_> {
    #[inline(always)]
    fn sees(&self, triangle: u32) -> bool {
        let word = self.visible.get(triangle as usize / MAX_LANES);
        word.is_some_and(|word| word >> (triangle as usize % MAX_LANES) & 1 == 1)
    }
}

/// A share of the projection of a frame, or of the frames of several cameras: some blocks of the file, in a row.
#[derive(Debug)]
pub struct Part<'p, 'a, const EYES: usize = 1> {
    source: Source<'p, 'a, EYES>,
    /// Of those that the plan draws from.
    blocks: Range<usize>,
    /// Index of the first slot.
    start: usize,
    /// As many as the plan has Gaussians in these blocks, for each camera.
    slots: [Slots<'p>; EYES],
    filled: [usize; EYES],
}

impl<'p, 'a, const EYES: usize> Source<'p, 'a, EYES> {
    /// Cuts the plan's blocks into shares of about as many Gaussians, with a slot for each and each camera.
    pub(crate) fn split(
        self,
        mut slots: [Slots<'p>; EYES],
        parts: usize,
    ) -> heapless::Vec<Part<'p, 'a, EYES>, MAX_PARTS> {
        let parts = parts.clamp(1, MAX_PARTS) as u64;
        let total = u64::from(self.plan.gaussians());
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
                    slots: slots.each_mut().map(|slots| slots.take(end - start)),
                    filled: [0; EYES],
                });
                start = end;
            }
        });
        shares
    }
}

impl<const EYES: usize> Part<'_, '_, EYES> {
    /// Projects this share's Gaussians.
    pub fn project(&mut self) {
        self.filled = [0; EYES];
        let mut index = 0;
        let Self { source, blocks, slots, filled, .. } = self;
        for_each_block(source.posed.avatar(), source.plan, |block, region, drawn| {
            if blocks.contains(&index) {
                match block.records {
                    Records::Disc(discs) => {
                        source.project(block, discs, region, drawn, slots, filled);
                    }
                    Records::Full(fulls) => {
                        source.project(block, fulls, region, drawn, slots, filled);
                    }
                }
            }
            index += 1;
        });
    }

    /// Slots that hold splats, for each camera.
    pub(crate) fn filled(&self) -> [Range<usize>; EYES] {
        self.filled.map(|filled| self.start..self.start + filled)
    }
}

impl<'a, const EYES: usize> Source<'_, 'a, EYES> {
    /// Fills `slots` behind the first `filled` with the splats of a block's Gaussians that can be seen.
    fn project<R: Coding<'a>>(
        &self,
        block: &Block<'a>,
        records: R,
        region: &RegionPlan,
        drawn: u32,
        slots: &mut [Slots<'_>; EYES],
        filled: &mut [usize; EYES],
    ) {
        let mut gathered = Coded::new(block, records);
        // Of one camera all that are gathered.
        let mut sees = [if EYES > 1 { 0 } else { u64::MAX }; EYES];
        let mut flush = |gathered: &mut Coded<'a, R>, sees: &mut [u64; EYES]| {
            let mut free =
                slots.iter_mut().zip(&*filled).map(|(slots, &filled)| slots.behind(filled));
            let eyes: [Eye<'_>; EYES] = core::array::from_fn(|eye| {
                let Looker { camera, grid, .. } = &self.lookers[eye];
                Eye { camera, grid, slots: free.next().unwrap_or_default(), sees: sees[eye] }
            });
            let touching = splats(self.posed.kernel(), gathered, eyes);
            filled.iter_mut().zip(touching).for_each(|(n, t)| *n += t.count_ones() as usize);
            gathered.clear();
            if EYES > 1 {
                *sees = [0; EYES];
            }
        };
        let shows = |triangle: u32| self.lookers.iter().any(|looker| looker.sees(triangle));
        for_each_of_block(block, region, drawn, shows, |place| {
            if !gathered.takes(&place) {
                flush(&mut gathered, &mut sees);
            }
            if EYES > 1 {
                for (sees, looker) in sees.iter_mut().zip(self.lookers) {
                    let shows = place.triangle.is_none_or(|triangle| looker.sees(triangle));
                    *sees |= u64::from(shows) << gathered.len();
                }
            }
            let frame = place.triangle.and_then(|triangle| self.posed.frame_rows(triangle));
            gathered.push(&place, frame);
        });
        flush(&mut gathered, &mut sees);
    }
}
