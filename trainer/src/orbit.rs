//! A camera that circles an avatar.

use anyhow::Result;
use dermis_runtime::{Avatar, Camera, Kernel, Pose, Posed};
use glam::Vec3;

use crate::scene::{Bounds, RigScale, camera_towards};

/// Where a camera stands.
#[derive(Clone, Copy, Debug)]
pub struct Orbit {
    /// Degrees to the avatar's left; 0 looks at its front.
    pub yaw: f32,
    /// Degrees above the horizon.
    pub pitch: f32,
    /// Metres from the middle of the posed box; by default all of the box is seen.
    pub distance: Option<f32>,
}

impl Orbit {
    /// A camera that looks at the middle of the posed avatar, as high as those of training.
    pub fn camera(
        &self,
        avatar: &Avatar<'_>,
        pose: &Pose<'_>,
        width: u32,
        height: u32,
    ) -> Result<Camera> {
        let mut scratch = vec![0; Posed::scratch_len(avatar)];
        let posed = Posed::new(avatar, pose, Kernel::detect(), &mut scratch)?;
        let vertices: Vec<Vec3> = posed.vertices().iter().copied().map(Vec3::from).collect();
        let corners = [avatar.header().box_min, avatar.header().box_max].map(Vec3::from);
        let bounds = Bounds::of(if vertices.is_empty() { &corners } else { &vertices });
        let vertical_fov = RigScale::of_extent(bounds.largest_extent()).vertical_fov;
        let (yaw, pitch) = (self.yaw.to_radians(), self.pitch.to_radians());
        let direction = Vec3::new(yaw.sin() * pitch.cos(), pitch.sin(), yaw.cos() * pitch.cos());
        let distance = self.distance.unwrap_or_else(|| {
            // The ball around the box touches the narrower pair of sides of the view.
            let half_height = (vertical_fov / 2.0).tan();
            let half = half_height.min(half_height * width as f32 / height as f32).atan();
            bounds.min.distance(bounds.max) / 2.0 / half.sin()
        });
        Ok(camera_towards(bounds.center(), direction, distance, vertical_fov, width, height))
    }
}
