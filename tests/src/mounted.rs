//! Gaussians that hang on a mesh, without our file in between: what GaussianAvatars and SplattingAvatar
//! write, and where their formulas put it in the world, in f64. Shares no code with converter, runtime
//! or format.

use std::fmt::Write as _;

use dermis_trainer::model::Model;
use dermis_trainer::optimize::schedule::Random;
use dermis_trainer::scene::{Pose, posed_vertices};
use glam::{DMat3, DQuat, DVec3, DVec4};

use crate::splats::SplatPly;

/// A mesh in a pose: world, metres.
#[derive(Clone, Debug)]
pub struct PlainMesh {
    /// Of each vertex.
    pub vertices: Vec<DVec3>,
    /// Indices of vertices.
    pub triangles: Vec<[u32; 3]>,
}

impl PlainMesh {
    /// A model at rest.
    pub fn at_rest(model: &Model) -> Self {
        let vertices = posed_vertices(model, &Pose::rest(model));
        Self {
            vertices: vertices.iter().map(|v| v.as_dvec3()).collect(),
            triangles: model.triangles.iter().map(|t| t.corners).collect(),
        }
    }

    /// The same triangles elsewhere.
    pub fn posed(&self, vertices: &[[f32; 3]]) -> Self {
        let vertices = vertices.iter().map(|v| DVec3::from(v.map(f64::from))).collect();
        Self { vertices, triangles: self.triangles.clone() }
    }

    /// As an OBJ file.
    pub fn obj(&self) -> String {
        let mut text = String::new();
        for v in &self.vertices {
            writeln!(text, "v {} {} {}", v.x as f32, v.y as f32, v.z as f32).expect("text grows");
        }
        for [a, b, c] in &self.triangles {
            writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1).expect("text grows");
        }
        text
    }

    /// Corners of a triangle.
    pub fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].map(|vertex| self.vertices[vertex as usize])
    }

    /// Twice the area times the unit normal.
    fn double_area(&self, triangle: usize) -> DVec3 {
        let [a, b, c] = self.corners(triangle);
        (b - a).cross(c - a)
    }

    /// Triangles that have an area, so that formulas have a frame for them.
    fn with_area(&self) -> Vec<usize> {
        (0..self.triangles.len()).filter(|&t| self.double_area(t).length() > 1e-12).collect()
    }

    /// Unit normal of each vertex, its triangles weighted by area.
    fn normals(&self) -> Vec<DVec3> {
        let mut normals = vec![DVec3::ZERO; self.vertices.len()];
        for (index, triangle) in self.triangles.iter().enumerate() {
            triangle.iter().for_each(|&v| normals[v as usize] += self.double_area(index));
        }
        normals.into_iter().map(DVec3::normalize_or_zero).collect()
    }
}

/// A Gaussian of a PLY in numbers.
struct Numbers {
    position: DVec3,
    rotation: DQuat,
    /// ln of the scales.
    scale: DVec3,
}

impl Numbers {
    fn of(ply: &SplatPly, row: &[f32]) -> Self {
        let get = |name: &str| ply.get(row, name);
        let [w, x, y, z] = ["rot_0", "rot_1", "rot_2", "rot_3"].map(get);
        Self {
            position: DVec3::from(["x", "y", "z"].map(get)),
            rotation: DQuat::from_xyzw(x, y, z, w).normalize(),
            scale: DVec3::from(["scale_0", "scale_1", "scale_2"].map(get)),
        }
    }

    /// Writes them over those of a row.
    fn into_row(self, ply: &SplatPly, row: &mut [f32]) {
        let DQuat { x, y, z, w } = self.rotation;
        let [p, s] = [self.position.to_array(), self.scale.to_array()];
        let of = [
            ("x", p[0]),
            ("y", p[1]),
            ("z", p[2]),
            ("scale_0", s[0]),
            ("scale_1", s[1]),
            ("scale_2", s[2]),
            ("rot_0", w),
            ("rot_1", x),
            ("rot_2", y),
            ("rot_3", z),
        ];
        for (name, number) in of {
            let column = ply.names.iter().position(|n| n == name).expect("it has this property");
            row[column] = number as f32;
        }
    }
}

/// Each row with its Gaussian moved.
fn moved(ply: &SplatPly, to: impl Fn(usize, &[f32], Numbers) -> Numbers) -> SplatPly {
    let mut other = ply.clone();
    for (index, row) in other.rows.iter_mut().enumerate() {
        let numbers = to(index, &ply.rows[index], Numbers::of(ply, row));
        numbers.into_row(ply, row);
    }
    other
}

/// A PLY as GaussianAvatars writes it: `count` Gaussians about as large as their triangles.
pub fn gaussian_avatar(mesh: &PlainMesh, count: u32, degree: usize, seed: u64) -> SplatPly {
    let mut ply = SplatPly::random(count, degree, seed);
    let mut random = Random::new(seed + 1);
    let triangles = mesh.with_area();
    for row in &mut ply.rows {
        for (name, x) in ply.names.iter().zip(row.iter_mut()) {
            if name.starts_with("scale") {
                *x = -1.2 + 0.8 * (2.0 * random.unit() - 1.0);
            }
        }
        row.push(triangles[(random.unit() * triangles.len() as f32) as usize] as f32);
    }
    ply.names.push("binding_0".into());
    ply
}

/// Where its authors' formulas put it.
pub fn gaussian_avatar_in_world(ply: &SplatPly, mesh: &PlainMesh) -> SplatPly {
    moved(ply, |_, row, local| {
        let [a, b, c] = mesh.corners(ply.get(row, "binding_0") as usize);
        let first = (b - a).normalize();
        let normal = first.cross(c - a).normalize();
        let third = -normal.cross(first).normalize();
        let axes = DMat3::from_cols(first, normal, third);
        let size = ((b - a).length() + third.dot(c - a).abs()) / 2.0;
        Numbers {
            position: axes * local.position * size + (a + b + c) / 3.0,
            rotation: DQuat::from_mat3(&axes).normalize() * local.rotation,
            scale: local.scale + size.ln(),
        }
    })
}

/// What SplattingAvatar writes.
#[derive(Clone, Debug)]
pub struct SplattingAvatar {
    /// Scales, colours, opacities; positions and rotations of a pose that does not matter.
    pub ply: SplatPly,
    /// Triangle of each.
    pub triangles: Vec<usize>,
    /// Place in the triangle.
    pub barycentric: Vec<[f64; 3]>,
    /// Metres above it.
    pub distances: Vec<f64>,
    /// Rotation in the canonical pose, w, x, y, z of any length.
    pub rotations: Vec<[f64; 4]>,
}

impl SplattingAvatar {
    /// `count` Gaussians of some centimetres, as near to a mesh.
    pub fn random(mesh: &PlainMesh, count: u32, degree: usize, seed: u64) -> Self {
        let ply = smaller(SplatPly::random(count, degree, seed), 1.3);
        let mut random = Random::new(seed + 1);
        let mut of_each = |number: &mut dyn FnMut(&mut Random) -> [f64; 4]| -> Vec<[f64; 4]> {
            (0..count).map(|_| number(&mut random)).collect()
        };
        let feet = of_each(&mut |random| {
            let [u, v] = [(); 2].map(|()| f64::from(random.unit()));
            let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
            let triangle = f64::from(random.unit()) * mesh.triangles.len() as f64;
            [u, v, 1.0 - u - v, triangle.min(mesh.triangles.len() as f64 - 1.0)]
        });
        let rotations =
            of_each(&mut |random| [(); 4].map(|()| f64::from(random.unit()) * 4.0 - 2.0));
        let distances = of_each(&mut |random| [f64::from(random.unit()) * 0.04 - 0.01; 4]);
        Self {
            ply,
            triangles: feet.iter().map(|foot| foot[3] as usize).collect(),
            barycentric: feet.iter().map(|&[u, v, w, _]| [u, v, w]).collect(),
            distances: distances.iter().map(|d| d[0]).collect(),
            rotations,
        }
    }

    /// `embedding.json`, without the rotations where they are not wanted.
    pub fn embedding(&self, mesh: &str) -> String {
        let xyz: Vec<[f64; 3]> = self.distances.iter().map(|&d| [0.0, 0.0, d]).collect();
        format!(
            r#"{{"cano_mesh": "{mesh}", "sample_fidxs": {:?}, "sample_bary": {:?}, "_xyz": {xyz:?}, "_rotation": {:?}}}"#,
            self.triangles, self.barycentric, self.rotations
        )
    }

    /// Where its authors' formulas put it on the posed mesh; the canonical pose is such a pose, too.
    pub fn in_world(&self, canonical: &PlainMesh, posed: &PlainMesh) -> SplatPly {
        let normals = posed.normals();
        let turns = vertex_turns(canonical, posed);
        moved(&self.ply, |index, _, numbers| {
            let corners = posed.triangles[self.triangles[index]];
            let weighted = || corners.iter().map(|&v| v as usize).zip(self.barycentric[index]);
            let foot: DVec3 = weighted().map(|(v, weight)| weight * posed.vertices[v]).sum();
            let normal: DVec3 = weighted().map(|(v, weight)| weight * normals[v]).sum();
            let turn: DVec4 = weighted().map(|(v, weight)| weight * turns[v]).sum();
            let [w, x, y, z] = self.rotations[index];
            let own = DQuat::from_xyzw(x, y, z, w).normalize();
            Numbers {
                position: foot + self.distances[index] * normal.normalize(),
                rotation: (DQuat::from_vec4(turn.normalize()) * own).normalize(),
                scale: numbers.scale,
            }
        })
    }
}

/// Quaternion x, y, z, w of each vertex from one pose to another: those of the triangles around it,
/// weighted by area at first.
fn vertex_turns(from: &PlainMesh, to: &PlainMesh) -> Vec<DVec4> {
    let axes = |mesh: &PlainMesh, triangle: usize| {
        let [a, b, _] = mesh.corners(triangle);
        let (edge, normal) = ((b - a).normalize(), mesh.double_area(triangle).normalize());
        DMat3::from_cols(edge, normal, edge.cross(normal))
    };
    let mut turns = vec![DVec4::ZERO; from.vertices.len()];
    for (index, triangle) in from.triangles.iter().enumerate() {
        let area = from.double_area(index).length();
        if area > 0.0 {
            let turn = DQuat::from_mat3(&(axes(to, index) * axes(from, index).transpose()));
            let turn = if turn.w < 0.0 { -turn } else { turn };
            triangle.iter().for_each(|&v| turns[v as usize] += area * DVec4::from(turn));
        }
    }
    turns.into_iter().map(|turn| turn.try_normalize().unwrap_or(DVec4::W)).collect()
}

/// The same Gaussians, e^`by` times smaller.
pub fn smaller(mut ply: SplatPly, by: f32) -> SplatPly {
    for row in &mut ply.rows {
        let scales = ply.names.iter().zip(row).filter(|(name, _)| name.starts_with("scale"));
        scales.for_each(|(_, x)| *x -= by);
    }
    ply
}

/// Gaussians that stand free, some centimetres large and as near to a mesh.
pub fn free_around(mesh: &PlainMesh, count: u32, degree: usize, seed: u64) -> SplatPly {
    SplattingAvatar::random(mesh, count, degree, seed).in_world(mesh, mesh)
}

/// Flat opaque Gaussians of one colour each, evenly all over a mesh's surface.
pub fn covering(mesh: &PlainMesh, count: u32, color: impl Fn(DVec3) -> [f32; 3]) -> SplatPly {
    let mut ply = SplatPly::random(0, 0, 0);
    let areas: Vec<f64> =
        (0..mesh.triangles.len()).map(|t| mesh.double_area(t).length() / 2.0).collect();
    let each = areas.iter().sum::<f64>() / f64::from(count);
    let mut random = Random::new(31);
    let (mut passed, mut placed) = (0.0, 0.0);
    for (triangle, area) in areas.iter().enumerate() {
        passed += area;
        while placed + each <= passed {
            placed += each;
            let [a, b, c] = mesh.corners(triangle);
            let [u, v] = [(); 2].map(|()| f64::from(random.unit()));
            let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
            let position = a + u * (b - a) + v * (c - a);
            let sigma = each.sqrt();
            let normal = mesh.double_area(triangle).normalize();
            let numbers = Numbers {
                position,
                rotation: DQuat::from_rotation_arc(DVec3::Z, normal),
                scale: DVec3::new(sigma, sigma, sigma / 20.0).map(f64::ln),
            };
            let rgb = color(position).map(|x| (x - 0.5) / 0.282_094_8);
            let own = |name: &String| match name.as_str() {
                "opacity" => 3.0,
                "f_dc_0" => rgb[0],
                "f_dc_1" => rgb[1],
                "f_dc_2" => rgb[2],
                _ => 0.0,
            };
            let mut row: Vec<f32> = ply.names.iter().map(own).collect();
            numbers.into_row(&ply, &mut row);
            ply.rows.push(row);
        }
    }
    ply
}
