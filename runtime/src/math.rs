//! Arithmetic that gives the same bits on every target: IEEE + − × ÷ and √, and libm.
//!
//! Formulas that the trainer differentiates or the reference renderer repeats in f64 are written
//! once, over [`Real`].

use core::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// A real number, or several side by side in the lanes of a vector: what the formulas of the
/// runtime are written over, once for the scalar kernel (f32), the SIMD kernels (vectors of f32)
/// and the reference (f64). Every operation acts on each lane by itself, and gives the same bits in
/// a lane as on one f32.
pub trait Real:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// True or false in each lane.
    type Mask: Copy
        + BitAnd<Output = Self::Mask>
        + BitOr<Output = Self::Mask>
        + Not<Output = Self::Mask>;

    /// `x` in every lane of a value like this one.
    fn like(self, x: f32) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// 2ˣ. For f32: 0 for x < −125, 2¹²⁷ for x > 127 and for NaN; relative error at most 3e-6 of
    /// either sign.
    fn exp2(self) -> Self;
    /// log₂ x. For f32: −127 unless x is normal and above 0; error at most 3e-7 + 1.2e-7 |log₂ x|.
    fn log2(self) -> Self;
    /// Sine and cosine of an angle in radians, |angle| < 10⁴, both with the same unspecified sign: the
    /// direction of a line. For f32: error at most 3e-7 + 2e-8 |angle|.
    fn line(self) -> [Self; 2];
    /// Lanes where `self < other`; false where either is NaN.
    fn below(self, other: Self) -> Self::Mask;
    /// Lanes where `self ≥ other`; false where either is NaN.
    fn reaches(self, other: Self) -> Self::Mask;
    /// `yes` where the mask is true, else `no`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// The smaller one; `other` if either is NaN. (`f32::min` differs between targets.)
    #[inline(always)]
    fn at_most(self, other: Self) -> Self {
        Self::select(self.below(other), self, other)
    }

    /// The greater one; `other` if either is NaN.
    #[inline(always)]
    fn at_least(self, other: Self) -> Self {
        Self::select(other.below(self), self, other)
    }

    /// |x|.
    #[inline(always)]
    fn abs(self) -> Self {
        Self::select(self.below(self.like(0.0)), -self, self)
    }

    /// The nearest integer for |x| < 2²² (of two the even one).
    #[inline(always)]
    fn nearest(self) -> Self {
        let rounder = self.like(ROUNDER);
        (self + rounder) - rounder
    }

    /// Neither infinite nor NaN.
    #[inline(always)]
    fn finite(self) -> Self::Mask {
        self.abs().below(self.like(f32::INFINITY))
    }
}

/// One number: f32, or f64 for the reference and gradient checks.
pub trait Scalar: Real<Mask = bool> + PartialOrd {
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// Exactly `x`.
    fn of(x: f32) -> Self;
    /// Rounded to f32.
    fn to_f32(self) -> f32;
}

/// f32, one or several: what the polynomials below need beyond [`Real`].
pub trait Single: Real {
    /// x · 2ⁿ for n to which [`ROUNDER`] was added, where neither x nor the result is subnormal, zero
    /// or not finite: the exponent's bits are added to.
    fn times_power_of_two(self, rounded: Self) -> Self;
    /// The smaller one of two finite numbers that are not zero.
    fn least(self, other: Self) -> Self;
    /// m in [√½, √2) and n with x = m · 2ⁿ, for normal x > 0.
    fn mantissa_and_exponent(self) -> [Self; 2];
}

impl Real for f32 {
    type Mask = bool;
    #[inline(always)]
    fn like(self, x: f32) -> Self {
        x
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        libm::sqrtf(self)
    }
    #[inline(always)]
    fn exp2(self) -> Self {
        exp2(self)
    }
    #[inline(always)]
    fn log2(self) -> Self {
        log2(self)
    }
    #[inline(always)]
    fn line(self) -> [Self; 2] {
        line(self)
    }
    #[inline(always)]
    fn below(self, other: Self) -> bool {
        self < other
    }
    #[inline(always)]
    fn reaches(self, other: Self) -> bool {
        self >= other
    }
    #[inline(always)]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
}

impl Scalar for f32 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    #[inline(always)]
    fn of(x: f32) -> Self {
        x
    }
    #[inline(always)]
    fn to_f32(self) -> f32 {
        self
    }
}

impl Single for f32 {
    #[inline(always)]
    fn times_power_of_two(self, rounded: Self) -> Self {
        Self::from_bits(self.to_bits().wrapping_add(rounded.to_bits() << 23))
    }
    #[inline(always)]
    fn least(self, other: Self) -> Self {
        self.at_most(other)
    }
    #[inline(always)]
    fn mantissa_and_exponent(self) -> [Self; 2] {
        let bits = self.to_bits() as i32;
        let exponent = bits.wrapping_sub(ROOT_HALF_BITS) >> 23;
        let mantissa = bits.wrapping_sub(exponent << 23);
        [Self::from_bits(mantissa as u32), exponent as f32]
    }
}

impl Real for f64 {
    type Mask = bool;
    fn like(self, x: f32) -> Self {
        Self::from(x)
    }
    fn sqrt(self) -> Self {
        libm::sqrt(self)
    }
    fn nearest(self) -> Self {
        libm::rint(self)
    }
    fn exp2(self) -> Self {
        libm::exp2(self)
    }
    fn log2(self) -> Self {
        libm::log2(self)
    }
    fn line(self) -> [Self; 2] {
        let (sin, cos) = libm::sincos(self);
        [sin, cos]
    }
    fn below(self, other: Self) -> bool {
        self < other
    }
    fn reaches(self, other: Self) -> bool {
        self >= other
    }
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
}

impl Scalar for f64 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    fn of(x: f32) -> Self {
        Self::from(x)
    }
    fn to_f32(self) -> f32 {
        self as f32
    }
}

/// `f` of each element. In place of the array's own `map`, which the compiler does not inline into
/// code for wider vectors than the target's: each operation would become a call.
#[inline(always)]
pub fn each<T: Copy, U: Copy, const N: usize>(from: [T; N], f: impl Fn(T) -> U) -> [U; N] {
    let mut to = [f(from[0]); N];
    for i in 1..N {
        to[i] = f(from[i]);
    }
    to
}

/// a + b.
#[inline(always)]
pub fn add<R: Real>(a: [R; 3], b: [R; 3]) -> [R; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// a − b.
#[inline(always)]
pub fn sub<R: Real>(a: [R; 3], b: [R; 3]) -> [R; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a · s.
#[inline(always)]
pub fn scale<R: Real>(a: [R; 3], s: R) -> [R; 3] {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// Scalar product.
#[inline(always)]
pub fn dot<R: Real>(a: [R; 3], b: [R; 3]) -> R {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
#[inline(always)]
pub fn cross<R: Real>(a: [R; 3], b: [R; 3]) -> [R; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Rows of the rotation matrix of a quaternion w, x, y, z of any length but 0.
#[inline(always)]
pub fn rotation_rows<R: Real>([w, x, y, z]: [R; 4]) -> [[R; 3]; 3] {
    let one = w.like(1.0);
    let two = (one + one) / (w * w + x * x + y * y + z * z);
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

/// What takes back what `m` does, by cofactors; `None` where it flattens space, or its numbers are beyond those of f32.
pub fn inverse(m: &Affine) -> Option<Affine> {
    let [a, b, c] = m.map(|[x, y, z, _]| [x, y, z]);
    let columns = [cross(b, c), cross(c, a), cross(a, b)];
    let determinant = dot(a, columns[0]);
    let rows: Affine = core::array::from_fn(|i| {
        let row = columns.map(|column| column[i] / determinant);
        let [x, y, z] = row;
        [x, y, z, -dot(row, m.map(|row| row[3]))]
    });
    rows.iter().flatten().all(|number| number.is_finite()).then_some(rows)
}

/// 1.5 · 2²³: adding it to |p| < 2²² rounds p to an integer, which the lowest bits then hold.
pub const ROUNDER: f32 = 12_582_912.0;
/// Bits of √½.
pub const ROOT_HALF_BITS: i32 = 0x3F35_04F3;

/// c₀ + x (c₁ + x (…)).
#[inline(always)]
fn polynomial<R: Real, const N: usize>(x: R, coefficients: [f32; N]) -> R {
    let mut sum = x.like(0.0);
    for (i, c) in coefficients.into_iter().rev().enumerate() {
        sum = if i == 0 { x.like(c) } else { x.like(c) + x * sum };
    }
    sum
}

/// 2ᵖ for p in [−125, 127]: the runtime's only exponential. The rasterizer calls it as it is, for p
/// in [−8, 0]; [`Real::exp2`] flushes and limits what lies outside.
///
/// p = n + f with n the nearest integer; the polynomial of degree 4 of least relative error for 2ᶠ
/// on [−½, ½]. Relative error at most 3e-6 of either sign (2.6e-6 by the polynomial, the rest by
/// rounding): of an alpha 0.0008 of 255 at most. Outside its domain the result is meaningless.
#[inline(always)]
pub fn exp2_in_range<S: Single>(p: S) -> S {
    let rounder = p.like(ROUNDER);
    let rounded = p + rounder;
    let f = p - (rounded - rounder);
    let power =
        polynomial(f, [0.999_999_3, 0.693_121_8, 0.240_247_45, 0.055_917_86, 0.009_570_102]);
    power.times_power_of_two(rounded)
}

#[inline(always)]
pub(crate) fn exp2<S: Single>(x: S) -> S {
    let power = exp2_in_range(x.at_most(x.like(127.0)).at_least(x.like(-125.0)));
    S::select(x.below(x.like(-125.0)), x.like(0.0), power)
}

/// log₂ m = s Q(s²) with s = (m − 1) / (m + 1), |s| ≤ 0.172 and Q of degree 3: off by 3.5e-10.
#[inline(always)]
pub(crate) fn log2<S: Single>(x: S) -> S {
    let normal = x.reaches(x.like(f32::MIN_POSITIVE)) & x.finite();
    let [m, n] = S::select(normal, x, x.like(1.0)).mantissa_and_exponent();
    let one = x.like(1.0);
    let s = (m - one) / (m + one);
    let q = polynomial(s * s, [2.885_39, 0.961_798_84, 0.576_715_2, 0.431_717_7]);
    S::select(normal, n + s * q, x.like(-127.0))
}

/// φ = θ − kπ with k the nearest integer to θ/π; polynomials of degree 9 and 10 on [−π/2, π/2],
/// off by 7e-9 and 3e-10.
#[inline(always)]
pub(crate) fn line<S: Single>(angle: S) -> [S; 2] {
    use core::f32::consts::FRAC_1_PI;
    // π in two parts, the first of 8 bits: k · PI_HIGH is exact for |k| < 2¹⁶.
    const PI_HIGH: f32 = 3.140_625;
    const PI_LOW: f32 = 9.676_536e-4;
    let k = (angle * angle.like(FRAC_1_PI)).nearest();
    let phi = (angle - k * angle.like(PI_HIGH)) - k * angle.like(PI_LOW);
    let square = phi * phi;
    let sin = [1.0, -0.166_666_58, 0.008_333_05, -0.000_198_090_17, 2.605_107_6e-6];
    let cos = [1.0, -0.5, 0.041_666_637, -0.001_388_836, 2.476_01e-5, -2.605_065e-7];
    [phi * polynomial(square, sin), polynomial(square, cos)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponential_of_alphas_is_within_its_bound() {
        let mut worst = 0.0f64;
        // Every 16th float of [−8, 0], and both ends; the rest of the domain is walked with `exp2`.
        for bits in ((-0.0f32).to_bits()..=(-8.0f32).to_bits()).step_by(16).chain([0]) {
            let p = f32::from_bits(bits);
            let exact = libm::exp2(f64::from(p));
            worst = worst.max((f64::from(exp2_in_range(p)) / exact - 1.0).abs());
        }
        assert!(worst < 3e-6, "{worst:e}");
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
