//! Pictures of avatars as floats.

use dermis_runtime::{Avatar, Camera, Kernel, Level, Plan, Pose};
use dermis_trainer::draw::draw_unrounded;

/// Every kernel of this machine, and the one that vectors fall back to where there are none.
pub fn kernels() -> impl Iterator<Item = Kernel> {
    Kernel::available().into_iter().chain([Kernel::Simd(Level::fallback())])
}

/// The runtime's picture before it is rounded to bytes: (r, g, b) of each pixel over `background`.
pub fn unrounded(
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    plan: &Plan,
    camera: &Camera,
    background: [f32; 3],
) -> Vec<[f32; 3]> {
    let kernel = Kernel::detect();
    draw_unrounded(avatar, pose, plan, kernel, camera, background).expect("it can be drawn")
}

/// Nearest bytes, as the runtime rounds.
pub fn bytes(picture: &[[f32; 3]]) -> Vec<u8> {
    picture.iter().flat_map(|rgb| rgb.map(dermis_runtime::framebuffer::to_byte)).collect()
}

/// The greatest difference of two pictures' bytes.
pub fn worst(a: &[u8], b: &[u8]) -> u8 {
    assert_eq!(a.len(), b.len(), "two pictures of one size");
    a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0)
}
