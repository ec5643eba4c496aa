//! From the gradient by pixels to the gradient by splats.
//!
//! Each tile walks its list front to back once more, keeping per pixel the transmittance T and
//! the colour C so far. Behind splat i lies S = picture − C, background included, so
//!
//! ```text
//! ∂/∂cᵢ = Tᵢ αᵢ g,   ∂/∂αᵢ = Tᵢ (g · cᵢ) − (g · S) / (1 − αᵢ)
//! ```
//!
//! A (tile, splat) pair has a gradient of its own; pairs are summed afterwards in the order of tiles.

use core::ops::Range;

use dermis_runtime::lists::Pair;
use dermis_runtime::project::Splat;
use dermis_runtime::raster::{
    GREATEST_ALPHA, LEAST_TRANSMITTANCE, alpha, blend, log2_alpha, row_span,
};
use dermis_runtime::tiles::{TILE, TileGrid};
use rayon::prelude::*;

use super::forward::Forward;

/// Gradient by what the rasterizer knows of a splat.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SplatGradient {
    /// By `mean`.
    pub mean: [f32; 2],
    /// By `falloff`.
    pub falloff: [f32; 3],
    /// By `log2_opacity`.
    pub log2_opacity: f32,
    /// By `color`.
    pub color: [f32; 3],
}

impl SplatGradient {
    fn add(&mut self, other: &Self) {
        for i in 0..2 {
            self.mean[i] += other.mean[i];
        }
        for i in 0..3 {
            self.falloff[i] += other.falloff[i];
            self.color[i] += other.color[i];
        }
        self.log2_opacity += other.log2_opacity;
    }
}

/// Gradient by each splat of `forward`, given the gradient by each pixel of its picture.
pub fn by_splats(forward: &Forward, by_pixels: &[[f32; 3]]) -> Vec<SplatGradient> {
    let grid = TileGrid::new(forward.picture.width, forward.picture.height);
    let bands: Vec<Vec<SplatGradient>> = forward
        .bands
        .par_iter()
        .enumerate()
        .map(|(row, band)| {
            let mut gradients = Vec::with_capacity(band.pairs.len());
            let mut start = 0;
            for (column, &end) in band.ends.iter().enumerate() {
                let order = &band.pairs[start as usize..end as usize];
                start = end;
                let tile = row as u32 * grid.columns + column as u32;
                by_pairs(forward, by_pixels, order, grid.pixels(tile), &mut gradients);
            }
            gradients
        })
        .collect();
    let mut sums = vec![SplatGradient::default(); forward.splats.len()];
    for (band, gradients) in forward.bands.iter().zip(&bands) {
        for (pair, gradient) in band.pairs.iter().zip(gradients) {
            sums[pair.splat as usize].add(gradient);
        }
    }
    sums
}

/// State of a pixel on the way: C so far, then T.
type Pixel = [f32; 4];

fn by_pairs(
    forward: &Forward,
    by_pixels: &[[f32; 3]],
    order: &[Pair],
    [columns, rows]: [Range<u32>; 2],
    gradients: &mut Vec<SplatGradient>,
) {
    let width = forward.picture.width as usize;
    let mut pixels = [[0.0, 0.0, 0.0, 1.0]; (TILE * TILE) as usize];
    for pair in order {
        let splat = &forward.splats[pair.splat as usize];
        let mut sum = SplatGradient::default();
        let [x0, y0, x1, y1] = splat.bounds.map(u32::from);
        let (x0, x1) = (x0.max(columns.start), x1.min(columns.end));
        for y in y0.max(rows.start)..y1.min(rows.end) {
            let dy = y as f32 + 0.5 - splat.mean[1];
            let span = row_span(splat, dy, x0..x1);
            let start = ((y - rows.start) * TILE + span.start - columns.start) as usize;
            let frame_row = y as usize * width;
            for (x, pixel) in span.clone().zip(&mut pixels[start..start + span.len()]) {
                if pixel[3] < LEAST_TRANSMITTANCE {
                    continue;
                }
                let at = frame_row + x as usize;
                let d = [x as f32 + 0.5 - splat.mean[0], dy];
                by_blend(splat, d, pixel, forward.picture.rgb[at], by_pixels[at], &mut sum);
            }
        }
        gradients.push(sum);
    }
}

/// One blend: adds to the splat's gradient and moves the pixel on.
#[inline]
fn by_blend(
    splat: &Splat,
    [dx, dy]: [f32; 2],
    pixel: &mut Pixel,
    picture: [f32; 3],
    g: [f32; 3],
    sum: &mut SplatGradient,
) {
    let exponent = log2_alpha(splat, dx, dy);
    let (alpha, touches) = alpha(exponent);
    if !touches {
        return;
    }
    let transmittance = pixel[3];
    let weight = transmittance * alpha;
    *pixel = blend(*pixel, alpha, splat.color);
    let (mut by_color, mut behind) = (0.0, 0.0);
    for i in 0..3 {
        sum.color[i] += weight * g[i];
        by_color += g[i] * splat.color[i];
        behind += g[i] * (picture[i] - pixel[i]);
    }
    if alpha >= GREATEST_ALPHA {
        return;
    }
    let by_alpha = transmittance * by_color - behind / (1.0 - alpha);
    let by_exponent = by_alpha * alpha * core::f32::consts::LN_2;
    let [a, b, c] = splat.falloff;
    sum.log2_opacity += by_exponent;
    // exponent = log₂ o − u² − v² with u = a dx + b dy, v = c dy.
    let by_u = -2.0 * by_exponent * (a * dx + b * dy);
    let by_v = -2.0 * by_exponent * c * dy;
    sum.falloff[0] += by_u * dx;
    sum.falloff[1] += by_u * dy;
    sum.falloff[2] += by_v * dy;
    sum.mean[0] -= by_u * a;
    sum.mean[1] -= by_u * b + by_v * c;
}
