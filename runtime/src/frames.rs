//! The frames of all triangles of a posed mesh, sixteen side by side.

use bytemuck::{Pod, Zeroable};
use dermis_format::Avatar;

use crate::extent::Extent;
use crate::frame::Frame;
use crate::frustum::Frustum;
use crate::kernel::Work;
use crate::lanes::{Column, Lanes, MAX_LANES, load, store};
use crate::math::{dot, each};
use crate::project::View;

/// Frames of sixteen triangles: axes x, y, z and origin, three numbers each; all zero where a
/// triangle has no frame.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(transparent)]
pub(crate) struct FrameBlock([Column; 12]);

impl FrameBlock {
    /// How many hold the frames of `triangles`.
    pub(crate) const fn count(triangles: u32) -> usize {
        triangles.div_ceil(MAX_LANES as u32) as usize
    }

    /// The frame of one triangle, all zero if it has none.
    #[inline(always)]
    pub(crate) fn numbers(&self, lane: usize) -> [f32; 12] {
        let lane = lane % MAX_LANES;
        each(
            self.0.each_ref(),
            #[inline(always)]
            |column: &Column| column[lane],
        )
    }

    /// Frames of lanes `at..`, and where there are any.
    #[inline(always)]
    fn load<V: Lanes>(&self, token: V::Token, at: usize) -> (Frame<V>, V::Mask) {
        let [a, b, c, d, e, f, g, h, i, j, k, l] = each(
            self.0.each_ref(),
            #[inline(always)]
            |column: &Column| load::<V>(token, column, at),
        );
        let frame = Frame { x: [a, b, c], y: [d, e, f], z: [g, h, i], origin: [j, k, l] };
        let length = a.abs() + b.abs() + c.abs();
        (frame, length.like(0.0).below(length))
    }
}

/// Frames the triangles of a mesh whose vertices are posed.
pub(crate) struct MakeFrames<'s, 'a> {
    pub(crate) avatar: &'s Avatar<'a>,
    pub(crate) vertices: &'s [[f32; 3]],
    pub(crate) blocks: &'s mut [FrameBlock],
}

impl Work for MakeFrames<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self, token: V::Token) {
        let Self { avatar, vertices, blocks } = self;
        let kind = avatar.header().frame;
        let mut corners = [[0.0; MAX_LANES]; 9];
        for (block, first) in blocks.iter_mut().zip((0..).step_by(MAX_LANES)) {
            for lane in 0..MAX_LANES {
                // Beyond the last triangle all corners are vertex 0: no area, no frame.
                let [a, b, c] = avatar.triangle(first + lane);
                let corner = |i: u32| vertices.get(i as usize).copied().unwrap_or([0.0; 3]);
                let numbers = [corner(a), corner(b), corner(c)];
                for (column, number) in corners.iter_mut().zip(numbers.as_flattened()) {
                    column[lane] = *number;
                }
            }
            let mut at = 0;
            while at < MAX_LANES {
                let [a, b, c, d, e, f, g, h, i] = each(
                    corners.each_ref(),
                    #[inline(always)]
                    |column: &Column| load::<V>(token, column, at),
                );
                let (frame, exists) = Frame::of_triangles(kind, [[a, b, c], [d, e, f], [g, h, i]]);
                let zero = V::splat(token, 0.0);
                let [x, y, z, origin] = [frame.x, frame.y, frame.z, frame.origin];
                let columns = block.0.iter_mut();
                for (column, number) in columns.zip([x, y, z, origin].as_flattened()) {
                    store(V::select(exists, *number, zero), column, at);
                }
                at += V::LEN;
            }
        }
    }
}

/// Which triangles have a frame and show something to a camera: their front looks there, or their
/// back is shown, too, and what stands on them can reach the frame. Bit t % 16 of word t / 16 is
/// triangle t.
pub(crate) struct FindVisible<'s, 'a> {
    pub(crate) avatar: &'s Avatar<'a>,
    pub(crate) blocks: &'s [FrameBlock],
    pub(crate) view: &'s View<f32>,
    pub(crate) extent: Extent,
    pub(crate) visible: &'s mut [u32],
}

impl Work for FindVisible<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self, token: V::Token) {
        let Self { avatar, blocks, view, extent, visible } = self;
        let kind = avatar.header().frame;
        let frustum = Frustum::of(view).map(
            #[inline(always)]
            |x| V::splat(token, x),
        );
        let eye = each(
            view.eye,
            #[inline(always)]
            |x| V::splat(token, x),
        );
        let offset = V::splat(token, extent.offset);
        let sigma = V::splat(token, extent.sigma);
        for ((word, block), index) in visible.iter_mut().zip(blocks).zip(0..) {
            let (mut exist, mut face) = (0, 0);
            let mut at = 0;
            while at < MAX_LANES {
                let (frame, exists) = block.load::<V>(token, at);
                let size = dot(frame.x, frame.x).sqrt();
                let misses = frustum.misses(frame.origin, size * offset, size * sigma);
                exist |= (V::bits(exists) & !V::bits(misses)) << at;
                face |= V::bits(frame.faces(kind, eye)) << at;
                at += V::LEN;
            }
            *word = exist & (face | u32::from(avatar.two_sided_of_sixteen(index)));
        }
    }
}
