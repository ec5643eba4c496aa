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

/// Codes of angles are 2⁻⁹ quarter turns apart, or a multiple: this makes none of them half way between two.
const OFF_TIES: f32 = 1.0 / 2048.0;

/// Quarter turns, a whole number of them, from nearest to the angle `from` to the angle `to`.
#[inline(always)]
pub fn quarters<R: Real>(from: R, to: R) -> R {
    ((to - from) * from.like(FRAC_2_PI) - from.like(OFF_TIES)).nearest()
}

/// Whether so many quarter turns exchange the scales of a disc.
#[inline(always)]
pub fn is_odd<R: Real>(quarters: R) -> R::Mask {
    let half = quarters * quarters.like(0.5);
    quarters.like(0.25).below((half - half.nearest()).abs())
}

#[cfg(test)]
mod tests {
    use core::f32::consts::PI;

    use proptest::prelude::*;

    use super::*;

    /// Of the ellipse that a disc is in its plane: xx, xy and yy of its covariance.
    fn covariance(disc: &Disc) -> [f32; 3] {
        let ([s, t], [sin, cos]) =
            (disc.log2_scale.map(|log2| libm::exp2f(2.0 * log2)), disc.angle.line());
        [s * cos * cos + t * sin * sin, (s - t) * sin * cos, s * sin * sin + t * cos * cos]
    }

    fn is_near(a: &Disc, b: &Disc) -> bool {
        covariance(a).iter().zip(covariance(b)).all(|(a, b)| (a - b).abs() < 1e-4)
    }

    fn discs() -> impl Strategy<Value = Disc> {
        (-7.0f32..7.0, [-2.0f32..0.0, -2.0..0.0]).prop_map(|(angle, log2_scale)| Disc {
            angle,
            log2_scale,
            ..Disc::default()
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn the_way_leads_from_one_disc_to_the_other(upper in discs(), lower in discs()) {
            prop_assert!(is_near(&mixed(&upper, &lower, 0.0), &upper));
            prop_assert!(is_near(&mixed(&upper, &lower, 1.0), &lower));
            prop_assert!((mixed(&upper, &lower, 1.0).angle - upper.angle).abs() < PI / 4.0 + 1e-3);
        }

        #[test]
        fn the_way_is_the_same_by_any_angle_of_a_disc(
            upper in discs(), lower in discs(), share in 0.0f32..1.0, turns in 0u8..4,
        ) {
            // Half way between two quarter turns either way is as near.
            let apart = (lower.angle - upper.angle) * FRAC_2_PI;
            prop_assume!((apart - libm::floorf(apart) - 0.5).abs() > 1e-3);
            let turned = (0..turns).fold(lower, |disc, _| {
                Disc { angle: disc.angle + FRAC_PI_2, ..disc.exchanged() }
            });
            prop_assert!(is_near(&mixed(&upper, &turned, share), &mixed(&upper, &lower, share)));
            let way = |upper: Disc| mixed(&upper, &lower, share);
            prop_assert!(is_near(&way(upper.upright()), &way(upper)));
        }

        #[test]
        fn an_upright_disc_is_the_same_one(disc in discs()) {
            let upright = disc.upright();
            prop_assert!((0.0..=FRAC_PI_2).contains(&upright.angle));
            prop_assert!(is_near(&upright, &disc));
            // Far round, as well as an f32 says where.
            let far = Disc { angle: 100.0 * disc.angle, ..disc };
            prop_assert!(is_near(&far.upright(), &far));
        }
    }
}
