//! A posed avatar: vertices in the world, and a frame for each triangle.

use dermis_format::header::MAX_REGIONS;
use dermis_format::{Avatar, Sample};

use crate::error::Error;
use crate::extent::Extent;
use crate::footprint::{AddFootprints, RegionSums};
use crate::frame::Frame;
use crate::frames::{FindVisible, FrameBlock, Frames, MakeFrames, MakeSomeFrames};
use crate::kernel::Kernel;
use crate::lanes::Row;
use crate::math::Affine;
use crate::needed::Needed;
use crate::plan::Plan;
use crate::pose::{self, Pose};
use crate::project::View;
use crate::scratch::{Scratch, words};
use crate::skin::Moving;

/// An avatar in a pose. Made once for all cameras.
#[derive(Debug)]
pub struct Posed<'s, 'a> {
    avatar: &'s Avatar<'a>,
    vertices: &'s [[f32; 3]],
    frames: Frames<'s>,
    kernel: Kernel,
    /// Gaussians of each region that it was posed for; none: all.
    counts: Option<heapless::Vec<u32, MAX_REGIONS>>,
}

impl<'s, 'a> Posed<'s, 'a> {
    /// Words of scratch that posing this avatar takes.
    pub fn scratch_len(avatar: &Avatar<'_>) -> usize {
        let header = avatar.header();
        // The first three together stay under 2²², whatever their 16 bits say.
        let moving = words::<Affine>(usize::from(header.joints))
            + words::<Affine>(usize::from(header.binds))
            + words::<f32>(usize::from(header.morph_targets));
        let frames = words::<FrameBlock>(FrameBlock::count(header.triangles));
        moving.saturating_add(words::<[f32; 3]>(header.vertices as usize)).saturating_add(frames)
    }

    /// Skins the vertices (morph targets, then linear blend skinning) and frames the triangles.
    /// A vertex that is not finite takes its triangles out of the picture, nothing else.
    pub fn new(
        avatar: &'s Avatar<'a>,
        pose: &Pose<'_>,
        kernel: Kernel,
        scratch: &'s mut [u32],
    ) -> Result<Self, Error> {
        Self::moving_from(avatar, pose, 0.0, kernel, scratch)
    }

    /// [`Self::new`], but what moves the surface less than so many metres stays as it rests, as [`Plan::still_below`] says.
    pub(crate) fn moving_from(
        avatar: &'s Avatar<'a>,
        pose: &Pose<'_>,
        metres: f32,
        kernel: Kernel,
        scratch: &'s mut [u32],
    ) -> Result<Self, Error> {
        let mut scratch = Scratch::new(scratch, Self::scratch_len(avatar))?;
        Self::of_needed(avatar, pose, metres, kernel, &mut scratch, None)
    }

    /// Words of scratch that [`Self::for_plan`] takes.
    pub fn scratch_len_for_plan(avatar: &Avatar<'_>) -> usize {
        Self::scratch_len(avatar).saturating_add(Needed::scratch_len(avatar))
    }

    /// Poses what a plan shows: vertices of triangles on which none of its Gaussians stands are not skinned (they are NaN;
    /// those that the caller gives stay), and what [`Plan::still_below`] says stays as it rests. Drawing this plan, or one
    /// that has no more in any region, gives the bytes of [`Self::new`] where nothing stays still; other plans are refused
    /// with [`Error::Plan`].
    ///
    /// Where the plan has so many Gaussians that looking for their vertices takes longer than skinning them, all are skinned.
    pub fn for_plan(
        avatar: &'s Avatar<'a>,
        pose: &Pose<'_>,
        plan: &Plan,
        kernel: Kernel,
        scratch: &'s mut [u32],
    ) -> Result<Self, Error> {
        plan.check(avatar)?;
        let mut scratch = Scratch::new(scratch, Self::scratch_len_for_plan(avatar))?;
        let few = plan.gaussians() <= avatar.header().vertices / VERTICES_PER_GAUSSIAN;
        let needed = few.then(|| Needed::of_plan(avatar, plan, &mut scratch)).transpose()?;
        let posed =
            Self::of_needed(avatar, pose, plan.still_below(), kernel, &mut scratch, needed)?;
        Ok(Self { counts: Some(plan.counts()), ..posed })
    }

    fn of_needed(
        avatar: &'s Avatar<'a>,
        pose: &Pose<'_>,
        still_below: f32,
        kernel: Kernel,
        scratch: &mut Scratch<'s>,
        needed: Option<Needed<'s>>,
    ) -> Result<Self, Error> {
        let header = avatar.header();
        let joints = scratch.take(usize::from(header.joints))?;
        let matrices = scratch.take(usize::from(header.binds))?;
        let weights = scratch.take(usize::from(header.morph_targets))?;
        let vertices = scratch.take(header.vertices as usize)?;
        let blocks = scratch.take(FrameBlock::count(header.triangles))?;
        let moving = match *pose {
            Pose::Vertices(given) => {
                pose::copy("vertices", vertices, given)?;
                None
            }
            Pose::Between { from, to, share } => {
                pose::mix(vertices, from, to, share)?;
                None
            }
            Pose::Rest | Pose::Clip { .. } | Pose::Joints { .. } => {
                pose::evaluate(avatar, pose, still_below, joints, matrices, weights)?;
                Some(Moving { matrices, weights })
            }
        };
        match needed {
            None => {
                if let Some(moving) = moving {
                    moving.skin(avatar, |_| true, vertices);
                }
                kernel.run(MakeFrames { avatar, vertices, blocks: &mut *blocks });
            }
            Some(needed) => {
                if let Some(moving) = moving {
                    moving.skin(avatar, |index| needed.vertex(index), vertices);
                }
                let (blocks, needed) = (&mut *blocks, needed.triangles());
                kernel.run(MakeSomeFrames { avatar, vertices, blocks, needed });
            }
        }
        let frames = Frames::new(blocks, needed.map(|needed| needed.triangles()));
        Ok(Self { avatar, vertices, frames, kernel, counts: None })
    }

    /// Whether all that a plan draws was posed.
    pub(crate) fn check(&self, plan: &Plan) -> Result<(), Error> {
        let within = |posed: &heapless::Vec<u32, MAX_REGIONS>| {
            plan.counts().iter().zip(posed).all(|(count, posed)| count <= posed)
        };
        self.counts.as_ref().is_none_or(within).then_some(()).ok_or(Error::Plan)
    }

    /// The avatar.
    pub fn avatar(&self) -> &'s Avatar<'a> {
        self.avatar
    }

    /// Vertices in the world, metres; NaN where a plan did not need them ([`Self::for_plan`]).
    pub fn vertices(&self) -> &'s [[f32; 3]] {
        self.vertices
    }

    /// The instructions it was made with, which draw it, too.
    pub fn kernel(&self) -> Kernel {
        self.kernel
    }

    /// Frame of a triangle; `None` where it has none.
    pub fn frame(&self, triangle: u32) -> Option<Frame<f32>> {
        let rows = self.frame_rows(triangle)?.map(|row| *row);
        (rows != [[0.0; 4]; 3]).then_some(Frame::of_rows(rows))
    }

    /// [`Frame::rows`] of a triangle, all zero where it has no frame.
    #[inline(always)]
    pub(crate) fn frame_rows(&self, triangle: u32) -> Option<[&'s Row; 3]> {
        self.frames.rows(triangle)
    }

    /// Finds the triangles on which Gaussians of `extent` show something to a camera; see
    /// [`FindVisible`].
    pub(crate) fn find_visible(&self, view: &View<f32>, extent: Extent, visible: &mut [u32]) {
        let Self { avatar, frames, kernel, .. } = *self;
        kernel.run(FindVisible { avatar, frames, view, extent, visible });
    }

    /// Adds up what the triangles of each region that are looked at cover of a camera's picture.
    pub(crate) fn add_footprints(
        &self,
        view: &View<f32>,
        extent: Extent,
        samples: impl Iterator<Item = Sample>,
        sums: &mut RegionSums,
    ) {
        let Self { avatar, frames, kernel, .. } = *self;
        kernel.run(AddFootprints { avatar, frames, view, extent, samples, sums });
    }

    /// Whether a triangle has a frame and shows something to `eye`: its front faces it, or its back
    /// is shown, too.
    pub fn shows(&self, triangle: u32, eye: [f32; 3]) -> bool {
        let two_sided = self.avatar.is_two_sided(triangle as usize);
        let kind = self.avatar.header().frame;
        self.frame(triangle).is_some_and(|frame| frame.shows(kind, two_sided, eye))
    }
}

/// A plan looks for its vertices where there are at least so many for each of its Gaussians. A Gaussian costs a few nanoseconds to
/// look at, a vertex about ten to skin, and each Gaussian finds up to three: of 6,221 vertices 1,171 Gaussians need 2,418.
const VERTICES_PER_GAUSSIAN: u32 = 2;
