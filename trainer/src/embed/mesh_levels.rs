//! Coarser meshes of the same vertices, for the first Gaussians to stand on (face-lod, 4.2).
//!
//! Where the paper weighs a vertex by its region, its distance, normal deviation and curvature, each region here has as many triangles as
//! its Gaussians ask for, and edges collapse by quadrics of position, normal, and place in the training poses: joints that
//! bend stay, and no vertex is new.

use std::collections::HashMap;

use glam::Vec3;
use meshopt::{SimplifyOptions, simplify_with_attributes_and_locks_decoder};

use super::regions::Regions;
use crate::model::Model;
use crate::nearest::Nearest;
use crate::scene::{KeyFrame, Pose, posed_vertices};

/// Triangles of a coarser mesh for each Gaussian that is to stand on it.
const TRIANGLES_PER_GAUSSIAN: f64 = 0.5;
/// Weight of a normal beside a position of a mesh of size 1.
const NORMAL_WEIGHT: f32 = 0.1;
/// Poses beside the rest pose that edges are weighed in, at most.
const POSES: usize = 8;

/// Triangles of a coarser mesh.
#[derive(Clone, Debug, Default)]
pub struct CoarserMesh {
    /// Vertices of the model.
    pub triangles: Vec<[u32; 3]>,
    /// Triangle of the model that lies nearest to the middle of each.
    pub originals: Vec<u32>,
}

/// Meshes for as many Gaussians as `counts` says of each, from fine to coarse, but for those that would have more than half
/// of the surface's triangles, or none.
pub fn coarser(
    model: &Model,
    regions: &Regions,
    key_frames: &[KeyFrame],
    counts: &[u32],
) -> Vec<CoarserMesh> {
    if counts.is_empty() {
        return Vec::new();
    }
    let shapes = Shapes::new(model, key_frames);
    let meshes = counts.iter().map(|&count| shapes.simplified(model, regions, count));
    let pays = |mesh: &CoarserMesh| {
        !mesh.triangles.is_empty() && 2 * mesh.triangles.len() <= model.triangles.len()
    };
    meshes.filter(pays).collect()
}

/// The mesh as edges are weighed: vertices that are one in all poses are one.
struct Shapes {
    /// Lowest index of the vertices that are one with each.
    firsts: Vec<u32>,
    /// At rest, metres.
    rest: Vec<Vec3>,
    /// Normal and places in the other poses of each vertex, `stride` numbers.
    attributes: Vec<f32>,
    /// Of each of those numbers.
    weights: Vec<f32>,
}

impl Shapes {
    fn new(model: &Model, key_frames: &[KeyFrame]) -> Self {
        let step = key_frames.len().div_ceil(POSES).max(1);
        let poses = key_frames.iter().step_by(step).map(|frame| frame.pose(model));
        let rest = posed_vertices(model, &Pose::rest(model));
        let posed: Vec<Vec<Vec3>> = poses.map(|pose| posed_vertices(model, &pose)).collect();
        let firsts = firsts(&rest, &posed);
        let normals = normals(model, &firsts, &rest);
        let mut attributes = Vec::new();
        for vertex in 0..rest.len() {
            attributes.extend(normals[firsts[vertex] as usize].to_array());
            posed.iter().for_each(|pose| attributes.extend(pose[vertex].to_array()));
        }
        // The library brings positions to size 1, but not these.
        let (low, high) =
            rest.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| {
                (low.min(*p), high.max(*p))
            });
        let size = (high - low).max_element().max(f32::MIN_POSITIVE);
        let of_pose = 1.0 / (size * libm::sqrtf(posed.len().max(1) as f32));
        let mut weights = vec![NORMAL_WEIGHT; 3];
        weights.resize(3 + 3 * posed.len(), of_pose);
        Self { firsts, rest, attributes, weights }
    }

    /// A mesh for so many Gaussians.
    fn simplified(&self, model: &Model, regions: &Regions, gaussians: u32) -> CoarserMesh {
        let triangles = f64::from(gaussians) * TRIANGLES_PER_GAUSSIAN;
        let corners: Vec<[u32; 3]> = (model.triangles.iter())
            .map(|triangle| triangle.corners.map(|corner| self.firsts[corner as usize]))
            .collect();
        let borders = self.borders(regions, &corners);
        let mut mesh = CoarserMesh::default();
        for (region, share) in self.shares(regions, &corners).into_iter().enumerate() {
            let own: Vec<u32> = (0..)
                .zip(&regions.of_triangles)
                .filter(|&(_, &of)| usize::from(of) == region)
                .map(|(triangle, _)| triangle)
                .collect();
            let indices: Vec<u32> =
                own.iter().flat_map(|&triangle| corners[triangle as usize]).collect();
            let wanted = 3 * (triangles * share).ceil() as usize;
            let left = self.collapsed(&indices, &borders, wanted);
            let middle = |corners: [u32; 3]| {
                corners.map(|corner| self.rest[corner as usize]).into_iter().sum::<Vec3>() / 3.0
            };
            let place = |&triangle: &u32| {
                let at = corners[triangle as usize].map(|corner| self.rest[corner as usize]);
                let [a, b, c] = at;
                let has_area = (b - a).cross(c - a).length_squared() > 0.0;
                has_area.then(|| (triangle, at.map(|corner| corner.as_dvec3().to_array())))
            };
            let nearest = Nearest::of(own.iter().filter_map(place));
            for &[a, b, c] in left.as_chunks().0 {
                let middle = middle([a, b, c]).as_dvec3().to_array();
                if let Some(original) = nearest.triangle(middle) {
                    mesh.triangles.push([a, b, c]);
                    mesh.originals.push(original);
                }
            }
        }
        mesh
    }

    /// Whether triangles of several regions meet at each vertex.
    fn borders(&self, regions: &Regions, corners: &[[u32; 3]]) -> Vec<bool> {
        let mut first = vec![None; self.rest.len()];
        let mut borders = vec![false; self.rest.len()];
        for (corners, &region) in corners.iter().zip(&regions.of_triangles) {
            for &corner in corners {
                let of = *first[corner as usize].get_or_insert(region);
                borders[corner as usize] |= of != region;
            }
        }
        borders
    }

    /// Of all Gaussians those of each region, by its area and the weight that it was given.
    fn shares(&self, regions: &Regions, corners: &[[u32; 3]]) -> Vec<f64> {
        let mut sums = vec![0.0; regions.len()];
        for (corners, &region) in corners.iter().zip(&regions.of_triangles) {
            let [a, b, c] = corners.map(|corner| self.rest[corner as usize]);
            let weight = regions.weights[usize::from(region)].unwrap_or(1.0);
            sums[usize::from(region)] += f64::from(weight * (b - a).cross(c - a).length());
        }
        let all = sums.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        sums.iter().map(|sum| sum / all).collect()
    }

    /// Corners of what is left of triangles where edges collapse until they are so few, those first that cost least.
    fn collapsed(&self, indices: &[u32], locked: &[bool], wanted: usize) -> Vec<u32> {
        let places: Vec<[f32; 3]> = self.rest.iter().map(|place| place.to_array()).collect();
        simplify_with_attributes_and_locks_decoder(
            indices,
            &places,
            &self.attributes,
            &self.weights,
            size_of_val(&self.weights[..]),
            locked,
            wanted,
            f32::MAX,
            SimplifyOptions::Sparse | SimplifyOptions::Prune,
            None,
        )
    }
}

/// Lowest index of the vertices that are in one place in all poses: a seam's two sides are one.
fn firsts(rest: &[Vec3], posed: &[Vec<Vec3>]) -> Vec<u32> {
    let mut known: HashMap<Vec<[u32; 3]>, u32> = HashMap::new();
    let bits = |place: Vec3| place.to_array().map(f32::to_bits);
    let key = |vertex: usize| -> Vec<[u32; 3]> {
        let others = posed.iter().map(|pose| pose[vertex]);
        core::iter::once(rest[vertex]).chain(others).map(bits).collect()
    };
    (0..rest.len()).map(|vertex| *known.entry(key(vertex)).or_insert(vertex as u32)).collect()
}

/// Unit normals of the first vertices at rest, by the area of the triangles around.
fn normals(model: &Model, firsts: &[u32], rest: &[Vec3]) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; rest.len()];
    for triangle in &model.triangles {
        let corners = triangle.corners.map(|corner| firsts[corner as usize] as usize);
        let [a, b, c] = corners.map(|corner| rest[corner]);
        let normal = (b - a).cross(c - a);
        corners.into_iter().for_each(|corner| sums[corner] += normal);
    }
    sums.into_iter().map(Vec3::normalize_or_zero).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::demo::demo_avatar;
    use crate::embed::choice::Choice;
    use crate::embed::regions::Region;
    use crate::scene::training_key_frames;

    fn head() -> Region {
        let choice = Choice { joints: vec!["head".into()], ..Choice::default() };
        Region { name: "head".into(), choice, weight: None }
    }

    #[test]
    fn meshes_are_as_coarse_as_is_asked_and_regions_stay_apart() {
        let model = demo_avatar();
        let frames = training_key_frames(&model, &[0], 3);
        for asked in [&[][..], &[head()]] {
            let regions = Regions::cut(&model, asked).expect("it can be cut");
            let meshes = coarser(&model, &regions, &frames, &[1000, 250]);
            for (mesh, gaussians) in meshes.iter().zip([1000.0, 250.0]) {
                let wanted = gaussians * TRIANGLES_PER_GAUSSIAN;
                let found = mesh.triangles.len() as f64;
                assert!(found > 0.5 * wanted && found < 1.3 * wanted, "{found} for {wanted}");
                let shapes = Shapes::new(&model, &frames);
                for (corners, &original) in mesh.triangles.iter().zip(&mesh.originals) {
                    let [a, b, c] = corners.map(|corner| shapes.rest[corner as usize]);
                    assert!((b - a).cross(c - a).length() > 0.0, "{corners:?} has no area");
                    let own = model.triangles[original as usize].corners;
                    let near = shapes.rest[own[0] as usize].distance((a + b + c) / 3.0);
                    assert!(near < 0.3, "{near} m from the triangle that it stands for");
                }
            }
            // Every vertex where regions meet is still a corner in both.
            let of_region = |region: u8| -> Vec<u32> {
                let mesh = &meshes[0];
                let own = mesh.triangles.iter().zip(&mesh.originals);
                let own = own.filter(|(_, of)| regions.of_triangles[**of as usize] == region);
                own.flat_map(|(corners, _)| *corners).collect()
            };
            let shapes = Shapes::new(&model, &frames);
            let corners: Vec<[u32; 3]> = (model.triangles.iter())
                .map(|triangle| triangle.corners.map(|corner| shapes.firsts[corner as usize]))
                .collect();
            let borders = shapes.borders(&regions, &corners);
            for vertex in (0..).zip(&borders).filter(|(_, border)| **border).map(|(v, _)| v) {
                assert!(of_region(0).contains(&vertex) && of_region(1).contains(&vertex));
            }
            assert_eq!(borders.contains(&true), asked.len() == 1);
        }
    }

    #[test]
    fn a_mesh_that_is_not_coarser_is_none() {
        let model = demo_avatar();
        let regions = Regions::cut(&model, &[]).expect("nothing is asked");
        let meshes = coarser(&model, &regions, &[], &[100_000, 250]);
        let lens: Vec<usize> = meshes.iter().map(|mesh| mesh.triangles.len()).collect();
        assert!(matches!(lens[..], [len] if len < 200), "{lens:?} of {}", model.triangles.len());
    }

    #[test]
    fn nothing_is_coarser_where_nothing_is_asked() {
        let model = demo_avatar();
        let regions = Regions::cut(&model, &[]).expect("nothing is asked");
        assert!(coarser(&model, &regions, &[], &[]).is_empty());
    }
}
