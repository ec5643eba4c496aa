//! Which clips and which of their moments are trained on and measured.

use anyhow::{Context, Result};
use glam::Vec3;
use rayon::prelude::*;

use super::pose::{Pose, posed_vertices};
use super::rig::Bounds;
use crate::model::{Model, MorphTarget};

/// Candidates stand on a grid of this many to the second ...
const CANDIDATES_PER_SECOND: f32 = 30.0;
/// ... thinned out evenly where the clips together hold more than this many.
const MAX_CANDIDATES: usize = 4096;
/// Poses are compared by at most this many vertices.
const MAX_PROBES: usize = 256;

/// A moment of a clip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeyFrame {
    /// Index into [`Model::clips`]; `None` is the rest pose.
    pub clip: Option<usize>,
    /// Since the clip's start.
    pub seconds: f32,
}

impl KeyFrame {
    /// The rest pose.
    pub const REST: Self = Self { clip: None, seconds: 0.0 };

    /// The pose of that moment.
    ///
    /// # Panics
    /// If `model` has no such clip.
    pub fn pose(&self, model: &Model) -> Pose {
        match self.clip {
            Some(clip) => Pose::of_clip(model, clip, self.seconds),
            None => Pose::rest(model),
        }
    }
}

/// Indices of the clips with these names, in that order.
///
/// # Errors
/// If there is no clip of a name; the message lists the names there are.
pub fn clips_named(model: &Model, names: &[String]) -> Result<Vec<usize>> {
    names
        .iter()
        .map(|name| {
            model.clips.iter().position(|clip| clip.name == *name).with_context(|| {
                let known: Vec<&str> = model.clips.iter().map(|clip| clip.name.as_str()).collect();
                let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
                format!("no clip is named {name:?}; there are: {known}")
            })
        })
        .collect()
}

/// The clips that are trained on: `chosen`, or all but the last, which is left for reenactment
/// unless it is the only one.
pub fn training_clips(model: &Model, chosen: Option<&[usize]>) -> Vec<usize> {
    let clips = model.clips.len();
    match chosen {
        Some(chosen) => chosen.to_vec(),
        None if clips > 1 => (0..clips - 1).collect(),
        None => (0..clips).collect(),
    }
}

/// The clips left for reenactment: those not trained on.
pub fn reenactment_clips(model: &Model, trained: &[usize]) -> Vec<usize> {
    (0..model.clips.len()).filter(|clip| !trained.contains(clip)).collect()
}

/// The `count` most different moments of the clips `trained`; fewer where fewer differ, and the
/// rest pose where there are no clips.
pub fn training_key_frames(model: &Model, trained: &[usize], count: usize) -> Vec<KeyFrame> {
    if trained.is_empty() {
        return vec![KeyFrame::REST; count.min(1)];
    }
    most_different(model, trained, count)
}

/// The `count` most different moments of the clips that are not `trained` on; fewer where fewer
/// differ, none where all clips are trained on.
pub fn reenactment_key_frames(model: &Model, trained: &[usize], count: usize) -> Vec<KeyFrame> {
    most_different(model, &reenactment_clips(model, trained), count)
}

/// Farthest-point selection. The first is the candidate nearest to the mean of all, so that a
/// single key frame is a typical one; each further one is the candidate whose nearest chosen
/// one is farthest. Ties go to the earlier candidate.
fn most_different(model: &Model, clips: &[usize], count: usize) -> Vec<KeyFrame> {
    let candidates = candidates(model, clips);
    if candidates.is_empty() {
        return Vec::new();
    }
    let probes = probes(model);
    let shapes: Vec<Vec<Vec3>> =
        candidates.par_iter().map(|key| shape(&probes, &key.pose(model))).collect();

    let share = 1.0 / shapes.len() as f32;
    let mean: Vec<Vec3> = (0..probes.vertices.len())
        .map(|i| shapes.iter().map(|shape| shape[i] * share).sum())
        .collect();
    let from_mean: Vec<f32> = shapes.iter().map(|shape| difference(shape, &mean)).collect();
    let mut next = first_of(&from_mean, |a, b| a < b);

    let mut chosen = Vec::new();
    let mut from_chosen = vec![f32::INFINITY; shapes.len()];
    while chosen.len() < count && from_chosen[next] > 0.0 {
        chosen.push(candidates[next]);
        for (nearest, shape) in from_chosen.iter_mut().zip(&shapes) {
            *nearest = nearest.min(difference(shape, &shapes[next]));
        }
        next = first_of(&from_chosen, |a, b| a > b);
    }
    chosen
}

/// Every moment of `clips` that may be chosen.
fn candidates(model: &Model, clips: &[usize]) -> Vec<KeyFrame> {
    let grids = clips.iter().map(|&clip| {
        let first = model.clips[clip]
            .channels
            .iter()
            .filter_map(|channel| channel.times.first())
            .fold(f32::INFINITY, |first, &time| first.min(time));
        let last = model.clips[clip].seconds;
        // A clip without channels, or with one key, has one moment.
        let start = if first < last { first.max(0.0) } else { last };
        // Capped, so that lengths beyond reason can still be added up.
        let steps = ((last - start) * CANDIDATES_PER_SECOND).floor().min(1e15) as usize;
        (clip, start, steps + 1)
    });
    let grids: Vec<(usize, f32, usize)> = grids.collect();
    let all = grids.iter().map(|&(_, _, moments)| moments).fold(0, usize::saturating_add);
    let stride = all.div_ceil(MAX_CANDIDATES).max(1);
    let mut kept = Vec::new();
    // Moments from the clip's first to the next that is kept.
    let mut next = 0;
    for (clip, start, moments) in grids {
        kept.extend((next..moments).step_by(stride).map(|step| KeyFrame {
            clip: Some(clip),
            seconds: start + step as f32 / CANDIDATES_PER_SECOND,
        }));
        let passed = moments.saturating_sub(next).div_ceil(stride) * stride;
        next = next + passed - moments;
    }
    kept
}

/// The model with few of its vertices and nothing to draw, for posing many times.
fn probes(model: &Model) -> Model {
    let stride = model.vertices.len().div_ceil(MAX_PROBES).max(1);
    let kept = |&(vertex, delta): &(u32, Vec3)| {
        (vertex as usize).is_multiple_of(stride).then_some((vertex / stride as u32, delta))
    };
    Model {
        vertices: model.vertices.iter().step_by(stride).copied().collect(),
        morph_targets: model
            .morph_targets
            .iter()
            .map(|target| MorphTarget {
                name: target.name.clone(),
                deltas: target.deltas.iter().filter_map(kept).collect(),
                default_weight: target.default_weight,
            })
            .collect(),
        joints: model.joints.clone(),
        binds: model.binds.clone(),
        ..Model::default()
    }
}

/// Posed probes around the centre of their box: the rig follows the avatar, so where it stands
/// makes no difference.
fn shape(probes: &Model, pose: &Pose) -> Vec<Vec3> {
    let mut posed = posed_vertices(probes, pose);
    let center = Bounds::of(&posed).center();
    posed.iter_mut().for_each(|position| *position -= center);
    posed
}

/// Sum of squared distances.
fn difference(a: &[Vec3], b: &[Vec3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a.distance_squared(*b)).sum()
}

/// Index of the first value that none `beats`.
fn first_of(values: &[f32], beats: impl Fn(f32, f32) -> bool) -> usize {
    (1..values.len()).fold(0, |best, i| if beats(values[i], values[best]) { i } else { best })
}
