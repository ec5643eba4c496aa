//! Morph targets, then linear blend skinning.

use dermis_format::Avatar;

use crate::math::{Affine, transform};

/// What moves vertices.
#[derive(Clone, Copy)]
pub(crate) struct Moving<'m> {
    /// Of each bind, bind space → world.
    pub(crate) matrices: &'m [Affine],
    /// Of each morph target.
    pub(crate) weights: &'m [f32],
}

impl Moving<'_> {
    /// v' = Σ wᵢ Mᵢ (v + Σ wₜ dₜ) of those vertices that are needed; NaN of the others.
    pub(crate) fn skin(
        &self,
        avatar: &Avatar<'_>,
        needed: impl Fn(usize) -> bool,
        vertices: &mut [[f32; 3]],
    ) {
        for (index, vertex) in vertices.iter_mut().enumerate() {
            *vertex = if needed(index) { avatar.vertex_position(index) } else { [f32::NAN; 3] };
        }
        for (target, &weight) in avatar.morph_targets().zip(self.weights) {
            if weight == 0.0 {
                continue;
            }
            let factor = weight * target.step;
            for (moved, delta) in target.vertices.iter().zip(target.deltas) {
                if !needed(moved as usize) {
                    continue;
                }
                if let Some(vertex) = vertices.get_mut(moved as usize) {
                    for (x, code) in vertex.iter_mut().zip(delta) {
                        *x += factor * f32::from(code.get());
                    }
                }
            }
        }
        if self.matrices.is_empty() {
            return;
        }
        for (index, vertex) in vertices.iter_mut().enumerate() {
            if !needed(index) {
                continue;
            }
            let mut sum = [0.0; 3];
            for (bind, weight) in avatar.influences(index) {
                if let (1.., Some(matrix)) = (weight, self.matrices.get(bind as usize)) {
                    let weight = f32::from(weight) * (1.0 / 255.0);
                    let moved = transform(matrix, *vertex);
                    sum.iter_mut().zip(moved).for_each(|(sum, x)| *sum += weight * x);
                }
            }
            *vertex = sum;
        }
    }
}
