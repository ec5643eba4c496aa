//! Coarser meshes of the same vertices, for the first Gaussians to stand on (face-lod, 4.2).
//!
//! Where the paper weighs a vertex by its region, its distance, normal deviation and curvature, each region here has as
//! many triangles as its share of the surface asks for, and edges collapse by quadrics of position, normal, and place in
//! the training poses: joints that bend stay, and no vertex is new.

use std::collections::HashMap;

use glam::Vec3;
use meshopt::{SimplifyOptions, simplify_with_attributes_and_locks_decoder};

use super::regions::Regions;
use crate::model::Model;
use crate::nearest::Nearest;
use crate::scene::{Bounds, KeyFrame, Pose, posed_vertices};

/// Weight of a normal beside a position of a mesh of size 1.
const NORMAL_WEIGHT: f32 = 0.1;
/// Poses beside the rest pose that edges are weighed in, at most.
const POSES: usize = 8;

/// Triangles of a coarser mesh.
#[derive(Clone, Debug, Default)]
pub struct CoarserMesh {
    /// Vertices of the model.
    pub triangles: Vec<[u32; 3]>,
    /// Triangle of the model that lies nearest to the middle of each, in its own region.
    pub originals: Vec<u32>,
    /// Whether all show their backs, too; those whose original does do anyway.
    pub two_sided: bool,
}

/// A mesh whose edges can collapse.
pub struct Coarsener {
    shapes: Shapes,
    /// Whether regions meet at each vertex.
    borders: Vec<bool>,
    parts: Vec<Part>,
    /// Of all parts.
    area: f64,
}

impl Coarsener {
    /// For a model in some of its training poses.
    pub fn new(model: &Model, regions: &Regions, key_frames: &[KeyFrame]) -> Self {
        let shapes = Shapes::new(model, key_frames);
        let borders = shapes.borders(regions);
        let parts: Vec<Part> =
            (0..regions.len()).map(|region| Part::new(&shapes, regions, region)).collect();
        let area = parts.iter().map(|part| part.area).sum();
        Self { shapes, borders, parts, area }
    }

    /// A mesh of about so many triangles; `None` if it has more than half of the surface's, or none.
    pub fn mesh(&self, triangles: f64) -> Option<CoarserMesh> {
        let per_area = triangles / self.area.max(f64::MIN_POSITIVE);
        let mut mesh = CoarserMesh::default();
        self.parts.iter().for_each(|part| {
            part.add(&self.shapes, &mut mesh, &self.borders, per_area);
        });
        let found = mesh.triangles.len();
        (found > 0 && 2 * found <= self.shapes.corners.len()).then_some(mesh)
    }
}

/// The mesh as edges are weighed: vertices that are one in all poses are one.
struct Shapes {
    /// Of each triangle.
    corners: Vec<[u32; 3]>,
    /// At rest, metres.
    rest: Vec<Vec3>,
    /// Unit normals at rest.
    normals: Vec<Vec3>,
    /// In each other pose, metres.
    posed: Vec<Vec<Vec3>>,
}

impl Shapes {
    fn new(model: &Model, key_frames: &[KeyFrame]) -> Self {
        let step = key_frames.len().div_ceil(POSES).max(1);
        let poses = key_frames.iter().step_by(step).map(|frame| frame.pose(model));
        let rest = posed_vertices(model, &Pose::rest(model));
        let posed: Vec<Vec<Vec3>> = poses.map(|pose| posed_vertices(model, &pose)).collect();
        let firsts = firsts(&rest, &posed);
        let triangles = model.triangles.iter();
        let corners: Vec<[u32; 3]> = triangles
            .map(|triangle| triangle.corners.map(|corner| firsts[corner as usize]))
            .collect();
        let normals = normals(&corners, &rest);
        Self { corners, rest, normals, posed }
    }

    /// Corners of a triangle at rest.
    fn at_rest(&self, corners: [u32; 3]) -> [Vec3; 3] {
        corners.map(|corner| self.rest[corner as usize])
    }

    /// Whether triangles of several regions meet at each vertex.
    fn borders(&self, regions: &Regions) -> Vec<bool> {
        let mut first = vec![None; self.rest.len()];
        let mut borders = vec![false; self.rest.len()];
        for (corners, &region) in self.corners.iter().zip(&regions.of_triangles) {
            for &corner in corners {
                let of = *first[corner as usize].get_or_insert(region);
                borders[corner as usize] |= of != region;
            }
        }
        borders
    }

    /// Corners of what is left of triangles where edges collapse until they are so few, those first that cost least.
    fn collapsed(&self, indices: &[u32], locked: &[bool], triangles: usize) -> Vec<u32> {
        if triangles >= indices.len() / 3 {
            return indices.to_vec();
        }
        let mut attributes = Vec::new();
        for vertex in 0..self.rest.len() {
            attributes.extend(self.normals[vertex].to_array());
            self.posed.iter().for_each(|pose| attributes.extend(pose[vertex].to_array()));
        }
        // The library brings the positions of these triangles to size 1, but not these numbers.
        let places: Vec<Vec3> = indices.iter().map(|&corner| self.rest[corner as usize]).collect();
        let Bounds { min, max } = Bounds::of(&places);
        let size = (max - min).max_element().max(f32::MIN_POSITIVE);
        let of_pose = 1.0 / (size * libm::sqrtf(self.posed.len().max(1) as f32));
        let mut weights = vec![NORMAL_WEIGHT; 3];
        weights.resize(3 + 3 * self.posed.len(), of_pose);
        let places: Vec<[f32; 3]> = self.rest.iter().map(|place| place.to_array()).collect();
        simplify_with_attributes_and_locks_decoder(
            indices,
            &places,
            &attributes,
            &weights,
            size_of_val(&weights[..]),
            locked,
            3 * triangles,
            f32::MAX,
            SimplifyOptions::Sparse | SimplifyOptions::Prune,
            None,
        )
    }
}

/// A region of the mesh.
struct Part {
    /// Corners of its triangles.
    indices: Vec<u32>,
    /// Those of the model's triangles that are its own and have an area.
    nearest: Nearest,
    /// At rest, times the weight that it was given, m².
    area: f64,
}

impl Part {
    fn new(shapes: &Shapes, regions: &Regions, region: usize) -> Self {
        let all = (0..).zip(&shapes.corners).zip(&regions.of_triangles);
        let own = all.filter(|(_, of)| usize::from(**of) == region).map(|(triangle, _)| triangle);
        let own: Vec<(u32, [u32; 3])> = own.map(|(index, corners)| (index, *corners)).collect();
        let size = |corners: [u32; 3]| {
            let [a, b, c] = shapes.at_rest(corners);
            f64::from(0.5 * (b - a).cross(c - a).length())
        };
        let place = |&(index, corners): &(u32, [u32; 3])| {
            let at = shapes.at_rest(corners).map(|corner| corner.as_dvec3().to_array());
            (size(corners) > 0.0).then_some((index, at))
        };
        let weight = f64::from(regions.weights[region].unwrap_or(1.0));
        Self {
            indices: own.iter().flat_map(|(_, corners)| *corners).collect(),
            nearest: Nearest::of(own.iter().filter_map(place)),
            area: weight * own.iter().map(|&(_, corners)| size(corners)).sum::<f64>(),
        }
    }

    /// Adds it to a mesh of so many triangles for each of its square metres.
    fn add(&self, shapes: &Shapes, mesh: &mut CoarserMesh, borders: &[bool], per_area: f64) {
        let wanted = (per_area * self.area).ceil() as usize;
        for &corners in shapes.collapsed(&self.indices, borders, wanted).as_chunks().0 {
            let middle = shapes.at_rest(corners).into_iter().sum::<Vec3>() / 3.0;
            if let Some(original) = self.nearest.triangle(middle.as_dvec3().to_array()) {
                mesh.triangles.push(corners);
                mesh.originals.push(original);
            }
        }
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

/// Unit normals of vertices, by the area of the triangles around.
fn normals(corners: &[[u32; 3]], rest: &[Vec3]) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; rest.len()];
    for corners in corners {
        let corners = corners.map(|corner| corner as usize);
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
            let coarsener = Coarsener::new(&model, &regions, &frames);
            let wanted = [650.0, 162.5];
            let meshes = wanted.map(|wanted| coarsener.mesh(wanted).expect("it is coarser"));
            for (mesh, wanted) in meshes.iter().zip(wanted) {
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
            let borders = Shapes::new(&model, &frames).borders(&regions);
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
        let coarsener = Coarsener::new(&model, &regions, &[]);
        let all = model.triangles.len() as f64;
        for wanted in [0.0, 0.55 * all, all, 1e9, f64::INFINITY] {
            let mesh = coarsener.mesh(wanted);
            assert!(mesh.is_none(), "{wanted} of {all}");
        }
        assert!(coarsener.mesh(0.45 * all).is_some());
    }
}
