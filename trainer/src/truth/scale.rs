//! Levels of an image pyramid: each side of a picture divided by 2^shift, rounded up.
//!
//! A coarse pixel covers 2^shift × 2^shift fine ones. At the right and lower edge it may reach
//! beyond the fine picture, and is then the average of what there is.

use dermis_runtime::Camera;

use crate::metrics::Rect;

/// Greatest shift: the sum of 2^24 bytes still fits into 32 bits.
pub const MAX_SHIFT: u32 = 12;

/// The camera of a picture whose sides are divided by 2^`shift` (0..=[`MAX_SHIFT`]): the same
/// rays in coarser pixels.
pub fn scaled(camera: &Camera, shift: u32) -> Camera {
    // A power of two: exact.
    let factor = 1.0 / (1_u32 << shift) as f32;
    Camera {
        width: scaled_length(camera.width, shift),
        height: scaled_length(camera.height, shift),
        fx: camera.fx * factor,
        fy: camera.fy * factor,
        cx: camera.cx * factor,
        cy: camera.cy * factor,
        world_to_camera: camera.world_to_camera,
    }
}

/// Coarse pixels that cover `pixels` fine ones.
pub const fn scaled_length(pixels: u32, shift: u32) -> u32 {
    pixels.div_ceil(1 << shift)
}

/// The coarse pixels that cover any of `rect`; without pixels if it has none.
pub const fn scaled_rect(rect: Rect, shift: u32) -> Rect {
    if rect.pixels() == 0 {
        return Rect { x: rect.x >> shift, y: rect.y >> shift, width: 0, height: 0 };
    }
    let (x, y) = (rect.x >> shift, rect.y >> shift);
    let (right, bottom) = (rect.x + rect.width, rect.y + rect.height);
    let width = scaled_length(right, shift) - x;
    let height = scaled_length(bottom, shift) - y;
    Rect { x, y, width, height }
}
