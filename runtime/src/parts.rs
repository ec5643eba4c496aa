//! The projection of a frame in shares that any thread may do.

use core::ops::Range;

use dermis_format::record::GroupRecord;
use dermis_format::{Block, Records};

use crate::batch::{Batch, Codes, Decode, Discs, Fulls, Shape};
use crate::frame::Frame;
use crate::kernel::Kernel;
use crate::lanes::MAX_LANES;
use crate::plan::{Plan, RegionPlan};
use crate::posed::Posed;
use crate::project::Splat;
use crate::screen::SplatCamera;
use crate::select::{Harmonics, Place, for_each_block, for_each_of_block};

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
    filled: usize,
}

impl<'p, 'a> Source<'p, 'a> {
    /// Cuts the plan's blocks into shares of about as many Gaussians, with a slot for each.
    pub(crate) fn split(
        self,
        mut slots: &'p mut [Splat],
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
                let share = blocks.clone();
                blocks.start = blocks.end;
                let _ = shares.push(Part {
                    source: self,
                    blocks: share,
                    start,
                    slots: front,
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
                let rest = slots.get_mut(*filled..).unwrap_or(&mut []);
                *filled += match block.records {
                    Records::Disc(_) => source.project::<Discs>(block, region, drawn, rest),
                    Records::Full(_) => source.project::<Fulls>(block, region, drawn, rest),
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
    fn project<G: Shape>(
        &self,
        block: &Block<'_>,
        region: &RegionPlan,
        drawn: u32,
        slots: &mut [Splat],
    ) -> usize {
        let mut filled = 0;
        let mut gathered = Gathered::<G>::new();
        let mut flush = |gathered: &mut Gathered<'_, G>| {
            gathered.project(self.posed.kernel(), self.camera, |splat| {
                if let Some(slot) = slots.get_mut(filled) {
                    *slot = splat;
                    filled += 1;
                }
            });
        };
        let shows = |triangle: u32| {
            let word = self.visible.get(triangle as usize / MAX_LANES);
            word.is_some_and(|word| word >> (triangle as usize % MAX_LANES) & 1 == 1)
        };
        for_each_of_block(block, region, drawn, shows, |place| {
            if !gathered.takes(&place) {
                flush(&mut gathered);
            }
            gathered.push(&place, self.posed);
        });
        flush(&mut gathered);
        filled
    }
}

/// Gaussians of one group, on their way from the file to the screen.
struct Gathered<'a, G> {
    batch: Batch<G>,
    codes: Codes,
    harmonics: [Harmonics<'a>; MAX_LANES],
    ranges: Option<(&'a GroupRecord, f32)>,
}

impl<'a, G: Shape> Gathered<'a, G> {
    fn new() -> Self {
        Self {
            batch: Batch::default(),
            codes: Codes::default(),
            harmonics: [Harmonics::default(); MAX_LANES],
            ranges: None,
        }
    }

    /// Whether there is room, and the place has the ranges of those that are here.
    #[inline(always)]
    fn takes(&self, place: &Place<'a, '_>) -> bool {
        let same = self.ranges.is_none_or(|(group, _)| core::ptr::eq(group, place.group));
        self.batch.len < MAX_LANES && same
    }

    #[inline(always)]
    fn push(&mut self, place: &Place<'a, '_>, posed: &Posed<'_, '_>) {
        let lane = self.batch.len % MAX_LANES;
        self.ranges = Some((place.group, place.log2_factor));
        self.batch.set_frame(
            lane,
            match place.triangle {
                Some(triangle) => posed.frame_numbers(triangle),
                None => Frame::world().numbers(),
            },
        );
        self.batch.opacity[lane] = place.opacity;
        if !place.block.harmonics.is_empty() {
            self.harmonics[lane] = place.harmonics();
        }
        G::gather(place, lane, &mut self.codes);
        self.batch.len = lane + 1;
    }

    /// Projects what is here, and empties it.
    fn project(&mut self, kernel: Kernel, camera: &SplatCamera, mut visit: impl FnMut(Splat)) {
        let Some((group, log2_factor)) = self.ranges.take() else { return };
        kernel.run(Decode { batch: &mut self.batch, codes: &self.codes, group, log2_factor });
        let harmonics = self.harmonics.get(..self.batch.len).unwrap_or(&[]);
        let has_any = harmonics.first().is_some_and(|first| !first.codes.is_empty());
        let harmonics = if has_any { harmonics } else { &[] };
        camera.splats(kernel, &self.batch, harmonics, |_, splat| visit(splat));
        self.batch.len = 0;
    }
}
