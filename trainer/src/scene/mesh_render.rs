//! Ground truth: the textured mesh, unlit, supersampled.
//!
//! Visibility is decided first, for each sub-sample; then what is visible is shaded, once for each
//! triangle in each quarter of a pixel, with the texture averaged over that quarter. A picture
//! is made in bands of a few rows, whose sub-samples stay in cache.

use std::ops::{AddAssign, Range};

use dermis_runtime::Camera;
use glam::{DVec2, Vec3};
use rayon::prelude::*;

use super::raster::{Piece, Setup};
use super::surface::Painter;
use crate::model::AlphaMode;
use crate::picture::Picture;

/// Rows of pixels in a band.
const BAND_ROWS: u32 = 8;
/// Instead of an index: nothing is seen.
const NOTHING: u32 = u32::MAX;

/// What a camera truly sees.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// sRGB; sub-samples averaged as stored.
    pub picture: Picture,
    /// Share of each pixel's sub-samples that the mesh covers, in [0, 1], as the picture's pixels.
    pub coverage: Vec<f32>,
    /// Sub-samples in which each triangle is seen, as [`crate::model::Model::triangles`].
    pub seen: Vec<SideCount>,
}

/// Sub-samples in which a triangle is seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SideCount {
    /// Its front.
    pub front: u32,
    /// Its back; 0 unless its material is double-sided.
    pub back: u32,
}

impl AddAssign for SideCount {
    fn add_assign(&mut self, other: Self) {
        self.front = self.front.saturating_add(other.front);
        self.back = self.back.saturating_add(other.back);
    }
}

/// A posed mesh and a camera.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// World positions of the model's vertices, metres.
    pub posed: &'a [Vec3],
    /// Who looks.
    pub camera: Camera,
}

/// Renders `views` over all threads and hands each to `finish` (with its index) where it was
/// made, so that no more than one truth for each thread need be held. Results are in order and
/// do not depend on the number of threads.
///
/// # Panics
/// As [`render`].
pub fn render_views<R: Send>(
    painter: &Painter,
    views: &[View],
    background: [f32; 3],
    samples: u32,
    finish: impl Fn(usize, Truth) -> R + Sync,
) -> Vec<R> {
    views
        .par_iter()
        .enumerate()
        .map(|(i, view)| finish(i, render(painter, view.posed, &view.camera, background, samples)))
        .collect()
}

/// Renders the painter's model with its vertices at `posed` (world, metres), before `background`
/// (sRGB), with `samples × samples` sub-samples on a regular grid in each pixel.
///
/// Nothing nearer than 0.01 m is seen. A sub-sample on an edge belongs to exactly one of the
/// triangles that share it; corners are rounded to 1/256 of the distance between sub-samples.
/// Of surfaces at the same depth the earlier triangle is seen. Triangles without area and those
/// with a corner that is not finite are left out.
///
/// [`AlphaMode::Blend`] is a screen door: a sub-sample is covered where alpha exceeds a threshold
/// that depends on triangle, pixel and sub-sample alone. Each is covered with probability alpha, so
/// the expected colour is exact for any number of layers. In a pixel that one triangle fills, the
/// share covered differs from alpha by less than 1/samples².
///
/// # Panics
/// If `posed` is not as long as the model's vertices, or `samples` is not in 1..=16, or a side of
/// the picture is longer than 16384 pixels.
pub fn render(
    painter: &Painter,
    posed: &[Vec3],
    camera: &Camera,
    background: [f32; 3],
    samples: u32,
) -> Truth {
    let model = painter.model();
    assert_eq!(posed.len(), model.vertices.len(), "one position for each vertex");
    assert!((1..=16).contains(&samples), "1 to 16 sub-samples a side");
    assert!(camera.width.max(camera.height) <= 16384, "at most 16384 pixels a side");

    let mut setup = Setup::new(camera, samples);
    let view: Vec<_> = posed.iter().map(|&position| setup.view_position(position)).collect();
    for (i, triangle) in model.triangles.iter().enumerate() {
        let corners = triangle.corners.map(|corner| view[corner as usize]);
        let double_sided = model.materials[triangle.material as usize].double_sided;
        setup.add(i as u32, corners, double_sided);
    }

    let mut bands = vec![Vec::new(); camera.height.div_ceil(BAND_ROWS) as usize];
    let sub_rows = i64::from(BAND_ROWS * samples);
    for piece in &setup.pieces {
        for band in piece.rows.start / sub_rows..=(piece.rows.end - 1) / sub_rows {
            bands[band as usize].push(piece);
        }
    }

    let mut truth = Truth {
        picture: Picture::filled(camera.width, camera.height, background),
        coverage: vec![0.0; camera.width as usize * camera.height as usize],
        seen: vec![SideCount::default(); model.triangles.len()],
    };
    let mut band = Band {
        painter,
        setup: &setup,
        samples,
        stride: (camera.width * samples) as usize,
        first_row: 0,
        seen: Vec::new(),
        fragments: Vec::new(),
    };
    for (i, pieces) in bands.iter().enumerate().filter(|(_, pieces)| !pieces.is_empty()) {
        let first = i as u32 * BAND_ROWS;
        let columns = band.draw(pieces, first, (camera.height - first).min(BAND_ROWS));
        band.resolve(columns, background, &mut truth);
    }
    truth
}

/// A few rows of the picture while they are made.
struct Band<'a> {
    painter: &'a Painter<'a>,
    setup: &'a Setup,
    /// Sub-samples along a pixel's side.
    samples: u32,
    /// Sub-samples in a row.
    stride: usize,
    /// First row of pixels.
    first_row: u32,
    /// (1/depth, facet) of each sub-sample, row-major.
    seen: Vec<(f32, u32)>,
    /// Scratch of [`Self::resolve`].
    fragments: Vec<Fragment>,
}

/// What is seen of a facet in a part of a pixel.
struct Fragment {
    facet: u32,
    /// Sub-samples.
    count: u32,
    /// Sum of their positions, in sub-samples.
    sum: [u32; 2],
}

impl Band<'_> {
    /// Decides what is seen in `rows` rows of pixels from `first_row`, and says in which columns of
    /// pixels that may be anything.
    fn draw(&mut self, pieces: &[&Piece], first_row: u32, rows: u32) -> Range<u32> {
        self.first_row = first_row;
        self.seen.clear();
        self.seen.resize(self.stride * (rows * self.samples) as usize, (0.0, NOTHING));
        let first = i64::from(first_row * self.samples);
        let end = i64::from((first_row + rows) * self.samples);
        let (mut left, mut right) = (i64::MAX, 0);
        for piece in pieces {
            let columns = piece.columns();
            let facet = &self.setup.facets[piece.facet as usize];
            let opaque = self.painter.is_opaque(facet.triangle as usize);
            (left, right) = (left.min(columns.start), right.max(columns.end));
            for row in piece.rows.start.max(first)..piece.rows.end.min(end) {
                let span = piece.span(row);
                if !span.is_empty() {
                    self.draw_span(piece.facet, opaque, row - first, span);
                }
            }
        }
        let samples = i64::from(self.samples);
        (left / samples) as u32..((right + samples - 1) / samples) as u32
    }

    /// Tests a run of covered sub-samples; `row` is counted from the band's first.
    fn draw_span(&mut self, index: u32, opaque: bool, row: i64, span: Range<i64>) {
        let facet = &self.setup.facets[index as usize];
        let at = |column: usize| self.position(column, row as usize);
        let (start, end) = (span.start as usize, span.end as usize);
        let first = facet.inverse_depth(at(start)) as f32;
        // The ends are kept within the triangle's depths, and so is what lies between.
        let last = facet.inverse_depth(at(end - 1)) as f32;
        let step = (last - first) / (end - 1 - start).max(1) as f32;
        let base = row as usize * self.stride;
        for (i, column) in (start..end).enumerate() {
            let depth = first + i as f32 * step;
            if depth > self.seen[base + column].0
                && (opaque || self.covers(index, column, row as usize))
            {
                self.seen[base + column] = (depth, index);
            }
        }
    }

    /// Pixel position of a sub-sample of this band.
    fn position(&self, column: usize, row: usize) -> DVec2 {
        let row = row + (self.first_row * self.samples) as usize;
        (DVec2::new(column as f64, row as f64) + 0.5) / f64::from(self.samples)
    }

    /// Whether the facet's alpha lets it be seen in a sub-sample.
    fn covers(&self, index: u32, column: usize, row: usize) -> bool {
        let facet = &self.setup.facets[index as usize];
        let triangle = facet.triangle as usize;
        let at = self.position(column, row);
        let side = f64::from(self.samples).recip();
        let (weights, footprint) = facet.patch(self.painter.uvs(triangle), at, side);
        let coverage = self.painter.coverage(triangle, weights, &footprint);
        let model = self.painter.model();
        let material = model.triangles[triangle].material as usize;
        match model.materials[material].alpha {
            AlphaMode::Blend => coverage > self.threshold(facet.triangle, at, column, row),
            AlphaMode::Opaque | AlphaMode::Mask(_) => coverage > 0.0,
        }
    }

    /// Uniform in [0, 1), one of each sixteenth (for 16 sub-samples) in a pixel.
    fn threshold(&self, triangle: u32, at: DVec2, column: usize, row: usize) -> f32 {
        let samples = self.samples as usize;
        let (x, y) = (column % samples, row % samples);
        // Neighbours in a row and in a column differ by a whole step of 1/samples.
        let rank = ((x + y) % samples * samples + x) as u32;
        let pixel = (at.y as u32) << 16 | at.x as u32;
        let hash = hashed(hashed(triangle) ^ pixel);
        let count = self.samples * self.samples;
        let turned = (rank + hash % count) % count;
        let jitter = (hashed(hash ^ rank) >> 16) as f32 / 65536.0;
        (turned as f32 + jitter) / count as f32
    }

    /// Shades what is seen in `columns` of pixels.
    fn resolve(&mut self, columns: Range<u32>, background: [f32; 3], truth: &mut Truth) {
        let rows = self.seen.len() / self.stride / self.samples as usize;
        let width = truth.picture.width as usize;
        let count = (self.samples * self.samples) as f32;
        for row in 0..rows as u32 {
            for column in columns.clone() {
                let (color, covered) = self.pixel(column, row, &mut truth.seen);
                if covered == 0 {
                    continue;
                }
                let pixel = (self.first_row + row) as usize * width + column as usize;
                let rest = count - covered as f32;
                truth.coverage[pixel] = covered as f32 / count;
                truth.picture.rgb[pixel] =
                    std::array::from_fn(|i| (color[i] + rest * background[i]) / count);
            }
        }
    }

    /// Sum of the colours of a pixel's covered sub-samples, and their number.
    fn pixel(&mut self, column: u32, row: u32, seen: &mut [SideCount]) -> (Vec3, u32) {
        // Quarters follow the outline of a triangle and the shape of its texture better than
        // whole pixels, at a fraction of the cost of every sub-sample.
        let parts = if self.samples.is_multiple_of(2) { 2 } else { 1 };
        let side = self.samples / parts;
        let share = 1.0 / f64::from(parts);
        let (mut color, mut covered) = (Vec3::ZERO, 0);
        for part in 0..parts * parts {
            let left = column * self.samples + part % parts * side;
            let top = row * self.samples + part / parts * side;
            self.gather(left, top, side);
            for fragment in &self.fragments {
                let facet = &self.setup.facets[fragment.facet as usize];
                let triangle = facet.triangle as usize;
                let [x, y] = fragment.sum.map(|sum| f64::from(sum) / f64::from(fragment.count));
                let at = DVec2::new(x + 0.5, y + 0.5) / f64::from(self.samples)
                    + DVec2::new(0.0, f64::from(self.first_row));
                let (weights, footprint) = facet.patch(self.painter.uvs(triangle), at, share);
                let (shade, _) = self.painter.surface_color(triangle, weights, &footprint);
                color += fragment.count as f32 * Vec3::from_array(shade);
                covered += fragment.count;
                let sides = if facet.back {
                    SideCount { front: 0, back: fragment.count }
                } else {
                    SideCount { front: fragment.count, back: 0 }
                };
                seen[triangle] += sides;
            }
        }
        (color, covered)
    }

    /// Collects the fragments of a square of sub-samples.
    fn gather(&mut self, left: u32, top: u32, side: u32) {
        self.fragments.clear();
        for y in top..top + side {
            for x in left..left + side {
                let (_, facet) = self.seen[y as usize * self.stride + x as usize];
                if facet == NOTHING {
                    continue;
                }
                let known = self.fragments.iter().position(|known| known.facet == facet);
                let known = known.unwrap_or_else(|| {
                    self.fragments.push(Fragment { facet, count: 0, sum: [0; 2] });
                    self.fragments.len() - 1
                });
                let fragment = &mut self.fragments[known];
                fragment.count += 1;
                fragment.sum[0] += x;
                fragment.sum[1] += y;
            }
        }
    }
}

/// A bijection that scatters its bits (the finalizer of MurmurHash3).
fn hashed(mut value: u32) -> u32 {
    value = (value ^ value >> 16).wrapping_mul(0x85eb_ca6b);
    value = (value ^ value >> 13).wrapping_mul(0xc2b2_ae35);
    value ^ value >> 16
}
