//! glTF 2.0, as JSON with outside or embedded buffers, or as GLB.

mod accessor;
mod animation;
mod document;
mod material;
mod mesh;
mod meshopt;
mod nodes;
mod skin;
mod texture;

use crate::model::{Model, MorphTarget};
use anyhow::{Context, Result, bail};
use document::{Document, item};
use material::Materials;
use nodes::Nodes;
use skin::Skeleton;
use std::path::Path;

pub(super) use document::{BYTE_ORDER_MARK, GLB_MAGIC};

/// Morph targets that one mesh node owns, as a range of [`Model::morph_targets`].
struct MorphRange {
    node: usize,
    first: usize,
    count: usize,
}

/// Reads a file's bytes; `path` is where outside buffers and images are looked for.
pub(super) fn import(bytes: &[u8], path: &Path) -> Result<Model> {
    let document = Document::open(bytes, path)?;
    let nodes = Nodes::read(&document)?;
    let mut materials = Materials::default();
    let mut skeleton = Skeleton::new(&document, &nodes);
    let mut model = Model::default();
    let mut ranges = Vec::new();
    let mut totals = mesh::Totals::default();
    for node in nodes.in_scene() {
        let Some(mesh) = document.root.nodes[node].mesh.map(|mesh| mesh.value()) else { continue };
        let first = model.morph_targets.len();
        let count = add_morph_targets(&document, &nodes, node, mesh, &mut model)?;
        ranges.push(MorphRange { node, first, count });
        for mut part in mesh::read(&document, mesh, &mut materials, &mut totals)? {
            skeleton.attach(node, &mut part).with_context(|| format!("mesh {mesh}"))?;
            append(part, first, &mut model);
        }
    }
    let joint_of_node = skeleton.finish(&mut model)?;
    model.clips = animation::read(&document, &joint_of_node, &ranges)?;
    (model.materials, model.textures) = materials.finish();
    Ok(model)
}

/// Adds the targets of a mesh on a node, yet without displacements, and says how many.
fn add_morph_targets(
    document: &Document,
    nodes: &Nodes,
    node: usize,
    mesh: usize,
    model: &mut Model,
) -> Result<usize> {
    let json = item(&document.root.meshes, mesh, "mesh")?;
    let targets = json.primitives.iter().filter_map(|p| p.targets.as_ref());
    let count = targets.map(Vec::len).max().unwrap_or(0);
    if model.morph_targets.len() + count > usize::from(u16::MAX) {
        bail!("has more than {} morph targets; export fewer", u16::MAX);
    }
    let names = mesh::target_names(json);
    let defaults = document.root.nodes[node].weights.as_ref().or(json.weights.as_ref());
    for index in 0..count {
        let name = names.get(index).cloned();
        let weight = defaults.and_then(|weights| weights.get(index)).copied().unwrap_or(0.0);
        model.morph_targets.push(MorphTarget {
            name: name.unwrap_or_else(|| format!("{}.{index}", nodes.name(node))),
            deltas: Vec::new(),
            default_weight: if weight.is_finite() { weight } else { 0.0 },
        });
    }
    Ok(count)
}

/// Adds a part whose vertices are already in bind space, its morph targets from `first` on.
fn append(part: mesh::Part, first: usize, model: &mut Model) {
    let base = model.vertices.len() as u32;
    model.vertices.extend(part.vertices);
    model.triangles.extend(part.triangles.into_iter().map(|mut triangle| {
        triangle.corners = triangle.corners.map(|corner| corner + base);
        triangle
    }));
    for (target, moved) in part.targets.into_iter().enumerate() {
        let moved = moved.into_iter().map(|(vertex, delta)| (vertex + base, delta));
        model.morph_targets[first + target].deltas.extend(moved);
    }
}
