//! Importers: from a file of another program to a [`Model`].
//!
//! A tour:
//!
//! 1. [`load`] reads the bytes and picks an importer by content first, then by extension.
//! 2. `gltf` reads glTF 2.0, as JSON or GLB: `document` opens containers, buffers and compressed
//!    views; `accessor` reads numbers from them, bounds checked; `mesh` turns primitives into
//!    vertices, triangles and morph targets; `material` and `texture` say what they are painted
//!    with; `nodes` holds the node tree; `skin` folds all skins, rigid parts and static parts
//!    into one list of joints and binds; `animation` reads clips.
//! 3. `obj` reads Wavefront OBJ with its MTL library.
//! 4. [`load`] leaves out vertices on which no triangle stands, and checks what all importers promise:
//!    at least one triangle, not all of them degenerate, nothing that is not finite.
//!
//! Files are hostile until proven otherwise: every index and range is checked where it is used,
//! and what a file claims costs memory only in proportion to the bytes it really has (or up to
//! the limits in this module). Errors are one line when printed with `{:#}`: the file, what is
//! wrong, and what to do.

mod gltf;
pub(crate) mod image_file;
mod obj;

use crate::model::Model;
use crate::output::read_unnamed;
use anyhow::{Context, Result, bail, ensure};
use std::path::Path;

/// Greatest number of vertices of a model. An avatar has some ten thousands; this stops files
/// that repeat a mesh, or claim one, beyond reason (4 M × 68 bytes = 285 MB).
const MAX_VERTICES: usize = 1 << 22;

/// Greatest number of triangles of a model, twice [`MAX_VERTICES`] as on a closed surface.
const MAX_TRIANGLES: usize = 2 * MAX_VERTICES;

/// Greatest number of displacements of all morph targets, and of numbers in all key frames.
const MAX_NUMBERS: usize = 1 << 26;

/// Greatest number of texels of all textures: 4 of 4096 × 4096, or 1 GB with their smaller copies.
const MAX_TEXELS: usize = 1 << 26;

/// Reads a GLB, glTF or OBJ file with all that it refers to.
///
/// # Errors
///
/// Where the file, or one that it refers to, is missing, malformed, or needs what Dermis does not
/// read. Print the error with `{:#}` for one line that begins with the file's name.
pub fn load(path: &Path) -> Result<Model> {
    read(path).with_context(|| path.display().to_string())
}

fn read(path: &Path) -> Result<Model> {
    let bytes = read_unnamed(path)?;
    let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
    let mut model = if bytes.starts_with(gltf::GLB_MAGIC) || starts_like_json(&bytes) {
        gltf::import(&bytes, path)?
    } else if extension == "obj" {
        obj::import(&bytes, path)?
    } else if extension == "glb" || extension == "gltf" {
        bail!("is neither a GLB nor glTF JSON, or is cut short; export it again");
    } else {
        bail!("is of no kind that Dermis reads; use GLB, glTF or OBJ");
    };
    model.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    keep_used_vertices(&mut model);
    check(&model)?;
    Ok(model)
}

/// Leaves out vertices on which no triangle stands: they would count where a mesh's size is measured.
fn keep_used_vertices(model: &mut Model) {
    let mut used = vec![false; model.vertices.len()];
    for corner in model.triangles.iter().flat_map(|triangle| triangle.corners) {
        used[corner as usize] = true;
    }
    if used.iter().all(|&used| used) {
        return;
    }
    let mut count = 0;
    let places: Vec<Option<u32>> = used
        .iter()
        .map(|&used| {
            count += u32::from(used);
            used.then(|| count - 1)
        })
        .collect();
    let mut used = used.iter();
    model.vertices.retain(|_| used.next().is_some_and(|&used| used));
    for corner in model.triangles.iter_mut().flat_map(|triangle| &mut triangle.corners) {
        *corner = places[*corner as usize].unwrap_or(0);
    }
    for target in &mut model.morph_targets {
        let kept = target.deltas.iter();
        let kept = kept.filter_map(|&(vertex, delta)| Some((places[vertex as usize]?, delta)));
        target.deltas = kept.collect();
    }
}

fn starts_like_json(bytes: &[u8]) -> bool {
    let bytes = bytes.strip_prefix(gltf::BYTE_ORDER_MARK).unwrap_or(bytes);
    bytes.trim_ascii_start().starts_with(b"{")
}

/// What every importer promises, checked where all of them pass.
fn check(model: &Model) -> Result<()> {
    ensure!(!model.triangles.is_empty(), "has no triangles; export a triangle mesh");
    if let Some(index) = model.vertices.iter().position(|v| !v.position.is_finite()) {
        bail!("vertex {index} is not finite; repair the mesh and export it again");
    }
    let has_area = |corners: [u32; 3]| {
        let [a, b, c] = corners.map(|i| model.vertices[i as usize].position.as_dvec3());
        (b - a).cross(c - a).length_squared() > 0.0
    };
    ensure!(
        model.triangles.iter().any(|t| has_area(t.corners)),
        "has no triangle with an area; export a triangle mesh"
    );
    Ok(())
}

/// Adds `more` to a running total, unless it passes a limit of this module.
fn add_within(total: &mut usize, more: usize, limit: usize, what: &str) -> Result<()> {
    *total = total.saturating_add(more);
    check_within(*total, limit, what)
}

/// Refuses a total beyond a limit of this module.
fn check_within(total: usize, limit: usize, what: &str) -> Result<()> {
    ensure!(total <= limit, "has more than {limit} {what}; simplify it first");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{MorphTarget, Triangle, Vertex};
    use glam::{Vec2, Vec3, Vec4};

    #[test]
    fn vertices_without_triangles_are_left_out() {
        let vertex = |x: f32| Vertex {
            position: Vec3::splat(x),
            uv: Vec2::ZERO,
            color: Vec4::ONE,
            influences: Default::default(),
        };
        let triangle = |corners| Triangle { corners, material: 0 };
        let mut model = Model {
            vertices: [9.0, 0.0, 1.0, 8.0, 2.0, 7.0].map(vertex).to_vec(),
            triangles: vec![triangle([1, 2, 4]), triangle([4, 2, 1])],
            morph_targets: vec![MorphTarget {
                deltas: [0, 2, 3, 4].map(|index| (index, Vec3::splat(index as f32))).to_vec(),
                ..MorphTarget::default()
            }],
            ..Model::default()
        };
        keep_used_vertices(&mut model);
        let positions: Vec<f32> = model.vertices.iter().map(|v| v.position.x).collect();
        assert_eq!(positions, [0.0, 1.0, 2.0]);
        assert_eq!(
            model.triangles.iter().map(|t| t.corners).collect::<Vec<_>>(),
            [[0, 1, 2], [2, 1, 0]]
        );
        assert_eq!(model.morph_targets[0].deltas, [(1, Vec3::splat(2.0)), (2, Vec3::splat(4.0))]);
    }
}
