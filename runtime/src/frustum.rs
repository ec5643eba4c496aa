//! What surely misses the frame, by planes in the world.

use crate::math::{Real, dot};
use crate::project::{NEAR, View};

/// Planes that Gaussians must cross to touch a pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frustum<R>([Plane<R>; 5]);

/// A Gaussian misses where n · p + d exceeds `offset` for each metre that its centre may be from p
/// and `sigma` for each metre of its standard deviation.
#[derive(Clone, Copy, Debug)]
struct Plane<R> {
    normal: [R; 3],
    d: R,
    offset: R,
    sigma: R,
}

/// What rounding may add to a plane's distance, as a share of the numbers it is a sum of; ten steps
/// of f32 at most, here and where the runtime projects.
const ROUNDING: f32 = 2e-6;

/// Standard deviations at which a footprint surely has ended.
pub(crate) const REACH: f32 = 3.34;

/// Pixels by which the low-pass widens a footprint at most.
pub(crate) const BLUR: f32 = 2.4;

impl Frustum<f32> {
    /// A footprint ends within 3.33 standard deviations (α ≥ 1/255), and its variance along x is at
    /// most (f / z)² (|X| + |s Z|)² σ² + 0.3 px² (low-pass), with X and Z rows of world → camera and the clamped
    /// slope s. So at depth z > 0 it is off the right border, W − c px from the principal point, where
    ///
    /// ```text
    /// f x − (W − c + 2.4 px) z > 3.34 f (|X| + |s Z|) σ
    /// ```
    ///
    /// which is a plane; so are the other borders and the near plane. True of any matrix: rows need
    /// not be of unit length.
    pub(crate) fn of(view: &View<f32>) -> Self {
        let [rx, ry, rz] = *view.rows();
        let ([cx, cy], [w, h]) = (view.center(), view.size());
        let length = |[x, y, z, _]: [f32; 4]| dot([x, y, z], [x, y, z]).sqrt();
        let border = |axis: usize, row: [f32; 4], towards: f32, border: f32| {
            let (focal, limit) = (view.focal()[axis], view.limit()[axis]);
            let slope = border + BLUR;
            let [a, b, c, d] = core::array::from_fn(|i| towards * focal * row[i] - slope * rz[i]);
            let (focal, slope) = (focal.abs(), slope.abs());
            Plane {
                normal: [a, b, c],
                d: d - ROUNDING * (focal * row[3].abs() + slope * rz[3].abs()),
                // At least the length of the normal, and all that was subtracted to make it.
                offset: focal * length(row) + slope * length(rz),
                sigma: REACH * focal * (length(row) + limit * length(rz)),
            }
        };
        let near = Plane {
            normal: [-rz[0], -rz[1], -rz[2]],
            d: NEAR - rz[3] - ROUNDING * rz[3].abs(),
            offset: length(rz),
            sigma: 0.0,
        };
        Self([
            border(0, rx, 1.0, w - cx),
            border(0, rx, -1.0, cx),
            border(1, ry, 1.0, h - cy),
            border(1, ry, -1.0, cy),
            near,
        ])
    }
}

impl<R: Copy> Frustum<R> {
    /// The same planes in other numbers.
    #[inline(always)]
    pub(crate) fn map<T: Copy>(&self, to: impl Fn(R) -> T) -> Frustum<T> {
        let [a, b, c, d, e] = self.0;
        Frustum([a.map(&to), b.map(&to), c.map(&to), d.map(&to), e.map(&to)])
    }
}

impl<R: Copy> Plane<R> {
    #[inline(always)]
    fn map<T: Copy>(self, to: impl Fn(R) -> T) -> Plane<T> {
        let [x, y, z] = self.normal;
        Plane {
            normal: [to(x), to(y), to(z)],
            d: to(self.d),
            offset: to(self.offset),
            sigma: to(self.sigma),
        }
    }
}

impl<R: Real> Frustum<R> {
    /// Where all that is at most `offset` metres from `point` (world) is behind the near plane.
    #[inline(always)]
    pub(crate) fn is_behind(&self, point: [R; 3], offset: R) -> R::Mask {
        let [.., near] = self.0;
        near.misses(point, offset, offset.like(0.0))
    }

    /// Where no Gaussian can touch a pixel whose centre is at most `offset` metres from `point`
    /// (world) and whose standard deviations are at most `sigma` metres. Never where one can.
    #[inline(always)]
    pub(crate) fn misses(&self, point: [R; 3], offset: R, sigma: R) -> R::Mask {
        let [x, y, z] = point;
        // What rounding moves a plane by is as if the point were elsewhere.
        let offset = offset + (x.abs() + y.abs() + z.abs()) * x.like(ROUNDING);
        let [a, b, c, d, e] = self.0;
        a.misses(point, offset, sigma)
            | b.misses(point, offset, sigma)
            | c.misses(point, offset, sigma)
            | d.misses(point, offset, sigma)
            | e.misses(point, offset, sigma)
    }
}

impl<R: Real> Plane<R> {
    #[inline(always)]
    fn misses(&self, point: [R; 3], offset: R, sigma: R) -> R::Mask {
        let distance = dot(self.normal, point) + self.d;
        (self.offset * offset + self.sigma * sigma).below(distance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::gaussian::Ellipsoid;
    use crate::math::{add, cross, rotation_rows, scale};
    use crate::project::{Splat, project};
    use dermis_format::LowPass;

    /// Numbers in [0, 1), the same in every run.
    struct Units(u32);

    impl Units {
        fn next(&mut self) -> f32 {
            self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (self.0 >> 8) as f32 / 16_777_216.0
        }

        /// In [−1, 1).
        fn signed(&mut self) -> f32 {
            2.0 * self.next() - 1.0
        }
    }

    /// A turned camera, whose axes are orthogonal and of length `stretch`, or sheared, and which
    /// sees the world's origin at `origin`.
    fn rows(units: &mut Units, stretch: f32, shear: f32, origin: [f32; 3]) -> [[f32; 4]; 3] {
        let turn = rotation_rows([0, 1, 2, 3].map(|_| units.signed() + 0.01));
        let sheared = [turn[0], add(turn[1], scale(turn[0], shear)), turn[2]];
        core::array::from_fn(|i| {
            let [x, y, z] = scale(sheared[i], stretch);
            [x, y, z, origin[i]]
        })
    }

    /// A world point at these camera coordinates, found by following the rows back.
    fn world_of(rows: &[[f32; 4]; 3], target: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = rows.map(|[a, b, c, _]| [a, b, c]);
        let right = [0, 1, 2].map(|i| target[i] - rows[i][3]);
        let (p, q, r) = (cross(y, z), cross(z, x), cross(x, y));
        let sum = add(add(scale(p, right[0]), scale(q, right[1])), scale(r, right[2]));
        scale(sum, 1.0 / dot(x, p))
    }

    /// Balls and needles around and beyond the borders, by cameras of every kind, near and far from
    /// the world's origin: what touches a pixel is never missed, and of what touches none, seen by a
    /// rigid camera near the origin, more than half is.
    #[test]
    fn nothing_that_touches_a_pixel_is_missed() {
        let mut units = Units(3);
        let kinds = [(1.0, 0.0, 0.0), (1.0, 0.0, 10.0), (2.0, 0.0, 1.0), (0.3, 0.0, 1.0)];
        let odd = [(1.0, 1.5, 1.0), (1.0, 0.0, 1e3), (1.0, 0.0, 1e4), (1.05, 0.0, 100.0)];
        for (kind, (stretch, shear, away)) in kinds.into_iter().chain(odd).enumerate() {
            let (mut touching, mut invisible, mut missed) = (0, 0, 0);
            for _ in 0..100_000 {
                let mut focal = || (20.0 + 200.0 * units.next()) * units.signed().signum();
                let (fx, fy) = (focal(), focal());
                let (cx, cy) = (80.0 * units.next(), 60.0 * units.next());
                // Half of the points, and of the origins, are next to the plane of the right border:
                // there its distance is a difference of large numbers.
                let right = (64.0 - cx) / fx;
                let along = |units: &mut Units, far: f32| match units.next() < 0.5 {
                    true => {
                        [far * right * (1.0 + 0.02 * units.signed()), far * units.signed(), far]
                    }
                    false => [0, 1, 2].map(|_| far * units.signed()),
                };
                let origin = along(&mut units, away);
                let camera = Camera {
                    width: 64,
                    height: 48,
                    fx,
                    fy,
                    cx,
                    cy,
                    world_to_camera: rows(&mut units, stretch, shear, origin),
                };
                let view = View::new(&camera);
                let depth = libm::exp2f(-6.5 + 8.0 * units.next());
                let seen = along(&mut units, depth);
                let point = world_of(view.rows(), seen);
                let sigma = libm::exp2f(-16.0 + 15.0 * units.next());
                let shift = [0, 1, 2].map(|_| units.signed() * 0.5 * sigma);
                let first = [0, 1, 2].map(|_| units.signed());
                let second = cross(first, [0.3, -0.5, 0.8]);
                let unit_of = |v: [f32; 3]| scale(v, sigma / dot(v, v).sqrt());
                let axes = [unit_of(first), scale(unit_of(second), units.next())];
                let disc = Ellipsoid { center: add(point, shift), axes };
                let (p, drawable) = project(&view, LowPass::Classic, &disc);
                let touches = drawable && Splat::pack(&view, &p, 1.0, [1.0; 3]).is_some();
                // Of what rounding makes of the centre, too.
                let offset = dot(shift, shift).sqrt() * 1.001;
                let misses = Frustum::of(&view).misses(point, offset, sigma * 1.001);
                assert!(!(touches && misses), "kind {kind}: {camera:?} {disc:?}");
                touching += u32::from(touches);
                invisible += u32::from(!touches);
                missed += u32::from(misses);
            }
            assert!(touching > 10_000, "kind {kind}: {touching}");
            assert!(kind > 1 || missed * 2 > invisible, "kind {kind}: {missed} of {invisible}");
        }
    }
}
