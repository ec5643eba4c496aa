//! Triangle frames: the posed coordinate system of a triangle.

use dermis_format::FrameKind;

use crate::math::{Real, Scalar, add, cross, dot, each, scale, sub};

/// 1 / (distance of a corner from the centroid of an equilateral triangle of area 1) = √(3√3) / 2.
const PER_ARM: f32 = 1.139_753_5;
/// 1 / (its side) = √(√3) / 2.
const PER_SIDE: f32 = 0.658_037;

/// A coordinate system: `world = x · X₀ + y · X₁ + z · X₂ + origin`. The axes are orthogonal and
/// as long as the frame's size, metres; but x and y of [`FrameKind::Affine`] are any two that span the triangle's
/// plane, and the root of the area that they span is the size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame<R> {
    /// First axis, in the triangle's plane.
    pub x: [R; 3],
    /// Second axis.
    pub y: [R; 3],
    /// Third axis; along the normal but for [`FrameKind::Edge`].
    pub z: [R; 3],
    /// World, metres.
    pub origin: [R; 3],
}

impl<R: Real> Frame<R> {
    /// The frame of a posed triangle, and where there is one: not where the triangle has no area,
    /// or corners that are not finite. What stands there is not drawn.
    ///
    /// Area (LoDAvatar, eq. 5): origin T = centroid, z = unit normal, x = unit(v0 − T), y = z × x,
    /// size = √area. Edge (GaussianAvatars): T = centroid, x = unit(v1 − v0), y = unit normal,
    /// z = −unit(y × x), size = (|v1 − v0| + |z · (v2 − v0)|) / 2. Affine: what takes the equilateral triangle of area 1
    /// about the origin, a corner on the first axis, to this one; z = √area · unit normal. Then a map of the plane that
    /// takes triangle to triangle takes Gaussians along, and no crack opens where a mesh shears or stretches.
    #[inline(always)]
    pub fn of_triangles(kind: FrameKind, [v0, v1, v2]: [[R; 3]; 3]) -> (Self, R::Mask) {
        let constant = |x: f32| v0[0].like(x);
        let (zero, one, half) = (constant(0.0), constant(1.0), constant(0.5));
        // Corners about the centroid, whose sum divided first by 3 cannot overflow.
        let third = one / constant(3.0);
        let origin = add(add(scale(v0, third), scale(v1, third)), scale(v2, third));
        let (e1, e2, arm) = (sub(v1, v0), sub(v2, v0), sub(v0, origin));
        // In units of the longest edge's greatest component neither products nor their squares
        // over- or underflow, whatever the size of the triangle.
        let unit = greatest(e1).at_least(greatest(e2));
        let inverse = one / unit;
        let sums = each(
            [origin, e1, e2],
            #[inline(always)]
            |[x, y, z]| x + y + z,
        );
        let finite = sums[0].finite() & sums[1].finite() & sums[2].finite() & inverse.finite();
        let (e1, e2, arm) = (scale(e1, inverse), scale(e2, inverse), scale(arm, inverse));
        let normal = cross(e1, e2);
        let double_area = dot(normal, normal).sqrt();
        let first = match kind {
            FrameKind::Edge => e1,
            FrameKind::Area | FrameKind::Affine | FrameKind::World => arm,
        };
        let first_length = dot(first, first).sqrt();
        let spans = zero.below(unit) & zero.below(double_area) & zero.below(first_length);
        let normal = scale(normal, one / double_area);
        let root_area = (double_area * half).sqrt();
        let unit_first = || scale(first, one / first_length);
        let turned = |[x, y, z]: [[R; 3]; 3], size: R| {
            (Self { x: scale(x, size), y: scale(y, size), z: scale(z, size), origin }, size)
        };
        let (frame, size) = match kind {
            FrameKind::Edge => {
                let first = unit_first();
                let height = cross(first, normal);
                let size = (first_length + dot(height, e2).abs()) * half;
                turned([first, normal, height], size * unit)
            }
            FrameKind::Area | FrameKind::World => {
                let first = unit_first();
                turned([first, cross(normal, first), normal], root_area * unit)
            }
            FrameKind::Affine => {
                let (x, y) = (constant(PER_ARM) * unit, constant(PER_SIDE) * unit);
                let size = root_area * unit;
                let (x, y) = (scale(arm, x), scale(sub(e1, e2), y));
                (Self { x, y, z: scale(normal, size), origin }, size)
            }
        };
        (frame, finite & spans & zero.below(size) & size.finite())
    }

    /// A local point in the world.
    #[inline(always)]
    pub fn point(&self, local: [R; 3]) -> [R; 3] {
        add(self.direction(local), self.origin)
    }

    /// A local direction in the world.
    #[inline(always)]
    pub fn direction(&self, [x, y, z]: [R; 3]) -> [R; 3] {
        add(add(scale(self.x, x), scale(self.y, y)), scale(self.z, z))
    }

    /// The triangle's normal, not of unit length.
    #[inline(always)]
    pub fn normal(&self, kind: FrameKind) -> [R; 3] {
        match kind {
            FrameKind::Edge => self.y,
            FrameKind::Area | FrameKind::Affine | FrameKind::World => self.z,
        }
    }

    /// The greatest length, metres, of what is 1 long in the frame, up to rounding.
    #[inline(always)]
    pub fn reach(&self, kind: FrameKind) -> R {
        let xx = dot(self.x, self.x);
        match kind {
            FrameKind::Edge | FrameKind::Area | FrameKind::World => xx.sqrt(),
            // The greater singular value of [x y]; z is not longer.
            FrameKind::Affine => {
                let (xy, yy) = (dot(self.x, self.y), dot(self.y, self.y));
                let (gap, twice) = (xx - yy, xy + xy);
                let root = (gap * gap + twice * twice).sqrt();
                ((xx + yy + root) * xx.like(0.5)).sqrt()
            }
        }
    }

    /// The numbers of x, y, z and origin, four in a row.
    #[inline(always)]
    pub fn rows(&self) -> [[R; 4]; 3] {
        let ([a, b, c], [d, e, f], [g, h, i]) = (self.x, self.y, self.z);
        let [j, k, l] = self.origin;
        [[a, b, c, d], [e, f, g, h], [i, j, k, l]]
    }

    /// The inverse of [`Self::rows`].
    #[inline(always)]
    pub fn of_rows([[a, b, c, d], [e, f, g, h], [i, j, k, l]]: [[R; 4]; 3]) -> Self {
        Self { x: [a, b, c], y: [d, e, f], z: [g, h, i], origin: [j, k, l] }
    }

    /// Whether the triangle's front looks at `eye`.
    #[inline(always)]
    pub fn faces(&self, kind: FrameKind, eye: [R; 3]) -> R::Mask {
        let towards = dot(self.normal(kind), sub(eye, self.origin));
        towards.like(0.0).below(towards)
    }
}

impl<R: Scalar> Frame<R> {
    /// The world's own axes, size 1 m.
    pub fn world() -> Self {
        let (o, i) = (R::ZERO, R::ONE);
        Self { x: [i, o, o], y: [o, i, o], z: [o, o, i], origin: [o; 3] }
    }

    /// [`Frame::of_triangles`] of one triangle.
    pub fn of_triangle(kind: FrameKind, corners: [[R; 3]; 3]) -> Option<Self> {
        let (frame, exists) = Self::of_triangles(kind, corners);
        exists.then_some(frame)
    }

    /// Whether what stands on the triangle can be seen from `eye`: its front looks there, or its
    /// back is shown, too.
    #[inline]
    pub fn shows(&self, kind: FrameKind, two_sided: bool, eye: [R; 3]) -> bool {
        two_sided || self.faces(kind, eye)
    }
}

/// Greatest absolute component.
#[inline(always)]
fn greatest<R: Real>([x, y, z]: [R; 3]) -> R {
    x.abs().at_least(y.abs()).at_least(z.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: [[f64; 3]; 3] = [[0.1, 0.2, 0.3], [1.0, 0.4, -0.2], [0.3, 1.5, 0.6]];

    #[test]
    fn axes_are_orthogonal_right_handed_and_as_long_as_the_size() {
        for kind in [FrameKind::Area, FrameKind::Edge] {
            let f = Frame::of_triangle(kind, TRIANGLE).unwrap();
            let size = dot(f.x, f.x).sqrt();
            assert!((dot(f.y, f.y).sqrt() - size).abs() < 1e-12);
            assert!(dot(f.x, f.y).abs() + dot(f.y, f.z).abs() + dot(f.z, f.x).abs() < 1e-12);
            let volume = dot(cross(f.x, f.y), f.z);
            assert!((volume - size * size * size).abs() < 1e-12, "{kind:?} {volume}");
        }
    }

    #[test]
    fn size_of_the_area_frame_is_the_root_of_the_area() {
        let f = Frame::of_triangle(FrameKind::Area, TRIANGLE).unwrap();
        let [a, b, c] = TRIANGLE;
        let n = cross(sub(b, a), sub(c, a));
        assert!((dot(f.x, f.x) - dot(n, n).sqrt() / 2.0).abs() < 1e-12);
    }

    /// What a map of the plane does to a triangle it does to all that stands on its affine frame.
    #[test]
    fn the_affine_frame_takes_an_equilateral_triangle_of_area_1_to_its_own() {
        let f = Frame::of_triangle(FrameKind::Affine, TRIANGLE).unwrap();
        let side = (4.0 / 3f64.sqrt()).sqrt();
        let arm = side / 3f64.sqrt();
        let reference =
            [[arm, 0.0, 0.0], [-arm / 2.0, side / 2.0, 0.0], [-arm / 2.0, -side / 2.0, 0.0]];
        for (corner, local) in TRIANGLE.into_iter().zip(reference) {
            let error = sub(f.point(local), corner);
            assert!(dot(error, error).sqrt() < 1e-7, "{error:?}: PER_ARM and PER_SIDE are f32");
        }
        let area_frame = Frame::of_triangle(FrameKind::Area, TRIANGLE).unwrap();
        assert_eq!((f.z, f.origin), (area_frame.z, area_frame.origin));
        let spanned = cross(f.x, f.y);
        let square = dot(f.z, f.z);
        assert!((dot(spanned, f.z) / (square * square.sqrt()) - 1.0).abs() < 1e-7);
        let equilateral = Frame::of_triangle(FrameKind::Affine, reference).unwrap();
        for (axis, unit) in [equilateral.x, equilateral.y, equilateral.z].into_iter().zip(0..) {
            (0..3).for_each(|i| assert!((axis[i] - f64::from(u8::from(i == unit))).abs() < 1e-7));
        }
    }

    /// Directions all around, on triangles from equilateral to slivers.
    #[test]
    fn nothing_of_length_1_is_longer_than_the_reach() {
        for kind in [FrameKind::Area, FrameKind::Edge, FrameKind::Affine] {
            for flatness in 0..40 {
                let thin = 0.7f64.powi(flatness);
                let corners = TRIANGLE.map(|[x, y, z]| [x + 0.3 * y, y * thin, z * thin]);
                let f = Frame::of_triangle(kind, corners).unwrap();
                let single =
                    Frame::of_triangle(kind, corners.map(|c| c.map(|x| x as f32))).unwrap();
                let mut greatest = 0.0f64;
                for turn in 0..360 {
                    for tilt in 0..=12 {
                        let (s, c) = f64::from(turn).to_radians().sin_cos();
                        let (up, flat) = f64::from(tilt * 90 / 12).to_radians().sin_cos();
                        let [x, y, z] = match kind {
                            FrameKind::Edge => [c * flat, up, s * flat],
                            _ => [c * flat, s * flat, up],
                        };
                        let direction = f.direction([x, y, z]);
                        greatest = greatest.max(dot(direction, direction).sqrt());
                    }
                }
                let reach = f.reach(kind);
                assert!(
                    greatest <= reach * (1.0 + 1e-7) && greatest > 0.999 * reach,
                    "{kind:?} {thin}: {greatest} {reach}"
                );
                assert!(
                    (f64::from(single.reach(kind)) / reach - 1.0).abs() < 1e-5,
                    "{kind:?} {thin}"
                );
            }
        }
    }

    #[test]
    fn any_size_from_1e_30_to_1e_15_m_has_a_frame() {
        for exponent in -30..=15 {
            let size = 10f32.powi(exponent);
            let corners = [[0.0, 0.0, 0.0], [size, 0.0, 0.0], [0.0, size, 0.0]];
            let f = Frame::of_triangle(FrameKind::Area, corners).expect("a frame");
            let root = libm::sqrtf(0.5) * size;
            assert!((f.z[2] / root - 1.0).abs() < 1e-6, "{size:e}: {:?}", f.z);
        }
    }

    #[test]
    fn degenerate_and_infinite_triangles_have_none() {
        let p = [1.0f32, 2.0, 3.0];
        let bad = [
            [p, p, p],
            [p, p, [2.0, 2.0, 3.0]],
            [[0.0; 3], [1.0; 3], [2.0; 3]],
            [[f32::NAN, 0.0, 0.0], p, [0.0; 3]],
            [p, [f32::INFINITY, 0.0, 0.0], [0.0; 3]],
            [[3e38, 0.0, 0.0], [-3e38, 0.0, 0.0], [0.0, 3e38, 0.0]],
        ];
        for triangle in bad {
            assert_eq!(Frame::of_triangle(FrameKind::Area, triangle), None, "{triangle:?}");
        }
    }

    #[test]
    fn a_flipped_triangle_looks_the_other_way() {
        let [a, b, c] = TRIANGLE;
        let eye = [0.0, 0.0, 9.0];
        let seen = |corners| {
            Frame::of_triangle(FrameKind::Area, corners).unwrap().faces(FrameKind::Area, eye)
        };
        assert!(seen([a, b, c]) != seen([a, c, b]));
    }
}
