//! A converted file's pictures against those of the Gaussians that went into it.

use std::path::Path;

use dermis_runtime::{Avatar, Camera, Plan, Pose};
use dermis_trainer::convert;
use dermis_trainer::draw::{draw, rgb_of};
use dermis_trainer::metrics::psnr::psnr_db;
use dermis_trainer::orbit::Orbit;

use crate::compare::to_reference;
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

/// [`psnr`] of the first `budget` Gaussians at rest.
pub fn psnr_at_rest(avatar: &Avatar<'_>, budget: u32, exact: &[u8], camera: &Camera) -> f64 {
    psnr(avatar, &Pose::Rest, &Plan::with_budget(avatar, budget), exact, camera)
}

/// [`orbit`] around a file at rest.
pub fn orbit_at_rest(
    avatar: &Avatar<'_>,
    yaw: f32,
    pitch: f32,
    distance: Option<f32>,
    size: u32,
) -> Camera {
    orbit(avatar, &Pose::Rest, yaw, pitch, distance, size)
}

/// Least PSNR of a converted file's pictures in dB, over the foreground; about 2 dB below what was
/// measured when it was set.
const LEAST_DB: f64 = 48.5;

/// Six views of a real file.
///
/// # Panics
///
/// Where they are not as good as they were.
pub fn real_file_keeps_its_pictures(name: &str, ply: &SplatPly, path: &Path, distance: f32) {
    let (splats, left_out) = convert::read(path, None).unwrap_or_else(|error| panic!("{error:#}"));
    let bytes = convert::pack(splats).expect("what can be read can be packed");
    let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
    let count = avatar.header().gaussians;
    assert_eq!((count as usize + left_out.faint, left_out.wild), (ply.rows.len(), 0));
    // All of them, half, a quarter, a sixteenth.
    let counts = [0, 1, 2, 4].map(|halvings| count >> halvings);
    let mut sums = [0.0; 4];
    for view in 0..6 {
        let pitch = [-25.0, 10.0][view % 2];
        let camera = orbit_at_rest(&avatar, 60.0 * view as f32, pitch, Some(distance), 400);
        let exact = exact(ply, &camera);
        let db = counts.map(|k| psnr_at_rest(&avatar, k, &exact, &camera));
        assert!(db[0] > LEAST_DB, "{name}: {:.2} dB", db[0]);
        assert!(db[1] > 17.0 && db[2] > 12.0, "{name}: prefixes are pictures, but {db:.2?} dB");
        sums.iter_mut().zip(db).for_each(|(sum, db)| *sum += db);
    }
    println!("{name}: {count} Gaussians, {} bytes, {:.2?} dB", bytes.len(), sums.map(|s| s / 6.0));
    let camera = orbit_at_rest(&avatar, 200.0, 5.0, Some(distance), 200);
    for budget in [ALL, count / 4] {
        let plan = Plan::with_budget(&avatar, budget);
        let off = to_reference(&avatar, &Pose::Rest, &plan, &camera);
        assert!(off.steps <= 1 && off.unrounded < 0.1, "{name}: {off:?}");
    }
}
