//! Colour by direction: real spherical harmonics up to degree 3, in 3D Gaussian Splatting's order.

use crate::math::{Real, add, dot, each, scale, sub};
use crate::select::Harmonics;

// √(1/π) times rationals and roots: the normalization of the real harmonics.
const C1: f32 = 0.488_602_5;
const C2: [f32; 3] = [1.092_548_4, 0.315_391_57, 0.546_274_2];
const C3: [f32; 5] = [0.590_043_6, 2.890_611_4, 0.457_045_8, 0.373_176_33, 1.445_305_7];

/// Colour = max(0, constant + Σ coefficient · basis), where `constant` already holds the + 0.5 and
/// `direction` points from the camera to the Gaussian, of unit length, world axes. Coefficients are
/// (r, g, b) after (r, g, b).
#[inline(always)]
pub fn color<R: Real>(
    constant: [R; 3],
    coefficients: impl Iterator<Item = [R; 3]>,
    direction: [R; 3],
) -> [R; 3] {
    let mut sum = constant;
    for (coefficient, weight) in coefficients.zip(basis(direction)) {
        sum = add(sum, scale(coefficient, weight));
    }
    not_below_zero(sum)
}

impl Harmonics<'_> {
    /// Colour of a Gaussian at `center` seen from `eye`, whose constant term is `constant`.
    pub fn seen<R: Real + 'static>(&self, constant: [R; 3], center: [R; 3], eye: [R; 3]) -> [R; 3] {
        color(constant, self.values(constant[0]), direction(center, eye))
    }
}

/// Unit vector from `eye` to `center`; zero where they are one.
#[inline(always)]
pub fn direction<R: Real>(center: [R; 3], eye: [R; 3]) -> [R; 3] {
    let ray = sub(center, eye);
    let length = dot(ray, ray).sqrt();
    let (zero, one) = (length.like(0.0), length.like(1.0));
    scale(ray, R::select(zero.below(length), one / length, zero))
}

/// max(0, colour): what no direction may go below.
#[inline(always)]
pub fn not_below_zero<R: Real>(color: [R; 3]) -> [R; 3] {
    each(
        color,
        #[inline(always)]
        |channel| channel.at_least(channel.like(0.0)),
    )
}

/// The 15 basis functions of degrees 1 to 3.
#[inline(always)]
fn basis<R: Real>([x, y, z]: [R; 3]) -> [R; 15] {
    let c = |x: f32| z.like(x);
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        -(c(C1) * y),
        c(C1) * z,
        -(c(C1) * x),
        c(C2[0]) * x * y,
        -(c(C2[0]) * y * z),
        c(C2[1]) * (zz + zz - xx - yy),
        -(c(C2[0]) * x * z),
        c(C2[2]) * (xx - yy),
        -(c(C3[0]) * y * (c(3.0) * xx - yy)),
        c(C3[1]) * x * y * z,
        -(c(C3[2]) * y * (c(4.0) * zz - xx - yy)),
        c(C3[3]) * z * (zz + zz - c(3.0) * (xx + yy)),
        -(c(C3[2]) * x * (c(4.0) * zz - xx - yy)),
        c(C3[4]) * z * (xx - yy),
        -(c(C3[0]) * x * (xx - c(3.0) * yy)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Orthonormal over the sphere: the integral of bᵢ bⱼ is 1 where i = j, else 0.
    #[test]
    fn basis_is_orthonormal() {
        let n = 400;
        let mut gram = [[0.0f64; 15]; 15];
        for i in 0..n {
            // Gauss-like in z by midpoints, uniform in longitude: exact enough at degree 6.
            let z = (i as f64 + 0.5) / n as f64 * 2.0 - 1.0;
            for j in 0..16 {
                let (sin, cos) = libm::sincos(j as f64 * core::f64::consts::PI / 8.0);
                let r = libm::sqrt(1.0 - z * z);
                let b = basis([r * cos, r * sin, z]);
                for (row, p) in gram.iter_mut().zip(b) {
                    for (cell, q) in row.iter_mut().zip(b) {
                        *cell += p * q * 4.0 * core::f64::consts::PI / (16 * n) as f64;
                    }
                }
            }
        }
        for (i, row) in gram.iter().enumerate() {
            for (j, &cell) in row.iter().enumerate() {
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((cell - expected).abs() < 1e-3, "<{i}, {j}> = {cell}");
            }
        }
    }
}
