//! Which sub-samples a triangle covers: exact, in whole numbers, so that triangles that share an
//! edge neither overlap nor leave a gap.

use std::ops::Range;

use dermis_runtime::Camera;
use glam::{DVec2, DVec3, Vec2, Vec3};

use super::texture::Footprint;

/// Nothing nearer than this is seen, metres (as the runtime).
const NEAR: f64 = dermis_runtime::project::NEAR as f64;
/// Corners are rounded to this part of the distance between sub-samples.
const SUBSTEPS: f64 = 256.0;
/// Triangles are cut this far outside the picture, pixels. With pictures up to 16384 pixels and
/// 16 sub-samples a side, rounded corners stay within 2²⁷ and edge functions within 2⁵⁸.
const GUARD: f64 = 16384.0;

/// A triangle in view: where it is, and how it is seen.
pub(super) struct Facet {
    /// Index into [`crate::model::Model::triangles`].
    pub(super) triangle: u32,
    /// Whether its back is towards the camera.
    pub(super) back: bool,
    /// Row i · (x, y, 1) is the weight of corner i divided by depth, 1/m, at pixel position (x, y).
    planes: [DVec3; 3],
    /// Their sum: 1/depth.
    inverse_depth: DVec3,
    /// Least and greatest 1/depth over what is in view.
    range: [f64; 2],
}

impl Facet {
    /// 1/depth at pixel position `at`. Kept between the corners' values: rounding of the corners
    /// may put a sub-sample just outside the true triangle, where a steep plane runs away.
    pub(super) fn inverse_depth(&self, at: DVec2) -> f64 {
        self.inverse_depth.dot(at.extend(1.0)).clamp(self.range[0], self.range[1])
    }

    /// Whether it is seen at pixel position `at` where nothing is before it. Edges belong to it, and a
    /// little more, so that nothing shows between two triangles that share one.
    pub(super) fn covers(&self, at: DVec2) -> bool {
        let ray = at.extend(1.0);
        let inverse_depth = self.inverse_depth.dot(ray);
        // In units of the triangle: far below a vertex's own rounding.
        let least = -1e-9 * inverse_depth;
        inverse_depth * NEAR <= 1.0 && self.planes.iter().all(|plane| plane.dot(ray) >= least)
    }

    /// What a square of `side` pixels around pixel position `at` shows: the weights of the corners
    /// in its middle (at least 0, adding up to 1), and its extent in the texture.
    pub(super) fn patch(&self, uvs: [Vec2; 3], at: DVec2, side: f64) -> (Vec3, Footprint) {
        let ray = at.extend(1.0);
        let weights = DVec3::from_array(self.planes.map(|plane| plane.dot(ray))).max(DVec3::ZERO);
        let sum = weights.element_sum();
        let weights = if sum > 0.0 { weights / sum } else { DVec3::splat(1.0 / 3.0) };
        // uv = Σ uvᵢ · planeᵢ / Σ planeᵢ, differentiated along x and along y.
        let scale = side / self.inverse_depth(at);
        let (mut along, mut across) = (DVec2::ZERO, DVec2::ZERO);
        for i in 0..3 {
            let slope = scale * (self.planes[i] - weights[i] * self.inverse_depth);
            along += slope.x * uvs[i].as_dvec2();
            across += slope.y * uvs[i].as_dvec2();
        }
        let footprint = Footprint { along: along.as_vec2(), across: across.as_vec2() };
        (weights.as_vec3(), footprint)
    }
}

/// A triangle of the picture: a facet, or a part of one that was cut at the near plane.
pub(super) struct Piece {
    /// Index of its facet.
    pub(super) facet: u32,
    /// Columns of sub-samples that it may cover.
    columns: Range<i64>,
    /// Rows of sub-samples that it may cover.
    pub(super) rows: Range<i64>,
    edges: [Edge; 3],
}

/// Sub-sample (column, row) is inside where `column · by_column + row · by_row + constant ≥ 0`.
struct Edge {
    by_column: i64,
    by_row: i64,
    constant: i64,
}

impl Edge {
    /// The edge from `a` to `b` (rounded positions), with the inside on its right as seen in the
    /// picture. Points on it belong to it if it is a top or a left edge.
    fn new(a: [i64; 2], b: [i64; 2]) -> Self {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let owns_its_points = dy < 0 || dy == 0 && dx > 0;
        let (step, half) = (SUBSTEPS as i64, SUBSTEPS as i64 / 2);
        Self {
            by_column: -dy * step,
            by_row: dx * step,
            constant: dx * (half - a[1]) - dy * (half - a[0]) - i64::from(!owns_its_points),
        }
    }
}

impl Piece {
    /// The columns of sub-samples that are covered in `row`.
    pub(super) fn span(&self, row: i64) -> Range<i64> {
        let Range { mut start, mut end } = self.columns;
        for edge in &self.edges {
            let value = edge.by_row * row + edge.constant;
            match edge.by_column {
                0 if value < 0 => return 0..0,
                0 => {}
                // column ≥ −value / by_column, rounded up
                slope @ 1.. => start = start.max(-value.div_euclid(slope)),
                // column ≤ value / −by_column, rounded down
                slope => end = end.min(value.div_euclid(-slope) + 1),
            }
        }
        start..end
    }

    fn new(corners: [[i64; 2]; 3], size: [i64; 2], facet: u32) -> Option<Self> {
        let [a, b, c] = corners;
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        let [a, b, c] = match area {
            0 => return None,
            1.. => [a, b, c],
            _ => [a, c, b],
        };
        // A sub-sample stands in the middle of its cell.
        let range = |axis: usize| {
            let (step, half) = (SUBSTEPS as i64, SUBSTEPS as i64 / 2);
            let least = a[axis].min(b[axis]).min(c[axis]);
            let most = a[axis].max(b[axis]).max(c[axis]);
            let first = (least - half).div_euclid(step).max(0);
            let last = (most - half).div_euclid(step).min(size[axis] - 1);
            first..last + 1
        };
        let (columns, rows) = (range(0), range(1));
        if columns.is_empty() || rows.is_empty() {
            return None;
        }
        let edges = [Edge::new(a, b), Edge::new(b, c), Edge::new(c, a)];
        Some(Self { facet, columns, rows, edges })
    }

    /// Columns of sub-samples that may be covered.
    pub(super) fn columns(&self) -> Range<i64> {
        self.columns.clone()
    }
}

/// The triangles in view of a camera.
pub(super) struct Setup {
    samples: u32,
    camera: Camera,
    pub(super) facets: Vec<Facet>,
    /// In the order of their facets.
    pub(super) pieces: Vec<Piece>,
}

impl Setup {
    /// Nothing in view of `camera`, with `samples × samples` sub-samples in a pixel.
    pub(super) fn new(camera: &Camera, samples: u32) -> Self {
        Self { samples, camera: *camera, facets: Vec::new(), pieces: Vec::new() }
    }

    /// World position (metres) to camera axes.
    pub(super) fn view_position(&self, world: Vec3) -> DVec3 {
        let [x, y, z] = self.camera.world_to_camera.map(|row| {
            let [x, y, z, w] = row.map(f64::from);
            DVec3::new(x, y, z).dot(world.as_dvec3()) + w
        });
        DVec3::new(x, y, z)
    }

    /// Pixel position of a point in camera axes, if it is in front of the near plane and in the picture.
    pub(super) fn place(&self, view: DVec3) -> Option<DVec2> {
        let size = DVec2::new(f64::from(self.camera.width), f64::from(self.camera.height));
        let at = self.pixel(view);
        let inside = at.cmpge(DVec2::ZERO).all() && at.cmplt(size).all();
        (view.z >= NEAR && inside).then_some(at)
    }

    /// Least and greatest pixel position of the part of a triangle (its corners in camera axes) that
    /// is in front of the near plane and not far outside the picture.
    pub(super) fn pixels(&self, corners: [DVec3; 3]) -> [DVec2; 2] {
        let outline = self.clipped(corners).into_iter().map(|corner| self.pixel(corner));
        outline.fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[least, most], at| {
            [least.min(at), most.max(at)]
        })
    }

    /// Adds a triangle by its corners in camera axes. Triangles out of view, without area or not
    /// finite are left out, and so are backs unless `double_sided`.
    pub(super) fn add(&mut self, triangle: u32, corners: [DVec3; 3], double_sided: bool) {
        let [a, b, c] = corners;
        if corners.iter().all(|corner| corner.z < NEAR) || !(a + b + c).is_finite() {
            return;
        }
        // Six times the volume below the triangle, seen from the camera; its sign is the side.
        let volume = a.dot(b.cross(c));
        if volume == 0.0 || !volume.is_finite() || (volume > 0.0 && !double_sided) {
            return;
        }
        let camera = &self.camera;
        // Σ weightᵢ · cornerᵢ = depth · ray, solved for weightᵢ / depth with
        // ray = ((x − cx)/fx, (y − cy)/fy, 1).
        let planes = [b.cross(c), c.cross(a), a.cross(b)].map(|row| {
            let row = row / volume;
            let (x, y) = (row.x / f64::from(camera.fx), row.y / f64::from(camera.fy));
            DVec3::new(x, y, row.z - x * f64::from(camera.cx) - y * f64::from(camera.cy))
        });
        let outline = self.clipped(corners);
        let depths = outline.iter().map(|corner| corner.z.recip());
        let range = depths.fold([f64::INFINITY, 0.0], |[least, most], inverse| {
            [inverse.min(least), inverse.max(most)]
        });
        let facet = self.facets.len() as u32;
        let before = self.pieces.len();
        let scale = f64::from(self.samples) * SUBSTEPS;
        let size = [camera.width, camera.height].map(|side| i64::from(side * self.samples));
        let rounded: Vec<[i64; 2]> = outline
            .iter()
            .map(|corner| self.pixel(*corner).to_array().map(|x| (x * scale).round() as i64))
            .collect();
        for i in 2..rounded.len() {
            let corners = [rounded[0], rounded[i - 1], rounded[i]];
            self.pieces.extend(Piece::new(corners, size, facet));
        }
        if self.pieces.len() > before {
            self.facets.push(Facet {
                triangle,
                back: volume > 0.0,
                planes,
                inverse_depth: planes[0] + planes[1] + planes[2],
                range,
            });
        }
    }

    fn pixel(&self, view: DVec3) -> DVec2 {
        let camera = &self.camera;
        DVec2::new(
            view.x / view.z * f64::from(camera.fx) + f64::from(camera.cx),
            view.y / view.z * f64::from(camera.fy) + f64::from(camera.cy),
        )
    }

    /// The part of a triangle in front of the near plane and inside the guard band.
    fn clipped(&self, corners: [DVec3; 3]) -> Vec<DVec3> {
        let camera = &self.camera;
        let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
        let inside = |corner: &DVec3| {
            let pixel = self.pixel(*corner);
            corner.z >= NEAR
                && pixel.cmpge(DVec2::splat(-GUARD)).all()
                && pixel.cmple(size + GUARD).all()
        };
        let mut outline = corners.to_vec();
        if corners.iter().all(inside) {
            return outline;
        }
        let focal = DVec2::new(f64::from(camera.fx), f64::from(camera.fy));
        let low = DVec2::new(f64::from(camera.cx), f64::from(camera.cy)) + GUARD;
        let high = size + 2.0 * GUARD - low;
        // Inside where plane · (x, y, z) ≥ limit.
        let planes = [
            (DVec3::Z, NEAR),
            (DVec3::new(focal.x, 0.0, low.x), 0.0),
            (DVec3::new(-focal.x, 0.0, high.x), 0.0),
            (DVec3::new(0.0, focal.y, low.y), 0.0),
            (DVec3::new(0.0, -focal.y, high.y), 0.0),
        ];
        for (plane, limit) in planes {
            outline = cut(&outline, |point| plane.dot(point) - limit);
        }
        outline
    }
}

/// The part of a convex outline where `distance` is not negative.
fn cut(outline: &[DVec3], distance: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
    let mut kept = Vec::with_capacity(outline.len() + 1);
    for (i, &a) in outline.iter().enumerate() {
        let b = outline[(i + 1) % outline.len()];
        let (from_a, from_b) = (distance(a), distance(b));
        if from_a >= 0.0 {
            kept.push(a);
        }
        if (from_a >= 0.0) != (from_b >= 0.0) {
            // From the inner end always, so that neighbours cut their edge at the same point.
            let (inner, outer, from_inner, from_outer) =
                if from_a >= 0.0 { (a, b, from_a, from_b) } else { (b, a, from_b, from_a) };
            kept.push(inner + (outer - inner) * (from_inner / (from_inner - from_outer)));
        }
    }
    kept
}
