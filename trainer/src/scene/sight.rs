//! Which vertices a camera sees: each is tested where it is projected, not at the middle of a pixel,
//! so that no picture need be fine enough.

use dermis_runtime::Camera;
use glam::{DVec2, DVec3, Vec3};

use super::raster::{Facet, Setup};
use super::surface::Painter;

/// A surface hides a vertex if it is nearer by more than this share of the vertex's depth (2 mm at
/// 2 m): what touches a vertex, such as its copy on the other side of a seam, does not hide it.
const TOLERANCE: f64 = 1e-3;
/// What covers less of what is behind it hides nothing.
const LEAST_COVERAGE: f32 = 0.5;
/// The most sub-samples a side that [`Setup`] takes, as corners are rounded to a part of their distance.
const SAMPLES: u32 = 16;

/// The pixel (column, row) in which `camera` sees each vertex of the painter's model, that stand at
/// `posed` (world, metres); none where it does not see it.
///
/// A vertex is seen if it lies in the picture, is a corner of a triangle whose drawn side is in view,
/// and no other triangle's drawn side, of a coverage of at least 0.5 there, is nearer by more than
/// 0.1 % of its depth.
///
/// # Panics
/// If `posed` is not as long as the model's vertices.
pub fn vertices_in_sight(
    painter: &Painter<'_>,
    posed: &[Vec3],
    camera: &Camera,
) -> Vec<Option<[u32; 2]>> {
    let model = painter.model();
    assert_eq!(posed.len(), model.vertices.len(), "one position for each vertex");
    let mut setup = Setup::new(camera, SAMPLES);
    let view: Vec<DVec3> = posed.iter().map(|&position| setup.view_position(position)).collect();
    for (index, triangle) in (0..).zip(&model.triangles) {
        let double_sided = model.materials[triangle.material as usize].double_sided;
        setup.add(index, triangle.corners.map(|corner| view[corner as usize]), double_sided);
    }
    let corners = |facet: &Facet| model.triangles[facet.triangle as usize].corners;
    let mut places = vec![None; posed.len()];
    for corner in setup.facets.iter().flat_map(corners) {
        places[corner as usize] = setup.place(view[corner as usize]);
    }
    let cells = Cells::new(camera, &places);
    for facet in &setup.facets {
        let outline = corners(facet).map(|corner| view[corner as usize]);
        for vertex in cells.near(setup.pixels(outline)) {
            let Some(at) = places[vertex as usize] else { continue };
            let nearer = |depth: f64| depth < view[vertex as usize].z * (1.0 - TOLERANCE);
            if facet.covers(at)
                && nearer(facet.inverse_depth(at).recip())
                && !corners(facet).contains(&vertex)
                && is_solid(painter, facet, at)
            {
                places[vertex as usize] = None;
            }
        }
    }
    places.into_iter().map(|place| place.map(|at| at.as_uvec2().to_array())).collect()
}

/// Whether the facet's alpha hides what is behind it at pixel position `at`.
fn is_solid(painter: &Painter<'_>, facet: &Facet, at: DVec2) -> bool {
    let triangle = facet.triangle as usize;
    painter.is_opaque(triangle) || {
        let (weights, footprint) = facet.patch(painter.uvs(triangle), at, 1.0);
        painter.coverage(triangle, weights, &footprint) >= LEAST_COVERAGE
    }
}

/// Vertices by where they are in the picture, about one to a cell.
struct Cells {
    /// Pixels along a cell's side.
    size: f64,
    /// Cells in a row, and rows.
    sides: [usize; 2],
    /// Indices of the vertices in each cell, row-major.
    vertices: Vec<Vec<u32>>,
}

impl Cells {
    fn new(camera: &Camera, places: &[Option<DVec2>]) -> Self {
        let [width, height] = [camera.width, camera.height].map(f64::from);
        let size = (width * height / places.len().max(1) as f64).sqrt().max(1.0);
        let sides = [width, height].map(|pixels| (pixels / size).ceil() as usize);
        let mut cells = Self { size, sides, vertices: vec![Vec::new(); sides[0] * sides[1]] };
        for (vertex, place) in (0..).zip(places) {
            if let Some(at) = place {
                let [column, row] = cells.cell(*at);
                cells.vertices[row * sides[0] + column].push(vertex);
            }
        }
        cells
    }

    /// Column and row of the nearest cell.
    fn cell(&self, at: DVec2) -> [usize; 2] {
        // A cast of what is below 0 gives 0.
        let [column, row] = (at / self.size).to_array().map(|cell| cell as usize);
        [column.min(self.sides[0] - 1), row.min(self.sides[1] - 1)]
    }

    /// The vertices in all cells that a rectangle touches, given by its least and greatest corner.
    fn near(&self, [least, most]: [DVec2; 2]) -> impl Iterator<Item = u32> {
        let ([left, top], [right, bottom]) = (self.cell(least), self.cell(most));
        let row = move |row| &self.vertices[row * self.sides[0]..][left..=right];
        (top..=bottom).flat_map(row).flatten().copied()
    }
}
