//! `.splat`: 32 bytes for each Gaussian. The layout stands in [`convert::splat`](crate::convert).

use super::Packed;
use crate::convert::Splats;

/// Packs Gaussians into `.splat`, without their harmonics: centre and scales as they are, colours and opacity within
/// 1/510, quaternions within 1/256 before they get length 1 again.
pub fn splat(splats: &Splats) -> Packed {
    let mut bytes = Vec::with_capacity(32 * splats.gaussians.len());
    let mut clamped = 0;
    for g in &splats.gaussians {
        let share = |x: f32| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
        let numbers = g.position.into_iter().chain(g.log2_scale.map(libm::exp2f));
        bytes.extend(numbers.flat_map(f32::to_le_bytes));
        bytes.extend(g.color.map(share));
        bytes.push(share(g.opacity));
        // q and −q are one rotation, and codes reach −1 but not 1: the greatest component is negative.
        let greatest = g.rotation.into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs()));
        let sign = if greatest.is_some_and(|q| q > 0.0) { -1.0 } else { 1.0 };
        // A cast to u8 saturates.
        bytes.extend(g.rotation.map(|q| (128.0 * sign * q + 128.0).round() as u8));
        clamped += usize::from(g.color.iter().any(|c| !(0.0..=1.0).contains(c)));
    }
    Packed { bytes, clamped }
}
