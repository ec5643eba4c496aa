//! Poses: from a clip or at rest, to joint transforms, to posed vertices.

use glam::{Affine3A, Quat, Vec3, Vec4};

use crate::model::{Channel, ChannelTarget, Interpolation, Model, Trs};

/// What can move in a [`Model`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    /// Transform of each joint to its parent, as [`Model::joints`].
    pub locals: Vec<Trs>,
    /// Weight of each morph target, as [`Model::morph_targets`].
    pub weights: Vec<f32>,
}

impl Pose {
    /// The pose of the file when no clip plays.
    pub fn rest(model: &Model) -> Self {
        Self {
            locals: model.joints.iter().map(|joint| joint.rest).collect(),
            weights: model.morph_targets.iter().map(|target| target.default_weight).collect(),
        }
    }

    /// The pose of clip `clip` (index into [`Model::clips`]) at `seconds`; what the clip does not
    /// move is at rest. Before a channel's first key and after its last the key holds.
    ///
    /// # Panics
    /// If the clip or something it moves does not exist.
    pub fn of_clip(model: &Model, clip: usize, seconds: f32) -> Self {
        let mut pose = Self::rest(model);
        for channel in &model.clips[clip].channels {
            match channel.target {
                ChannelTarget::Translation(joint) => {
                    pose.locals[usize::from(joint)].translation =
                        Vec3::from_array(interpolate(channel, seconds));
                }
                ChannelTarget::Rotation(joint) => {
                    pose.locals[usize::from(joint)].rotation =
                        interpolate_rotation(channel, seconds);
                }
                ChannelTarget::Scale(joint) => {
                    pose.locals[usize::from(joint)].scale =
                        Vec3::from_array(interpolate(channel, seconds));
                }
                ChannelTarget::Weight(target) => {
                    [pose.weights[usize::from(target)]] = interpolate(channel, seconds);
                }
            }
        }
        pose
    }

    /// Transform of each joint to the world, in metres, as [`Model::joints`].
    pub fn joint_worlds(&self, model: &Model) -> Vec<Affine3A> {
        let mut worlds: Vec<Affine3A> = Vec::with_capacity(model.joints.len());
        for (joint, local) in model.joints.iter().zip(&self.locals) {
            let local = Affine3A::from_scale_rotation_translation(
                local.scale,
                local.rotation,
                local.translation,
            );
            worlds.push(match joint.parent {
                Some(parent) => worlds[usize::from(parent)] * local,
                None => local,
            });
        }
        worlds
    }
}

/// Vertices in world space, in metres, as [`Model::vertices`]: morph targets, then linear blend
/// skinning. Without binds the morphed vertices are in world space already.
pub fn posed_vertices(model: &Model, pose: &Pose) -> Vec<Vec3> {
    let mut positions: Vec<Vec3> = model.vertices.iter().map(|vertex| vertex.position).collect();
    for (target, &weight) in model.morph_targets.iter().zip(&pose.weights) {
        if weight != 0.0 {
            for &(vertex, delta) in &target.deltas {
                positions[vertex as usize] += weight * delta;
            }
        }
    }
    if model.binds.is_empty() {
        return positions;
    }
    let worlds = pose.joint_worlds(model);
    let moves: Vec<Affine3A> =
        model.binds.iter().map(|bind| worlds[usize::from(bind.joint)] * bind.inverse).collect();
    for (position, vertex) in positions.iter_mut().zip(&model.vertices) {
        let bound = *position;
        *position = vertex
            .influences
            .iter()
            .filter(|&&(_, weight)| weight != 0.0)
            .map(|&(bind, weight)| weight * moves[usize::from(bind)].transform_point3(bound))
            .sum();
    }
    positions
}

/// Where a time falls between keys.
struct Segment {
    /// Indices of the keys before and after; equal outside the keys.
    keys: [usize; 2],
    /// Share of the way from the one to the other.
    share: f32,
    /// Seconds between them.
    seconds: f32,
}

fn segment(times: &[f32], seconds: f32) -> Segment {
    let next = times.partition_point(|&time| time <= seconds);
    if next == 0 || next == times.len() {
        let key = next.saturating_sub(1);
        return Segment { keys: [key; 2], share: 0.0, seconds: 0.0 };
    }
    let span = times[next] - times[next - 1];
    Segment { keys: [next - 1, next], share: (seconds - times[next - 1]) / span, seconds: span }
}

/// The `N` numbers at `index` in units of `N`.
fn numbers<const N: usize>(channel: &Channel, index: usize) -> [f32; N] {
    std::array::from_fn(|i| channel.values[index * N + i])
}

/// The channel's value, component by component.
fn interpolate<const N: usize>(channel: &Channel, seconds: f32) -> [f32; N] {
    let at = segment(&channel.times, seconds);
    let [before, after] = at.keys;
    match channel.interpolation {
        Interpolation::Step => numbers(channel, before),
        Interpolation::Linear => {
            let (a, b): ([f32; N], [f32; N]) = (numbers(channel, before), numbers(channel, after));
            std::array::from_fn(|i| a[i] + at.share * (b[i] - a[i]))
        }
        Interpolation::CubicSpline => {
            // A key holds in-tangent, value, out-tangent; tangents are per second.
            let (a, leave): ([f32; N], [f32; N]) =
                (numbers(channel, 3 * before + 1), numbers(channel, 3 * before + 2));
            let (arrive, b): ([f32; N], [f32; N]) =
                (numbers(channel, 3 * after), numbers(channel, 3 * after + 1));
            let t = at.share;
            let (t2, t3) = (t * t, t * t * t);
            std::array::from_fn(|i| {
                (2.0 * t3 - 3.0 * t2 + 1.0) * a[i]
                    + (t3 - 2.0 * t2 + t) * at.seconds * leave[i]
                    + (3.0 * t2 - 2.0 * t3) * b[i]
                    + (t3 - t2) * at.seconds * arrive[i]
            })
        }
    }
}

/// The channel's value as a unit quaternion.
fn interpolate_rotation(channel: &Channel, seconds: f32) -> Quat {
    let unit = |xyzw: [f32; 4]| {
        Vec4::from_array(xyzw).try_normalize().map_or(Quat::IDENTITY, Quat::from_vec4)
    };
    if channel.interpolation != Interpolation::Linear {
        return unit(interpolate(channel, seconds));
    }
    let at = segment(&channel.times, seconds);
    let [a, b] = at.keys.map(|key| unit(numbers(channel, key)));
    // The shorter way round, as glTF asks.
    a.slerp(b, at.share)
}
