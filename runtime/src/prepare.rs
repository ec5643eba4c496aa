//! A frame before its pixels: the splats of a plan, and how many each tile will draw.

use core::ops::Range;

use dermis_format::Avatar;

use crate::camera::Camera;
use crate::error::Error;
use crate::extent::Extent;
use crate::frames::FrameBlock;
use crate::kernel::Kernel;
use crate::lists::{ListKey, Listed};
use crate::parts::{Looker, Source};
use crate::plan::Plan;
use crate::posed::Posed;
use crate::project::{Splat, View};
use crate::scratch::{Scratch, words};
use crate::screen::{Slots, SplatCamera};
use crate::tiles::TileGrid;

pub use crate::parts::{MAX_PARTS, Part};

/// Greatest width and height of a frame, px.
pub const MAX_SIZE: u32 = 16_384;

/// A frame ready to be drawn, band by band, by any number of threads.
#[derive(Debug)]
pub struct Prepared<'s> {
    pub(crate) listed: Listed<'s>,
    pub(crate) tile_counts: &'s [u32],
    pub(crate) kernel: Kernel,
    selected: u32,
}

impl<'s> Prepared<'s> {
    /// Words of scratch for at most `budget` Gaussians on `width × height` pixels.
    pub fn scratch_len(avatar: &Avatar<'_>, budget: u32, width: u32, height: u32) -> usize {
        (words::<Splat>(1) + words::<ListKey>(1))
            .saturating_mul(budget as usize)
            .saturating_add(TileGrid::new(width, height).tiles())
            .saturating_add(FrameBlock::count(avatar.header().triangles))
    }

    /// Projects the Gaussians of `plan` that can be seen. Dropped are: Gaussians on a triangle
    /// that faces away and is not two-sided, or that has no frame; nearer than
    /// [`NEAR`](crate::project::NEAR); off screen; of an opacity under
    /// [`LEAST_OPACITY`](crate::select::LEAST_OPACITY) at the plan's level; fainter than 1/255
    /// everywhere; with a number on the screen that is not finite.
    ///
    /// Fails with [`Error::Plan`], [`Error::Size`] or [`Error::Scratch`].
    pub fn new(
        posed: &Posed<'_, '_>,
        plan: &Plan,
        camera: &Camera,
        scratch: &'s mut [u32],
    ) -> Result<Self, Error> {
        let run = |parts: &mut [Part<'_, '_>]| parts.iter_mut().for_each(Part::project);
        Self::in_parts(posed, plan, camera, scratch, 1, run)
    }

    /// [`Self::new`] in at most `parts` shares of about the same work (and at most [`MAX_PARTS`]):
    /// `run` is given all of them and calls [`Part::project`] on each, in any order and on any
    /// thread. The outcome is the same for any number.
    pub fn in_parts(
        posed: &Posed<'_, '_>,
        plan: &Plan,
        camera: &Camera,
        scratch: &'s mut [u32],
        parts: usize,
        run: impl FnOnce(&mut [Part<'_, '_>]),
    ) -> Result<Self, Error> {
        let [prepared] = Self::of_eyes(posed, plan, [camera], [scratch], parts, run)?;
        Ok(prepared)
    }

    /// Frames of several cameras, as the two of a headset: [`Self::in_parts`] for each, with scratch of its own, but what
    /// cameras have in common, walking the plan, decoding Gaussians and putting them in the world, is done once. The outcome
    /// is the same as alone.
    pub fn of_eyes<const EYES: usize>(
        posed: &Posed<'_, '_>,
        plan: &Plan,
        cameras: [&Camera; EYES],
        scratch: [&'s mut [u32]; EYES],
        parts: usize,
        run: impl FnOnce(&mut [Part<'_, '_, EYES>]),
    ) -> Result<[Self; EYES], Error> {
        let mut lent = heapless::Vec::<Lent<'s>, EYES>::new();
        for (camera, scratch) in cameras.iter().zip(scratch) {
            let _ = lent.push(Lent::new(posed, plan, camera, scratch)?);
        }
        // As many as cameras: the lengths are the same, so this cannot fail.
        let mut lent = lent.into_array::<EYES>().map_err(|_| Error::Plan)?;
        let lookers = lent.each_ref().map(|lent| lent.looker);
        let slots = lent.each_mut().map(|lent| Slots { splats: lent.splats, keys: lent.keys });
        let mut shares = Source { posed, plan, lookers: &lookers }.split(slots, parts);
        run(&mut shares);
        let mut filled = heapless::Vec::<[Range<usize>; EYES], MAX_PARTS>::new();
        for share in &shares {
            let _ = filled.push(share.filled());
        }
        drop(shares);
        let mut eye = 0..;
        Ok(lent.map(|Lent { looker, tile_counts, splats, keys }| {
            let eye = eye.next().unwrap_or_default();
            let (splats, keys) = (close_gaps(splats, &filled, eye), close_gaps(keys, &filled, eye));
            let listed = Listed { splats, keys, grid: looker.grid };
            listed.count(tile_counts);
            Self { listed, tile_counts, kernel: posed.kernel(), selected: plan.gaussians() }
        }))
    }

    /// Splats in the order of the file, which breaks ties of depth.
    pub fn splats(&self) -> &'s [Splat] {
        self.listed.splats
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

/// What the frame of one camera takes of its scratch.
struct Lent<'s> {
    looker: Looker<'s>,
    tile_counts: &'s mut [u32],
    splats: &'s mut [Splat],
    keys: &'s mut [ListKey],
}

impl<'s> Lent<'s> {
    fn new(
        posed: &Posed<'_, '_>,
        plan: &Plan,
        camera: &Camera,
        scratch: &'s mut [u32],
    ) -> Result<Self, Error> {
        let (width, height) = (camera.width, camera.height);
        let avatar = posed.avatar();
        check(avatar, plan, camera)?;
        posed.check(plan)?;
        let grid = TileGrid::new(width, height);
        let needed = Prepared::scratch_len(avatar, plan.gaussians(), width, height);
        let mut scratch = Scratch::new(scratch, needed)?;
        let tile_counts = scratch.take::<u32>(grid.tiles())?;
        let visible = scratch.take::<u32>(FrameBlock::count(avatar.header().triangles))?;
        let splats = scratch.take::<Splat>(plan.gaussians() as usize)?;
        let keys = scratch.take::<ListKey>(plan.gaussians() as usize)?;
        let camera = SplatCamera { view: View::new(camera), low_pass: avatar.header().low_pass };
        posed.find_visible(&camera.view, Extent::of_plan(avatar, plan), visible);
        let looker = Looker { camera, visible, grid };
        Ok(Self { looker, tile_counts, splats, keys })
    }
}

/// Moves the runs of `slots` that are `filled` with splats of a camera together.
fn close_gaps<'s, T: Copy, const EYES: usize>(
    slots: &'s mut [T],
    filled: &[[Range<usize>; EYES]],
    eye: usize,
) -> &'s [T] {
    let mut end = 0;
    for run in filled.iter().filter_map(|filled| filled.get(eye)) {
        if end == run.start {
            end = run.end;
            continue;
        }
        for from in run.clone() {
            if let Some(&moved) = slots.get(from)
                && let Some(slot) = slots.get_mut(end)
            {
                *slot = moved;
                end += 1;
            }
        }
    }
    slots.get(..end).unwrap_or(&[])
}
