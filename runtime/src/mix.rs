//! A disc on its way from one level to the one below.

use core::f32::consts::{FRAC_1_PI, PI};

use dermis_format::Disc;

use crate::math::Real;

/// The way from `upper` to `lower`, of which `share` in [0, 1] is gone. Not the opacity, which stays that of
/// `upper`: whether a Gaussian is drawn at all is decided by it before (`select`).
#[inline(always)]
pub fn mixed<R: Real>(upper: &Disc<R>, lower: &Disc<R>, share: R) -> Disc<R> {
    Disc {
        position: toward(upper.position, lower.position, share),
        angle: upper.angle + share * turn(lower.angle - upper.angle),
        log2_scale: toward(upper.log2_scale, lower.log2_scale, share),
        color: toward(upper.color, lower.color, share),
        opacity: upper.opacity,
    }
}

/// upper + share · (lower − upper).
#[inline(always)]
pub fn between<R: Real>(upper: R, lower: R, share: R) -> R {
    upper + share * (lower - upper)
}

/// [`between`] of each.
#[inline(always)]
fn toward<R: Real, const N: usize>(upper: [R; N], lower: [R; N], share: R) -> [R; N] {
    let mut mixed = upper;
    for i in 0..N {
        mixed[i] = between(upper[i], lower[i], share);
    }
    mixed
}

/// The same line's angle nearest to 0, in [−π/2, π/2] radians: lines are the same after half a turn.
#[inline(always)]
pub fn turn<R: Real>(angle: R) -> R {
    angle - angle.like(PI) * (angle * angle.like(FRAC_1_PI)).nearest()
}
