//! Blending, one pixel after the other, as in the runtime's scalar kernel.

use dermis_runtime::Camera;
use dermis_runtime::lists::Pair;
use dermis_runtime::math::Real;
use dermis_runtime::project::{LEAST_LOG2_ALPHA, Splat};
use dermis_runtime::raster::{
    CLEAR, Counts, GREATEST_ALPHA, LEAST_TRANSMITTANCE, alpha, blend, log2_alpha, row_span,
};
use dermis_runtime::tiles::{TILE, TileGrid};

use super::Exact;
use super::splats::FAINTER_LOG2;

/// (r, g, b, T) of each pixel of a tile.
type Pixels = [[f32; 4]; (TILE * TILE) as usize];

/// The picture before it is rounded, row-major, and what it took.
pub(super) fn draw(
    camera: &Camera,
    splats: &[Splat],
    lists: &[Vec<Pair>],
    background: [f32; 3],
    exact: Exact,
) -> (Vec<[f32; 3]>, Counts) {
    // Constants, so that each variant is compiled on its own as the runtime's kernel is.
    let draw_tile = match (exact.exponential, exact.stop, exact.skip) {
        (false, false, false) => draw_tile::<false, false, false>,
        (false, false, true) => draw_tile::<false, false, true>,
        (false, true, false) => draw_tile::<false, true, false>,
        (false, true, true) => draw_tile::<false, true, true>,
        (true, false, false) => draw_tile::<true, false, false>,
        (true, false, true) => draw_tile::<true, false, true>,
        (true, true, false) => draw_tile::<true, true, false>,
        (true, true, true) => draw_tile::<true, true, true>,
    };
    let grid = TileGrid::new(camera.width, camera.height);
    let mut picture = vec![[0.0; 3]; camera.width as usize * camera.height as usize];
    let mut counts = Counts::default();
    let mut pixels: Pixels = [CLEAR; (TILE * TILE) as usize];
    for (list, tile) in lists.iter().zip(0..) {
        pixels.fill(CLEAR);
        counts += draw_tile(&grid, tile, splats, list, &mut pixels);
        let [columns, rows] = grid.pixels(tile);
        for (y, row) in rows.zip(pixels.as_chunks::<{ TILE as usize }>().0) {
            for (x, &[r, g, b, t]) in columns.clone().zip(row) {
                let color = [0, 1, 2].map(|i| [r, g, b][i] + t * background[i]);
                picture[(y * camera.width + x) as usize] = color;
            }
        }
    }
    (picture, counts)
}

fn draw_tile<const EXPONENTIAL: bool, const STOP: bool, const SKIP: bool>(
    grid: &TileGrid,
    tile: u32,
    splats: &[Splat],
    order: &[Pair],
    pixels: &mut Pixels,
) -> Counts {
    let [columns, rows] = grid.pixels(tile);
    let mut counts = Counts::default();
    let mut unfinished = columns.len() * rows.len();
    for pair in order {
        let splat = &splats[pair.splat as usize];
        let [x0, y0, x1, y1] = splat.bounds.map(u32::from);
        let (x0, x1) = (x0.max(columns.start), x1.min(columns.end));
        // What decides how far a row reaches.
        let faint = if SKIP { FAINTER_LOG2 } else { 0.0 };
        let reaching = Splat { log2_opacity: splat.log2_opacity + faint, ..*splat };
        for y in y0.max(rows.start)..y1.min(rows.end) {
            let dy = y as f32 + 0.5 - splat.mean[1];
            let span = row_span(&reaching, dy, x0..x1);
            counts.evaluations += span.len() as u64;
            for x in span {
                let pixel = &mut pixels[((y - rows.start) * TILE + x - columns.start) as usize];
                if !STOP && pixel[3] < LEAST_TRANSMITTANCE {
                    continue;
                }
                let dx = x as f32 + 0.5 - splat.mean[0];
                let (alpha, touches) = alpha_of::<EXPONENTIAL, SKIP>(log2_alpha(splat, dx, dy));
                if !touches {
                    continue;
                }
                *pixel = blend(*pixel, alpha, splat.color);
                counts.blends += 1;
                unfinished -= usize::from(!STOP && pixel[3] < LEAST_TRANSMITTANCE);
            }
        }
        if unfinished == 0 {
            break;
        }
    }
    counts
}

/// Alpha, and whether it is blended.
#[inline(always)]
fn alpha_of<const EXPONENTIAL: bool, const SKIP: bool>(log2_alpha: f32) -> (f32, bool) {
    if !EXPONENTIAL && !SKIP {
        return alpha(log2_alpha);
    }
    // The runtime's polynomial serves exponents down to −8; its general form goes on.
    let power = if EXPONENTIAL { libm::exp2f(log2_alpha) } else { log2_alpha.exp2() };
    let faint = if SKIP { FAINTER_LOG2 } else { 0.0 };
    (power.at_most(GREATEST_ALPHA), log2_alpha >= LEAST_LOG2_ALPHA - faint)
}
