//! Splats of one tile into its pixels, front to back.

mod depth;
mod scalar;
mod simd;

use core::ops::Range;

use bytemuck::{Pod, Zeroable};

use crate::kernel::Kernel;
use crate::lists::Pair;
use crate::math::{Real, Single, exp2_in_range};
use crate::project::{LEAST_LOG2_ALPHA, Splat};
use crate::tiles::TILE;

pub use depth::TileDepths;
pub use scalar::row_span;

use depth::{Keep, NoDepths};

/// No Gaussian covers more of a pixel than this.
pub const GREATEST_ALPHA: f32 = 0.99;
/// A pixel that lets less light than this through is finished.
pub const LEAST_TRANSMITTANCE: f32 = 1e-4;

/// A tile's pixels, row by row.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(transparent)]
pub struct TilePixels(pub [TileRow; TILE as usize]);

/// Pixels of a row: red, green and blue accumulated, then T, what is left of the light from behind.
///
/// A plane for each would be 4 KB from the next one: loads would wait for stores whose addresses
/// differ in higher bits only.
pub type TileRow = [[f32; TILE as usize]; 4];

/// An untouched pixel: black, and all light comes through.
pub const CLEAR: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

impl TilePixels {
    /// Untouched.
    pub const fn clear() -> Self {
        let [black, one] = [[0.0; TILE as usize], [1.0; TILE as usize]];
        Self([[black, black, black, one]; TILE as usize])
    }

    /// Makes all pixels untouched, in place: a tile is more than a small stack holds.
    pub fn reset(&mut self) {
        for [red, green, blue, transmittance] in &mut self.0 {
            [red, green, blue].into_iter().for_each(|channel| channel.fill(0.0));
            transmittance.fill(1.0);
        }
    }

    /// Whether no pixel lets light through any more.
    fn finished(&self) -> bool {
        self.0.iter().all(|[.., t]| t.iter().all(|&t| t < LEAST_TRANSMITTANCE))
    }
}

/// (r, g, b, T) of a pixel of a row.
#[inline]
pub fn pixel(row: &TileRow, column: usize) -> [f32; 4] {
    let column = column % TILE as usize;
    [row[0][column], row[1][column], row[2][column], row[3][column]]
}

/// What drawing took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Exponents computed, all lanes counted; depends on the kernel.
    pub evaluations: u64,
    /// Gaussians blended into pixels.
    pub blends: u64,
    /// Splats in the lists of the tiles: a splat counts once for each tile that its bounds meet.
    pub pairs: u64,
}

impl core::ops::AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.evaluations += other.evaluations;
        self.blends += other.blends;
        self.pairs += other.pairs;
    }
}

/// Blends the splats of `order` into a tile whose pixels are `columns × rows` of the frame.
///
/// A pixel blends a splat where its alpha is at least 1/255, C += T α c, T −= T α, until T < 1e-4.
pub fn draw_tile(
    kernel: Kernel,
    splats: &[Splat],
    order: &[Pair],
    area: [Range<u32>; 2],
    pixels: &mut TilePixels,
) -> Counts {
    draw_tile_keeping(kernel, splats, order, area, pixels, &mut NoDepths)
}

/// The same, and the depth of each pixel that is no longer half transparent; the others' stay.
pub(crate) fn draw_tile_with_depths(
    kernel: Kernel,
    splats: &[Splat],
    order: &[Pair],
    area: [Range<u32>; 2],
    pixels: &mut TilePixels,
    depths: &mut TileDepths,
) -> Counts {
    draw_tile_keeping(kernel, splats, order, area, pixels, depths)
}

fn draw_tile_keeping(
    kernel: Kernel,
    splats: &[Splat],
    order: &[Pair],
    area: [Range<u32>; 2],
    pixels: &mut TilePixels,
    depths: &mut impl Keep,
) -> Counts {
    let drawn = match kernel {
        Kernel::Scalar => scalar::draw_tile(splats, order, area, pixels, depths),
        Kernel::Simd(_) => kernel.run(simd::DrawTile { splats, order, area, pixels, depths }),
    };
    Counts { pairs: order.len() as u64, ..drawn }
}

/// log₂ of a splat's alpha at a pixel's centre, before the clamp at 0.99. One definition for the
/// rasterizer and for what differentiates it.
#[inline(always)]
pub fn log2_alpha(splat: &Splat, dx: f32, dy: f32) -> f32 {
    let [a, b, c] = splat.falloff;
    let v = c * dy;
    exponent(splat.log2_opacity - v * v, a * dx, b * dy)
}

/// log₂ of alpha from what is the same along a row: `room`, log₂ of the opacity less (c dy)², and b dy.
#[inline(always)]
pub fn exponent<R: Real>(room: R, a_dx: R, b_dy: R) -> R {
    let u = a_dx + b_dy;
    room - u * u
}

/// Alpha from its logarithm, at most 0.99, and whether it reaches 1/255.
#[inline(always)]
pub fn alpha<S: Single>(log2_alpha: S) -> (S, S::Mask) {
    let touches = log2_alpha.reaches(log2_alpha.like(LEAST_LOG2_ALPHA));
    let alpha = exp2_in_range(log2_alpha);
    // Where it does not touch, alpha may be anything.
    (alpha.least(alpha.like(GREATEST_ALPHA)), touches)
}

/// C += T α c, T −= T α.
#[inline(always)]
pub fn blend<R: Real>(pixel: [R; 4], alpha: R, color: [R; 3]) -> [R; 4] {
    blend_weight(pixel, pixel[3] * alpha, color)
}

/// [`blend`] with T α.
#[inline(always)]
fn blend_weight<R: Real>([r, g, b, t]: [R; 4], weight: R, color: [R; 3]) -> [R; 4] {
    [r + weight * color[0], g + weight * color[1], b + weight * color[2], t - weight]
}
