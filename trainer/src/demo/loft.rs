//! Closed surfaces swept along a path: every part of the figure is one.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

/// A closed curve around the path. At angle θ it passes through
/// `center + cos θ · front + sin θ · side`; without extent it is a pole that closes the surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ring {
    /// Metres.
    pub(super) center: Vec3,
    /// Half axis towards θ = 0, metres.
    pub(super) front: Vec3,
    /// Half axis towards θ = π/2, metres; front × side points along the path.
    pub(super) side: Vec3,
}

/// Rings in the order of the path; the first and the last are poles, no other is.
#[derive(Clone, Debug)]
pub(super) struct Loft {
    pub(super) rings: Vec<Ring>,
    /// v of each ring, from 0 to 1; by default in proportion to the length of the surface.
    pub(super) stations: Vec<f32>,
    /// Quadrilaterals around.
    pub(super) segments: usize,
    /// dθ/du at the front over its mean: under 1 for finer segments and texels in front.
    pub(super) front_density: f32,
    /// Nothing reaches below this height, metres (the ground under a sole).
    pub(super) floor: f32,
}

impl Loft {
    /// A round tube. `path` lists (point, radius); its ends are poles, where the radius is not
    /// read. `front` is the direction of θ = 0, made perpendicular to the path.
    pub(super) fn tube(path: &[(Vec3, f32)], front: Vec3, segments: usize) -> Self {
        let last = path.len() - 1;
        let ring = |(i, &(center, radius)): (usize, &(Vec3, f32))| {
            let along = (path[(i + 1).min(last)].0 - path[i.saturating_sub(1)].0).normalize();
            let front = (front - along * front.dot(along)).normalize();
            let radius = if i == 0 || i == last { 0.0 } else { radius };
            Ring { center, front: front * radius, side: along.cross(front) * radius }
        };
        Self::new(path.iter().enumerate().map(ring).collect(), segments)
    }

    /// An ellipsoid with poles above and below; `latitudes` in degrees, ascending, poles left out.
    pub(super) fn ellipsoid(center: Vec3, radii: Vec3, latitudes: &[f32], segments: usize) -> Self {
        let ring = |(sin, cos): (f32, f32)| Ring {
            center: center + Vec3::Y * (radii.y * sin),
            front: Vec3::Z * (radii.z * cos),
            side: Vec3::X * (radii.x * cos),
        };
        let inner = latitudes.iter().map(|latitude| ring(latitude.to_radians().sin_cos()));
        let rings = std::iter::once(ring((-1.0, 0.0))).chain(inner);
        Self::new(rings.chain([ring((1.0, 0.0))]).collect(), segments)
    }

    pub(super) fn new(rings: Vec<Ring>, segments: usize) -> Self {
        let mut stations = vec![0.0];
        for pair in rings.windows(2) {
            let [before, after] = pair else { continue };
            let rise = before.center.distance(after.center);
            let spread = before.side.length() - after.side.length();
            stations.push(stations[stations.len() - 1] + rise.hypot(spread));
        }
        let length = stations[stations.len() - 1];
        stations.iter_mut().for_each(|station| *station /= length);
        Self { rings, stations, segments, front_density: 1.0, floor: f32::NEG_INFINITY }
    }

    /// The smooth surface at (u, v) in [0, 1]²: u goes around with the front at 0.5, v along the
    /// rings.
    fn smooth_point(&self, uv: Vec2) -> Vec3 {
        let turn = 2.0 * uv.x - 1.0;
        let warped = turn * (self.front_density + (1.0 - self.front_density) * turn * turn);
        let (sin, cos) = (PI * warped).sin_cos();
        let at = |ring: &Ring| {
            let place = ring.center + ring.front * cos + ring.side * sin;
            place.with_y(place.y.max(self.floor))
        };
        let v = uv.y.clamp(0.0, 1.0);
        let after = self.stations.partition_point(|&station| station < v).max(1);
        let [start, end] = [self.stations[after - 1], self.stations[after]];
        at(&self.rings[after - 1]).lerp(at(&self.rings[after]), (v - start) / (end - start))
    }

    /// The faceted surface, which the triangles follow.
    pub(super) fn point(&self, uv: Vec2) -> Vec3 {
        let position = uv.x * self.segments as f32;
        let before = position.floor();
        let at = |column: f32| self.smooth_point(Vec2::new(column / self.segments as f32, uv.y));
        at(before).lerp(at(before + 1.0), position - before)
    }

    /// Unit normal that points outside.
    pub(super) fn normal(&self, uv: Vec2) -> Vec3 {
        // Steps of about a facet smooth over the edges; poles are approached, not touched.
        let step = 0.04;
        let v = uv.y.clamp(1.5 * step, 1.0 - 1.5 * step);
        let at = |du: f32, dv: f32| self.smooth_point(Vec2::new(uv.x + du, v + dv));
        let around = at(0.01, 0.0) - at(-0.01, 0.0);
        let along = at(0.0, step) - at(0.0, -step);
        around.cross(along).normalize_or(Vec3::Y)
    }

    /// Vertices (position, (u, v)) and counter-clockwise triangles. Vertices at one place along
    /// the seam and at the poles have the same bits.
    pub(super) fn mesh(&self) -> (Vec<(Vec3, Vec2)>, Vec<[u32; 3]>) {
        let (n, last) = (self.segments, self.rings.len() - 1);
        let mut vertices = Vec::new();
        let mut triangles = Vec::new();
        for (row, (ring, &v)) in self.rings.iter().zip(&self.stations).enumerate() {
            // A pole has a vertex for each triangle that meets there, in its middle.
            let pole = row == 0 || row == last;
            for column in 0..if pole { n } else { n + 1 } {
                let shift = if pole { 0.5 } else { 0.0 };
                let u = (column as f32 + shift) / n as f32;
                let around = (column % n) as f32 / n as f32;
                let smooth = || self.smooth_point(Vec2::new(around, v));
                vertices.push((if pole { ring.center } else { smooth() }, Vec2::new(u, v)));
            }
        }
        let index = |row: usize, column: usize| match row {
            0 => column as u32,
            _ => (n + (row - 1) * (n + 1) + column) as u32,
        };
        for (row, column) in (0..last).flat_map(|row| (0..n).map(move |column| (row, column))) {
            let [a, b] = [index(row, column), index(row, column + 1)];
            let [c, d] = [index(row + 1, column), index(row + 1, column + 1)];
            // Diagonals alternate, so that no direction is favoured.
            if row == 0 {
                triangles.push([a, d, c]);
            } else if row == last - 1 {
                triangles.push([a, b, c]);
            } else if (row + column) % 2 == 0 {
                triangles.extend([[a, b, d], [a, d, c]]);
            } else {
                triangles.extend([[a, b, c], [b, d, c]]);
            }
        }
        (vertices, triangles)
    }
}
