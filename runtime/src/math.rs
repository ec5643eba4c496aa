//! Arithmetic that gives the same bits on every target: IEEE + − × ÷ and √, and libm.
//!
//! Formulas that the trainer differentiates or the reference renderer repeats in f64 are written
//! once, over [`Real`]. glam's SIMD-backed types stay out: their bits differ between targets.

use core::ops::{Add, Div, Mul, Neg, Sub};

/// A floating-point number: f32 (the runtime) or f64 (the reference, and gradient checks).
pub trait Real:
    Copy
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// Exactly `x`.
    fn of(x: f32) -> Self;
    /// Rounded to f32.
    fn to_f32(self) -> f32;
    /// Square root.
    fn sqrt(self) -> Self;
    /// 2ˣ.
    fn exp2(self) -> Self;
    /// log₂ x.
    fn log2(self) -> Self;
    /// Sine and cosine of an angle in radians.
    fn sin_cos(self) -> (Self, Self);
    /// Neither infinite nor NaN.
    fn is_finite(self) -> bool;

    /// The smaller one; `other` if either is NaN. (`f32::min` differs between targets.)
    #[inline]
    fn at_most(self, other: Self) -> Self {
        if self < other { self } else { other }
    }

    /// The greater one; `other` if either is NaN.
    #[inline]
    fn at_least(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    /// |x|.
    #[inline]
    fn abs(self) -> Self {
        if self < Self::ZERO { -self } else { self }
    }
}

macro_rules! real {
    ($number:ty, $sqrt:path, $exp2:path, $log2:path, $sincos:path) => {
        impl Real for $number {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            #[inline]
            fn of(x: f32) -> Self {
                <$number>::from(x)
            }
            #[inline]
            fn to_f32(self) -> f32 {
                self as f32
            }
            #[inline]
            fn sqrt(self) -> Self {
                $sqrt(self)
            }
            #[inline]
            fn exp2(self) -> Self {
                $exp2(self)
            }
            #[inline]
            fn log2(self) -> Self {
                $log2(self)
            }
            #[inline]
            fn sin_cos(self) -> (Self, Self) {
                $sincos(self)
            }
            #[inline]
            fn is_finite(self) -> bool {
                <$number>::is_finite(self)
            }
        }
    };
}
real!(f32, libm::sqrtf, libm::exp2f, libm::log2f, libm::sincosf);
real!(f64, libm::sqrt, libm::exp2, libm::log2, libm::sincos);

/// a + b.
#[inline]
pub fn add<R: Real>(a: [R; 3], b: [R; 3]) -> [R; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// a − b.
#[inline]
pub fn sub<R: Real>(a: [R; 3], b: [R; 3]) -> [R; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a · s.
#[inline]
pub fn scale<R: Real>(a: [R; 3], s: R) -> [R; 3] {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// Scalar product.
#[inline]
pub fn dot<R: Real>(a: [R; 3], b: [R; 3]) -> R {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
#[inline]
pub fn cross<R: Real>(a: [R; 3], b: [R; 3]) -> [R; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Rows of the rotation matrix of a quaternion w, x, y, z of any length but 0.
pub fn rotation_rows<R: Real>([w, x, y, z]: [R; 4]) -> [[R; 3]; 3] {
    let two = (R::ONE + R::ONE) / (w * w + x * x + y * y + z * z);
    let one = R::ONE;
    [
        [one - two * (y * y + z * z), two * (x * y - w * z), two * (x * z + w * y)],
        [two * (x * y + w * z), one - two * (x * x + z * z), two * (y * z - w * x)],
        [two * (x * z - w * y), two * (y * z + w * x), one - two * (x * x + y * y)],
    ]
}

/// Rows of a 3×4 affine matrix.
pub type Affine = [[f32; 4]; 3];

/// Leaves everything in its place.
pub const IDENTITY: Affine = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// First `b`, then `a`.
pub fn compose(a: &Affine, b: &Affine) -> Affine {
    core::array::from_fn(|row| {
        core::array::from_fn(|column| {
            let sum =
                a[row][0] * b[0][column] + a[row][1] * b[1][column] + a[row][2] * b[2][column];
            if column == 3 { sum + a[row][3] } else { sum }
        })
    })
}

/// Scale, then rotate (quaternion w, x, y, z), then translate.
pub fn affine_of(translation: [f32; 3], rotation: [f32; 4], factors: [f32; 3]) -> Affine {
    let rows = rotation_rows(rotation);
    core::array::from_fn(|i| {
        let [x, y, z] = rows[i];
        [x * factors[0], y * factors[1], z * factors[2], translation[i]]
    })
}

/// Moves a point.
#[inline]
pub fn transform(m: &Affine, [x, y, z]: [f32; 3]) -> [f32; 3] {
    core::array::from_fn(|i| m[i][0] * x + m[i][1] * y + m[i][2] * z + m[i][3])
}

/// 1.5 · 2²³: adding it to |p| < 2²² rounds p to an integer, which the lowest bits then hold.
const ROUNDER: f32 = 12_582_912.0;

/// 2ᵖ for p in [−8, 0]: the rasterizer's only exponential.
///
/// p = n + f with n the nearest integer; a polynomial of degree 5 for 2ᶠ on [−½, ½], exactly 1 at
/// 0; relative error at most 3e-7 of either sign (9.1e-8 by the polynomial, the rest by rounding).
/// Outside its domain the result is finite for |p| ≤ 120 and meaningless.
#[inline]
#[expect(clippy::approx_constant, reason = "the fitted slope at 0 is near ln 2, and not ln 2")]
pub fn exp2_of_alpha(p: f32) -> f32 {
    let rounded = p + ROUNDER;
    let f = p - (rounded - ROUNDER);
    let polynomial = 1.0
        + f * (0.693_147
            + f * (0.240_222_42 + f * (0.055_507_336 + f * (0.009_671_513 + f * 0.001_326_472_7))));
    let whole_power = f32::from_bits(rounded.to_bits().wrapping_add(127) << 23);
    polynomial * whole_power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponential_is_within_its_bound_on_its_whole_domain() {
        let mut worst = 0.0f64;
        // Every 16th float of the domain, and both ends.
        for bits in ((-0.0f32).to_bits()..=(-8.0f32).to_bits()).step_by(16).chain([0]) {
            let p = f32::from_bits(bits);
            let exact = libm::exp2(f64::from(p));
            worst = worst.max((f64::from(exp2_of_alpha(p)) / exact - 1.0).abs());
        }
        assert!(worst < 3e-7, "{worst:e}");
        assert_eq!(exp2_of_alpha(0.0), 1.0);
    }

    #[test]
    fn matrices_compose_like_their_transforms() {
        let a = affine_of([1.0, 2.0, 3.0], [0.5, 0.5, -0.5, 0.5], [1.0, 2.0, 0.5]);
        let b = affine_of([-1.0, 0.5, 0.0], [0.8, 0.0, 0.6, 0.0], [1.0; 3]);
        let p = [0.3, -0.7, 1.1];
        let one = transform(&compose(&a, &b), p);
        let two = transform(&a, transform(&b, p));
        assert!(one.iter().zip(two).all(|(x, y)| (x - y).abs() < 1e-5), "{one:?} {two:?}");
    }
}
