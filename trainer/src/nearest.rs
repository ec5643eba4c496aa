//! The triangle nearest to a point.

use glam::DVec3;
use rstar::{AABB, PointDistance, RTree, RTreeObject};

/// Triangles as far away as the nearest one up to this share of the squared distance, or of the squared
/// size of the point's coordinates, are as near: rounding would choose between the two sides of an edge.
const ROUNDING: f64 = 1e-12;

/// Triangles to be searched by place.
pub(crate) struct Nearest(RTree<Triangle>);

struct Triangle {
    index: u32,
    corners: [DVec3; 3],
}

impl Nearest {
    /// Of triangles with their corners, all of them finite and with an area.
    pub(crate) fn of(triangles: impl Iterator<Item = (u32, [[f64; 3]; 3])>) -> Self {
        let triangle = |(index, corners): (u32, [[f64; 3]; 3])| Triangle {
            index,
            corners: corners.map(DVec3::from),
        };
        Self(RTree::bulk_load(triangles.map(triangle).collect()))
    }

    /// The nearest triangle to a finite point; of several the lowest index. None without triangles.
    pub(crate) fn triangle(&self, point: [f64; 3]) -> Option<u32> {
        let mut nearest = self.0.nearest_neighbor_iter_with_distance_2(point);
        let (first, distance) = nearest.next()?;
        let size = DVec3::from(point).length_squared();
        let as_near = distance + ROUNDING * distance.max(ROUNDING * size);
        let others = nearest.take_while(|(_, distance)| *distance <= as_near);
        Some(others.map(|(triangle, _)| triangle.index).fold(first.index, u32::min))
    }

    /// Triangles from the nearest one on.
    pub(crate) fn by_distance(&self, point: [f64; 3]) -> impl Iterator<Item = u32> {
        self.0.nearest_neighbor_iter(point).map(|triangle| triangle.index)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimize::schedule::Random;

    /// The least distance, squared, to a fine grid of points on a triangle.
    fn by_samples([a, b, c]: [DVec3; 3], p: DVec3) -> f64 {
        const STEPS: u32 = 60;
        let mut least = f64::INFINITY;
        for i in 0..=STEPS {
            for j in 0..=STEPS - i {
                let [u, v] = [i, j].map(|k| f64::from(k) / f64::from(STEPS));
                least = least.min((a + u * (b - a) + v * (c - a)).distance_squared(p));
            }
        }
        least
    }

    fn triangles(random: &mut Random, count: u32) -> Vec<[[f64; 3]; 3]> {
        let mut number = || f64::from(2.0 * random.unit() - 1.0);
        let corners = |middle: [f64; 3], number: &mut dyn FnMut() -> f64| {
            [(); 3].map(|()| middle.map(|x| x + 0.2 * number()))
        };
        (0..count).map(|_| corners([(); 3].map(|()| number()), &mut number)).collect()
    }

    #[test]
    fn the_closest_point_is_on_the_triangle_and_none_is_closer() {
        let mut random = Random::new(5);
        for corners in triangles(&mut random, 300) {
            let corners = corners.map(DVec3::from);
            let p = DVec3::from([(); 3].map(|()| f64::from(2.0 * random.unit() - 1.0)));
            let (own, sampled) = (closest(corners, p).distance(p), by_samples(corners, p).sqrt());
            assert!(own <= sampled + 1e-12 && own > sampled - 0.01, "{own} {sampled}");
        }
    }

    #[test]
    fn the_tree_finds_what_a_search_of_all_finds() {
        let mut random = Random::new(6);
        let triangles = triangles(&mut random, 500);
        let nearest = Nearest::of((0..).zip(triangles.iter().copied()));
        for _ in 0..500 {
            let p = [(); 3].map(|()| f64::from(3.0 * random.unit() - 1.5));
            let distance = |index: u32| {
                let corners = triangles[index as usize].map(DVec3::from);
                closest(corners, p.into()).distance_squared(p.into())
            };
            let found = nearest.triangle(p).expect("there are triangles");
            assert!((0..500).all(|other| distance(found) <= distance(other) * (1.0 + 1e-9)));
        }
        assert_eq!(Nearest::of([].into_iter()).triangle([0.0; 3]), None);
    }

    #[test]
    fn of_two_sides_of_an_edge_the_lower_index_is_taken() {
        let mut random = Random::new(7);
        let mut number = || f64::from(2.0 * random.unit() - 1.0);
        for _ in 0..200 {
            // A roof; the point stands over its ridge.
            let [a, b] = [(); 2].map(|()| DVec3::new(number(), number(), number()));
            let along = (b - a).normalize();
            let up = along.any_orthonormal_vector();
            let aside = along.cross(up);
            let [left, right] = [aside, -aside].map(|side| a + side - 0.5 * up);
            let p = a.lerp(b, 0.5 + 0.4 * number()) + 0.1 * up;
            let roof = [[a, b, left], [b, a, right]].map(|t| t.map(|v| v.to_array()));
            for (first, second) in [(0, 1), (1, 0)] {
                let pair = [(3, roof[first]), (9, roof[second])];
                assert_eq!(Nearest::of(pair.into_iter()).triangle(p.to_array()), Some(3));
            }
        }
    }
}
