//! The runtime's f32 picture against the f64 reference.

use dermis_runtime::{Avatar, Camera, Plan, Pose};
use dermis_tests::picture::{bytes, unrounded, worst};
use dermis_tests::small::{WHITE, options, trained_demo};
use dermis_trainer::draw::{draw, orbit, rgb_of};
use dermis_trainer::eval::reference::draw_reference;

/// Whole in the frame, so near that it fills it and is cut by the near plane, and a few pixels high.
const DISTANCES: [Option<f32>; 4] = [None, Some(0.7), Some(0.12), Some(40.0)];

#[test]
fn runtime_is_within_one_step_of_the_reference() {
    let (_, trained) = trained_demo(&options(1500, 100));
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    let mut greatest = 0.0f64;
    let mut pictures = 0;
    let mut touched = 0;
    for (index, clip) in [None, Some(0), Some(1)].into_iter().enumerate() {
        let pose = clip.map_or(Pose::Rest, |clip| Pose::Clip { clip, seconds: 0.6 });
        for distance in DISTANCES {
            let yaw = 70.0 * index as f32 - 25.0;
            let camera =
                orbit(&avatar, &pose, yaw, 12.0, distance, 150, 131).expect("it has a box");
            for budget in [u32::MAX, 700, 60, 1] {
                let plan = Plan::with_budget(&avatar, budget);
                let difference = difference(&avatar, &pose, &plan, &camera);
                greatest = greatest.max(difference.0);
                touched += difference.1;
                pictures += 1;
            }
        }
    }
    println!("{pictures} pictures, greatest unrounded difference {:.4} of 255", 255.0 * greatest);
    assert!(touched > pictures * 100, "there is something in the pictures");
    // Far below half a step: bytes differ only where a value stands next to the border of two.
    assert!(greatest * 255.0 < 0.1, "{greatest}");
}

/// Greatest unrounded difference, and how many pixels are not background; bytes are checked here.
fn difference(avatar: &Avatar<'_>, pose: &Pose<'_>, plan: &Plan, camera: &Camera) -> (f64, usize) {
    let exact = draw_reference(avatar, pose, plan, camera, WHITE).expect("it can be drawn");
    let floats = unrounded(avatar, pose, plan, camera, WHITE);
    let drawn = rgb_of(&draw(avatar, pose, plan, camera, WHITE).expect("it can be drawn").rgba);
    assert_eq!(drawn, bytes(&floats), "the framebuffer holds the pixels' nearest bytes");
    let rounded =
        exact.iter().flat_map(|rgb| rgb.map(|x| (x.clamp(0.0, 1.0) * 255.0).round() as u8));
    let off = worst(&drawn, &rounded.collect::<Vec<u8>>());
    assert!(off <= 1, "{off} steps at {} Gaussians from {camera:?}", plan.gaussians());
    let pairs = floats.iter().flatten().zip(exact.iter().flatten());
    let greatest = pairs.map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max);
    (greatest, floats.iter().filter(|rgb| **rgb != WHITE).count())
}
