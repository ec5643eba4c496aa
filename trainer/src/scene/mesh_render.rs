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
        rows: 0..0,
        columns: 0..0,
        seen: Vec::new(),
        fragments: Vec::new(),
    };
    for (i, pieces) in bands.iter().enumerate().filter(|(_, pieces)| !pieces.is_empty()) {
        let first = i as u32 * BAND_ROWS;
        band.draw(pieces, first..camera.height.min(first + BAND_ROWS));
        band.resolve(background, &mut truth);
    }
    truth
}

/// A few rows of the picture while they are made. Sub-samples are counted from its upper left.
struct Band<'a> {
    painter: &'a Painter<'a>,
    setup: &'a Setup,
    /// Sub-samples along a pixel's side.
    samples: u32,
    /// Rows of pixels.
    rows: Range<u32>,
    /// Columns of pixels in which anything may be seen.
    columns: Range<u32>,
    /// (1/depth, facet) of each sub-sample, row-major.
    seen: Vec<(f32, u32)>,
    /// Scratch of [`Self::pixel`].
    fragments: Vec<Fragment>,
}

/// What is seen of a facet in a part of a pixel.
struct Fragment {
    facet: u32,
    /// Sub-samples.
    count: u32,
    /// Sum of their (column, row) from the part's upper left.
    sum: [u32; 2],
}

impl Band<'_> {
    /// Decides what is seen of `pieces` in these rows of pixels.
    fn draw(&mut self, pieces: &[&Piece], rows: Range<u32>) {
        let samples = i64::from(self.samples);
        let left = pieces.iter().map(|piece| piece.columns().start).min().unwrap_or(0) / samples;
        let right = pieces.iter().map(|piece| piece.columns().end).max().unwrap_or(0);
        self.columns = left as u32..((right + samples - 1) / samples) as u32;
        self.rows = rows;
        let pixels = self.columns.len() * self.rows.len();
        self.seen.clear();
        self.seen.resize(pixels * (samples * samples) as usize, (0.0, NOTHING));

        let [left, top] = [&self.columns, &self.rows].map(|range| i64::from(range.start) * samples);
        let bottom = i64::from(self.rows.end) * samples;
        for piece in pieces {
            let facet = &self.setup.facets[piece.facet as usize];
            let opaque = self.painter.is_opaque(facet.triangle as usize);
            for row in piece.rows.start.max(top)..piece.rows.end.min(bottom) {
                let span = piece.span(row);
                if !span.is_empty() {
                    let span = (span.start - left) as u32..(span.end - left) as u32;
                    self.draw_span(piece.facet, opaque, (row - top) as u32, span);
                }
            }
        }
    }

    /// Tests a run of covered sub-samples.
    fn draw_span(&mut self, index: u32, opaque: bool, row: u32, span: Range<u32>) {
        let facet = &self.setup.facets[index as usize];
        let depth = |column: u32| {
            facet.inverse_depth(self.position(f64::from(column), f64::from(row))) as f32
        };
        // The ends are kept within the triangle's depths, and so is what lies between.
        let (first, last) = (depth(span.start), depth(span.end - 1));
        let step = (last - first) / (span.len() - 1).max(1) as f32;
        let base = self.index(span.start, row);
        for (i, column) in span.enumerate() {
            let depth = first + i as f32 * step;
            if depth > self.seen[base + i].0 && (opaque || self.covers(index, column, row)) {
                self.seen[base + i] = (depth, index);
            }
        }
    }

    /// Where a sub-sample stands in [`Self::seen`].
    fn index(&self, column: u32, row: u32) -> usize {
        row as usize * self.columns.len() * self.samples as usize + column as usize
    }

    /// Pixel position of a sub-sample.
    fn position(&self, column: f64, row: f64) -> DVec2 {
        let origin = DVec2::new(f64::from(self.columns.start), f64::from(self.rows.start));
        origin + (DVec2::new(column, row) + 0.5) / f64::from(self.samples)
    }

    /// Whether the facet's alpha lets it be seen in a sub-sample.
    fn covers(&self, index: u32, column: u32, row: u32) -> bool {
        let facet = &self.setup.facets[index as usize];
        let triangle = facet.triangle as usize;
        let at = self.position(f64::from(column), f64::from(row));
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
    fn threshold(&self, triangle: u32, at: DVec2, column: u32, row: u32) -> f32 {
        let samples = self.samples;
        let (x, y) = (column % samples, row % samples);
        // Neighbours in a row and in a column differ by a whole step of 1/samples.
        let rank = (x + y) % samples * samples + x;
        let pixel = (at.y as u32) << 16 | at.x as u32;
        let hash = hashed(hashed(triangle) ^ pixel);
        let count = samples * samples;
        let turned = (rank + hash % count) % count;
        let jitter = (hashed(hash ^ rank) >> 16) as f32 / 65536.0;
        (turned as f32 + jitter) / count as f32
    }

    /// Shades what is seen.
    fn resolve(&mut self, background: [f32; 3], truth: &mut Truth) {
        let width = truth.picture.width as usize;
        let count = (self.samples * self.samples) as f32;
        for row in 0..self.rows.len() as u32 {
            for column in 0..self.columns.len() as u32 {
                let (color, covered) = self.pixel(column, row, &mut truth.seen);
                if covered == 0 {
                    continue;
                }
                let pixel = (self.rows.start + row) as usize * width
                    + (self.columns.start + column) as usize;
                let rest = count - covered as f32;
                truth.coverage[pixel] = covered as f32 / count;
                truth.picture.rgb[pixel] =
                    std::array::from_fn(|i| (color[i] + rest * background[i]) / count);
            }
        }
    }

    /// Sum of the colours of a pixel's covered sub-samples, and their number. The pixel is counted
    /// from the band's upper left.
    fn pixel(&mut self, column: u32, row: u32, seen: &mut [SideCount]) -> (Vec3, u32) {
        // Quarters of a pixel follow a triangle's outline and its texture better than whole ones:
        // on a tilted checkerboard the mean error is 0.0012 instead of 0.0030, the greatest 0.07
        // instead of 0.15, for 1.7 times the time.
        let parts = if self.samples.is_multiple_of(2) { 2 } else { 1 };
        let side = self.samples / parts;
        let share = 1.0 / f64::from(parts);
        let (mut color, mut covered) = (Vec3::ZERO, 0);
        for part in 0..parts * parts {
            let left = column * self.samples + part % parts * side;
            let top = row * self.samples + part / parts * side;
            self.gather(left, top, side);
            for &Fragment { facet, count, sum } in &self.fragments {
                let facet = &self.setup.facets[facet as usize];
                let triangle = facet.triangle as usize;
                let [x, y] = sum.map(|sum| f64::from(sum) / f64::from(count));
                let at = self.position(f64::from(left) + x, f64::from(top) + y);
                let (weights, footprint) = facet.patch(self.painter.uvs(triangle), at, share);
                let (shade, _) = self.painter.surface_color(triangle, weights, &footprint);
                color += count as f32 * Vec3::from_array(shade);
                covered += count;
                let sides = &mut seen[triangle];
                *(if facet.back { &mut sides.back } else { &mut sides.front }) += count;
            }
        }
        (color, covered)
    }

    /// Collects the fragments of a square of sub-samples.
    fn gather(&mut self, left: u32, top: u32, side: u32) {
        self.fragments.clear();
        for y in 0..side {
            let start = self.index(left, top + y);
            for (x, &(_, facet)) in (0..side).zip(&self.seen[start..]) {
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
