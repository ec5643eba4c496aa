//! Numbers of a Gaussian in SPZ's codes, and back.
//!
//! | plane | bytes | code |
//! |---|---|---|
//! | positions | 9 | 3 i24: metres · 2^bits |
//! | alphas | 1 | u8: opacity · 255 |
//! | colours | 3 | 3 u8: (0.15 · `f_dc` + ½) · 255 |
//! | scales | 3 | 3 u8: (ln σ + 10) · 16 |
//! | rotations | 3 or 4 | version 2: x, y, z, (q + 1) · 127.5, where w is not negative; then: smallest three |
//! | harmonics | 3 · ((degree + 1)² − 1) | u8: 128 · coefficient + 128, (r, g, b) after (r, g, b) |
//!
//! Smallest three, u32: from the highest bit on two that name the greatest component of x, y, z, w, which is
//! made positive and left out, then for each of the others a sign and 9 bits of its magnitude · 511 / √½.

use std::f64::consts::{FRAC_1_SQRT_2, LN_2, LOG2_E};

use super::splat_ply::CONSTANT_HARMONIC;
use super::splats::Splat;

/// What the bytes of a Gaussian are, in the order of the file.
pub(crate) const PLANES: [&str; 6] =
    ["positions", "alphas", "colours", "scales", "rotations", "harmonics"];

/// Coefficients of a Gaussian at the greatest degree of the format, 4.
pub(super) const MOST_HARMONICS: usize = 72;

/// First version with rotations by their smallest three.
const SMALLEST_THREE: u32 = 3;

/// `f_dc` · this + ½ is in [0, 1] where the format can hold it.
const COLOR: f64 = 0.15;

/// Greatest magnitude of a component that is not the greatest, in codes.
const ROTATION: f64 = 511.0 / FRAC_1_SQRT_2;

/// Bytes of a Gaussian in each plane.
pub(crate) fn widths(version: u32, degree: u8) -> [usize; 6] {
    let harmonics = 3 * ((usize::from(degree) + 1).pow(2) - 1);
    [9, 1, 3, 3, if version < SMALLEST_THREE { 3 } else { 4 }, harmonics]
}

/// The Gaussian whose bytes these are; `coefficients`, as many as it has, are decoded already.
pub(super) fn decode<'a>(
    [position, alpha, color, scale, turn, _]: [&[u8]; 6],
    fraction_bits: u8,
    coefficients: &'a [f32],
) -> Splat<'a> {
    let step = libm::exp2(-f64::from(fraction_bits));
    let fixed = |i: usize| {
        // In the upper bytes of 32 bits, so that its sign is theirs.
        let [a, b, c] = [0, 1, 2].map(|byte| position[3 * i + byte]);
        f64::from(i32::from_le_bytes([0, a, b, c]) >> 8) * step
    };
    let share = |code: u8| f64::from(code) / 255.0;
    Splat {
        position: [0, 1, 2].map(fixed),
        rotation: match turn {
            &[x, y, z] => first_three([x, y, z]),
            _ => {
                smallest_three(turn.iter().rev().fold(0, |code, &byte| code << 8 | u32::from(byte)))
            }
        },
        log2_scale: [0, 1, 2].map(|i| (f64::from(scale[i]) / 16.0 - 10.0) * LOG2_E),
        color: [0, 1, 2].map(|i| 0.5 + CONSTANT_HARMONIC * (share(color[i]) - 0.5) / COLOR),
        opacity: share(alpha[0]),
        harmonics: coefficients,
    }
}

/// A coefficient.
pub(super) fn harmonic(code: u8) -> f32 {
    (f32::from(code) - 128.0) / 128.0
}

fn first_three(codes: [u8; 3]) -> [f64; 4] {
    let [x, y, z] = codes.map(|code| f64::from(code) / 127.5 - 1.0);
    [(1.0 - x * x - y * y - z * z).max(0.0).sqrt(), x, y, z]
}

/// w, x, y, z.
fn smallest_three(mut code: u32) -> [f64; 4] {
    let greatest = (code >> 30) as usize;
    let mut xyzw = [0.0; 4];
    for i in (0..4).rev().filter(|&i| i != greatest) {
        let magnitude = f64::from(code & 0x1ff) / ROTATION;
        xyzw[i] = if code & 0x200 == 0 { magnitude } else { -magnitude };
        code >>= 10;
    }
    let rest: f64 = xyzw.iter().map(|x| x * x).sum();
    xyzw[greatest] = (1.0 - rest).max(0.0).sqrt();
    xyzw.rotate_right(1);
    xyzw
}

/// A byte, and whether `x` is one when rounded, or had to be brought into its range.
pub(crate) type Code = (u8, bool);

fn code(x: f64) -> Code {
    let rounded = libm::round(x);
    (rounded.clamp(0.0, 255.0) as u8, (0.0..=255.0).contains(&rounded))
}

/// Three bytes of a coordinate, metres, at most 2²³ − 1 steps.
pub(crate) fn position_bytes(x: f64, fraction_bits: u8) -> [u8; 3] {
    let greatest = f64::from((1 << 23) - 1);
    let steps = libm::round(x * libm::exp2(f64::from(fraction_bits))).clamp(-greatest, greatest);
    let [a, b, c, _] = (steps as i32).to_le_bytes();
    [a, b, c]
}

/// Code of an opacity.
pub(crate) fn alpha_code(opacity: f64) -> Code {
    code(255.0 * opacity)
}

/// Code of a channel of the constant colour.
pub(crate) fn color_code(channel: f64) -> Code {
    code(255.0 * (COLOR * (channel - 0.5) / CONSTANT_HARMONIC + 0.5))
}

/// Code of log₂ of a standard deviation, metres. What is under e⁻¹⁰ m, 45 µm, comes out as that: it is a point.
pub(crate) fn scale_code(log2_scale: f64) -> Code {
    code((16.0 * (log2_scale * LN_2 + 10.0)).max(0.0))
}

/// Code of a coefficient.
pub(crate) fn harmonic_code(coefficient: f64) -> Code {
    code(128.0 * coefficient + 128.0)
}

/// Bytes of a quaternion w, x, y, z of length 1 by its smallest three.
pub(crate) fn rotation_bytes([w, x, y, z]: [f64; 4]) -> [u8; 4] {
    let xyzw = [x, y, z, w];
    let greatest =
        (1..4).fold(0, |best, i| if xyzw[i].abs() > xyzw[best].abs() { i } else { best });
    let mut code = greatest as u32;
    for (_, x) in xyzw.iter().enumerate().filter(|(i, _)| *i != greatest) {
        let x = x * xyzw[greatest].signum();
        let magnitude = libm::round(x.abs() * ROTATION).min(511.0) as u32;
        code = code << 10 | u32::from(x < 0.0) << 9 | magnitude;
    }
    code.to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(position: [u8; 3], codes: [u8; 3], turn: u32, bits: u8) -> Splat<'static> {
        let position = [position; 3].concat();
        decode([&position, &codes[..1], &codes, &codes, &turn.to_le_bytes(), &[]], bits, &[])
    }

    #[test]
    fn every_code_comes_back() {
        for byte in 0..=255 {
            let splat = decoded([0; 3], [byte; 3], 0, 12);
            assert_eq!(alpha_code(splat.opacity), (byte, true));
            assert_eq!(color_code(splat.color[2]), (byte, true));
            assert_eq!(scale_code(splat.log2_scale[1]), (byte, true));
            assert_eq!(harmonic_code(harmonic(byte).into()), (byte, true));
            for bits in [0, 12, 23] {
                let position = [byte, 3, 255 - byte];
                let x = decoded(position, [0; 3], 0, bits).position[0];
                assert_eq!(position_bytes(x, bits), position);
            }
        }
    }

    #[test]
    fn quaternions_come_back() {
        for greatest in 0..4u32 {
            for codes in [[0, 0, 0], [1, 2, 3], [100, 600, 20], [300, 5, 812], [811, 811, 811]] {
                let code = codes.iter().fold(greatest, |code, part| code << 10 | part);
                let turn = decoded([0; 3], [0; 3], code, 0).rotation;
                let length: f64 = turn.iter().map(|x| x * x).sum();
                assert!((length - 1.0).abs() < 1e-12, "{turn:?}");
                assert_eq!(rotation_bytes(turn), code.to_le_bytes(), "{turn:?}");
                assert_eq!(rotation_bytes(turn.map(|x| -x)), code.to_le_bytes(), "{turn:?}");
            }
        }
    }

    #[test]
    fn what_is_beyond_a_code_is_told() {
        assert_eq!([color_code(1.5), color_code(-0.5)], [(255, false), (0, false)]);
        assert_eq!([harmonic_code(1.0), harmonic_code(-1.01)], [(255, false), (0, false)]);
        assert_eq!([scale_code(9.0), scale_code(-20.0)], [(255, false), (0, true)]);
        assert_eq!(position_bytes(9e9, 0), [255, 255, 127]);
    }
}
