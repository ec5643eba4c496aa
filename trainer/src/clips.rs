//! A model's clips as a file has them: keys evenly spaced, and no finer than anyone sees.

use dermis_format::rig::Property;
use dermis_format::source::{Channel, Clip};
use glam::Quat;

use crate::model::{ChannelTarget, Interpolation, Model, MorphTarget};
use crate::scene::Pose;

/// Keys, per second.
pub(crate) const KEYS_PER_SECOND: f32 = 30.0;

/// A step of a component of a rotation: half of it turns by 0.00012 radians at most, at arm's length a step of the mesh.
const TURN_STEP: f32 = 1.0 / 16_384.0;
/// A step of a scale, to the greatest of its channel.
const SCALE_STEP: f32 = 1.0 / 16_384.0;

/// The last of a clip's keys, which are evenly spaced from 0 to its end.
pub fn last_key(seconds: f32) -> usize {
    (seconds * KEYS_PER_SECOND).ceil().max(1.0) as usize
}

/// A clip with evenly spaced keys; what moves by half a step or less has one. `mesh_step` is how far nobody sees a vertex move, in bind
/// space.
pub(crate) fn resampled(model: &Model, index: usize, mesh_step: f32) -> Clip {
    let clip = &model.clips[index];
    let last = last_key(clip.seconds);
    // Pose by pose: all poses of a long clip at once are more than what its channels keep of them.
    let mut sampled: Vec<Vec<f32>> = vec![Vec::new(); clip.channels.len()];
    for key in 0..=last {
        let pose = Pose::of_clip(model, index, clip.seconds * key as f32 / last as f32);
        for (values, channel) in sampled.iter_mut().zip(&clip.channels) {
            values.extend(value(&pose, channel.target));
        }
    }
    let channels = clip.channels.iter().zip(sampled).map(|(channel, mut values)| {
        let property = property(channel.target);
        let width = property.width();
        if matches!(property, Property::Rotation(_)) {
            align_signs(&mut values);
        }
        let step = step_of(property, &values, &model.morph_targets, mesh_step);
        let rests = |key: &[f32]| {
            key.iter().zip(&values).all(|(here, first)| (here - first).abs() <= step / 2.0)
        };
        if values.chunks_exact(width).all(rests) {
            values.truncate(width);
        }
        let holds = channel.interpolation == Interpolation::Step;
        Channel { property, holds, values, step }
    });
    Clip { name: clip.name.clone(), seconds: clip.seconds, channels: channels.collect() }
}

/// Of a translation, whose unit is that of the joint's parent, a step is as fine as can be.
fn step_of(property: Property, values: &[f32], targets: &[MorphTarget], mesh_step: f32) -> f32 {
    match property {
        Property::Translation(_) => 0.0,
        Property::Rotation(_) => TURN_STEP,
        Property::Scale(_) => SCALE_STEP * greatest(values.iter().map(|value| value.abs())),
        Property::Weight(target) => {
            let deltas = targets[usize::from(target)].deltas.iter();
            let moved = greatest(deltas.map(|(_, delta)| delta.length()));
            if moved > 0.0 { (mesh_step / moved).min(1.0) } else { 0.0 }
        }
    }
}

fn greatest(numbers: impl Iterator<Item = f32>) -> f32 {
    numbers.fold(0.0, f32::max)
}

fn property(target: ChannelTarget) -> Property {
    match target {
        ChannelTarget::Translation(joint) => Property::Translation(joint),
        ChannelTarget::Rotation(joint) => Property::Rotation(joint),
        ChannelTarget::Scale(joint) => Property::Scale(joint),
        ChannelTarget::Weight(target) => Property::Weight(target),
    }
}

fn value(pose: &Pose, target: ChannelTarget) -> Vec<f32> {
    match target {
        ChannelTarget::Translation(joint) => {
            pose.locals[usize::from(joint)].translation.to_array().to_vec()
        }
        ChannelTarget::Rotation(joint) => wxyz(pose.locals[usize::from(joint)].rotation).to_vec(),
        ChannelTarget::Scale(joint) => pose.locals[usize::from(joint)].scale.to_array().to_vec(),
        ChannelTarget::Weight(target) => vec![pose.weights[usize::from(target)]],
    }
}

/// q and −q are one rotation: neighbours get the sign that makes them near.
fn align_signs(values: &mut [f32]) {
    for key in 1..values.len() / 4 {
        let (before, after) = values.split_at_mut(key * 4);
        let dot: f32 = before[key * 4 - 4..].iter().zip(&after[..4]).map(|(a, b)| a * b).sum();
        if dot < 0.0 {
            after[..4].iter_mut().for_each(|x| *x = -*x);
        }
    }
}

/// In the order of a file.
pub(crate) fn wxyz(q: Quat) -> [f32; 4] {
    [q.w, q.x, q.y, q.z]
}
