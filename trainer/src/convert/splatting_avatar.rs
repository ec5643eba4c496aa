//! SplattingAvatar: Gaussians over points of a mesh.
//!
//! Beside the PLY of 3D Gaussian Splatting lies `embedding.json`. It names the canonical mesh and says
//! for each Gaussian of which triangle and where in it (barycentric coordinates) its foot stands; the
//! third number of `_xyz` is its distance from there, metres, along the vertex normals mixed by the same
//! coordinates; `_rotation` is its rotation in the canonical pose. Position and rotation of the PLY are
//! those of the pose in which it was saved, and are not used; scales, colours and opacities are.
//!
//! In the canonical pose the avatar is the same. In other poses its authors mix the rotations of three
//! corners and leave the size of Gaussians as it is; here they follow their triangle, in Area frames: they
//! turn and grow with it, but are not sheared, which is nearer to what the authors do than an affine frame
//! (`notes/convert.md` has the figures).

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use dermis_format::FrameKind;
use glam::DVec3;
use serde::Deserialize;

use super::assembly::{Assembly, Carrier, Mount};
use super::bind::hang;
use super::splats::{LeftOut, Splat, Splats};
use crate::model::Model;
use crate::{import, output};

/// The file beside the PLY.
#[derive(Deserialize)]
struct Embedding {
    /// Path of the canonical mesh, from the file's folder.
    cano_mesh: PathBuf,
    /// Triangle of each Gaussian.
    sample_fidxs: Vec<u32>,
    /// Barycentric coordinates of its foot.
    sample_bary: Vec<[f64; 3]>,
    /// Nothing, nothing, distance from the foot, metres.
    #[serde(rename = "_xyz")]
    xyz: Vec<[f64; 3]>,
    /// Quaternion w, x, y, z in the canonical pose; without it the PLY's.
    #[serde(rename = "_rotation")]
    rotation: Option<Vec<[f64; 4]>>,
}

/// The frames in which its Gaussians stand.
const FRAME: FrameKind = FrameKind::Area;

/// Where the embedding of a PLY lies.
pub(super) fn embedding(ply: &Path) -> PathBuf {
    ply.with_file_name("embedding.json")
}

/// Reads a PLY and its embedding. `moving` has the canonical mesh's triangles in the same order, and
/// moves them; without it the canonical mesh stands still.
pub(super) fn read(path: &Path, moving: Option<Carrier>) -> Result<(Assembly, LeftOut)> {
    let json = embedding(path);
    let name = || json.display().to_string();
    let embedding = parse(&output::read(&json)?).with_context(name)?;
    let mesh = json.with_file_name(&embedding.cano_mesh);
    let model = import::load(&mesh).with_context(name)?;
    let canonical = Carrier::of(&model, mesh.display().to_string())?;
    embedding.check(model.triangles.len()).with_context(name)?;
    let place = || path.display().to_string();
    let (mut splats, triangles, left_out) =
        standing(path, &embedding, &model).with_context(place)?;
    let triangles = hang(&mut splats, &canonical, FRAME, &triangles)?;
    let carrier = moving.unwrap_or_else(|| canonical.clone());
    let (given, own) = (carrier.triangles(), canonical.triangles());
    ensure!(
        given == own,
        "{}: has {given} triangles, {} has {own}; give a mesh with the same ones in the same order",
        carrier.name,
        canonical.name
    );
    let mount = Mount { carrier, frame: FRAME, triangles };
    Ok((Assembly { splats, mount: Some(mount), levels: None }, left_out))
}

fn parse(bytes: &[u8]) -> Result<Embedding> {
    serde_json::from_slice(bytes).context("is no embedding of SplattingAvatar; export it again")
}

impl Embedding {
    /// Whether its parts fit each other and a mesh of this many triangles.
    fn check(&self, triangles: usize) -> Result<()> {
        let count = self.sample_fidxs.len();
        let lengths = [
            ("sample_bary", self.sample_bary.len()),
            ("_xyz", self.xyz.len()),
            ("_rotation", self.rotation.as_ref().map_or(count, Vec::len)),
        ];
        for (part, len) in lengths {
            ensure!(
                len == count,
                "its {part} has {len} entries, its sample_fidxs {count}; export it again"
            );
        }
        for (index, &triangle) in self.sample_fidxs.iter().enumerate() {
            ensure!(
                (triangle as usize) < triangles,
                "its sample_fidxs {index} is {triangle}, but {} has the triangles 0 to {}; give the \
                 mesh that it was trained on",
                self.cano_mesh.display(),
                triangles - 1
            );
        }
        Ok(())
    }
}

/// The PLY's Gaussians in the canonical pose, world axes, metres, and their triangles.
fn standing(
    path: &Path,
    embedding: &Embedding,
    model: &Model,
) -> Result<(Splats, Vec<u32>, LeftOut)> {
    let ply = super::open(path)?;
    let (count, expected) = (ply.count(), embedding.sample_fidxs.len());
    ensure!(
        count == expected,
        "has {count} Gaussians, its embedding.json {expected}; export both again, or take it as it \
         stands with --from ply"
    );
    let normals = vertex_normals(model);
    let mut splats = ply.splats();
    let (mut left_out, mut triangles) = (LeftOut::default(), Vec::new());
    ply.for_each(|row, splat, _| {
        let triangle = embedding.sample_fidxs[row];
        let corners = model.triangles[triangle as usize].corners;
        let mixed = |of_vertex: &dyn Fn(u32) -> DVec3| -> DVec3 {
            let weighted = corners.iter().zip(embedding.sample_bary[row]);
            weighted.map(|(&vertex, weight)| weight * of_vertex(vertex)).sum()
        };
        let foot = mixed(&|vertex| model.vertices[vertex as usize].position.as_dvec3());
        let normal = mixed(&|vertex| normals[vertex as usize]).normalize_or_zero();
        let [_, _, distance] = embedding.xyz[row];
        let rotation = embedding.rotation.as_ref().map_or(splat.rotation, |all| all[row]);
        let position = (foot + distance * normal).to_array();
        if splats.push(&Splat { position, rotation, ..*splat }, &mut left_out) {
            triangles.push(triangle);
        }
        Ok(())
    })?;
    splats.ensure_any(&left_out)?;
    splats.lower_degree();
    Ok((splats, triangles, left_out))
}

/// Unit normals of vertices: of the triangles around each, by area; zero where there is none.
fn vertex_normals(model: &Model) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; model.vertices.len()];
    for triangle in &model.triangles {
        let [a, b, c] =
            triangle.corners.map(|vertex| model.vertices[vertex as usize].position.as_dvec3());
        let normal = (b - a).cross(c - a);
        triangle.corners.iter().for_each(|&vertex| normals[vertex as usize] += normal);
    }
    normals.into_iter().map(DVec3::normalize_or_zero).collect()
}
