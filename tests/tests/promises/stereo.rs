//! One posed avatar for two eyes.

use dermis_conformance::{File, cameras};
use dermis_runtime::{Avatar, Plan, Pose, Posed};
use dermis_tests::picture::kernels;

use crate::frame::fresh;

#[test]
fn one_pose_for_two_cameras_is_the_same_as_two_poses() {
    let avatar = Avatar::parse(File::Figure.bytes()).expect("a valid file");
    let plan = Plan::with_budget(&avatar, 3_000);
    // Eyes 64 mm apart, from the front and, so that other triangles are culled, from behind.
    let eyes = [cameras::FRONT, cameras::BACK].map(|view| {
        [-0.032, 0.032].map(|by| {
            let mut camera = view.camera([90, 100]);
            camera.world_to_camera[0][3] += by;
            camera
        })
    });
    for kernel in kernels() {
        let pose = Pose::Clip { clip: 1, seconds: 0.4 };
        let mut once = vec![0; Posed::scratch_len(&avatar)];
        let posed = Posed::new(&avatar, &pose, kernel, &mut once).expect("it fits");
        let [[left, right], _] = eyes;
        assert!(fresh(&posed, &plan, &left) != fresh(&posed, &plan, &right), "two eyes");
        for camera in eyes.as_flattened() {
            let mut again = vec![u32::MAX; Posed::scratch_len(&avatar)];
            let alone = Posed::new(&avatar, &pose, kernel, &mut again).expect("it fits");
            let (one, other) = (fresh(&posed, &plan, camera), fresh(&alone, &plan, camera));
            assert!(one.1.blends > 10_000 && one == other, "{}", kernel.name());
        }
    }
}
