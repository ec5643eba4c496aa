//! A converted file's pictures against those of the Gaussians that went into it.

use dermis_runtime::{Avatar, Camera, Plan, Pose};
use dermis_trainer::draw::{draw, rgb_of};
use dermis_trainer::metrics::psnr::psnr_db;
use dermis_trainer::orbit::Orbit;

use crate::small::WHITE;
use crate::splats::SplatPly;

/// All of a file's Gaussians.
pub const ALL: u32 = u32::MAX;

/// The picture of a whole PLY in f64 over white, RGB8.
pub fn exact(ply: &SplatPly, camera: &Camera) -> Vec<u8> {
    let byte = |x: f64| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
    ply.draw(camera, WHITE).iter().flat_map(|rgb| rgb.map(byte)).collect()
}

/// What a plan draws of a file, against a picture over white: dB over the pixels that either touches.
///
/// # Panics
///
/// Where it cannot be drawn, or there is nothing to be seen.
pub fn psnr(
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    plan: &Plan,
    exact: &[u8],
    camera: &Camera,
) -> f64 {
    let drawn = draw(avatar, pose, plan, camera, WHITE).expect("it can be drawn");
    let drawn = rgb_of(&drawn.rgba);
    let pixels = exact.chunks_exact(3).zip(drawn.chunks_exact(3));
    let touched: Vec<bool> = pixels.map(|(a, b)| a != [255; 3] || b != [255; 3]).collect();
    psnr_db(exact, &drawn, Some(&touched)).expect("it is seen")
}

/// A square picture from somewhere around a posed file.
///
/// # Panics
///
/// Where the file has no box.
pub fn orbit(
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    yaw: f32,
    pitch: f32,
    distance: Option<f32>,
    size: u32,
) -> Camera {
    let orbit = Orbit { yaw, pitch, distance };
    orbit.camera(avatar, pose, size, size).expect("it has a box")
}
