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

    /// Puts [`Frame::rows`] of a triangle in a lane.
    #[inline(always)]
    pub(crate) fn set_rows(&mut self, lane: usize, rows: [&Row; 3]) {
        for (to, row) in self.0.iter_mut().zip(rows) {
            to[lane % MAX_LANES] = *row;
        }
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

/// Sixteen bits.
const ALL: u32 = (1 << MAX_LANES) - 1;

/// The frames of a posed mesh, sixteen side by side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frames<'s> {
    blocks: &'s [FrameBlock],
    /// Bit t % 16 of word t / 16: whether triangle t was framed; none: all were.
    made: Option<&'s [u32]>,
}

impl<'s> Frames<'s> {
    pub(crate) fn new(blocks: &'s [FrameBlock], made: Option<&'s [u32]>) -> Self {
        Self { blocks, made }
    }

    /// A block of which some was framed, and bits of these.
    #[inline(always)]
    pub(crate) fn block(&self, index: usize) -> Option<(&'s FrameBlock, u32)> {
        let made = self.made.map_or(ALL, |made| made.get(index).copied().unwrap_or(0));
        self.blocks.get(index).filter(|_| made != 0).map(|block| (block, made))
    }

    /// [`Frame::rows`] of a triangle, all zero if it has none; `None` if it was not framed.
    #[inline(always)]
    pub(crate) fn rows(&self, triangle: u32) -> Option<[&'s Row; 3]> {
        let lane = triangle as usize % MAX_LANES;
        let (block, made) = self.block(triangle as usize / MAX_LANES)?;
        (made >> lane & 1 == 1).then(|| block.rows(lane))
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
        let mut corners = Corners::new(avatar, vertices);
        for (index, block) in blocks.iter_mut().enumerate() {
            for lane in 0..MAX_LANES {
                // Beyond the last triangle all corners are vertex 0: no area, no frame.
                corners.set(lane, MAX_LANES * index + lane);
            }
            corners.frame::<V>(token, block);
        }
    }
}

/// Frames some of them.
pub(crate) struct MakeSomeFrames<'s, 'a> {
    pub(crate) avatar: &'s Avatar<'a>,
    pub(crate) vertices: &'s [[f32; 3]],
    pub(crate) blocks: &'s mut [FrameBlock],
    /// Bit t % 16 of word t / 16: whether triangle t is framed. What the blocks hold of the others stays.
    pub(crate) needed: &'s [u32],
}

impl Work for MakeSomeFrames<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self, token: V::Token) {
        let Self { avatar, vertices, blocks, needed } = self;
        let mut corners = Corners::new(avatar, vertices);
        let mut made = FrameBlock::zeroed();
        let mut needed = ones(needed);
        loop {
            let mut triangles = [0; MAX_LANES];
            let mut filled = 0;
            for (slot, triangle) in triangles.iter_mut().zip(&mut needed) {
                corners.set(filled, triangle);
                *slot = triangle;
                filled += 1;
            }
            if filled == 0 {
                return;
            }
            // In the lanes beyond stand earlier triangles.
            corners.frame::<V>(token, &mut made);
            for (lane, &triangle) in triangles.iter().enumerate().take(filled) {
                if let Some(block) = blocks.get_mut(triangle / MAX_LANES) {
                    for (to, from) in block.0.iter_mut().zip(&made.0) {
                        to[triangle % MAX_LANES] = from[lane];
                    }
                }
            }
        }
    }
}

/// The triangles whose bits are set.
#[inline(always)]
fn ones(words: &[u32]) -> impl Iterator<Item = usize> + '_ {
    words.iter().zip(0..).flat_map(|(&word, index): (&u32, usize)| {
        let left = core::iter::successors(Some(word), |left| Some(left & left.wrapping_sub(1)));
        let left = left.take_while(|&left| left != 0);
        left.map(move |left| MAX_LANES * index + left.trailing_zeros() as usize)
    })
}

/// The corners of sixteen triangles.
struct Corners<'s, 'a> {
    avatar: &'s Avatar<'a>,
    vertices: &'s [[f32; 3]],
    rows: [[Row; MAX_LANES]; 3],
}

impl<'s, 'a> Corners<'s, 'a> {
    #[inline(always)]
    fn new(avatar: &'s Avatar<'a>, vertices: &'s [[f32; 3]]) -> Self {
        Self { avatar, vertices, rows: [[[0.0; 4]; MAX_LANES]; 3] }
    }

    /// Puts those of a triangle in place `lane`.
    #[inline(always)]
    fn set(&mut self, lane: usize, triangle: usize) {
        for (rows, vertex) in self.rows.iter_mut().zip(self.avatar.triangle(triangle)) {
            let [x, y, z] = self.vertices.get(vertex as usize).copied().unwrap_or([0.0; 3]);
            rows[lane % MAX_LANES] = [x, y, z, 0.0];
        }
    }

    /// Fills a block with their frames.
    #[inline(always)]
    fn frame<V: Lanes>(&self, token: V::Token, block: &mut FrameBlock) {
        let kind = self.avatar.header().frame;
        let mut at = 0;
        while at < MAX_LANES {
            let corners = each(
                self.rows.each_ref(),
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

/// Which triangles have a frame and show something to a camera: their front looks there, or their
/// back is shown, too, and what stands on them can reach the frame. Bit t % 16 of word t / 16 is
/// triangle t.
pub(crate) struct FindVisible<'s, 'a> {
    pub(crate) avatar: &'s Avatar<'a>,
    pub(crate) frames: Frames<'s>,
    pub(crate) view: &'s View<f32>,
    pub(crate) extent: Extent,
    pub(crate) visible: &'s mut [u32],
}

impl Work for FindVisible<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self, token: V::Token) {
        let Self { avatar, frames, view, extent, visible } = self;
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
        for (word, index) in visible.iter_mut().zip(0..) {
            let Some((block, made)) = frames.block(index) else {
                *word = 0;
                continue;
            };
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
            *word = exist & made & (face | u32::from(avatar.two_sided_of_sixteen(index)));
        }
    }
}
