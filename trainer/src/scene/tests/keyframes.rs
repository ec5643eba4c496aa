use super::super::keyframes::{
    KeyFrame, clips_named, reenactment_clips, reenactment_key_frames, training_clips,
    training_key_frames,
};
use super::pose::{arm, bend};
use crate::model::{Clip, Interpolation, Model};

fn with_clips(count: usize) -> Model {
    let mut model = arm(vec![bend(Interpolation::Linear)]);
    let clip = model.clips[0].clone();
    model.clips = (0..count).map(|i| Clip { name: format!("clip{i}"), ..clip.clone() }).collect();
    model
}

#[test]
fn the_last_of_several_clips_is_left_out() {
    assert_eq!(training_clips(&with_clips(3), None), [0, 1]);
    assert_eq!(training_clips(&with_clips(1), None), [0]);
    assert!(training_clips(&with_clips(0), None).is_empty());
    assert_eq!(training_clips(&with_clips(3), Some(&[2])), [2]);
    assert_eq!(reenactment_clips(&with_clips(3), &[2]), [0, 1]);
}

#[test]
fn clips_are_found_by_name() {
    let model = with_clips(3);
    let names = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
    assert_eq!(clips_named(&model, &names(&["clip2", "clip0"])).unwrap(), [2, 0]);
    let error = clips_named(&model, &names(&["walk"])).unwrap_err().to_string();
    assert!(error.contains("\"walk\"") && error.contains("clip0, clip1, clip2"), "{error}");
}

#[test]
fn without_clips_the_rest_pose_stands_in() {
    let model = with_clips(0);
    assert_eq!(training_key_frames(&model, &[], 4), [KeyFrame::REST]);
    assert!(training_key_frames(&model, &[], 0).is_empty());
    assert!(reenactment_key_frames(&model, &[], 4).is_empty());
    assert!(reenactment_key_frames(&with_clips(1), &[0], 4).is_empty());
}

#[test]
fn key_frames_are_spread_over_the_motion() {
    let model = with_clips(2);
    let keys = training_key_frames(&model, &[0], 3);
    assert_eq!(keys.len(), 3);
    assert!(keys.iter().all(|key| key.clip == Some(0) && (1.0..=2.0).contains(&key.seconds)));
    // The typical pose first, then both ends of the bend.
    assert!((1.3..1.7).contains(&keys[0].seconds), "{keys:?}");
    let mut ends = [keys[1].seconds, keys[2].seconds];
    ends.sort_by(f32::total_cmp);
    assert!(ends[0] == 1.0 && ends[1] > 1.96, "{keys:?}");
    assert_eq!(keys, training_key_frames(&model, &[0], 3), "deterministic");

    let others = reenactment_key_frames(&model, &[0], 2);
    assert!(others.len() == 2 && others.iter().all(|key| key.clip == Some(1)));
}

#[test]
fn equal_poses_are_chosen_once() {
    let mut model = with_clips(1);
    model.clips[0].channels[0].interpolation = Interpolation::Step;
    let keys = training_key_frames(&model, &[0], 8);
    assert_eq!(keys.len(), 2, "{keys:?}");
    model.clips[0].channels.clear();
    assert_eq!(training_key_frames(&model, &[0], 8).len(), 1);
}
