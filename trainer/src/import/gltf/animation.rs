//! Clips: the animations of nodes that became joints, and of morph targets.

use super::super::{MAX_NUMBERS, add_within};
use super::MorphRange;
use super::accessor::Accessor;
use super::document::{Document, item};
use super::nodes::unit;
use crate::clips::KEYS_PER_SECOND;
use crate::model::{Channel, ChannelTarget, Clip, Interpolation};
use anyhow::{Context, Result, ensure};
use glam::Quat;
use gltf::json::animation::{self, Animation, Property};
use gltf::json::validation::Checked;
use std::collections::HashSet;

/// Reads all animations that move something. `joints` says which joint each node became.
pub(super) fn read(
    document: &Document,
    joints: &[Option<u16>],
    morphs: &[MorphRange],
) -> Result<Vec<Clip>> {
    let mut reader = Reader { document, joints, morphs, numbers: 0 };
    let mut clips = Vec::new();
    // Numbers of a pose: each key of a resampled clip is made from one.
    let moved = joints.iter().flatten().count() + morphs.iter().map(|m| m.count).sum::<usize>();
    let mut resampled = 0_usize;
    for (index, json) in document.root.animations.iter().enumerate() {
        let channels = reader.clip(json).with_context(|| format!("animation {index}"))?;
        if !channels.is_empty() {
            let name = json.name.clone().filter(|name| !name.is_empty());
            let ends = channels.iter().filter_map(|channel| channel.times.last().copied());
            let name = name.unwrap_or_else(|| format!("clip{index}"));
            let seconds = ends.fold(0.0, f32::max);
            // Clips are resampled evenly, so that a late key costs as much as many keys.
            let keys = (seconds * KEYS_PER_SECOND) as usize;
            let numbers = keys.saturating_mul(moved + 4 * channels.len());
            resampled = resampled.saturating_add(numbers);
            ensure!(
                resampled <= MAX_NUMBERS,
                "clip {name:?}: its {seconds:?} s at {KEYS_PER_SECOND} keys a second bring all \
                 clips beyond {MAX_NUMBERS} numbers; shorten it, or check the times of its keys"
            );
            clips.push(Clip { name, seconds, channels });
        }
    }
    Ok(clips)
}

struct Reader<'a> {
    document: &'a Document,
    joints: &'a [Option<u16>],
    morphs: &'a [MorphRange],
    /// Numbers in all channels so far.
    numbers: usize,
}

/// Key frames of a sampler: `values` has `parts` × `width` numbers a key.
struct Keys {
    times: Vec<f32>,
    values: Vec<f32>,
    width: usize,
    /// 3 with tangents, else 1.
    parts: usize,
}

impl Reader<'_> {
    fn clip(&mut self, json: &Animation) -> Result<Vec<Channel>> {
        let mut channels: Vec<Channel> = Vec::new();
        let mut taken = HashSet::new();
        for (index, channel) in json.channels.iter().enumerate() {
            let read = self.channel(json, channel).with_context(|| format!("channel {index}"))?;
            // glTF forbids two channels with one target; of such, the first holds.
            channels.extend(read.into_iter().filter(|channel| taken.insert(channel.target)));
        }
        Ok(channels)
    }

    fn channel(&mut self, json: &Animation, channel: &animation::Channel) -> Result<Vec<Channel>> {
        let node = channel.target.node.value();
        let joint = item(&self.document.root.nodes, node, "node").map(|_| self.joints[node])?;
        let Checked::Valid(property) = channel.target.path else { return Ok(Vec::new()) };
        let sampler = item(&json.samplers, channel.sampler.value(), "sampler")?;
        let target = match (property, joint) {
            (Property::MorphTargetWeights, _) => return self.weights(sampler, node),
            (_, None) => return Ok(Vec::new()),
            (Property::Translation, Some(joint)) => ChannelTarget::Translation(joint),
            (Property::Rotation, Some(joint)) => ChannelTarget::Rotation(joint),
            (Property::Scale, Some(joint)) => ChannelTarget::Scale(joint),
        };
        let is_rotation = property == Property::Rotation;
        let width = if is_rotation { 4 } else { 3 };
        let mut keys = self.keys(sampler, width)?;
        if is_rotation && keys.parts == 1 {
            keys.values.chunks_exact_mut(4).for_each(|value| {
                let quaternion = Quat::from_slice(value);
                value.copy_from_slice(&unit(quaternion).to_array());
            });
        }
        Ok(vec![Channel {
            target,
            interpolation: interpolation(sampler),
            times: keys.times,
            values: keys.values,
        }])
    }

    /// Splits the weights of a node into one channel a morph target.
    fn weights(&mut self, sampler: &animation::Sampler, node: usize) -> Result<Vec<Channel>> {
        let Some(range) = self.morphs.iter().find(|range| range.node == node && range.count > 0)
        else {
            return Ok(Vec::new());
        };
        let keys = self.keys(sampler, range.count)?;
        let channel = |index: usize| Channel {
            target: ChannelTarget::Weight((range.first + index) as u16),
            interpolation: interpolation(sampler),
            times: keys.times.clone(),
            values: keys.values.iter().skip(index).step_by(keys.width).copied().collect(),
        };
        // The repeated times count, too.
        let times = keys.times.len().saturating_mul(range.count);
        add_within(&mut self.numbers, times, MAX_NUMBERS, "numbers in key frames")?;
        Ok((0..range.count).map(channel).collect())
    }

    fn keys(&mut self, sampler: &animation::Sampler, width: usize) -> Result<Keys> {
        let parts = if interpolation(sampler) == Interpolation::CubicSpline { 3 } else { 1 };
        let input = Accessor::open(self.document, sampler.input.value(), &[1])?;
        let output = Accessor::open(self.document, sampler.output.value(), &[1, width])?;
        let (keys, numbers) = (input.count(), output.count().saturating_mul(output.width()));
        ensure!(
            keys > 0 && keys.saturating_mul(width * parts) == numbers,
            "has {keys} times for {numbers} numbers; export it again"
        );
        add_within(&mut self.numbers, keys + numbers, MAX_NUMBERS, "numbers in key frames")?;
        let times: Vec<f32> = input.floats::<1>(0.0).into_iter().flatten().collect();
        let values = flat(&output);
        let finite = times.iter().chain(&values).all(|number| number.is_finite());
        ensure!(finite, "has a key frame that is not finite; export it again");
        Ok(ascending(Keys { times, values, width, parts }))
    }
}

fn flat(accessor: &Accessor) -> Vec<f32> {
    match accessor.width() {
        1 => accessor.floats::<1>(0.0).into_flattened(),
        3 => accessor.floats::<3>(0.0).into_flattened(),
        width => {
            let elements = accessor.floats::<4>(0.0);
            elements.iter().flat_map(|element| &element[..width.min(4)]).copied().collect()
        }
    }
}

/// Leaves out keys that are not later than the one before, which some exporters repeat.
fn ascending(keys: Keys) -> Keys {
    if keys.times.is_sorted_by(|a, b| a < b) {
        return keys;
    }
    let stride = keys.width * keys.parts;
    let mut kept = Keys { times: Vec::new(), values: Vec::new(), ..keys };
    for (&time, values) in keys.times.iter().zip(keys.values.chunks_exact(stride)) {
        if kept.times.last().is_none_or(|&last| time > last) {
            kept.times.push(time);
            kept.values.extend(values);
        }
    }
    kept
}

fn interpolation(sampler: &animation::Sampler) -> Interpolation {
    match sampler.interpolation {
        Checked::Valid(animation::Interpolation::Step) => Interpolation::Step,
        Checked::Valid(animation::Interpolation::CubicSpline) => Interpolation::CubicSpline,
        Checked::Valid(animation::Interpolation::Linear) | Checked::Invalid => {
            Interpolation::Linear
        }
    }
}
