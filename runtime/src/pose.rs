//! Pose: clips or joints to a matrix per bind and a weight per morph target.

use core::cmp::Ordering;

use dermis_format::Avatar;
use dermis_format::record::JointRecord;
use dermis_format::rig::{Channel, Clip, Property};

use crate::error::Error;
use crate::math::{Affine, IDENTITY, Real, affine_of, compose, inverse};

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
    /// Joints → world, and morph weights, as many as the avatar has. Training leaves joints out that move nothing and adds some
    /// above others: find yours by name, not by their place in the mesh's file.
    Joints {
        /// Rows of 3×4 matrices, metres, one for each of [`Avatar::joints`] (names: [`Avatar::joint_names`]), those of the
        /// joints above included; inverse bind matrices are applied here.
        worlds: &'a [Affine],
        /// Weight of each morph target.
        weights: &'a [f32],
    },
    /// Vertices in the world, metres, as many as the avatar has: skinned by the caller.
    Vertices(&'a [[f32; 3]]),
    /// On a straight line from one pose to another, whose vertices these are ([`Posed::vertices`](crate::Posed::vertices)): what
    /// is seen between two frames in which poses are evaluated ([`crate::rate`]). Both of `Posed::new`, or for plans that have no
    /// fewer Gaussians in any region than what is drawn: what was not posed is a hole. A point that turns by θ around one r
    /// away comes r (1 − cos(θ / 2)) nearer to that, at most.
    Between {
        /// At share 0.
        from: &'a [[f32; 3]],
        /// At share 1.
        to: &'a [[f32; 3]],
        /// In [0, 1].
        share: f32,
    },
}

/// Fills `matrices` (bind space → world) and `weights`; `joints` is working space of the length of
/// the skeleton. What moves the surface less than `still_below` metres stays as it rests: joints of clips with all below them, and
/// morph targets.
pub(crate) fn evaluate(
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    still_below: f32,
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
            let movements = avatar.movements();
            let moved = |joint: u16| movements.and_then(|m| m.of_joint(joint.into()));
            let moves = |joint| moved(joint).is_none_or(|metres| metres >= still_below);
            apply(&clip, seconds, moves, joints, weights);
            to_world(avatar, joints);
        }
        Pose::Rest | Pose::Vertices(_) | Pose::Between { .. } => {
            rest(avatar, joints, weights);
            to_world(avatar, joints);
        }
    }
    if let Some(movements) = avatar.movements() {
        for ((weight, target), index) in weights.iter_mut().zip(avatar.morph_targets()).zip(0..) {
            let metres = movements.of_target(index).unwrap_or(f32::INFINITY);
            if ((*weight - target.default_weight) * metres).abs() < still_below {
                *weight = target.default_weight;
            }
        }
    }
    for (matrix, bind) in matrices.iter_mut().zip(avatar.binds()) {
        let inverse = bind.inverse.map(|row| row.map(|x| x.get()));
        let world = joints.get(usize::from(bind.joint.get()));
        *matrix = world.map_or(inverse, |world| compose(world, &inverse));
    }
    Ok(())
}

/// What a pose does to the avatar as a whole: where the joint above all that move the mesh takes what is at rest. Footprints
/// of the rest pose in this place (`camera.for_place(&compose(&place, &carried))`) stand for those of the posed avatar, and cost
/// no skinning. Rigid, as [`Camera::for_place`](crate::Camera::for_place) asks, where no joint above is scaled. The identity where the
/// caller gives vertices, where nothing is above all, and where that hangs under more than 256 joints.
pub fn carried(avatar: &Avatar<'_>, pose: &Pose<'_>) -> Affine {
    let Some(top) = top_joint(avatar) else { return IDENTITY };
    let rest = world(avatar, top, |_| None);
    let posed = match *pose {
        Pose::Rest | Pose::Vertices(_) | Pose::Between { .. } => return IDENTITY,
        Pose::Joints { worlds, .. } => worlds.get(top).copied().unwrap_or(rest),
        Pose::Clip { clip, seconds } => {
            let Some(clip) = avatar.clips().nth(clip) else { return IDENTITY };
            world(avatar, top, |joint| {
                let mut local = rest_of(avatar.joints().get(joint)?);
                for channel in clip.channels() {
                    let (Property::Translation(moved)
                    | Property::Rotation(moved)
                    | Property::Scale(moved)) = channel.property
                    else {
                        continue;
                    };
                    if usize::from(moved) == joint {
                        move_joint(&clip, &channel, seconds, &mut local);
                    }
                }
                Some(local)
            })
        }
    };
    inverse(&rest).map_or(IDENTITY, |inverse| compose(&posed, &inverse))
}

/// The deepest joint above all that have binds.
fn top_joint(avatar: &Avatar<'_>) -> Option<usize> {
    let parent = |joint: usize| {
        let parent = usize::from(avatar.joints().get(joint)?.parent.get());
        (parent < joint).then_some(parent)
    };
    let mut joints = avatar.binds().iter().map(|bind| usize::from(bind.joint.get()));
    let first = joints.next()?;
    let top = joints.try_fold(first, |mut a, mut b| {
        // Parents stand before their children.
        for _ in 0..2 * DEEPEST {
            match a.cmp(&b) {
                Ordering::Equal => return Some(a),
                Ordering::Greater => a = parent(a)?,
                Ordering::Less => b = parent(b)?,
            }
        }
        None
    })?;
    let above = core::iter::successors(Some(top), |&joint| parent(joint));
    (above.take(DEEPEST + 1).count() <= DEEPEST).then_some(top)
}

/// Joints above each other that are looked at.
const DEEPEST: usize = 256;

/// World transform of a joint whose chain has these locals (translation, rotation, scale), or those in which it rests.
fn world(avatar: &Avatar<'_>, joint: usize, local: impl Fn(usize) -> Option<Affine>) -> Affine {
    let mut world = IDENTITY;
    let mut at = joint;
    while let Some(record) = avatar.joints().get(at) {
        let [[x, y, z, _], rotation, [u, v, w, _]] = local(at).unwrap_or_else(|| rest_of(record));
        world = compose(&affine_of([x, y, z], rotation, [u, v, w]), &world);
        let parent = usize::from(record.parent.get());
        if parent >= at {
            break;
        }
        at = parent;
    }
    world
}

pub(crate) fn copy<T: Copy>(what: &'static str, to: &mut [T], from: &[T]) -> Result<(), Error> {
    if to.len() != from.len() {
        return Err(Error::Pose { what, expected: to.len(), found: from.len() });
    }
    to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
    Ok(())
}

/// Fills `vertices` with those between two poses.
pub(crate) fn mix(
    vertices: &mut [[f32; 3]],
    from: &[[f32; 3]],
    to: &[[f32; 3]],
    share: f32,
) -> Result<(), Error> {
    copy("vertices", vertices, from)?;
    if to.len() != vertices.len() {
        return Err(Error::Pose { what: "vertices", expected: vertices.len(), found: to.len() });
    }
    for (vertex, to) in vertices.iter_mut().zip(to) {
        for (x, to) in vertex.iter_mut().zip(to) {
            *x += share * (to - *x);
        }
    }
    Ok(())
}

/// Until [`to_world`] a joint's slot holds its local transform: translation, rotation, scale.
fn rest(avatar: &Avatar<'_>, joints: &mut [Affine], weights: &mut [f32]) {
    for (slot, joint) in joints.iter_mut().zip(avatar.joints()) {
        *slot = rest_of(joint);
    }
    for (weight, target) in weights.iter_mut().zip(avatar.morph_targets()) {
        *weight = target.default_weight;
    }
}

fn rest_of(joint: &JointRecord) -> Affine {
    let [x, y, z] = joint.translation.map(|x| x.get());
    let rotation = joint.rotation.map(|x| x.get());
    let [u, v, w] = joint.scale.map(|x| x.get());
    [[x, y, z, 0.0], rotation, [u, v, w, 0.0]]
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

fn apply(
    clip: &Clip<'_>,
    seconds: f32,
    moves: impl Fn(u16) -> bool,
    joints: &mut [Affine],
    weights: &mut [f32],
) {
    for channel in clip.channels() {
        match channel.property {
            Property::Weight(target) => {
                if let Some(weight) = weights.get_mut(usize::from(target)) {
                    *weight = Moment::new(&channel, clip.seconds, seconds).mix(&channel, 0);
                }
            }
            Property::Translation(joint) | Property::Rotation(joint) | Property::Scale(joint) => {
                if moves(joint)
                    && let Some(local) = joints.get_mut(usize::from(joint))
                {
                    move_joint(clip, &channel, seconds, local);
                }
            }
        }
    }
}

/// Puts the value of a joint's channel into its local transform.
fn move_joint(
    clip: &Clip<'_>,
    channel: &Channel<'_>,
    seconds: f32,
    [translation, rotation, factors]: &mut Affine,
) {
    let at = Moment::new(channel, clip.seconds, seconds);
    match channel.property {
        Property::Translation(_) => *translation = at.vector(channel),
        Property::Rotation(_) => *rotation = at.rotation(channel),
        Property::Scale(_) => *factors = at.vector(channel),
        Property::Weight(_) => {}
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
