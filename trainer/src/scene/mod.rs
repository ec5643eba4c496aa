//! What is trained on and measured against: the textured mesh, posed and seen by cameras.
//!
//! 1. [`keyframes`] chooses clips and moments: the most different ones.
//! 2. [`pose`] turns a moment into joint transforms and posed vertices.
//! 3. [`rig`] puts 42 cameras around them, or 42 others for novel views.
//! 4. [`texture`] prepares images for area sampling, and [`surface`] paints triangles with them.
//! 5. `raster` finds the sub-samples that a triangle covers, exactly; [`mesh_render`] puts it
//!    all together into the ground truth of one view; [`sight`] tells which vertices are seen.

pub mod keyframes;
pub mod mesh_render;
pub mod pose;
mod raster;
pub mod rig;
pub mod sight;
pub mod surface;
pub mod texture;

#[cfg(test)]
mod tests;

pub use keyframes::{
    KeyFrame, clips_named, reenactment_clips, reenactment_key_frames, training_clips,
    training_key_frames,
};
pub use mesh_render::{SideCount, Truth, View, render, render_views};
pub use pose::{Pose, posed_vertices};
pub use rig::{Bounds, RigScale, camera_towards, novel_directions, training_directions};
pub use sight::vertices_in_sight;
pub use surface::{Painter, srgb_decode, srgb_encode};
pub use texture::Footprint;
