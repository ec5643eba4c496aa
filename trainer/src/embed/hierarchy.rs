//! LoDAvatar's hierarchical embedding (3.4–3.5, eqs. 6–9): uniform subdivision of every triangle.
//!
//! Level 0 has a Gaussian on each vertex and one at the centre of each triangle. A step joins the
//! trained position of each centre Gaussian to its triangle's corners, which gives 3 new triangles
//! beside the old one, and puts a Gaussian at the centre of each of the 4.

use glam::Vec3;

use super::initial::seed;
use super::surface::{Surface, SurfacePoint};
use crate::optimize::cloud::{Cloud, Freedom, Seed};
use crate::scene::Painter;

/// Gaussians of a mesh with `vertices` and `triangles` at level `level`: V + F (4^(n+1) − 1) / 3.
pub fn gaussians_at_level(vertices: u64, triangles: u64, level: u32) -> u64 {
    vertices + triangles * (4u64.pow(level + 1) - 1) / 3
}

/// A triangle of the current level.
#[derive(Clone, Debug)]
struct SubTriangle {
    /// The mesh's triangle it lies on.
    base: u32,
    /// Corners as barycentrics of the base: trained offsets along the normal stay with their Gaussian.
    corners: [Vec3; 3],
    /// Index of its centre Gaussian among all seeds.
    center: u32,
}

/// The embedding, level by level.
#[derive(Clone, Debug, Default)]
pub struct Hierarchy {
    layers: Vec<u32>,
    triangles: Vec<SubTriangle>,
}

impl Hierarchy {
    /// Level 0. Every vertex of `corners` (indices of each triangle's vertices) gets its Gaussian
    /// on the first triangle with an area that has it.
    pub fn base(
        surface: &Surface,
        painter: &Painter<'_>,
        corners: &[[u32; 3]],
        vertices: usize,
    ) -> (Self, Vec<Seed>) {
        let mut owner: Vec<Option<(u32, usize)>> = vec![None; vertices];
        for (triangle, ids) in corners.iter().enumerate() {
            let valid = surface.area(triangle as u32) > 0.0;
            for (corner, &vertex) in ids.iter().enumerate() {
                let slot = &mut owner[vertex as usize];
                if slot.is_none() && valid {
                    *slot = Some((triangle as u32, corner));
                }
            }
        }
        let total: f32 = (0..corners.len()).map(|t| surface.area(t as u32)).sum();
        let area = total / gaussians_at_level(vertices as u64, corners.len() as u64, 0) as f32;
        // A vertex without a triangle of any area gets a place all the same: the counts are exact.
        let on_vertices = owner.into_iter().map(|owner| {
            let (triangle, corner) = owner.unwrap_or((0, 0));
            let point = SurfacePoint { triangle, barycentrics: Vec3::AXES[corner] };
            seed(surface, painter, &point, area, Freedom::Anchored)
        });
        let mut seeds: Vec<Seed> = on_vertices.collect();
        let mut hierarchy = Self::default();
        let whole = (0..corners.len() as u32).map(|base| (base, Vec3::AXES)).collect();
        hierarchy.add_level(surface, painter, whole, area, &mut seeds);
        hierarchy.layers = vec![seeds.len() as u32];
        (hierarchy, seeds)
    }

    /// The next level on top of a trained cloud: everything in it is fixed.
    pub fn refine(&mut self, surface: &Surface, painter: &Painter<'_>, cloud: &Cloud) -> Vec<Seed> {
        let mut seeds = vec![None; cloud.len()];
        let gaussians = cloud.full().iter().zip(&cloud.triangles);
        for ((&parameters, &triangle), &origin) in gaussians.zip(&cloud.origins) {
            seeds[origin as usize] = Some(Seed { triangle, parameters, freedom: Freedom::Fixed });
        }
        let mut seeds: Vec<Seed> = seeds.into_iter().flatten().collect();
        let mut children = Vec::with_capacity(self.triangles.len() * 4);
        for triangle in &self.triangles {
            let center = &seeds[triangle.center as usize];
            let apex = surface.barycentrics(triangle.base, center.parameters.position);
            let [a, b, c] = triangle.corners;
            let corners = [[apex, a, b], [apex, b, c], [apex, c, a], [a, b, c]];
            children.extend(corners.map(|corners| (triangle.base, corners)));
        }
        let total: f32 = (0..surface.len()).map(|t| surface.area(t as u32)).sum();
        let before = seeds.len();
        let area = total / (before + children.len()) as f32;
        self.add_level(surface, painter, children, area, &mut seeds);
        self.layers.push((seeds.len() - before) as u32);
        seeds
    }

    /// Gaussians of each level so far.
    pub fn layers(&self) -> Vec<u32> {
        self.layers.clone()
    }

    fn add_level(
        &mut self,
        surface: &Surface,
        painter: &Painter<'_>,
        triangles: Vec<(u32, [Vec3; 3])>,
        area: f32,
        seeds: &mut Vec<Seed>,
    ) {
        self.triangles.clear();
        for (base, corners) in triangles {
            let point = SurfacePoint {
                triangle: base,
                barycentrics: (corners[0] + corners[1] + corners[2]) / 3.0,
            };
            self.triangles.push(SubTriangle { base, corners, center: seeds.len() as u32 });
            seeds.push(seed(surface, painter, &point, area, Freedom::Free));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::gaussians_at_level;

    #[test]
    fn smpl_has_the_counts_of_the_paper() {
        let counts: Vec<u64> =
            (0..4).map(|level| gaussians_at_level(6890, 13_776, level)).collect();
        assert_eq!(counts, [20_666, 75_770, 296_186, 1_177_850]);
    }
}
