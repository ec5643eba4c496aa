//! LoDAvatar's hierarchical embedding (3.4–3.6, eqs. 6–9): subdivision of every triangle, then of some.
//!
//! Level 0 has a Gaussian on each vertex and one at the centre of each triangle. A step joins the
//! trained position of each centre Gaussian to its triangle's corners, which gives 3 new triangles
//! beside the old one, and puts a Gaussian at the centre of each of the 4. Selective detail (3.6) takes
//! such steps on chosen triangles alone.

use anyhow::Result;
use glam::Vec3;

use super::initial::seed;
use super::surface::{Surface, SurfacePoint};
use crate::model::Model;
use crate::optimize::cloud::{Cloud, Freedom, Seed};
use crate::options::Options;
use crate::scene::Painter;

/// Gaussians of a mesh with `vertices` and `triangles` at level `level`: V + F (4^(n+1) − 1) / 3.
pub fn gaussians_at_level(vertices: u64, triangles: u64, level: u32) -> u64 {
    vertices + triangles * (4u64.pow(level + 1) - 1) / 3
}

/// Gaussians that `steps` further levels add on `sub_triangles` chosen triangles of the last level of
/// all (each triangle of the mesh has 4ⁿ of them at level n): S (4 + 16 + … + 4^steps).
pub fn gaussians_of_detail(sub_triangles: u64, steps: u32) -> u64 {
    sub_triangles * (4u64.pow(steps + 1) - 4) / 3
}

/// Gaussians that [`Method::Lodavatar`](crate::methods::Method) makes of a mesh.
///
/// # Errors
///
/// Where no triangle is what the detail asks for.
pub fn gaussians_of(model: &Model, options: &Options) -> Result<u64> {
    let (vertices, triangles) = (model.vertices.len() as u64, model.triangles.len() as u64);
    let last = options.levels.max(1) - 1;
    let selected = options.detail.select(model)?.unwrap_or_default();
    let chosen = selected.iter().filter(|selected| **selected).count() as u64;
    let more = gaussians_of_detail(chosen * 4u64.pow(last), options.detail_levels());
    Ok(gaussians_at_level(vertices, triangles, last) + more)
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

    /// The next level on top of a trained cloud: everything in it is fixed. With `detail` (a choice of
    /// the mesh's triangles) only what lies on chosen triangles is divided; what was left out once has
    /// no part in later levels.
    pub fn refine(
        &mut self,
        surface: &Surface,
        painter: &Painter<'_>,
        cloud: &Cloud,
        detail: Option<&[bool]>,
    ) -> Vec<Seed> {
        let takes_part = |base: u32| detail.is_none_or(|selected| selected[base as usize]);
        let mut seeds = vec![None; cloud.len()];
        let gaussians = cloud.full().iter().zip(&cloud.triangles);
        for ((&parameters, &triangle), &origin) in gaussians.zip(&cloud.origins) {
            seeds[origin as usize] = Some(Seed { triangle, parameters, freedom: Freedom::Fixed });
        }
        let mut seeds: Vec<Seed> = seeds.into_iter().flatten().collect();
        let mut children = Vec::with_capacity(self.triangles.len() * 4);
        for triangle in self.triangles.iter().filter(|triangle| takes_part(triangle.base)) {
            let center = &seeds[triangle.center as usize];
            let apex = surface.barycentrics(triangle.base, center.parameters.position);
            let [a, b, c] = triangle.corners;
            let corners = [[apex, a, b], [apex, b, c], [apex, c, a], [a, b, c]];
            children.extend(corners.map(|corners| (triangle.base, corners)));
        }
        // Each Gaussian stands for its share of the surface that is divided.
        let divided = (0..surface.len() as u32).filter(|&triangle| takes_part(triangle));
        let total: f32 = divided.map(|triangle| surface.area(triangle)).sum();
        let there = seeds.iter().filter(|seed| takes_part(seed.triangle)).count();
        let before = seeds.len();
        let area = total / (there + children.len()).max(1) as f32;
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
    use dermis_format::FrameKind;
    use glam::{Vec2, Vec3, Vec4};

    use super::{Hierarchy, gaussians_at_level, gaussians_of_detail};
    use crate::embed::surface::Surface;
    use crate::model::{Material, Model, Triangle, Vertex};
    use crate::optimize::cloud::{Cloud, Freedom, Seed};
    use crate::scene::Painter;

    #[test]
    fn smpl_has_the_counts_of_the_paper() {
        let counts: Vec<u64> =
            (0..4).map(|level| gaussians_at_level(6890, 13_776, level)).collect();
        assert_eq!(counts, [20_666, 75_770, 296_186, 1_177_850]);
    }

    #[test]
    fn detail_has_the_counts_of_the_paper() {
        // 5,175 sub-triangles at level 1.
        let added: Vec<u64> = (0..3).map(|steps| gaussians_of_detail(5175, steps)).collect();
        assert_eq!(added, [0, 20_700, 20_700 + 82_800]);
        // All sub-triangles of level 1: the next levels.
        let whole = gaussians_at_level(6890, 13_776, 1) + gaussians_of_detail(4 * 13_776, 2);
        assert_eq!(whole, gaussians_at_level(6890, 13_776, 3));
    }

    /// A band of `triangles` triangles, and one more vertex than it has with 2.
    fn band(triangles: u32) -> Model {
        let vertex = |i: u32| Vertex {
            position: Vec3::new((i / 2) as f32, (i % 2) as f32, 0.0) * 0.01,
            uv: Vec2::ZERO,
            color: Vec4::ONE,
            influences: [(0, 0.0); 4],
        };
        let corners =
            |i: u32| if i.is_multiple_of(2) { [i, i + 2, i + 1] } else { [i, i + 1, i + 2] };
        Model {
            vertices: (0..triangles + 2).map(vertex).collect(),
            triangles: (0..triangles)
                .map(|i| Triangle { corners: corners(i), material: 0 })
                .collect(),
            materials: vec![Material::default()],
            ..Model::default()
        }
    }

    /// All seeds after `uniform` levels and then `steps` on `selected` triangles, untrained; and the layers.
    fn embedded(
        model: &Model,
        uniform: u32,
        steps: u32,
        selected: &[bool],
    ) -> (Vec<u32>, Vec<Seed>) {
        let positions: Vec<_> = model.vertices.iter().map(|v| v.position.to_array()).collect();
        let corners: Vec<_> = model.triangles.iter().map(|t| t.corners).collect();
        let (surface, painter) =
            (Surface::new(FrameKind::Area, &positions, &corners), Painter::new(model));
        let (mut hierarchy, mut seeds) =
            Hierarchy::base(&surface, &painter, &corners, positions.len());
        for step in 0..uniform + steps {
            let cloud = Cloud::arrange(hierarchy.layers(), &seeds);
            let detail = (step >= uniform).then_some(selected);
            seeds = hierarchy.refine(&surface, &painter, &cloud, detail);
        }
        (hierarchy.layers(), seeds)
    }

    #[test]
    fn detail_divides_chosen_triangles_alone() {
        let model = band(6000);
        let selected: Vec<bool> = (0..6000).map(|triangle| triangle % 6000 < 5175).collect();
        let (layers, seeds) = embedded(&model, 0, 2, &selected);
        assert_eq!(layers, [6002 + 6000, 20_700, 82_800]);
        let (old, new) = seeds.split_at(layers[0] as usize);
        assert!(new.iter().all(|seed| selected[seed.triangle as usize]));
        assert!(old.iter().all(|seed| seed.freedom == Freedom::Fixed));
        let last = &new[layers[1] as usize..];
        assert!(last.iter().all(|seed| seed.freedom == Freedom::Free));
    }

    #[test]
    fn detail_follows_uniform_levels() {
        let model = band(60);
        let selected: Vec<bool> = (0..60).map(|triangle| triangle % 4 == 1).collect();
        let (layers, _) = embedded(&model, 1, 2, &selected);
        assert_eq!(layers, [62 + 60, 4 * 60, 16 * 15, 64 * 15]);
        let total = gaussians_at_level(62, 60, 1) + gaussians_of_detail(4 * 15, 2);
        assert_eq!(u64::from(layers.iter().sum::<u32>()), total);
    }

    #[test]
    fn detail_everywhere_is_a_level() {
        let model = band(60);
        let ((layers, seeds), (other_layers, other)) =
            (embedded(&model, 2, 0, &[]), embedded(&model, 1, 1, &[true; 60]));
        assert_eq!(layers, other_layers);
        for (seed, other) in seeds.iter().zip(&other) {
            assert_eq!((seed.triangle, seed.parameters), (other.triangle, other.parameters));
        }
    }
}
