//! What other parts of the program may take for granted about the built-in avatar.

use std::collections::HashMap;

use glam::{Quat, Vec3};

use super::*;
use crate::model::{ChannelTarget, Interpolation};

fn corners(model: &Model, triangle: &Triangle) -> [Vec3; 3] {
    triangle.corners.map(|corner| model.vertices[corner as usize].position)
}

/// A model of one part alone.
fn alone(part: &Part, mirror: bool) -> Model {
    let mut model = Model { morph_targets: vec![MorphTarget::default(); 2], ..Model::default() };
    append(&mut model, part, mirror);
    model
}

#[test]
fn size_and_place() {
    let model = demo_avatar();
    assert!((2500..3500).contains(&model.triangles.len()), "{}", model.triangles.len());
    assert_eq!(model.joints.len(), 18);
    let heights = model.vertices.iter().map(|vertex| vertex.position.y);
    let (low, high) =
        heights.fold((f32::MAX, f32::MIN), |(low, high), y| (low.min(y), high.max(y)));
    assert_eq!(low, 0.0);
    assert!((1.65..1.78).contains(&high), "{high}");
    // The nose is in front.
    let foremost = model.vertices.iter().filter(|vertex| vertex.position.y > 1.2);
    let foremost = foremost.max_by(|a, b| a.position.z.total_cmp(&b.position.z)).unwrap();
    assert!(foremost.position.z > 0.0);
}

#[test]
fn every_call_gives_the_same() {
    let (a, b) = (demo_avatar(), demo_avatar());
    assert_eq!(a.vertices, b.vertices);
    assert_eq!(a.textures, b.textures);
    assert_eq!(a.clips, b.clips);
}

#[test]
fn parts_are_closed_and_wound_outwards() {
    for part in &body::parts() {
        for mirror in [false, true] {
            let model = alone(part, mirror);
            let mut edges: HashMap<[[u32; 3]; 2], i32> = HashMap::new();
            let mut volume = 0.0;
            for triangle in &model.triangles {
                let [a, b, c] = corners(&model, triangle);
                volume += a.dot(b.cross(c)) / 6.0;
                for [from, to] in [[a, b], [b, c], [c, a]] {
                    // Vertices of seams and poles are one where their bits are; + 0.0 joins ±0.
                    let [from, to] = [from, to].map(|v| (v + 0.0).to_array().map(f32::to_bits));
                    let (key, sign) = if from < to { ([from, to], 1) } else { ([to, from], -1) };
                    let entry = edges.entry(key).or_default();
                    *entry += sign;
                    assert!(entry.abs() <= 1, "an edge of {:?} has two equal sides", part.surface);
                }
            }
            assert!(volume > 1e-6, "{:?} {volume}", part.surface);
            assert!(edges.values().all(|&sum| sum == 0), "{:?} is open", part.surface);
        }
    }
}

#[test]
fn no_triangle_is_degenerate_and_no_vertex_unused() {
    let model = demo_avatar();
    let mut used = vec![false; model.vertices.len()];
    for triangle in &model.triangles {
        let [a, b, c] = corners(&model, triangle);
        let area = 0.5 * (b - a).cross(c - a).length();
        assert!(area > 1e-7, "{area}");
        let [p, q, r] = triangle.corners.map(|corner| model.vertices[corner as usize].uv);
        assert!((q - p).perp_dot(r - p).abs() > 1e-8);
        triangle.corners.iter().for_each(|&corner| used[corner as usize] = true);
    }
    assert!(used.iter().all(|&used| used));
}

#[test]
fn vertices_are_valid() {
    let model = demo_avatar();
    for vertex in &model.vertices {
        let sum: f32 = vertex.influences.iter().map(|&(_, weight)| weight).sum();
        assert!((sum - 1.0).abs() < 1e-5, "{sum}");
        for (bind, weight) in vertex.influences {
            assert!(usize::from(bind) < model.binds.len() && (0.0..=1.0).contains(&weight));
        }
        assert!(vertex.uv.cmpge(glam::Vec2::ZERO).all() && vertex.uv.cmple(glam::Vec2::ONE).all());
    }
}

#[test]
fn at_rest_nothing_moves() {
    let model = demo_avatar();
    let mut places: Vec<Vec3> = Vec::new();
    for (index, joint) in model.joints.iter().enumerate() {
        let parent = joint.parent.map_or(Vec3::ZERO, |parent| {
            assert!(usize::from(parent) < index);
            places[usize::from(parent)]
        });
        places.push(parent + joint.rest.translation);
    }
    for bind in &model.binds {
        let origin = bind.inverse.transform_point3(places[usize::from(bind.joint)]);
        assert!(origin.length() < 1e-6);
    }
}

#[test]
fn morph_targets_are_sparse_and_symmetric() {
    let model = demo_avatar();
    for target in &model.morph_targets {
        assert!(!target.deltas.is_empty() && target.deltas.is_sorted_by(|a, b| a.0 < b.0));
        assert!(target.deltas.len() < model.vertices.len() / 4);
        let sum: Vec3 = target.deltas.iter().map(|&(_, displacement)| displacement).sum();
        assert!(sum.x.abs() < 1e-4, "{} {sum}", target.name);
    }
}

#[test]
fn clips_are_valid() {
    let model = demo_avatar();
    let names: Vec<_> = model.clips.iter().map(|clip| clip.name.as_str()).collect();
    assert_eq!(names, ["wave", "walk", "turn"]);
    let mut kinds = Vec::new();
    for clip in &model.clips {
        for channel in &clip.channels {
            let (index, count, width) = match channel.target {
                ChannelTarget::Rotation(joint) => (joint, model.joints.len(), 4),
                ChannelTarget::Translation(joint) | ChannelTarget::Scale(joint) => {
                    (joint, model.joints.len(), 3)
                }
                ChannelTarget::Weight(target) => (target, model.morph_targets.len(), 1),
            };
            assert!(usize::from(index) < count);
            let tangents = if channel.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
            assert_eq!(channel.values.len(), channel.times.len() * width * tangents);
            assert!(channel.times.is_sorted_by(|a, b| a < b) && channel.times[0] == 0.0);
            assert!((channel.times[channel.times.len() - 1] - clip.seconds).abs() < 1e-6);
            if width == 4 {
                assert!(channel.values.chunks(4).all(|q| Quat::from_slice(q).is_normalized()));
            }
            kinds.push(channel.interpolation);
        }
        let mut targets: Vec<_> = clip.channels.iter().map(|channel| channel.target).collect();
        let channels = targets.len();
        targets.sort_by_key(|target| format!("{target:?}"));
        targets.dedup();
        assert_eq!(targets.len(), channels, "two channels of {} move one thing", clip.name);
    }
    for kind in [Interpolation::Step, Interpolation::Linear, Interpolation::CubicSpline] {
        assert!(kinds.contains(&kind));
    }
}
