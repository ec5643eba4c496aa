//! Which triangles must be drawn when they face away.
//!
//! glTF's `doubleSided` says little (exporters set it always), so what counts is what the training
//! views see. A triangle is two-sided if they see enough of its back. A connected piece of the
//! mesh that shows enough of its backs is open (hair, a skirt): other poses will show others of
//! its backs, so all of it is two-sided.

use std::collections::HashMap;

use crate::model::Model;
use crate::scene::SideCount;

/// Least share of backs among the visible sub-samples of a triangle, or of a piece.
const BACK_SHARE: f64 = 0.005;

/// Whether each triangle is two-sided, from what the training views saw of it.
pub fn two_sided(model: &Model, seen: &[SideCount]) -> Vec<bool> {
    let pieces = pieces(model);
    let mut of_piece: HashMap<u32, SideCount> = HashMap::new();
    for (piece, count) in pieces.iter().zip(seen) {
        *of_piece.entry(*piece).or_default() += *count;
    }
    pieces
        .iter()
        .zip(seen)
        .map(|(piece, count)| shows_back(count) || shows_back(&of_piece[piece]))
        .collect()
}

fn shows_back(count: &SideCount) -> bool {
    let (front, back) = (f64::from(count.front), f64::from(count.back));
    back > BACK_SHARE * (front + back)
}

/// For each triangle a number that is the same within a connected piece. Vertices at the same
/// place are one: seams of texture do not cut a surface.
fn pieces(model: &Model) -> Vec<u32> {
    let mut places: HashMap<[u32; 3], u32> = HashMap::new();
    let mut parents: Vec<u32> = (0..model.vertices.len() as u32).collect();
    for (index, vertex) in model.vertices.iter().enumerate() {
        let place = vertex.position.to_array().map(f32::to_bits);
        let first = *places.entry(place).or_insert(index as u32);
        join(&mut parents, first, index as u32);
    }
    for triangle in &model.triangles {
        let [a, b, c] = triangle.corners;
        join(&mut parents, a, b);
        join(&mut parents, b, c);
    }
    model.triangles.iter().map(|triangle| root(&mut parents, triangle.corners[0])).collect()
}

fn root(parents: &mut [u32], mut at: u32) -> u32 {
    while parents[at as usize] != at {
        let grandparent = parents[parents[at as usize] as usize];
        parents[at as usize] = grandparent;
        at = grandparent;
    }
    at
}

fn join(parents: &mut [u32], a: u32, b: u32) {
    let (a, b) = (root(parents, a), root(parents, b));
    parents[a.max(b) as usize] = a.min(b);
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3, Vec4};

    use super::*;
    use crate::model::{Triangle, Vertex};

    fn model(triangles: &[[Vec3; 3]]) -> Model {
        let vertex = |position| Vertex {
            position,
            uv: Vec2::ZERO,
            color: Vec4::ONE,
            influences: [(0, 0.0); 4],
        };
        let corners = |i: usize| [0, 1, 2].map(|k| (3 * i + k) as u32);
        Model {
            vertices: triangles.iter().flatten().map(|&p| vertex(p)).collect(),
            triangles: (0..triangles.len())
                .map(|i| Triangle { corners: corners(i), material: 0 })
                .collect(),
            ..Model::default()
        }
    }

    #[test]
    fn an_open_piece_is_two_sided_as_a_whole_and_others_are_not() {
        let [o, x, y, z] = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let far = Vec3::splat(9.0);
        // The first two share an edge by position only.
        let model = model(&[[o, x, y], [x, o, z], [far, far + x, far + y]]);
        let seen = |front, back| SideCount { front, back };
        let counts = [seen(10, 10), seen(50, 0), seen(1000, 1)];
        assert_eq!(two_sided(&model, &counts), [true, true, false]);
    }
}
