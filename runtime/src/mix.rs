//! A disc on its way from one level to the one below.

use core::f32::consts::{FRAC_2_PI, FRAC_PI_2};

use dermis_format::Disc;

use crate::math::Real;

/// The way from `upper` to `lower`, of which `share` in [0, 1] is gone. Not the opacity, which stays that of
/// `upper`: whether a Gaussian is drawn at all is decided by it before (`select`).
///
/// After a quarter turn a disc is the same, its scales exchanged: the way is that to the angle which is the nearest.
#[inline(always)]
pub fn mixed<R: Real>(upper: &Disc<R>, lower: &Disc<R>, share: R) -> Disc<R> {
    let quarters = quarters(upper.angle, lower.angle);
    let there = lower.angle - quarters * share.like(FRAC_PI_2);
    let [s, t] = lower.log2_scale;
    let exchanges = is_odd(quarters);
    let scales = [R::select(exchanges, t, s), R::select(exchanges, s, t)];
    Disc {
        position: toward(upper.position, lower.position, share),
        angle: between(upper.angle, there, share),
        log2_scale: toward(upper.log2_scale, scales, share),
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

/// Quarter turns, a whole number of them, from nearest to the angle `from` to the angle `to`.
#[inline(always)]
pub fn quarters<R: Real>(from: R, to: R) -> R {
    ((to - from) * from.like(FRAC_2_PI)).nearest()
}

/// Whether so many quarter turns exchange the scales of a disc.
#[inline(always)]
pub fn is_odd<R: Real>(quarters: R) -> R::Mask {
    let half = quarters * quarters.like(0.5);
    quarters.like(0.25).below((half - half.nearest()).abs())
}
