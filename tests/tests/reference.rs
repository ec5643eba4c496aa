//! The runtime's f32 picture against the f64 reference.

use dermis_runtime::{Avatar, Plan, Pose};
use dermis_tests::compare::to_reference;
use dermis_tests::small::{options, trained_demo};
use dermis_trainer::orbit::Orbit;

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
            let camera = Orbit { yaw, pitch: 12.0, distance }.camera(&avatar, &pose, 150, 131);
            let camera = camera.expect("it has a box");
            for budget in [u32::MAX, 700, 60, 1] {
                let plan = Plan::with_budget(&avatar, budget);
                let off = to_reference(&avatar, &pose, &plan, &camera);
                assert!(off.steps <= 1, "{off:?} at {budget} from {camera:?}");
                greatest = greatest.max(off.unrounded);
                touched += off.touched;
                pictures += 1;
            }
        }
    }
    println!("{pictures} pictures, greatest unrounded difference {greatest:.4} of 255");
    assert!(touched > pictures * 100, "there is something in the pictures");
    // Far below half a step: bytes differ only where a value stands next to the border of two.
    assert!(greatest < 0.1, "{greatest}");
}
