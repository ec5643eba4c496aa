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

impl Frustum<f32> {
    /// A footprint ends within 3.33 standard deviations (α ≥ 1/255), and its variance along x is at
    /// most (f / z)² (1 + s²) σ² + 0.3 px² with the clamped slope s. So at depth z > 0 it is off the
    /// right border, W − c px from the principal point, where
    ///
    /// ```text
    /// f x − (W − c + 2.4 px) z > 3.34 f √(1 + s²) σ
    /// ```
    ///
    /// which is a plane; so are the other borders and the near plane.
    pub(crate) fn of(view: &View<f32>) -> Self {
        let [rx, ry, rz] = *view.rows();
        let ([cx, cy], [w, h]) = (view.center(), view.size());
        let border = |axis: usize, row: [f32; 4], towards: f32, border: f32| {
            let (focal, limit) = (view.focal()[axis], view.limit()[axis]);
            let slope = border + 2.4;
            let [a, b, c, d] = core::array::from_fn(|i| towards * focal * row[i] - slope * rz[i]);
            let offset = (focal * focal + slope * slope).sqrt();
            let sigma = 3.34 * focal.abs() * (1.0 + limit * limit).sqrt();
            Plane { normal: [a, b, c], d, offset, sigma }
        };
        let near =
            Plane { normal: [-rz[0], -rz[1], -rz[2]], d: NEAR - rz[3], offset: 1.0, sigma: 0.0 };
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
    /// Where no Gaussian can touch a pixel whose centre is at most `offset` metres from `point`
    /// (world) and whose standard deviations are at most `sigma` metres. Never where one can.
    #[inline(always)]
    pub(crate) fn misses(&self, point: [R; 3], offset: R, sigma: R) -> R::Mask {
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
        let [x, y, z] = point;
        let [a, b, c] = self.normal;
        let distance = dot(self.normal, point) + self.d;
        // Rounding is relative to what is added up.
        let size = (a * x).abs() + (b * y).abs() + (c * z).abs() + self.d.abs();
        let slack = size * distance.like(1e-5);
        (self.offset * offset + self.sigma * sigma + slack).below(distance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::gaussian::Ellipsoid;
    use crate::math::{IDENTITY, add, cross, scale};
    use crate::project::{Splat, project};
    use dermis_format::LowPass;

    /// Balls and needles around and beyond the borders: what touches a pixel is never missed, and
    /// half of what touches none is.
    #[test]
    fn nothing_that_touches_a_pixel_is_missed() {
        let mut seed = 3u32;
        let mut unit = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as f32 / 16_777_216.0
        };
        let (mut touching, mut invisible, mut missed) = (0, 0, 0);
        for _ in 0..20_000 {
            let camera = Camera {
                width: 64,
                height: 48,
                fx: 20.0 + 200.0 * unit(),
                fy: -(20.0 + 200.0 * unit()),
                cx: 80.0 * unit(),
                cy: 48.0 * unit(),
                world_to_camera: IDENTITY,
            };
            let view = View::new(&camera);
            let point = [2.0 * unit() - 1.0, 2.0 * unit() - 1.0, 3.0 * unit() - 0.5];
            let sigma = libm::exp2f(-9.0 + 9.0 * unit());
            let away = [0, 1, 2].map(|_| (unit() - 0.5) * sigma);
            let first = [0, 1, 2].map(|_| unit() - 0.5);
            let second = cross(first, [0.3, -0.5, 0.8]);
            let unit_of = |v: [f32; 3]| scale(v, sigma / dot(v, v).sqrt());
            let axes = [unit_of(first), scale(unit_of(second), unit())];
            let disc = Ellipsoid { center: add(point, away), axes };
            let (p, drawable) = project(&view, LowPass::Classic, &disc);
            let touches = drawable && Splat::pack(&view, &p, 1.0, [1.0; 3]).is_some();
            let misses = Frustum::of(&view).misses(point, dot(away, away).sqrt(), sigma);
            assert!(!(touches && misses), "{camera:?} {disc:?}");
            touching += u32::from(touches);
            invisible += u32::from(!touches);
            missed += u32::from(misses);
        }
        assert!(touching > 2000 && missed * 2 > invisible, "{touching} {invisible} {missed}");
    }
}
