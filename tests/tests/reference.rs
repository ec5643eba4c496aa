//! The runtime's f32 picture against the f64 reference.

use dermis_runtime::{Avatar, Camera, Plan, Pose};
use dermis_tests::compare::to_reference;
use dermis_tests::small::{WHITE, options, trained_demo};
use dermis_trainer::eval::reference::{draw_own_reference, draw_reference};
use dermis_trainer::mannequin;
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

/// Greatest difference of two pictures, and its root mean square, in 1/255.
fn differences(a: &[[f64; 3]], b: &[[f64; 3]]) -> [f64; 2] {
    let off = a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| 255.0 * (a - b).abs());
    let (greatest, squares) =
        off.fold((0.0f64, 0.0), |(greatest, sum), off| (greatest.max(off), sum + off * off));
    [greatest, (squares / (3 * a.len()) as f64).sqrt()]
}

/// The runtime decides nearly everything as exact arithmetic does: where the two differ it is about
/// Gaussians that add 1/255 to a pixel, or stand at nearly one depth.
#[test]
fn decisions_in_f64_give_nearly_the_same_picture() {
    let (_, trained) = trained_demo(&options(1500, 100));
    let trained = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    let free = mannequin::avatar(4000).expect("it has Gaussians");
    let free = Avatar::parse(&free).expect("what was packed is valid");
    let near: Camera = mannequin::camera(1.0, 200).camera;
    let pose = Pose::Clip { clip: 0, seconds: 0.6 };
    let orbit = Orbit { yaw: 40.0, pitch: 12.0, distance: None };
    let around = orbit.camera(&trained, &pose, 150, 131).expect("it has a box");
    for (avatar, pose, camera) in [(&trained, &pose, around), (&free, &Pose::Rest, near)] {
        for budget in [u32::MAX, 700, 1, 0] {
            let plan = Plan::with_budget(avatar, budget);
            let follows = draw_reference(avatar, pose, &plan, &camera, WHITE).expect("drawn");
            let decides = draw_own_reference(avatar, pose, &plan, &camera, WHITE).expect("drawn");
            let [greatest, rms] = differences(&follows, &decides);
            println!("{budget}: {greatest:.4} of 255, root mean square {rms:.6}");
            assert!(greatest < 4.0 && rms < 0.02, "{greatest} {rms} at {budget}");
        }
    }
}
