//! Pinhole camera in OpenCV's axes: x right, y down, z forward.

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
