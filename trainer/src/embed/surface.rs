//! The mesh at rest: triangles with their frames and areas.

use dermis_format::FrameKind;
use dermis_runtime::frame::Frame;
use glam::{Mat2, Mat3, Vec2, Vec3};

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
    /// Of triangles with corners at `vertices`, metres, and frames of a kind whose size is the root of the area.
    pub fn new(kind: FrameKind, vertices: &[[f32; 3]], triangles: &[[u32; 3]]) -> Self {
        let corners: Vec<[[f32; 3]; 3]> =
            triangles.iter().map(|t| t.map(|i| vertices[i as usize])).collect();
        let frames: Vec<_> = corners.iter().map(|c| Frame::of_triangle(kind, *c)).collect();
        // A frame's z is as long as the root of the area.
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

    /// Corners of a triangle.
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.corners[triangle as usize]
    }

    /// A point of the frame of a triangle in the world; the origin where it has none.
    pub fn point(&self, triangle: u32, local: [f32; 3]) -> Vec3 {
        self.frames[triangle as usize].as_ref().map_or(Vec3::ZERO, |f| f.point(local).into())
    }

    /// A point of the world in the frame of a triangle; the origin where it has none.
    pub fn local(&self, triangle: u32, place: Vec3) -> [f32; 3] {
        let Some(frame) = &self.frames[triangle as usize] else { return [0.0; 3] };
        let arm = place - Vec3::from(frame.origin);
        // In units of the frame's size, so that determinants of small triangles do not underflow.
        let axes = [frame.x, frame.y, frame.z].map(Vec3::from);
        let size = axes[2].length();
        let [x, y, z] = axes.map(|axis| axis / size);
        (Mat3::from_cols(x, y, z).inverse() * (arm / size)).into()
    }

    /// Angle and log₂ of the scales, in the frame of a triangle, of a round disc whose standard deviation is the root of
    /// the triangle's area.
    pub fn round_disc(&self, triangle: u32) -> (f32, [f32; 2]) {
        let Some(frame) = &self.frames[triangle as usize] else { return (0.0, [0.0; 2]) };
        let axes = [frame.x, frame.y, frame.z].map(Vec3::from);
        let size = axes[2].length();
        let [x, y, normal] = axes.map(|axis| axis / size);
        // The frame's axes in those of an orthonormal basis of the plane, and Σ = F⁻¹ F⁻ᵀ.
        let first = x.normalize();
        let second = normal.cross(first);
        let in_plane = |axis: Vec3| Vec2::new(axis.dot(first), axis.dot(second));
        let inverse = Mat2::from_cols(in_plane(x), in_plane(y)).inverse();
        let covariance = inverse * inverse.transpose();
        let (xx, xy, yy) = (covariance.x_axis.x, covariance.x_axis.y, covariance.y_axis.y);
        let (middle, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
        let root = libm::sqrtf(half * half + xy * xy);
        // det F is 1, and so is that of Σ: the smaller variance is what the greater one leaves.
        let log2_greater = 0.5 * libm::log2f(middle + root);
        (0.5 * libm::atan2f(xy, half), [log2_greater, -log2_greater])
    }

    /// Barycentrics of the foot of a local point on its triangle's plane.
    pub fn barycentrics(&self, triangle: u32, [x, y, _]: [f32; 3]) -> Vec3 {
        let [a, b, c] = self.corners(triangle).map(|corner| self.local(triangle, corner));
        let cross = |p: [f32; 2], q: [f32; 2]| p[0] * q[1] - p[1] * q[0];
        let arm = |corner: [f32; 3]| [corner[0] - x, corner[1] - y];
        let (a, b, c) = (arm(a), arm(b), arm(c));
        // Twice the areas that the point spans with the sides; the triangle's own is 1.
        let weights = Vec3::new(cross(b, c), cross(c, a), cross(a, b));
        let sum = weights.element_sum();
        if sum > 0.0 { weights / sum } else { Vec3::splat(1.0 / 3.0) }
    }
}

#[cfg(test)]
mod tests {
    use dermis_runtime::gaussian::disc_on;

    use super::*;

    const VERTICES: [[f32; 3]; 3] = [[0.1, 0.2, 0.3], [1.3, 0.4, -0.2], [0.5, 0.5, 0.3]];

    /// On sheared frames, too: the disc is found by the frame's inverse, and drawn by the frame.
    #[test]
    fn a_round_disc_is_round_and_stands_where_its_point_is() {
        for kind in [FrameKind::Area, FrameKind::Affine] {
            let surface = Surface::new(kind, &VERTICES, &[[0, 1, 2]]);
            let frame = Frame::of_triangle(kind, VERTICES).unwrap();
            let (angle, log2_scale) = surface.round_disc(0);
            let point = SurfacePoint { triangle: 0, barycentrics: Vec3::new(0.2, 0.5, 0.3) };
            let local = surface.local(0, surface.position(&point));
            let disc = disc_on(&frame, local, angle, log2_scale);
            let [a, b] = disc.axes.map(Vec3::from);
            let [center, area] = [surface.position(&point), Vec3::splat(surface.area(0))];
            assert!((Vec3::from(disc.center) - center).length() < 1e-5, "{kind:?}");
            // Equal variances along any two directions of the plane, and none across.
            let found = Vec3::new(a.length_squared(), b.length_squared(), area.x + 2.0 * a.dot(b));
            assert!((found / area - Vec3::ONE).abs().max_element() < 1e-4, "{kind:?} {found}");
            assert!((surface.barycentrics(0, local) - point.barycentrics).length() < 1e-5);
        }
    }
}
