//! How far joints and morph targets move the mesh: what animation may leave out where nobody sees it.

use crate::header::Header;
use crate::record::{Bf16, plane, take_plane};

/// The greatest number of a movement: the last bf16 that is not above 10⁶.
pub const MOST: f32 = 999_424.0;

/// Of all joints, morph targets and clips, in the file.
#[derive(Clone, Copy, Debug)]
pub struct Movements<'a> {
    joints: &'a [Bf16],
    targets: &'a [Bf16],
    clips: &'a [Bf16],
}

impl<'a> Movements<'a> {
    /// `None` where the payload is not as long as the header says, or holds numbers that no movement has.
    pub(crate) fn split(payload: &'a [u8], header: &Header) -> Option<Self> {
        let (joints, rest) = take_plane(payload, header.joints.into())?;
        let (targets, rest) = take_plane(rest, header.morph_targets.into())?;
        let clips: &[Bf16] = plane(rest)?;
        let numbers = [joints, targets, clips].into_iter().flatten();
        let valid = clips.len() == usize::from(header.clips)
            && numbers.into_iter().all(|number| (0.0..=MOST).contains(&number.get()));
        valid.then_some(Self { joints, targets, clips })
    }

    /// How far the surface is from where it belongs if this joint and those below it stay as they rest: root of the mean
    /// square over what they move, in the worst of the moments of all clips that were looked at, metres; no less than that of any joint below.
    pub fn of_joint(&self, joint: usize) -> Option<f32> {
        self.joints.get(joint).map(|number| number.get())
    }

    /// How far a morph target at weight 1 moves the vertices that it moves: root of the mean square, metres.
    pub fn of_target(&self, target: usize) -> Option<f32> {
        self.targets.get(target).map(|number| number.get())
    }

    /// How fast the surface is between the two keys of a clip where it is fastest: root of the mean square, m/s.
    pub fn of_clip(&self, clip: usize) -> Option<f32> {
        self.clips.get(clip).map(|number| number.get())
    }
}
