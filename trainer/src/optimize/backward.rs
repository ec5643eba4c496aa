//! From the gradient by pixels to the gradient by splats.
//!
//! Each tile walks its list front to back once more, keeping per pixel the transmittance T and what
//! the picture's gradient g makes of all that lies behind, ρ = g · (picture − C), background included. With
//! the splat's αᵢ, cᵢ and the weight w = T αᵢ
//!
//! ```text
//! ρ ← ρ − w g · cᵢ        ∂/∂cᵢ = w g        αᵢ ∂/∂αᵢ = w g · cᵢ − ρ αᵢ / (1 − αᵢ) = e
//! ```
//!
//! What a splat's place and shape get of e follows from its moments Σ e, Σ e dx, … over the pixels, at
//! distance (dx, dy) from the splat's centre. A (tile, splat) pair has moments of its own; they are
//! summed afterwards in the order of tiles, so the bits depend neither on threads nor on the kernel.

use core::ops::Range;

use dermis_runtime::Kernel;
use dermis_runtime::kernel::Work;
use dermis_runtime::lanes::{Lanes, Row};
use dermis_runtime::lists::Pair;
use dermis_runtime::math::each;
use dermis_runtime::project::Splat;
use dermis_runtime::raster::{GREATEST_ALPHA, LEAST_TRANSMITTANCE, alpha, exponent};
use dermis_runtime::tiles::{TILE, TileGrid};
use rayon::prelude::*;

use super::forward::Forward;

const SIDE: usize = TILE as usize;
/// Lanes of [`Kernel::run_by_eights`].
const LANES: usize = 8;
/// Splats between two looks at whether the whole tile is finished.
const FINISHED_EVERY: usize = 64;

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

/// Sums over a splat's pixels: e, e dx, e dx², e dy; e dx dy, e dy², w g of red and green; of blue.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Moments([Row; 3]);

impl Moments {
    fn add(&mut self, other: &Self) {
        for (row, other) in self.0.iter_mut().zip(&other.0) {
            row.iter_mut().zip(other).for_each(|(sum, x)| *sum += x);
        }
    }

    /// exponent = log₂ o − u² − v² with u = a dx + b dy, v = c dy, and α = 2^exponent.
    fn gradient(&self, splat: &Splat) -> SplatGradient {
        let [[e, e_x, e_xx, e_y], [e_xy, e_yy, red, green], [blue, ..]] = self.0;
        let [a, b, c] = splat.falloff;
        let ln2 = core::f32::consts::LN_2;
        let by_u = a * e_x + b * e_y;
        SplatGradient {
            mean: [2.0 * ln2 * (a * by_u), 2.0 * ln2 * (b * by_u + c * c * e_y)],
            falloff: [
                -2.0 * ln2 * (a * e_xx + b * e_xy),
                -2.0 * ln2 * (a * e_xy + b * e_yy),
                -2.0 * ln2 * (c * e_yy),
            ],
            log2_opacity: ln2 * e,
            color: [red, green, blue],
        }
    }
}

/// Gradient by each splat of `forward`, given the gradient by each pixel of its picture.
pub fn by_splats(forward: &Forward, by_pixels: &[[f32; 3]]) -> Vec<SplatGradient> {
    let kernel = Kernel::detect();
    let grid = TileGrid::new(forward.picture.width, forward.picture.height);
    let tiles: Vec<(u32, &[Pair])> = forward.lists().collect();
    let moments: Vec<Vec<Moments>> = tiles
        .par_iter()
        .with_max_len(1)
        .map(|&(tile, order)| {
            let area = grid.pixels(tile);
            let mut pixels = Box::new(Pixels::new(forward, by_pixels, &area));
            let mut moments = vec![Moments::default(); order.len()];
            let (splats, pixels) = (&forward.splats, &mut *pixels);
            kernel.run_by_eights(Walk { splats, order, area, pixels, moments: &mut moments });
            moments
        })
        .collect();
    let mut sums = vec![Moments::default(); forward.splats.len()];
    for ((_, order), moments) in tiles.iter().zip(&moments) {
        for (pair, moments) in order.iter().zip(moments) {
            sums[pair.splat as usize].add(moments);
        }
    }
    sums.iter().zip(&forward.splats).map(|(moments, splat)| moments.gradient(splat)).collect()
}

/// Pixels of a tile, row by row, a plane for each number: T and ρ, which change on the way, and g.
struct Pixels([[[f32; SIDE]; 5]; SIDE]);

impl Pixels {
    fn new(forward: &Forward, by_pixels: &[[f32; 3]], [columns, rows]: &[Range<u32>; 2]) -> Self {
        let mut pixels = Self([[[0.0; SIDE]; 5]; SIDE]);
        for ([t, rest, red, green, blue], y) in pixels.0.iter_mut().zip(rows.clone()) {
            let start = (y * forward.picture.width + columns.start) as usize;
            let row = start..start + columns.len();
            let frame = forward.picture.rgb[row.clone()].iter().zip(&by_pixels[row]);
            for (column, (picture, g)) in frame.enumerate() {
                t[column] = 1.0;
                rest[column] = g[0] * picture[0] + g[1] * picture[1] + g[2] * picture[2];
                [red[column], green[column], blue[column]] = *g;
            }
        }
        pixels
    }

    fn finished(&self) -> bool {
        self.0.iter().all(|[t, ..]| t.iter().all(|&t| t < LEAST_TRANSMITTANCE))
    }
}

/// One tile's way back.
struct Walk<'a> {
    splats: &'a [Splat],
    order: &'a [Pair],
    area: [Range<u32>; 2],
    pixels: &'a mut Pixels,
    moments: &'a mut [Moments],
}

impl Work for Walk<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self, token: V::Token) {
        let Self { splats, order, area: [columns, rows], pixels, moments } = self;
        for (i, (pair, moments)) in order.iter().zip(moments).enumerate() {
            let splat = &splats[pair.splat as usize];
            let [x0, y0, x1, y1] = splat.bounds.map(u32::from);
            let (x0, x1) = (x0.max(columns.start), x1.min(columns.end));
            let (y0, y1) = (y0.max(rows.start), y1.min(rows.end));
            if x0 < x1 && y0 < y1 {
                let mut sums = [V::splat(token, 0.0); 12];
                let mut start = x0;
                while start < x1 {
                    let end = x1.min(start + V::LEN as u32);
                    let origin = [columns.start, rows.start];
                    strip(token, splat, start..end, y0..y1, origin, pixels, &mut sums);
                    start = end;
                }
                *moments = Moments(totals(sums));
            }
            if i % FINISHED_EVERY == FINISHED_EVERY - 1 && pixels.finished() {
                break;
            }
        }
    }
}

/// Adds to `sums` what at most `V::LEN` columns of a splat give; `left` and `top` are the tile's first pixel.
#[inline(always)]
fn strip<V: Lanes>(
    token: V::Token,
    splat: &Splat,
    columns: Range<u32>,
    rows: Range<u32>,
    [left, top]: [u32; 2],
    pixels: &mut Pixels,
    sums: &mut [V; 12],
) {
    let constant = |x: f32| V::splat(token, x);
    let (zero, one) = (constant(0.0), constant(1.0));
    // A strip ends inside the tile's row, if need be by starting further to the left.
    let first = (columns.start - left).min(TILE - V::LEN as u32);
    let x = V::load(token, &FROM_FIRST) + constant((left + first) as f32);
    let inside = x.reaches(constant(columns.start as f32)) & x.below(constant(columns.end as f32));
    let dx = x + constant(0.5) - constant(splat.mean[0]);
    let [a, b, c] = splat.falloff;
    // Nothing touches so far away.
    let a_dx = V::select(inside, constant(a) * dx, constant(f32::INFINITY));
    let [red, green, blue] = each(splat.color, constant);
    let at = first as usize..first as usize + V::LEN;
    let [e, e_x, e_xx, e_y, e_xy, e_yy, by_red, by_green, by_blue, ..] = sums;
    for y in rows {
        let dy = y as f32 + 0.5 - splat.mean[1];
        let v = c * dy;
        let room = constant(splat.log2_opacity - v * v);
        let (alpha, touches) = alpha(exponent(room, a_dx, constant(b * dy)));
        let [t, rest, g_red, g_green, g_blue] = &mut pixels.0[(y - top) as usize % SIDE];
        let (t, rest) = (&mut t[at.clone()], &mut rest[at.clone()]);
        let before = V::load(token, t);
        let blended = touches & before.reaches(constant(LEAST_TRANSMITTANCE));
        if V::bits(blended) == 0 {
            continue;
        }
        let g_red = V::load(token, &g_red[at.clone()]);
        let g_green = V::load(token, &g_green[at.clone()]);
        let g_blue = V::load(token, &g_blue[at.clone()]);
        let alpha = V::select(blended, alpha, zero);
        let weight = before * alpha;
        let share = weight * (g_red * red + g_green * green + g_blue * blue);
        let behind = V::load(token, rest) - share;
        (before - weight).store(t);
        behind.store(rest);
        *by_red = *by_red + weight * g_red;
        *by_green = *by_green + weight * g_green;
        *by_blue = *by_blue + weight * g_blue;
        // Where alpha is clamped it does not depend on the splat's shape.
        let moves = alpha.below(constant(GREATEST_ALPHA));
        let by = V::select(moves, share - behind * (alpha / (one - alpha)), zero);
        let (by_x, dy) = (by * dx, constant(dy));
        let by_y = by * dy;
        *e = *e + by;
        *e_x = *e_x + by_x;
        *e_xx = *e_xx + by_x * dx;
        *e_y = *e_y + by_y;
        *e_xy = *e_xy + by_x * dy;
        *e_yy = *e_yy + by_y * dy;
    }
}

/// The sum over the lanes of each of twelve vectors.
#[inline(always)]
fn totals<V: Lanes>(sums: [V; 12]) -> [Row; 3] {
    let mut totals = [[0.0; 4]; 3];
    for (total, columns) in totals.iter_mut().zip(sums.as_chunks::<4>().0) {
        let mut rows = [[0.0; 4]; LANES];
        V::store_rows(*columns, &mut rows);
        for row in rows {
            total.iter_mut().zip(row).for_each(|(sum, x)| *sum += x);
        }
    }
    totals
}

/// Columns of a strip from its first one on.
const FROM_FIRST: [f32; LANES] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimize::schedule::Random;

    #[test]
    fn moments_have_the_same_bits_by_every_kernel() {
        let mut random = Random::new(5);
        let mut between = |low: f32, high: f32| low + (high - low) * random.unit();
        let splats: Vec<Splat> = (0..200)
            .map(|_| {
                let mean = [between(-3.0, 35.0), between(-3.0, 35.0)];
                let edge = |x: f32, by: f32| (x + by).clamp(0.0, 32.0) as u16;
                let falloff = [between(0.05, 0.8), between(-0.3, 0.3), between(0.05, 0.8)];
                let bounds = [
                    edge(mean[0], -12.0),
                    edge(mean[1], -12.0),
                    edge(mean[0], 12.0),
                    edge(mean[1], 12.0),
                ];
                let color = [between(0.0, 1.0), between(0.0, 1.0), between(0.0, 1.0)];
                let log2_opacity = between(-4.0, -0.02);
                Splat { mean, falloff, log2_opacity, color, depth: 1.0, bounds }
            })
            .collect();
        let order: Vec<Pair> = (0..200).map(|splat| Pair { depth: splat, splat }).collect();
        let rows: Vec<f32> = (0..5 * SIDE * SIDE).map(|_| between(-1.0, 1.0)).collect();
        let by = |kernel: Kernel| {
            let mut pixels = Box::new(Pixels([[[0.0; SIDE]; 5]; SIDE]));
            pixels.0.as_flattened_mut().as_flattened_mut().copy_from_slice(&rows);
            pixels.0.iter_mut().for_each(|[t, ..]| t.fill(1.0));
            let mut moments = vec![Moments::default(); order.len()];
            kernel.run_by_eights(Walk {
                splats: &splats,
                order: &order,
                area: [0..TILE, 0..TILE],
                pixels: &mut pixels,
                moments: &mut moments,
            });
            moments.iter().flat_map(|m| m.0.map(|row| row.map(f32::to_bits))).collect::<Vec<_>>()
        };
        let expected = by(Kernel::Scalar);
        assert!(expected.iter().filter(|row| row[0] != 0).count() > 300, "most splats touch");
        for kernel in Kernel::available() {
            assert!(by(kernel) == expected, "{}", kernel.name());
        }
    }
}
