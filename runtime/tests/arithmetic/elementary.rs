//! exp2, log2 and line against libm in f64, over the domains and within the bounds that [`Real`]
//! states. Steps through the bits are primes, so that every mantissa comes up in some binade.

use dermis_runtime::math::Real;

use crate::{both, floats};

const NOT_FINITE: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];

#[test]
fn exp2_is_within_its_bound() {
    let mut worst = 0.0f64;
    let domain = floats(0.0, 127.0, 509).flat_map(both).filter(|&x| x >= -125.0);
    for x in domain.chain([-125.0]) {
        let exact = libm::exp2(f64::from(x));
        worst = worst.max((f64::from(x.exp2_of_real()) / exact - 1.0).abs());
    }
    println!("exp2: relative error {worst:.3e}");
    assert!(worst <= 3e-6, "{worst:e}");
}

/// Zero below, the greatest power above; the step at −125 is the smallest normal numbers' end.
#[test]
fn exp2_ends_at_minus_125_and_at_127() {
    let exp2 = |x: f32| x.exp2_of_real();
    for x in floats(125.0, f32::MAX, 65_521).skip(1).chain([125.0f32.next_up(), f32::INFINITY]) {
        assert_eq!(exp2(-x).to_bits(), 0, "−{x}");
    }
    let least = exp2(-125.0);
    assert!(least >= 0.999_99 * 2.0 * f32::MIN_POSITIVE, "{least:e} is normal");
    let greatest = exp2(127.0);
    assert!((f64::from(greatest) / libm::exp2(127.0) - 1.0).abs() <= 3e-6);
    for x in floats(127.0, f32::MAX, 65_521).chain([f32::INFINITY, f32::NAN]) {
        assert_eq!(exp2(x).to_bits(), greatest.to_bits(), "{x}");
    }
    for zero in [0.0, -0.0, f32::MIN_POSITIVE, -f32::MIN_POSITIVE, 1e-45, -1e-45] {
        assert_eq!(exp2(zero).to_bits(), exp2(0.0).to_bits(), "{zero:e}");
    }
}

#[test]
fn log2_is_within_its_bound() {
    // As a share of the bound, which grows with the logarithm.
    let mut worst = (0.0f64, 0.0);
    for x in floats(f32::MIN_POSITIVE, f32::MAX, 509) {
        let exact = libm::log2(f64::from(x));
        let share = (f64::from(Real::log2(x)) - exact).abs() / (3e-7 + 1.2e-7 * exact.abs());
        if share > worst.0 {
            worst = (share, x);
        }
    }
    println!("log2: {:.3} of its bound at {:e}", worst.0, worst.1);
    assert!(worst.0 <= 1.0, "{worst:?}");
    // Powers of two and their neighbours, where mantissa and exponent change.
    for power in -126..=127 {
        let x = libm::exp2f(power as f32);
        assert_eq!(Real::log2(x), power as f32, "2^{power}");
    }
}

#[test]
fn log2_of_all_else_is_minus_127() {
    let subnormal = floats(0.0, f32::MIN_POSITIVE.next_down(), 509);
    let negative = floats(0.0, f32::MAX, 65_521).map(|x| -x);
    for x in subnormal.chain(negative).chain(NOT_FINITE) {
        assert_eq!(Real::log2(x), -127.0, "{x:e}");
    }
}

/// Greatest difference of both from sine and cosine, whichever sign the two share.
fn error_of_line(angle: f32) -> f64 {
    let [sin, cos] = angle.line().map(f64::from);
    let (s, c) = libm::sincos(f64::from(angle));
    let off = |sign: f64| (sin - sign * s).abs().max((cos - sign * c).abs());
    off(1.0).min(off(-1.0))
}

#[test]
fn line_is_within_its_bound() {
    let mut worst = (0.0f64, 0.0);
    let bits = floats(0.0, 1e4f32.next_down(), 509);
    // By bits few of the larger angles come up.
    let even = (0..2_000_000).map(|i| i as f32 * 5e-3);
    // Where the nearest multiple of π changes, and where sine or cosine is 0.
    let turns = (0..6366u32).flat_map(|k| {
        let at = (f64::from(k) * core::f64::consts::FRAC_PI_2) as f32;
        [at.next_down(), at, at.next_up()]
    });
    for angle in bits.chain(even).chain(turns).flat_map(both).filter(|x| x.abs() < 1e4) {
        let share = error_of_line(angle) / (3e-7 + 2e-8 * f64::from(angle.abs()));
        if share > worst.0 {
            worst = (share, angle);
        }
    }
    println!("line: {:.3} of its bound at {}", worst.0, worst.1);
    assert!(worst.0 <= 1.0, "{worst:?}");
    // What a disc can hold.
    for code in 0..256u16 {
        let angle = f32::from(code) * dermis_format::quant::angle_step(8);
        assert!(error_of_line(angle) <= 3e-7 + 2e-8 * f64::from(angle), "code {code}");
    }
}

/// Beyond its domain the line's direction means nothing, but it is no reason to stop.
#[test]
fn line_of_odd_angles_does_not_panic() {
    for angle in floats(1e4, f32::MAX, 65_521).chain(NOT_FINITE) {
        let _ = angle.line();
    }
}

/// f32 has an `exp2` of its own, the platform's.
trait OfReal {
    fn exp2_of_real(self) -> f32;
}

impl OfReal for f32 {
    fn exp2_of_real(self) -> f32 {
        Real::exp2(self)
    }
}

#[test]
fn nearest_integers() {
    let domain = floats(0.0, 4_194_303.5, 509);
    let halves = (0..2000u16).map(|i| f32::from(i) * 0.5);
    for x in domain.chain(halves).flat_map(both) {
        let exact = f64::from(x);
        assert_eq!(f64::from(x.nearest()), libm::rint(exact), "nearest {x}");
    }
}
