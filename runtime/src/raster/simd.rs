//! Pixels of a row side by side: strips as wide as a vector that start at the splat's left edge.

use core::ops::Range;

use super::depth::Keep;
use super::{Counts, LEAST_TRANSMITTANCE, TilePixels, TileRow, alpha, blend_weight, exponent};
use crate::kernel::Work;
use crate::lanes::{Lanes, MAX_LANES};
use crate::lists::Pair;
use crate::math::each;
use crate::project::Splat;
use crate::tiles::TILE;

const SIDE: usize = TILE as usize;
/// Splats between two looks at whether the whole tile is finished.
const FINISHED_EVERY: usize = 64;
/// So many splats ahead the bounds are read: by then the cache has the rest of the splat, too.
const AHEAD: usize = 8;

/// [`super::draw_tile`] in vectors.
pub(super) struct DrawTile<'a, D> {
    pub(super) splats: &'a [Splat],
    pub(super) order: &'a [Pair],
    pub(super) area: [Range<u32>; 2],
    pub(super) pixels: &'a mut TilePixels,
    pub(super) depths: &'a mut D,
}

impl<D: Keep> Work for DrawTile<'_, D> {
    type Output = Counts;

    #[inline(always)]
    fn run<V: Lanes>(self, token: V::Token) -> Counts {
        let Self { splats, order, area: [columns, rows], pixels, depths } = self;
        let mut counts = Counts::default();
        let bounds_of = |pair: Option<&Pair>| {
            let splat = pair.and_then(|pair| splats.get(pair.splat as usize));
            splat.map_or([0; 4], |splat| splat.bounds)
        };
        let mut ahead: [[u16; 4]; AHEAD] = core::array::from_fn(|i| bounds_of(order.get(i)));
        for (i, pair) in order.iter().enumerate() {
            let [x0, y0, x1, y1] = ahead[i % AHEAD].map(u32::from);
            ahead[i % AHEAD] = bounds_of(order.get(i + AHEAD));
            let (x0, x1) = (x0.max(columns.start), x1.min(columns.end));
            let (y0, y1) = (y0.max(rows.start), y1.min(rows.end));
            if let Some(splat) = splats.get(pair.splat as usize)
                // A list may hold what misses the tile: it costs nothing.
                && x0 < x1
                && y0 < y1
            {
                let area = Area { columns: x0..x1, rows: y0..y1 };
                let origin = [columns.start, rows.start];
                strips::<V>(token, splat, area, origin, pixels, depths, &mut counts);
            }
            if i % FINISHED_EVERY == FINISHED_EVERY - 1 && pixels.finished() {
                break;
            }
        }
        counts
    }
}

/// Pixels of the frame that a splat may touch in a tile.
#[derive(Clone)]
struct Area {
    columns: Range<u32>,
    rows: Range<u32>,
}

/// Strip after strip, each as wide as a vector, the first from the splat's left edge on.
#[inline(always)]
fn strips<V: Lanes>(
    token: V::Token,
    splat: &Splat,
    area: Area,
    [left, top]: [u32; 2],
    pixels: &mut TilePixels,
    depths: &mut impl Keep,
    counts: &mut Counts,
) {
    let rows = RowTerms::new::<V>(token, splat, &area.rows);
    let within = (area.rows.start - top) as usize..(area.rows.end - top) as usize;
    let mut start = area.columns.start;
    while start < area.columns.end {
        let columns = start..area.columns.end.min(start + V::LEN as u32);
        start = columns.end;
        let pixels = pixels.0.get_mut(within.clone()).unwrap_or(&mut []);
        counts.evaluations += (V::LEN * pixels.len()) as u64;
        let origin = [left, within.start as u32];
        counts.blends += strip::<V>(token, splat, columns, origin, &rows, pixels, depths);
    }
}

/// What of a splat's exponent is the same along a row, for each row that it touches.
struct RowTerms {
    /// log₂ of the opacity less (c dy)².
    room: [f32; TILE as usize],
    /// b dy.
    shift: [f32; TILE as usize],
}

impl RowTerms {
    #[inline(always)]
    fn new<V: Lanes>(token: V::Token, splat: &Splat, rows: &Range<u32>) -> Self {
        let constant = |x: f32| V::splat(token, x);
        let [_, b, c] = splat.falloff;
        let mut terms = Self { room: [0.0; TILE as usize], shift: [0.0; TILE as usize] };
        let mut y = V::load(token, &LANES) + constant(rows.start as f32);
        let slots = terms.room.chunks_exact_mut(V::LEN).zip(terms.shift.chunks_exact_mut(V::LEN));
        for (room, shift) in slots.take(rows.len().div_ceil(V::LEN)) {
            let dy = y + constant(0.5) - constant(splat.mean[1]);
            let v = constant(c) * dy;
            (constant(splat.log2_opacity) - v * v).store(room);
            (constant(b) * dy).store(shift);
            y = y + constant(V::LEN as f32);
        }
        terms
    }
}

/// At most `V::LEN` columns of all rows; `left` is the tile's first column, `top` the first row's place
/// in the tile. Returns the blends.
#[inline(always)]
fn strip<V: Lanes>(
    token: V::Token,
    splat: &Splat,
    columns: Range<u32>,
    [left, top]: [u32; 2],
    rows: &RowTerms,
    pixels: &mut [TileRow],
    depths: &mut impl Keep,
) -> u64 {
    let constant = |x: f32| V::splat(token, x);
    // A strip ends inside the tile's row, if need be by starting further to the left.
    let first = (columns.start - left).min(TILE - V::LEN as u32);
    let x = V::load(token, &LANES) + constant((left + first) as f32);
    let inside = x.reaches(constant(columns.start as f32)) & x.below(constant(columns.end as f32));
    let a_dx = constant(splat.falloff[0]) * (x + constant(0.5) - constant(splat.mean[0]));
    // Nothing touches so far away.
    let a_dx = V::select(inside, a_dx, constant(f32::INFINITY));
    let color = each(splat.color, constant);
    let first = first as usize;
    let mut blends = 0;
    let rows = pixels.iter_mut().zip(&rows.room).zip(&rows.shift);
    for (((row, &room), &shift), y) in rows.zip(top as usize..) {
        let (alpha, touches) = alpha(exponent(constant(room), a_dx, constant(shift)));
        // Four stretches of LEN, 32 apart: one check for all of them.
        let Some(row) = row.as_flattened_mut().get_mut(first..first + 3 * SIDE + V::LEN) else {
            break;
        };
        let before = [
            V::load(token, &row[..V::LEN]),
            V::load(token, &row[SIDE..SIDE + V::LEN]),
            V::load(token, &row[2 * SIDE..2 * SIDE + V::LEN]),
            V::load(token, &row[3 * SIDE..3 * SIDE + V::LEN]),
        ];
        let blended = touches & before[3].reaches(constant(LEAST_TRANSMITTANCE));
        blends += V::bits(blended).count_ones();
        let weight = V::select(blended, before[3] * alpha, constant(0.0));
        let [r, g, b, t] = blend_weight(before, weight, color);
        r.store(&mut row[..V::LEN]);
        g.store(&mut row[SIDE..SIDE + V::LEN]);
        b.store(&mut row[2 * SIDE..2 * SIDE + V::LEN]);
        t.store(&mut row[3 * SIDE..3 * SIDE + V::LEN]);
        depths.blended(token, [first, y], [before[3], t], splat.depth);
    }
    u64::from(blends)
}

/// Columns of a strip from its first one on.
const LANES: [f32; MAX_LANES] =
    [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0];
