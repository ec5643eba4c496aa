//! Clips that are long, and clips that an avatar and a mesh do not share.

use dermis_runtime::Avatar;
use dermis_trainer::demo::demo_avatar;
use dermis_trainer::eval::{EvalOptions, evaluate};
use dermis_trainer::options::{Options, Preset};
use dermis_trainer::scene::training_key_frames;
use dermis_trainer::train::train;

#[test]
fn key_frames_of_long_clips_take_little_memory() {
    let mut model = demo_avatar();
    for clip in &mut model.clips {
        clip.seconds = 1e9;
    }
    let clips: Vec<usize> = (0..model.clips.len()).collect();
    let keys = training_key_frames(&model, &clips, 2);
    assert!(!keys.is_empty() && keys.iter().all(|key| (0.0..=1e9).contains(&key.seconds)));
}

#[test]
fn a_mesh_with_other_clips_is_refused() {
    let model = demo_avatar();
    let preset = Options::preset(Preset::Draft);
    let options = Options { gaussians: 60, steps: 1, views: 2, key_frames: 1, size: 32, ..preset };
    let trained = train(&model, &options).unwrap();
    let avatar = Avatar::parse(&trained.bytes).unwrap();
    let measure = EvalOptions {
        key_frames: 1,
        views: 2,
        size: 32,
        background: [1.0; 3],
        budgets: Vec::new(),
        prefixes: Vec::new(),
        packed: None,
        planned: false,
        distance: None,
    };
    let fails = |model: &_, part: &str| {
        let error = format!("{:#}", evaluate(&avatar, model, &measure).expect_err(part));
        assert!(error.contains(part) && error.contains("; give the mesh"), "{error}");
    };
    let mut still = model.clone();
    still.clips.clear();
    fails(&still, "3 clips and the mesh has 0");
    let mut renamed = model.clone();
    renamed.clips[1].name = "hover".into();
    fails(&renamed, "clip 1 of the avatar is \"walk\" and that of the mesh is \"hover\"");

    let evaluation = evaluate(&avatar, &model, &measure).unwrap();
    assert_eq!(evaluation.views, 2);
    assert!(evaluation.rows.iter().all(|row| row.views == 2));
}
