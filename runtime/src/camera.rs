//! Pinhole camera in OpenCV's axes: x right, y down, z forward.

use crate::math::{Affine, Scalar, compose};

/// A pinhole camera. Pixel (0, 0) has its centre at (0.5, 0.5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Focal length along x, pixels.
    pub fx: f32,
    /// Focal length along y, pixels.
    pub fy: f32,
    /// Principal point, pixels.
    pub cx: f32,
    /// Principal point, pixels.
    pub cy: f32,
    /// World → camera: rows of a 3×4 rigid transform, metres.
    pub world_to_camera: [[f32; 4]; 3],
}

impl Camera {
    /// The same camera for an avatar that stands at `place` (its own axes → world, rigid): what it draws is where it is
    /// drawn.
    pub fn for_place(&self, place: &Affine) -> Self {
        Self { world_to_camera: compose(&self.world_to_camera, place), ..*self }
    }

    /// Centre of projection in world axes, metres: −Rᵀ t.
    pub fn position<R: Scalar>(&self) -> [R; 3] {
        let m = self.world_to_camera.map(|row| row.map(R::of));
        core::array::from_fn(|i| -(m[0][i] * m[0][3] + m[1][i] * m[1][3] + m[2][i] * m[2][3]))
    }
}
