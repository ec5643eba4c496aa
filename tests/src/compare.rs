//! The runtime against the reference, and a file against the cloud that was packed into it.

use dermis_format::LowPass;
use dermis_runtime::{Avatar, Camera, Plan, Pose};
use dermis_trainer::draw::{draw, rgb_of};
use dermis_trainer::eval::reference::draw_reference;
use dermis_trainer::metrics::psnr::psnr_db;
use dermis_trainer::model::Model;
use dermis_trainer::optimize::cloud::Prefix;
use dermis_trainer::optimize::forward::{self, Stage};
use dermis_trainer::options::Options;
use dermis_trainer::scene::{self, Painter, RigScale};
use dermis_trainer::train::{Trained, key_frames, runtime_pose};

use crate::picture::{bytes, unrounded, worst};
use crate::small::WHITE;

/// How far a picture is from the reference's.
#[derive(Clone, Copy, Debug)]
pub struct Difference {
    /// Greatest one of rounded values, in 8-bit steps.
    pub steps: u8,
    /// Greatest one of values before rounding, in 8-bit steps.
    pub unrounded: f64,
    /// Pixels that are not background.
    pub touched: usize,
}

/// Draws over white by the runtime and by the reference.
///
/// # Panics
///
/// Where the runtime's framebuffer does not hold the nearest bytes of its own pixels.
pub fn to_reference(
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    plan: &Plan,
    camera: &Camera,
) -> Difference {
    let exact = draw_reference(avatar, pose, plan, camera, WHITE).expect("it can be drawn");
    let floats = unrounded(avatar, pose, plan, camera, WHITE);
    let drawn = rgb_of(&draw(avatar, pose, plan, camera, WHITE).expect("it can be drawn").rgba);
    assert_eq!(drawn, bytes(&floats), "the framebuffer holds the pixels' nearest bytes");
    let byte = |x: f64| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
    let rounded: Vec<u8> = exact.iter().flat_map(|rgb| rgb.map(byte)).collect();
    let pairs = floats.iter().flatten().zip(exact.iter().flatten());
    let greatest = pairs.map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max);
    Difference {
        steps: worst(&drawn, &rounded),
        unrounded: 255.0 * greatest,
        touched: floats.iter().filter(|rgb| **rgb != WHITE).count(),
    }
}

/// Foreground PSNR, dB, means over novel views of the key frames.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cost {
    /// Of the float cloud against the mesh.
    pub cloud: f64,
    /// Of the file against the mesh.
    pub file: f64,
    /// Of the file against the cloud.
    pub between: f64,
}

/// What packing costs at `count` Gaussians, in `views` novel views of each key frame.
pub fn cost_of_packing(
    model: &Model,
    trained: &Trained,
    options: &Options,
    count: u32,
    views: usize,
) -> Cost {
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    let painter = Painter::new(model);
    let plan = Plan::with_budget(&avatar, count);
    let prefix = Prefix::of(count, &trained.clouds[0]);
    let mut sum = Cost::default();
    let mut pictures = 0.0;
    for frame in key_frames(model, options).expect("its clips exist") {
        let pose = runtime_pose(&frame);
        let stage = Stage::of(&avatar, &pose).expect("it can be posed");
        let posed = scene::posed_vertices(model, &frame.pose(model));
        let directions = &scene::novel_directions()[..views];
        for camera in RigScale::of(model).cameras(directions, &posed, options.size, options.size) {
            let truth = scene::render(&painter, &posed, &camera, WHITE, 4);
            let mask: Vec<bool> = truth.coverage.iter().map(|&c| c > 0.0).collect();
            let exact = truth.picture.to_bytes();
            let psnr = |a: &[u8], b: &[u8]| psnr_db(a, b, Some(&mask)).expect("it is seen");
            let low_pass = LowPass::Pixel;
            let before =
                forward::draw(&trained.clouds, &[prefix], &stage, &camera, low_pass, WHITE);
            let before = before.picture.to_bytes();
            let after = draw(&avatar, &pose, &plan, &camera, WHITE).expect("it can be drawn");
            let after = rgb_of(&after.rgba);
            sum.cloud += psnr(&exact, &before);
            sum.file += psnr(&exact, &after);
            sum.between += psnr(&before, &after);
            pictures += 1.0;
        }
    }
    let mean = |sum: f64| sum / pictures;
    Cost { cloud: mean(sum.cloud), file: mean(sum.file), between: mean(sum.between) }
}
