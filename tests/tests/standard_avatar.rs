//! What preset draft must reach on the standard avatar: a real human of 13,605 triangles. The
//! slowest test by far, about two minutes on two cores.

use dermis_runtime::{Avatar, Plan, Pose};
use dermis_tests::compare::{cost_of_packing, to_reference};
use dermis_tests::files;
use dermis_trainer::eval::{EvalOptions, Row, Split, evaluate};
use dermis_trainer::import;
use dermis_trainer::options::{Options, Preset};
use dermis_trainer::orbit::Orbit;
use dermis_trainer::train::train;

#[test]
fn the_draft_of_a_real_human_is_as_good_as_promised() {
    let Some(folder) = files::data("the_draft_of_a_real_human") else { return };
    let model = import::load(&folder.join("valid_male.glb")).expect("it can be read");
    let options = Options::preset(Preset::Draft);
    let trained = train(&model, &options).expect("it trains");
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    assert!(avatar.header().gaussians <= 76_000);

    // A quarter of the directions of `dermis eval`, spread over all of them.
    let measure = EvalOptions {
        key_frames: 4,
        views: 10,
        size: 540,
        background: [1.0; 3],
        budgets: vec![20_000],
        prefixes: Vec::new(),
        packed: None,
        planned: false,
        distance: None,
    };
    let evaluation = evaluate(&avatar, &model, &measure).expect("it can be measured");
    let rows = |split| evaluation.rows.iter().filter(move |row| row.split == split);
    let at = |split, count| -> &Row {
        rows(split).find(|row| row.gaussians == count).expect("this count was measured")
    };
    for (count, frame, foreground) in [(75_000, 37.0, 29.0), (20_000, 35.0, 27.0)] {
        let novel = at(Split::NovelView, count);
        println!("{novel:?}");
        assert!(novel.psnr_db >= frame && novel.psnr_foreground_db >= foreground, "{novel:?}");
        let unseen = at(Split::Reenactment, count);
        println!("{unseen:?}");
        assert!(unseen.psnr_foreground_db >= novel.psnr_foreground_db - 1.0, "{unseen:?}");
    }
    for split in [Split::NovelView, Split::Reenactment] {
        let curve: Vec<&Row> = rows(split).collect();
        assert!(curve.len() >= 5);
        for pair in curve.windows(2) {
            assert!(pair[0].gaussians < pair[1].gaussians);
            assert!(pair[0].psnr_db <= pair[1].psnr_db, "quality fell: {pair:?}");
            assert!(
                pair[0].psnr_foreground_db <= pair[1].psnr_foreground_db,
                "quality fell: {pair:?}"
            );
        }
    }

    let plan = Plan::with_budget(&avatar, u32::MAX);
    for (pose, yaw, distance) in [
        (Pose::Rest, 0.0, Some(2.0)),
        (Pose::Clip { clip: 2, seconds: 1.1 }, 130.0, Some(2.0)),
        (Pose::Clip { clip: 1, seconds: 1.5 }, 40.0, Some(0.6)),
    ] {
        let orbit = Orbit { yaw, pitch: 15.0, distance };
        let camera = orbit.camera(&avatar, &pose, 540, 540).expect("it can be posed");
        let off = to_reference(&avatar, &pose, &plan, &camera);
        println!("{pose:?}: {off:?}");
        assert!(off.steps <= 1, "{off:?}");
    }
    let cost = cost_of_packing(&model, &trained, &options, 75_000, 6);
    println!("{cost:.3?}");
    assert!(cost.cloud - cost.file <= 0.3, "{cost:?}");
}
