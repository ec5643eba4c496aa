use std::f32::consts::{FRAC_PI_2, SQRT_2};

use glam::{Affine3A, Quat, Vec3, Vec4, vec3};

use super::super::pose::{Pose, posed_vertices};
use crate::model::{
    Bind, Channel, ChannelTarget, Clip, Interpolation, Joint, Model, MorphTarget, Trs, Vertex,
};

fn joint(parent: Option<u16>, translation: Vec3) -> Joint {
    let rest = Trs { translation, ..Trs::IDENTITY };
    Joint { name: String::new(), parent, rest }
}

fn bound(position: Vec3, influences: [(u16, f32); 2]) -> Vertex {
    let [a, b] = influences;
    Vertex { influences: [a, b, (0, 0.0), (0, 0.0)], ..super::vertex(position, glam::Vec2::ZERO) }
}

/// Two bones of 1 m along Y, the second on the first's end, with one morph target.
pub(super) fn arm(channels: Vec<Channel>) -> Model {
    let first = (0, 1.0);
    let second = (1, 1.0);
    Model {
        vertices: vec![
            bound(vec3(0.0, 0.5, 0.0), [first, (1, 0.0)]),
            bound(vec3(0.0, 2.0, 0.0), [(0, 0.0), second]),
            bound(vec3(0.0, 2.0, 0.0), [(0, 0.25), (1, 0.75)]),
        ],
        joints: vec![joint(None, Vec3::ZERO), joint(Some(0), Vec3::Y)],
        binds: vec![
            Bind { joint: 0, inverse: Affine3A::IDENTITY },
            Bind { joint: 1, inverse: Affine3A::from_translation(Vec3::NEG_Y) },
        ],
        morph_targets: vec![MorphTarget {
            name: "longer".to_owned(),
            deltas: vec![(1, vec3(0.0, 1.0, 0.0))],
            default_weight: 0.0,
        }],
        clips: vec![Clip { name: "clip".to_owned(), seconds: 2.0, channels }],
        ..Model::default()
    }
}

fn channel(
    target: ChannelTarget,
    interpolation: Interpolation,
    times: &[f32],
    values: &[f32],
) -> Channel {
    Channel { target, interpolation, times: times.to_vec(), values: values.to_vec() }
}

/// A quarter turn about +Z of the second bone between 1 s and 2 s.
pub(super) fn bend(interpolation: Interpolation) -> Channel {
    let half = SQRT_2 / 2.0;
    let values = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half];
    channel(ChannelTarget::Rotation(1), interpolation, &[1.0, 2.0], &values)
}

fn weight_at(interpolation: Interpolation, values: &[f32], seconds: f32) -> f32 {
    let channel = channel(ChannelTarget::Weight(0), interpolation, &[0.5, 1.0, 2.0], values);
    Pose::of_clip(&arm(vec![channel]), 0, seconds).weights[0]
}

#[test]
fn bones_carry_their_vertices() {
    let model = arm(vec![bend(Interpolation::Linear)]);
    let rest = posed_vertices(&model, &Pose::rest(&model));
    assert_eq!(rest, super::positions(&model));

    let bent = posed_vertices(&model, &Pose::of_clip(&model, 0, 2.0));
    let expected = [vec3(0.0, 0.5, 0.0), vec3(-1.0, 1.0, 0.0), vec3(-0.75, 1.25, 0.0)];
    for (position, expected) in bent.iter().zip(expected) {
        assert!(position.distance(expected) < 1e-6, "{position} {expected}");
    }
}

#[test]
fn parents_carry_children() {
    let model = arm(vec![channel(
        ChannelTarget::Translation(0),
        Interpolation::Step,
        &[0.0],
        &[5.0, 0.0, 0.0],
    )]);
    let worlds = Pose::of_clip(&model, 0, 0.0).joint_worlds(&model);
    assert_eq!(worlds[1].transform_point3(Vec3::ZERO), vec3(5.0, 1.0, 0.0));
}

#[test]
fn morph_targets_add_before_skinning() {
    let model = arm(vec![
        bend(Interpolation::Linear),
        channel(ChannelTarget::Weight(0), Interpolation::Step, &[0.0], &[0.5]),
    ]);
    let posed = posed_vertices(&model, &Pose::of_clip(&model, 0, 2.0));
    assert!(posed[1].distance(vec3(-1.5, 1.0, 0.0)) < 1e-6);

    let mut unbound = Model { binds: Vec::new(), ..model };
    unbound.morph_targets[0].default_weight = 2.0;
    let rest = posed_vertices(&unbound, &Pose::rest(&unbound));
    assert_eq!(rest[1], vec3(0.0, 4.0, 0.0));
}

#[test]
fn step_holds_and_linear_connects() {
    let values = [1.0, 3.0, -1.0];
    for (seconds, step, linear) in [
        (-1.0, 1.0, 1.0),
        (0.0, 1.0, 1.0),
        (0.75, 1.0, 2.0),
        (1.0, 3.0, 3.0),
        (1.75, 3.0, 0.0),
        (2.0, -1.0, -1.0),
        (9.0, -1.0, -1.0),
    ] {
        assert_eq!(weight_at(Interpolation::Step, &values, seconds), step, "{seconds}");
        assert_eq!(weight_at(Interpolation::Linear, &values, seconds), linear, "{seconds}");
    }
}

#[test]
fn cubic_spline_is_hermite() {
    // t³ has slope 3t², so its values and slopes at three keys give it back exactly. Tangents
    // that the curve must not use are absurd.
    let cubed = |t: f32| [3.0 * t * t, t * t * t, 3.0 * t * t];
    let mut values = [cubed(0.5), cubed(1.0), cubed(2.0)].concat();
    (values[0], values[8]) = (1e9, 1e9);
    for i in 0..=16 {
        let t = 0.5 + 1.5 * i as f32 / 16.0;
        let value = weight_at(Interpolation::CubicSpline, &values, t);
        assert!((value - t * t * t).abs() < 1e-5, "{t}: {value}");
    }
    assert_eq!(weight_at(Interpolation::CubicSpline, &values, 0.0), 0.125);
    assert_eq!(weight_at(Interpolation::CubicSpline, &values, 5.0), 8.0);
}

#[test]
fn rotations_turn_evenly_and_the_shorter_way() {
    let mut channel = bend(Interpolation::Linear);
    // The same rotation as its negative, and not quite unit.
    channel.values[4..].iter_mut().for_each(|value| *value *= -1.001);
    let model = arm(vec![channel]);
    for share in [0.0, 0.25, 0.5, 1.0] {
        let rotation = Pose::of_clip(&model, 0, 1.0 + share).locals[1].rotation;
        let expected = Quat::from_rotation_z(share * FRAC_PI_2);
        assert!(rotation.dot(expected).abs() > 1.0 - 1e-6, "{share}");
        assert!(rotation.is_normalized());
    }
}

#[test]
fn spline_rotations_are_unit() {
    let mut channel = bend(Interpolation::CubicSpline);
    let none = [0.0; 4];
    let keys = channel.values.clone();
    channel.values = [&none[..], &keys[..4], &none, &none, &keys[4..], &none].concat();
    let model = arm(vec![channel]);
    let rotation = Pose::of_clip(&model, 0, 1.5).locals[1].rotation;
    // Half way with flat tangents is the mean of the keys, made unit.
    let mean = Vec4::from_slice(&keys[..4]) + Vec4::from_slice(&keys[4..]);
    assert!(Vec4::from(rotation).distance(mean.normalize()) < 1e-6);
}

#[test]
fn scale_is_animated() {
    let scale = channel(
        ChannelTarget::Scale(0),
        Interpolation::Linear,
        &[0.0, 1.0],
        &[1.0, 1.0, 1.0, 3.0, 1.0, 1.0],
    );
    let pose = Pose::of_clip(&arm(vec![scale]), 0, 0.5);
    assert_eq!(pose.locals[0].scale, vec3(2.0, 1.0, 1.0));
}
