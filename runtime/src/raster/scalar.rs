//! The specification: one pixel after the other.

use core::ops::Range;

use super::depth::Keep;
use super::{Counts, LEAST_TRANSMITTANCE, TilePixels, alpha, blend, log2_alpha, pixel};
use crate::lists::Pair;
use crate::math::Real;
use crate::project::{LEAST_LOG2_ALPHA, Splat};
use crate::tiles::TILE;

/// The part of `columns` that a splat can touch in the row at `dy`: none of its pixels is left
/// out, so this changes what a row costs, never what it shows.
///
/// α ≥ 1/255 where |a dx + b dy| ≤ √(reach − (c dy)²), with reach = log₂ o + log₂ 255.
#[inline]
pub fn row_span(splat: &Splat, dy: f32, columns: Range<u32>) -> Range<u32> {
    let [a, b, c] = splat.falloff;
    let v = c * dy;
    let room = splat.log2_opacity - LEAST_LOG2_ALPHA - v * v;
    // A little more than rounding can take away, here and in the ends.
    let half = room.at_least(0.0).sqrt() + 1e-3;
    let middle = -(b * dy);
    let end = |edge: f32, slack: f32| splat.mean[0] + edge / a + slack;
    let slack = 0.02 + 1e-5 * ((middle.abs() + half) / a);
    let first = end(middle - half, -slack) - 0.5;
    let last = end(middle + half, slack) + 0.5;
    let clamp = |x: f32| x.at_least(columns.start as f32).at_most(columns.end as f32) as u32;
    // What is not finite leaves nothing out.
    let start = if first.is_finite() { clamp(first) } else { columns.start };
    let stop = if last.is_finite() { clamp(last) } else { columns.end };
    start..stop
}

/// Blends the splats of `order` into a tile whose pixels are `columns × rows` of the frame.
///
/// A pixel blends a splat where its alpha is at least 1/255, C += T α c, T −= T α, until T < 1e-4.
pub(super) fn draw_tile(
    splats: &[Splat],
    order: &[Pair],
    [columns, rows]: [Range<u32>; 2],
    pixels: &mut TilePixels,
    depths: &mut impl Keep,
) -> Counts {
    let mut counts = Counts::default();
    let mut unfinished = columns.len() * rows.len();
    for pair in order {
        let Some(splat) = splats.get(pair.splat as usize) else { continue };
        let [x0, y0, x1, y1] = splat.bounds.map(u32::from);
        let (x0, x1) = (x0.max(columns.start), x1.min(columns.end));
        if x0 >= x1 {
            // A list may hold what misses the tile: it costs nothing.
            continue;
        }
        for y in y0.max(rows.start)..y1.min(rows.end) {
            let dy = y as f32 + 0.5 - splat.mean[1];
            let span = row_span(splat, dy, x0..x1);
            counts.evaluations += span.len() as u64;
            let at_y = ((y - rows.start) % TILE) as usize;
            let row = &mut pixels.0[at_y];
            for x in span {
                let column = (x - columns.start) as usize % TILE as usize;
                let before = pixel(row, column);
                if before[3] < LEAST_TRANSMITTANCE {
                    continue;
                }
                let dx = x as f32 + 0.5 - splat.mean[0];
                let (alpha, touches) = alpha(log2_alpha(splat, dx, dy));
                if !touches {
                    continue;
                }
                let after = blend(before, alpha, splat.color);
                row.iter_mut().zip(after).for_each(|(channel, value)| channel[column] = value);
                depths.blended((), [column, at_y], [before[3], after[3]], splat.depth);
                counts.blends += 1;
                unfinished -= usize::from(after[3] < LEAST_TRANSMITTANCE);
            }
        }
        if unfinished == 0 {
            break;
        }
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::gaussian::Ellipsoid;
    use crate::project::{View, project};
    use dermis_format::LowPass;

    /// Random discs from specks to needles as long as the frame: every pixel that a splat touches
    /// is in its row's span, and spans are at most 4 px wider than what is touched.
    #[test]
    fn spans_hold_every_touched_pixel() {
        const SIZE: u32 = 256;
        let camera = Camera {
            width: SIZE,
            height: SIZE,
            fx: 300.0,
            fy: 280.0,
            cx: 128.0,
            cy: 120.0,
            world_to_camera: crate::math::IDENTITY,
        };
        let view = View::new(&camera);
        let mut seed = 7u32;
        let mut unit = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as f32 / 16_777_216.0
        };
        let (mut rows, mut touched_rows) = (0, 0);
        for _ in 0..3000 {
            let lengths = [0, 1].map(|_| libm::exp2f(-12.0 + 12.0 * unit()));
            let direction = [0, 1, 2].map(|_| unit() - 0.5);
            let across = crate::math::cross(direction, [0.3, -0.5, 0.8]);
            let disc = Ellipsoid {
                center: [2.0 * unit() - 1.0, 2.0 * unit() - 1.0, 0.5 + 2.0 * unit()],
                axes: [
                    crate::math::scale(direction, lengths[0]),
                    crate::math::scale(across, lengths[1]),
                ],
            };
            let (p, drawable) = project(&view, LowPass::Classic, &disc);
            let opacity = 0.01 + 0.98 * unit();
            let splat = Splat::pack(&view, &p, opacity, [1.0; 3]).filter(|_| drawable);
            let Some(splat) = splat else { continue };
            let [x0, y0, x1, y1] = splat.bounds.map(u32::from);
            for y in y0..y1 {
                let dy = y as f32 + 0.5 - splat.mean[1];
                let touches =
                    |x: &u32| alpha(log2_alpha(&splat, *x as f32 + 0.5 - splat.mean[0], dy)).1;
                let span = row_span(&splat, dy, x0..x1);
                assert!((x0..x1).filter(touches).all(|x| span.contains(&x)), "{splat:?} row {y}");
                rows += 1;
                if let (Some(first), Some(last)) = ((x0..x1).find(touches), (x0..x1).rfind(touches))
                {
                    touched_rows += 1;
                    assert!(
                        span.len() <= (last - first + 5) as usize,
                        "{splat:?} row {y}: {span:?}"
                    );
                }
            }
        }
        assert!(touched_rows > 10_000 && rows < 4 * touched_rows);
    }
}
