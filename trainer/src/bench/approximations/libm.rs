//! f32 whose transcendental functions are libm's in place of the runtime's polynomials.

use std::ops::{Add, Div, Mul, Neg, Sub};

use dermis_runtime::math::Real;

/// A number of the front end.
pub(super) trait Number: Real<Mask = bool> + 'static {
    fn of(x: f32) -> Self;
    fn get(self) -> f32;
}

impl Number for f32 {
    fn of(x: f32) -> Self {
        x
    }
    fn get(self) -> f32 {
        self
    }
}

/// An f32 with libm's functions.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub(super) struct Libm(f32);

impl Number for Libm {
    fn of(x: f32) -> Self {
        Self(x)
    }
    fn get(self) -> f32 {
        self.0
    }
}

impl Real for Libm {
    type Mask = bool;
    fn like(self, x: f32) -> Self {
        Self(x)
    }
    fn sqrt(self) -> Self {
        Self(libm::sqrtf(self.0))
    }
    fn exp2(self) -> Self {
        Self(libm::exp2f(self.0))
    }
    fn log2(self) -> Self {
        Self(libm::log2f(self.0))
    }
    fn line(self) -> [Self; 2] {
        let (sin, cos) = libm::sincosf(self.0);
        [Self(sin), Self(cos)]
    }
    fn below(self, other: Self) -> bool {
        self.0 < other.0
    }
    fn reaches(self, other: Self) -> bool {
        self.0 >= other.0
    }
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
}

impl Add for Libm {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

impl Sub for Libm {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
}

impl Mul for Libm {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0)
    }
}

impl Div for Libm {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        Self(self.0 / other.0)
    }
}

impl Neg for Libm {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}
