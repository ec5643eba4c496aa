//! The rasterizer's specification: splats of one tile, front to back, one pixel after the other.

use core::ops::Range;

use crate::math::exp2_of_alpha;
use crate::project::{LEAST_LOG2_ALPHA, Splat};
use crate::tiles::{Pair, TILE};

/// No Gaussian covers more of a pixel than this.
pub const GREATEST_ALPHA: f32 = 0.99;
/// A pixel that lets less light than this through is finished.
pub const LEAST_TRANSMITTANCE: f32 = 1e-4;

/// A tile's pixels: (r, g, b) accumulated, and the transmittance T that is left.
pub type TilePixels = [[f32; 4]; (TILE * TILE) as usize];

/// An untouched pixel.
pub const CLEAR: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

/// log₂ of a splat's alpha at a pixel's centre, before the clamp at 0.99. One definition for the
/// rasterizer and for what differentiates it.
#[inline]
pub fn log2_alpha(splat: &Splat, dx: f32, dy: f32) -> f32 {
    let [a, b, c] = splat.falloff;
    let (u, v) = (a * dx + b * dy, c * dy);
    (splat.log2_opacity - v * v) - u * u
}

/// Alpha from its logarithm: `None` below 1/255, at most 0.99.
#[inline]
pub fn alpha(log2_alpha: f32) -> Option<f32> {
    if !(log2_alpha >= LEAST_LOG2_ALPHA) {
        return None;
    }
    let alpha = exp2_of_alpha(if log2_alpha < 0.0 { log2_alpha } else { 0.0 });
    Some(if alpha < GREATEST_ALPHA { alpha } else { GREATEST_ALPHA })
}

/// Blends the splats of `order` into a tile whose pixels are `columns × rows` of the frame.
/// Returns how many blends that took.
///
/// A pixel blends a splat where its alpha is at least 1/255, C += T α c, T −= T α, until T < 1e-4.
pub fn draw_tile(
    splats: &[Splat],
    order: &[Pair],
    [columns, rows]: [Range<u32>; 2],
    pixels: &mut TilePixels,
) -> u64 {
    let mut blends = 0;
    let mut unfinished = columns.len() * rows.len();
    for pair in order {
        let Some(splat) = splats.get(pair.splat as usize) else { continue };
        let [x0, y0, x1, y1] = splat.bounds.map(u32::from);
        let (x0, x1) = (x0.max(columns.start), x1.min(columns.end));
        for y in y0.max(rows.start)..y1.min(rows.end) {
            let dy = y as f32 + 0.5 - splat.mean[1];
            let start = ((y - rows.start) * TILE) as usize;
            let row = pixels.get_mut(start..start + TILE as usize).unwrap_or(&mut []);
            for x in x0..x1 {
                let Some(pixel) = row.get_mut((x - columns.start) as usize) else { continue };
                let dx = x as f32 + 0.5 - splat.mean[0];
                if pixel[3] < LEAST_TRANSMITTANCE {
                    continue;
                }
                let Some(alpha) = alpha(log2_alpha(splat, dx, dy)) else { continue };
                blend(pixel, alpha, splat.color);
                blends += 1;
                unfinished -= usize::from(pixel[3] < LEAST_TRANSMITTANCE);
            }
        }
        if unfinished == 0 {
            break;
        }
    }
    blends
}

/// C += T α c, T −= T α.
#[inline]
pub fn blend(pixel: &mut [f32; 4], alpha: f32, color: [f32; 3]) {
    let weight = pixel[3] * alpha;
    pixel[0] += weight * color[0];
    pixel[1] += weight * color[1];
    pixel[2] += weight * color[2];
    pixel[3] -= weight;
}
