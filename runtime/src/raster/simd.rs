//! Pixels of a row side by side: strips of 4, 8 or 16 that start at the splat's left edge.

use core::ops::Range;

use fearless_simd::{Simd, SimdBase, f32x4, f32x8, f32x16};

use super::{Counts, LEAST_TRANSMITTANCE, TilePixels, alpha, blend, exponent};
use crate::lanes::Lanes;
use crate::project::Splat;
use crate::tiles::{Pair, TILE};

/// Splats between two looks at whether the whole tile is finished.
const FINISHED_EVERY: usize = 64;

/// [`super::draw_tile`] in vectors.
#[inline(always)]
pub(super) fn draw_tile<S: Simd>(
    simd: S,
    splats: &[Splat],
    order: &[Pair],
    [columns, rows]: [Range<u32>; 2],
    pixels: &mut TilePixels,
) -> Counts {
    let mut counts = Counts::default();
    for pairs in order.chunks(FINISHED_EVERY) {
        for pair in pairs {
            let Some(splat) = splats.get(pair.splat as usize) else { continue };
            let [x0, y0, x1, y1] = splat.bounds.map(u32::from);
            let (x0, x1) = (x0.max(columns.start), x1.min(columns.end));
            let (y0, y1) = (y0.max(rows.start), y1.min(rows.end));
            if x0 >= x1 {
                // A list may hold what misses the tile: it costs nothing.
                continue;
            }
            let area = Area {
                left: columns.start,
                top: rows.start,
                columns: x0..x1,
                rows: y0..y1,
            };
            match x1 - x0 {
                ..=4 if S::f32s::LEN == 4 => strip::<f32x4<S>>(simd, splat, area, pixels, &mut counts),
                _ if S::f32s::LEN == 4 => strips::<f32x4<S>>(simd, splat, area, pixels, &mut counts),
                ..=8 => strip::<f32x8<S>>(simd, splat, area, pixels, &mut counts),
                _ if S::f32s::LEN == 8 => strips::<f32x8<S>>(simd, splat, area, pixels, &mut counts),
                _ => strips::<f32x16<S>>(simd, splat, area, pixels, &mut counts),
            }
        }
        if pixels.transmittance.iter().all(|&t| t < LEAST_TRANSMITTANCE) {
            break;
        }
    }
    counts
}

/// Pixels of the frame that a splat may touch in a tile.
#[derive(Clone)]
struct Area {
    /// First column and row of the tile.
    left: u32,
    top: u32,
    columns: Range<u32>,
    rows: Range<u32>,
}

/// Strip after strip.
#[inline(always)]
fn strips<V: Lanes>(
    token: V::Token,
    splat: &Splat,
    area: Area,
    pixels: &mut TilePixels,
    counts: &mut Counts,
) {
    let mut start = area.columns.start;
    while start < area.columns.end {
        let columns = start..area.columns.end.min(start + V::LEN as u32);
        start = columns.end;
        strip::<V>(token, splat, Area { columns, ..area.clone() }, pixels, counts);
    }
}

/// At most `V::LEN` columns.
#[inline(always)]
fn strip<V: Lanes>(
    token: V::Token,
    splat: &Splat,
    area: Area,
    pixels: &mut TilePixels,
    counts: &mut Counts,
) {
    let constant = |x: f32| V::splat(token, x);
    let [a, b, c] = splat.falloff;
    // A strip ends inside the tile's row, if need be by starting further to the left.
    let first = (area.columns.start - area.left).min(TILE - V::LEN as u32);
    let x = V::load(token, &LANES) + constant((area.left + first) as f32);
    let inside = x.reaches(constant(area.columns.start as f32))
        & x.below(constant(area.columns.end as f32));
    let a_dx = constant(a) * (x + constant(0.5) - constant(splat.mean[0]));
    let color = splat.color.map(constant);
    let [red, green, blue] = &mut pixels.color;
    let transmittance = &mut pixels.transmittance;
    for y in area.rows.clone() {
        let dy = y as f32 + 0.5 - splat.mean[1];
        let v = c * dy;
        let p = exponent(constant(splat.log2_opacity - v * v), a_dx, constant(b * dy));
        let (alpha, touches) = alpha(p);
        let at = ((y - area.top) * TILE + first) as usize;
        let planes = [&*red, &*green, &*blue, &*transmittance];
        let before = planes.map(
            #[inline(always)]
            |plane| V::load(token, plane.get(at..).unwrap_or(&[])),
        );
        let blended = touches & inside & before[3].reaches(constant(LEAST_TRANSMITTANCE));
        let bits = V::bits(blended);
        counts.evaluations += V::LEN as u64;
        counts.blends += u64::from(bits.count_ones());
        let alpha = V::select(blended, alpha, constant(0.0));
        let after = blend(before, alpha, color);
        let planes = [&mut *red, &mut *green, &mut *blue, &mut *transmittance];
        for (plane, value) in planes.into_iter().zip(after) {
            value.store(plane.get_mut(at..).unwrap_or(&mut []));
        }
    }
}

/// Columns of a strip from its first one on.
const LANES: [f32; 16] =
    [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0];
