//! Pictures of avatars as floats.

use dermis_runtime::tiles::TileGrid;
use dermis_runtime::{Avatar, Camera, Kernel, Level, Plan, Pose, Posed, Prepared, raster};

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
    let (width, height, budget) = (camera.width, camera.height, plan.gaussians());
    let mut posing = vec![0; Posed::scratch_len(avatar)];
    let mut preparing = vec![0; Prepared::scratch_len(avatar, budget, width, height)];
    let mut drawing = vec![0; Prepared::band_scratch_len(budget, width, height)];
    let posed =
        Posed::new(avatar, pose, Kernel::detect(), &mut posing).expect("scratch is long enough");
    let prepared = Prepared::new(&posed, plan, camera, &mut preparing).expect("as above");
    let grid = TileGrid::new(width, height);
    let mut picture = vec![[0.0; 3]; width as usize * height as usize];
    let drawn = prepared.for_each_tile(0..grid.rows, &mut drawing, |tile, _, pixels| {
        let [columns, rows] = grid.pixels(tile);
        for (y, row) in rows.zip(&pixels.0) {
            for (column, x) in columns.clone().enumerate() {
                let [r, g, b, t] = raster::pixel(row, column);
                let color = [0, 1, 2].map(|i| [r, g, b][i] + t * background[i]);
                picture[(y * width + x) as usize] = color;
            }
        }
    });
    drawn.expect("scratch is long enough");
    picture
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
