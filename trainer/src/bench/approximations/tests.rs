//! The plain rasterizer unchanged is the runtime's, and each switch does what it says.

use dermis_runtime::{Avatar, Plan, Pose, Prepared};

use super::*;
use crate::camera_file::Shot;
use crate::draw::draw_unrounded;
use crate::mannequin;

const COUNT: u32 = 900;

fn with_scene(act: impl FnOnce(&Scene<'_>, &Source)) {
    let bytes = mannequin::avatar(COUNT).expect("it has Gaussians");
    let avatar = Avatar::parse(&bytes).expect("it is valid");
    let shot: Shot = mannequin::camera(1.5, 90);
    let scene = Scene { avatar: &avatar, pose: &Pose::Rest, shot, budget: u32::MAX };
    act(&scene, &mannequin::gaussians(COUNT));
}

#[test]
fn unchanged_it_draws_the_runtimes_picture() {
    with_scene(|scene, _| {
        for budget in [u32::MAX, 300] {
            let plan = Plan::with_budget(scene.avatar, budget);
            let camera = scene.shot.camera;
            let mut posing = vec![0; Posed::scratch_len(scene.avatar)];
            let posed = Posed::new(scene.avatar, scene.pose, Kernel::Scalar, &mut posing);
            let posed = posed.expect("scratch is long enough");
            let mut preparing = vec![
                0;
                Prepared::scratch_len(
                    scene.avatar,
                    plan.gaussians(),
                    camera.width,
                    camera.height
                )
            ];
            let prepared = Prepared::new(&posed, &plan, &camera, &mut preparing);
            let prepared = prepared.expect("scratch is long enough");
            let from = From::File { plan: &plan, back_faces: false };
            assert_eq!(splats::splats::<f32>(&posed, &camera, from, false), prepared.splats());
            let drawn = frame(scene, &posed, &plan, None, Exact::NONE).expect("it is drawn");
            let expected = draw_unrounded(
                scene.avatar,
                scene.pose,
                &plan,
                Kernel::Scalar,
                &camera,
                scene.shot.background,
            );
            assert!(drawn.picture == expected.expect("it is drawn"), "another picture");
            assert!(drawn.counts.blends > 1000);
        }
    });
}

#[test]
fn each_switch_changes_the_picture_as_little_as_it_should() {
    with_scene(|scene, source| {
        let measured = measure(scene, Some(source), 1).expect("it is drawn");
        let row = |name: &str| {
            let row = measured.rows.iter().find(|row| row.name.contains(name));
            row.unwrap_or_else(|| panic!("no {name}"))
        };
        // Of 255: by the bounds of the runtime's own documentation.
        let errors = |name: &str| row(name).max_error_unrounded_8bit;
        assert!(errors("pixels") < 0.01, "{}", errors("pixels"));
        assert!(errors("front end") < 0.1, "{}", errors("front end"));
        // T < 1e-4 of light, of at most 1 a channel.
        assert!(errors("stop") < 0.0256 + 1e-3, "{}", errors("stop"));
        assert!((0.01..20.0).contains(&errors("skip")), "{}", errors("skip"));
        assert!((0.01..40.0).contains(&errors("quantized")), "{}", errors("quantized"));
        assert!(errors("all") >= errors("pixels"));
        assert_eq!(row("pixels").exact_form, "libm's exp2f");
        assert!(row("skip").blends > row("pixels").blends, "more is blended");
        let left_out: Vec<&str> = measured.left_out.iter().map(|left| left.name).collect();
        assert_eq!(left_out, ["depth key", "incremental exponential", "culling of back faces"]);
    });
}
