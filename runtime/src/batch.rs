//! Up to 64 Gaussians that are projected together, each on the frame of its triangle.
//!
//! What belongs to one Gaussian is gathered in rows of four numbers, and turned into columns in
//! registers: a row is one move where its numbers would be four.

use dermis_format::{Disc, Full};

use crate::frame::Frame;
use crate::gaussian::{Ellipsoid, disc_on, full_on};
use crate::harmonics::not_below_zero;
use crate::lanes::{Lanes, Row, load_rows};
use crate::math::{Real, each};
use crate::project::{Projected, project};
use crate::screen::SplatCamera;

/// Gaussians of a batch at most: as many as a word has bits.
pub const BATCH: usize = u64::BITS as usize;

/// Gaussians that are projected together.
pub trait Batch {
    /// How many; at most [`BATCH`].
    fn len(&self) -> usize;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Projects Gaussians `at..at + V::LEN` for each camera, putting them in the world once; beyond the last one it gives
    /// anything.
    fn project<V: Lanes, const EYES: usize>(
        &self,
        token: V::Token,
        at: usize,
        cameras: &[SplatCamera<V>; EYES],
    ) -> [OnScreen<V>; EYES];
}

/// Gaussians on the screen.
#[derive(Clone, Copy, Debug)]
pub struct OnScreen<R: Real> {
    /// Where, and how wide.
    pub projected: Projected<R>,
    /// Which can be drawn.
    pub drawable: R::Mask,
    /// Before the low-pass.
    pub opacity: R,
    /// Display-referred sRGB seen from the eye, not below 0.
    pub color: [R; 3],
}

/// Gaussians in the world on the screen of each camera.
#[inline(always)]
pub(crate) fn seen<R: Real, const N: usize, const EYES: usize>(
    ellipsoid: &Ellipsoid<R, N>,
    opacity: R,
    color: [R; 3],
    cameras: &[SplatCamera<R>; EYES],
) -> [OnScreen<R>; EYES] {
    each(
        cameras.each_ref(),
        #[inline(always)]
        |camera: &SplatCamera<R>| {
            let (projected, drawable) = project(&camera.view, camera.low_pass, ellipsoid);
            OnScreen { projected, drawable, opacity, color }
        },
    )
}

/// The frame of each Gaussian of a batch: first, second and third rows of [`Frame::rows`].
#[derive(Clone, Debug)]
pub(crate) struct FrameRows([[Row; BATCH]; 3]);

impl FrameRows {
    /// The world's, all of them.
    pub(crate) fn new() -> Self {
        let [a, b, c] = Frame::world().rows();
        Self([[a; BATCH], [b; BATCH], [c; BATCH]])
    }

    /// Puts the rows of a frame in place `lane`.
    #[inline(always)]
    pub(crate) fn set(&mut self, lane: usize, [a, b, c]: [&Row; 3]) {
        let [first, second, third] = &mut self.0;
        let lane = lane % BATCH;
        first[lane] = *a;
        second[lane] = *b;
        third[lane] = *c;
    }

    /// Frames `at..at + V::LEN`.
    #[inline(always)]
    pub(crate) fn load<V: Lanes>(&self, token: V::Token, at: usize) -> Frame<V> {
        Frame::load(token, self.0.each_ref().map(<[Row; BATCH]>::as_slice), at)
    }
}

/// Discs that are not quantized, as training has them.
#[derive(Clone, Debug)]
pub struct Discs {
    len: usize,
    frames: FrameRows,
    /// Position, then angle.
    places: [Row; BATCH],
    /// log₂ of the scales, opacity, nothing.
    shapes: [Row; BATCH],
    /// Colour, nothing.
    colors: [Row; BATCH],
}

impl Discs {
    /// None.
    pub fn new() -> Self {
        let rows = [[0.0; 4]; BATCH];
        Self { len: 0, frames: FrameRows::new(), places: rows, shapes: rows, colors: rows }
    }

    /// Puts a disc on `frame` behind the others; a full batch stays as it is.
    #[inline]
    pub fn push(&mut self, disc: &Disc, frame: &Frame<f32>) {
        let lane = self.len;
        if lane >= BATCH {
            return;
        }
        let ([x, y, z], [s, t], [r, g, b]) = (disc.position, disc.log2_scale, disc.color);
        self.frames.set(lane, frame.rows().each_ref());
        self.places[lane] = [x, y, z, disc.angle];
        self.shapes[lane] = [s, t, disc.opacity, 0.0];
        self.colors[lane] = [r, g, b, 0.0];
        self.len = lane + 1;
    }

    /// Removes all.
    pub fn clear(&mut self) {
        self.len = 0;
    }
}

impl Default for Discs {
    fn default() -> Self {
        Self::new()
    }
}

impl Batch for Discs {
    fn len(&self) -> usize {
        self.len
    }

    #[inline(always)]
    fn project<V: Lanes, const EYES: usize>(
        &self,
        token: V::Token,
        at: usize,
        cameras: &[SplatCamera<V>; EYES],
    ) -> [OnScreen<V>; EYES] {
        let [x, y, z, angle] = load_rows::<V>(token, &self.places, at);
        let [s, t, opacity, _] = load_rows::<V>(token, &self.shapes, at);
        let [r, g, b, _] = load_rows::<V>(token, &self.colors, at);
        let disc = disc_on(&self.frames.load(token, at), [x, y, z], angle, [s, t]);
        seen(&disc, opacity, not_below_zero([r, g, b]), cameras)
    }
}

/// Gaussians with rotation and three scales that are not quantized, in the colours in which they are seen.
#[derive(Clone, Debug)]
pub struct Fulls {
    len: usize,
    frames: FrameRows,
    /// Position, then opacity.
    places: [Row; BATCH],
    rotations: [Row; BATCH],
    /// log₂ of the scales, nothing.
    scales: [Row; BATCH],
    /// Colour, nothing.
    colors: [Row; BATCH],
}

impl Fulls {
    /// None.
    pub fn new() -> Self {
        let rows = [[0.0; 4]; BATCH];
        let frames = FrameRows::new();
        Self { len: 0, frames, places: rows, rotations: rows, scales: rows, colors: rows }
    }

    /// Puts a Gaussian on `frame` behind the others; a full batch stays as it is.
    #[inline]
    pub fn push(&mut self, full: &Full, frame: &Frame<f32>) {
        let lane = self.len;
        if lane >= BATCH {
            return;
        }
        let ([x, y, z], [s, t, u], [r, g, b]) = (full.position, full.log2_scale, full.color);
        self.frames.set(lane, frame.rows().each_ref());
        self.places[lane] = [x, y, z, full.opacity];
        self.rotations[lane] = full.rotation;
        self.scales[lane] = [s, t, u, 0.0];
        self.colors[lane] = [r, g, b, 0.0];
        self.len = lane + 1;
    }

    /// Removes all.
    pub fn clear(&mut self) {
        self.len = 0;
    }
}

impl Default for Fulls {
    fn default() -> Self {
        Self::new()
    }
}

impl Batch for Fulls {
    fn len(&self) -> usize {
        self.len
    }

    #[inline(always)]
    fn project<V: Lanes, const EYES: usize>(
        &self,
        token: V::Token,
        at: usize,
        cameras: &[SplatCamera<V>; EYES],
    ) -> [OnScreen<V>; EYES] {
        let [x, y, z, opacity] = load_rows::<V>(token, &self.places, at);
        let rotation = load_rows::<V>(token, &self.rotations, at);
        let [s, t, u, _] = load_rows::<V>(token, &self.scales, at);
        let [r, g, b, _] = load_rows::<V>(token, &self.colors, at);
        let full = full_on(&self.frames.load(token, at), [x, y, z], rotation, [s, t, u]);
        seen(&full, opacity, not_below_zero([r, g, b]), cameras)
    }
}
