//! Primitives: vertices, triangles and morph targets, still in the space of their mesh.

use super::super::{MAX_NUMBERS, MAX_TRIANGLES, MAX_VERTICES, add_within};
use super::accessor::Accessor;
use super::document::{Document, item};
use super::material::{Materials, UvMap};
use crate::model::{Triangle, Vertex};
use anyhow::{Context, Result, bail, ensure};
use glam::{Vec2, Vec3, Vec4};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use serde::Deserialize;

/// Vertices with the triangles that share them: a primitive, or several over the same vertices.
pub(super) struct Part {
    pub(super) vertices: Vec<Vertex>,
    pub(super) triangles: Vec<Triangle>,
    /// Whether the influences of `vertices` name joints of a skin; else they are all 0.
    pub(super) skinned: bool,
    /// Displacements of each morph target, vertices ascending, none zero.
    pub(super) targets: Vec<Vec<(u32, Vec3)>>,
}

/// What all parts of a file add up to, to be held against the importers' limits.
#[derive(Default)]
pub(super) struct Totals {
    vertices: usize,
    triangles: usize,
    displacements: usize,
}

/// Reads all primitives of a mesh that have triangles.
pub(super) fn read(
    document: &Document,
    mesh: usize,
    materials: &mut Materials,
    totals: &mut Totals,
) -> Result<Vec<Part>> {
    let json = item(&document.root.meshes, mesh, "mesh")?;
    let mut parts: Vec<(Key, Part)> = Vec::new();
    for (index, primitive) in json.primitives.iter().enumerate() {
        read_primitive(document, primitive, materials, totals, &mut parts)
            .with_context(|| format!("mesh {mesh}, primitive {index}"))?;
    }
    Ok(parts.into_iter().map(|(_, part)| part).collect())
}

/// Names of the morph targets, where the mesh's extras have them.
pub(super) fn target_names(mesh: &gltf::json::Mesh) -> Vec<String> {
    #[derive(Default, Deserialize)]
    #[serde(default, rename_all = "camelCase")]
    struct Extras {
        target_names: Vec<String>,
    }
    let json = mesh.extras.as_ref().map_or("{}", |extras| extras.get());
    serde_json::from_str::<Extras>(json).unwrap_or_default().target_names
}

/// What two primitives have in common if their vertices are the same.
#[derive(PartialEq)]
struct Key {
    attributes: Vec<(String, usize)>,
    targets: Vec<Option<usize>>,
    uv_map: UvMap,
}

impl Key {
    fn of(primitive: &Primitive, uv_map: UvMap) -> Self {
        let attributes = primitive.attributes.iter();
        let targets = primitive.targets.iter().flatten();
        Self {
            attributes: attributes.map(|(name, index)| (name.to_string(), index.value())).collect(),
            targets: targets.map(|target| target.positions.map(|index| index.value())).collect(),
            uv_map,
        }
    }
}

fn read_primitive(
    document: &Document,
    primitive: &Primitive,
    materials: &mut Materials,
    totals: &mut Totals,
    parts: &mut Vec<(Key, Part)>,
) -> Result<()> {
    use Mode::{TriangleFan, TriangleStrip, Triangles};
    let Checked::Valid(mode @ (Triangles | TriangleStrip | TriangleFan)) = primitive.mode else {
        return Ok(());
    };
    if attribute(primitive, Semantic::Positions).is_none() {
        return Ok(());
    }
    let (material, uv_map) =
        materials.get(document, primitive.material.map(|material| material.value()))?;
    let key = Key::of(primitive, uv_map);
    let part = match parts.iter().position(|(other, _)| *other == key) {
        Some(known) => &mut parts[known].1,
        None => {
            let part = read_vertices(document, primitive, uv_map, totals)?;
            parts.push((key, part));
            &mut parts.last_mut().expect("just pushed").1
        }
    };
    let corners = match primitive.indices {
        Some(indices) => read_indices(document, indices.value(), part.vertices.len())?,
        None => (0..part.vertices.len() as u32).collect(),
    };
    let triangles = assemble(mode, &corners);
    add_within(&mut totals.triangles, triangles.len(), MAX_TRIANGLES, "triangles")?;
    part.triangles.extend(triangles.into_iter().map(|corners| Triangle { corners, material }));
    Ok(())
}

fn attribute(primitive: &Primitive, semantic: Semantic) -> Option<usize> {
    primitive.attributes.get(&Checked::Valid(semantic)).map(|index| index.value())
}

fn read_indices(document: &Document, index: usize, vertices: usize) -> Result<Vec<u32>> {
    let indices = Accessor::open(document, index, &[1])?.integers::<1>()?;
    let indices: Vec<u32> = indices.into_iter().map(|[index]| index).collect();
    if let Some(wrong) = indices.iter().find(|&&index| index as usize >= vertices) {
        bail!("has index {wrong}, but only {vertices} vertices; export it again");
    }
    Ok(indices)
}

/// glTF 3.7.2.1. Triangles that join strips have no area by intent and are left out.
fn assemble(mode: Mode, corners: &[u32]) -> Vec<[u32; 3]> {
    let distinct = |[a, b, c]: &[u32; 3]| a != b && b != c && c != a;
    match mode {
        Mode::TriangleStrip => corners
            .windows(3)
            .enumerate()
            .map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] })
            .filter(distinct)
            .collect(),
        Mode::TriangleFan => {
            let hub = corners.first().copied().unwrap_or(0);
            let rim = corners.get(1..).unwrap_or_default();
            rim.windows(2).map(|w| [w[0], w[1], hub]).filter(distinct).collect()
        }
        _ => corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
    }
}

fn read_vertices(
    document: &Document,
    primitive: &Primitive,
    uv_map: UvMap,
    totals: &mut Totals,
) -> Result<Part> {
    let open = |semantic: Semantic, widths: &[usize]| -> Result<Option<Accessor>> {
        let name = semantic.to_string();
        let Some(index) = attribute(primitive, semantic) else { return Ok(None) };
        Accessor::open(document, index, widths).map(Some).context(name)
    };
    let positions = open(Semantic::Positions, &[3])?.context("has no positions")?;
    let count = positions.count();
    add_within(&mut totals.vertices, count, MAX_VERTICES, "vertices")?;
    let same_count = |accessor: &Accessor, what: &str| -> Result<()> {
        let other = accessor.count();
        ensure!(other == count, "has {count} positions but {other} {what}; export it again");
        Ok(())
    };
    let mut vertices: Vec<Vertex> = positions.floats::<3>(0.0).into_iter().map(vertex_at).collect();
    if let Some(index) = vertices.iter().position(|vertex| !vertex.position.is_finite()) {
        bail!("vertex {index} is not finite; repair the mesh and export it again");
    }
    if let Some(uvs) = open(Semantic::TexCoords(uv_map.set), &[2])? {
        same_count(&uvs, "texture coordinates")?;
        for (vertex, uv) in vertices.iter_mut().zip(uvs.floats::<2>(0.0)) {
            vertex.uv = uv_map.apply(uv.into());
        }
    }
    if let Some(colors) = open(Semantic::Colors(0), &[3, 4])? {
        same_count(&colors, "colours")?;
        for (vertex, color) in vertices.iter_mut().zip(colors.floats::<4>(1.0)) {
            let color = Vec4::from(color);
            vertex.color = if color.is_finite() { color } else { Vec4::ONE };
        }
    }
    let mut sets = Vec::new();
    while let Some(joints) = open(Semantic::Joints(sets.len() as u32), &[4])? {
        let Some(weights) = open(Semantic::Weights(sets.len() as u32), &[4])? else { break };
        same_count(&joints, "joint indices")?;
        same_count(&weights, "joint weights")?;
        sets.push((joints.integers::<4>()?, weights.floats::<4>(0.0)));
    }
    for (index, vertex) in vertices.iter_mut().enumerate().filter(|_| !sets.is_empty()) {
        let all =
            sets.iter().flat_map(|(joints, weights)| joints[index].into_iter().zip(weights[index]));
        vertex.influences = strongest(all.collect())
            .with_context(|| format!("vertex {index} has a joint weight that is not finite"))?;
    }
    let targets = read_targets(document, primitive, count, totals)?;
    Ok(Part { vertices, triangles: Vec::new(), skinned: !sets.is_empty(), targets })
}

fn vertex_at(position: [f32; 3]) -> Vertex {
    Vertex {
        position: position.into(),
        uv: Vec2::ZERO,
        color: Vec4::ONE,
        influences: [(0, 0.0); 4],
    }
}

/// The four greatest weights, made to add up to 1. A vertex without weights follows the first
/// joint that it names.
fn strongest(mut all: Vec<(u32, f32)>) -> Option<[(u16, f32); 4]> {
    let first = all.first()?.0;
    if all.iter().any(|(_, weight)| !weight.is_finite()) {
        return None;
    }
    all.retain(|&(_, weight)| weight > 0.0);
    // Stable, so that equal weights stay in the file's order.
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    all.truncate(4);
    if all.is_empty() {
        all.push((first, 1.0));
    }
    let sum: f64 = all.iter().map(|&(_, weight)| f64::from(weight)).sum();
    let mut influences = [(0, 0.0); 4];
    for (slot, (joint, weight)) in influences.iter_mut().zip(all) {
        // Beyond u16 is beyond every skin, which is found out there.
        *slot = (u16::try_from(joint).unwrap_or(u16::MAX), (f64::from(weight) / sum) as f32);
    }
    Some(influences)
}

fn read_targets(
    document: &Document,
    primitive: &Primitive,
    vertices: usize,
    totals: &mut Totals,
) -> Result<Vec<Vec<(u32, Vec3)>>> {
    let read = |target: &gltf::json::mesh::MorphTarget| -> Result<Vec<(u32, Vec3)>> {
        let Some(positions) = target.positions else { return Ok(Vec::new()) };
        let positions = Accessor::open(document, positions.value(), &[3])?;
        let count = positions.count();
        ensure!(
            count == vertices,
            "has {count} displacements for {vertices} vertices; export it again"
        );
        // Each element that is looked at counts, so that a small file cannot cost hours.
        let dense = if positions.is_dense() { count } else { 0 };
        add_within(&mut totals.displacements, dense, MAX_NUMBERS, "morph displacements")?;
        let moved = positions.nonzero::<3>();
        add_within(&mut totals.displacements, moved.len(), MAX_NUMBERS, "morph displacements")?;
        let moved: Vec<_> = moved.into_iter().map(|(i, delta)| (i, Vec3::from(delta))).collect();
        ensure!(moved.iter().all(|(_, delta)| delta.is_finite()), "is not finite; export it again");
        Ok(moved)
    };
    let targets = primitive.targets.iter().flatten().map(read).enumerate();
    targets.map(|(index, target)| target.with_context(|| format!("morph target {index}"))).collect()
}
