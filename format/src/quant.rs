//! Codes to numbers, and back.

use core::f32::consts::{FRAC_PI_2, PI};
use core::ops::{Add, Mul, Sub};

use crate::discs::DiscLayout;
use crate::record::{Bf16, DiscGroup, FullGroup, FullRecord, Range, ShortRange};

/// A flat disc in the frame of its triangle, or several side by side. Lengths in units of the frame's size.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Disc<F = f32> {
    /// Along the frame's axes. Area: x, y in the triangle's plane, z along its normal. Edge: x, z in
    /// the plane, y along the normal. World: the world's axes, metres.
    pub position: [F; 3],
    /// From the frame's x to the first axis, radians. After a quarter turn the axes have changed places: files have it in [0, π/2).
    pub angle: F,
    /// log₂ of the standard deviations along the two axes.
    pub log2_scale: [F; 2],
    /// Display-referred sRGB.
    pub color: [F; 3],
    /// In [0, 1].
    pub opacity: F,
}

impl<F: Copy> Disc<F> {
    /// All ten, in the order of a record.
    pub fn numbers(self) -> [F; 10] {
        let ([x, y, z], [s, t], [luma, orange, green]) =
            (self.position, self.log2_scale, self.color);
        [x, y, z, self.angle, s, t, luma, orange, green, self.opacity]
    }

    /// A disc of other numbers.
    pub fn map<G>(self, f: impl Fn(F) -> G) -> Disc<G> {
        Disc {
            position: self.position.map(&f),
            angle: f(self.angle),
            log2_scale: self.log2_scale.map(&f),
            color: self.color.map(&f),
            opacity: f(self.opacity),
        }
    }
}

impl Disc {
    /// The same disc by an angle in [0, π/2].
    pub fn upright(self) -> Self {
        let rest = self.angle % PI;
        let half_turn = if rest < 0.0 { rest + PI } else { rest };
        if half_turn < FRAC_PI_2 {
            Self { angle: half_turn, ..self }
        } else {
            Self { angle: half_turn - FRAC_PI_2, ..self.exchanged() }
        }
    }

    /// Its scales in each other's place.
    pub fn exchanged(self) -> Self {
        let [s, t] = self.log2_scale;
        Self { log2_scale: [t, s], ..self }
    }
}

/// A Gaussian with rotation and three scales, or several side by side. Lengths in units of the frame's size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Full<F = f32> {
    /// Along the frame's axes. Area: x, y in the triangle's plane, z along its normal. Edge: x, z in
    /// the plane, y along the normal. World: the world's axes, metres.
    pub position: [F; 3],
    /// Unit quaternion w, x, y, z: own axes → frame.
    pub rotation: [F; 4],
    /// log₂ of the standard deviations along the three axes.
    pub log2_scale: [F; 3],
    /// Display-referred sRGB (with harmonics: the constant term's colour).
    pub color: [F; 3],
    /// In [0, 1].
    pub opacity: F,
}

/// A number, or several side by side.
pub trait Number: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {}

impl<F: Copy + Add<Output = F> + Sub<Output = F> + Mul<Output = F>> Number for F {}

/// Codes to numbers: `offset + code · step`.
pub trait Linear: Copy {
    /// Value of code 0, and difference between codes.
    fn parts(self) -> (f32, f32);

    /// offset + code · step, of one code or of several side by side; `constant` makes an `F` of an f32.
    #[inline(always)]
    fn decode<F: Number>(self, code: F, constant: &impl Fn(f32) -> F) -> F {
        let (offset, step) = self.parts();
        constant(offset) + code * constant(step)
    }

    /// The value of a code.
    #[inline]
    fn value(self, code: u16) -> f32 {
        self.decode(f32::from(code), &|x| x)
    }

    /// The nearest code to `value`, in 0..=`last`.
    fn code(self, value: f32, last: u16) -> u16 {
        let (offset, step) = self.parts();
        if step > 0.0 {
            // Saturates; NaN becomes 0.
            (((value - offset) / step + 0.5) as u16).min(last)
        } else {
            0
        }
    }

    /// Whether every code up to `last` has a finite value of at most `limit`.
    fn is_within(self, last: u16, limit: f32) -> bool {
        let ((low, step), high) = (self.parts(), self.value(last));
        low.abs() <= limit && high.abs() <= limit && step >= 0.0
    }
}

impl Linear for Range {
    #[inline(always)]
    fn parts(self) -> (f32, f32) {
        (self.offset.get(), self.step.get())
    }
}

impl Linear for ShortRange {
    #[inline(always)]
    fn parts(self) -> (f32, f32) {
        (self.offset.get(), self.step.get())
    }
}

#[inline(always)]
fn decode_each<F: Number>(
    ranges: &[impl Linear; 3],
    codes: [F; 3],
    constant: &impl Fn(f32) -> F,
) -> [F; 3] {
    let ([a, b, c], [x, y, z]) = (ranges, codes);
    [a.decode(x, constant), b.decode(y, constant), c.decode(z, constant)]
}

/// A disc's position as its codes have it: x, y, ∛z. Most discs lie near their triangle and few far off, so codes are close to
/// each other near 0: it saves more than a bit.
pub fn rooted([x, y, z]: [f32; 3]) -> [f32; 3] {
    [x, y, libm::cbrtf(z)]
}

/// Radians per code of a disc's angle of `bits` bits: π/2 / 2^bits, exact but for π.
#[inline(always)]
pub fn angle_step(bits: u8) -> f32 {
    FRAC_PI_2 / (1u32 << (bits & 31)) as f32
}

/// The last code of `bits` bits, at most 8.
pub fn last_code(bits: u8) -> u16 {
    (1 << (bits & 15)) - 1
}

impl Range {
    /// The range that codes 0..=`last` need to reach from `min` to `max`.
    pub fn spanning(min: f32, max: f32, last: u16) -> Self {
        Self { offset: min.into(), step: ((max - min) / f32::from(last)).into() }
    }
}

impl ShortRange {
    /// A range whose codes 0..=`last` reach from `min` to `max`, and a little beyond: an offset not above `min`, then
    /// the least step. With one code alone, the nearest to the middle.
    pub fn spanning(min: f32, max: f32, last: u16) -> Self {
        if last == 0 {
            let middle = min + (max - min) / 2.0;
            let [below, above] = [Bf16::at_most(middle), Bf16::at_least(middle)];
            let is_nearer = above.get() - middle < middle - below.get();
            return Self { offset: if is_nearer { above } else { below }, step: Bf16::default() };
        }
        let offset = Bf16::at_most(min);
        let mut step = Bf16::at_least((max - offset.get()) / f32::from(last));
        if (Self { offset, step }).value(last) < max {
            // The sum was rounded down: the next step.
            step = Bf16::at_least(step.get() * (1.0 + f32::EPSILON));
        }
        Self { offset, step }
    }
}

impl DiscGroup {
    /// Decodes the codes of a disc, or of several side by side, the angle of `angle_bits` bits; `constant` makes
    /// an `F` of an f32.
    #[inline(always)]
    pub fn disc_of_codes<F: Number>(
        &self,
        codes: &Disc<F>,
        angle_bits: u8,
        constant: impl Fn(f32) -> F,
    ) -> Disc<F> {
        let [s, t] = codes.log2_scale;
        let [x, y, root] = decode_each(&self.position, codes.position, &constant);
        Disc {
            position: [x, y, root * root * root],
            angle: (codes.angle + constant(0.5)) * constant(angle_step(angle_bits)),
            log2_scale: [
                self.log2_scale.decode(s, &constant),
                self.log2_scale.decode(t, &constant),
            ],
            color: rgb_of_ycocg(decode_each(&self.color, codes.color, &constant)),
            opacity: self.opacity.decode(codes.opacity, &constant),
        }
    }

    /// Encodes an [upright](Disc::upright) disc whose values lie in this group's ranges.
    pub fn encode(&self, disc: &Disc, layout: DiscLayout) -> Disc<u16> {
        let widths = layout.widths();
        // A code stands for the middle of its step; what rounding made π/2 is of the last one.
        let angle = (disc.angle / angle_step(widths.angle)) as u16;
        let angle = angle.min(last_code(widths.angle));
        let ycocg = ycocg_of_rgb(disc.color);
        let code = |range: ShortRange, value: f32, bits: u8| range.code(value, last_code(bits));
        let position = rooted(disc.position);
        Disc {
            position: core::array::from_fn(|i| {
                code(self.position[i], position[i], widths.position[i])
            }),
            angle,
            log2_scale: disc.log2_scale.map(|scale| code(self.log2_scale, scale, widths.scale)),
            color: core::array::from_fn(|i| code(self.color[i], ycocg[i], widths.color[i])),
            opacity: code(self.opacity, disc.opacity, widths.opacity),
        }
    }
}

impl FullGroup {
    /// Decodes a Gaussian with rotation and three scales.
    #[inline]
    pub fn full(&self, record: &FullRecord) -> Full {
        let codes = Full {
            position: record.position.map(|code| f32::from(code.get())),
            rotation: quaternion_value(record.rotation.get()),
            log2_scale: record.scale.map(f32::from),
            color: record.color.map(f32::from),
            opacity: opacity_value(record.opacity),
        };
        self.full_of_codes(&codes, |x| x)
    }

    /// Decodes the codes of a Gaussian with rotation and three scales, or of several side by side. Every
    /// field of `codes` is a code but rotation and opacity, which are values and stay; `constant` makes an
    /// `F` of an f32.
    #[inline(always)]
    pub fn full_of_codes<F: Number>(
        &self,
        codes: &Full<F>,
        constant: impl Fn(f32) -> F,
    ) -> Full<F> {
        Full {
            position: decode_each(&self.position, codes.position, &constant),
            rotation: codes.rotation,
            log2_scale: decode_each(&[self.log2_scale; 3], codes.log2_scale, &constant),
            color: rgb_of_ycocg(decode_each(&self.color, codes.color, &constant)),
            opacity: codes.opacity,
        }
    }

    /// Encodes a Gaussian whose values lie in this group's ranges.
    pub fn encode(&self, full: &Full) -> FullRecord {
        let ycocg = ycocg_of_rgb(full.color);
        FullRecord {
            position: core::array::from_fn(|i| {
                self.position[i].code(full.position[i], u16::MAX).into()
            }),
            rotation: quaternion_code(full.rotation).into(),
            scale: full.log2_scale.map(|scale| self.log2_scale.code(scale, 255) as u8),
            color: core::array::from_fn(|i| self.color[i].code(ycocg[i], 255) as u8),
            opacity: opacity_code(full.opacity),
        }
    }
}

/// Luma and chroma, along which colours of neighbours differ least: Y = (r + 2g + b) / 4,
/// Co = (r − b) / 2, Cg = (2g − r − b) / 4.
pub fn ycocg_of_rgb([r, g, b]: [f32; 3]) -> [f32; 3] {
    [(r + 2.0 * g + b) / 4.0, (r - b) / 2.0, (2.0 * g - r - b) / 4.0]
}

/// The inverse of [`ycocg_of_rgb`], of one colour or of several side by side.
#[inline(always)]
pub fn rgb_of_ycocg<F: Number>([luma, orange, green]: [F; 3]) -> [F; 3] {
    let rest = luma - green;
    [rest + orange, luma + green, rest - orange]
}

/// Opacity of a code.
#[inline]
pub fn opacity_value(code: u8) -> f32 {
    f32::from(code) * (1.0 / 255.0)
}

/// Nearest code of an opacity.
pub fn opacity_code(opacity: f32) -> u8 {
    (opacity * 255.0 + 0.5) as u8
}

/// √½: no component but the greatest of a unit quaternion exceeds it.
pub const HALF_ROOT: f32 = core::f32::consts::FRAC_1_SQRT_2;
/// Codes of a component: 10 bits, 0 in the middle.
pub const COMPONENT_MIDDLE: f32 = 511.0;

/// Smallest three: bits 30..32 say which component is the greatest (left out, positive), then 10
/// bits for each other one in the order w, x, y, z: (code − 511) / 511 · √½.
pub fn quaternion_code(rotation: [f32; 4]) -> u32 {
    let mut greatest = 0;
    for i in 1..4 {
        if rotation[i].abs() > rotation[greatest].abs() {
            greatest = i;
        }
    }
    let sign = if rotation[greatest] < 0.0 { -1.0 } else { 1.0 };
    let mut code = greatest as u32;
    for (i, component) in rotation.into_iter().enumerate() {
        if i != greatest {
            let scaled = sign * component / HALF_ROOT * COMPONENT_MIDDLE + COMPONENT_MIDDLE;
            code = code << 10 | ((scaled + 0.5) as u32).min(1022);
        }
    }
    code
}

/// The quaternion of a code; its length is 1 up to rounding, or up to 22 % more for codes that
/// [`quaternion_code`] never makes.
#[inline]
pub fn quaternion_value(code: u32) -> [f32; 4] {
    let component = |shift: u32| {
        ((code >> shift & 1023) as f32 - COMPONENT_MIDDLE) * (HALF_ROOT / COMPONENT_MIDDLE)
    };
    let (a, b, c) = (component(20), component(10), component(0));
    let rest = 1.0 - (a * a + b * b + c * c);
    let greatest = if rest > 0.0 { libm::sqrtf(rest) } else { 0.0 };
    match code >> 30 {
        0 => [greatest, a, b, c],
        1 => [a, greatest, b, c],
        2 => [a, b, greatest, c],
        _ => [a, b, c, greatest],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotations_return_within_a_third_of_a_degree() {
        let mut seed = 1u32;
        let mut random = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as f32 / 8_388_608.0 - 1.0
        };
        for _ in 0..10_000 {
            let raw: [f32; 4] = core::array::from_fn(|_| random());
            let length = raw.iter().map(|x| x * x).sum::<f32>().sqrt();
            let unit = raw.map(|x| x / length);
            let back = quaternion_value(quaternion_code(unit));
            let dot: f32 = unit.iter().zip(back).map(|(a, b)| a * b).sum();
            // The angle between the two is 2 acos(dot).
            assert!(dot.abs() > libm::cosf(0.333f32.to_radians() / 2.0), "{unit:?} {back:?}");
        }
    }

    #[test]
    fn colours_return() {
        for rgb in [[0.0, 0.0, 0.0], [1.0, 0.5, 0.25], [0.2, 0.9, 1.1]] {
            let back = rgb_of_ycocg(ycocg_of_rgb(rgb));
            assert!(rgb.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-6));
        }
    }
}
