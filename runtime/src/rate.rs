//! How often the pose of an avatar is worth evaluating.
//!
//! A pose that is held for n frames is late by up to n − 1 of them: its surface is off by up to speed · (n − 1) · seconds of a
//! frame. The clip itself goes on: whoever evaluates it at the time of the frame keeps its duration, whatever n is. With two poses
//! at hand, one held frame late, [`Pose::Between`](crate::Pose::Between) moves from one to the other instead.

use dermis_format::Avatar;

use crate::math::Real;

/// Frames that a pose is held at most.
pub const MOST_FRAMES: u32 = 60;

/// Every how many frames, 1 to [`MOST_FRAMES`], a clip must be evaluated so that no held pose is off by more than `pixels` (root of
/// the mean square over the surface), `density` being pixels to a metre ([`Footprint`](crate::footprint::Footprint)) and
/// `frame_seconds` the time from frame to frame. 1 where the file does not say how fast the clip is. Who poses joints or vertices
/// puts the surface's own speed v, metres a second, in place of the clip's: 1 + ⌊pixels / (v · density · frame_seconds)⌋.
pub fn frames_to_hold(
    avatar: &Avatar<'_>,
    clip: usize,
    density: f32,
    frame_seconds: f32,
    pixels: f32,
) -> u32 {
    let speed = avatar.movements().and_then(|movements| movements.of_clip(clip));
    // px that the surface moves in a frame.
    let moved = speed.map_or(f32::INFINITY, |speed| speed * density * frame_seconds);
    let late = (pixels / moved).at_least(0.0).at_most((MOST_FRAMES - 1) as f32);
    // Saturates; NaN becomes 0.
    1 + late as u32
}

/// Whether instance `index` evaluates its pose in `frame`, if it holds poses for so many frames: instances take turns.
pub fn is_due(index: u32, frame: u32, frames_to_hold: u32) -> bool {
    frame.wrapping_add(index).checked_rem(frames_to_hold).unwrap_or(0) == 0
}
