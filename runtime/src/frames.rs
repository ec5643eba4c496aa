//! The frames of all triangles of a posed mesh, sixteen side by side.

use bytemuck::{Pod, Zeroable};
use dermis_format::Avatar;

use crate::extent::Extent;
use crate::frame::Frame;
use crate::frustum::Frustum;
use crate::kernel::Work;
use crate::lanes::{Lanes, MAX_LANES, Row, load_rows};
use crate::math::each;
use crate::project::View;

/// Frames of sixteen triangles: the first, second and third rows of four of their numbers; all zero
/// where a triangle has no frame.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(transparent)]
pub(crate) struct FrameBlock([[Row; MAX_LANES]; 3]);

impl FrameBlock {
    /// How many hold the frames of `triangles`.
    pub(crate) const fn count(triangles: u32) -> usize {
        triangles.div_ceil(MAX_LANES as u32) as usize
    }

    /// [`Frame::rows`] of one triangle, all zero if it has none.
    #[inline(always)]
    pub(crate) fn rows(&self, lane: usize) -> [&Row; 3] {
        let [a, b, c] = &self.0;
        let lane = lane % MAX_LANES;
        [&a[lane], &b[lane], &c[lane]]
    }

    /// Frames of lanes `at..`, and where there are any.
    #[inline(always)]
    pub(crate) fn load<V: Lanes>(&self, token: V::Token, at: usize) -> (Frame<V>, V::Mask) {
        let frame = Frame::<V>::load(token, self.0.each_ref().map(|rows| rows.as_slice()), at);
        let [a, b, c] = frame.x;
        let length = a.abs() + b.abs() + c.abs();
        (frame, length.like(0.0).below(length))
    }
}

impl<V: Lanes> Frame<V> {
    /// From the first, second and third rows of things `at..`.
    #[inline(always)]
    pub(crate) fn load(token: V::Token, [a, b, c]: [&[Row]; 3], at: usize) -> Self {
        Self::of_rows([load_rows(token, a, at), load_rows(token, b, at), load_rows(token, c, at)])
    }
}

/// Frames the triangles of a mesh whose vertices are posed.
pub(crate) struct MakeFrames<'s, 'a, N> {
    pub(crate) avatar: &'s Avatar<'a>,
    pub(crate) vertices: &'s [[f32; 3]],
    pub(crate) blocks: &'s mut [FrameBlock],
    /// Whether a block of triangles is needed; the others get no frames.
    pub(crate) needed: N,
}

impl<N: Fn(usize) -> bool> Work for MakeFrames<'_, '_, N> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self, token: V::Token) {
        let Self { avatar, vertices, blocks, needed } = self;
        let kind = avatar.header().frame;
        let mut corners = [[[0.0; 4]; MAX_LANES]; 3];
        for (index, block) in blocks.iter_mut().enumerate() {
            if !needed(index) {
                *block = FrameBlock::zeroed();
                continue;
            }
            let first = index * MAX_LANES;
            for lane in 0..MAX_LANES {
                // Beyond the last triangle all corners are vertex 0: no area, no frame.
                let triangle = avatar.triangle(first + lane);
                for (rows, vertex) in corners.iter_mut().zip(triangle) {
                    let [x, y, z] = vertices.get(vertex as usize).copied().unwrap_or([0.0; 3]);
                    rows[lane] = [x, y, z, 0.0];
                }
            }
            let mut at = 0;
            while at < MAX_LANES {
                let corners = each(
                    corners.each_ref(),
                    #[inline(always)]
                    |rows: &[Row; MAX_LANES]| {
                        let [x, y, z, _] = load_rows::<V>(token, rows, at);
                        [x, y, z]
                    },
                );
                let (frame, exists) = Frame::of_triangles(kind, corners);
                let zero = V::splat(token, 0.0);
                for (to, row) in block.0.iter_mut().zip(frame.rows()) {
                    let row = each(
                        row,
                        #[inline(always)]
                        |number| V::select(exists, number, zero),
                    );
                    V::store_rows(row, to.get_mut(at..).unwrap_or(&mut []));
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
                let reach = frame.reach(kind);
                let misses = frustum.misses(frame.origin, reach * offset, reach * sigma);
                exist |= (V::bits(exists) & !V::bits(misses)) << at;
                face |= V::bits(frame.faces(kind, eye)) << at;
                at += V::LEN;
            }
            *word = exist & (face | u32::from(avatar.two_sided_of_sixteen(index)));
        }
    }
}
