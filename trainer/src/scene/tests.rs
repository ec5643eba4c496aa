//! Tests of the scene, and the small models that they share.

mod keyframes;
mod pose;
mod render;
mod rig;
mod sight;
mod texture;
mod visibility;

use dermis_runtime::Camera;
use glam::{Vec2, Vec3, Vec4, vec2, vec3};
use image::{Rgba, RgbaImage};

use super::rig::camera_towards;
use crate::model::{Material, Model, Texture, Triangle, Vertex, Wrap};

pub(super) const WHITE: [f32; 3] = [1.0; 3];

/// A mesh of one material without skeleton; texture coordinates are the positions' x and y.
pub(super) fn mesh(positions: &[Vec3], triangles: &[[u32; 3]], material: Material) -> Model {
    Model {
        vertices: positions.iter().map(|&position| vertex(position, position.truncate())).collect(),
        triangles: triangles.iter().map(|&corners| Triangle { corners, material: 0 }).collect(),
        materials: vec![material],
        ..Model::default()
    }
}

pub(super) fn vertex(position: Vec3, uv: Vec2) -> Vertex {
    Vertex { position, uv, color: Vec4::ONE, influences: [(0, 0.0); 4] }
}

/// The square [−1, 1]² in the plane z = 0 with its front towards +Z. Its texture coordinates go
/// from (0, 0) in the upper left to (1, 1) in the lower right.
pub(super) fn square(material: Material, texture: Option<Texture>) -> Model {
    let corners = [vec2(-1.0, 1.0), vec2(-1.0, -1.0), vec2(1.0, -1.0), vec2(1.0, 1.0)];
    Model {
        vertices: corners
            .iter()
            .map(|corner| {
                vertex(corner.extend(0.0), vec2(0.5 + 0.5 * corner.x, 0.5 - 0.5 * corner.y))
            })
            .collect(),
        triangles: [[0, 1, 2], [0, 2, 3]]
            .iter()
            .map(|&corners| Triangle { corners, material: 0 })
            .collect(),
        materials: vec![Material { texture: texture.as_ref().map(|_| 0), ..material }],
        textures: texture.into_iter().collect(),
        ..Model::default()
    }
}

pub(super) fn texture(
    width: u32,
    height: u32,
    nearest: bool,
    texel: impl Fn(u32, u32) -> [u8; 4],
) -> Texture {
    Texture {
        image: RgbaImage::from_fn(width, height, |x, y| Rgba(texel(x, y))),
        wrap: [Wrap::Clamp; 2],
        nearest,
    }
}

/// Looks at the origin from +Z, 2 m away: a metre in the plane z = 0 is `scale` pixels.
pub(super) fn head_on(size: u32, scale: f32) -> Camera {
    let fov = 2.0 * (0.25 * size as f32 / scale).atan();
    camera_towards(Vec3::ZERO, Vec3::Z, 2.0, fov, size, size)
}

pub(super) fn positions(model: &Model) -> Vec<Vec3> {
    model.vertices.iter().map(|vertex| vertex.position).collect()
}

/// Numbers in [0, 1) that scatter.
pub(super) fn scattered(seed: u64) -> impl FnMut() -> f32 {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1_u64 << 24) as f32
    }
}

/// A ball around the origin by rings of longitude and latitude.
pub(super) fn ball(radius: f32, rings: u32) -> Model {
    use std::f32::consts::{PI, TAU};
    let around = 2 * rings;
    let mut points = Vec::new();
    for ring in 0..=rings {
        let (sin, cos) = (PI * ring as f32 / rings as f32).sin_cos();
        for step in 0..around {
            let (east, north) = (TAU * step as f32 / around as f32).sin_cos();
            points.push(radius * vec3(sin * north, cos, -sin * east));
        }
    }
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for step in 0..around {
            let next = (step + 1) % around;
            let [a, b] = [ring, ring + 1].map(|ring| ring * around + step);
            let [c, d] = [ring, ring + 1].map(|ring| ring * around + next);
            triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    mesh(&points, &triangles, Material::default())
}
