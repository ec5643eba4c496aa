//! The mesh at rest: triangles with their frames and areas.

use dermis_format::FrameKind;
use dermis_runtime::frame::Frame;
use glam::Vec3;

/// A point on a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Index of the triangle.
    pub triangle: u32,
    /// Weights of its corners; their sum is 1.
    pub barycentrics: Vec3,
}

/// A mesh at rest.
#[derive(Clone, Debug)]
pub struct Surface {
    corners: Vec<[Vec3; 3]>,
    frames: Vec<Option<Frame<f32>>>,
    areas: Vec<f32>,
}

impl Surface {
    /// Of triangles with corners at `vertices`, metres.
    pub fn new(vertices: &[[f32; 3]], triangles: &[[u32; 3]]) -> Self {
        let corners: Vec<[[f32; 3]; 3]> =
            triangles.iter().map(|t| t.map(|i| vertices[i as usize])).collect();
        let frames: Vec<_> =
            corners.iter().map(|c| Frame::of_triangle(FrameKind::Area, *c)).collect();
        // The axes of a frame are as long as the root of the area.
        let area = |frame: &Frame<f32>| Vec3::from(frame.z).length_squared();
        let areas = frames.iter().map(|frame| frame.as_ref().map_or(0.0, area)).collect();
        Self { corners: corners.into_iter().map(|c| c.map(Vec3::from)).collect(), frames, areas }
    }

    /// Number of triangles.
    pub fn len(&self) -> usize {
        self.areas.len()
    }

    /// Whether there are no triangles.
    pub fn is_empty(&self) -> bool {
        self.areas.is_empty()
    }

    /// Area of a triangle, m²; 0 where it has no frame.
    pub fn area(&self, triangle: u32) -> f32 {
        self.areas[triangle as usize]
    }

    /// Unit normal of a triangle; 0 where it has no frame.
    pub fn normal(&self, triangle: u32) -> Vec3 {
        self.frames[triangle as usize]
            .as_ref()
            .map_or(Vec3::ZERO, |f| Vec3::from(f.z).normalize_or_zero())
    }

    /// A point in the world, metres.
    pub fn position(&self, point: &SurfacePoint) -> Vec3 {
        let [a, b, c] = self.corners[point.triangle as usize];
        let w = point.barycentrics;
        a * w.x + b * w.y + c * w.z
    }

    /// A point in the frame of its triangle, in units of the frame's size.
    pub fn local(&self, point: &SurfacePoint) -> [f32; 3] {
        let Some(frame) = &self.frames[point.triangle as usize] else { return [0.0; 3] };
        let arm = self.position(point) - Vec3::from(frame.origin);
        [frame.x, frame.y, frame.z].map(|axis| {
            let axis = Vec3::from(axis);
            arm.dot(axis) / axis.length_squared()
        })
    }

    /// Barycentrics of the foot of a local point (units of the frame's size) on its triangle's plane.
    pub fn barycentrics(&self, triangle: u32, [x, y, _]: [f32; 3]) -> Vec3 {
        let local = |corner: Vec3| self.local(&SurfacePoint { triangle, barycentrics: corner });
        let [a, b, c] = Vec3::AXES.map(local);
        let cross = |p: [f32; 2], q: [f32; 2]| p[0] * q[1] - p[1] * q[0];
        let arm = |corner: [f32; 3]| [corner[0] - x, corner[1] - y];
        let (a, b, c) = (arm(a), arm(b), arm(c));
        // Twice the areas that the point spans with the sides; the triangle's own is 1.
        let weights = Vec3::new(cross(b, c), cross(c, a), cross(a, b));
        let sum = weights.element_sum();
        if sum > 0.0 { weights / sum } else { Vec3::splat(1.0 / 3.0) }
    }
}
