//! Where the cases are seen from.
//!
//! Numbers are written down, not made by sines, whose last bits differ between platforms' libraries.

use dermis_runtime::Camera;

/// A camera for frames of any size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// World → camera: rows of a 3×4 rigid transform, metres.
    pub world_to_camera: [[f32; 4]; 3],
    /// Focal lengths along x and y, in units of the frame's greater side.
    pub focal: [f32; 2],
    /// Principal point, in units of the frame's width and height.
    pub center: [f32; 2],
}

impl View {
    const fn new(world_to_camera: [[f32; 4]; 3]) -> Self {
        Self { world_to_camera, focal: [1.072_253_5; 2], center: [0.5; 2] }
    }

    /// As a camera of `width × height` pixels.
    pub fn camera(&self, [width, height]: [u32; 2]) -> Camera {
        let side = width.max(height) as f32;
        Camera {
            width,
            height,
            fx: self.focal[0] * side,
            fy: self.focal[1] * side,
            cx: self.center[0] * width as f32,
            cy: self.center[1] * height as f32,
            world_to_camera: self.world_to_camera,
        }
    }
}

/// Looks along −Z from `(x, y, z)`.
const fn from_front(x: f32, y: f32, z: f32) -> View {
    View::new([[1.0, 0.0, 0.0, -x], [0.0, -1.0, 0.0, y], [0.0, 0.0, -1.0, z]])
}

/// The whole figure from 2 m before it.
pub const FRONT: View = from_front(0.0, 0.85, 2.0);

/// The figure from its left.
pub const SIDE: View =
    View::new([[0.0, 0.0, -1.0, 0.0], [0.0, -1.0, 0.0, 0.85], [-1.0, 0.0, 0.0, 2.0]]);

/// The figure from behind.
pub const BACK: View =
    View::new([[-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.85], [0.0, 0.0, 1.0, 2.0]]);

/// 37° to one side and 53° above the horizon: a turn about Y by (0.8, 0.6), then a tilt by (0.6, 0.8).
pub const OBLIQUE: View =
    View::new([[0.8, 0.0, -0.6, 0.0], [-0.48, -0.6, -0.64, 0.6], [-0.36, 0.8, -0.48, 1.7]]);

/// The front, rolled by 53° about the line of sight.
pub const ROLLED: View =
    View::new([[0.6, -0.8, 0.0, 0.68], [-0.8, -0.6, 0.0, 0.51], [0.0, 0.0, -1.0, 2.0]]);

/// The face from 25 cm before it.
pub const NEAR: View = from_front(0.0, 1.45, 0.45);

/// So near that the face crosses the near plane.
pub const TOUCHING: View = from_front(0.02, 1.48, 0.2);

/// Inside the chest, looking out.
pub const INSIDE: View = from_front(0.0, 1.0, 0.0);

/// At the feet, looking up along the body, which the plane of the camera cuts.
pub const FROM_BELOW: View =
    View::new([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, -0.3]]);

/// 40 m away: every Gaussian is far smaller than a pixel.
pub const FAR: View = from_front(0.0, 0.85, 40.0);

/// 40 m away through a telescope.
pub const TELESCOPE: View = View { focal: [19.0; 2], ..FAR };

/// 5 km away.
pub const HORIZON: View = from_front(0.0, 0.85, 5000.0);

/// Turned away: all is behind the camera.
pub const AWAY: View =
    View::new([[-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.85], [0.0, 0.0, 1.0, -2.0]]);

/// Beside the figure: all is before the camera and outside the frame, some of it only just.
pub const OFF_SCREEN: View = from_front(1.4, 0.85, 2.0);

/// The figure at the frame's corner.
pub const CORNER: View = from_front(0.8, 1.6, 2.0);

/// 127° wide, from near by: the Jacobian is clamped at the sides.
pub const WIDE: View = View { focal: [0.25; 2], ..from_front(0.0, 0.85, 0.6) };

/// Unequal focal lengths and a principal point off the middle.
pub const SKEWED: View = View { focal: [0.7, 1.4], center: [0.25, 0.625], ..FRONT };

/// The ribbon from its left at 0.35 s of its clip.
pub const RIBBON: View = View::new([
    [0.819_151_94, 0.0, -0.573_576_4, 0.085_091_53],
    [0.099_600_494, -0.984_807_67, 0.142_244_23, 0.525_980_95],
    [-0.564_862_55, -0.173_648_18, -0.806_707_26, 1.660_502_1],
]);

/// What stands about the origin, from one side and above.
pub const ORIGIN: View = View::new([
    [0.939_692_6, 0.0, 0.342_020_12, 0.0],
    [-0.144_543_95, -0.906_307_7, 0.397_131_26, 0.0],
    [0.309_975_5, -0.422_618_27, -0.851_650_7, 1.56],
]);

/// From the origin itself.
pub const AT_ORIGIN: View = from_front(0.0, 0.0, 0.0);

/// Cameras that are none: nothing of them may reach a pixel.
pub mod broken {
    use super::{FRONT, View};

    const NAN: f32 = f32::NAN;
    const INFINITY: f32 = f32::INFINITY;
    const ROWS: [[f32; 4]; 3] = FRONT.world_to_camera;

    /// A rotation that is none.
    pub const NAN_ROTATION: View = View::new([[1.0, NAN, 0.0, 0.0], ROWS[1], ROWS[2]]);
    /// All of it.
    pub const NAN_ALL: View =
        View { world_to_camera: [[NAN; 4]; 3], focal: [NAN; 2], center: [NAN; 2] };
    /// A depth that is none.
    pub const NAN_DEPTH: View = View::new([ROWS[0], ROWS[1], [0.0, 0.0, -1.0, NAN]]);
    /// Infinitely far away.
    pub const INFINITE_DEPTH: View = View::new([ROWS[0], ROWS[1], [0.0, 0.0, -1.0, INFINITY]]);
    /// Infinitely far to the side.
    pub const INFINITE_SIDE: View = View::new([[1.0, 0.0, 0.0, -INFINITY], ROWS[1], ROWS[2]]);
    /// No rotation at all.
    pub const ZERO_ROTATION: View = View::new([[0.0; 4]; 3]);
    /// No focal length.
    pub const ZERO_FOCAL: View = View { focal: [0.0; 2], ..FRONT };
    /// A focal length that is none.
    pub const NAN_FOCAL: View = View { focal: [NAN, 1.0], ..FRONT };
    /// Upside down and mirrored.
    pub const NEGATIVE_FOCAL: View = View { focal: [-1.0, -1.0], ..FRONT };
    /// As long as a number can be.
    pub const HUGE_FOCAL: View = View { focal: [1e30, 1e30], ..FRONT };
    /// As short as a number can be.
    pub const TINY_FOCAL: View = View { focal: [1e-40, 1e-40], ..FRONT };
    /// A principal point that is nowhere.
    pub const INFINITE_CENTER: View = View { center: [INFINITY, 0.5], ..FRONT };
    /// A principal point that is none.
    pub const NAN_CENTER: View = View { center: [0.5, NAN], ..FRONT };
}
