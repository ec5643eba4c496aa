//! Splats of one tile into its pixels, front to back.

mod scalar;
mod simd;

use core::ops::Range;

use bytemuck::{Pod, Zeroable};
use fearless_simd::dispatch;

use crate::kernel::Kernel;
use crate::math::{Real, Single, exp2_of_alpha};
use crate::project::{LEAST_LOG2_ALPHA, Splat};
use crate::tiles::{Pair, TILE};

pub use scalar::row_span;

/// No Gaussian covers more of a pixel than this.
pub const GREATEST_ALPHA: f32 = 0.99;
/// A pixel that lets less light than this through is finished.
pub const LEAST_TRANSMITTANCE: f32 = 1e-4;

/// One number of each pixel of a tile, row by row.
pub type Plane = [f32; (TILE * TILE) as usize];

/// A tile's pixels.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct TilePixels {
    /// Red, green and blue accumulated.
    pub color: [Plane; 3],
    /// T, what is left of the light from behind.
    pub transmittance: Plane,
}

/// An untouched pixel: black, and all light comes through.
pub const CLEAR: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

impl TilePixels {
    /// Untouched.
    pub const fn clear() -> Self {
        Self { color: [[0.0; (TILE * TILE) as usize]; 3], transmittance: [1.0; (TILE * TILE) as usize] }
    }

    /// (r, g, b, T) of pixel `index`.
    #[inline]
    pub fn pixel(&self, index: usize) -> [f32; 4] {
        let [r, g, b] = &self.color;
        [r, g, b, &self.transmittance].map(|plane| plane.get(index).copied().unwrap_or(0.0))
    }

    /// Puts (r, g, b, T) there.
    #[inline]
    pub fn set_pixel(&mut self, index: usize, pixel: [f32; 4]) {
        let [r, g, b] = &mut self.color;
        for (plane, value) in [r, g, b, &mut self.transmittance].into_iter().zip(pixel) {
            if let Some(slot) = plane.get_mut(index) {
                *slot = value;
            }
        }
    }
}

/// What drawing took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Exponents computed, all lanes counted; depends on the kernel.
    pub evaluations: u64,
    /// Gaussians blended into pixels.
    pub blends: u64,
}

impl core::ops::AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.evaluations += other.evaluations;
        self.blends += other.blends;
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
    match kernel {
        Kernel::Scalar => scalar::draw_tile(splats, order, area, pixels),
        Kernel::Simd(level) => {
            dispatch!(level, simd => simd::draw_tile(simd, splats, order, area, pixels))
        }
    }
}

/// log₂ of a splat's alpha at a pixel's centre, before the clamp at 0.99. One definition for the
/// rasterizer and for what differentiates it.
#[inline(always)]
pub fn log2_alpha(splat: &Splat, dx: f32, dy: f32) -> f32 {
    let [a, b, c] = splat.falloff;
    let v = c * dy;
    exponent(splat.log2_opacity - v * v, a * dx, b * dy)
}

/// What is left of `room`, log₂ of opacity less the row's share, along the row.
#[inline(always)]
fn exponent<R: Real>(room: R, a_dx: R, b_dy: R) -> R {
    let u = a_dx + b_dy;
    room - u * u
}

/// Alpha from its logarithm, at most 0.99, and whether it reaches 1/255.
#[inline(always)]
pub fn alpha<S: Single>(log2_alpha: S) -> (S, S::Mask) {
    let touches = log2_alpha.reaches(log2_alpha.like(LEAST_LOG2_ALPHA));
    let alpha = exp2_of_alpha(log2_alpha);
    (alpha.at_most(alpha.like(GREATEST_ALPHA)), touches)
}

/// C += T α c, T −= T α.
#[inline(always)]
pub fn blend<R: Real>([r, g, b, t]: [R; 4], alpha: R, color: [R; 3]) -> [R; 4] {
    let weight = t * alpha;
    [r + weight * color[0], g + weight * color[1], b + weight * color[2], t - weight]
}
