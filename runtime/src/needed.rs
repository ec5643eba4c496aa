//! Which vertices and triangles the Gaussians of a plan stand on.

use dermis_format::{Avatar, order};

use crate::error::Error;
use crate::frames::FrameBlock;
use crate::lanes::MAX_LANES;
use crate::plan::Plan;
use crate::scratch::Scratch;
use crate::select::for_each_block;

/// What a plan needs of a mesh.
#[derive(Clone, Copy)]
pub(crate) struct Needed<'s> {
    /// Bit v % 32 of word v / 32 is vertex v.
    vertices: &'s [u32],
    /// Bit t % 16 of word t / 16 is triangle t.
    triangles: &'s [u32],
}

impl<'s> Needed<'s> {
    /// Words of scratch that it takes.
    pub(crate) fn scratch_len(avatar: &Avatar<'_>) -> usize {
        let header = avatar.header();
        header.vertices.div_ceil(u32::BITS) as usize + FrameBlock::count(header.triangles)
    }

    /// Walks the plan's Gaussians, a few nanoseconds each.
    pub(crate) fn of_plan(
        avatar: &Avatar<'_>,
        plan: &Plan,
        scratch: &mut Scratch<'s>,
    ) -> Result<Self, Error> {
        let header = avatar.header();
        let vertices = scratch.take::<u32>(header.vertices.div_ceil(u32::BITS) as usize)?;
        let triangles = scratch.take::<u32>(FrameBlock::count(header.triangles))?;
        vertices.fill(0);
        triangles.fill(0);
        for_each_block(avatar, plan, |block, _, drawn| {
            for (index, triangle) in (0..).zip(block.triangles.iter()) {
                let Some(word) = triangles.get_mut(triangle as usize / MAX_LANES) else { return };
                let bit = 1 << (triangle as usize % MAX_LANES);
                if *word & bit != 0 || order::rank(index, block.count) >= drawn {
                    continue;
                }
                *word |= bit;
                for vertex in avatar.triangle(triangle as usize) {
                    if let Some(word) = vertices.get_mut((vertex / u32::BITS) as usize) {
                        *word |= 1 << (vertex % u32::BITS);
                    }
                }
            }
        });
        Ok(Self { vertices, triangles })
    }

    /// Whether a Gaussian stands on a triangle at vertex `index`.
    pub(crate) fn vertex(&self, index: usize) -> bool {
        let word = self.vertices.get(index / u32::BITS as usize);
        word.is_some_and(|word| word >> (index % u32::BITS as usize) & 1 == 1)
    }

    /// Bit t % 16 of word t / 16: whether one stands on triangle t.
    pub(crate) fn triangles(&self) -> &'s [u32] {
        self.triangles
    }
}
