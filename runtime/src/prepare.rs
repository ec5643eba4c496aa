//! A frame before its pixels: the splats of a plan, and how many each tile will draw.

use dermis_format::record::GroupRecord;
use dermis_format::{Avatar, Block, Records};

use crate::batch::{Batch, Codes, Decode, Discs, Fulls, Shape};
use crate::camera::Camera;
use crate::error::Error;
use crate::frame::Frame;
use crate::kernel::Kernel;
use crate::lanes::MAX_LANES;
use crate::plan::{Plan, RegionPlan};
use crate::posed::Posed;
use crate::project::{Splat, View};
use crate::scratch::{Scratch, words};
use crate::screen::SplatCamera;
use crate::select::{Harmonics, Place, for_each_block, for_each_of_block};
use crate::tiles::{TileGrid, count_tiles};

/// Greatest width and height of a frame, px.
pub const MAX_SIZE: u32 = 16_384;

/// A frame ready to be drawn, band by band, by any number of threads.
#[derive(Debug)]
pub struct Prepared<'s> {
    pub(crate) splats: &'s [Splat],
    pub(crate) tile_counts: &'s [u32],
    pub(crate) grid: TileGrid,
    pub(crate) kernel: Kernel,
    selected: u32,
}

impl<'s> Prepared<'s> {
    /// Words of scratch for at most `budget` Gaussians on `width × height` pixels.
    pub fn scratch_len(budget: u32, width: u32, height: u32) -> usize {
        words::<Splat>(budget as usize).saturating_add(TileGrid::new(width, height).tiles())
    }

    /// Projects the Gaussians of `plan` that can be seen. Dropped are: Gaussians on a triangle
    /// that faces away and is not two-sided, or that has no frame; nearer than
    /// [`NEAR`](crate::project::NEAR); off screen; fainter than 1/255 everywhere.
    pub fn new(
        posed: &Posed<'_, '_>,
        plan: &Plan,
        camera: &Camera,
        scratch: &'s mut [u32],
    ) -> Result<Self, Error> {
        let (width, height) = (camera.width, camera.height);
        check(posed.avatar(), plan, camera)?;
        let grid = TileGrid::new(width, height);
        let mut scratch =
            Scratch::new(scratch, Self::scratch_len(plan.gaussians(), width, height))?;
        let tile_counts = scratch.take::<u32>(grid.tiles())?;
        let slots = scratch.take::<Splat>(plan.gaussians() as usize)?;
        let camera =
            SplatCamera { view: View::new(camera), low_pass: posed.avatar().header().low_pass };
        let mut filled = 0;
        for_each_block(posed.avatar(), plan, |block, region, drawn| {
            let rest = slots.get_mut(filled..).unwrap_or(&mut []);
            filled += match block.records {
                Records::Disc(_) => {
                    project_block::<Discs>(posed, &camera, block, region, drawn, rest)
                }
                Records::Full(_) => {
                    project_block::<Fulls>(posed, &camera, block, region, drawn, rest)
                }
            };
        });
        let splats: &[Splat] = slots.get(..filled).unwrap_or(&[]);
        count_tiles(&grid, splats, tile_counts);
        Ok(Self { splats, tile_counts, grid, kernel: posed.kernel(), selected: plan.gaussians() })
    }

    /// Splats in the order of the file, which breaks ties of depth.
    pub fn splats(&self) -> &'s [Splat] {
        self.splats
    }

    /// Gaussians of the plan.
    pub fn gaussians_selected(&self) -> u32 {
        self.selected
    }
}

/// Whether a plan is one for this avatar, and the frame has a size that can be drawn.
pub(crate) fn check(avatar: &Avatar<'_>, plan: &Plan, camera: &Camera) -> Result<(), Error> {
    let (width, height) = (camera.width, camera.height);
    if !(1..=MAX_SIZE).contains(&width) || !(1..=MAX_SIZE).contains(&height) {
        return Err(Error::Size { width, height });
    }
    plan.check(avatar)
}

/// Fills `slots` with the splats of a block's Gaussians that can be seen; returns how many.
fn project_block<G: Shape>(
    posed: &Posed<'_, '_>,
    camera: &SplatCamera,
    block: &Block<'_>,
    region: &RegionPlan,
    drawn: u32,
    slots: &mut [Splat],
) -> usize {
    let mut filled = 0;
    let mut gathered = Gathered::<G>::new();
    let mut flush = |gathered: &mut Gathered<'_, G>| {
        gathered.project(posed.kernel(), camera, |splat| {
            if let Some(slot) = slots.get_mut(filled) {
                *slot = splat;
                filled += 1;
            }
        });
    };
    let frame_of = |triangle| posed.shown_frame(triangle, camera.view.eye);
    for_each_of_block(block, region, drawn, frame_of, |place, frame| {
        if !gathered.takes(&place) {
            flush(&mut gathered);
        }
        gathered.push(&place, frame);
    });
    flush(&mut gathered);
    filled
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
    fn push(&mut self, place: &Place<'a, '_>, frame: &Frame<f32>) {
        let lane = self.batch.len % MAX_LANES;
        self.ranges = Some((place.group, place.log2_factor));
        self.batch.set_frame(lane, frame);
        self.batch.opacity[lane] = place.opacity;
        self.harmonics[lane] = place.harmonics();
        G::gather(place, lane, &mut self.codes);
        self.batch.len = lane + 1;
    }

    /// Projects what is here, and empties it.
    fn project(&mut self, kernel: Kernel, camera: &SplatCamera, mut visit: impl FnMut(Splat)) {
        let Some((group, log2_factor)) = self.ranges.take() else { return };
        kernel.run(Decode { batch: &mut self.batch, codes: &self.codes, group, log2_factor });
        let harmonics = if self.harmonics[0].codes.is_empty() { &[] } else { &self.harmonics[..] };
        camera.splats(kernel, &self.batch, harmonics, |_, splat| visit(splat));
        self.batch.len = 0;
    }
}
