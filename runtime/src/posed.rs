//! A posed avatar: vertices in the world, and a frame for each triangle.

use dermis_format::Avatar;
use dermis_format::header::MAX_REGIONS;

use crate::error::Error;
use crate::extent::Extent;
use crate::footprint::{AddFootprints, RegionSums};
use crate::frame::Frame;
use crate::frames::{FindVisible, FrameBlock, MakeFrames};
use crate::kernel::Kernel;
use crate::lanes::{MAX_LANES, Row};
use crate::math::{Affine, transform};
use crate::needed::Needed;
use crate::plan::Plan;
use crate::pose::{self, Pose};
use crate::project::View;
use crate::scratch::{Scratch, words};

/// An avatar in a pose. Made once for all cameras.
#[derive(Debug)]
pub struct Posed<'s, 'a> {
    avatar: &'s Avatar<'a>,
    vertices: &'s [[f32; 3]],
    frames: &'s [FrameBlock],
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
        let mut scratch = Scratch::new(scratch, Self::scratch_len(avatar))?;
        let all = |_: usize| true;
        Self::of_needed(avatar, pose, 0.0, kernel, &mut scratch, all, all)
    }

    /// Words of scratch that [`Self::for_plan`] takes.
    pub fn scratch_len_for_plan(avatar: &Avatar<'_>) -> usize {
        Self::scratch_len(avatar).saturating_add(Needed::scratch_len(avatar))
    }

    /// Poses what a plan shows: vertices of triangles on which none of its Gaussians stands are not skinned (they are NaN),
    /// and what [`Plan::still_below`] says stays as it rests. Drawing this plan, or one of fewer Gaussians in any region,
    /// gives the bytes of [`Self::new`] where nothing stays still; other plans are refused with [`Error::Plan`].
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
        let still_below = plan.still_below();
        if plan.gaussians() > avatar.header().vertices / FEW {
            let all = |_: usize| true;
            return Self::of_needed(avatar, pose, still_below, kernel, &mut scratch, all, all);
        }
        let needed = Needed::of_plan(avatar, plan, &mut scratch)?;
        let (vertex, block) = (|index| needed.vertex(index), |index| needed.block(index));
        let posed =
            Self::of_needed(avatar, pose, still_below, kernel, &mut scratch, vertex, block)?;
        Ok(Self { counts: Some(plan.counts()), ..posed })
    }

    fn of_needed(
        avatar: &'s Avatar<'a>,
        pose: &Pose<'_>,
        still_below: f32,
        kernel: Kernel,
        scratch: &mut Scratch<'s>,
        vertex: impl Fn(usize) -> bool,
        block: impl Fn(usize) -> bool,
    ) -> Result<Self, Error> {
        let header = avatar.header();
        let joints = scratch.take(usize::from(header.joints))?;
        let matrices = scratch.take(usize::from(header.binds))?;
        let weights = scratch.take(usize::from(header.morph_targets))?;
        let vertices = scratch.take(header.vertices as usize)?;
        let frames = scratch.take(FrameBlock::count(header.triangles))?;
        if let Pose::Vertices(given) = pose {
            pose::copy("vertices", vertices, given)?;
        } else {
            pose::evaluate(avatar, pose, still_below, joints, matrices, weights)?;
            skin(avatar, matrices, weights, vertex, vertices);
        }
        kernel.run(MakeFrames { avatar, vertices, blocks: &mut *frames, needed: block });
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

    /// Vertices in the world, metres.
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
        let block = self.frames.get(triangle as usize / MAX_LANES)?;
        Some(block.rows(triangle as usize % MAX_LANES))
    }

    /// Finds the triangles on which Gaussians of `extent` show something to a camera; see
    /// [`FindVisible`].
    pub(crate) fn find_visible(&self, view: &View<f32>, extent: Extent, visible: &mut [u32]) {
        let Self { avatar, frames: blocks, kernel, .. } = *self;
        kernel.run(FindVisible { avatar, blocks, view, extent, visible });
    }

    /// Adds up what the triangles of each region cover of a camera's picture.
    pub(crate) fn add_footprints(
        &self,
        view: &View<f32>,
        extent: Extent,
        stride: usize,
        sums: &mut RegionSums,
    ) {
        let Self { avatar, frames: blocks, kernel, .. } = *self;
        kernel.run(AddFootprints { avatar, blocks, view, extent, stride, sums });
    }

    /// Whether a triangle has a frame and shows something to `eye`: its front faces it, or its back
    /// is shown, too.
    pub fn shows(&self, triangle: u32, eye: [f32; 3]) -> bool {
        let two_sided = self.avatar.is_two_sided(triangle as usize);
        let kind = self.avatar.header().frame;
        self.frame(triangle).is_some_and(|frame| frame.shows(kind, two_sided, eye))
    }
}

/// Gaussians of a plan that looks for its vertices, at most: a share of the mesh's vertices.
const FEW: u32 = 2;

/// v' = Σ wᵢ Mᵢ (v + Σ wₜ dₜ) of those that are needed; NaN of the others.
fn skin(
    avatar: &Avatar<'_>,
    matrices: &[Affine],
    weights: &[f32],
    needed: impl Fn(usize) -> bool,
    vertices: &mut [[f32; 3]],
) {
    for (index, vertex) in vertices.iter_mut().enumerate() {
        *vertex = if needed(index) { avatar.vertex_position(index) } else { [f32::NAN; 3] };
    }
    for (target, &weight) in avatar.morph_targets().zip(weights) {
        if weight == 0.0 {
            continue;
        }
        let factor = weight * target.step;
        for (moved, delta) in target.vertices.iter().zip(target.deltas) {
            if !needed(moved as usize) {
                continue;
            }
            if let Some(vertex) = vertices.get_mut(moved as usize) {
                for (x, code) in vertex.iter_mut().zip(delta) {
                    *x += factor * f32::from(code.get());
                }
            }
        }
    }
    if matrices.is_empty() {
        return;
    }
    for (index, vertex) in vertices.iter_mut().enumerate() {
        if !needed(index) {
            continue;
        }
        let mut sum = [0.0; 3];
        for (bind, weight) in avatar.influences(index) {
            if let (1.., Some(matrix)) = (weight, matrices.get(bind as usize)) {
                let weight = f32::from(weight) * (1.0 / 255.0);
                let moved = transform(matrix, *vertex);
                sum.iter_mut().zip(moved).for_each(|(sum, x)| *sum += weight * x);
            }
        }
        *vertex = sum;
    }
}
