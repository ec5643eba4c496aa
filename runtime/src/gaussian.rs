//! A Gaussian on a posed frame: its centre and axes in the world.

use crate::frame::Frame;
use crate::math::{Real, each, rotation_rows, scale};

/// A Gaussian in the world with `N` axes: Σ = a₀a₀ᵀ + … (3×3). Two axes make a flat disc.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipsoid<R, const N: usize> {
    /// Centre, metres.
    pub center: [R; 3],
    /// Metres. On frames with orthogonal axes they are orthogonal, and their lengths are the standard deviations; on
    /// affine ones they are any that give Σ.
    pub axes: [[R; 3]; N],
}

/// X' = F · X + T, F being the frame's axes (size · R where they are orthogonal), with axes
/// σ₀(cos θ, sin θ, 0) and σ₁(−sin θ, cos θ, 0) in the frame.
#[inline(always)]
pub fn disc_on<R: Real>(
    frame: &Frame<R>,
    position: [R; 3],
    angle: R,
    log2_scale: [R; 2],
) -> Ellipsoid<R, 2> {
    let [sin, cos] = angle.line();
    let [first, second] = each(
        log2_scale,
        #[inline(always)]
        |scale: R| scale.exp2(),
    );
    let zero = angle.like(0.0);
    Ellipsoid {
        center: frame.point(position),
        axes: [
            frame.direction([cos * first, sin * first, zero]),
            frame.direction([-(sin * second), cos * second, zero]),
        ],
    }
}

/// X' = F · X + T, with axes σᵢ · rotation · eᵢ in the frame.
#[inline(always)]
pub fn full_on<R: Real>(
    frame: &Frame<R>,
    position: [R; 3],
    rotation: [R; 4],
    log2_scale: [R; 3],
) -> Ellipsoid<R, 3> {
    let rows = rotation_rows(rotation);
    Ellipsoid {
        center: frame.point(position),
        axes: each(
            [0, 1, 2],
            #[inline(always)]
            |i: usize| {
                let column = [rows[0][i], rows[1][i], rows[2][i]];
                frame.direction(scale(column, log2_scale[i].exp2()))
            },
        ),
    }
}
