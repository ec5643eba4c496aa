//! The triangle nearest to a point.

use glam::DVec3;
use rstar::{AABB, PointDistance, RTree, RTreeObject};

/// Triangles as far away as the nearest one up to this share of the squared distance, or of the squared
/// size of the point's coordinates, are as near: rounding would choose between the two sides of an edge.
const ROUNDING: f64 = 1e-12;

/// Triangles to be searched by place.
pub(super) struct Nearest(RTree<Triangle>);

struct Triangle {
    index: u32,
    corners: [DVec3; 3],
}

impl Nearest {
    /// Of triangles with their corners, all of them finite and with an area.
    pub(super) fn of(triangles: impl Iterator<Item = (u32, [[f64; 3]; 3])>) -> Self {
        let triangle = |(index, corners): (u32, [[f64; 3]; 3])| Triangle {
            index,
            corners: corners.map(DVec3::from),
        };
        Self(RTree::bulk_load(triangles.map(triangle).collect()))
    }

    /// The nearest triangle to a finite point; of several the lowest index. None without triangles.
    pub(super) fn triangle(&self, point: [f64; 3]) -> Option<u32> {
        let mut nearest = self.0.nearest_neighbor_iter_with_distance_2(point);
        let (first, distance) = nearest.next()?;
        let size = DVec3::from(point).length_squared();
        let as_near = distance + ROUNDING * distance.max(ROUNDING * size);
        let others = nearest.take_while(|(_, distance)| *distance <= as_near);
        Some(others.map(|(triangle, _)| triangle.index).fold(first.index, u32::min))
    }
}

impl RTreeObject for Triangle {
    type Envelope = AABB<[f64; 3]>;

    fn envelope(&self) -> Self::Envelope {
        AABB::from_points(&self.corners.map(|corner| corner.to_array()))
    }
}

impl PointDistance for Triangle {
    fn distance_2(&self, point: &[f64; 3]) -> f64 {
        let point = DVec3::from(*point);
        closest(self.corners, point).distance_squared(point)
    }
}

/// The point of a triangle with an area that is closest to `p`: its foot on the plane if that lies
/// inside, else the closest one of the edges.
fn closest([a, b, c]: [DVec3; 3], p: DVec3) -> DVec3 {
    let normal = (b - a).cross(c - a);
    let inside = |from: DVec3, to: DVec3| normal.dot((to - from).cross(p - from)) >= 0.0;
    if inside(a, b) && inside(b, c) && inside(c, a) {
        return p - normal * (normal.dot(p - a) / normal.length_squared());
    }
    let on_edge = |from: DVec3, to: DVec3| {
        let edge = to - from;
        from + edge * (edge.dot(p - from) / edge.length_squared()).clamp(0.0, 1.0)
    };
    let edges = [on_edge(a, b), on_edge(b, c), on_edge(c, a)];
    let nearer =
        |x: DVec3, y: DVec3| if y.distance_squared(p) < x.distance_squared(p) { y } else { x };
    edges.into_iter().fold(edges[0], nearer)
}
