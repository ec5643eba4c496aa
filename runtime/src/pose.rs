//! Pose: clips or joints to a matrix per bind and a weight per morph target.

use dermis_format::Avatar;
use dermis_format::rig::{Channel, Clip, Property};

use crate::error::Error;
use crate::math::{Affine, Real, affine_of, compose};

/// How the avatar stands.
#[derive(Clone, Copy, Debug)]
pub enum Pose<'a> {
    /// As it rests.
    Rest,
    /// A moment of a clip of the file.
    Clip {
        /// Index of the clip.
        clip: usize,
        /// Seconds from its start; held before the start and after the end.
        seconds: f32,
    },
    /// Joints → world, and morph weights, as many as the avatar has.
    Joints {
        /// Rows of 3×4 matrices, metres.
        worlds: &'a [Affine],
        /// Weight of each morph target.
        weights: &'a [f32],
    },
    /// Vertices in the world, metres, as many as the avatar has: skinned by the caller.
    Vertices(&'a [[f32; 3]]),
}

/// Fills `matrices` (bind space → world) and `weights`; `joints` is working space of the length of
/// the skeleton.
pub(crate) fn evaluate(
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    joints: &mut [Affine],
    matrices: &mut [Affine],
    weights: &mut [f32],
) -> Result<(), Error> {
    match *pose {
        Pose::Joints { worlds, weights: given } => {
            copy("joints", joints, worlds)?;
            copy("morph weights", weights, given)?;
        }
        Pose::Clip { clip: index, seconds } => {
            // Of a prefix of a file some may not be there.
            let clips = avatar.clips().count();
            let clip = avatar.clips().nth(index).ok_or(Error::Clip { clips, index })?;
            rest(avatar, joints, weights);
            apply(&clip, seconds, joints, weights);
            to_world(avatar, joints);
        }
        Pose::Rest | Pose::Vertices(_) => {
            rest(avatar, joints, weights);
            to_world(avatar, joints);
        }
    }
    for (matrix, bind) in matrices.iter_mut().zip(avatar.binds()) {
        let inverse = bind.inverse.map(|row| row.map(|x| x.get()));
        let world = joints.get(usize::from(bind.joint.get()));
        *matrix = world.map_or(inverse, |world| compose(world, &inverse));
    }
    Ok(())
}

pub(crate) fn copy<T: Copy>(what: &'static str, to: &mut [T], from: &[T]) -> Result<(), Error> {
    if to.len() != from.len() {
        return Err(Error::Pose { what, expected: to.len(), found: from.len() });
    }
    to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
    Ok(())
}

/// Until [`to_world`] a joint's slot holds its local transform: translation, rotation, scale.
fn rest(avatar: &Avatar<'_>, joints: &mut [Affine], weights: &mut [f32]) {
    for (slot, joint) in joints.iter_mut().zip(avatar.joints()) {
        let [x, y, z] = joint.translation.map(|x| x.get());
        let rotation = joint.rotation.map(|x| x.get());
        let [u, v, w] = joint.scale.map(|x| x.get());
        *slot = [[x, y, z, 0.0], rotation, [u, v, w, 0.0]];
    }
    for (weight, target) in weights.iter_mut().zip(avatar.morph_targets()) {
        *weight = target.default_weight;
    }
}

fn to_world(avatar: &Avatar<'_>, joints: &mut [Affine]) {
    for (index, joint) in avatar.joints().iter().enumerate() {
        let Some(&[[x, y, z, _], rotation, [u, v, w, _]]) = joints.get(index) else { return };
        let local = affine_of([x, y, z], rotation, [u, v, w]);
        let parent = joints.get(usize::from(joint.parent.get()));
        let world = parent.map_or(local, |parent| compose(parent, &local));
        if let Some(slot) = joints.get_mut(index) {
            *slot = world;
        }
    }
}

fn apply(clip: &Clip<'_>, seconds: f32, joints: &mut [Affine], weights: &mut [f32]) {
    for channel in clip.channels() {
        let at = Moment::new(&channel, clip.seconds, seconds);
        match channel.property {
            Property::Translation(joint) => {
                if let Some([slot, _, _]) = joints.get_mut(usize::from(joint)) {
                    *slot = at.vector(&channel);
                }
            }
            Property::Rotation(joint) => {
                if let Some([_, slot, _]) = joints.get_mut(usize::from(joint)) {
                    *slot = at.rotation(&channel);
                }
            }
            Property::Scale(joint) => {
                if let Some([_, _, slot]) = joints.get_mut(usize::from(joint)) {
                    *slot = at.vector(&channel);
                }
            }
            Property::Weight(target) => {
                if let Some(weight) = weights.get_mut(usize::from(target)) {
                    *weight = at.mix(&channel, 0);
                }
            }
        }
    }
}

/// A time between two keys.
struct Moment {
    key: usize,
    next: usize,
    fraction: f32,
}

impl Moment {
    fn new(channel: &Channel<'_>, length: f32, seconds: f32) -> Self {
        let last = channel.keys - 1;
        if last == 0 || !(length > 0.0) {
            return Self { key: 0, next: 0, fraction: 0.0 };
        }
        let at = (seconds / length).at_least(0.0).at_most(1.0) * last as f32;
        let key = (at as usize).min(last);
        let fraction = if channel.holds { 0.0 } else { at - key as f32 };
        Self { key, next: (key + 1).min(last), fraction }
    }

    fn mix(&self, channel: &Channel<'_>, component: usize) -> f32 {
        let value = channel.value(self.key, component);
        if self.fraction == 0.0 {
            return value;
        }
        value + self.fraction * (channel.value(self.next, component) - value)
    }

    fn vector(&self, channel: &Channel<'_>) -> [f32; 4] {
        [self.mix(channel, 0), self.mix(channel, 1), self.mix(channel, 2), 0.0]
    }

    /// Normalized linear interpolation along the shorter arc. Against the spherical one the turn is
    /// off by at most 0.0042 θ³ for keys θ ≤ π/2 radians apart (0.04° for 30°, 0.93° for 90°): too
    /// little before the middle, too much after it.
    fn rotation(&self, channel: &Channel<'_>) -> [f32; 4] {
        let key = |key| core::array::from_fn::<f32, 4, _>(|i| channel.value(key, i));
        let (a, b) = (key(self.key), key(self.next));
        let dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
        let sign = if dot < 0.0 { -1.0 } else { 1.0 };
        let mixed: [f32; 4] = core::array::from_fn(|i| a[i] + self.fraction * (sign * b[i] - a[i]));
        let length2: f32 = mixed.iter().map(|x| x * x).sum();
        if length2 > 1e-12 { mixed } else { [1.0, 0.0, 0.0, 0.0] }
    }
}

#[cfg(test)]
mod tests {
    /// Walks the domain of the bound that interpolation of rotations states.
    #[test]
    fn normalized_interpolation_is_within_its_bound() {
        for step in 1..=90 {
            let apart = (step as f64).to_radians();
            // Quaternions of turns about one axis lie on a circle, at half the turn.
            let (sin, cos) = libm::sincos(apart / 2.0);
            for part in 0..=100 {
                let t = f64::from(part) / 100.0;
                let turn = 2.0 * libm::atan2(t * sin, 1.0 - t + t * cos);
                let error = turn - t * apart;
                assert!(error.abs() <= 0.0042 * apart * apart * apart, "{step}° at {t}: {error}");
                assert!(
                    error * (t - 0.5) >= -1e-12,
                    "too little before the middle, too much after"
                );
            }
        }
    }
}
