//! Vertices, triangles, skin and morph targets to bytes.

use crate::header::{Header, MAX_LAYERS};
use crate::quant::Linear;
use crate::record::{MorphRecord, Range, U32, VertexRecord};
use crate::section::tag;
use crate::source::{Mesh, Morph};

use super::{EncodeError, STEPS, bytes_of, extent, narrow, refuse, section, shortened};

/// How far from 1 the weights of a vertex may add up.
const WEIGHT_SUM_TOLERANCE: f32 = 1e-3;

/// Indices are narrowed when they are written, so a reader could not tell that one was too large.
pub(super) fn check_mesh(mesh: &Mesh, binds: usize) -> Result<(), EncodeError> {
    let exists = |vertex: &u32| (*vertex as usize) < mesh.positions.len();
    if !mesh.triangles.iter().flatten().all(exists) {
        return refuse("a triangle's corner does not exist");
    }
    if !mesh.morph_targets.iter().flat_map(|m| &m.deltas).all(|(vertex, _)| exists(vertex)) {
        return refuse("a morph target moves a vertex that does not exist");
    }
    for morph in &mesh.morph_targets {
        if !morph.deltas.is_sorted_by(|(a, _), (b, _)| a < b) {
            let name = &morph.name;
            return refuse(format!("morph target {name}: its vertices do not ascend, each once"));
        }
    }
    if mesh.influences.iter().flatten().any(|&(bind, _)| usize::from(bind) >= binds) {
        return refuse("a vertex hangs on a bind that does not exist");
    }
    for influences in &mesh.influences {
        let weights = influences.map(|(_, weight)| weight);
        if !weights.iter().all(|weight| weight.is_finite()) {
            return refuse("a skin weight is not finite");
        }
        if weights.iter().any(|&weight| weight < 0.0) {
            return refuse("a skin weight is negative");
        }
        let sum: f32 = weights.iter().sum();
        if !((sum - 1.0).abs() <= WEIGHT_SUM_TOLERANCE) {
            return refuse(format!("a vertex's skin weights add up to {sum}, not to 1"));
        }
    }
    let coarser: u64 = mesh.coarser.iter().map(|&triangles| u64::from(triangles)).sum();
    let leaves_some = mesh.coarser.is_empty() || coarser < mesh.triangles.len() as u64;
    if mesh.coarser.len() >= MAX_LAYERS || mesh.coarser.contains(&0) || !leaves_some {
        let meshes = &mesh.coarser;
        return refuse(format!(
            "coarser meshes of {meshes:?} triangles: leave some to the surface"
        ));
    }
    let Mesh { step, .. } = mesh;
    if !STEPS.contains(step) {
        return refuse(format!("the mesh: a step of {step} m; give 0 to 1e6"));
    }
    for Morph { name, step, .. } in &mesh.morph_targets {
        if !STEPS.contains(step) {
            return refuse(format!("morph target {name}: a step of {step} m; give 0 to 1e6"));
        }
    }
    if !mesh.two_sided.is_empty() && mesh.two_sided.len() != mesh.triangles.len() {
        return refuse("triangles and their two-sided bits differ in number");
    }
    Ok(())
}

pub(super) fn position_grid(mesh: &Mesh) -> Result<([f32; 3], [f32; 3]), EncodeError> {
    let mut min = [0.0; 3];
    let mut step = [0.0; 3];
    for axis in 0..3 {
        let values = mesh.positions.iter().map(|p| p[axis]);
        let Some((low, high)) = extent(values) else { continue };
        if !(low.is_finite() && high.is_finite()) {
            return refuse("a vertex is not finite");
        }
        min[axis] = low;
        step[axis] = mesh.step.max((high - low) / f32::from(u16::MAX));
    }
    Ok((min, step))
}

pub(super) fn write_mesh(
    out: &mut Vec<u8>,
    mesh: &Mesh,
    header: &Header,
) -> Result<(), EncodeError> {
    if mesh.triangles.is_empty() {
        return Ok(());
    }
    let grid = |axis: usize| Range {
        offset: header.position_min[axis].into(),
        step: header.position_step[axis].into(),
    };
    let vertices: Vec<VertexRecord> = mesh
        .positions
        .iter()
        .map(|p| VertexRecord {
            position: core::array::from_fn(|i| grid(i).code(p[i], u16::MAX).into()),
        })
        .collect();
    section(out, tag::VERTICES, bytes_of(&vertices))?;
    section(
        out,
        tag::TRIANGLES,
        &vertex_indices(mesh.triangles.iter().flatten().copied(), header.vertices),
    )?;
    if !mesh.influences.is_empty() {
        section(out, tag::SKIN, &skin_payload(mesh, header.binds))?;
    }
    if mesh.two_sided.contains(&true) {
        let mut bits = vec![0u8; mesh.triangles.len().div_ceil(8)];
        for (index, _) in mesh.two_sided.iter().enumerate().filter(|(_, side)| **side) {
            bits[index / 8] |= 1 << (index % 8);
        }
        section(out, tag::SIDES, &bits)?;
    }
    if !mesh.coarser.is_empty() {
        let triangles: Vec<U32> = mesh.coarser.iter().map(|&n| n.into()).collect();
        section(out, tag::MESH_LEVELS, bytes_of(&triangles))?;
    }
    if header.regions > 1 {
        section(out, tag::TRIANGLE_REGIONS, &mesh.triangle_regions)?;
    }
    Ok(())
}

fn vertex_indices(indices: impl Iterator<Item = u32>, vertices: u32) -> Vec<u8> {
    if vertices <= 1 << 16 {
        indices.flat_map(|i| (i as u16).to_le_bytes()).collect()
    } else {
        indices.flat_map(u32::to_le_bytes).collect()
    }
}

fn skin_payload(mesh: &Mesh, binds: u16) -> Vec<u8> {
    let codes: Vec<[u8; 4]> =
        mesh.influences.iter().map(|i| weight_codes(i.map(|(_, weight)| weight))).collect();
    // An influence that is not used is (0, 0).
    let indices = mesh.influences.iter().flatten().zip(codes.iter().flatten());
    let indices = indices.map(|(&(bind, _), &code)| if code == 0 { 0 } else { bind });
    let mut payload: Vec<u8> = if binds <= 1 << 8 {
        indices.map(|bind| bind as u8).collect()
    } else {
        indices.flat_map(u16::to_le_bytes).collect()
    };
    payload.extend(codes.iter().flatten());
    payload
}

/// Weights that add up to 1, in 1/255 that add up to 255: the greatest takes what rounding left over.
fn weight_codes(weights: [f32; 4]) -> [u8; 4] {
    let mut codes = weights.map(|weight| (weight * 255.0 + 0.5) as u8);
    let mut greatest = 0;
    for i in 1..4 {
        if weights[i] > weights[greatest] {
            greatest = i;
        }
    }
    let sum: i32 = codes.iter().map(|&code| i32::from(code)).sum();
    // The greatest is at least 63/255, more than rounding leaves over: this is in 0..=255.
    codes[greatest] = (i32::from(codes[greatest]) + 255 - sum) as u8;
    codes
}

pub(super) fn morph_payload(morph: &Morph, vertices: u32) -> Result<Vec<u8>, EncodeError> {
    let name = shortened(&morph.name, usize::from(u16::MAX));
    let greatest = extent(morph.deltas.iter().flat_map(|(_, d)| d.iter().map(|x| x.abs())))
        .map_or(0.0, |(_, high)| high);
    if !greatest.is_finite() {
        return refuse(format!("morph target {name}: a displacement is not finite"));
    }
    let step = morph.step.max(greatest / f32::from(i16::MAX));
    let codes =
        |delta: [f32; 3]| delta.map(|x| if step > 0.0 { (x / step).round() as i16 } else { 0 });
    let moved = morph.deltas.iter().map(|&(vertex, delta)| (vertex, codes(delta)));
    let moved: Vec<(u32, [i16; 3])> = moved.filter(|(_, codes)| *codes != [0; 3]).collect();
    let head = MorphRecord {
        step: step.into(),
        default_weight: morph.default_weight.into(),
        name_len: narrow::<u16>("bytes of a name", name.len())?.into(),
    };
    let mut payload = bytes_of(&[head]).to_vec();
    payload.extend(name.as_bytes());
    payload.extend(vertex_indices(moved.iter().map(|(vertex, _)| *vertex), vertices));
    for (_, codes) in moved {
        payload.extend(codes.into_iter().flat_map(i16::to_le_bytes));
    }
    Ok(payload)
}
