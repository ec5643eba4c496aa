//! A posed avatar: vertices in the world, and a frame for each triangle.

use dermis_format::Avatar;

use crate::error::Error;
use crate::extent::Extent;
use crate::footprint::{AddFootprints, RegionSums};
use crate::frame::Frame;
use crate::frames::{FindVisible, FrameBlock, MakeFrames};
use crate::kernel::Kernel;
use crate::lanes::{MAX_LANES, Row};
use crate::math::{Affine, transform};
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
        let header = avatar.header();
        let mut scratch = Scratch::new(scratch, Self::scratch_len(avatar))?;
        let joints = scratch.take(usize::from(header.joints))?;
        let matrices = scratch.take(usize::from(header.binds))?;
        let weights = scratch.take(usize::from(header.morph_targets))?;
        let vertices = scratch.take(header.vertices as usize)?;
        let frames = scratch.take(FrameBlock::count(header.triangles))?;
        if let Pose::Vertices(given) = pose {
            pose::copy("vertices", vertices, given)?;
        } else {
            pose::evaluate(avatar, pose, joints, matrices, weights)?;
            skin(avatar, matrices, weights, vertices);
        }
        kernel.run(MakeFrames { avatar, vertices, blocks: &mut *frames });
        Ok(Self { avatar, vertices, frames, kernel })
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

/// v' = Σ wᵢ Mᵢ (v + Σ wₜ dₜ).
fn skin(avatar: &Avatar<'_>, matrices: &[Affine], weights: &[f32], vertices: &mut [[f32; 3]]) {
    for (index, vertex) in vertices.iter_mut().enumerate() {
        *vertex = avatar.vertex_position(index);
    }
    for (target, &weight) in avatar.morph_targets().zip(weights) {
        if weight == 0.0 {
            continue;
        }
        let factor = weight * target.step;
        for (moved, delta) in target.vertices.iter().zip(target.deltas) {
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
